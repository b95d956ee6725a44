"""Write `references.json` without gapwalk, in some minutes: ``python -m tests.machines.compute_references [name ...]``.

Each orbit has its state at theta = 0 (coordinates, then dq/dt), amplitudes, multipliers, and the derivative of the
state by the frequency, also through loads that grow with it. `gap` is how far the state is from itself after the
cycles, and `error` the correction by Newton's method that a second run with five times shorter steps asks for.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np

from tests.machines import balance, beam, closed_forms
from tests.machines.equations import MACHINES
from tests.machines.shooting import find, integrate, measures

FILE = Path(__file__).with_name("references.json")

# machine: (frequency, first guess, other values of parameters, cycles, remark)
ORBITS = {
    "duffing": [
        (0.8, [0.473, 0.040], {}),
        (1.25, [0.7355, 3.206], {}, 1, "upper branch"),
        (1.25, [-0.32, 0.045], {}, 1, "lower branch"),
        (1.0, [0.683, 0.192], {"k": 1.0, "a": 2.0, "c": 0.16, "F": 0.5}, 1, "SKHiPPR examples/duffing.py"),
        (1.3, [0.23, 0.851], {"k": 1.0, "a": 3.0, "c": 1.0, "F": 1.0}, 1, "SKHiPPR test/conftest.py"),
        (0.8, [2.568, 0.203], {"k": 1.0, "a": 0.2, "c": 0.1, "F": 3.0}, 1, "SKHiPPR test/test_bif_curve.py"),
        (0.3, [0.234, -0.0062], {"k": 0.5, "a": 3.0, "c": 0.05, "F": 0.1}, 1, "Bayer and Leine, figure 10"),
        (5.0, [-0.005, 0.0], {"k": 5.0, "a": 0.1, "c": 0.02, "F": 0.1}, 1, "Bayer and Leine, figure 9"),
        (1.2, [1.0523, 0.0934], {"k": -1.0, "a": 1.0, "c": 0.3, "F": 0.37}, 5, "SKHiPPR: five cycles"),
    ],
    "two_cubic": [
        (0.9, [0.419, 0.785, 0.151, 1.161], {}),
        (1.03, [0.216, -1.168, 0.554, 2.208], {}),
        (1.3, [-0.183, 0.135, 0.028, -0.213], {}),
    ],
    "unilateral": [
        (0.6, [0.982, 0.641, 0.169, 0.060], {}, 1, "unstable, beyond the Neimark-Sacker bifurcation"),
        (0.635, [0.961, 0.658, 0.317, 0.086], {}),
        (0.72, [-0.348, -0.167, 0.014, 0.009], {}, 1, "no contact"),
    ],
    "cubic_chain": [
        (0.95, [0.403, 0.366, 0.028, 0.027], {}),
        (1.05, [0.909, 0.996, 0.238, 0.245], {}),
        (1.8, [-0.231, 0.184, 0.089, -0.087], {}),
    ],
    "geometric": [
        (1.16, [-0.0073, 0.0002, 0.0003, 0.0], {"F": 5e-4}),
        (1.133, [-0.0787, 0.0003, 0.0495, -0.0131], {"F": 5e-4}),
        (1.13, [-0.1250, -0.0271, 0.1671, -0.0492], {"F": 1e-3}),
        (1.08, [0.0265, 0.002, 0.0007, 0.0], {"F": 3e-3}, 1, "lower branch"),
    ],
    "three_masses": [
        (0.5, [0.578, 0.605, 0.062, -0.281, 0.073, -0.167], {}, 1, "unstable by little"),
        (1.5, [-1.718, 0.195, 0.361, -2.835, 0.859, 2.178], {}),
        (2.2, [-0.195, 0.449, -0.784, -0.058, 0.289, -0.268], {}),
    ],
    "van_der_pol": [
        (0.8, [2.65, 0.471], {}),
        (1.0, [-0.504, 3.099], {}),
        (1.3, [-1.405, -0.293], {}),
        (1.4, [-0.998, -0.286], {}, 1, "unstable, beyond the Neimark-Sacker bifurcation"),
    ],
    "truss": [
        (3.0, [1.027, 0.001], {}),
        (5.0, [1.032, 0.004], {}),
        (5.0, [-0.958, 0.006], {}, 1, "the other well"),
        (10.0, [0.986, 0.9625], {"G": 0.5}, 1, "a resonance of the well"),
    ],
    "helmholtz_duffing": [(0.5, [0.248, -0.267], {}), (0.9, [0.884, 0.197], {}), (1.2, [-0.473, 0.055], {})],
    "mathieu": [
        (0.7, [0.216, 0.008], {}),
        (1.9, [-0.03, 0.002], {}, 1, "unstable, in the tongue of flips"),
        (2.3, [-0.0185, 0.001], {}),
    ],
    "meissner": [
        (0.7, [0.199, 0.009], {}),
        (1.87, [-0.035, 0.002], {}),
        (2.0, [-0.03, 0.002], {}, 1, "unstable, in the tongue of flips"),
        (2.3, [-0.02, 0.001], {}),
    ],
    "truncated_meissner": [(1.5, [0.0, 0.0], {}, 1, "unstable"), (2.3, [0.0, 0.0], {}), (3.1, [0.0, 0.0], {})],
    "mathieu_stop": [
        (0.95, [-0.140, 1.042], {"F": 0.01}),
        (1.0, [-0.237, 1.115], {"F": 0.01}),
        (1.05, [-0.348, 1.212], {"F": 0.01}),
    ],
    "pendulum": [(0.95, [1.26, -0.405], {}), (1.0, [1.041, -0.318], {}), (1.05, [0.757, -0.221], {})],
    "gear_load": [
        (0.6, [1.152, 0.006], {}, 1, "no loss of contact"),
        (0.75, [1.22, 0.015], {}, 1, "lower branch, a short loss of contact"),
        (0.75, [0.72, 0.12], {}, 1, "upper branch of the softening jump"),
        (0.9, [0.813, 0.066], {}, 1, "loss of contact"),
    ],
    "gear_error": [
        (0.6, [1.202, 0.006], {}, 1, "no loss of contact"),
        (0.75, [1.27, 0.015], {}, 1, "lower branch, a short loss of contact"),
        (0.75, [0.77, 0.12], {}, 1, "upper branch of the softening jump"),
        (0.9, [0.863, 0.066], {}, 1, "loss of contact"),
    ],
    "gear_rectangle": [(0.75, [0.745, 0.1475], {}), (0.9, [0.819, 0.082], {}), (1.2, [0.931, 0.031], {})],
    "rotor_stop": [
        (0.6, [0.053, -0.002, 0.003, 0.021], {}, 1, "no contact"),
        (1.0, [0.441, -0.022, 0.496, 0.092], {}),
        (1.2, [-0.140, -0.009, 0.697, 0.485], {}),
        (1.4, [-0.717, -0.617, 1.213, 0.889], {}),
    ],
    "rotor_annulus": [
        (0.6, [0.056, -0.305, 0.003, 0.033], {}, 1, "no contact"),
        (0.9, [0.3455, -0.3483, 0.0973, 0.1792], {}, 1, "unstable"),
        (1.2, [0.522, -0.2636, 0.0801, 0.5728], {}, 1, "unstable"),
    ],
    "base": [
        (0.6, [0.156, 0.001], {}, 1, "no contact"),
        (0.9, [0.512, 0.07], {}, 1, "no contact"),
        (1.0, [0.6153, 0.2395], {}),
        (1.1, [0.6444, 0.4030], {}),
    ],
    "hertz": [
        (0.8, [1.456, 0.028], {}, 1, "no loss of contact"),
        (1.1, [1.8727, 2.1456], {}, 1, "both contacts"),
        (1.2, [-0.144, 0.539], {}),
    ],
    "drag": [(0.6, [0.777, 0.041], {}), (1.0, [-0.011, 1.712], {}), (1.5, [-0.394, 0.069], {})],
}


def numbers(array):
    """Plain numbers for the file."""
    return [float(x) for x in np.ravel(array)]


def orbit(name, w, guess, changes, cycles=1, remark=""):
    """One orbit of a machine, as the file has it."""
    machine = MACHINES[name]
    state, path, gap = find(machine, w, guess, changes, cycles)
    size = len(state)
    again = integrate(machine, state, w, machine.parameters | changes, cycles, steps=1000, rtol=3e-14)
    error = np.linalg.solve(np.eye(size) - again.transition, again.end - state)
    slope = np.linalg.solve(np.eye(size) - path.transition, path.slope)
    multipliers = np.linalg.eigvals(path.transition)
    multipliers = multipliers[np.lexsort((multipliers.imag, multipliers.real, -np.abs(multipliers)))]
    found = {"frequency": w, "cycles": cycles, "parameters": machine.parameters | changes, "state": numbers(state)}
    found |= {
        "multipliers": [[float(m.real), float(m.imag)] for m in multipliers],
        "slope_by_frequency": numbers(slope),
    }
    found |= measures(machine, state, path, cycles)
    found |= {"switches": len(path.events), "gap": float(gap), "error": float(np.max(np.abs(error)))}
    return found | ({"remark": remark} if remark else {})


def nonlinear_modes():
    """Free motions of `cubic_chain` without damping (NLvib 04): displacements at rest, whose period is 2 pi / W."""
    machine = MACHINES["cubic_chain"]
    p = machine.parameters | {"F": 0.0, "c": 0.0}
    found, q = [], np.zeros(2)
    steps = [(w, None) for w in np.linspace(1.05, 1.2, 16)]  # in phase, along the branch
    for w, guess in [(1.05, [0.76, 0.84]), *steps[1:], (1.8, [1.08, -0.86])]:
        q = q if guess is None else np.array(guess)
        for _ in range(30):
            path = integrate(machine, [*q, 0.0, 0.0], w, p, cycles=0.5)
            change = np.linalg.solve(path.transition[2:, :2], path.end[2:])
            q = q - change
            if np.max(np.abs(change)) < 1e-14:
                break
        if guess is None and round(100 * w) not in (110, 120):
            continue
        energy = 0.5 * q @ np.array([[2.0, -1.0], [-1.0, 2.0]]) @ q + p["a"] * q[0] ** 4 / 4
        rest = float(np.max(np.abs(path.end[2:])))
        found.append({"frequency": float(w), "state": [*numbers(q), 0.0, 0.0], "energy": float(energy), "gap": rest})
    return found


def limit_cycles():
    """Free van der Pol oscillators: the largest displacement, the period and the multiplier that is not 1."""
    machine = MACHINES["van_der_pol"]
    found = []
    for mu in (0.05, 0.1, 0.2, 0.8, 1.5):
        p = machine.parameters | {"mu": mu, "F": 0.0}
        x = np.array([2.0, 1.0 - mu**2 / 16])
        for _ in range(30):
            path = integrate(machine, [x[0], 0.0], x[1], p)
            jacobian = np.column_stack((path.transition[:, 0] - [1.0, 0.0], path.slope))
            change = np.linalg.solve(jacobian, path.end - [x[0], 0.0])
            x = x - change
            if np.max(np.abs(change)) < 1e-14:
                break
        multiplier = float(np.linalg.det(path.transition))
        found.append({"mu": mu, "amplitude": float(x[0]), "period": 2 * np.pi / float(x[1]), "multiplier": multiplier})
    return found


def peaks():
    """Peaks of NLvib 06, by harmonic balance with its 7 harmonics and with 15."""
    found = {}
    for level in (3e-4, 5e-4, 1e-3, 3e-3):
        for harmonics, samples in ((7, 29), (15, 128)):
            system = balance.geometric(level, harmonics, samples)
            best = system.peaks(1.6, 0.8, 0.005, max(0.01, 30 * level), balance.order_one())
            found[f"F={level}, H={harmonics}"] = {"amplitude": best[0][0], "frequency": best[0][1]}
    return found


def main(names):
    """Compute all, or the machines that are named."""
    old = json.loads(FILE.read_text()) if FILE.exists() else {"orbits": {}}
    machines = {name: {"equation": m.acceleration.__doc__, "parameters": m.parameters} for name, m in MACHINES.items()}
    new = {"about": __doc__, "machines": machines, "orbits": dict(old["orbits"]), "others": dict(old.get("others", {}))}
    others = {
        "closed_forms": closed_forms.all_of_them,
        "nonlinear_modes": nonlinear_modes,
        "limit_cycles": limit_cycles,
        "peaks_of_geometric": peaks,
        "beam": beam.orbits,
    }
    for name in names or [*ORBITS, *others]:
        if name in others:
            new["others"][name] = others[name]()
        else:
            new["orbits"][name] = [orbit(name, *case) for case in ORBITS[name]]
            worst = max(max(o["gap"], o["error"]) for o in new["orbits"][name])
            print(f"{name}: {len(new['orbits'][name])} orbits, {worst:.1e}", flush=True)
        FILE.write_text(json.dumps(new, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])

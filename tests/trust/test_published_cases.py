"""Numbers from public reports, published analyses and other programs, and what gapwalk computes in their place.

Each case computes some numbers, which follow it in the table with the largest difference that is allowed. How a number
is known stands beside it: a closed form, an independent integration, or the program that printed it.
"""

import math
from collections.abc import Callable, Sequence

import numpy as np
import pytest
import scipy.linalg

import gapwalk as gw

Case = tuple[Callable[[], Sequence[float]], Sequence[float], float]


def driven(
    stiffness: float, damping: float, *contacts, force: float = 1.0, frequency: float = 1.0, **more
) -> gw.System:
    """A mass of 1 on a spring under a harmonic force."""
    return gw.System(
        ["x"], [[stiffness]], [[damping]], contacts=contacts, harmonics=[gw.Harmonic(force, {"x": 1.0})],
        frequency=frequency,
    )  # fmt: skip


def spring(law: str, **numbers: float) -> gw.Contact:
    """A spring whose force is a formula."""
    return gw.force("spring", {"x": 1.0}, law, **numbers)


def stop(clearance: float, restitution: float) -> gw.Contact:
    """A rigid stop on the positive side."""
    return gw.rigid_stop("stop", {"x": 1.0}, clearance, restitution=restitution, side="positive")


def values(branch: gw.Branch, kind: str) -> list[float]:
    """Where a branch has special points of a kind."""
    return [point.value for point in branch.special(kind)]


def falling_friction() -> list[float]:
    contacts = [gw.friction("dry", {"x": 1.0}, 1.0), spring("-Fs*d*v/(1+d*abs(v))", Fs=1.0, d=1.0)]
    system = driven(1.0, 0.05, *contacts, force=1.2, frequency=0.5)
    return [gw.settle(system, **{"harmonic1.amplitude": force}).orbit.measure("max.x") for force in (1.2, 2.0)]


def belt_cycle() -> list[float]:
    contacts = [gw.friction("belt", {"x": 1.0}, 1.0, speed=0.2), spring("-d*(v-vb)/(1+d*abs(v-vb))", d=3.0, vb=0.2)]
    system = gw.System(["x"], [[1.0]], mass=[[1.0]], contacts=contacts)
    orbit = gw.free.find_self_excited(system, start=[0.0, 0.1])
    return [orbit.duration, orbit.measure("max.x")]


def stop_without_clearance() -> list[float]:
    settled = gw.settle(driven(1.0, 0.2, stop(0.0, 0.8), frequency=2.5))
    return values(gw.follow(settled.orbit, "frequency", (2.4, 2.75)), "flip")


def period_adding() -> list[float]:
    edge = abs(1 - 4 + 5j)
    system, found = driven(1.0, 2.5, stop(1.0, 0.8), force=edge, frequency=2.0), list[float]()
    for periods, beyond, right in ((2, 3e-2, 0.01466305), (3, 2e-3, 0.0006813355), (4, 8e-5, 2.998211e-05)):
        orbit = gw.settle(system, **{"harmonic1.amplitude": edge * (1 + beyond)}).orbit
        assert orbit.period == periods
        walk = gw.follow(orbit, "harmonic1.amplitude", (edge * (1 + beyond / 60), edge * (1 + beyond)))
        found += [(value / edge - 1) / right for value in values(walk, "flip")]
    return found


def exponents_at_a_stop() -> list[float]:
    system = driven(1.0, 0.4, stop(1.0, 0.8), force=3.135, frequency=2.0)
    return [sum(gw.analysis.lyapunov(gw.settle(system)).exponents)]


def meshing_stiffness() -> list[float]:
    system = gw.System(
        ["x"], [[0.0]], [[0.04]], mean={"x": 0.5}, contacts=[gw.backlash("mesh", {"x": 1.0}, 1.0, 1.0)],
        harmonics=[gw.Harmonic(0.2, varies="mesh.stiffness")], frequency=1.6,
    )  # fmt: skip
    return values(gw.follow(gw.find_orbit(system), "frequency", 2.3), "flip")


def locked_clutch() -> Sequence[float]:
    stiffness = [[100.0, 0, 0], [0, 400.0, -400.0], [0, -400.0, 400.0]]
    clutch = gw.friction("clutch", {"a": 1.0, "b": -1.0}, 50.0)
    system = gw.System(["a", "b", "c"], stiffness, mass=np.diag([1.0, 0.5, 2.0]), contacts=[clutch])
    return gw.find_modes(system, "stuck").frequencies


def locked_modes() -> Sequence[float]:
    squares = scipy.linalg.eigvalsh([[500.0, -400.0], [-400.0, 400.0]], np.diag([1.5, 2.0]))
    return np.sqrt(squares).tolist()


def double_wells() -> list[float]:
    counts = list[float]()
    for stiffness, law in ((-1.0, "k*x**3"), (0.0, "k*x**3 - x")):
        wells = [gw.force(f"f{name}", {name: 1.0}, law, k=1.0) for name in "ab"]
        system = gw.System(["a", "b"], stiffness * np.eye(2), 0.3 * np.eye(2), contacts=wells)
        counts.append(len(gw.find_equilibria(system).equilibria))
    return counts


def softening_duffing() -> list[float]:
    system = driven(1.0, 0.1, spring("-x**3"), force=0.05, frequency=0.5)
    return values(gw.follow(gw.find_orbit(system), "frequency", 1.5), "fold")


def bouncing_ball() -> list[float]:
    floor = gw.rigid_stop("floor", {"h": 1.0}, 0.0, restitution=0.8, side="negative")
    ball = gw.System(["h"], [[0.0]], [[0.0]], contacts=[floor], mean={"h": -9.81}, frequency=2 * np.pi)
    times = [event.theta / (2 * np.pi) for event in gw.integrate(ball, [1.0, 0.0], periods=5.0, samples=64).events]
    return [*times[:6], times[-1]]


def bounces() -> list[float]:
    first = math.sqrt(2 / 9.81)
    return [first * (1 + 2 * sum(0.8**n for n in range(1, count + 1))) for count in (*range(6), 400)]


def moving_base() -> list[float]:
    carried = gw.friction("dry", {"x": 1.0}, 0.3)
    base = gw.Harmonic(1.0, varies="dry.deflection")
    system = gw.System(["x"], [[0.0]], [[0.0]], contacts=[carried], harmonics=[base], frequency=1.0)
    return [gw.settle(system).orbit.measure("half.x")]


def damped_parametron() -> list[float]:
    forces = [gw.force("s", {"x": 1.0}, "k*x", k=1.0), gw.force("n", {"x": 1.0}, "x**3 + e*x*x*v", e=0.3)]
    pump = gw.Harmonic(0.02, varies="s.k", order=2, phase=np.pi)
    system = gw.System(["x"], [[0.0]], [[0.005]], contacts=forces, harmonics=[pump], frequency=0.95)
    rest = gw.follow(gw.find_orbit(system, start=[0.0, 0.0]), "frequency", 1.05)
    found = values(rest, "branch-point")
    for born in rest.special("branch-point"):  # from each of them the whole loop, once round
        loop = gw.follow(born, "frequency", (0.95, 1.05))
        assert loop.closed
        assert len(loop.special("branch-point")) == 1
        found += values(loop, "fold")
    return found


def unbalance_error() -> list[float]:
    stiffness, damping = np.array([[1, 0.35], [-0.3, 1.3]]), np.array([[0.2, 0.04], [-0.03, 0.25]])
    turning = gw.Harmonic(0.1, {"y": 1.0}, phase=-np.pi / 2, growth=2, name="y")
    loads = [gw.Harmonic(0.1, {"x": 1.0}, growth=2), turning]
    system = gw.System(["x", "y"], stiffness, damping, harmonics=loads, frequency=0.5)
    branch, largest = gw.follow(gw.find_orbit(system), "frequency", 2.0), 0.0
    for point in branch.points:
        w = point.value
        complex_ones = np.linalg.solve(
            stiffness - w * w * np.eye(2) + 1j * w * damping, 0.1 * w * w * np.array([1, -1j])
        )
        for name, amplitude in zip("xy", complex_ones, strict=True):
            largest = max(largest, abs(point.measure(f"half.{name}") - abs(amplitude)))
    return [largest]


def elastic_impacts() -> list[float]:
    found = list[float]()
    for clearance in (0.0, 0.1):
        orbit = gw.find_orbit(driven(1.0, 0.0, stop(clearance, 1.0), frequency=2.5), start=[-0.5, 0.0])
        found += [event.velocity for event in orbit.events] + [abs(np.prod(orbit.multipliers))]
    return found


def double_well_ramp() -> list[float]:
    system = driven(-1.0, 0.3, spring("x**3"), force=0.25, frequency=1.25)
    return values(gw.follow(gw.settle(system, start=[1.0, 0.0]).orbit, "harmonic1.amplitude", 0.3), "flip")


def nlvib_peak() -> list[float]:
    system = driven(1.0, 0.05, spring("0.1*x**3"), force=0.18, frequency=0.9)
    branch = gw.follow(gw.find_orbit(system), "frequency", 1.4, walk=gw.WalkOptions(largest_step=0.01))
    heights = branch.measure("rms.x")
    top = slice(heights.argmax() - 1, heights.argmax() + 2)
    places = np.array([point.arclength for point in branch.points[top]])
    curve = np.polynomial.Polynomial.fit(places, heights[top], 2)
    return [float(curve(curve.deriv().roots()[0]))]


def determinant() -> list[float]:
    orbit = gw.find_orbit(driven(1.0, 1.0, spring("3*x**3"), frequency=1.3))
    return [float(np.prod(orbit.multipliers).real)]


def linode_error() -> list[float]:
    branch = gw.follow(gw.find_orbit(driven(1.0, 1.0)), "stiffness.x.x", (0.05, 3.0))
    exact = [np.array([p - 1, 1]) / (p * p - 2 * p + 2) for p in branch.values]
    return [max(np.abs(point.orbit.state - right).max() for point, right in zip(branch.points, exact, strict=True))]


def compliant_floor() -> list[float]:
    floor = gw.stop("floor", {"q": 1.0}, clearance=0.0, stiffness=100.0, side="negative")
    ball = gw.System(["q"], [[0.0]], [[0.0]], contacts=[floor], mean={"q": -9.81}, frequency=2 * np.pi)
    heights = gw.integrate(ball, [0.9, 0.0], periods=2.0, samples=20000).signal("q")
    return [float(heights[8400]) + 0.1]


def peaks_of_two_masses() -> list[float]:
    springs = [gw.force("c1", {"a": 1.0}, "k*x**3", k=1.0), gw.force("c2", {"a": 1.0, "b": -1.0}, "k*x**3", k=0.0042)]
    system = gw.System(
        ["a", "b"], [[1.0453, -0.0453], [-0.0453, 0.0453]], [[0.015, -0.013], [-0.013, 0.013]], [1.0, 0.05],
        contacts=springs, harmonics=[gw.Harmonic(0.11, {"a": 1.0})], frequency=1.0,
    )  # fmt: skip
    branch = gw.follow(gw.find_orbit(system), "frequency", 1.06, walk=gw.WalkOptions(largest_step=0.01))
    return [float(branch.measure(f"rms.{name}").max()) for name in "ab"]


def periods_of_a_double_well() -> list[float]:
    labels = [
        gw.classify(driven(-1.0, 0.3, spring("x**3"), force=force, frequency=1.2), [1.0, 0.0]).label
        for force in (0.2, 0.28, 0.29, 0.37, 0.5, 0.65)
    ]
    return [0 if label == "chaos" else float(label.removeprefix("P")) for label in labels]


def one_impact() -> list[float]:
    orbit = gw.find_orbit(driven(1.0, 0.1, stop(1.0, 0.8)), start=[-0.98, 0.29])
    (impact,) = orbit.events
    return [0.8 * abs(impact.velocity), *values(gw.follow(orbit, "harmonic1.amplitude", 0.05), "fold")]


def impacts_at_resonance() -> list[float]:
    orbit = gw.find_orbit(driven(1.0, 0.0, stop(0.0, 0.8), frequency=2.0), start=[-4.0, -3.0])
    (impact,) = orbit.events
    return [abs(impact.velocity), float(np.prod(orbit.multipliers).real)]


def impact_pair() -> list[float]:
    box = gw.rigid_stop("box", {"y": 1.0}, 1.0, restitution=0.8, side="both")
    base = gw.Harmonic(0.3, varies="box.deflection", phase=np.pi, name="base")
    system = gw.System(["y"], [[0.0]], [[0.0]], contacts=[box], harmonics=[base], frequency=1.0)
    orbit = gw.find_orbit(system, start=[1.0337128, 0.81861595])
    return values(gw.follow(orbit, "base.amplitude", 0.05), "fold")


def shaken_table() -> list[float]:
    table = gw.rigid_stop("table", {"y": 1.0}, 0.0, restitution=0.5, side="positive")
    load = gw.Harmonic(1.2, {"y": 1.0}, name="f")
    ball = gw.System(["y"], [[0.0]], [[0.0]], mean={"y": 1.0}, contacts=[table], harmonics=[load], frequency=1.0)
    branch = gw.follow(gw.find_orbit(ball, start=[-6.15832, 1.06063]), "f.amplitude", (1.0, 1.2))
    above = gw.follow(gw.find_orbit(ball, start=[-6.15832, 1.06063]), "f.amplitude", 1.6)
    return [values(branch, "fold")[0], values(above, "flip")[0]]


def two_stops() -> list[float]:
    found = list[float]()
    for beta in (0.6, 0.8, 1.25):
        system = driven(1.0, 0.0, gw.friction("dry", {"x": 1.0}, 0.4), frequency=beta)
        found.append(values(gw.follow(gw.settle(system).orbit, "dry.limit", 0.9), "crossing-sliding")[0])
    return found


def without_two_stops(beta: float) -> float:
    """The friction below which x0 beta^2 > f, with Den Hartog's x0^2 = V^2 - (U f)^2."""
    v, u = 1 / (1 - beta**2), math.sin(math.pi / beta) / (beta * (1 + math.cos(math.pi / beta)))
    return beta**2 * abs(v) / math.sqrt(1 + beta**4 * u**2)


def sudden_chaos() -> list[float]:
    dry, law = gw.friction("dry", {"x": 1.0}, 1.5, speed=1.0), spring("a*(1-v) - b*(1-v)**3", a=1.5, b=0.45)
    system = driven(1.0, 0.0, dry, law, force=0.1, frequency=1.71)
    branch = gw.follow(gw.settle(system).orbit, "frequency", (1.706, 1.711))
    (graze,) = branch.special("grazing-sliding")
    assert graze.beyond.verdict == "chaos at once"
    return [graze.value]


CASES: dict[str, Case] = {
    # event-driven DOP853, written separately; Leine et al. (1998) for the belt
    "friction that falls with |v|": (falling_friction, [1.96630022243, 2.0767806884189], 1e-9),
    "a cycle on a belt": (belt_cycle, [12.00103129483, 1.13394467644], 1e-9),
    # closed in an impact code to 1e-13 (Thompson and Ghaffari; Shaw and Holmes)
    "a rigid stop at clearance 0": (stop_without_clearance, [2.6639447452], 1e-9),
    # period adding: the ratio of windows is exp(2 T c / 2); flips of P2, P3, P4
    "period adding": (period_adding, [1, 1, 1], 2e-7),
    "exponents of one impact a period": (exponents_at_a_stop, [2 * math.log(0.8) / math.pi - 0.4], 1e-6),
    # monodromy matrix of the Mathieu equation, DOP853
    "stiffness of a mesh": (meshing_stiffness, [1.9067865699, 2.0899477434], 1e-9),
    "modes of a locked clutch": (locked_clutch, locked_modes(), 1e-9),
    "rests of two double wells": (double_wells, [9, 9], 0),
    # DOP853 and a root finder
    "softening Duffing": (softening_duffing, [0.8927792130704338, 0.8627056000598479], 1e-10),
    "bouncing ball": (bouncing_ball, bounces(), 2e-7),
    "friction on a moving base": (moving_base, [0.3 * math.pi**2 / 8], 1e-7),
    # DOP853; the tongue of rest and the folds of the loop from both of its ends
    "damped parametron": (damped_parametron, [0.995660530393382, 1.0043207212636736, *[1.02385551] * 4], 1e-8),
    "unbalance in cross-coupled bearings": (unbalance_error, [0.0], 1e-12),
    "elastic impacts": (elastic_impacts, [0.586225435652429, 1.0, 0.27845708193490376, 1.0], 1e-12),
    "flips of a double well": (double_well_ramp, [0.2876966971], 1e-9),
    # NLvib's example 1
    "peak of NLvib's Duffing": (nlvib_peak, [2.001518], 3e-6),
    "Liouville": (determinant, [math.exp(-2 * math.pi / 1.3)], 1e-14),
    "COCO's linear oscillator": (linode_error, [0.0], 1e-13),
    "Siconos's ball": (compliant_floor, [0.134758], 1e-12),
    # NLvib's example 2
    "peaks of NLvib's two masses": (peaks_of_two_masses, [0.41849, 1.71678], 3e-4),
    # SKHiPPR's example at .37; the known series of Duffing's double well, 0 for chaos
    "periods of a double well": (periods_of_a_double_well, [1, 2, 4, 5, 0, 2], 0),
    # COCO's impact oscillator by its own root of the equations of one impact; Budd and Dux (1994), 2 w / (w^2 - 1) / .2
    "one impact a period": (one_impact, [1.35658635008, 0.09997075362831], 1e-10),
    "impacts at resonance": (impacts_at_resonance, [20 / 3, 0.64], 1e-12),
    # one impact a period: pi g (1 - r) / (1 + r), and with 2 g (1 + r^2) / (1 + r)^2 at a right angle to it
    "shaken table": (shaken_table, [math.pi / 3, math.hypot(math.pi / 3, 10 / 9)], 1e-11),
    "Den Hartog's motions without stops": (two_stops, [without_two_stops(each) for each in (0.6, 0.8, 1.25)], 1e-10),
    # di Bernardo, Kowalczyk and Nordmark (2003): with Feeny and Moon's friction
    "sudden chaos by grazing-sliding": (sudden_chaos, [1.7077997], 5e-8),
    "impact pair": (impact_pair, [0.0705592284326684], 1e-12),
}  # fmt: skip


@pytest.mark.parametrize("name", CASES)
def test_published_numbers(name: str) -> None:
    compute, right, allowed = CASES[name]
    assert compute() == pytest.approx(right, rel=0.0, abs=allowed)

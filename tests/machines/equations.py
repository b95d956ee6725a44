"""The equations of motion of the machines in this folder, in plain NumPy: what `references.json` was computed with."""

from __future__ import annotations

import numpy as np

from tests.machines.shooting import Machine


def linear(mass, stiffness, damping):
    """The accelerations of linear springs and dampers, and the inverse of the mass matrix."""
    inverse = np.linalg.inv(np.array(mass, dtype=float))
    return inverse, inverse @ np.array(stiffness, dtype=float), inverse @ np.array(damping, dtype=float)


def duffing(theta, w, q, v, p, closed):
    """``x'' + c x' + k x + a x^3 = F cos``: NLvib 01, SKHiPPR's Duffing."""
    return p["F"] * np.cos(theta) - p["c"] * v - p["k"] * q - p["a"] * q**3


INVERSE2, K2, C2 = linear(
    np.diag([1, 0.05]), [[1.0453, -0.0453], [-0.0453, 0.0453]], [[0.015, -0.013], [-0.013, 0.013]]
)


def two_cubic(theta, w, q, v, p, closed):
    """NLvib 02."""
    first, between = p["a1"] * q[0] ** 3, p["a2"] * (q[0] - q[1]) ** 3
    force = np.stack((p["F"] * np.cos(theta) - first - between, between))
    return INVERSE2 @ force - K2 @ q - C2 @ v


K3 = np.array([[1.0, -1.0], [-1.0, 2.0]])


def unilateral(theta, w, q, v, p, closed):
    """NLvib 03."""
    wall = p["k"] * (q[0] - p["b"]) * closed[0]
    return np.stack((-wall, p["F"] * np.cos(theta) + 0 * q[1])) - K3 @ q - p["c"] * (K3 @ v)


K4 = np.array([[2.0, -1.0], [-1.0, 2.0]])


def cubic_chain(theta, w, q, v, p, closed):
    """NLvib 04; a force and damping, which it has not, are zero unless changed."""
    return np.stack((p["F"] * np.cos(theta) - p["a"] * q[0] ** 3, 0 * q[1])) - K4 @ q - p["c"] * (K4 @ v)


def geometric(theta, w, q, v, p, closed):
    """NLvib 06: two springs at right angles, in modal coordinates, to third order."""
    one, two, s = p["w1"] ** 2, p["w2"] ** 2, (p["w1"] ** 2 + p["w2"] ** 2) / 2
    x, y = q
    f1 = 1.5 * one * x**2 + two * x * y + 0.5 * one * y**2 + s * (x**3 + x * y**2)
    f2 = 0.5 * two * x**2 + one * x * y + 1.5 * two * y**2 + s * (x**2 * y + y**3)
    load = p["F"] * np.cos(theta)
    a1 = load - 2 * p["z1"] * p["w1"] * v[0] - one * x - f1
    a2 = load - 2 * p["z2"] * p["w2"] * v[1] - two * y - f2
    return np.stack((a1, a2))


K7 = np.array([[2.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 2.0]])


def three_masses(theta, w, q, v, p, closed):
    """NLvib 07 without its two friction elements."""
    second, between = q[1] ** 3, (q[2] - q[1]) ** 3
    stop = p["k"] * (q[2] - p["b"]) * closed[0]
    f = np.stack((0 * q[0], p["F"] * np.cos(theta) - p["a"] * second + p["a"] * between, -p["a"] * between - stop))
    return f - K7 @ q - 0.02 * (K7 @ v)


def van_der_pol(theta, w, q, v, p, closed):
    """``x'' - mu (1 - x^2) x' + x = F cos``."""
    return p["F"] * np.cos(theta) + p["mu"] * (1 - q**2) * v - q


def truss(theta, w, q, v, p, closed):
    """SKHiPPR's Truss with a harmonic force: ``x'' + c x' + k x (1 - l/sqrt(a^2 + x^2)) = F + G cos``."""
    return p["F"] + p["G"] * np.cos(theta) - p["c"] * v - p["k"] * q * (1 - p["l"] / np.sqrt(p["a"] ** 2 + q**2))


def helmholtz_duffing(theta, w, q, v, p, closed):
    """``x'' + c x' + x + a2 x^2 + a3 x^3 = F cos``."""
    return p["F"] * np.cos(theta) - p["c"] * v - q - p["a2"] * q**2 - p["a3"] * q**3


def mathieu(theta, w, q, v, p, closed):
    """``x'' + 2 z x' + (1 + e cos theta) x = F cos theta``."""
    return -2 * p["z"] * v - (1 + p["e"] * np.cos(theta)) * q + p["F"] * np.cos(theta)


def meissner(theta, w, q, v, p, closed):
    """``x'' + 2 z x' + (1 + e sgn cos theta) x = F cos theta``."""
    return -2 * p["z"] * v - (1 + p["e"] * (1 if closed[0] else -1)) * q + p["F"] * np.cos(theta)


def truncated_meissner(theta, w, q, v, p, closed):
    """SKHiPPR's TruncatedMeissner with five harmonics: orders 1, 3 and 5 of the rectangle."""
    g = 4 / np.pi * (np.cos(theta) - np.cos(3 * theta) / 3 + np.cos(5 * theta) / 5)
    return -p["d"] * v - (p["a"] + p["b"] * g) * q + p["F"] * np.cos(theta)


def mathieu_stop(theta, w, q, v, p, closed):
    """Mathieu's oscillator with a stop on one side; a cycle of theta is two of the stiffness."""
    stop = p["ks"] * (q - p["b"]) * closed[0]
    return -2 * p["z"] * v - (1 + p["e"] * np.cos(2 * theta)) * q - stop + p["F"] * np.cos(theta)


def pendulum(theta, w, q, v, p, closed):
    """Pendulum, pivot moved vertically at 2 W: ``x'' + c x' + (1 + a (2 W)^2 cos 2 theta) sin x = 0``."""
    return -p["c"] * v - (1 + p["a"] * (2 * w) ** 2 * np.cos(2 * theta)) * np.sin(q)


def gear_load(theta, w, q, v, p, closed):
    """Spur gear pair in the dynamic transmission error: ``q'' + 2 z q' + k(theta) f(q) = Fm + e W^2 cos theta``."""
    k = 1 + p["kappa"] * np.cos(theta + p["phase"])
    gap = (q - p["b"]) * closed[0] + (q + p["b"]) * closed[1]
    return p["Fm"] + p["e"] * w**2 * np.cos(theta) - 2 * p["z"] * v - k * gap


def gear_load_guards(theta, w, q, v, p):
    """The flanks of `gear_load`."""
    return q[0] - p["b"], -p["b"] - q[0]


def gear_error(theta, w, q, v, p, closed):
    """`gear_load` in the motion y = q + e cos theta of the wheels against each other."""
    k = 1 + p["kappa"] * np.cos(theta + p["phase"])
    x, rate = q - p["e"] * np.cos(theta), v + p["e"] * w * np.sin(theta)
    gap = (x - p["b"]) * closed[0] + (x + p["b"]) * closed[1]
    return p["Fm"] - 2 * p["z"] * rate - k * gap


def gear_error_guards(theta, w, q, v, p):
    """The flanks of `gear_error`."""
    x = q[0] - p["e"] * np.cos(theta)
    return x - p["b"], -p["b"] - x


def gear_rectangle(theta, w, q, v, p, closed):
    """`gear_load` with a rectangular mesh stiffness of mean 1: 1 + kappa during a share of each mesh cycle."""
    low = 1 - p["kappa"] * p["share"] / (1 - p["share"])
    k = 1 + p["kappa"] if closed[2] else low
    gap = (q - p["b"]) * closed[0] + (q + p["b"]) * closed[1]
    return p["Fm"] + p["e"] * w**2 * np.cos(theta) - 2 * p["z"] * v - k * gap


def gear_rectangle_guards(theta, w, q, v, p):
    """The flanks, and the edges of the rectangle."""
    return q[0] - p["b"], -p["b"] - q[0], np.cos(theta + p["phase"]) - np.cos(np.pi * p["share"])


def rotor_stop(theta, w, q, v, p, closed):
    """Unbalanced rotor on anisotropic bearings with cross-coupled damping, and a flat stop across (0.8, 0.6)."""
    stop = p["ks"] * (0.8 * q[0] + 0.6 * q[1] - p["b"]) * closed[0]
    a1 = p["e"] * w**2 * np.cos(theta) - 2 * p["z"] * v[0] - p["g"] * v[1] - q[0] - 0.8 * stop
    a2 = p["e"] * w**2 * np.sin(theta) - 2 * p["z"] * v[1] + p["g"] * v[0] - p["ky"] * q[1] - 0.6 * stop
    return np.stack((a1, a2))


def rotor_annulus(theta, w, q, v, p, closed):
    """Jeffcott rotor with weight in a round stator, which pushes radially where the radius exceeds the clearance."""
    stop = p["ks"] * (1 - p["b"] / np.sqrt(q[0] ** 2 + q[1] ** 2)) * closed[0] if closed[0] else 0.0
    a1 = p["e"] * w**2 * np.cos(theta) - 2 * p["z"] * v[0] - q[0] - stop * q[0]
    a2 = p["e"] * w**2 * np.sin(theta) - 2 * p["z"] * v[1] - q[1] - stop * q[1] - p["weight"]
    return np.stack((a1, a2))


def base(theta, w, q, v, p, closed):
    """Oscillator on a base u = a cos theta, with a stop fixed to the base; x is the absolute displacement."""
    x, rate = q - p["a"] * np.cos(theta), v + p["a"] * w * np.sin(theta)
    return -2 * p["z"] * rate - x - p["ks"] * (x - p["b"]) * closed[0]


def base_guards(theta, w, q, v, p):
    """The stop of `base`."""
    return (q[0] - p["a"] * np.cos(theta) - p["b"],)


def power(x, exponent):
    """The odd function ``x |x|^(exponent - 1)``, also of complex numbers near the real line."""
    return x * (x * x) ** ((exponent - 1) / 2)


def hertz(theta, w, q, v, p, closed):
    """A mass between two Hertz contacts with clearance, pressed on one of them: a loaded ball bearing."""
    force = p["k"] * power(q - p["b"], 1.5) * closed[0] + p["k"] * power(q + p["b"], 1.5) * closed[1]
    return p["Fm"] + p["F"] * np.cos(theta) - p["c"] * v - force


def drag(theta, w, q, v, p, closed):
    """``x'' + x + d x' |x'| = F cos``: drag that grows with the square of the rate."""
    return p["F"] * np.cos(theta) - q - p["d"] * v * v * (1 if closed[0] else -1)


def stop_at(key="b", coordinate=0):
    """A guard: a coordinate less its clearance."""

    def guards(theta, w, q, v, p):
        return (q[coordinate] - p[key],)

    return guards


MACHINES = {
    "duffing": Machine(1, duffing, {"k": 1.0, "a": 0.1, "c": 0.05, "F": 0.18}),
    "two_cubic": Machine(2, two_cubic, {"a1": 1.0, "a2": 0.0042, "F": 0.11}),
    "unilateral": Machine(2, unilateral, {"k": 100.0, "b": 1.0, "c": 0.03, "F": 0.1}, stop_at()),
    "cubic_chain": Machine(2, cubic_chain, {"a": 0.5, "c": 0.01, "F": 0.1}),
    "geometric": Machine(2, geometric, {"w1": 1.13, "w2": 2.0, "z1": 1e-3, "z2": 5e-3, "F": 1e-3}),
    "three_masses": Machine(3, three_masses, {"a": 1.0, "k": 1.0, "b": 0.25, "F": 1.0}, stop_at(coordinate=2)),
    "van_der_pol": Machine(1, van_der_pol, {"mu": 0.2, "F": 1.0}),
    "truss": Machine(1, truss, {"k": 100.0, "c": 0.5, "F": 1.0, "a": 0.1, "l": 1.0, "G": 2.0}),
    "helmholtz_duffing": Machine(1, helmholtz_duffing, {"c": 0.04, "a2": 0.3, "a3": 0.1, "F": 0.2}),
    "mathieu": Machine(1, mathieu, {"z": 0.02, "e": 0.4, "F": 0.1}),
    "meissner": Machine(
        1, meissner, {"z": 0.02, "e": 0.2, "F": 0.1}, lambda theta, w, q, v, p: (np.cos(theta) + 0 * w,)
    ),
    "truncated_meissner": Machine(1, truncated_meissner, {"a": 0.2, "b": 1.0, "d": 0.02, "F": 0.1}),
    "mathieu_stop": Machine(1, mathieu_stop, {"z": 0.02, "e": 0.3, "ks": 10.0, "b": 1.0, "F": 0.0}, stop_at()),
    "pendulum": Machine(1, pendulum, {"c": 0.1, "a": 0.1}),
    "gear_load": Machine(
        1, gear_load, {"z": 0.05, "kappa": 0.2, "phase": np.pi, "b": 1.0, "Fm": 0.1, "e": 0.05}, gear_load_guards
    ),
    "gear_error": Machine(
        1, gear_error, {"z": 0.05, "kappa": 0.2, "phase": np.pi, "b": 1.0, "Fm": 0.1, "e": 0.05}, gear_error_guards
    ),
    "gear_rectangle": Machine(
        1,
        gear_rectangle,
        {"z": 0.05, "kappa": 0.2, "share": 0.6, "phase": np.pi, "b": 1.0, "Fm": 0.1, "e": 0.05},
        gear_rectangle_guards,
    ),
    "rotor_stop": Machine(
        2,
        rotor_stop,
        {"e": 0.1, "z": 0.05, "g": 0.1, "ky": 1.3, "ks": 10.0, "b": 0.5},
        lambda theta, w, q, v, p: (0.8 * q[0] + 0.6 * q[1] - p["b"],),
    ),
    "rotor_annulus": Machine(
        2,
        rotor_annulus,
        {"e": 0.1, "z": 0.05, "ks": 10.0, "b": 0.5, "weight": 0.3},
        lambda theta, w, q, v, p: (np.sqrt(q[0] ** 2 + q[1] ** 2) - p["b"],),
    ),
    "base": Machine(1, base, {"z": 0.02, "a": 0.1, "ks": 20.0, "b": 0.5}, base_guards),
    "hertz": Machine(1, hertz, {"k": 1.0, "b": 0.1, "c": 0.1, "Fm": 1.0, "F": 0.3}, gear_load_guards),
    "drag": Machine(1, drag, {"d": 0.2, "F": 0.5}, lambda theta, w, q, v, p: (v[0],)),
}

"""Systems whose tori are known in closed form: circles of self-excited oscillators beside a forced one.

``x'' + g(x^2 + x'^2) x' + x = 0`` has the circles ``x^2 + x'^2 = R`` with ``g(R) = 0`` as limit cycles, with the
frequency 1. Beside a forced linear oscillator they are tori, which strobes pass with the rotation number ``1 / W``.
"""

import math

import gapwalk as gw

SQRT5 = math.sqrt(5.0)


def circles(law: str, frequency: float = SQRT5, **numbers: float) -> gw.System:
    """Return the self-excited oscillator x with the damping ``law`` times v, beside a forced oscillator y."""
    return gw.System(
        ["x", "y"],
        mass=[1.0, 1.0],
        damping=[0.0, 0.2],
        stiffness=[1.0, 3.0],
        contacts=[gw.force("excitation", {"x": 1.0}, law=f"({law})*v", numbers=numbers)],
        harmonics=[gw.Harmonic(0.5, {"y": 1.0})],
        frequency=frequency,
    )


def one_circle(frequency: float = SQRT5) -> gw.System:
    """Return the system with the unit circle, to which its deviations contract with the mean rate 1."""
    return circles("x*x + v*v - 1", frequency)


def two_circles(a: float = 1.0) -> gw.System:
    """Return the system with circles at ``x^2 + v^2 = 2 +- sqrt(a)``, of which the outer one is stable."""
    return circles("(x*x + v*v - 2)*(x*x + v*v - 2) - a", a=a)


def nlvib_pair() -> gw.System:
    """Return the two masses with a stop of example 03 of NLvib (Krack and Gross 2019)."""
    return gw.System(
        ["a", "b"],
        stiffness=[[1.0, -1.0], [-1.0, 2.0]],
        damping=[[0.03, -0.03], [-0.03, 0.06]],
        contacts=[gw.stop("stop", {"a": 1.0}, clearance=1.0, stiffness=100.0)],
        harmonics=[gw.Harmonic(0.1, {"b": 1.0})],
    )

"""Branches pass a graze that touches at all angles at once: the annular rub, whose synchronous whirl is known."""

import numpy as np
import pytest
from scipy.optimize import brentq

import gapwalk as gw
from gapwalk.errors import ModelError

STIFFNESS, SOFTENED = 20.0, 1e-9  # of the ring; the latter keeps the root in the formula differentiable at the centre


def rotor(friction: float) -> gw.System:
    """A rotor with an unbalance, in a ring with a radial gap of 1."""
    numbers = {"k": STIFFNESS, "g": 1.0, "mu": friction, "e": SOFTENED}
    both, press = {"x": {"x": 1.0}, "y": {"y": 1.0}}, "k*max(1-g/sqrt(x*x+y*y+e),0)"
    return gw.System(
        ["x", "y"],
        mass=np.eye(2),
        stiffness=np.eye(2),
        damping=0.1 * np.eye(2),
        contacts=[
            gw.force("fx", both, f"{press}*(x-mu*y)", acts_on={"x": 1.0}, numbers=numbers),
            gw.force("fy", both, f"{press}*(y+mu*x)", acts_on={"y": 1.0}, numbers=numbers),
        ],
        harmonics=[
            gw.Harmonic(0.3, {"x": 1.0}, growth=2),
            gw.Harmonic(0.3, {"y": 1.0}, phase=-np.pi / 2, growth=2, name="uy"),
        ],
        frequency=0.8,
    )


def force_at(radius: float, speed: float, friction: float) -> float:
    """Force that turns with the rotor and holds it on a circle of this radius."""
    press = STIFFNESS * max(1.0 - 1.0 / np.sqrt(radius**2 + SOFTENED), 0.0) * (1.0 + 1j * friction)
    return abs(1.0 - speed**2 + 0.1j * speed + press) * radius


def graze() -> float:
    """Speed at which the free whirl just reaches the ring."""
    radius = np.sqrt(1.0 - SOFTENED)
    return float(brentq(lambda speed: force_at(radius, speed, 0.0) - 0.3 * speed**2, 0.7, 0.95, xtol=1e-15))


@pytest.mark.parametrize(("friction", "begin", "to"), [(0.1, 0.88, 0.886), (0.0, 0.95, 0.8)])
def test_a_rotor_that_comes_to_touch_all_around_goes_on_in_contact(friction: float, begin: float, to: float) -> None:
    """The graze is marked once, and every motion has the radius of the closed form, from either side."""
    system = rotor(friction)
    start = gw.find_orbit(system, frequency=begin, start="settle" if begin > 0.9 else "rest")
    branch = gw.follow(start, "frequency", to)
    assert branch.ends[-1].reason_words == "the end of the range was reached"
    (found,) = branch.special_points
    assert (found.kind, found.contact) == (gw.Kind.GRAZING, "fx and fy")
    assert abs(found.value - graze()) <= found.uncertainty < 1e-10
    assert found.beyond is not None
    assert found.beyond.verdict == "unknown"  # the theory of a touch does not say what lies beyond
    for point in branch.points:
        radius = float(np.hypot(*point.orbit.state[:2]))
        assert force_at(radius, point.value, friction) == pytest.approx(0.3 * point.value**2, abs=1e-11)
    assert not branch.unexplained
    flutters = found.after if begin < to else found.before
    assert flutters.pairs == (1 if friction else 0)  # friction drives the whirl backwards
    with pytest.raises(ModelError, match="at all angles at once"):
        gw.follow_locus(found, "frequency", "fx.g", ((0.8, 1.0), (0.9, 1.1)))

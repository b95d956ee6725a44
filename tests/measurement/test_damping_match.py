"""Matching impact damping to viscous dampers: closed form, energy, and computed motions (paper, section 4)."""

import math
from dataclasses import replace

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.errors import ModelError
from gapwalk.model import Contact, Harmonic, Side, Stage, System
from tests.systems import clutch, linear

C = 0.05


def held(mean: float = 2.0, load: float = 0.1, frequency: float = 0.8) -> System:
    """A mass on a one-sided spring that a load holds closed, with Hunt and Crossley's damping."""
    stop = Contact(
        "stop", {"x": 1.0}, (Stage(0.5, 1.0, side=Side.POSITIVE),), None, "hunt-crossley", {"impact_damping": 0.1}
    )
    return System(
        ("x",), [[0.0]], contacts=[stop], mean={"x": mean}, harmonics=[Harmonic(load, {"x": 1.0})], frequency=frequency
    )


def test_a_closed_contact_needs_the_damper_over_its_static_force() -> None:
    """While it does not open, ``integral of |g| sin^2`` is pi times the mean force."""
    assert gw.measure.find_impact_damping(held(), C, 0.3, mean=2.5) == pytest.approx(C / 2.0, rel=1e-13)
    two = gw.paper.case("5")
    assert gw.measure.find_impact_damping(two, C, 0.1, "stage2", mean=3.0) == pytest.approx(C / 2.0, rel=1e-13)


def test_a_contact_that_opens_costs_the_same_as_the_damper() -> None:
    stop = Contact("stop", {"x": 1.0}, (Stage(0.5, 3.0),), None, "elastic")
    beta = gw.measure.find_impact_damping(stop, C, 1.3)
    matched = replace(stop, law="hunt-crossley", impact_damping=beta)
    loop = gw.analysis.hysteresis(matched, 1.3, frequency=0.7)
    assert loop.loss == pytest.approx(math.pi * C * 0.7 * 1.3**2, rel=1e-12)


def test_small_motions_match_as_one_harmonic_says() -> None:
    """Dampers beside the contact, and a harmonic motion: both ways agree but for terms of second order."""
    differences = []
    for load in (0.1, 0.05):
        impact = held(load=load)
        viscous = gw.find_orbit(impact.at({"damping.x.x": C, "stop.impact_damping": 0.0}))
        found = gw.measure.match_impact_damping(viscous, impact)
        assert found.astray < 1e-14
        assert found.viscous_damping == pytest.approx(C, rel=1e-12)
        assert found.one_harmonic == pytest.approx(C / 2.0, rel=1e-9)
        assert found.one_harmonic_share == pytest.approx(1.0, abs=1e-12)
        amplitude = load / math.hypot(1 - 0.64, C * 0.8)
        assert (found.amplitude, found.mean) == pytest.approx((amplitude, 2.5), rel=1e-9)
        differences.append(abs(found.impact_damping / found.one_harmonic - 1.0))
        assert found.difference < 0.1
    assert differences[0] < 0.05
    assert differences[0] / differences[1] == pytest.approx(4.0, rel=0.2)


def test_a_viscous_contact_is_a_damper_while_it_is_closed() -> None:
    impact = held()
    contact = Contact(
        "stop", {"x": 1.0}, (Stage(0.5, 1.0, side=Side.POSITIVE),), None, "viscous", {"viscous_damping": C}
    )
    viscous = System(("x",), [[0.0]], contacts=[contact], mean={"x": 2.0}, harmonics=[Harmonic(0.1, {"x": 1.0})])
    found = gw.measure.match_impact_damping(gw.find_orbit(viscous, frequency=0.8), impact)
    assert found.viscous_damping == pytest.approx(C, rel=1e-9)
    assert found.one_harmonic == pytest.approx(C / 2.0, rel=1e-9)


def test_the_computed_match_is_the_nearest_motion() -> None:
    """No other coefficient gives an acceleration as near, and the record is not of one harmonic."""
    viscous = gw.settle(gw.paper.case("6"), frequency=0.45).orbit
    assert viscous is not None
    found = gw.measure.match_impact_damping(viscous, gw.paper.case("5"))
    assert found.one_harmonic_share < 0.999

    def apart(beta: float) -> float:
        system = found.impact.system.at({"stage2.impact_damping": beta})
        pair = gw.analysis.contrast(viscous, gw.find_orbit(system, start=found.impact.state), ["q1''"]).pairs[0]
        assert pair.agreement is not None
        return pair.agreement.relative

    best = apart(found.impact_damping)
    assert best == pytest.approx(found.difference, rel=1e-3)
    assert best < min(apart(0.98 * found.impact_damping), apart(1.02 * found.impact_damping))
    assert best < apart(found.one_harmonic)
    assert found.contrast(("q1''",)).names == ("viscous damping", "impact damping")


def test_the_papers_dampers_are_not_beside_the_clutch() -> None:
    """C21 = 0.04 acts on q3, where n2 / n1 = 0.6 would ask for 0.024: a quarter of them acts elsewhere."""
    found = gw.measure.match_impact_damping(gw.find_orbit(gw.paper.case("6"), frequency=1.5), gw.paper.case("5"))
    unit, more = np.array([1.0, -0.6]), np.array([0.04, -0.04])
    assert found.viscous_damping == pytest.approx(more @ unit / (unit @ unit), rel=1e-12)
    rest = more - found.viscous_damping * unit
    assert found.astray == pytest.approx(np.linalg.norm(rest) / np.linalg.norm(more), rel=1e-12)
    assert found.impact_damping == pytest.approx(found.one_harmonic, rel=0.05)


def test_what_cannot_be_matched_is_refused() -> None:
    with pytest.raises(ModelError, match=r"does not close under a deflection of 0 \+- 0.2"):
        gw.measure.find_impact_damping(held(), C, 0.2)
    bare = clutch().at(frequency=1.5)
    with pytest.raises(ModelError, match="differ in their coordinates or contacts"):
        gw.measure.match_impact_damping(gw.find_orbit(linear()), bare)
    none = System(("x",), [[1.0]], contacts=[Contact("stop", {"x": 1.0}, (Stage(0.5),))])
    with pytest.raises(ModelError, match="has the force law 'elastic'; give it impact damping"):
        gw.measure.find_impact_damping(none, C, 1.0)

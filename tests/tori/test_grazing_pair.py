"""Tori of two masses and a stop, example 03 of NLvib, at both of their Neimark-Sacker points.

One point is next to the resonance 1:4, the other one 1e-6 beside a graze. Long simulations confirm how each ends.
"""

from functools import cache

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.attractors.rotation import rotation
from gapwalk.attractors.section import Strobe
from gapwalk.tori.torus_family import TorusEndReason, TorusEventKind
from tests.tiers import in_campaign
from tests.tori.closed_forms import nlvib_pair

EVENTS = TorusEventKind


@cache
def point(near):
    """The Neimark-Sacker point of the branch of period 1 next to a frequency."""
    branch = gw.follow(gw.find_orbit(nlvib_pair(), frequency=near + 0.008), "frequency", near - 0.002)
    (found,) = branch.special(gw.Kind.NEIMARK_SACKER)
    return found


def simulated(frequency, start, settling=12_000, kept=6_000):
    """The last strobes of a long simulation."""
    states = gw.analysis.strobe(nlvib_pair().at(frequency=frequency), start, settling + kept).states
    return states[-kept:]


def closings(frequency, start, settling, kept):
    """How often the stop closes in each period of a long simulation."""
    strobe = Strobe(nlvib_pair().at(frequency=frequency))
    arcs = (strobe.arc(state) for state in strobe.run(start, settling + kept)[-kept:])
    return [sum(event.enters for event in arc.contacts) for arc in arcs]


def repeats(strobes, period):
    """True if strobes repeat after a period, and not after less."""
    apart = [np.abs(strobes[each:] - strobes[:-each]).max() for each in range(1, period + 1)]
    return apart[-1] < 1e-10 < min(apart[:-1])


@pytest.mark.slow
def test_beside_the_resonance_1_4_tori_end_on_the_locked_motion():
    start = point(0.6186)
    assert start.value == pytest.approx(0.6186068743, abs=1e-9)
    family = gw.tori.follow_tori(start, "frequency", (0.6, 0.63))
    end = family.ends[1]
    assert end.reason is TorusEndReason.RESONANCE
    assert "approaches 1/4; period 4, stable" in end.detail
    assert end.value == pytest.approx(0.61852039, abs=2e-8)
    assert all(each.torus.stable for each in family.points)
    some = family.points[len(family.points) // 2]
    met = rotation(simulated(some.value, some.torus.state()))
    assert met is not None
    assert met.number == pytest.approx(some.torus.rotation, abs=1e-8)
    # just below its last torus, the motion that was on it goes to period 4
    last = family.points[-1].torus.state()
    assert repeats(simulated(end.value - 1e-7, last), 4)


@pytest.mark.slow
@pytest.mark.parametrize("long", [(2_000, 2_000), in_campaign((12_000, 6_000))])
def test_beside_a_graze_tori_are_followed_from_the_smallest(long):
    start = point(0.5819)
    family = gw.tori.follow_tori(start, "frequency", (0.5818, 0.581901))
    first, last = family.points[0], family.points[-1]
    assert first.torus.size < 2e-5
    assert not first.torus.grazes
    assert last.value == pytest.approx(0.581901, abs=1e-12)
    (graze,) = [each for each in family.events if each.kind is EVENTS.GRAZING]
    assert {*closings(graze.value - 1e-8, last.torus.state(), *long)} == {1}
    assert {*closings(graze.value + 1e-8, last.torus.state(), *long)} == {0, 1}
    assert last.torus.grazes
    met = rotation(simulated(last.value, last.torus.state(), *long))
    assert met is not None
    assert met.number == pytest.approx(last.torus.rotation, abs=1e-7)
    # where no contact grazes along the torus, the rotation number is exact
    (smooth,) = [each for each in family.points if not each.torus.grazes][-1:]
    met = rotation(simulated(smooth.value, smooth.torus.state(), *long))
    assert met is not None
    assert met.number == pytest.approx(smooth.torus.rotation, abs=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("samples", [257, 513])
def test_beside_a_graze_the_family_ends_on_the_motion_of_period_7(samples):
    """On its way it leaps over windows such as that of 11/75, which is 2e-9 wide."""
    options = gw.tori.TorusOptions(max_samples=samples)
    family = gw.tori.follow_tori(point(0.5819), "frequency", (0.5, 0.8), options=options)
    end = family.ends[1]
    assert end.reason is TorusEndReason.RESONANCE
    assert "approaches 1/7; period 7, stable" in end.detail
    assert "a contact grazes along the torus (0 to 2 contact events)" in end.detail
    assert end.value == pytest.approx(0.58190183, abs=2e-8)
    assert EVENTS.RESONANCE in {each.kind for each in family.events}
    # each torus is one: motions from it turn by its rotation number
    for each in family.points:
        met = rotation(gw.analysis.strobe(each.torus.system, each.torus.state(), 8_000).states, 1)
        assert met is None or met.number == pytest.approx(each.torus.rotation, abs=1e-5)
    assert repeats(simulated(0.581902, family.points[-1].torus.state()), 7)

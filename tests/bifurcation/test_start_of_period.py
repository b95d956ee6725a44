"""Walks along which the impacts of a chatter pass the start of the period, one after the other."""

from __future__ import annotations

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.bifurcation.orbit_on_branch import Curve
from gapwalk.continuation.walk import EndReason
from gapwalk.flow.flow import Flow
from gapwalk.orbit.orbit import _more_flights
from tests.tiers import keeps


def teeth(amplitude: float, phase: float = 0.0, unit: float = 1.0) -> gw.System:
    """Rigid teeth that a mean load presses together, and a harmonic load lifts off; 140 impacts a period."""
    stop = gw.rigid_stop("teeth", {"x": 1.0}, 0.5 * unit, 0.9)
    load = gw.Harmonic(amplitude * unit, {"x": 1.0}, phase=phase, name="load")
    return gw.System(["x"], [[0.0]], [[0.6]], contacts=[stop], mean={"x": 0.4 * unit}, harmonics=[load], frequency=1.0)


@keeps("1000000000.0")
@pytest.mark.parametrize("unit", [1.0, 1e9])
def test_many_impacts_pass_the_start_in_one_step(unit: float) -> None:
    first = gw.settle(teeth(0.4385, unit=unit)).orbit
    assert first is not None
    before = Flow.calls
    branch = gw.follow(first, "load.amplitude", 0.4405 * unit, walk=gw.WalkOptions(0.1, largest_step=0.3))
    assert Flow.calls - before < 150
    assert branch.ends[-1].reason is EndReason.RANGE
    assert not branch.special_points
    last = gw.settle(teeth(0.4405, unit=unit)).orbit
    assert last is not None
    assert branch.points[-1].orbit.state == pytest.approx(last.state, abs=1e-9 * unit)
    (own,) = Curve(branch).orbits_at(0.43971 * unit)
    settled = gw.settle(teeth(0.43971, unit=unit)).orbit
    assert settled is not None
    assert own.state == pytest.approx(settled.state, abs=1e-9 * unit)


def test_flights_of_a_chatter_are_compared_one_by_one() -> None:
    """The end of a chatter moves by more than its last flights last; a graze splits one flight in two."""
    left = 0.9 ** np.arange(100.0)
    ours, drifted = left, 1.05 * left**1.02
    assert _more_flights([*ours], [*drifted]) == 0
    for place in (1, 40):
        split = np.insert(drifted, place, 0.6 * drifted[place - 1] + 0.4 * drifted[place])
        assert _more_flights([*ours], [*split]) == 1
        assert _more_flights([*split], [*ours]) == -1
    assert _more_flights([*ours], [*0.5 ** np.arange(20.0)]) is None  # other flights altogether


def test_no_graze_is_counted_where_the_end_of_a_chatter_drifts() -> None:
    first, last = (gw.settle(teeth(value, phase=-2.0)).orbit for value in (0.47575943, 0.47701893))
    assert first is not None
    assert last is not None
    assert first.closings != last.closings
    assert first.closing_changes(last) == (0,)

"""Branches of systems with friction and impacts, against numbers of other programs and closed forms."""

from __future__ import annotations

import math
from collections import Counter

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.bifurcation.branch import Branch
from gapwalk.bifurcation.detector import unexplained_of
from gapwalk.bifurcation.kinds.sliding import Sliding
from gapwalk.bifurcation.special_point import Kind
from gapwalk.continuation.walk import EndReason
from gapwalk.flow.flow import Flow, flow_of
from gapwalk.flow.friction_switches import DrySwitches
from gapwalk.model.coefficients import coefficients_of
from gapwalk.model.contact import Contact, Side, Stage
from gapwalk.model.loads import Harmonic
from gapwalk.model.system import System
from tests.dry import closed_forms
from tests.flow.dry_systems import clutch
from tests.tiers import in_campaign, keeps

# folds and flips of period 1 with friction .005, located by single shooting on another integrator (ten digits)
CLUTCH = {
    "flip": [1.3319237942, 1.2315204596, 0.7956394074, 0.6527108634, 0.4215829155, 0.3910381111],
    "fold": [0.6188807084, 0.6392503634, 0.4267694361, 0.4352821092, 0.3249850323, 0.3264588832],
}


def impacts(amplitude: float) -> System:
    """The impact oscillator of COCO's demo "impact"."""
    wall = Contact("wall", {"x": 1.0}, [Stage(1.0, side=Side.POSITIVE)], law="rigid", restitution=0.8)
    load = Harmonic(amplitude, {"x": 1.0}, name="load")
    return System(["x"], [[1.0]], [[0.1]], contacts=[wall], harmonics=[load], frequency=1.0)


def places(branch: Branch, kind: str) -> list[float]:
    return [each.value for each in branch.special_points if str(each.kind) == kind]


def test_the_clutch_with_friction_has_the_points_of_another_program() -> None:
    branch = gw.follow(gw.find_orbit(clutch(0.005)), "frequency", 0.15)
    assert branch.points[-1].value == pytest.approx(0.15)
    for kind, expected in CLUTCH.items():
        assert sorted(places(branch, kind)) == pytest.approx(sorted(expected), abs=1e-9)
    assert not places(branch, "neimark-sacker")


@pytest.mark.slow
@pytest.mark.parametrize(("phase", "first"), [(1.0, 0.7), in_campaign(2.5, 2.0)])
def test_the_points_do_not_depend_on_where_the_section_is(phase: float, first: float) -> None:
    """At the first phase a corner of grazing-sliding ends the steps; at the second the section falls into stick."""
    branch = gw.follow(gw.find_orbit(clutch(0.02, phase=phase), frequency=first), "frequency", 0.3)
    folds, flips = places(branch, "fold"), places(branch, "flip")
    assert branch.points[-1].value == pytest.approx(0.3)
    assert folds == pytest.approx([0.6180155557, 0.6381430507, 0.4268292830, 0.4375494545], abs=1e-9)
    expected = [each for each in (1.3319012039, 1.2421425130, 0.7844917143, 0.6491234235) if each < first]
    assert flips[: len(expected)] == pytest.approx(expected, abs=1e-9)
    assert places(branch, "grazing-sliding")[0] == pytest.approx(0.4325314254, abs=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize(("stiffness", "sliding", "calls"), [(None, 11, 2190), in_campaign(10.0, 22, 2790)])
def test_work_of_a_walk_with_friction_does_not_grow(stiffness: float | None, sliding: int, calls: int) -> None:
    """Guards the speed of the clutch with friction .02 by counting flow calls; without friction there are 1,662."""
    orbit = gw.find_orbit(clutch(0.02, stiffness=stiffness))
    before = Flow.calls
    branch = gw.follow(orbit, "frequency", 0.15)
    found = [each for each in branch.special_points if isinstance(each.kind, Sliding)]
    assert len(found) == sliding
    assert max(each.uncertainty for each in found) < 1e-6
    assert len(branch.points) < 340
    assert Flow.calls - before < calls


def test_each_end_of_slip_of_a_spring_is_decided_by_one_evaluation(monkeypatch: pytest.MonkeyPatch) -> None:
    """Guards the speed: no event without a change, no reading of all forces, and none at all where slip begins."""
    orbit, counts = gw.find_orbit(clutch(0.02, stiffness=10.0), frequency=0.35), Counter[str]()
    for name in ("at_slip", "decide", "read", "speed"):
        own = getattr(DrySwitches, name)

        def counted(self, *given, name=name, own=own):
            counts[name] += 1
            return own(self, *given)

        monkeypatch.setattr(DrySwitches, name, counted)
    arc = flow_of(orbit.system, "frequency", transition=True).integrate(coefficients_of(orbit.system), orbit.state)
    changes = len(arc.slips) - 1
    assert changes >= 4
    assert counts["at_slip"] == changes
    assert counts["decide"] == sum(not event.slip for event in arc.slips[1:])
    assert counts["read"] == 0
    assert counts["speed"] <= 3


def test_a_phase_that_vanishes_is_not_taken_for_another_one() -> None:
    """In a long step another phase is shorter than the one that vanishes; its margin jumps, and was taken for zero."""
    start = gw.find_orbit(clutch(0.02, stiffness=10.0), frequency=0.2246)
    branch = gw.follow(start, "frequency", 0.2222, walk=gw.WalkOptions(initial_step=0.3, largest_step=0.3))
    assert places(branch, "adding-sliding")[-1] == pytest.approx(0.2225777944, abs=1e-9)


def test_margins_cost_no_integration_of_their_own() -> None:
    orbit = gw.find_orbit(clutch(0.02), frequency=0.2)
    assert orbit.extremes.shape == (2, 4)
    before = Flow.calls
    assert {each.what for each in orbit.margins} == {"stop", "rate"}  # no reserve is least within stick
    assert Flow.calls == before


@pytest.mark.slow
@pytest.mark.parametrize("stiffness", [None, in_campaign(10.0)])
def test_the_diagram_of_the_clutch_with_friction_is_closed(stiffness: float | None) -> None:
    start = gw.find_orbit(clutch(0.02, stiffness=stiffness))
    diagram = gw.diagram(start.system, "frequency", (2.0, 0.15), start=start)
    for each in diagram.branches:
        assert EndReason.STEP not in [end.reason for end in each.ends], each


@pytest.mark.slow
def test_a_doubled_branch_ends_where_a_multiplier_of_its_parent_jumps_across_minus_one() -> None:
    """The parent loses a stick there: its multiplier jumps from -1.017, and there is no flip.

    Half the period apart, the doubled motions meet in proportion to the parameter, which two points of them tell.
    """
    start = gw.find_orbit(clutch(0.02), 2, frequency=1.286)
    diagram = gw.diagram(start.system, "frequency", (1.2825, 1.286), start=start)
    parent, child = diagram.branches
    (corner,) = [each for each in parent.special_points if str(each.kind) == "grazing-sliding"]
    assert (corner.before.below, corner.after.below) == (1, 0)
    assert len(parent.special(gw.Kind.FLIP)) == 1
    assert child.ends[-1].reason is EndReason.JOINED
    assert child.ends[-1].value == corner.value
    a, b = (float(np.abs(np.subtract(*point.orbit.strobes(3)[::2])).max()) for point in child.points[-8:-1:6])
    first, last = (child.points[place].value for place in (-8, -2))
    assert (a * last - b * first) / (a - b) == pytest.approx(corner.value, abs=0.2 * abs(last - corner.value) + 1e-8)
    for each in (parent, child):
        assert not unexplained_of(each)


@keeps("amplitudes1")
@pytest.mark.parametrize("amplitudes", [(0.05, 0.11), (0.11, 0.05)])
def test_a_walk_passes_the_graze_of_a_rigid_stop(amplitudes: tuple[float, float]) -> None:
    first, last = amplitudes
    branch = gw.follow(gw.find_orbit(impacts(first)), "load.amplitude", last)
    assert branch.points[-1].value == pytest.approx(last)
    assert places(branch, "grazing") == pytest.approx([0.1], abs=1e-11)
    assert places(branch, "fold") == pytest.approx([closed_forms.one_impact_fold()], abs=1e-11)


@pytest.mark.slow
@pytest.mark.parametrize(("amplitude", "damping"), [in_campaign(1.0, 0.2), (0.2, 0.02)])
def test_a_walk_passes_the_graze_of_a_rigid_stop_in_both_directions(amplitude: float, damping: float) -> None:
    """Towards the graze the impacts become ever softer; the motion beyond is the linear one, whose amplitude is 1."""
    wall = Contact("wall", {"x": 1.0}, [Stage(1.0, side=Side.POSITIVE)], law="rigid", restitution=0.8)
    load = Harmonic(amplitude, {"x": 1.0})
    system = System(["x"], [[1.0]], [[damping]], contacts=[wall], harmonics=[load], frequency=0.6)
    up = gw.follow(gw.find_orbit(system), "frequency", 1.9)
    down = gw.follow(gw.find_orbit(system, frequency=1.9), "frequency", 0.6)
    assert up.ends[-1].reason is down.ends[-1].reason is EndReason.RANGE
    found, again = ([(each.kind, each.value) for each in branch.special_points] for branch in (up, down))
    assert [kind for kind, _ in found] == [kind for kind, _ in reversed(again)]
    assert [value for _, value in found] == pytest.approx([value for _, value in reversed(again)], abs=1e-9)
    grazes = {value for kind, value in found if kind is Kind.GRAZING}
    b = 1.0 - 0.5 * damping**2  # the larger root of (1 - W^2)^2 + (damping W)^2 = amplitude^2
    assert max(grazes) == pytest.approx(math.sqrt(b + math.sqrt(b**2 - 1.0 + amplitude**2)), abs=1e-9)


@pytest.mark.slow
def test_a_graze_beside_which_motions_grow_fast_is_verified() -> None:
    """At 3e-9 beside it, where the motion has an impact, a change of the state grows by the inverse of its velocity."""
    wall = Contact("wall", {"x": 1.0}, [Stage(1.0, side=Side.POSITIVE)], law="rigid", restitution=0.8)
    load = Harmonic(0.3, {"x": 1.0})
    system = System(["x"], [[1.0]], [[0.1]], contacts=[wall], harmonics=[load], frequency=0.6)
    branch = gw.follow(gw.find_orbit(system), "frequency", 1.0)
    assert places(branch, "grazing")
    verified = gw.verify(branch)
    assert verified.breaches == ()


def test_the_velocity_after_an_impact_is_that_of_another_program() -> None:
    (event,) = gw.find_orbit(impacts(1.0)).events
    assert -0.8 * event.velocity == pytest.approx(-1.3565863500759, abs=1e-12)

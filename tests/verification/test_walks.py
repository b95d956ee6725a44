"""Verification passes right walks of kinds that strain it, and looks at them no less closely."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import pytest

import gapwalk as gw
from gapwalk.bifurcation.special_point import ErrorEstimator
from gapwalk.model import Contact, Harmonic, Side, Stage, System
from gapwalk.verification.verify_special_points import Examination, Track
from tests.dry.trials.random_systems import random_system
from tests.sampled_verification import SAMPLED, verified
from tests.tiers import in_campaign


def steel(side: Side, law: str, damping: float) -> System:
    """A mass on a spring with stops a million times as stiff."""
    names = {"viscous": "viscous_damping", "hunt-crossley": "impact_damping"}
    more = {"law": law, names[law]: damping} if law in names else {}
    stop = Contact("stop", {"x": 1.0}, (Stage(1.0, 1e6, side=side),), **more)
    return System(["x"], [[1.0]], [[0.1]], contacts=[stop], harmonics=[Harmonic(0.3, {"x": 1.0})], frequency=0.3)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("side", "law", "damping"),
    [in_campaign(Side.POSITIVE, "elastic", 0.0), (Side.POSITIVE, "hunt-crossley", 0.1), (Side.BOTH, "viscous", 10.0)],
)
def test_a_walk_at_a_stiff_stop_passes_and_is_looked_at_closely(side, law, damping) -> None:
    """A contact lasts a thousandth of a period and is integrated as exactly as the motion between."""
    branch = gw.follow(gw.find_orbit(steel(side, law, damping)), "frequency", 0.9)
    found = gw.verify(branch)
    assert found.ok, found.words
    assert not found.notes
    assert branch.special_points
    number = next(i for i, point in enumerate(branch.points) if point.orbit.events and point.value > 0.88)
    point = branch.points[number]
    off = replace(point.orbit, state=point.orbit.state * (1.0 + 1e-6))
    points = [*branch.points[:number], replace(point, orbit=off, memo={}), *branch.points[number + 1 :]]
    assert "closure" in {breach.check.word for breach in gw.verify(replace(branch, points=tuple(points))).breaches}


@pytest.mark.slow
def test_motions_that_are_small_for_their_branch_pass() -> None:
    """Their contact events are stored as exactly as those of the largest motion, in units of the branch."""
    spring = Contact("c", {"x": 1.0}, (Stage(0.0, 0.0, 1.0),))
    system = System(["x"], [[1.0]], [[0.05]], contacts=[spring], harmonics=[Harmonic(0.5, {"x": 1.0})], frequency=1.2)
    amplitude = next(name for name in system.parameters if "amplitude" in name)
    branch = gw.follow(gw.find_orbit(system), amplitude, 1e-3)
    found = gw.verify(branch)
    assert found.ok, found.words
    number = len(branch.points) - 2
    point = branch.points[number]
    late = [event._replace(theta=event.theta + 3e-4) for event in point.orbit.events]
    points = list(branch.points)
    points[number] = replace(point, orbit=replace(point.orbit, events=tuple(late)), memo={})
    assert "stages" in {breach.check.word for breach in gw.verify(replace(branch, points=tuple(points))).breaches}


def test_a_phase_that_begins_where_the_bound_of_its_friction_vanishes_is_found_on_both_computations() -> None:
    """Its margin is zero wherever the phase is not, and only rounding has a sign there."""
    state = [-0.0275890698561478, -0.463827351941639, -0.344784181925571, 0.154884417292762, -0.170289356305528]
    system = random_system(10).at(frequency=0.4592368001437316)
    orbit = gw.find_orbit(system, start=[*state, 0.226638911120915])
    branch = gw.follow(orbit, "frequency", 0.4583, walk=gw.WalkOptions(largest_step=0.3))
    (found,) = branch.special("switching-sliding")
    values = [found.value + shift for shift in (-1.5e-6, 1.5e-6)]
    beside = [gw.find_orbit(system.at(frequency=value), start=found.orbit.state) for value in values]
    assert len(beside[0].friction[3]) - len(beside[1].friction[3]) in (-1, 1)
    track = Track("P1", branch)
    again = Examination(track, ErrorEstimator(track.corrector(len(found.point.x))), found).sides()
    assert again.value == pytest.approx(found.value, abs=2e-6)


def over_its_range(seed: int) -> gw.Branch:
    system = random_system(seed)
    return gw.follow(gw.find_orbit(system), "frequency", 1.3 * system.frequency)


@pytest.mark.slow
@pytest.mark.parametrize("sampled", SAMPLED)
def test_a_walk_that_turns_sharply_where_a_rigid_stop_is_grazed_passes(sampled: int) -> None:
    branch = over_its_range(15)
    (grazing,) = branch.special("grazing")
    before = max(each.value for each in branch.points if each.arclength < grazing.point.arclength)
    assert before > grazing.value < branch.points[-1].value
    turns = [float(a.tangent @ b.tangent) for a, b in pairwise(branch.points)]
    assert min(turns) < 0.9
    assert verified(branch, sampled).breaches == ()


def test_motions_at_rest_pass() -> None:
    branch = over_its_range(34)
    assert not any(point.orbit.extremes[:, :2].any() for point in branch.points)
    assert gw.verify(branch).breaches == ()

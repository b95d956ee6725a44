"""Branch switching: doubled branches that close on their parents, broken symmetry, super- and subcritical flips."""

from contextlib import suppress
from dataclasses import replace

import numpy as np
import pytest

from gapwalk.bifurcation import BranchTracer, Kind, follow, switch, walk_out
from gapwalk.bifurcation.detector import Detector
from gapwalk.continuation import EndReason
from gapwalk.errors import ModelError, NumericalError
from gapwalk.flow.flow import PERIOD, flow_of
from gapwalk.model.coefficients import coefficients_of
from gapwalk.model.contact import backlash
from gapwalk.model.loads import Harmonic
from gapwalk.model.system import System
from gapwalk.orbit import find_orbit
from gapwalk.orbit.orbit import is_same, true_period
from gapwalk.paper import case
from tests.bifurcation.test_special_points import symmetric
from tests.computed import paper_response

RANGE = (0.15, 2.0)


@pytest.fixture(scope="module")
def parent():
    return paper_response("13")


def test_the_direction_that_rounding_leaves_where_a_branch_joins_its_parent_hides_no_fold(parent):
    """Balanced, a branch that bends within 1e-6 has there a tangent of 3e-5, of either sign, and no multiplier of 1."""
    (beginning,) = switch(parent.special(Kind.FLIP)[0], "frequency", RANGE)
    loop = walk_out([beginning])
    assert loop.ends[-1].reason is EndReason.JOINED
    *others, vertex = loop.points

    def ending(component: float, reason: EndReason) -> list[str]:
        tangent = vertex.tangent.copy()
        tangent[-1] = component
        multipliers = vertex.orbit.multipliers * (1.0 + 1.5e-5)
        end = replace(vertex, orbit=replace(vertex.orbit, multipliers=multipliers), tangent=tangent, memo={})
        ends = (loop.ends[0], replace(loop.ends[-1], reason=reason))
        return [each.text for each in replace(loop, points=(*others, end), ends=ends).unexplained]

    way = np.sign(others[-1].tangent[-1])
    for component in (-3e-5, -1e-5, 0.0, 3e-5):
        assert ending(component, EndReason.JOINED) == []
    turned = ["the branch turns back, with 0 points of the kind fold between"]
    assert ending(-3e-5 * way, EndReason.RANGE) == turned
    assert ending(-3e-3 * way, EndReason.JOINED) == turned


@pytest.mark.slow
def test_every_flip_of_figure_13_leads_along_a_loop_to_another_flip(parent):
    flips = parent.special(Kind.FLIP)
    reached = {}
    for flip in flips:
        (beginning,) = switch(flip, "frequency", RANGE)
        loop = walk_out([beginning])
        assert loop.period == 2
        assert [end.reason for end in loop.ends] == [EndReason.BRANCHED, EndReason.JOINED]
        reached[flip.value] = loop.ends[-1].value
    values = sorted(flip.value for flip in flips)
    assert sorted(reached.values()) == pytest.approx(values, abs=1e-6)
    for begin, end in reached.items():  # and back
        back = min(reached, key=lambda value: abs(value - end))
        assert reached[back] == pytest.approx(begin, abs=1e-6)


def test_follow_leaves_a_special_point_along_the_other_branch(parent):
    flip = parent.special(Kind.FLIP)[0]
    loop = follow(flip, "frequency", RANGE)
    switched = walk_out(switch(flip, "frequency", RANGE))
    assert [point.value for point in loop.points] == [point.value for point in switched.points]
    lower = follow(flip, "frequency", 1.3)
    assert (lower.period, lower.ends[-1].reason, lower.ends[-1].value) == (2, EndReason.RANGE, 1.3)
    with pytest.raises(ModelError, match="no other periodic branch begins at a fold"):
        follow(parent.special(Kind.FOLD)[0], "frequency", RANGE)


def test_a_doubled_branch_that_reaches_the_end_of_the_range_has_not_turned_back(parent):
    # its first tangent has no component along the parameter: it heads neither way
    low, high = sorted(flip.value for flip in parent.special(Kind.FLIP))[-2:]
    middle = 0.5 * (low + high)
    for flip in parent.special(Kind.FLIP)[:2]:
        within = (middle, 2.0) if flip.value == high else (0.15, middle)
        cut = walk_out(switch(flip, "frequency", within))
        assert cut.ends[-1].reason is EndReason.RANGE
        assert cut.ends[-1].value == cut.points[-1].value == middle


def test_a_broken_symmetry_that_reaches_the_end_of_the_range_has_not_turned_back():
    breaking = follow(find_orbit(symmetric()), "frequency", to=0.8).special(Kind.BRANCH_POINT)[0]
    for beginning in switch(breaking, "frequency", (0.84, 0.9)):
        assert walk_out([beginning]).ends[-1].reason is EndReason.RANGE


def test_orbits_of_a_doubled_branch_repeat_after_two_periods_and_not_after_one(parent):
    loop = walk_out(switch(parent.special(Kind.FLIP)[0], "frequency", RANGE))
    for point in loop.points[2:-2:5]:
        assert true_period(point.orbit) == 2
        flow, coefficients = flow_of(point.orbit.system), coefficients_of(point.orbit.system)
        end = flow.integrate(coefficients, point.orbit.state, 0.0, 2 * PERIOD).state
        assert end == pytest.approx(point.orbit.state, abs=1e-8)


@pytest.fixture(scope="module")
def grazed_flip():
    """A flip of figure 15, 3e-8 in W beside which the contact just touches: what is born there turns round at once."""
    (flip,) = follow(find_orbit(case("15"), frequency=0.194), "frequency", to=0.192).special(Kind.FLIP)
    return flip


@pytest.mark.slow
def test_a_branch_that_turns_within_a_millionth_of_its_beginning_has_its_fold(grazed_flip):
    branch = follow(grazed_flip, "frequency", to=(0.15, 1.9))
    graze, fold, *_ = branch.special_points
    assert [graze.kind, fold.kind] == [Kind.GRAZING, Kind.FOLD]
    assert fold.point.arclength < 1e-6
    assert fold.value < graze.value < grazed_flip.value
    assert fold.nature == "opens to higher values"
    # unstable as it is born, for smaller W, and stable beyond the fold: seen without a walk, at one W beside it
    (beginning,) = switch(grazed_flip, "frequency", (0.15, 1.9))
    between = 0.5 * (fold.value + graze.value)
    stable = set()
    for length in (5e-7, 8e-7):
        x = beginning.first.x + length * beginning.first.tangent
        correction = beginning.corrector.at_value(x, between)
        assert correction is not None
        stable.add(beginning.corrector.point(correction, beginning.first.tangent, length).stable)
    assert stable == {False, True}


@pytest.mark.slow
def test_both_arms_of_a_vertex_have_the_fold_that_is_close_to_it(grazed_flip):
    """Beyond the vertex all comes again in reverse, as the same motions a forcing period later."""
    (beginning,) = switch(grazed_flip, "frequency", (0.15, 1.9))
    corrector, tangent = beginning.corrector, beginning.first.tangent
    arm, seen = [Kind.FOLD, Kind.GRAZING], []
    for length in np.linspace(1.5e-6, 4e-6, 11):  # so close to a vertex rounding decides from where orbits can be held
        ends = []
        for way in (-length, length):
            correction = corrector.correct(beginning.first.x + way * tangent, tangent)
            assert correction is not None
            ends.append(corrector.point(correction, tangent, float(way)))
        with suppress(NumericalError):
            found = Detector(corrector).inspect(*ends)
            if [each.kind for each in found] == [*arm, Kind.BRANCH_POINT, *reversed(arm)]:
                seen.append(found)
    assert seen
    for found in seen:
        values = [each.value for each in found]
        assert values == pytest.approx(values[::-1], abs=1e-12)
        assert [each.before.total for each in found] == [each.after.total for each in reversed(found)]


def test_criticality_agrees_with_the_side_on_which_stable_doubled_motions_are(parent):
    natures = {round(flip.value, 3): flip.nature for flip in parent.special(Kind.FLIP)}
    assert natures[1.332] == natures[0.799] == natures[0.654] == "supercritical"
    assert natures[1.229] == natures[0.390] == "subcritical"
    for flip in parent.special(Kind.FLIP):
        assert flip.judged > 1e-3
        loop = walk_out(switch(flip, "frequency", RANGE))
        born = loop.points[2]
        # the parent is unstable on one side only; a supercritical child is there, and stable
        here = [p for p in parent.points if abs(p.value - flip.value) < 0.05]
        side = np.sign(born.value - flip.value)
        beside = min(
            (p for p in here if np.sign(p.value - flip.value) == side), key=lambda p: abs(p.value - flip.value)
        )
        assert (not beside.stable) == (flip.nature == "supercritical")
        assert born.stable == (flip.nature == "supercritical")


def test_folds_say_to_which_side_they_open(parent):
    for fold in parent.special(Kind.FOLD):
        near = [p.value for p in parent.points if abs(p.arclength - fold.point.arclength) < 0.02]
        assert fold.nature == ("opens to lower values" if np.mean(near) < fold.value else "opens to higher values")


def test_a_broken_symmetry_is_left_in_both_directions_by_mirror_images():
    branch = follow(find_orbit(symmetric()), "frequency", to=0.5)
    breaking = branch.special(Kind.BRANCH_POINT)[0]
    beginnings = switch(breaking, "frequency", (0.5, 3.0))
    assert len(beginnings) == 2
    sides = [walk_out([beginning]) for beginning in beginnings]
    for side in sides:
        assert len(side.points) > 5
        assert abs(side.points[3].measure("mean.x")) > 1e-4
    one, other = (side.points[1] for side in sides)
    mirrored = find_orbit(one.orbit.system, start=_half_later(other.orbit))
    assert one.measure("mean.x") == pytest.approx(-other.measure("mean.x"), rel=0.2)
    assert mirrored.measure("mean.x") * one.measure("mean.x") > 0


def _half_later(orbit):
    """The mirror image of a motion of a symmetric system: its negative, half a period later."""
    flow = flow_of(orbit.system)
    return -flow.integrate(coefficients_of(orbit.system), orbit.state, 0.0, PERIOD / 2).state


def test_a_doubled_branch_resumes_as_if_never_stopped(parent):
    (beginning,) = switch(parent.special(Kind.FLIP)[2], "frequency", RANGE)
    whole = list(BranchTracer(beginning))
    first = BranchTracer(beginning)
    begun = [next(first) for _ in range(9)]
    rest = list(BranchTracer(switch(parent.special(Kind.FLIP)[2], "frequency", RANGE)[0], resume=first.state))
    assert [p.value for p, _ in begun + rest] == [p.value for p, _ in whole]


@pytest.mark.parametrize("kind", [Kind.FOLD, Kind.NEIMARK_SACKER, Kind.GRAZING])
def test_there_is_nothing_to_switch_to_elsewhere(parent, kind):
    with pytest.raises(ModelError, match="switch at a flip or at a branch point"):
        switch(parent.special(kind)[0], "frequency", RANGE)


def test_a_range_without_the_special_point_is_refused(parent):
    with pytest.raises(ModelError, match="outside the range"):
        switch(parent.special(Kind.FLIP)[0], "frequency", (0.2, 0.5))


def test_identity_of_orbits_up_to_a_shift():
    orbit = find_orbit(case("13"), 2, frequency=0.72)
    flow, coefficients = flow_of(orbit.system), coefficients_of(orbit.system)
    later = flow.integrate(coefficients, orbit.state, 0.0, PERIOD).state
    assert is_same(orbit, find_orbit(orbit.system, 2, start=later))
    once = find_orbit(case("13"), 1, frequency=0.72, start=0.5 * (orbit.state + later))
    assert not is_same(orbit, once)
    twice = find_orbit(case("13"), 2, frequency=0.72, start=once.state)
    assert true_period(twice) == 1
    assert true_period(orbit) == 2


@pytest.mark.slow
def test_a_doubled_motion_of_any_size_has_no_folds_where_it_only_grows():
    """While teeth stay in contact the mesh is linear: at the flip the doubled motion has any size, and no fold."""
    pair = System(
        ["x"],
        [[0.0]],
        [[0.03]],
        contacts=[backlash("mesh", {"x": 1.0}, clearance=1.0, stiffness=1.0)],
        mean={"x": 0.1},
        harmonics=[Harmonic(0.2, varies="mesh.stiffness"), Harmonic(0.02, {"x": 1.0}, name="torque")],
    )
    branch = follow(find_orbit(pair, frequency=2.3), "frequency", to=1.8)
    flips = branch.special(Kind.FLIP)
    assert len(flips) == 2
    doubled = follow(flips[0], "frequency", (0.5, 3.5))
    straight = [abs(point.value - flips[0].value) < 1e-11 for point in doubled.points]
    assert sum(straight) > 2  # it runs straight across the frequency, until the teeth part
    assert not [
        fold for fold in doubled.special(Kind.FOLD) if min(abs(fold.value - flip.value) for flip in flips) < 1e-6
    ]

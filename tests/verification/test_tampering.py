"""Records that were changed after they were found: verification finds each change by computing it again."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.continuation import EndReason
from gapwalk.errors import ModelError
from gapwalk.studies.response_study import ResponseOptions
from gapwalk.verification import Check, Verification
from gapwalk.verification.dop853 import carry
from tests.independent import integrate
from tests.sampled_verification import verified
from tests.systems import clutch, viscous_stop
from tests.tiers import keeps, some_of

LONG = gw.WalkOptions(largest_step=0.08)
"""Longer steps than by default: what is verified again after each change has fewer points."""


@pytest.fixture(scope="module")
def branch():
    return gw.follow(gw.find_orbit(clutch(frequency=0.85)), "frequency", to=0.6, walk=LONG)


@pytest.fixture(scope="module")
def tree():
    options = {"max_period": 2, "workers": 1, "walk": LONG}
    return gw.diagram(clutch(frequency=0.85), "frequency", (0.64, 0.85), **options)


@pytest.fixture(scope="module")
def backlash():
    """A symmetric gap: both of its sides graze at once, where the amplitude of linear theory is the clearance."""
    gap = gw.backlash("gap", {"x": 1.0}, 1.0, 20.0, impact_damping=0.1)
    system = gw.System(["x"], [[1.0]], [[0.05]], contacts=[gap], harmonics=[gw.Harmonic(0.5, {"x": 1.0})])
    return gw.follow(gw.find_orbit(system.at(frequency=0.3)), "frequency", to=4.0, walk=LONG)


def failed(found: Verification) -> set[str]:
    return {breach.check.word for breach in found.breaches}


def kinds_of(branch) -> dict[gw.Kind, int]:
    """A special point of each kind, as its place in the list."""
    return {each.kind: index for index, each in enumerate(branch.special_points)}


def at_special_points(branch) -> gw.Verification:
    """Verify a branch without most of its other orbits."""
    return verified(branch, 2)


def with_specials(branch, special_points):
    return replace(branch, special_points=tuple(special_points))


def with_special(branch, index, **changes):
    specials = list(branch.special_points)
    specials[index] = replace(specials[index], **changes)
    return with_specials(branch, specials)


def test_what_was_not_changed_passes(branch, tree) -> None:
    for what in (branch, tree):
        found = gw.verify(what)
        assert found.ok, found.words
        assert {"order", "ends", "nature", "residual"} <= {each.check.word for each in found.summaries}


@pytest.mark.slow
def test_a_symmetric_gap_passes(backlash) -> None:
    found = gw.verify(backlash)
    assert found.ok, found.words
    assert not found.notes
    grazes = backlash.special("grazing")
    assert [each.contact for each in grazes] == ["gap +", "gap -"] * 2
    # W at which the amplitude F / |1 - W^2 + i c W| is 1
    square = np.roots([1.0, 0.05**2 - 2.0, 1.0 - 0.5**2])
    assert grazes[0].value == pytest.approx(np.sqrt(square.min()), abs=1e-10)


@pytest.mark.slow
def test_one_of_two_sides_that_graze_at_once_is_missed(backlash) -> None:
    index = next(i for i, each in enumerate(backlash.special_points) if each.contact == "gap -")
    rest = [each for i, each in enumerate(backlash.special_points) if i != index]
    assert "counts" in failed(at_special_points(with_specials(backlash, rest)))


@pytest.mark.slow
def test_events_of_a_point_aside_do_not_cost_digits_of_its_closure() -> None:
    """Its last Newton step moves an orbit by some 1e-7, and its stored events are those from before."""
    orbit = gw.find_orbit(clutch(frequency=0.6))
    assert orbit.events
    moved = [event._replace(theta=event.theta + 1e-6 * (-1) ** i) for i, event in enumerate(orbit.events)]
    (around,) = carry([replace(orbit, events=tuple(moved))])
    assert around.closure < 1e-10
    assert np.abs(integrate(orbit.system, orbit.state) - orbit.state).max() < 1e-8
    assert around.astray > 1e-8  # by which stages are judged, which are told where they are not
    (far,) = carry([replace(orbit, events=tuple(e._replace(theta=e.theta + 1e-3) for e in orbit.events))])
    assert far.closure > 1e-9


def test_an_event_that_is_moved_moves_those_after_it_where_the_force_jumps() -> None:
    """Locating all events once leaves a closure of the order of what moves them: it is done until they stay."""
    orbit = gw.find_orbit(viscous_stop(0.9))
    assert len(orbit.events) >= 2
    assert np.abs(integrate(orbit.system, orbit.state) - orbit.state).max() < 1e-9
    moved = [event._replace(theta=event.theta + 4e-6 * (-1) ** i) for i, event in enumerate(orbit.events)]
    (around,) = carry([replace(orbit, events=tuple(moved))])
    assert around.closure < 1e-10


OTHER = {
    "supercritical": "subcritical",
    "subcritical": "supercritical",
    "opens to lower values": "opens to higher values",
    "opens to higher values": "opens to lower values",
}


@pytest.mark.slow
def test_a_swapped_nature_is_found(branch) -> None:
    assert {each.kind for each in branch.special_points if each.nature} == {gw.Kind.FOLD, gw.Kind.FLIP}
    for index in (kinds_of(branch)[kind] for kind in (gw.Kind.FOLD, gw.Kind.FLIP)):
        changed = with_special(branch, index, nature=OTHER[branch.special_points[index].nature])
        found = at_special_points(changed)
        (breach,) = found.breaches
        assert breach.check is Check.NATURE
        assert breach.spot.item.startswith(f"special point {index} ")


@keeps("flip-0.5")
@pytest.mark.parametrize("wrong", some_of([1e-18, 0.0, -1.0, 0.5, math.nan], 1e-18, 0.5, math.nan))
@pytest.mark.parametrize("kind", some_of(["fold", "flip", "grazing"], "flip", "grazing"))
def test_an_absurd_uncertainty_is_found(branch, kind, wrong) -> None:
    index = next(i for i, each in enumerate(branch.special_points) if each.kind == kind)
    found = at_special_points(with_special(branch, index, uncertainty=wrong))
    assert failed(found) == {"location"}
    assert "its stated error is" in found.breaches[0].detail


@pytest.mark.slow
def test_a_point_that_is_there_twice_is_found(branch) -> None:
    points = branch.points
    for at, again, place in ((40, 40, 40), (40, 39, 39), (10, 50, 10)):
        found = gw.verify(replace(branch, points=(*points[:at], points[again], *points[at:])))
        assert {"order"} <= failed(found)
        assert (Check.ORDER, f"points {place} to {place + 1}") in {(b.check, b.spot.item) for b in found.breaches}
    near = replace(points[40], arclength=0.5 * (points[40].arclength + points[41].arclength))
    assert "gaps" in failed(gw.verify(replace(branch, points=(*points[:41], near, *points[41:]))))


@pytest.mark.slow
def test_a_special_point_that_is_there_twice_is_found(branch) -> None:
    for index in kinds_of(branch).values():
        special = branch.special_points[index]
        specials = [*branch.special_points[:index], special, *branch.special_points[index:]]
        assert "order" in failed(at_special_points(with_specials(branch, specials)))


def test_a_branch_without_its_last_half_is_found(branch) -> None:
    half = len(branch.points) // 2
    kept = [each for each in branch.special_points if each.point.arclength < branch.points[half].arclength]
    cut = replace(branch, points=branch.points[: half + 1], special_points=tuple(kept))
    found = gw.verify(cut)
    assert failed(found) == {"ends"}
    assert found.breaches[0].spot.item == f"point {half}"
    cut = replace(branch, points=branch.points[half:], special_points=branch.special_points[len(kept) :])
    assert failed(gw.verify(cut)) == {"ends"}


@pytest.mark.parametrize(
    ("reason", "words"),
    [
        (EndReason.CLOSED, "its last motion is not its first"),
        (EndReason.JOINED, "no other branch is near its end"),
        (EndReason.TURNED_BACK, "it is ahead of the start"),
    ],
)
def test_a_reason_of_an_end_that_does_not_hold_is_found(branch, reason, words) -> None:
    (breach,) = gw.verify(replace(branch, ends=(branch.ends[0], replace(branch.ends[1], reason=reason)))).breaches
    assert breach.check is Check.ENDS
    assert words in breach.detail


@pytest.mark.slow
def test_a_changed_value_of_an_end_and_a_lost_end_are_found(branch) -> None:
    for ends in ((branch.ends[0], replace(branch.ends[1], value=0.61)), branch.ends[:1]):
        assert failed(gw.verify(replace(branch, ends=ends))) == {"ends"}


def test_a_count_of_points_that_does_not_hold_is_found() -> None:
    start = gw.find_orbit(clutch(frequency=0.85))
    short = gw.follow(start, "frequency", to=0.6, walk=gw.WalkOptions(max_points=12))
    assert short.ends[-1].reason is EndReason.POINTS
    assert gw.verify(short).ok
    end = replace(short.ends[-1], detail="max_points = 20")
    assert failed(gw.verify(replace(short, ends=(short.ends[0], end)))) == {"ends"}


@keeps("0.001")
@pytest.mark.parametrize("wrong", [0.5, 1e-3, -1e-12, math.nan, math.inf])
def test_a_changed_residual_is_found(branch, wrong) -> None:
    points = list(branch.points)
    points[7] = replace(points[7], orbit=replace(points[7].orbit, residual=wrong), memo={})
    (breach,) = gw.verify(replace(branch, points=tuple(points))).breaches
    assert (breach.check, breach.spot.item) == (Check.RESIDUAL, "point 7")


@pytest.mark.slow
def test_a_leaf_that_was_dropped_is_found(tree) -> None:
    assert tree.complete
    assert tree.max_period == 2
    found = gw.verify(replace(tree, members=tree.members[:1]))
    assert failed(found) == {"tree"}
    flips = [i for i, each in enumerate(tree["P1-1"].branch.special_points) if each.kind == "flip"]
    assert {breach.spot.item for breach in found.breaches} == {f"special point {i} (flip)" for i in flips}
    assert "a branch of period 2 begins there" in found.breaches[0].detail
    # what does not call itself complete may lack branches, and so may what was not asked for longer periods
    assert gw.verify(replace(tree, members=tree.members[:1], complete=False)).ok
    assert gw.verify(replace(tree, members=tree.members[:1], max_period=1)).ok
    assert any("is not verified" in note for note in gw.verify(replace(tree, max_period=None)).notes)


def test_a_branch_that_is_there_twice_is_found(tree) -> None:
    member = tree.members[-1]
    name = f"P{member.period}-{sum(each.period == member.period for each in tree.members) + 1}"
    found = gw.verify(replace(tree, members=(*tree.members, replace(member, name=name))))
    assert failed(found) == {"tree"}
    assert f"it is the branch {member.name} again" in str(found.breaches[0])


def test_a_missing_name_is_found(tree) -> None:
    renamed = replace(tree.members[-1], name="P2-7")
    assert failed(gw.verify(replace(tree, members=(*tree.members[:-1], renamed)))) == {"tree"}


@pytest.mark.slow
def test_another_range_is_found() -> None:
    options = ResponseOptions("frequency", 0.85, 0.8, "half.q1")
    result = gw.run(gw.Study(clutch(frequency=0.85), options))
    assert gw.verify(result).ok
    for changes in ({"end": 0.79}, {"end": 0.81}, {"begin": 0.86}):
        changed = replace(result.study, options=replace(options, **changes))
        assert failed(gw.verify(replace(result, study=changed))) == {"ends"}


@pytest.mark.parametrize("what", [5, None, [], object(), gw.find_orbit])
def test_what_cannot_be_verified_is_said(what) -> None:
    with pytest.raises(ModelError, match=r"cannot be verified; give an orbit, a branch, .* or the name of a result"):
        gw.verify(what)

"""Families: members, and special points joined by their exact loci, beside branches and loci that are walked alone."""

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.errors import ModelError, StoreError
from gapwalk.studies.branch_family import LIMIT, Family, Fate, Place, distance_between, nearest_pairs
from tests.interruption import until_ctrl_c
from tests.studies.families import second_resonance
from tests.studies.same import assert_same_branch
from tests.systems import clutch

pytestmark = pytest.mark.usefixtures("kept_processes")

LOADS = (0.25, 0.35, 0.5)
ONE = {"workers": 1}


@pytest.fixture(scope="module")
def family() -> Family:
    return second_resonance()


def response(system: gw.System, begin: float, end: float) -> gw.Branch:
    return gw.follow(gw.find_orbit(system.at(frequency=begin), start="settle"), "frequency", to=end)


def count(kind: str, system: gw.System, begin: float, end: float) -> int:
    return len(response(system, begin, end).special(gw.Kind.named(kind)))


def places(family: Family, name: str) -> list[float]:
    return [family.special(place).value for place in family[name].places]


def test_each_member_is_the_response_of_its_system(family) -> None:
    assert family.complete
    assert (family.failures, family.notes) == ((), ())
    for member, load in zip(family.members, LOADS, strict=True):
        (branch,) = member.branches
        assert member.value == load
        assert_same_branch(branch, response(clutch().at({"mean.q3": load}), 1.4, 1.1))


@pytest.mark.slow
def test_special_points_are_joined_as_the_loci_through_all_members_say(family) -> None:
    assert [point_path.name for point_path in family.point_paths] == ["grazing-1", "flip-1", "flip-2", "grazing-2"]
    for point_path in family.point_paths:
        assert point_path.exact
        assert (point_path.before, point_path.after) == (None, None)
        first, *others = (family.special(place) for place in point_path.places)
        for load, special in zip(LOADS[1:], others, strict=True):
            locus = gw.follow_locus(first, "frequency", "mean.q3", ((1.1, 1.4), (LOADS[0], load)))
            ends = [point.values for point in (locus.points[0], locus.points[-1])]
            assert min(abs(end[0] - special.value) for end in ends if end[1] == load) < 1e-9


@pytest.mark.slow
def test_two_flips_that_meet_are_gone_beyond_and_there_before() -> None:
    """Of the clutch under growing mean load: from 0.437 on nothing doubles its period about the second resonance."""
    found = gw.family(clutch(), "frequency", (1.4, 1.15), {"mean.q1": (0.43, 0.44)}, **ONE)
    flips = found.of_kind("flip")
    assert [len(point_path.places) for point_path in flips] == [1, 1]
    one, other = flips
    assert one.after is other.after
    assert one.after is not None
    assert (one.after.fate, one.after.event) == (Fate.MET, "turn")
    frequency, load = one.after.at
    assert 0.43 < load < 0.44
    assert "meets another one at (" in one.after.text
    before = response(clutch().at({"mean.q1": load - 1e-5}), 1.4, 1.15).special(gw.Kind.FLIP)
    assert len(before) == 2
    assert all(abs(special.value - frequency) < 0.01 for special in before)
    assert count("flip", clutch().at({"mean.q1": load + 1e-5}), 1.4, 1.15) == 0


@pytest.mark.slow
def test_folds_that_meet_in_a_cusp_are_there_on_one_side_of_it() -> None:
    """Two folds are born beside the jump of figure 13 before the load of figure 14 is reached, one by one."""
    found = gw.family(clutch(), "frequency", (0.66, 0.61), {"mean.q3": (0.385, 0.395)}, **ONE)
    born = [point_path for point_path in found.of_kind("fold") if point_path.before is not None]
    assert len(born) == 2
    (connection,) = {point_path.before for point_path in born}
    assert connection is not None
    assert (connection.fate, connection.event) == (Fate.MET, "cusp")
    _, load = connection.at
    before, after = (count("fold", clutch().at({"mean.q3": load + d}), 0.66, 0.61) for d in (-1e-4, 1e-4))
    assert after - before == 2
    assert " in a cusp at (" in connection.text


@pytest.mark.slow
def test_what_splits_off_is_told() -> None:
    """Above a load of 0.4386 the jump of figure 14 has an island beside it, to which special points have gone."""
    found = gw.family(clutch(), "frequency", (0.66, 0.59), {"mean.q3": (0.43, 0.44)}, **ONE)
    fates = {connection.fate for connections in (found.connections or {}).values() for connection in connections}
    assert Fate.MET in fates or Fate.OUTSIDE in fates
    text = " ".join(connection.text for connections in (found.connections or {}).values() for connection in connections)
    assert "no known branch" in text


@pytest.mark.slow
def test_a_special_point_that_leaves_the_range_is_told() -> None:
    found = gw.family(clutch(), "frequency", (1.4, 1.23), {"mean.q3": (0.3, 0.25)}, **ONE)
    flip = found["flip-2"]
    assert len(flip.places) == 1
    assert flip.after is not None
    assert flip.after.fate is Fate.RANGE
    frequency, load = flip.after.at
    assert frequency == pytest.approx(1.23, abs=1e-12)
    # there it is on the edge: the flip of a response that goes further lies just there
    further = response(clutch().at({"mean.q3": load}), 1.4, 1.2).special(gw.Kind.FLIP)
    assert further[-1].value == pytest.approx(1.23, abs=1e-9)


@pytest.mark.slow
def test_names_that_move_together_are_one_parameter() -> None:
    """Twice the amplitude is twice the force: two ways to say the same."""
    amplitude = gw.family(clutch(), "frequency", (1.4, 1.1), {"harmonic1.amplitude": (0.2, 0.25)}, **ONE)
    over = gw.studies.MemberParameter.of(
        {"harmonic1.amplitude": (0.4, 0.5), "harmonic1.acts_on.q1": (0.5, 0.5)}, "force", (0.2, 0.25)
    )
    force = gw.family(clutch(), "frequency", (1.4, 1.1), over, **ONE)
    assert force.over.name == "force"
    assert len(amplitude.point_paths) == len(force.point_paths)
    for one, other in zip(amplitude.point_paths, force.point_paths, strict=True):
        assert one.name == other.name
        assert places(amplitude, one.name) == pytest.approx(places(force, other.name), abs=1e-9)
        for a, b in ((one.before, other.before), (one.after, other.after)):
            assert (a is None) == (b is None)
            if a is not None and b is not None:
                assert (a.fate, a.at) == (b.fate, pytest.approx(b.at, abs=1e-6))


def test_a_family_over_the_frequency() -> None:
    found = gw.family(clutch(), "harmonic1.amplitude", (0.1, 0.3), {"frequency": (1.25, 1.3)}, **ONE)
    assert found.complete
    assert [round(member.branches[0].system.frequency, 12) for member in found.members] == [1.25, 1.3]
    assert all(point_path.exact for point_path in found.point_paths)


@pytest.mark.slow
def test_longer_periods_are_members_too() -> None:
    options = {"max_period": 2, "workers": 1}
    found = second_resonance((0.45, 0.5), **options)
    assert [[branch.period for branch in member.branches] for member in found.members] == [[1, 2], [1, 2]]
    assert {point_path.period for point_path in found.point_paths} == {1, 2}
    assert all(point_path.exact for point_path in found.point_paths if point_path.connections)
    assert len(found.of_kind("flip")) >= 2


def test_a_member_that_fails_costs_only_itself() -> None:
    """A stiffness as negative as that lets no motion be followed; its neighbours are joined past it."""
    over = gw.studies.MemberParameter.of(
        {"damping.q1.q1": (0.04, 0.04, 0.05), "stiffness.q1.q1": (0.1, -1e6, 0.1)}, "case", (1.0, 2.0, 3.0)
    )
    found = gw.family(clutch(), "frequency", (1.4, 1.1), over, **ONE)
    assert found.complete
    (failure,) = found.failures
    assert failure.startswith("case = 2: no branch could be walked")
    assert [len(member.branches) for member in found.members] == [1, 0, 1]
    assert list(found.connections or {}) == [0]
    flip = found["flip-1"]
    assert [place.member for place in flip.places] == [0, 2]
    assert flip.exact


@pytest.mark.slow
def test_by_nearness_the_same_are_joined_where_they_are_near_and_it_is_said_to_be_a_guess(family) -> None:
    guess = second_resonance((0.25, 0.3), **dict(ONE, exact=False))
    exact = second_resonance((0.25, 0.3))
    assert [(each.name, each.places) for each in guess.point_paths] == [
        (each.name, each.places) for each in exact.point_paths
    ]
    assert not any(point_path.exact for point_path in guess.point_paths)
    assert all(
        "(a guess)" in connection.text for point_path in guess.point_paths for connection in point_path.connections
    )
    far = second_resonance((0.25, 0.3), **dict(ONE, exact=False, kinds=(gw.Kind.FLIP,)))
    assert {connection.kind for connection in far.connections[0]} == {gw.Kind.FLIP}


def test_the_assignment_leaves_alone_what_has_no_partner(family) -> None:
    specials = dict(family.members[0].special_points)
    flips = {place: special for place, special in specials.items() if special.kind is gw.Kind.FLIP}
    within = family.within
    (a, one), (b, other) = flips.items()
    assert nearest_pairs(flips, {b: other}, within) == [(b, b)]  # not with the farther one, and each once
    assert nearest_pairs({a: one}, {b: other}, within) == []
    assert distance_between(one, other, within) > LIMIT
    grazing = {place: special for place, special in specials.items() if special.kind is gw.Kind.GRAZING}
    assert nearest_pairs(flips, grazing, within) == []
    assert nearest_pairs({}, grazing, within) == []


def test_the_result_does_not_depend_on_the_number_of_processes(family) -> None:
    found = second_resonance(workers=2)
    assert found.connections == family.connections
    for one, other in zip(found.branches, family.branches, strict=True):
        assert_same_branch(one, other)


@pytest.mark.slow
def test_balanced_members_are_joined_by_exact_loci_too() -> None:
    found = second_resonance((0.25, 0.3), method=gw.Balance(harmonics=20))
    exact = second_resonance((0.25, 0.3))
    assert [each.name for each in found.point_paths] == [each.name for each in exact.point_paths]
    assert all(point_path.exact and len(point_path.places) == 2 for point_path in found.point_paths)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"called": "Kb"}, "called and values belong together"),
        ({"values": (1.0, 2.0)}, "called and values belong together"),
        ({"called": "Kb", "values": (1.0,)}, "values has 1 numbers, and over has 2"),
        ({"called": "Kb", "values": (1.0, 1.0)}, "values 1, 1 of Kb; they must rise"),
    ],
)
def test_a_name_of_its_own_needs_its_values(values, message) -> None:
    with pytest.raises(ModelError, match=message):
        gw.studies.MemberParameter.of({"mean.q3": (0.25, 0.3)}, **values)


def test_impossible_families_are_refused() -> None:
    """What is refused in a file too is tested there."""
    for over, message in (
        ({}, "over names no parameter"),
        ({"mean.q3": (0.25, np.nan)}, "must be finite"),
        ({"frequency": (0.25, 0.3)}, "has frequency, along which each member is walked"),
    ):
        with pytest.raises(ModelError, match=message):
            gw.family(clutch(), "frequency", (1.4, 1.1), over, **ONE)
    with pytest.raises(ModelError, match="they may be fold, flip"):
        gw.family(clutch(), "frequency", (1.4, 1.1), {"mean.q3": LOADS}, kinds=())
    with pytest.raises(ModelError):
        gw.family(clutch(), "frequency", (1.4, 1.4), {"mean.q3": LOADS}, **ONE)


def test_a_stopped_family_goes_on_to_the_same_result(family, tmp_path) -> None:
    path = tmp_path / "a.family"
    seen = []

    def stop(part, pace) -> None:
        seen.append((pace.done, pace.total))
        if pace.done in (2, 4):
            raise KeyboardInterrupt

    stopped = until_ctrl_c(second_resonance, output=path, report=stop)
    assert not stopped.complete
    assert [member.value for member in stopped.members] == list(LOADS[:2])
    assert "2 members of 3" in repr(stopped)
    assert gw.open_result(path).connections == {}
    again = until_ctrl_c(second_resonance, output=path, report=stop)
    assert len(again.members) == 3
    assert len(again.connections or {}) == 1
    assert not again.complete
    whole = second_resonance(output=path, report=lambda part, pace: seen.append((pace.done, pace.before)))
    assert seen == [(1, 5), (2, 5), (3, 5), (4, 5), (5, 4)]
    for found in (whole, gw.open_result(path)):
        assert found.complete
        assert found.connections == family.connections
        assert found.point_paths == family.point_paths
        for one, other in zip(found.branches, family.branches, strict=True):
            assert_same_branch(one, other)
    with pytest.raises(StoreError, match="holds the result of something else"):
        second_resonance((0.25, 0.3), output=path)


def test_a_family_can_be_asked(family) -> None:
    assert repr(family) == "Family(frequency over mean.q3: 3 members; point_paths: 2 of flip, 2 of grazing)"
    assert family["flip-2"].places[0] == Place(0, 0, 2)
    with pytest.raises(KeyError, match="there is no special point fold-1; there are grazing-1, flip-1"):
        family["fold-1"]
    assert repr(family.members[0]) == "Member(0.25, 1 branches)"

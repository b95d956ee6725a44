"""What lies within a part of a range is found alike, however wide the whole is, and nothing changes unexplained."""

from dataclasses import replace

import pytest

from gapwalk import Branch, Harmonic, System, backlash, find_orbit, follow
from gapwalk.bifurcation.special_point import Kind
from gapwalk.continuation.walk import EndReason
from gapwalk.orbit.floquet import largest_move
from tests.bifurcation.ranges.comparison import compare_ranges, random_system
from tests.systems import clutch
from tests.tiers import in_campaign, some_of


def symmetric(damping: float, clearance: float, stiffness: float, force: float) -> System:
    """One mass in a symmetric gap: its walks once went over to the branch of broken symmetry."""
    gap = backlash("c", {"a": 1.0}, clearance, stiffness, impact_damping=0.1)
    return System(["a"], [[1.0]], [[damping]], contacts=[gap], harmonics=[Harmonic(force, {"a": 1.0})], frequency=0.3)


FIRST = symmetric(0.05452960105824532, 1.0268257348382837, 24.43984639759848, 0.5741777063732986)
SECOND = symmetric(0.04653300143139204, 0.73001713018205, 8.722732160890653, 0.7157102174539421)
BY_HAND = {
    "first": ["grazing"] * 2 + ["branch-point"] * 2 + ["fold"] * 2 + ["grazing"] * 2,
    "second": ["grazing"] * 2 + ["branch-point"] * 2 + ["fold"] * 2 + ["grazing"] * 2 + ["fold"] * 2 + ["grazing"] * 2,
}


@pytest.mark.slow
@pytest.mark.parametrize(("name", "system"), [("first", FIRST), in_campaign("second", SECOND)])
def test_a_wide_range_has_the_special_points_of_a_narrow_one(name, system):
    start = find_orbit(system)
    narrow = follow(start, "frequency", 4.0)
    assert [special.kind.value for special in narrow.special_points] == BY_HAND[name]
    for to in (30.0, 300.0, 1e9):
        wide = follow(start, "frequency", to)
        assert wide.ends[-1].reason is EndReason.RANGE
        assert wide.unexplained == ()
        assert [s.kind for s in wide.special_points] == [s.kind for s in narrow.special_points]
        values = [special.value for special in narrow.special_points]
        assert [special.value for special in wide.special_points] == pytest.approx(values, rel=1e-9)


@pytest.mark.slow
def test_the_clutch_keeps_its_folds_over_the_widest_range():
    start = find_orbit(clutch(), frequency=0.15)
    narrow = follow(start, "frequency", 2.0).special_points
    wide = follow(start, "frequency", 1e9).special_points
    assert [special.kind for special in wide] == [special.kind for special in narrow]


@pytest.mark.parametrize("seed", some_of([11, 33]))
def test_random_systems_are_walked_alike_over_all_ranges(seed):
    comparison = compare_ranges(f"random {seed}", random_system(seed), verified=False)
    assert comparison.faults == []
    assert comparison.shared > 3


def test_what_special_points_do_not_explain_is_recorded():
    branch = follow(find_orbit(clutch(), frequency=1.9), "frequency", 0.5)
    assert branch.unexplained == ()
    fold = branch.special(Kind.FOLD)[0]
    without = replace(branch, special_points=tuple(each for each in branch.special_points if each is not fold))
    assert {each.text for each in without.unexplained} == {
        "0 unstable multipliers become 1, with nothing between",
        "the branch turns back, with 0 points of the kind fold between",
    }
    low, high = sorted((without.unexplained[0].first, without.unexplained[0].last))
    assert low - 1e-3 < fold.value < high + 1e-3


@pytest.mark.slow
def test_no_multiplier_turns_far_in_one_step():
    branch = follow(find_orbit(SECOND), "frequency", 300.0)
    steps = zip(branch.points[:-1], branch.points[1:], strict=True)
    far = [a for a, b in steps if largest_move(a.orbit.multipliers, b.orbit.multipliers) > 0.8]
    assert len(far) <= 6  # steps cut short at a graze


def grazes(branch: Branch) -> list[tuple[float, str]]:
    return [(special.value, special.contact) for special in branch.special("grazing")]


@pytest.mark.slow
def test_grazing_points_of_extremes_born_in_the_step_of_another_are_found():
    """In one step of the narrow walk two extremes are born and pass the breakpoint, while a third point grazes."""
    orbit = find_orbit(random_system(86))
    narrow, wide = (grazes(follow(orbit, "frequency", to)) for to in (0.65, 30.0))
    assert [contact for _, contact in narrow] == ["gap +"] * 5
    assert [value for value, _ in narrow] == pytest.approx([value for value, _ in wide[:5]], rel=1e-10)
    assert any(abs(value - 0.5684616456) < 1e-9 for value, _ in narrow)


@pytest.mark.slow
def test_both_sides_of_a_symmetric_motion_graze_past_a_stiff_graze():
    """The walk passes this graze by the depth of one touch; the touch on the other side is at the same place."""
    branch = follow(find_orbit(random_system(130)), "frequency", 0.6)
    assert not branch.unexplained
    found = grazes(branch)
    for side, other in (("gap +", "gap -"), ("gap -", "gap +")):
        mirrored = [value for value, contact in found if contact == other]
        assert [value for value, contact in found if contact == side] == pytest.approx(mirrored, rel=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "to", "near"), [(56, 30.0, 1.184836983), in_campaign(158, 4.0, 0.389621311)])
def test_the_error_of_a_branch_point_next_to_a_graze_is_known(seed: int, to: float, near: float):
    branch = follow(find_orbit(random_system(seed)), "frequency", to)
    point = min(branch.special("branch-point"), key=lambda special: abs(special.value - near))
    assert abs(point.value - near) < 1e-8
    assert point.uncertainty < 1e-8

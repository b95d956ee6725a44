"""Folds and flips: to which side they open and how they double, beside doubled motions found in other ways."""

from dataclasses import replace
from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from scipy.optimize import fsolve

from gapwalk import backlash
from gapwalk.bifurcation import Branch, Kind, SpecialPoint, follow, switch
from gapwalk.continuation import WalkOptions
from gapwalk.flow.flow import Flow
from gapwalk.model import Harmonic, System
from gapwalk.orbit import Shooting, find_orbit
from gapwalk.paper import case
from tests.computed import paper_response
from tests.independent import integrate
from tests.tiers import in_campaign, some_of

RANGES = {"13": (0.15, 2.0), "15": (0.15, 2.0), "29": (0.02, 1.0)}


@cache
def response(figure: str) -> Branch:
    """The motions of period 1 of a figure."""
    low, high = RANGES[figure]
    if figure == "29":
        return follow(find_orbit(case("29").at({"harmonic1.amplitude": low})), "harmonic1.amplitude", to=high)
    return paper_response(figure)


def flip_near(branch: Branch, value: float) -> SpecialPoint:
    return min(branch.special(Kind.FLIP), key=lambda flip: abs(flip.value - value))


@cache
def doubled(figure: str, value: float) -> Branch:
    return follow(flip_near(response(figure), value), response(figure).parameter, RANGES[figure])


def beside(flip: SpecialPoint, parameter: str, amplitude: float):
    """The doubled motion of about an amplitude, in units of the state, on the branch that leaves a flip."""
    (beginning,) = switch(flip, parameter, (flip.value - 1.0, flip.value + 1.0))
    corrector, first = beginning.corrector, beginning.first
    size = amplitude / np.abs((first.tangent * corrector.scales)[: len(flip.orbit.state)]).max()
    correction = corrector.correct(first.x + size * first.tangent, first.tangent)
    assert correction is not None
    return corrector.point(correction, first.tangent, size)


def check_label(flip: SpecialPoint, parameter: str) -> None:
    """Doubled motions within the amplitude that is stated lie, and are as stable, as the nature of their flip says."""
    gains = (flip.after.total - flip.before.total) * np.sign(flip.point.tangent[-1])  # towards larger values
    side = gains if flip.nature == "supercritical" else -gains
    unstable = min(flip.before.total, flip.after.total) + (flip.nature == "subcritical")
    motions = [beside(flip, parameter, share * flip.judged) for share in (0.01, 0.03)]
    assert {np.sign(motion.value - flip.value) for motion in motions} == {side}
    assert motions[0].instability.total == unstable  # farther off another multiplier may have left the circle


@pytest.mark.slow
@pytest.mark.parametrize("figure", some_of(RANGES, "29"))
def test_no_branch_contradicts_the_label_of_the_flip_that_it_leaves(figure):
    flips = response(figure).special(Kind.FLIP)
    assert len(flips) == {"13": 6, "15": 15, "29": 5}[figure]
    for flip in flips:
        assert flip.nature in ("supercritical", "subcritical")
        if flip.judged > 1e-5:  # motions closer to their parent cannot be told from it
            check_label(flip, response(figure).parameter)


@pytest.mark.parametrize(
    ("figure", "parent", "value", "nature"),
    [
        ("15", 0.0, 0.680789217, "subcritical"),
        in_campaign("15", 0.42119915, 0.413660092, "subcritical"),
        ("15", 0.24451470, 0.228975795, "supercritical"),  # but from 2e-4 on doubled motions lie on the other side
        in_campaign("13", 0.79853333, 0.684952333, "subcritical"),
    ],
)
def test_flips_beside_which_a_contact_grazes(figure, parent, value, nature):
    branch = doubled(figure, parent) if parent else response(figure)
    flip = flip_near(branch, value)
    assert flip.value == pytest.approx(value, abs=1e-9)
    assert (flip.nature, flip.nature_words) == (nature, f"{nature} up to {flip.judged:.1g}")
    check_label(flip, "frequency")


def test_a_graze_that_the_doubled_branch_only_passes_does_not_end_the_side_of_its_flip():
    """Long steps fail at these grazes; up to 1 % of the motion no doubled motion is on the other side."""
    flip, before = flip_near(response("15"), 0.268993443), Flow.calls
    again = flip.kind.judged(replace(flip, nature="", judged=0.0), "frequency", None)
    assert (again.nature, again.nature_words, again.judged) == ("supercritical", "supercritical", flip.judged)
    assert Flow.calls - before < 60
    branch = follow(flip, "frequency", to=RANGES["15"], walk=WalkOptions(max_points=60))
    judged = [each for each in branch.points[1:] if np.abs(each.orbit.state - flip.orbit.state).max() < flip.judged]
    assert len(judged) > 5
    assert {np.sign(each.value - flip.value) for each in judged} == {np.sign(judged[0].value - flip.value)}
    assert {np.sign(each.tangent[-1]) for each in judged} == {np.sign(judged[0].tangent[-1])}


@pytest.mark.slow
def test_doubled_motions_found_with_scipy_lie_where_a_subcritical_flip_has_them():
    flip = flip_near(response("15"), 0.680789217)
    motion = beside(flip, "frequency", 5e-4)
    exact = doubled_with_scipy(motion.orbit)
    gains = (flip.after.total - flip.before.total) * np.sign(flip.point.tangent[-1])
    assert np.sign(exact - flip.value) == -gains
    assert exact - flip.value == pytest.approx(motion.value - flip.value, rel=1e-2)


def doubled_with_scipy(orbit) -> float:
    """The frequency of the doubled motion whose halves are as far apart as those of an orbit, by SciPy alone."""
    half, system = orbit.period // 2, orbit.system
    start = orbit.state

    def ends(x):
        at = system.at(frequency=x[-1])
        period = 2.0 * np.pi / x[-1]
        return integrate(at, x[:-1], 2 * half, max_step=0.05, t_eval=[half * period, 2 * half * period])

    apart = ends(np.append(start, system.frequency))[0] - start

    def residual(x):
        middle, end = ends(x)
        return np.append((end - x[:-1]) / 1e-3, (apart @ (middle - x[:-1])) / (apart @ apart) - 1.0)

    found, _, is_found, message = fsolve(residual, np.append(start, system.frequency), xtol=1e-12, full_output=True)
    assert is_found in (1, 4, 5), message
    return float(found[-1])


@cache
def walk_with_folds_side_by_side() -> Branch:
    """Three folds within 0.005 of arclength, and a flip beside which two multipliers meet."""
    system = System(
        ["q1", "q2"],
        stiffness=[[1.7613281574802686, -1], [-1, 1.0712710118932809]],
        damping=[[0.09859421086456391, -0.026459833733941486], [-0.026459833733941486, 0.08033541352541396]],
        mass=np.diag([0.7388645149076992, 1.0749137996434386]),
        contacts=[backlash("c", {"q2": 1.0}, 0.984827568392969, 10.812361863198415, impact_damping=0.1)],
        mean={"q1": -0.4905836459158077},
        harmonics=[Harmonic(0.6279580145903336, {"q1": 1.0})],
        frequency=0.7710757874742222,
    )
    start = [1.1415820027210415, 0.7125267255093958, 0.2650975223418547, 0.6589648322486215]
    return follow(find_orbit(system, 2, start), "frequency", (0.271, 1.371))


def test_folds_in_one_step_open_one_to_each_side():
    branch = walk_with_folds_side_by_side()
    folds = branch.special(Kind.FOLD)
    assert folds[1].value == pytest.approx(0.7513482473365, abs=1e-12)
    for fold, following in pairwise(folds):  # a branch that turned back can only turn forth
        assert {fold.nature, following.nature} == {"opens to lower values", "opens to higher values"}
        assert (fold.value < following.value) == (fold.nature == "opens to higher values")


def test_multipliers_that_meet_in_the_step_of_a_flip_do_not_turn_its_nature_round():
    flip = flip_near(walk_with_folds_side_by_side(), 0.9056529850956)
    assert flip.value == pytest.approx(0.9056529850956, abs=1e-12)
    assert flip.nature == "supercritical"
    for each in walk_with_folds_side_by_side().special(Kind.FLIP):
        if each.judged > 1e-5:
            check_label(each, "frequency")


def test_the_nature_does_not_depend_on_segments():
    branch = follow(find_orbit(case("15"), frequency=0.7), "frequency", to=0.66, method=Shooting(3))
    (flip,) = branch.special(Kind.FLIP)
    other = flip_near(response("15"), flip.value)
    assert flip.nature == other.nature == "subcritical"
    assert flip.judged == pytest.approx(other.judged, rel=0.3)


def test_a_point_without_a_single_critical_multiplier_is_left_without_a_nature():
    flip = flip_near(response("13"), 1.3318)
    odd = replace(flip, before=flip.after, nature="", judged=0.0)
    assert odd.kind.judged(odd, "frequency", None).nature == ""

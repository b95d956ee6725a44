"""Special points against other codes, closed forms, and walks with much smaller steps."""

import itertools
import json
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import brentq, fsolve

from gapwalk.bifurcation import Kind, follow
from gapwalk.bifurcation.special_point import in_runs, words_of
from gapwalk.continuation import EndReason, WalkOptions
from gapwalk.errors import ModelError
from gapwalk.flow.flow import PERIOD, flow_of
from gapwalk.model import Contact, Harmonic, Side, Stage, System
from gapwalk.model.coefficients import coefficients_of
from gapwalk.orbit import Orbit, find_orbit
from gapwalk.paper import case, frequency_responses
from tests.computed import paper_response
from tests.independent import integrate
from tests.tiers import in_campaign, keeps, some_of

REFERENCE = json.loads((Path(__file__).parents[1] / "data" / "special_points.json").read_text())["figures"]


def response(figure: str, walk: WalkOptions):
    return follow(find_orbit(case(figure), frequency=2.0), "frequency", to=0.15, walk=walk)


@pytest.mark.parametrize("figure", ["12", "13"])
def test_special_points_that_two_other_codes_agree_on(figure):
    found = [special for special in paper_response(figure).special_points if special.kind is not Kind.GRAZING]
    assert len(found) == len(REFERENCE[figure])
    for expected in REFERENCE[figure]:
        special = min(found, key=lambda s: abs(s.value - expected["W"]) + 10 * (s.kind != expected["kind"]))
        assert special.kind == expected["kind"]
        assert special.value == pytest.approx(expected["W"], abs=1e-9)
        # the fold at 0.42675 is given to six digits only
        exact = 1e-9 if len(str(expected["half"])) > 10 else 2e-6
        assert special.orbit.measure("half.q1") == pytest.approx(expected["half"], abs=exact)
        assert special.orbit.measure("max.q1") == pytest.approx(expected["max"], abs=exact)
        assert special.uncertainty < 1e-10


def test_many_grazes_after_each_other_are_one_line():
    graze, fold = (paper_response("13").special(kind)[0] for kind in ("grazing", "fold"))
    run, *others = in_runs((*[graze] * 30, fold, graze))
    assert (len(run), *map(len, others)) == (30, 1, 1)
    assert [words_of(run)[each] for each in ("kind", "±", "contact")] == ["30 grazing", "", "stage2"]


@keeps("12", "13", "15")
@pytest.mark.parametrize("figure", some_of(frequency_responses(), "9b", "12", "13", "15", "23b", "25"))
def test_every_frequency_response_of_the_paper_runs_through(figure):
    branch = paper_response(figure)
    assert branch.ends[-1].reason is EndReason.RANGE
    assert branch.points[-1].value == 0.15
    for a, b in itertools.pairwise(branch.points):
        assert np.linalg.norm(b.x - a.x) <= 1.05 * WalkOptions().largest_step
    marks = sorted([p.arclength for p in branch.points] + [s.point.arclength for s in branch.special_points])
    assert marks[0] == 0.0
    changes_are_explained(branch)


def changes_are_explained(branch):
    """Every change of the count of unstable multipliers stands at a special point, and none stands there in vain."""
    for a, b in itertools.pairwise(branch.points):
        between = [s for s in branch.special_points if a.arclength < s.point.arclength <= b.arclength]
        change = sum(s.after.total - s.before.total for s in between)
        assert b.instability.total - a.instability.total == change
        if not [s for s in between if s.kind is not Kind.GRAZING]:
            assert a.instability.total == b.instability.total
    for special in branch.special_points:
        if special.kind in (Kind.FLIP, Kind.FOLD):
            assert abs(special.after.total - special.before.total) == 1
            assert special.multiplier == pytest.approx(-1.0 if special.kind is Kind.FLIP else 1.0, abs=1e-6)
        if special.kind is Kind.NEIMARK_SACKER:
            assert abs(special.after.total - special.before.total) == 2
            assert abs(special.multiplier) == pytest.approx(1.0, abs=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("figure", some_of(["13", "15", "23b", "26b"], "13"))
def test_nothing_is_missed_or_invented_beside_a_walk_with_ten_times_smaller_steps(figure):
    coarse = paper_response(figure)
    fine = response(figure, walk=WalkOptions(initial_step=2e-4, largest_step=2e-3))
    assert len(fine.points) > 3 * len(coarse.points)
    assert [s.kind for s in coarse.special_points] == [s.kind for s in fine.special_points]
    assert [s.value for s in coarse.special_points] == pytest.approx([s.value for s in fine.special_points], abs=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("figure", frequency_responses())
def test_nothing_is_missed_or_invented_in_any_figure_whatever_the_steps(figure):
    fine = response(figure, walk=steps(0.001)).special_points
    for longest in (0.005, 0.008, 0.01, 0.011, 0.014, 0.02):
        coarse = response(figure, walk=steps(longest)).special_points
        assert [s.kind for s in coarse] == [s.kind for s in fine]
        assert [s.value for s in coarse] == pytest.approx([s.value for s in fine], abs=1e-9)


def steps(longest: float) -> WalkOptions:
    return WalkOptions(initial_step=min(0.002, longest / 5), largest_step=longest)


@pytest.mark.parametrize("longest", [in_campaign(0.005), 0.014, in_campaign(0.021)])
def test_a_pair_of_flips_within_one_step_is_found(longest):
    # two multipliers meet, one just passes -1 and comes back, and both part again
    flips = response("9b", walk=steps(longest)).special(Kind.FLIP)
    pair = [flip.value for flip in flips if 0.18 < flip.value < 0.19]
    assert pair == pytest.approx([0.1842869819, 0.1833494533], abs=1e-9)


@pytest.mark.parametrize("longest", [in_campaign(0.005), in_campaign(0.011), 0.021])
def test_grazing_points_are_where_a_contact_touches_whatever_the_steps(longest):
    # an extremum is born by the breakpoint, so it cannot be tracked over the step; two may change sides at once
    grazes = response("23b", walk=steps(longest)).special(Kind.GRAZING)
    pair = [special for special in grazes if 0.3126 < special.value < 0.3128]
    assert [special.value for special in pair] == pytest.approx([0.3127323524, 0.3126295165], abs=1e-9)


def test_another_integrator_sees_the_touch_at_a_grazing_point():
    special = next(each for each in paper_response("13").special(Kind.GRAZING) if each.value < 1.0)
    system, full = special.orbit.system, 2 * np.pi / special.value
    theta = min(zip(*special.orbit.turns[0], strict=True), key=lambda turn: abs(abs(turn[1]) - 1.0))[0]
    around = np.array([theta - 0.01, theta, theta + 0.01, 2 * np.pi]) / (2 * np.pi) * full
    before, there, after, _ = integrate(system, special.orbit.state, t_eval=around)[:, 0]
    assert abs(there) == pytest.approx(system["stage2.clearance"], abs=1e-7)
    assert (there - before) * (after - there) < 0.0


def test_a_pair_of_grazing_points_within_one_step_is_found():
    # an extremum is born by the breakpoint and leaves it at once: neither end of the step shows a trace of the pair
    branch = paper_response("23b")
    pair = [s for s in branch.special(Kind.GRAZING) if 0.3126 < s.value < 0.3128]
    assert len(pair) == 2
    assert abs(pair[0].value - pair[1].value) < 2e-4
    assert abs(pair[0].point.arclength - pair[1].point.arclength) < WalkOptions().largest_step / 4


FREQUENCY, PHASE = 0.5, 0.3


def two_lines(theta: float, second: float, derivative: int = 0) -> float:
    """A linear motion under a load of two harmonics, the second of any amplitude, or its derivatives by theta."""
    orders = np.array([1.0, 2.0])
    loads = np.array([1.0, second * np.exp(1j * PHASE)])
    lines = loads / (1.0 - (orders * FREQUENCY) ** 2 + 0.1j * orders * FREQUENCY)
    return float((lines * (1j * orders) ** derivative * np.exp(1j * orders * theta)).real.sum())


def graze_of_two_lines(theta: float, second: float, depth: float) -> float:
    """The amplitude of the second harmonic at which an extreme is at a depth: by Newton's method on the closed form."""
    found, _, is_found, _ = fsolve(
        lambda v: [two_lines(v[0], v[1], 1), two_lines(v[0], v[1]) - depth],
        [theta, second],
        xtol=1e-13,
        full_output=True,
    )
    assert is_found == 1
    return float(found[1])


@pytest.mark.parametrize("aside", [1e-4, 1e-5])
def test_a_pair_that_grazes_as_soon_as_its_extremes_are_there_is_found(aside):
    # with growing second harmonic a pair of extremes is born; a breakpoint beside that place changes next to nothing
    theta, second = fsolve(lambda v: [two_lines(v[0], v[1], 1), two_lines(v[0], v[1], 2)], [4.49, 0.064], xtol=1e-13)
    depth = two_lines(theta, second) + aside
    spring = Contact("gap", {"x": 1.0}, (Stage(-depth, 1e-14, side=Side.NEGATIVE),))
    loads = [Harmonic(1.0, {"x": 1.0}), Harmonic(0.01, {"x": 1.0}, order=2, phase=PHASE)]
    system = System(("x",), [[1.0]], [[0.1]], contacts=[spring], harmonics=loads, frequency=FREQUENCY)
    branch = follow(find_orbit(system), "harmonic2.amplitude", to=0.2)
    starts = [(theta + turn, second + more) for turn in (-0.15, -0.01, 0.01, 0.15) for more in (1e-5, 1e-3)]
    found = {round(graze_of_two_lines(*start, depth), 13) for start in starts}
    assert len(found) == 3
    assert [each.kind for each in branch.special_points] == [Kind.GRAZING] * 3
    assert [each.value for each in branch.special_points] == pytest.approx(sorted(found), abs=1e-11)


AMPLITUDE = "harmonic1.amplitude"


def mirrored(orbit: Orbit) -> Orbit:
    """The same motion half a period later, where the load has the other sign."""
    later = flow_of(orbit.system).integrate(coefficients_of(orbit.system), orbit.state, 0.0, PERIOD / 2).state
    return find_orbit(orbit.system.at({AMPLITUDE: -orbit.system[AMPLITUDE]}), orbit.period, later)


@pytest.mark.slow
@pytest.mark.parametrize(("value", "longest"), [in_campaign(0.383, 0.01), (0.3882, 0.02), in_campaign(0.4025, 0.003)])
def test_mirror_images_have_mirrored_special_points_wherever_they_are_entered(value, longest):
    # over the amplitude of one load the system is its own mirror image, with the other sign, half a period later
    start = find_orbit(case("28"), 2, [2.46807309, 1.11607739, 0.01055129, -0.01674301], at={AMPLITUDE: 0.393})
    whole = follow(start, AMPLITUDE, to=(-1.0, 1.0))
    orbit = min(whole.points, key=lambda point: abs(point.value - value)).orbit
    image = mirrored(orbit)
    # with steps ten times smaller
    expected = [0.3832405852, 0.3834140692, 0.3934664613, 0.4040027333, 0.4043030548]
    for to in ((-1.0, 1.0), (0.2, 0.6)):
        one = follow(orbit, AMPLITUDE, to=to, walk=steps(longest))
        other = follow(image, AMPLITUDE, to=(-to[1], -to[0]), walk=steps(longest))
        for branch, sign in ((one, 1.0), (other, -1.0)):
            assert [end.reason for end in branch.ends] == [EndReason.JOINED] * 2
            assert len(branch.special(Kind.FOLD)) == 1
            assert sorted(sign * each.value for each in branch.special_points) == pytest.approx(expected, abs=1e-9)
            ends = sorted(sign * end.value for end in branch.ends)
            assert ends == pytest.approx([0.3823772106, 0.4036304193], abs=1e-8)


def preloaded(mean: float) -> System:
    """A linear oscillator as long as its stage stays closed; no contact damping, so that the closed form holds."""
    contact = Contact("gap", {"q1": 1.0}, (Stage(1.0),), {"q1": 0.9, "q3": -0.54})
    return System(
        ("q1", "q3"),
        [[0.1, -0.6], [-0.06, 1.1]],
        [[0.04, -0.04], [-0.04, 0.06]],
        contacts=[contact],
        mean={"q1": mean, "q3": 0.25},
        harmonics=[Harmonic(0.25, {"q1": 1.0})],
        frequency=2.0,
    )


def lowest_deflection(system: System, frequency: float) -> float:
    """Least q1 of the steady motion with the stage closed all the time: static offset less the linear amplitude."""
    d, e = np.array([0.9, -0.54]), np.array([1.0, 0.0])
    closed = system.matrix("stiffness") + np.outer(d, e)
    static = np.linalg.solve(closed, np.array([system["mean.q1"], 0.25]) + d * 1.0)
    dynamic = closed - frequency**2 * np.eye(2) + 1j * frequency * system.matrix("damping")
    return static[0] - abs(np.linalg.solve(dynamic, [0.25, 0.0])[0])


@keeps("0.25")
@pytest.mark.parametrize("mean", [0.25, 0.5])
def test_linear_motion_first_grazes_where_its_amplitude_uses_up_the_preload(mean):
    system = preloaded(mean)
    grid = np.linspace(2.0, 0.7, 500)
    first = next(k for k, w in enumerate(grid) if lowest_deflection(system, w) < 1.0)
    expected = brentq(lambda w: lowest_deflection(system, w) - 1.0, grid[first], grid[first - 1], xtol=1e-14)
    branch = follow(find_orbit(system), "frequency", to=0.6)
    first = branch.special(Kind.GRAZING)[0]
    assert first.value == pytest.approx(expected, abs=1e-10)
    assert first.contact == "gap +"
    before = [p for p in branch.points if p.arclength < first.point.arclength]
    assert all(p.orbit.pattern == "closed+" for p in before)


def symmetric(frequency: float = 3.0) -> System:
    """A symmetric gap with no mean load: its symmetric motions lose their symmetry at branch points."""
    gap = Contact("gap", {"x": 1.0}, (Stage(0.5, 4.0),))
    return System(("x",), [[0.2]], [[0.08]], contacts=[gap], harmonics=[Harmonic(1.0, {"x": 1.0})], frequency=frequency)


def test_symmetry_breaking_is_a_branch_point_where_asymmetric_motions_are_born():
    branch = follow(find_orbit(symmetric()), "frequency", to=0.3)
    assert len(branch.special(Kind.BRANCH_POINT)) >= 3
    assert len(branch.special(Kind.FOLD)) >= 4
    changes_are_explained(branch)
    breaking = branch.special(Kind.BRANCH_POINT)[0]
    assert breaking.multiplier == pytest.approx(1.0, abs=1e-7)
    assert breaking.uncertainty < 1e-9
    again = follow(find_orbit(symmetric(2.5)), "frequency", to=0.8).special(Kind.BRANCH_POINT)[0]
    assert again.value == pytest.approx(breaking.value, abs=1e-10)
    assert abs(breaking.point.tangent[-1]) > 1e-2  # no fold
    for point in branch.points[::20]:
        motion = point.orbit.motion(64)
        assert motion.q[32:64, 0] == pytest.approx(-motion.q[:32, 0], abs=1e-8)
    # beyond it the symmetric motion is unstable, and the stable ones nearby are not symmetric; followed back, they
    # turn at the branch point (a pitchfork is a fold of the asymmetric branch)
    beside = find_orbit(symmetric(breaking.value - 0.01))
    assert beside.stable
    assert abs(beside.measure("mean.x")) > 1e-3
    back = follow(beside, "frequency", to=breaking.value + 0.05)
    assert back.ends[-1].reason is EndReason.JOINED
    assert back.ends[-1].value == pytest.approx(breaking.value, abs=1e-9)


def test_special_points_say_how_stability_changes():
    branch = paper_response("13")
    flips = branch.special("flip")
    assert [special.change for special in flips[:2]] == ["stable -> unstable(1)", "unstable(1) -> stable"]
    hopf = branch.special(Kind.NEIMARK_SACKER)
    assert [special.change for special in hopf] == ["stable -> unstable(2)", "unstable(2) -> stable"]
    assert abs(hopf[0].multiplier) == pytest.approx(1.0, abs=1e-9)
    assert hopf[0].multiplier.imag > 0
    assert "flip at 1.331838029" in repr(flips[0])


def test_a_kind_without_points_is_empty_and_one_that_does_not_exist_is_an_error():
    linear = System(["x"], [[1.0]], [[0.1]], harmonics=[Harmonic(1.0, {"x": 1.0})])
    branch = follow(find_orbit(linear, frequency=0.5), "frequency", to=0.52)
    assert branch.special("fold") == branch.special(Kind("of mine")) == ()
    with pytest.raises(ModelError, match=r"no kind of special point 'graze'; kinds of special points are .* grazing"):
        branch.special("graze")

"""Stages whose force begins with a jump: beside their grazes a multiplier is unbounded, as beside a rigid stop."""

from dataclasses import replace
from itertools import repeat

import numpy as np
import pytest
from scipy.optimize import fsolve, minimize_scalar

import gapwalk as gw
from gapwalk.bifurcation.branch_start import has_parent, value_ahead
from gapwalk.bifurcation.steps_over_corners import smooth_between
from gapwalk.flow.event_rule import jumping_switches
from gapwalk.verification.verify_special_points import Track
from tests.bifurcation.alike.comparison import compare_ways, differences, ways
from tests.bifurcation.alike.kinds import machine_of
from tests.computed import once
from tests.tiers import in_campaign, some_of

B, K, P, C, F = 1.1008242922933908, 1.107877872602049, 0.03230478179428088, 0.20880532034255395, 0.511866097372504

SHORTER = gw.WalkOptions(largest_step=6e-3)


def mass(stage: gw.Stage, damping: float, force: float, frequency: float, phase: float = 0.0) -> gw.System:
    contact = gw.Contact("p", {"x": 1.0}, [stage], law="piecewise")
    load = gw.Harmonic(force, {"x": 1.0}, phase=phase)
    return gw.System(["x"], [[1.0]], [[damping]], contacts=[contact], harmonics=[load], frequency=frequency)


def pressed(stage: gw.Stage, mean: float, force: float, frequency: float) -> gw.System:
    contact = gw.Contact("p", {"x": 1.0}, [stage], law="piecewise")
    load = gw.Harmonic(force, {"x": 1.0})
    return gw.System(["x"], [[1.0]], [[C]], contacts=[contact], mean={"x": mean}, harmonics=[load], frequency=frequency)


def softened(amplitude: float, stiffness: float, force: float) -> float:
    """The lower frequency at which the oscillator of both springs has an amplitude: closed form."""
    own = 1.0 + stiffness
    squares = np.roots([1.0, C**2 - 2.0 * own, own**2 - (force / amplitude) ** 2]).real
    return float(np.sqrt(squares.min()))


def touching(amplitude: float, damping: float, force: float) -> list[float]:
    """The frequencies at which a linear oscillator has an amplitude: closed form, in increasing order."""
    return sorted(np.sqrt(np.roots([1.0, damping**2 - 2.0, 1.0 - (force / amplitude) ** 2]).real))


@once
def beside_a_fold() -> gw.Branch:
    stage = gw.Stage(B, K, side="positive", numbers={"preload": P})
    return gw.follow(gw.find_orbit(mass(stage, C, F, 1.1)), "frequency", 1.9)


def piece(stiffness: float, mean: float, time: float, start: tuple[float, float], w: float, angle: float) -> np.ndarray:
    """Position and velocity after a time of a linear oscillator under a mean load and F cos(w t + angle)."""
    forced = F / (stiffness - w**2 + 1j * C * w) * np.exp(1j * angle)
    roots = np.roots([1.0, C, stiffness])
    own = np.linalg.solve(
        np.array([[1.0, 1.0], roots]), [start[0] - mean / stiffness - forced.real, start[1] - (1j * w * forced).real]
    )
    free, turned = own * np.exp(roots * time), forced * np.exp(1j * w * time)
    return np.array(
        [mean / stiffness + turned.real + free.sum().real, (1j * w * turned).real + (roots * free).sum().real]
    )


def test_a_fold_beside_a_graze_is_found():
    branch = beside_a_fold()
    assert branch.ends[-1].reason.name == "RANGE"
    fold, graze = branch.special_points
    assert (fold.kind, graze.kind) == ("fold", "grazing")
    assert (fold.change, graze.change) == ("stable -> unstable(1)", "unstable(1) -> stable")
    assert abs(graze.value - touching(B, C, F)[-1]) <= graze.uncertainty < 1e-11

    def frequency(speed: float) -> float:
        """The frequency of the motion that closes the stage at a speed; it is largest at the fold."""

        def open_ends(unknowns: np.ndarray) -> list[float]:
            angle, closed, w = unknowns
            inside = piece(1.0 + K, K * B - P, closed, (B, speed), w, angle)
            outside = piece(1.0, 0.0, 2.0 * np.pi / w - closed, (B, inside[1]), w, angle + w * closed)
            return [(inside[0] - B) / speed, outside[0] - B, outside[1] - speed]

        return float(fsolve(open_ends, guess, xtol=1e-12)[2])

    event = next(each for each in fold.orbit.events if each.enters)
    leaves = next(each for each in fold.orbit.events if not each.enters)
    guess = [event.theta, (leaves.theta - event.theta) / fold.value, fold.value]
    near = abs(event.velocity)
    largest = minimize_scalar(lambda speed: -frequency(speed), (0.9 * near, near, 1.1 * near), tol=1e-8)
    assert fold.value == pytest.approx(-largest.fun, abs=1e-11)


@pytest.mark.slow
def test_verification_refuses_stable_motions_on_both_sides_of_such_a_graze():
    branch = beside_a_fold()
    assert gw.verify(branch).ok
    graze = branch.special_points[-1]
    points = [each for each in branch.points if each.stable]
    assert len(points) < len(branch.points)
    stable = replace(graze, before=graze.after)
    missed = replace(branch, points=tuple(points), special_points=(stable,))
    assert any("no multiplier is unstable before p + grazes" in each.text for each in missed.unexplained)
    assert not gw.verify(missed).ok


@pytest.mark.parametrize("phase", [0.0, *some_of([1.0, 2.0, 3.0, 4.0, 5.0], 4.0)])
def test_a_walk_goes_on_beyond_the_first_touch_from_any_phase(phase):
    stage = gw.Stage(1.0, 3.0, side="positive", numbers={"preload": 0.05})
    branch = gw.follow(gw.find_orbit(mass(stage, 0.08, 0.5, 0.4, phase)), "frequency", 2.0)
    assert branch.ends[-1].reason.name == "RANGE"
    assert branch.unexplained == ()
    kinds = ["grazing", "flip", "fold", "fold", "fold", "grazing"]
    assert [special.kind for special in branch.special_points] == kinds
    grazes = [special.value for special in branch.special("grazing")]
    assert grazes == pytest.approx(touching(1.0, 0.08, 0.5), abs=1e-11)
    others = [0.7877663599, 1.2798928297, 1.2207489251, 1.2212487604]
    assert [special.value for special in branch.special_points if special.kind != "grazing"] == pytest.approx(
        others, abs=2e-9
    )


@pytest.mark.parametrize("side", ["positive", "both"])
def test_a_walk_goes_on_where_a_pressed_stage_opens_for_a_moment(side):
    mean, k, preload = 6.0, 3.0, 0.3
    stage = gw.Stage(1.0, k, side=side, numbers={"preload": preload})
    system = pressed(stage, mean, force=2.0, frequency=1.0)
    branch = gw.follow(gw.find_orbit(system), "frequency", 1.56)
    assert branch.ends[-1].reason.name == "RANGE"
    assert branch.unexplained == ()
    # pressed, it swings about the rest of both springs; beyond 1.56 it crosses the whole gap
    swing = (mean + k - preload) / (1.0 + k) - 1.0
    graze = branch.special("grazing")[0]
    assert graze.value == pytest.approx(softened(swing, k, 2.0), abs=1e-10)
    assert graze.after.total == 1


def test_a_preload_without_a_gap_is_touched_where_the_motion_reaches_zero():
    mean, k, preload = 2.0, 0.5, 0.3
    system = pressed(gw.Stage(0.0, k, numbers={"preload": preload}), mean, force=0.8, frequency=0.9)
    assert system.gapless == (False, False)
    assert pressed(gw.Stage(0.0, k), mean, force=0.8, frequency=0.3).gapless == (True, True)
    branch = gw.follow(gw.find_orbit(system), "frequency", 0.91)
    assert branch.ends[-1].reason.name == "RANGE"
    assert branch.unexplained == ()
    grazes = branch.special("grazing")
    assert {graze.contact for graze in grazes[:2]} == {"p +", "p -"}
    # until then it swings about the rest of both springs, as if they went on beyond zero
    value = softened((mean - preload) / (1.0 + k), k, 0.8)
    assert [graze.value for graze in grazes[:2]] == pytest.approx([value, value], abs=1e-10)


@pytest.mark.slow
def test_a_gap_of_no_width_that_is_touched_from_both_sides_at_once_is_verified():
    contact = gw.Contact("p", {"x": 1.0}, [gw.Stage(0.0, 0.5, numbers={"preload": 0.3})], law="piecewise")
    loads = [gw.Harmonic(1.0, {"x": 1.0}), gw.Harmonic(0.9, {"x": 1.0}, order=3, phase=0.4)]
    system = gw.System(["x"], [[1.0]], [[0.2]], contacts=[contact], harmonics=loads, frequency=0.5)
    branch = gw.follow(gw.find_orbit(system), "frequency", 2.0)
    assert branch.ends[-1].reason.name == "RANGE"
    assert [graze.contact for graze in branch.special("grazing")] == ["p +", "p -", "p -", "p +"]
    assert gw.verify(branch).ok


def test_a_search_begins_in_motion_where_a_jump_holds_rest():
    system = mass(gw.Stage(0.0, 0.5, numbers={"preload": 0.3}), 0.2, 0.8, 0.9, phase=1.4)
    with pytest.raises(gw.errors.FlowError, match="comes to rest on the breakpoint 0 of p"):
        gw.integrate(system, np.zeros(2))  # the load is less than the preload at first
    orbit = gw.find_orbit(system)
    assert np.abs(gw.integrate(system, orbit.state).states[-1] - orbit.state).max() < 1e-9
    assert orbit.closings == (1, 1)


def test_an_event_at_the_start_of_a_segment_is_passed_with_all_starts_moved():
    stage, method = gw.Stage(1.0, 3.0, side="positive", numbers={"preload": 0.5}), gw.Shooting(segments=4)
    event = gw.find_orbit(mass(stage, 0.08, 0.5, 0.85)).events[0].theta
    start = gw.find_orbit(mass(stage, 0.08, 0.5, 0.85, event - 0.5 * np.pi), method=method)
    walk = gw.WalkOptions(max_points=3, initial_step=1e-4, largest_step=1e-4)
    branch = gw.follow(start, "frequency", 0.9, method=method, walk=walk)
    corrector = Track("P1-1", branch).corrector_at(branch.points[0])
    elsewhere, first, last = smooth_between(corrector, *branch.points[:2])
    assert elsewhere is not corrector
    assert elsewhere.equation.begin > 1e-3
    ahead = (last.x - first.x) / np.linalg.norm(last.x - first.x)
    assert ahead @ first.tangent == pytest.approx(1.0, abs=1e-6)
    own = branch.points[1].x - branch.points[0].x  # where the force jumps, the path of the state has a corner
    assert own / np.linalg.norm(own) @ branch.points[0].tangent < 1.0 - 1e-6


def test_what_begins_with_the_speed_of_a_touch_or_is_slight_does_not_jump():
    def jumps(contact: gw.Contact) -> bool:
        return bool(jumping_switches(gw.System(["x"], [[1.0]], contacts=[contact])))

    def preloaded(preload: float, **numbers: float) -> gw.Contact:
        return gw.Contact(
            "p", {"x": 1.0}, [gw.Stage(1.0, 3.0, numbers={"preload": preload})], law="piecewise", **numbers
        )

    assert jumps(preloaded(0.05))
    assert jumps(preloaded(-0.05))
    assert jumps(preloaded(0.0, offset=0.1))
    assert jumps(gw.rigid_stop("s", {"x": 1.0}, 1.0, 0.5))
    assert not jumps(preloaded(0.0))
    assert not jumps(preloaded(1e-7))
    for law, damping in (("hunt-crossley", "impact_damping"), ("viscous", "viscous_damping")):
        assert not jumps(gw.Contact("s", {"x": 1.0}, [gw.Stage(1.0, 3.0)], law=law, **{damping: 0.5}))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("seed", "walk"),
    [(16, gw.WalkOptions(largest_step=0.08)), *map(in_campaign, [12, 16, 18, 21, 25, 31, 33], repeat(SHORTER))],
)
def test_random_machines_have_one_list_of_special_points(seed, walk):
    comparison = compare_ways(f"preload {seed}", machine_of(f"preload {seed}"), verified=False, fine=walk)
    assert comparison.faults == []
    assert comparison.stuck == 0
    assert comparison.shared > 2


@pytest.mark.slow
def test_stated_errors_do_not_depend_on_the_units():
    machine = machine_of("preload 12")
    here = {way.name: way for way in ways(machine, gw.find_orbit(machine.system))}
    plain, other = (here[name].walked().special("grazing") for name in ("default steps", "other units"))
    assert len(plain) == len(other) == 1
    for a, b in zip(plain, other, strict=True):
        assert b.uncertainty / b.value == pytest.approx(a.uncertainty / a.value, rel=3.0)


@pytest.mark.slow
def test_two_folds_within_one_step_are_found():
    """In these units a step begins before both and ends beyond both, and the slopes at its ends tell nothing."""
    machine = machine_of("preload 59")
    here = {way.name: way for way in ways(machine, gw.find_orbit(machine.system))}
    values = [each.value for each in here["other units"].walked().special("fold")]
    assert values == pytest.approx([691.0264752, 1516.652716, 1494.009076, 1494.266708], rel=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [20, 40, 42])
def test_verification_accepts_a_fold_or_a_flip_close_to_a_graze(seed):
    """The walk steps over both at once, 4e-8 to 5e-7 apart, or ends 1e-9 before a graze."""
    machine = machine_of(f"preload {seed}")
    assert gw.verify(next(ways(machine, gw.find_orbit(machine.system))).walked()).breaches == ()


@pytest.mark.slow
def test_a_comparison_names_what_only_one_walk_has():
    machine = machine_of("preload 12")
    plain = next(ways(machine, gw.find_orbit(machine.system)))
    branch = plain.walked()
    fewer = replace(branch, special_points=branch.special_points[:-1])
    moved = replace(branch.special_points[0], uncertainty=1e-15, point=branch.points[0])
    assert differences(plain, branch, plain, branch) == []
    assert "missing" in differences(plain, branch, plain, fewer)[0]
    assert "in place of" in differences(plain, branch, plain, replace(branch, special_points=(moved,)))[0]


def test_a_doubled_branch_joins_only_a_parent_that_is_there():
    stage = gw.Stage(1.0, 3.0, side="positive", numbers={"preload": 0.05})
    branch = gw.follow(gw.find_orbit(mass(stage, 0.08, 0.5, 0.75)), "frequency", 0.85)
    (flip,) = branch.special("flip")
    doubled = gw.follow(flip, "frequency", (0.6, 0.9))
    assert doubled.ends[-1].reason.name == "WITHIN_ROUNDING"  # at the graze, which the motion of period 1 meets too
    assert doubled.ends[-1].value == pytest.approx(touching(1.0, 0.08, 0.5)[0], abs=1e-8)
    (first, beside), (before, last) = doubled.points[:2], doubled.points[-3:-1]
    equation = gw.Shooting().pose(last.orbit.system, "frequency", 2)
    assert has_parent(beside, equation, first.value)
    assert not has_parent(last, equation, doubled.ends[-1].value)
    assert not has_parent(last, equation, 0.8)
    assert value_ahead(last, before, 1.0) is None

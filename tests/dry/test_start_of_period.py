"""Branches on which an event passes the start of the period: the state there jumps, and nothing else does."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.bifurcation.orbit_on_branch import Curve
from gapwalk.bifurcation.steps_over_corners import smooth_between
from gapwalk.continuation.walk import EndReason
from gapwalk.flow.flow import PERIOD
from gapwalk.model.contact import Contact, Side, Stage, friction
from gapwalk.model.loads import Harmonic
from gapwalk.model.system import System
from gapwalk.verification.verification import Check, Ledger
from gapwalk.verification.verify_branch import _verify_gaps
from gapwalk.verification.verify_special_points import Track
from tests.tiers import keeps

RANGE = (0.65, 1.0)


def impacts(phase: float) -> System:
    """Make an impact oscillator by the phase of its load: at 0 an impact passes theta = 0, at 4 none does."""
    wall = Contact("wall", {"x": 1.0}, [Stage(1.0, side=Side.POSITIVE)], law="rigid", restitution=0.8)
    return System(["x"], [[1.0]], [[0.1]], contacts=[wall], harmonics=[Harmonic(1.0, {"x": 1.0}, 1, phase)])


def followed(phase: float, within: tuple[float, float] = RANGE) -> gw.Branch:
    return gw.follow(gw.find_orbit(impacts(phase), frequency=0.95), "frequency", within)


@pytest.fixture(scope="module")
def branches() -> tuple[gw.Branch, gw.Branch]:
    return followed(0.0), followed(4.0)


def jump(branch: gw.Branch) -> int:
    """Return the number of the point after which the state at the start jumps: its velocity changes sign."""
    jumps = [abs(b.orbit.state[1] - a.orbit.state[1]) for a, b in zip(branch.points, branch.points[1:], strict=False)]
    return int(np.argmax(jumps))


@pytest.mark.slow
def test_the_branch_has_the_special_points_and_ends_of_one_with_shifted_excitation(
    branches: tuple[gw.Branch, gw.Branch],
) -> None:
    passing, free = branches
    at = jump(passing)
    before, after = (passing.points[at + each].orbit for each in (0, 1))
    assert after.state[1] * before.state[1] < 0.0
    assert before.events[0].theta > 6.2
    assert [str(each.kind) for each in passing.special_points] == [str(each.kind) for each in free.special_points]
    values = [[each.value for each in branch.special_points] for branch in branches]
    assert len(values[0]) == 2
    assert values[0] == pytest.approx(values[1], abs=1e-11)
    assert [end.value for end in passing.ends] == [end.value for end in free.ends]


def test_orbits_are_found_and_known_where_the_state_jumps(branches: tuple[gw.Branch, gw.Branch]) -> None:
    passing, free = branches
    first, last = (passing.points[jump(passing) + each].value for each in (0, 1))
    for value in np.linspace(first, last, 7):
        (own,), (other,) = Curve(passing).orbits_at(value), Curve(free).orbits_at(value)
        assert own.extremes == pytest.approx(other.extremes, abs=1e-9)
        assert np.poly(own.multipliers) == pytest.approx(np.poly(other.multipliers), abs=1e-8)
        assert Curve(passing).holds(own)


def test_verification_finds_no_gap_at_the_jump(branches: tuple[gw.Branch, gw.Branch]) -> None:
    branch, ledger = branches[0], Ledger()
    _verify_gaps(ledger, Track("branch", branch))
    assert ledger.verification.ok, ledger.verification.words
    assert ledger.verification.worst(Check.GAPS).size <= 1.0


def test_the_jump_is_passed_in_a_narrow_range(branches: tuple[gw.Branch, gw.Branch]) -> None:
    (orbit,) = Curve(branches[0]).orbits_at(0.905)
    branch = gw.follow(orbit, "frequency", 0.9)
    assert branch.ends[-1].reason is EndReason.RANGE
    assert branch.points[0].orbit.events[0].theta < 0.01
    assert branch.points[-1].orbit.events[0].theta > 6.27


def test_the_other_section_has_the_same_orbits_and_multipliers(branches: tuple[gw.Branch, gw.Branch]) -> None:
    branch = branches[0]
    first, last = (branch.points[jump(branch) + each] for each in (0, 1))
    corrector = Curve(branch)._space.corrector
    assert smooth_between(corrector, branch.points[0], branch.points[1])[0] is corrector
    elsewhere, *points = smooth_between(corrector, first, last)
    assert elsewhere is not corrector
    for own, there in zip((first, last), points, strict=True):
        assert there.orbit.state == pytest.approx(own.orbit.state, abs=1e-11)
        # A complex pair comes in either order, and its real parts differ in the last digits.
        here, other = (
            sorted(orbit.multipliers, key=lambda m: (round(m.real, 6), m.imag)) for orbit in (own.orbit, there.orbit)
        )
        assert other == pytest.approx(here, abs=1e-8)
        assert [each.switch for each in there.orbit.events] == [each.switch for each in own.orbit.events]
        assert [each.theta for each in there.orbit.events] == pytest.approx([each.theta for each in own.orbit.events])
    step = points[1].arclength - points[0].arclength
    assert np.linalg.norm(points[1].x - points[0].x) == pytest.approx(step, rel=1e-2)


@pytest.mark.slow
def test_a_walk_stopped_behind_the_jump_resumes_to_the_bit(branches: tuple[gw.Branch, gw.Branch]) -> None:
    whole = branches[0]
    orbit = gw.find_orbit(impacts(0.0), frequency=0.95)
    steps = gw.walk(orbit, "frequency", RANGE)
    for _ in range(jump(whole) + 2):
        next(steps)
    resumed = gw.walk(orbit, "frequency", RANGE, resume=pickle.loads(pickle.dumps(steps.state)))
    for _ in resumed:
        pass
    assert [each.value for each in resumed.branch.points] == [each.value for each in whole.points]
    assert [each.value for each in resumed.branch.special_points] == [each.value for each in whole.special_points]


def test_gaps_are_measured_in_the_section_in_which_they_were_walked() -> None:
    """Slip ends at the start of the period. A state there and another one move by different lengths along a branch."""

    def braked(phase: float) -> gw.Orbit:
        brake, load = friction("brake", {"x": 1.0}, 0.1), Harmonic(1.0, {"x": 1.0}, 1, phase)
        return gw.find_orbit(System(["x"], [[1.0]], [[0.1]], contacts=[brake], harmonics=[load], frequency=1.1))

    end = next(each.theta for each in braked(0.0).slips if each.theta > 0.0)
    branch = gw.follow(braked(end), "frequency", 1.43, walk=gw.WalkOptions(max_points=10))
    corrector, first, last = smooth_between(Track("P1-1", branch).corrector_at(branch.points[0]), *branch.points[:2])
    assert corrector.equation.begin > 0.1
    ahead = branch.points[1].arclength
    assert float(np.linalg.norm(branch.points[1].x - branch.points[0].x)) == pytest.approx(ahead, rel=1e-6)
    assert abs(float(np.linalg.norm(last.x - first.x)) / ahead - 1.0) > 0.1
    assert gw.verify(branch).worst(Check.GAPS).size < 0.1


@keeps("ends0")
@pytest.mark.parametrize("ends", [(0.9735, 0.9745), (0.9745, 0.9735)])
def test_a_stop_that_never_pushes_is_not_held_where_its_plastic_impact_is_just_before_the_start(
    ends: tuple[float, float],
) -> None:
    """The load less the spring's force at the stop is cos(theta) - 1: it is zero at 0 rad, and pulls elsewhere.

    Within 2e-4 rad after the impact the body is still at the stop to rounding, where the motion begins.
    """
    wall = Contact("wall", {"x": 1.0}, [Stage(1.0, side=Side.POSITIVE)], law="rigid", restitution=0.0)
    load = Harmonic(1.0, {"x": 1.0})
    system = System(["x"], [[1.0]], [[0.1]], contacts=[wall], harmonics=[load], frequency=ends[0])
    orbit = gw.find_orbit(system.at(frequency=0.97402))
    assert [each.theta - PERIOD for each in orbit.events] == [pytest.approx(-1.158e-4, abs=1e-7)]
    assert orbit.held == {0: (0, 1)}
    branch = gw.follow(gw.find_orbit(system), "frequency", ends[1])
    assert branch.ends[-1].reason is EndReason.RANGE
    assert branch.special_points == ()

"""Rattle sweeps by equal steps: against exact curves, a reference train, resumed and in several processes."""

import sqlite3
from contextlib import closing, suppress
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.answers.gap_states import OTHER, Direction, SettledSweep, innermost, seldom, spans_of
from gapwalk.answers.held_flank import grazing_near
from gapwalk.answers.lane_sweep import (
    Piece,
    is_many,
    joined,
    known_at,
    lasting,
    observed,
    other_sweeps,
    started_piece,
    sweep_piece,
)
from gapwalk.answers.lane_threshold import rattling_along
from gapwalk.answers.rattle_bands import RattleBands, bands_of_sweeps
from gapwalk.answers.threshold import Request, ThresholdOptions
from gapwalk.attractors.lane_settling import LaneMotion, Start, settle_lanes, slow_modes
from gapwalk.ensemble.batch_flow import state_at_rest
from gapwalk.model.model_source import parse_source
from gapwalk.studies.study_file import check_study
from tests.attractors.lane_labels import Text
from tests.attractors.test_lane_settling import small_text, small_train

TRAIN_A = Path(__file__).parents[1] / "data/train_a.toml"
SMALL, RANGE = small_train(), (400.0, 1200.0)
# Exact grazing points of the small train, by continuation (`by = "curves"`, 30 s): the slow test finds them again.
ENDS = {"mesh": 585.8626, "idle": 923.3213}


def bands(**options: Any) -> RattleBands:
    return gw.ask.rattle_bands(
        SMALL, "speed", RANGE, **{"search": 0, "starts": 0, "steps": 30, "workers": 1, **options}
    )


@cache
def by_steps() -> RattleBands:
    return bands()


def ends_of(found: RattleBands, gap: str, met: str) -> list[float]:
    return [end.value for band in found.of(gap, met) for end in (band.low, band.high)]


@pytest.mark.parametrize("gap", [*ENDS])
def test_ends_of_bands_are_those_of_exact_curves(gap: str) -> None:
    assert is_many(SMALL)
    for met in ("rising", "falling"):
        assert ends_of(by_steps(), gap, met) == pytest.approx([RANGE[0], ENDS[gap]], abs=1e-4)


def at_once(function, pieces):
    """Do pieces of a search, and store none."""
    return [function(piece) for piece in pieces]
    yield


def test_sweeps_at_a_threshold_meet_the_motions_that_rattle_up_to_the_exact_end() -> None:
    clearance = SMALL["idle.clearance"]
    to = (clearance, 2.0 * clearance)
    asked = Request(SMALL, ("idle",), "idle.clearance", to, "speed", RANGE, ThresholdOptions())
    work = rattling_along(asked, clearance, at_once)
    with pytest.raises(StopIteration) as end:
        next(work)
    hits = end.value.value
    assert {hit.gaps for hit in hits} == {("idle",)}
    step = (RANGE[1] - RANGE[0]) / 320
    assert ENDS["idle"] - step <= max(hit.other for hit in hits) <= ENDS["idle"]


def test_a_threshold_by_steps_is_where_the_exact_end_comes_into_the_range() -> None:
    drag, quiet = SMALL["churn.linear"], {"speed": (ENDS["idle"], 1000.0)}
    few: dict[str, Any] = {"values": 8, "starts": 4, "workers": 1}
    found = gw.ask.threshold(SMALL, "churn.linear", (0.9 * drag, 1.2 * drag), quiet, "idle", **few)
    last, first = found.between
    assert last < drag < first
    assert first - last == pytest.approx(2e-4 * 0.3 * drag, rel=1e-9)
    assert found.at == ENDS["idle"]
    assert found.confirmation is not None
    assert not found.confirmation.rattling


def test_what_moves_an_end_beside_impacts_is_the_difference_of_two_ends() -> None:
    (band,), sweep = by_steps().of("mesh", "rising"), by_steps().sweeps[0]
    end, place = band.high, sweep.contacts.index("idle")
    quiet = min((each for each in sweep.lanes if each.value > end.value), key=lambda each: each.value)
    assert quiet.sides[place].any()  # the other gap rattles
    mover = end.movers[0]
    size = 1e-4 * SMALL[mover.name]
    ends = []
    for sign in (1, -1):
        moved = SMALL.at({"speed": quiet.value, mover.name: SMALL[mover.name] + sign * size})
        orbit = gw.find_orbit(moved, quiet.period, quiet.state)
        switches = innermost(moved, "mesh")
        switch = min(switches, key=lambda each: np.abs(orbit.turning_depths[each][1]).min(initial=np.inf))
        ends.append(grazing_near(orbit, "speed", switch).value)
    assert mover.error < 1e-4 * abs(mover.slope)
    assert (ends[0] - ends[1]) / (2 * size) == pytest.approx(mover.slope, rel=1e-6)  # the ends have errors


@pytest.mark.slow
def test_exact_curves_have_these_ends() -> None:
    found = bands(by="curves")
    for gap, value in ENDS.items():
        assert ends_of(found, gap, "rising")[-1] == pytest.approx(value, abs=1e-3)


@pytest.mark.slow
def test_ends_of_train_a_are_those_of_an_independent_program() -> None:
    found = gw.ask.rattle_bands(gw.read_model(str(TRAIN_A)), "speed", (700.0, 1500.0), steps=160, workers=1)
    for met in ("rising", "falling"):
        for gap, value, error in (
            ("mesh1", 989.1, 0.05),
            ("mesh2", 946.2, 0.05),
            ("mesh3", 780.85, 0.05),
            ("mesh4", 723.9, 1.0),
        ):
            assert ends_of(found, gap, met)[-1] == pytest.approx(value, abs=error)
        assert not [value for value in ends_of(found, "mesh5", met) if value > 710.0]
    assert not found.of("mesh1", OTHER)


def parts(path: Path) -> dict[tuple[str, int], bytes]:
    """The arrays of the parts of a result file."""
    with closing(sqlite3.connect(path)) as file:
        rows = file.execute("SELECT name, number, arrays FROM part WHERE name != 'moment'")
        return {(name, number): arrays for name, number, arrays in rows}


STUDY = """
[[study]]
kind = "rattle"
parameter = "speed"
from = "400 rpm"
to = "1200 rpm"
steps = 24
search = 1
starts = 4
"""


def run(path: Path, stop: int = 0, workers: int = 1) -> dict[tuple[str, int], bytes]:
    """Run a study, stop it after some reports, and go on; return its parts."""
    study = check_study(parse_source(small_text() + STUDY + f"workers = {workers}"))
    left = [stop]

    def report(*_: object) -> None:
        left[0] -= 1
        if left[0] == 0:
            raise KeyboardInterrupt

    with suppress(KeyboardInterrupt):
        gw.run(study, path, report=report)
    gw.run(study, path, resume=True)
    return parts(path)


def test_a_study_that_is_resumed_after_a_part_stores_the_same_bytes(tmp_path: Path) -> None:
    whole = run(tmp_path / "whole.gapwalk")
    assert {name for name, _ in whole} >= {"piece", "quiet", "sweep", "starts", "others", "bands"}
    assert run(tmp_path / "resumed.gapwalk", stop=2) == whole


@pytest.mark.slow
def test_a_study_that_is_resumed_after_any_part_or_has_two_workers_stores_the_same_bytes(tmp_path: Path) -> None:
    whole = run(tmp_path / "whole.gapwalk")
    for stop in range(1, 6):
        assert run(tmp_path / f"{stop}.gapwalk", stop=stop) == whole
    assert run(tmp_path / "two.gapwalk", workers=2) == whole


def second_train() -> gw.System:
    """A train whose clutch stays on its soft stage in one motion, and swings between its stiff ones in another."""
    text = Text("900 rpm", "vehicle", 'flywheel = "0.5 N m"')
    text.inertias(flywheel=0.3, input=0.004, loose=0.003, output=0.02, vehicle=3.0)
    text.shaft("clutch", "flywheel", "input", 60, 0.1)
    text.stages("0.03 rad", "0.03 rad", 1500)
    text.gear("mesh", "input", "output", 1.2, "0.02 rad", 6000, 'damping = "0.4 N m s/rad"')
    text.gear("idle", "input", "loose", 2.0, "0.004 rad", 4000, 'damping = "0.3 N m s/rad"')
    text.drag("churn", "loose", "ground", 0.02)
    text.drag("bearing", "loose", "output", 0.01)
    text.shaft("half", "output", "vehicle", 300, 0.8)
    text.harmonics("flywheel", o2=150)
    return text.system


def test_a_second_motion_is_found_by_random_starts_and_followed_both_ways() -> None:
    system, within, steps = second_train(), (980.0, 1020.0), 2
    edges = sweep_piece(system, "speed", within, steps, Piece((0,), None))
    pieces = [edges, sweep_piece(system, "speed", within, steps, Piece((0,), edges))]
    gaps = ("mesh", "idle")
    sweeps = [joined(system, "speed", within, steps, way, pieces, gaps) for way in Direction]
    known = known_at(sweeps, [1000.0])
    started = started_piece(system, "speed", 16, 0, known)
    assert started[0].count == 16
    found, notes = other_sweeps(system, sweeps, steps, started)
    loud = [each for each in found if each.lanes[0].rms[1] > 3.0 * known[0][0].rms[1]]
    assert {each.direction for each in loud} == set(Direction)
    assert all(each.name == OTHER for each in found)
    assert any(len(each.lanes) > 1 for each in loud)
    first = spans_of(loud[0], "mesh")[0]
    assert {str(end.kind) for end in (first.low, first.high) if end.value == 1000.0} == {"end of a motion"}
    assert "16 random starts at each of 1 values led to" in notes[0]


def test_where_no_start_leads_elsewhere_the_share_is_bounded() -> None:
    sweeps = [each for each in by_steps().sweeps if not each.name]
    known = known_at(sweeps, [1200.0])
    started = started_piece(SMALL, "speed", 8, 0, known)
    assert sum(started[0].led) == 8
    found, notes = other_sweeps(SMALL, sweeps, 30, started)
    assert not found
    assert "with 95 % confidence, less than 37.5 % of all starts lead to other motions" in notes[1]


def motion(value: float, period: int, closings: float, watched: int = 66, margin: float = 0.1) -> LaneMotion:
    """A motion of which only the closings of one gap count."""
    one, none = np.ones(1), np.zeros((3, 1))
    sides = np.array([[closings, 0.0]])
    figures = dict.fromkeys(("peak", "power", "approach", "rms", "largest", "kurtosis", "error"), one)
    figures |= {"parted": np.minimum(sides[:, 0], 1.0) * watched, "margin": margin * one}
    return LaneMotion(value, one, period, 50, watched, sides, one > 0.0, extremes=none, **figures)


def sweep_of(*motions: LaneMotion) -> SettledSweep:
    """The motions as a rising sweep of one gap, over its values."""
    ends = motions[0].value, motions[-1].value
    return SettledSweep("speed", ends, Direction.UP, (), (), lanes=motions, contacts=("mesh",))


def test_a_gap_that_parts_seldom_in_chaos_has_one_band_and_an_end_of_that_kind() -> None:
    rare = [motion(1, 0, 3.0), motion(2, 0, 0.0), motion(3, 0, 0.02), motion(4, 0, 0.0), motion(5, 0, 0.0)]
    sweep = sweep_of(*rare)
    rattles, seldom_parts = spans_of(sweep, "mesh")
    assert (rattles.low.value, rattles.high.value, rattles.high.kind) == (1, 3.5, "seldom parts beyond")
    assert (rattles.state.rattles, seldom_parts.state.rattles) == (True, False)
    found = RattleBands(SMALL, "speed", (1, 5), ("mesh",), 1.0, (sweep,), bands_of_sweeps([sweep], ["mesh"]), (), ())
    assert found.sentence("mesh") == (
        "mesh rattles from the beginning of the range, 1 rpm, to about 3.5 rpm (beyond, it did not separate in 66 "
        "observed forcing periods, but may do so more rarely)"
    )
    assert seldom([sweep], "mesh") == (
        "mesh did not separate at 2 values from 4 to 5, where the motion has no period, within 66 forcing periods or "
        "more: with 95 % confidence it separates in less than one of 22 periods"
    )


def test_a_gap_that_stays_far_from_parting_in_chaos_is_quiet() -> None:
    sweep = sweep_of(motion(1, 0, 3.0), motion(2, 0, 0.0, margin=2.0), motion(3, 0, 3.0))
    assert [span.state.rattles for span in spans_of(sweep, "mesh")] == [True, False, True]
    assert seldom([sweep], "mesh") is None


def test_a_periodic_motion_that_does_not_part_is_quiet() -> None:
    sweep = sweep_of(motion(1, 0, 3.0), motion(2, 1, 0.0), motion(3, 0, 0.02))
    assert [(span.high.value, span.high.kind) for span in spans_of(sweep, "mesh")] == [
        (1.5, "between samples"),
        (2.5, "between samples"),
        (3, "end of the range"),
    ]
    assert seldom([sweep], "mesh") is None


def test_it_is_said_for_how_long_motions_without_period_were_watched() -> None:
    assert observed([sweep_of(motion(1, 0, 3.0), motion(2, 0, 0.0, 512), motion(3, 1, 0.0, 1))]) == (
        "motions without period were watched for 66 to 512 forcing periods: a longer transient is not excluded"
    )
    assert observed([sweep_of(motion(1, 1, 3.0, 1))]) is None


@pytest.mark.parametrize(("damping", "watched", "periods"), [(0.01, 512, "40"), (0.004, 512, "99"), (0.004, 64, "")])
def test_a_free_vibration_that_outlasts_the_longest_watch_is_told(damping: float, watched: int, periods: str) -> None:
    # x'' + c x' + x = 0 falls to 1/e in 2 / c, of periods of 2 pi / 1.25
    system = gw.System(["x"], mass=[[1.0]], damping=[[damping]], stiffness=[[1.0]], frequency=1.25)
    told = lasting(system, [sweep_of(motion(1, 0, 3.0, watched))])
    assert told is None if periods != "99" else told is not None and f"takes {periods} forcing periods" in told


def test_free_swings_are_taken_out_of_a_transient() -> None:
    system = second_train().at({"speed": 1300.0, "o2.amplitude": 20.0})
    states = np.tile(state_at_rest(system), (3, 1))
    states[1:, system.size + system.coordinates.index("half")] = 2.0, 20.0
    found = [motion for _, motion in settle_lanes(Start(k, 1300.0, system, each) for k, each in enumerate(states))]
    modes = slow_modes(system, found[0].extremes[1])
    assert modes.longest > 60.0
    assert all(motion.period == 1 and motion.is_like(found[0]) for motion in found)
    assert max(motion.waited for motion in found) < 2.0 * modes.longest  # of the swing 1e-4 would be left after nine


def test_a_motion_is_independent_of_those_beside_it() -> None:
    starts = [
        Start(speed, speed, here := SMALL.at(speed=speed), state_at_rest(here)) for speed in (450.0, 700.0, 1100.0)
    ]
    together = {start.key: motion for start, motion in settle_lanes(starts)}
    for start in starts:
        ((_, alone),) = settle_lanes([start])
        assert alone.state.tobytes() == together[start.key].state.tobytes()
        assert alone.rms.tobytes() == together[start.key].rms.tobytes()

"""Sweeps: against closed forms, folds and flips that other programs found, and themselves when they are interrupted."""

import json
import os
import shutil
import signal
import tracemalloc
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.errors import ModelError, StoreError, WorkError
from gapwalk.flow import Flow
from gapwalk.parallel.workers import Pace, local_workers
from gapwalk.results.result_file import lock, reading
from gapwalk.studies import sweep_study as segments
from gapwalk.studies.result import REQUEST, load_result, request_file
from gapwalk.studies.sweep_study import BLOCK, STRETCH, Sweep, SweepSegment, SweepStudy, Way
from tests.interruption import until_ctrl_c
from tests.results.tampering import change_sealed
from tests.studies.sweeps import FOLDS, options
from tests.studies.test_transient import steady_state
from tests.systems import clutch, linear
from tests.tiers import keeps

pytestmark = pytest.mark.usefixtures("kept_processes")

REFERENCE = json.loads((Path(__file__).parents[1] / "data" / "special_points.json").read_text())["figures"]["13"]
ROOT = Path(__file__).resolve().parents[2]


def reference(kind: str, near: float) -> float:
    """A special point of figure 13 that other programs found."""
    return min((point["W"] for point in REFERENCE if point["kind"] == kind), key=lambda value: abs(value - near))


def light(**changes) -> gw.System:
    """Figure 15: the clutch with twice the excitation."""
    return clutch(**changes).at({"harmonic1.amplitude": 0.5})


@pytest.fixture(scope="module")
def hysteresis() -> Sweep:
    return gw.sweep(*FOLDS, **options())


def assert_same(a: Sweep, b: Sweep) -> None:
    for name in ("values", "sections", "transients", "settled", "regimes"):
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name))
    assert (a.complete, a.notes, str(a)) == (b.complete, b.notes, str(b))


def test_a_linear_system_follows_its_closed_form() -> None:
    found = gw.sweep(linear(), "frequency", (0.4, 2.0), **options(tolerance=1e-9, kick=0.0))
    assert found.complete
    assert found.settled.all()
    assert (found.regimes == "period 1").all()
    for place, value in enumerate(found.values):
        expected = steady_state(linear(frequency=value))
        assert np.abs(found.sections[:, place] - expected).max() < 1e-7


def test_jumps_are_where_the_folds_are(hysteresis) -> None:
    up, down = hysteresis.sections[:, :, 0, 0]
    differ = np.abs(up - down) > 0.5
    first, last = hysteresis.values[differ][[0, -1]]
    step = hysteresis.values[1] - hysteresis.values[0]
    assert reference("fold", 0.62) < first < reference("fold", 0.62) + 1.01 * step
    assert reference("fold", 0.64) - 1.01 * step < last < reference("fold", 0.64)


def test_bands_change_where_the_flip_is() -> None:
    found = gw.sweep(clutch(), "frequency", (1.3, 1.36), **options(steps=61, ways="down"))
    low, high = found.bands()
    assert (low.regime, high.regime) == ("period 2", "period 1")
    assert abs(low.high - reference("flip", 1.33)) < 2.5e-3  # a motion leaves an unstable one after some values only
    assert low.high == high.low


def test_section_points_in_a_window_are_those_of_the_orbit() -> None:
    found = gw.sweep(light(), "frequency", (0.78, 0.82), **options(steps=9, ways="down"))
    assert set(found.regimes[0, :6]) == {"period 3"}
    for place in (1, 4):
        section = found.sections[0, place]
        orbit = gw.find_orbit(light(frequency=found.values[place]), 3, section[0])
        assert orbit.stable
        assert np.abs(orbit.state - section[0]).max() < 1e-5
        assert np.abs(section[3:] - section[:-3]).max() < 1e-5


def test_a_torus_is_named() -> None:
    found = gw.sweep(light(), "frequency", (1.13, 1.16), **options(steps=4, ways="down", points=60, starts=2))
    assert "quasi-periodic" in found.regimes  # where the paper's figure 15 shows one
    lane, place = np.argwhere(found.regimes == "quasi-periodic")[0]
    distances = np.abs(found.sections[lane, place, 1:] - found.sections[lane, place, 0]).max(axis=1)
    assert distances.min() > 1e-3


def test_many_starts_find_what_one_does_not() -> None:
    few = gw.sweep(clutch(), "frequency", (0.622, 0.636), **options(steps=3, ways="again"))
    many = gw.sweep(clutch(), "frequency", (0.622, 0.636), **options(steps=3, ways="again", starts=8))
    assert len(many.lanes) == 8
    np.testing.assert_array_equal(many.sections[0], few.sections[0])
    found = np.round(many.sections[:, :, 0, 0], 2)
    assert [len(set(column)) for column in found.T[:2]] == [2, 2]  # both stable motions between the folds
    given = tuple(tuple(lane.state) for lane in many.lanes[2:4])
    again = gw.sweep(clutch(), "frequency", (0.622, 0.636), **options(steps=3, ways="again", starts=given, kick=0))
    np.testing.assert_allclose(again.sections, many.sections[2:4], atol=1e-4)


def test_the_number_of_workers_changes_nothing(hysteresis) -> None:
    with local_workers(2) as workers:
        assert_same(gw.sweep(*FOLDS, **options(workers=workers)), hysteresis)


def test_the_seed_makes_a_difference_of_the_size_of_the_kicks(hysteresis) -> None:
    other = gw.sweep(clutch(), "frequency", (0.649, 0.605), **options(seed=1))
    assert not np.array_equal(other.sections, hysteresis.sections)
    np.testing.assert_allclose(other.sections, hysteresis.sections, atol=3e-5)


@keeps("1", "3")
@pytest.mark.parametrize("after", [1, 3, 5])
def test_ctrl_c_keeps_what_there_is_and_is_resumed(after, hysteresis, tmp_path) -> None:
    path, done, paces = tmp_path / "up.sweep", [], []

    def report(segment, pace: Pace) -> None:
        done.append(segment)
        paces.append(pace)
        if len(done) == after:
            signal.raise_signal(signal.SIGINT)

    stopped = until_ctrl_c(gw.sweep, *FOLDS, **options(), report=report, output=path)
    assert not stopped.complete
    assert np.count_nonzero(stopped.regimes != "") == sum(len(segment.regimes) for segment in done)
    assert [(pace.done, pace.total) for pace in paces] == [(k, 6) for k in range(1, after + 1)]
    assert_same(gw.open_result(path), stopped)
    assert os.listdir(tmp_path) == [path.name]
    paces.clear()
    again = gw.sweep(*FOLDS, **options(workers=2), output=path, report=lambda _, pace: paces.append(pace))
    assert_same(again, hysteresis)
    assert_same(gw.open_result(path), hysteresis)
    assert [(pace.done, pace.before) for pace in paces] == [(k, after) for k in range(after + 1, 7)]
    calls = Flow.calls
    assert_same(gw.sweep(*FOLDS, **options(), output=path), hysteresis)
    assert Flow.calls == calls  # a complete sweep is not driven again


def test_another_sweep_is_not_mixed_with_one_in_a_file(tmp_path) -> None:
    path = tmp_path / "a.sweep"
    small = options(steps=2, ways="up")
    gw.sweep(clutch(), "frequency", (0.6, 0.7), **small, output=path)
    with pytest.raises(StoreError, match=r"kick is 0\.0, and was 1e-07"):
        gw.sweep(clutch(), "frequency", (0.6, 0.7), **dict(small, kick=0.0), output=path)
    with pytest.raises(StoreError, match=r"stiffness\.q1\.q1 is 0\.2, and was 0\.1"):
        gw.sweep(clutch().at({"stiffness.q1.q1": 0.2}), "frequency", (0.6, 0.7), **small, output=path)
    with pytest.raises(StoreError, match="and no result of a study"):
        load_result(path)
    with pytest.raises(StoreError, match="being written by another run"), lock(tmp_path / "b.sweep"):
        gw.sweep(clutch(), "frequency", (0.6, 0.7), **small, output=tmp_path / "b.sweep")


def test_a_damaged_file_is_called_so(tmp_path) -> None:
    path = tmp_path / "a.sweep"
    gw.sweep(clutch(), "frequency", (0.6, 0.7), **options(steps=2, ways="up"), output=path)
    with reading(path) as parts:
        call = parts.one(REQUEST)
        parts.base = call.system
        ((_, segment),) = parts.all(STRETCH)
    other = tmp_path / "b.sweep"

    def asking(**changes):
        return replace(call, options=replace(call.options, **changes))

    for request, number, wrong, message in [
        (call, 1, segment, "is stored in the place of another one"),
        (call, 5, replace(segment, lane=5), "segment 0 of lane 5 does not belong to this sweep"),
        (call, 0, replace(segment, regimes=("",)), "another size"),
        (call, 0, replace(segment, sections=segment.sections[..., 1:]), "another size"),
        (asking(end=0.6), 0, segment, "is damaged"),
        (asking(parameter="mass"), 0, segment, "is damaged"),
        (asking(block=7), 0, segment, "its segments have 7 values"),
    ]:
        with request_file(request, other) as file:
            file.write(STRETCH.entry(wrong, number))
        with pytest.raises(StoreError, match=message):
            gw.open_result(other)
    for statement in (
        "UPDATE part SET head = replace(head, '\"steps\":2', '\"steps\":1')",
        "UPDATE part SET head = replace(head, '\"options\"', '\"option\"')",
        "UPDATE part SET arrays = x'' WHERE name = 'segment'",
        "UPDATE part SET arrays = zeroblob(length(arrays) - 40) WHERE name = 'segment'",
    ):
        shutil.copy(path, other)
        change_sealed(other, statement)
        with pytest.raises(StoreError, match="is damaged"):
            gw.open_result(other)


def test_a_motion_that_runs_away_ends_its_lane_and_is_noted() -> None:
    system = gw.System(["x"], [[1.0]], [[0.1]], harmonics=[gw.Harmonic(0.3, {"x": 1.0})])
    found = gw.sweep(system, "stiffness.x.x", (-1.0, 1.0), **options(ways="up and down and again"))
    up, down, again = found.regimes
    assert found.complete  # there is nothing left to do
    assert up[0] == "diverges"
    assert set(up[1:]) == {""}
    edge = int(np.flatnonzero(down == "diverges")[-1])
    assert set(down[:edge]) == {""}
    assert set(down[edge + 1 :]) == {"period 1"}
    assert found.values[edge] < 0.0 < found.values[edge + 3]
    assert set(again[:20]) == {"diverges"}
    assert np.isnan(found.sections[1, edge]).all()
    assert len(found.notes) == 4  # two segments of the last lane
    assert found.notes[0].startswith("start 1, up: the motion could not be followed and ends there: stiffness")
    x, y = found.section("x")
    assert len(x) == len(y) == np.count_nonzero(~np.isnan(found.sections[..., 0]))


def test_a_kick_leaves_what_is_unstable() -> None:
    rest = gw.System(["x"], [[-0.1]], [[0.1]], contacts=[gw.backlash("gap", {"x": 1.0}, 1.0)], frequency=1.0)
    still = gw.sweep(rest, "frequency", (1.0, 1.1), **options(steps=2, ways="up", kick=0.0))
    kicked = gw.sweep(rest, "frequency", (1.0, 1.1), **options(steps=2, ways="up"))
    assert np.abs(still.sections).max() == 0.0
    assert np.abs(kicked.sections[..., 0]).min() > 1.0  # against one side of the gap


@pytest.mark.slow
def test_a_worker_that_dies_each_time_is_told_with_its_lane(monkeypatch) -> None:
    from gapwalk.studies import sweep_study as study
    from tests.studies.pieces import die

    monkeypatch.setattr(study, "sweep_stretch", die)
    with pytest.raises(WorkError, match=r"Lane\(up, start 1\).*a worker process died"):
        gw.sweep(clutch(), "frequency", (0.6, 0.7), **options(ways="up", workers=2))


def test_what_is_asked_of_a_sweep_is_found(hysteresis) -> None:
    x, y = hysteresis.section("q3'", lane=1)
    assert x.shape == y.shape == (45 * 14,)
    assert y[0] == hysteresis.sections[1, 0, 0, 3]
    assert [band.regime for band in hysteresis.bands(1)] == ["period 1"]
    assert str(hysteresis) == "Sweep(frequency from 0.605 to 0.649, 2 lanes, complete)"
    with pytest.raises(ModelError, match="there is no coordinate 'q2'; there are q1, q3, q1', q3'"):
        hysteresis.section("q2")
    assert stretches_are_whole(hysteresis)


def stretches_are_whole(found: Sweep) -> bool:
    return BLOCK < len(found.values) < 3 * BLOCK and found.lanes[0].way is Way.UP


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"steps": 1}, "steps is 1; it must be an integer >= 2"),
        ({"ways": "sideways"}, "ways is 'sideways'; write"),
        ({"ways": "up and up"}, "ways is 'up and up'; write"),
        ({"points": 12}, "points is 12; it must be more than max_period, 12"),
        ({"starts": 0}, "starts is 0; it must be an integer >= 1, or a list of states"),
        ({"starts": ()}, "starts is empty"),
        ({"kick": 1.0}, "kick is 1.0; it must lie between 0 and 1e-2"),
        ({"seed": True}, "seed is True"),
    ],
)
def test_options_that_make_no_sense(wrong, message) -> None:
    with pytest.raises(ModelError, match=message):
        SweepStudy("frequency", 0.6, 0.7, **options(**wrong))


def test_a_sweep_that_makes_no_sense() -> None:
    with pytest.raises(ModelError, match="is empty"):
        gw.sweep(clutch(), "frequency", (1.0, 1.0))
    with pytest.raises(ModelError, match="frequency is -1"):
        gw.sweep(clutch(), "frequency", (-1.0, 1.0))
    with pytest.raises(ModelError, match="no parameter"):
        gw.sweep(clutch(), "speed", (0.5, 1.0))
    with pytest.raises(ModelError, match="4 finite numbers"):
        gw.sweep(clutch(), "frequency", (0.5, 1.0), **options(starts=((1.0, 2.0),)))


def test_a_result_depends_on_its_task_alone() -> None:
    work = SweepStudy("frequency", 0.6, 0.7, **options()).work(clutch())
    (task, _) = work._first_tasks()
    segments.sweep_stretch(replace(task, state=task.state + 0.3))
    once, twice = segments.sweep_stretch(task), segments.sweep_stretch(task)
    np.testing.assert_array_equal(once.sections, twice.sections)


def test_progress_in_words() -> None:
    assert str(Pace(0, 8)) == "0 of 8"
    assert str(Pace(4, 8, 0, 2.0)) == "4 of 8, 2 a second, 2 s left"
    assert str(Pace(6, 8, 4, 100.0)) == "6 of 8, 50 s each, 1 min 40 s left"
    assert str(Pace(1, 100, 0, 100.0)) == "1 of 100, 100 s each, 2 h 45 min left"
    assert Pace(4, 8, 4, 3.0).rate is None


def test_section_points_are_in_memory_once() -> None:
    asked = SweepStudy("frequency", 0.3, 1.2, steps=400, ways="up", points=500)
    work = asked.work(light())  # the first one brings what is kept for good

    def segment(number: int) -> SweepSegment:
        sections = np.full((BLOCK, 500, 4), float(number))
        return SweepSegment(0, number, sections, np.ones(BLOCK, int), np.ones(BLOCK, bool), ("period 1",) * BLOCK)

    tracemalloc.start()
    try:
        work = asked.work(light())
        work.take(SimpleNamespace(all=lambda _: ((number, segment(number)) for number in range(400 // BLOCK))))
        found = work.record
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert found.complete
    assert found.sections[0, -1, 0, 0] == 400 // BLOCK - 1
    assert peak < 1.3 * found.sections.nbytes


def test_the_earlier_name_of_a_way_is_read() -> None:
    assert Way("afresh") is Way.AGAIN
    assert SweepStudy("frequency", 0.6, 0.7, ways="up and afresh").each_way() == (Way.UP, Way.AGAIN)


def test_a_mass_that_rests_on_a_rigid_stop_is_not_kicked_through_it():
    """Without clearance it is pressed on the stop from the start; the kick would begin beyond it."""
    unit = 1e-9
    stop = gw.rigid_stop("stop", {"x": 1.0}, 0.0, restitution=0.5)
    system = gw.System(
        ["x"],
        [[1.0]],
        [[0.2]],
        [[1.0]],
        contacts=[stop],
        mean={"x": 0.5 * unit},
        harmonics=[gw.Harmonic(unit, {"x": 1.0}, name="a")],
        frequency=1.0,
    )
    found = gw.sweep(system, "a.amplitude", (0.1 * unit, 2.0 * unit), **options(steps=3, ways="up"))
    assert {band.regime for lane in range(len(found.lanes)) for band in found.bands(lane)} == {"period 1"}
    pressed, lifts = (gw.settle(system.at({"a.amplitude": share * unit})).motion(64) for share in (0.4, 2.0))
    assert np.abs(pressed.states[:, 0]).max() <= 1e-12 * unit
    assert lifts.states[:, 0].min() < -0.1 * unit


@pytest.mark.slow
def test_a_sweep_begins_within_rigid_stops_that_are_carried_away():
    """A prescribed displacement carries the position 0 beyond both stops, at each value by another way."""
    gap = gw.rigid_stop("gap", {"x": 1.0}, 0.01, restitution=0.3, side="both")
    system = gw.System(
        ["x"],
        mass=[1.0],
        damping=[0.5],
        stiffness=[0.0],
        contacts=[gap],
        harmonics=[gw.Harmonic(0.1, varies="gap.deflection", name="sway")],
        frequency=1.0,
    )
    found = gw.sweep(system, "sway.amplitude", (0.1, 0.5), **options(steps=3, starts=2, ways="up and down"))
    assert not found.notes
    assert {band.regime for lane in range(len(found.lanes)) for band in found.bands(lane)} == {"period 1"}

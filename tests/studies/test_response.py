"""The study of a response: what it walks, what it reports, and how it ends when it cannot go on."""

import signal
import threading
from dataclasses import replace

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.continuation import EndReason
from gapwalk.errors import ModelError, NumericalError
from gapwalk.studies import response_study as response
from gapwalk.studies.response_study import ResponseOptions
from tests.interruption import until_ctrl_c
from tests.studies.same import assert_same_branch, assert_same_result
from tests.studies.studies import stop_study


def test_it_walks_from_the_first_value_to_the_second() -> None:
    study = stop_study()
    result = gw.run(study)
    (branch,) = result.branches
    assert result.complete
    assert result.study is study
    assert branch.values[[0, -1]] == pytest.approx([0.7, 1.9], abs=1e-15)
    assert [end.reason for end in branch.ends] == [EndReason.START, EndReason.RANGE]
    back = gw.run(
        replace(study, system=study.system.at(frequency=1.9), options=replace(study.options, begin=1.9, end=0.7))
    )
    assert back.branches[0].values[-1] == pytest.approx(0.7, abs=1e-15)
    there, back_there = (
        sorted(special.value for special in each.branches[0].special_points) for each in (result, back)
    )
    assert there == pytest.approx(back_there, abs=1e-10)


def test_it_walks_any_parameter() -> None:
    study = stop_study()
    options = ResponseOptions("stop.clearance", 1.0, 0.5, "max.x")
    branch = gw.run(gw.Study(study.system.at(frequency=1.0), options)).branches[0]
    assert branch.values[[0, -1]] == pytest.approx([1.0, 0.5], abs=1e-15)
    assert branch.points[3].orbit.system["stop.clearance"] == branch.values[3]


@pytest.mark.parametrize("start", ["rest", "settle", (0.3, -0.05)])
def test_it_starts_where_it_is_told(start) -> None:
    study = stop_study(end=0.72)
    result = gw.run(replace(study, options=replace(study.options, start=start)))
    orbit = gw.find_orbit(study.system, start=start)
    np.testing.assert_allclose(result.branches[0].points[0].orbit.state, orbit.state, atol=1e-9)


def test_it_reports_each_point_in_order() -> None:
    reported = []
    result = gw.run(stop_study(), report=lambda point, special_points: reported.append((point, special_points)))
    (branch,) = result.branches
    assert tuple(point for point, _ in reported) == branch.points
    assert tuple(special for _, found in reported for special in found) == branch.special_points
    for (point, found), before in zip(reported[1:], branch.points, strict=False):
        assert all(before.arclength <= special.point.arclength <= point.arclength for special in found)


def test_a_resumed_result_is_reported_from_its_beginning(tmp_path) -> None:
    path, study = tmp_path / "stop.gapwalk", stop_study()
    first, second = [], []
    gw.run(study, path, report=lambda *step: first.append(step))
    gw.run(study, path, resume=True, report=lambda *step: second.append(step))
    assert [point.value for point, _ in first] == [point.value for point, _ in second]
    assert [[s.value for s in found] for _, found in first] == [[s.value for s in found] for _, found in second]


def test_ctrl_c_stops_between_two_points_without_a_file_too() -> None:
    before = signal.getsignal(signal.SIGINT)
    count = 0

    def report(point, special_points) -> None:
        nonlocal count
        count += 1
        if count == 10:
            signal.raise_signal(signal.SIGINT)

    result = until_ctrl_c(gw.run, stop_study(), report=report)
    assert not result.complete
    assert len(result.branches[0].points) == 10
    assert "interrupted" in str(result.branches[0].ends[-1])
    assert signal.getsignal(signal.SIGINT) is before


def test_a_second_ctrl_c_is_not_waited_for() -> None:
    def report(point, special_points) -> None:
        signal.raise_signal(signal.SIGINT)
        signal.raise_signal(signal.SIGINT)

    with pytest.raises(KeyboardInterrupt):
        gw.run(stop_study(), report=report)
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_it_runs_in_a_thread(tmp_path) -> None:
    results = []
    thread = threading.Thread(target=lambda: results.append(gw.run(stop_study(), tmp_path / "stop.gapwalk")))
    thread.start()
    thread.join()
    assert_same_result(results[0], gw.run(stop_study()))


def test_a_failure_on_the_way_keeps_what_was_found(tmp_path, monkeypatch) -> None:
    path, study = tmp_path / "stop.gapwalk", stop_study()

    class FailingTracer(response.BranchTracer):
        def __next__(self):
            if self.walk.count == 30:
                raise NumericalError("no orbit found between here and there")
            return super().__next__()

    with monkeypatch.context() as patch:
        patch.setattr(response, "BranchTracer", FailingTracer)
        result = gw.run(study, path)
    end = result.branches[0].ends[-1]
    assert (end.reason, end.detail) == (EndReason.FAILED, "no orbit found between here and there")
    assert len(result.branches[0].points) == 31
    assert not result.complete
    assert_same_result(result, gw.open_result(path))
    assert_same_branch(gw.run(study, path, resume=True).branches[0], gw.run(study).branches[0])


def test_a_study_that_makes_no_sense(tmp_path) -> None:
    study, path = stop_study(), tmp_path / "stop.gapwalk"
    with pytest.raises(ModelError, match="the range is empty"):
        gw.run(replace(study, options=replace(study.options, end=0.7)), path)
    with pytest.raises(ModelError, match="no parameter"):
        gw.run(replace(study, options=replace(study.options, parameter="stop.clearence")), path)
    assert not list(tmp_path.iterdir())

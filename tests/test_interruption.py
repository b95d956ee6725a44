"""Ctrl-C in a call raises, so that nothing after it is done with a part of the answer; what was found is not lost."""

import pickle
import signal
import sys
from typing import Any

import pytest

import gapwalk as gw
from gapwalk.bifurcation.detector import Detector
from gapwalk.bifurcation.loci import LocusEndReason
from gapwalk.continuation.walk import EndReason
from gapwalk.errors import Interrupted
from gapwalk.studies.study_kind import found_by
from tests.interruption import until_ctrl_c
from tests.systems import clutch, linear


def after(count: int):
    """A report that Ctrl-C is pressed in at the given call."""
    calls = []

    def report(*news: object) -> None:
        calls.append(news)
        if len(calls) == count:
            signal.raise_signal(signal.SIGINT)

    return report


def test_a_branch_that_is_interrupted_is_there_as_far_as_it_was_walked() -> None:
    start = gw.find_orbit(clutch(frequency=1.0))
    branch = until_ctrl_c(gw.follow, start, "frequency", (0.5, 1.2), report=after(7))
    assert len(branch.points) == 8
    assert branch.ends[-1].reason is EndReason.STOPPED
    whole = gw.follow(start, "frequency", (0.5, 1.2)).values.tolist()  # from one end of the range to the other
    begin = whole.index(1.0)
    assert branch.values.tolist() in (whole[begin : begin + 8], whole[begin::-1][:8])


def test_a_branch_that_is_interrupted_in_a_step_ends_at_its_last_point(monkeypatch) -> None:
    inspect, calls = Detector.inspect, []

    def interrupted(detector: Detector, *points: Any) -> list[gw.SpecialPoint]:
        calls.append(points)
        if len(calls) == 6:
            signal.raise_signal(signal.SIGINT)
        return inspect(detector, *points)

    monkeypatch.setattr(Detector, "inspect", interrupted)
    branch = until_ctrl_c(gw.follow, gw.find_orbit(clutch(frequency=1.0)), "frequency", 0.5)
    assert len(branch.points) == 6
    assert branch.ends[-1].reason is EndReason.STOPPED
    assert branch.ends[-1].value == branch.points[-1].value


def test_a_locus_that_is_interrupted_is_there_as_far_as_it_was_walked() -> None:
    branch = gw.follow(gw.find_orbit(clutch(frequency=1.0)), "frequency", 0.55)
    special = next(each for each in branch.special_points if each.kind is not gw.Kind.BRANCH_POINT)
    plane = ("frequency", "mean.q3", ((0.5, 1.0), (0.24, 0.26)))
    locus = until_ctrl_c(gw.follow_locus, special, *plane, report=after(3))
    assert len(locus.points) == 4
    assert locus.ends[-1].reason is LocusEndReason.STOPPED


def test_before_there_is_anything_there_is_nothing_to_find(monkeypatch) -> None:
    def interrupt(*_: object, **__: object) -> None:
        signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr(sys.modules[gw.follow.__module__], "BranchTracer", interrupt)
    with pytest.raises(KeyboardInterrupt) as caught:
        gw.follow(gw.find_orbit(linear()), "frequency", 1.0)
    assert not isinstance(caught.value, Interrupted)


def test_shares_of_basins_are_counted_over_the_states_that_were_done() -> None:
    options = {"workers": 1}
    found = until_ctrl_c(gw.basin_shares, linear(), {"a": (-1.0, 1.0)}, 5000, **options, report=after(1))
    assert not found.complete
    assert found.notes == ("stopped when 4096 of 5000 states were done",)


def test_what_was_found_can_be_asked_for() -> None:
    def call(*, stops: bool) -> list[int]:
        if stops:
            raise Interrupted([1])
        return [1, 2]

    assert found_by(call, stops=False) == [1, 2]
    assert found_by(call, stops=True) == [1]
    again = pickle.loads(pickle.dumps(Interrupted([1])))
    assert again.found == [1]
    assert str(again) == "the results so far are `found` of this exception, or afterwards sys.last_value.found"


def test_a_notebook_stops_at_the_cell_and_the_next_one_has_what_was_found() -> None:
    shell_of = pytest.importorskip("IPython.core.interactiveshell").InteractiveShell
    shell = shell_of()
    shell.user_ns.update(gw=gw, system=clutch(frequency=1.0), report=after(2))
    cell = 'branch = gw.follow(gw.find_orbit(system), "frequency", 0.5, report=report)\nafter = 1'
    result = shell.run_cell(cell)
    assert isinstance(result.error_in_exec, KeyboardInterrupt)
    assert "after" not in shell.user_ns
    assert shell.run_cell("import sys; branch = sys.last_value.found").success
    assert len(shell.user_ns["branch"].points) == 3


def test_a_regime_map_that_is_stopped_keeps_its_cells_in_the_file(tmp_path) -> None:
    model = tmp_path / "a.toml"
    model.write_text(
        'coordinates = ["x"]\nstiffness = [[1.0]]\ndamping = [[0.1]]\nmean = { x = 0.1 }\n'
        "[[harmonic]]\norder = 1\namplitude = 0.5\nacts_on = { x = 1.0 }\n"
        '[study]\nkind = "regimes"\nresolution = [33, 32]\nworkers = 1\ncheck = 0\n'
        'parameter = "frequency"\nfrom = 0.5\nto = 1.5\nsecond = { parameter = "mean.x", from = 0.0, to = 1.0 }\n'
    )
    path = tmp_path / "a.gapwalk"
    stopped = until_ctrl_c(gw.run, gw.read_study(model), path, report=after(1))
    for result in (stopped, gw.open_result(path)):
        assert not result.complete
        assert result.finding is not None
        assert result.finding.record.cells == {"period 1": 1024, "undecided": 32}
        assert result.finding.notes == ("stopped when 1024 of 1056 cells were done",)

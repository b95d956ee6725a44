"""Diagrams as studies: stored branch by branch, the same however often they are interrupted, and by whom."""

import os
import signal
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.bifurcation.diagram import Cascade, Diagram, Origin
from gapwalk.continuation import EndReason
from gapwalk.errors import ModelError, NumericalError, StoreError
from gapwalk.orbit.orbit import is_same
from gapwalk.results import result_file as file
from gapwalk.studies import diagram_study as growing
from gapwalk.studies.response_study import ResponseOptions
from tests.bifurcation.test_special_points import symmetric
from tests.interruption import until_ctrl_c
from tests.results.tampering import change_sealed
from tests.studies.diagrams import clutch_diagram, clutch_loop, loop_file
from tests.studies.same import assert_same_branch, assert_same_result
from tests.studies.studies import stop_study

pytestmark = pytest.mark.usefixtures("kept_processes")


@pytest.fixture
def path(tmp_path) -> Path:
    return tmp_path / "loop.gapwalk"


@pytest.fixture(scope="module")
def undisturbed() -> gw.Result:
    return clutch_loop()


def test_a_study_is_the_diagram_of_its_system(undisturbed) -> None:
    found = gw.diagram(clutch_diagram().system, "frequency", (0.6, 0.85), max_period=4, workers=1)
    tree = undisturbed.diagram
    assert undisturbed.complete
    assert tree.complete
    assert tree.within == (0.6, 0.85)
    assert undisturbed.names == ("P1-1", "P2-1", "P4-1")
    assert undisturbed.branches == tree.branches
    for a, b in zip(found.branches, undisturbed.branches, strict=True):
        assert_same_branch(a, b)
    main, loop, quad = tree.members
    flips = [i for i, special in enumerate(main.branch.special_points) if special.kind is gw.Kind.FLIP]
    assert (loop.begins, loop.joins) == (Origin("P1-1", flips[0]), Origin("P1-1", flips[1]))
    assert loop.branch.ends[-1].reason is EndReason.JOINED
    assert loop.branch.ends[-1].value == main.branch.special_points[flips[1]].value
    assert "P1-1, at its flip" in str(loop.branch.ends[-1])
    assert quad.begins.parent == quad.joins.parent == "P2-1"
    assert (tree.children("P1-1"), tree.attached("P1-1", loop.begins.special)) == ((loop,), (loop,))
    assert tree["P4-1"] is quad
    assert "1 of period 1, 1 of period 2, 1 of period 4" in repr(tree)
    assert "P2-1" in repr(quad.begins)
    with pytest.raises(KeyError, match="P8-1"):
        tree["P8-1"]


def test_both_halves_of_a_broken_symmetry_are_branches() -> None:
    tree = gw.diagram(symmetric(1.2), "frequency", (0.6, 1.2), max_period=1, workers=1)
    first, one, other, *_ = tree.members
    assert (first.name, one.begins.parent) == ("P1-1", "P1-1")
    assert one.begins == other.begins
    means = [member.branch.points[5].measure("mean.x") for member in (one, other)]
    assert means[0] * means[1] < 0
    assert not is_same(one.branch.points[3].orbit, other.branch.points[3].orbit)


def test_ratios_of_a_cascade() -> None:
    values = np.cumsum([0.0, *(4.669 ** -np.arange(4.0))])  # intervals that shrink by Feigenbaum's number
    assert Cascade(("P1-1",), tuple(values)).ratios == pytest.approx([4.669] * 3)
    assert Diagram("frequency", (0.6, 0.85)).cascades == ()


def test_the_number_of_workers_changes_nothing(path, undisturbed) -> None:
    result = gw.run(clutch_diagram(workers=2), path)
    assert_same_result(result, undisturbed)
    assert_same_result(gw.run(clutch_diagram(workers=1), path, resume=True), undisturbed)


@pytest.mark.slow
def test_what_was_reported_is_in_the_file(path) -> None:
    def report(diagram, member) -> None:
        stored = gw.open_result(path)
        assert stored.names[-1] == member.name
        assert not stored.complete
        assert_same_branch(stored.branches[-1], member.branch)

    gw.run(clutch_diagram(), path, report=report)


@pytest.mark.slow
def test_ctrl_c_just_after_the_file_was_made_keeps_its_branch(path, monkeypatch, undisturbed) -> None:
    replace_file = os.replace

    def interrupted(old, new) -> None:
        replace_file(old, new)
        signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr(os, "replace", interrupted)
    until_ctrl_c(gw.run, clutch_diagram(), path)
    assert gw.open_result(path).names == ("P1-1",)
    monkeypatch.undo()
    reported = []
    resumed = gw.run(clutch_diagram(), path, resume=True, report=lambda diagram, member: reported.append(member.name))
    assert_same_result(resumed, undisturbed)
    assert reported == list(undisturbed.names)


@pytest.mark.slow
def test_ctrl_c_just_before_a_branch_is_written_keeps_it(path, monkeypatch, undisturbed) -> None:
    write = file.ResultFile.write

    def interrupted(kept, *entries) -> None:
        monkeypatch.undo()
        signal.raise_signal(signal.SIGINT)
        write(kept, *entries)

    monkeypatch.setattr(file.ResultFile, "write", interrupted)
    until_ctrl_c(gw.run, clutch_diagram(), path)
    assert gw.open_result(path).names == ("P1-1",)
    assert_same_result(gw.run(clutch_diagram(), path, resume=True), undisturbed)


def test_ctrl_c_without_a_file_keeps_what_there_is_too() -> None:
    def report(diagram, member) -> None:
        signal.raise_signal(signal.SIGINT)

    stopped = until_ctrl_c(gw.run, clutch_diagram(), report=report)
    assert not stopped.complete
    assert stopped.names == ("P1-1",)


def test_ctrl_c_before_the_first_branch_leaves_nothing(path, monkeypatch) -> None:
    def interrupt(*_) -> None:
        signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr(growing, "_walk_branch", interrupt)
    with pytest.raises(KeyboardInterrupt):
        gw.run(clutch_diagram(), path)
    assert not list(path.parent.iterdir())


@pytest.mark.slow
def test_a_disk_that_is_full_loses_nothing_that_was_reported(path, monkeypatch, undisturbed) -> None:
    insert, count = file._insert, 0

    def insert_some(*arguments) -> None:
        nonlocal count
        count += 1
        if count == 4:  # two make the file, with its first branch
            raise OSError(28, "No space left on device")
        insert(*arguments)

    with monkeypatch.context() as patch:
        patch.setattr(file, "_insert", insert_some)
        with pytest.raises(StoreError, match="the disk is full"):
            gw.run(clutch_diagram(), path)
    assert gw.open_result(path).names == ("P1-1", "P2-1")
    assert_same_result(gw.run(clutch_diagram(), path, resume=True), undisturbed)


@pytest.mark.slow
def test_what_cannot_be_walked_is_noted_once(path, monkeypatch) -> None:
    walk = growing.walk_out

    def fail(beginnings, options):
        if beginnings[0].first.orbit.period == 4:
            raise NumericalError("no way")
        return walk(beginnings, options)

    monkeypatch.setattr(growing, "walk_out", fail)

    def report(diagram, member) -> None:
        if member.name == "P2-1":
            signal.raise_signal(signal.SIGINT)

    until_ctrl_c(gw.run, clutch_diagram(), path, report=report)
    result = gw.run(clutch_diagram(), path, resume=True)
    assert result.complete
    assert result.names == ("P1-1", "P2-1")
    assert len(result.diagram.failures) == 2  # from both flips of the loop
    assert all(note.endswith("could not be walked: no way") for note in result.diagram.failures)
    assert_same_result(result, gw.open_result(path))
    monkeypatch.setattr(growing, "walk_out", lambda *_: fail([replace_period(4)], None))
    with pytest.raises(NumericalError, match="no way"):
        gw.run(clutch_diagram())


def replace_period(period: int):
    class BranchStart:
        class first:  # noqa: N801
            class orbit:  # noqa: N801
                pass

    BranchStart.first.orbit.period = period
    return BranchStart


@pytest.mark.slow
def test_a_limit_of_branches_is_an_end_and_is_noted(path) -> None:
    result = gw.run(clutch_diagram(max_branches=2), path)
    assert result.complete  # nothing is left to do
    assert not result.diagram.complete
    assert result.diagram.notes == ("stopped at max_branches = 2; there are more",)
    assert_same_result(gw.run(clutch_diagram(max_branches=2), path, resume=True), result)


@pytest.mark.slow
def test_a_different_study_is_not_resumed(path) -> None:
    gw.run(clutch_diagram(max_period=2), path)
    with pytest.raises(StoreError, match="max_period is 4, and was 2"):
        gw.run(clutch_diagram(), path, resume=True)
    response = replace(clutch_diagram(), options=ResponseOptions("frequency", 0.85, 0.6, "half.q1"))
    with pytest.raises(StoreError, match="its kind is response, and was diagram"):
        gw.run(response, path, resume=True)
    with pytest.raises(StoreError, match="exists already"):
        gw.run(clutch_diagram(), path)


def test_a_study_that_makes_no_sense(path) -> None:
    study = clutch_diagram()
    with pytest.raises(ModelError, match="the range is empty"):
        gw.run(replace(study, options=replace(study.options, end=0.85)), path)
    with pytest.raises(ModelError, match="max_period is 0; it must be an integer from 1 to 100,000"):
        gw.run(clutch_diagram(max_period=0), path)
    with pytest.raises(ModelError, match=r"max_branches is 1\.5"):
        clutch_diagram(max_branches=1.5).options.limits  # noqa: B018
    with pytest.raises(ModelError, match="outside the range"):
        gw.diagram(study.system.at(frequency=1.9), "frequency", (0.6, 0.85))
    assert not list(path.parent.iterdir())


def test_a_branch_may_end_anywhere(path) -> None:
    result = gw.run(clutch_diagram(end=0.7), path)  # the loop is cut off
    assert result.diagram["P2-1"].joins is None
    assert result.branches[1].ends[-1].reason in (EndReason.RANGE, EndReason.TURNED_BACK)
    assert_same_result(result, gw.open_result(path))


@pytest.mark.parametrize(
    "statement",
    [
        "DELETE FROM part WHERE name = 'branch' AND number = 0",
        'UPDATE part SET head = replace(head, \'"name":"P2-1"\', \'"name":"P1-1"\') WHERE name = \'branch\'',
        "UPDATE part SET head = replace(head, '\"ends\":', '\"end\":') WHERE name = 'branch' AND number = 1",
        'UPDATE part SET head = replace(head, \'"ends":{"count":2\', \'"ends":{"count":3\') WHERE name = \'branch\'',
        "UPDATE part SET head = replace(head, ',\"period\":2', ',\"period\":0') WHERE name = 'branch'",
        'UPDATE part SET head = replace(head, \'"parent":"P1-1"\', \'"parent":"P3-1"\') WHERE name = \'branch\'',
        "UPDATE part SET head = replace(head, '\"special\":', '\"special\":9') WHERE name = 'branch' AND number = 1",
        'UPDATE part SET head = replace(head, \'"parent":"P1-1"\', \'"parent":"P2-1"\') WHERE name = \'branch\'',
        "DELETE FROM part WHERE name = 'diagram'",
        'UPDATE part SET head = replace(head, \'"max_period":{"is":"int","int":\', '
        '\'"max_period":{"is":"int","int":-\') WHERE name = \'diagram\'',
    ],
)
def test_a_damaged_result_is_called_so(path, statement) -> None:
    path.write_bytes(loop_file())
    change_sealed(path, statement)
    with pytest.raises(StoreError, match="damaged"):
        gw.open_result(path)


def test_a_response_has_no_diagram(path) -> None:
    result = gw.run(stop_study(end=0.72), path)
    assert gw.open_result(path).diagram is None
    assert result.names == ("P1-1",)

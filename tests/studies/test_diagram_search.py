"""Diagrams whose branches have to be searched for: the same however often they are interrupted, with their coverage."""

import json
import random
import signal
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.bifurcation.isolated import coverage
from gapwalk.continuation import EndReason
from gapwalk.errors import ModelError, NumericalError
from gapwalk.studies import diagram_study as growing
from gapwalk.studies.diagram_study import DiagramOptions
from gapwalk.studies.options import COVERAGE, SearchTable, coverage_rows
from gapwalk.studies.result import result_document
from gapwalk.studies.study_schema import table_schema
from tests.interruption import until_ctrl_c
from tests.studies.diagrams import islands, islands_file
from tests.studies.killing import killed_after
from tests.studies.same import assert_same_result
from tests.tiers import some_of

pytestmark = pytest.mark.usefixtures("kept_processes")


@pytest.fixture
def path(tmp_path) -> Path:
    return tmp_path / "islands.gapwalk"


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory) -> gw.Result:
    path = tmp_path_factory.mktemp("undisturbed") / "islands.gapwalk"
    path.write_bytes(islands_file())
    return gw.open_result(path)


def test_what_hangs_together_with_nothing_is_found(undisturbed) -> None:
    tree = undisturbed.diagram
    assert undisturbed.complete
    assert undisturbed.names == ("P3-1", "P1-1", "P3-2", "P2-1", "P2-2")
    assert [member.begins and member.begins.parent for member in tree.members] == [None, None, None, "P1-1", "P1-1"]
    for name in ("P3-1", "P3-2"):
        assert tree[name].branch.ends[-1].reason is EndReason.CLOSED
    assert tree.notes == coverage(tree.search)
    assert not undisturbed.failures


def test_what_several_processes_store_is_what_one_found(path, undisturbed) -> None:
    returned = gw.run(islands(workers=2), path)
    assert_same_result(returned, undisturbed)
    loaded = gw.open_result(path).diagram.search
    for found, expected in zip(loaded.found, undisturbed.diagram.search.found, strict=True):
        assert np.array_equal(found.orbit.state, expected.orbit.state)
        assert np.array_equal(found.orbit.multipliers, expected.orbit.multipliers)
        assert np.array_equal(found.orbit.system.values, expected.orbit.system.values)
        assert found.orbit.events == expected.orbit.events
        assert found.orbit.measure("rms.q1") == expected.orbit.measure("rms.q1")
    assert coverage(loaded) == undisturbed.diagram.notes


@pytest.mark.slow
@pytest.mark.parametrize("after", some_of([1, 2, 3, 4, 5], 4))
def test_ctrl_c_then_resume_gives_the_same_names_in_the_same_order(path, after, undisturbed) -> None:
    """Between the roots that a search finds, nothing must grow from those that are stored already."""

    def report(diagram, member) -> None:
        if len(diagram.members) == after:
            signal.raise_signal(signal.SIGINT)

    stopped = until_ctrl_c(gw.run, islands(), path, report=report)
    assert stopped.names == undisturbed.names[:after]
    assert (stopped.diagram.search is None) == (after == 1)
    assert_same_result(gw.run(islands(), path, resume=True), undisturbed)
    assert_same_result(gw.open_result(path), undisturbed)


@pytest.mark.slow
def test_a_search_that_is_stopped_keeps_what_it_has_and_is_resumed(path, monkeypatch, undisturbed) -> None:
    search = growing.search

    def stopped_search(*arguments, **options):
        done = []
        return search(*arguments, **{**options, "report": done.append, "stop": lambda: len(done) == 1})

    with monkeypatch.context() as patch:
        patch.setattr(growing, "search", stopped_search)
        stopped = until_ctrl_c(gw.run, islands(), path)
    assert not stopped.complete
    assert stopped.names == ("P3-1",)
    part = gw.open_result(path).diagram
    assert not part.search.complete
    assert part.search.values == (0.351,)
    assert part.search.new
    assert part.notes[0] == "The search was stopped before its end."
    assert_same_result(gw.run(islands(), path, resume=True), undisturbed)


@pytest.mark.slow
def test_a_run_that_is_killed_at_any_moment_comes_to_the_same_result(path, undisturbed) -> None:
    random.seed(15)
    code = f"from tests.studies.diagrams import islands, main; main({str(path)!r}, '1', islands)"
    for aim in (1, 1, 2, 100):
        lines = killed_after(aim, code, longest_wait=0.6)
        assert gw.open_result(path).names == undisturbed.names[: len(gw.open_result(path).names)]
    assert lines[-1] == "complete"
    assert_same_result(replace(gw.open_result(path), study=undisturbed.study), undisturbed)


def test_without_a_first_branch_there_is_no_search(monkeypatch) -> None:
    """Which root comes first must not depend on what a search finds."""

    def fail(beginnings, options):
        raise NumericalError("no way")

    def search(*_, **__):
        raise AssertionError("nothing to search for")

    monkeypatch.setattr(growing, "walk_out", fail)
    monkeypatch.setattr(growing, "search", search)
    with pytest.raises(NumericalError, match="no way"):
        gw.run(islands())


def test_coverage_is_told_value_by_value(undisturbed) -> None:
    result = undisturbed.diagram.search
    rows = [dict(zip(COVERAGE, row, strict=True)) for row in coverage_rows(result)]
    assert [row["value"] for row in rows] == [0.351, 0.445]
    for row in rows:
        assert row["starts"] == 12 == row["settled"] + row["not_periodic"] + row["ran_away"]
        assert row["orbits"] >= row["new"] >= 1
        # the chance that N starts all miss a basin of that share is 5 %
        assert (1 - row["unseen_share"]) ** row["settled"] == pytest.approx(0.05)
    document = json.loads(json.dumps(result_document(undisturbed, points=False)))
    assert document["search"]["values"] == rows
    assert document["search"]["coverage"] == document["notes"] == list(undisturbed.diagram.notes)
    assert document["search"]["complete"] is True
    assert document["failures"] == []


def test_a_file_can_set_every_option_of_a_search() -> None:
    options = {field.name for field in fields(gw.SearchOptions)}
    assert set(table_schema(SearchTable).model_fields) == options | {"values"}


@pytest.mark.parametrize("values", [-1, 1.5, True, (float("nan"),), ("x",)])
def test_bad_values_are_refused(values) -> None:
    with pytest.raises(ModelError, match="an integer from 0 to 100,000, or values of the parameter"):
        DiagramOptions(search_values=values)

"""Jobs of the paper in a folder: done once, completed, and told where they fail."""

from pathlib import Path

import pytest

from gapwalk.errors import ConvergenceError, ModelError, StoreError
from gapwalk.study.run import run
from reproductions.padmanabhan_singh_1995 import compute as module
from reproductions.padmanabhan_singh_1995.compute import compute
from reproductions.padmanabhan_singh_1995.jobs import find_job


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("paper") / "results"
    done = []
    computed = compute(["12", "17", "12"], folder, report=lambda *told: done.append(told))
    assert done == [("12", 1, 2), ("17", 2, 2)]  # the longest first, each once
    assert (set(computed.paths), dict(computed.failures)) == ({"12", "17"}, {})
    return folder


@pytest.fixture
def never(monkeypatch) -> None:
    """A second computation would fail."""

    def fail(*_: object, **__: object) -> None:
        raise AssertionError("it was computed again")

    monkeypatch.setattr("gapwalk.study.diagram.study._grow", fail)
    monkeypatch.setattr("gapwalk.study.settle.study.settle", fail)


@pytest.mark.usefixtures("never")
def test_what_is_done_is_not_done_again(folder) -> None:
    computed = compute(["17", "12"], folder)
    result = computed.result("12")
    assert result is not None
    assert result.branches[0].period == 1
    assert computed.result("13") is None


def test_force_does_it_again(folder, monkeypatch) -> None:
    calls = []
    monkeypatch.setattr(module, "run", lambda *args, **options: calls.append(options) or run(*args, **options))
    compute(["17"], folder, force=True)
    assert calls == [{"resume": False, "force": True}]


def test_the_result_of_another_request_is_written_over(tmp_path) -> None:
    path = tmp_path / "17.gapwalk"
    run(find_job("18").study, path)
    computed = compute(["17"], tmp_path)
    result = computed.result("17")
    assert result is not None
    assert result.system.frequency == 0.63


def test_a_file_that_is_no_result_is_not_touched(tmp_path) -> None:
    path = tmp_path / "17.gapwalk"
    path.write_text("the only copy of a letter, and longer than the head of a result file is")
    with pytest.raises(StoreError, match="no result"):
        compute(["17"], tmp_path)
    assert path.read_text().startswith("the only copy")


def test_numerics_that_fail_are_told_and_keep_nothing_back(tmp_path, monkeypatch) -> None:
    def refuse(study, *args, **options):
        if "damping as-printed" in study.title:
            raise ConvergenceError("the motion runs away")
        return run(study, *args, **options)

    monkeypatch.setattr(module, "run", refuse)
    computed = compute(["17-as-printed", "17"], tmp_path)
    assert dict(computed.failures) == {"17-as-printed": "the motion runs away"}
    assert set(computed.paths) == {"17"}


def test_an_unknown_job_is_refused_before_anything_is_computed(tmp_path) -> None:
    with pytest.raises(ModelError, match="no job 'x'"):
        compute(["12", "x"], tmp_path)
    assert not list(tmp_path.iterdir())


def test_a_folder_that_cannot_be_made(tmp_path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(StoreError, match="cannot be made"):
        compute(["12"], tmp_path / "file" / "results")

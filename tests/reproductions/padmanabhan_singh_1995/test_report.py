"""Studies of the paper in a folder: run once, resumed, and named where they fail."""

import math
from pathlib import Path

import pytest

import gapwalk as gw
from reproductions.padmanabhan_singh_1995 import report as module
from reproductions.padmanabhan_singh_1995.jobs import AS_PRINTED, JOBS
from reproductions.padmanabhan_singh_1995.report import compute

JOB, FREQUENCY = JOBS["17"], 0.63
RUN = gw.run


def done(jobs, folder: Path, **options):
    with gw.parallel.local_workers(1) as workers:
        return compute(jobs, folder, workers, **options)


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("paper") / "results"
    seen = []
    results, failures = done([JOB, JOBS["12"]], folder, progress=lambda *news: seen.append(news))
    # before anything is done, and then the longest first
    assert [news[:4] for news in seen] == [("studies", "", 0, 2), ("studies", "12", 1, 2), ("studies", "17", 2, 2)]
    assert math.isnan(seen[0][4])
    assert 0.0 < seen[1][4] < 60.0  # seconds left
    assert seen[2][4] == 0.0
    assert (set(results), failures) == ({"12", "17"}, {})
    return folder


@pytest.fixture
def never(monkeypatch) -> None:
    """A second computation would fail."""

    def fail(*_: object, **__: object) -> None:
        raise AssertionError("it was computed again")

    monkeypatch.setattr("gapwalk.studies.diagram_study.DiagramWork.parts", fail)
    monkeypatch.setattr("gapwalk.studies.settle_study.settle", fail)


@pytest.mark.slow
@pytest.mark.usefixtures("never")
def test_what_is_done_is_not_done_again(folder) -> None:
    seen = []
    results, _ = done([JOB, JOBS["12"]], folder, progress=lambda *news: seen.append(news[4]))
    assert all(map(math.isnan, seen))  # what is found in its file says nothing of the time that is left
    assert results["12"].branches[0].period == 1
    assert set(results) == {"12", "17"}


def test_force_does_it_again(folder, monkeypatch) -> None:
    calls = []
    monkeypatch.setattr(gw, "run", lambda *args, **options: calls.append(options) or RUN(*args, **options))
    done([JOB], folder, force=True)
    assert calls == [{"resume": False, "force": True}]


def test_the_result_of_another_request_is_written_over(tmp_path) -> None:
    gw.run(JOBS["18"].study, tmp_path / "17.gapwalk")
    results, _ = done([JOB], tmp_path)
    assert results["17"].system.frequency == FREQUENCY


def test_a_damaged_result_is_computed_again(folder, tmp_path) -> None:
    content = bytearray((folder / "17.gapwalk").read_bytes())
    content[len(content) // 2 :] = bytes(len(content) - len(content) // 2)
    (tmp_path / "17.gapwalk").write_bytes(content)
    results, failures = done([JOB], tmp_path)
    assert (results["17"].complete, failures) == (True, {})


def test_a_file_that_is_no_result_is_not_touched(tmp_path) -> None:
    path = tmp_path / "17.gapwalk"
    path.write_text("the only copy of a letter, and longer than the head of a result file is")
    with pytest.raises(gw.errors.StoreError, match="not a result"):
        done([JOB], tmp_path)
    assert path.read_text().startswith("the only copy")


def test_numerics_that_fail_are_named_and_keep_nothing_back(tmp_path, monkeypatch) -> None:
    def refuse(study, *args, **options):
        if "damping as-printed" in study.title:
            raise gw.errors.ConvergenceError("the motion runs away")
        return RUN(study, *args, **options)

    monkeypatch.setattr(gw, "run", refuse)
    results, failures = done([JOB.at(AS_PRINTED), JOB], tmp_path)
    assert failures == {"17-as-printed": "the motion runs away"}
    assert set(results) == {"17"}


def test_a_folder_that_cannot_be_made(tmp_path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(gw.errors.StoreError, match="cannot be made"):
        done([JOB], tmp_path / "file" / "results")


@pytest.mark.slow
def test_other_processes_do_the_same(tmp_path) -> None:
    with gw.parallel.local_workers(2) as workers:
        results, failures = compute([JOB, JOBS["18"]], tmp_path, workers)
    assert {key: result.system.frequency for key, result in results.items()} == {"17": FREQUENCY, "18": 0.634}
    assert not failures


def test_the_code_that_draws_is_older_than_what_it_draws(tmp_path) -> None:
    (tmp_path / "new").write_text("")
    assert 0.0 < module._last_change() <= (tmp_path / "new").stat().st_mtime

"""Do the jobs of the paper, several side by side, each into a result file of its own; what is done stays done."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from gapwalk.errors import NumericalError, StoreError
from gapwalk.paper.job import Job
from gapwalk.paper.jobs import find_job
from gapwalk.study.claim import check_claim
from gapwalk.study.load import load_result
from gapwalk.study.result import Result
from gapwalk.study.run import run
from gapwalk.study.work.processes import local_cores
from gapwalk.study.work.workers import workers

Report = Callable[[str, int, int], object]
"""Called with the key of a job that is done, and how many are done of how many."""

_LONG = 10.0  # seconds of work from which on another process is worth its start


class Computed(NamedTuple):
    """What the jobs have come to, by their keys."""

    paths: Mapping[str, Path]
    """Result files."""
    failures: Mapping[str, str]
    """Why a job has no result, or what is missing in it, in a sentence."""

    def result(self, key: str) -> Result | None:
        """The result of a job; None if it has none."""
        path = self.paths.get(key)
        return None if path is None else load_result(path)


class _Piece(NamedTuple):
    job: Job
    path: Path
    force: bool


def compute(
    keys: Sequence[str],
    folder: Path,
    *,
    force: bool = False,
    cores: int | None = None,
    report: Report | None = None,
) -> Computed:
    """Do jobs, the longest first, and keep their results in a folder.

    A result that is there already and complete is not computed again; an interrupted one is completed. One of another
    request, such as from an earlier version of gapwalk with other options, is written over.

    Parameters
    ----------
    keys
        Which jobs, as `find_job` has them.
    folder
        Where the result files are to be; it is made if need be.
    force
        Compute all of them anew.
    cores
        How many processes work; by default one for each local core, and one for jobs of a moment.
    report
        Called with each job that is done.

    Raises
    ------
    StoreError
        If a file cannot be written, or is none of gapwalk's.
    KeyboardInterrupt
        After Ctrl-C; what is complete by then is kept.
    """
    _make(folder)
    jobs = sorted((find_job(key) for key in dict.fromkeys(keys)), key=lambda job: -job.effort)
    pieces = [_Piece(job, folder / f"{job.key}.gapwalk", force) for job in jobs]
    paths: dict[str, Path] = {}
    failures: dict[str, str] = {}

    def accept(index: int, failure: str) -> None:
        key, path = jobs[index].key, pieces[index].path
        if path.exists():
            paths[key] = path
        if failure:
            failures[key] = failure
        if report is not None:
            report(key, len({*paths, *failures}), len(jobs))

    with workers(_count(jobs, cores)) as hands:
        hands.run(_do, pieces, accept, in_order=False)
    return Computed(paths, failures)


def _count(jobs: Sequence[Job], cores: int | None) -> int:
    """How many processes are worth their start."""
    short = sum(job.effort for job in jobs) < _LONG or len(jobs) < 2
    return 1 if short else min(cores or local_cores(), len(jobs))


def _do(piece: _Piece) -> str:
    """Do one job; an empty text, or a sentence on what failed."""
    study, path = piece.job.study, piece.path
    anew = piece.force
    if path.exists() and not anew:
        try:
            check_claim(path, study, resume=True, force=False)
        except StoreError:  # the result of another request, or damaged; what is no result at all is refused below
            anew = True
    try:
        result = run(study, path, resume=not anew, force=anew and path.exists())
    except NumericalError as error:
        return str(error)
    return "; ".join(result.failures)


def _make(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise StoreError(f"the folder {folder} cannot be made: {error.strerror or error}") from None

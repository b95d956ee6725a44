"""A run: studies are computed in several processes, claims checked, figures drawn; what is there already stays."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple

import gapwalk as gw
from reproductions.padmanabhan_singh_1995.claims import Claim, Outcome, Trade, decide, jobs_of
from reproductions.padmanabhan_singh_1995.figures import Figure
from reproductions.padmanabhan_singh_1995.jobs import Job, Reading

Progress = Callable[[str, str, int, int, float], object]
"""Called with what is being done, what was done last, how many are done of how many, and seconds left (nan: unknown).

At the beginning nothing was done last, and its name is empty.
"""

_COLOURS = 64  # of a picture: a third of the bytes, and no difference to be seen
_LONG = 10.0  # seconds of work from which on another process is worth its start


@dataclass(frozen=True)
class Report:
    """What a run has found."""

    figures: tuple[Figure, ...]  #: The figures, in one reading.
    reading: Reading  #: That reading.
    results: Mapping[str, gw.Result] = field(default_factory=dict)  #: Results by the keys of their jobs.
    failures: Mapping[str, str] = field(default_factory=dict)  #: Why a job has none, or what is missing in it.
    checked: Sequence[tuple[Claim, Outcome]] = ()  #: The claims, and what their checks have come to.
    pictures: Mapping[str, Sequence[str]] = field(default_factory=dict)  #: Files of the panels of each figure drawn.
    trades: Sequence[Trade] = ()  #: What other numbers gain and cost, if all claims are checked.

    def about(self, figure: Figure) -> list[tuple[Claim, Outcome]]:
        """Return the claims about one figure."""
        return [(claim, outcome) for claim, outcome in self.checked if claim.figure == str(figure.number)]

    @property
    def faults(self) -> dict[str, str]:
        """The failures of what was asked for; that a study fails in another reading of a claim is a finding."""
        jobs = [job for figure in self.figures for job in figure.jobs]
        jobs += [job for claim, _ in self.checked for job in claim.jobs if job.reading == self.reading]
        wanted = {job.key for job in jobs}
        return {key: text for key, text in self.failures.items() if key in wanted}


def reproduce(
    figures: Sequence[Figure],
    claims: Sequence[Claim],
    reading: Reading,
    folder: Path,
    *,
    draw: bool = True,
    force: bool = False,
    cores: int | None = None,
    progress: Progress | None = None,
) -> Report:
    """Compute what figures and claims rest on, check the claims, and draw the figures.

    Parameters
    ----------
    figures, claims
        What is reproduced.
    reading
        The reading in which the figures are drawn. Claims name their own readings.
    folder
        The folder of the pictures; result files are in its folder ``results``. It is made if need be.
    draw
        Whether to write pictures, and the tables of the results.
    force
        Compute and draw everything again. Otherwise a complete result is left alone, an interrupted one is resumed, and
        one of another request is computed again; pictures newer than their results and than gapwalk stay.
    cores
        Number of processes; by default one for each local core, and this process alone for a few seconds of work.
    progress
        Called whenever a study or a picture is done.

    Raises
    ------
    StoreError
        If a file cannot be written, or is no result file of gapwalk.
    KeyboardInterrupt
        After Ctrl-C; what has been computed is kept.
    """
    figures = tuple(figure.at(reading) for figure in figures)
    jobs = {job.key: job for figure in figures for job in figure.jobs}
    jobs |= {job.key: job for job in jobs_of(claims)}
    effort = sum(job.effort for job in jobs.values())
    with gw.parallel.local_workers(1 if effort < _LONG or len(jobs) < 2 else cores) as workers:
        results, failures = compute(list(jobs.values()), folder / "results", workers, force=force, progress=progress)
        if progress is not None and claims:
            progress("claims", "", 0, len(claims), math.nan)
        checked, trades = decide(claims, results, failures)
        report = Report(figures, reading, results, failures, checked, trades=trades)
        return replace(report, pictures=_draw(report, folder, workers, force, progress)) if draw else report


def compute(
    jobs: Sequence[Job], folder: Path, workers: Any, *, force: bool = False, progress: Progress | None = None
) -> tuple[dict[str, gw.Result], dict[str, str]]:
    """Run the studies of jobs, the longest first, each into a result file of its own.

    Parameters
    ----------
    jobs, folder, force, progress
        As in `reproduce`; `folder` is that of the result files.
    workers
        The processes that do it, as from `gapwalk.parallel.local_workers`.

    Returns
    -------
    results, failures : dict
        The results, and why a job has none or what is missing in it, by the keys of the jobs.
    """
    _make(folder)
    tasks = [_Task(job, folder / f"{job.key}.gapwalk", force) for job in sorted(jobs, key=lambda job: -job.effort)]
    failures: dict[str, str] = {}
    done: list[str] = []
    begin, left, spent = time.monotonic(), sum(task.job.effort for task in tasks), 0.0

    def accept(index: int, found: tuple[str, bool]) -> None:
        nonlocal left, spent
        (failure, is_new), job = found, tasks[index].job
        done.append(job.key)
        left -= job.effort
        spent += job.effort if is_new else 0.0
        if failure:
            failures[job.key] = failure
        if progress is not None:
            ahead = left * (time.monotonic() - begin) / spent if spent else math.nan
            progress("studies", job.key, len(done), len(tasks), ahead)

    if progress is not None:
        progress("studies", "", 0, len(tasks), math.nan)
    workers.run(_compute, tasks, accept, in_order=False)
    return {task.job.key: gw.open_result(task.path) for task in tasks if task.path.exists()}, failures


class _Task(NamedTuple):
    job: Job
    path: Path
    force: bool


def _compute(task: _Task) -> tuple[str, bool]:
    """Run the study of one job; return an empty text, or a sentence on what failed, and whether it was computed now."""
    before = _written(task.path)
    failure = _failure(task)
    return failure, _written(task.path) != before


def _written(path: Path) -> int:
    """Return when a file was written; 0 if there is none."""
    return path.stat().st_mtime_ns if path.exists() else 0


def _failure(task: _Task) -> str:
    study = task.job.study
    try:
        try:
            result = gw.run(study, task.path, resume=not task.force, force=task.force)
        except gw.errors.StoreError:
            if task.force:
                raise
            # The result of another request, or damaged. What is no result at all is refused again, and stays.
            result = gw.run(study, task.path, force=True)
    except gw.errors.NumericalError as error:
        return str(error)
    return "; ".join(result.failures)


class _Sketch(NamedTuple):
    """A figure to draw, and the keys of the jobs whose tables are written with it."""

    figure: Figure
    tables: tuple[str, ...]
    folder: Path


def _draw(
    report: Report, folder: Path, workers: Any, force: bool, progress: Progress | None
) -> dict[str, tuple[str, ...]]:
    """Draw the figures that have all results, and return the names of the picture files."""
    whole = [figure for figure in report.figures if {job.key for job in figure.jobs} <= set(report.results)]
    changed = _last_change()
    pictures = {figure.name: _names(figure) for figure in whole if not force and _is_drawn(figure, folder, changed)}
    sketches: list[_Sketch] = []
    seen = set[str]()
    for figure in (figure for figure in whole if figure.name not in pictures):
        keys = tuple(job.key for job in figure.jobs if job.key not in seen)
        sketches.append(_Sketch(figure, keys, folder))
        seen.update(keys)

    def accept(index: int, names: tuple[str, ...]) -> None:
        pictures[sketches[index].figure.name] = names
        if progress is not None:
            progress("pictures", sketches[index].figure.name, len(pictures), len(whole), math.nan)

    workers.run(_draw_one, sketches, accept, in_order=False)
    return pictures


def _draw_one(sketch: _Sketch) -> tuple[str, ...]:
    from PIL import Image  # matplotlib writes its pictures with it

    figure, tables, folder = sketch
    results = {job.key: gw.open_result(folder / "results" / f"{job.key}.gapwalk") for job in figure.jobs}
    for key in tables:
        gw.save_tables(results[key], folder / "results" / key)
    for panel, name in zip(figure.panels, _names(figure), strict=True):
        picture = panel.picture([results[job.key] for job in figure.jobs_of(panel)])
        gw.plot.save(picture, folder / name)
        with Image.open(folder / name) as whole:
            few = whole.convert("RGB").quantize(_COLOURS, dither=Image.Dither.NONE)
        few.save(folder / name, optimize=True)
    return _names(figure)


def _names(figure: Figure) -> tuple[str, ...]:
    return tuple(figure.file_name(panel) for panel in figure.panels)


def _is_drawn(figure: Figure, folder: Path, changed: float) -> bool:
    """Tell whether the pictures of a figure, which are written last, show its results as they are."""
    pictures = [folder / name for name in _names(figure)]
    if not all(path.exists() for path in pictures):
        return False
    results = [(folder / "results" / f"{job.key}.gapwalk").stat().st_mtime for job in figure.jobs]
    return min(path.stat().st_mtime for path in pictures) > max([changed, *results])


def _last_change() -> float:
    """Return when the code that draws was changed last, which is when it was installed."""
    folders = (Path(gw.__file__).parent, Path(__file__).parent)
    return max(path.stat().st_mtime for folder in folders for path in folder.rglob("*.py"))


def _make(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise gw.errors.StoreError(f"the folder {folder} cannot be made: {error.strerror or error}") from None

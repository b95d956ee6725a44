"""A task as the process that does it sees it: a study, or what follows from an orbit, and the result file to write."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from gapwalk.explorer.news import News, Progress
from gapwalk.studies.file import Study
from gapwalk.studies.interruption import found_by
from gapwalk.studies.run import run


class FollowUp(Protocol):
    """Work that starts from an orbit and is not a study of a model file; see `gapwalk.explorer.follow_ups`."""

    def do(self, study: Study, output: Path, news: News, *, resume: bool) -> bool:
        """Do it, and write the result file; whether it was done to its end, False after Ctrl-C."""
        ...


@dataclass(frozen=True)
class Task:
    """What is to be done.

    Parameters
    ----------
    study
        The study; of an follow_up, what its result is stored as.
    output
        The result file.
    follow_up
        What to do if it is not the study itself.
    resume
        Whether to go on with an interrupted run; where it has left no result file, to begin.
    """

    study: Study
    output: Path
    follow_up: FollowUp | None = None
    resume: bool = False


def do(task: Task, tell: Callable[[Progress], object]) -> bool:
    """Do a task, and tell what is new, four times a second at most; whether it was done to its end.

    Ctrl-C stops it with what there is stored. Errors as `gapwalk.run`, `gapwalk.switch`, `gapwalk.find_others` and
    `gapwalk.follow_locus`.
    """
    news = News(tell)
    try:
        if task.follow_up is None:
            return _run(task, news)
        return task.follow_up.do(task.study, task.output, news, resume=task.resume)
    finally:
        with suppress(OSError):  # nobody listens any more
            news.tell()


def _run(task: Task, news: News) -> bool:
    reports = {"response": news.point, "diagram": news.member, "map": news.chart, "locus": news.chart}
    report = reports.get(task.study.options.kind, news.part)
    resume = task.resume and task.output.exists()
    return found_by(run, task.study, task.output, resume=resume, report=report).complete

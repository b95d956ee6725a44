"""The one runner of all kinds of study: it stores each part once it is found, and continues stopped runs."""

from __future__ import annotations

import os
import reprlib
import time
from collections.abc import Callable, Iterable
from contextlib import ExitStack, closing, nullcontext
from typing import Any, TypeVar

from gapwalk.errors import Interrupted, ModelError
from gapwalk.model.system import System
from gapwalk.notebook import shows_progress
from gapwalk.parallel.processes import local_cores
from gapwalk.parallel.workers import Pace, Workers, for_all, local_workers
from gapwalk.pieces import tell
from gapwalk.results.result_file import Parts, lock, reading, undamaged, versions
from gapwalk.studies.result import (
    Call,
    Keeper,
    NoFile,
    Result,
    as_before,
    claimed,
    earlier_result,
    load_result,
    request_file,
    result_of,
)
from gapwalk.studies.study_file import Study, read_study
from gapwalk.studies.study_kind import Work

Report = Callable[..., object]
"""Called with each part when it is done and is in the file; with what, says `gapwalk.studies.study_kind.Found`."""

AnyWork = TypeVar("AnyWork", bound=Work)


def run_study(
    study: Study,
    output: str | os.PathLike[str] | None = None,
    *,
    resume: bool = False,
    force: bool = False,
    report: Report | None = None,
    work: Work | None = None,
) -> Result:
    """Run a study, or other work whose result is stored as that of a study; otherwise as `gapwalk.run`."""
    work = work or study.options.work(study.system)
    with nullcontext() if output is None else lock(output):
        earlier = earlier_result(output, study, resume=resume, force=force)
        if earlier is not None and output is not None:
            with reading(output) as parts:
                _take(work, parts, study.system)
            for news in work.again():
                if report is not None:
                    report(*news)
            if earlier.complete:
                return earlier
        before = None if earlier is None else dict(earlier.versions)
        finished, is_kept = _carry_out(work, study.options, None, lambda: request_file(study, output, before), report)
        if output is None or finished:
            result = result_of(study, work, versions(before)) if finished or work.done else None
        else:  # after Ctrl-C at any moment, what is stored is what counts
            result = load_result(output) if is_kept or before is not None else None
    if finished and result is not None:
        return result
    if result is None or not result.interrupted:
        raise KeyboardInterrupt  # there is nothing to keep, or a second Ctrl-C came before the first was noted
    raise Interrupted(result)


def check_work(studies: Iterable[Study]) -> None:
    """Raise a ModelError that says which of some studies no work can do, before any of them is computed."""
    problems = []
    for study in studies:
        try:
            study.options.work(study.system)
        except ModelError as error:
            problems.append(f"study {study.name}: {error}" if study.name else str(error))
    if problems:
        raise ModelError("\n".join(problems))


def call(
    asked: Any,
    work: AnyWork,
    system: System,
    *,
    workers: Workers | int | None = None,
    report: Report | None = None,
    output: str | os.PathLike[str] | None = None,
) -> AnyWork:
    """Do the work that a Python function requests; if its file contains a part of it, continue that."""
    request = Call(system, asked)
    with claimed(request, output) as before:
        if output is not None and before is not None:
            with reading(output) as parts:
                _take(work, parts, system)
        if not work.complete:
            finished, _ = _carry_out(work, asked, workers, lambda: request_file(request, output, before), report)
            if not finished:
                raise Interrupted(work.record) from None
    return work


def _take(work: Work, parts: Parts, system: System) -> None:
    parts.base = system
    with undamaged(parts.path):
        work.take(parts)


def _carry_out(
    work: Work, asked: Any, workers: Workers | int | None, opened: Callable[[], Keeper], report: Report | None
) -> tuple[bool, bool]:
    """Do the remaining work; store and report it part by part."""
    # The file is opened when the first part is ready: if the work cannot be continued, the file stays unchanged.
    begun, before = time.monotonic(), work.done
    waiting: list[tuple[Any, ...]] = []
    with ExitStack() as stack:
        file: Keeper | None = None
        try:
            # this process does the work where the options say nothing of others
            count = getattr(asked, "workers", 1) if workers is None else workers
            most = getattr(asked, "most_workers", None)
            if most is not None and not isinstance(count, Workers):
                count = min(local_cores() if count is None else count, most)
            with local_workers(count) as executor, for_all(executor), closing(work.parts(executor)) as parts:
                executor.prepare()
                if begins := getattr(report, "begin", None):
                    begins(Pace(work.done, work.total, work.done), lambda: executor.in_progress)
                for found in parts:
                    tell(0.0)
                    file = file or stack.enter_context(opened())
                    if found.entries:
                        file.write(*found.entries)
                    pace = Pace(work.done, work.total, before, time.monotonic() - begun)
                    waiting += ((found.entries[0].value, pace),) if found.news is None else found.news
                    if report is not None and (found.entries or isinstance(file, NoFile)):
                        for news in waiting:
                            report(*news)
                        waiting = []
        except KeyboardInterrupt:
            finished = False
        else:
            finished = True
        if entries := tuple(work.last(finished=finished)):
            file = file or stack.enter_context(opened())
            file.write(*(each for each in entries if not each.part.numbered or each.number >= file.count(each.part)))
        return finished, file is not None and file.is_begun


@shows_progress(lambda count, *news: str(news[-1]) if isinstance(news[-1], Pace) else f"{count} parts")
def run(
    request: Study | str | os.PathLike[str],
    output: str | os.PathLike[str] | None = None,
    *,
    resume: bool = False,
    force: bool = False,
    study: str = "",
    report: Callable[..., object] | None = None,
) -> Result:
    """Run a study, or that of a model file.

    A numerical failure does not affect the other parts; the end of a branch, or the `failures` of a diagram or
    a map, state the reason.

    Parameters
    ----------
    request
        The study, as from `read_study`, or a model file with its study.
    output
        A result file to write while it runs; `open_result` reads it. None: the result is only returned.
    resume
        Continue the result file of an interrupted run; it becomes the same as without the interruption. If there is
        no such file, begin.
    force
        Overwrite an existing result file.
    study
        Name of the study, if `request` is a file that has several.
    report
        Called with each new result, once it is in the file: a point of a response and the special points before it; a
        diagram and its new branch; a map and its new section or locus; of other studies, each part of the work and the
        `gapwalk.parallel.workers.Pace` of all. The stored part of a resumed result is reported first.

    Returns
    -------
    Result
        What the study has found.

    Raises
    ------
    StoreError
        If the result file exists (and is not to be resumed or overwritten), belongs to a different study, is being
        written by another run, or cannot be written.
    ModelError
        If the study is invalid.
    NumericalError
        If no first orbit is found.
    Interrupted
        After Ctrl-C: the results so far are in the file; `found` of the exception is the result, with ``complete``
        False.
    KeyboardInterrupt
        After Ctrl-C before a diagram has its first branch, or a map its first section; or while a complete result is
        verified.

    Examples
    --------
    >>> [str(special.kind) for special in gw.run(study).branches[0].special_points]  # or: gw.run("stop.toml")
    ['fold', 'fold', 'grazing']
    """
    if isinstance(request, str | os.PathLike):
        asked = read_study(request, name=study)
    elif isinstance(request, Study):
        asked = request
    else:
        hint = 'gw.run("model.toml") or gw.run(gw.read_study("model.toml"))'
        raise ModelError(f"run takes a study or a model file, not {reprlib.repr(request)}; write {hint}")
    if resume and output is not None and asked.reduced is not None and os.path.lexists(output):
        asked = as_before(asked, load_result(output).study)
    try:
        result = run_study(asked, output, resume=resume, force=force, report=report)
        from gapwalk.studies.verify import with_checks, with_verification  # only now: it loads all that can be verified

        return with_verification(with_checks(result, output), asked.options, output)
    except Interrupted as stop:
        if isinstance(stop.found, Result):
            raise
        raise KeyboardInterrupt from None  # a curve was followed to read or check what is stored: that stays as it is

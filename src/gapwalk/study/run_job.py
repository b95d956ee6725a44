"""Runs a study without branches: its job keeps its parts in the result file, and an interrupted run goes on."""

from __future__ import annotations

import os
from collections.abc import Callable

from gapwalk.study.file import Study
from gapwalk.study.jobs import job_of
from gapwalk.study.result import Result
from gapwalk.study.store.claim import earlier_result
from gapwalk.study.store.database import lock
from gapwalk.study.store.result_file import ResultFile
from gapwalk.study.store.shelf import Shelf
from gapwalk.study.store.stored import StoredParts, read
from gapwalk.study.store.versions import versions


def run_job(
    study: Study,
    output: str | os.PathLike[str] | None = None,
    *,
    resume: bool = False,
    force: bool = False,
    report: Callable[..., object] | None = None,
) -> Result:
    """Run a study of one of the kinds in `gapwalk.study.jobs`; parameters and errors as in `gapwalk.run`."""
    job = job_of(study.options.kind)
    if output is None:
        finding = job.work(study, None, report)
        return Result(study, (), finding.complete, versions(), finding=finding)
    with lock(output):
        earlier = earlier_result(output, study, resume=resume, force=force)
        found = StoredParts(None, {}) if earlier is None else earlier.found
        assert isinstance(found, StoredParts)  # the study is the same
        if earlier is not None and found.finding is not None and found.finding.complete:
            return earlier.result()
        written_by = versions(None if earlier is None else earlier.versions)
        with ResultFile(output, study, written_by, exists=earlier is not None) as file:
            job.work(study, Shelf(file, found.parts), report)
            if not file.is_begun:
                raise KeyboardInterrupt  # there is nothing to keep
        return read(output).result()  # after Ctrl-C at any moment, what is stored is what counts

"""Runs a study without branches: its job keeps its parts in the result file, and an interrupted run continues."""

from __future__ import annotations

import os
from collections.abc import Callable

from gapwalk.results.result_file import lock
from gapwalk.results.versions import versions
from gapwalk.studies.claim import earlier_result
from gapwalk.studies.file import Study
from gapwalk.studies.jobs import job_of
from gapwalk.studies.load import load_result
from gapwalk.studies.request import request_file
from gapwalk.studies.result import Result


def run_job(
    study: Study,
    output: str | os.PathLike[str] | None = None,
    *,
    resume: bool = False,
    force: bool = False,
    report: Callable[..., object] | None = None,
) -> Result:
    """Run a study of one of the kinds in `gapwalk.studies.jobs`; parameters and errors as in `gapwalk.run`."""
    job = job_of(study.options.kind)
    if output is None:
        finding = job.work(study, None, report)
        return Result(study, (), finding.complete, versions(), finding=finding)
    with lock(output):
        earlier = earlier_result(output, study, resume=resume, force=force)
        if earlier is not None and earlier.complete:
            return earlier
        with request_file(study, output, None if earlier is None else earlier.versions) as file:
            job.work(study, file, report)
            if not file.is_begun:
                raise KeyboardInterrupt  # there is nothing to keep
        return load_result(output)  # after Ctrl-C at any moment, what is stored is what counts

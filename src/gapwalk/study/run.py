"""Run a study, whatever its kind."""

from __future__ import annotations

import os

from gapwalk.study.file import Study
from gapwalk.study.response import run_response
from gapwalk.study.result import Result
from gapwalk.study.store import Report


def run(
    study: Study,
    output: str | os.PathLike[str] | None = None,
    *,
    resume: bool = False,
    force: bool = False,
    report: Report | None = None,
) -> Result:
    """Run a study.

    Ctrl-C stops it between two points: what has been found is returned, and not `complete`. So does a failure of the
    numerics on the way; the end of the branch says what happened.

    Parameters
    ----------
    study
        The study, as from `read_study`.
    output
        A result file to write while it runs; `load` reads it. None: the result is only returned.
    resume
        Go on with the result file of an interrupted run; it becomes the same as without the interruption. If there is
        no such file, begin.
    force
        Write over an existing result file.
    report
        Called with each new point and the special points before it, once they are in the file. The points of a
        resumed result come first.

    Raises
    ------
    StoreError
        If the result file exists (and is not to be resumed or written over), belongs to a different study, is being
        written by another run, or cannot be written.
    ModelError
        If the study makes no sense.
    NumericalError
        If no first orbit is found.
    """
    return run_response(study, output, resume=resume, force=force, report=report)

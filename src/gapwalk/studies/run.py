"""Run a study, whatever its kind."""

from __future__ import annotations

import os
import reprlib
from collections.abc import Callable

from gapwalk.errors import Interrupted, ModelError
from gapwalk.notebook.progress_line import shows_progress
from gapwalk.parallel.pace import Pace
from gapwalk.studies.diagram.study import run_diagram
from gapwalk.studies.file import Study
from gapwalk.studies.jobs import JOBS
from gapwalk.studies.load import load_result
from gapwalk.studies.map.study import run_map
from gapwalk.studies.reduced.before import as_before
from gapwalk.studies.reduced.check import with_checks
from gapwalk.studies.response import run_response
from gapwalk.studies.result import Result
from gapwalk.studies.run_job import run_job
from gapwalk.studies.verify import with_verification

_RUNNERS: dict[str, Callable[..., Result]] = {
    "response": run_response,
    "diagram": run_diagram,
    "map": run_map,
    "locus": run_map,
    **dict.fromkeys(JOBS, run_job),
}


@shows_progress(lambda count, *news: str(news[-1]) if isinstance(news[-1], Pace) else f"{count} parts")
def run(
    study: Study,
    output: str | os.PathLike[str] | None = None,
    *,
    resume: bool = False,
    force: bool = False,
    report: Callable[..., object] | None = None,
) -> Result:
    """Run a study.

    A failure of the numerics on the way does not lose the rest; the end of a branch, or the `failures` of a diagram or
    a map, say what happened.

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
        Called with what is new, once it is in the file: of a response, each point and the special points before it
        (`gapwalk.studies.walk_file.Report`); of a diagram, the diagram and the branch that was added to it
        (`gapwalk.studies.diagram.study.Report`); of a map or a locus, the map and the section or the locus that was
        added to it (`gapwalk.studies.map.Report`); of a family, a sweep, basins and regimes, each part of the work and
        the `gapwalk.parallel.pace.Pace` of all. What a resumed result has already comes first.

    Raises
    ------
    StoreError
        If the result file exists (and is not to be resumed or written over), belongs to a different study, is being
        written by another run, or cannot be written.
    ModelError
        If the study makes no sense.
    NumericalError
        If no first orbit is found.
    Interrupted
        After Ctrl-C: what has been found is in the file, and `found` of the exception is the result, not `complete`.
    KeyboardInterrupt
        After Ctrl-C before a diagram has its first branch, or a map its first section; or while a complete result is
        verified.
    """
    if not isinstance(study, Study):
        file = os.fspath(study) if isinstance(study, str | os.PathLike) else "model.toml"
        hint = f"gw.run(gw.read_study({file!r}))"
        raise ModelError(f"run takes a study, not {reprlib.repr(study)}; read one from a file: {hint}")
    if resume and output is not None and study.reduced is not None and os.path.lexists(output):
        study = as_before(study, load_result(output).study)
    result = _RUNNERS[study.options.kind](study, output, resume=resume, force=force, report=report)
    if result.interrupted:
        raise Interrupted(result)
    return with_verification(with_checks(result, output), study.options, output)

"""``gapwalk run``: the studies of a model file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from gapwalk.cli.app import Changes, Flag, app
from gapwalk.cli.outcome import guard


@app.command(sort_key=4)
def run(
    file: Path,
    /,
    *,
    output: Path | None = None,
    study: Annotated[list[str] | None, Parameter(negative=())] = None,
    changes: Changes = None,
    units: Literal["none"] | None = None,
    resume: Flag = False,
    force: Flag = False,
    scheduler: str | None = None,
    json: Flag = False,
    quiet: Flag = False,
    debug: Flag = False,
) -> int:
    """Run the studies of a model file: write their results, pictures (PNG and SVG) and tables (CSV).

    Ctrl-C stops the run with everything stored; --resume continues as if it had not been interrupted.

    Parameters
    ----------
    file
        The model file.
    output
        The result file, by default named after the model file, ending in .gapwalk; names of several studies are added.
        Picture and tables are written next to it and replace earlier ones.
    study
        Run only the study of this name; may be repeated.
    changes
        A changed value: --set stage2.clearance=0.5, --set study.to=0.3, --set study.light.to=0.3; may be repeated.
    units
        none: run a drive train that has units in non-dimensional form; its tables and pictures are then in that form.
    resume
        Continue an interrupted run; parts that are complete are not computed again.
    force
        Overwrite an existing result.
    scheduler
        Scheduler of a Dask cluster (gapwalk[cluster]) for the work, such as tcp://node7:8786, or its scheduler file.
    json
        Print one JSON document.
    quiet
        Print only errors.
    debug
        Show the traceback of an error.
    """

    def job() -> int:
        from gapwalk.cli.run_command import run_file

        how = {"resume": resume, "force": force, "json": json, "quiet": quiet, "plain": units == "none"}
        return run_file(file, output, changes or [], study or [], **how, scheduler=scheduler)

    return guard(job, json=json, debug=debug)

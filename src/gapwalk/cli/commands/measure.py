"""``gapwalk measure``: comparison of a measured record with the computed motion."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from gapwalk.cli.app import Changes, Flag, app
from gapwalk.cli.outcome import guard


@app.command(sort_key=7)
def measure(
    file: Path,
    record: Path,
    /,
    *,
    fit: Annotated[list[str] | None, Parameter(negative=())] = None,
    changes: Changes = None,
    output: Path | None = None,
    json: Flag = False,
    debug: Flag = False,
) -> int:
    """Compare a measured record with the computed motion, and fit parameters to it.

    The table [measurement] of the model file defines the measured signal. Pictures (PNG and SVG) and tables (CSV) are
    written; existing ones are overwritten.

    Parameters
    ----------
    file
        The model file.
    record
        The record: a CSV or MAT file with the columns time, acceleration and optionally speed.
    fit
        A parameter to fit, as in --fit stage2.impact_damping; may be repeated. By default those named in the file.
    changes
        A changed value, as in --set stage2.clearance=0.5 or --set measurement.scale=9.81; may be repeated.
    output
        The picture to write; by default named after the record. The tables are named after it.
    json
        Print one JSON document.
    debug
        Show the traceback of an error.
    """

    def job() -> int:
        from gapwalk.cli.measure_command import measure_file

        return measure_file(file, record, fit or [], changes or [], output, json=json)

    return guard(job, json=json, debug=debug)

"""``gapwalk paper``: the figures and claims of the paper."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from gapwalk.cli.app import Flag, app
from gapwalk.cli.outcome import guard


@app.command(sort_key=8)
def paper(
    *figures: str,
    list_: Annotated[bool, Parameter(name="--list", negative=(), show_default=False)] = False,
    slope: Literal["reduced", "literal"] = "reduced",
    damping: Literal["dissipative", "as-printed"] = "dissipative",
    output: Path | None = None,
    claims: Path | None = None,
    force: Flag = False,
    json: Flag = False,
    debug: Flag = False,
) -> int:
    """Draw the figures of the paper (Padmanabhan and Singh, 1995), and check what it says; what is computed is kept.

    Parameters
    ----------
    figures
        Figures, or parts of them, such as 13 or 20a; by default all, with a page (index.html).
    list_
        List the figures.
    slope
        How the slope of the second stage is read.
    damping
        How the impact damping is read.
    output
        The folder to write pictures, results and tables into; by default paper, or none with --json.
    claims
        Check all that the paper says, and write a page in Markdown with this name; no figure is drawn.
    force
        Compute everything anew.
    json
        Print one JSON document; of several figures, a list.
    debug
        Show the traceback of an error.
    """

    def job() -> int:
        from reproductions.padmanabhan_singh_1995.reading import Reading
        from reproductions.padmanabhan_singh_1995.report import list_figures, run_figures, write_claims

        if list_:
            return list_figures(json=json)
        if claims:
            return write_claims(claims, output, force=force)
        return run_figures(figures, Reading.of(slope, damping), output, force=force, json=json)

    return guard(job, json=json, debug=debug)

"""Commands on result files: ``show``, ``export``, ``compare``, ``verify``."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from gapwalk.cli.app import Changes, Flag, app
from gapwalk.cli.outcome import guard


@app.command(sort_key=5)
def show(result: Path, /, *, points: Flag = False, json: Flag = False, debug: Flag = False) -> int:
    """Show the contents of a result file: branches, reasons for their ends, special points, and other findings.

    Parameters
    ----------
    result
        The result file.
    points
        Also show the special points of a diagram or a map.
    json
        Print one JSON document.
    debug
        Show the traceback of an error.
    """

    def job() -> int:
        from gapwalk.cli.file_commands import show_result

        return show_result(result, points=points, json=json)

    return guard(job, json=json, debug=debug)


@app.command(sort_key=6)
def export(
    result: Path,
    /,
    *,
    format: Literal["csv", "png", "svg", "pdf", "html"] | None = None,
    output: Path | None = None,
    measure: str | None = None,
    size: Literal["screen", "column", "page", "slide"] | None = None,
    debug: Flag = False,
) -> int:
    """Write the tables or the picture of a result file, or a web page with its diagram and motions (html).

    The page is a single file that opens in any browser without a network. A click on a point shows its motion.

    Parameters
    ----------
    result
        The result file.
    format
        The format; by default that of the file extension of the output, otherwise csv.
    output
        The file to write, replacing an earlier one; by default named after the result. For csv, the special points and
        further tables are written to other files next to it.
    measure
        The quantity on the vertical axis, as in max.q1; by default that of the study. Only for branches.
    size
        Size of a picture: for a column of a journal (85 mm wide, letters of 8 points), its whole page (175 mm), a
        slide (250 mm), or a screen.
    debug
        Show the traceback of an error.
    """

    def job() -> int:
        from gapwalk.cli.file_commands import export_result

        return export_result(result, format, output, measure, size)

    return guard(job, debug=debug)


@app.command(sort_key=6)
def compare(
    first: str,
    second: str,
    /,
    *,
    tolerance: float = 1e-3,
    output: Path | None = None,
    measure: str | None = None,
    changes: Changes = None,
    json: Flag = False,
    debug: Flag = False,
) -> int:
    """Compare two results, for example of two methods: their distance, and what only one of them contains.

    The exit code is 0 if they agree within the tolerance, and 4 if they do not.

    Parameters
    ----------
    first, second
        Result files, or model files whose study is then run (select one of several as in model.toml:light).
    tolerance
        The largest distance, shift of a special point, or missing part of a range that counts as agreement: a fraction
        of the range of the parameter and of the motions' measures.
    output
        A picture to write, PNG or SVG, with both results overlaid and their distance.
    measure
        The quantity on the vertical axis of the picture, as in max.q1; by default that of the first study.
    changes
        A changed value in model files, as in --set stage2.clearance=0.5; may be repeated.
    json
        Print one JSON document.
    debug
        Show the traceback of an error.
    """

    def job() -> int:
        from gapwalk.cli.compare_results import compare_files

        options = {"output": output, "measure": measure, "changes": changes or [], "json": json}
        return compare_files(first, second, tolerance, **options)

    return guard(job, json=json, debug=debug)


@app.command(sort_key=6)
def verify(result: Path, /, *, json: Flag = False, debug: Flag = False) -> int:
    """Check a result by independent means: orbits, gaps between them, special points, and counts.

    The exit code is 0 if all checks pass, and 5 if one fails.

    Parameters
    ----------
    result
        The result file of a response, a diagram, a map or a family.
    json
        Print one JSON document.
    debug
        Show the traceback of an error.
    """

    def job() -> int:
        from gapwalk.cli.verify_command import verify_file

        return verify_file(result, json=json)

    return guard(job, json=json, debug=debug)

"""The commands and their options; what they do is imported only when one of them runs, so that help comes at once."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from cyclopts import App, Parameter

from gapwalk.cli.outcome import guard

app = App(
    name="gapwalk",
    help="Walks the solution branches of vibrating systems with gaps.",
    help_format="plaintext",
    version=lambda: __import__("gapwalk").__version__,
)

Flag = Annotated[bool, Parameter(negative=(), show_default=False)]
Changes = Annotated[list[str] | None, Parameter(name="--set", negative=())]


@app.command(sort_key=1)
def new(file: Path, /, *, debug: Flag = False) -> int:
    """Write a model file to begin with; its comments explain every key.

    Parameters
    ----------
    file
        The file to write, such as model.toml.
    debug
        Show the traceback of an error.
    """

    def job() -> int:
        from gapwalk.cli.files import new_file

        return new_file(file)

    return guard(job, debug=debug)


@app.command(sort_key=2)
def check(file: Path, /, *, changes: Changes = None, json: Flag = False, debug: Flag = False) -> int:
    """Check a model file, and say what it describes or everything that is wrong with it.

    Parameters
    ----------
    file
        The model file.
    changes
        Another value, as in --set stage2.clearance=0.5 or --set study.to=0.3; may be repeated.
    json
        Print one JSON document.
    debug
        Show the traceback of an error.
    """

    def job() -> int:
        from gapwalk.cli.files import check_file

        return check_file(file, changes or [], json=json)

    return guard(job, json=json, debug=debug)


@app.command(sort_key=3)
def modes(
    file: Path,
    /,
    *,
    changes: Changes = None,
    picture: Path | None = None,
    json: Flag = False,
    debug: Flag = False,
) -> int:
    """Show where a system rests under its mean load, which clearances are open there, and its natural vibrations.

    Parameters
    ----------
    file
        The model file; a study in it is not looked at.
    changes
        Another value, as in --set stage2.clearance=0.5; may be repeated.
    picture
        Draw the slowest modes into this file, PNG or SVG.
    json
        Print one JSON document.
    debug
        Show the traceback of an error.
    """

    def job() -> int:
        from gapwalk.cli.modes import show_modes

        return show_modes(file, changes or [], picture, json=json)

    return guard(job, json=json, debug=debug)


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

    Ctrl-C stops it with everything stored; --resume goes on from there, as if nothing had happened.

    Parameters
    ----------
    file
        The model file.
    output
        The result file, by default named after the model file, ending in .gapwalk; names of several studies are added.
        Picture and tables are written beside it, over earlier ones.
    study
        Run the study of this name only; may be repeated.
    changes
        Another value: --set stage2.clearance=0.5, --set study.to=0.3, --set study.light.to=0.3; may be repeated.
    units
        none: run a drive train that has units in non-dimensional form; its tables and pictures are then in that form.
    resume
        Go on with the results of an interrupted run; what is complete is not computed again.
    force
        Write over an existing result.
    scheduler
        Scheduler of a Dask cluster (gapwalk[cluster]) that does the work: tcp://node7:8786, say, or its scheduler file.
    json
        Print one JSON document.
    quiet
        Print nothing but errors.
    debug
        Show the traceback of an error.
    """

    def job() -> int:
        from gapwalk.cli.run import run_file

        how = {"resume": resume, "force": force, "json": json, "quiet": quiet, "plain": units == "none"}
        return run_file(file, output, changes or [], study or [], **how, scheduler=scheduler)

    return guard(job, json=json, debug=debug)


@app.command(sort_key=5)
def show(result: Path, /, *, points: Flag = False, json: Flag = False, debug: Flag = False) -> int:
    """Show what a result file holds: branches, why they end, and special points; or what else its study found.

    Parameters
    ----------
    result
        The result file.
    points
        Show the special points of a diagram or a map too.
    json
        Print one JSON document.
    debug
        Show the traceback of an error.
    """

    def job() -> int:
        from gapwalk.cli.files import show_result

        return show_result(result, points=points, json=json)

    return guard(job, json=json, debug=debug)


@app.command(sort_key=6)
def export(
    result: Path,
    /,
    *,
    format: Literal["csv", "png", "svg"] | None = None,
    output: Path | None = None,
    measure: str | None = None,
    debug: Flag = False,
) -> int:
    """Write the tables or the picture of a result file.

    Parameters
    ----------
    result
        The result file.
    format
        What to write; by default what the ending of the output says, or else csv.
    output
        The file to write, over an earlier one; by default named after the result. For csv, the special points stand in
        a second file beside it, and so do further tables.
    measure
        What the picture shows, as in max.q1; by default what the study says. Only branches have one.
    debug
        Show the traceback of an error.
    """

    def job() -> int:
        from gapwalk.cli.files import export_result

        return export_result(result, format, output, measure)

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
    """Compare two results, found by two methods perhaps: how far apart they are, and what only one of them has.

    The exit code is 0 if they agree within the tolerance, and 4 if they do not.

    Parameters
    ----------
    first, second
        Result files; or model files, whose study is then run (name one of several as in model.toml:light).
    tolerance
        The largest distance, location of a special point, or missing part of a range that counts as agreement: a share
        of the range of the parameter and of the motions' measures.
    output
        A picture to write, PNG or SVG, with both results overlaid and their distance.
    measure
        What the picture shows, as in max.q1; by default what the first study says.
    changes
        Another value in model files, as in --set stage2.clearance=0.5; may be repeated.
    json
        Print one JSON document.
    debug
        Show the traceback of an error.
    """

    def job() -> int:
        from gapwalk.cli.compare import compare_files

        options = {"output": output, "measure": measure, "changes": changes or [], "json": json}
        return compare_files(first, second, tolerance, **options)

    return guard(job, json=json, debug=debug)


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
    """Put a measured record beside the computed motion, and fit parameters to it.

    The table [measurement] of the model file says what the record measures. Pictures (PNG and SVG) and tables (CSV) are
    written, over earlier ones.

    Parameters
    ----------
    file
        The model file.
    record
        The record: a CSV or MAT file with the columns time, acceleration and perhaps speed.
    fit
        A parameter to fit, as in --fit stage2.impact_damping; may be repeated. By default those that the file names.
    changes
        Another value, as in --set stage2.clearance=0.5 or --set measurement.scale=9.81; may be repeated.
    output
        The picture to write; by default named after the record. The tables are named after it.
    json
        Print one JSON document.
    debug
        Show the traceback of an error.
    """

    def job() -> int:
        from gapwalk.cli.measure import measure_file

        return measure_file(file, record, fit or [], changes or [], output, json=json)

    return guard(job, json=json, debug=debug)


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
        from gapwalk.cli.paper import list_figures, run_figures, write_claims
        from gapwalk.paper.reading import Reading

        if list_:
            return list_figures(json=json)
        if claims:
            return write_claims(claims, output, force=force)
        return run_figures(figures, Reading.of(slope, damping), output, force=force, json=json)

    return guard(job, json=json, debug=debug)

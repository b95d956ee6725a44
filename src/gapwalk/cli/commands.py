"""The commands and their options; their code is imported only when one of them runs, so that help appears at once."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable
from functools import wraps
from pathlib import Path
from typing import Annotated, Any, Literal

from cyclopts import App, CycloptsError, Parameter, UnusedCliTokensError
from rich.text import Text


def _error_words(error: CycloptsError) -> str:
    """Describe what is wrong with the words of a command, and what to write instead."""
    text = str(error)
    if isinstance(error, UnusedCliTokensError):
        name, extra = " ".join(("gapwalk", *(error.command_chain or ()))), (error.unused_tokens or [""])[0]
        text = f"{name} does not take {extra!r} there; {name} --help lists what it takes"
        for option, hint in getattr(error.target, "__annotations__", {}).items():
            if f"'{extra}'" in hint and "Literal" in hint:
                text = f"{name} takes {extra!r} as an option; write --{option} {extra}"
    return f"gapwalk: {text}"


app = App(
    name="gapwalk",
    help="Numerical continuation for vibrating systems with gaps.",
    help_format="plaintext",
    error_formatter=lambda error: Text(_error_words(error)),
    version=lambda: __import__("gapwalk").__version__,
)

EXIT_CODES = (
    "Exit codes: 0 done, 1 a bug, 2 bad input, 3 the numerics failed, 4 compared results differ, 5 a check of verify "
    "failed, 130 Ctrl-C, 143 SIGTERM. After the last two, all complete parts are stored."
)
"""The last lines of each help text."""

_SWITCH = Parameter(negative=(), show_default=False)
Flag = Annotated[bool, _SWITCH]
Force = Annotated[bool, _SWITCH, Parameter(alias="-f")]
Json = Annotated[bool, _SWITCH, Parameter(alias="-j", help="Print one JSON document.")]
Debug = Annotated[bool, _SWITCH, Parameter(help="Show the traceback of an error.")]
Quiet = Annotated[bool, _SWITCH, Parameter(alias="-q", help="Print only errors, and what --json asks for.")]
_ON_ALL = (
    inspect.Parameter("quiet", inspect.Parameter.KEYWORD_ONLY, default=False, annotation=Quiet),
    inspect.Parameter("debug", inspect.Parameter.KEYWORD_ONLY, default=False, annotation=Debug),
)
Changes = Annotated[list[str] | None, Parameter(name="--set", negative=())]
Names = Annotated[list[str] | None, Parameter(negative=())]
Output = Annotated[Path | None, Parameter(alias="-o")]
_PARAGRAPH = re.compile(r"^( *)(?![ -]).+(?:\n\1(?![ -]).+)+", re.M)  # its lines are broken by the terminal


def command(sort_key: float, *examples: str) -> Callable[[Callable[..., int]], Callable[..., int]]:
    """Add a function to the commands: its errors are reported, in JSON if that is wanted, and become exit codes.

    A function without a parameter ``debug`` gets the options that all commands have. The examples are shown below its
    help, each with a comment after ``#``.
    """
    shown = "\n".join(["Examples:", "", *(f"  {example}" for example in examples), "", EXIT_CODES])

    def add(job: Callable[..., int]) -> Callable[..., int]:
        @wraps(job)
        def guarded(*arguments: Any, debug: bool = False, quiet: bool = False, **options: Any) -> int:
            from gapwalk.cli.output import guard

            return guard(lambda: job(*arguments, **options), json=options.get("json", False), debug=debug, quiet=quiet)

        guarded.__doc__ = _PARAGRAPH.sub(
            lambda each: each[1] + " ".join(each[0].split()), inspect.cleandoc(job.__doc__ or "")
        )
        own = inspect.signature(job)
        if "debug" not in own.parameters:
            everything = own.replace(parameters=[*own.parameters.values(), *_ON_ALL])
            guarded.__signature__ = everything  # type: ignore[attr-defined]
        return app.command(guarded, sort_key=sort_key, help_epilogue=shown)

    return add


@command(1, "gapwalk new rattle.toml", "gapwalk new neutral-rattle", "gapwalk new train.toml --from train.csv")
def new(
    file: Path | None = None,
    /,
    *,
    table: Annotated[Path | None, Parameter(name="--from")] = None,
) -> int:
    """Write a template of a model file; its comments explain every key. Or make one from the table of a drive train.

    Parameters
    ----------
    file
        The file to write, such as model.toml; or the name of a machine to begin with, such as neutral-rattle, which is
        written to neutral-rattle.toml. Without it, the machines are listed.
    table
        A spreadsheet with a row for each inertia, shaft, gear and load, and units in its headings: train.csv, or
        train.xlsx with pip install "gapwalk[data]".
    """
    from gapwalk.cli.file_commands import new_file

    return new_file(file, table)


@command(
    2,
    "gapwalk check rattle.toml",
    "gapwalk check rattle.toml --set stage2.clearance=0.8",
    "gapwalk check rattle.toml --picture forces.svg",
)
def check(
    file: Path,
    /,
    *,
    changes: Changes = None,
    picture: Path | None = None,
    json: Json = False,
) -> int:
    """Check a model file; print a summary, or everything that is wrong with it.

    Parameters
    ----------
    file
        The model file.
    changes
        A changed value, as in --set stage2.clearance=0.5 or --set study.to=0.3; may be repeated.
    picture
        Draw the forces of contacts, measured curves, and what varies over the angle, into this file, PNG, SVG or PDF.
    """
    from gapwalk.cli.file_commands import check_file

    return check_file(file, changes or [], picture, json=json)


@command(3, "gapwalk modes examples/drivetrain.toml", "gapwalk modes examples/train.toml --picture modes.png")
def modes(
    file: Path,
    /,
    *,
    changes: Changes = None,
    picture: Path | None = None,
    json: Json = False,
) -> int:
    """Show the static equilibria of a system under its mean load, its open clearances there, and its natural modes.

    Parameters
    ----------
    file
        The model file; a study in it is ignored.
    changes
        A changed value, as in --set stage2.clearance=0.5; may be repeated.
    picture
        Draw the modes of the lowest frequencies into this file, PNG, SVG or PDF.
    """
    from gapwalk.cli.modes_command import show_modes

    return show_modes(file, changes or [], picture, json=json)


@command(
    4,
    "gapwalk run examples/clutch.toml --output out/clutch.gapwalk",
    "gapwalk run examples/idle.toml drag  # one of its studies",
    "gapwalk run rattle.toml --set study.to=0.3 --force",
    "gapwalk run rattle.toml --resume  # after Ctrl-C or a kill",
)
def run(
    file: Path,
    /,
    *studies: str,
    output: Output = None,
    study: Names = None,
    changes: Changes = None,
    units: Literal["none"] | None = None,
    resume: Flag = False,
    force: Force = False,
    scheduler: str | None = None,
    json: Json = False,
) -> int:
    """Run the studies of a model file: write their results, pictures (PNG and SVG) and tables (CSV).

    Ctrl-C stops the run with all complete parts stored, such as points of a branch; --resume computes the others.

    Parameters
    ----------
    file
        The model file.
    studies
        Names of the studies to run, if not all.
    output
        The result file, by default named after the model file, ending in .gapwalk; names of several studies are added.
        Picture and tables are written next to it and replace earlier ones. An earlier result of another text that has
        the default name gets a number, as in rattle-1.gapwalk.
    study
        The same: a study to run; may be repeated.
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
    """
    from gapwalk.cli.output import saying

    if scheduler is None:
        from gapwalk.cli.foreseen import foresee

        foresee(file)
    with saying("gapwalk is loading"):  # takes a second or two
        from gapwalk.cli.run_command import run_file

    how = {"resume": resume, "force": force, "json": json, "plain": units == "none"}
    return run_file(file, output, changes or [], [*studies, *(study or [])], **how, scheduler=scheduler)


@command(
    5,
    "gapwalk show rattle.gapwalk",
    "gapwalk show rattle.gapwalk --gradients  # what moves each special point",
    "gapwalk show rattle.gapwalk --json",
)
def show(
    result: Path,
    /,
    *,
    points: Flag = False,
    gradients: Flag = False,
    json: Json = False,
) -> int:
    """Show the contents of a result file: branches, reasons for their ends, special points, and other findings.

    Parameters
    ----------
    result
        The result file.
    points
        Also show the special points of a diagram or a map.
    gradients
        Also show which parameters move each special point most.
    """
    from gapwalk.cli.file_commands import show_result

    return show_result(result, points=points, gradients=gradients, json=json)


@command(
    6,
    "gapwalk export rattle.gapwalk --format csv",
    "gapwalk export rattle.gapwalk --output rattle.nc  # for xarray",
    "gapwalk export rattle.gapwalk --output rattle.pdf --output rattle.html",
    "gapwalk export rattle.gapwalk --format html  # for a colleague without gapwalk",
    "gapwalk export rattle.gapwalk --size column --no-legend --output rattle.pdf",
    "gapwalk export start.gapwalk --format wav --signal mesh.force  # sound",
)
def export(
    result: Path,
    /,
    *,
    format: Literal["csv", "json", "netcdf", "mat", "parquet", "xlsx", "png", "svg", "pdf", "html", "wav"]
    | None = None,
    output: Annotated[list[Path] | None, Parameter(alias="-o", negative=())] = None,
    measure: str | None = None,
    size: Literal["screen", "column", "page", "slide"] | None = None,
    signal: str | None = None,
    full_scale: float | None = None,
    title: Annotated[bool, Parameter(show_default=False)] = True,
    legend: Annotated[bool, Parameter(show_default=False)] = True,
) -> int:
    """Write the tables, the picture or the sound of a result file, or a web page with its diagram and motions (html).

    Tables are written as csv, json, netcdf (for xarray), mat (for MATLAB), parquet (for pandas) or xlsx (for Excel);
    netcdf, parquet and xlsx need pip install "gapwalk[data]". The page is a single file that opens in any browser
    without a network. A click on a point shows its motion. The sound (wav) of a run-up or a settled motion has its true
    pitch and level.

    Parameters
    ----------
    result
        The result file.
    format
        The format; by default that of the file extension of the output, otherwise csv.
    output
        The file to write, replacing an earlier one; by default named after the result; may be repeated, for several
        formats. For csv and parquet, the special points and further tables are written to other files next to it.
    measure
        The quantity on the vertical axis, as in max.q1; by default that of the study. Only for branches.
    size
        Size of a picture: for a column of a journal (85 mm wide, letters of 8 points), its whole page (175 mm), a
        slide (250 mm), or a screen.
    signal
        Signal of a sound, as in mesh.force or gear''; by default the acceleration of what hits hardest.
    full_scale
        Amplitude of that signal which is as loud as a file can be. Give sounds that are compared the same one.
    title
        Leave out the title and the sentences of a picture with --no-title; a column and a page have none.
    legend
        Leave out the legend of a picture with --no-legend.
    """
    from gapwalk.cli.file_commands import export_result

    return export_result(result, format, output or [], measure, size, signal, full_scale, title=title, legend=legend)


@command(
    6,
    "gapwalk compare before.gapwalk after.gapwalk --output both.png",
    "gapwalk compare model.toml:light model.toml:heavy --tolerance 1e-6",
)
def compare(
    first: str,
    second: str,
    /,
    *,
    tolerance: float = 1e-3,
    output: Output = None,
    measure: str | None = None,
    changes: Changes = None,
    json: Json = False,
) -> int:
    """Compare two results, for example of two methods: their distance, and what only one of them contains.

    The exit code is 0 if they agree within the tolerance, and 4 if they do not.

    Parameters
    ----------
    first, second
        Result files, or model files whose study is then run (select one of several as in model.toml:light).
    tolerance
        The largest distance, shift of a special point, or missing part of a range that counts as agreement: a fraction
        of the range of the parameter and of the motions' measures. Of maps of regimes, basins or rattle: the share of
        cells that may have another label.
    output
        A picture to write, PNG or SVG, with both results overlaid and their distance; not of maps of cells.
    measure
        The quantity on the vertical axis of the picture, as in max.q1; by default that of the first study.
    changes
        A changed value in model files, as in --set stage2.clearance=0.5; may be repeated.
    """
    from gapwalk.cli.compare_commands import compare_files

    options = {"output": output, "measure": measure, "changes": changes or [], "json": json}
    return compare_files(first, second, tolerance, **options)


@command(6, "gapwalk verify rattle.gapwalk")
def verify(result: Path, /, *, json: Json = False) -> int:
    """Check a result by independent means: orbits, gaps between them, special points, and counts.

    The exit code is 0 if all checks pass, and 5 if one fails.

    Parameters
    ----------
    result
        The result file of a response, a diagram, a map, a family, tori or a threshold.
    """
    from gapwalk.cli.file_commands import verify_file

    return verify_file(result, json=json)


@command(
    7,
    "gapwalk measure examples/rattle.toml examples/rattle.csv",
    "gapwalk measure model.toml run.mat --fit stage2.impact_damping --fit mean.q1",
)
def measure(
    file: Path,
    record: Path | None = None,
    /,
    *,
    fit: Names = None,
    changes: Changes = None,
    output: Output = None,
    json: Json = False,
) -> int:
    """Compare a measured record with the computed motion, and fit parameters to it; or fit them to measured jumps.

    The table [measurement] of the model file defines the measured signal, or, with the key sweep, the range in which
    jumps and other special points were measured. Pictures (PNG and SVG, of a record) and tables (CSV) are written;
    existing ones are overwritten.

    Parameters
    ----------
    file
        The model file.
    record
        The record: a CSV, MAT, HDF5, Excel, MDF, TDMS or UFF file with the columns time, acceleration and optionally
        speed. Of special points, a CSV file with the columns kind, value, error and optionally which; by default those
        of the model file.
    fit
        A parameter to fit, as in --fit stage2.impact_damping; may be repeated. By default those named in the file.
    changes
        A changed value, as in --set stage2.clearance=0.5 or --set measurement.scale=9.81; may be repeated.
    output
        The picture to write; by default named after the record, or the model file. The tables are named after it.
    """
    from gapwalk.cli.compare_commands import measure_file

    return measure_file(file, record, fit or [], changes or [], output, json=json)


@command(
    3.5,
    "gapwalk explore rattle.toml",
    "gapwalk explore results/  # a folder of models and results",
    "gapwalk explore rattle.toml --port 8000 --no-browser",
)
def explore(
    file: Path | None = None,
    /,
    *,
    port: int = 0,
    host: str = "127.0.0.1",
    browser: Annotated[bool, Parameter(negative="--no-browser", show_default=False)] = True,
) -> int:
    """Open a model or a result in the browser: its diagram grows during the computation, any point shows its motion.

    Results are stored in a folder next to the file, such as model.explorer for model.toml. Ctrl-C ends the command.

    Parameters
    ----------
    file
        The model file, the result, or a folder of them; by default the current folder.
    port
        The port of the server; 0 for any free port.
    host
        The address of the server; 0.0.0.0 for all of this machine's. The page requires a token, which is part of the
        printed address.
    browser
        Open the page in the browser.
    """
    from gapwalk.explorer.engine import Engine

    with Engine() as engine:  # it starts while this process loads the server
        from gapwalk.explorer.web_app import serve

        serve(file, host, port, browser=browser, engine=engine)
    return 0


@command(
    9,
    'gapwalk completion bash  # eval "$(gapwalk completion bash)" in ~/.bashrc',
    "gapwalk completion fish  # into ~/.config/fish/completions/gapwalk.fish",
)
def completion(shell: Literal["bash", "zsh", "fish"], /, *, debug: Debug = False) -> int:
    """Print the script with which a shell completes the commands and their options; for zsh as for bash, in ~/.zshrc.

    Parameters
    ----------
    shell
        The shell.
    """
    print(app.generate_completion(prog_name="gapwalk", shell=shell))
    return 0


@command(9, "gapwalk manual > ~/.local/share/man/man1/gapwalk.1")
def manual(*, debug: Debug = False) -> int:
    """Print the manual page of all commands, for man."""
    from gapwalk import __version__
    from gapwalk.cli.docs_command import man_page

    print(man_page(app, __version__, EXIT_CODES))
    return 0


@command(8, "gapwalk docs", "gapwalk docs glossary", "gapwalk docs settle --no-browser  # print where the page is")
def docs(
    page: str | None = None,
    /,
    *,
    browser: Annotated[bool, Parameter(negative="--no-browser", show_default=False)] = True,
) -> int:
    """Open the documentation in the browser: the copy of this version, without a network.

    Parameters
    ----------
    page
        The name of a page, of a function or of a class, such as glossary or follow_locus; by default the first page.
    browser
        Open the page in the browser.
    """
    from gapwalk.cli.docs_command import open_docs

    return open_docs(page, browser=browser)

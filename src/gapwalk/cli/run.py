"""``gapwalk run``: a study from its model file to result, picture and tables."""

from __future__ import annotations

import shlex
import sys
from pathlib import Path

from gapwalk.cli.outcome import DONE, FAILED, INTERRUPTED, print_json, printable
from gapwalk.cli.screen import WalkProgress, console, print_result
from gapwalk.continuation.walk import EndReason
from gapwalk.errors import ModelError
from gapwalk.plot.response import save_response
from gapwalk.plot.words import parameter_symbol
from gapwalk.study.changes import parse_change
from gapwalk.study.document import result_document
from gapwalk.study.export import export_csv
from gapwalk.study.file import Study, read_study
from gapwalk.study.result import Result
from gapwalk.study.run import run

_OTHER_ENDINGS = (".csv", ".png", ".svg", ".toml")


def run_file(
    file: Path, output: Path | None, changes: list[str], *, resume: bool, force: bool, json: bool, quiet: bool
) -> int:
    """Run the study of a model file, and return the exit code."""
    study = read_changed(file, changes)
    output = result_path(file, output)
    screen = console(stderr=json)
    with WalkProgress(study.options, show=not quiet) as progress:
        result = run(study, output, resume=resume, force=force, report=progress)
    code = exit_code(result)
    files = [output]
    if code != INTERRUPTED:
        files += write_products(result, output)
    if json:
        print_json({**result_document(result), "files": [str(path) for path in files]})
    elif not quiet:
        print_heading(screen, study)
        print_result(screen, result)
        print_files(screen, files)
    if code == FAILED:
        say_why_it_failed(result)
    if code == INTERRUPTED:
        _say_how_to_resume(file, output, changes, result)
    return code


def read_changed(file: Path, changes: list[str]) -> Study:
    """The study of a model file with the changes of ``--set``."""
    return read_study(file, dict(parse_change(text) for text in changes))


def result_path(file: Path, output: Path | None) -> Path:
    """The name of the result file; a ModelError if it is that of something else."""
    output = file.with_suffix(".gapwalk") if output is None else output
    if output.suffix in _OTHER_ENDINGS or output == file:
        raise ModelError(f"{output} is no name for a result; give it the ending .gapwalk, as in {output.stem}.gapwalk")
    return output


def write_products(result: Result, output: Path) -> list[Path]:
    """Write picture and tables beside a result file, and return their names."""
    png, svg = output.with_suffix(".png"), output.with_suffix(".svg")
    tables = table_paths(output)
    save_response(result, png, svg)
    export_csv(result, *tables)
    return [png, svg, *tables]


def table_paths(output: Path) -> tuple[Path, Path]:
    """The names of the tables that belong to a result file."""
    return output.with_name(f"{output.stem}-points.csv"), output.with_name(f"{output.stem}-special-points.csv")


def exit_code(result: Result) -> int:
    """0 if every branch was walked to a proper end, 130 after an interruption, 3 if the numerics gave up."""
    ends = [end for branch in result.branches for end in branch.ends]
    if any(end.reason is EndReason.INTERRUPTED for end in ends):
        return INTERRUPTED
    return FAILED if any(end.reason.is_failure or end.reason is EndReason.STOPPED for end in ends) else DONE


def say_why_it_failed(result: Result) -> None:
    """Say on stderr where and why a walk gave up."""
    for branch in result.branches:
        if branch.ends[-1].reason.is_failure:
            print(f"gapwalk: {printable(str(branch.ends[-1]))}", file=sys.stderr)


def print_heading(screen, study: Study) -> None:
    """Print the title of a study."""
    if study.title:
        screen.print(printable(study.title), style="bold", soft_wrap=True)


def print_files(screen, files: list[Path]) -> None:
    """Say which files were written."""
    screen.print(f"written: {printable(', '.join(str(path) for path in files))}", soft_wrap=True)


def _say_how_to_resume(file: Path, output: Path, changes: list[str], result: Result) -> None:
    branch = result.branches[-1]
    words = ["gapwalk", "run", str(file), "--output", str(output), "--resume"]
    for change in changes:
        words += ["--set", change]
    console(stderr=True).print(
        f"interrupted at {parameter_symbol(branch.parameter)} = {branch.values[-1]:.8g}; all {len(branch.points)} "
        f"points are stored. Go on with\n    {shlex.join(words)}",
        soft_wrap=True,
    )

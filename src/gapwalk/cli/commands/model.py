"""Commands on model files: ``new``, ``check``, ``modes``."""

from __future__ import annotations

from pathlib import Path

from gapwalk.cli.app import Changes, Flag, app
from gapwalk.cli.outcome import guard


@app.command(sort_key=1)
def new(file: Path, /, *, debug: Flag = False) -> int:
    """Write a template of a model file; its comments explain every key.

    Parameters
    ----------
    file
        The file to write, such as model.toml.
    debug
        Show the traceback of an error.
    """

    def job() -> int:
        from gapwalk.cli.file_commands import new_file

        return new_file(file)

    return guard(job, debug=debug)


@app.command(sort_key=2)
def check(file: Path, /, *, changes: Changes = None, json: Flag = False, debug: Flag = False) -> int:
    """Check a model file; print a summary, or everything that is wrong with it.

    Parameters
    ----------
    file
        The model file.
    changes
        A changed value, as in --set stage2.clearance=0.5 or --set study.to=0.3; may be repeated.
    json
        Print one JSON document.
    debug
        Show the traceback of an error.
    """

    def job() -> int:
        from gapwalk.cli.file_commands import check_file

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
    """Show the static equilibria of a system under its mean load, its open clearances there, and its natural modes.

    Parameters
    ----------
    file
        The model file; a study in it is ignored.
    changes
        A changed value, as in --set stage2.clearance=0.5; may be repeated.
    picture
        Draw the modes of the lowest frequencies into this file, PNG, SVG or PDF.
    json
        Print one JSON document.
    debug
        Show the traceback of an error.
    """

    def job() -> int:
        from gapwalk.cli.print_modes import show_modes

        return show_modes(file, changes or [], picture, json=json)

    return guard(job, json=json, debug=debug)

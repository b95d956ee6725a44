"""The model file to begin with: what `gapwalk new FILE` writes."""

from __future__ import annotations

import os
from importlib.resources import files

from gapwalk.errors import ModelError
from gapwalk.files import why_no_file


def template() -> str:
    """The text of a complete model file whose comments explain it."""
    return files("gapwalk.studies").joinpath("template.toml").read_text(encoding="utf-8")


def write_template(path: str | os.PathLike[str], *, overwrite: bool = False) -> None:
    """Write the model file to begin with.

    Parameters
    ----------
    path
        Where to.
    overwrite
        Whether a file that is there already may be lost.

    Raises
    ------
    ModelError
        If there is a file of that name, or none can be written.
    """
    name = os.fspath(path)
    if overwrite and (why := why_no_file(name)):
        raise ModelError(f"{name} {why}")
    try:
        with open(name, "w" if overwrite else "x", encoding="utf-8", newline="\n") as file:
            file.write(template())
    except FileExistsError:
        raise ModelError(f"{name} exists already; choose another name") from None
    except (OSError, ValueError) as error:  # a ValueError is a NUL in the name
        reason = getattr(error, "strerror", None) or error
        raise ModelError(f"{name} cannot be written: {reason}") from None

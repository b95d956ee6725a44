"""Model files to begin with, which `gapwalk new` writes: nothing heavy is imported, for it is the first command."""

from __future__ import annotations

import os
import tomllib
from importlib.resources import files

from gapwalk.errors import ModelError
from gapwalk.files import why_no_file

_FOLDER = files("gapwalk.studies").joinpath("templates")


def template() -> str:
    """Return the text of a complete model file whose comments explain it."""
    return files("gapwalk.studies").joinpath("template.toml").read_text(encoding="utf-8")


def machines() -> dict[str, str]:
    """Return the titles of the machines to begin with, by their names."""
    found = sorted((each for each in _FOLDER.iterdir() if each.name.endswith(".toml")), key=lambda each: each.name)
    return {each.name.removesuffix(".toml"): tomllib.loads(each.read_text("utf-8"))["title"] for each in found}


def machine_text(name: str) -> str:
    """Return the model file of a machine to begin with."""
    known = [*machines()]
    if name not in known:
        from gapwalk.model.problems import did_you_mean  # only now: it loads all of the model

        raise ModelError(
            f"there is no machine {name!r} to begin with (any other file has an ending: gapwalk new {name}.toml); "
            f"{did_you_mean(name, known)}"
        )
    return _FOLDER.joinpath(f"{name}.toml").read_text(encoding="utf-8")


def write_template(path: str | os.PathLike[str], *, overwrite: bool = False, text: str = "") -> None:
    """Write the model file to begin with."""
    name = os.fspath(path)
    if overwrite and (why := why_no_file(name)):
        raise ModelError(f"{name} {why}")
    try:
        with open(name, "w" if overwrite else "x", encoding="utf-8", newline="\n") as file:
            file.write(text or template())
    except FileExistsError:
        raise ModelError(f"{name} exists already; choose another name") from None
    except (OSError, ValueError) as error:  # a ValueError is a NUL in the name
        reason = getattr(error, "strerror", None) or error
        raise ModelError(f"{name} cannot be written: {reason}") from None

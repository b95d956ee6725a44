"""The command that opens the documentation: a copy in one file of the package, unpacked once for each version."""

from __future__ import annotations

import hashlib
import os
import shutil
import tempfile
import webbrowser
import zipfile
from contextlib import suppress
from inspect import cleandoc
from pathlib import Path

from cyclopts import App

from gapwalk.cache_folder import cache_folder, is_private
from gapwalk.cli.output import DONE, console
from gapwalk.errors import GapwalkError
from gapwalk.model.problems import did_you_mean

ARCHIVE = Path(__file__).parents[1] / "offline_docs.zip"
"""The built pages; ``make docs`` writes this file, and a wheel that is built afterwards has it."""


def open_docs(page: str | None, *, browser: bool = True, archive: Path = ARCHIVE) -> int:
    """Print where a page is, and open it."""
    if not archive.exists():
        raise GapwalkError(
            "this installation has no copy of the documentation; in the folder with gapwalk's sources, `make docs` "
            "makes it, and `pip install .` installs it then"
        )
    with zipfile.ZipFile(archive) as packed:
        name = _page_named(page, packed.namelist()) if page else "index.html"
    path = _unpacked(archive) / name
    console().print(str(path), soft_wrap=True)
    if browser:
        webbrowser.open(path.as_uri())
    return DONE


def _page_named(page: str, names: list[str]) -> str:
    """Return the file of a page: that of its whole name, or of the last part of one, the shortest first."""
    stems = {name.removesuffix(".html"): name for name in sorted(names, key=len) if name.endswith(".html")}
    wanted = page.removesuffix(".html").removeprefix("gw.")
    for stem, name in stems.items():
        if wanted == stem or wanted in (stem.rpartition("/")[2], stem.rpartition(".")[2]):
            return name
    known = sorted({stem.rpartition("/")[2].rpartition(".")[2] for stem in stems})
    raise GapwalkError(f"the documentation has no page {page!r}; {did_you_mean(page, known)}")


def _unpacked(archive: Path) -> Path:
    """Return the folder with the pages, unpacked if they are not yet: in the cache, or else in a temporary folder."""
    digest = hashlib.sha256(archive.read_bytes()).hexdigest()[:16]
    home = _private_folder() or Path(tempfile.mkdtemp(prefix="gapwalk-docs-"))
    folder = home / digest
    if not folder.exists():
        for old in home.iterdir():  # of earlier versions
            shutil.rmtree(old, ignore_errors=True)
        new = Path(tempfile.mkdtemp(dir=home))
        with zipfile.ZipFile(archive) as packed:
            packed.extractall(new)
        with suppress(OSError):  # another process was faster
            os.replace(new, folder)
    return folder


def _private_folder() -> Path | None:
    """Return the folder of pages in the cache; None if it cannot be made, or is open to others."""
    try:
        home = cache_folder("docs")
        home.mkdir(mode=0o700, parents=True, exist_ok=True)
        return home if is_private(home) else None
    except (OSError, RuntimeError):  # RuntimeError: there is no home
        return None


def man_page(app: App, version: str, ending: str) -> str:
    """Return the source of the manual page of an app: its commands, each with its options, and the last lines."""
    names = sorted((name for name in app if not name.startswith("-")), key=lambda name: app[name].sort_key or 0.0)
    lines = [f'.TH {app.name[0].upper()} 1 "" "{app.name[0]} {version}"', ".SH NAME"]
    lines += [f"{app.name[0]} \\- {_plain(app.help)}", ".SH COMMANDS"]
    for name in names:
        sub = app[name]
        title, *more = cleandoc(sub.help or "").split("\n\nParameters\n")[0].split("\n\n")
        lines += [f".SS {app.name[0]} {name}", _plain(title), *(f".PP\n{_plain(part)}" for part in more)]
        for each in sub.assemble_argument_collection(parse_docstring=True):
            if each.show:
                choices = f" ({', '.join(each.get_choices() or ())})" if each.get_choices() else ""
                lines += [".TP", f".B {_plain(', '.join(each.names) or each.field_info.name)}"]
                lines.append(f"{_plain(each.parameter.help)}{_plain(choices)}")
        examples = (sub.help_epilogue or "").partition("\n\nExit codes")[0].splitlines()
        lines += [".PP", ".nf", *map(_verbatim, examples), ".fi"]
    return "\n".join([*lines, ".SH EXIT STATUS", _plain(ending)])


def _verbatim(text: str) -> str:
    escaped = text.replace("\\", "\\e").replace("-", "\\-")
    return f"\\&{escaped}" if escaped[:1] in (".", "'") else escaped


def _plain(text: str | None) -> str:
    return _verbatim(" ".join((text or "").split()))

"""The machine of every system in the gallery, drawn from its model: ``python -m docs._ext.machines``.

The model is the file that a page shows, or the first system that its code builds. The drawings are small SVG files in
docs/pictures, on white paper, so that they can be read on a dark page too.
"""

from __future__ import annotations

import ast
import re
from pathlib import Path

import gapwalk as gw
from gapwalk.plot.machine.elements import svg_of
from gapwalk.plot.machine.layout import scene_of

GALLERY = Path(__file__).parent.parent / "gallery"
PICTURES = GALLERY.parent / "pictures"
WIDTH = 640.0
PAGES = tuple(sorted(path.stem for path in GALLERY.glob("*.md") if path.stem != "index"))

_FILE = re.compile(r"literalinclude}? (\.\./[\w./-]+\.toml)")
_CELL = re.compile(r"```\{code-cell\}\n(.*?)```", re.S)


def system_of(page: str) -> gw.System:
    """Return the first system of a page: that of its model file, or of its code, up to where the system is built."""
    text = (GALLERY / f"{page}.md").read_text(encoding="utf-8")
    file = _FILE.search(text)
    if file:
        return gw.studies.read_studies(GALLERY / file[1])[0].system
    found: dict[str, object] = {}
    for statement in ast.parse("".join(_CELL.findall(text)[:1])).body:
        exec(compile(ast.Module([statement], []), page, "exec"), found)
        for value in found.values():
            if isinstance(value, gw.System):
                return value
            if isinstance(value, gw.train.Train):
                return value.system()
    raise LookupError(f"the page {page} builds no system")


def drawing(page: str) -> str:
    """Return the text of the drawing of a page."""
    return svg_of(scene_of(system_of(page), WIDTH))


def file_of(page: str) -> Path:
    """Return the file of the drawing of a page."""
    return PICTURES / f"machine-{page}.svg"


def main() -> None:
    """Write all drawings."""
    for page in PAGES:
        file_of(page).write_text(drawing(page), encoding="utf-8")


if __name__ == "__main__":
    main()

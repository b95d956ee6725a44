"""A check of the built pages: every cell that draws shows its picture.

python docs/_ext/pictures.py FOLDER

A notebook that does not show a figure gives no warning, so a page without its picture would be built unnoticed.
"""

from __future__ import annotations

import ast
import sys
from dataclasses import dataclass
from html.parser import HTMLParser
from pathlib import Path

INPUT, OUTPUT = "cell_input", "cell_output"


@dataclass
class Cell:
    """A cell of a page: its code, and the number of pictures below it."""

    code: str = ""
    pictures: int = 0

    @property
    def draws(self) -> bool:
        """Whether it calls `plot` or `draw`."""
        calls = [node.func for node in ast.walk(ast.parse(self.code)) if isinstance(node, ast.Call)]
        names = [call.attr if isinstance(call, ast.Attribute) else getattr(call, "id", "") for call in calls]
        return not {"plot", "draw"}.isdisjoint(names)


class Page(HTMLParser):
    """The cells of a page, as myst-nb writes them."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.cells: list[Cell] = []
        self._inside: list[str] = []  # what each open division is: a cell, its input, its output, or nothing of these
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag == "div":
            classes = (dict(attrs).get("class") or "").split()
            self._inside.append(next((name for name in ("cell", INPUT, OUTPUT) if name in classes), ""))
            if self._inside[-1] == "cell":
                self.cells.append(Cell())
        elif tag in ("img", "svg") and OUTPUT in self._inside:
            self.cells[-1].pictures += 1

    def handle_endtag(self, tag: str) -> None:
        if tag == "div":
            self._inside.pop()

    def handle_data(self, data: str) -> None:
        if INPUT in self._inside:
            self.cells[-1].code += data


def problems(folder: Path) -> tuple[list[str], int]:
    """What is wrong with the pages of a folder, and how many of their cells draw."""
    found, count = [], 0
    for path in sorted(folder.rglob("*.html")):
        text = path.read_text(encoding="utf-8")
        for cell in Page(text).cells if INPUT in text else ():
            if cell.draws:
                count += 1
                if not cell.pictures:
                    last = cell.code.strip().splitlines()[-1]
                    found.append(
                        f"{path.relative_to(folder)}: no picture is shown below the cell that ends with {last}"
                    )
    return found, count


if __name__ == "__main__":
    found, count = problems(Path(sys.argv[1]))
    print("\n".join(found) or f"{count} cells draw, and all of them show a picture")
    sys.exit(bool(found))

"""A small picture of the response of every system in the gallery: ``python -m docs._ext.responses [PAGE ...]``.

The picture is one that the code of the page draws, by default the first, in the size of a card. It is written to
docs/pictures as response-PAGE.png. Pages whose pictures are made by long commands show one of those.
"""

from __future__ import annotations

import os
import re
import sys
from pathlib import Path

import matplotlib as mpl
import matplotlib.pyplot as plt
from matplotlib.gridspec import GridSpec

from docs._ext.machines import GALLERY, PAGES, PICTURES

WHICH = {"bearing": 1, "engine": 1, "mesh": 1}  # the first picture of these pages shows the forces
BY_COMMAND = {"idle": "idle-rattle.png", "engine-start": "start-fast.png"}
SIZE = (3.4, 2.1)  # inches

_CELL = re.compile(r"```\{code-cell\}\n(.*?)```", re.S)


def picture_of(page: str) -> Path:
    """Return the picture that the card of a page shows."""
    return PICTURES / BY_COMMAND.get(page, f"response-{page}.png")


def draw(page: str) -> None:
    """Run the cells of a page until its picture is drawn, and write it."""
    names: dict[str, object] = {}
    for code in _CELL.findall((GALLERY / f"{page}.md").read_text(encoding="utf-8")):
        exec(compile(code, page, "exec"), names)
        if len(numbers := plt.get_fignums()) > WHICH.get(page, 0):
            figure = plt.figure(numbers[WHICH.get(page, 0)])
            break
    else:
        raise LookupError(f"the page {page} draws no picture")
    for legend in [*figure.legends, *(axes.get_legend() for axes in figure.axes)]:
        if legend is not None:
            legend.remove()
    for axes in list(figure.axes):
        if axes.get_window_extent().height < figure.bbox.height / 10.0:
            axes.remove()  # a strip: its words would be on top of each other
    if len(figure.axes) == 1:
        figure.axes[0].set_subplotspec(GridSpec(1, 1, figure)[0])
    for axes in figure.axes:
        axes.set_ylabel("")  # longer than a card is high
        axes.set_title("")
        for side in ("left", "right"):
            axes.set_title("", loc=side)
    figure.suptitle("")
    figure.set_size_inches(SIZE)
    figure.set_layout_engine("constrained")
    figure.savefig(picture_of(page), dpi=120)
    plt.close("all")


def main() -> None:
    """Draw the pages that are named, or all."""
    mpl.use("Agg")
    os.chdir(GALLERY)
    for page in sys.argv[1:] or [page for page in PAGES if page not in BY_COMMAND]:
        draw(page)
        print(page, flush=True)


if __name__ == "__main__":
    main()

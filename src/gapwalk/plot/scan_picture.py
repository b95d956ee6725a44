"""Picture of a scan: the best variations with what each claim comes to, and how many others fulfil as many."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from gapwalk.answers.scan import FAILS, HOLDS, UNKNOWN, Scan
from gapwalk.plot.picture import AnyFigure, Finish, draws, write_answer
from gapwalk.plot.style import GREY

_ROWS = 12  # variations that are drawn
_COLORS = {HOLDS: "#2f8f6b", FAILS: "#e9e8e2", UNKNOWN: "#ffffff"}
_WORDS = {HOLDS: "holds", FAILS: "no", UNKNOWN: "unknown"}
_INKS = {HOLDS: "#ffffff", FAILS: "#6a6a66", UNKNOWN: "#6a6a66"}
_TRIED, _RANDOM = "#0b56a4", "#f3c55b"
_WIDEST = 46  # letters of a variation in one line


def _rows(found: Scan) -> list[int]:
    return [0, *(index for index in found.best[:_ROWS] if found.scores[index] > 0)]


def _size(found: Scan, **_: object) -> tuple[float, float]:
    return 9.0, 2.6 + 0.34 * (len(_rows(found)) + len(found.claims))


@draws(Scan, panels=True, size=_size)
def draw_scan(found: Scan, figure: AnyFigure, *, title: str | None = None) -> Finish | None:
    """Draw a table of the best variations and claims, and beside it the shares of variations by number of claims."""
    claims = [f"claim {number}: {claim.words}" for number, claim in enumerate(found.claims, start=1)]
    write_answer(figure, title or "", [found.sentence, *claims])
    panels: Any = figure.subplots(1, 2, width_ratios=[2.0, 1.0])
    _draw_table(panels[0], found)
    _draw_shares(panels[1], found)
    return None


def _draw_table(ax: Axes, found: Scan) -> None:
    rows, count = _rows(found), len(found.claims)
    for place, index in enumerate(rows):
        for claim, verdict in enumerate(found.holds[index].tolist()):
            ax.add_patch(_cell(claim, place, _COLORS[verdict]))
            ax.text(claim, place, _WORDS[verdict], ha="center", va="center", color=_INKS[verdict], fontsize="small")
    ax.set_xlim(-0.5, count - 0.5)
    ax.set_ylim(len(rows) - 0.5, -0.5)
    ax.set_xticks(range(count), [f"claim {number}" for number in range(1, count + 1)])
    ax.set_yticks(range(len(rows)), [_short(found.words(index)) for index in rows], fontsize="small")
    ax.tick_params(length=0, top=False, right=False)
    ax.tick_params(axis="x", labeltop=True, labelbottom=False)
    ax.spines[:].set_visible(False)
    ax.grid(visible=False)


def _cell(x: float, y: float, color: str):
    from matplotlib.patches import Rectangle

    return Rectangle((x - 0.47, y - 0.44), 0.94, 0.88, facecolor=color, edgecolor=GREY, linewidth=0.4)


def _short(words: str) -> str:
    """Break a long description after a comma."""
    if len(words) <= _WIDEST or ", " not in words:
        return words
    head, _, tail = words.partition(", ")
    return f"{head},\n{tail}"


def _draw_shares(ax: Axes, found: Scan) -> None:
    """Draw the share of variations by the number of claims that they fulfil: of those tried, and of random ones."""
    scores = np.arange(len(found.claims) + 1)
    groups = [("tried", found.variations.tried, _TRIED), ("random neighbours", found.variations.neighbours, _RANDOM)]
    height = 0.38
    for place, (name, which, color) in enumerate(groups):
        own = found.scores[which & (found.holds != UNKNOWN).any(axis=1)]
        if not len(own):
            continue
        shares = np.array([(own == score).mean() for score in scores])
        where = scores + (place - 0.5) * height
        ax.barh(where, shares, height, color=color, label=f"{name}: {len(own):,}")
        for y, score, share in zip(where, scores, shares, strict=True):
            ax.annotate(
                f"{int((own == score).sum())}",
                (share, y),
                textcoords="offset points",
                xytext=(3, 0),
                va="center",
                fontsize="small",
            )
    ax.set_xlim(0.0, 1.18)
    ax.set_yticks(scores)
    ax.yaxis.set_major_locator(MaxNLocator(integer=True))
    ax.set_xlabel("share of variations")
    ax.set_ylabel("claims that hold")
    ax.legend(loc="lower right", bbox_to_anchor=(1.02, 1.0), fontsize="small", frameon=False)

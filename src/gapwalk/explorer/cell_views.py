"""Views of planes of cells on the page: basins of attraction, their shares of a box, and maps of regimes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gapwalk.attractors.basins import IMPOSSIBLE, RUNAWAY, UNRESOLVED, Basins, BasinShares
from gapwalk.attractors.regimes import Regimes
from gapwalk.explorer.answer_view import AnswerView, Json, Series, shown
from gapwalk.explorer.axis_quantities import START, quantity_words
from gapwalk.plot.cells import (
    FILLS,
    IMPOSSIBLE_COLOR,
    RUNAWAY_COLOR,
    UNRESOLVED_COLOR,
    marked_strobes,
    regimes_of,
)

_OTHERS = ((RUNAWAY, RUNAWAY_COLOR), (UNRESOLVED, UNRESOLVED_COLOR), (IMPOSSIBLE, IMPOSSIBLE_COLOR))
_MOST = 250_000  # cells that a page draws without waiting; of more, every second (third, ...) of a row and a column


def cells_of(
    axes: tuple[str, str],
    within: Sequence[tuple[float, float]],
    codes: NDArray[np.int_],
    entries: Sequence[tuple[str, str]],
) -> Json:
    """Return a plane of cells as JSON values.

    Shapes: `codes` (rows, columns).
    """
    every = max(1, int(np.ceil(np.sqrt(codes.size / _MOST))))
    return {
        "axes": list(axes),
        "within": [list(ends) for ends in within],
        "rows": codes[::every, ::every].tolist(),
        "entries": [{"tint": "", "color": color, "wild": False, "text": text} for text, color in entries],
        "of": "",
    }


@shown(Basins)
class BasinsView(AnswerView):
    """The plane of initial states, each cell in the colour of its attractor, with the states of periodic motions."""

    record: Basins

    @property
    def axes(self) -> tuple[str, str]:
        """The two components of the initial state."""
        return f"{START}{self.record.window.across}", f"{START}{self.record.window.up}"

    def sentences(self) -> list[str]:
        """Return the share of the plane of each attractor, and how accurate the labels are."""
        found = self.record
        counts = {**found.cells, **{text: count for text, count in found.others.items() if count}}
        shares = ", ".join(f"{name} {count / found.labels.size:.1%}" for name, count in counts.items())
        return [f"Of {found.labels.size:,} starts: {shares}"]

    def drawn(self) -> Json:
        """Return the cells, and the strobes of the periodic attractors."""
        found = self.record
        named = [(name, FILLS[index % len(FILLS)]) for index, name in enumerate(found.names)]
        others: dict[int, str] = dict(zip((RUNAWAY, UNRESOLVED, IMPOSSIBLE), found.others, strict=True))
        entries, codes = list(named), np.array(found.labels)
        for label, color in _OTHERS:
            if np.any(found.labels == label):
                codes[found.labels == label] = len(entries)
                entries.append((others[label], color))
        layers = []
        for index, states in marked_strobes(found, "in the plane"):
            text = f"orbit of {found.names[index]}"
            layers.append(Series(states[:, 0], states[:, 1], "stars", "worst", text, axes=self.axes).plain)
        within = found.window.within
        return {
            "cells": [cells_of(self.axes, within, codes, entries)],
            "layers": layers,
            "quantities": quantity_words(self.axes, found.system),
            "within": {axis: list(ends) for axis, ends in zip(self.axes, within, strict=True)},
        }


@shown(BasinShares)
class BasinSharesView(AnswerView):
    """The share of random starts that lead to each attractor, with its confidence limits."""

    record: BasinShares

    def sentences(self) -> list[str]:
        """Return the shares."""
        shares = ", ".join(f"{each.name} {each.share:.1%}" for each in self.record.shares)
        return [f"Of {len(self.record.labels):,} random starts: {shares}"]

    def drawn(self) -> Json:
        """Return a bar for each attractor."""
        return {"shares": [self._share(number, each) for number, each in enumerate(self.record.shares)]}

    def _share(self, number: int, share: Any) -> Json:
        text = f"{share.share:.1%} ({share.low:.1%} to {share.high:.1%})"
        color = FILLS[number % len(FILLS)]
        return {"name": share.name, "share": share.share, "low": share.low, "high": share.high, "text": text,
                "color": color}  # fmt: skip


@shown(Regimes)
class RegimesView(AnswerView):
    """The kind of motion in each cell of the plane of two parameters."""

    record: Regimes

    @property
    def axes(self) -> tuple[str, str]:
        """Both parameters."""
        return self.record.first, self.record.second

    def sentences(self) -> list[str]:
        """Return the share of the cells of each regime."""
        found = self.record
        shares = ", ".join(f"{name} {count / found.regimes.size:.1%}" for name, count in found.cells.items())
        return [f"Of {found.regimes.size:,} cells: {shares}"]

    def drawn(self) -> Json:
        """Return the cells."""
        found, entries = self.record, list[tuple[str, str]]()
        codes = np.zeros(found.regimes.shape, dtype=int)
        for code, (text, color, cells) in enumerate(regimes_of(found)):
            codes[cells] = code
            entries.append((text, color))
        return {
            "cells": [cells_of(self.axes, found.within, codes, entries)],
            "within": {axis: list(ends) for axis, ends in zip(self.axes, found.within, strict=True)},
        }

"""The record of a regime map: which kind of motion there is at each cell of a plane of two parameters."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gapwalk.attractor.box import centres
from gapwalk.attractor.regime import regime_word
from gapwalk.errors import ModelError
from gapwalk.model.system import System
from gapwalk.notebook.shown import Shown

_SHORT = 8  # periods that are told one by one in few words


@dataclass(frozen=True)
class RegimeCheck:
    """How far the words of a regime map hold.

    Attributes
    ----------
    checked
        Random cells whose motion was settled further and classified with the exact flow.
    different
        Those of them that were given another word or period: one sentence for each.
    """

    checked: int = 0
    different: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Regimes(Shown):
    """The regimes in the plane of two parameters, cell by cell; arrays begin with the lowest row.

    Attributes
    ----------
    system
        The system, with the values of the other parameters.
    first, second
        Names of the parameters: across, and up.
    within
        The range of each. A cell is judged at its centre.
    regimes : shape (rows, columns)
        Values of `Regime`.
    periods : shape (rows, columns)
        m of the periodic motions; 0 for the others.
    exponents : shape (rows, columns)
        Largest Lyapunov exponent, a forcing period, of motions that were not found to be periodic at once; else nan.
    peak_force, impacts : shape (rows, columns, contacts)
        Largest contact force without its sign, and impacts a forcing period; shape (rows, columns, 0) if not wanted.
    states : shape (rows, columns, 2n)
        A state of the motion at theta = 0.
    check
        How far the words hold.
    error
        Of the fast flow over one forcing period, relative to the size of the motion, as seen beside the exact flow;
        0 where that was used alone.
    complete
        False if the work was stopped before its end; cells that were not reached are undecided.
    notes
        What could not be done, in sentences.
    """

    system: System
    first: str
    second: str
    within: tuple[tuple[float, float], tuple[float, float]]
    regimes: NDArray[np.int_]
    periods: NDArray[np.int_]
    exponents: NDArray[np.float64]
    peak_force: NDArray[np.float64]
    impacts: NDArray[np.float64]
    states: NDArray[np.float64]
    check: RegimeCheck = RegimeCheck()
    error: float = 0.0
    complete: bool = True
    notes: tuple[str, ...] = ()

    @property
    def resolution(self) -> tuple[int, int]:
        """Columns and rows."""
        rows, columns = self.regimes.shape
        return columns, rows

    @property
    def axes(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """The parameters' values at the centres of the cells."""
        first, second = (centres(ends, count) for ends, count in zip(self.within, self.resolution, strict=True))
        return first, second

    @property
    def cells(self) -> dict[str, int]:
        """How many cells have each regime, by its word: ``period 1``, ..., ``quasi-periodic``, ``chaotic``, ..."""
        words = Counter(zip(self.regimes.ravel().tolist(), self.periods.ravel().tolist(), strict=True))
        order = sorted(words, key=lambda key: (key[0] < 0, key))
        return {regime_word(*key): words[key] for key in order}

    def at(self, first: float, second: float) -> str:
        """The word of the cell in which two parameter values lie."""
        place = []
        for value, (low, high), count in zip((first, second), self.within, self.resolution, strict=True):
            if not low <= value <= high:
                raise ModelError(f"({first:g}, {second:g}) lies outside the map, which is over {self.within}")
            place.append(min(int((value - low) / (high - low) * count), count - 1))
        column, row = place
        return regime_word(int(self.regimes[row, column]), int(self.periods[row, column]))

    def plot(self, title: str = "", **options: Any):
        """Draw the map; options as in `gapwalk.plot.cells.draw_regimes`. Returns the figure."""
        from gapwalk.plot import draw

        return draw(self, title=title, **options)

    def _groups(self) -> dict[str, int]:
        """The same as `cells`, with all long periods in one."""
        longer = int(np.sum(self.periods > _SHORT))
        short = {f"period {m}": int(np.sum(self.periods == m)) for m in range(1, _SHORT + 1)}
        others = {word: count for word, count in self.cells.items() if not word.startswith("period ")}
        groups = {**short, f"longer periods than {_SHORT}": longer, **others}
        return {word: count for word, count in groups.items() if count}

    def __repr__(self) -> str:
        columns, rows = self.resolution
        parts = ", ".join(f"{word}: {count}" for word, count in self._groups().items())
        return f"Regimes({self.first}, {self.second}; {columns} x {rows} cells; {parts})"

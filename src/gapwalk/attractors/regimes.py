"""The record of a regime map: the kind of motion at each cell of a plane of two parameters.

A `Regime` is the kind of a motion, as a number that arrays can hold and in words.

Method: docs/numerics/basins.md
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from gapwalk.attractors.box import centres
from gapwalk.errors import ModelError
from gapwalk.model.system import System
from gapwalk.notebook import Shown
from gapwalk.orbit.measures import parameter_headings
from gapwalk.summary import Rows, TableRows, Tables

_SHORT = 8  # longest period that a short summary lists separately


@dataclass(frozen=True)
class RegimeCheck:
    """Accuracy of the regimes of a map.

    Examples
    --------
    >>> regimes.check.checked >= len(regimes.check.different)
    True
    """

    #: Number of cells whose motion was settled further and classified with the exact flow, rare kinds first.
    checked: int = 0
    #: One sentence for each of them that then got another regime or period, which the map holds now.
    different: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Regimes(Shown):
    """The regimes in the plane of two parameters, cell by cell; the first row of each array is the lowest.

    Examples
    --------
    >>> regimes.at(0.65, 1.0), regimes.periods.shape
    ('period 1', (8, 8))
    """

    system: System  #: The system, with the values of the other parameters.
    #: first, second: Names of the parameters: horizontal, and vertical.
    first: str
    second: str
    #: The range of each parameter. A cell is evaluated at its centre.
    within: tuple[tuple[float, float], tuple[float, float]]
    regimes: NDArray[np.int_]  #: shape (rows, columns): Values of `Regime`.
    periods: NDArray[np.int_]  #: shape (rows, columns): Period m of the periodic motions; 0 for the others.
    #: shape (rows, columns): Largest Lyapunov exponent per forcing period of motions that were not found to be periodic
    #: at once; else nan.
    exponents: NDArray[np.float64]
    #: peak_force, impacts: shape (rows, columns, contacts): Largest magnitude of each contact force (nan of a rigid
    #: stop, whose impacts have no finite force), and impacts per forcing period; shape (rows, columns, 0) if not
    #: requested.
    peak_force: NDArray[np.float64]
    impacts: NDArray[np.float64]
    states: NDArray[np.float64]  #: shape (rows, columns, state_size): A state of the motion at theta = 0.
    check: RegimeCheck = RegimeCheck()  #: Accuracy of the regimes.
    #: Error of the fast flow over one forcing period, relative to the size of the motion, measured against the exact
    #: flow; 0 if only the exact flow was used.
    error: float = 0.0
    complete: bool = True  #: False if the computation was stopped before its end; the remaining cells are undecided.
    notes: tuple[str, ...] = ()  #: Sentences on what could not be computed.

    def _check_read(self) -> None:
        """Raise a ValueError if its parts do not fit together."""
        parts = (self.regimes, self.periods, self.exponents, self.peak_force, self.impacts, self.states)
        if self.regimes.ndim != 2 or any(part.shape[:2] != self.regimes.shape for part in parts):
            raise ValueError(f"its parts have the shapes {', '.join(str(part.shape) for part in parts)}")
        if self.impacts.ndim != 3 or self.peak_force.shape != self.impacts.shape:
            raise ValueError("its forces and impacts are not those of the same contacts")

    @property
    def resolution(self) -> tuple[int, int]:
        """Columns and rows."""
        rows, columns = self.regimes.shape
        return columns, rows

    @property
    def axes(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """The values of the parameters at the centres of the cells."""
        first, second = (centres(ends, count) for ends, count in zip(self.within, self.resolution, strict=True))
        return first, second

    @property
    def cells(self) -> dict[str, int]:
        """Number of cells of each regime, by its name: ``period 1``, ..., ``quasi-periodic``, ``chaotic``, ..."""
        words = Counter(zip(self.regimes.ravel().tolist(), self.periods.ravel().tolist(), strict=True))
        order = sorted(words, key=lambda key: (key[0] < 0, key))
        return {regime_word(*key): words[key] for key in order}

    def at(self, first: float, second: float) -> str:
        """Return the regime of the cell that contains two parameter values.

        Parameters
        ----------
        first, second
            Values of the horizontal and of the vertical parameter.
        """
        place = []
        for value, (low, high), count in zip((first, second), self.within, self.resolution, strict=True):
            if not low <= value <= high:
                raise ModelError(f"({first:g}, {second:g}) lies outside the map, which is over {self.within}")
            place.append(min(int((value - low) / (high - low) * count), count - 1))
        column, row = place
        return regime_word(int(self.regimes[row, column]), int(self.periods[row, column]))

    def tables(self) -> Tables:
        """Return the table of the cells."""
        return {"cells": TableRows(self._cell_rows, 2, units={"peak.force.": ".force"})}

    def _cell_rows(self) -> Rows:
        contacts = [contact.name for contact in self.system.structure.contacts][: self.impacts.shape[2]]
        headings = [f"{what}.{contact}" for what in ("peak.force", "impacts") for contact in contacts]
        names = parameter_headings([self.first, self.second], self.system.coordinates)
        yield [*names, "regime", "period", "exponent", *headings]
        (across, up), (rows, columns) = self.axes, self.regimes.shape
        for row, column in np.ndindex(rows, columns):
            regime, period = int(self.regimes[row, column]), int(self.periods[row, column])
            forces, impacts = self.peak_force[row, column], self.impacts[row, column]
            yield [
                float(across[column]),
                float(up[row]),
                regime_word(regime, period),
                period,
                *("" if np.isnan(each) else float(each) for each in (self.exponents[row, column], *forces, *impacts)),
            ]

    def _groups(self) -> dict[str, int]:
        """Count cells as in `cells`, with all long periods in one group."""
        longer = int(np.sum(self.periods > _SHORT))
        short = {f"period {m}": int(np.sum(self.periods == m)) for m in range(1, _SHORT + 1)}
        others = {word: count for word, count in self.cells.items() if not word.startswith("period ")}
        groups = {**short, f"longer periods than {_SHORT}": longer, **others}
        return {word: count for word, count in groups.items() if count}

    def __repr__(self) -> str:
        columns, rows = self.resolution
        parts = ", ".join(f"{word}: {count}" for word, count in self._groups().items())
        return f"Regimes({self.first}, {self.second}; {columns} x {rows} cells; {parts})"


class Regime(IntEnum):
    """The kind of a motion.

    Examples
    --------
    >>> gw.analysis.Regime(regimes.regimes[0, 0]).name
    'PERIODIC'
    """

    RUNAWAY = -2
    UNDECIDED = -1
    PERIODIC = 0
    QUASI_PERIODIC = 1
    CHAOTIC = 2

    @property
    def text(self) -> str:
        """The regime in words."""
        return ("periodic", "quasi-periodic", "chaotic", "diverges", "undecided")[self.value]


def regime_word(regime: int, period: int) -> str:
    """Return the name of a regime in a regime map: ``period 3``, ``quasi-periodic``, ``chaotic``, ..."""
    return f"period {period}" if regime == Regime.PERIODIC else Regime(regime).text

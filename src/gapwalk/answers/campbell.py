"""A Campbell diagram: natural frequencies over the speed in each state of a machine, and the orders that meet them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import zip_longest
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.bracketed_root import find_root
from gapwalk.model.mode_states import mode_states
from gapwalk.model.modes import ModeState, find_modes
from gapwalk.model.system import System
from gapwalk.model.words import parameter_symbol, value_words
from gapwalk.notebook import Shown
from gapwalk.picture_parts import NATURAL_FREQUENCY, Parts, Picture, Series, pictured
from gapwalk.summary import Rows, SummaryParts, Table, TableRows, Tables, summarizes

_LOOKS = ("first", "falling", "other", "fourth", "main")
_ROOM = 1.2  # height of the lines, in the highest crossing
_MARGIN = 1.1  # height of the picture, in that of the lines: room for the names of the orders
_SAME = 1e-9  # relative difference of frequencies of two states that are one
_TOLERANCE = 1e-12  # of the speed of a crossing, relative


class OrderCrossing(NamedTuple):
    """A speed at which an order meets a natural frequency."""

    state: str  #: The state, in words.
    order: float  #: The order, per turn of the reference shaft, or the multiple of the excitation.
    mode: int  #: Number of the mode in that state, from 1, without motions that no spring holds.
    frequency: float  #: The frequency there, in Hz (angular without units).
    value: float  #: The speed, or the frequency of the excitation.


@dataclass(frozen=True, eq=False, repr=False)
class Campbell(Shown):
    """Natural frequencies over the speed in each state, the rays of orders, and their crossings."""

    system: System  #: The system.
    parameter: str  #: Its first parameter, over which the diagram is drawn.
    #: shape (speeds,): Values of this parameter; two if no coefficient of the equations depends on it.
    values: NDArray[np.float64]
    orders: tuple[float, ...]  #: The orders of the rays.
    states: tuple[ModeState, ...]  #: The states.
    #: shape (states, modes, speeds): Natural frequencies, in Hz (angular without units), slowest first; without motions
    #: that no spring holds. NaN where a state has fewer modes.
    frequencies: NDArray[np.float64]
    crossings: tuple[OrderCrossing, ...]  #: The crossings within the speeds, state by state.

    def _check_read(self) -> None:
        """Raise a ValueError if its parts do not fit together."""
        shape = self.frequencies.shape
        if len(shape) != 3 or (shape[0], shape[2]) != (len(self.states), len(self.values)):
            raise ValueError("the frequencies of a Campbell diagram do not fit its states and speeds")

    @property
    def complete(self) -> bool:
        """True: it has one part."""
        return True

    def ray(self, order: float) -> NDArray[np.float64]:
        """Return the frequency of an order at each speed, shape (speeds,)."""
        return self.values * _slope(self.system, order)

    @summarizes
    def summary(self, *, notes: bool = True) -> SummaryParts:
        """Return how many crossings there are, the modes of each state, and the crossings."""
        units = self.system.units
        ends = " to ".join(f"{value:g}" for value in self.values[[0, -1]])
        several = ["s" * (len(each) != 1) for each in (self.crossings, self.orders, self.states)]
        yield (
            f"Campbell diagram over {parameter_symbol(self.parameter, units)} from {ends}: {len(self.crossings)} "
            f"crossing{several[0]} of order{several[1]} {', '.join(f'{each:g}' for each in self.orders)} with modes of "
            f"{len(self.states)} state{several[2]}"
        )
        rate, place = "Hz" if units else "W", value_words(float(self.values[0]), self.parameter, units, 6)
        rows = [
            [each.text, ", ".join(f"{value:.6g}" for value in found[:, 0] if not math.isnan(value))]
            for each, found in zip(self.states, self.frequencies, strict=True)
        ]
        yield Table(["state", f"natural frequencies [{rate}] at {place}"], rows)
        if self.crossings:
            states = [each.state for each in self.crossings]
            ends = [k for k in range(len(states) - 1) if states[k + 1] != states[k]]
            cells = [
                [
                    "" if k and k - 1 not in ends else each.state,
                    f"{each.order:g}",
                    str(each.mode),
                    f"{each.frequency:.6g}",
                    f"{each.value:.6g}",
                ]
                for k, each in enumerate(self.crossings)
            ]
            heads = ["state", ">order", ">mode", f">{rate}", f">{parameter_symbol(self.parameter, units)}"]
            yield Table(heads, cells, ends)

    def tables(self) -> Tables:
        """Return the crossings, and the frequencies of each mode over the speed."""
        unit = "Hz" if self.system.units else ""
        return {
            "crossings": TableRows(self._crossing_rows, units={NATURAL_FREQUENCY: unit}),
            "frequencies": TableRows(self._rows, units={NATURAL_FREQUENCY: unit}),
        }

    def _crossing_rows(self) -> Rows:
        yield ["state", "order", "mode", NATURAL_FREQUENCY, self.parameter]
        yield from map(list, self.crossings)

    def _rows(self) -> Rows:
        yield ["state", "mode", self.parameter, NATURAL_FREQUENCY]
        for state, modes in zip(self.states, self.frequencies, strict=True):
            for number, found in enumerate(modes, start=1):
                for value, frequency in zip(self.values.tolist(), found.tolist(), strict=True):
                    if not math.isnan(frequency):
                        yield [state.text, number, value, frequency]

    def __repr__(self) -> str:
        return f"Campbell({len(self.states)} states, {len(self.crossings)} crossings)"


def campbell_of(system: System, ends: Sequence[float], orders: Sequence[float], count: int) -> Campbell:
    """Compute the diagram at some speeds, of which two are enough where no number depends on the speed."""
    pace = system.structure.pace
    values = np.linspace(ends[0], ends[1], count if system.structure.is_paced else 2)
    states, tables = list[ModeState](), list[NDArray[np.float64]]()
    for state in mode_states(system):
        found = [_frequencies(system.at({pace: float(value)}), state) for value in values]
        table = np.array([*zip_longest(*found, fillvalue=np.nan)]).reshape(-1, len(values))
        if not any(
            each.shape == table.shape and np.allclose(each, table, _SAME, 0.0, equal_nan=True) for each in tables
        ):
            states.append(state)
            tables.append(table)
    rows = zip_longest(*tables, fillvalue=np.full(len(values), np.nan))
    whole = np.array([*map(np.stack, rows)]).reshape(-1, len(states), len(values)).swapaxes(0, 1)
    crossings = [
        each
        for state, modes in zip(states, whole, strict=True)
        for order in orders
        for each in _crossings(system, state, modes, values, order)
    ]
    return Campbell(system, pace, values, tuple(orders), tuple(states), whole, tuple(crossings))


def _slope(system: System, order: float) -> float:
    """Return the frequency of an order at the value 1 of the first parameter."""
    return order / float(system.turns or 1) * system.structure.frequency * _rate(system)


def _rate(system: System) -> float:
    return 0.5 / math.pi if system.units else 1.0


def _frequencies(system: System, state: ModeState) -> NDArray[np.float64]:
    """Return the natural frequencies of what some spring holds."""
    found = find_modes(system, state)
    return found.frequencies[found.numbers > 0] * _rate(system)


def _crossings(
    system: System, state: ModeState, modes: NDArray[np.float64], values: NDArray[np.float64], order: float
) -> Iterator[OrderCrossing]:
    """Yield the speeds at which an order meets the modes of a state."""
    slope, pace = _slope(system, order), system.structure.pace
    for number, frequencies in enumerate(modes):
        above = frequencies - slope * values

        def excess(value: float, number: int = number) -> float:
            return float(_frequencies(system.at({pace: value}), state)[number] - slope * value)

        for k in np.flatnonzero((above[:-1] > 0.0) != (above[1:] > 0.0)):
            if np.isnan(above[k : k + 2]).any():
                continue
            low, high = sorted(map(float, values[k : k + 2]))
            if system.structure.is_paced:
                value = find_root(excess, low, high, relative=_TOLERANCE).place
            else:
                value = float(frequencies[k]) / slope
            yield OrderCrossing(state.text, order, number + 1, slope * value, value)


@pictured(Campbell, size=(8.0, 5.6))
def campbell_picture(found: Campbell) -> Picture:
    """Describe the modes of each state over the speed, the rays of the orders, and their crossings."""
    return Picture(
        found.system,
        (found.parameter, NATURAL_FREQUENCY),
        (),
        partial(_parts, found),
        sentences=[str(found.summary()[0])],
        words=("", f"frequency [{'Hz' if found.system.units else 'angular'}]"),
    )


def _parts(found: Campbell) -> Parts:
    """Return the lines up to a little above the highest crossing."""
    highest = max((each.frequency for each in found.crossings), default=0.0)
    top = _ROOM * (highest or float(np.max([found.ray(each) for each in found.orders])))
    return Parts(
        layers=list(_series(found, top)),
        quantities=[NATURAL_FREQUENCY],
        within={NATURAL_FREQUENCY: (0.0, _MARGIN * top), found.parameter: (found.values.min(), found.values.max())},
    )


def _series(found: Campbell, top: float) -> Iterator[Series]:
    """Yield the rays, the modes and their crossings up to the highest frequency shown."""
    axes = found.parameter, NATURAL_FREQUENCY
    words = f"order{'s' * (len(found.orders) > 1)} {', '.join(f'{each:g}' for each in found.orders)}"
    for order in found.orders:
        slope = _slope(found.system, order)
        ends = np.sort(found.values[[0, -1]])
        ends[1] = min(ends[1], top / slope)
        if ends[1] > ends[0]:
            name = f"order {order:g}" if found.system.turns else f"{order:g} Ω"
            yield Series(ends, slope * ends, "line", "measured", words, axes=axes, notes=("", name))
    for number, (state, modes) in enumerate(zip(found.states, found.frequencies, strict=True)):
        look = _LOOKS[number % len(_LOOKS)]
        for frequencies in modes:
            if np.nanmin(frequencies, initial=math.inf) <= top:
                shown = np.where(frequencies <= top, frequencies, np.nan)
                yield Series(found.values, shown, "line", look, state.text, axes=axes)
        own = [each for each in found.crossings if each.state == state.text]
        yield Series([each.value for each in own], [each.frequency for each in own], "dots", look, axes=axes)

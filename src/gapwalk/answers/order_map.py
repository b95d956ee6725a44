"""An order map: amplitudes over the speed and over orders, with cuts, levels and peaks, of a run-up or of orbits."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.answers.run_up import RunUp
from gapwalk.attractors.spectrum import BAND, Waterfall, order_heading, turns_of, waterfall
from gapwalk.bifurcation.branch import Branch
from gapwalk.errors import ModelError
from gapwalk.model.measures import MeasureName
from gapwalk.model.system import System
from gapwalk.model.words import parameter_symbol
from gapwalk.notebook import Shown
from gapwalk.orbit.orbit import Orbit
from gapwalk.summary import Rows, SummaryParts, Table, TableRows, Tables, summarizes

DEPTH = 60.0
"""Range of the colours of a map, in dB."""
TOP = 10
"""The highest order of a map by default, in the orders of the excitation."""


class OrderPeak(NamedTuple):
    """The largest amplitude of an order."""

    order: float  #: The order.
    value: float  #: The parameter there: the speed, say.
    amplitude: float  #: The amplitude, in the unit of the signal.
    level: float  #: Its level in dB; see `OrderMap.levels`.


@dataclass(frozen=True, eq=False, repr=False)
class OrderMap(Shown):
    """Amplitudes of a signal over a parameter and over orders, with cuts through the map and levels beside it."""

    spectra: Waterfall  #: The spectra.
    cuts: tuple[float, ...]  #: Orders whose amplitudes are drawn beside the map, and listed.

    @property
    def values(self) -> NDArray[np.float64]:
        """The parameter at each spectrum, shape (spectra,)."""
        return self.spectra.values

    def levels(self, amplitudes: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return levels of amplitudes in dB, of their root mean square.

        The reference is 1e-6 m/s^2 for accelerations in m/s^2, and otherwise 1 of the unit.
        """
        return np.vectorize(lambda each: self._measure.level(each, self.spectra.units), otypes=[float])(amplitudes)

    @property
    def unit(self) -> str:
        """The unit of the levels: ``dB re 1e-6 m/s^2``."""
        return self._measure._replace(is_level=True).unit(self.spectra.units)

    @property
    def _measure(self) -> MeasureName:
        return MeasureName("order", self.spectra.signal, (Fraction(1),))

    @property
    def peaks(self) -> tuple[OrderPeak, ...]:
        """The largest amplitude of each order of `cuts`."""
        found = []
        for order in self.cuts:
            sizes = self.spectra.cut(order)
            place = int(np.argmax(sizes))
            level = float(self.levels(sizes[place]))
            found.append(OrderPeak(order, float(self.values[place]), float(sizes[place]), level))
        return tuple(found)

    @summarizes
    def summary(self) -> SummaryParts:
        """Return the windows, the largest amplitude of each order, and the largest levels."""
        spectra, units = self.spectra, self.spectra.units
        symbol = "time" if spectra.parameter == "time" else parameter_symbol(spectra.parameter, units)
        unit = units.signal(spectra.signal)[1] if units else ""
        size = f"{spectra.signal} [{unit}]" if unit else spectra.signal
        yield f"order map of {size} over {symbol}, {len(self.values)} spectra: {spectra.window}"
        rows = [[f"order {each.order:g}", *self._texts(each.value, each.amplitude, each.level)] for each in self.peaks]
        for words, sizes in self.lines():
            place = int(np.nanargmax(sizes))
            level = float(self.levels(sizes[place] * math.sqrt(2.0)))
            rows.append([words, *self._texts(float(self.values[place]), float(sizes[place]), level)])
        yield Table(["", f">{symbol}", ">largest", f">{self.unit}"], rows)

    def _texts(self, value: float, size: float, level: float) -> list[str]:
        return [f"{value:.6g}", f"{size:.5g}", f"{level:.2f}"]

    def lines(self) -> Iterator[tuple[str, NDArray[np.float64]]]:
        """Yield the levels beside the map in words, each with its root mean squares, shape (spectra,)."""
        yield "overall, root mean square", self.spectra.overall
        if np.isfinite(self.spectra.band).any():
            yield f"rattle, {BAND[0]:.0f} to {BAND[1]:.0f} Hz, root mean square", self.spectra.band

    def tables(self) -> Tables:
        """Return the peaks, the cuts with the levels over the parameter, and the whole map."""
        signal, units = self.spectra.signal, self.spectra.units
        unit = units.signal(signal)[1] if units else ""
        known = dict.fromkeys(("overall", "rattle", "amplitude"), unit) | {"level": self.unit if units else ""}
        return {
            "peaks": TableRows(self._peak_rows, units=known),
            "cuts": TableRows(self._cut_rows, 1, signal, units=known),
            "amplitudes": TableRows(self._rows, 1, signal),
        }

    def _peak_rows(self) -> Rows:
        yield ["order", self.spectra.parameter, "amplitude", "level"]
        yield from map(list, self.peaks)

    def _cut_rows(self) -> Rows:
        yield [self.spectra.parameter, *map(order_heading, self.cuts), "overall", "rattle"]
        columns = [self.values, *map(self.spectra.cut, self.cuts), self.spectra.overall, self.spectra.band]
        yield from np.column_stack(columns).tolist()

    def _rows(self) -> Rows:
        yield [self.spectra.parameter, *map(order_heading, self.spectra.orders)]
        yield from np.column_stack((self.values, self.spectra.amplitudes)).tolist()

    def __repr__(self) -> str:
        return f"OrderMap({self.spectra!r})"


def orders_of(system: System) -> tuple[float, ...]:
    """Return the orders of the loads, per turn of the reference shaft, or as multiples of the excitation."""
    unit = float(system.turns or 1)
    return tuple(sorted({each * unit for load in system.structure.harmonics for each in load.multiples}))


def order_map(
    found: RunUp | Branch | Sequence[Orbit],
    signal: str,
    top: float | None = None,
    *,
    cuts: Sequence[float] = (),
    turns: int = 8,
    overlap: float = 0.75,
    parameter: str = "",
) -> OrderMap:
    """Compute the order map of a signal along a run-up, along a branch, or for a list of orbits.

    Parameters
    ----------
    found
        A run-up, of which spectra are computed in Hann windows; or a branch, or orbits in the order in which a
        parameter changes: lines of periodic orbits are exact.
    signal
        As in `Motion.signal`, such as ``"gear1.acceleration"``.
    top
        The highest order; by default 10 times the order of the excitation.
    cuts
        Orders whose amplitudes are drawn beside the map; by default those of the loads.
    turns
        Length of a window in turns of the reference shaft, or in forcing periods if the system has no speed. With 8
        turns, the lines of a spectrum are 1/8 of an order apart.
    overlap
        Share of a window that the next window covers too, from 0 to less than 1.
    parameter
        Name of the parameter that changes, for a list of orbits; by default the frequency or the speed.

    Returns
    -------
    OrderMap
        The map, with its cuts, levels and peaks.

    Raises
    ------
    ModelError
        If there is no such signal, no such order, or the run-up is shorter than a window.

    Notes
    -----
    Orders count turns of the reference shaft where its speed is a parameter, otherwise multiples of the excitation. The
    overall level includes all orders, without the mean. The level of rattle is that between 500 and 5,000 Hz, because
    impacts of teeth are broad-band, and orders of the excitation are lower.

    Examples
    --------
    >>> found = gw.analysis.order_map(branch, "x''", 5.0)
    >>> len(found.cuts), found.spectra.cut(1.0).shape == found.values.shape
    (1, True)
    """
    if not isinstance(found, RunUp | Branch) and not found:
        raise ModelError("an order map needs a run-up, a branch, or at least one orbit")
    system = found.system if isinstance(found, RunUp | Branch) else found[0].system
    unit = float(system.turns or 1)
    if top is None:
        top = TOP * unit
    if isinstance(found, RunUp):
        spectra = found.waterfall(signal, top, turns_of(system, turns), overlap)
    else:
        spectra = waterfall(found, signal, top, parameter=parameter or system.structure.pace)
    chosen = tuple(cuts) or tuple(order for order in orders_of(system) or (unit,) if order <= top)
    for order in chosen:
        spectra.cut(order)  # refuses what the map does not have
    return OrderMap(spectra, chosen)

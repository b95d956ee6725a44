"""The waterfall: spectra of a signal along a branch or for a list of orbits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import lcm

import numpy as np
from numpy.typing import NDArray

from gapwalk.attractors.spectrum import SpectrumOptions, spectrum
from gapwalk.bifurcation.branch import Branch
from gapwalk.errors import ModelError
from gapwalk.orbit.orbit import Orbit


@dataclass(frozen=True, eq=False)
class Waterfall:
    """Spectra over orders, orbit by orbit: multiples of W, or orders per turn of the shaft whose speed is a parameter.

    Attributes
    ----------
    parameter
        Name of the parameter that changes from orbit to orbit.
    signal
        Name of the signal.
    values : shape (orbits,)
        The parameter at each orbit, in the order along the branch: it reverses at folds.
    orders : shape (lines,)
        Orders, evenly spaced from 0; see `Spectrum`.
    amplitudes : shape (orbits, lines)
        Amplitudes in the units of the signal; the first column is the mean.
    stable : shape (orbits,)
        True for stable orbits.
    turns
        See `System.turns`.
    """

    parameter: str
    signal: str
    values: NDArray[np.float64]
    orders: NDArray[np.float64]
    amplitudes: NDArray[np.float64]
    stable: NDArray[np.bool_]
    turns: int | None = None

    def plot(self, **options):
        """Draw it as a colour map; see `gapwalk.plot.motions.draw_waterfall`. Return the axes."""
        from gapwalk.plot import draw

        return draw(self, **options)

    def __repr__(self) -> str:
        return (
            f"Waterfall({self.signal} over {self.parameter} {self.values[0]:.6g} ... {self.values[-1]:.6g}, "
            f"{len(self.values)} orbits, orders up to {self.orders[-1]:g})"
        )


def waterfall(
    orbits: Branch | Sequence[Orbit],
    signal: str,
    top: float = 10.0,
    *,
    parameter: str = "frequency",
    options: SpectrumOptions | None = None,
) -> Waterfall:
    """Compute the spectra of a signal along a branch, or for a list of orbits.

    Parameters
    ----------
    orbits
        A branch, or orbits in the order in which a parameter changes.
    signal
        As in `spectrum`.
    top
        The highest order.
    parameter
        Name of the parameter that changes, for a list of orbits; a branch supplies its own.
    options
        As in `spectrum`; by default aliasing is limited to 1e-4 of the largest line.

    Raises
    ------
    ModelError
        If there are no orbits, no such signal, or no such parameter.
    """
    if isinstance(orbits, Branch):
        parameter, orbits = orbits.parameter, [point.orbit for point in orbits.points]
    if not orbits:
        raise ModelError("a waterfall needs at least one orbit")
    if not top > 0.0:
        raise ModelError(f"top is {top!r}; it must be a positive order")
    options = options or SpectrumOptions(tolerance=1e-4)
    spacing = lcm(*(orbit.period for orbit in orbits))
    turns = orbits[0].system.turns
    orders = (turns or 1) * np.arange(round(top / (turns or 1) * spacing) + 1) / spacing
    table = np.zeros((len(orbits), len(orders)))
    for row, orbit in zip(table, orbits, strict=True):
        step = spacing // orbit.period
        lines = spectrum(orbit, signal, options).amplitudes[: len(row[::step])]
        row[: len(lines) * step : step] = lines
    values = np.array([orbit.system[parameter] for orbit in orbits])
    return Waterfall(parameter, signal, values, orders, table, np.array([orbit.stable for orbit in orbits]), turns)

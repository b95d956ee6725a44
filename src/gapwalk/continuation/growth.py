"""Largest amplitude along a parameter before a gap limits it, by linear theory (exact until a gap closes)."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from gapwalk.continuation.walk_options import Range
from gapwalk.model.coefficients import coefficients_of, layout_of
from gapwalk.model.spring import springs_of
from gapwalk.model.system import System
from gapwalk.orbit.harmonic_balance.linear_part import Linear, linear_of

_EVEN, _BY_RATIO = 33, 65  # values at which the response is computed: evenly spaced, and with equal ratios
_LOWEST = 1e-9  # share of the highest value at which the equal ratios begin in a range that begins at zero
_PEAKS = 3  # number of peaks that are refined
_SHARP = 1e-3  # accuracy of a peak, as a share of the interval between two values


def linear_growth(system: System, parameter: str, within: Range) -> float:
    """Return the largest amplitude that any coordinate reaches along a parameter while all gaps stay open.

    Peaks are located by Brent's method between the neighbouring values, so that none is missed at light damping. The
    result is 0 where linear theory does not apply, because a stage without clearance is not a linear spring.
    """
    if not _is_linear_inside_its_gaps(system):
        return 0.0
    place, values = system.structure.place(parameter), _values(within)

    def size(value: float) -> float:
        return _amplitude(System.beside(system, place, value))

    sizes = [size(value) for value in values.tolist()]
    return max(_summit(size, values, sizes, peak) for peak in _peaks(sizes))


def _is_linear_inside_its_gaps(system: System) -> bool:
    """Return whether all stages without a clearance, if there are any, are linear springs."""
    for spring in springs_of(system):
        tight = [slope for slope in spring.slopes if slope.clearance == 0.0]
        if any(slope.bends or slope.pull[0] for slope in tight) or sum(slope.sign for slope in tight) != 0:
            return False
        if tight and spring.form.law.is_damped:
            return False
    return True


def _values(within: Range) -> NDArray[np.float64]:
    """Return values of a range, at some of which the motion is a good part of its largest."""
    low, high = within.low, within.high
    if within.is_relative or low >= 0.0:
        low = max(low, _LOWEST * high)
        return np.unique(np.concatenate((np.linspace(low, high, _EVEN), np.geomspace(low, high, _BY_RATIO)[1:-1])))
    return np.linspace(low, high, _EVEN)


def _peaks(sizes: list[float]) -> list[int]:
    """Return the places of the largest values that have no larger neighbour."""
    padded = [-math.inf, *sizes, -math.inf]
    tops = [k for k in range(len(sizes)) if padded[k] <= padded[k + 1] >= padded[k + 2]]
    return sorted(tops, key=lambda k: sizes[k])[-_PEAKS:]


def _summit(size: Callable[[float], float], values: NDArray[np.float64], sizes: list[float], peak: int) -> float:
    """Return the largest size near one of the values."""
    from scipy.optimize import minimize_scalar  # imported late: slow to import, and rarely needed

    low, high = values[max(peak - 1, 0)], values[min(peak + 1, len(values) - 1)]
    found = minimize_scalar(
        lambda value: -size(float(value)),
        bounds=(low, high),
        method="bounded",
        options={"xatol": _SHARP * (high - low)},
    )
    return max(sizes[peak], -float(found.fun))


def _amplitude(system: System) -> float:
    """Return the largest amplitude of a coordinate, summed over all harmonics, while all gaps are open."""
    layout = layout_of(system.structure)
    linear = linear_of(layout, coefficients_of(system))
    stiffness, n = _sprung(system, linear), system.size
    total = np.zeros(n)
    for order, load in zip(layout.orders, linear.loads.T[1:], strict=True):
        frequency = order * system.frequency
        matrix = stiffness - frequency**2 * np.eye(n) + 1j * frequency * linear.damping
        try:
            total += np.abs(np.linalg.solve(matrix, load))
        except np.linalg.LinAlgError:  # no damping, at resonance
            return math.inf
    return float(total.max())


def _sprung(system: System, linear: Linear) -> NDArray[np.float64]:
    """Return the stiffness including the stages that have no clearance, shape (n, n)."""
    tight = [[each for each in spring.slopes if each.clearance == 0.0 < each.sign] for spring in springs_of(system)]
    return linear.shifted(np.array([sum(each.stiffness for each in stages) for stages in tight]))

"""Spectra of periodic functions with kinks and jumps at known angles, by Gauss's rule on panels between these.

Beside a kink a function may behave as a fractional power of the distance, as the force of Hertz. There the panels are
stretched: with the distance proportional to the fourth power of the variable of integration, multiples of a half become
even powers. Panels are halved until each is resolved, so that two kinks may be close together.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.polynomial import Polynomial, legendre
from numpy.typing import NDArray

_NODES, _WEIGHTS = legendre.leggauss(20)
_LAST = 3  # coefficients of Legendre's series that show what is not resolved
_STRETCH = 4
_HALVINGS = 40
_RESOLVED = 1e-12  # what each panel may leave unresolved, relative to the integral of the largest value
_BATCH = 2_000_000  # numbers in one matrix of waves


class Panels(NamedTuple):
    """Panels between angles, and whether a break is at their ends; arrays of the same length."""

    low: NDArray[np.float64]
    high: NDArray[np.float64]
    begins: NDArray[np.bool_]
    ends: NDArray[np.bool_]

    def halves(self) -> Panels:
        """Halve all panels."""
        middle, none = 0.5 * (self.low + self.high), np.zeros(len(self.low), dtype=bool)
        both = (self.low, middle), (middle, self.high), (self.begins, none), (none, self.ends)
        return Panels(*(np.concatenate(pair) for pair in both))


def spectra_between(
    breaks: NDArray[np.float64],
    count: int,
    longest: int,
    values_at: Callable[[NDArray[np.float64]], tuple[NDArray[np.float64], NDArray[np.float64]]],
) -> tuple[NDArray[np.complex128], float]:
    """Compute the spectra, k = 0 ... longest, of some functions, and what is left unresolved of them."""
    panels, largest, left = _even(breaks, count), 0.0, 0.0
    result: NDArray[np.complex128] = np.zeros((1, longest + 1), dtype=complex)
    for halving in range(_HALVINGS + 1):
        width = panels.high - panels.low
        share, slope = _places(panels)
        phi = panels.low[:, None] + width[:, None] * share
        values, factors = values_at(phi.ravel())
        values = values.reshape(len(values), *phi.shape)
        largest = largest or float((factors * np.abs(values).max(axis=(1, 2))).max())
        coefficients = (values * slope) @ _last_coefficients()
        off = (factors[:, None] * np.abs(coefficients).max(axis=2)).max(axis=0) * width * (count / (2.0 * np.pi))
        coarse = off > _RESOLVED * largest
        if halving == _HALVINGS:
            left, coarse = float(off.max()) / (largest or 1.0), np.zeros_like(coarse)
        fine = ~coarse
        weights = (0.5 * _WEIGHTS) * slope[fine] * width[fine, None]
        result = result + _spectra(phi[fine].ravel(), (values[:, fine] * weights).reshape(len(values), -1), longest)
        if not coarse.any():
            break
        low, high, begins, ends = panels
        panels = Panels(low[coarse], high[coarse], begins[coarse], ends[coarse]).halves()
    return result, left


def _even(breaks: NDArray[np.float64], count: int) -> Panels:
    """Make panels of about the same length that end at breaks."""
    if not len(breaks):
        knots = 2.0 * np.pi * np.arange(count + 1) / count
        none = np.zeros(count, dtype=bool)
        return Panels(knots[:-1], knots[1:], none, none)
    parts = []
    for low, high in zip(breaks, np.append(breaks[1:], breaks[0] + 2.0 * np.pi), strict=True):
        number = max(1, int(np.ceil(count * (high - low) / (2.0 * np.pi))))
        knots = low + (high - low) * np.arange(number + 1) / number
        knots[-1] = high
        parts.append((knots[:-1], knots[1:], np.arange(number) == 0, np.arange(number) == number - 1))
    return Panels(*(np.concatenate(each) for each in zip(*parts, strict=True)))


def _places(panels: Panels) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the places of the nodes within the panels, from 0 to 1, and their derivatives; shape (panels, nodes)."""
    share, slope = np.empty((2, len(panels.low), len(_NODES)))
    for begins in (False, True):
        for ends in (False, True):
            here = (panels.begins == begins) & (panels.ends == ends)
            share[here], slope[here] = _stretched(begins, ends)
    return share, slope


@lru_cache(maxsize=4)
def _stretched(begins: bool, ends: bool) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the place within a panel and its derivative, at the nodes; breaks are at one of its ends, or both."""
    t = 0.5 + 0.5 * _NODES
    if begins and ends:  # the integral of (t (1 - t))**3, normalised
        polynomial = Polynomial([0.0, 0.0, 0.0, 0.0, 35.0, -84.0, 70.0, -20.0])
        return polynomial(t), polynomial.deriv()(t)
    if begins:
        return t**_STRETCH, _STRETCH * t ** (_STRETCH - 1)
    if ends:
        return 1.0 - (1.0 - t) ** _STRETCH, _STRETCH * (1.0 - t) ** (_STRETCH - 1)
    return t, np.ones_like(t)


@lru_cache(maxsize=1)
def _last_coefficients() -> NDArray[np.float64]:
    """Return the matrix from values at the nodes to the last coefficients of Legendre's series."""
    count = len(_NODES)
    rows = legendre.legvander(_NODES, count - 1)[:, -_LAST:] * _WEIGHTS[:, None]
    return rows * (np.arange(count - _LAST, count) + 0.5)


def _spectra(phi: NDArray[np.float64], weighted: NDArray[np.float64], longest: int) -> NDArray[np.complex128]:
    """Return the spectra of functions, from their values at angles times the weights of these."""
    result: NDArray[np.complex128] = np.zeros((len(weighted), longest + 1), dtype=complex)
    size = max(1, _BATCH // (longest + 1))
    for first in range(0, len(phi), size):
        part = slice(first, first + size)
        result += weighted[:, part] @ np.exp(-1j * np.multiply.outer(phi[part], np.arange(longest + 1)))
    return result / (2.0 * np.pi)

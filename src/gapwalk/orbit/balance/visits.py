"""When each contact stage is closed along a motion that is given by its Fourier lines: exact in the breakpoints."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gapwalk.orbit.balance.lines import Bracket, differentiated, grid, real_form, waves, zeros


@dataclass(frozen=True, slots=True)
class Visits:
    """The times at which deflections pass breakpoints, over one period ``0 <= phi < 2 pi``.

    Attributes
    ----------
    phi : shape (crossings,)
        Angles, grouped by switch and growing within each.
    switch : shape (crossings,)
        Which stage on which side.
    enters : shape (crossings,)
        Whether it closes there.
    starts_inside : shape (switches,)
        Whether it is closed at phi = 0.
    """

    phi: NDArray[np.float64]
    switch: NDArray[np.intp]
    enters: NDArray[np.bool_]
    starts_inside: NDArray[np.bool_]

    def indicators(self, count: int) -> NDArray[np.complex128]:
        """Spectra, k = 0 ... count, of the functions that are 1 while a stage is closed; shape (switches, count + 1).

        In closed form: ``(exp(-i k enters) - exp(-i k leaves)) / (2 pi i k)`` summed over the visits.
        """
        result = np.zeros((len(self.starts_inside), count + 1), dtype=complex)
        result[:, 0] = self.starts_inside
        if len(self.phi):
            sign = np.where(self.enters, 1.0, -1.0)
            which = (self.switch == np.arange(len(result))[:, None]) * sign
            result[:, 0] -= which @ self.phi / (2.0 * np.pi)
            result[:, 1:] = (which @ waves(-self.phi, count)[:, 1:]) / (2j * np.pi * np.arange(1, count + 1))
        return result


def find_visits(
    lines: NDArray[np.complex128],
    contact: NDArray[np.intp],
    sign: NDArray[np.float64],
    clearance: NDArray[np.float64],
) -> Visits:
    """Find every crossing of every breakpoint.

    Parameters
    ----------
    lines : shape (contacts, K + 1)
        The deflections.
    contact, sign, clearance : shape (switches,)
        For each stage on each side its contact, and that it is closed where ``sign * x > clearance``.
    """
    phi, values, slopes = grid(lines.shape[-1] - 1)
    real = real_form(lines)
    depths = sign[:, None] * (real @ values)[contact] - clearance[:, None]
    speeds = sign[:, None] * (real @ slopes)[contact]
    inside = depths > 0.0
    changes = inside[:, 1:] != inside[:, :-1]
    switch, cell = np.nonzero(changes)
    bracket = Bracket(phi[cell], phi[cell + 1], depths[switch, cell], depths[switch, cell + 1])
    functions = sign[:, None] * lines[contact]
    functions[:, 0] -= clearance
    hidden = _hidden(depths, speeds, inside, changes, phi[1])
    if hidden.any():
        switch, bracket = _joined((switch, bracket), _split(functions, hidden, phi))
    if not len(switch):
        return Visits(np.empty(0), switch, np.empty(0, dtype=bool), inside[:, 0])
    roots = zeros(functions[switch], bracket)
    # they alternate: the first of a switch enters unless the motion starts inside
    number = np.arange(len(switch)) - np.searchsorted(switch, switch)
    return Visits(roots, switch, (number % 2 == 0) != inside[switch, 0], inside[:, 0])


def _hidden(
    depths: NDArray[np.float64],
    speeds: NDArray[np.float64],
    inside: NDArray[np.bool_],
    changes: NDArray[np.bool_],
    width: float,
) -> NDArray[np.bool_]:
    """Cells in which a deflection may reach its breakpoint and return; all of shape (switches, cells)."""
    towards = inside == (speeds < 0.0)
    # where a cell holds an extremum and is so near to the breakpoint that the slopes may lead there
    turns = towards[:, :-1] & ~towards[:, 1:] & ~changes
    size, speed = np.abs(depths), np.abs(speeds)
    distance = np.minimum(size[:, 1:], size[:, :-1])
    return turns & (distance < width * np.maximum(speed[:, 1:], speed[:, :-1]))


Found = tuple[NDArray[np.intp], Bracket]
"""Switches and the brackets of their crossings."""


def _split(functions: NDArray[np.complex128], hidden: NDArray[np.bool_], phi: NDArray[np.float64]) -> Found:
    """The brackets on either side of those extremes that do pass the breakpoint."""
    switch, cell = np.nonzero(hidden)
    moving, low, high = functions[switch], phi[cell], phi[cell + 1]
    speeds = differentiated(moving)
    middle = zeros(speeds, Bracket(low, high, _values(speeds, low), _values(speeds, high)))
    starts, turns, ends = (_values(moving, where) for where in (low, middle, high))
    through = (starts > 0.0) != (turns > 0.0)
    halves = Bracket(low, middle, starts, turns), Bracket(middle, high, turns, ends)
    first, second = ((switch[through], Bracket(*(side[through] for side in half))) for half in halves)
    return _joined(first, second)


def _values(functions: NDArray[np.complex128], phi: NDArray[np.float64]) -> NDArray[np.float64]:
    """Values at one angle for each function."""
    return (functions * waves(phi, functions.shape[-1] - 1)).sum(axis=1).real


def _joined(first: Found, second: Found) -> Found:
    """The brackets of both, by switch and angle."""
    switch = np.concatenate((first[0], second[0]))
    sides = [np.concatenate(pair) for pair in zip(first[1], second[1], strict=True)]
    order = np.lexsort((sides[0], switch))
    return switch[order], Bracket(*(side[order] for side in sides))

"""Where a motion is relative to the breakpoints of all stages, in plain numbers.

These are read at every event of a motion, of which there are thousands in a walk: a few numbers of a list are several
times faster than arrays.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gapwalk.flow.equations import Equations

_CLOSE = 1e-6  # relative distance of two breakpoints of a contact within which they may coincide by rounding


class BreakpointGeometry:
    """Geometry of the breakpoints of one compiled integrator.

    Shapes: `signs` (count,).

    Attributes
    ----------
    signs : shape (count,)
        Side of each switch: 1 or -1.
    """

    _state: Any
    _parameters: Any
    _coefficients: NDArray[np.float64]

    def __init__(self, equations: Equations) -> None:
        self.equations = equations
        layout = equations.layout
        contacts = [layout.contacts[k] for k, _ in equations.switches]
        stages = [layout.contacts[k].stages[j] for k, j in equations.switches]
        self.n, self.size = layout.structure.size, layout.structure.state_size
        self.count = len(stages)
        self.signs = np.array([stage.sign for stage in stages], dtype=float)
        self._breaks = np.array([stage.clearance for stage in stages], dtype=np.intp)
        self._deflections = np.array([contact.deflection for contact in contacts]).reshape(self.count, self.n)
        self._signs = self.signs.tolist()
        self._sways = [contact.sway for contact in contacts]
        self._swaying = [switch for switch, sway in enumerate(self._sways) if sway is not None]
        moving = [sway for sway in self._sways if sway is not None]
        self._geometry = np.concatenate((self._deflections.ravel(), self._breaks, *moving))
        self._orders = np.array(layout.orders, dtype=float)
        self._known, self._weights = b"", equations.first_weight

    def _read_geometry(self, coefficients: NDArray) -> None:
        """Read deflection vectors and breakpoints as plain numbers, only when they have changed."""
        known = coefficients[self._geometry].tobytes()
        if known == self._known:
            return
        self._known = known
        self._vectors = coefficients[self._deflections]
        self._offsets = (self.signs * coefficients[self._breaks]).tolist()
        self._scales = [1.0 + abs(offset) for offset in self._offsets]
        self._scale = max(self._scales)
        weights = [min(1.0, 1.0 / abs(offset)) if offset else 1.0 for offset in self._offsets]
        self._parameters[self._weights : self._weights + self.count] = weights
        self._rows = [tuple((int(i), float(vector[i])) for i in np.flatnonzero(vector)) for vector in self._vectors]
        self._simultaneous = [self._possibly_simultaneous(switch) for switch in range(self.count)]
        # deflections of one coordinate each, the usual case, are compared with their breakpoints fastest
        plain = not self._swaying and all(len(row) == 1 for row in self._rows)
        rows = zip(self._signs, self._rows, self._offsets, strict=True)
        self._plain = [(*row[0], sign, offset) for sign, row, offset in rows] if plain else None
        self._rate_rows = [tuple((self.n + i, factor) for i, factor in row) for row in self._rows]
        self._lines = [None if sway is None else coefficients[sway] for sway in self._sways]

    def _sway(self, switch: int, theta: float, derivative: int = 0) -> float:
        """Return the displacement that is added to the deflection of a switch, or a derivative of it by theta."""
        lines, count = self._lines[switch], len(self._orders)
        if lines is None:
            return 0.0
        angles = self._orders * theta + 0.5 * math.pi * derivative
        powers = self._orders**derivative
        return float(lines[:count] @ (powers * np.cos(angles)) + lines[count:] @ (powers * np.sin(angles)))

    def _possibly_simultaneous(self, switch: int) -> tuple[int, ...]:
        """Return the switches that may change simultaneously: of other contacts, and of breakpoints close by."""
        contact, offset = self.equations.switches[switch][0], self._offsets[switch]
        others = enumerate(zip(self.equations.switches, self._offsets, strict=True))
        return tuple(
            other
            for other, ((k, _), place) in others
            if other != switch and (k != contact or abs(place - offset) <= _CLOSE * self._scales[switch])
        )

    def _depths(self, positions: list[float], theta: float) -> list[float]:
        """Return the penetration of each stage (> 0), or the distance from it (< 0)."""
        if self._plain is not None:
            return [sign * (factor * positions[i] - offset) for i, factor, sign, offset in self._plain]
        depths = [
            sign * (sum([factor * positions[i] for i, factor in row]) - offset)
            for sign, row, offset in zip(self._signs, self._rows, self._offsets, strict=True)
        ]
        for switch in self._swaying:
            depths[switch] += self._signs[switch] * self._sway(switch, theta)
        return depths

    def _are_near(self, depths: list[float], state: list[float], share: float) -> list[bool]:
        """Return which breakpoints the motion is on, within a share of the size of the motion and the breakpoint."""
        size = self._size(state)
        return [abs(depth) <= share * (scale + size) for depth, scale in zip(depths, self._scales, strict=True)]

    def _size(self, state: list[float]) -> float:
        """Return the size of the motion: of its positions, now or a quarter of a period later."""
        return max(*map(abs, state[: self.n]), float(self._coefficients[0]) * max(map(abs, state[self.n :])))

    def _rate(self, switch: int, theta: float) -> float:
        """Return the rate of the deflection of a switch over time."""
        rate = 0.0
        for i, factor in self._rate_rows[switch]:
            rate += factor * self._state.item(i)
        if self._lines[switch] is not None:
            rate += self._sway(switch, theta, 1) / float(self._coefficients[0])
        return rate

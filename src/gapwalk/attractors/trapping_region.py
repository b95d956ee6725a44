"""The trapping region of a stable orbit: states from which the motion is known to converge to the orbit.

So a motion need not be followed until it has reached the orbit. The linearised return map A of a stable orbit has a
norm in which it is a contraction, ``|x|^2 = x' P x`` with ``A' P A / g^2 - P + I = 0`` for any g above the largest
multiplier (Lyapunov's equation). The ellipsoids of that norm are tested from large to small on the exact flow. The
trapping region is the first one for which random points of its surface, and of smaller ones inside, all return to a
smaller ellipsoid. The return map is one-to-one and continuous, so points inside the surface stay inside.

Method: docs/numerics/basins.md
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from gapwalk.attractors.strobe import Strobe, size_of
from gapwalk.errors import FlowError
from gapwalk.orbit.orbit import Orbit

_POINTS = 48  # points on each surface
_SHELLS = np.array([1.0, 0.5, 0.25])
_LARGEST, _SMALLEST = 0.5, 1e-5  # half the size of a trapping region, relative to that of the motion
_SEED = 1995
_NEUTRAL = 1e-9  # distance of a multiplier from the unit circle below which the linear map decides nothing


@dataclass(frozen=True, eq=False)
class TrappingRegion:
    """Ellipsoids about the m strobes of a stable orbit.

    Attributes
    ----------
    strobes : shape (m, 2n)
        The states of the orbit, one forcing period apart.
    shapes : shape (m, 2n, 2n)
        A state x is inside the ellipsoid about strobe j where ``|shapes[j] @ (x - strobes[j])| <= 1``.
    """

    strobes: NDArray[np.float64]
    shapes: NDArray[np.float64]

    def holds(self, states: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Mark the states that are inside, shape (count,); states that are not finite are outside."""
        inside = np.zeros(len(states), dtype=bool)
        for strobe, shape in zip(self.strobes, self.shapes, strict=True):
            with np.errstate(over="ignore", invalid="ignore"):  # motions that diverge
                inside |= np.square((states - strobe) @ shape.T).sum(axis=1) <= 1.0
        return inside


def trapping_region_of(orbit: Orbit) -> TrappingRegion | None:
    """Build the trapping region of an orbit; None if it is not stable, or so weakly that no useful region was found."""
    if np.abs(orbit.multipliers).max() >= 1.0 - _NEUTRAL:
        return None
    builder = _Builder(orbit)
    first = builder.first_shape()
    if first is None:
        return None
    shapes = [first]
    for phase in range(1, orbit.period):
        shape = builder.shape_before(phase, first)
        if shape is None:
            return None
        shapes.append(shape)
    return TrappingRegion(builder.strobes, np.array(shapes))


class _Builder:
    """Finds the ellipsoids of one orbit."""

    def __init__(self, orbit: Orbit) -> None:
        self.period = orbit.period
        self.flow = Strobe(orbit.system)
        with_matrix = Strobe(orbit.system, transition=True)
        strobes, matrices = [orbit.state], []
        for _ in range(orbit.period):
            arc = with_matrix.arc(strobes[-1])
            assert arc.transition is not None
            matrices.append(arc.transition)
            strobes.append(arc.state)
        self.strobes = np.array(strobes[:-1])
        self.matrices = matrices
        self.scale = size_of(orbit.system, self.strobes)
        self.rate = 0.5 * (1.0 + float(np.abs(orbit.multipliers).max()))
        random = np.random.default_rng(_SEED)
        directions = random.normal(size=(_POINTS, len(orbit.state)))
        self.directions = directions / np.linalg.norm(directions, axis=1)[:, None]

    def first_shape(self) -> NDArray[np.float64] | None:
        """Return the largest ellipsoid about the first strobe that the return map contracts."""
        limit = 0.5 * (1.0 + self.rate)

        def shrinks(shape: NDArray[np.float64]) -> bool:
            return all(
                self._distance(shape, 0, state, self.period) <= limit * shell
                for shell, state in self._surfaces(shape, 0)
            )

        return self._largest(0, shrinks)

    def shape_before(self, phase: int, first: NDArray[np.float64]) -> NDArray[np.float64] | None:
        """Return the largest ellipsoid about another strobe from which all motions reach the one about the first."""

        def arrives(shape: NDArray[np.float64]) -> bool:
            rest = self.period - phase
            return all(self._distance(first, 0, state, rest) <= 1.0 for _, state in self._surfaces(shape, phase))

        return self._largest(phase, arrives)

    def _largest(self, phase: int, is_good) -> NDArray[np.float64] | None:
        """Return the largest accepted ellipsoid of the norm at a strobe; each is half as large as the one before."""
        root = self._root(phase)
        size = _LARGEST
        while size >= _SMALLEST:
            shape = root / size
            if is_good(shape):
                return shape
            size /= 2.0
        return None

    def _root(self, phase: int) -> NDArray[np.float64]:
        """Return a root of P, scaled so that the ellipsoid is as wide as the motion in its widest direction."""
        product = np.eye(len(self.scale))
        for step in range(self.period):
            product = self.matrices[(phase + step) % self.period] @ product
        scaled = product * self.scale / self.scale[:, None] / self.rate
        norm = scipy.linalg.solve_discrete_lyapunov(scaled.T, np.eye(len(self.scale)))
        values, vectors = np.linalg.eigh(norm)
        return np.sqrt(values / values[0])[:, None] * vectors.T / self.scale

    def _surfaces(self, shape: NDArray[np.float64], phase: int):
        """Yield points of an ellipsoid's surface and of smaller ones inside, largest first, with the relative size."""
        offsets = np.linalg.solve(shape, self.directions.T).T
        for shell in _SHELLS:
            for offset in offsets:
                yield shell, self.strobes[phase] + shell * offset

    def _distance(self, shape: NDArray[np.float64], phase: int, state: NDArray[np.float64], periods: int) -> float:
        try:
            end = self.flow.arc(state, periods).state
        except FlowError:
            return np.inf
        return float(np.linalg.norm(shape @ (end - self.strobes[phase])))

"""Reconstruction of the equation and the scales with which a branch was followed, from its points."""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import cache
from typing import cast

import numpy as np
from numpy.typing import NDArray

from gapwalk.bifurcation.branch import Branch
from gapwalk.bifurcation.special_point import SpecialPoint
from gapwalk.bifurcation.special_point_kind import Kind
from gapwalk.continuation.corrector import TRUST, Corrector
from gapwalk.continuation.point_on_branch import BranchPoint
from gapwalk.continuation.walk_scales import powers_of_two
from gapwalk.orbit.orbit import Orbit
from gapwalk.orbit.orbit_equation import OrbitEquation
from gapwalk.verification.verification import Spot

CROSSING = 1e-6
"""Regularity of a point below which branches cross there; near a fold it is 1e-4 or more."""

_ASIDE = 1e-7  # the longest Newton step after which a walk takes the multipliers of the point before it
_LOOSE = 10.0  # factor on the residual that a walk accepts: states elsewhere may be larger
_TOLD_APART = 2.0  # frequency by which the scales of velocities differ from those of lengths
_WAYS, _SEED = 3, 1995  # number of random directions of such a step, and their seed


def special_spot(name: str, number: int, special: SpecialPoint) -> Spot:
    """Return the place of a special point of a branch."""
    return Spot(name, f"special point {number} ({special.kind.value})", special.value)


class Track:
    """Correctors for a branch, one for each resolution of its points."""

    def __init__(self, name: str, branch: Branch) -> None:
        self.name, self.branch = name, branch
        self._knots = [*branch.points, *(special.point for special in branch.special_points)]
        self.is_exact = branch.points[0].orbit.is_exact
        self.corrector = cache(self._corrector)

    @property
    def segments(self) -> int:
        """Number of segments with which it was shot, if it was."""
        return max(1, (len(self.branch.points[0].x) - 1) // self.branch.system.state_size)

    def spots(self) -> Iterator[tuple[Spot, BranchPoint, Kind | None]]:
        """Yield all points and special points with their places, and the kinds of the latter."""
        for number, point in enumerate(self.branch.points):
            yield Spot(self.name, f"point {number}", point.value), point, None
        for number, special in enumerate(self.branch.special_points):
            yield special_spot(self.name, number, special), special.point, special.kind

    def corrector_at(self, point: BranchPoint) -> Corrector:
        """Return the corrector with the unknowns of a point."""
        return self.corrector(len(point.x))

    def asides(self, point: BranchPoint) -> list[NDArray[np.float64]]:
        """Return changes of a state that represent the distance to where a point's multipliers were evaluated."""
        size = self.branch.system.state_size
        ways = np.random.default_rng(_SEED).normal(size=(_WAYS, size))
        ways = np.vstack((ways / np.linalg.norm(ways, axis=1)[:, None], point.tangent[:size]))
        return [sign * _ASIDE * way * self.corrector_at(point).scales[:size] for way in ways for sign in (-1.0, 1.0)]

    def aside(self, point: BranchPoint) -> float:
        """Return the largest change of a position in such a step."""
        return _ASIDE * float(self.corrector_at(point).scales[: self.branch.system.size].max())

    def mismatch(self, point: BranchPoint) -> float:
        """Return the largest contradiction in the stored data of a point, relative to its size.

        Compared are the unknowns with the state or the lines, and the parameter with the system.
        """
        corrector = self.corrector_at(point)
        orbit, scales = point.orbit, corrector.scales
        known = self._determined(cast("OrbitEquation", corrector.equation), orbit)
        x = point.x[: len(known)] * scales[: len(known)]
        apart = float(np.abs(x - known).max()) / max(float(np.abs(known).max()), np.finfo(float).tiny)
        value = orbit.system[self.branch.parameter]
        width = abs(value) + float(scales[-1])
        return max(apart, abs(point.value - value) / width, abs(point.x[-1] * scales[-1] - value) / width)

    def regularity(self, point: BranchPoint) -> float:
        """Return 0 at a crossing of branches, where the derivatives lose rank, and up to 1 far from it."""
        corrector = self.corrector_at(point)
        evaluation = corrector.equation.evaluate(point.x[:-1] * corrector.scales[:-1], point.value)
        assert evaluation.by_parameter is not None
        derivatives = np.column_stack((evaluation.by_unknowns, evaluation.by_parameter)) * corrector.scales
        sizes = np.linalg.svd(derivatives, compute_uv=False)
        return float(sizes[-1] / sizes[0])

    def doubtful_residual(self, point: BranchPoint) -> float:
        """Return the stored residual of a point, in units of the largest that a walk accepts for its last step."""
        residual = point.orbit.residual
        if not residual >= 0.0:
            return math.inf
        if not self.is_exact:
            return 0.0 if math.isfinite(residual) else math.inf
        size = max(float(np.abs(point.orbit.state).max()), float(np.abs(point.orbit.extremes[:, :2]).max()))
        scales = self.corrector_at(point).scales[:-1]
        return residual / (_LOOSE * TRUST * max(size, min(1.0, float(scales.max()))))

    def _determined(self, equation: OrbitEquation, orbit: Orbit) -> NDArray[np.float64]:
        """Return the first unknowns of an orbit: all, or if it is exact its state, from which the others follow."""
        return orbit.determined if self.is_exact else equation.unknowns(orbit)

    def _corrector(self, count: int) -> Corrector:
        """Return the corrector for points with a number of scaled variables."""
        branch = self.branch
        fellows = [point for point in self._knots if len(point.x) == count]
        orbit = fellows[0].orbit
        equation = orbit.posed_in(count - 1).pose(branch.system, branch.parameter, branch.period)
        known = np.array([self._determined(equation, point.orbit) for point in fellows])
        x = np.array([point.x[: known.shape[1]] for point in fellows])
        units, scale = equation.scales(1.0, _TOLD_APART), np.empty(count - 1)
        for unit in np.unique(units):  # lengths have one scale, velocities another
            alike = units == unit
            part = alike[: known.shape[1]]
            scale[alike] = _ratio(known[:, part], x[:, part])
        values, labels = (np.array([[part(p)] for p in fellows]) for part in (lambda p: p.value, lambda p: p.x[-1]))
        return Corrector(equation, powers_of_two(np.append(scale, _ratio(values, labels))))


def _ratio(physical: NDArray[np.float64], scaled: NDArray[np.float64]) -> float:
    """Return the median scale of the points, so that a wrong one does not spoil the others."""
    sizes = np.abs(scaled).max(axis=1)
    ratios = np.abs(physical).max(axis=1)[sizes > 0.0] / sizes[sizes > 0.0]
    ratios = ratios[ratios > 0.0]
    return float(np.median(ratios)) if len(ratios) else 1.0

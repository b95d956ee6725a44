"""Space of Fourier lines, in which a branch followed by harmonic balance is a curve."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np
from numpy.typing import NDArray

from gapwalk.bifurcation.branch import Branch
from gapwalk.bifurcation.orbit_on_branch import Knot, StateSpace
from gapwalk.continuation.corrector import Corrector, powers_of_two
from gapwalk.continuation.curve_points import BranchPoint
from gapwalk.orbit.harmonic_balance import Balance
from gapwalk.orbit.harmonic_balance.balance_equation import BalanceEquation
from gapwalk.orbit.harmonic_balance.kernels import from_real_form, real_form
from gapwalk.orbit.harmonic_balance.linear_part import deflections_in
from gapwalk.orbit.orbit import Orbit

_ROUGH = 2.0  # largest distance of an exact motion from its balanced one, in truncation errors


class LineSpace(StateSpace):
    """Space of the Fourier lines of the contact deflections, with as many lines as the finest orbit of the branch."""

    def __init__(self, branch: Branch, points: Sequence[BranchPoint]) -> None:
        self._branch, self._width = branch, deflections_in(branch.system.structure)
        self._harmonics = max(point.orbit.harmonics for point in points)
        self._error = max(point.orbit.truncation for point in points)
        self._finest = self._equation(self._harmonics)
        self._unit, self._parameter_scale = self._units(points[0])
        self._correctors = cache(self._corrector)  # by their numbers of harmonics
        self.corrector = self._correctors(self._harmonics)
        self.scales, self.size = self.corrector.scales, len(self.corrector.scales) - 1

    def knot(self, point: BranchPoint) -> Knot:
        """See `StateSpace.knot`."""
        unit, parameter_scale = self._units(point)
        unknowns, tangent = self._finest.unknowns(point.orbit), self._resized(point.tangent[:-1], self._harmonics)
        x = np.append(unknowns / self._unit, point.value / self._parameter_scale)
        slope = np.append(tangent * unit / self._unit, point.tangent[-1] * parameter_scale / self._parameter_scale)
        return x, slope / np.linalg.norm(slope), point.arclength

    def places(self, orbit: Orbit) -> Sequence[NDArray[np.float64]]:
        """See `StateSpace.places`."""
        if self._branch.period % orbit.period:
            return []
        return [self._finest.unknowns(orbit), *self._finest.with_other_phases(orbit)]

    def goal(self, orbit: Orbit, place: NDArray[np.float64], value: float) -> NDArray[np.float64]:
        """See `StateSpace.goal`."""
        return np.append(place / self._unit, value)

    def correct(self, orbit: Orbit, guess: NDArray[np.float64], normal: NDArray[np.float64]) -> NDArray | None:
        """See `StateSpace.correct`."""
        # two balanced motions are the same only if they solve one equation
        harmonics = orbit.harmonics or self._harmonics
        start, across = (np.append(self._resized(x[:-1], harmonics), x[-1]) for x in (guess, normal))
        correction = self._correctors(harmonics).correct(start, across / np.linalg.norm(across))
        if correction is None:
            return None
        return np.append(self._resized(correction.x[:-1], self._harmonics), correction.x[-1])

    def tolerance(self, orbit: Orbit) -> float:
        """See `StateSpace.tolerance`."""
        return _ROUGH * self._error if orbit.is_exact else 0.0

    def _equation(self, harmonics: int) -> BalanceEquation:
        branch = self._branch
        return BalanceEquation(branch.system, branch.parameter, branch.period, Balance(harmonics), harmonics)

    def _corrector(self, harmonics: int) -> Corrector:
        equation = self._equation(harmonics)
        return Corrector(equation, np.append(np.full(len(equation.scales(1.0)), self._unit), self._parameter_scale))

    def _units(self, point: BranchPoint) -> tuple[float, float]:
        """Return the scales of the lines and of the parameter with which a point was followed."""
        lines = self._finest.unknowns(point.orbit)
        size = float(np.abs(point.x[:-1]).sum())
        parameter = point.value / float(point.x[-1]) if point.x[-1] else 1.0
        units = powers_of_two(np.array([float(np.abs(lines).sum()) / size if size else 1.0, abs(parameter)]))
        return float(units[0]), float(units[1])

    def _resized(self, unknowns: NDArray[np.float64], harmonics: int) -> NDArray[np.float64]:
        """Return the same lines, cut off or padded with zeros to a number of harmonics."""
        known = from_real_form(unknowns.reshape(self._width, -1))
        count = harmonics * self._branch.period
        lines = np.zeros((self._width, count + 1), dtype=complex)
        kept = min(count + 1, known.shape[1])
        lines[:, :kept] = known[:, :kept]
        return real_form(lines).ravel()

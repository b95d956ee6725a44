"""Orbits in the plane of two parameters by harmonic balance, from the Fourier lines of their contact deflections."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from gapwalk.bifurcation.kinds.critical_multipliers import Criticality, flip_coefficient, smallest_singular_value
from gapwalk.bifurcation.loci.locus_equations import STEP, OrbitPlane, Place, Turning
from gapwalk.bifurcation.special_point import Kind
from gapwalk.continuation.corrector import unknown_scales
from gapwalk.orbit.harmonic_balance.balance import Balance
from gapwalk.orbit.harmonic_balance.balance_equation import BalanceEquation, Evidence
from gapwalk.orbit.harmonic_balance.contact_forces import contact_forces_of
from gapwalk.orbit.harmonic_balance.kernels import from_real_form
from gapwalk.orbit.harmonic_balance.linear_part import deflections_in, waves
from gapwalk.orbit.harmonic_balance.monodromy import Linearised
from gapwalk.orbit.orbit import Orbit
from gapwalk.orbit.orbit_equation import Evaluation

_LEAST_ERROR = 1e-12  # smallest truncation error that may be required


@dataclass(frozen=True)
class BalancedPlane(OrbitPlane):
    """Equation of harmonic balance, ``x - x_free + G F(x) = 0``.

    Folds are those of that equation, where its Jacobian is singular, as on a branch by harmonic balance. Its second
    derivatives along the critical vector come from one difference of exact Jacobians, as in shooting. Flips and
    Neimark-Sacker points are those of the multipliers, again as on a branch. The derivatives of the monodromy matrix
    come from one difference per unknown, since one pass over the period costs no more than an evaluation.
    """

    options: Balance
    harmonics: int  #: H, the highest harmonic of the forcing frequency.

    def place(self, unknowns: NDArray[np.float64], *point: float) -> Place:
        """See `OrbitPlane.place`. Errors as in `BalanceEquation.evaluate`."""
        return self._place(unknowns, *self._parameters.coefficients(*point))

    def orbit(self, unknowns: NDArray[np.float64], first: float, second: float, evaluation: Evaluation) -> Orbit:
        """See `OrbitPlane.orbit`."""
        system = self._parameters.system_at(first, second)
        return self._equation.orbit_at(system, unknowns, evaluation._replace(evidence=evaluation.evidence.evidence))

    def unknowns(self, orbit: Orbit) -> NDArray[np.float64]:
        """Return the real forms of the deflections."""
        return self._equation.unknowns(orbit)

    def scales(self, orbit: Orbit) -> NDArray[np.float64]:
        """See `OrbitPlane.scales`."""
        return unknown_scales(self._equation, orbit)

    def criticality(self, kind: Kind, place: Place, scales: NDArray[np.float64]) -> Criticality:
        """See `OrbitPlane.criticality`; from the Jacobian at folds, from the monodromy matrix otherwise."""
        if kind is Kind.FOLD:
            return smallest_singular_value(place.jacobian[:, : len(place.unknowns)])
        return kind.condition(self._monodromy(place.evidence))

    def gradient(
        self, kind: Kind, critical: Criticality, place: Place, scales: NDArray[np.float64], step: float | None = None
    ) -> NDArray[np.float64]:
        """See `OrbitPlane.gradient`."""
        size, length = len(place.unknowns), step or STEP
        ends, width = ((0.0, 1.0), length) if step is None else ((-1.0, 1.0), 2.0 * length)
        if kind is Kind.FOLD:
            shift = length * float(scales[0]) * critical.directions[0]
            places = [self._place(place.unknowns + end * shift, place.coefficients, place.slopes) for end in ends]
            return critical.covectors[0] @ (places[1].jacobian - places[0].jacobian) / (width * float(scales[0]))
        linearised = self._equation.linearised(place.evidence)
        matrix, by_all = self._monodromy(place.evidence, linearised), np.empty(size + len(self.names))

        def monodromy(index: int, shift: float) -> NDArray[np.float64]:
            if not shift:
                return matrix
            return self._monodromy(self._beside(place, index, shift), linearised if index < size else None)

        for index, scale in enumerate(scales.tolist()):
            before, after = (monodromy(index, end * length * scale) for end in ends)
            by_all[index] = np.einsum("ja,ab,jb->", critical.covectors, after - before, critical.directions) / scale
        return by_all / width

    def turning(self, switch: int, place: Place, theta: float) -> Turning:
        """See `OrbitPlane.turning`; the rate is over theta."""
        evidence: Evidence = place.evidence
        contact, sign = int(evidence.laws.contact[switch]), float(evidence.laws.sign[switch])
        lines, rate = evidence.lines[contact], 1j / self.period * np.arange(evidence.lines.shape[1])
        wave = waves(np.array(theta / self.period), len(lines) - 1)
        size, width = len(place.unknowns), 2 * len(lines) - 1
        values, derivatives = np.empty(2), np.zeros((2, size + 1 + len(self.names)))
        for row, factor in enumerate((wave, rate * wave)):  # the deflection, and its derivative by theta
            values[row] = sign * float((lines @ factor).real)
            derivatives[row, contact * width : (contact + 1) * width] = sign * np.append(factor.real, factor.imag[1:])
            derivatives[row, size] = sign * float((lines @ (rate * factor)).real)
        clearances = [stage.clearance for slots in self._layout.contacts for stage in slots.stages]
        values[0] -= place.coefficients[clearances[switch]]
        derivatives[0, size + 1 :] -= place.slopes[:, clearances[switch]]
        return values, derivatives

    def flip_coefficient(self, place: Place, scales: NDArray[np.float64]) -> float:
        """See `OrbitPlane.flip_coefficient`; it is that of the doubled equation, whose flip is near the motion's."""
        twice, shared = self._doubled, self._doubled.shared()
        start = np.zeros(len(shared))
        start[shared] = place.unknowns

        def jacobian(unknowns: NDArray[np.float64]):
            evaluation = twice._equation.evaluate_at(unknowns, place.coefficients, None)
            return evaluation.by_unknowns, list(twice._equation.events(evaluation.evidence))

        here = jacobian(start)
        other = np.flatnonzero(~shared)
        block = smallest_singular_value(here[0][np.ix_(other, other)])
        right, left = np.zeros((2, len(start)))
        right[other], left[other] = block.directions[0], block.covectors[0]
        response = np.eye(len(start))
        response[np.ix_(shared, shared)] = -here[0][np.ix_(shared, shared)]
        units = np.full(len(start), scales[0])
        return flip_coefficient(jacobian, here, start, units, (right, left), response).value

    def shared(self) -> NDArray[np.bool_]:
        """Return a mask of the lines with even numbers."""
        count = self._equation.count
        k = np.append(np.arange(count + 1), np.arange(1, count + 1))
        return np.tile(k % 2 == 0, deflections_in(self.system.structure))

    def mean_of_halves(self, orbit: Orbit) -> NDArray[np.float64]:
        """See `OrbitPlane.mean_of_halves`: a shift by half a period reverses the odd lines."""
        return self.unknowns(orbit)[self.shared()]

    def inaccuracy(self, orbit: Orbit, share: float = 1.0) -> str:
        """See `OrbitPlane.inaccuracy`."""
        if share == 1.0:
            return self._equation.inaccuracy(orbit)
        stricter = replace(self.options, error=max(_LEAST_ERROR, share * self.options.error))
        return replace(self._equation, options=stricter).inaccuracy(orbit)

    def finer(self) -> BalancedPlane | None:
        """See `OrbitPlane.finer`."""
        finer = self._equation.finer()
        return None if finer is None else replace(self, harmonics=finer.harmonics)

    def _place(
        self, unknowns: NDArray[np.float64], coefficients: NDArray[np.float64], slopes: NDArray[np.float64]
    ) -> Place:
        found = [self._equation.evaluate_at(unknowns, coefficients, slope) for slope in slopes]
        columns = [each.by_parameter for each in found if each.by_parameter is not None]
        jacobian = np.column_stack((found[0].by_unknowns, *columns))
        return Place(unknowns, coefficients, slopes, found[0].residual, jacobian, found[0].evidence)

    def _beside(self, place: Place, index: int, step: float) -> Evidence:
        """Return the evidence of the motion with one unknown or parameter, given by its index, larger by a step."""
        evidence: Evidence = place.evidence
        lines, laws, coefficients = evidence.lines, evidence.laws, place.coefficients
        size = len(place.unknowns)
        if index < size:
            unknowns = place.unknowns.copy()
            unknowns[index] += step
            lines = from_real_form(unknowns.reshape(len(lines), -1))
        else:
            coefficients = coefficients + step * place.slopes[index - size]
            laws = self._equation.laws(coefficients)
        return evidence._replace(
            coefficients=coefficients, lines=lines, laws=laws, forces=contact_forces_of(lines, laws, self.period)
        )

    def _monodromy(self, evidence: Evidence, linearised: Linearised | None = None) -> NDArray[np.float64]:
        """Return the monodromy matrix of positions and momenta, with velocities in units of the frequency."""
        matrix = self._equation.monodromy(evidence, linearised)
        units = self.system.state_scales(1.0, 1.0 / float(evidence.coefficients[0]))
        if len(matrix) != len(units):
            return matrix
        return matrix * units / units[:, None]

    @cached_property
    def _equation(self) -> BalanceEquation:
        return BalanceEquation(self.system, None, self.period, self.options, self.harmonics, self.names)

    @cached_property
    def _doubled(self) -> BalancedPlane:
        return replace(self, period=2 * self.period)

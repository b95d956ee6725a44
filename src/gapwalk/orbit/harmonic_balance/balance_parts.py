"""The parts of a system as harmonic balance needs them, and what of them stays the same along a parameter."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from gapwalk.model.coefficients import CoefficientLayout, ParameterLine, coefficients_of, layout_of, period_of
from gapwalk.model.system import System
from gapwalk.orbit.harmonic_balance.compliance import DirectCompliance, Lines, PoleCompliance, pole_compliance
from gapwalk.orbit.harmonic_balance.laws import Laws, laws_of
from gapwalk.orbit.harmonic_balance.linear_part import Linear, linear_of
from gapwalk.orbit.harmonic_balance.linearised import Linearised
from gapwalk.orbit.harmonic_balance.poles import Poles, poles_of

_LOOSE = 1e10  # condition of the stiffness beyond which only contacts hold the system in place
_SHARE = 0.5  # share of a contact's stiffness that is then counted as part of the linear system


@dataclass(frozen=True)
class Parts:
    """The linear part and the contact laws of a system along a parameter, for motions of K lines.

    Parameters
    ----------
    system, parameter, period
        As of the equation.
    count
        K.
    others
        Names of other parameters that may vary.
    """

    system: System
    parameter: str | None
    period: int
    count: int
    others: tuple[str, ...] = ()

    @cached_property
    def layout(self) -> CoefficientLayout:
        """Where the coefficients stand."""
        return layout_of(self.system.structure)

    @cached_property
    def line(self) -> ParameterLine:
        """The systems along the parameter."""
        return ParameterLine(self.system, self.parameter or self._pace)

    def coefficients(self, value: float) -> tuple[NDArray[np.float64], NDArray[np.float64] | None]:
        """The coefficients at a value of the parameter, and their derivatives."""
        if self.parameter is None:
            return coefficients_of(self.system), None
        if self.parameter == self._pace:  # the first coefficient is all that changes, and all that is asked for
            first, slope = period_of(self.system, value)
            return np.array([first]), np.array([slope])
        return self.line.coefficients(value)

    def compliance(
        self, coefficients: NDArray[np.float64], slope: NDArray[np.float64] | None
    ) -> PoleCompliance | DirectCompliance:
        """The linear part on the lines of the motion."""
        frequencies = self.orders[: self.count + 1] / coefficients[0]
        slopes = frequencies * (0.0 if slope is None else -slope[0] / coefficients[0])
        lines = Lines(frequencies, slopes, self._load_lines)
        if self.poles is not None:
            return pole_compliance(self.poles, lines)
        if self._fixed is not None:
            return DirectCompliance(self._fixed, None, lines, self.shift)
        change = None if slope is None else linear_of(self.layout, slope)
        return DirectCompliance(linear_of(self.layout, coefficients), change, lines, self.shift)

    def laws(self, coefficients: NDArray[np.float64], slope: NDArray[np.float64] | None) -> Laws:
        """The contact laws and their derivatives."""
        return laws_of(self.layout, coefficients, slope) if self._fixed_laws is None else self._fixed_laws

    def linearised(self, coefficients: NDArray[np.float64], laws: Laws) -> Linearised:
        """The linearised equations."""
        if self._fixed_linearised is not None:
            return self._fixed_linearised
        return Linearised(self._fixed or linear_of(self.layout, coefficients), laws)

    @cached_property
    def poles(self) -> Poles | None:
        """The eigenvalues of a linear part that does not change; None if it does, or has too few eigenvectors."""
        return None if self._fixed is None else poles_of(self._fixed, self.shift)

    @cached_property
    def shift(self) -> NDArray[np.float64]:
        """Stiffness of each contact that counts as part of the linear system; zero where that stands by itself."""
        coefficients = coefficients_of(self.system)
        if np.linalg.cond(linear_of(self.layout, coefficients).stiffness, 1) < _LOOSE:
            return np.zeros(len(self.layout.contacts))
        laws = laws_of(self.layout, coefficients)
        springs, count = np.abs(laws.spring[:, 1]), len(self.layout.contacts)
        total, number = np.bincount(laws.contact, springs, count), np.bincount(laws.contact, springs > 0.0, count)
        return _SHARE * total / np.maximum(number, 1.0)

    @property
    def _pace(self) -> str:
        return self.system.structure.pace

    @cached_property
    def _fixed(self) -> Linear | None:
        """The linear part, where it does not change with any parameter."""
        for name in self._varying:
            slope = ParameterLine(self.system, name).coefficients(self.system[name])[1]
            if not linear_of(self.layout, slope).is_zero:
                return None
        return linear_of(self.layout, coefficients_of(self.system))

    @cached_property
    def _fixed_laws(self) -> Laws | None:
        """The laws, where no parameter touches them."""
        return None if self._varying else laws_of(self.layout, coefficients_of(self.system))

    @property
    def _varying(self) -> tuple[str, ...]:
        """The parameters that may change the matrices or the laws."""
        return tuple(name for name in (self.parameter, *self.others) if name not in (None, self._pace))

    @cached_property
    def _fixed_linearised(self) -> Linearised | None:
        if self._fixed is None or self._fixed_laws is None:
            return None
        return Linearised(self._fixed, self._fixed_laws)

    @cached_property
    def orders(self) -> NDArray[np.float64]:
        """Lines from 0 to 2K in multiples of the forcing frequency: what lies beyond K measures what is neglected."""
        return np.arange(2 * self.count + 1) / self.period

    @cached_property
    def _load_lines(self) -> NDArray[np.intp]:
        return np.array([0, *self.layout.orders], dtype=np.intp) * self.period

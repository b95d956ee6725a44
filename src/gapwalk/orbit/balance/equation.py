"""Harmonic balance: a periodic orbit as the Fourier lines of its contact deflections."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.errors import ModelError
from gapwalk.model.coefficients import CoefficientLayout, ParameterLine, coefficients_of, layout_of
from gapwalk.model.system import System
from gapwalk.motion.motion import integrate
from gapwalk.motion.switching import ContactEvent
from gapwalk.orbit.balance.compliance import DirectCompliance, Lines, PoleCompliance, Poles, poles_of
from gapwalk.orbit.balance.force import Forces, contact_forces_of
from gapwalk.orbit.balance.hill import projected_monodromy
from gapwalk.orbit.balance.laws import Laws, laws_of
from gapwalk.orbit.balance.linear import linear_of
from gapwalk.orbit.balance.linearised import Linearised
from gapwalk.orbit.balance.lines import differentiated, from_real_form, multiplication, real_form, waves
from gapwalk.orbit.balance.options import Balance
from gapwalk.orbit.balance.orbit import BalancedOrbit
from gapwalk.orbit.balance.series import Series
from gapwalk.orbit.balance.variational import monodromy
from gapwalk.orbit.equation import Evaluation
from gapwalk.orbit.floquet import multipliers
from gapwalk.orbit.orbit import Orbit

_MOST = 1000  # harmonics beyond which an automatic choice gives up
_SHARE = 0.5  # share of a contact's stiffness that is counted as part of the linear system


class Evidence(NamedTuple):
    """What an evaluation knows of the motion: its lines, the linear part, the forces, and their sum.

    Attributes
    ----------
    coefficients
        Of the flow.
    lines, total : shape (contacts, K + 1)
        Of the deflections, and of the contact forces less the linear shares.
    tangent : shape (contacts, K + 1, 2K + 1)
        Derivative of the total of each contact by the real form of its deflection.
    compliance, laws, forces
        The parts.
    """

    coefficients: NDArray[np.float64]
    lines: NDArray[np.complex128]
    total: NDArray[np.complex128]
    tangent: NDArray[np.complex128]
    compliance: PoleCompliance | DirectCompliance
    laws: Laws
    forces: Forces


@dataclass(frozen=True)
class BalanceEquation:
    """``x - x_free + G F(x) = 0`` in each harmonic: x the contact deflections, F their forces, G their flexibility.

    The unknowns are the real forms of the deflections, one contact after the other: 2K + 1 numbers each, with
    ``K = H m`` lines. All other coordinates are eliminated exactly.

    Parameters
    ----------
    system
        The system.
    parameter
        The named parameter to follow, or None.
    period
        m, forcing periods.
    options
        How to balance.
    harmonics
        H, the highest harmonic of the forcing frequency.
    """

    system: System
    parameter: str | None = None
    period: int = 1
    options: Balance = Balance()
    harmonics: int = 10

    def __post_init__(self) -> None:
        if isinstance(self.period, bool) or not isinstance(self.period, int) or self.period < 1:
            raise ModelError(f"period is {self.period!r}; it must be an integer >= 1 (forcing periods of the orbit)")
        if self.parameter is not None:
            self.system.structure.place(self.parameter)
        if not self.system.structure.contacts:
            raise ModelError("the system has no contact; harmonic balance solves for the deflections of contacts")
        highest = max(self._layout.orders, default=1)
        if self.harmonics < highest:
            raise ModelError(
                f"harmonics is {self.harmonics}, but the excitation has order {highest}; write harmonics = {highest} "
                "or more"
            )

    @property
    def tolerance(self) -> float:
        """Largest residual of an orbit, relative to the size of its lines."""
        return self.options.tolerance

    @property
    def count(self) -> int:
        """K, the number of lines."""
        return self.harmonics * self.period

    def evaluate(self, unknowns: NDArray[np.float64], value: float) -> Evaluation:
        """Residual and derivatives; see `Equation.evaluate`.

        Raises
        ------
        NumericalError
            If the linear part is singular at one of the lines.
        """
        coefficients, slope = self._coefficients(value)
        contacts, count = len(self._layout.contacts), self.count
        lines = from_real_form(unknowns.reshape(contacts, -1))
        compliance = self._compliance(coefficients, slope)
        laws = self._laws(coefficients, slope)
        forces = contact_forces_of(lines, laws)
        iw = 1j * compliance.lines.frequencies[: count + 1]
        total = forces.spring[:, : count + 1] - self._shift[:, None] * lines + iw * forces.damper[:, : count + 1]
        tangents = forces.tangents if laws.damped else forces.tangents[:1]
        tangent, *damping = multiplication(tangents)
        if damping:
            tangent += iw[:, None] * damping[0]
        tangent -= self._share
        flexibility = compliance.flexibility[: count + 1]
        residual = lines.T - compliance.free[: count + 1] + (flexibility @ total.T[:, :, None])[:, :, 0]
        evidence = Evidence(coefficients, lines, total, tangent, compliance, laws, forces)
        jacobian = _real_rows(flexibility, tangent)
        jacobian.flat[:: len(jacobian) + 1] += 1.0
        by_parameter = None
        if slope is not None:
            change = forces.spring_slope + iw * forces.damper_slope
            change += 1j * compliance.lines.slopes[: count + 1] * forces.damper[:, : count + 1]
            by_parameter = -real_form(compliance.slope(total.T, change.T).T).ravel()
        return Evaluation(real_form(residual.T).ravel(), jacobian, by_parameter, evidence)

    def orbit(self, unknowns: NDArray[np.float64], value: float, evaluation: Evaluation) -> BalancedOrbit:
        """The orbit of a solution."""
        evidence: Evidence = evaluation.evidence
        system = self.system if self.parameter is None else self._line.system_at(value)
        # the unknowns may be one Newton step past the evaluation
        real = unknowns.reshape(len(evidence.lines), -1)
        step = (evidence.tangent @ (real - real_form(evidence.lines))[:, :, None])[:, :, 0]
        series = Series(evidence.compliance.motion((evidence.total + step).T).T, self.period, system.frequency)
        return BalancedOrbit(
            system,
            self.period,
            series.states(np.zeros(1))[0],
            multipliers([self._monodromy(evidence)]),
            self._events(evidence),
            float(np.abs(evaluation.residual).max()),
            2 * self.count,
            series,
            Series(from_real_form(real), self.period, system.frequency),
            self._truncation(evidence),
        )

    def unknowns(self, orbit: Orbit) -> NDArray[np.float64]:
        """The real forms of the deflections of an orbit that was found in whatever way."""
        n, count = self.system.size, self.count
        vectors = linear_of(self._layout, coefficients_of(orbit.system)).deflections
        if isinstance(orbit, BalancedOrbit):
            series, stride = orbit.series, self.period // orbit.series.period
            kept = min(series.lines.shape[1], count // stride + 1)
            lines = np.zeros((n, count + 1), dtype=complex)
            lines[:, : (kept - 1) * stride + 1 : stride] = series.lines[:, :kept]
        else:
            samples = max(orbit.samples, 1 << (16 * self.harmonics - 1).bit_length())
            return self._from_positions(orbit.motion(samples).q)
        return real_form(vectors.astype(complex) @ lines).ravel()

    def _from_positions(self, q: NDArray[np.float64]) -> NDArray[np.float64]:
        """The unknowns of a motion sampled evenly over its period, both ends included, shape (samples, n)."""
        lines = 2.0 * np.fft.rfft(q[:-1], axis=0).T[:, : self.count + 1] / (len(q) - 1)
        lines[:, 0] *= 0.5
        return real_form(linear_of(self._layout, coefficients_of(self.system)).deflections @ lines).ravel()

    def scales(self, length: float) -> NDArray[np.float64]:
        """How much of each unknown counts as one length."""
        contacts = len(self._layout.contacts)
        return np.full(contacts * (2 * self.count + 1), length * np.sqrt(contacts))

    def doubt(self, orbit: Orbit) -> str:
        """Why a solution is no motion that can be trusted, and what to change; empty if it is one."""
        if not isinstance(orbit, BalancedOrbit) or orbit.truncation <= self.options.error:
            return ""
        return (
            f"the harmonics beyond H = {self.harmonics} amount to {orbit.truncation:.2g} of the motion, and error = "
            f"{self.options.error:g} is allowed; write Balance(harmonics={2 * self.harmonics}) or more, or "
            "Balance(harmonics=None) for as many as it takes, or allow a larger error"
        )

    def finer(self) -> BalanceEquation | None:
        """The same with half as many harmonics again, if their number is left open."""
        more = self.harmonics + max(2, self.harmonics // 2)
        if self.options.harmonics is not None or more > _MOST:
            return None
        return replace(self, harmonics=more)

    def start(self, state: NDArray[np.float64]) -> NDArray[np.float64]:
        """The lines of the motion from a state over the orbit's period; of no motion at all for the state zero."""
        if not state.any():  # a system of a thousand degrees of freedom has no flow
            return np.zeros(len(self._layout.contacts) * (2 * self.count + 1))
        samples = 1 << (16 * self.harmonics - 1).bit_length()
        return self._from_positions(integrate(self.system, state, self.period, samples).q)

    def _monodromy(self, evidence: Evidence) -> NDArray[np.float64]:
        length = 2.0 * np.pi / float(evidence.compliance.lines.frequencies[1])
        linearised, forces = self._linearised(evidence), evidence.forces
        if self.options.stability == "hill":
            return projected_monodromy(linearised, forces.tangents.reshape(-1, 2 * self.count + 1), length)
        return monodromy(linearised, evidence.lines, forces.visits.phi, length)

    def _linearised(self, evidence: Evidence) -> Linearised:
        if self._fixed is None or evidence.laws is not self._fixed_laws:
            return Linearised(linear_of(self._layout, evidence.coefficients), evidence.laws)
        return self._fixed_linearised

    @cached_property
    def _fixed_linearised(self) -> Linearised:
        assert self._fixed_laws is not None
        return Linearised(linear_of(self._layout, coefficients_of(self.system)), self._fixed_laws)

    def _truncation(self, evidence: Evidence) -> float:
        """Amplitudes in the lines from K + 1 to 2K, relative to those up to K."""
        count, forces = self.count, evidence.forces
        iw = 1j * evidence.compliance.lines.frequencies[count + 1 :]
        total = forces.spring[:, count + 1 :] + iw * forces.damper[:, count + 1 :]
        neglected = (evidence.compliance.flexibility[count + 1 :] @ total.T[:, :, None])[:, :, 0]
        kept = np.abs(evidence.lines[:, 1:]).sum(axis=1).max()
        return float(np.abs(neglected).sum(axis=0).max() / kept) if kept > 0.0 else 0.0

    def _events(self, evidence: Evidence) -> tuple[ContactEvent, ...]:
        visits, lines = evidence.forces.visits, evidence.lines
        if not len(visits.phi):
            return ()
        rates = differentiated(lines)[evidence.laws.contact[visits.switch]]
        speeds = (rates * waves(visits.phi, lines.shape[1] - 1)).sum(axis=1).real
        speeds *= evidence.compliance.lines.frequencies[1]
        order = np.argsort(visits.phi, kind="stable")
        rows = (self.period * visits.phi, visits.switch, visits.enters, speeds)
        return tuple(ContactEvent(*event) for event in zip(*(row[order].tolist() for row in rows), strict=True))

    def _compliance(
        self, coefficients: NDArray[np.float64], slope: NDArray[np.float64] | None
    ) -> PoleCompliance | DirectCompliance:
        """The linear part on all lines, and on as many beyond, which measure what is neglected."""
        frequencies = self._orders / coefficients[0]
        slopes = frequencies * (0.0 if slope is None else -slope[0] / coefficients[0])
        lines = Lines(frequencies, slopes, self._load_lines)
        if self._fixed is not None:
            return PoleCompliance(self._fixed, lines)
        change = None if slope is None else linear_of(self._layout, slope)
        return DirectCompliance(linear_of(self._layout, coefficients), change, lines, self._shift)

    @cached_property
    def _orders(self) -> NDArray[np.float64]:
        return np.arange(2 * self.count + 1) / self.period

    @cached_property
    def _share(self) -> NDArray[np.complex128]:
        """The linear shares of the contacts' stiffnesses as matrices from real forms to lines."""
        half = np.zeros((len(self._shift), 2 * self.count + 1), dtype=complex)
        half[:, 0] = self._shift
        return multiplication(half)

    @cached_property
    def _load_lines(self) -> NDArray[np.intp]:
        return np.array([0, *self._layout.orders], dtype=np.intp) * self.period

    @cached_property
    def _fixed(self) -> Poles | None:
        """The eigenvalues of the linear part, where it does not change with the parameter and has enough of them."""
        coefficients, slope = self._coefficients(self.system[self.parameter or "frequency"])
        if slope is not None and not linear_of(self._layout, slope).is_zero:
            return None
        return poles_of(linear_of(self._layout, coefficients), self._shift)

    def _laws(self, coefficients: NDArray[np.float64], slope: NDArray[np.float64] | None) -> Laws:
        return laws_of(self._layout, coefficients, slope) if self._fixed_laws is None else self._fixed_laws

    @cached_property
    def _fixed_laws(self) -> Laws | None:
        """The laws, where the parameter does not touch them."""
        if self.parameter not in (None, "frequency"):
            return None
        return laws_of(self._layout, coefficients_of(self.system))

    @cached_property
    def _layout(self) -> CoefficientLayout:
        return layout_of(self.system.structure)

    @cached_property
    def _shift(self) -> NDArray[np.float64]:
        """Stiffness of each contact that counts as part of the linear system, whatever the parameter."""
        laws = laws_of(self._layout, coefficients_of(self.system))
        slopes = np.bincount(laws.contact, np.abs(laws.spring[:, 1]), len(self._layout.contacts))
        return _SHARE * slopes / np.maximum(np.bincount(laws.contact, laws.spring[:, 1] != 0.0, len(slopes)), 1.0)

    @cached_property
    def _line(self) -> ParameterLine:
        assert self.parameter is not None
        return ParameterLine(self.system, self.parameter)

    def _coefficients(self, value: float) -> tuple[NDArray[np.float64], NDArray[np.float64] | None]:
        if self.parameter is None:
            return coefficients_of(self.system), None
        return self._line.coefficients(value)


def _real_rows(flexibility: NDArray[np.complex128], tangent: NDArray[np.complex128]) -> NDArray[np.float64]:
    """``G`` times the tangents, as a real matrix: rows and columns are real forms, contact by contact."""
    contacts, rows, columns = tangent.shape
    product = flexibility.transpose(1, 0, 2)[:, :, :, None] * tangent.transpose(1, 0, 2)
    real = np.concatenate((product.real, -product.imag[:, 1:]), axis=1)
    return real.reshape(contacts * (2 * rows - 1), contacts * columns)

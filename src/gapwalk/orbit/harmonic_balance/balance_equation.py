"""Harmonic balance: a periodic orbit as the Fourier lines of its contact deflections.

Method: docs/numerics/harmonic-balance.md
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.errors import ModelError
from gapwalk.flow.motion import integrate
from gapwalk.flow.switching import ContactEvent
from gapwalk.model.coefficients import coefficients_of
from gapwalk.model.system import System
from gapwalk.orbit.floquet import multipliers
from gapwalk.orbit.harmonic_balance.balance import Balance
from gapwalk.orbit.harmonic_balance.balance_parts import Parts
from gapwalk.orbit.harmonic_balance.balanced_orbit import BalancedOrbit
from gapwalk.orbit.harmonic_balance.compliance import DirectCompliance, PoleCompliance
from gapwalk.orbit.harmonic_balance.contact_forces import Forces, contact_forces_of
from gapwalk.orbit.harmonic_balance.hill_monodromy import projected_monodromy
from gapwalk.orbit.harmonic_balance.kernels import from_real_form, real_form
from gapwalk.orbit.harmonic_balance.laws import Laws
from gapwalk.orbit.harmonic_balance.linear_part import linear_of
from gapwalk.orbit.harmonic_balance.linearised import Linearised
from gapwalk.orbit.harmonic_balance.magnus_monodromy import monodromy
from gapwalk.orbit.harmonic_balance.modal_monodromy import modal_monodromy
from gapwalk.orbit.harmonic_balance.residual import balance, beyond, changed, share
from gapwalk.orbit.harmonic_balance.series import Series
from gapwalk.orbit.orbit import Orbit
from gapwalk.orbit.orbit_equation import Evaluation, OrbitEquation, check_period

_MOST = 1000  # harmonics beyond which an automatic choice gives up
_MANY = 16  # degrees of freedom from which stability is computed in eigenvectors
_FASTEST = 2.0  # eigenvalues that are kept for stability, in highest lines


class Evidence(NamedTuple):
    """What an evaluation knows of the motion: its lines, the linear part, the forces, and their sum.

    Attributes
    ----------
    coefficients
        Of the flow.
    lines : shape (contacts, K + 1)
        Of the deflections.
    total : shape (K + 1, contacts)
        Lines of the contact forces less the linear shares.
    compliance, laws, forces
        The parts.
    """

    coefficients: NDArray[np.float64]
    lines: NDArray[np.complex128]
    total: NDArray[np.complex128]
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
    others
        Names of other parameters that may vary; see `evaluate_at`.
    """

    system: System
    parameter: str | None = None
    period: int = 1
    options: Balance = Balance()
    harmonics: int = 10
    others: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        check_period(self.period)
        if self.parameter is not None:
            self.system.structure.place(self.parameter)
        if not self.system.structure.contacts:
            raise ModelError("the system has no contact; harmonic balance solves for the deflections of contacts")
        highest = max(self._parts.layout.orders, default=1)
        if self.harmonics < highest:
            raise ModelError(
                f"harmonics is {self.harmonics}, but the excitation has order {highest}; write harmonics = {highest} "
                "or more"
            )

    @property
    def by_touches(self) -> None:
        """None: no time of a contact is among its unknowns."""
        return None

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
        return self.evaluate_at(unknowns, *self._parts.coefficients(value))

    def evaluate_at(
        self, unknowns: NDArray[np.float64], coefficients: NDArray[np.float64], slope: NDArray[np.float64] | None
    ) -> Evaluation:
        """Residual and derivatives for coefficients of the flow, and for their derivatives by any of the parameters.

        Raises
        ------
        NumericalError
            As `evaluate`.
        """
        lines = from_real_form(unknowns.reshape(len(self._parts.layout.contacts), -1))
        compliance = self._parts.compliance(coefficients, slope)
        laws = self._parts.laws(coefficients, slope)
        forces = contact_forces_of(lines, laws)
        residual, jacobian, total, change = balance(
            lines,
            forces.parts,
            forces.slopes,
            self._parts.shift,
            *compliance.lines[:2],
            compliance.free,
            compliance.flexibility,
        )
        by_parameter = None
        if slope is not None:
            by_parameter = -compliance.slope(total, change)
        evidence = Evidence(coefficients, lines, total, compliance, laws, forces)
        return Evaluation(residual, jacobian, by_parameter, evidence)

    def orbit(self, unknowns: NDArray[np.float64], value: float, evaluation: Evaluation) -> BalancedOrbit:
        """The orbit of a solution."""
        system = self.system if self.parameter is None else self._parts.line.system_at(value)
        return self.orbit_at(system, unknowns, evaluation)

    def orbit_at(self, system: System, unknowns: NDArray[np.float64], evaluation: Evaluation) -> BalancedOrbit:
        """The orbit of a solution, which is a motion of `system`."""
        evidence: Evidence = evaluation.evidence
        # the unknowns may be one Newton step past the evaluation
        lines = from_real_form(unknowns.reshape(len(evidence.lines), -1))
        compliance, shift = evidence.compliance, self._parts.shift
        moved = changed(lines - evidence.lines, evidence.forces.parts, shift, compliance.lines.frequencies)
        series = Series(compliance.motion(evidence.total + moved).T.copy(), self.period, system.frequency)
        return BalancedOrbit(
            system,
            self.period,
            series.start(),
            multipliers([self.monodromy(evidence)]),
            self.events(evidence),
            max(map(abs, evaluation.residual.tolist())),
            2 * self.count,
            series,
            Series(lines, self.period, system.frequency),
            self._truncation(evidence),
        )

    def unknowns(self, orbit: Orbit) -> NDArray[np.float64]:
        """The real forms of the deflections of an orbit that was found in whatever way."""
        if not isinstance(orbit, BalancedOrbit):
            samples = max(orbit.samples, 1 << (16 * self.harmonics - 1).bit_length())
            return self._from_positions(orbit.motion(samples).q)
        known, stride = orbit.deflections.lines, self.period // orbit.deflections.period
        kept = min(known.shape[1], self.count // stride + 1)
        lines = np.zeros((len(known), self.count + 1), dtype=complex)
        lines[:, : (kept - 1) * stride + 1 : stride] = known[:, :kept]
        return real_form(lines).ravel()

    def _from_positions(self, q: NDArray[np.float64]) -> NDArray[np.float64]:
        """The unknowns of a motion sampled evenly over its period, both ends included, shape (samples, n)."""
        lines = 2.0 * np.fft.rfft(q[:-1], axis=0).T[:, : self.count + 1] / (len(q) - 1)
        lines[:, 0] *= 0.5
        return real_form(linear_of(self._parts.layout, coefficients_of(self.system)).deflections @ lines).ravel()

    def scales(self, length: float, frequency: float | None = None) -> NDArray[np.float64]:
        """How much of each unknown counts as one length."""
        contacts = len(self._parts.layout.contacts)
        return np.full(contacts * (2 * self.count + 1), length * np.sqrt(contacts))

    def doubt(self, orbit: Orbit) -> str:
        """Why a solution is no motion that can be trusted, and what to change; empty if it is one."""
        if orbit.truncation <= self.options.error:
            return ""
        text = (
            f"the harmonics beyond H = {self.harmonics} amount to {orbit.truncation:.4g} of the motion, and error = "
            f"{self.options.error:g} is allowed; "
        )
        if self.options.harmonics is None:
            return text + "no motion was found with more of them: allow a larger error, or use the method shooting"
        return (
            text + f"take harmonics = {2 * self.harmonics} or more, or leave harmonics out for as many as it takes, or "
            "allow a larger error"
        )

    def finer(self) -> BalanceEquation | None:
        """The same with half as many harmonics again, if their number is left open."""
        more = self.harmonics + max(2, self.harmonics // 2)
        if self.options.harmonics is not None or more > _MOST:
            return None
        return replace(self, harmonics=more)

    def otherwise(self) -> BalanceEquation:
        """The same with half as many harmonics again: what is neglected then tells in the difference."""
        return replace(self, harmonics=self.harmonics + max(2, self.harmonics // 2))

    def embed(self, direction: NDArray[np.float64], other: OrbitEquation) -> NDArray[np.float64]:
        """The same lines, and none beyond."""
        contacts = len(self._parts.layout.contacts)
        known = from_real_form(direction.reshape(contacts, -1))
        lines = np.zeros((contacts, (len(other.scales(1.0)) // contacts + 1) // 2), dtype=complex)
        lines[:, : known.shape[1]] = known
        return real_form(lines).ravel()

    def start(self, state: NDArray[np.float64]) -> NDArray[np.float64]:
        """The lines of the motion from a state over the orbit's period; of no motion at all for the state zero."""
        if not state.any():  # a system of a thousand degrees of freedom has no flow
            return np.zeros(len(self._parts.layout.contacts) * (2 * self.count + 1))
        samples = 1 << (16 * self.harmonics - 1).bit_length()
        return self._from_positions(integrate(self.system, state, self.period, samples).q)

    def linearised(self, evidence: Evidence) -> Linearised:
        """The linearised equations of all motions with the coefficients and the laws of one."""
        return self._parts.linearised(evidence.coefficients, evidence.laws)

    def monodromy(self, evidence: Evidence, linearised: Linearised | None = None) -> NDArray[np.float64]:
        """How changes of a motion are mapped over its period, in the unknowns in which `options.stability` has them.

        Where `linearised` is known already, that saves time.
        """
        length = 2.0 * np.pi * self.period * float(evidence.coefficients[0])
        forces, breaks = evidence.forces, evidence.forces.crossings[0]
        poles, shift = self._parts.poles, self._parts.shift
        if poles is not None and self.system.size >= _MANY and self.options.stability == "variational":
            # eigenvectors that are faster than every line, by far, follow at once
            slow = poles.below(_FASTEST * self.count * 2.0 * np.pi / length)
            return modal_monodromy(slow, shift, evidence.laws, evidence.lines, breaks, length)
        linearised = linearised or self.linearised(evidence)
        if self.options.stability == "hill":
            tangents = forces.tangents.reshape(-1, 2 * self.count + 1)
            return projected_monodromy(linearised, tangents, length)
        return monodromy(linearised, evidence.lines, breaks, length)

    def _truncation(self, evidence: Evidence) -> float:
        """Amplitudes in the lines from K + 1 to 2K, relative to those up to K."""
        frequencies = self._parts.orders[self.count + 1 :] / evidence.coefficients[0]
        neglected = evidence.compliance.answer(frequencies, beyond(evidence.forces.parts, frequencies))
        return share(neglected, evidence.lines)

    def events(self, evidence: Evidence) -> tuple[ContactEvent, ...]:
        """The crossings of breakpoints in one period."""
        rate = float(evidence.compliance.lines.frequencies[1])
        return tuple(
            ContactEvent(self.period * phi, int(switch), closes > 0.0, rate * slope)
            for phi, slope, closes, switch in evidence.forces.crossings.T.tolist()
        )

    @cached_property
    def _parts(self) -> Parts:
        return Parts(self.system, self.parameter, self.period, self.count, self.others)

"""Harmonic balance: a periodic orbit as the Fourier lines of its contact deflections.

The linear part and the contact laws of the system are computed once where no parameter changes them.

Method: docs/numerics/notes/harmonic-balance.md
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.errors import ModelError
from gapwalk.flow.contact_events import ContactEvent
from gapwalk.flow.motion import integrate
from gapwalk.late_scipy import linalg
from gapwalk.model.coefficients import CoefficientLayout, coefficients_of, layout_of, period_of, varying
from gapwalk.model.system import System
from gapwalk.orbit.floquet import multipliers
from gapwalk.orbit.harmonic_balance.balance import Balance, BalancedOrbit
from gapwalk.orbit.harmonic_balance.compliance import DirectCompliance, Lines, PoleCompliance, Poles, poles_of
from gapwalk.orbit.harmonic_balance.contact_forces import Forces, Laws, contact_forces_of, depend_on_frequency, laws_of
from gapwalk.orbit.harmonic_balance.jenkins_forces import NO_MEMORY
from gapwalk.orbit.harmonic_balance.kernels import balance, beyond, changed, from_real_form, real_form, share
from gapwalk.orbit.harmonic_balance.linear_part import (
    LOOSE,
    Linear,
    Series,
    Share,
    deflections_in,
    linear_of,
    shared,
    shares_of,
)
from gapwalk.orbit.harmonic_balance.monodromy import Linearised, modal_monodromy, monodromy
from gapwalk.orbit.harmonic_balance.sampled_forces import Pairs
from gapwalk.orbit.orbit import Orbit, repeats
from gapwalk.orbit.orbit_equation import Evaluation, OrbitEquation

# The monodromy matrix of a balanced motion by Hill's matrix, projected, so that no eigenvalues need be sorted.


def projected_monodromy(
    linearised: Linearised, tangents: NDArray[np.complex128], length: float, pairs: Pairs
) -> NDArray[np.float64]:
    """Compute the monodromy matrix of positions and momenta over one period, shape (2n, 2n)."""
    # Shapes: `tangents` (2 contacts, 2K + 1).
    #
    # With ``z_k = exp(i k W t / m) y`` the equation ``y' = sum_l L_l exp(i l W t / m) y`` has constant coefficients,
    # ``z_k' = i k (W/m) z_k + sum_l L_l z_(k+l)``: Hill's matrix. The monodromy matrix is the middle row of its
    # exponential, applied to ``z_k(0) = y(0)`` (Bayer and Leine 2023, Nonlinear Dynamics 111, 8439-8466: the
    # Koopman-Hill projection). Classical methods take 2n of its eigenvalues, and may take the wrong ones.
    steady, parts = linearised.steady, linearised.parts
    size, count = len(steady), (tangents.shape[1] - 1) // 2
    spectra = _two_sided(tangents)  # k = -2K ... 2K
    if len(pairs.forces):
        by_deflection, by_rate = (_two_sided(pairs.spectra[:, which]) for which in (0, 1))
        dampers = spectra[len(parts) // 2 + linearised.damped]
        products = [np.convolve(rate, damper, "same") for damper in dampers for rate in by_rate]
        spectra = np.vstack((spectra, by_deflection, by_rate, *products))
        parts = np.concatenate((parts, linearised.pair_parts(pairs)))
    harmonics = np.tensordot(spectra.T, parts, axes=1)
    harmonics[2 * count] += steady
    k = np.arange(2 * count + 1)
    blocks = harmonics[2 * count + k[None, :] - k[:, None]]
    matrix = blocks.transpose(0, 2, 1, 3).reshape(len(k) * size, len(k) * size)
    rates = 2j * np.pi / length * (k - count)
    matrix[np.diag_indices(len(matrix))] += np.repeat(rates, size)
    spread = linalg.expm(matrix * length)
    middle = spread[count * size : (count + 1) * size]
    return middle.reshape(size, len(k), size).sum(axis=1).real


def _two_sided(spectra: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Return the parts with negative k, too, of spectra of real functions."""
    return np.concatenate((spectra[:, :0:-1].conj(), spectra), axis=1)


_SHARE = 0.5  # share of each contact's stiffness that then belongs to the linear system
_MOST = 1000  # largest automatically chosen number of harmonics
_MANY = 16  # degrees of freedom from which stability is computed in eigenvectors
_FASTEST = 2.0  # largest eigenvalue used for stability, in multiples of the highest line


@dataclass(frozen=True)
class BalanceEquation(OrbitEquation):
    """``x - x_free + G F(x) = 0`` in each harmonic: x the contact deflections, F their forces, G their flexibility.

    The unknowns are the real forms of the deflections, one contact after the other: 2K + 1 numbers each, with
    ``K = H m`` lines. All other coordinates are eliminated exactly.
    """

    options: Balance = Balance()
    harmonics: int = 10  #: H, the highest harmonic of the forcing frequency.
    others: tuple[str, ...] = ()  #: Names of other parameters that may vary; see `evaluate_at`.

    def __post_init__(self) -> None:
        super().__post_init__()
        structure = self.system.structure
        if structure.memories and self.options.stability == "hill":
            names = " and ".join(repr(structure.contacts[number].name) for number in structure.memories)
            raise ModelError(
                f'stability is "hill", but {names} has a memory, which Hill\'s matrix has not; write '
                'stability = "variational"'
            )
        if not self.system.structure.contacts:
            raise ModelError("the system has no contact; harmonic balance solves for the deflections of contacts")
        highest = max(self._layout.orders, default=1)
        if self.harmonics < highest:
            raise ModelError(
                f"harmonics is {self.harmonics}, but the excitation has order {highest}; write harmonics = {highest} "
                "or more"
            )

    @property
    def count(self) -> int:
        """K, the number of lines."""
        return self.harmonics * self.period

    @cached_property
    def _width(self) -> int:
        """Number of the deflections, each of which has 2K + 1 unknowns."""
        return deflections_in(self._layout.structure)

    def evaluate(self, unknowns: NDArray[np.float64], value: float) -> Evaluation:
        """Compute residual and derivatives; see `Equation.evaluate`."""
        return self.evaluate_at(unknowns, *self.coefficients(value))

    def evaluate_at(
        self, unknowns: NDArray[np.float64], coefficients: NDArray[np.float64], slope: NDArray[np.float64] | None
    ) -> Evaluation:
        """Compute residual and derivatives from coefficients of the flow and their derivatives by any parameter."""
        lines = from_real_form(unknowns.reshape(self._width, -1))
        compliance = self._compliance(coefficients, slope)
        laws = self.laws(coefficients, slope) if self._fixed_laws is None else self._fixed_laws
        forces = contact_forces_of(lines, laws, self.period)
        residual, jacobian, total, change = balance(
            lines,
            forces.parts,
            forces.slopes,
            self._shift,
            *compliance.lines[:2],
            compliance.free,
            compliance.flexibility,
            *forces.pairs,
        )
        if forces.memory.forces:
            places, columns, rows = forces.memory.links
            pushed = (compliance.flexibility[:, :, places] * columns.T[:, None]).transpose(1, 0, 2)
            both = np.concatenate((pushed.real, -pushed.imag[:, 1:]), axis=1)
            jacobian += both.reshape(len(jacobian), len(places)) @ rows
        by_parameter = None if slope is None else -compliance.slope(total, change)
        evidence = Evidence(coefficients, lines, total, compliance, laws, forces)
        return Evaluation(residual, jacobian, by_parameter, evidence)

    def laws(self, coefficients: NDArray[np.float64], slope: NDArray[np.float64] | None = None) -> Laws:
        """Return the laws of the contacts for coefficients of the flow, and their derivatives along `slope`."""
        return laws_of(self._layout, coefficients, slope, self._shares)

    def orbit(self, unknowns: NDArray[np.float64], value: float, evaluation: Evaluation) -> BalancedOrbit:
        """Return the orbit of a solution."""
        return self.orbit_at(self.system_at(value), unknowns, evaluation)

    def orbit_at(self, system: System, unknowns: NDArray[np.float64], evaluation: Evaluation) -> BalancedOrbit:
        """Return the orbit of a solution, which is a motion of `system`."""
        evidence: Evidence = evaluation.evidence
        # the unknowns may be one Newton step past the evaluation
        lines = from_real_form(unknowns.reshape(len(evidence.lines), -1))
        compliance, shift = evidence.compliance, self._shift
        forces, frequencies = evidence.forces, compliance.lines.frequencies
        step = lines - evidence.lines
        moved = changed(step, forces.parts, shift, frequencies, *forces.pairs)
        if forces.memory.forces:
            places, columns, rows = forces.memory.links
            np.add.at(moved.T, places, columns * (rows @ real_form(step).ravel())[:, None])
        series = Series(compliance.motion(evidence.total + moved).T.copy(), self.period, system.frequency)
        state, found = series.start(), multipliers([self.monodromy(evidence)])
        memory = NO_MEMORY
        if self.system.structure.memories:
            memory = contact_forces_of(lines, evidence.laws, self.period).memory
            state, found = np.append(state, memory.extensions(np.zeros(1))[0]), memory.with_kept(found)
        return BalancedOrbit(
            system,
            self.period,
            state,
            found,
            self.events(evidence),
            max(map(abs, evaluation.residual.tolist())),
            2 * self.count,
            series,
            Series(lines, self.period, system.frequency),
            self._truncation(evidence),
            slips=memory.slips(self.period),
            stuck=memory.stuck,
        )

    def unknowns(self, orbit: Orbit) -> NDArray[np.float64]:
        """Return the real forms of the deflections of an orbit found by any method."""
        if not isinstance(orbit, BalancedOrbit):
            samples = max(orbit.samples, 1 << (16 * self.harmonics - 1).bit_length())
            return self._from_positions(orbit.motion(samples).q)
        known, stride = orbit.deflections.lines, self.period // orbit.deflections.period
        kept = min(known.shape[1], self.count // stride + 1)
        lines = np.zeros((len(known), self.count + 1), dtype=complex)
        lines[:, : (kept - 1) * stride + 1 : stride] = known[:, :kept]
        return real_form(lines).ravel()

    def with_other_phases(self, orbit: Orbit) -> list[NDArray[np.float64]]:
        """See `OrbitEquation.with_other_phases`: the lines are turned."""
        lines, count = from_real_form(self.unknowns(orbit).reshape(self._width, -1)), repeats(orbit.system)
        later = np.exp(2j * np.pi * np.arange(lines.shape[1]) / (self.period * count))
        return [real_form(lines * later**shift).ravel() for shift in range(1, orbit.period * count)]

    def _from_positions(self, q: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the unknowns of a motion sampled evenly over its period, both ends included, shape (samples, n)."""
        lines = 2.0 * np.fft.rfft(q[:-1], axis=0).T[:, : self.count + 1] / (len(q) - 1)
        lines[:, 0] *= 0.5
        linear = linear_of(self._layout, coefficients_of(self.system))
        found = linear.deflections @ lines
        found[:, np.array([0, *self._layout.orders]) * self.period] += linear.sways
        return real_form(found).ravel()

    def scales(self, length: float, frequency: float | None = None) -> NDArray[np.float64]:
        """Return the amount of each unknown that counts as one length."""
        return np.full(self._width * (2 * self.count + 1), length * np.sqrt(self._width))

    def inaccuracy(self, orbit: Orbit) -> str:
        """Return the reason why a solution is not reliable, with advice; empty if it is reliable."""
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
        """Return the equation with 50 % more harmonics, if the options leave their number open."""
        finer = self.otherwise()
        return finer if self.options.harmonics is None and finer.harmonics <= _MOST else None

    def otherwise(self) -> BalanceEquation:
        """Return the equation with 50 % more harmonics: the difference of solutions shows the truncation error."""
        return replace(self, harmonics=self.harmonics + max(2, self.harmonics // 2))

    def embed(self, direction: NDArray[np.float64], other: OrbitEquation) -> NDArray[np.float64]:
        """Return the unknowns with the same lines, and zeros beyond."""
        known = from_real_form(direction.reshape(self._width, -1))
        lines = np.zeros((self._width, (len(other.scales(1.0)) // self._width + 1) // 2), dtype=complex)
        lines[:, : known.shape[1]] = known
        return real_form(lines).ravel()

    def start(self, state: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the lines of the motion from a state over the orbit's period; zeros for the state zero."""
        if not state.any():  # a system of a thousand degrees of freedom has no flow
            return np.zeros(self._width * (2 * self.count + 1))
        samples = 1 << (16 * self.harmonics - 1).bit_length()
        return self._from_positions(integrate(self.system, state, self.period, samples).q)

    def rest(self, position: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the lines of a system that stays at a position, such as a static equilibrium."""
        return self._from_positions(np.tile(position, (16 * self.harmonics, 1)))

    def linearised(self, evidence: Evidence) -> Linearised:
        """Return the linearised equations for the coefficients and the laws of an evaluation."""
        if self._fixed_linearised is not None:
            return self._fixed_linearised
        return Linearised(self._fixed or self._linear(evidence.coefficients)[0], evidence.laws)

    def monodromy(self, evidence: Evidence, linearised: Linearised | None = None) -> NDArray[np.float64]:
        """Compute the monodromy matrix, in the unknowns of the method that `options.stability` names."""
        # Passing a known `linearised` saves time.
        length = 2.0 * np.pi * self.period * float(evidence.coefficients[0])
        forces, laws = evidence.forces, evidence.laws
        poles, shift, by_lines = self._poles, self._shift, self.options.stability == "hill"
        if poles is not None and self.system.size >= _MANY and not by_lines and laws.are_slim:
            # eigenvectors that are much faster than every line respond statically
            slow = poles.below(_FASTEST * self.count * 2.0 * np.pi / length)
            return modal_monodromy(slow, shift, laws, evidence.lines, forces.breaks, length, self.period)
        linearised = linearised or self.linearised(evidence)
        if by_lines:
            tangents = forces.parts[:, 1::2].transpose(1, 0, 2)  # of the springs, then of the dampers
            return projected_monodromy(linearised, tangents.reshape(-1, 2 * self.count + 1), length, forces.pairs)
        return monodromy(linearised, evidence.lines, forces.breaks, length, self.period, forces.pairs, forces.memory)

    def _truncation(self, evidence: Evidence) -> float:
        """Return the amplitudes in the lines from K + 1 to 2K, relative to those up to K."""
        frequencies = self._orders[self.count + 1 :] / evidence.coefficients[0]
        neglected = evidence.compliance.answer(frequencies, beyond(evidence.forces.parts, frequencies))
        return share(neglected, evidence.lines)

    def events(self, evidence: Evidence) -> tuple[ContactEvent, ...]:
        """Return the crossings of breakpoints in one period."""
        rate = float(evidence.compliance.lines.frequencies[1])
        return tuple(
            ContactEvent(self.period * phi, int(switch), closes > 0.0, rate * slope)
            for phi, slope, closes, switch in evidence.forces.crossings.T.tolist()
        )

    def coefficients(self, value: float) -> tuple[NDArray[np.float64], NDArray[np.float64] | None]:
        """Return the coefficients at a value of the parameter, and their derivatives."""
        if self.parameter is None or self.parameter in self._varying:
            return super().coefficients(value)
        first, slope = period_of(self.system, value)  # the parameter changes only 1/W, and no other one is used
        return np.array([first]), np.array([slope])

    def _compliance(
        self, coefficients: NDArray[np.float64], slope: NDArray[np.float64] | None
    ) -> PoleCompliance | DirectCompliance:
        """Return the linear part on the lines of the motion."""
        frequencies = self._orders[: self.count + 1] / coefficients[0]
        slopes = frequencies * (0.0 if slope is None else -slope[0] / coefficients[0])
        lines = Lines(frequencies, slopes, np.array([0, *self._layout.orders], dtype=np.intp) * self.period)
        if self._poles is not None:
            return PoleCompliance.on(lines, self._poles)
        if self._fixed is not None:
            return DirectCompliance(self._fixed, None, lines, self._shift)
        return DirectCompliance(*self._linear(coefficients, slope), lines, self._shift)

    def _linear(
        self, coefficients: NDArray[np.float64], slope: NDArray[np.float64] | None = None
    ) -> tuple[Linear, Linear | None]:
        """Return the linear part, and its derivative along `slope`."""
        return shared(self._layout, coefficients, slope, self._shares)

    @cached_property
    def _shares(self) -> tuple[Share, ...]:
        """The shares of formulas that are moved into the linear part."""
        return shares_of(self._layout, coefficients_of(self.system)) if depend_on_frequency(self._layout) else ()

    @cached_property
    def _layout(self) -> CoefficientLayout:
        return layout_of(self.system.structure)

    @cached_property
    def _orders(self) -> NDArray[np.float64]:
        """Lines from 0 to 2K in multiples of the forcing frequency: those beyond K measure the truncation."""
        return np.arange(2 * self.count + 1) / self.period

    @cached_property
    def _shift(self) -> NDArray[np.float64]:
        """Stiffness of each contact that is moved into the linear part; 0 if no contact is needed to restrain it."""
        coefficients, count = coefficients_of(self.system), self._width
        if np.linalg.cond(self._linear(coefficients)[0].stiffness, 1) < LOOSE:
            return np.zeros(count)
        laws = self.laws(coefficients)
        always = laws.gate < 0
        springs, contact = np.abs(laws.polynomials[always, 0, 1]), laws.contact[always]
        total, number = np.bincount(contact, springs, count), np.bincount(contact, springs > 0.0, count)
        return _SHARE * total / np.maximum(number, 1.0)

    @cached_property
    def _varying(self) -> tuple[str, ...]:
        """The parameters that may change more than 1/W: the matrices or the laws."""
        enters = self._layout.frequency_enters or depend_on_frequency(self._layout)
        only_period = () if enters else (self.system.structure.pace,)
        return tuple(name for name in (self.parameter, *self.others) if name not in (None, *only_period))

    @cached_property
    def _fixed(self) -> Linear | None:
        """The linear part, if no parameter changes it."""
        for mask in varying(self.system, self._varying):
            _, change = self._linear(coefficients_of(self.system), mask.astype(float))
            if change is not None and not change.is_zero:
                return None
        return self._linear(coefficients_of(self.system))[0]

    @cached_property
    def _poles(self) -> Poles | None:
        """The eigenvalues of a constant linear part; None if it varies, or has too few eigenvectors."""
        return None if self._fixed is None else poles_of(self._fixed, self._shift)

    @cached_property
    def _fixed_laws(self) -> Laws | None:
        """The laws, if no parameter changes them."""
        return None if self._varying else self.laws(coefficients_of(self.system))

    @cached_property
    def _fixed_linearised(self) -> Linearised | None:
        """The linearised equations, if no parameter changes them."""
        if self._fixed is None or self._fixed_laws is None:
            return None
        return Linearised(self._fixed, self._fixed_laws)


class Evidence(NamedTuple):
    """Data of an evaluation: the lines of the motion, the linear part, the forces, and their sum."""

    coefficients: NDArray[np.float64]  #: Coefficients of the flow.
    lines: NDArray[np.complex128]  #: shape (contacts, K + 1): Lines of the deflections.
    total: NDArray[np.complex128]  #: shape (K + 1, contacts): Lines of the contact forces less the linear shares.
    #: compliance, laws, forces: The parts.
    compliance: PoleCompliance | DirectCompliance
    laws: Laws
    forces: Forces

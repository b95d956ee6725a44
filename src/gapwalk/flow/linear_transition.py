"""The state transition matrix of motions that are linear between their contact events, from those events alone.

While no contact opens or closes, changes of such a motion follow ``dy/dt = A y`` with a constant matrix. So the
transition matrix is a product of matrix exponentials, and of the jumps of the general event rule: n^3 for each event.
Taylor series of the variational equations cost as much for each of many steps, so large systems gain most. Where the
matrix stays the same along a branch, as over frequency, loads and clearances, its eigenvectors give each exponential
by products of matrices. They cost more than some exponentials; else, and where they hardly differ, SciPy's serves.

Moler and Van Loan (2003), Nineteen dubious ways to compute the exponential of a matrix, SIAM Review 45, ways 3 and 14.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.flow.contact_events import ContactEvent
from gapwalk.flow.equations import Equations
from gapwalk.flow.event_rule import jump_of
from gapwalk.model.laws import closed_form_of

LARGE = 5
"""Number of coordinates from which it takes less time than Taylor series."""
_EXACT = 1e-13  # share of the matrix within which its eigenvectors must give it back
_KEPT = 64  # matrices that are kept, one for each set of closed stages

Array = NDArray[np.float64]


class _Spectrum(NamedTuple):
    """A matrix in the basis of its eigenvectors, whose complex pairs are replaced by real and imaginary parts."""

    #: basis, inverse: shape (2n, 2n): The basis, in columns, and its inverse.
    basis: Array
    inverse: Array
    #: growth, turn: shape (2n, 1): Real part of each eigenvalue; its imaginary part, with the sign by which the partner
    #: enters.
    growth: Array
    turn: Array
    partner: NDArray[np.intp]  #: shape (2n,): The other one of a pair; of a real eigenvalue itself.

    @classmethod
    def of(cls, matrix: Array) -> _Spectrum | None:
        """Return the spectrum of a matrix; None where its eigenvectors hardly differ, as at critical damping."""
        pairs = np.linalg.eig(matrix)
        values: NDArray[np.complex128] = np.asarray(pairs.eigenvalues, dtype=np.complex128)
        vectors: NDArray[np.complex128] = np.asarray(pairs.eigenvectors, dtype=np.complex128)
        first = np.flatnonzero(values.imag > 0.0)  # LAPACK returns pairs side by side
        basis, partner, turn = vectors.real.copy(), np.arange(len(values)), values.imag.copy()
        basis[:, first + 1] = vectors[:, first].imag
        partner[first], partner[first + 1] = first + 1, first
        turn[first + 1] = -values[first].imag
        try:
            inverse = np.asarray(np.linalg.inv(basis), dtype=np.float64)
        except np.linalg.LinAlgError:
            return None
        found = cls(basis, inverse, values.real[:, None].copy(), turn[:, None], partner)
        again = basis @ (found.growth * inverse + found.turn * inverse[partner])
        return found if np.abs(again - matrix).max() <= _EXACT * np.abs(matrix).max() else None

    def carried(self, changes: Array | None, time: float) -> Array:
        """Return changes of the state after some time; None stands for the identity."""
        own = self.inverse if changes is None else self.inverse @ changes
        grown, angle = np.exp(self.growth * time), self.turn * time
        return self.basis @ (grown * np.cos(angle) * own + grown * np.sin(angle) * own[self.partner])


class LinearTransition:
    """The transition matrices of the motions of one integrator; see `serves`."""

    def __init__(self, equations: Equations) -> None:
        layout = equations.layout
        self._n, self._switches = layout.structure.size, equations.switches
        self._rows = layout.accelerations[:, : 2 * self._n + len(layout.contacts)]
        self._contacts = np.array([contact for contact, _ in equations.switches], dtype=np.intp)
        vectors = [contact.deflection for contact in layout.contacts]  # there may be none
        self._vectors = np.array(vectors, dtype=np.intp).reshape(-1, self._n)
        self._terms = [_terms(equations, *switch) or () for switch in equations.switches]
        self._jumps = [jump_of(layout, *switch) for switch in equations.switches]
        self._slots = _slots(equations)
        self._is_constant = not any(np.isin(self._slots, slots).any() for slots in equations.varying)
        self._known, self._matrices = b"", dict[tuple[bool, ...], Array | _Spectrum]()

    @staticmethod
    def serves(equations: Equations) -> bool:
        """Return True if motions are linear between events of breakpoints, and nothing else is an event."""
        layout = equations.layout
        if equations.ramp or equations.dry or equations.stops or equations.modes or layout.cycles:
            return False
        for index, contact in enumerate(layout.contacts):
            varies = set(contact.waves) - set(contact.form.law.arguments) or any(
                stage.waves for stage in contact.stages
            )
            if varies or contact.form.law.rebounds or closed_form_of(contact.form.law, contact.form.shapes) is None:
                return False
            if any(_terms(equations, index, stage) is None for stage in range(len(contact.stages))):
                return False
        return True

    def along(
        self, coefficients: Array, inside: Sequence[bool], events: Sequence[ContactEvent], thetas: Array, unit: float
    ) -> Array:
        """Return the transition matrices from the first of some angles to each, shape (angles, 2n, 2n)."""
        self._read(coefficients)
        n, rate, closed, now = self._n, float(coefficients[0]), list(inside), float(thetas[0])
        changes: Array | None = None
        found, left = [np.eye(2 * n)], list(events)
        for stop in thetas[1:].tolist():
            while left and left[0].theta <= stop:
                event = left.pop(0)
                changes, now = self._carried(changes, closed, (event.theta - now) * rate), event.theta
                closed[event.switch] = event.enters
                self._pass(changes, event, coefficients, unit)
            changes, now = self._carried(changes, closed, (stop - now) * rate), stop
            found.append(changes.copy())
        every = np.array(found)
        every[:, :n, n:] /= self._scale  # velocities have been in multiples of the largest frequency
        every[:, n:, :n] *= self._scale
        return every

    def _read(self, coefficients: Array) -> None:
        """Read what matrices depend on, only when it has changed."""
        known = coefficients[self._slots].tobytes()
        if known == self._known and len(self._matrices) <= _KEPT:
            return
        n, rows = self._n, coefficients[self._rows]
        self._known, self._matrices = known, {}
        self._stiffness, self._damping, self._pushes = rows[:, :n], rows[:, n : 2 * n], rows[:, 2 * n :].T
        self._directions = coefficients[self._vectors]
        self._slopes = [
            [sum([factor * math.prod(coefficients[slots].tolist()) for factor, slots in power]) for power in terms]
            for terms in self._terms
        ]
        self._scale = math.sqrt(float(np.abs(self._stiffness).sum(axis=1).max(initial=0.0))) or 1.0

    def _carried(self, changes: Array | None, closed: Sequence[bool], time: float) -> Array:
        if time <= 0.0:
            return np.eye(2 * self._n) if changes is None else changes
        known = self._matrix(tuple(closed))
        if isinstance(known, _Spectrum):
            return known.carried(changes, time)
        from scipy.linalg import expm

        grown = np.asarray(expm(known * time), dtype=float)
        return grown if changes is None else grown @ changes

    def _matrix(self, closed: tuple[bool, ...]) -> Array | _Spectrum:
        """Return the spectrum of the matrix while some stages are closed, or the matrix itself."""
        found = self._matrices.get(closed)
        if found is not None:
            return found
        n, stiffness, damping = self._n, self._stiffness.copy(), self._damping.copy()
        for switch in np.flatnonzero(closed).tolist():
            contact, (spring, damper) = self._contacts[switch], self._slopes[switch]
            along = np.outer(self._pushes[contact], self._directions[contact])
            stiffness += spring * along
            damping += damper * along
        matrix = np.block([[np.zeros((n, n)), self._scale * np.eye(n)], [-stiffness / self._scale, -damping]])
        spectrum = _Spectrum.of(matrix) if self._is_constant else None
        self._matrices[closed] = found = matrix if spectrum is None else spectrum
        return found

    def _pass(self, changes: Array, event: ContactEvent, coefficients: Array, unit: float) -> None:
        """Change the velocities by the jump of the force that comes earlier or later."""
        jump = self._jumps[event.switch]
        if jump is None:
            return
        n, contact = self._n, self._contacts[event.switch]
        size = jump(coefficients)(event.velocity / unit, event.theta) / self._scale
        shifts = self._directions[contact] @ changes[:n]
        changes[n:] -= np.outer((size if event.enters else -size) * self._pushes[contact], shifts)


def _slots(equations: Equations) -> NDArray[np.intp]:
    """Return the slots of all coefficients on which the matrices depend, but for the frequency."""
    layout = equations.layout
    rows = layout.accelerations[:, : 2 * layout.structure.size + len(layout.contacts)]
    every = [_terms(equations, *switch) or () for switch in equations.switches]
    own = [slot for terms in every for power in terms for _, slots in power for slot in slots]
    vectors = [slot for contact in layout.contacts for slot in contact.deflection.tolist()]
    return np.unique([*rows.ravel().tolist(), *vectors, *own]).astype(np.intp)


def _terms(equations: Equations, contact: int, stage: int) -> list[list[tuple[float, list[int]]]] | None:
    """Return the products by which a closed stage adds to the slopes of its force by deflection and rate.

    None if one of them is not constant.
    """
    slots = equations.layout.contacts[contact]
    found: list[list[tuple[float, list[int]]]] = [[], []]
    for term in closed_form_of(slots.form.law, slots.form.shapes) or ():
        if term.stage != stage or not term.power + term.rate:
            continue
        own = [*(slots.numbers[name] for name in term.numbers)]
        own += [slots.stages[stage].numbers[name] for name in term.stage_numbers]
        if not equations.pattern[own].all():
            continue  # a number that is zero
        if term.power + term.rate > 1:
            return None
        found[term.rate].append((term.factor, own))
    return found

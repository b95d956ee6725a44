"""The compiled flow: motions of a system over theta, with sensitivities and exact contact events.

A `Flow` is a program of the compiled kernel (`gapwalk.taylor.kernel`) for a structure and a pattern of non-zero
coefficients; it serves every value. Each breakpoint of each contact is a terminal event, found to rounding.

Method: docs/numerics/notes/flow.md
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import lru_cache, partial, wraps
from itertools import pairwise
from operator import itemgetter
from threading import Lock
from typing import Concatenate, NamedTuple, NoReturn, ParamSpec, TypeVar
from weakref import WeakMethod

import numpy as np
from numpy.typing import NDArray

from gapwalk.errors import FlowError
from gapwalk.flow.constraints import reachable_masks
from gapwalk.flow.contact_events import (
    ContactEvent,
    Switchboard,
    Turn,
    TurningPoints,
)
from gapwalk.flow.equations import Equations, LengthUnit
from gapwalk.flow.event_rule import jump_of
from gapwalk.flow.forces import CompiledReadings
from gapwalk.flow.friction_state import Hold, Kink, SlipEvent
from gapwalk.model.coefficients import CoefficientLayout, coefficients_of, layout_of, varying
from gapwalk.model.laws import closed_form_of
from gapwalk.model.structure import Structure
from gapwalk.model.system import System
from gapwalk.taylor.integrator import Integrator, Outcome
from gapwalk.taylor.program import Program

# The state transition matrix of motions that are linear between their contact events, from those events alone.
#
# While no contact opens or closes, changes of such a motion follow ``dy/dt = A y`` with a constant matrix. So the
# transition matrix is a product of matrix exponentials, and of the jumps of the general event rule: n^3 for each
# event. Taylor series of the variational equations cost as much for each of many steps, so large systems gain most.
# Where the matrix stays the same along a branch, as over frequency, loads and clearances, its eigenvectors give each
# exponential by products of matrices. They cost more than some exponentials; else, and where they hardly differ,
# SciPy's serves.
#
# Moler and Van Loan (2003), Nineteen dubious ways to compute the exponential of a matrix, SIAM Review 45, ways 3 and
# 14.

LARGE = 8
"""Number of coordinates from which it takes less time than Taylor series: with 6 a third more, with 10 a third less."""
DEAR, DEAR_LINEAR = 32, 80
"""Numbers of the state from which a transition matrix is dear: by Taylor series, and of motions that are linear."""
_EXACT = 1e-13  # share of the matrix within which its eigenvectors must give it back
_KEPT, _FEW = 64, 16  # matrices that are kept, one for each set of closed stages, and for each change of these

Array = NDArray[np.float64]


class Modes(NamedTuple):
    """The exponential of a linear system over a time, in real and imaginary parts of its modes, all of them complex."""

    basis: NDArray[np.float64]  #: shape (2n, 2n): Real and imaginary part of each mode, side by side.
    inverse: NDArray[np.float64]  #: shape (2n, 2n): Its inverse.
    values: NDArray[np.complex128]  #: shape (n,): Eigenvalue of each mode after that time, of a pair the upper one.


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
    scaled: list[Array]  #: Basis and inverse in other units, if they have been asked for.

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
        found = cls(basis, inverse, values.real[:, None].copy(), turn[:, None], partner, [])
        again = basis @ (found.growth * inverse + found.turn * inverse[partner])
        return found if np.abs(again - matrix).max() <= _EXACT * np.abs(matrix).max() else None

    def carried(self, changes: Array, time: float) -> Array:
        """Return changes after some time, in this basis."""
        grown, angle = np.exp(self.growth * time), self.turn * time
        found = changes[self.partner]
        found *= grown * np.sin(angle)
        found += grown * np.cos(angle) * changes
        return found

    def modes(self, scale: float, time: float) -> Modes | None:
        """Return the modes over some time, for velocities in other units; None if not all of them are complex."""
        upper = self.turn[::2, 0]
        if not (upper > 0.0).all():
            return None
        if not self.scaled:
            units = np.repeat((1.0, scale), len(self.basis) // 2)
            self.scaled[:] = units[:, None] * self.basis, self.inverse / units
        return Modes(self.scaled[0], self.scaled[1], np.exp((self.growth[::2, 0] + 1j * upper) * time))


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
        self._between = dict[tuple[int, int], Array]()  # from the basis of one spectrum to that of another
        self.modes: Modes | None = None  # of what the last motion followed most of the time

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
        every, left, lasted = np.empty((len(thetas), 2 * n, 2 * n)), list(events), dict[tuple[bool, ...], float]()
        every[0] = np.eye(2 * n)
        changes: Array | None = None  # None: the identity
        basis: _Spectrum | None = None  # of the changes; None: they are those of the state
        for place, stop in enumerate(thetas[1:].tolist(), start=1):
            while True:
                event = left.pop(0) if left and left[0].theta <= stop else None
                until, pattern = (stop if event is None else event.theta), tuple(closed)
                if until > now:
                    known = self._matrix(pattern)
                    changes, basis = self._in_basis(changes, basis, known if isinstance(known, _Spectrum) else None)
                    changes = _carried(known, changes, (until - now) * rate)
                    lasted[pattern] = lasted.get(pattern, 0.0) + until - now
                now = until
                if event is None:
                    break
                closed[event.switch] = event.enters
                changes = self._pass(changes, basis, event, coefficients, unit)
            every[place] = every[0] if changes is None else self._in_basis(changes, basis, None)[0]
        every[1:, :n, n:] /= self._scale  # velocities have been in multiples of the largest frequency
        every[1:, n:, :n] *= self._scale
        longest = self._matrix(max(lasted, key=lasted.__getitem__)) if lasted else None
        time = (now - float(thetas[0])) * rate
        self.modes = longest.modes(self._scale, time) if isinstance(longest, _Spectrum) else None
        return every

    def _in_basis(
        self, changes: Array | None, now: _Spectrum | None, then: _Spectrum | None
    ) -> tuple[Array, _Spectrum | None]:
        """Return changes in another basis, by one product where both are known, and that basis."""
        if changes is None:
            return (then.inverse if then else np.eye(2 * self._n)), then
        if now is then:
            return changes, then
        if now is None or then is None:
            return (then.inverse @ changes if then else now.basis @ changes if now else changes), then
        key = id(now), id(then)
        if key not in self._between:
            if len(self._between) >= _FEW:
                self._between.clear()
            self._between[key] = then.inverse @ now.basis
        return self._between[key] @ changes, then

    def _read(self, coefficients: Array) -> None:
        """Read what matrices depend on, only when it has changed."""
        known = coefficients[self._slots].tobytes()
        if known == self._known and len(self._matrices) <= _KEPT:
            return
        n, rows = self._n, coefficients[self._rows]
        self._known, self._matrices, self._between = known, {}, {}
        self._stiffness, self._damping, self._pushes = rows[:, :n], rows[:, n : 2 * n], rows[:, 2 * n :].T
        self._directions = coefficients[self._vectors]
        self._slopes = [
            [sum([factor * math.prod(coefficients[slots].tolist()) for factor, slots in power]) for power in terms]
            for terms in self._terms
        ]
        self._scale = math.sqrt(float(np.abs(self._stiffness).sum(axis=1).max(initial=0.0))) or 1.0

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

    def _pass(
        self, changes: Array | None, basis: _Spectrum | None, event: ContactEvent, coefficients: Array, unit: float
    ) -> Array | None:
        """Return changes after the velocities have changed by the jump of the force that comes earlier or later."""
        jump = self._jumps[event.switch]
        if jump is None:
            return changes
        changes = np.eye(2 * self._n) if changes is None else changes
        n, contact = self._n, self._contacts[event.switch]
        size = jump(coefficients)(event.velocity / unit, event.theta) / self._scale
        along, push = self._directions[contact], (-size if event.enters else size) * self._pushes[contact]
        if basis is not None:
            return changes + np.outer(basis.inverse[:, n:] @ push, (along @ basis.basis[:n]) @ changes)
        changes[n:] += np.outer(push, along @ changes[:n])
        return changes


def _carried(known: Array | _Spectrum, changes: Array, time: float) -> Array:
    """Return changes after some time, in the basis of a spectrum, or by the exponential of a matrix."""
    if isinstance(known, _Spectrum):
        return known.carried(changes, time)
    from scipy.linalg import expm

    return np.asarray(expm(known * time), dtype=float) @ changes


def _slots(equations: Equations) -> NDArray[np.intp]:
    """Return the slots of all coefficients on which the matrices depend, but for the frequency."""
    layout = equations.layout
    rows = layout.accelerations[:, : 2 * layout.structure.size + len(layout.contacts)]
    every = [_terms(equations, *switch) or () for switch in equations.switches]
    own = [slot for terms in every for power in terms for _, slots in power for slot in slots]
    vectors = [slot for contact in layout.contacts for slot in contact.deflection.tolist()]
    return np.unique([*rows.ravel().tolist(), *vectors, *own]).astype(np.intp)


def _terms(equations: Equations, contact: int, stage: int) -> list[list[tuple[float, list[int]]]] | None:
    """Return the products by which a closed stage adds to the slopes of its force by deflection and rate."""
    # None if one of them is not constant.
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


T = TypeVar("T")
P = ParamSpec("P")

PERIOD = 2.0 * math.pi
"""One forcing period, in theta."""

_TRIES = ((math.inf, 1e-13), (PERIOD / 128, 1e-11), (PERIOD / 2048, 1e-9))  # longest step, and `DrySwitches.unseen`
_STEPS = 20_000  # Taylor steps per forcing period before a motion counts as divergent; usual are 20 to 2,000
_EVENTS = 20_000  # contact events per forcing period before a motion counts as chattering without end
_MOST = 64  # flows in the cache of a process
_compiling = Lock()
_NO_ANGLES = np.zeros(0)
_NONE = np.zeros((0, 0, 0))  # derivatives of a motion that was sampled without them


Restarts = Sequence[tuple[float, NDArray[np.float64]]]
"""Angles at which a motion that is strongly unstable continues from known states, in their order."""


class Arc(NamedTuple):
    """Result of the flow for one interval of theta."""

    #: shape (state size,): Positions, then velocities, then the extensions of contacts with a memory, at the end.
    state: NDArray[np.float64]
    #: shape (2n, 2n), or None: Derivative of the final state by the initial one.
    transition: NDArray[np.float64] | None
    #: shape (2n,), or (2n, k), or None: Derivative of the final state along the direction of coefficients, or along
    #: each of k > 1 directions.
    sensitivity: NDArray[np.float64] | None
    contacts: list[ContactEvent]  #: list of ContactEvent: The crossings of breakpoints, in order.
    steps: int  #: int: Taylor steps taken: a measure of how fast the motion varies.
    #: sequence of SlipEvent: The modes of dry friction at the start, then their changes, in order.
    slips: Sequence[SlipEvent] = ()
    #: sequence of Hold: What sticks rigidly, or is held at a stop, at the start; then its changes, in order.
    holds: Sequence[Hold] = ()
    impacts: Sequence[Kink] = ()  #: sequence of Kink: The instants at which velocities jump, in order.
    #: shape (turns, 2 + size), or None: Contact, angle and state of the reversals of deflections (with transition).
    reversals: NDArray[np.float64] | None = None
    modes: Modes | None = None  #: Those that the motion follows for most of the time, if it is linear between events.


class Variations(NamedTuple):
    """A sampled motion with its derivatives."""

    states: NDArray[np.float64]  #: shape (samples, 2n): Positions, then velocities.
    transitions: NDArray[np.float64]  #: shape (samples, 2n, 2n): Derivative of each by the state at the first sample.
    #: shape (samples, 2n, k): Derivative of each along k directions of coefficients.
    sensitivities: NDArray[np.float64]
    contacts: list[ContactEvent]  #: list of ContactEvent: The crossings of breakpoints, in order.
    #: slips, holds, impacts: As in `Arc`.
    slips: Sequence[SlipEvent] = ()
    holds: Sequence[Hold] = ()
    impacts: Sequence[Kink] = ()

    @property
    def logs(self) -> tuple[list[ContactEvent], Sequence[SlipEvent], Sequence[Hold], Sequence[Kink]]:
        """All events: crossings of breakpoints, then those of friction and rigid stops."""
        return self.contacts, self.slips, self.holds, self.impacts


class _Integrator:
    """One integrator of a flow, with its switches; one thread at a time uses it. Its methods are those of `Flow`."""

    def __init__(self, flow: Flow) -> None:
        self.equations, self.size = flow.equations, flow.size
        self.has_transition, self.has_survey, self.directions = flow.has_transition, flow.has_survey, flow.directions
        self._switchboard = Switchboard(self.equations)
        self._turns = TurningPoints(self.equations, self._switchboard)
        taylor = Integrator(
            flow.program,
            [partial(self._switchboard.answer, *event) for event in flow.events],
            self._turns.at_event if flow.has_survey else None,
        )
        self._lengths, self._taylor, self._unit = flow._lengths, taylor, 1.0
        self._state, self._parameters = taylor.state, taylor.pars
        self._coefficients = self._parameters[self.equations.first_coefficient :]
        self._components = self._parameters[: self.equations.first_switch]
        self._own, self._rest = self._state[: self.size], self._state[self.size :]
        self._linear = LinearTransition(self.equations) if flow.is_linear else None
        self._width = self.size * (self.has_transition and not flow.is_linear)  # columns of the transition matrix
        self._switchboard.attach(taylor, self._width + self.directions, flow.readings)
        if flow.has_survey:
            self._switchboard.listener = WeakMethod(self._turns.at_stop)
        equations = self.equations
        self._active, self._length = equations.active, equations.length
        self._changing = equations.components if self.directions else None
        self._has_events = bool(equations.switches or equations.modes or equations.dry or equations.restarts)
        self._still = np.zeros((self.directions, len(equations.pattern)))
        self._identity = np.zeros(len(self._state) - self.size)
        if self._width:
            self._identity[: self.size**2] = np.eye(self.size).ravel()

    def integrate(
        self,
        coefficients: Array,
        state: Array,
        start: float = 0.0,
        stop: float = PERIOD,
        direction: Array | None = None,
        *,
        keeps: int | None = None,
        sums: bool = True,
    ) -> Arc:
        """Integrate a state, shape (2n,), from one theta to another."""
        for longest_step, unseen in _TRIES:
            self._prepare(coefficients, state, start, stop, direction)
            self._switchboard.dry.keeps, self._switchboard.dry.unseen = keeps, unseen
            if self._switchboard.chatters and keeps is None and sums:
                self._switchboard.sums(np.array([stop]))
            steps = self._run(start, stop, longest_step)
            if keeps is not None or self._switchboard.is_right():
                return self._arc(steps, np.array([start, stop]))
        self._refuse_missed(state, start, stop)

    def sample(self, coefficients: Array, state: Array, thetas: Array, restarts: Restarts = ()) -> Variations:
        """Return the states at each of the increasing `thetas`, and the events, without derivatives."""
        # The state given is that at ``thetas[0]``. At the angles of `restarts` the motion continues from their states.
        # Errors as in `integrate`.
        return self.vary(coefficients, state, thetas, None, restarts)

    def vary(
        self,
        coefficients: Array,
        state: Array,
        thetas: Array,
        direction: Array | None = None,
        restarts: Restarts = (),
    ) -> Variations:
        """Return states and their derivatives at the increasing `thetas`; parameters as in `sample` and `integrate`."""
        # For a flow compiled with the transition matrix, and with as many directions as `direction` has rows.
        self._prepare(coefficients, state, float(thetas[0]), float(thetas[-1]), direction)
        rows = self._sampled(np.asarray(thetas, dtype=float), restarts)
        if not self._switchboard.is_right():
            return self._vary_piecewise(coefficients, state, thetas, direction)
        size, count, unit, width = self.size, len(rows), self._unit, self._width
        transitions = rows[:, size : size * (1 + width)].reshape(count, width, size).transpose(0, 2, 1)
        if self._linear is not None:
            transitions = self._linear_transitions(np.asarray(thetas, dtype=float))
        along = rows[:, size * (1 + width) :][:, : size * self.directions].reshape(count, self.directions, size)
        moved = rows[:, :size] * unit, transitions, along.transpose(0, 2, 1) * unit
        return Variations(*moved, self._switchboard.log, *self._dry_logs)

    @property
    def _dry_logs(self) -> tuple[list[SlipEvent], list[Hold], list[Kink]]:
        """The logs of friction and rigid stops since the start, in units of the model."""
        dry = self._switchboard.dry
        if not dry.count:
            return [], [], []
        return dry.log, dry.hold_log, [kink.scaled(self._unit) for kink in dry.kinks if kink.is_impact]

    def _sampled(
        self, thetas: NDArray[np.float64], restarts: Restarts = (), longest_step: float = math.inf
    ) -> NDArray[np.float64]:
        """Integrate from the first of the increasing angles to the last, and return the state at each, in rows."""
        start, stop, done, rows = float(thetas[0]), float(thetas[-1]), 0, []
        changes = self._switchboard.modes.jumps_between(start, stop) if self.equations.layout.cycles else []
        changes = sorted([*changes, *(each for each in restarts if start < each[0] < stop)], key=itemgetter(0))
        for angle, *change in [*changes, (stop,)]:
            end = int(np.searchsorted(thetas, angle, side="right")) if change else len(thetas)
            rows += self._advance(start, angle, longest_step, thetas[done:end])[1]
            done = end
            if len(change) == 1:
                self._own[:] = change[0] / self._unit
            elif change:
                self._switchboard.change_level(angle, *change)
        return np.concatenate(rows)

    def _advance(
        self, start: float, stop: float, longest_step: float, thetas: NDArray[np.float64] = _NO_ANGLES
    ) -> tuple[int, list[NDArray[np.float64]]]:
        """Integrate to an angle; return the number of steps, and the states at some angles on the way."""
        total, rows = 0, []
        while True:
            outcome, steps, found = self._taylor.propagate(stop, self._max_steps, longest_step, thetas)
            total, thetas = total + steps, thetas[len(found) :]
            rows.append(found)
            if not self._switchboard.land():
                break
        if outcome is not Outcome.REACHED:
            self._refuse(outcome, start)
        return total, rows

    def kinks(self, coefficients: Array, state: Array, stop: float) -> list[float]:
        """Return the angles from 0 to `stop` at which a law has a kink, or a load jumps, in their order."""
        # Without such laws and loads nothing is integrated. Errors as in `integrate`.
        if not self.equations.modes and not self.equations.layout.cycles:
            return []
        self.integrate(coefficients, state, 0.0, stop)
        modes = self._switchboard.modes
        jumps = [angle for angle, *_ in modes.jumps_between(0.0, stop)] if modes.cycle_count else []
        return sorted([*jumps, *(theta for theta, _ in modes.kinks)])

    def survey(
        self, coefficients: Array, state: Array, thetas: Array, restarts: Restarts = ()
    ) -> tuple[Array, list[Turn], Variations]:
        """Return the integrals of positions and squared positions, shape (2, n), all turns, and the sampled motion."""
        # For a flow compiled for a survey. It is sampled at the increasing `thetas`, of which the first is the start,
        # and surveyed up to the last. Errors as in `integrate`, restarts as in `sample`.
        start, stop = float(thetas[0]), float(thetas[-1])
        for longest_step, unseen in _TRIES:
            self._prepare(coefficients, state, start, stop, None)
            self._switchboard.dry.unseen = unseen
            if self._switchboard.chatters:
                self._switchboard.sums(np.asarray(thetas, dtype=float), self._turns.vectors)
            rows = self._sampled(np.asarray(thetas, dtype=float), restarts, longest_step)
            if self._switchboard.is_right():
                states, units = rows[:, : self.size] * self._unit, np.array([[self._unit], [self._unit**2]])
                found = Variations(states, _NONE, _NONE, self._switchboard.log, *self._dry_logs)
                return rows[-1, self.size :].reshape(2, -1) * units, self._turns.found(), found
        self._refuse_missed(state, start, stop)

    def _vary_piecewise(self, coefficients, state, thetas, direction) -> Variations:
        """Compute the result of `vary` point by point with the checks of `integrate`: slower, but never silently wrong.

        Derivatives over an interval continue those before it; without the transition matrix there are none.
        """
        size = self.size
        states, contacts, slips, holds, impacts = [np.asarray(state, dtype=float)], [], [], [], []
        transitions, along = [np.eye(size)], [np.zeros((size, self.directions))]
        for start, stop in pairwise(thetas):
            arc = self.integrate(coefficients, states[-1], float(start), float(stop), direction, sums=False)
            states.append(arc.state)
            contacts += arc.contacts
            slips += arc.slips
            holds += arc.holds
            impacts += arc.impacts
            if arc.transition is not None:
                added = 0.0 if arc.sensitivity is None else arc.sensitivity.reshape(size, self.directions)
                transitions.append(arc.transition @ transitions[-1])
                along.append(arc.transition @ along[-1] + added)
        return Variations(np.array(states), np.array(transitions), np.array(along), contacts, slips, holds, impacts)

    def _prepare(self, coefficients, state, start, stop, direction) -> None:
        Flow.calls += 1
        Flow.matrices += self.has_transition
        self._taylor.time = start
        if self._has_events:
            self._taylor.reset_cooldowns()
        unit = self._unit = self._lengths.of_motion(coefficients, state)
        if unit != 1.0:
            coefficients, state = self._lengths.carried(coefficients, unit), state / unit
            direction = None if direction is None else self._lengths.carried(direction, unit)
        self._parameters[self._length] = unit
        self._own[:], self._rest[:] = state, self._identity
        coefficients.take(self._active, out=self._coefficients, mode="clip")
        if self._changing is not None and direction is not None:
            direction.take(self._changing, out=self._components, mode="clip")
        elif self._changing is not None:
            self._components[:] = 0.0
        periods = max(1.0, (stop - start) / PERIOD)
        self._max_steps = int(_STEPS * periods)
        if self.has_survey:
            self._turns.start(coefficients, unit)
        along = direction.reshape(self.directions, -1) if self.directions and direction is not None else self._still
        self._switchboard.start(coefficients, along, start, int(_EVENTS * periods), unit)
        # otherwise the Taylor series of the first step is finite
        if self.equations.formulas and not math.isfinite(self._taylor.time):
            raise FlowError(
                f"the motion cannot begin in the state {_short(state * unit)}: a formula has no finite value or slope "
                "there. Begin in another state, or write the formula so that it has one: k*(1 - g/sqrt(max(x**2 + "
                "y**2, g**2)))*x instead of k*max(r - g, 0)*x/r with r = sqrt(x**2 + y**2)"
            )

    def _run(self, start: float, stop: float, longest_step: float) -> int:
        total, cycles = 0, self.equations.layout.cycles
        changes = self._switchboard.modes.jumps_between(start, stop) if cycles else []
        for angle, *change in [*changes, (stop,)]:
            total += self._advance(start, angle, longest_step)[0]
            if change:
                self._switchboard.change_level(angle, *change)
        return total

    def _refuse_missed(self, state, start: float, stop: float) -> NoReturn:
        raise FlowError(
            f"a contact event was missed between theta = {start:.6g} and {stop:.6g}, even with short steps, from the "
            f"state {_short(state)}; please report this system"
        )

    def _refuse(self, outcome, start: float) -> NoReturn:
        theta, state = self._taylor.time, self._state[: self.size] * self._unit
        self._switchboard.refuse_rest(theta)
        where = f"at theta = {theta:.6g} (begun at {start:.6g}), in the state {_short(state)}"
        if self._switchboard.event_limit <= 0:
            raise FlowError(
                f"more than {_EVENTS} contact events in a forcing period, {where}: the motion chatters without end"
            )
        if outcome is Outcome.NOT_FINITE or not np.all(np.isfinite(state)) or np.abs(state).max() > 1e12:
            raise FlowError(
                f"the motion diverges to infinity in the interval from theta = {start:.6g}; is there a stiffness, and "
                "a damping that dissipates energy?"
            )
        raise FlowError(
            f"more than {_STEPS} integration steps per forcing period, {where}: the system is too stiff, or the motion "
            "diverges"
        )

    def _linear_transitions(self, thetas: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the transition matrices of the last motion from the first of some angles to each."""
        assert self._linear is not None
        switches = self._switchboard
        return self._linear.along(switches.coefficients, switches.begun, switches.log, thetas, self._unit)

    def _arc(self, steps: int, ends: NDArray[np.float64]) -> Arc:
        size, state, unit = self.size, self._state, self._unit
        transition = sensitivity = None
        if self._linear is not None:
            transition = self._linear_transitions(ends)[1]
        elif self.has_transition:
            transition = state[size : size * (1 + size)].reshape(size, size).T.copy()
        if self.directions == 1:
            sensitivity = state[-size:] * unit
        elif self.directions:
            sensitivity = state[-size * self.directions :].reshape(self.directions, size).T * unit
        reversals = self._taylor.turns() if self.has_transition and self.equations.reversals else None
        if reversals is not None and unit != 1.0:
            reversals[:, 2:] *= unit
        logs = self._switchboard.log, steps, *self._dry_logs
        return Arc(self._own * unit, transition, sensitivity, *logs, reversals, self._linear and self._linear.modes)


def _lent(method: Callable[Concatenate[_Integrator, P], T]) -> Callable[Concatenate[Flow, P], T]:
    """Return a method of a flow that lends one of its integrators to a method of these."""

    @wraps(method)
    def call(flow: Flow, *given: P.args, **options: P.kwargs) -> T:
        return flow._lend(lambda each: method(each, *given, **options))

    return call


class Flow:
    """A compiled flow: see `flow_of`. Several threads may call one at the same time."""

    calls = 0
    """Number of integrations in this process, for tests of work done."""
    matrices = 0
    """Number of those with a transition matrix."""

    def __init__(self, equations: Equations, *, transition: bool = False, survey: bool = False) -> None:
        self.equations = equations
        self.size = equations.layout.structure.state_size
        self.has_transition, self.has_survey, self.directions = transition, survey, len(equations.varying)
        # whether the transition matrix is integrated with the state, or follows from the events alone
        self.is_linear = transition and equations.layout.structure.size >= LARGE and LinearTransition.serves(equations)
        integrated = transition and not self.is_linear
        columns = (self.size if integrated else 0) + self.directions
        # from here on a transition matrix costs as much as seven to sixty motions
        self.is_dear = self.size >= (DEAR if integrated else DEAR_LINEAR)
        events = {
            **{("switch", index): equations.gap(*switch) for index, switch in enumerate(equations.switches)},
            **{("mode", index): equations.guard(*mode) for index, mode in enumerate(equations.modes)},
            **{
                ("slip", 2 * place + number): guard
                for place in range(len(equations.dry))
                for number, guard in enumerate(equations.slip_guards(place))
            },
            **{("restart", index): place for index, place in enumerate(equations.restarts)},
        }
        self.events = list(events)
        self.program = Program(
            equations.first_coefficient + len(equations.active),
            equations.state,
            equations.integrals() if survey else (),
            columns=columns,
            lane=equations.column if columns else (),
            forced=[equations.forcing(index) for index in range(self.directions)],
            events=list(events.values()),
            turns=[rate for _, rate in equations.turning] if survey else equations.reversals if transition else (),
        )
        self.readings = CompiledReadings(equations) if equations.dry or equations.stops else None
        self._lengths = LengthUnit(equations.layout)
        self._idle: list[_Integrator] = []

    def _lend(self, call: Callable[[_Integrator], T]) -> T:
        integrator = self._take()
        try:
            return call(integrator)
        finally:
            self._idle.append(integrator)

    def _take(self) -> _Integrator:
        """Take an integrator for one call, which no other thread uses until it is given back."""
        try:
            return self._idle.pop()
        except IndexError:
            return _Integrator(self)

    integrate, sample = _lent(_Integrator.integrate), _lent(_Integrator.sample)
    vary, survey, kinks = _lent(_Integrator.vary), _lent(_Integrator.survey), _lent(_Integrator.kinks)


def flow_of(system: System, *parameters: str | tuple[str, ...], transition: bool = False, survey: bool = False) -> Flow:
    """Return the compiled flow of a system; systems of equal structure and pattern share one."""
    pattern, directions = coefficients_of(system) != 0.0, varying(system, parameters)
    for mask in directions:
        pattern |= mask
    masks = reachable_masks(system.structure, tuple(mask.tobytes() for mask in (pattern, *directions)))
    with _compiling:  # one thread compiles a flow, the others wait for it
        return _compile(system.structure, masks, transition, survey)


def flow_with(layout: CoefficientLayout, coefficients: Array, *ways: Array, transition: bool = False) -> Flow:
    """Return the compiled flow of the system that has some coefficients, with derivatives along changes of them."""
    masks = np.any([coefficients, *ways], axis=0), *(way != 0.0 for way in ways)
    with _compiling:
        found = reachable_masks(layout.assembled, tuple(mask.tobytes() for mask in masks))
        return _compile(layout.assembled, found, transition, False)


@lru_cache(maxsize=_MOST)
def _compile(structure: Structure, masks: tuple[bytes, ...], transition: bool, survey: bool) -> Flow:
    pattern, *directions = (np.frombuffer(mask, dtype=bool) for mask in masks)
    equations = Equations(layout_of(structure), pattern, tuple(np.flatnonzero(mask) for mask in directions))
    return Flow(equations, transition=transition, survey=survey)


def _short(state: NDArray[np.float64]) -> str:
    shown = ", ".join(f"{value:.6g}" for value in state[:6])
    return f"({shown}{', ...' if len(state) > 6 else ''})"

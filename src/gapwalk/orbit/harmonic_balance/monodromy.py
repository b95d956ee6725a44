"""The monodromy matrix of a balanced motion by Magnus' series.

The equations are linearised about the motion (`Linearised`). The unknowns are the changes of the positions and of the
momenta ``p = v + sum_k D_k P_k(x)`` (over mass), where ``g + dP/dt`` is the force of a contact (see `contact_forces`).
Unlike velocities, momenta do not jump where a viscous contact closes, and their equations

    q' = p - sum_k D_k P_k'(x) e_k q,    p' = -(A + sum_k D_k g_k'(x) e_k) q - B q'

need no velocity of the motion. At any one time the two kinds of unknowns differ by a fixed matrix, so the multipliers
are the same. The matrix of the equations varies with the angle and jumps at breakpoints. A force f by a formula, of any
deflections and their rates, adds ``-D df/dx e q - D df/dx' e v`` to p', with the velocities v that belong to p.

`monodromy` takes one pass over the period, by steps of Magnus' series between contact events. Other ways are that of
`gapwalk.orbit.harmonic_balance.balance_equation`, and `modal_monodromy` for many degrees of freedom.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from gapwalk.orbit.harmonic_balance.compliance import Poles
from gapwalk.orbit.harmonic_balance.contact_forces import Laws
from gapwalk.orbit.harmonic_balance.jenkins_forces import NO_MEMORY, TURN, Change, DryForce, Memory
from gapwalk.orbit.harmonic_balance.kernels import kernel, part
from gapwalk.orbit.harmonic_balance.linear_part import Linear, kicks, waves
from gapwalk.orbit.harmonic_balance.sampled_forces import Pairs

# Changes of a motion with Jenkins elements: places of sliders among the unknowns of the variational equations.
#
# While an element sticks, its slider keeps its place, and a change of that place pushes the momenta by the stiffness.
# In slip it follows a bound, and what it was before is forgotten. So it suffices to set its change where it comes to
# rest, at its pins: to that of the bound, a function of the changes of positions and momenta. Where the limit falls
# below the force, the force jumps; the angle of that event moves with the host, and so the momenta jump with the
# positions.

Array = NDArray[np.float64]

_ASIDE = 1e-9  # radians from a break, at which dampers beside it are read


@dataclass(frozen=True, eq=False)
class SliderChanges:
    """The changes of the sliders of all elements along a motion."""

    #: memory, linear, laws: The elements, the linear part, and the contacts.
    memory: Memory
    linear: Linear
    laws: Laws
    lines: NDArray[np.complex128]  #: shape (deflections, K + 1): The motion.
    period: int  #: m.

    def wider(self, matrices: Array) -> Array:
        """Add the places of the sliders to matrices of shape (..., 2n, 2n), as rows and columns of zeros."""
        more = len(self.memory)
        return np.pad(matrices, [(0, 0)] * (matrices.ndim - 2) + [(0, more), (0, more)])

    def pushes(self) -> Array:
        """Return the matrix of what the place of each slider adds to the momenta in stick, shape (elements, ...)."""
        n, found = len(self.linear.stiffness), []
        for number, force in enumerate(self.memory.forces):
            matrix = np.zeros((2 * n + len(self.memory),) * 2)
            matrix[n : 2 * n, 2 * n + number] = force.stiffness[0] * self.linear.contacts[:, force.slider.element.place]
            found.append(matrix)
        return np.array(found)

    def resets(self) -> tuple[Array, Array]:
        """Return angles at which changes of the motion change at once, and the differences of the matrices from 1."""
        n, found = len(self.linear.stiffness), []
        size = 2 * n + len(self.memory)
        for number, force in enumerate(self.memory.forces):
            if force.never_slips:  # its place is kept: that is no change of the motion
                matrix = np.zeros((size, size))
                matrix[2 * n + number, 2 * n + number] = -1.0
                found.append((TURN, 2, matrix))
                continue
            for pin in (force.pins[each] for each in {stick.pin for stick in force.sticks}):
                change, matrix = force.change_of(pin), np.zeros((size, size))
                aside = 0.0 if pin.place < 0 else -_ASIDE if pin.is_before else _ASIDE
                matrix[2 * n + number, : 2 * n] = self._row(force, change, aside)
                matrix[2 * n + number, 2 * n + number] = -1.0
                found.append((pin.phi % TURN or TURN, 0 if pin.is_before else 2, matrix))
            for leap in force.leaps:
                change, matrix = force.shift_of(leap.place), np.zeros((size, size))
                late = self._row(force, change, -_ASIDE) / force.slider.motion.frequency  # over time
                pushed = self.linear.contacts[:, force.slider.element.place] * (-force.stiffness[0] * leap.change)
                matrix[n : 2 * n, : 2 * n] = np.outer(pushed, late)
                found.append((change.phi % TURN or TURN, 1, matrix))
        found.sort(key=lambda each: each[:2])
        return np.array([each[0] for each in found]), np.array([each[2] for each in found]).reshape(
            len(found), size, size
        )

    def _row(self, force: DryForce, change: Change, aside: float) -> Array:
        """Return a change as a function of the changes of positions and momenta, shape (2n,)."""
        n, element, linear = len(self.linear.stiffness), force.slider.element, self.linear
        row = np.zeros(2 * n)
        row[:n] = change.own * linear.deflections[element.place]
        if element.host >= 0:
            other = linear.deflections[element.host_place]
            row[:n] += change.host * other
            if change.host_rate:
                row[n:] += change.host_rate * other
                row[:n] -= change.host_rate * (other @ self._dampers(change.phi + aside))
        return row

    def _dampers(self, phi: float) -> Array:
        """Return the sum of ``D_k P_k' e_k`` at an angle, with which velocities follow from momenta; shape (n, n)."""
        x = (waves(np.array([phi]), self.lines.shape[1] - 1) @ self.lines.T).real
        dampers = self.laws.tangents(x, np.array([phi % TURN]), self.period)[1][0]
        return (self.linear.contacts * dampers) @ self.linear.deflections


# The monodromy matrix of a balanced motion of many degrees of freedom, in the eigenvectors of the linear part.
#
# Between two contacts each eigenvector changes independently and exactly. While contacts are closed, their forces are
# determined by a few numbers for each contact and step, so a step changes the matrix by one of low rank. The cost
# grows with the square of the number of eigenvectors, not with its cube.

_MODAL_REACH = 0.4  # largest angle by which the fastest eigenvector, or a closed contact, turns in one step
_MODAL_FINE = 4  # smallest number of steps per shortest wave of the motion
_TWO_NODES = 0.5 + np.sqrt(1.0 / 12.0) * np.array([-1.0, 1.0])  # Gauss and Legendre's two, on 0 ... 1
_POINTS, _WEIGHTS = (0.5 * each for each in np.polynomial.legendre.leggauss(4))
_POINTS = _POINTS + 0.5


def modal_monodromy(
    poles: Poles,
    shift: NDArray[np.float64],
    laws: Laws,
    lines: NDArray[np.complex128],
    breaks: NDArray[np.float64],
    length: float,
    period: int,
) -> NDArray[np.float64]:
    """Compute the monodromy matrix of the amplitudes of the eigenvectors, shape (poles, poles)."""
    # Shapes: `shift` (contacts,).
    #
    # With ``z' = lambda z - (inputs g' + lambda inputs P') x`` and ``x = deflections z`` (P as in
    # `gapwalk.orbit.harmonic_balance.monodromy`), the forces over a step are interpolated between two Gauss nodes, at
    # which they are solved for: an exponential method of collocation, of fourth order, exact for the linear part.
    #
    # Of a pair of conjugate eigenvalues one is used, with real and imaginary part of its amplitude.
    times, spring, damper = _steps(poles, shift, laws, lines, breaks, length, period)
    half = poles.values.imag >= 0.0
    values, inputs = poles.values[half], poles.inputs[half]
    paired = values.imag > 0.0
    deflections = poles.deflections[:, half] * (1.0 + paired)
    ends = np.exp(times[:, None] * values)
    outer = _weights(values, times, 1.0)
    solution = np.linalg.inv(_coupling(poles.residual, values, inputs, deflections, times, spring, damper))
    identity = np.eye(len(values), dtype=np.complex128)
    matrix = np.concatenate((identity, 1j * identity[:, paired]), axis=1)
    touched = (spring != 0.0).any(axis=1) | (damper != 0.0).any(axis=1)
    for p, active in enumerate(touched):
        if not active.any():
            matrix *= ends[p][:, None]
            continue
        both = np.concatenate((active, active))
        rows = np.concatenate([deflections[active] * np.exp(times[p] * node * values) for node in _TWO_NODES])
        at_nodes = solution[p][both][:, both] @ (rows @ matrix).real
        tangents = spring[p][:, active, None] + damper[p][:, active, None] * values
        pushes = (tangents * inputs[:, active].T * outer[p][:, None]).reshape(-1, len(values)).T
        matrix *= ends[p][:, None]
        matrix.real -= pushes.real @ at_nodes
        matrix.imag -= pushes.imag @ at_nodes
    return np.vstack((matrix.real, matrix.imag[paired]))


def _steps(poles: Poles, shift, laws: Laws, lines, breaks, length: float, period: int):
    """Return the steps' lengths in time, and the tangents of the contacts' springs and dampers at their nodes."""
    # There is one step for each interval in which no contact is closed and no share is moved.
    slopes = np.bincount(laws.contact, laws.stiffness, len(lines))
    contact = np.sqrt(np.abs(np.diagonal((poles.deflections * poles.values) @ poles.inputs)) * slopes).max(initial=0.0)
    fastest = max(float(np.abs(poles.values).max()), float(contact))
    count = max(8, _MODAL_FINE * (lines.shape[1] - 1), int(np.ceil(length * fastest / _MODAL_REACH)))
    knots = np.sort(np.concatenate((2.0 * np.pi / count * np.arange(count + 1), breaks)))
    knots = knots[np.append(True, np.diff(knots) > 0.0)]
    widths = np.diff(knots)
    phi = knots[:-1, None] + widths[:, None] * _TWO_NODES
    deflections = (waves(phi, lines.shape[1] - 1) @ lines.T).real
    spring, damper = laws.tangents(deflections, phi, period)
    spring = spring - shift
    free = ~((spring != 0.0).any(axis=(1, 2)) | (damper != 0.0).any(axis=(1, 2)))
    # consecutive steps without contact forces are joined into one
    first = np.flatnonzero(~(free & np.append(False, free[:-1])))
    times = np.add.reduceat(widths, first) * (length / (2.0 * np.pi))
    return times, spring[first], damper[first]


def _weights(values: NDArray[np.complex128], times: NDArray[np.float64], end: float) -> NDArray[np.complex128]:
    """Compute the effect of forces linear between two nodes up to a share `end` of a step, shape (steps, 2, poles)."""
    # It is the integral of ``exp(lambda (end h - s)) l_j(s)`` over s from 0 to ``end h``.
    s = end * _POINTS
    gains = np.exp(times[:, None, None] * (end - s)[:, None] * values)
    other = _TWO_NODES[::-1]
    shapes = (end * _WEIGHTS)[:, None] * (s[:, None] - other) / (_TWO_NODES - other)
    weights = np.tensordot(gains, shapes.astype(complex), axes=(1, 0)).transpose(0, 2, 1) * times[:, None, None]
    return np.asarray(weights, dtype=np.complex128)


def _coupling(residual, values, inputs, deflections, times, spring, damper) -> NDArray[np.float64]:
    """Compute how deflections at the nodes of a step affect each other, shape (steps, 2 contacts, 2 contacts)."""
    contacts = len(deflections)
    residues = (deflections.T[:, :, None] * inputs[:, None, :]).reshape(len(values), -1)
    coupling = np.tile(np.eye(2 * contacts), (len(times), 1, 1))
    for i, node in enumerate(_TWO_NODES):
        inner = _weights(values, times, node)
        for j in range(2):
            flexible = (inner[:, j] @ residues).real.reshape(-1, contacts, contacts)
            moving = ((inner[:, j] * values) @ residues).real.reshape(-1, contacts, contacts)
            part = coupling[:, i * contacts : (i + 1) * contacts, j * contacts : (j + 1) * contacts]
            part += (flexible + (i == j) * residual) * spring[:, None, j]
            part += moving * damper[:, None, j]
    return coupling


_REACH = 0.7  # largest angle by which the fastest part of the system turns in one step
_FINE = 2  # smallest number of steps per shortest wave of the motion
_FINE_SAMPLED = 4  # the same with forces by formulas, which have shorter waves than the motion
_NODES = 0.5 + np.sqrt(0.15) * np.array([-1.0, 0.0, 1.0])  # Gauss and Legendre's, on 0 ... 1
_FEWEST = 8
_NO_KICKS = np.zeros(0)
_LANES = 16  # steps computed together: their values fill the registers, and their matrices the cache
_INVERSE = 1.0 / np.cumprod([1.0, *range(1, 12)])  # of the factorials


@dataclass(frozen=True)
class Linearised:
    """The generator of the linearised equations over time, ``steady + sum_k g_k' springs_k + P_k' dampers_k``."""

    #: linear, laws: The system.
    linear: Linear
    laws: Laws

    @cached_property
    def steady(self) -> NDArray[np.float64]:
        """Constant part of the matrix, shape (2n, 2n)."""
        n = len(self.linear.stiffness)
        return np.block([[np.zeros((n, n)), np.eye(n)], [-self.linear.stiffness, -self.linear.damping]])

    @cached_property
    def parts(self) -> NDArray[np.float64]:
        """The matrices of the springs, then of the dampers, shape (2 contacts, 2n, 2n)."""
        linear, n = self.linear, len(self.linear.stiffness)
        contacts = linear.contacts.shape[1]
        parts = np.zeros((2 * contacts, 2 * n, 2 * n))
        for k in range(contacts):
            along = np.outer(linear.contacts[:, k], linear.deflections[k])
            parts[k, n:, :n] = -along
            parts[contacts + k, :n, :n] = -along
            parts[contacts + k, n:, :n] = linear.damping @ along
        return parts

    @cached_property
    def damped(self) -> NDArray[np.intp]:
        """The contacts that have a P."""
        acts = self.laws.polynomials[:, 1].any(axis=1) | self.laws.waves[:, 1].any(axis=(1, 2))
        return np.unique(self.laws.contact[acts])

    def pair_parts(self, pairs: Pairs) -> NDArray[np.float64]:
        """Return matrices of derivatives of formulas, shape (pairs (2 + damped contacts), 2n, 2n)."""
        # They belong to all derivatives by deflections, to those by rates, and to the product of each of these with
        # each P' of a damped contact.
        linear, n = self.linear, len(self.linear.stiffness)
        along = [np.outer(linear.contacts[:, f], linear.deflections[a]) for f, a in zip(*pairs[:2], strict=True)]
        parts = np.zeros((2 + len(self.damped), len(along), 2 * n, 2 * n))
        for place, each in enumerate(along):
            parts[0, place, n:, :n] = parts[1, place, n:, n:] = -each
            for number, k in enumerate(self.damped, start=2):
                parts[number, place, n:, :n] = each @ np.outer(linear.contacts[:, k], linear.deflections[k])
        return parts.reshape(-1, 2 * n, 2 * n)

    @cached_property
    def rate(self) -> float:
        """Estimate of the highest frequency while every contact is closed."""
        return self.rate_with(0.0, 0.0)

    def rate_with(self, springs: NDArray[np.float64] | float, dampers: NDArray[np.float64] | float) -> float:
        """Estimate it with other matrices added to those of stiffness and damping, of positive numbers."""
        linear = self.linear
        # slopes of each contact's stages on one side, at small penetration
        slopes = 0.5 * np.bincount(self.laws.contact, self.laws.stiffness, linear.contacts.shape[1]).astype(float)
        contacts = np.abs(linear.contacts) @ (slopes[:, None] * np.abs(linear.deflections))
        stiffness = np.abs(linear.stiffness) + contacts + springs
        damping = np.abs(linear.damping) + dampers
        return float(np.sqrt(stiffness.sum(axis=1).max()) + damping.sum(axis=1).max())


def monodromy(
    linearised: Linearised,
    lines: NDArray[np.complex128],
    breaks: NDArray[np.float64],
    length: float,
    period: int,
    pairs: Pairs,
    memory: Memory = NO_MEMORY,
) -> NDArray[np.float64]:
    """Compute the monodromy matrix of positions and momenta over one period, shape (2n, 2n)."""
    # The places of the sliders of Jenkins elements follow.
    #
    # Shapes: `lines` (deflections, K + 1).
    #
    # Between two contact events the coefficients are smooth. Magnus' series of sixth order (Blanes, Casas, Oteo and Ros
    # 2009, Physics Reports 470, section 5.4) evaluates the generator at three Gauss nodes of each step; it is exact for
    # a constant generator.
    laws, fine, rate = linearised.laws, _FINE, linearised.rate
    if len(pairs.forces):
        fine, rate = _FINE_SAMPLED, _rate_of_pairs(linearised, pairs)
    steps = max(_FEWEST, fine * (lines.shape[1] - 1), int(np.ceil(length * rate / _REACH)))
    size = 2 * len(linearised.linear.stiffness)
    more, values = np.zeros((0, size, size)), np.zeros((0, 3, 1))
    if len(pairs.forces):
        more, values = linearised.pair_parts(pairs), _values_of_pairs(linearised, lines, steps, breaks, period, memory)
    jumping = (_NO_KICKS, np.zeros((0, size, size)))
    if laws.has_kicks:
        jumping = kicks(lines, laws, period, linearised.linear)
    steady, parts = linearised.steady, linearised.parts
    if memory.forces:
        sliders = SliderChanges(memory, linearised.linear, laws, lines, period)
        angles, resets = sliders.resets()
        jumping = np.concatenate((jumping[0], angles)), np.concatenate((sliders.wider(jumping[1]), resets))
        steady, parts, more = map(sliders.wider, (steady, parts, more))
        more = np.concatenate((more, sliders.pushes()))
    variation = *laws.over(period), laws.wave_rates
    own = steady, parts, *laws.switches, laws.rates
    return _transition(lines, steps, breaks, length, *own, *variation, more, values, *jumping)


def _rate_of_pairs(linearised: Linearised, pairs: Pairs) -> float:
    """Estimate the highest frequency with forces by formulas, from bounds of their derivatives."""
    bounds = np.abs(pairs.spectra)
    bounds[:, :, 1:] *= 2.0
    springs, dampers = np.zeros((2, *linearised.linear.stiffness.shape))
    for f, a, (spring, damper) in zip(pairs.forces, pairs.arguments, bounds.sum(axis=2), strict=True):
        along = np.abs(np.outer(linearised.linear.contacts[:, f], linearised.linear.deflections[a]))
        springs += spring * along
        dampers += damper * along
    return linearised.rate_with(springs, dampers)


def _values_of_pairs(
    linearised: Linearised,
    lines: NDArray[np.complex128],
    steps: int,
    breaks: NDArray[np.float64],
    period: int,
    memory: Memory,
) -> NDArray[np.float64]:
    """Return the factors of `Linearised.pair_parts` at the nodes of all steps, shape (parts, 3, steps)."""
    # Then follows 1 for each Jenkins element that sticks.
    laws = linearised.laws
    knots = np.sort(np.concatenate((2.0 * np.pi / steps * np.arange(steps + 1), breaks)))
    phi = (knots[:-1] + _NODES[:, None] * np.diff(knots)).ravel()
    found = [] if laws.formulas is None else [laws.formulas.tangents(lines, phi, period)]
    tangents = np.concatenate([*found, *(each.tangents(phi) for each in memory.forces)])
    groups = [tangents[:, 0], tangents[:, 1]]
    if len(linearised.damped):
        dampers = laws.tangents((waves(phi, lines.shape[1] - 1) @ lines.T).real, phi, period)[1]
        groups += [tangents[:, 1] * dampers[:, k] for k in linearised.damped]
    groups += [each.sticks_at(phi)[None] for each in memory.forces]
    return np.concatenate(groups).reshape(-1, 3, len(knots) - 1)


@part
def _knots(steps, breaks):
    """Return the angles at which steps end: evenly over the period, and at breakpoints."""
    knots = np.empty(steps + 1 + len(breaks))
    for index in range(steps + 1):
        knots[index] = 2.0 * np.pi / steps * index
    for number in range(len(breaks)):
        place = steps + 1 + number
        while knots[place - 1] > breaks[number]:
            knots[place] = knots[place - 1]
            place -= 1
        knots[place] = breaks[number]
    return knots


@part
def _multiply(a, b, result):
    """Multiply square matrices; here and below, the last dimension is that of the steps."""
    size = len(a)
    for i in range(size):
        for j in range(size):
            for s in range(_LANES):
                result[i, j, s] = a[i, 0, s] * b[0, j, s]
            for k in range(1, size):
                for s in range(_LANES):
                    result[i, j, s] += a[i, k, s] * b[k, j, s]


@part
def _combine(a, x, b, y, c, z, result):
    """Compute the sum of three matrices with factors."""
    for i in range(len(x)):
        for j in range(len(x)):
            for s in range(_LANES):
                result[i, j, s] = a * x[i, j, s] + b * y[i, j, s] + c * z[i, j, s]


@part
def _commute(a, b, spare, result):
    """Compute commutators."""
    _multiply(a, b, result)
    _multiply(b, a, spare)
    _combine(1.0, result, -1.0, spare, 0.0, spare, result)


@part
def _logarithms(h, nodes, work, result):
    """Compute the logarithms of the steps' transitions, from the generators at their three nodes."""
    size = len(result)
    second, third, inner, outer, spare, other = work[0], work[1], work[2], work[3], work[4], work[5]
    for a in range(size):
        for b in range(size):
            for s in range(_LANES):
                start, middle, end = nodes[0, a, b, s], nodes[1, a, b, s], nodes[2, a, b, s]
                result[a, b, s] = h[s] * middle
                second[a, b, s] = h[s] * (np.sqrt(15.0) / 3.0) * (end - start)
                third[a, b, s] = h[s] * (10.0 / 3.0) * (end - 2.0 * middle + start)
    _commute(result, second, spare, inner)
    _combine(2.0, third, 1.0, inner, 0.0, inner, other)
    _commute(result, other, spare, outer)
    _combine(1.0, second, -1.0 / 60.0, outer, 0.0, outer, outer)
    _combine(1.0, inner, -1.0, third, -20.0, result, other)
    _commute(other, outer, spare, inner)
    _combine(1.0, result, 1.0 / 12.0, third, 1.0 / 240.0, inner, result)


@part
def _exponentials(x, work, result):
    """Compute exponentials of small matrices, by Taylor's polynomial of degree 11 in five products."""
    square, cube, product = work[0], work[1], work[2]
    _multiply(x, x, square)
    _multiply(square, x, cube)
    for first in (9, 6, 3, 0):
        if first < 9:
            _multiply(result, cube, product)
        _combine(1.0 if first < 9 else 0.0, product, _INVERSE[first + 1], x, _INVERSE[first + 2], square, result)
        for a in range(len(x)):
            for s in range(_LANES):
                result[a, a, s] += _INVERSE[first]


@part
def _deflections(lines, phi, result):
    """Evaluate a function with given lines at some angles."""
    cosines, sines, p, q = np.empty(_LANES), np.empty(_LANES), np.empty(_LANES), np.empty(_LANES)
    for s in range(_LANES):
        cosines[s], sines[s], p[s], q[s], result[s] = np.cos(phi[s]), np.sin(phi[s]), 1.0, 0.0, lines[0].real
    for k in range(1, len(lines)):
        re, im = lines[k].real, lines[k].imag
        for s in range(_LANES):
            p[s], q[s] = p[s] * cosines[s] - q[s] * sines[s], p[s] * sines[s] + q[s] * cosines[s]
            result[s] += re * p[s] - im * q[s]


@part
def _polynomial(coefficients, x):
    value = 0.0
    for power in range(len(coefficients) - 1, -1, -1):
        value = value * x + coefficients[power]
    return value


@part
def _is_open(phi, gate, first_open, jumps):
    """Return 1 if a gate is open at an angle."""
    opened = first_open[gate]
    for jump in range(jumps.shape[1]):
        if jumps[0, jump] > phi:
            break
        if int(jumps[2, jump]) == gate:
            opened = jumps[1, jump]
    return opened


@part
def _vary(orders, phi, result):
    """Compute the cosines, then the sines, of some orders at some angles."""
    for place in range(len(orders)):
        for s in range(_LANES):
            result[place, s] = np.cos(orders[place] * phi[s])
            result[len(orders) + place, s] = np.sin(orders[place] * phi[s])


@part
def _wave(coefficients, x, lines, s):
    """Evaluate what is added to a polynomial over the angle."""
    value = 0.0
    for power in range(len(coefficients) - 1, -1, -1):
        value *= x
        for place in range(coefficients.shape[1]):
            value += coefficients[power, place] * lines[place, s]
    return value


@part
def _add_more(more, values, first, result):
    """Add some matrices with their values in each step."""
    for m in range(len(more)):
        for a in range(more.shape[1]):
            for b in range(more.shape[1]):
                if more[m, a, b] != 0.0:
                    for s in range(_LANES):
                        result[a, b, s] += more[m, a, b] * values[m, min(first + s, values.shape[1] - 1)]


@part
def _add_slopes(depth, j, rates, wave_rates, waves, s, slopes):
    """Add the slopes of one row of polynomials at a depth."""
    for kind in range(2):
        slopes[kind, s] += _polynomial(rates[j, kind], depth)
        if len(waves):
            slopes[kind, s] += _wave(wave_rates[j, kind], depth, waves, s)


@part
def _generate(
    lines,
    phi,
    steady,
    parts,
    contact,
    sign,
    clearance,
    rates,
    orders,
    gate,
    first_open,
    jumps,
    wave_rates,
    waves,
    more,
    values,
    first,
    result,
):
    """Compute the generators at some angles; `values` are those of `more`, from the step `first` on."""
    x = np.empty(_LANES)
    for a in range(len(steady)):
        for b in range(len(steady)):
            for s in range(_LANES):
                result[a, b, s] = steady[a, b]
    _vary(orders, phi, waves)
    for c in range(len(lines)):
        _deflections(lines[c], phi, x)
        slopes = np.zeros((2, _LANES))
        for j in range(len(contact)):
            if contact[j] == c:
                for s in range(_LANES):
                    depth = sign[j] * x[s] - clearance[j]
                    if depth > 0.0 and (gate[j] < 0 or _is_open(phi[s], gate[j], first_open, jumps) > 0.0):
                        _add_slopes(depth, j, rates, wave_rates, waves, s, slopes)
        for kind in range(2):
            for a in range(len(steady)):
                for b in range(len(steady)):
                    part = parts[kind * len(lines) + c, a, b]
                    if part != 0.0:
                        for s in range(_LANES):
                            result[a, b, s] += part * slopes[kind, s]
    _add_more(more, values, first, result)


@part
def _kick(knots, knot, angles, changes, matrix, moved):
    """Let the unknowns jump with one another, by one change after the other, at the last knot of each angle."""
    size = len(matrix)
    if knot + 1 < len(knots) and knots[knot + 1] == knots[knot]:
        return
    for kick in range(len(angles)):
        if angles[kick] == knots[knot]:
            for a in range(size):
                for b in range(size):
                    moved[a, b] = matrix[a, b]
                    for k in range(size):
                        moved[a, b] += changes[kick, a, k] * matrix[k, b]
            for a in range(size):
                for b in range(size):
                    matrix[a, b] = moved[a, b]


@kernel(
    "f8[:, ::1](c16[:, ::1], i8, f8[::1], f8, f8[:, ::1], f8[:, :, ::1], i8[::1], f8[::1], f8[::1], f8[:, :, ::1],"
    " i8[::1], i8[::1], f8[::1], f8[:, ::1], f8[:, :, :, ::1], f8[:, :, ::1], f8[:, :, ::1],"
    " f8[::1], f8[:, :, ::1])"
)
def _transition(
    lines,
    steps,
    breaks,
    length,
    steady,
    parts,
    contact,
    sign,
    clearance,
    rates,
    orders,
    gate,
    first_open,
    jumps,
    wave_rates,
    more,
    values,
    kick_angles,
    kick_matrices,
):
    """Multiply the transitions of all steps, some of them at a time."""
    size, knots = len(steady), _knots(steps, breaks)
    matrix, moved = np.zeros((size, size)), np.zeros((size, size))
    for a in range(size):
        matrix[a, a] = 1.0
    nodes, work = np.zeros((3, size, size, _LANES)), np.zeros((6, size, size, _LANES))
    logarithms, exponentials = np.zeros((size, size, _LANES)), np.zeros((size, size, _LANES))
    starts, widths, phi, times = np.zeros(_LANES), np.zeros(_LANES), np.zeros(_LANES), np.zeros(_LANES)
    waves = np.empty((2 * len(orders), _LANES))
    for first in range(0, len(knots) - 1, _LANES):
        for s in range(_LANES):  # steps beyond the last one have no width
            step = min(first + s, len(knots) - 1)
            starts[s], widths[s] = knots[step], knots[min(step + 1, len(knots) - 1)] - knots[step]
        for node in range(3):
            for s in range(_LANES):
                phi[s] = starts[s] + widths[s] * _NODES[node]
                times[s] = widths[s] * length / (2.0 * np.pi)
            _generate(
                lines,
                phi,
                steady,
                parts,
                contact,
                sign,
                clearance,
                rates,
                orders,
                gate,
                first_open,
                jumps,
                wave_rates,
                waves,
                more,
                values[:, node],
                first,
                nodes[node],
            )
        _logarithms(times, nodes, work, logarithms)
        _exponentials(logarithms, work, exponentials)
        for s in range(min(_LANES, len(knots) - 1 - first)):
            for a in range(size):
                for b in range(size):
                    moved[a, b] = 0.0
                    for k in range(size):
                        moved[a, b] += exponentials[a, k, s] * matrix[k, b]
            matrix, moved = moved, matrix
            if len(kick_angles):
                _kick(knots, first + s + 1, kick_angles, kick_matrices, matrix, moved)
    return matrix

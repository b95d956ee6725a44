"""Normal forms of folds, flips and Neimark-Sacker points: coefficients, criticality, and amplitudes beyond.

The map of the state over the period of the motion is reduced to the critical direction q, with A q = mu q and
p^* A = mu p^*, p^* q = 1. With derivatives B and C of second and third order, and R(z) = (z - A)^-1, the terms are

    fold             s -> s + rate d + c s^2                    c = p B(q, q) / 2
    flip             s -> (-1 + rate d) s + c s^3               c = p [C(q, q, q) / 6 + B(q, R(1) B(q, q)) / 2]
    Neimark-Sacker   |z| -> (1 + rate d) |z| + c |z|^3          c = Re(p* [C(q, q, q*) / 2 + B(q, R(1) B(q, q*))
                                                                    + B(q*, R(mu^2) B(q, q)) / 2] / mu)

for a change d of the parameter (Kuznetsov, Elements of Applied Bifurcation Theory, sections 5.4 and 10.2). So the
amplitude beyond is ``sqrt(-rate d / c)`` in each case. B and C along q are differences of exact transition matrices.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from gapwalk.errors import ModelError, NumericalError
from gapwalk.flow.contact_events import ContactEvent
from gapwalk.flow.equations import magnitude
from gapwalk.orbit.shooting import Shooting

if TYPE_CHECKING:
    from gapwalk.bifurcation.special_point import SpecialPoint
    from gapwalk.flow.flow import Arc

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
Matrices = Callable[[NDArray[Any], float], Array]
"""Derivative of a map by its state, at a displacement of the state and of the parameter."""

PLACES = (-2.0, -1.0, 1.0, 2.0)
"""Places of fourth-order differences, with their weights for the first and the second derivative."""
FIRST = np.array([1.0, -8.0, 8.0, -1.0]) / 12.0
SECOND = np.array([-1.0, 16.0, 16.0, -1.0]) / 12.0
SECOND_HERE = -30.0 / 12.0
_ALIKE = 0.05  # relative change of an impact velocity within which displaced orbits make the same contact
_LONGEST, _SHORTER, _TRIED = 0.02, 0.25, 16  # displacements, as a share of the motion, longest first
_ENOUGH = 1e-9  # relative change from one displacement to the next at which no shorter one is tried
_CRITICAL = 1e-4  # distance of the multiplier from criticality up to which a motion is at such a point
_SINGLE = 1e-7  # second singular value below which several multipliers are critical at once
_SURE = 0.05  # relative error of the coefficient up to which its sign counts
_NOT_ALIKE = "a contact grazes within the displacement"


@dataclass(frozen=True, eq=False)
class NormalForm:
    """Leading terms of the map of the motion near a fold, a flip or a Neimark-Sacker point.

    Examples
    --------
    >>> form = fold.normal_form
    >>> form.criticality, form.error < 1e-6 * abs(form.coefficient)
    ('opens to lower values', True)
    >>> form.predicted(-1e-6).shape  # how far apart each position and rate is from that at the fold
    (2,)
    """

    #: Coefficient c of the leading term, quadratic at a fold, otherwise cubic; it belongs to the scale of the mode.
    coefficient: float
    error: float  #: Estimated error of the coefficient.
    rate: float  #: Derivative by the parameter: at a fold of the map along the mode, otherwise of |multiplier|.
    #: shape (N,): Critical direction q of the state at theta = 0, positions, then rates; complex for a pair.
    mode: Complex
    criticality: str  #: As `SpecialPoint.nature`; empty if the sign of the coefficient is not sure.

    def predicted(self, distance: float) -> Array:
        """Return the amplitude of what leaves the point, at a distance of the parameter from it.

        Parameters
        ----------
        distance
            Value of the parameter less that of the point.

        Returns
        -------
        array, shape (N,)
            For each entry of the state at theta = 0: at a fold, how far the two motions are on either side of the one
            at the fold; at a flip, half the difference of the two states of the doubled motion one period apart; at a
            Neimark-Sacker point, half the width of the invariant curve. nan on the side on which nothing leaves.
        """
        square = -self.rate * distance / self.coefficient if self.coefficient else math.nan
        size = math.sqrt(square) if square >= 0.0 else math.nan
        return (2.0 if np.iscomplexobj(self.mode) else 1.0) * size * np.abs(self.mode)


def normal_form_of_map(matrices: Matrices, slope: Array, multiplier: complex, order: int, unit: float) -> NormalForm:
    """Compute the normal form of a map, scaled to a motion of size 1, whose parameter has a unit.

    Shapes: `slope` (N,), the derivative of the map by the parameter. `order` is 2 at a fold, otherwise 3.
    """
    size = len(slope)
    here, mu = matrices(np.zeros(size), 0.0), complex(multiplier / abs(multiplier))
    is_real = mu.imag == 0.0
    left, values, right = np.linalg.svd(here - (mu.real if is_real else mu) * np.eye(size))
    q, p = right[-1].conj(), left[:, -1]
    if values[-1] > _CRITICAL or (size > 1 and values[-2] < _SINGLE):
        raise NumericalError("no single multiplier is critical")
    p = p / (p.conj() @ q).conj()
    dual = p.conj()
    # along the branch, which turns back at a fold, whose rate needs no differences
    along = np.linalg.solve(np.eye(size) - here, slope) if order > 2 else 0.0 * slope
    reach = 1.0 / max(float(np.linalg.norm(along)), 1.0 / unit)

    def differences(way: NDArray[Any], step: float, parameter: float = 0.0) -> tuple[Array, Array]:
        found = [matrices(place * step * way, place * step * parameter) for place in PLACES]
        second = (np.tensordot(SECOND, found, 1) + SECOND_HERE * here) / step**2
        return np.tensordot(FIRST, found, 1) / step, second

    def terms(step: float) -> tuple[float, float]:
        by_real, twice_real = differences(q.real, step)
        if order == 2:
            return float(dual @ by_real @ q) / 2.0, float(dual @ slope)
        by_imag, twice_imag = differences(q.imag, step) if not is_real else (0.0 * here, 0.0 * here)
        rate = (dual @ differences(reach * along, step, reach)[0] @ q) / (reach * mu)
        by_q = by_real + 1j * by_imag
        mean = np.linalg.solve(np.eye(size) - here, by_q @ q.conj())  # of the bent mode
        cubic = by_q @ mean if not is_real else 0.5 * (by_q @ mean)
        if is_real:
            return float((dual @ (twice_real @ q / 6.0 + cubic)).real), float((rate * mu).real)
        double = np.linalg.solve(mu**2 * np.eye(size) - here, by_q @ q)
        cubic = cubic + 0.5 * (twice_real + twice_imag) @ q + 0.5 * by_q.conj() @ double
        return float((dual @ cubic / mu).real), float(rate.real)

    best, known = (math.nan, math.inf, math.nan), None
    for step in _LONGEST * _SHORTER ** np.arange(_TRIED):
        try:
            value, rate = terms(float(step))
        except NumericalError:
            known = None
            continue
        if known is not None:
            error = abs(value - known)
            if error > 4.0 * best[1]:
                break  # rounding takes over
            best = min(best, (value, error, rate), key=lambda each: each[1])
            if error < _ENOUGH * abs(value):
                break
        known = value
    value, error, rate = best
    error += float(values[-1]) * abs(value)
    sign = math.copysign(1.0, value) if error < _SURE * abs(value) else 0.0
    if order == 2:
        words = f"opens to {'lower' if rate * sign > 0.0 else 'higher'} values"
    else:
        words = "supercritical" if (sign > 0.0) == is_real else "subcritical"
    return NormalForm(value, error, rate, q, words if sign and rate else "")


def normal_form(special: SpecialPoint) -> NormalForm | None:
    """Compute the normal form of a special point; None if its kind has none, or if it is not known."""
    orbit, order = special.orbit, special.kind.order
    if not order or special.multiplicity > 1:
        return None
    try:
        equation = Shooting(1).pose(orbit.system, special.parameter, orbit.period)
        state, value = orbit.state, special.value
        units = orbit.system.state_scales(magnitude(state[: orbit.system.size], orbit.system))
        start = equation.evaluate(state, value)
        assert start.by_parameter is not None

        def matrices(displacement: Array, shift: float) -> Array:
            found = equation.evaluate(state + units * displacement, value + shift)
            if any(not _stays(*pair) for pair in zip(found.evidence, start.evidence, strict=True)):
                raise NumericalError(_NOT_ALIKE)
            return found.by_unknowns / units[:, None] * units + np.eye(len(units))

        multiplier, unit = special.kind.target or special.multiplier, abs(value) or 1.0
        found = normal_form_of_map(matrices, start.by_parameter / units, multiplier, order, unit)
    except (NumericalError, ModelError, np.linalg.LinAlgError):
        return None
    if not found.error < math.inf:
        return None
    return NormalForm(found.coefficient, found.error, found.rate, units * found.mode, found.criticality)


def alike(some: Sequence[ContactEvent], others: Sequence[ContactEvent]) -> bool:
    """Return True if two motions make the same contacts, at nearly the same velocities."""
    return len(some) == len(others) and all(
        a.switch == b.switch and a.enters is b.enters and abs(a.velocity - b.velocity) < _ALIKE * abs(b.velocity)
        for a, b in zip(some, others, strict=True)
    )


def _stays(some: Arc, others: Arc) -> bool:
    """Return True if two motions make the same contacts, and slip and stick in the same sequence."""
    modes = [[(each.contact, each.slip) for each in arc.slips] for arc in (some, others)]
    return modes[0] == modes[1] and alike(some.contacts, others.contacts)

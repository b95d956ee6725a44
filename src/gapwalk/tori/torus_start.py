"""Beginnings of families of tori: next to a Neimark-Sacker point, or at a torus, in one direction or in both."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from enum import StrEnum
from fractions import Fraction
from typing import cast

import numpy as np
from numpy.typing import NDArray

from gapwalk.attractors.settle import settle
from gapwalk.bifurcation.special_point import Kind, SpecialPoint
from gapwalk.continuation.corrector import Corrector, Range, powers_of_two
from gapwalk.continuation.curve_points import BranchPoint
from gapwalk.continuation.walk import WalkOptions
from gapwalk.errors import ConvergenceError, ModelError, NumericalError
from gapwalk.orbit.orbit_equation import Evaluation
from gapwalk.orbit.shooting import ShootingEquation
from gapwalk.orbit.sticking import transition_of
from gapwalk.tori.tongue import LockedWindow
from gapwalk.tori.torus import TURN, Torus, odd, phases, reversed_torus, rotation_matrices, tangents
from gapwalk.tori.torus_equation import TorusCorrector, TorusEquation, TorusOptions, find_torus, torus_of
from gapwalk.tori.torus_family import TorusEnd, TorusEndReason, TorusEvent, TorusPoint

# Doubling of a torus: the direction in which it loses or gains stability, and the smallest tori of twice the period.
#
# Deviations ``w(psi)`` from a curve are carried to ``w -> DP(psi - rho) w(psi - rho)``. If the torus is reducible, the
# eigenvalues of this operator are ``mu exp(2 pi i k rho)`` with the normal multipliers mu and all integers k (Jorba
# 2001, Nonlinearity 14, 943-976). One of them is -1 where the torus doubles: beside it are tori of twice as many
# curves. Another one than that of the tangent is 1 where two families cross. If none is real, the direction turns over
# once along the curve: the torus becomes one of half the rotation number, which is twice as long.

_EXACT = 1e-4  # distance of an eigenvalue from -1 or 1 at a located change of stability that is an error of it
_SIDEWAYS = 0.5  # share of a direction that is not along the curve, from which on it is another one than the tangent


class Change(StrEnum):
    """What happens where one normal exponent passes zero beside a fold; the value is in the event's words."""

    DOUBLES = "the tori of twice as many curves begin or end here"
    CROSSES = "another family of tori crosses here"
    TURNS_OVER = "its direction turns over along the curve: tori of half the rotation number begin or end here"


def change_at(torus: Torus) -> tuple[Change, NDArray[np.float64]]:
    """Return what happens at a torus with a normal exponent of zero, and the direction, shape (N, state_size)."""
    values, directions = _spectrum(torus)
    for change, target in ((Change.DOUBLES, -1.0), (Change.CROSSES, 1.0)):
        near = np.flatnonzero(np.abs(values - target) < _EXACT)
        sideways = [(place, _real(directions[place])) for place in near.tolist()]
        sideways = [each for each in sideways if target < 0.0 or _off_curve(torus, each[1]) > _SIDEWAYS]
        if sideways:
            place, direction = min(sideways, key=lambda each: abs(values[each[0]] - target))
            return change, direction
    place = int(np.argmin(np.abs(np.abs(values) - 1.0)))
    return Change.TURNS_OVER, _real(directions[place])


def _spectrum(torus: Torus) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
    """Return eigenvalues and eigenvectors, shape (N size, N, size), of the operator on deviations, in scaled states."""
    system = torus.system
    equation = TorusEquation(system, system.structure.names[0], torus.curves, torus.states)
    found = equation.linearise(np.append(torus.states, torus.rotation), float(system.values[0]))
    unit = system.state_scales()
    maps = found.transitions * unit / unit[:, None]
    back, _ = rotation_matrices(torus.count, -torus.rotation)
    count, size = torus.states.shape
    operator = np.einsum("jk,kab->jakb", back, maps).reshape(count * size, count * size)
    values, vectors = np.linalg.eig(operator)
    directions = np.asarray(vectors.T.reshape(-1, count, size) * unit, dtype=np.complex128)
    return np.asarray(values, dtype=np.complex128), directions


def _real(direction: NDArray[np.complex128]) -> NDArray[np.float64]:
    """Return the real direction of a complex one with a common factor, with the largest entry 1."""
    largest = direction.ravel()[np.abs(direction).argmax()]
    return (direction / largest).real


def _off_curve(torus: Torus, direction: NDArray[np.float64]) -> float:
    """Return how far a direction leaves that of the tangents of the curve, as a share of it."""
    unit = torus.system.state_scales()
    along, given = (tangents(torus.states) / unit).ravel(), (direction / unit).ravel()
    along /= np.linalg.norm(along)
    return float(np.linalg.norm(given - (given @ along) * along) / np.linalg.norm(given))


# amplitudes of the first torus that are tried, in first steps; where a contact grazes next to the point, only the
# smallest tori are smooth
_SMALLEST = (1.0, 0.3, 3.0, 0.1, 0.01, 1e-3, 1e-4, 1e-5)
_NEAR = 0.02  # distance of a rotation number from a fraction of small denominator that is mentioned
_GRAZES = "a contact grazes along the smallest tori, which are not smooth"
_UNKNOWN = "its tori may be locked, or not smooth"
_BESIDE = 0.1  # distance from a fraction, times its denominator, at which the torus beyond a locked window is expected
_PAST = (0.3, 1.0)  # places beyond a window, in widths or in distances from the last torus, where a motion settles
_STRONG = 4  # the largest denominator of such a fraction


class CurveEquation(TorusEquation):
    """Equation of tori that makes a record of each of its solutions for continuation."""

    def orbit(self, unknowns: NDArray[np.float64], value: float, evaluation: Evaluation) -> Torus:
        """Return the torus of a solution."""
        return torus_of(self, unknowns, value, evaluation)


def torus_at(point: BranchPoint) -> Torus:
    """Return the torus of a point: continuation carries the record of a solution without looking into it."""
    return cast(Torus, cast(object, point.orbit))


def record_at(point: BranchPoint) -> TorusPoint:
    """Return the record of a point of a family."""
    return TorusPoint(point.value, torus_at(point), point.arclength)


def equation_of(corrector: Corrector) -> CurveEquation:
    """Return the equation of a corrector of tori."""
    return cast(CurveEquation, corrector.equation)


@dataclass(frozen=True, eq=False)
class Second:
    """A second parameter that varies so that the rotation number stays, and its range."""

    name: str
    within: Range


@dataclass(frozen=True, eq=False)
class TorusStart:
    """Beginning of a family in one direction."""

    corrector: Corrector  #: Corrector of the equation.
    first: BranchPoint  #: The first point.
    within: Range  #: The range.
    end: TorusEnd  #: What is at the beginning: the Neimark-Sacker point, or the start of the walk.
    #: Factor on the first and the smallest step of the walk: below 1 where the first torus had to be small.
    fineness: float = 1.0
    second: Second | None = None  #: The second parameter, if the rotation number is kept.


def starts_at(
    start: Torus | SpecialPoint | TorusEvent,
    parameter: str,
    within: Range,
    options: TorusOptions,
    walk: WalkOptions,
    both: bool,
    second: Second | None = None,
) -> list[TorusStart]:
    """Return the beginnings of the family of a torus in each direction, or of the tori next to a special point."""
    if not isinstance(start, Torus) and second is not None:
        raise ModelError(
            "a rotation number can be kept only if the walk starts from a torus; give one of the tori of a family"
        )
    if isinstance(start, TorusEvent):
        return [_doubled(start, parameter, within, options, walk)]
    if isinstance(start, SpecialPoint):
        return [_next_to(start, parameter, within, options, walk)]
    if not isinstance(start, Torus):
        raise ModelError(
            "tori are followed from a torus, a Neimark-Sacker point or a torus doubling, not from "
            f"{type(start).__name__}; gw.tori.find_torus(settled) finds the torus of a settled motion"
        )
    return _from_torus(start, parameter, within, both, second)


def corrector_of(equation: CurveEquation, states: NDArray[np.float64], smallest: float, within: Range) -> Corrector:
    """Return the corrector of the tori near a curve."""
    return TorusCorrector(equation, powers_of_two(np.append(equation.scales(states, smallest), within.width)))


def _from_torus(torus: Torus, parameter: str, within: Range, both: bool, second: Second | None) -> list[TorusStart]:
    equation, last = CurveEquation(torus.system, parameter, torus.curves, torus.states), torus.rotation
    if second is not None:
        last = torus.system[second.name]
        kept = {"kept": torus.rotation, "second": second.name, "last_scale": second.within.width}
        equation = replace(equation, **kept)
    corrector = corrector_of(equation, torus.states, 0.0, within)
    value = torus.system[parameter]
    x = np.append(torus.states.ravel(), (last, value)) / corrector.scales
    normal = np.zeros(len(x))
    normal[-1] = 1.0
    first = corrector.point_near(x, normal)
    if first is None:
        raise ConvergenceError("Newton's method does not converge at the torus to start from; find it more accurately")
    end = TorusEnd(TorusEndReason.START, value, torus.rotation)
    # towards the end of the range; both ways if two ends were given
    ahead = 1.0 if within.high - value > value - within.low else -1.0
    ways = (-1.0, 1.0) if both else (ahead,)
    return [TorusStart(corrector, _towards(first, way), within, end, second=second) for way in ways]


def _towards(point: BranchPoint, way: float) -> BranchPoint:
    """Return a point whose tangent leads to higher (+1) or lower (-1) values of the parameter."""
    sign = way * (1.0 if point.tangent[-1] >= 0.0 else -1.0)
    return replace(point, tangent=sign * point.tangent, determinant=sign * point.determinant, memo={})


def _doubled(event: TorusEvent, parameter: str, within: Range, options: TorusOptions, walk: WalkOptions) -> TorusStart:
    """Return the beginning at a torus doubling: a torus of twice as many curves, beside the one that doubles."""
    # With the direction ``DP w(psi) = -w(psi + 2 pi rho)``, the curve ``u + a w`` is carried to the second one, ``u - a
    # w``, and to itself by the map over twice as many periods, which turns its phase by ``2 rho``.
    torus = event.torus
    assert torus is not None  # events without one are refused before
    _, wave = change_at(torus)
    value = torus.system[parameter]
    equation = CurveEquation(torus.system, parameter, 2 * torus.curves, torus.states)
    corrector = corrector_of(equation, torus.states, 0.0, within)
    for amplitude, share, first in _smallest(corrector, torus.states, wave, (2.0 * torus.rotation, value), walk):
        if share >= 0.5 and first.value in within and torus_at(first).is_resolved:
            end = TorusEnd(TorusEndReason.DOUBLED, value, 2.0 * torus.rotation % 1.0)
            return TorusStart(corrector, first, within, end, min(1.0, amplitude))
    raise ConvergenceError(
        f"no tori of twice as many curves were found beside the doubling at {parameter} = {value:.9g}"
    )


def _smallest(
    corrector: Corrector,
    states: NDArray[np.float64],
    wave: NDArray[np.float64],
    turns_and_value: tuple[float, float],
    walk: WalkOptions,
) -> Iterator[tuple[float, float, BranchPoint]]:
    """Yield the tori beside states in the direction of a wave; with the amplitude in steps, and the share reached."""
    away = np.append(wave.ravel(), (0.0, 0.0)) / corrector.scales
    away /= np.linalg.norm(away)
    x = np.append(states.ravel(), turns_and_value) / corrector.scales
    for amplitude in _SMALLEST:
        step = amplitude * walk.first_step
        found = corrector.correct(x + step * away, away)
        if found is not None:
            with suppress(NumericalError):
                yield amplitude, float((found.x - x) @ away) / step, corrector.point(found, away, step)


def start_beyond(
    torus: Torus, window: LockedWindow, parameter: str, way: float, within: Range, value: float, options: TorusOptions
) -> TorusStart | None:
    """Return the beginning beyond a window in which the motion of a family locks; None if there is none."""
    # The motion next to the locked one settles there on a torus, if it is stable, whose rotation number is on the other
    # side of the fraction. If the window holds the last torus itself, both motions coexist, and the family ends there.
    near, far = (window.low, window.high) if way > 0.0 else (window.high, window.low)
    if not window.is_whole or way * (near - value) < 0.0:
        return None
    for share in _PAST:
        place = far + way * share * max(window.width, abs(far - value))
        found = _settled_torus(torus, window, parameter, place, options) if place in within else None
        if found is not None:
            return _from_torus(found, parameter, within, True, None)[int(way > 0.0)]
    return None


def _settled_torus(
    torus: Torus, window: LockedWindow, parameter: str, place: float, options: TorusOptions
) -> Torus | None:
    """Return the torus on which the locked motion settles at a place beyond its window; None if it is another one."""
    try:
        motion = settle(torus.system.at({parameter: place}), window.orbit.state)
        found = find_torus(motion, replace(options, samples=max(options.samples, torus.count)))
    except NumericalError:
        return None
    ratio = float(window.ratio)
    if abs(found.rotation - ratio) > abs(1.0 - found.rotation - ratio):
        found = reversed_torus(found)
    crossed = (found.rotation - ratio) * (torus.rotation - ratio) < 0.0
    near = abs(found.rotation - ratio) <= _BESIDE / window.ratio.denominator
    return found if found.curves == torus.curves and crossed and near else None


def _next_to(
    special: SpecialPoint, parameter: str, within: Range, options: TorusOptions, walk: WalkOptions
) -> TorusStart:
    """Return the beginning at a Neimark-Sacker point: a small torus in the plane of its critical multipliers."""
    # With ``M v = exp(i theta) v`` the curve ``x + a Re(v exp(i psi))`` is carried into itself to first order in a,
    # with the rotation number ``theta / 2 pi``; the parameter changes with the square of a.
    if special.kind is not Kind.NEIMARK_SACKER:
        raise ModelError(
            f"no tori begin at a point of the kind {special.kind.value!r}; they do at Neimark-Sacker points "
            f"({Kind.NEIMARK_SACKER.value!r})"
        )
    orbit, value = special.orbit, special.orbit.system[parameter]
    arc = ShootingEquation(orbit.system, None, orbit.period).evaluate(orbit.state, value).evidence[0]
    values, vectors = np.linalg.eig(transition_of(arc))
    place = int(np.argmin(np.abs(values - special.multiplier)))
    turns = float(np.angle(values[place])) / TURN
    unit = orbit.system.state_scales()
    vector = vectors[:, place] / np.abs(vectors[:, place] / unit).max()
    count = odd(options.samples - 1)
    wave = (np.exp(1j * phases(count))[:, None] * vector).real
    length = float(np.abs(orbit.state / unit).max())
    still = np.tile(orbit.state, (count, 1))
    equation = CurveEquation(orbit.system, parameter, orbit.period, still + wave)
    corrector = corrector_of(equation, still, length * 1e-3, within)
    grazes = False
    for amplitude, _, first in _smallest(corrector, still, wave, (turns, value), walk):
        grazes = grazes or torus_at(first).grazes
        if first.value in within and _is_torus(torus_at(first), options):
            end = TorusEnd(TorusEndReason.BORN, value, turns % 1.0)
            return TorusStart(corrector, first, within, end, min(1.0, amplitude))
    raise ConvergenceError(
        f"no torus was found next to the Neimark-Sacker point at {parameter} = {value:.9g} (rotation number "
        f"{turns:.6g}){_resonance_nearby(turns)}; {_GRAZES if grazes else _UNKNOWN}: settle() on either side shows "
        "what motions there are"
    )


def _is_torus(torus: Torus, options: TorusOptions) -> bool:
    """Return True if the curve has a size: Newton's method may converge to the orbit itself."""
    return torus.size > 0.0 and torus.is_resolved and torus.error <= max(options.accuracy, 1e-6)


def _resonance_nearby(turns: float) -> str:
    """Return a clause that names the fraction of a small denominator next to a rotation number; empty if none is."""
    near = Fraction(turns).limit_denominator(_STRONG)
    if abs(turns - near) > _NEAR:
        return ""
    return f", near the resonance {near.numerator}:{near.denominator}"

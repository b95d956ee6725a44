"""Ends of families of tori: they shrink to an orbit, lose their smoothness, or lock to a periodic motion."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from gapwalk.bifurcation.follow import follow
from gapwalk.bifurcation.special_point import SpecialPoint
from gapwalk.bifurcation.special_point_kind import Kind
from gapwalk.continuation.corrector import Corrector, length_of
from gapwalk.continuation.point_on_branch import BranchPoint
from gapwalk.errors import GapwalkError, NumericalError
from gapwalk.orbit.orbit_equation import solve
from gapwalk.orbit.shooting import ShootingEquation
from gapwalk.tori.closed_curve import TURN
from gapwalk.tori.locked_window import LockedWindow
from gapwalk.tori.torus import Torus, relative_size
from gapwalk.tori.torus_family import TorusEnd, TorusEndReason
from gapwalk.tori.torus_start import torus_at

DENOMINATOR = 12
"""The largest denominator of resonances that are named, and whose locked motions are looked for."""

_RESONANT = 0.02  # distance of a rotation number from p/q, times q, within which the resonance is named
_SMALL = 1e-3  # size of a torus, over that of the motion, at which a failing walk has perhaps reached its orbit
_SMALLEST = 1e-8  # such a size below which a torus cannot be distinguished from its orbit
_INVERTED = -0.5  # cosine between successive curves below which the second one is the first, inverted
# distances within which the Neimark-Sacker point is looked for, in steps of the family: beyond the point its curves
# are the same, inverted, so that a step over it may change the parameter little
_BEYOND = (4.0, 40.0, 400.0)


def has_shrunk(before: BranchPoint, after: BranchPoint) -> bool:
    """Return True if a step has passed the orbit to which tori shrink: the curve beyond is the one before, inverted."""
    first, last = (_deviations(torus_at(point)) for point in (before, after))
    if first.shape != last.shape:
        return False
    return bool((first * last).sum() < _INVERTED * np.linalg.norm(first) * np.linalg.norm(last))


def shrunk(before: BranchPoint, after: BranchPoint, parameter: str) -> TorusEnd:
    """Return the end of a family that has shrunk to an orbit between two of its points, with that point if it is found.

    The orbit is found by Newton's method from the mean of the last curve, and followed to its Neimark-Sacker point.
    """
    torus = torus_at(before)
    point = _neimark_sacker(before, after, parameter)
    if point is None:
        return TorusEnd(TorusEndReason.SHRINKS, before.value, torus.rotation, f"its size was {torus.size:.2g}")
    return TorusEnd(TorusEndReason.SHRINKS, point.value, _turns(point, torus))


def halved(last: BranchPoint, corrector: Corrector) -> BranchPoint | None:
    """Return the torus of half the size of a small one, if the family shrinks from there on; None if it does not.

    The orbit in the middle solves the equation of its tori too, with any rotation number. So the Jacobian along a
    family is the nearer to a singular one the smaller the tori are, and steps fail. Across, it stays regular: the size
    is given, in the plane perpendicular to the deviations from the mean, and all others are unknown.
    """
    normal, size = _outwards(last, corrector), relative_size(torus_at(last))
    if not _SMALLEST < size < _SMALL or last.tangent @ normal >= 0.0:
        return None
    found = corrector.correct(last.x - 0.5 * float(normal @ last.x) * normal, normal)
    if found is not None and not found.iterations:  # the tangent would be that of the guess
        found = corrector.correct(found.x, normal)
    if found is None:
        return None
    try:
        return corrector.point(found, -normal, last.arclength + length_of(found.x - last.x))
    except NumericalError:
        return None


def vanished(before: BranchPoint, after: BranchPoint, parameter: str) -> TorusEnd | None:
    """Return the end of a family whose last torus has half the size of the one before; None if it does not end there.

    Parameter and rotation number change in proportion to the size, or to a higher power of it. So what is left of the
    way to the Neimark-Sacker point is no more than the last change.
    """
    born = _neimark_sacker(after, before, parameter)
    if born is None:
        return None
    torus = torus_at(after)
    end = TorusEnd(TorusEndReason.SHRINKS, born.value, _turns(born, torus))
    ways = (end.value, after.value, before.value), (end.rotation, torus.rotation, torus_at(before).rotation)
    return end if all(abs(last - there) <= abs(last - first) for there, last, first in ways) else None


def _outwards(point: BranchPoint, corrector: Corrector) -> NDArray[np.float64]:
    """Return the direction in which a torus grows, as a unit vector of the scaled unknowns and the parameter."""
    states = torus_at(point).states
    away = np.append((states - states.mean(axis=0)).ravel(), (0.0, 0.0)) / corrector.scales
    return away / length_of(away)


def _turns(point: SpecialPoint, torus: Torus) -> float:
    """Return the rotation number of a Neimark-Sacker point, in the direction of the phase of a torus beside it."""
    turns = abs(float(np.angle(point.multiplier))) / TURN
    return turns if abs(turns - torus.rotation) < abs(1.0 - turns - torus.rotation) else 1.0 - turns


def _neimark_sacker(before: BranchPoint, after: BranchPoint, parameter: str) -> SpecialPoint | None:
    torus = torus_at(before)
    equation = ShootingEquation(torus.system, None, torus.curves)
    reach = max(abs(after.value - before.value), 1e-6 * abs(before.value))
    for longer in _BEYOND:
        try:
            orbit = equation.orbit(*_solved(equation, torus.states.mean(axis=0)))
            branch = follow(orbit, parameter, (before.value - longer * reach, before.value + longer * reach))
        except GapwalkError:
            return None
        found = branch.special(Kind.NEIMARK_SACKER)
        if found:
            return min(found, key=lambda each: abs(each.value - before.value))
    return None


def _solved(equation: ShootingEquation, start: NDArray[np.float64]):
    unknowns, evaluation = solve(equation, start, 0.0)
    return unknowns, 0.0, evaluation


def rough(last: BranchPoint, beyond: Torus, passed: Fraction | None) -> TorusEnd:
    """Return the end of a family whose tori need more samples than allowed, with the evidence."""
    torus = torus_at(last)
    why = f"the error is {beyond.error:.1g}{_roughness(beyond)}"
    near = resonance_near(torus.rotation) or passed
    if near is not None:
        why += f"; the rotation number is near {near}"
    return TorusEnd(TorusEndReason.ROUGH, last.value, torus.rotation, why)


def resonance_near(turns: float) -> Fraction | None:
    """Return the fraction of a small denominator next to a rotation number; None if there is none."""
    near = Fraction(turns).limit_denominator(DENOMINATOR)
    return near if abs(turns - near) < _RESONANT / near.denominator else None


def locked(last: BranchPoint, ratio: Fraction, window: LockedWindow | None) -> TorusEnd:
    """Return the end of a family whose motion locks to a fraction, with the motions that were found there."""
    torus = torus_at(last)
    words = f"the rotation number approaches {ratio}" + ("" if window is None else f"; {window.words}")
    words += _roughness(torus) if torus.grazes else ""
    return TorusEnd(TorusEndReason.RESONANCE, last.value, torus.rotation, words, window)


def _roughness(torus: Torus) -> str:
    """Return a clause with the tail of the series of a torus, and a contact that grazes along it."""
    words = f"; the tail of the series is {torus.tail:.1g} with {torus.count} samples"
    if torus.grazes:
        words += f"; a contact grazes along the torus ({torus.touches[0]} to {torus.touches[1]} contact events)"
    return words


def _deviations(torus: Torus) -> NDArray[np.float64]:
    return (torus.states - torus.states.mean(axis=0)) / torus.system.state_scales()

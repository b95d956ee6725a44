"""Step over a graze that touches at all angles at once, as where a whirling rotor meets a ring all around.

A force by a formula with ``max``, ``min`` or ``abs`` sets in at the kink of that function. Where a motion reaches the
kink at all its angles at once, the derivatives of the orbit's equation jump, and the branch has a corner. A first guess
a little beyond it, along the old direction, soon leaves the kink again, so the derivatives there are those of neither
side. With several segments, each of which begins beyond the kink, the motion stays there, and the derivatives are those
of the far side.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gapwalk.bifurcation.branch_start import lift
from gapwalk.bifurcation.special_point import ROUNDING, SAFETY, Kind, SpecialPoint
from gapwalk.bifurcation.steps_over_corners import CornerPassage
from gapwalk.continuation.corrector import Corrector, length_of, powers_of_two
from gapwalk.continuation.curve_points import BranchPoint
from gapwalk.errors import NumericalError
from gapwalk.flow.forces import Angles, stages_of
from gapwalk.model.coefficients import coefficients_of, layout_of
from gapwalk.orbit.orbit import Orbit
from gapwalk.orbit.shooting import ShootingEquation

_SAMPLES = 64  # angles in each forcing period at which the modes of the formulas are compared
_SEGMENTS = (8, 32)  # numbers of segments with which the far side is sought
_PROBES = (1e-9, 1e-8, 1e-7)  # distances beyond at which the derivatives are evaluated
_STEPS = (1e-5, 1e-4, 1e-6)  # lengths of the step
_ASTRAY = 0.5  # distance of the corrected point from the guess, as a share of the step, beyond which it is astray
_BACK = 1e-4  # distance behind the last point at which the slope of a guard is taken
_TRIES = 4  # secant steps by which the corner is located
_MARGIN = 1e-12  # distance to the corner of the located point: at the corner itself rounding decides on the modes


def pass_throughout(corrector: Corrector, point: BranchPoint) -> CornerPassage | None:
    """Return the step over a graze at all angles at once from a point just before it; None if there is none near."""
    equation = corrector.equation
    if not isinstance(equation, ShootingEquation) or not any(map(len, _guards(point.orbit).values())):
        return None
    try:
        rough = next(_beyond(corrector, equation, point), None)
        if rough is None:
            return None
        names, mode = _changed(point.orbit, rough.orbit)
        corner, error = _located(corrector, point, mode)
        beyond = next(_beyond(corrector, equation, corner), rough)
    except NumericalError:
        return None
    sides = corner.orbit.instability, beyond.orbit.instability
    words = " and ".join(names)
    graze = SpecialPoint(Kind.GRAZING, corner, *sides, error, words, parameter=equation.parameter or "")
    return CornerPassage(corner, beyond, [graze], beyond.arclength - corner.arclength)


def _beyond(corrector: Corrector, equation: ShootingEquation, corner: BranchPoint) -> Iterator[BranchPoint]:
    """Iterate over points beyond a corner at which a formula has another mode at all angles."""
    for count in (each for each in _SEGMENTS if each > equation.options.segments):
        posed = replace(equation, options=replace(equation.options, segments=count))
        unit = corrector.scales[: equation.system.state_size] * math.sqrt(count / equation.options.segments)
        finer = Corrector(posed, powers_of_two(np.append(np.tile(unit, count), corrector.scales[-1])))
        begin = lift(corner, finer)
        if begin is None:
            continue
        for probe in _PROBES:
            try:
                way = np.linalg.svd(finer.jacobian(begin.x + probe * begin.tangent))[2][-1]
            except NumericalError:
                continue
            way *= math.copysign(1.0, way @ begin.tangent)
            for length in _STEPS:
                guess, within = begin.x + length * way, _ASTRAY * length
                found = finer.point_near(guess, way, near=1e-3 * length, within=within)
                if found is None or not _changed(corner.orbit, found.orbit)[0]:
                    continue
                x = np.append(equation.unknowns(found.orbit), found.value) / corrector.scales
                chord = x - corner.x
                own = corrector.point_near(x, chord / length_of(chord), corner.arclength + length_of(chord))
                if own is not None and _changed(corner.orbit, own.orbit)[0]:
                    yield own


def _located(corrector: Corrector, point: BranchPoint, mode: tuple[int, int]) -> tuple[BranchPoint, float]:
    """Return the point at which the guard of a mode vanishes, on the near side, and the error of its parameter."""
    before = corrector.point_ahead(point, -_BACK)
    if before is None:
        return point, math.inf
    heights = [_height(each, mode) for each in (before, point)]
    slope = (heights[1] - heights[0]) / _BACK
    corner = point
    for _ in range(_TRIES):
        off = -_height(corner, mode) / slope - _MARGIN
        if abs(off) < 0.5 * _MARGIN:
            break
        ahead = corrector.point_ahead(corner, off, within=abs(off))
        if ahead is None or _height(ahead, mode) * heights[0] < 0.0:
            break
        corner = ahead
    off, scale = abs(_height(corner, mode) / slope), float(corrector.scales[-1])
    rounding = ROUNDING * (abs(corner.value) + scale * abs(float(corner.tangent[-1])) * abs(heights[0] / slope / _BACK))
    return corner, float(SAFETY * scale * off + rounding)


def _height(point: BranchPoint, mode: tuple[int, int]) -> float:
    """Return the mean of a guard over an orbit."""
    contact, number = mode
    return float(_guards(point.orbit)[contact][number].mean())


def _changed(first: Orbit, last: Orbit) -> tuple[list[str], tuple[int, int]]:
    """Return the contacts whose formulas have another mode in one motion than in the other, at all angles, and one."""
    names, modes, contacts = [], [], first.system.structure.contacts
    theirs = _guards(last)
    for contact, guards in _guards(first).items():
        for number, (ours, other) in enumerate(zip(guards, theirs[contact], strict=True)):
            signs = ours > 0.0, other > 0.0
            if all(each.all() or not each.any() for each in signs) and signs[0][0] != signs[1][0]:
                names.append(contacts[contact].name)
                modes.append((contact, number))
    return list(dict.fromkeys(names)), modes[0] if modes else (0, 0)


def _guards(orbit: Orbit) -> dict[int, NDArray[np.float64]]:
    """Return the guards of all modes of each formula along an orbit, shape (modes, samples), by the contact."""
    layout, numbers = layout_of(orbit.system.structure), coefficients_of(orbit.system)
    own = {number: each for number, each in enumerate(layout.contacts) if each.form.law.mode_count}
    if not own:
        return {}
    motion, found = orbit.motion(_SAMPLES), dict[int, NDArray[np.float64]]()
    angles, q, v = Angles(layout, numbers, motion.theta), motion.q, motion.v
    for number, slots in own.items():
        moves = [
            (q @ numbers[row] + angles.sway(slots, place), v @ numbers[row] + angles.sway(slots, place, 1))
            for place, row in enumerate(slots.deflections)
        ]
        values = angles.named(slots.numbers, slots.waves)
        guards = slots.form.law.guards(moves[0][1], stages_of(slots, angles, moves), values)
        found[number] = np.array([np.broadcast_to(np.real(each), motion.theta.shape) for each in guards])
    return found

"""When a Jenkins element sticks and slips along a periodic deflection: all events, exact to rounding.

With the deflection ``x``, less the way of a base that moves, the slider stands at ``p = x - z``, where ``z`` is the
extension of the spring. The limit over the stiffness, ``r``, is the largest extension, so ``x - r <= p <= x + r``. The
slider stays where it is unless one of these bounds pushes it: that is slip, and it ends where the bound turns. If the
limit varies, the bounds are ``x`` less or plus what varies; where the limit jumps, the bounds jump.

Between two events of the contact that hosts the friction, the bounds have turning points. Between two neighbouring
ones of all these angles both bounds are monotone, and what the slider does follows from their ends. Its place after a
period is ``min(max(p, low), high)`` of that before: so it settles within one period, and the second one is the periodic
motion. If it never slips, any place from the highest lower bound to the lowest upper bound is possible. Then the one is
taken at which the mean of its force is zero, or nearest to that.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.orbit.harmonic_balance.slip_limit import SAME, TURN, Slider
from gapwalk.orbit.harmonic_balance.zeros import roots

Array = NDArray[np.float64]

_ROUNDING = 4e-15  # of a place, relative to the size of the bounds


class Pin(NamedTuple):
    """The angle of a bound at which the slider comes to rest."""

    phi: float  #: The angle, below 0 if that was in the period before.
    #: -1 for the lower bound, 1 for the upper one; 0 for a slider that never slips, and rests where its force has the
    #: mean zero.
    side: int
    piece: int  #: The interval of the limit to which the bound belongs.
    place: int  #: Number of the break at that angle; -1 for none.
    is_before: bool  #: True if the bound is that just before the angle.


class Phase(NamedTuple):
    """A phase of stick, with its pin, or of slip in a direction, 1 or -1, with the interval of the limit."""

    start: float
    end: float
    slip: int
    pin: int
    piece: int


class Leap(NamedTuple):
    """A change of the extension at once, where the limit falls below it; `place` is the number of the break."""

    place: int
    change: float


def sequence_of(slider: Slider) -> tuple[list[Phase], list[Pin], list[Leap], list[float]]:
    """Return the phases of a slider from 0 to 2 pi, its pins, its leaps, and the place of the slider at each pin."""
    stiffness, drift = slider.number("stiffness")[0], slider.drift[0]
    knots, pieces, places = _knots(slider)
    ends = np.concatenate((knots[:-1], knots[1:]))
    x = slider.deflection(ends)
    reach = slider.limit(ends, np.concatenate((pieces, pieces)), partial=False).value / stiffness
    (low, low_then), (high, high_then) = (each.reshape(2, -1).tolist() for each in (x - reach, x + reach))
    rounding = _ROUNDING * max(float(np.abs(x).max()), float(np.abs(reach).max()))
    highest, lowest = max(*low, *low_then), min(*high, *high_then)
    if not drift and highest <= lowest:
        middle = float(slider.motion.lines[slider.element.place][0].real)
        rest = min(max(middle, highest), lowest)
        pin = Pin(0.0, 0, 0, -1, False)
        if rest != middle:
            side, bounds, then = (-1, low, low_then) if rest == highest else (1, high, high_then)
            number = (bounds + then).index(rest)
            at, is_before = number % len(bounds), number >= len(bounds)
            pin = Pin(float(ends[number]), side, int(pieces[at]), places[at + is_before], is_before)
        return [Phase(0.0, TURN, 0, 0, -1)], [pin], [], [rest]
    rest, pin = np.inf if drift >= 0.0 else -np.inf, None
    for turn in (-1, 0):  # in the period before, and in this one
        phases: list[Phase] = []
        pins: list[Pin] = [] if pin is None else [pin]
        rests, leaps, starts = [rest], [], []
        for number, (start, end, piece) in enumerate(zip(knots, knots[1:], pieces, strict=False)):
            shift = TURN * turn
            for side, bound in ((-1, low[number]), (1, high[number])):
                if side * (rest - bound) > 0.0:
                    if places[number] >= 0 and abs(rest - bound) > rounding:
                        leaps.append(Leap(places[number], bound - rest))
                    rest = bound
                    pins.append(Pin(start + shift, side, int(piece), places[number], False))
                    rests.append(rest)
            slip = 1 if low_then[number] > rest else -1 if high_then[number] < rest else 0
            begin = low[number] if slip > 0 else high[number]
            if not slip:
                phases.append(Phase(start, end, 0, len(pins) - 1, int(piece)))
                continue
            if abs(rest - begin) > rounding:
                starts.append((len(phases), rest))
                phases.append(Phase(start, end, 0, len(pins) - 1, int(piece)))
            phases.append(Phase(start, end, slip, -1, int(piece)))
            rest = low_then[number] if slip > 0 else high_then[number]
            pins.append(Pin(end + shift, -slip, int(piece), places[number + 1], True))
            rests.append(rest)
        pin, rest = pins[-1], rest + TURN * drift * (turn < 0)
    _begin(slider, phases, starts, stiffness)
    return [each for each in _joined(phases) if each.end > each.start], pins, leaps, rests


def _begin(slider: Slider, phases: list[Phase], starts: list[tuple[int, float]], stiffness: float) -> None:
    """Find the angles at which slip begins within a segment, and set them as ends of stick and starts of slip."""
    if not starts:
        return
    slips = [phases[number + 1] for number, _ in starts]
    sides, piece = np.array([each.slip for each in slips]), np.array([each.piece for each in slips])
    rests = np.array([rest for _, rest in starts])

    def beyond(phi: Array, number: NDArray[np.intp]) -> tuple[Array, Array]:
        limit, side = slider.limit(phi, piece[number], partial=False), sides[number] / stiffness
        return (
            slider.deflection(phi) - side * limit.value - rests[number],
            slider.deflection_rate(phi) - side * limit.by_angle,
        )

    low, high = np.array([each.start for each in slips]), np.array([each.end for each in slips])
    for (number, _), phi in zip(starts, roots(beyond, low, high).tolist(), strict=True):
        phases[number] = phases[number]._replace(end=phi)
        phases[number + 1] = phases[number + 1]._replace(start=phi)


def _joined(phases: list[Phase]) -> list[Phase]:
    """Join neighbouring phases of stick with the same pin, and of slip in one interval."""
    found: list[Phase] = []
    for each in phases:
        if (
            found
            and found[-1].slip == each.slip
            and found[-1].pin == each.pin
            and (not each.slip or found[-1].piece == each.piece)
        ):
            found[-1] = found[-1]._replace(end=each.end)
        else:
            found.append(each)
    return found


def _knots(slider: Slider) -> tuple[list[float], NDArray[np.intp], list[int]]:
    """Return the angles between which both bounds are monotone, from 0 to 2 pi.

    With them come the number of the interval of the limit after each, and the number of the break at each, or -1.
    """
    knots, intervals, places = [], [], []
    at_break = {each.phi: number for number, each in enumerate(slider.breaks)}
    for (low, high, piece), turning in zip(slider.pieces, slider.turning_points(), strict=True):
        inside = [low]
        for each in turning:
            if each - inside[-1] > SAME and high - each > SAME:
                inside.append(each)
        knots += inside
        intervals += [piece] * len(inside)
        places += [at_break.get(low, -1)] + [-1] * (len(inside) - 1)
    return [*knots, TURN], np.array(intervals), [*places, places[0]]

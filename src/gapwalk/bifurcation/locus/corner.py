"""Corners: where a contact grazes at a bifurcation, its locus turns sharply, and a walk has to be helped round.

The monodromy matrix changes like the square root of the depth of a touch. So with depth d and the condition
``g = s + c sqrt(d)``, s being smooth, the locus crosses the grazing locus on the side without the touch, and on the
other it leaves it tangentially, like the parabola ``d = (s / c)^2``: two smooth arcs that meet at an angle. Seen from
the grazing locus both are smooth curves, over d on the one side and over its square root on the other (see `Brink`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.bifurcation.kinds.grazing import describe_switch
from gapwalk.bifurcation.locus.approach import Approach, Turning, turnings
from gapwalk.bifurcation.locus.brink import Brink, is_highest, on_locus
from gapwalk.bifurcation.locus.detect import Finding
from gapwalk.bifurcation.locus.locus import Codim2
from gapwalk.continuation.corrector import Correction, Corrector
from gapwalk.continuation.point import BranchPoint
from gapwalk.errors import NumericalError

_NEAR = 1e-3  # distance from a breakpoint, in units of the state, within which a turning point may be the corner's
_STRAIGHT = 0.9  # cosine of the angle within which the corner must lie ahead
_HALVINGS = 4  # how often the distance to the corner is halved, to see that the locus leads there
_LEAST = 3.0  # and the least depth in doing so, in margins
_NEARER = 0.8  # share of the distance that may be left
_SHALLOW = 1e-7  # depth, in units of the state, at which the locus beyond the corner is looked for first
_SHORTENINGS = 10  # how often the next depth there may be brought nearer to the one before
_STRAYED = 0.1  # share of its distance from the one before by which a place may differ from what is foretold
_TINY = 1e-7  # scaled distance by which it may differ in any case
_FAR_ENOUGH = 0.5  # distance from the corner, in lengths of AWAY, from which the walk can go on

AWAY = 1e-3
"""Scaled distance from a corner within which a walk does not go: it is led round."""


class Corner(NamedTuple):
    """A corner of a locus: what happens there, and the point of the locus beyond, from where the walk goes on."""

    finding: Finding
    beyond: BranchPoint


def turn_corner(
    corrector: Corrector, point: BranchPoint, within: float, ahead: Sequence[Approach] = ()
) -> Corner | None:
    """The corner just ahead of a point of a locus; None if there is none that can be turned.

    Parameters
    ----------
    corrector
        Corrects onto the locus.
    point
        The last point before the corner.
    within
        Scaled distance within which the corner must lie.
    ahead
        The turning points that may graze there; by default all that are near to their breakpoints are tried.
    """
    candidates = [each.turning for each in ahead]
    if not candidates:
        near = _NEAR * float(corrector.scales[0])
        candidates = sorted((each for each in turnings(point) if abs(each.depth) < near), key=lambda t: abs(t.depth))
    for turning in candidates:
        try:
            corner = _turn(corrector, point, within, turning)
        except (NumericalError, np.linalg.LinAlgError):
            continue
        if corner is not None:
            return corner
    return None


def _turn(corrector: Corrector, point: BranchPoint, within: float, turning: Turning) -> Corner | None:
    """The corner at which one turning point grazes, if the locus leads there and on."""
    brink = Brink(corrector, turning.switch)
    start = brink.beside(point, turning.theta)
    corner = brink.at(-brink.margin if brink.turns_highest(start) else brink.margin, start)
    if corner is None:
        return None
    way = on_locus(corner) - point.x
    length = float(np.linalg.norm(way))
    if length > within or float(way @ point.tangent) < _STRAIGHT * length:
        return None  # the corner of another arc
    if not _leads_there(brink, start, corner, turning):
        return None
    beyond = _beyond(corrector, brink, corner, turning)
    if beyond is None or beyond.orbit.closings == point.orbit.closings:
        return None
    x, orbit = on_locus(corner), brink.orbit(corner)
    there = BranchPoint(
        float(x[-1] * corrector.scales[-1]), orbit, x, point.tangent, point.determinant, point.arclength + length
    )
    arclength = there.arclength + float(np.linalg.norm(beyond.x - x))
    finding = Finding(Codim2.GRAZING, there, describe_switch(orbit, turning.switch))
    return Corner(finding, replace(beyond, arclength=arclength))


def _leads_there(brink: Brink, start: NDArray[np.float64], corner: Correction, turning: Turning) -> bool:
    """Whether the locus leads from a start to a corner: as the depth dwindles, it comes nearer in proportion."""
    there, depth = on_locus(corner), turning.depth
    distance = float(np.linalg.norm(np.delete(start, -3) - there))
    for _ in range(_HALVINGS):
        depth *= 0.25 if turning.is_touch else 0.5
        if abs(depth) < _LEAST * brink.margin:
            break
        at = brink.at(depth, start)
        if at is None or is_highest(at) is not is_highest(corner):
            return False
        start, before = at.x, distance
        distance = float(np.linalg.norm(on_locus(at) - there))
        if distance > _NEARER * before:
            return False
    return True


def _beyond(corrector: Corrector, brink: Brink, corner: Correction, turning: Turning) -> BranchPoint | None:
    """The point of the locus a little beyond its corner, where the deflection turns on the other side.

    It is followed from the corner outwards over the measure in which it is smooth: the depth, or its square root.
    """
    side = -np.sign(turning.depth) * brink.unit
    power, growth = (1, 3.0) if turning.is_touch else (2, 2.0)
    measures, places = [0.0], [corner]
    measure, shortenings = _SHALLOW ** (1.0 / power), 0
    while shortenings < _SHORTENINGS:
        guess = _extrapolated(measures, [place.x for place in places], measure)
        at = brink.at(side * measure**power, guess)
        if at is None or is_highest(at) is not is_highest(corner) or _strays(at, guess, places):
            measure, shortenings = 0.5 * (measures[-1] + measure), shortenings + 1
            continue
        measures.append(measure)
        places.append(at)
        if float(np.linalg.norm(on_locus(at) - on_locus(corner))) > _FAR_ENOUGH * AWAY:
            break
        measure *= growth
    if len(places) == 1:
        return None
    there, way = on_locus(places[-1]), on_locus(places[-1]) - on_locus(places[-2])
    way /= np.linalg.norm(way)
    correction = corrector.correct(there, way)
    if correction is None or correction.distance > _STRAYED * float(np.linalg.norm(there - on_locus(corner))):
        return None
    return corrector.point(correction, way, 0.0)


def _strays(at: Correction, guess: NDArray[np.float64], places: list[Correction]) -> bool:
    """Whether an orbit is so far from what those before it foretell that it belongs to another arc."""
    if len(places) == 1:
        return False
    foretold = float(np.linalg.norm(guess - places[-1].x))
    return float(np.linalg.norm(at.x - guess)) > max(_STRAYED * foretold, _TINY)


def _extrapolated(measures: list[float], places: list[NDArray[np.float64]], measure: float) -> NDArray[np.float64]:
    """The place at a measure by the parabola through the last three places, or what fewer allow."""
    nodes, known = measures[-3:], places[-3:]
    result = np.zeros_like(known[0])
    for i, place in enumerate(known):
        others = [node for j, node in enumerate(nodes) if j != i]
        result += place * float(np.prod([(measure - node) / (nodes[i] - node) for node in others]))
    return result

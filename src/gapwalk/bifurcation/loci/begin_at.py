"""Other loci begun at a point of codimension two, where several of them meet."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import product

import numpy as np

from gapwalk.bifurcation.follow import follow
from gapwalk.bifurcation.loci.locus import Codim2, Codim2Point
from gapwalk.bifurcation.loci.locus_equations import GrazingEquation, ShotPlane, onto_curve
from gapwalk.bifurcation.special_point import Kind, SpecialPoint
from gapwalk.continuation.corrector import Corrector, Range, powers_of_two
from gapwalk.continuation.curve_points import BranchPoint
from gapwalk.errors import ConvergenceError, ModelError, NumericalError
from gapwalk.flow.flow import PERIOD
from gapwalk.orbit.orbit import Orbit, switch_named

_ASIDE = (1e-2, 3e-2, 3e-3)  # scaled distances along the locus of the graze at which another one is sought
_MISSED = 10.0  # distance from the breakpoint of the motions there, in squares of that distance
_NONE = np.zeros(2)
_REACH = 0.05  # share of the range of the second parameter within which they are followed


def special_at(start: SpecialPoint | Codim2Point, kind: str | None) -> SpecialPoint:
    """Return the special point of a kind at a point of codimension two; a special point as it is."""
    if isinstance(start, SpecialPoint):
        if kind is not None:
            raise ModelError(f"kind is {kind!r}, but the start is a {start.kind.value} already; leave kind out")
        return start
    if not isinstance(start, Codim2Point):
        raise ModelError(
            f"a locus begins at a special point or at a point of codimension two, not at {start!r}; kinds with loci "
            f"are {', '.join(Kind.with_locus())}; write one of them, as branch.special_points[0]"
        )
    wanted = None if kind is None else Kind.named(kind)
    names = ("fold", "flip", "neimark-sacker", *("grazing",) * bool(start.contact))
    if slides := start.kind is Codim2.DEGENERATE_SLIDING:
        names = ("crossing-sliding", "switching-sliding")
    if wanted is None or wanted not in names:
        raise ModelError(
            f"kind is {kind!r}; several loci meet at {start}: write the kind that begins there, one of {names}"
        )
    return special_of(wanted, start.orbit, start.contact if slides or wanted is Kind.GRAZING else "")


def special_of(kind: Kind, orbit: Orbit, contact: str) -> SpecialPoint:
    """Return the special point of an orbit at its bifurcation."""
    point = BranchPoint(math.nan, orbit, _NONE, _NONE, 1.0, 0.0)
    return SpecialPoint(kind, point, orbit.instability, orbit.instability, math.inf, contact)


def special_beside(found: Codim2Point, kind: Kind, names: tuple[str, str], within: tuple[Range, Range]) -> SpecialPoint:
    """Return a special point of a kind on its locus near a point where that locus ends at a graze."""
    for aside, way in product(_ASIDE, (1.0, -1.0)):
        beside = _beside(found, names, within, way * aside)
        if beside is None:
            continue
        value, (low, high) = beside.system[names[1]], (within[1].low, within[1].high)
        reach = _REACH * (high - low)
        try:
            branch = follow(beside, names[1], (max(low, value - reach), min(high, value + reach)))
        except (NumericalError, ModelError):
            continue
        if alike := branch.special(kind):
            return min(alike, key=lambda each: abs(each.value - value))
    raise ConvergenceError(f"no locus of the kind {kind} is found near {found}")


def _beside(found: Codim2Point, names: tuple[str, str], within: tuple[Range, Range], aside: float) -> Orbit | None:
    """Return a motion that just misses the contact, a little along the locus of its graze; None if there is none."""
    plane = ShotPlane(found.orbit.system, names, found.orbit.period)
    switch = switch_named(found.orbit, found.contact) or 0
    scales = powers_of_two(np.concatenate((plane.scales(found.orbit), [PERIOD], [each.width for each in within])))
    equation = GrazingEquation(plane, switch, 0.0, plane.tolerance)
    start, value = equation.unknowns(found.orbit), found.orbit.system[names[1]]
    missed = _MISSED * aside**2 * float(scales[0])
    corrector = Corrector(replace(equation, depth=-missed if equation.is_highest(start, value) else missed), scales)
    correction, tangent = onto_curve(corrector, np.append(start, value) / scales)
    correction = correction and corrector.correct(correction.x + aside * tangent, tangent)
    if correction is None:
        return None
    x = correction.x * scales
    return equation.orbit(x[:-1], float(x[-1]), correction.evaluation)

"""Follow a special point from one member of a family towards the next: where its locus leads, exactly."""

from __future__ import annotations

from dataclasses import dataclass, replace

from gapwalk.bifurcation.branch import SpecialPoint
from gapwalk.bifurcation.loci import Codim2, Locus, LocusEndReason, follow_locus
from gapwalk.bifurcation.loci.locus import Codim2Point, LocusPoint
from gapwalk.bifurcation.loci.locus_start import start_locus
from gapwalk.bifurcation.loci.solution_curve import Secant, zero_along
from gapwalk.continuation.corrector import Correction, Corrector
from gapwalk.continuation.walk_options import WalkOptions
from gapwalk.orbit.orbit import Orbit
from gapwalk.studies.family.connection import TURN
from gapwalk.studies.family.gap import Gap

# The gap is one wide, like the range. Loci bend less than branches, and steps shorten where they do; where one leads is
# verified by the orbit at its end.
_WALK = WalkOptions(initial_step=0.02, largest_step=0.1)
_EDGE = 1e-9  # share of the gap within which a locus has reached a member
_SECANT = Secant(longest=0.05, farthest=0.2)


@dataclass(frozen=True)
class Trace:
    """The locus of a special point between two members.

    Attributes
    ----------
    locus
        The locus from the special point on.
    arrives
        The member that it reaches, 0 or 1; None if it ends between them.
    """

    locus: Locus
    arrives: int | None

    @property
    def orbit(self) -> Orbit:
        """The orbit where it ends."""
        return self.locus.points[-1].orbit

    @property
    def first(self) -> float:
        """The parameter of the members where it ends."""
        return self.locus.points[-1].values[0]


def trace(special: SpecialPoint, side: int, gap: Gap) -> Trace:
    """Follow a special point of one member into the gap.

    Raises
    ------
    NumericalError
        If it cannot be followed.
    """
    lifted = gap.lifted(special, side)
    locus = _inwards(follow_locus(lifted, gap.parameter, gap.second, gap.ranges, walk=_WALK))
    share = gap.share(locus.points[-1].values[1])
    at_edge = locus.ends[1].reason is LocusEndReason.RANGE and len(locus.points) > 1
    arrives = next((end for end in (0, 1) if at_edge and abs(share - end) <= _EDGE), None)
    return Trace(locus, arrives)


def _inwards(locus: Locus) -> Locus:
    """The locus from its start on: of its two directions there, one leads out of the gap and ends at once."""
    begin, end = locus.ends
    if begin.reason is LocusEndReason.START:
        return locus
    points, codim2 = locus.points[::-1], locus.codim2_points[::-1]
    return replace(locus, points=points, codim2_points=codim2, ends=(end, begin))


def farthest(found: Trace, special: SpecialPoint, side: int, gap: Gap) -> tuple[tuple[float, float], str]:
    """Where a locus that comes back to the member from which it started is farthest from it, and what happens there."""
    here = gap.bounds[side]
    points: list[tuple[LocusPoint, str]] = [(point, TURN) for point in found.locus.points]
    points += [(each.point, each.kind.value) for each in found.locus.codim2_points if _turns(each)]
    best, event = max(points, key=lambda each: abs(each[0].values[1] - here))
    if event != TURN:
        return (best.values[0], gap.value(best.values[1])), event
    corrector = start_locus(gap.lifted(special, side), gap.parameter, gap.second, gap.ranges)[0].corrector
    turn = zero_along(corrector, best.x, lambda correction: _slope(corrector, correction, best), _SECANT)
    first, second = best.values if turn is None else (turn.x[-2:] * corrector.scales[-2:]).tolist()
    return (first, gap.value(second)), event


def _turns(codim2: Codim2Point) -> bool:
    """Whether a locus may turn back at a point: at a cusp, and at the corners that it has where a contact grazes."""
    return codim2.kind in (Codim2.CUSP, Codim2.GRAZING, Codim2.DEGENERATE_GRAZING)


def _slope(corrector: Corrector, correction: Correction, beside: LocusPoint) -> float:
    """How fast the second parameter changes along a locus."""
    return float(corrector.tangent(correction.evaluation, beside.tangent).tangent[-1])

"""Spans of a parameter over which a gap does the same, and the bands in which it rattles, with their located ends.

A span ends at a grazing point, where the deflection just reaches a breakpoint; at a jump, where the motion that was
followed ends or loses its stability and the next one does something else; or between two samples of motions without a
branch.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from gapwalk.answers.gap_states import GapState, gap_state, innermost
from gapwalk.answers.settled_sweep import Direction, Sample, SettledSweep, Stretch, start_of
from gapwalk.attractors.section import Strobe
from gapwalk.bifurcation.special_point import SpecialPoint, describe_switch
from gapwalk.bifurcation.special_point_kind import Kind
from gapwalk.errors import ModelError, NumericalError
from gapwalk.flow.motion import Motion
from gapwalk.orbit.orbit import Orbit

_LOOK = 64  # forcing periods over which a motion without period is watched

RANGE, BETWEEN, LOST = "end of the range", "between samples", "end of a motion"


@dataclass(frozen=True, slots=True)
class Mover:
    """A parameter that moves the end of a band.

    Examples
    --------
    >>> mover = bands.of("stop", "rising")[0].high.with_movers().movers[0]
    >>> mover.name, round(mover.share, 3)
    ('mass.x.x', -0.458)
    """

    name: str  #: Name of the parameter.
    slope: float  #: Derivative of the end by the parameter, in the units of the model.
    error: float  #: Estimated error of the slope.
    share: float  #: Change of the end in percent for one percent more of the parameter.


@dataclass(frozen=True, eq=False)
class BandEnd:
    """End of a span or a band.

    Examples
    --------
    >>> end = bands.of("stop", "rising")[0].high
    >>> end.kind, round(end.value, 6), end.is_jump
    ('fold', 1.392109, True)
    """

    value: float  #: Value of the parameter.
    #: ``grazing``; ``fold``, ``flip`` or another kind of special point at which the motion is lost, so that it jumps;
    #: ``end of the range``; ``between samples`` if motions without a branch lie on either side.
    kind: str
    error: float = 0.0  #: Estimated error of the value.
    special: SpecialPoint | None = None  #: The special point; None if there is none.
    movers: tuple[Mover, ...] = ()  #: Parameters that move it, those that move it most first.

    @property
    def is_located(self) -> bool:
        """True if it is a special point of a branch."""
        return self.special is not None

    @property
    def is_jump(self) -> bool:
        """True if the motion jumps there."""
        return self.special is not None and self.special.kind is not Kind.GRAZING

    def with_movers(self) -> BandEnd:
        """Return the end with the parameters that move it; without them if the point has no gradient."""
        if self.special is None or self.movers:
            return self
        try:
            found = self.special.gradient()
        except (ModelError, NumericalError):
            return self
        shares = found.elasticities
        movers = [
            Mover(found.names[k], float(found.slopes[k]), float(found.errors[k]), float(shares[k])) for k in found.order
        ]
        return replace(self, movers=tuple(movers))


@dataclass(frozen=True, eq=False)
class GapSpan:
    """A span of the parameter over which the state of a gap is the same.

    Examples
    --------
    >>> span = bands.of("stop", "rising")[0].spans[0]
    >>> round(span.high.value, 6), span.state.value
    (1.392109, 'one side')
    """

    #: low, high: Its ends.
    low: BandEnd
    high: BandEnd
    state: GapState  #: The state of the gap.


@dataclass(frozen=True, eq=False)
class RattleBand:
    """A band of the parameter in which a gap rattles.

    Examples
    --------
    >>> band = bands.of("stop", "rising")[0]
    >>> band.met, round(band.low.value, 6), round(band.high.value, 6)
    ('rising', 1.1, 1.392109)
    """

    gap: str  #: Name of the contact.
    #: How it is met: ``rising``, ``falling``, or ``any`` for the union over all settled motions that are known.
    met: str
    #: low, high: Its ends.
    low: BandEnd
    high: BandEnd
    #: The spans of equal state in it, in the order of the parameter; those of a union may overlap.
    spans: tuple[GapSpan, ...]

    @property
    def states(self) -> tuple[GapState, ...]:
        """The states of the gap in it, each once."""
        return tuple(state for state in GapState if any(span.state is state for span in self.spans))


def state_of(motion: Orbit | Sample, gap: str) -> GapState:
    """Return the state of a gap in an orbit, or in a sampled motion that need not be periodic."""
    if isinstance(motion, Orbit):
        return gap_state(motion, gap)
    settled = motion.motion
    if settled.orbit is not None:
        return gap_state(settled.orbit, gap)
    watched = Strobe(settled.system).arc(settled.state, _LOOK)  # only its events matter
    return gap_state(Motion.of(settled.system, np.zeros(1), settled.state[None], watched.contacts), gap)


def spans_of(sweep: SettledSweep, gap: str) -> list[GapSpan]:
    """Return the spans of a gap along a sweep, in the order of the parameter."""
    ends: list[BandEnd] = []
    states: list[GapState] = []
    last: Stretch | Sample | None = None
    for piece in sweep.pieces:
        changes = list(_changes(piece, gap))
        state = changes[0][1]
        if last is None:
            ends.append(BandEnd(start_of(piece), RANGE))
            states.append(state)
        elif state is not states[-1]:
            ends.append(_between(last, start_of(piece)))
            states.append(state)
        for end, state in changes[1:]:
            assert end is not None
            ends.append(end)
            states.append(state)
        last = piece
    if last is None:
        return []
    final = last.end if isinstance(last, Stretch) else last.value
    bound = sweep.within[1] if sweep.direction is Direction.UP else sweep.within[0]
    is_whole = abs(final - bound) <= abs(sweep.within[1] - sweep.within[0]) * 1e-9
    if isinstance(last, Sample) or is_whole:  # the next sample would lie beyond the range
        ends.append(BandEnd(bound, RANGE))
    else:
        ends.append(_between(last, final) if last.lost is not None else BandEnd(final, LOST, abs(final - bound)))
    spans = [GapSpan(low, high, state) for (low, high), state in zip(pairwise(ends), states, strict=True)]
    if sweep.direction is Direction.DOWN:
        spans = [GapSpan(span.high, span.low, span.state) for span in reversed(spans)]
    return spans


def bands_of_spans(spans: Sequence[GapSpan], gap: str, met: str) -> tuple[RattleBand, ...]:
    """Return the bands of spans that touch or overlap; the ends of a band are its outermost."""
    bands: list[list[GapSpan]] = []
    high: BandEnd | None = None
    for span in sorted((span for span in spans if span.state.rattles), key=lambda span: span.low.value):
        if high is not None and span.low.value <= high.value + high.error:
            bands[-1].append(span)
            high = max(high, span.high, key=lambda end: end.value)
        else:
            bands.append([span])
            high = span.high
    return tuple(
        RattleBand(gap, met, band[0].low, max((span.high for span in band), key=lambda end: end.value), tuple(band))
        for band in bands
    )


def _between(last: Stretch | Sample, value: float) -> BandEnd:
    """Return the end between a piece of a sweep and the next one, which begins at a value."""
    if isinstance(last, Sample):
        return BandEnd(0.5 * (last.value + value), BETWEEN, 0.5 * abs(value - last.value))
    if last.lost is None:
        return BandEnd(last.end, LOST, abs(value - last.end))
    return BandEnd(last.end, str(last.lost.kind), last.lost.uncertainty, last.lost)


def _changes(piece: Stretch | Sample, gap: str) -> Iterator[tuple[BandEnd | None, GapState]]:
    """Yield the first state of a gap in a piece, then each change of it: the end of the span, and the new state."""
    if isinstance(piece, Sample):
        yield None, state_of(piece, gap)
        return
    points = piece.points
    before = gap_state(points[0].orbit, gap)
    yield None, before
    for one, other in pairwise(points):
        after = gap_state(other.orbit, gap)
        if after is not before:
            specials = [
                each for each in piece.special_points if one.arclength <= each.point.arclength <= other.arclength
            ]
            yield from _through(one.orbit, other.orbit, gap, specials, (one.value, other.value), (before, after))
        before = after


def _through(
    one: Orbit,
    other: Orbit,
    gap: str,
    specials: Iterable[SpecialPoint],
    values: tuple[float, float],
    states: tuple[GapState, GapState],
) -> Iterator[tuple[BandEnd, GapState]]:
    """Yield the changes of a gap between two neighbouring orbits of a branch.

    A side that is touched from now on was first touched at the first graze of its breakpoint, and one that is no longer
    touched was last touched at the last.
    """
    touched = [_touched(orbit, gap) for orbit in (one, other)]
    names = {side: describe_switch(one, switch) for switch, side in innermost(one.system, gap).items()}
    found = []
    for side in sorted(touched[0] ^ touched[1]):
        own = [each for each in specials if each.kind is Kind.GRAZING and each.contact == names[side]]
        if own:
            found.append(own[0] if side in touched[1] else own[-1])
    found.sort(key=lambda each: each.point.arclength)
    ends = [BandEnd(each.value, str(each.kind), each.uncertainty, each) for each in found]
    if not ends:
        ends = [BandEnd(float(np.mean(values)), BETWEEN, 0.5 * abs(values[1] - values[0]))]
    for end in ends[:-1]:  # two sides at once: first one of them
        yield end, GapState.ONE_SIDE
    yield ends[-1], states[1]


def _touched(orbit: Orbit, gap: str) -> set[int]:
    inner = innermost(orbit.system, gap)
    return {inner[event.switch] for event in orbit.events if event.switch in inner}

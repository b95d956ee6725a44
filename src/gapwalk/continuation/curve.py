"""A curve of solutions along a parameter: its record, what may happen along it, and its trace in one direction."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from gapwalk.continuation.corrector import Zero, zero_in_step
from gapwalk.continuation.curve_points import BranchPoint
from gapwalk.continuation.walk import End, EndReason, Tracing, Walk, in_one_direction
from gapwalk.notebook import Shown
from gapwalk.summary import Rows, SummaryParts, Table, row_of, rows_of, summarizes


@dataclass(frozen=True)
class Happens:
    """A kind of event along a curve: a zero, with a change of sign, of a function of its points."""

    name: str
    function: Callable[[BranchPoint], float]
    least: float = 0.0  # size that both values must exceed for their signs to count
    is_genuine: Callable[[BranchPoint], bool] = lambda point: True
    hides: str = ""  # name of what changes its sign at the same place for this reason


def turn(name: str, least: float, hides: str = "") -> Happens:
    """Return what happens where the parameter turns back."""
    return Happens(name, lambda point: float(point.tangent[-1]), least, hides=hides)


def crossing(name: str) -> Happens:
    """Return what happens where another curve crosses."""
    return Happens(name, lambda point: point.determinant)


class CurveEvent:
    """A point of a curve at which something happens."""

    kind: Any
    value: Any
    uncertainty: Any

    @property
    def words(self) -> str:
        """The event in words."""
        return self.kind

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.words} at {self.value:.10g} +- {self.uncertainty:.0e})"


class Curve(Shown):
    """Solutions along a parameter, with what happens along them and both ends."""

    _end_words: ClassVar[Any] = staticmethod(str)
    #: Headings and formats of the columns of events in words; a heading may name an attribute of the curve.
    _words: ClassVar[Mapping[str, str]]

    points: Any
    events: Any
    ends: Any

    @property
    def values(self) -> NDArray[np.float64]:
        """Value of the parameter at each point, shape (points,)."""
        return np.array([point.value for point in self.points])

    @property
    def complete(self) -> bool:
        """True if the walk came to an end by itself."""
        return all(end.reason.is_final for end in self.ends)

    @property
    def failures(self) -> tuple[str, ...]:
        """Ends at which the numerics gave up, in sentences."""
        return tuple(self._end_words(end) for end in self.ends if end.reason.is_failure)

    @property
    def _range_words(self) -> str:
        raise NotImplementedError

    @summarizes
    def summary(self) -> SummaryParts:
        """Return the range, the events and the ends, in words."""
        yield self._range_words
        if self.events:
            rows = [[form.format(each) for form in self._words.values()] for each in self.events]
            yield Table([heading.format(self) for heading in self._words], rows)
        for place, end in zip(("first", "last"), self.ends, strict=True):
            yield f"{place} end: {self._end_words(end)}"

    def tables(self) -> Mapping[str, Callable[[], Rows]]:
        """Return the tables of points and events."""
        return {name: lambda name=name: rows_of(map(row_of, getattr(self, name))) for name in ("points", "events")}


class Measured:
    """A curve of motions."""

    points: Any

    def measure(self, name: str) -> NDArray[np.float64]:
        """Return one measure at each point, such as ``half.q1``, in the unit of the signal; see `Orbit.measure`."""
        return np.array([point.measure(name) for point in self.points])


def reason_first(end: End) -> str:
    """Return an end in words, with its details before its place."""
    return f"{end.reason_words}, at {end.value:.8g}"


def numbered(name: str, curves: Sequence[Any], records: Callable[[Any], Iterable[Any]], letter: str = "") -> Rows:
    """Yield the rows of a table of records of several curves, with the number of the curve first."""
    return rows_of(
        {name: f"{letter}{number}" if letter else number, **(each if isinstance(each, dict) else row_of(each))}
        for number, curve in enumerate(curves, start=1)
        for each in records(curve)
    )


class CurveTrace(Iterator[tuple[Any, list[Any]]]):
    """Trace of a curve in one direction: each solution, with what happened before it."""

    kinds: ClassVar[Sequence[Happens]] = ()
    is_closed = False  # a curve that closes on itself is followed in the other direction too

    def __init__(self, walk: Walk) -> None:
        self.walk, self.corrector, self.last = walk, walk.corrector, walk.point
        self.first: Any = walk.point.orbit
        self.end: End | None = None

    def __next__(self) -> tuple[Any, list[Any]]:
        point = None if self.end is not None else next(self.walk, None)
        if point is None:
            self.end = self.end or self.end_of_walk()
            raise StopIteration
        return self.taken(point)

    def taken(self, point: BranchPoint) -> tuple[Any, list[Any]]:
        """Go on to a point of the walk, and return its solution with what happened before it."""
        happened, self.last = list(self.happened(point)), point
        return point.orbit, happened

    def end_of_walk(self) -> End:
        """Return the end of the walk, at its last point."""
        end = self.walk.end
        assert end is not None
        return End(end.reason, self.walk.point.value, end.detail)

    def stopped(self, last: Any) -> End:
        """Return the end of the trace; that it was stopped at the last solution if it has none."""
        return self.end or End(EndReason.STOPPED, last.value)

    def happened(self, after: BranchPoint) -> Iterator[Any]:
        """Locate what happens between the last point and one after it."""
        hidden: set[str] = set()
        for kind in self.kinds:
            a, b = kind.function(self.last), kind.function(after)
            if not a * b < 0.0 or min(abs(a), abs(b)) <= kind.least or kind.name in hidden:
                continue
            hidden.add(kind.hides)
            zero = zero_in_step(self.last, after, self.corrector, kind.function)
            if kind.is_genuine(zero.point):
                yield self.event(kind, zero, after)

    def event(self, kind: Happens, zero: Zero, after: BranchPoint) -> Any:
        """Return the record of what happens at a point of the step to another one."""
        raise NotImplementedError


def joined(
    tracing: Tracing[Any, Any, Any], begin: Any, turned: Callable[[Any], Any], turned_event: Callable[[Any], Any]
) -> tuple[tuple[Any, ...], tuple[Any, ...], tuple[Any, Any]]:
    """Return points, events and ends of a curve in one direction of travel, from its traces in one or two."""
    # The first end is `begin` if there is one trace, or the last one alone closes the curve.
    kept = slice(-1, None) if tracing.traces[-1].is_closed else slice(None)
    traces, steps = tracing.traces[kept], tracing.steps[kept]
    ends = [
        trace.stopped(walked[-1][0] if walked else trace.first) for trace, walked in zip(traces, steps, strict=True)
    ]
    points, events = in_one_direction(steps, traces[-1].first, turned, turned_event)
    return points, events, (begin if begin is not None and len(traces) == 1 else ends[0], ends[-1])

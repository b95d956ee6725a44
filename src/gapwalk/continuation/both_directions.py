"""Tracing of a curve from its start, in one direction or in both directions one after the other, step by step."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Generic, Protocol, TypeVar

from gapwalk.errors import Interrupted

D = TypeVar("D")
S = TypeVar("S", bound=tuple[Any, ...])
S_co = TypeVar("S_co", covariant=True)
R = TypeVar("R")
P = TypeVar("P")
F = TypeVar("F")


class Trace(Protocol[S_co]):
    """Trace of a curve in one direction: an iterator over its steps that can be stopped after any step and resumed."""

    @property
    def state(self) -> Any:
        """Everything needed to resume the trace."""
        ...

    @property
    def end(self) -> Any:
        """End of the trace, with its reason; None while it continues."""
        ...

    @property
    def is_closed(self) -> bool:
        """True if the curve has returned to its start, so that nothing is left in the other direction."""
        ...

    def finish_with(self, end: Any) -> None:
        """Set the end that the trace had reached before it was stopped."""
        ...

    def __next__(self) -> S_co: ...


T = TypeVar("T", bound=Trace[Any])


@dataclass(frozen=True)
class TracingState(Generic[S]):
    """Progress of a tracing: the state, the end and the steps of each direction that was begun."""

    states: tuple[Any, ...]
    ends: tuple[Any, ...]
    steps: tuple[tuple[S, ...], ...]


class Tracing(Iterator[S], Generic[D, T, S]):
    """Iterator over the steps of a curve, traced in each direction in which it leaves its start.

    Attributes
    ----------
    steps
        The steps that each trace has yielded.
    """

    def __init__(
        self, beginnings: Sequence[D], begin: Callable[[D, Any], T], resume: TracingState[S] | None = None
    ) -> None:
        self._beginnings, self._begin = beginnings, begin
        self.traces: list[T] = []
        self.steps: list[list[S]] = []
        for state, end, steps in zip(resume.states, resume.ends, resume.steps, strict=True) if resume else ():
            self._begin_next(state, steps)
            if end is not None:
                self.traces[-1].finish_with(end)

    def to_end(self, record: Callable[[Any], R], report: Callable[..., object] | None = None) -> R:
        """Trace to the end, call `report` with the parts of each step, and return `record` of this tracing."""
        try:
            for step in self:
                if report is not None:
                    report(*step)
        except KeyboardInterrupt:
            if not self.traces:
                raise
            raise Interrupted(record(self)) from None
        return record(self)

    @property
    def state(self) -> TracingState[S]:
        """Progress so far: a tracing made with it as `resume` continues as if it had never been stopped."""
        return TracingState(
            tuple(trace.state for trace in self.traces),
            tuple(trace.end for trace in self.traces),
            tuple(map(tuple, self.steps)),
        )

    def __next__(self) -> S:
        while True:
            if self.traces:
                try:
                    step = next(self.traces[-1])
                except StopIteration:
                    if self.traces[-1].is_closed or len(self.traces) == len(self._beginnings):
                        raise
                else:
                    self.steps[-1].append(step)
                    return step
            self._begin_next(None, ())

    def _begin_next(self, state: Any, steps: Sequence[S]) -> None:
        self.traces.append(self._begin(self._beginnings[len(self.traces)], state))
        self.steps.append(list(steps))


def in_one_direction(
    walked: Sequence[Sequence[tuple[P, list[F]]]], first: P, turn: Callable[[P], P], turn_found: Callable[[F], F]
) -> tuple[tuple[P, ...], tuple[F, ...]]:
    """Join the steps of one or two traces into the points of a curve and the events between them."""
    *back, ahead = walked
    points, found = [first], []
    for steps in back:
        points = [*(turn(point) for point, _ in reversed(steps)), first]
        found = [turn_found(each) for _, before in reversed(steps) for each in reversed(before)]
    points += [point for point, _ in ahead]
    found += [each for _, before in ahead for each in before]
    return tuple(points), tuple(found)

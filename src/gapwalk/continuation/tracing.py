"""A curve as it is traced: in one direction of its start or in both, one after the other, step by step."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Generic, Protocol, TypeVar

D = TypeVar("D")
S = TypeVar("S")
S_co = TypeVar("S_co", covariant=True)


class Trace(Protocol[S_co]):
    """One direction of a curve: an iterator over its steps that can be stopped after any of them and resumed."""

    @property
    def state(self) -> Any:
        """All that is needed to resume it."""
        ...

    @property
    def end(self) -> Any:
        """Where and why it has ended; None while it has not."""
        ...

    @property
    def is_closed(self) -> bool:
        """Whether it has come back to its start, so that there is nothing in the other direction."""
        ...

    def finish_with(self, end: Any) -> None:
        """Take over the end that it had come to before it was stopped."""
        ...

    def __next__(self) -> S_co: ...


T = TypeVar("T", bound=Trace[Any])


@dataclass(frozen=True)
class TracingState(Generic[S]):
    """Where a tracing has come to: for each direction that was begun its state, its end, and its steps."""

    states: tuple[Any, ...]
    ends: tuple[Any, ...]
    steps: tuple[tuple[S, ...], ...]


class Tracing(Iterator[S], Generic[D, T, S]):
    """Traces a curve in the directions in which it departs from its start.

    Parameters
    ----------
    departures
        Where it begins, in each direction.
    begin
        The trace of one direction from its departure, and from a state that it had come to (or None).
    resume
        `state` of a tracing of the same departures that was stopped.

    Attributes
    ----------
    traces
        The directions that were begun.
    steps
        What each of them has yielded.
    """

    def __init__(
        self, departures: Sequence[D], begin: Callable[[D, Any], T], resume: TracingState[S] | None = None
    ) -> None:
        self._departures, self._begin = departures, begin
        self.traces: list[T] = []
        self.steps: list[list[S]] = []
        for state, end, steps in zip(resume.states, resume.ends, resume.steps, strict=True) if resume else ():
            self._begin_next(state, steps)
            if end is not None:
                self.traces[-1].finish_with(end)

    @property
    def state(self) -> TracingState[S]:
        """Where it has come to: a tracing made with it as `resume` continues as if it had never been stopped."""
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
                    if self.traces[-1].is_closed or len(self.traces) == len(self._departures):
                        raise
                else:
                    self.steps[-1].append(step)
                    return step
            self._begin_next(None, ())

    def _begin_next(self, state: Any, steps: Sequence[S]) -> None:
        self.traces.append(self._begin(self._departures[len(self.traces)], state))
        self.steps.append(list(steps))

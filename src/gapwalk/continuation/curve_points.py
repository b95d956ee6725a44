"""Tracing of a curve from its start, in one direction or in both directions one after the other, step by step."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from gapwalk.errors import Interrupted
from gapwalk.orbit.floquet import Instability
from gapwalk.orbit.orbit import Orbit, measure_names
from gapwalk.summary import row_of

# Point of a branch: an orbit, its place on the branch, and the direction in which the branch continues.


class OrbitOnCurve:
    """An orbit at a point of a curve, with the direction in which the curve continues."""

    orbit: Any
    x: Any
    tangent: Any

    def _check_read(self) -> None:
        """Raise a ValueError if its parts do not fit together."""
        if self.x.ndim != 1 or len(self.x) < 2 or self.tangent.shape != self.x.shape:
            raise ValueError("the unknowns of a point are not as many as the components of its tangent")

    def measure(self, name: str) -> float:
        """Return one measure of the motion; see `Orbit.measure`."""
        return self.orbit.measure(name)


@dataclass(frozen=True, eq=False)
class BranchPoint(OrbitOnCurve):
    """One orbit on a branch."""

    _row: ClassVar = {
        "parameter": "value",
        "stable": "stable",
        "instability": "instability.label",
        "contacts": "orbit.pattern",
    }

    value: float  #: Value of the parameter that is followed.
    orbit: Orbit  #: The orbit; its system carries all parameter values.
    x: NDArray[np.float64]  #: shape (N + 1,): Unknowns of the equation, then the parameter, in scaled variables.
    #: shape (N + 1,): Unit tangent of the branch there, in scaled variables, in the direction of the walk.
    tangent: NDArray[np.float64]
    #: Determinant of the Jacobian bordered by the tangent (see `Course`); its sign changes where branches cross.
    determinant: float
    arclength: float  #: Scaled arclength from the start of the walk.
    #: Cache of values derived from the point that are needed repeatedly.
    memo: dict[Any, Any] = field(default_factory=dict, repr=False, compare=False, metadata={"stored": False})

    @property
    def stable(self) -> bool:
        """True if the orbit is stable."""
        return self.orbit.stable

    @property
    def instability(self) -> Instability:
        """Number of multipliers outside the unit circle, and where they left it."""
        return self.orbit.instability

    def __repr__(self) -> str:
        return f"BranchPoint({self.value:.10g}, {self.instability.words}, contacts {self.orbit.pattern})"


def method_values(orbit: Orbit) -> list[float]:
    """Return the values under these headings; they are empty for an orbit that was found by shooting."""
    return [getattr(orbit, name) for name in orbit.method.columns]


def method_document(orbit: Orbit) -> dict[str, float]:
    """Return the method-specific values as JSON values."""
    return dict(zip(orbit.method.columns, method_values(orbit), strict=True))


def point_row(point: Any) -> dict[str, Any]:
    """Return the row of a point, special or not, in a table: its numbers, measures, and the values of its method."""
    orbit, names = point.orbit, measure_names(point.orbit.system.coordinates)
    measures = {name: orbit.measure(name) for name in names}
    return {**row_of(point), "measures": measures, **method_document(orbit)}


def motion_row(orbit: Orbit) -> dict[str, float]:
    """Return the state of an orbit at theta = 0, and its multipliers in polar form, by their headings."""
    polar = np.column_stack((np.abs(orbit.multipliers), np.angle(orbit.multipliers))).ravel().tolist()
    states = [f"{name}(0)" for name in orbit.system.state_names]
    multipliers = [f"{part}.multiplier{i + 1}" for i in range(len(states)) for part in ("modulus", "argument")]
    return dict(zip((*states, *multipliers), (*orbit.state.tolist(), *polar), strict=True))


D = TypeVar("D")
S = TypeVar("S", bound=tuple[Any, ...])
T = TypeVar("T", bound=Any)
R = TypeVar("R")
P = TypeVar("P")
F = TypeVar("F")


@dataclass(frozen=True)
class TracingState(Generic[S]):
    """Progress of a tracing: the state, the end and the steps of each direction that was begun."""

    states: tuple[Any, ...]
    ends: tuple[Any, ...]
    steps: tuple[tuple[S, ...], ...]


class Tracing(Iterator[S], Generic[D, T, S]):
    """Iterator over the steps of a curve, traced in each direction in which it leaves its start.

    A trace is an iterator over the steps in one direction. Its `end` is None while it continues; `is_closed` says that
    the curve has returned to its start; one that is made with its `state` resumes it.

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
                self.traces[-1].end = end

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

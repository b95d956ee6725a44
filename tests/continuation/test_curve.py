"""A kind of curve in one file: the circle x^2 + a^2 = 1 along a, with its turn, ends, table and words."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import pytest

from gapwalk.continuation.corrector import Corrector, Range, Zero
from gapwalk.continuation.curve import Curve, CurveEvent, CurveTrace, Happens, joined, turn
from gapwalk.continuation.walk import End, EndReason, Tracing, Walk, WalkOptions
from gapwalk.orbit.orbit_equation import Evaluation


@dataclass(frozen=True)
class Place:
    value: float
    height: float
    stuck = ()


@dataclass(frozen=True, repr=False)
class Turn(CurveEvent):
    kind: str
    value: float
    uncertainty: float


@dataclass(frozen=True, eq=False)
class Arc(Curve):
    _words: ClassVar = {"what": "{0.words}", ">{0.parameter}": "{0.value:.6g}"}
    parameter: str
    points: tuple[Place, ...]
    events: tuple[Turn, ...]
    ends: tuple[End, End]

    @property
    def _range_words(self) -> str:
        return f"an arc of {len(self.points)} points"


class Circle:
    tolerance = 1e-12

    def evaluate(self, unknowns: np.ndarray, value: float) -> Evaluation:
        (x,) = unknowns
        return Evaluation(np.array([x * x + value**2 - 1.0]), np.array([[2.0 * x]]), np.array([2.0 * value]), None)

    def orbit(self, unknowns: np.ndarray, value: float, evaluation: Evaluation) -> Place:
        return Place(value, float(unknowns[0]))


class CircleTrace(CurveTrace):
    kinds = (turn("it turns back", 1e-9),)

    def event(self, kind: Happens, zero: Zero, after: object) -> Turn:
        return Turn(kind.name, zero.point.value, zero.width)


def arc(**options: int) -> Arc:
    corrector: Any = Corrector(Circle(), np.ones(2))  # type: ignore[arg-type]
    within = Range(-0.5, 2.0)

    def begin(way: float, _: object) -> CircleTrace:
        first = corrector.point_at(np.array([1.0, 0.0]), 0.0, np.array([0.0, way]))
        return CircleTrace(Walk(first, within, corrector, WalkOptions(**options), trust=0.0, branched=True))

    def record(tracing: Tracing) -> Arc:
        return Arc("a", *joined(tracing, None, lambda point: point, lambda event: event))

    return Tracing((-1.0, 1.0), begin).to_end(record)


def test_both_directions_give_one_curve_with_its_turn_and_ends():
    found = arc()
    (event,) = found.events
    assert found.values[[0, -1]].tolist() == [-0.5, -0.5]
    assert [point.height for point in (found.points[0], found.points[-1])] == pytest.approx([0.75**0.5, -(0.75**0.5)])
    assert event.value == pytest.approx(1.0, abs=1e-9)
    assert [end.reason for end in found.ends] == [EndReason.RANGE] * 2
    assert found.complete
    assert not found.failures
    assert str(found.summary()).endswith("last end: the end of the range was reached, at -0.5")
    assert repr(event) == f"Turn(it turns back at {event.value:.10g} +- {event.uncertainty:.0e})"
    headings, row = found.tables()["events"]()
    assert dict(zip(headings, row, strict=True))["kind"] == "it turns back"


def test_a_curve_says_where_the_numerics_gave_up():
    found = arc(max_points=3)
    assert len(found.points) == 7
    assert len(found.failures) == 2
    assert all("max_points = 3" in text for text in found.failures)

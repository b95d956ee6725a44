"""Writes a walk while it is computed, so that nothing that was reported is ever lost.

The points of one moment are one part of the file, together with the state of the walk after them. So a run that is
killed at any moment is resumed as if nothing had happened; and thousands of small parts would take longer to write than
their points to compute.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import NamedTuple, TypeVar

from gapwalk.bifurcation.branch import SpecialPoint
from gapwalk.bifurcation.branch_tracer import BranchTracerState
from gapwalk.bifurcation.detector import DetectorState
from gapwalk.continuation.branch_point import BranchPoint
from gapwalk.continuation.walk import End
from gapwalk.orbit.orbit import Orbit
from gapwalk.results.result_file import Part
from gapwalk.studies.request import Keeper, NoFile

_SECONDS = 0.1  # between two writes
_POINTS = 500  # at most in one write

Report = Callable[[BranchPoint, list[SpecialPoint]], object]
"""Called with each point of a branch and the special points between it and the one before."""

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Progress:
    """Where a walk has come to, but for its last two points: they are kept as points."""

    step: float
    count: int
    detector: DetectorState


class Moment(NamedTuple):
    """What a walk has found since the moment before.

    Attributes
    ----------
    points, special_points
        Its points, and the special points between them and the one before.
    progress
        Where the walk can continue; None if it has not left its first point.
    ends
        Where and why it ends, at its beginning and at its end; None while it goes on.
    """

    points: tuple[BranchPoint, ...]
    special_points: tuple[SpecialPoint, ...] = ()
    progress: Progress | None = None
    ends: tuple[End, ...] | None = None


START = Part("start", Orbit)
MOMENT = Part("moment", Moment, numbered=True)


class WalkFile:
    """The file of a response that is being walked.

    Parameters
    ----------
    file
        The file.
    moments
        What it has already: the first point at least.
    report
        Called with each point once it is safe.

    Attributes
    ----------
    moments
        All that it has.
    """

    def __init__(self, file: Keeper, moments: Iterable[Moment], report: Report | None = None) -> None:
        self.moments = list(moments)
        self._file, self._report = file, report
        self._pending: list[tuple[BranchPoint, list[SpecialPoint]]] = []
        self._progress, self._ends = self.moments[-1].progress, self.moments[-1].ends
        self._written = time.monotonic()

    def add(
        self,
        point: BranchPoint,
        special_points: list[SpecialPoint],
        state: BranchTracerState,
        ends: tuple[End, ...] | None,
    ) -> None:
        """Take in a new point, the special points before it, and the state of the walk after it.

        It is written, and reported, with one of the next points at the latest a tenth of a second later.

        Raises
        ------
        StoreError
            If the file can no longer be written.
        """
        self._pending.append((point, special_points))
        self._progress = Progress(state.walk.step, state.walk.count, state.detector)
        self._ends = ends
        is_due = len(self._pending) >= _POINTS or time.monotonic() - self._written >= _SECONDS
        if is_due or isinstance(self._file, NoFile):
            self._flush()

    def finish(self, ends: tuple[End, ...]) -> None:
        """Write the rest, and where and why the walk ended. Errors as `add`."""
        self._ends = ends
        self._flush()

    def _flush(self) -> None:
        """Write what has been taken in, with the state of the walk, at once; then report it."""
        safe = self._pending
        special_points = tuple(special for _, specials in safe for special in specials)
        moment = Moment(tuple(point for point, _ in safe), special_points, self._progress, self._ends)
        self._file.write(MOMENT.entry(moment, len(self.moments)))
        self.moments.append(moment)
        self._pending, self._written = [], time.monotonic()
        if self._report is not None:
            for found in safe:
                self._report(*found)


def in_order(parts: Iterable[tuple[int, T]]) -> list[T]:
    """Parts that follow one another from number 0; a ValueError if one is missing."""
    found = []
    for number, value in parts:
        if number != len(found):
            raise ValueError(f"what should follow its part {len(found)} is missing")
        found.append(value)
    if not found:
        raise ValueError("it holds nothing")
    return found

"""The live locus: points of the last curves are moved to other numbers; at rest the loci are followed again."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import pairwise
from typing import Any, NamedTuple, Self, cast

import numpy as np

from gapwalk.bifurcation.follow import walk
from gapwalk.bifurcation.loci import Locus, LocusStart, start_locus
from gapwalk.bifurcation.loci.begin_at import special_of
from gapwalk.bifurcation.loci.follow_locus import Ranges, trace_locus, traced_locus
from gapwalk.bifurcation.moved_curve import codim2_marks, moved
from gapwalk.bifurcation.special_point import Kind
from gapwalk.continuation.corrector import Corrector, hermite
from gapwalk.errors import ConvergenceError, ModelError, NumericalError
from gapwalk.model.system import System
from gapwalk.model.words import parameter_words
from gapwalk.orbit.find import find_orbit
from gapwalk.studies.live_answer import GAP, LONGEST, LiveAnswer, Seen
from gapwalk.studies.locus_study import LocusStudyOptions
from gapwalk.studies.map_study import lies_on_locus
from gapwalk.studies.study_file import Study

_MOVED = 32  # points of all moved loci: each takes 1 to 2 ms
_BETWEEN = (0.0, 0.25, 0.5, 0.75)  # shares of the way to the next moved point at which the curve is drawn
_WIDER = 0.1  # share of the width of a locus by which the plane in which it is followed again is wider


class _Known(NamedTuple):
    """A locus, where it was begun, and the points that are moved."""

    start: LocusStart
    locus: Locus
    points: Sequence[Any]


class LiveLocus(LiveAnswer):
    """Loci of a study, or one that was followed already."""

    key = "locus"

    def __init__(self, names: tuple[str, str], to: Ranges, options: LocusStudyOptions | None = None) -> None:
        self.names, self.to, self.options = names, to, options
        self.known: list[_Known] = []

    @classmethod
    def of(cls, studies: Sequence[Study], at: float | None) -> tuple[Self, System]:
        """See `LiveAnswer.of`."""
        study = next((each for each in studies if isinstance(each.options, LocusStudyOptions)), None)
        if study is None:
            raise ModelError(
                'no study is a locus; write one of kind = "locus", with of, parameter, from, to and second'
            )
        options = cast("LocusStudyOptions", study.options)
        live = cls((options.parameter, options.second.parameter), (options.ends, options.second.ends), options)
        live.about = study.system.structure, options
        across, up = (parameter_words(name, study.system.units) for name in live.names)
        live.title = {"across": across, "up": up, "range": list(live.to[0])}
        return live, options.first_system(study.system)

    @classmethod
    def of_locus(cls, locus: Locus) -> LiveLocus:
        """Return the live answer of a locus."""
        across, up = locus.values.T
        live = cls((locus.first, locus.second), (_plane(across), _plane(up)))
        middle = locus.points[len(locus.points) // 2]
        for _ in live._trace(start_locus(special_of(locus.kind, middle.orbit, locus.contact), *live.names, live.to)):
            pass
        return live

    def coarse(self, system: System) -> Seen | None:
        """Return the moved points of the loci, with points of codimension two between them by interpolation."""
        found, seen = list[_Known](), Seen([], [], [], [])
        for known in self.known:
            own = _corrector(known.start, system)
            points = moved(own, known.points)
            enough = len(points) > 0.75 * len(known.points)  # the next ones are moved from here
            found.append(known._replace(points=points) if enough else known)
            if len(points) < 2:  # as where folds are beside a graze, which a Newton step passes
                continue
            places = [hermite(*pair, share) for pair in pairwise(points) for share in _BETWEEN]
            places.append(points[-1].x)
            _add(seen, known.locus.kind, np.array(places)[:, -2:] * own.scales[-2:])
            seen.marks.extend(codim2_marks(known.locus.kind, own, points))
        self.known = found
        return seen if seen.x else None

    def rest(self, system: System) -> Iterator[Seen | None]:
        """Yield the loci that are followed from the special points of the branch of the study."""
        before, is_whole = self.known, False
        self.known, self.end = [], ""
        try:
            yield from self._grown(system)
            is_whole = True
        finally:
            if not is_whole:  # it was given up
                self.known = before

    def _grown(self, system: System) -> Iterator[Seen | None]:
        assert self.options is not None
        (low, high), (_, second), options = self.to[0], self.names, self.options
        until = time.process_time() + LONGEST
        method, own = options.method.suited_to(system), system[self.names[0]]
        at = system.at({self.names[0]: own if low <= own <= high else high})
        steps = walk(
            find_orbit(at, options.period, options.start, method=method), self.names[0], self.to[0],
            walk=options.walk, method=method,
        )  # fmt: skip
        for _ in steps:
            yield None
        for special in options.which.of(steps.branch.special_points):
            on = (lies_on_locus(each.locus, special, system[second], high - low) for each in self.known)
            if not low <= special.value <= high or any(on):
                continue
            with suppress(NumericalError):
                for _ in self._trace(start_locus(special, *self.names, self.to, method)):
                    if time.process_time() > until:
                        self.end = f"stopped after {LONGEST:g} s of work; Compute follows all of it"
                        return
                    yield None
                locus, found = self.known[-1].locus, Seen([], [], [], [])
                _add(found, locus.kind, locus.values)
                found.marks.extend((each.kind.value, *each.values) for each in locus.codim2_points)
                yield found
        if not self.known:
            self.end = f"the branch has no {options.which.words}"

    def exact(self, system: System) -> Locus:
        """Return the locus, followed again from a point that was moved."""
        (known,) = self.known
        start, own = known.start, _corrector(known.start, system)
        points = moved(own, known.points)
        if not points:
            raise ConvergenceError(f"the locus of {known.locus.kind.value} points is not found near the last one")
        point = replace(points[len(points) // 2], arclength=0.0)
        back = replace(point, tangent=-point.tangent, determinant=-point.determinant, memo={})
        for _ in self._trace([replace(start, corrector=own, first=each) for each in (back, point)]):
            pass
        return self.known[0].locus

    def _trace(self, starts: list[LocusStart]) -> Iterator[None]:
        """Follow a locus, which is known afterwards."""
        tracing = trace_locus(starts, None if self.options is None else self.options.walk)
        for _ in tracing:
            yield
        locus, last = traced_locus(tracing), tracing.traces[-1].beginning
        own = [each for each in locus.points if len(each.x) == len(last.corrector.scales)]
        count = _MOVED if self.options is None else max(5, _MOVED // (len(self.known) + 1))
        found = _Known(last, locus, _spread(own, count))
        known = self.known if self.options is not None else []
        self.known = [*(each._replace(points=_spread(each.points, count)) for each in known), found]


def _add(seen: Seen, kind: Kind, values: np.ndarray) -> None:
    """Add a curve to others."""
    seen.x.extend([*values[:, 0].tolist(), GAP])
    seen.y.extend([*values[:, 1].tolist(), GAP])
    seen.looks.extend([kind.value] * (len(values) + 1))


def _corrector(start: LocusStart, system: System) -> Corrector:
    """Return the corrector of the locus of a system with other numbers."""
    equation = start.equation
    return Corrector(replace(equation, plane=equation.plane.with_system(system)), start.corrector.scales)


def _spread(points: Sequence[Any], count: int) -> list[Any]:
    """Return some points, evenly spread."""
    return [points[k] for k in np.unique(np.linspace(0, len(points) - 1, count).round().astype(int))]


def _plane(values: np.ndarray) -> tuple[float, float]:
    """Return a range a little wider than the values of a locus."""
    low, high = float(values.min()), float(values.max())
    more = _WIDER * (high - low)
    return low - more if low - more > 0.0 or low <= 0.0 else 0.5 * low, high + more

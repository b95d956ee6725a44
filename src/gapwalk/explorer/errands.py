"""What follows from an orbit and is no study of a model file: a switch, a search for others, a locus.

Each is stored as a result of a kind that there is: a switch and a search as a diagram, a locus as a map. What Ctrl-C
has interrupted keeps what it has found. A search that goes on keeps its branches; a switch and a locus are walked
anew, for they take seconds, and so they come to the same as without the interruption.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gapwalk.bifurcation import Trail, join, switch
from gapwalk.bifurcation.branch import Branch, SpecialPoint
from gapwalk.bifurcation.diagram import Diagram, Limb
from gapwalk.bifurcation.locus import LocusEndReason
from gapwalk.bifurcation.locus.departure import depart_locus
from gapwalk.bifurcation.locus.follow import join_locus
from gapwalk.bifurcation.locus.trail import LocusTrail
from gapwalk.continuation.walk import EndReason
from gapwalk.errors import NumericalError
from gapwalk.explorer.news import News
from gapwalk.results.file import lock
from gapwalk.study.claim import earlier_result
from gapwalk.study.diagram.diagram import empty_diagram
from gapwalk.study.diagram.others import grow_others
from gapwalk.study.diagram.store import DiagramStore
from gapwalk.study.file import Study
from gapwalk.study.map import Map
from gapwalk.study.map.store import MapStore
from gapwalk.study.options import DiagramStudyOptions, MapStudyOptions
from gapwalk.study.request import request_file


@dataclass(frozen=True)
class SwitchErrand:
    """Walk the branch that leaves a special point, or that crosses there.

    Parameters
    ----------
    special
        The special point.
    """

    special: SpecialPoint

    def do(self, study: Study, output: Path, news: News, *, resume: bool) -> bool:
        """Walk it, from the special point also where an earlier walk was interrupted."""
        del resume
        options = study.options
        assert isinstance(options, DiagramStudyOptions)
        within = (options.begin, options.end)
        departures = switch(self.special, options.parameter, within, options.method)
        way = _Way(news)
        complete = way.walk(Trail(each, options.walk) for each in departures)
        branch = join(way.trails, way.walked)
        limb = Limb(f"P{branch.period}-1", branch)
        known = empty_diagram(options.parameter, within)
        tree = Diagram(options.parameter, known.within, (limb,), complete=complete)
        with lock(output), request_file(study, output) as file:
            store = DiagramStore(file, known)
            store.add(tree, limb)
            store.finish(tree, finished=complete)
        return complete


@dataclass(frozen=True)
class SearchErrand:
    """Search for motions that hang together with no known branch, and follow what is found.

    Parameters
    ----------
    known
        The known branches along the parameter.
    """

    known: tuple[Branch, ...]

    def do(self, study: Study, output: Path, news: News, *, resume: bool) -> bool:
        """Search and follow; an interrupted search begins anew, the branches of one that was complete are kept."""
        options = study.options
        assert isinstance(options, DiagramStudyOptions)
        within = (options.begin, options.end)
        with lock(output):
            earlier = earlier_result(output, study, resume=True, force=False) if resume else None
            tree = (earlier and earlier.diagram) or empty_diagram(options.parameter, within)
            for limb in tree.limbs:
                news.limb(tree, limb)
            with request_file(study, output, earlier and earlier.versions) as file:
                store = DiagramStore(file, tree)

                def keep(diagram: Diagram, limb: Limb) -> None:
                    store.add(diagram, limb)
                    news.limb(diagram, limb)

                limits, walk, method = options.limits, options.walk, options.method
                start = (study.system, options.parameter, within, self.known)
                grown, finished = grow_others(*start, limits, walk, method, keep, tree, news.part)
                if grown.search is not None:
                    store.finish(grown, finished=finished)
        return finished


@dataclass(frozen=True)
class LocusErrand:
    """Follow a special point in the plane of two parameters.

    Parameters
    ----------
    special
        The special point.
    """

    special: SpecialPoint

    def do(self, study: Study, output: Path, news: News, *, resume: bool) -> bool:
        """Follow it, from the special point also where an earlier walk was interrupted."""
        del resume
        options = study.options
        assert isinstance(options, MapStudyOptions)
        first, second = options.parameter, options.second.parameter
        news.locus(self.special.kind, second)
        departures = depart_locus(self.special, first, second, options.within, options.method)
        way = _Way(news)
        complete = way.walk(LocusTrail(each, options.walk) for each in departures)
        last = way.trails[-1].end
        # one direction shows the whole of a closed curve
        kept = slice(-1, None) if last is not None and last.reason is LocusEndReason.CLOSED else slice(None)
        locus = join_locus(way.trails[kept], way.walked[kept])
        chart = Map(first, second, options.within, (locus,), complete=complete)
        with lock(output), request_file(study, output) as file:
            store = MapStore(file)
            store.add(chart, locus)
            store.finish(chart)
        return complete


class _Way:
    """The one or two directions of a branch or a locus as far as they were walked.

    Parameters
    ----------
    news
        Who hears of each point.
    """

    def __init__(self, news: News) -> None:
        self.report: Callable[..., None] = news.point
        self.trails: list[Any] = []
        self.walked: list[list[Any]] = []

    def walk(self, trails: Iterator[Any]) -> bool:
        """Walk each trail to its end, or until Ctrl-C; whether it was to the end.

        Raises
        ------
        KeyboardInterrupt
            After Ctrl-C before there was anything.
        """
        try:
            for trail in trails:
                self.trails.append(trail)
                self.walked.append([])
                self._steps(trail, self.walked[-1])
                if trail.end is not None and trail.end.reason in (EndReason.CLOSED, LocusEndReason.CLOSED):
                    break
        except KeyboardInterrupt:
            if not any(self.walked):
                raise
            return False
        if not self.trails:
            raise NumericalError("nothing leaves this point between these values; choose a wider range")
        return True

    def _steps(self, trail: Iterator[Sequence[Any]], kept: list[Any]) -> None:
        for step in trail:
            kept.append(step)
            self.report(*step)

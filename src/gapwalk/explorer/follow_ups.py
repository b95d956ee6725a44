"""Work that starts from an orbit and is not a study of a model file: a switch, a search for others, a locus.

Each is stored as a result of a kind that there is: a switch and a search as a diagram, a locus as a map. What Ctrl-C
has interrupted keeps what it has found. A search that goes on keeps its branches; a switch and a locus are walked
again, for they take seconds, and so they give the same result as without the interruption.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from gapwalk.bifurcation import switch
from gapwalk.bifurcation.branch import Branch, SpecialPoint
from gapwalk.bifurcation.diagram import Diagram, DiagramBranch
from gapwalk.bifurcation.follow import BranchWalk
from gapwalk.bifurcation.loci.follow_locus import trace_locus, traced_locus
from gapwalk.bifurcation.loci.locus_start import start_locus
from gapwalk.errors import NumericalError
from gapwalk.explorer.news import News
from gapwalk.results.result_file import lock
from gapwalk.studies.claim import earlier_result
from gapwalk.studies.diagram.diagram import empty_diagram
from gapwalk.studies.diagram.others import grow_others
from gapwalk.studies.diagram.store import DiagramStore
from gapwalk.studies.file import Study
from gapwalk.studies.map import Map
from gapwalk.studies.map.store import MapStore
from gapwalk.studies.options import DiagramStudyOptions, MapStudyOptions
from gapwalk.studies.request import request_file

S = TypeVar("S")


@dataclass(frozen=True)
class SwitchFollowUp:
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
        beginnings = switch(self.special, options.parameter, within, options.method)
        if not beginnings:
            raise NumericalError("nothing leaves this point between these values; choose a wider range")
        steps = BranchWalk(beginnings, options.walk)
        complete = _to_end(steps, lambda point: news.point(point, list(steps.special_points)))
        member = DiagramBranch(f"P{steps.branch.period}-1", steps.branch)
        known = empty_diagram(options.parameter, within)
        tree = Diagram(options.parameter, known.within, (member,), complete=complete)
        with lock(output), request_file(study, output) as file:
            store = DiagramStore(file, known)
            store.write(tree, finished=complete)
        return complete


@dataclass(frozen=True)
class SearchFollowUp:
    """Search for motions connected to no known branch, and follow what is found.

    Parameters
    ----------
    known
        The known branches along the parameter.
    """

    known: tuple[Branch, ...]

    def do(self, study: Study, output: Path, news: News, *, resume: bool) -> bool:
        """Search and follow; an interrupted search begins again, the branches of one that was complete are kept."""
        options = study.options
        assert isinstance(options, DiagramStudyOptions)
        within = (options.begin, options.end)
        with lock(output):
            earlier = earlier_result(output, study, resume=True, force=False) if resume else None
            tree = (earlier and earlier.diagram) or empty_diagram(options.parameter, within)
            for member in tree.members:
                news.member(tree, member)
            with request_file(study, output, earlier and earlier.versions) as file:
                store = DiagramStore(file, tree)

                def keep(diagram: Diagram, member: DiagramBranch) -> None:
                    store.write(diagram)
                    news.member(diagram, member)

                limits, walk, method = options.limits, options.walk, options.method
                start = (study.system, options.parameter, within, self.known)
                grown, finished = grow_others(*start, limits, walk, method, keep, tree, news.part)
                if grown.search is not None:
                    store.write(grown, finished=finished)
        return finished


@dataclass(frozen=True)
class LocusFollowUp:
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
        beginnings = start_locus(self.special, first, second, options.within, options.method)
        steps = trace_locus(beginnings, options.walk)
        complete = _to_end(steps, lambda step: news.point(*step))
        locus = traced_locus(steps)
        chart = Map(first, second, options.within, (locus,), complete=complete)
        with lock(output), request_file(study, output) as file:
            store = MapStore(file)
            store.write(chart)
        return complete


def _to_end(steps: Iterator[S], tell: Callable[[S], None]) -> bool:
    """Walk to the end, or until Ctrl-C, and report each step; return True at the end.

    Raises
    ------
    KeyboardInterrupt
        After Ctrl-C before there was anything.
    """
    walked = False
    try:
        for step in steps:
            walked = True
            tell(step)
    except KeyboardInterrupt:
        if not walked:
            raise
        return False
    return True

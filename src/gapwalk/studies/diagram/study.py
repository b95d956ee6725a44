"""The study of a diagram: its branches are stored one by one as they are accepted, and an interrupted run goes on."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from contextlib import nullcontext
from dataclasses import replace

from gapwalk.bifurcation.diagram import Diagram, DiagramBranch
from gapwalk.errors import NumericalError
from gapwalk.orbit.find import find_orbit
from gapwalk.orbit.orbit import Orbit
from gapwalk.results.result_file import Parts, lock
from gapwalk.results.versions import versions
from gapwalk.studies.claim import earlier_result
from gapwalk.studies.diagram.diagram import empty_diagram, grow
from gapwalk.studies.diagram.store import DiagramState, DiagramStore, stored_diagram
from gapwalk.studies.file import Study
from gapwalk.studies.load import load_result
from gapwalk.studies.options import DiagramStudyOptions
from gapwalk.studies.request import request_file
from gapwalk.studies.result import Result

Report = Callable[[Diagram, DiagramBranch], object]
"""Called with the diagram so far and the branch that was added to it last."""


def run_diagram(
    study: Study,
    output: str | os.PathLike[str] | None = None,
    *,
    resume: bool = False,
    force: bool = False,
    report: Report | None = None,
) -> Result:
    """Run the study of a diagram; parameters and errors as in `gapwalk.run`."""
    with nullcontext() if output is None else lock(output):
        earlier = earlier_result(output, study, resume=resume, force=force)
        walked = study.walked
        known = None if earlier is None else earlier.diagram
        known = known or empty_diagram(walked.parameter, (walked.begin, walked.end))
        if report is not None:
            _report_again(known, report)
        if earlier is not None and earlier.complete:
            return earlier
        before = None if earlier is None else earlier.versions
        with request_file(study, output, before) as file:
            found = _grow(study, known, DiagramStore(file, known), report)
        if output is None:
            return _result(study, found, versions())
    return load_result(output)  # after Ctrl-C at any moment, what is stored is what counts


def read_diagram(study: Study, parts: Parts) -> Result:
    """The result of a diagram from the parts of its file; see `gapwalk.studies.load`."""
    found, options = stored_diagram(parts), study.walked
    low, high = sorted((options.begin, options.end))
    if (found.diagram.parameter, found.diagram.within) != (options.parameter, (low, high)):
        raise ValueError("the diagram does not belong to the study")
    return _result(study, found, {})


def _result(study: Study, found: DiagramState, written_by: Mapping[str, str]) -> Result:
    return Result(study, found.diagram.branches, found.finished, written_by, found.diagram)


def _grow(study: Study, known: Diagram, store: DiagramStore, report: Report | None) -> DiagramState:
    """Find the branches that are not known yet, and keep each of them."""
    options = study.options
    assert isinstance(options, DiagramStudyOptions)

    def keep(tree: Diagram, member: DiagramBranch) -> None:
        store.write(tree)
        if report is not None:
            report(tree, member)

    start = known.branches[0].points[0].orbit if known.members else _first_orbit(study)
    grown, finished = grow(
        start, options.parameter, known.within, options.limits, options.walk, options.method, keep, known
    )
    if not grown.members and not finished:
        raise KeyboardInterrupt  # there is nothing to keep
    if not grown.members:
        raise NumericalError("; ".join(grown.failures) or "no branch was found")
    store.write(grown, finished=finished)
    return DiagramState(grown, finished)


def _first_orbit(study: Study) -> Orbit:
    options = study.walked
    return find_orbit(study.system, options.period, options.start, method=options.method)


def _report_again(known: Diagram, report: Report) -> None:
    """Report the branches of a result that is resumed, each with the diagram as it was then."""
    for count, member in enumerate(known.members, start=1):
        report(replace(known, members=known.members[:count]), member)

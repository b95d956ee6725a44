"""The study of a diagram: its branches are stored one by one as they are accepted, and an interrupted run goes on."""

from __future__ import annotations

import os
from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import replace

from gapwalk.bifurcation.diagram import Diagram, Limb
from gapwalk.errors import NumericalError
from gapwalk.orbit.find import find_orbit
from gapwalk.orbit.orbit import Orbit
from gapwalk.study.diagram.diagram import empty_diagram, grow
from gapwalk.study.diagram.store import DiagramStore
from gapwalk.study.file import Study
from gapwalk.study.options import DiagramStudyOptions
from gapwalk.study.result import Result
from gapwalk.study.store.claim import earlier_result
from gapwalk.study.store.database import lock
from gapwalk.study.store.result_file import ResultFile
from gapwalk.study.store.stored import Stored, StoredDiagram, read
from gapwalk.study.store.versions import versions

Report = Callable[[Diagram, Limb], object]
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
        earlier = None if output is None else earlier_result(output, study, resume=resume, force=force)
        walked = study.walked
        empty = StoredDiagram(empty_diagram(walked.parameter, (walked.begin, walked.end)), finished=False)
        found = empty if earlier is None else earlier.found
        assert isinstance(found, StoredDiagram)  # the study is the same
        if report is not None:
            _report_again(found.diagram, report)
        if earlier is not None and found.finished:
            return earlier.result()
        written_by = versions(None if earlier is None else earlier.versions)
        if output is None:
            return Stored(study, _grow(study, found.diagram, None, report), written_by).result()
        with ResultFile(output, study, written_by, exists=earlier is not None) as file:
            _grow(study, found.diagram, DiagramStore(file, len(found.diagram.limbs)), report)
        return read(output).result()  # after Ctrl-C at any moment, what is stored is what counts


def _grow(study: Study, known: Diagram, store: DiagramStore | None, report: Report | None) -> StoredDiagram:
    """Find the branches that are not known yet, and keep each of them."""
    options = study.options
    assert isinstance(options, DiagramStudyOptions)

    def keep(tree: Diagram, limb: Limb) -> None:
        if store is not None:
            store.add(tree, limb)
        if report is not None:
            report(tree, limb)

    start = known.branches[0].points[0].orbit if known.limbs else _first_orbit(study)
    grown, finished = grow(
        start, options.parameter, known.within, options.limits, options.walk, options.method, keep, known
    )
    if not grown.limbs and not finished:
        raise KeyboardInterrupt  # there is nothing to keep
    if not grown.limbs:
        raise NumericalError("; ".join(grown.failures) or "no branch was found")
    if store is not None:
        store.finish(grown, finished=finished)
    return StoredDiagram(grown, finished)


def _first_orbit(study: Study) -> Orbit:
    options = study.walked
    return find_orbit(study.system, options.period, options.start, method=options.method)


def _report_again(known: Diagram, report: Report) -> None:
    """Report the branches of a result that is resumed, each with the diagram as it was then."""
    for count, limb in enumerate(known.limbs, start=1):
        report(replace(known, limbs=known.limbs[:count]), limb)

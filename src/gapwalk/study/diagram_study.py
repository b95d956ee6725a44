"""The study of a diagram: its branches are stored one by one as they are accepted, and an interrupted run goes on."""

from __future__ import annotations

import os
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from dataclasses import replace

from gapwalk.bifurcation.diagram import Diagram, Limb
from gapwalk.errors import NumericalError
from gapwalk.study.claim import earlier_result, versions
from gapwalk.study.database import lock
from gapwalk.study.diagram import diagram
from gapwalk.study.diagram_store import DiagramStore
from gapwalk.study.file import Study
from gapwalk.study.options import DiagramStudyOptions
from gapwalk.study.result import Result
from gapwalk.study.stored import Stored, StoredDiagram, StoredWalk, read

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
        found = StoredDiagram(_empty(study.options), finished=False) if earlier is None else earlier.found
        assert not isinstance(found, StoredWalk)  # the study is the same
        if report is not None:
            _report_again(found.diagram, report)
        if earlier is not None and found.finished:
            return earlier.result()
        written_by = versions(None if earlier is None else earlier.versions)
        with _store(output, study, written_by, found.diagram) as store:
            found = _grow(study, found.diagram, store, report)
        if output is not None:
            return read(output).result()  # after Ctrl-C at any moment, what is stored is what counts
        return Stored(study, found, written_by).result()


def _grow(study: Study, known: Diagram, store: DiagramStore | None, report: Report | None) -> StoredDiagram:
    """Find the branches that are not known yet, and keep each of them."""
    options = study.options
    assert isinstance(options, DiagramStudyOptions)

    def keep(tree: Diagram, limb: Limb) -> None:
        if store is not None:
            store.add(tree, limb)
        if report is not None:
            report(tree, limb)

    grown = diagram(
        study.system,
        options.parameter,
        known.within,
        start=known.branches[0].points[0].orbit if known.limbs else options.start,
        period=options.period,
        options=options.limits,
        walk=options.walk,
        shooting=options.shooting,
        report=keep,
        # what could not be done before is tried again, and noted again
        resume=replace(known, notes=(), complete=False) if known.limbs else None,
    )
    finished = grown.complete or len(grown.limbs) >= options.max_branches
    if not grown.limbs and not finished:
        raise KeyboardInterrupt  # there is nothing to keep
    if not grown.limbs:
        raise NumericalError("; ".join(grown.notes) or "no branch was found")
    if store is not None:
        store.finish(grown, finished=finished)
    return StoredDiagram(grown, finished)


def _store(
    output: str | os.PathLike[str] | None, study: Study, written_by: dict[str, str], known: Diagram
) -> AbstractContextManager[DiagramStore | None]:
    return nullcontext() if output is None else DiagramStore(output, study, written_by, len(known.limbs))


def _empty(options) -> Diagram:
    low, high = sorted((options.begin, options.end))
    return Diagram(options.parameter, (low, high))


def _report_again(known: Diagram, report: Report) -> None:
    """Report the branches of a result that is resumed, each with the diagram as it was then."""
    for count, limb in enumerate(known.limbs, start=1):
        report(replace(known, limbs=known.limbs[:count]), limb)

"""The study of a map, or of a locus: its sections and loci are stored one by one, and an interrupted run goes on."""

from __future__ import annotations

import os
from contextlib import nullcontext

from gapwalk.bifurcation.locus import Locus
from gapwalk.errors import NumericalError
from gapwalk.study.file import Study
from gapwalk.study.interruption import found_by
from gapwalk.study.locus.study_options import LocusStudyOptions
from gapwalk.study.map.chart import Map, Section
from gapwalk.study.map.charting import Report, bifurcation_map, chart_loci
from gapwalk.study.map.read import StoredMap
from gapwalk.study.map.store import MapStore
from gapwalk.study.options import MapStudyOptions
from gapwalk.study.result import Result
from gapwalk.study.store.claim import earlier_result
from gapwalk.study.store.database import lock
from gapwalk.study.store.result_file import ResultFile
from gapwalk.study.store.stored import Stored, read
from gapwalk.study.store.versions import versions


def run_map(
    study: Study,
    output: str | os.PathLike[str] | None = None,
    *,
    resume: bool = False,
    force: bool = False,
    report: Report | None = None,
) -> Result:
    """Run the study of a map, or of a locus; parameters and errors as in `gapwalk.run`."""
    options = study.options
    assert isinstance(options, MapStudyOptions)
    with nullcontext() if output is None else lock(output):
        earlier = None if output is None else earlier_result(output, study, resume=resume, force=force)
        empty = StoredMap(Map(options.parameter, options.second.parameter, options.within), finished=False)
        found = empty if earlier is None else earlier.found
        assert isinstance(found, StoredMap)  # the study is the same
        if report is not None:
            _report_again(found.chart, report)
        if earlier is not None and found.finished:
            return earlier.result()
        written_by = versions(None if earlier is None else earlier.versions)
        if output is None:
            return Stored(study, _chart(study, options, found.chart, None, report), written_by).result()
        with ResultFile(output, study, written_by, exists=earlier is not None) as file:
            _chart(study, options, found.chart, MapStore(file, found.chart), report)
        return read(output).result()  # after Ctrl-C at any moment, what is stored is what counts


def _chart(
    study: Study, options: MapStudyOptions, known: Map, store: MapStore | None, report: Report | None
) -> StoredMap:
    """Find what is not known yet, and keep it."""

    def keep(chart: Map, addition: Section | Locus) -> None:
        if store is not None:
            store.add(chart, addition)
        if report is not None:
            report(chart, addition)

    plane = (study.system, options.parameter, options.second.parameter, options.within)
    begin = {"start": options.start, "period": options.period, "walk": options.walk, "method": options.method}
    if isinstance(options, LocusStudyOptions):
        chart = found_by(chart_loci, *plane, options.which, **begin, report=keep, resume=known)
    else:
        chart = found_by(bifurcation_map, *plane, **begin, options=options.limits, report=keep, resume=known)
    if not chart.sections:
        raise KeyboardInterrupt  # there is nothing to keep
    if chart.complete and not chart.branches:
        raise NumericalError("; ".join(chart.failures) or "no branch was found")
    if store is not None:
        store.finish(chart, finished=chart.complete)
    return StoredMap(chart, chart.complete)


def _report_again(known: Map, report: Report) -> None:
    """Report what a resumed result has already: its sections, then its loci, each with the map as it was then."""
    for count, section in enumerate(known.sections, start=1):
        report(Map(known.first, known.second, known.within, (), known.sections[:count]), section)
    for count, locus in enumerate(known.loci, start=1):
        report(Map(known.first, known.second, known.within, known.loci[:count], known.sections), locus)

"""The study of a map, or of a locus: its sections and loci are stored one by one, and an interrupted run goes on."""

from __future__ import annotations

import os
from collections.abc import Mapping
from contextlib import nullcontext
from dataclasses import replace

from gapwalk.bifurcation.loci import Locus
from gapwalk.errors import NumericalError
from gapwalk.results.result_file import Parts, lock
from gapwalk.results.versions import versions
from gapwalk.studies.claim import earlier_result
from gapwalk.studies.file import Study
from gapwalk.studies.interruption import found_by
from gapwalk.studies.load import load_result
from gapwalk.studies.locus.study_options import LocusStudyOptions
from gapwalk.studies.map.chart import Map, Section
from gapwalk.studies.map.charting import Report, bifurcation_map, chart_loci
from gapwalk.studies.map.store import MapStore, stored_map
from gapwalk.studies.options import MapStudyOptions
from gapwalk.studies.request import request_file
from gapwalk.studies.result import Result


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
        earlier = earlier_result(output, study, resume=resume, force=force)
        known = None if earlier is None else earlier.map
        known = known or Map(options.parameter, options.second.parameter, options.within)
        if report is not None:
            _report_again(known, report)
        if earlier is not None and earlier.complete:
            return earlier
        before = None if earlier is None else earlier.versions
        with request_file(study, output, before) as file:
            chart = _chart(study, options, known, MapStore(file), report)
        if output is None:
            return _result(study, chart, versions())
    return load_result(output)  # after Ctrl-C at any moment, what is stored is what counts


def read_map(study: Study, parts: Parts) -> Result:
    """The result of a map from the parts of its file; see `gapwalk.studies.load`."""
    chart, options = stored_map(parts), study.options
    assert isinstance(options, MapStudyOptions)
    if (chart.first, chart.second, chart.within) != (options.parameter, options.second.parameter, options.within):
        raise ValueError("the map does not belong to the study")
    return _result(study, chart, {})


def _result(study: Study, chart: Map, written_by: Mapping[str, str]) -> Result:
    return Result(study, chart.branches, chart.complete, written_by, map=chart)


def _chart(study: Study, options: MapStudyOptions, known: Map, store: MapStore, report: Report | None) -> Map:
    """Find what is not known yet, and keep it."""

    def keep(chart: Map, addition: Section | Locus) -> None:
        store.write(replace(chart, complete=False))
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
    store.write(chart)
    return chart


def _report_again(known: Map, report: Report) -> None:
    """Report what a resumed result has already: its sections, then its loci, each with the map as it was then."""
    for count, section in enumerate(known.sections, start=1):
        report(Map(known.first, known.second, known.within, (), known.sections[:count]), section)
    for count, locus in enumerate(known.loci, start=1):
        report(Map(known.first, known.second, known.within, known.loci[:count], known.sections), locus)

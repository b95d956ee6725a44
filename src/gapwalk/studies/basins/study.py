"""The job of basins of attraction: its parts are chunks of cells, and the result after them."""

from __future__ import annotations

from collections.abc import Callable

from gapwalk.results.result_file import Parts
from gapwalk.studies.basins.basins import basins
from gapwalk.studies.basins.call import CELLS, stored_basins
from gapwalk.studies.basins.finding import BasinFinding
from gapwalk.studies.basins.job import chunks_of
from gapwalk.studies.basins.study_options import BasinStudyOptions
from gapwalk.studies.file import Study
from gapwalk.studies.interruption import found_by
from gapwalk.studies.request import Keeper


def work_basins(study: Study, file: Keeper | None, report: Callable[..., object] | None = None) -> BasinFinding:
    """Find the basins; see `gapwalk.studies.jobs.Job`."""
    options = study.options
    assert isinstance(options, BasinStudyOptions)
    found = found_by(
        basins,
        study.system,
        options.plane,
        options.resolution,
        fixed=options.fixed,
        options=options.limits,
        report=report,
        output=file,
    )
    total = chunks_of(options.resolution)
    return BasinFinding(found, total if found.complete else 0, total)


def read_basins(study: Study, parts: Parts) -> BasinFinding:
    """What has been found; see `gapwalk.studies.jobs.Job`."""
    options = study.options
    assert isinstance(options, BasinStudyOptions)
    done = len(list(parts.all(CELLS)))
    return BasinFinding(stored_basins(parts, options.window, options.resolution), done, chunks_of(options.resolution))

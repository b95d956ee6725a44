"""The job of basins of attraction: its parts are chunks of cells, and the result after them."""

from __future__ import annotations

from collections.abc import Callable

from gapwalk.results.file import Parts
from gapwalk.study.basins.basins import basins
from gapwalk.study.basins.call import CELLS, stored_basins
from gapwalk.study.basins.finding import BasinFinding
from gapwalk.study.basins.job import chunks_of
from gapwalk.study.basins.study_options import BasinStudyOptions
from gapwalk.study.file import Study
from gapwalk.study.interruption import found_by
from gapwalk.study.request import Keeper


def work_basins(study: Study, file: Keeper | None, report: Callable[..., object] | None = None) -> BasinFinding:
    """Find the basins; see `gapwalk.study.jobs.Job`."""
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
    """What has been found; see `gapwalk.study.jobs.Job`."""
    options = study.options
    assert isinstance(options, BasinStudyOptions)
    done = len(list(parts.all(CELLS)))
    return BasinFinding(stored_basins(parts, options.window, options.resolution), done, chunks_of(options.resolution))

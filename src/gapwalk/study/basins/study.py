"""The job of basins of attraction: its parts are chunks of cells, and the result after them."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping

from gapwalk.study.basins import job as basin_job
from gapwalk.study.basins.basins import basins
from gapwalk.study.basins.finding import BasinFinding
from gapwalk.study.basins.store import basins_of
from gapwalk.study.basins.study_options import BasinStudyOptions
from gapwalk.study.file import Study
from gapwalk.study.interruption import found_by
from gapwalk.study.store.cell_store import parted


def work_basins(
    study: Study, shelf: os.PathLike[str] | None, report: Callable[..., object] | None = None
) -> BasinFinding:
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
        output=shelf,
    )
    total = _chunks(options)
    return BasinFinding(found, total if found.complete else 0, total)


def read_basins(study: Study, parts: Mapping[int, bytes]) -> BasinFinding:
    """What has been found; see `gapwalk.study.jobs.Job`."""
    options = study.options
    assert isinstance(options, BasinStudyOptions)
    total = _chunks(options)
    done, result = parted("the result", parts, total)
    found = None if result is None else basins_of(study.system, options.window, result)
    if found is not None and found.resolution != options.resolution:
        raise ValueError(f"its resolution is {found.resolution}")
    return BasinFinding(found, len(done), total)


def _chunks(options: BasinStudyOptions) -> int:
    columns, rows = options.resolution
    return -(-columns * rows // basin_job.CHUNK)

"""The jobs of the kinds of study that have no branches: how each is done, and how it is read back."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from gapwalk.results.result_file import Parts
from gapwalk.studies.file import Study
from gapwalk.studies.finding import Finding
from gapwalk.studies.request import Keeper

Report = Callable[..., object]
"""Called with each part when it is done and is in the file, and with the `gapwalk.parallel.pace.Pace` of the job."""


@dataclass(frozen=True)
class Job:
    """How a kind of study is done.

    Attributes
    ----------
    work
        Does it: called with the study, the file in which it keeps its parts (or None), and whom to report to. After
        Ctrl-C it returns what there is, or raises KeyboardInterrupt if that is nothing.
    read
        What has been found, from the study and the parts of its file; any of LookupError, TypeError and ValueError if
        they make no sense.
    """

    work: Callable[[Study, Keeper | None, Report | None], Finding]
    read: Callable[[Study, Parts], Finding]


def _family() -> Job:
    from gapwalk.studies.family.study import read_family, work_family

    return Job(work_family, read_family)


def _settle() -> Job:
    from gapwalk.studies.settle.study import read_settled, work_settle

    return Job(work_settle, read_settled)


def _sweep() -> Job:
    from gapwalk.studies.sweep.study import read_sweep, work_sweep

    return Job(work_sweep, read_sweep)


def _basins() -> Job:
    from gapwalk.studies.basins.study import read_basins, work_basins

    return Job(work_basins, read_basins)


def _regimes() -> Job:
    from gapwalk.studies.regimes.study import read_regimes, work_regimes

    return Job(work_regimes, read_regimes)


# Each is loaded only when it is asked for: a frequency response need not wait for the code of basins.
_JOBS = {"family": _family, "settle": _settle, "sweep": _sweep, "basins": _basins, "regimes": _regimes}

JOBS = tuple(_JOBS)
"""The kinds of study that are jobs."""


def job_of(kind: str) -> Job:
    """The job of a kind of study, one of `JOBS`."""
    return _JOBS[kind]()

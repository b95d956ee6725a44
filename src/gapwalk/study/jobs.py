"""The jobs of the kinds of study that have no branches: how each is done, and how it is read back."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from gapwalk.study.basins.study import read_basins, work_basins
from gapwalk.study.family.study import read_family, work_family
from gapwalk.study.file import Study
from gapwalk.study.finding import Finding
from gapwalk.study.regimes.study import read_regimes, work_regimes
from gapwalk.study.settle.study import read_settled, work_settle
from gapwalk.study.sweep.study import read_sweep, work_sweep

Report = Callable[..., object]
"""Called with each part when it is done and is in the file, and with the `gapwalk.study.work.pace.Pace` of the job."""


@dataclass(frozen=True)
class Job:
    """How a kind of study is done.

    Attributes
    ----------
    work
        Does it: called with the study, where to keep its parts (a `gapwalk.study.store.shelf.Shelf`, or None), and
        whom to report to. After Ctrl-C it returns what there is, or raises KeyboardInterrupt if that is nothing.
    read
        What has been found, from the study and the parts by number; any of LookupError, TypeError and ValueError if
        they are damaged.
    """

    work: Callable[[Study, os.PathLike[str] | None, Report | None], Finding]
    read: Callable[[Study, Mapping[int, bytes]], Finding]


JOBS: dict[str, Job] = {
    "family": Job(work_family, read_family),
    "settle": Job(work_settle, read_settled),
    "sweep": Job(work_sweep, read_sweep),
    "basins": Job(work_basins, read_basins),
    "regimes": Job(work_regimes, read_regimes),
}
"""The jobs by the kind of study."""

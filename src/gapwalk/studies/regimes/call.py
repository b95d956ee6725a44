"""The call of `gapwalk.regimes` as its file keeps it, and the parts of its work."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from gapwalk.attractors.regimes import Regimes
from gapwalk.model.system import System
from gapwalk.results.result_file import Part, Parts
from gapwalk.studies.regimes.job import Plan, RegimeChunk, RegimeJob
from gapwalk.studies.regimes.options import RegimeMapOptions, places_of
from gapwalk.studies.request import Call

CELLS = Part("cells", RegimeChunk, numbered=True)
REGIMES = Part("regimes", Regimes)


@dataclass(frozen=True)
class RegimesCall(Call):
    """What regime map is to be made; see `gapwalk.regimes`. Its start is a state."""

    asks: ClassVar[str] = "regimes"

    system: System
    names: tuple[str, str]
    within: tuple[tuple[float, float], tuple[float, float]]
    resolution: tuple[int, int]
    start: tuple[float, ...]
    options: RegimeMapOptions

    def found(self, parts: Parts) -> Regimes:
        """The map, as far as it has come."""
        return stored_regimes(parts, job_of(self))


def job_of(call: RegimesCall) -> RegimeJob:
    """The work that a call asks for."""
    plane = (call.system, call.names, call.within, call.resolution)
    plan = Plan(*plane, np.array(call.start, dtype=float), call.options.judging)
    return RegimeJob(plan, places_of(plan, call.options.carry))


def stored_regimes(parts: Parts, job: RegimeJob) -> Regimes:
    """The map of a file, as far as it has come; a ValueError if it is another one."""
    found = parts.get(REGIMES)
    if found is None:
        job.take(chunk for _, chunk in parts.all(CELLS))
        return job.record()
    if found.resolution != job.plan.resolution:
        raise ValueError(f"its resolution is {found.resolution}")
    return found

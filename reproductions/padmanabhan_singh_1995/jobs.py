"""All jobs: each set of the paper once, though several figures may show it."""

from __future__ import annotations

import math
from dataclasses import replace

from gapwalk.errors import ModelError
from gapwalk.model.problem import did_you_mean
from gapwalk.paper import DampingReading, SlopeReading
from reproductions.padmanabhan_singh_1995.job import PERIOD_1, BalanceJob, BranchJob, Job, MotionJob
from reproductions.padmanabhan_singh_1995.reading import Reading

_AMPLITUDE = "harmonic1.amplitude"
# Islands away from 0 come in pairs, since the sign of Te1 is a shift by half a period: for their extents one will do.
_POSITIVE = tuple(round(0.025 + 0.05 * place, 3) for place in range(16))
_OVER_AMPLITUDE = BranchJob(
    case="27",
    parameter=_AMPLITUDE,
    begins=-0.8,
    ends=0.8,
    max_period=2,
    search_values=32,
    short_search=_POSITIVE,
    effort=10.0,
)

# The place nearest to the printed numbers of figures 5 and 6 that was found to have both of their motions, with all
# multipliers below 0.9 (docs/design.md: how). Over Te1 or Tm1 alone each of them exists, but not both at one place.
_NEAR = (("mean.q1", 0.2143), ("mean.q3", 0.2047), (_AMPLITUDE, 0.2968), ("frequency", 0.1679))
_FOUR_PEAKS = (2.432, 0.709, 0.46, 0.282)  # on the motion of figure 5
_VERY_LOW = (("mean.q1", 0.05), ("mean.q3", 0.05), ("frequency", 0.35))

# What the figures show.
_FIGURES = (
    MotionJob(case="3-impact", signal="q1''", effort=0.5),
    MotionJob(case="3-viscous", signal="q1''", effort=0.5),
    BranchJob(case="4a"),
    BranchJob(case="4b"),
    MotionJob(
        case="5", name="5-near", signal="stage2", changes=(*_NEAR, ("stage2.impact_damping", 0.1103)), effort=0.5
    ),
    MotionJob(case="6", name="6-near", signal="stage2", changes=_NEAR, start=_FOUR_PEAKS, effort=0.5),
    # Three times the viscous damping, and the impact damping that gives the nearest force: the paper prints neither.
    MotionJob(
        case="7-viscous",
        name="7-viscous-near",
        changes=(*_NEAR, ("damping.q1.q1", 0.12), ("damping.q3.q1", -0.12)),
        start=_FOUR_PEAKS,
        effort=0.5,
    ),
    MotionJob(
        case="7-impact",
        name="7-impact-near",
        changes=(*_NEAR, ("stage2.impact_damping", 0.287)),
        start=_FOUR_PEAKS,
        effort=0.5,
    ),
    MotionJob(case="8a", name="8-impact", changes=_VERY_LOW, effort=0.5),
    MotionJob(case="6", name="8-viscous", changes=_VERY_LOW, effort=0.5),
    # What the synthetic record is made of: a little other load and damping than those of the motion beside it.
    MotionJob(
        case="8a",
        name="8-record",
        changes=(*_VERY_LOW[1:], ("mean.q1", 0.055), ("stage2.impact_damping", 0.12)),
        effort=0.5,
    ),
    BranchJob(case="9a"),
    BranchJob(case="9b"),
    BalanceJob(case="9a", name="9a-balance", effort=1.0),
    BalanceJob(case="9b", name="9b-balance", effort=1.0),
    BranchJob(case="10b"),
    BranchJob(case="11a"),
    # Motions of period 4 of this set are many, and the paper shows none.
    BranchJob(case="11b", max_period=2, effort=7.0),
    BranchJob(case="12"),
    BranchJob(case="13"),
    BranchJob(case="15", effort=20.0),
    # Where the motions of these three figures are: the printed frequencies have none of them.
    MotionJob(case="15", name="17-near", changes=(("frequency", 0.864),), effort=0.5),
    MotionJob(case="15", name="18-near", changes=(("frequency", 0.855),), effort=4.0),
    MotionJob(case="15", name="19-near", changes=(("frequency", 0.833),), start=(0.5, 1.0, 0.5, 0.5), effort=3.0),
    BranchJob(case="20a"),
    BranchJob(case="20b", effort=6.0),
    BranchJob(case="22"),
    BranchJob(case="23b"),
    BranchJob(case="24"),
    BranchJob(case="25"),
    BranchJob(case="26b", effort=5.0),
    _OVER_AMPLITUDE,
    replace(_OVER_AMPLITUDE, case="28"),
    BranchJob(case="29", parameter=_AMPLITUDE, begins=0.02, ends=1.0, effort=15.0),
)

# What claims look at besides.
_MORE = (
    MotionJob(case="5", signal="stage2", effort=0.5),
    MotionJob(case="6", name="6-near-rest", changes=_NEAR, effort=0.5),
    MotionJob(case="6", signal="stage2", effort=0.5),
    BranchJob(case="5", name="5-mean", parameter="mean.q1", begins=0.25, ends=0.0, max_period=1),
    BranchJob(case="6", name="6-mean", parameter="mean.q1", begins=0.25, ends=0.0, max_period=1),
    BranchJob(case="5", name="5-amplitude", parameter=_AMPLITUDE, begins=0.25, ends=0.4, max_period=1),
    BranchJob(case="6", name="6-amplitude", parameter=_AMPLITUDE, begins=0.25, ends=0.4, max_period=1),
    BranchJob(case="10b", name="10b-softer", changes=(("stage2.force.q1", 0.7), ("stage2.force.q3", -0.42))),
    # The proportions that all other sets have; with them the resonances are as far apart as the paper says.
    BranchJob(case="11a", name="11a-mended", changes=(("stiffness.q1.q3", -0.6), ("stage2.force.q3", -0.42))),
    MotionJob(case="17", effort=0.5),
    MotionJob(case="18", effort=0.5),
    MotionJob(case="19", effort=0.5),
    BranchJob(case="23b", name="23b-120", changes=(("harmonic2.phase", math.radians(120)),), max_period=1),
    BranchJob(case="23b", name="23b-180", changes=(("harmonic2.phase", math.pi),), max_period=1),
    replace(
        _OVER_AMPLITUDE,
        case="28",
        name="28-overlap",
        changes=(("frequency", 0.2576),),
        max_period=1,
        search_values=_POSITIVE,
        effort=5.0,
    ),
    *(
        MotionJob(case="29", name=f"29-{value}", changes=((_AMPLITUDE, value),), effort=3.0)
        for value in (0.16, 0.2, 0.27, 0.36)
    ),
    *(MotionJob(case="29", name=f"29-{value}", changes=((_AMPLITUDE, value),)) for value in (0.65, 0.8, 0.95)),
)

JOBS: dict[str, Job] = {job.key: job for job in (*_FIGURES, *_MORE)}
"""By key, in the default reading."""


def find_job(key: str) -> Job:
    """A job by its key, whose end may tell more, as in ``12-literal`` or ``24-period-1-literal``.

    First comes `PERIOD_1`, then a reading that is not the default.

    Raises
    ------
    ModelError
        If there is none.
    """
    readings = (Reading(slope, damping) for slope in SlopeReading for damping in DampingReading)
    for reading in readings:
        name = key.removesuffix(reading.suffix)
        if f"{name}{reading.suffix}" != key:
            continue
        if name in JOBS:
            return JOBS[name].at(reading)
        whole = JOBS.get(name.removesuffix(PERIOD_1))
        if isinstance(whole, BranchJob) and name.endswith(PERIOD_1):
            return whole.shortest.at(reading)
    raise ModelError(f"the paper has no job {key!r}; {did_you_mean(key, list(JOBS))}")

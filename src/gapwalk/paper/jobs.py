"""All jobs: each set of the paper once, though several figures may show it."""

from __future__ import annotations

from gapwalk.errors import ModelError
from gapwalk.model.problem import did_you_mean
from gapwalk.paper.job import BranchJob, Job, MotionJob
from gapwalk.paper.reading import AS_PRINTED, LITERAL, USUAL

_AMPLITUDE = "harmonic1.amplitude"

_JOBS = (
    BranchJob(case="4a"),
    BranchJob(case="4b"),
    BranchJob(case="9a"),
    BranchJob(case="9b"),
    BranchJob(case="10b"),
    BranchJob(case="11a"),
    # Motions of period 4 of this set are many, and the paper shows none.
    BranchJob(case="11b", max_period=2, effort=7.0),
    BranchJob(case="12"),
    BranchJob(case="13"),
    BranchJob(case="15", effort=20.0),
    MotionJob(case="17", effort=0.5),
    MotionJob(case="18", effort=0.5),
    MotionJob(case="19", effort=0.5),
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
    BranchJob(case="27", parameter=_AMPLITUDE, begins=-0.8, ends=0.8, max_period=2, search_values=32, effort=10.0),
    BranchJob(case="28", parameter=_AMPLITUDE, begins=-0.8, ends=0.8, max_period=2, search_values=32, effort=10.0),
    BranchJob(case="29", parameter=_AMPLITUDE, begins=0.02, ends=1.0, effort=15.0),
)

JOBS: dict[str, Job] = {job.key: job for job in _JOBS}
"""By key, in the default reading."""


def find_job(key: str) -> Job:
    """A job by its key; the end of the key tells a reading that is not the default, as in ``12-literal``.

    Raises
    ------
    ModelError
        If there is none.
    """
    for reading in (LITERAL, AS_PRINTED, USUAL):
        name = key.removesuffix(reading.suffix) if reading.suffix else key
        if name in JOBS and f"{name}{reading.suffix}" == key:
            return JOBS[name].at(reading)
    raise ModelError(f"the paper has no job {key!r}; {did_you_mean(key, list(JOBS))}")

"""All figures of Padmanabhan and Singh (1995) with all claims about them, in a new process on one core."""

from __future__ import annotations

import tempfile

from benchmarks import start
from benchmarks.effort import FULL, Effort
from benchmarks.row import Row, Target

GROUP = "The paper, on one core"
_TARGET = 60.0

# On one core it works in one process. A motion that it cannot classify is not a fault of the benchmark.
_ALL = """\
import os, sys
if hasattr(os, "sched_setaffinity"):
    os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
from reproductions.padmanabhan_singh_1995.__main__ import DONE, FAILED, main
sys.exit(main([*sys.argv[2:], "--output", sys.argv[1], "--force"]) not in (DONE, FAILED))
"""


def rows(effort: Effort) -> list[Row]:
    """Measure all figures; a quick look measures one."""
    whole = effort == FULL
    names = [] if whole else ["13"]
    with tempfile.TemporaryDirectory() as folder:
        if whole:
            start.once(["-c", _ALL, f"{folder}/before", "9"])  # compiles the kernels of harmonic balance
        seconds = start.once(["-c", _ALL, f"{folder}/paper", *names])
    what = "make paper: all figures and claims" if whole else "make paper FIG=13"
    note = "CPU time of all of it: walks, searches, pictures, tables, claims; compare it with the period above"
    return [Row(GROUP, what, seconds, targets=(Target(_TARGET),) if whole else (), note=note)]

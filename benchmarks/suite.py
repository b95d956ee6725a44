"""The checks of gapwalk itself, as a developer waits for them: ``make quick`` and ``make test``."""

from __future__ import annotations

import os
import resource
import subprocess
import time
from collections.abc import Sequence
from pathlib import Path

from benchmarks.effort import FULL, Effort
from benchmarks.row import Row, Target

GROUP = "Checks of gapwalk itself"
_ROOT = Path(__file__).resolve().parents[1]
_CORES = 2  # on which the limits hold
_QUICK, _ALL = 90.0, 600.0  # seconds of wall time


def rows(effort: Effort) -> list[Row]:
    """Measure both; a quick look leaves out the long one."""
    found = [measured(["make", "quick"], _QUICK)]
    return [*found, measured(["make", "test"], _ALL)] if effort == FULL else found


def measured(command: Sequence[str], limit: float) -> Row:
    """Measure a command once, with all processes that it starts and waits for.

    The CPU time, which other programs hardly change, is compared with what two cores have within the limit. The wall
    time is in the note. If the command fails, no target counts.
    """
    variables = {name: text for name, text in os.environ.items() if name not in ("OMP_NUM_THREADS", "MAKEFLAGS")}
    before, begun = _used(), time.perf_counter()
    done = subprocess.run(command, cwd=_ROOT, env=variables, check=False, stdout=subprocess.DEVNULL)
    seconds, wall = _used() - before, time.perf_counter() - begun
    what = " ".join(command)
    if done.returncode:
        return Row(GROUP, what, seconds, note=f"it failed after {wall:.0f} s: run it alone")
    note = (
        f"{wall:.0f} s of wall time, of which {limit:.0f} s are allowed on {_CORES} idle cores; "
        "the CPU time lacks that of processes of Chromium, for some of which nobody waits"
    )
    return Row(GROUP, what, seconds, targets=(Target(_CORES * limit),), counts={"wall": round(wall)}, note=note)


def _used() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime

"""Reduction of long chains, then shooting: time and error over the number of modes, and of contacts.

    python -m benchmarks.reduction

Times are CPU seconds of one core, including compiling; set OPENBLAS_NUM_THREADS=1, because small matrices gain nothing
from threads. The error is computed from the equations of the full system (`Reduction.check`).
"""

from __future__ import annotations

import sys
import time
from itertools import pairwise

from benchmarks.balance import chain, summary
from gapwalk import System, WalkOptions, find_orbit, follow, reduce
from gapwalk.errors import GapwalkError

BEGIN, END = 0.12, 0.19  # over the first resonance of the rod
LINES = ((100, 1, 2), (100, 1, 4), (100, 1, 8), (100, 3, 4), (1000, 3, 4))


def main() -> None:
    """Print the lines."""
    for size, contacts, modes in LINES:
        print(line(size, contacts, modes), flush=True)


def soft(size: int, contacts: int) -> System:
    """Return the chain of the benchmark of harmonic balance, with softer stops and a smaller load."""
    stops = {f"gap{k}.stiffness": 0.05 * size for k in range(contacts)}
    return chain(size, contacts).at({"frequency": BEGIN, "harmonic1.amplitude": 0.003 * size, **stops})


def line(size: int, contacts: int, modes: int) -> str:
    """Return the times to reduce a chain, to walk its frequency response by shooting, and to check it."""
    full = soft(size, contacts)
    times = [time.process_time()]
    reduction = reduce(full, modes=modes, up_to=END)
    times.append(time.process_time())
    branch = follow(find_orbit(reduction.system), "frequency", to=END, walk=WalkOptions(largest_step=0.05))
    times.append(time.process_time())
    check = reduction.check(branch)
    times.append(time.process_time())
    reduced, walked, checked = (after - before for before, after in pairwise(times))
    return (
        f"chain of {size}, {contacts} gaps, as {reduction.system.size} degrees of freedom: reduced in {reduced:.1f} s, "
        f"walked in {walked:.1f} s, checked in {checked:.1f} s; {summary(branch)}; {check}"
    )


if __name__ == "__main__":
    try:
        main()
    except (GapwalkError, KeyboardInterrupt) as problem:
        sys.exit(str(problem) or "interrupted")

"""``python -m tests.bifurcation.dense LOG``: compares branch after branch; goes on where it was stopped."""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path

from gapwalk import find_orbit
from gapwalk.errors import GapwalkError
from gapwalk.paper import case, frequency_responses
from tests.bifurcation.dense.comparison import Comparison, compare_walks
from tests.bifurcation.dense.random_systems import random_task

LONGEST = 120  # points of a random branch that are compared


def compared(name: str) -> Comparison:
    """Compare the walks of one branch: ``figure 13``, or ``random 7``."""
    kind, which = name.split()
    try:
        if kind == "figure":
            return compare_walks(name, find_orbit(case(which), frequency=2.0), "frequency", 0.15)
        system, parameter, to = random_task(int(which))
        return compare_walks(name, find_orbit(system), parameter, to, LONGEST)
    except GapwalkError as error:
        return Comparison(name, note=f"{type(error).__name__}: {error}")


def main() -> None:
    """Compare what the log does not hold yet."""
    parser = argparse.ArgumentParser(prog="python -m tests.bifurcation.dense", description=__doc__)
    parser.add_argument("log", type=Path, help="one line of JSON for each branch; what it holds is not done again")
    parser.add_argument("--systems", type=int, default=200, metavar="N", help="random systems (default: 200)")
    parser.add_argument("--first", type=int, default=0, metavar="SEED", help="seed of the first of them")
    parser.add_argument("--random-only", action="store_true", help="leave the figures of the paper out")
    options = parser.parse_args()
    names = [f"figure {figure}" for figure in frequency_responses() if not options.random_only]
    names += [f"random {seed}" for seed in range(options.first, options.first + options.systems)]
    known = options.log.read_text(encoding="utf-8").splitlines() if options.log.exists() else []
    done = {json.loads(line)["name"] for line in known}
    for name in names:
        if name in done:
            continue
        start = time.process_time()
        comparison = compared(name)
        with options.log.open("a", encoding="utf-8") as log:
            log.write(comparison.as_line() + "\n")
        print(f"{name:12} {time.process_time() - start:6.1f} s  {_summary(comparison)}", flush=True)


def _summary(comparison: Comparison) -> str:
    if comparison.note:
        return comparison.note
    text = f"{comparison.shared} special points, {comparison.apart:.0e} apart, {comparison.points} points"
    text += f" and {comparison.fine_points}"
    for what, found in (("missing", comparison.missing), ("invented", comparison.invented)):
        text += "".join(f"\n    {what}: {each}" for each in found)
    if comparison.ends[0] != comparison.ends[1]:
        text += f"\n    ends: {comparison.ends}"
    return text


if __name__ == "__main__":
    main()

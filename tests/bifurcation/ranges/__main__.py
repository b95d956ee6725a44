"""``python -m tests.bifurcation.ranges LOG``: walks random systems over many ranges; goes on where it was stopped."""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path

from gapwalk.errors import GapwalkError
from tests.bifurcation.ranges.comparison import Comparison, compare_ranges, random_system


def main() -> None:
    """Compare what the log does not hold yet."""
    parser = argparse.ArgumentParser(prog="python -m tests.bifurcation.ranges", description=__doc__)
    parser.add_argument("log", type=Path, help="one line of JSON for each system; what it holds is not done again")
    parser.add_argument("--systems", type=int, default=200, metavar="N", help="random systems (default: 200)")
    parser.add_argument("--first", type=int, default=0, metavar="SEED", help="seed of the first of them")
    parser.add_argument("--quick", action="store_true", help="do not verify the walks")
    options = parser.parse_args()
    known = options.log.read_text(encoding="utf-8").splitlines() if options.log.exists() else []
    done = {json.loads(line)["name"] for line in known}
    for seed in range(options.first, options.first + options.systems):
        if f"random {seed}" in done:
            continue
        start = time.process_time()
        try:
            comparison = compare_ranges(f"random {seed}", random_system(seed), not options.quick)
        except GapwalkError as error:
            comparison = Comparison(f"random {seed}", note=f"{type(error).__name__}: {error}")
        with options.log.open("a", encoding="utf-8") as log:
            log.write(comparison.as_line() + "\n")
        found = "".join(f"\n    {each}" for each in comparison.faults)
        text = comparison.note or f"{comparison.shared} special points in {comparison.walks} walks{found}"
        print(f"random {seed:<4} {time.process_time() - start:6.1f} s  {text}", flush=True)


if __name__ == "__main__":
    main()

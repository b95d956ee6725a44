"""``python -m tests.bifurcation.exactly LOG``: computes special points again; goes on where it was stopped."""

from __future__ import annotations

import json
import sys

import numpy as np

from tests.bifurcation.campaign import arguments, compare_all
from tests.bifurcation.exactly.comparison import MACHINES, Recomputed, compare


def main() -> int:
    """Compute again what the log does not hold yet; 1 if more than 1 in 100 is outside, or one by more than 3 times."""
    parser = arguments("bifurcation.exactly", __doc__)
    parser.add_argument("kinds", nargs="*", default=[*MACHINES], help=f"of {', '.join(MACHINES)}; by default all")
    options = parser.parse_args()
    seeds = range(options.first, options.first + options.systems)
    failed = compare_all(
        options.log, [f"{kind} {seed}" for kind in options.kinds for seed in seeds], compare, Recomputed
    )
    done = [Recomputed(**json.loads(line)) for line in options.log.read_text(encoding="utf-8").splitlines()]
    ratios = np.array([ratio for each in done for ratio in each.ratios])
    outside = int(np.count_nonzero(ratios > 1.0))
    print(f"{len(ratios)} points, {outside} outside of their errors, the worst ratio {ratios.max(initial=0.0):.3g}")
    if len(ratios):
        print(f"the error is {1.0 / max(np.median(ratios), 1e-300):.3g} times the deviation on median")
    return int(failed or 100 * outside > len(ratios))


if __name__ == "__main__":
    sys.exit(main())

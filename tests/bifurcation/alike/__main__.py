"""``python -m tests.bifurcation.alike LOG KIND``: walks random machines in several ways; goes on where it stopped."""

from __future__ import annotations

import sys

from tests.bifurcation.alike.comparison import compare_ways
from tests.bifurcation.alike.kinds import KINDS, machine_of
from tests.bifurcation.campaign import arguments, compare_all
from tests.bifurcation.ranges.comparison import Comparison


def main() -> int:
    """Compare what the log does not hold yet, and count the walks that got stuck."""
    parser = arguments("bifurcation.alike", __doc__)
    parser.add_argument("kinds", nargs="*", default=[*KINDS], help=f"of {', '.join(KINDS)}; by default all")
    parser.add_argument("--quick", action="store_true", help="do not verify the walks")
    options = parser.parse_args()
    seeds = range(options.first, options.first + options.systems)
    names = [f"{kind} {seed}" for kind in options.kinds for seed in seeds]
    return compare_all(
        options.log, names, lambda name: compare_ways(name, machine_of(name), not options.quick), Comparison
    )


if __name__ == "__main__":
    sys.exit(main())

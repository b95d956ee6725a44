"""``python -m tests.bifurcation.ranges LOG``: walks random systems over many ranges; goes on where it was stopped."""

from __future__ import annotations

import sys

from tests.bifurcation.campaign import arguments, compare_all, random_names
from tests.bifurcation.ranges.comparison import Comparison, compare_ranges, random_system


def main() -> int:
    """Compare what the log does not hold yet."""
    parser = arguments("bifurcation.ranges", __doc__)
    parser.add_argument("--quick", action="store_true", help="do not verify the walks")
    options = parser.parse_args()

    def compared(name: str) -> Comparison:
        return compare_ranges(name, random_system(int(name.split()[1])), not options.quick)

    return compare_all(options.log, random_names(options), compared, Comparison)


if __name__ == "__main__":
    sys.exit(main())

"""``python -m tests.dry.trials LOG``: tries random systems with friction and stops; goes on where it was stopped."""

from __future__ import annotations

import sys

from tests.bifurcation.campaign import arguments, compare_all, random_names
from tests.dry.trials.random_systems import random_system
from tests.dry.trials.trial import Trial, attempt


def main() -> int:
    """Try what the log does not hold yet."""
    parser = arguments("dry.trials", __doc__)
    parser.add_argument("--sampled", type=int, default=0, metavar="N", help="verify N orbits of each branch only")
    parser.add_argument("--factor", type=float, default=1.3, help="width of the range (default: 1.3)")
    options = parser.parse_args()

    def tried(name: str) -> Trial:
        return attempt(name, random_system(int(name.split()[1])), options.factor, options.sampled)

    return compare_all(options.log, random_names(options), tried, Trial)


if __name__ == "__main__":
    sys.exit(main())

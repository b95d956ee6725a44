"""``python -m tests.bifurcation.dense LOG``: compares branch after branch; goes on where it was stopped."""

from __future__ import annotations

import sys

from gapwalk import find_orbit
from gapwalk.paper import case, frequency_responses
from tests.bifurcation.campaign import arguments, compare_all, random_names
from tests.bifurcation.dense.comparison import Comparison, compare_walks
from tests.bifurcation.dense.random_systems import random_task

LONGEST = 120  # points of a random branch that are compared


def compared(name: str) -> Comparison:
    """Compare the walks of one branch: ``figure 13``, or ``random 7``."""
    kind, which = name.split()
    if kind == "figure":
        return compare_walks(name, find_orbit(case(which), frequency=2.0), "frequency", 0.15)
    system, parameter, to = random_task(int(which))
    return compare_walks(name, find_orbit(system), parameter, to, LONGEST)


def main() -> int:
    """Compare what the log does not hold yet."""
    parser = arguments("bifurcation.dense", __doc__)
    parser.add_argument("--random-only", action="store_true", help="leave the figures of the paper out")
    options = parser.parse_args()
    figures = () if options.random_only else frequency_responses()
    names = [*(f"figure {figure}" for figure in figures), *random_names(options)]
    return compare_all(options.log, names, compared, Comparison)


if __name__ == "__main__":
    sys.exit(main())

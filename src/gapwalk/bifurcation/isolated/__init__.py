"""Search for isolated branches and other attractors, with many starts, settled transients, and Newton's method."""

from gapwalk.bifurcation.isolated.search import Isolated, Progress, isolated, search
from gapwalk.bifurcation.isolated.search_options import VALUES, SearchOptions, values_between
from gapwalk.bifurcation.isolated.search_result import (
    FoundOrbit,
    SearchResult,
    Tally,
    coverage,
    next_is_new,
    unseen_share,
)

__all__ = [
    "VALUES",
    "FoundOrbit",
    "Isolated",
    "Progress",
    "SearchOptions",
    "SearchResult",
    "Tally",
    "coverage",
    "isolated",
    "next_is_new",
    "search",
    "unseen_share",
    "values_between",
]

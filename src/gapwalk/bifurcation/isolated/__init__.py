"""Search for isolated branches and other attractors, with many starts, settled transients, and Newton's method."""

from gapwalk.bifurcation.isolated.search import (
    FoundOrbit,
    Progress,
    SearchResult,
    Tally,
    coverage,
    next_is_new,
    search,
    unseen_share,
)
from gapwalk.bifurcation.isolated.search_starts import SearchOptions

__all__ = [
    "FoundOrbit",
    "Progress",
    "SearchOptions",
    "SearchResult",
    "Tally",
    "coverage",
    "next_is_new",
    "search",
    "unseen_share",
]

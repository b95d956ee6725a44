"""Search for isolated branches and other attractors, with many starts, settled transients, and Newton's method."""

from gapwalk.bifurcation.search.coverage import coverage, next_is_new, unseen_share
from gapwalk.bifurcation.search.isolated import Isolated, isolated
from gapwalk.bifurcation.search.options import VALUES, SearchOptions, values_between
from gapwalk.bifurcation.search.result import Found, SearchResult, Tally
from gapwalk.bifurcation.search.search import Progress, search

__all__ = [
    "VALUES",
    "Found",
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

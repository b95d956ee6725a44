"""Verification of a branch that leaves out most of its orbits: `make campaign` verifies all of them."""

from collections.abc import Iterator
from unittest.mock import patch

import numpy as np

import gapwalk as gw
from gapwalk.bifurcation.special_point import Kind
from gapwalk.continuation.curve_points import BranchPoint
from gapwalk.verification import Verification
from gapwalk.verification.verification import Spot
from gapwalk.verification.verify_special_points import Track
from tests.tiers import in_campaign

SAMPLED = (4, in_campaign(0))
"""Numbers of orbits that are verified: a few in `make test`, all (0) in `make campaign`."""


def verified(branch: gw.Branch, sampled: int) -> Verification:
    """Verify a branch; with `sampled`, all but its orbits, of which so many, and those of its special points."""
    if not sampled:
        return gw.verify(branch)
    every = Track.spots

    def some(track: Track) -> Iterator[tuple[Spot, BranchPoint, Kind | None]]:
        places = {round(each) for each in np.linspace(0, len(track.branch.points) - 1, sampled)}
        for number, spot in enumerate(every(track)):
            if number in places or number >= len(track.branch.points):
                yield spot

    with patch.object(Track, "spots", some):
        return gw.verify(branch)

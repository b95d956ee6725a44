"""Attractor signatures: motions are recognised by the trapping region of an orbit or by their distance to strobes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gapwalk.attractors.trapping_region import TrappingRegion

_WIDE = 3.0  # largest distance of a motion from an attractor's strobes, in distances between these strobes
_SHARE = 0.9  # fraction of a motion's strobes that must be so near
_CLOSEST = 2e-3  # relative distance that always counts as near: the two may come from different flows


@dataclass(frozen=True, eq=False)
class AttractorSignature:
    """The signature by which motions on an attractor are recognised.

    Attributes
    ----------
    region
        The trapping region of its orbit; None if the attractor is not periodic, or too weakly stable.
    strobes : shape (count, 2n)
        States of the attractor, one forcing period apart.
    scale : shape (2n,)
        Size of the attractor.
    """

    region: TrappingRegion | None
    strobes: NDArray[np.float64]
    scale: NDArray[np.float64]

    @property
    def wide(self) -> bool:
        """True if motions are recognised by their strobes alone."""
        return self.region is None

    def is_home_of(self, track: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Mark the motions that stay near the attractor, shape (count,), from their strobes (strobes, count, 2n)."""
        from scipy.spatial import cKDTree  # imported late: it takes long

        known = self.strobes / self.scale
        tree = cKDTree(known)
        apart = float(np.quantile(tree.query(known, k=2)[0][:, 1], 0.99)) if len(known) > 1 else 0.0
        reach = max(_WIDE * apart, _CLOSEST)
        finite = np.isfinite(track).all(axis=(0, 2))
        near = np.zeros(track.shape[1], dtype=bool)
        distances = tree.query(track[:, finite] / self.scale, distance_upper_bound=reach)[0]
        near[finite] = (distances < reach).mean(axis=0) >= _SHARE
        return near

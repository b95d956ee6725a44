"""How a motion is recognised as being at an attractor: by a trap about an orbit, or by the company of its strobes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gapwalk.attractor.trap import Trap

_WIDE = 3.0  # how far from an attractor's strobes, in distances between them, a motion may be that is on it
_SHARE = 0.9  # of a motion's strobes that must be so near
_CLOSEST = 2e-3  # relative distance that always counts as near: the two may come from different flows


@dataclass(frozen=True, eq=False)
class Haunt:
    """What is known of the place of an attractor.

    Attributes
    ----------
    trap
        The trap about its orbit; None where it is not periodic, or too weakly stable.
    strobes : shape (count, 2n)
        States of it, a forcing period apart.
    scale : shape (2n,)
        Its size.
    """

    trap: Trap | None
    strobes: NDArray[np.float64]
    scale: NDArray[np.float64]

    @property
    def wide(self) -> bool:
        """Whether a motion is recognised by its strobes alone."""
        return self.trap is None

    def is_home_of(self, track: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Which motions stay near the attractor, shape (count,); `track` holds their strobes, (strobes, count, 2n)."""
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

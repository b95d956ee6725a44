"""Assignment of settled motions to known attractors by distance: a cheap way to sort basins and sweeps."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from gapwalk.attractors.attractor import Attractor, AttractorKind
from gapwalk.attractors.settled import Settled
from gapwalk.attractors.strobe import size_of
from gapwalk.errors import ModelError
from gapwalk.orbit.identity import is_same

_SPACING = 4.0  # largest distance of a strobe from the sample of its attractor, in spacings of the sample
_MOST = 0.9  # fraction of the strobes that must be near


def match(
    attractors: Sequence[Attractor],
    motion: Attractor | Settled | NDArray[np.float64],
    tolerance: float = 1e-3,
) -> int | None:
    """Return the index of the attractor to which a settled motion belongs, or None.

    Two orbits are compared as in `gapwalk.orbit.identity.is_same`. States are compared with the strobes of each
    attractor: they must be near those of an orbit within `tolerance`, and near those of a torus or of chaos within
    some spacings of its sample. If several attractors match, the nearest one is returned.

    Parameters
    ----------
    attractors
        The known attractors, all of the same system with the same parameter values.
    motion
        An attractor, a settled motion, one state at theta = 0 (shape (2n,)), or several one forcing period apart (shape
        (count, 2n)): one state distinguishes orbits, 16 or more distinguish any attractors.
    tolerance
        Tolerance relative to the size of an orbit.

    Raises
    ------
    ModelError
        If the states have the wrong shape.
    """
    if isinstance(motion, Attractor | Settled) and motion.orbit is not None:
        same = [each.orbit is not None and is_same(each.orbit, motion.orbit, tolerance) for each in attractors]
        if sum(same) == 1:
            return same.index(True)  # several: one motion in phases shifted by whole forcing periods
    states = motion.strobes if isinstance(motion, Attractor | Settled) else np.atleast_2d(np.asarray(motion, float))
    if isinstance(motion, Settled) and motion.orbit is not None:
        states = motion.orbit.state[None, :]
    distances = [distance(attractor, states, tolerance) for attractor in attractors]
    best = int(np.argmin(distances)) if distances else 0
    return best if distances and distances[best] <= 1.0 else None


def distance(attractor: Attractor, states: NDArray[np.float64], tolerance: float = 1e-3) -> float:
    """Return the distance of most of some states, shape (count, 2n), from an attractor; up to 1 they belong to it."""
    from scipy.spatial import KDTree  # imported late: it takes long

    known = attractor.strobes
    if states.ndim != 2 or states.shape[1] != known.shape[1]:
        raise ModelError(f"the states have the shape {states.shape}; it must be (count, {known.shape[1]})")
    scale = size_of(attractor.system, known)
    tree = KDTree(known / scale)
    reach = tolerance
    if attractor.kind is not AttractorKind.PERIODIC and len(known) > 1:
        spacing = tree.query(known / scale, k=2)[0][:, 1]
        reach = max(tolerance, _SPACING * float(np.quantile(spacing, 0.95)))
    away = tree.query(states / scale)[0]
    return float(np.quantile(away, _MOST)) / reach

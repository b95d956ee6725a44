"""Which known attractor a settled motion belongs to: by distance, so that basins and sweeps can be sorted cheaply."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from gapwalk.attractor.attractor import Attractor, AttractorKind
from gapwalk.attractor.settled import Settled
from gapwalk.attractor.strobe import size_of
from gapwalk.errors import ModelError
from gapwalk.orbit.identity import is_same

_SPACING = 4.0  # how far a strobe may lie from a sample of its attractor, in spacings of the sample
_MOST = 0.9  # share of the strobes that must be near


def match(
    attractors: Sequence[Attractor],
    motion: Attractor | Settled | NDArray[np.float64],
    tolerance: float = 1e-3,
) -> int | None:
    """The index of the attractor that a settled motion belongs to, or None.

    Two orbits are compared as `gapwalk.orbit.identity.is_same` does. States are compared with the strobes of each
    attractor: those of an orbit must be near within `tolerance`, those of a torus or of chaos within some spacings of
    its sample. Of several the nearest is taken.

    Parameters
    ----------
    attractors
        The known ones, all of the same system with the same parameter values.
    motion
        An attractor, a settled motion, one state at theta = 0 (shape (2n,)), or several a forcing period apart (shape
        (count, 2n)): one state tells orbits apart, 16 or more tell any attractors apart.
    tolerance
        Relative to the size of an orbit.

    Raises
    ------
    ModelError
        If the states have the wrong shape.
    """
    if isinstance(motion, Attractor | Settled) and motion.orbit is not None:
        same = [each.orbit is not None and is_same(each.orbit, motion.orbit, tolerance) for each in attractors]
        if sum(same) == 1:
            return same.index(True)  # several: the same motion in phases that lead from different starts
    states = motion.strobes if isinstance(motion, Attractor | Settled) else np.atleast_2d(np.asarray(motion, float))
    if isinstance(motion, Settled) and motion.orbit is not None:
        states = motion.orbit.state[None, :]
    distances = [distance(attractor, states, tolerance) for attractor in attractors]
    best = int(np.argmin(distances)) if distances else 0
    return best if distances and distances[best] <= 1.0 else None


def distance(attractor: Attractor, states: NDArray[np.float64], tolerance: float = 1e-3) -> float:
    """How far most of some states, shape (count, 2n), are from an attractor; 1 is the limit of belonging to it."""
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

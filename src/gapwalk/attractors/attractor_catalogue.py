"""The catalogue of the known attractors of one system, and the assignment of states to the attractors they lead to.

The catalogue grows when a state leads to an attractor not yet in it. A motion is recognised by the trapping region of
an orbit or, more cheaply, by its distance to the strobes of known attractors (`AttractorSignature`). Many states are
sorted at once, each followed only as long as it needs.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.attractors.attractor import Attractor, AttractorKind, Settled
from gapwalk.attractors.classify import ClassifyOptions, classify
from gapwalk.attractors.section import size_of
from gapwalk.attractors.settle import SettleOptions
from gapwalk.attractors.trapping_region import TrappingRegion, trapping_region_of
from gapwalk.errors import FlowError, ModelError
from gapwalk.model.system import System
from gapwalk.orbit.orbit import is_same

_SPACING = 4.0  # largest distance of a strobe from the sample of its torus or chaos, in spacings of the sample
_MOST = 0.9  # fraction of the strobes that must be so near
_CLOSEST = 2e-3  # relative distance that always counts as near: the two may come from different flows
UNRESOLVED, RUNAWAY, IMPOSSIBLE = -1, -2, -3
"""Labels of states that lead to no known attractor, of motions that diverge, and of states beyond a rigid stop."""

_FIRST = 8  # forcing periods before the first test; the total grows by half before each further test
_WATCHED = 48  # strobes of a motion in no trapping region that are compared with the attractor signatures

Advance = Callable[[NDArray[np.float64], int], NDArray[np.float64]]
"""Advances states, one in each row, by some forcing periods; a motion that cannot be integrated becomes nan."""
_COMPARED = 64  # strobes with which a motion is compared with the known attractors


@dataclass(frozen=True)
class Catalogue:
    """The known attractors of a system, each with a signature by which motions on it are recognised."""

    system: System  #: The system.
    #: attractors, signatures: The attractors in the order in which they were found, and the signature of each.
    attractors: tuple[Attractor, ...] = ()
    signatures: tuple[AttractorSignature, ...] = ()

    def with_one_more(self, attractor: Attractor) -> Catalogue:
        """Return a copy of the catalogue with one more attractor at its end."""
        return Catalogue(self.system, (*self.attractors, attractor), (*self.signatures, signature_of(attractor)))


@dataclass(frozen=True, eq=False)
class AttractorSignature:
    """The signature by which motions on an attractor are recognised."""

    #: The trapping region of its orbit; None if the attractor is not periodic, or too weakly stable.
    region: TrappingRegion | None
    strobes: NDArray[np.float64]  #: shape (count, state_size): States of the attractor, one forcing period apart.
    scale: NDArray[np.float64]  #: shape (state_size,): Size of the attractor.
    reach: float  #: Distance from the strobes, relative to that size, up to which a state belongs to the attractor.

    @property
    def wide(self) -> bool:
        """True if motions are recognised by their strobes alone."""
        return self.region is None

    def distance(self, track: NDArray[np.float64]) -> NDArray[np.float64]:
        """Compute the distance of most strobes of motions, shape (strobes, ...); up to 1 they are on the attractor.

        The strobes have the shape (strobes, ..., state_size). A motion that has diverged is nan; its distance is inf.
        """
        from scipy.spatial import KDTree  # imported late: it takes long

        finite = np.isfinite(track).all(axis=(0, -1))
        away = np.full(finite.shape, np.inf)
        distances = KDTree(self.strobes / self.scale).query(track[:, finite] / self.scale)[0]
        away[finite] = np.quantile(distances, _MOST, axis=0) / self.reach
        return away


class Sorted(NamedTuple):
    """The attractors to which states lead."""

    #: shape (count,): Index of the attractor signature that each motion reaches; UNRESOLVED or RUNAWAY for none.
    labels: NDArray[np.int_]
    states: NDArray[np.float64]  #: shape (count, state_size): States of the motions when this was decided.
    periods: NDArray[np.int_]  #: shape (count,): Number of forcing periods until then.


def explore(
    catalogue: Catalogue, advance: Advance, states: NDArray[np.float64], *, longest: int, max_period: int, tries: int
) -> tuple[Catalogue, NDArray[np.int_]]:
    """Classify states that lead to no known attractor: settle the first, sort the others by its attractor, and repeat.

    Shapes: `states` (count, state_size).
    """
    states = np.array(states, dtype=float)
    labels = np.full(len(states), UNRESOLVED)
    rest = np.arange(len(states))
    for _ in range(tries):
        if not len(rest):
            break
        first, rest = rest[0], rest[1:]
        known = len(catalogue.attractors)
        catalogue, labels[first] = _settle_one(catalogue, states[first], max_period)
        if labels[first] == known:  # a new attractor, to which others may lead too
            found = sort_states(advance, states[rest], catalogue.signatures, longest)
            states[rest], labels[rest] = found.states, found.labels
            rest = rest[found.labels == UNRESOLVED]
    return catalogue, labels


def _settle_one(catalogue: Catalogue, state: NDArray[np.float64], max_period: int) -> tuple[Catalogue, int]:
    """Label one state with the exact flow; return the catalogue, extended if its attractor is new, and the label."""
    options = ClassifyOptions(settle=SettleOptions(max_period=max_period))
    try:
        attractor = classify(catalogue.system, state, options)
    except FlowError:
        return catalogue, RUNAWAY
    if attractor.kind is AttractorKind.UNDECIDED:
        return catalogue, UNRESOLVED
    track = attractor.strobes[-_COMPARED:]
    for index, signature in enumerate(catalogue.signatures):
        if signature.distance(track) <= 1.0 if signature.region is None else signature.region.holds(track).all():
            return catalogue, index
    return catalogue.with_one_more(attractor), len(catalogue.attractors)


def sort_states(
    advance: Advance, states: NDArray[np.float64], signatures: Sequence[AttractorSignature], longest: int
) -> Sorted:
    """Follow states until each has reached one of the attractors, or for `longest` forcing periods.

    Shapes: `states` (count, state_size).
    """
    states = np.array(states, dtype=float)
    labels = np.full(len(states), UNRESOLVED)
    periods = np.zeros(len(states), dtype=int)
    total = 0
    alive = _look(states, labels, signatures, np.arange(len(states)))
    while len(alive) and total < longest:
        step = min(max(_FIRST, total // 2), longest - total)
        states[alive] = advance(states[alive], step)
        total += step
        periods[alive] = total
        alive = _look(states, labels, signatures, alive)
    wide = [(index, signature) for index, signature in enumerate(signatures) if signature.wide]
    if len(alive) and wide:
        track = np.empty((_WATCHED, len(alive), states.shape[1]))
        for strobe in track:
            strobe[:] = states[alive] = advance(states[alive], 1)
        periods[alive] += _WATCHED
        for index, signature in wide:
            labels[alive[(labels[alive] == UNRESOLVED) & (signature.distance(track) <= 1.0)]] = index
    return Sorted(labels, states, periods)


def _look(
    states: NDArray[np.float64],
    labels: NDArray[np.int_],
    signatures: Sequence[AttractorSignature],
    alive: NDArray[np.intp],
) -> NDArray[np.intp]:
    """Label the motions that are in a trapping region or have diverged; return the rest of `alive`."""
    labels[alive[~np.isfinite(states[alive]).all(axis=1)]] = RUNAWAY
    for index, signature in enumerate(signatures):
        if signature.region is not None:
            rest = alive[labels[alive] == UNRESOLVED]
            labels[rest[signature.region.holds(states[rest])]] = index
    return alive[labels[alive] == UNRESOLVED]


def match(
    attractors: Sequence[Attractor],
    motion: Attractor | Settled | NDArray[np.float64],
    tolerance: float = 1e-3,
) -> int | None:
    """Return the index of the attractor to which a settled motion belongs, or None.

    Two orbits are compared as in `gapwalk.orbit.orbit.is_same`. States are compared with the strobes of each
    attractor: they must be near those of an orbit within `tolerance`, and near those of a torus or of chaos within
    some spacings of its sample. If several attractors match, the nearest one is returned.

    Parameters
    ----------
    attractors
        The known attractors, all of the same system with the same parameter values.
    motion
        An attractor, a settled motion, one state at theta = 0, or several one forcing period apart, one in each row:
        one state distinguishes orbits, 16 or more distinguish any attractors.
    tolerance
        Tolerance relative to the size of an orbit.

    Returns
    -------
    int or None
        Index of the attractor.

    Raises
    ------
    ModelError
        If the states have the wrong shape.

    Examples
    --------
    >>> gw.analysis.match([attractor], settled)
    0
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
    """Return the distance of most of some states, one in each row, from an attractor; up to 1 they belong to it."""
    length = attractor.strobes.shape[1]
    if states.ndim != 2 or states.shape[1] != length:
        raise ModelError(f"the states have the shape {states.shape}; it must be (count, {length})")
    return float(_signature(attractor, None, tolerance).distance(states))


def signature_of(attractor: Attractor) -> AttractorSignature:
    """Build the signature of an attractor."""
    region = None if attractor.orbit is None else trapping_region_of(attractor.orbit)
    return _signature(attractor, region, _CLOSEST)


def _signature(attractor: Attractor, region: TrappingRegion | None, reach: float) -> AttractorSignature:
    """Build a signature whose reach is at least the given one, and more for the sample of a torus or of chaos."""
    from scipy.spatial import KDTree  # imported late: it takes long

    scale = size_of(attractor.system, attractor.strobes)
    known = attractor.strobes / scale
    if attractor.kind is not AttractorKind.PERIODIC and len(known) > 1:
        spacing = KDTree(known).query(known, k=2)[0][:, 1]
        reach = max(reach, _SPACING * float(np.quantile(spacing, 0.95)))
    return AttractorSignature(region, attractor.strobes, scale, reach)

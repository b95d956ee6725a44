"""Sorting of states by the attractor to which they lead: many at once, each followed only as long as it needs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.attractors.signature import AttractorSignature

UNRESOLVED, RUNAWAY = -1, -2
"""Labels of states that lead to no known attractor, and of motions that diverge."""

_FIRST = 8  # forcing periods before the first test; the total grows by half before each further test
_WATCHED = 48  # strobes of a motion in no trapping region that are compared with the attractor signatures

Advance = Callable[[NDArray[np.float64], int], NDArray[np.float64]]
"""Advances states, shape (count, 2n), by some forcing periods; a motion that cannot be integrated becomes nan."""


class Sorted(NamedTuple):
    """The attractors to which states lead.

    Attributes
    ----------
    labels : shape (count,)
        Index of the attractor signature that each motion reaches; UNRESOLVED or RUNAWAY for none.
    states : shape (count, 2n)
        States of the motions when this was decided.
    periods : shape (count,)
        Number of forcing periods until then.
    """

    labels: NDArray[np.int_]
    states: NDArray[np.float64]
    periods: NDArray[np.int_]


def sort_states(
    advance: Advance, states: NDArray[np.float64], signatures: Sequence[AttractorSignature], longest: int
) -> Sorted:
    """Follow states until each has reached one of the attractors, or for `longest` forcing periods.

    Parameters
    ----------
    advance
        The flow of many motions.
    states : shape (count, 2n)
        Positions, then velocities, at theta = 0.
    signatures
        Signatures of the attractors.
    longest
        The most forcing periods.
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
            labels[alive[(labels[alive] == UNRESOLVED) & signature.is_home_of(track)]] = index
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

"""Sorting states by the attractor to which they lead: many at a time, and no longer than each of them needs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.attractor.haunt import Haunt

UNRESOLVED, RUNAWAY = -1, -2
"""Labels of states that were found to lead to no known attractor, and of motions that run away."""

_FIRST = 8  # forcing periods before the first look; each following look comes after half as many again
_WATCHED = 48  # strobes by which a motion that is in no trap is compared with haunts

Advance = Callable[[NDArray[np.float64], int], NDArray[np.float64]]
"""Carries states, shape (count, 2n), over a number of forcing periods; a motion that cannot be followed becomes nan."""


class Sorted(NamedTuple):
    """Where states lead.

    Attributes
    ----------
    labels : shape (count,)
        Which haunt each of them comes to; UNRESOLVED or RUNAWAY for none.
    states : shape (count, 2n)
        Where they have come to when that was seen.
    periods : shape (count,)
        After how many forcing periods that was.
    """

    labels: NDArray[np.int_]
    states: NDArray[np.float64]
    periods: NDArray[np.int_]


def sort_states(advance: Advance, states: NDArray[np.float64], haunts: Sequence[Haunt], longest: int) -> Sorted:
    """Follow states until each is at one of the haunts, or for `longest` forcing periods.

    Parameters
    ----------
    advance
        The flow of many motions.
    states : shape (count, 2n)
        Positions, then velocities, at theta = 0.
    haunts
        What is known of the attractors.
    longest
        The most forcing periods.
    """
    states = np.array(states, dtype=float)
    labels = np.full(len(states), UNRESOLVED)
    periods = np.zeros(len(states), dtype=int)
    total = 0
    alive = _look(states, labels, haunts, np.arange(len(states)))
    while len(alive) and total < longest:
        step = min(max(_FIRST, total // 2), longest - total)
        states[alive] = advance(states[alive], step)
        total += step
        periods[alive] = total
        alive = _look(states, labels, haunts, alive)
    wide = [(index, haunt) for index, haunt in enumerate(haunts) if haunt.wide]
    if len(alive) and wide:
        track = np.empty((_WATCHED, len(alive), states.shape[1]))
        for strobe in track:
            strobe[:] = states[alive] = advance(states[alive], 1)
        periods[alive] += _WATCHED
        for index, haunt in wide:
            labels[alive[(labels[alive] == UNRESOLVED) & haunt.is_home_of(track)]] = index
    return Sorted(labels, states, periods)


def _look(
    states: NDArray[np.float64], labels: NDArray[np.int_], haunts: Sequence[Haunt], alive: NDArray[np.intp]
) -> NDArray[np.intp]:
    """Label the states that are trapped or lost; the rest of `alive`."""
    labels[alive[~np.isfinite(states[alive]).all(axis=1)]] = RUNAWAY
    for index, haunt in enumerate(haunts):
        if haunt.trap is not None:
            rest = alive[labels[alive] == UNRESOLVED]
            labels[rest[haunt.trap.holds(states[rest])]] = index
    return alive[labels[alive] == UNRESOLVED]

"""The catalogue of the attractors of one system, which grows as states are found that lead to none of those known."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gapwalk.attractor.attractor import Attractor, AttractorKind
from gapwalk.attractor.classify import ClassifyOptions, classify
from gapwalk.attractor.haunt import Haunt
from gapwalk.attractor.settle import SettleOptions
from gapwalk.attractor.sorting import RUNAWAY, UNRESOLVED, Advance, sort_states
from gapwalk.attractor.strobe import size_of
from gapwalk.attractor.trap import trap_of
from gapwalk.errors import FlowError
from gapwalk.model.system import System

_COMPARED = 64  # strobes of an attractor by which it is compared with those known


@dataclass(frozen=True)
class Catalogue:
    """The known attractors of a system, and how motions are recognised as being at each of them.

    Attributes
    ----------
    system
        The system.
    attractors, haunts
        The attractors in the order in which they were found, and the place of each.
    """

    system: System
    attractors: tuple[Attractor, ...] = ()
    haunts: tuple[Haunt, ...] = ()

    def with_one_more(self, attractor: Attractor) -> Catalogue:
        """The catalogue with an attractor at its end."""
        return Catalogue(self.system, (*self.attractors, attractor), (*self.haunts, haunt_of(attractor)))


@dataclass(frozen=True, slots=True)
class Effort:
    """How much is done to find where states lead.

    Parameters
    ----------
    longest
        The most forcing periods that a motion is followed by the fast flow.
    max_period
        The longest period m of an orbit that is looked for.
    tries
        The most motions that are settled and classified one by one, with the exact flow.
    """

    longest: int
    max_period: int
    tries: int


def haunt_of(attractor: Attractor) -> Haunt:
    """The place of an attractor."""
    trap = None if attractor.orbit is None else trap_of(attractor.orbit)
    return Haunt(trap, attractor.strobes, size_of(attractor.system, attractor.strobes))


def explore(
    catalogue: Catalogue, advance: Advance, states: NDArray[np.float64], effort: Effort
) -> tuple[Catalogue, NDArray[np.int_]]:
    """Sort states that lead to no known attractor: the first of them is settled and classified, and so on.

    Parameters
    ----------
    catalogue
        What is known already.
    advance
        The flow of many motions.
    states : shape (count, 2n)
        The states.
    effort
        How much is done.

    Returns
    -------
    The catalogue with the attractors that were found, and the label of each state, an index into it or UNRESOLVED or
    RUNAWAY.
    """
    states = np.array(states, dtype=float)
    labels = np.full(len(states), UNRESOLVED)
    rest = np.arange(len(states))
    for _ in range(effort.tries):
        if not len(rest):
            break
        first, rest = rest[0], rest[1:]
        known = len(catalogue.attractors)
        catalogue, labels[first] = _settle_one(catalogue, states[first], effort)
        if labels[first] == known:  # it is a new one, to which others may lead too
            found = sort_states(advance, states[rest], catalogue.haunts, effort.longest)
            states[rest], labels[rest] = found.states, found.labels
            rest = rest[found.labels == UNRESOLVED]
    return catalogue, labels


def _settle_one(catalogue: Catalogue, state: NDArray[np.float64], effort: Effort) -> tuple[Catalogue, int]:
    """The label of one state by the exact flow, and the catalogue with its attractor if that is new."""
    options = ClassifyOptions(settle=SettleOptions(max_period=effort.max_period))
    try:
        attractor = classify(catalogue.system, state, options)
    except FlowError:
        return catalogue, RUNAWAY
    if attractor.kind is AttractorKind.UNDECIDED:
        return catalogue, UNRESOLVED
    track = attractor.strobes[-_COMPARED:]
    for index, haunt in enumerate(catalogue.haunts):
        if haunt.trap is None:
            if haunt.is_home_of(track[:, None, :])[0]:
                return catalogue, index
        elif haunt.trap.holds(track).all():
            return catalogue, index
    return catalogue.with_one_more(attractor), len(catalogue.attractors)

"""The catalogue of the known attractors of one system; it grows when a state leads to an attractor not yet in it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gapwalk.attractors.attractor import Attractor, AttractorKind
from gapwalk.attractors.classify import ClassifyOptions, classify
from gapwalk.attractors.settle import SettleOptions
from gapwalk.attractors.signature import AttractorSignature
from gapwalk.attractors.sorting import RUNAWAY, UNRESOLVED, Advance, sort_states
from gapwalk.attractors.strobe import size_of
from gapwalk.attractors.trapping_region import trapping_region_of
from gapwalk.errors import FlowError
from gapwalk.model.system import System

_COMPARED = 64  # strobes with which a motion is compared with the known attractors


@dataclass(frozen=True)
class Catalogue:
    """The known attractors of a system, each with a signature by which motions on it are recognised.

    Attributes
    ----------
    system
        The system.
    attractors, signatures
        The attractors in the order in which they were found, and the signature of each.
    """

    system: System
    attractors: tuple[Attractor, ...] = ()
    signatures: tuple[AttractorSignature, ...] = ()

    def with_one_more(self, attractor: Attractor) -> Catalogue:
        """Return a copy of the catalogue with one more attractor at its end."""
        return Catalogue(self.system, (*self.attractors, attractor), (*self.signatures, signature_of(attractor)))


@dataclass(frozen=True, slots=True)
class Effort:
    """Limits on the work of finding the attractors to which states lead.

    Parameters
    ----------
    longest
        The most forcing periods for which a motion is followed with the fast flow.
    max_period
        The longest period m of the orbits that are searched for.
    tries
        The most motions that are settled and classified one by one with the exact flow.
    """

    longest: int
    max_period: int
    tries: int


def signature_of(attractor: Attractor) -> AttractorSignature:
    """Build the signature of an attractor."""
    region = None if attractor.orbit is None else trapping_region_of(attractor.orbit)
    return AttractorSignature(region, attractor.strobes, size_of(attractor.system, attractor.strobes))


def explore(
    catalogue: Catalogue, advance: Advance, states: NDArray[np.float64], effort: Effort
) -> tuple[Catalogue, NDArray[np.int_]]:
    """Classify states that lead to no known attractor: settle the first, sort the others by its attractor, and repeat.

    Parameters
    ----------
    catalogue
        The attractors known so far.
    advance
        The flow of many motions.
    states : shape (count, 2n)
        The states.
    effort
        Limits on the work.

    Returns
    -------
    The catalogue with the attractors that were found, and the label of each state: an index into the catalogue, or
    UNRESOLVED or RUNAWAY.
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
        if labels[first] == known:  # a new attractor, to which others may lead too
            found = sort_states(advance, states[rest], catalogue.signatures, effort.longest)
            states[rest], labels[rest] = found.states, found.labels
            rest = rest[found.labels == UNRESOLVED]
    return catalogue, labels


def _settle_one(catalogue: Catalogue, state: NDArray[np.float64], effort: Effort) -> tuple[Catalogue, int]:
    """Label one state with the exact flow; return the catalogue, extended if its attractor is new, and the label."""
    options = ClassifyOptions(settle=SettleOptions(max_period=effort.max_period))
    try:
        attractor = classify(catalogue.system, state, options)
    except FlowError:
        return catalogue, RUNAWAY
    if attractor.kind is AttractorKind.UNDECIDED:
        return catalogue, UNRESOLVED
    track = attractor.strobes[-_COMPARED:]
    for index, signature in enumerate(catalogue.signatures):
        if signature.region is None:
            if signature.is_home_of(track[:, None, :])[0]:
                return catalogue, index
        elif signature.region.holds(track).all():
            return catalogue, index
    return catalogue.with_one_more(attractor), len(catalogue.attractors)

"""The job behind basins of attraction: where many states lead, in chunks, checked with the exact flow."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gapwalk.attractors.attractor_catalogue import Catalogue, Effort, explore
from gapwalk.attractors.basins import Check
from gapwalk.attractors.batch_motions import motions_of
from gapwalk.attractors.many_motions import ExactMotions
from gapwalk.attractors.neighbours import about, differs
from gapwalk.attractors.signature import AttractorSignature
from gapwalk.attractors.sorting import UNRESOLVED, Sorted, sort_states
from gapwalk.model.system import System
from gapwalk.parallel.pace import Pace
from gapwalk.parallel.workers import Workers

CHUNK = 4096
"""States in a chunk: one piece of work, and what a killed run loses at most."""

_CHECKED = 32  # states of a piece that is followed with the exact flow
_WANDERING = 512  # periods for which a motion that seems to be on a torus or chaotic is followed exactly, at most
_SHIFT = 1e-15  # relative: where it changes a label, rounding decides
_PILOT = 64  # states that are looked at first: most attractors are found by them


@dataclass(frozen=True)
class BasinChunk:
    """Where the states of one chunk lead, by the fast flow.

    Attributes
    ----------
    number
        Which chunk.
    sorted
        Labels in the order in which the attractors were found.
    error
        Of the fast flow, see `gapwalk.attractors.many_motions.ManyMotions`.
    """

    number: int
    sorted: Sorted
    error: float


def chunks_of(resolution: tuple[int, int]) -> int:
    """Number of chunks of a plane of cells."""
    columns, rows = resolution
    return -(-columns * rows // CHUNK)


Report = Callable[[BasinChunk, Pace], object]
"""Called with each chunk when it is done, and how far the job has come."""


@dataclass(frozen=True, eq=False)
class _Piece:
    """Some of the states, and what is known of the attractors."""

    number: int
    places: NDArray[np.intp]
    system: System
    states: NDArray[np.float64]
    signatures: tuple[AttractorSignature, ...]
    longest: int


class BasinJob:
    """Finds where many states lead.

    Parameters
    ----------
    system
        The system.
    states : shape (count, 2n)
        The states.
    effort
        How much is done.
    seed
        Of the choice of the states that are looked at first, and of those that are checked.
    """

    def __init__(self, system: System, states: NDArray[np.float64], effort: Effort, seed: int) -> None:
        self.states, self.effort, self.seed = states, effort, seed
        self.catalogue = Catalogue(system)
        self.labels = np.full(len(states), UNRESOLVED)
        self.checked = Check(len(states))
        self.complete = False
        self._ends = states.copy()  # where the motions have come to
        self._chunks: dict[int, BasinChunk] = {}

    @property
    def count(self) -> int:
        """Number of chunks."""
        return -(-len(self.states) // CHUNK)

    def take(self, done: Iterable[BasinChunk]) -> None:
        """Take over chunks of the same job that have been done already."""
        self._chunks.update({chunk.number: chunk for chunk in done})

    @property
    def error(self) -> float:
        """The largest error of the fast flow."""
        return max((chunk.error for chunk in self._chunks.values()), default=0.0)

    def notes(self) -> Iterator[str]:
        """What could not be done, in sentences."""
        if not self.complete:
            done = sum(len(chunk.sorted.labels) for chunk in self._chunks.values())
            yield f"stopped when {done} of {len(self.states)} states were done"
        left = int(np.sum(self.labels == UNRESOLVED))
        if left and self.complete:
            yield f"{left} states lead to no attractor that was found; raise longest or tries"

    def sort(self, hands: Workers, report: Report | None = None) -> None:
        """Find the attractors to which some of the states lead, sort all by them, and look at those left over."""
        random = np.random.default_rng(self.seed)
        self._explore(np.sort(random.permutation(len(self.states))[:_PILOT]))
        for chunk in self._chunks.values():
            self._note(chunk)
        pieces = self._pieces(np.arange(len(self.states)), CHUNK, self.effort.longest)
        pieces = [piece for piece in pieces if piece.number not in self._chunks]
        begun, before = time.monotonic(), len(self._chunks)

        def accept(_: int, chunk: BasinChunk) -> None:
            self._chunks[chunk.number] = chunk
            self._note(chunk)
            if report is not None:
                total = before + len(pieces)
                report(chunk, Pace(len(self._chunks), total, before, time.monotonic() - begun))

        hands.run(_sort_fast, pieces, accept, in_order=False)
        self._explore(np.flatnonzero(self.labels == UNRESOLVED))

    def check(self, hands: Workers, neighbours: NDArray[np.intp], at_borders: int | None, elsewhere: int) -> None:
        """Find labels at borders, and some others, again with the exact flow, and correct what is wrong.

        Wrong labels are not alone: where one was found, those about it are found again too. And where a sample holds
        one, there are more; so others are drawn, until a sample holds none. In the end some are followed once more from
        states shifted by their rounding: where basins are as fine as that, no computation can tell their labels.

        Parameters
        ----------
        hands
            Who does it.
        neighbours : shape (count, any number)
            Which states are beside each one.
        at_borders
            How many labels at borders; None for all of them, with those about wrong ones, and as many samples as it
            takes. Otherwise there is one sample.
        elsewhere
            How many labels in a sample.
        """
        checked, changed, sampled = (np.zeros(len(self.states), dtype=bool) for _ in range(3))
        wrong = wrong_elsewhere = 0
        while True:
            while True:  # mended labels make new borders
                near = differs(self.labels, neighbours)
                if at_borders is None:
                    near |= about(about(changed, neighbours), neighbours)
                left = len(self.states) if at_borders is None else at_borders - int(np.sum(checked & ~sampled))
                chosen = self._choose(near & ~checked, left)
                if not len(chosen):
                    break
                wrong += self._mend(hands, chosen, changed)
                checked[chosen] = True
            chosen = self._choose(~near & ~checked, elsewhere)
            before = int(changed.sum())
            wrong_elsewhere += self._mend(hands, chosen, changed)
            checked[chosen] = sampled[chosen] = True
            if at_borders is not None or changed.sum() == before:
                break
        at_border = checked & ~sampled
        counts = (int(np.sum((near | at_border) & ~sampled)), int(at_border.sum()), wrong)
        again = self._choose(checked, elsewhere)
        shifted = self._exact(hands, again, _SHIFT)
        differ = int(np.sum((shifted != UNRESOLVED) & (shifted != self.labels[again])))
        self.checked = Check(
            len(self.states), *counts, int(sampled.sum()), wrong_elsewhere, shifted=len(again), shifted_wrong=differ
        )

    def _note(self, chunk: BasinChunk) -> None:
        place = slice(chunk.number * CHUNK, chunk.number * CHUNK + len(chunk.sorted.labels))
        self.labels[place], self._ends[place] = chunk.sorted.labels, chunk.sorted.states

    def _choose(self, group: NDArray[np.bool_], most: int) -> NDArray[np.intp]:
        """Random ones of a group of cells, in order."""
        random = np.random.default_rng(self.seed)
        return np.sort(random.permutation(np.flatnonzero(group))[:most])

    def _mend(self, hands: Workers, which: NDArray[np.intp], changed: NDArray[np.bool_]) -> int:
        """Find labels again with the exact flow, and note in `changed` which are others now; how many were wrong."""
        exact = self._exact(hands, which)
        wrong = int(np.sum(exact != self.labels[which]))
        # one that has come to no attractor by then keeps its label, but counts as wrong
        mended = np.where(exact == UNRESOLVED, self.labels[which], exact)
        changed[which] = mended != self.labels[which]
        self.labels[which] = mended
        return wrong

    def _exact(self, hands: Workers, which: NDArray[np.intp], shift: float = 0.0) -> NDArray[np.int_]:
        """Labels by the exact flow, from states that are shifted by so much of the largest of their components."""
        exact = np.full(len(self.states), UNRESOLVED)
        wide = np.array(
            [signature.wide for signature in self.catalogue.signatures] + [False, False]
        )  # the last: no attractor
        is_wide = wide[self.labels[which]]
        pieces = self._pieces(which[~is_wide], _CHECKED, self.effort.longest, shift)
        pieces += self._pieces(which[is_wide], _CHECKED, min(self.effort.longest, _WANDERING), shift)

        def accept(index: int, found: Sorted) -> None:
            exact[pieces[index].places] = found.labels

        hands.run(_sort_exactly, pieces, accept, in_order=False)
        return exact[which]

    def _explore(self, which: NDArray[np.intp]) -> None:
        if len(which):
            motions = motions_of(self.catalogue.system, self.states[which])
            self.catalogue, labels = explore(self.catalogue, motions.advance, self._ends[which], self.effort)
            self.labels[which] = labels

    def _pieces(self, which: NDArray[np.intp], size: int, longest: int, shift: float = 0.0) -> list[_Piece]:
        system, signatures = self.catalogue.system, self.catalogue.signatures
        states = self.states + shift * np.abs(self.states).max(axis=0)
        places = [which[first : first + size] for first in range(0, len(which), size)]
        return [_Piece(number, some, system, states[some], signatures, longest) for number, some in enumerate(places)]


def _sort_fast(piece: _Piece) -> BasinChunk:
    """Sort states by the batch integrator."""
    motions = motions_of(piece.system, piece.states)
    found = sort_states(motions.advance, piece.states, piece.signatures, piece.longest)
    return BasinChunk(piece.number, found, motions.error)


def _sort_exactly(piece: _Piece) -> Sorted:
    return sort_states(ExactMotions(piece.system).advance, piece.states, piece.signatures, piece.longest)

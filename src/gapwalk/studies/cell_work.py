"""Work on the cells of a map: chunk by chunk with the batch integrator, then a check with the exact flow."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Generator, Iterable
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from gapwalk.parallel.workers import Workers
from gapwalk.results.result_file import Entry, Part, Parts
from gapwalk.studies.study_kind import AnswerFinding, Found, StudyKind, Work

CHUNKS = "chunks of cells"
"""Name of the parts of such work."""
_COSTLY = 8  # share of a sample, inverse, that costly cells of one kind may have


class CellWork(Work):
    """Work on many cells, in chunks that do not depend on each other.

    A chunk is a frozen record with its ``number`` and the ``error`` of the batch integrator in it. Which chunks there
    are, and what they hold, does not depend on who does them, so a stopped job comes to the same result.

    Attributes
    ----------
    chunk_part
        The part of a file that holds a chunk.
    resolution
        Columns and rows of a map.
    """

    chunk_part: ClassVar[Part]

    asked: Any  # the study; None if the work is not that of a study

    def __init__(self, asked: StudyKind | None, resolution: tuple[int, int]) -> None:
        self.asked, self.resolution = asked, resolution
        self.chunks: dict[int, Any] = {}
        self._whole: Any = None

    @property
    def whole_part(self) -> Part:
        """The part of a file that holds the whole record."""
        return self.asked.answer

    def begin(self) -> Iterable[Found]:
        """Do the work that all chunks depend on."""
        return ()

    @abstractmethod
    def follow(self, workers: Workers, numbers: list[int]) -> Iterable[tuple[int, Any]]:
        """Do some chunks, as `gapwalk.parallel.workers.Workers.each`."""

    @abstractmethod
    def note(self, chunk: Any) -> None:
        """Enter a chunk into the arrays over all cells."""

    @abstractmethod
    def check(self, workers: Workers) -> Iterable[Found] | None:
        """Compare the results with the exact flow, when all chunks are done."""

    @abstractmethod
    def found(self, *, complete: bool) -> Any:
        """Return the record of the results so far; None if there are none yet."""

    @property
    def error(self) -> float:
        """The largest error of the batch integrator."""
        return max((chunk.error for chunk in self.chunks.values()), default=0.0)

    def take(self, known: Parts) -> None:
        """Read the record of a file, or its chunks if it is incomplete; raise a ValueError if it has other cells."""
        self._whole = known.get(self.whole_part)
        if self._whole is None:
            for _, chunk in known.all(self.chunk_part):
                self._add(chunk)
        elif self._whole.resolution != self.resolution:
            raise ValueError(f"its resolution is {self._whole.resolution}, not that of the study")

    def parts(self, workers: Workers) -> Generator[Found]:
        """Do the remaining chunks; then check the results with the exact flow."""
        yield from self.begin()
        for _, chunk in self.follow(workers, [number for number in range(self.total) if number not in self.chunks]):
            self._add(chunk)
            yield Found.part(self.chunk_part, chunk, chunk.number)
        yield from self.check(workers) or ()
        self._whole = self.found(complete=True)

    def _add(self, chunk: Any) -> None:
        self.chunks[chunk.number] = chunk
        self.note(chunk)

    def last(self, *, finished: bool) -> Iterable[Entry]:
        """Return the record, if it is complete."""
        return [self.whole_part.entry(self._whole)] if finished else []

    @property
    def complete(self) -> bool:
        """True if all cells are done, and checked."""
        return self._whole is not None

    @property
    def done(self) -> int:
        """Chunks that are done."""
        return self.total if self.complete else len(self.chunks)

    @property
    def record(self) -> Any:
        """The record so far; None if there is none yet."""
        return self._whole or self.found(complete=False)

    def finding(self) -> AnswerFinding | None:
        """Return the record as the finding of a study; None if the work is not that of a study."""
        return None if self.asked is None else AnswerFinding(self.asked, self.record, self.done, self.total, CHUNKS)


def check_until_right(
    kinds: NDArray[Any],
    may: NDArray[np.bool_],
    costly: NDArray[np.bool_],
    most: int,
    seed: int,
    find_wrong: Callable[[NDArray[np.intp]], NDArray[np.bool_]],
) -> int:
    """Check cells of all kinds, then those beside wrong ones and more of their kinds, until none is wrong."""
    # Shapes: `kinds` (first, second, numbers); `may`, `costly` (first, second), bool.
    _, group, sizes = np.unique(kinds.reshape(may.size, -1), axis=0, return_inverse=True, return_counts=True)
    group, left, random = group.ravel(), may.ravel().copy(), np.random.default_rng(seed)

    def sample(among: NDArray[np.intp]) -> NDArray[np.intp]:
        """Choose cells of some kinds: the rarest in full, the others in equal numbers."""
        chosen = [np.empty(0, dtype=np.intp)]
        among = among[np.argsort(sizes[among], kind="stable")]
        for number, one in enumerate(among):
            share, own = (most - sum(map(len, chosen))) // (len(among) - number), group == one
            if costly.ravel()[own].any():
                share = min(share, -(-most // _COSTLY))
            chosen.append(random.permutation(np.flatnonzero(left & own))[:share])
        return np.concatenate(chosen)

    chosen, wrong = sample(np.arange(len(sizes))), np.zeros(may.size, dtype=bool)
    while len(chosen):
        chosen = np.sort(chosen)
        left[chosen] = False
        bad = chosen[find_wrong(chosen)]
        if not len(bad):
            break
        wrong[:] = False
        wrong[bad] = True
        framed = np.pad(wrong.reshape(may.shape), 1)
        rows, columns = may.shape
        near = np.any([framed[i : i + rows, j : j + columns] for i in range(3) for j in range(3)], axis=0).ravel()
        chosen = np.union1d(np.flatnonzero(near & left), sample(np.unique(group[bad])))
    return int(may.sum() - left.sum())

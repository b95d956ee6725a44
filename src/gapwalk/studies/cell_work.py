"""Work on the cells of a map: chunk by chunk with the batch integrator, then a check with the exact flow."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Generator, Iterable
from dataclasses import dataclass
from typing import Any, ClassVar

from gapwalk.parallel.workers import Workers
from gapwalk.results.result_file import Entry, Part, Parts
from gapwalk.studies.study_kind import Finding, Found, Work


class CellWork(Work):
    """Work on many cells, in chunks that do not depend on each other.

    A chunk is a frozen record with its ``number`` and the ``error`` of the batch integrator in it. Which chunks there
    are, and what they hold, does not depend on who does them, so a stopped job comes to the same result.

    Attributes
    ----------
    chunk_part, whole_part
        The parts of a file that hold a chunk, and the whole record.
    found_as
        The class of what a study has found.
    resolution
        Columns and rows of a map.
    """

    chunk_part: ClassVar[Part]
    whole_part: ClassVar[Part]
    found_as: ClassVar[type[CellFinding]]

    def __init__(self, resolution: tuple[int, int]) -> None:
        self.resolution = resolution
        self.chunks: dict[int, Any] = {}
        self._whole: Any = None

    def begin(self) -> None:
        """Do what all chunks need."""
        return

    @abstractmethod
    def follow(self, workers: Workers, numbers: list[int]) -> Iterable[tuple[int, Any]]:
        """Do some chunks, as `gapwalk.parallel.workers.Workers.each`."""

    @abstractmethod
    def note(self, chunk: Any) -> None:
        """Enter a chunk into the arrays over all cells."""

    @abstractmethod
    def check(self, workers: Workers) -> None:
        """Compare what is found with the exact flow, when all chunks are done."""

    @abstractmethod
    def found(self, *, complete: bool) -> Any:
        """Return the record of what is found so far; None as long as there can be none."""

    @property
    def error(self) -> float:
        """The largest error of the batch integrator."""
        return max((chunk.error for chunk in self.chunks.values()), default=0.0)

    def take(self, known: Parts) -> None:
        """Take over the record, or the chunks of one that is not complete; a ValueError if it is of other cells."""
        self._whole = known.get(self.whole_part)
        if self._whole is None:
            for _, chunk in known.all(self.chunk_part):
                self._add(chunk)
        elif self._whole.resolution != self.resolution:
            raise ValueError(f"its resolution is {self._whole.resolution}")

    def parts(self, workers: Workers) -> Generator[Found]:
        """Do the chunks that are left; then check what is found with the exact flow."""
        self.begin()
        for _, chunk in self.follow(workers, [number for number in range(self.total) if number not in self.chunks]):
            self._add(chunk)
            yield Found.part(self.chunk_part, chunk, chunk.number)
        self.check(workers)
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
        """The record, as far as it has come; None as long as there can be none."""
        return self._whole or self.found(complete=False)

    def finding(self) -> CellFinding:
        """Return the record as what a study has found."""
        return self.found_as(self.record, self.done, self.total)


@dataclass(frozen=True)
class CellFinding(Finding):
    """A map, as far as it has come, and how many of its chunks of cells are done."""

    map: Any
    done: int
    total: int

    @property
    def record(self) -> Any:
        """The map; None if the work was stopped before there was one."""
        return self.map

    @property
    def stored(self) -> str:
        """How many chunks have been done."""
        return f"{self.done} of {self.total} chunks of cells are stored"

    def document(self, points: bool) -> dict[str, Any]:
        """The map as JSON values, and how far it has come; with all values cell by cell if wanted."""
        document: dict[str, Any] = {"chunks": {"done": self.done, "total": self.total}}
        return document if self.map is None else document | self.map_document(points)

    @abstractmethod
    def map_document(self, points: bool) -> dict[str, Any]:
        """The map as JSON values."""

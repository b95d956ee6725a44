"""The names of the parameters of a system; those of large matrices are computed on request."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import overload

from gapwalk.errors import ModelError
from gapwalk.model.problems import near_names
from gapwalk.model.units import PACES

_SHOWN = 5  # names that are listed if none is similar to the unknown one
_FEW = 20_000  # names that may be listed, for a faster look-up and to find similar ones


@dataclass(frozen=True, slots=True)
class NameBlock:
    """Consecutive parameters: one number (rank 0), one for each coordinate (1), or for each pair of them (2)."""

    prefix: str
    rank: int = 0


@dataclass(frozen=True)
class ParameterNames(Sequence[str]):
    """All names in the order of the value vector; they are not stored if there are very many.

    Parameters
    ----------
    blocks
        The blocks of names, in their order.
    coordinates
        The names by which vectors and matrices are indexed: ``stiffness.q1.q3``.
    """

    blocks: tuple[NameBlock, ...]
    coordinates: tuple[str, ...] = ()

    def __len__(self) -> int:
        return self._starts[-1]

    @overload
    def __getitem__(self, index: int) -> str: ...
    @overload
    def __getitem__(self, index: slice) -> Sequence[str]: ...
    def __getitem__(self, index: int | slice) -> str | Sequence[str]:
        if isinstance(index, slice):
            return [self[each] for each in range(*index.indices(len(self)))]
        place = range(len(self))[index]
        number = next(i for i, end in enumerate(self._starts[1:]) if place < end)
        block, offset, n = self.blocks[number], place - self._starts[number], len(self.coordinates)
        words = [block.prefix]
        for power in range(block.rank - 1, -1, -1):
            words.append(self.coordinates[offset // n**power % n])
        return ".".join(words)

    def __iter__(self) -> Iterator[str]:
        for block in self.blocks:
            prefixes = [block.prefix]
            for _ in range(block.rank):
                prefixes = [f"{prefix}.{name}" for prefix in prefixes for name in self.coordinates]
            yield from prefixes

    def __contains__(self, name: object) -> bool:
        return isinstance(name, str) and self._find(name) is not None

    def start(self, prefix: str) -> int:
        """Return the place of the first parameter of a block; raise a KeyError for an unknown prefix."""
        return self._starts[self._blocks[prefix]]

    def place(self, name: str) -> int:
        """Return the place of one parameter.

        Raises
        ------
        ModelError
            If there is no parameter of that name; the message offers the nearest ones.
        """
        place = self._find(name) if isinstance(name, str) else None
        if place is None:
            raise ModelError(self._unknown(str(name)))
        return place

    @property
    def single(self) -> list[int]:
        """The places of the parameters that are not entries of a vector or a matrix."""
        return [start for block, start in zip(self.blocks, self._starts, strict=False) if block.rank == 0]

    @cached_property
    def _starts(self) -> list[int]:
        starts = [0]
        for block in self.blocks:
            starts.append(starts[-1] + len(self.coordinates) ** block.rank)
        return starts

    @cached_property
    def _blocks(self) -> dict[str, int]:
        return {block.prefix: number for number, block in enumerate(self.blocks)}

    @cached_property
    def _indices(self) -> dict[str, int]:
        return {name: index for index, name in enumerate(self.coordinates)}

    @cached_property
    def _listed(self) -> dict[str, int] | None:
        return {name: place for place, name in enumerate(self)} if len(self) <= _FEW else None

    def _find(self, name: str) -> int | None:
        return self._listed.get(name) if self._listed is not None else self._compute(name)

    def _compute(self, name: str) -> int | None:
        words = name.split(".")
        for rank in (0, 1, 2):
            number = self._blocks.get(".".join(words[: len(words) - rank]))
            if number is None or self.blocks[number].rank != rank:
                continue
            indices = [self._indices.get(word) for word in words[len(words) - rank :]]
            if None in indices:
                continue
            offset = 0
            for index in indices:
                offset = offset * len(self.coordinates) + (index or 0)
            return self._starts[number] + offset
        return None

    def _unknown(self, name: str) -> str:
        known = list(self) if len(self) <= _FEW else [block.prefix for block in self.blocks if block.rank == 0]
        near = near_names(name, known)
        if not near:
            last = name.rsplit(".", 1)[-1]
            near = [each for each in known if each.rsplit(".", 1)[-1] == last][:3]
        if not near and name in PACES:
            near = known[:1]  # the other of the two
        if near:
            return f"there is no parameter {name!r}; did you mean {' or '.join(map(repr, near))}?"
        rest = ", ... (system.parameters lists them all)" if len(self) > _SHOWN else ""
        return f"there is no parameter {name!r}; there are {', '.join(map(repr, known[:_SHOWN]))}{rest}"

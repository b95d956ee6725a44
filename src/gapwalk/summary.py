"""How records describe themselves to readers: lines of text, tables and trees; the terminal draws them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field


@dataclass(frozen=True)
class Table:
    """A table of texts.

    Parameters
    ----------
    headings
        Headings of the columns. Those that begin with ``>`` (which is not shown) have columns aligned to the right.
    rows
        The cells of each row.
    groups
        Indices of the rows after which a gap separates groups of rows.
    """

    headings: Sequence[str]
    rows: Sequence[Sequence[str]]
    groups: Sequence[int] = ()

    @property
    def columns(self) -> Iterator[tuple[str, bool]]:
        """Heading of each column, and True if the column is aligned to the right."""
        return ((heading.removeprefix(">"), heading.startswith(">")) for heading in self.headings)


@dataclass(frozen=True)
class Tree:
    """A text with the texts that depend on it.

    Parameters
    ----------
    label
        The text.
    children
        Trees that depend on it.
    """

    label: str
    children: list[Tree] = field(default_factory=list, hash=False)


Summary = Iterable[str | Table | Tree]
"""A record in the words that the terminal shows: lines, tables and trees, from the top to the bottom."""


def remarks(notes: Iterable[str], failures: Iterable[str]) -> Iterator[str]:
    """Return the last lines of a summary: notes, and what could not be computed."""
    yield from (f"note: {text}" for text in notes)
    yield from (f"failed: {text}" for text in failures)

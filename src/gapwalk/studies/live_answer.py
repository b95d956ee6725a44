"""An answer that is drawn again while numbers of its system change: what the page and a notebook ask of each kind."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from typing import Any, ClassVar, NamedTuple, Self

from gapwalk.model.system import System
from gapwalk.studies.study_file import Study

LONGEST = 15.0
"""Seconds of CPU time that an answer may take at rest."""
GAP = float("nan")
"""Both coordinates between two curves."""


class Seen(NamedTuple):
    """Curves as they are drawn while numbers change."""

    #: x, y, looks: Points, and the style of each: a label of stability, a kind of special point, or ``settled``.
    x: list[float]
    y: list[float]
    looks: list[str]
    marks: list[tuple[str, float, float]]  #: Kind and place of each special point.


class LiveAnswer(ABC):
    """Answer of one kind, with what is known of it for the numbers that it was computed with last."""

    key: ClassVar[str]  #: Name of the kind.
    about: tuple[Any, ...] = ()  #: What is known is used again for systems and studies for which this is equal.
    title: dict[str, Any]  #: What the page shows before there is a picture: both axes and their ranges.
    end: str = ""  #: Why the answer is not whole, in words.

    @classmethod
    @abstractmethod
    def of(cls, studies: Sequence[Study], at: float | None) -> tuple[Self, System]:
        """Return the answer that studies ask for, and its system; `at` is a chosen value of the first parameter."""

    def renew(self, other: LiveAnswer) -> None:
        """Take the title of an answer to a changed text about the same."""
        self.title = other.title

    @abstractmethod
    def coarse(self, system: System) -> Any:
        """Return a picture of a system with other numbers, made at once from what is known; None if nothing is."""

    @abstractmethod
    def rest(self, system: System) -> Iterator[Any]:
        """Yield pictures of what is found, for the page, and None where the work may be given up."""

    @abstractmethod
    def exact(self, system: System) -> Any:
        """Return the record that the ordinary computation finds."""

"""What studies find that is more, or other, than branches: each kind by a class of its own."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

Rows = Iterable[Sequence[object]]
"""The rows of a table, the first of them the headings."""


class Finding(ABC):
    """What a study has found, of a kind whose result is more, or other, than a list of branches.

    A kind of study brings a subclass; how it is printed and drawn stands in `gapwalk.cli.print_findings` and
    `gapwalk.plot.picture`.
    """

    @property
    @abstractmethod
    def record(self) -> Any:
        """What the Python function of the same name returns; None if the work was stopped before there was one."""

    @property
    @abstractmethod
    def complete(self) -> bool:
        """Whether nothing is left to do."""

    @property
    @abstractmethod
    def stored(self) -> str:
        """What has been done, in words, as far as it is not complete."""

    @property
    def can_be_drawn(self) -> bool:
        """Whether there is something to draw."""
        return self.record is not None

    @property
    def notes(self) -> tuple[str, ...]:
        """What else there is to say, in sentences."""
        return ()

    @property
    def failures(self) -> tuple[str, ...]:
        """Where the numerics gave up, in sentences."""
        return ()

    @abstractmethod
    def document(self, points: bool) -> dict[str, Any]:
        """The same as plain JSON values; with everything point by point if wanted."""

    @abstractmethod
    def tables(self) -> Mapping[str, Callable[[], Rows]]:
        """The tables by name, the most important one first."""


def plain_numbers(values: Any) -> Any:
    """Numbers in nested lists, as JSON has them: those that are not finite become null."""
    if isinstance(values, list):
        return [plain_numbers(value) for value in values]
    return None if isinstance(values, float) and not math.isfinite(values) else values

"""The constant load."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from gapwalk.model.loads.load import Line, Load, LoadForm


class Mean(Load):
    """The constant load: every system has one, a vector that is all of its parameters."""

    key, words = "mean", "the constant load"
    parameters = ()

    @classmethod
    def lines(cls, order: int, frequency: Any, numbers: Mapping[str, Any]) -> Iterable[Line]:
        """See `Load.lines`."""
        yield Line(0, 1.0)


MEAN = LoadForm("mean", 0, Mean)
"""The constant load of a system; its vector is called ``mean``."""

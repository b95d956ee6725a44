"""What a map shows, and where its loci are picked up."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from gapwalk.bifurcation.branch import Kind
from gapwalk.bifurcation.isolated import SearchOptions
from gapwalk.errors import ModelError

KINDS = tuple(kind for kind in Kind.known() if not kind.no_locus)
"""The kinds of special points that have loci."""

_MOST = 100_000


@dataclass(frozen=True, slots=True)
class MapOptions:
    """What a map shows, and where its loci are picked up.

    Parameters
    ----------
    sections
        Values of the second parameter at which branches are followed along the first one: their special points are
        where the loci begin. A number of them is spread evenly over the range, its ends included.
    max_period
        Longest period, in forcing periods, of the branches that are followed there.
    kinds
        Kinds of loci.
    workers
        Processes to work in; by default one for each local core. The result does not depend on it.
    search_values
        Values of the first parameter on each section at which branches not connected to others are sought;
        as in `DiagramOptions`.
    search
        How thoroughly to search there.
    """

    sections: int | tuple[float, ...] = 5
    max_period: int = 2
    kinds: tuple[Kind, ...] = KINDS
    workers: int | None = None
    search_values: int | tuple[float, ...] = 0
    search: SearchOptions = SearchOptions()

    def __post_init__(self) -> None:
        _check_sections(self.sections)
        if not _is_count(self.max_period):
            raise ModelError(f"max_period is {self.max_period!r}; it must be an integer from 1 to {_MOST:,}")
        if not self.kinds or not set(self.kinds) <= set(KINDS):
            names = ", ".join(kind.value for kind in KINDS)
            raise ModelError(f"kinds is {[str(kind) for kind in self.kinds]}; they may be {names}")

    def values(self, low: float, high: float) -> tuple[float, ...]:
        """The values of the sections between two bounds.

        Raises
        ------
        ModelError
            If one of them lies outside.
        """
        if isinstance(self.sections, int):
            count = self.sections
            return tuple(np.linspace(low, high, count).tolist()) if count > 1 else (0.5 * (low + high),)
        outside = [value for value in self.sections if not low <= value <= high]
        if outside:
            raise ModelError(f"there is to be a section at {outside[0]:g}, outside the range from {low:g} to {high:g}")
        return tuple(float(value) for value in self.sections)


def _check_sections(sections: object) -> None:
    if isinstance(sections, tuple):
        if not sections or not all(math.isfinite(value) for value in sections):
            raise ModelError(f"sections is {sections!r}; it must be an integer from 1 to {_MOST:,}, or numbers")
        if len(set(sections)) < len(sections):
            raise ModelError(f"sections is {sections!r}; each value must stand there once")
    elif not _is_count(sections):
        raise ModelError(
            f"sections is {sections!r}; it must be an integer from 1 to {_MOST:,}, or values of the second parameter"
        )


def _is_count(value: object) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and 1 <= value <= _MOST

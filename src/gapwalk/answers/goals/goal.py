"""A goal of a design: what a response should be, as margins that must not be negative, with their derivatives.

A goal is reached where all its margins are at least zero. How it is reached may be open: folds leave a band at its
lower or its upper end, or vanish in it. Each such way is a smooth problem of its own, and all are tried.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.answers.local_response import LocalResponse
from gapwalk.bifurcation.branch import Branch
from gapwalk.errors import ModelError
from gapwalk.model.system import System

MARGIN = 1e-3
"""Safety margin: as a share of the width of a band, of a limit, or of a measure of size 1."""
EXACT = 1e-9
"""Margin that may be missing because of rounding."""
LOWEST = 3
"""Local minima of a measure along a branch that are kept away from zero."""


class Need(NamedTuple):
    """One margin of a goal at a design.

    Examples
    --------
    >>> need = gw.ask.Need(margin=0.1, slopes=np.array([0.5]), words="fold at 1.39 below the band")
    >>> need.margin
    0.1
    """

    margin: float  #: What is left, relative to the width of the band or to the limit; negative: missing.
    slopes: NDArray[np.float64]  #: shape (k,): Its derivatives by relative changes of the parameters.
    words: str  #: Description.


@dataclass(frozen=True)
class Goal(ABC):
    """A goal of a design."""

    def ways(self, system: System) -> tuple[str, ...]:
        """Return the ways in which it may be reached by a system; each is tried."""
        return ("",)

    def posed(self, system: System, way: str) -> System:
        """Return the system, with the same parameters, on whose response the margins of a way are taken."""
        return system

    @property
    def band(self) -> tuple[float, float] | None:
        """The band of the walked parameter for which it is set; None if there is none."""
        return getattr(self, "within", None)

    @abstractmethod
    def words(self, system: System, parameter: str) -> str:
        """Describe the goal."""

    @abstractmethod
    def needs(self, response: LocalResponse, way: str, margin: float) -> list[Need]:
        """Return the margins at a design, with their derivatives, less the safety margin."""

    @abstractmethod
    def margin(self, response: LocalResponse) -> float:
        """Return how far the goal is reached at a design, in whichever way; negative if it is not."""

    def against(self, branch: Branch) -> list[str]:
        """Return sentences on what an isolated branch has against the goal."""
        return []

    def check(self, system: System, ends: tuple[float, float]) -> None:
        """Raise a ModelError if the goal is none of this system, or leaves the range of the response."""
        low, high = self.band or ends
        if not ends[0] <= low < high <= ends[1]:
            raise ModelError(
                f"a goal is set from {low:g} to {high:g}; it must lie inside the range of the response, "
                f"{ends[0]:g} to {ends[1]:g}"
            )

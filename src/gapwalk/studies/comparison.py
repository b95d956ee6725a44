"""Two results that should be the same, compared: what both have, how far apart it is, and what only one of them has."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.notebook.shown import Shown
from gapwalk.studies.result import Result


class Shift(NamedTuple):
    """A special point that both results have.

    Attributes
    ----------
    label
        What happens there, and which contact grazes.
    first, second
        The value of the parameter in either result; on a locus, of both.
    share
        The largest of the differences, as a share of the parameter's range.
    """

    label: str
    first: tuple[float, ...]
    second: tuple[float, ...]
    share: float

    @property
    def differences(self) -> tuple[float, ...]:
        """Second less first, in units of the parameters."""
        return tuple(b - a for a, b in zip(self.first, self.second, strict=True))


class Lone(NamedTuple):
    """A special point that one result has alone: what happens there, and where."""

    label: str
    values: tuple[float, ...]


@dataclass(frozen=True, eq=False)
class Pair:
    """A branch, or a locus, that both results have.

    Attributes
    ----------
    names
        What either result calls it.
    places, distances : shape (points, 1 or 2), (points,)
        Parameters of the points of both, and how far each is from the other curve, as a share of the ranges.
    resolution
        Roughly the largest part of a distance that the interpolation between points may be.
    shifts
        Special points that both have.
    only
        Those that the first has alone, and those that the second has alone, where both have points.
    covered
        The range of the parameter, or of the first of two, that either covers.
    missing
        The largest part of a range that one covers and the other does not, as a share of the parameter's range.
    """

    names: tuple[str, str]
    places: NDArray[np.float64]
    distances: NDArray[np.float64]
    resolution: float
    shifts: tuple[Shift, ...]
    only: tuple[tuple[Lone, ...], tuple[Lone, ...]]
    covered: tuple[tuple[float, float], tuple[float, float]]
    missing: float

    @property
    def largest(self) -> float:
        """The largest distance between the curves, as a share of the ranges."""
        return float(self.distances.max(initial=0.0))

    @property
    def worst(self) -> tuple[float, ...]:
        """The parameters where it is."""
        return tuple(self.places[int(np.argmax(self.distances))].tolist()) if len(self.distances) else ()

    @property
    def largest_shift(self) -> float:
        """The largest difference in the location of a special point, as a share of the parameter's range."""
        return max((shift.share for shift in self.shifts), default=0.0)

    def within(self, tolerance: float) -> bool:
        """Whether the curves agree: distances, locations and ranges, with no special point on one of them alone."""
        return not any(self.only) and max(self.largest, self.largest_shift, self.missing) <= tolerance


@dataclass(frozen=True)
class ResultComparison(Shown):
    """What two results have in common, and what not.

    Lengths are shares: of the range of the parameter, and of the range of each measure, over all branches of both.

    Attributes
    ----------
    results
        The results.
    parameters
        The parameter of the branches; of the loci of a map both.
    ranges
        The range of each, in its units: what a share is a share of.
    measures
        What tells motions apart beside the parameters; nothing on loci, which are curves in the plane.
    pairs
        The branches, and the loci of maps, that both have.
    only
        Names of those that the first has alone, and of those that the second has alone.
    notes
        In what the studies differ, in sentences.
    """

    results: tuple[Result, Result]
    parameters: tuple[str, ...]
    ranges: tuple[float, ...]
    measures: tuple[str, ...]
    pairs: tuple[Pair, ...]
    only: tuple[tuple[str, ...], tuple[str, ...]]
    notes: tuple[str, ...] = ()

    @property
    def largest(self) -> float:
        """The largest distance between curves that both have, as a share of the ranges."""
        return max((pair.largest for pair in self.pairs), default=0.0)

    @property
    def largest_shift(self) -> float:
        """The largest difference in the location of a special point, as a share of the parameter's range."""
        return max((pair.largest_shift for pair in self.pairs), default=0.0)

    def within(self, tolerance: float) -> bool:
        """Whether all that one has the other has too, within a tolerance (a share of the ranges)."""
        return not any(self.only) and all(pair.within(tolerance) for pair in self.pairs)

    def __str__(self) -> str:
        lines = [line for pair in self.pairs for line in _pair_lines(pair, self.parameters)]
        for which, names in zip(("first", "second"), self.only, strict=True):
            lines += [f"only in the {which}: {name}" for name in names]
        return "\n".join([*self.notes, *lines])


def place_words(parameters: Sequence[str], values: Sequence[float]) -> str:
    """Where something is: ``frequency = 0.61909789``."""
    return ", ".join(f"{name} = {value:.8g}" for name, value in zip(parameters, values, strict=False))


def _pair_lines(pair: Pair, parameters: tuple[str, ...]) -> list[str]:
    """What there is to say of a pair, line by line."""
    name = pair.names[0] if pair.names[0] == pair.names[1] else " and ".join(pair.names)
    lines = [f"{name}: largest distance {pair.largest:.3g} of the ranges, at {place_words(parameters, pair.worst)}"]
    if pair.missing > 0.0:
        ranges = ", ".join(f"{low:.8g} to {high:.8g}" for low, high in pair.covered)
        lines.append(f"  the first and the second cover {parameters[0]} from {ranges.replace(', ', ' and from ')}")
    for shift in pair.shifts:
        differences = ", ".join(f"{difference:+.3g}" for difference in shift.differences)
        lines.append(f"  {shift.label} at {place_words(parameters, shift.first)}: {differences}")
    for which, alone in zip(("first", "second"), pair.only, strict=True):
        lines += [f"  only in the {which}: {each.label} at {place_words(parameters, each.values)}" for each in alone]
    return lines

"""The record of a map: the loci in the plane of two parameters, and the sections on which they were picked up."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from gapwalk.bifurcation.branch import Branch, Kind
from gapwalk.bifurcation.loci import Locus
from gapwalk.notebook.shown import Shown
from gapwalk.studies.map.options import KINDS

Ranges = tuple[tuple[float, float], tuple[float, float]]
"""The ranges of both parameters."""


@dataclass(frozen=True, eq=False)
class Section:
    """The branches along the first parameter at one value of the second.

    Attributes
    ----------
    value
        Value of the second parameter.
    branches
        The branches; none if no first orbit was found.
    """

    value: float
    branches: tuple[Branch, ...]

    @property
    def named(self) -> Iterator[tuple[str, Branch]]:
        """The branches with their names, such as ``P2-3``: the third branch of period 2 on this section."""
        counts: Counter[int] = Counter()
        for branch in self.branches:
            counts[branch.period] += 1
            yield f"P{branch.period}-{counts[branch.period]}", branch


@dataclass(frozen=True, eq=False)
class Map(Shown):
    """The loci in the plane of two parameters.

    Attributes
    ----------
    first, second
        Names of the parameters.
    within
        The range of each.
    loci
        The loci, in the order in which they were found.
    sections
        The sections whose special points began them.
    complete
        False if the work was stopped before its end.
    notes
        What else there is to say, in sentences.
    failures
        What could not be followed, in sentences.
    tried
        How many of the special points of the sections have been dealt with: a map that is resumed goes on there.
    """

    first: str
    second: str
    within: Ranges
    loci: tuple[Locus, ...] = ()
    sections: tuple[Section, ...] = ()
    complete: bool = False
    notes: tuple[str, ...] = ()
    failures: tuple[str, ...] = ()
    tried: int = 0

    @property
    def branches(self) -> tuple[Branch, ...]:
        """The branches of all sections."""
        return tuple(branch for section in self.sections for branch in section.branches)

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the loci, such as ``fold-3``: the third locus of folds."""
        counts: Counter[Kind] = Counter()
        names = []
        for locus in self.loci:
            counts[locus.kind] += 1
            names.append(f"{locus.kind.value}-{counts[locus.kind]}")
        return tuple(names)

    def of_kind(self, kind: Kind | str) -> tuple[Locus, ...]:
        """The loci of one kind."""
        return tuple(locus for locus in self.loci if locus.kind == kind)

    def plot(self, **options: Any):
        """Draw all loci in the plane; `options` are those of `gapwalk.plot.loci.draw_map`. Returns the axes."""
        from gapwalk.plot import draw

        return draw(self, **options)

    def __getitem__(self, name: str) -> Locus:
        """The locus of a name."""
        try:
            return self.loci[self.names.index(name)]
        except ValueError:
            raise KeyError(f"there is no locus {name}; there are {', '.join(self.names) or 'none'}") from None

    def __repr__(self) -> str:
        counts = ", ".join(f"{len(self.of_kind(kind))} of {kind.value}" for kind in KINDS if self.of_kind(kind))
        return f"Map({self.first}, {self.second}; loci: {counts or 'none'})"

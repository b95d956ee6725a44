"""The study of basins along a parameter: at each of some values, the share of random starts of each motion."""

from __future__ import annotations

from collections import Counter
from collections.abc import Generator, Mapping
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import Annotated, Any, ClassVar, NamedTuple

import numpy as np
from annotated_types import Ge, Gt, Le, Lt
from numpy.typing import NDArray
from pydantic import Field

from gapwalk.attractors.basins import IMPOSSIBLE, Box
from gapwalk.model.bounds import Counted, Natural
from gapwalk.model.system import System
from gapwalk.model.words import parameter_symbol
from gapwalk.notebook import Shown
from gapwalk.picture_parts import Parts, Picture, Series, pictured
from gapwalk.results.codec import plain
from gapwalk.results.result_file import Part
from gapwalk.studies.basin_study import basin_shares
from gapwalk.studies.options import RangeStudy
from gapwalk.studies.study_kind import Found, Job
from gapwalk.summary import Rows, SummaryParts, Table, TableRows, Tables, summarizes

SHARE = "share of the starts"
_LOOKS = ("first", "second", "third", "fourth")


class SharesAt(NamedTuple):
    """One part: how many starts lead to each motion at one value."""

    value: float
    kinds: tuple[str, ...]
    """``period 1``, ``chaotic``, ``diverges``, ..."""
    counts: tuple[int, ...]
    places: NDArray[np.float64]
    """Shape (motions, 2 state_size): mean and range of the strobes of each motion, relative to the scales of states: by
    these it is known at the next value."""


@dataclass(frozen=True, eq=False, repr=False)
class ShareCurve(Shown):
    """Shares of a box of initial states that lead to each motion, over a parameter."""

    system: System  #: The system.
    parameter: str  #: The parameter.
    starts: int  #: Number of random starts at each value.
    confidence: float  #: Confidence level of the limits, for each share separately.
    parts: tuple[SharesAt, ...]  #: What was found at each value.
    complete: bool = True  #: False if it was stopped before its end.

    @cached_property
    def values(self) -> NDArray[np.float64]:
        """Shape (values,): values of the parameter, in increasing order."""
        return np.array([each.value for each in self._sorted])

    @cached_property
    def counts(self) -> dict[str, NDArray[np.int_]]:
        """Number of starts that lead to each motion at each value; a motion is the nearest one of the value before."""
        found = dict[tuple[str, int], NDArray[np.int_]]()
        latest = dict[tuple[str, int], NDArray[np.float64]]()
        for number, part in enumerate(self._sorted):
            pairs = [
                (float(np.linalg.norm(part.places[own] - place)), own, key)
                for own, kind in enumerate(part.kinds)
                for key, place in latest.items()
                if key[0] == kind
            ]
            named = dict[int, tuple[str, int]]()
            for _, own, key in sorted(pairs):
                if own not in named and key not in named.values():
                    named[own] = key
            for own, kind in enumerate(part.kinds):
                key = named.get(own) or (kind, sum(each[0] == kind for each in found))
                found.setdefault(key, np.zeros(len(self.parts), dtype=int))[number] = part.counts[own]
                latest[key] = part.places[own]
        several = Counter(kind for kind, _ in found)
        return {f"{kind}{chr(97 + place) if several[kind] > 1 else ''}": found[kind, place] for kind, place in found}

    @property
    def _sorted(self) -> list[SharesAt]:
        return sorted(self.parts, key=lambda each: each.value)

    def limits(self, counts: NDArray[np.int_]) -> NDArray[np.float64]:
        """Return the confidence limits of shares with some counts, shape (2, values), as `gapwalk.basin_shares` has."""
        from scipy.stats import binomtest  # imported late: it takes long

        tests = (binomtest(count, self.starts) for count in counts.tolist())
        return np.array([test.proportion_ci(self.confidence, method="exact") for test in tests], dtype=float).T

    @summarizes
    def summary(self, *, notes: bool = True) -> SummaryParts:
        """Return the shares of each motion at each value."""
        yield f"{self.starts} random starts at each of {len(self.values)} values; limits of {self.confidence:.0%}"
        cells = [[f"{value:.6g}"] for value in self.values]
        for counts in self.counts.values():
            low, high = self.limits(counts)
            for row, count, a, b in zip(cells, counts, low, high, strict=True):
                row.append(f"{count / self.starts:.1%} ({a:.1%} to {b:.1%})" if count else "")
        symbol = parameter_symbol(self.parameter, self.system.units)
        yield Table([f">{symbol}", *(f">{name}" for name in self.counts)], cells)
        if any(name.endswith("b") and f"{name[:-1]}a" in self.counts for name in self.counts):
            yield "a motion is named as the nearest one of its kind at the previous value; more points make this safer"

    def tables(self) -> Tables:
        """Return the shares with their limits."""
        return {"shares": TableRows(self._rows)}

    def _rows(self) -> Rows:
        yield [self.parameter, "leads.to", "starts", "share", "low", "high"]
        for name, counts in self.counts.items():
            for value, count, low, high in zip(self.values, counts, *self.limits(counts), strict=True):
                yield [float(value), name, int(count), count / self.starts, float(low), float(high)]

    def __repr__(self) -> str:
        return f"ShareCurve({self.parameter}, {len(self.values)} values, {', '.join(self.counts)})"


@pictured(ShareCurve, size=(8.0, 4.6), forms=("axes",))
def share_picture(found: ShareCurve) -> Picture:
    """Describe the shares as areas, one on another, with the limits of their sums."""
    axes = found.parameter, SHARE

    def parts() -> Parts:
        layers, total = list[Series](), np.zeros(len(found.values), dtype=int)
        for number, (name, counts) in enumerate(found.counts.items()):
            look, below, total = _LOOKS[number % len(_LOOKS)], total, total + counts
            layers.append(
                Series(found.values, [below / found.starts, total / found.starts], "between", look, name, axes=axes)
            )  # type: ignore
            if number + 1 < len(found.counts):
                layers += [Series(found.values, each, "line", "run", axes=axes) for each in found.limits(total)]
        within = {SHARE: (0.0, 1.0), found.parameter: (found.values[0], found.values[-1])}
        return Parts(layers=layers, within=within, quantities=[SHARE])

    note = f"grey: limits of {found.confidence:.0%}"
    return Picture(
        found.system, axes, (), parts, words=("", SHARE), note=note, sentences=[str(next(iter(found.summary())))]
    )


SHARES = Part("shares at a value", SharesAt, numbered=True)


@dataclass(frozen=True)
class ShareStudy(RangeStudy):
    """Shares of a box of initial states that lead to each motion, at values of a parameter, coarse to fine.

    Examples
    --------
    >>> found = gw.analysis.shares(system, "frequency", (1.1, 1.5), {"x": (-2, 1)}, points=3, starts=20)
    >>> len(found.values)
    3
    """

    kind: ClassVar[str] = "shares"
    stored: ClassVar[tuple[Part, ...]] = (SHARES,)
    answer: ClassVar[Part | None] = Part("shares", ShareCurve)
    arguments: ClassVar[tuple[str, ...]] = ("parameter", "to", "box")

    #: Ranges of components of the state at theta = 0; those that are not named are 0.
    box: Annotated[
        Mapping[str, tuple[float, float]],
        Field(description="write the ranges of the starts, as in box = { x = [-2, 2] }"),
    ] = field(kw_only=True)
    points: Annotated[int, Ge(2), Le(10_000)] = 17  #: Number of values.
    starts: Counted = 200  #: Number of random starts at each value.
    confidence: Annotated[float, Gt(0.0), Lt(1.0)] = 0.95  #: Probability with which the limits of a share hold.
    seed: Natural = 0  #: Seed of the random starts.
    #: Number of processes; by default one for each local core. The result does not depend on it.
    workers: Counted | None = field(default=None, compare=False)

    @property
    def plan(self) -> str:
        """Describe the work to be done, in one line."""
        return f"shares of basins over {self.range_words} at {self.points} values"

    def refuse_invalid(self, system: System) -> None:
        """Refuse a box of other components, and a range that no system can have."""
        Box.of(system, self.box)
        super().refuse_invalid(system)

    def do(self, job: Job) -> Generator[Found]:
        """Find the shares at each value, those in the middle of the widest gaps first."""
        values = np.linspace(self.begin, self.end, self.points).tolist()
        stride, order = 1 << (self.points - 1).bit_length(), dict[int, float]()
        while stride:
            order |= {number: values[number] for number in range(0, self.points, stride) if number not in order}
            stride //= 2
        yield from job.each(SHARES, partial(_shares_at, job.system, self), order)
        yield job.end(self.so_far(job, complete=True))

    def so_far(self, job: Job, complete: bool = False) -> ShareCurve:
        """Return the shares at the values that are done."""
        return ShareCurve(job.system, self.parameter, self.starts, self.confidence, tuple(job.all(SHARES)), complete)

    def total(self, job: Job) -> int:
        """Return the number of parts."""
        return self.points + 1

    def document(self, found: ShareCurve, points: bool) -> dict[str, Any]:
        """Return the shares and their limits as JSON values."""
        shares = {
            name: {"share": plain(counts / found.starts), "limits": plain(found.limits(counts))}
            for name, counts in found.counts.items()
        }
        return {"parameter": found.parameter, "values": plain(found.values), "starts": found.starts, "shares": shares}


def _shares_at(system: System, asked: ShareStudy, value: float) -> SharesAt:
    """Return the shares at one value."""
    at = system.at({asked.parameter: value})
    found = basin_shares(at, asked.box, asked.starts, seed=asked.seed, check=0, exact_borders=False, workers=1)
    kinds = [f"period {each.period}" if each.orbit else each.kind.value for each in found.attractors]
    tracks = [each.strobes for each in found.attractors]
    counts = [int((found.labels == label).sum()) for label in range(len(kinds))]
    for label, name in ((-1, "unresolved"), (-2, "diverges"), (IMPOSSIBLE, "beyond a rigid stop")):
        if (found.labels == label).any():
            kinds, counts, tracks = (
                [*kinds, name],
                [*counts, int((found.labels == label).sum())],
                [*tracks, np.zeros((1, at.state_size))],
            )
    scales = at.state_scales()
    places = np.array([np.concatenate((each.mean(axis=0) / scales, np.ptp(each, axis=0) / scales)) for each in tracks])
    return SharesAt(value, tuple(kinds), tuple(counts), places)

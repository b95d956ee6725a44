"""Record of a branch: its points, its ends, and its special points."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.bifurcation.band import Band, band_rows, graze_words
from gapwalk.bifurcation.special_point import Kind, SpecialPoint, in_runs, words_of
from gapwalk.continuation.curve import Curve, Measured
from gapwalk.continuation.curve_points import BranchPoint, motion_row, point_row
from gapwalk.continuation.walk import End, EndReason
from gapwalk.errors import ModelError
from gapwalk.model.system import System
from gapwalk.model.words import parameter_symbol, told_apart
from gapwalk.orbit.floquet import Instability
from gapwalk.orbit.orbit import Orbit
from gapwalk.summary import Rows, SummaryParts, Table, Tables, row_of, rows_of, summarizes

if TYPE_CHECKING:
    import pandas


def instabilities_along(points: Sequence[BranchPoint]) -> list[Instability]:
    """Return the unstable multipliers at each point; a single neutral point has those of its neighbour."""
    found = [point.instability for point in points]
    for number, each in enumerate(found):
        beside = [*found[max(number - 1, 0) : number], *found[number + 1 : number + 2]]
        if each.label == "neutral" and beside and all(other.label != "neutral" for other in beside):
            found[number] = beside[0]
    return found


@dataclass(frozen=True)
class Unexplained:
    """Step of a branch whose changes are not accounted for by its special points: one was missed there."""

    #: first, last: Values of the parameter at the points before and after it.
    first: float
    last: float
    text: str  #: Description of the change, as a sentence.

    def __str__(self) -> str:
        return f"between {self.first:.10g} and {self.last:.10g}: {self.text}"


_AXIS = re.compile(r"(distance from|above|below) (?:(\S+) ([1-9]\d*)|(\S+))")


class Distance(NamedTuple):
    """Distance from a value of a parameter, an axis of pictures."""

    value: float
    side: int
    """1 above, -1 below, 0 for both."""
    least: float
    """Error of the value: nearer points have no distance."""

    @classmethod
    def of(cls, branches: Sequence[Branch], text: str) -> Distance:
        """Read ``above grazing 1``, ``below fold 2`` or ``distance from 0.8``; special points are counted along all."""
        read, found = _AXIS.fullmatch(text), list[tuple[float, float]]()
        if read and read[4]:
            with suppress(ValueError):  # neither a number nor a special point
                found = [(float(read[4]), 0.0)]
        elif read:
            found = [(each.value, each.uncertainty) for branch in branches for each in branch.special(read[2])]
        place = int(read[3] or 1) - 1 if read else 0
        if place >= len(found):
            kinds = [each.kind for branch in branches for each in branch.special_points]
            known = (
                ", ".join(f"{kind} {kinds[: n + 1].count(kind)}" for n, kind in enumerate(kinds)) or "no special points"
            )
            raise ModelError(
                f'x = {text!r} is no distance here: write "above grazing 1", "below fold 2" or "distance from 0.8"; '
                f"there are {known}"
            )
        assert read
        value, least = found[place]
        return cls(value, {"above": 1, "below": -1}.get(read[1], 0), max(least, 1e-15 * abs(value)))

    def __call__(self, values: Any) -> NDArray[np.float64]:
        """Return the distances of values; nan on the other side and within the error."""
        away = (np.asarray(values) - self.value) * self.side if self.side else np.abs(np.asarray(values) - self.value)
        return np.where(away > self.least, away, np.nan)


@dataclass(frozen=True, eq=False)
class Branch(Curve, Measured):
    """Branch of orbits along one parameter.

    Examples
    --------
    >>> branch.values[[0, -1]], len(branch.special("fold"))
    (array([0.6, 1.6]), 2)
    >>> branch.measure("max.x").shape == branch.values.shape
    True
    """

    parameter: str  #: Name of the parameter that varies.
    period: int  #: m, number of forcing periods of the orbits.
    points: tuple[BranchPoint, ...]  #: The orbits in the order of the walk; none where only motions settle.
    special_points: tuple[SpecialPoint, ...]  #: Special points in the order of the walk.
    ends: tuple[End, ...]  #: Ends of the branch with their reasons, at its first and at its last point.
    #: Settled motions at steps of the parameter, where grazes are so many that no orbit is followed. If a response has
    #: several stretches, the first holds those of all.
    bands: tuple[Band, ...] = field(default=(), metadata={"stored": False})
    #: Further stretches of the response beyond such motions; `gapwalk.studies.Result.branches` has all stretches.
    beyond: tuple[Branch, ...] = field(default=(), metadata={"stored": False})
    #: System of the settled motions, if there is no orbit.
    base: System | None = field(default=None, metadata={"stored": False})

    def _check_read(self) -> None:
        """Raise a ValueError if its parts do not fit together."""
        if not (self.points or self.bands) or len(self.ends) != 2 or self.period < 1:
            raise ValueError("a branch has no points, or no ends")
        for point in (*self.points, *(special.point for special in self.special_points)):
            if point.orbit.period != self.period or point.orbit.system[self.parameter] != point.value:
                raise ValueError("a point does not belong to its branch")

    @property
    def system(self) -> System:
        """System at the first point."""
        return self.points[0].orbit.system if self.base is None else self.base

    @property
    def closed(self) -> bool:
        """True if the branch closes on itself: an isolated branch (isola), connected to no other branch."""
        return self.ends[-1].reason is EndReason.CLOSED

    @cached_property
    def unexplained(self) -> tuple[Unexplained, ...]:
        """Steps of the walk with a change that their special points do not explain, so that a point was missed.

        The changes are in the number of unstable multipliers, the direction of the branch, the sign of the Jacobian's
        determinant, or the number of closings of a contact. The tuple is empty if no point was missed.
        """
        from gapwalk.bifurcation.detector import unexplained_of

        return unexplained_of(self)

    @cached_property
    def instabilities(self) -> tuple[Instability, ...]:
        """Unstable multipliers at each point; a single neutral point, such as an end, has those of its neighbour."""
        return tuple(instabilities_along(self.points))

    def basins(self, box: Mapping[str, tuple[float, float]], **options: Any) -> Any:
        """Return which share of starts in a box leads to each motion of the branch; see `gapwalk.analysis.shares`."""
        from gapwalk.studies.functions import shares

        return shares(self.system, self.parameter, (float(min(self.values)), float(max(self.values))), box, **options)

    def live(self, parameter: str, to: tuple[float, float], measure: str = "half") -> Any:
        """Draw the branch above a slider for another parameter. Notebooks need ``%matplotlib widget``."""
        # At each step of the slider the points of a quick walk are moved; at rest the branch is followed again.
        from gapwalk.plot.live_slider import live_slider

        return live_slider(self, parameter, to, measure)

    def special(self, kind: Kind | str) -> tuple[SpecialPoint, ...]:
        """Return the special points of one kind, which may be given by its name, such as ``fold``."""
        found = tuple(special for special in self.special_points if special.kind == kind)
        if not found and not isinstance(kind, Kind):
            Kind.named(kind)  # raises an error at a name that is none
        return found

    def distances(self, place: str) -> NDArray[np.float64]:
        """Return how far each point lies beyond a special point, as in ``above fold 1``; nan for points below it."""
        # It may also be "below grazing 2", "distance from fold 1" (both sides), or a value: "above 0.85".
        return Distance.of([self], place)(self.values)

    def orbits_at(self, value: float) -> list[Orbit]:
        """Return all orbits of the branch at a value of its parameter, each corrected by Newton's method there."""
        from gapwalk.bifurcation.orbit_on_branch import Curve as Line  # it reads branches

        return Line(self).orbits_at(value)

    @summarizes
    def summary(self, points: bool = True) -> SummaryParts:
        """Return the branch's range, numbers of points and ends, and, unless `points` is False, its special points."""
        if not self.points:
            yield f"no orbit of period {self.period} can be followed; settled motions are given instead"
            yield from graze_words(self.bands, self.parameter, self.system)
            return
        symbol = parameter_symbol(self.parameter, self.system.units)
        first, last = told_apart(float(self.values[0]), float(self.values[-1]), 10)
        low, high = self.values.min(), self.values.max()
        least = 1e-6 * (high - low) if self.ends[-1].reason is not EndReason.CENTRE else np.inf
        ends = self.values[[0, -1]]
        beyond = [each for each in (low, high) if np.abs(ends - each).min() > least]
        by = f" by way of {' and '.join(f'{each:.10g}' for each in beyond)}" if beyond else ""
        yield f"period-{self.period} motions over {symbol} from {first}{by} to {last}: {self.counts}"
        for end in self.ends:
            yield f"  {symbol} = {end.value:.10g}: {end.reason_words}"
        yield from graze_words(self.bands, self.parameter, self.system)
        if points and self.special_points:
            rows = [words_of(group) for group in in_runs(self.special_points)]
            yield Table(list(rows[0]), [list(row.values()) for row in rows])

    @property
    def counts(self) -> str:
        """Numbers of points, of stable points and of special points, in words."""
        stable = sum(each.label == "stable" for each in self.instabilities)
        kinds = ", ".join(f"{len(self.special(kind))} {kind.value}" for kind in Kind.known() if self.special(kind))
        neutral = sum(each.label == "neutral" for each in self.instabilities)
        states = f"{stable} of them stable{f', {neutral} neutral' if neutral else ''}"
        return f"{len(self.points)} points, {states}; {kinds or 'no special points'}"

    def to_dataframe(self, *measures: str) -> pandas.DataFrame:
        """Return the points as a pandas DataFrame: parameter, stability, contacts, and measures of each coordinate.

        Needs pandas (``pip install gapwalk[dataframe]``).
        """
        import pandas as pd

        names = measures or tuple(f"{kind}.{q}" for q in self.system.coordinates for kind in ("half", "max", "min"))
        columns: dict[str, Any] = {self.parameter: self.values}
        columns["stable"] = [point.stable for point in self.points]
        columns["instability"] = [point.instability.label for point in self.points]
        columns["contacts"] = [point.orbit.pattern for point in self.points]
        columns["z"] = [point.orbit.z for point in self.points]
        columns.update({name: self.measure(name) for name in names})
        return pd.DataFrame(columns)

    def tables(self) -> Tables:
        """Return the tables ``points`` and ``special-points``, with measures, states and multipliers, and ``ends``."""
        found = {"points": self.points, "special-points": self.special_points}
        tables: Tables = {name: partial(_rows, points) for name, points in found.items() if points}
        if self.bands:
            bands = partial(band_rows, self.bands, self.parameter, self.system)
            tables = {**tables, "bands": lambda: rows_of(bands())}
        return {**tables, "ends": lambda: rows_of(map(row_of, self.ends))}

    def __repr__(self) -> str:
        kinds = ", ".join(f"{len(self.special(kind))} {kind}" for kind in Kind.known() if self.special(kind))
        return (
            f"Branch(period {self.period}, {self.parameter} {self.ends[0].value:.6g} ... "
            f"{self.ends[-1].value:.6g}, {len(self.points)} points, {kinds or 'no special points'})"
        )


def _rows(points: tuple[BranchPoint | SpecialPoint, ...]) -> Rows:
    return rows_of({**point_row(point), **motion_row(point.orbit)} for point in points)


def named_by_period(branches: Iterable[Branch]) -> Iterator[tuple[str, Branch]]:
    """Yield branches with their names, such as ``P2-1``: the first branch of period 2."""
    counts: Counter[int] = Counter()
    for branch in branches:
        counts[branch.period] += 1
        yield f"P{branch.period}-{counts[branch.period]}", branch

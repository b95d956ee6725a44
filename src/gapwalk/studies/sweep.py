"""Record and options of a sweep: settled motions over a parameter, sampled once every forcing period."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from itertools import groupby
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from gapwalk.errors import ModelError
from gapwalk.model.system import System
from gapwalk.notebook import Shown
from gapwalk.orbit.measures import parameter_headings
from gapwalk.studies.study_registry import INLINE, Counted, check_integers
from gapwalk.summary import Rows, Tables

_MOST = 100_000_000  # states that are kept


class Way(StrEnum):
    """Order in which the values are visited.

    Examples
    --------
    >>> [way.value for way in gw.studies.Way]
    ['up', 'down', 'again']
    """

    UP = "up"
    """From the lowest to the highest, the state carried over."""
    DOWN = "down"
    """From the highest to the lowest, the state carried over."""
    AGAIN = "again"
    """At each value from the start again."""

    @classmethod
    def _missing_(cls, value: object) -> Way | None:
        """Read its earlier name, which older files have."""
        return cls.AGAIN if value == "afresh" else None

    @property
    def number(self) -> int:
        """A fixed number of this order, which does not depend on the other orders used."""
        return list(Way).index(self)


@dataclass(frozen=True, slots=True)
class Patience:
    """Limits on the length of a transient.

    Examples
    --------
    >>> gw.studies.Patience(shortest=20, longest=500).longest
    500
    """

    #: shortest, longest: Least and largest number of forcing periods.
    shortest: int = 48
    longest: int = 2000
    #: Distance from the limiting periodic motion below which it has settled; in half-widths of the box of states.
    tolerance: float = 1e-6

    def __post_init__(self) -> None:
        check_integers(self, shortest=1, longest=1)
        if self.longest < self.shortest:
            raise ModelError(f"longest is {self.longest}; it must be at least {self.shortest}, the shortest transient")
        if not 1e-12 <= self.tolerance <= 1e-2:
            raise ModelError(f"tolerance is {self.tolerance!r}; it must lie between 1e-12 and 1e-2 (half-widths)")


@dataclass(frozen=True, slots=True)
class SweepOptions:
    """Options of a sweep.

    Examples
    --------
    >>> gw.SweepOptions(steps=9, ways="up", points=13).each_way()
    (<Way.UP: 'up'>,)
    """

    steps: int = 500  #: Number of values, spread evenly over the range, both ends included.
    #: ``"up and down"``, ``"up"``, ``"down"``, or ``"again"``: each value begins from the starts. Any of them may be
    #: joined by "and".
    ways: str = "up and down"
    points: int = 100  #: Section points at each value: states a forcing period apart, once the transient has settled.
    #: Number of starts: the first one is rest, the others are spread over the box of states. Or the states themselves,
    #: one of 2n numbers each, or more with extensions.
    starts: int | tuple[tuple[float, ...], ...] = 1
    seed: int = 0  #: Seed of the starts and of the kicks: the same seed gives the same result.
    #: Longest period, in forcing periods, that is distinguished from a motion that is not periodic.
    max_period: int = 12
    patience: Annotated[Patience, INLINE] = Patience()  #: Limits on the length of the transient at each value.
    #: Size of a random disturbance at each value, in half-widths of the box of states. Like the noise in a test rig, it
    #: prevents motions from staying on an unstable orbit. 0: none.
    kick: float = 1e-7
    #: Number of processes; by default one for each local core. The result does not depend on it.
    workers: Counted | None = field(default=None, compare=False)

    def __post_init__(self) -> None:
        check_integers(self, steps=2, points=2, seed=0, max_period=1)
        if isinstance(self.starts, int) and (isinstance(self.starts, bool) or self.starts < 1):
            raise ModelError(f"starts is {self.starts!r}; it must be an integer >= 1, or a list of states")
        starts = self.starts if isinstance(self.starts, int) else len(self.starts)
        if (states := self.steps * self.points * starts) > _MOST:
            raise ModelError(
                f"steps is {self.steps:,}, with {self.points:,} points from {starts:,} starts: that makes {states:,} "
                f"states; {_MOST:,} can be kept"
            )
        if not self.starts:
            raise ModelError("starts is empty; give at least one state, or the number of starts")
        if self.points <= self.max_period:
            raise ModelError(
                f"points is {self.points}; it must be more than max_period, {self.max_period}, so that a return is seen"
            )
        if not 0.0 <= self.kick <= 1e-2:
            raise ModelError(
                f"kick is {self.kick!r}; it must lie between 0 and 1e-2 (half-widths of the box of states)"
            )
        self.each_way()

    def each_way(self) -> tuple[Way, ...]:
        """Return the ways, in the order in which they are written."""
        words = [word.strip() for word in self.ways.split(" and ")]
        words = [str(Way.AGAIN) if word == "afresh" else word for word in words]  # as older files say
        if not set(words) <= set(Way) or len(set(words)) < len(words):
            raise ModelError(
                f'ways is {self.ways!r}; write "up and down", "up", "down" or "again", or several joined by "and"'
            )
        return tuple(Way(word) for word in words)


BLOCK = 20
"""Values in a segment: one piece of work, and what a killed run loses at most of each lane."""


@dataclass(frozen=True, eq=False)
class Lane:
    """One start of a sweep, with one order of the values.

    Examples
    --------
    >>> lane = sweep.lanes[0]
    >>> lane.way, lane.start, lane.is_carried
    (<Way.UP: 'up'>, 1, True)
    """

    way: Way  #: Order in which the values are visited.
    start: int  #: Number of the start, from 1.
    state: NDArray[np.float64]  #: shape (state_size,): The start.

    @property
    def is_carried(self) -> bool:
        """True if the state is carried over from one value to the next; otherwise each begins at the start."""
        return self.way is not Way.AGAIN

    def __repr__(self) -> str:
        return f"Lane({self.way}, start {self.start})"


@dataclass(frozen=True, eq=False)
class SweepSegment:
    """Motions at the values of a segment, in the order in which they were visited."""

    #: lane, number: Index of the lane in the sweep, and of the segment in the lane.
    lane: int
    number: int
    #: shape (count, points, state_size): States a forcing period apart; nan where the motion has diverged, and later if
    #: the state is carried over.
    sections: NDArray[np.float64]
    transients: NDArray[np.intp]  #: shape (count,): Forcing periods before the section points.
    settled: NDArray[np.bool_]  #: shape (count,), bool: True if the transient had settled.
    regimes: tuple[str, ...]  #: Regimes in words; empty where there are no points.
    note: str = ""  #: Reason why it ended before its last value; empty if it did not.

    @property
    def last(self) -> NDArray[np.float64]:
        """The state with which the next segment continues, shape (state_size,)."""
        return self.sections[-1, -1]


@dataclass(frozen=True, slots=True)
class Band:
    """A range of the parameter in which the regime is the same.

    Examples
    --------
    >>> band = sweep.bands()[0]
    >>> band.regime, round(band.low, 3), round(band.high, 3)
    ('period 1', 0.6, 0.725)
    """

    regime: str  #: In words, such as ``period 3``.
    #: low, high: Its ends, halfway to the next values of another regime.
    low: float
    high: float
    count: int  #: Number of values in it.


def bands_of(values: NDArray[np.float64], regimes: Sequence[str]) -> tuple[Band, ...]:
    """Return the bands of equal regimes along increasing values; empty regimes belong to no band."""
    edges = np.concatenate((values[:1], 0.5 * (values[1:] + values[:-1]), values[-1:]))
    bands, first = [], 0
    for regime, group in groupby(regimes):
        count = len(list(group))
        if regime:
            bands.append(Band(regime, float(edges[first]), float(edges[first + count]), count))
        first += count
    return tuple(bands)


@dataclass(frozen=True, eq=False)
class Sweep(Shown):
    """The settled motions over a parameter.

    Examples
    --------
    >>> sweep.values.shape, [band.regime for band in sweep.bands(lane=0)]
    ((9,), ['period 1', 'period 2', 'period 1'])
    """

    system: System  #: The system; its own value of the parameter plays no role.
    parameter: str  #: Name of the parameter.
    values: NDArray[np.float64]  #: shape (steps,): Its values, increasing.
    lanes: tuple[Lane, ...]  #: The starts and orders of values, in the order of the first axis of the arrays below.
    #: shape (lanes, steps, points, state_size): The states at the start of forcing periods, one after the other; nan
    #: where there is nothing.
    sections: NDArray[np.float64]
    transients: NDArray[np.intp]  #: shape (lanes, steps): Forcing periods before the section points.
    #: shape (lanes, steps), bool: True if the transient had settled; False if it reached its longest length.
    settled: NDArray[np.bool_]
    #: shape (lanes, steps), str: Regime of each motion in words: ``period 3``, ``quasi-periodic``, ``chaotic``,
    #: ``undecided``, ``diverges``, or ``not periodic`` where no more can be said of a large system; empty where there
    #: is nothing.
    regimes: NDArray[np.str_]
    complete: bool = False  #: False if the work was stopped before its end.
    notes: tuple[str, ...] = ()  #: Failures: what could not be done, in sentences.

    def bands(self, lane: int = 0) -> tuple[Band, ...]:
        """Return the bands of equal regimes along a lane, in the order of the parameter."""
        return bands_of(self.values, self.regimes[lane].tolist())

    def section(self, coordinate: str | None = None, lane: int | None = None) -> tuple[NDArray[Any], NDArray[Any]]:
        """Return all section points of a coordinate or of its velocity: the values of the parameter, and its own.

        Parameters
        ----------
        coordinate
            Its name, or that with a dash for its velocity: ``q1'``. By default the first one.
        lane
            Index of the lane; by default all lanes.

        Returns
        -------
        values : array, shape (count,)
            Values of the parameter, one for each section point.
        points : array, shape (count,)
            The coordinate or velocity at each.
        """
        place = self.place(coordinate)
        sections = self.sections if lane is None else self.sections[lane : lane + 1]
        y = sections[..., place]
        x = np.broadcast_to(self.values[:, None], y.shape)
        seen = ~np.isnan(y)
        return x[seen], y[seen]

    def place(self, coordinate: str | None) -> int:
        """Return the place of a coordinate or a velocity in a state; errors as `section`.

        Parameters
        ----------
        coordinate
            Its name, or that with a dash for its velocity; None for the first one.
        """
        names = self.system.state_names
        name = names[0] if coordinate is None else coordinate
        if name not in names:
            raise ModelError(f"there is no coordinate {name!r}; there are {', '.join(names)}")
        return names.index(name)

    def tables(self) -> Tables:
        """Return the tables of section points and of the regime of each motion."""
        return {"points": self._point_rows, "regimes": self._regime_rows}

    def _point_rows(self) -> Rows:
        headings = parameter_headings([self.parameter], self.system.coordinates)
        yield ["way", "start", *headings, "point", *self.system.state_names]
        sections = self.sections.reshape(-1, *self.sections.shape[2:])
        for head, section in zip(self._heads(), sections, strict=True):
            for number, state in enumerate(section[~np.isnan(section[:, 0])].tolist(), start=1):
                yield [*head, number, *state]

    def _regime_rows(self) -> Rows:
        names = self.system.coordinates
        yield ["way", "start", *parameter_headings([self.parameter], names), "regime", "transient", "settled"]
        flat = (self.regimes.ravel(), self.transients.ravel(), self.settled.ravel())
        for head, regime, transient, settled in zip(self._heads(), *(part.tolist() for part in flat), strict=True):
            yield [*head, regime, transient, settled]

    def _heads(self) -> Iterator[tuple[object, ...]]:
        values = self.values.tolist()
        return ((lane.way.value, lane.start, value) for lane in self.lanes for value in values)

    def __repr__(self) -> str:
        low, high = self.values[0], self.values[-1]
        seen = int(np.count_nonzero(self.regimes != ""))
        state = "complete" if self.complete else f"{seen} of {self.regimes.size} values"
        return f"Sweep({self.parameter} from {low:g} to {high:g}, {len(self.lanes)} lanes, {state})"


def blank_sweep(
    system: System, parameter: str, values: NDArray[np.float64], lanes: tuple[Lane, ...], points: int
) -> Sweep:
    """Return a sweep in which nothing has been done yet; `enter` fills its arrays."""
    count, steps, size = len(lanes), len(values), system.state_size
    return Sweep(
        system,
        parameter,
        values,
        lanes,
        np.full((count, steps, points, size), np.nan),
        np.zeros((count, steps), dtype=np.intp),
        np.zeros((count, steps), dtype=bool),
        np.full((count, steps), "", dtype="<U16"),
    )


def enter(sweep: Sweep, segment: SweepSegment) -> str:
    """Write a segment into the arrays of a sweep; return a sentence on a failure, or an empty text.

    This keeps only one copy of the section points in memory.
    """
    lane = sweep.lanes[segment.lane]
    places = places_of(lane.way, len(sweep.values), segment.number)
    sweep.sections[segment.lane, places] = segment.sections
    sweep.transients[segment.lane, places] = segment.transients
    sweep.settled[segment.lane, places] = segment.settled
    sweep.regimes[segment.lane, places] = segment.regimes
    if not segment.note:
        return ""
    ends = " and was not carried on" if lane.is_carried else ""
    return f"start {lane.start}, {lane.way}: the motion could not be followed{ends}: {segment.note}"


def places_of(way: Way, steps: int, number: int) -> NDArray[np.intp]:
    """Return the places of the values of a segment, in the order in which they are visited."""
    places = np.arange(number * BLOCK, min((number + 1) * BLOCK, steps))
    return steps - 1 - places if way is Way.DOWN else places

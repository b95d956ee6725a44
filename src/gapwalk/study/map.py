"""The map: every locus that bounds a regime in the plane of two parameters."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gapwalk.bifurcation.departure import depart, directions
from gapwalk.bifurcation.follow import walk_out
from gapwalk.bifurcation.locus import Locus, follow_locus
from gapwalk.continuation.branch import Branch, Kind, SpecialPoint
from gapwalk.continuation.options import WalkOptions
from gapwalk.errors import ModelError, NumericalError
from gapwalk.model.system import System
from gapwalk.orbit.find import find_orbit
from gapwalk.orbit.identity import stroboscopic
from gapwalk.orbit.orbit import Orbit
from gapwalk.orbit.shooting import Shooting
from gapwalk.study.diagram import DiagramOptions, diagram
from gapwalk.study.workers import workers

_BESIDE = 4e-3  # distance from a locus, in widths of the ranges, within which a special point may lie on it
_ALIKE = 0.1  # relative distance of two orbits' states within which they may belong to the same locus

KINDS = (Kind.FOLD, Kind.FLIP, Kind.NEIMARK_SACKER, Kind.GRAZING)
"""The kinds of special points that have loci."""


@dataclass(frozen=True, slots=True)
class MapOptions:
    """What a map shows, and where its loci are picked up.

    Parameters
    ----------
    sections
        Number of values of the second parameter, spread evenly over its range, at which branches are followed along
        the first one: their special points are where the loci begin.
    max_period
        Longest period, in forcing periods, of the branches that are followed there.
    kinds
        Kinds of loci.
    workers
        Processes to work in; by default one for each local core. The result does not depend on it.
    """

    sections: int = 5
    max_period: int = 2
    kinds: tuple[Kind, ...] = KINDS
    workers: int | None = None

    def __post_init__(self) -> None:
        for name in ("sections", "max_period"):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, int) or value < 1:
                raise ModelError(f"{name} is {value!r}; it must be an integer >= 1")
        if not self.kinds or not set(self.kinds) <= set(KINDS):
            names = ", ".join(kind.value for kind in KINDS)
            raise ModelError(f"kinds is {[str(kind) for kind in self.kinds]}; they may be {names}")


@dataclass(frozen=True)
class Map:
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
        The branches along the first parameter whose special points began them.
    complete
        False if the work was stopped before its end.
    notes
        What could not be done, in sentences.
    """

    first: str
    second: str
    within: tuple[tuple[float, float], tuple[float, float]]
    loci: tuple[Locus, ...] = ()
    sections: tuple[Branch, ...] = ()
    complete: bool = False
    notes: tuple[str, ...] = ()

    def of_kind(self, kind: Kind | str) -> tuple[Locus, ...]:
        """The loci of one kind."""
        return tuple(locus for locus in self.loci if locus.kind == kind)

    def __repr__(self) -> str:
        counts = ", ".join(f"{len(self.of_kind(kind))} of {kind.value}" for kind in KINDS if self.of_kind(kind))
        return f"Map({self.first}, {self.second}; loci: {counts or 'none'})"


Report = Callable[[Map, Locus], None]
"""Called with the map and the locus that was added to it last."""


@dataclass(frozen=True)
class _Piece:
    """One special point to follow in two parameters."""

    special: SpecialPoint
    first: str
    second: str
    within: tuple[tuple[float, float], tuple[float, float]]
    walk: WalkOptions | None
    shooting: Shooting | None


def bifurcation_map(
    system: System,
    first: str,
    second: str,
    to: tuple[tuple[float, float], tuple[float, float]],
    *,
    start: str | Sequence[float] = "settle",
    options: MapOptions | None = None,
    walk: WalkOptions | None = None,
    shooting: Shooting | None = None,
    report: Report | None = None,
) -> Map:
    """All loci of folds, flips, Neimark-Sacker and grazing points that are met in the plane of two parameters.

    Branches are followed along the first parameter at several values of the second; each of their special points that
    is on no locus yet begins one. Ctrl-C ends the work and keeps what there is.

    Parameters
    ----------
    system
        The system.
    first, second
        Names of the parameters; the first is the one along which branches are followed.
    to
        The range of each.
    start
        Where the branches start, as in `find_orbit`, at the system's own value of the first parameter if that is in
        its range, and at the upper end otherwise.
    options, walk, shooting
        What the map shows; options of the walks and of the method.
    report
        Called with each locus as it is accepted.

    Raises
    ------
    ModelError
        For unknown or equal parameters, or empty ranges.
    """
    options = options or MapOptions()
    if first == second:
        raise ModelError(f"a map needs two different parameters, but both are {first!r}")
    ranges = (_range(system, first, to[0]), _range(system, second, to[1]))
    charter = _Charter(Map(first, second, ranges), options, walk, shooting, report)
    try:
        for value in np.linspace(*ranges[1], options.sections):
            charter.add_section(system.at({second: float(value)}), start)
            charter.add_loci(float(value))
    except KeyboardInterrupt:
        return charter.chart
    return replace(charter.chart, complete=True)


def _range(system: System, name: str, within: tuple[float, float]) -> tuple[float, float]:
    low, high = sorted((float(within[0]), float(within[1])))
    for value in (low, high):
        system.at({name: value})
    if not low < high:
        raise ModelError(f"the range of {name} is from {low:g} to {high:g}: it is empty")
    return low, high


class _Charter:
    """Draws up one map, section by section."""

    def __init__(self, empty: Map, options: MapOptions, walk, shooting, report: Report | None) -> None:
        self.chart, self.options, self.walk, self.shooting, self.report = empty, options, walk, shooting, report

    def add_section(self, system: System, start: str | Sequence[float]) -> None:
        """Follow the branches along the first parameter at one value of the second."""
        chart = self.chart
        (low, high), value = chart.within[0], system[chart.first]
        at = value if low <= value <= high else high
        try:
            orbit = find_orbit(system.at({chart.first: at}), 1, start, method=self.shooting)
            branches = self._branches_through(orbit)
        except NumericalError as error:
            self._note(f"no branch was followed at {chart.second} = {system[chart.second]:.6g}: {error}")
            return
        self.chart = replace(chart, sections=(*chart.sections, *branches))

    def add_loci(self, value: float) -> None:
        """Follow the loci that begin at the special points of the section at one value of the second parameter."""
        specials = [
            special
            for branch in self.chart.sections
            if branch.system[self.chart.second] == value
            for special in branch.special_points
            if special.kind in self.options.kinds
        ]
        pieces = [self._piece(special) for special in specials]

        def is_new(index: int) -> bool:
            known = self.chart.loci
            return not any(_lies_on_locus(locus, specials[index], value, self.chart) for locus in known)

        with workers(self.options.workers if len(pieces) > 1 else 1) as hands:
            hands.run(_follow_piece, pieces, lambda index, locus: self._accept(locus), is_new)

    def _branches_through(self, orbit: Orbit) -> tuple[Branch, ...]:
        """The branch through an orbit along the first parameter, and those that branch off from it."""
        first, within = self.chart.first, self.chart.within[0]
        if self.options.max_period == 1:
            ways = directions(orbit.system[first], within)
            return (walk_out([depart(orbit, first, within, way, self.shooting) for way in ways], self.walk),)
        tree = DiagramOptions(max_period=self.options.max_period, workers=self.options.workers)
        grown = diagram(orbit.system, first, within, start=orbit, options=tree, walk=self.walk, shooting=self.shooting)
        return grown.branches

    def _accept(self, locus: Locus | str) -> None:
        if isinstance(locus, str):
            self._note(locus)
            return
        self.chart = replace(self.chart, loci=(*self.chart.loci, locus))
        if self.report is not None:
            self.report(self.chart, locus)

    def _note(self, note: str) -> None:
        self.chart = replace(self.chart, notes=(*self.chart.notes, note))

    def _piece(self, special: SpecialPoint) -> _Piece:
        chart = self.chart
        return _Piece(special, chart.first, chart.second, chart.within, self.walk, self.shooting)


def _follow_piece(piece: _Piece) -> Locus | str:
    """Follow one locus; a sentence instead if that cannot be done."""
    try:
        return follow_locus(
            piece.special, piece.first, piece.second, piece.within, walk=piece.walk, shooting=piece.shooting
        )
    except NumericalError as error:
        kind, value = piece.special.kind.value, piece.special.value
        return f"the locus of the {kind} at {piece.first} = {value:.10g} could not be followed: {error}"


def _lies_on_locus(locus: Locus, special: SpecialPoint, value: float, chart: Map) -> bool:
    """Whether a special point is on a locus that is known: between two of its points, with an orbit like theirs."""
    if locus.kind is not special.kind or locus.period != special.orbit.period or locus.contact != special.contact:
        return False
    places = locus.values
    width = chart.within[0][1] - chart.within[0][0]
    a, b = places[:-1], places[1:]
    crosses = np.flatnonzero((a[:, 1] - value) * (b[:, 1] - value) <= 0.0)
    for k in crosses:
        rise = b[k, 1] - a[k, 1]
        share = 0.5 if rise == 0.0 else (value - a[k, 1]) / rise
        if abs(a[k, 0] + share * (b[k, 0] - a[k, 0]) - special.value) <= _BESIDE * width:
            nearest = locus.points[k] if share < 0.5 else locus.points[k + 1]
            if _are_alike(nearest.orbit, special.orbit):
                return True
    return False


def _are_alike(a: Orbit, b: Orbit) -> bool:
    """Whether two orbits of neighbouring systems may be the same motion, begun at different forcing periods perhaps."""
    states = stroboscopic(a)
    distance = float(np.abs(states - b.state).max(axis=1).min())
    return distance <= _ALIKE * (1.0 + float(np.abs(b.state).max()))

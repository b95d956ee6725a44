"""Drawing up a map: branches at some values of the second parameter, then the loci of their special points."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gapwalk.bifurcation.branch import Branch, SpecialPoint
from gapwalk.bifurcation.follow import follow
from gapwalk.bifurcation.loci import Locus, follow_locus
from gapwalk.continuation.walk_options import WalkOptions
from gapwalk.errors import Interrupted, ModelError, NumericalError
from gapwalk.flow.length_unit import magnitude
from gapwalk.model.system import System
from gapwalk.notebook import shows_progress
from gapwalk.orbit.find import find_orbit
from gapwalk.orbit.method import Method
from gapwalk.orbit.orbit import Orbit, phases
from gapwalk.parallel.workers import Workers, local_workers
from gapwalk.studies.map import Map, MapOptions, MapSection, Ranges, Which
from gapwalk.studies.whole_diagram import DiagramOptions, grow

_BESIDE = 4e-3  # distance from a locus, in widths of the ranges, within which a special point may lie on it
_ALIKE = 0.1  # relative distance of two orbits' states within which they may belong to the same locus

Report = Callable[[Map, MapSection | Locus], None]
"""Called with the map, and the section or the locus that was added to it last."""


@dataclass(frozen=True)
class _Cut:
    """One section to follow branches on."""

    system: System
    first: str
    second: str
    within: tuple[float, float]
    start: str | Sequence[float]
    period: int
    options: DiagramOptions | None  # None: one branch, and none that leaves it
    walk: WalkOptions | None
    method: Method | None


@dataclass(frozen=True)
class _Found:
    """What a section holds, or why it holds nothing."""

    branches: tuple[Branch, ...] = ()
    notes: tuple[str, ...] = ()
    failures: tuple[str, ...] = ()


@dataclass(frozen=True)
class _Piece:
    """One special point to follow in two parameters."""

    special: SpecialPoint
    first: str
    second: str
    within: Ranges
    walk: WalkOptions | None
    method: Method | None


@shows_progress(lambda count, chart, added: f"{len(chart.sections)} sections, {len(chart.loci)} loci")
def bifurcation_map(
    system: System,
    first: str,
    second: str,
    to: Ranges,
    *,
    start: str | Sequence[float] = "settle",
    period: int = 1,
    options: MapOptions | None = None,
    walk: WalkOptions | None = None,
    method: Method | None = None,
    report: Report | None = None,
    resume: Map | None = None,
) -> Map:
    """All loci of folds, flips, Neimark-Sacker and grazing points that are met in the plane of two parameters.

    Branches are followed along the first parameter at several values of the second; each of their special points that
    is on no locus yet begins one.

    Parameters
    ----------
    system
        The system.
    first, second
        Names of the parameters; the first is the one along which branches are followed.
    to
        The range of each.
    start, period
        Where the branches start, as in `find_orbit`, at the system's own value of the first parameter if that is in
        its range, and at the upper end otherwise.
    options, walk, method
        What the map shows; options of the walks and of the method.
    report
        Called with each section and each locus as it is accepted.
    resume
        A map of the same request that was stopped: what it has is kept, and the rest is added.

    Raises
    ------
    ModelError
        For unknown or equal parameters, or empty ranges.
    NumericalError
        If a worker process dies.
    Interrupted
        After Ctrl-C; its `found` is the map as far as it has come, from which `resume` goes on.
    """
    options = options or MapOptions()
    how = (start, period, walk, method)
    charter = map_charter(system, first, second, to, options, *how, resume)
    try:
        with local_workers(options.workers) as workers:
            for addition in charter.additions(workers):
                if report is not None:
                    report(charter.chart, addition)
    except KeyboardInterrupt:
        raise Interrupted(charter.chart) from None
    return replace(charter.chart, complete=True)


def map_charter(
    system: System,
    first: str,
    second: str,
    to: Ranges,
    options: MapOptions,
    start: str | Sequence[float],
    period: int,
    walk: WalkOptions | None,
    method: Method | None,
    known: Map | None = None,
) -> Charter:
    """What draws up a map; parameters and errors are those of `bifurcation_map`."""
    if first == second:
        raise ModelError(f"a map needs two different parameters, but both are {first!r}")
    ranges = (_range(system, first, to[0]), _range(system, second, to[1]))
    tree = DiagramOptions(
        max_period=options.max_period, workers=1, search_values=options.search_values, search=options.search
    )
    cuts = [
        _Cut(system.at({second: value}), first, second, ranges[0], start, period, tree, walk, method)
        for value in options.values(*ranges[1])
    ]
    return Charter(known or Map(first, second, ranges), cuts, options, walk, method)


def locus_charter(
    system: System,
    first: str,
    second: str,
    to: Ranges,
    which: Which,
    start: str | Sequence[float],
    period: int,
    walk: WalkOptions | None,
    method: Method | None,
    known: Map | None = None,
) -> Charter:
    """What draws up a map of the loci of some special points of one branch, its one section, at the system's values.

    Parameters and errors are those of `bifurcation_map`.
    """
    ranges = (_range(system, first, to[0]), _range(system, second, to[1]))
    cut = _Cut(system, first, second, ranges[0], start, period, None, walk, method)
    options = MapOptions(sections=(system[second],), kinds=(which.kind,), workers=1)
    return Charter(known or Map(first, second, ranges), [cut], options, walk, method, which)


def _range(system: System, name: str, within: tuple[float, float]) -> tuple[float, float]:
    low, high = sorted((float(within[0]), float(within[1])))
    for value in (low, high):
        system.at({name: value})
    if not low < high:
        raise ModelError(f"the range of {name} is from {low:g} to {high:g}: it is empty")
    return low, high


class Charter:
    """Draws up one map. What is known already is at each moment the first part of the whole, in its order.

    Parameters
    ----------
    known
        What there is of it already.
    cuts
        Its sections.
    options, walk, method
        As in `bifurcation_map`.
    which
        Which special points begin a locus; by default all.
    """

    def __init__(
        self,
        known: Map,
        cuts: Sequence[_Cut],
        options: MapOptions,
        walk: WalkOptions | None,
        method: Method | None,
        which: Which | None = None,
    ) -> None:
        self.chart, self.cuts, self.options, self.which = known, cuts, options, which
        self.walk, self.method = walk, method

    def additions(self, workers: Workers) -> Iterator[MapSection | Locus]:
        """What is not known yet, each when it has been added: the sections, then the loci."""
        yield from self._sections(workers)
        yield from self._loci(workers)

    def _sections(self, workers: Workers) -> Iterator[MapSection]:
        """Follow the branches along the first parameter at each value of the second."""
        left = self.cuts[len(self.chart.sections) :]
        for index, found in workers.each(_follow_section, left):
            section = MapSection(left[index].system[self.chart.second], found.branches)
            notes, failures = (*self.chart.notes, *found.notes), (*self.chart.failures, *found.failures)
            sections = (*self.chart.sections, section)
            self.chart = replace(self.chart, sections=sections, notes=notes, failures=failures)
            yield section

    def _loci(self, workers: Workers) -> Iterator[Locus]:
        """Follow the loci that begin at the special points of the sections, or at some of them."""
        which, (low, high) = self.which, self.chart.within[0]
        specials = [
            (section.value, special)
            for section in self.chart.sections
            for branch in section.branches
            for special in (branch.special_points if which is None else which.of(branch.special_points))
            # a fold between two points of a branch may lie just beyond the edge
            if special.kind in self.options.kinds and low <= special.value <= high
        ]
        if which is not None and not specials:
            self.chart = replace(self.chart, failures=(*self.chart.failures, _none_of(which, self.chart)))
        left = specials[self.chart.tried :]
        done = self.chart.tried

        def is_new(index: int) -> bool:
            value, special = left[index]
            return not any(_lies_on_locus(locus, special, value, self.chart) for locus in self.chart.loci)

        for index, locus in workers.each(_follow_piece, [self._piece(special) for _, special in left], is_new):
            tried = done + index + 1
            if isinstance(locus, str):
                self.chart = replace(self.chart, failures=(*self.chart.failures, locus), tried=tried)
            else:
                self.chart = replace(self.chart, loci=(*self.chart.loci, locus), tried=tried)
                yield locus
        self.chart = replace(self.chart, tried=len(specials))

    def _piece(self, special: SpecialPoint) -> _Piece:
        chart = self.chart
        return _Piece(special, chart.first, chart.second, chart.within, self.walk, self.method)


def _follow_section(cut: _Cut) -> _Found:
    """Follow the branch through the first orbit of a section, and those that branch off from it."""
    (low, high), value = cut.within, cut.system[cut.first]
    system = cut.system.at({cut.first: value if low <= value <= high else high})
    where = f"at {cut.second} = {cut.system[cut.second]:.10g}"
    try:
        orbit = find_orbit(system, cut.period, cut.start, method=cut.method)
    except NumericalError as error:
        return _Found(failures=(f"{where} no branch could be followed: {error}",))
    if cut.options is None:
        return _follow_alone(cut, orbit, where)
    grown, finished = grow(orbit, cut.first, cut.within, cut.options, cut.walk, cut.method)
    if not finished:
        raise KeyboardInterrupt  # a section counts only as a whole
    notes, failures = ([f"{where}: {text}" for text in texts] for texts in (grown.notes, grown.failures))
    return _Found(grown.branches, tuple(notes), tuple(failures))


def _follow_alone(cut: _Cut, orbit: Orbit, where: str) -> _Found:
    """Follow the branch through the first orbit of a section, and no other."""
    try:
        return _Found((follow(orbit, cut.first, cut.within, walk=cut.walk, method=cut.method),))
    except NumericalError as error:
        return _Found(failures=(f"{where} no branch could be followed: {error}",))


def _none_of(which: Which, chart: Map) -> str:
    """Why there is nothing to follow."""
    found = [
        f"{special.kind.value}{special.contact and f' of {special.contact}'} at {special.value:.8g}"
        for branch in chart.branches
        for special in branch.special_points
    ]
    return f"the branch has no {which.words}; it has {', '.join(found) or 'no special points'}"


def _follow_piece(piece: _Piece) -> Locus | str:
    """Follow one locus; a sentence instead if that cannot be done."""
    try:
        return follow_locus(
            piece.special, piece.first, piece.second, piece.within, walk=piece.walk, method=piece.method
        )
    except NumericalError as error:
        kind, place = piece.special.kind.value, piece.special.orbit.system
        where = f"{piece.first} = {piece.special.value:.10g}, {piece.second} = {place[piece.second]:.10g}"
        return f"the locus of the {kind} at {where} could not be followed: {error}"


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
    """Whether two orbits of neighbouring systems may be the same motion, one begun later perhaps."""
    states = phases(a)
    distance = float(np.abs(states - b.state).max(axis=1).min())
    return distance <= _ALIKE * magnitude(b.state, b.system)

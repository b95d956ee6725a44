"""Map of rattle in the plane of two parameters: the state of each gap cell by cell, with exact borders over it.

Many motions are followed at once to judge the cells. The borders are loci of the points at which the settled motion,
followed from either end of the first range, begins or ceases to rattle, or is lost.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from operator import itemgetter

import numpy as np
from numpy.typing import NDArray

from gapwalk.answers.gap_states import GapState, SlowSweepOptions, gap_state, innermost, watched
from gapwalk.answers.rattle_bands import chosen_gap
from gapwalk.attractors.basins import centres
from gapwalk.attractors.settle import SettleOptions, settle
from gapwalk.bifurcation.follow import walk
from gapwalk.bifurcation.loci import Locus, follow_locus
from gapwalk.bifurcation.special_point import Kind, SpecialPoint
from gapwalk.errors import FlowError, ModelError, NumericalError
from gapwalk.model.system import System
from gapwalk.notebook import Shown
from gapwalk.orbit.orbit import Orbit, describe_switch
from gapwalk.picture_parts import Cells, Parts, Picture, curves_of_loci, pictured
from gapwalk.pieces import tell, workers_around
from gapwalk.summary import Rows, SummaryParts, Table, TableRows, Tables, remarks, summarizes

_BEYOND = 60  # points of a walk after the first change of all gaps
_LONGEST = 8  # longest period of a motion that is settled again
_LISTED_DIFFERENCES = 8  # differences that the summary lists
_SAME = 1e-3  # distance from a locus, in widths of the ranges, below which a point lies on it

Ranges = tuple[tuple[float, float], tuple[float, float]]


@dataclass(frozen=True, eq=False)
class RattleMap(Shown):
    r"""States of gaps in the plane of two parameters, cell by cell; the first row of each array is the lowest.

    Examples
    --------
    >>> import io
    >>> keys = "[study]\nresolution = 6\nsecond = { parameter = 'stop.clearance', from = 0.9, to = 1.1 }"
    >>> text = file.replace("[study]", keys).replace("response", "rattle")
    >>> gw.run(gw.read_study(io.StringIO(text))).finding.record.cells("stop")
    {'open': 18, 'one side': 18}
    """

    system: System  #: The system, with the values of the other parameters.
    #: first, second: Names of the parameters: horizontal, and vertical.
    first: str
    second: str
    within: Ranges  #: The range of each parameter. A cell is evaluated at its centre.
    gaps: tuple[str, ...]  #: Names of the contacts.
    #: shape (rows, columns, gaps): `GapState.code` of each gap; -1 where the motion has diverged, -2 where nothing is
    #: known yet.
    codes: NDArray[np.int_]
    periods: NDArray[np.int_]  #: shape (rows, columns): Periods of the motions; 0 if they did not become periodic.
    #: shape (rows, columns, gaps): Largest magnitude of each contact force; nan on a rigid stop.
    peak_force: NDArray[np.float64]
    #: Exact borders: loci of grazing points at which a gap begins or ceases to rattle, and of points at which the
    #: motion that was followed is lost.
    loci: tuple[Locus, ...] = ()
    #: checked, different: Number of cells whose gaps were observed with the exact flow, rare kinds first; one sentence
    #: for each that then differed. The map holds what the exact flow found.
    checked: int = 0
    different: tuple[str, ...] = ()
    error: float = 0.0  #: Error of the batch integrator over one forcing period, relative to the size of the motion.
    complete: bool = True  #: False if the computation was stopped before its end.
    notes: tuple[str, ...] = ()  #: Remarks, in sentences.

    def _check_read(self) -> None:
        """Raise a ValueError if its parts do not fit together."""
        if self.codes.shape != (*self.periods.shape, len(self.gaps)) or self.peak_force.shape != self.codes.shape:
            raise ValueError(f"its parts have the shapes {self.codes.shape}, {self.periods.shape}")

    @property
    def resolution(self) -> tuple[int, int]:
        """Columns and rows."""
        rows, columns = self.periods.shape
        return columns, rows

    @property
    def axes(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """The values of the parameters at the centres of the cells."""
        first, second = (centres(ends, count) for ends, count in zip(self.within, self.resolution, strict=True))
        return first, second

    def cells(self, gap: str | None = None) -> dict[str, int]:
        """Return the number of cells of each state of a gap, by default of the first one, in words."""
        place = 0 if gap is None else self.gaps.index(gap)
        found = Counter(zip(self.codes[..., place].ravel().tolist(), (self.periods.ravel() > 0).tolist(), strict=True))
        return {cell_word(*key): found[key] for key in sorted(found)}

    @summarizes
    def summary(self, *, notes: bool = True) -> SummaryParts:
        """Return the share of cells of each state of each gap, the loci, and the notes if wanted."""
        for gap in self.gaps:
            shares = "; ".join(f"{word}: {100 * n / self.periods.size:.3g} %" for word, n in self.cells(gap).items())
            yield f"{gap}: {shares}"
        if self.loci:
            yield ""
            rows = [
                (str(locus.kind), locus.contact, str(len(locus.points)), f"{low:.6g}", f"{high:.6g}")
                for locus in self.loci
                for low, high in [(float(locus.values[:, 0].min()), float(locus.values[:, 0].max()))]
            ]
            yield Table(("border", "contact", ">points", f">{self.first} from", ">to"), rows)
        if self.checked:
            yield f"checked with the exact flow: {len(self.different)} of {self.checked} cells differed"
        yield from self.different[:_LISTED_DIFFERENCES]
        if notes:
            yield from remarks(self.notes, ())

    def tables(self) -> Tables:
        """Return the table of cells, and that of the points of the loci."""
        return {"cells": TableRows(self._cell_rows, 2, units={"peak.": ".force"}), "borders": self._locus_rows}

    def _cell_rows(self) -> Rows:
        yield [self.first, self.second, "period", *(f"{what}.{gap}" for gap in self.gaps for what in ("state", "peak"))]
        across, up = self.axes
        for row, column in np.ndindex(self.periods.shape):
            states = (
                entry
                for place in range(len(self.gaps))
                for entry in (
                    cell_word(int(self.codes[row, column, place]), True),
                    float(self.peak_force[row, column, place]),
                )
            )
            yield [float(across[column]), float(up[row]), int(self.periods[row, column]), *states]

    def _locus_rows(self) -> Rows:
        yield ["border", "kind", self.first, self.second]
        for number, locus in enumerate(self.loci, start=1):
            for first, second in locus.values.tolist():
                yield [number, str(locus.kind), first, second]

    def __repr__(self) -> str:
        columns, rows = self.resolution
        shares = "; ".join(f"{gap}: {' | '.join(self.cells(gap))}" for gap in self.gaps)
        return f"RattleMap({self.first}, {self.second}; {columns} x {rows} cells; {shares})"


def cell_word(code: int, is_periodic: bool) -> str:
    """Return the state of a cell in words: ``closed``, ``one side, not periodic``, ..."""
    if code < 0:
        return "diverges" if code == -1 else "not done"
    return list(GapState)[code] + ("" if is_periodic else ", not periodic")


def borders(
    system: System,
    names: tuple[str, str],
    within: Ranges,
    gaps: Sequence[str],
    start: str | Sequence[float],
    options: SlowSweepOptions,
    sections: Sequence[float],
) -> tuple[list[Locus], list[str]]:
    """Follow the points that end the quiet of gaps, or the motion itself, in the plane of two parameters."""
    # At each section, a value of the second parameter, the settled motion is followed from either end of the first
    # range up to the first such point. A point that lies on a locus that is known already is not followed again.
    pieces = [(section, begin, end) for section in sections for begin, end in (within[0], within[0][::-1])]
    changes, found = partial(_changes_from, system, names, gaps, start, options), list[list[SpecialPoint] | str]()
    for _, each in workers_around().each(changes, pieces):
        found.append(each)
        tell(0.5 * len(found) / len(pieces))
    points = [(point, k) for k, each in enumerate(found) if isinstance(each, list) for point in each]
    loci, failed = list[Locus](), [(k, each) for k, each in enumerate(found) if isinstance(each, str)]
    notes = [(k, f"{names[1]} = {pieces[k][0]:.6g}: {text}") for k, text in failed]

    # only the points of one section are followed at the same time: those of the next mostly lie on the same loci
    for count, section in enumerate(dict.fromkeys(sections)):
        tell(0.5 + 0.5 * count / len(sections))
        here = [(point, k) for point, k in points if pieces[k][0] == section]

        def is_needed(number: int, section: float = section, here: list[tuple[SpecialPoint, int]] = here) -> bool:
            return not any(_is_on(locus, (here[number][0].value, section), within) for locus in loci)

        follow = partial(_locus_of, names, within)
        for number, locus in workers_around().each(follow, [point for point, _ in here], is_needed):
            if isinstance(locus, Locus):
                loci.append(locus)
            else:
                point, k = here[number]
                notes.append((k, f"the {point.kind} at {names[0]} = {point.value:.6g} has no locus: {locus}"))
    return loci, [text for _, text in sorted(notes, key=itemgetter(0))]


def _changes_from(
    system: System,
    names: tuple[str, str],
    gaps: Sequence[str],
    start: str | Sequence[float],
    options: SlowSweepOptions,
    piece: tuple[float, float, float],
) -> list[SpecialPoint] | str:
    """Return where the gaps change first from an end of the first range; in words why it is not known."""
    section, begin, end = piece
    here = system.at({names[0]: begin, names[1]: section})
    try:
        orbit = settle(here, start, SettleOptions(max_periods=options.patience, max_period=2)).orbit
        return [] if orbit is None else _first_changes(orbit, names[0], end, gaps, options)
    except (NumericalError, FlowError) as error:
        return str(error)


def _locus_of(names: tuple[str, str], within: Ranges, point: SpecialPoint) -> Locus | str:
    """Return the locus of a point; in words why there is none."""
    try:
        return follow_locus(point, *names, within)
    except (ModelError, NumericalError) as error:
        return str(error)


def _first_changes(
    orbit: Orbit, parameter: str, end: float, gaps: Sequence[str], options: SlowSweepOptions
) -> list[SpecialPoint]:
    """Return the first point at which each gap changes its state, and the fold at which the motion is lost, if any."""
    # Beyond the first change of all gaps the walk goes on for a while only, to the fold from which a rattling motion
    # jumps; a rattling motion that branches instead goes on rattling.
    found: list[SpecialPoint] = []
    left, more = {gap: gap_state(orbit, gap) for gap in gaps}, _BEYOND
    switches = {describe_switch(orbit, switch): gap for gap in gaps for switch in innermost(orbit.system, gap)}
    steps = walk(orbit, parameter, end, walk=options.walk)
    for point in steps:
        for special in steps.special_points:
            gap = switches.get(special.contact) if special.kind is Kind.GRAZING else None
            if gap in left and gap_state(point.orbit, gap) is not left[gap]:
                found.append(special)
                del left[gap]
        lost = next((each for each in steps.special_points if not each.before.total and each.after.total), None)
        if lost is not None and not lost.kind.no_locus and (left or lost.kind is Kind.FOLD) and lost not in found:
            found.append(lost)
        more -= not left
        if lost is not None or not point.stable or not more:
            break
    return found


def _is_on(locus: Locus, place: tuple[float, float], within: Ranges) -> bool:
    """Return True if a point lies on a locus, to the accuracy of straight lines between its points."""
    widths = np.array([high - low for low, high in within])
    line, point = locus.values / widths, np.array(place) / widths
    first, along = line[:-1], np.diff(line, axis=0)
    length2 = np.maximum((along**2).sum(axis=1), np.finfo(float).tiny)
    share = np.clip(((point - first) * along).sum(axis=1) / length2, 0.0, 1.0)
    away = np.linalg.norm(first + share[:, None] * along - point, axis=1)
    return bool((away < _SAME).any())


def exact_gaps(
    system: System, state: NDArray[np.float64], gaps: Sequence[str], codes: Sequence[int], patience: int
) -> tuple[list[int], str]:
    """Return the codes of gaps by the exact flow, and in words where they differ from those given; empty if none does.

    Where they differ, the motion was perhaps none of the system: it settles first.
    """
    try:
        found = watched(system, state, gaps)
        if [each.code for each in found] != list(codes):
            settled = settle(system, state, SettleOptions(max_periods=patience, max_period=_LONGEST))
            found = watched(system, settled.state, gaps)
    except FlowError as error:
        return [-1] * len(gaps), "" if set(codes) == {-1} else str(error)
    differ = [(gap, code, exact) for gap, code, exact in zip(gaps, codes, found, strict=True) if exact.code != code]
    words = (f"{gap} is {cell_word(code, True)}, but {exact} by the exact flow" for gap, code, exact in differ)
    return [each.code for each in found], "; ".join(words)


_CELLS = {
    GapState.CLOSED: ("closed", "closed (quiet)"),
    GapState.OPEN: ("open", "open (quiet)"),
    GapState.ONE_SIDE: ("one", "one side"),
    GapState.BOTH_SIDES: ("both", "both sides"),
}


@pictured(RattleMap, size=(8.0, 6.0), forms=("axes",))
def rattle_map_picture(found: RattleMap, gap: str | None = None) -> Picture:
    """Describe the state of a gap in the plane of two parameters, with the exact borders over the cells."""
    gap = chosen_gap(found.gaps, gap)
    note = f"checked with the exact flow: {len(found.different)} of {found.checked} cells differed"
    within = dict(zip((found.first, found.second), found.within, strict=True))
    return Picture(
        found.system,
        (found.first, found.second),
        curves_of_loci(found.loci, "border: {}"),
        lambda: Parts(cells=[_cells(found, k, each) for k, each in enumerate(found.gaps)], within=within),
        sentences=[part for part in found.summary() if isinstance(part, str)][: len(found.gaps)],
        heading=[f"rattle of {gap}"],
        contacts=found.gaps,
        of=gap,
        script="record.loci",
        note=note if found.checked else "not checked with the exact flow",
    )


def _cells(found: RattleMap, place: int, gap: str) -> Cells:
    """Return the cells of a gap."""
    states, is_periodic = found.codes[..., place], found.periods > 0
    codes, entries = np.zeros(states.shape, dtype=int), list[tuple[str, str]]()
    kinds = [(state.code, periodic) for state in GapState for periodic in (True, False)]
    for code, periodic in [*kinds, (-1, False), (-2, False)]:
        own = (states == code) & (is_periodic == periodic)
        if own.any():
            codes[own] = len(entries)
            entries.append(_cell_entry(code, periodic))
    return Cells(codes, entries, found.within, gap)


def _cell_entry(code: int, periodic: bool) -> tuple[str, str]:
    if code < 0:
        return cell_word(code, True), "none" if code == -1 else "undone"
    tint, words = _CELLS[list(GapState)[code]]
    return (words, tint) if periodic else (f"{words}, not periodic", f"{tint}-wild")

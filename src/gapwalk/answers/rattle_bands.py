"""Rattle bands: where gaps open and close over a range of a parameter, how badly, and what ends it.

The record gives the bands met by a slowly rising and by a slowly falling parameter, and their union over all settled
motions that are known; the severity of rattle along them; and the worst motion with the share of starts that lead to
it.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, fields
from functools import partial
from itertools import chain, pairwise

import numpy as np
from numpy.typing import NDArray

from gapwalk.answers.gap_states import (
    BandEnd,
    GapSpan,
    GapState,
    RattleBand,
    bands_of_spans,
    gap_state,
    innermost,
    judge_gaps,
    spans_of,
    state_of,
    watched,
)
from gapwalk.answers.settled_sweep import Direction, Sample, SettledSweep, SlowSweepOptions
from gapwalk.answers.shown_measure import moved_by
from gapwalk.answers.tolerance import chance_of
from gapwalk.attractors.basins import centres
from gapwalk.attractors.many_motions import enough, has_kernel, motions_of
from gapwalk.attractors.rattle import Rattle, rattle
from gapwalk.attractors.regimes import Regime, RegimeOptions, judge, regime_word
from gapwalk.attractors.settle import SettleOptions, settle
from gapwalk.bifurcation.follow import walk
from gapwalk.bifurcation.isolated.search_starts import spread_starts, state_box
from gapwalk.bifurcation.loci import Locus, follow_locus
from gapwalk.bifurcation.special_point import Kind, SpecialPoint, describe_switch
from gapwalk.continuation.curve_points import BranchPoint
from gapwalk.errors import FlowError, ModelError, NumericalError
from gapwalk.model.problems import did_you_mean
from gapwalk.model.system import System
from gapwalk.model.words import parameter_symbol, told_apart
from gapwalk.notebook import Shown
from gapwalk.orbit.orbit import Orbit
from gapwalk.picture_parts import (
    Cells,
    End,
    Line,
    NamedCurve,
    Panel,
    Parts,
    Picture,
    Series,
    Shade,
    curves_of_loci,
    pictured,
)
from gapwalk.summary import Rows, SummaryParts, Table, TableRows, Tables, remarks, summarizes

_APART = 1 / 40  # of the range: the least distance of two motions of a stretch whose severity is computed
_WATCHED = 16  # forcing periods over which the severity of a motion without period is computed
_QUIET = 5.0  # factor on that distance where nothing rattles
_NEXT = 2  # motions on either side of the worst one that are examined too
_TRANSIENT = 200  # the most forcing periods in which the motions of many starts may become periodic
_EQUAL = 0.05  # difference of peak forces, relative to them, up to which two settled motions count as one
_JUDGED = 4  # motions without period whose kind is found
NOT_PERIODIC = "not periodic"
_SHOWN = 3  # movers of an end in the summary
_LISTED = 12  # rows of severity in the summary


@dataclass(frozen=True, slots=True)
class Severity:
    """Severity of the rattle of one gap in one settled motion.

    In a system with units, forces are in N m, velocities in the unit of angles per second, accelerations in rad/s^2,
    and powers in W.
    """

    #: gap, met: Name of the contact; how the motion is met: ``rising``, ``falling``, or ``other`` if no sweep meets it.
    gap: str
    met: str
    value: float  #: Value of the parameter.
    state: GapState  #: State of the gap.
    period: int  #: Period of the motion in forcing periods; 0 if it is not periodic.
    impacts: float  #: Impacts per forcing period.
    #: per_second, per_turn: Impacts per unit of time, and per turn of the shaft whose speed is the first parameter; nan
    #: if there is none.
    per_second: float
    per_turn: float
    peak: float  #: Largest magnitude of the contact force; nan on a rigid stop.
    approach: float  #: Largest approach velocity.
    power: float  #: Mean power lost in the contact.
    #: rms, kurtosis: Root mean square and kurtosis of the acceleration of the coordinate that moves most violently
    #: across the gap; nan where a rigid stop gives it impulses.
    rms: float
    kurtosis: float
    #: ``20 log10`` of that rms over the reference, in dB; -inf without acceleration, nan where the rms is.
    level: float


@dataclass(frozen=True, slots=True)
class Worst:
    """The worst rattle of a gap among all settled motions that are known."""

    severity: Severity  #: Its severity. If the motion is not periodic, its figures are those of a sample of it.
    #: Share of random starts, at its value of the parameter, that lead to it: those with its peak force. A motion that
    #: is not periodic, or one on a rigid stop, cannot be told by its peak force: of these it is the share of starts
    #: that lead to rattle of any kind. It is nan if none was followed.
    share: float
    starts: int  #: Number of these starts.
    motion: str = ""  #: Kind of the motion in words: ``period 1``, ``chaotic``, ...

    @property
    def words(self) -> str:
        """The share in words, with the interval that contains it with 95 % confidence (Clopper and Pearson 1934)."""
        there = "lead there" if _is_told(self.severity) else "rattle there"
        chance = chance_of(round(self.share * self.starts), self.starts)
        ends = f"{100.0 * chance.low:.3g} to {100.0 * chance.high:.3g} %"
        return f"{chance.count} of {self.starts} random starts {there}: {ends} of all"


@dataclass(frozen=True, eq=False)
class RattleBands(Shown):
    """The bands of a parameter in which gaps rattle."""

    system: System  #: The system; its own value of the parameter plays no role.
    #: parameter, within: The parameter and its range.
    parameter: str
    within: tuple[float, float]
    gaps: tuple[str, ...]  #: Names of the contacts.
    reference: float  #: Acceleration to which levels in dB refer.
    #: The settled motions met by slow sweeps, then others that were found from random starts.
    sweeps: tuple[SettledSweep, ...]
    bands: tuple[RattleBand, ...]  #: The bands, by gap, then by how they are met (see `RattleBand.met`).
    severities: tuple[Severity, ...]  #: Severity along the motions, in the order of the parameter.
    worst: tuple[Worst, ...]  #: The worst motion of each gap that rattles.
    complete: bool = True  #: False if the computation was stopped before its end.
    notes: tuple[str, ...] = ()  #: Remarks, in sentences.

    def of(self, gap: str | None = None, met: str = "any") -> tuple[RattleBand, ...]:
        """Return the bands of a gap (by default the first one) that are met in one way, from low to high."""
        gap = self.gaps[0] if gap is None else gap
        return tuple(band for band in self.bands if band.gap == gap and band.met == met)

    def sentence(self, gap: str) -> str:
        """Return the answer for one gap, as a sentence."""
        low, high = (self._value(end) for end in self.within)
        bands = self.of(gap)
        if not bands:
            states = {str(span.state) for sweep in self.sweeps for span in spans_of(sweep, gap)}
            return f"{gap} is quiet ({' or '.join(sorted(states))}) from {low} to {high}"
        ends = [told_apart(band.low.value, band.high.value) for band in bands]
        unit = self.system.units.parameter(self.parameter) if self.system.units else ""
        ranges = " and ".join(f"from {first} to {last} {unit}".rstrip() for first, last in ends)
        text = f"{gap} rattles {ranges}"
        worst = next((each for each in self.worst if each.severity.gap == gap), None)
        if worst is None:
            return text
        severity, units, parts = worst.severity, self.system.units, []
        about = "" if severity.period else "about "
        if not math.isnan(severity.peak):
            peak = _figure(severity.peak, severity)
            parts.append(f"{about}{peak} N m" if units else f"peak force {about}{peak}")
        else:
            fastest = _figure(severity.approach, severity)
            parts.append(f"impacts at {about}{fastest}{' ' + units.state(chr(39)) if units else ''}")
        if units:
            parts.append(f"{_figure(severity.per_second, severity)} impacts per second")
        else:
            many = _figure(severity.impacts, severity)
            parts.append(f"{many} impact{'s' * (many != '1')} per forcing period")
        if about:
            parts.append(worst.motion or NOT_PERIODIC)
        where = "near" if about else "at"
        text += f"; worst {where} {self._value(severity.value, 3 if about else 6)}: {', '.join(parts)}"
        return f"{text} ({worst.words})" if worst.starts else text

    @summarizes
    def summary(self, *, notes: bool = True) -> SummaryParts:
        """Return a sentence for each gap, the bands with their ends, the severity along them, and notes if wanted."""
        yield from (self.sentence(gap) for gap in self.gaps)
        symbol = parameter_symbol(self.parameter, self.system.units)
        rows, groups = [], []
        for band in self.bands:
            for name, end in (("from", band.low), ("to", band.high)):
                movers = ", ".join(f"{each.name} {each.share:+.2f}" for each in end.movers[:_SHOWN])
                error = f"{end.error:.0e}" if end.error else ""
                what = ", ".join(band.states) if name == "from" else ""
                head = (band.gap, band.met) if name == "from" else ("", "")
                rows.append((*head, name, f"{end.value:.8g}", error, end.kind, movers, what))
            groups.append(len(rows) - 1)
        if rows:
            yield ""
            headings = ("gap", "met", "", f">{symbol}", ">±", "end", "moved most by (% per %)", "gap closes on")
            yield Table(headings, rows, groups)
        for gap in self.gaps:
            yield from self._severity_parts(gap)
        if notes:
            yield from remarks(self.notes, ())

    def tables(self) -> Tables:
        """Return the tables of bands, of what moves their ends, and of severity."""
        along = self.parameter
        ends = dict.fromkeys(["from", "from.error", "to", "to.error"], along)
        severity = {"value": along, "peak": ".force", "approach": "'", "power": "W", "rms": "''"}
        return {
            "bands": TableRows(self._band_rows, units=ends),
            "movers": TableRows(self._mover_rows, units={"value": along}),
            "severity": TableRows(self._severity_rows, units=severity),
        }

    def _severity_parts(self, gap: str) -> SummaryParts:
        rows = [each for each in self.severities if each.gap == gap and each.state.rattles]
        if not rows:
            return
        chosen = sorted({id(row): row for row in sorted(rows, key=_peak)[-_LISTED:]}.values(), key=_place)
        largest = "fastest impacts" if all(math.isnan(row.peak) for row in rows) else "largest force"
        units = self.system.units
        symbol = parameter_symbol(self.parameter, units)
        of = (lambda name, unit: f">{name} [{unit}]") if units else (lambda name, unit: f">{name}")
        yield f"\n{gap}: the {len(chosen)} motions with the {largest}, of {len(rows)} that rattle"
        headings = (f">{symbol}", "met", "state", "period", ">impacts/s" if units else ">impacts/time", ">per turn")
        headings += (of("peak", "N m"), of("approach", units.state("'") if units else ""), of("lost", "W"))
        headings += (of("rms", "rad/s^2"), ">kurtosis", f">dB re {self.reference:g}")
        yield Table(
            headings,
            [
                (
                    f"{row.value:.6g}",
                    row.met,
                    str(row.state),
                    str(row.period or "none"),
                    _figure(row.per_second, row),
                    *(
                        _figure(number, row)
                        for number in (row.per_turn, row.peak, row.approach, row.power, row.rms, row.kurtosis)
                    ),
                    "-" if math.isnan(row.level) else f"{row.level:.1f}",
                )
                for row in chosen
            ],
        )

    def _value(self, value: float, digits: int = 6) -> str:
        unit = self.system.units.parameter(self.parameter) if self.system.units else None
        return f"{value:.{digits}g} {unit}" if unit else f"{value:.{digits}g}"

    def _band_rows(self) -> Rows:
        yield ["gap", "met", "from", "from.error", "from.kind", "to", "to.error", "to.kind", "states"]
        for band in self.bands:
            ends = chain.from_iterable((end.value, end.error, end.kind) for end in (band.low, band.high))
            yield [band.gap, band.met, *ends, " ".join(state.replace(" ", "-") for state in band.states)]

    def _mover_rows(self) -> Rows:
        yield ["gap", "met", "end", "value", "parameter", "slope", "error", "percent_per_percent"]
        for band in self.bands:
            for name, end in (("from", band.low), ("to", band.high)):
                for each in end.movers:
                    yield [band.gap, band.met, name, end.value, each.name, each.slope, each.error, each.share]

    def _severity_rows(self) -> Rows:
        names = [field.name for field in fields(Severity)]
        yield names
        for row in self.severities:
            yield [str(getattr(row, name)) if name == "state" else getattr(row, name) for name in names]

    def __repr__(self) -> str:
        return f"RattleBands({'; '.join(self.sentence(gap) for gap in self.gaps)})"


def _figure(number: float, row: Severity) -> str:
    """Write a figure of a motion; that of a sample of one without period has three digits, an undefined one none."""
    if math.isnan(number):
        return "-"
    return f"{number:.4g}" if row.period else f"{number:.3g}"


def _is_told(row: Severity) -> bool:
    """Return True if a motion is known by its peak force: that of a motion without period depends on the sample."""
    return row.period > 0 and not math.isnan(row.peak)


def _place(row: Severity) -> tuple[float, str]:
    return row.value, row.met


def bands_of_sweeps(sweeps: Sequence[SettledSweep], gaps: Iterable[str]) -> tuple[RattleBand, ...]:
    """Return the bands of each gap: those of each sweep, and their union, whose ends have gradients."""
    found: list[RattleBand] = []
    for gap in gaps:
        every: list[GapSpan] = []
        known: dict[int, BandEnd] = {}
        for sweep in sweeps:
            spans = spans_of(sweep, gap)
            every += spans
            if not sweep.name:
                found += bands_of_spans(spans, gap, sweep.met)
        for band in bands_of_spans(every, gap, "any"):
            low, high = (known.setdefault(id(end), end.with_movers()) for end in (band.low, band.high))
            found.append(RattleBand(gap, "any", low, high, band.spans))
    return tuple(found)


def severities_of(sweep: SettledSweep, gaps: Sequence[str], reference: float) -> list[Severity]:
    """Return the severity of each gap along a sweep: at spread points of its stretches, and at its samples.

    Beside the worst motion of a stretch, its neighbours are examined too.
    """
    apart = _APART * (sweep.within[1] - sweep.within[0])
    rows: list[Severity] = []
    worst, beside = -1.0, []
    for piece in sweep.pieces:
        found = []
        if isinstance(piece, Sample):
            found = _rows_at(piece, sweep, gaps, reference)
            worst, beside = max([(worst, beside), *((_peak(row), []) for row in found)], key=lambda each: each[0])
        else:
            places = list(_spread(piece.points, apart, gaps))
            for place in places:
                found += (own := _rows_at(piece.points[place], sweep, gaps, reference))
                if (peak := max(map(_peak, own))) > worst:
                    near = [place + k for k in range(-_NEXT, _NEXT + 1) if place + k not in places]
                    worst, beside = peak, [piece.points[k] for k in near if 0 <= k < len(piece.points)]
        rows += found
    for point in beside:
        rows += _rows_at(point, sweep, gaps, reference)
    return sorted(rows, key=_place)


def _peak(row: Severity) -> float:
    return (row.approach if math.isnan(row.peak) else row.peak) if row.state.rattles else -1.0


def _spread(points: Sequence[BranchPoint], apart: float, gaps: Sequence[str]) -> Iterator[int]:
    """Yield the places of points at least some distance apart, farther where all gaps are quiet.

    The first is among them, and both points beside each beginning or end of rattle.
    """
    last, rattled, shown = -math.inf, None, -1
    for place, point in enumerate(points):
        rattles = any(gap_state(point.orbit, gap).rattles for gap in gaps)
        changes = rattled is not None and rattles is not rattled
        if changes and shown < place - 1:
            yield place - 1
        if changes or abs(point.value - last) >= apart * (1.0 if rattles else _QUIET):
            yield place
            last, shown = point.value, place
        rattled = rattles


def _rows_at(
    motion: BranchPoint | Sample, sweep: SettledSweep, gaps: Sequence[str], reference: float
) -> list[Severity]:
    if isinstance(motion, BranchPoint):
        whole, period, what = rattle(motion.orbit), motion.orbit.period, motion.orbit
    else:
        try:
            whole = rattle(motion.motion, _WATCHED)
        except FlowError:
            return []
        period, what = motion.motion.period or 0, motion
    met, value = sweep.met, motion.value
    return [severity_of(whole, gap, met, value, state_of(what, gap), period, reference) for gap in gaps]


def severity_of(
    whole: Rattle, gap: str, met: str, value: float, state: GapState, period: int, reference: float
) -> Severity:
    """Return the severity of one gap from all figures of a rattling motion."""
    system = whole.system
    sides = [side for side in whole.sides if side.contact == gap]
    load = next(each for each in whole.contacts if each.contact == gap)
    impacts = sum(side.impacts for side in sides)
    moved = moved_by(system, gap)
    own = [each for each in whole.coordinates if each.coordinate in moved]
    signal = max(own, key=lambda each: math.inf if math.isnan(each.rms) else each.rms)
    level = -math.inf if signal.rms == 0.0 else 20.0 * math.log10(signal.rms / reference)
    turns = system.turns
    return Severity(
        gap,
        met,
        value,
        state,
        period,
        impacts,
        impacts * system.frequency / (2.0 * math.pi),
        math.nan if turns is None else impacts * float(turns),
        load.peak,
        max(side.fastest for side in sides),
        load.power,
        signal.rms,
        signal.kurtosis,
        level,
    )


def worst_of(
    system: System, parameter: str, severities: Sequence[Severity], gap: str, starts: int, seed: int
) -> Worst | None:
    """Return the worst motion of a gap, with the share of random starts that lead to it; None if the gap is quiet."""
    rows = [row for row in severities if row.gap == gap and row.state.rattles]
    if not rows:
        return None
    worst = max(rows, key=_peak)
    share, motion = math.nan, regime_word(Regime.PERIODIC, worst.period) if worst.period else NOT_PERIODIC
    if starts:
        here = system.at({parameter: worst.value})
        states = np.array(spread_starts([here], state_box(here), starts, seed, 0.0))
        found = judge_gaps(here, states, None, [gap], _TRANSIENT)
        rattles = np.isin(found.codes[:, 0], [state.code for state in GapState if state.rattles])
        is_alike = np.abs(found.peaks[:, 0] - worst.peak) <= _EQUAL * worst.peak if _is_told(worst) else rattles
        share = float(np.mean(is_alike))
        if not worst.period:
            motion = _kind_of(here, found.states[rattles & (found.periods == 0)])
    return Worst(worst, share, starts, motion)


def _kind_of(system: System, states: NDArray[np.float64]) -> str:
    """Return the kind of most of some settled motions without period, in words."""
    if not len(states) or not has_kernel(system):
        return NOT_PERIODIC
    states, options = states[:_JUDGED], RegimeOptions(longest=_WATCHED, forces=False)
    work = partial(judge, states=states, scales=np.tile(system.state_scales(), (len(states), 1)), options=options)
    found, _ = enough(motions_of(system, states), work)
    words = [regime_word(*each) for each in zip(found.regimes.tolist(), found.periods.tolist(), strict=True)]
    most = max(words, key=words.count)
    return NOT_PERIODIC if most in (Regime.RUNAWAY.text, Regime.UNDECIDED.text) else most


# Map of rattle in the plane of two parameters: the state of each gap cell by cell, with exact borders over it.
#
# The cells are judged by the batch integrator. The borders are loci of the points at which the settled motion,
# followed from either end of the first range, begins or ceases to rattle, or is lost.

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
                (str(locus.kind), _contact_of(locus), str(len(locus.points)), f"{low:.6g}", f"{high:.6g}")
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


def _contact_of(locus: Locus) -> str:
    return getattr(locus, "contact", "") or ""


def borders(
    system: System,
    names: tuple[str, str],
    within: Ranges,
    gaps: Sequence[str],
    start: str | Sequence[float],
    options: SlowSweepOptions,
    sections: Sequence[float],
) -> tuple[list[Locus], list[str]]:
    """Follow the points that end the quiet of gaps, or the motion itself, in the plane of two parameters.

    At each section, a value of the second parameter, the settled motion is followed from either end of the first range
    up to the first such point. A point that lies on a locus that is known already is not followed again.
    """
    loci: list[Locus] = []
    notes: list[str] = []
    for section in sections:
        for begin, end in (within[0], within[0][::-1]):
            here = system.at({names[0]: begin, names[1]: section})
            try:
                orbit = settle(here, start, SettleOptions(max_periods=options.patience, max_period=2)).orbit
                points = [] if orbit is None else _first_changes(orbit, names[0], end, gaps, options)
            except (NumericalError, FlowError) as error:
                notes.append(f"{names[1]} = {section:.6g}: {error}")
                continue
            for point in points:
                if any(_is_on(locus, (point.value, section), within) for locus in loci):
                    continue
                try:
                    loci.append(follow_locus(point, *names, within))
                except (ModelError, NumericalError) as error:
                    notes.append(f"the {point.kind} at {names[0]} = {point.value:.6g} has no locus: {error}")
    return loci, notes


def _first_changes(
    orbit: Orbit, parameter: str, end: float, gaps: Sequence[str], options: SlowSweepOptions
) -> list[SpecialPoint]:
    """Return the first point at which each gap changes its state, and the fold at which the motion is lost, if any.

    Beyond the first change of all gaps the walk goes on for a while only, to the fold from which a rattling motion
    jumps; a rattling motion that branches instead goes on rattling.
    """
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


_TINTS = {GapState.ONE_SIDE: ("one", "rattles on one side"), GapState.BOTH_SIDES: ("both", "on both sides")}
_CELLS = {
    GapState.CLOSED: ("closed", "closed (quiet)"),
    GapState.OPEN: ("open", "open (quiet)"),
    GapState.ONE_SIDE: ("one", "one side"),
    GapState.BOTH_SIDES: ("both", "both sides"),
}
_SAMPLED = 64  # samples of a forcing period of a motion without period


@pictured(RattleBands, size=(8.0, 9.0))
def rattle_picture(found: RattleBands, gap: str | None = None) -> Picture:
    """Describe the bands of a gap over the response, and the peak force and the impacts along them."""
    gap, units = _chosen(found.gaps, gap), found.system.units
    moved = moved_by(found.system, gap)[0]
    curves = [
        NamedCurve(f"{sweep.met}-{number}", stretch.branch, *_look(found, sweep.met), stretch.points)
        for sweep in found.sweeps
        for number, stretch in enumerate(sweep.stretches, start=1)
    ]
    return Picture(
        found.system,
        (found.parameter, f"half.{moved}"),
        curves,
        partial(_parts_of_bands, found, moved),
        sentences=[found.sentence(each) for each in found.gaps],
        heading=[found.sentence(gap)],
        contacts=found.gaps,
        of=gap,
        script="[stretch.branch for sweep in record.sweeps for stretch in sweep.stretches]",
        words=("", f"amplitude of {moved}" + (f" [{units.signal(moved)[1]}]" if units else "")),
        height=1.25,
        reach={found.parameter: found.within, f"half.{moved}": (0.0, None)},
    )


def _chosen(gaps: Sequence[str], gap: str | None) -> str:
    name = gaps[0] if gap is None else gap
    if name not in gaps:
        raise ModelError(f"gap is {gap!r}; {did_you_mean(name, gaps)}")
    return name


def _look(found: RattleBands, met: str) -> tuple[str, str]:
    """Return the style and the legend of motions that are met in a way."""
    if met not in list(Direction):
        return "other", "other motions"
    return met, f"{found.parameter.rpartition('.')[2].replace('_', ' ')} {met}"


def _parts_of_bands(found: RattleBands, moved: str) -> Parts:
    over, units = found.parameter, found.system.units
    bands = [band for gap in found.gaps for band in found.of(gap)]
    ends = [(band.gap, *pair) for band in bands for pair in (("from", band.low), ("to", band.high))]
    unit = units.parameter(over) if units else ""
    return Parts(
        layers=list(_samples(found, moved)),
        shades=[each for gap in found.gaps for each in _shades(found, gap)],
        lines=[Line(over, end.value, f"{end.value:.6g}", end.is_located, gap, end.kind) for gap, _, end in ends],
        below=[each for gap in found.gaps for each in _severity_panels(found, gap)],
        ends=[
            End(
                f"{word} {end.value:.7g} {unit}".rstrip(),
                end.kind,
                end.special,
                ", ".join(f"{each.name} {each.share:+.2f}" for each in end.movers[:2]),
                gap,
            )
            for gap, word, end in ends
        ],
        within={over: found.within},
    )


def _samples(found: RattleBands, moved: str) -> Iterator[Series]:
    """Yield the amplitudes of the motions that were sampled, because they have no branch."""
    axes, place = (found.parameter, f"half.{moved}"), found.system.coordinates.index(moved)
    if any(row.period == 0 for row in found.severities):
        yield Series([], [], "crosses", "measured", "not periodic, or of long period", axes=axes)
    for sweep in found.sweeps:
        for mark, own in (
            ("dots", [each for each in sweep.samples if each.motion.orbit]),
            ("crosses", [each for each in sweep.samples if not each.motion.orbit]),
        ):
            y = [0.5 * float(np.ptp(each.motion.motion(_WATCHED, _SAMPLED).q[:, place])) for each in own]
            if own:
                yield Series([each.value for each in own], y, mark, _look(found, sweep.met)[0], axes=axes)


def _shades(found: RattleBands, gap: str) -> Iterator[Shade]:
    """Yield the spans of each state; where motions of both kinds exist, the worse one shows."""
    spans = [span for band in found.of(gap) for span in band.spans]
    values = sorted({end.value for span in spans for end in (span.low, span.high)})
    before: Shade | None = None
    for low, high in pairwise(values):
        states = [span.state for span in spans if span.low.value <= low and high <= span.high.value]
        tint, text = _TINTS[max(states, key=list(_TINTS).index)] if states else ("", "")
        if before is not None and before.tint == tint and before.high == low:
            before = before._replace(high=high)
            continue
        if before is not None:
            yield before
        before = Shade(found.parameter, low, high, tint, text, gap) if tint else None
    if before is not None:
        yield before


def _severity_panels(found: RattleBands, gap: str) -> Iterator[Panel]:
    """Yield the panels of severity: the peak force, or the approach velocity of a rigid stop; and the impacts."""
    units = found.system.units
    rows = [row for row in found.severities if row.gap == gap]
    if all(math.isnan(row.peak) for row in rows if row.state.rattles):
        title, key = f"approach velocity{f' [{units.state(chr(39))}]' if units else ''}", "approach"
    else:
        title, key = ("peak torque [N m]" if units else "peak force"), "peak"
    worst = [each.severity for each in found.worst if each.severity.gap == gap][:1]
    stars = [Series([each.value], [getattr(each, key)], "stars", "worst", "worst") for each in worst]
    yield Panel(title, found.parameter, [*_along(found, rows, key), *stars], gap)
    many = "impacts per s" if units else "impacts per time"
    yield Panel(many, found.parameter, list(_along(found, rows, "per_second")), gap, height=0.8)


def _along(found: RattleBands, rows: Sequence[Severity], key: str) -> Iterator[Series]:
    """Yield the series of one figure along the motions met in each way."""
    for met in dict.fromkeys(row.met for row in rows):
        own = [row for row in rows if row.met == met]
        look, text = _look(found, met)
        for mark, chosen in (
            ("line", own),
            ("dots", [row for row in own if row.period]),
            ("crosses", [row for row in own if not row.period]),
        ):
            if chosen:
                x, y = [row.value for row in chosen], [getattr(row, key) for row in chosen]
                yield Series(x, y, mark, look, text if mark == "dots" else "")


@pictured(RattleMap, size=(8.0, 6.0), forms=("axes",))
def rattle_map_picture(found: RattleMap, gap: str | None = None) -> Picture:
    """Describe the state of a gap in the plane of two parameters, with the exact borders over the cells."""
    gap = _chosen(found.gaps, gap)
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

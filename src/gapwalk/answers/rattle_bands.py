"""Rattle bands: where gaps open and close over a range of a parameter, how badly, and what ends it.

The record gives the bands met by a slowly rising and by a slowly falling parameter, and their union over all settled
motions that are known; the severity of rattle along them; and the worst motion with the share of starts that lead to
it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields
from functools import partial
from itertools import chain, cycle, pairwise

import numpy as np
from numpy.typing import NDArray

from gapwalk.answers.gap_states import (
    RANGE,
    SELDOM,
    BandEnd,
    Direction,
    GapSpan,
    GapState,
    RattleBand,
    Sample,
    SettledSweep,
    bands_of_spans,
    gap_state,
    judge_gaps,
    lane_states,
    spans_of,
    state_of,
    unsure,
)
from gapwalk.answers.lane_sweep import started_piece
from gapwalk.answers.shown_measure import moved_by
from gapwalk.answers.tolerance import chance_of
from gapwalk.attractors.lane_settling import LaneMotion
from gapwalk.attractors.many_motions import enough, has_kernel, motions_of
from gapwalk.attractors.rattle import Rattle, rattle
from gapwalk.attractors.regimes import Regime, RegimeOptions, judge, regime_word, take_another_look
from gapwalk.bifurcation.isolated.search_starts import spread_starts, state_box
from gapwalk.bifurcation.loci.gradient import main_movers
from gapwalk.continuation.curve_points import BranchPoint
from gapwalk.errors import FlowError, ModelError
from gapwalk.flow.motion import acceleration_names, accelerations_at
from gapwalk.model.problems import did_you_mean
from gapwalk.model.system import System
from gapwalk.model.words import parameter_symbol, told_apart, with_error
from gapwalk.notebook import Shown
from gapwalk.picture_parts import End, Line, NamedCurve, Panel, Parts, Picture, Series, Shade, pictured
from gapwalk.summary import Rows, SummaryParts, Table, TableRows, Tables, remarks, summarizes

_APART = 1 / 40  # of the range: the least distance of two motions of a stretch whose severity is computed
_WATCHED = 16  # forcing periods over which the severity of a motion without period is computed
_QUIET = 5.0  # factor on that distance where nothing rattles
_NEXT = 2  # motions on either side of the worst one that are examined too
_TRANSIENT = 200  # the most forcing periods in which the motions of many starts may become periodic
_EQUAL = 0.05  # difference of peak forces, relative to them, up to which two settled motions count as one
_JUDGED = 4  # motions without period whose kind is found
NOT_PERIODIC = "not periodic"
_RANKED = {"approach": "fastest impacts", "rms": "largest acceleration", "peak": "largest force"}
_COLUMNS = {"approach": 12, "peak": 11}  # their columns, which are not left out
_KEYS = {"approach": "approach", "rms": "rms", "peak": "peak force"}
_SHOWN = 3  # movers of an end in the summary
_MILDER = 0.9  # ratio of the ranks of a milder motion and the worst, up to which it is reported
_LIKE = 0.98  # ratio of two accelerations above which they are those of one motion
_OFTEN = 0.2  # share of periods in which a gap parts, up to which that is seldom
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
    #: rms, kurtosis: Root mean square and kurtosis of the acceleration that is largest of the parts on either side of
    #: the gap: of a coordinate, or of an inertia of a train; nan where a rigid stop gives it impulses.
    rms: float
    kurtosis: float
    #: ``20 log10`` of that rms over the reference, in dB; -inf without acceleration, nan where the rms is.
    level: float
    #: largest, error: Largest magnitude of that acceleration; half the width of the interval of its root mean square at
    #: 95 %, 0 for a periodic motion.
    largest: float = math.nan
    error: float = 0.0
    part: str = ""  #: Name of that acceleration: ``x''``, ``gear1.acceleration``.
    #: often, often_low, often_high: Share of forcing periods in which the gap parts, and its interval at 95 % (Clopper
    #: and Pearson 1934); without width for a periodic motion, nan where a motion was followed by continuation.
    often: float = math.nan
    often_low: float = math.nan
    often_high: float = math.nan

    @property
    def words(self) -> str:
        """The state of the gap in words, with how often it parts if that is seldom."""
        if self.often_low == self.often_high or not 0.0 < self.often < _OFTEN:
            return str(self.state)
        least, most = 1.0 / self.often_high, 1.0 / self.often_low
        return f"{self.state}, once in {1.0 / self.often:.3g} periods ({least:.2g} to {most:.2g})"


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
        what = "this motion" if _is_told(self.severity) else "rattle"
        chance = chance_of(round(self.share * self.starts), self.starts)
        ends = f"{100.0 * chance.low:.3g} to {100.0 * chance.high:.3g} %"
        return f"{chance.count} of {self.starts} random starts lead to {what}; with 95 % confidence, {ends} of all do"


@dataclass(frozen=True, eq=False)
class RattleBands(Shown):
    """The bands of a parameter in which gaps rattle."""

    system: System  #: The system; its own value of the parameter is not used.
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
        widest = sorted(
            sorted(bands, key=lambda band: band.low.value - band.high.value)[:_SHOWN], key=lambda b: b.low.value
        )
        ranges = " and ".join(self._range(band) for band in widest)
        left = len(bands) - len(widest)
        more = f", and in {left} narrower band{'s' * (left > 1)}" if left else ""
        text = f"{gap} rattles {ranges}{more}"
        if any(end.kind == SELDOM for band in widest for end in (band.low, band.high)):
            periods = min(motion.watched for motion in unsure(self.sweeps, gap))
            text += f" (beyond, it did not separate in {periods} observed forcing periods, but may do so more rarely)"
        worst = next((each for each in self.worst if each.severity.gap == gap), None)
        if worst is None:
            return text
        severity, units, parts = worst.severity, self.system.units, []
        about = "" if severity.period else "about "
        if units and not math.isnan(severity.rms):
            name, unit = severity.part.removesuffix(".acceleration"), units.signal(severity.part)[1]
            rms, largest = _figure(severity.rms, severity), _figure(severity.largest, severity)
            parts.append(f"{name} accelerates by {rms} {unit} rms, {largest} at most")
        if not math.isnan(severity.peak):
            peak = _figure(severity.peak, severity)
            parts.append(f"peak torque {about}{peak} N m" if units else f"peak force {about}{peak}")
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
        text += f"; worst {where} {self._value(severity.value)}: {', '.join(parts)}"
        text += f" ({worst.words})" if worst.starts else ""
        return text + self._beside(severity)

    def _beside(self, worst: Severity) -> str:
        """Say which milder motion other sweeps meet at the value of the worst motion; empty if none does."""
        rows: dict[str, list[Severity]] = {}
        for row in self.severities:
            if row.gap == worst.gap and row.met != worst.met:
                rows.setdefault(row.met, []).append(row)
        met = [(name, [each.value for each in own], own) for name, own in rows.items()]
        near = [
            (_rank(row), name, row)
            for name, values, own in met
            if min(values) <= worst.value <= max(values)
            for row in [min(own, key=lambda each: abs(each.value - worst.value))]
            if abs(row.value - worst.value) <= _APART * (self.within[1] - self.within[0])
        ]
        rank, name, row = min(near, default=(math.inf, "", worst), key=lambda each: each[0])
        if rank > _MILDER * _rank(worst):
            return ""
        found = f"; a milder motion exists there too (met {name})"
        if not row.state.rattles:
            return found.replace("milder motion", f"motion in which {row.gap} is {row.state}")
        key, units = _key([row]), self.system.units
        unit = units.signal({"rms": row.part, "peak": f"{row.gap}.force"}.get(key, "'"))[1] if units else ""
        what = {"rms": "rms acceleration", "peak": "peak force", "approach": "impacts at"}[key]
        return f"{found}: {what} about {_plain(rank, 3)} {unit}".rstrip()

    def _moved(self, end: BandEnd, count: int) -> str:
        """Write the parameters that move an end most, with their percent per percent."""
        found = main_movers(self.system, {each.name: each.share for each in end.movers})
        return ", ".join(f"{name} {share:+.2f}" for name, share in found[:count])

    def _range(self, band: RattleBand) -> str:
        """Write where a band is: with its errors where they exceed the rounding, and where only the range begins."""
        texts, ends = told_apart(band.low.value, band.high.value), (band.low, band.high)
        unit = self.system.units.parameter(self.parameter) if self.system.units else ""
        low, high = (_end_words(end, text) for text, end in zip(texts, ends, strict=True))
        first, last = (f"{text} {unit}".rstrip() for text in (low, high))
        match [end.kind == RANGE for end in ends]:
            case [True, True]:
                return f"over the whole range, {low} to {last}"
            case [True, False]:
                return f"from the beginning of the range, {first}, to {last}"
            case [False, True]:
                return f"from {first} to the end of the range, {last}"
        return f"from {low} to {last}"

    @summarizes
    def summary(self, *, notes: bool = True) -> SummaryParts:
        """Return the ranked gaps, a sentence for each, the bands, the severity along them, and notes if wanted."""
        if self.worst[1:]:
            yield from self._ranking()
        yield from (self.sentence(gap) for gap in self.gaps)
        symbol = parameter_symbol(self.parameter, self.system.units)
        rows, groups = [], []
        for band in self.bands:
            for name, end in (("from", band.low), ("to", band.high)):
                movers = self._moved(end, _SHOWN)
                error = f"{end.error:{'.0e' if end.error < 1.0 else '.3g'}}" if end.error else ""
                error = f">= {error}" if end.kind == SELDOM else error
                what = ", ".join(band.states) if name == "from" else ""
                head = (band.gap, band.met) if name == "from" else ("", "")
                rows.append((*head, name, f"{end.value:.8g}", error, end.kind, movers, what))
            groups.append(len(rows) - 1)
        if rows:
            yield ""
            headings = ("gap", "met", "", f">{symbol}", ">±", "end", "moved most by (% per %)", "gap closes on")
            yield Table(headings, rows, groups, [headings[k] for k in (6, 4, 7)]).filled
        for gap in self.gaps:
            yield from self._severity_parts(gap)
        if notes:
            yield from remarks(self.notes, ())

    def _ranking(self) -> SummaryParts:
        """Yield a table of the gaps from the worst rattle to the mildest."""
        units, is_rms = self.system.units, bool(self._unit(self.worst[0]))
        rows = []
        for each in ranked(self):
            row, bands = each.severity, self.of(each.severity.gap)
            ends = (f"{end.value:.6g}" for end in (bands[0].low, bands[-1].high))
            figures = (row.rms, row.per_second, row.peak) if is_rms else (_rank(row), row.per_second)
            rms, *others = (_figure(figure, row) for figure in figures)
            rows.append((row.gap, *ends, f"{row.value:.6g}", f"{rms} {self._unit(each)}".rstrip(), *others))
        rows += [(gap, "quiet", *[""] * (len(rows[0]) - 2)) for gap in self.gaps if not self.of(gap)]
        first = ">rms" if is_rms else f">{_KEYS[_key(each.severity for each in self.worst)]}"
        many = ">impacts/s" if units else ">impacts/time"
        of = f"[{units.parameter(self.parameter)}]" if units and units.parameter(self.parameter) else ""
        places = (f">{name} {of}".rstrip() for name in ("rattles from", "to", "worst at"))
        headings = ("gap", *places, first, many, *[">peak [N m]"] * is_rms)
        yield Table(headings, rows)
        if len({self._unit(each) for each in self.worst}) > 1:
            yield "accelerations in rad/s^2 are those of parts without a radius; they rank behind those in m/s^2"
        yield ""

    def _unit(self, worst: Worst) -> str:
        """Return the unit of the acceleration by which a gap is ranked; empty if it is ranked by something else."""
        is_rms = self.system.units and _key([worst.severity]) == "rms"
        return self.system.units.signal(worst.severity.part)[1] if self.system.units and is_rms else ""

    def tables(self) -> Tables:
        """Return the tables of bands, of what moves their ends, and of severity."""
        along = self.parameter
        ends = dict.fromkeys(["from", "from.error", "to", "to.error"], along)
        severity = {"value": along, "peak": ".force", "approach": "'", "power": "W", "level": "dB", "per_second": "1/s"}
        moved = any(end.movers for band in self.bands for end in (band.low, band.high))
        return {
            "bands": TableRows(self._band_rows, units=ends),
            **({"movers": TableRows(self._mover_rows, units={"value": along})} if moved else {}),
            "severity": TableRows(self._severity_rows, units=severity),
        }

    def _severity_parts(self, gap: str) -> SummaryParts:
        rows = [each for each in self.severities if each.gap == gap and each.state.rattles]
        if not rows:
            return
        chosen = sorted(self._listed(rows), key=_place)
        largest = _RANKED[_key(rows)]
        units = self.system.units
        symbol = parameter_symbol(self.parameter, units)
        of = (lambda name, unit: f">{name} [{unit}]") if units else (lambda name, unit: f">{name}")
        of_parts = {units.signal(row.part)[1] for row in rows} if units else {""}
        unit = of_parts.pop() if len(of_parts) == 1 else "rad/s^2 or m/s^2"
        level = f">level [{f'dB re {self.reference:g} {unit}'.rstrip()}]"
        yield f"\n{gap}: the {len(chosen)} motions with the {largest}, of {len(rows)} that rattle"
        headings = (f">{symbol}", "met", "state", "period", "part", of("rms", unit), of("most", unit), ">kurtosis")
        headings += (of("lost", "W"), ">impacts/s" if units else ">impacts/time", ">per turn", of("peak", "N m"))
        headings += (of("approach", units.state("'") if units else ""), level)
        yield Table(
            headings,
            [
                (
                    f"{row.value:.6g}",
                    row.met,
                    row.words,
                    str(row.period or "none"),
                    row.part.removesuffix(".acceleration"),
                    with_error(row.rms, row.error) if row.error else _figure(row.rms, row),
                    *(
                        _figure(number, row)
                        for number in (row.largest, row.kurtosis, row.power, row.per_second, row.per_turn)
                    ),
                    _figure(row.peak, row),
                    _figure(row.approach, row),
                    "-" if math.isnan(row.level) else f"{row.level:.1f}",
                )
                for row in chosen
            ],
            spare=[headings[place] for place in (13, 7, 10, 8, 6, 11, 12) if place != _COLUMNS.get(_key(rows))],
        )

    def _listed(self, rows: Sequence[Severity]) -> list[Severity]:
        """Return the rows with the largest figures; of many at nearly one value, one for each different motion."""
        found: list[Severity] = []
        is_dense = any(sweep.lanes for sweep in self.sweeps)
        apart = abs(self.within[1] - self.within[0]) * _APART if is_dense else 0.0
        for row in sorted(rows, key=_rank, reverse=True):
            near = (each for each in found if is_dense and abs(each.value - row.value) < apart)
            if not any(each.met == row.met or row.rms > _LIKE * each.rms for each in near):
                found.append(row)
            if len(found) == _LISTED:
                break
        return found

    def _value(self, value: float, digits: int = 6) -> str:
        unit = self.system.units.parameter(self.parameter) if self.system.units else None
        return f"{_plain(value, digits)} {unit}" if unit else _plain(value, digits)

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
        names, units = [field.name for field in fields(Severity)], self.system.units
        yield [*names, *["acceleration_unit"] * bool(units)]
        for row in self.severities:
            own = [units.signal(row.part)[1]] if units else []
            yield [*(str(getattr(row, name)) if name == "state" else getattr(row, name) for name in names), *own]

    def __repr__(self) -> str:
        return f"RattleBands({'; '.join(self.sentence(gap) for gap in self.gaps)})"


def _end_words(end: BandEnd, text: str) -> str:
    """Write an end of a band: with its error where that exceeds the rounding of its text, and is more than a step."""
    if end.kind == SELDOM:
        return f"about {text}"
    is_vague = end.error > max(abs(float(text) - end.value), 5e-7 * abs(end.value))
    return with_error(end.value, end.error) if is_vague else text


def _figure(number: float, row: Severity) -> str:
    """Write a figure of a motion; that of a sample of one without period has three digits, an undefined one none."""
    if math.isnan(number):
        return "-"
    return _plain(number, 4 if row.period else 3)


def _plain(number: float, digits: int) -> str:
    """Write a number to some digits, without a power of ten up to a million: 2540 in place of 2.54e+03."""
    return f"{float(f'{number:.{digits}g}'):g}"


def _is_told(row: Severity) -> bool:
    """Return True if a motion is known by its peak force or an interval; without period the force is of a sample."""
    return (row.period > 0 and not math.isnan(row.peak)) or row.error > 0.0


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


def severities_of(system: System, sweep: SettledSweep, gaps: Sequence[str], reference: float) -> list[Severity]:
    """Return the severity of each gap along a sweep: at spread points of its stretches, and at its samples."""
    if sweep.lanes:
        places = [acceleration_names(system), *(accelerations_at(system, gap) for gap in gaps)]
        motions = [motion for motion in sweep.lanes if not motion.diverged]
        rows = [row for motion in motions for row in _rows_of_lanes(system, motion, sweep, gaps, places, reference)]
        return sorted(rows, key=_place)
    # Beside the worst motion of a stretch, its neighbours are examined too.
    apart = _APART * (sweep.within[1] - sweep.within[0])
    rows: list[Severity] = []
    worst, beside = -1.0, []
    for piece in sweep.pieces:
        found = []
        if isinstance(piece, Sample):
            found = _rows_at(piece, sweep, gaps, reference)
            worst, beside = max([(worst, beside), *((_rank(row), []) for row in found)], key=lambda each: each[0])
        else:
            places = list(_spread(piece.points, apart, gaps))
            for place in places:
                found += (own := _rows_at(piece.points[place], sweep, gaps, reference))
                if (peak := max(map(_rank, own))) > worst:
                    near = [place + k for k in range(-_NEXT, _NEXT + 1) if place + k not in places]
                    worst, beside = peak, [piece.points[k] for k in near if 0 <= k < len(piece.points)]
        rows += found
    for point in beside:
        rows += _rows_at(point, sweep, gaps, reference)
    return sorted(rows, key=_place)


def _key(rows: Iterable[Severity]) -> str:
    """Return the name of the figure by which severities are ranked, the one that pictures show."""
    rows = list(rows)
    if all(math.isnan(row.peak) for row in rows):
        return "approach"
    # in a train the force holds the preload, and so ranks gears by their drag: the part's acceleration does not
    return "rms" if any(row.part.endswith(".acceleration") and row.rms == row.rms for row in rows) else "peak"


def _rank(row: Severity) -> float:
    """Return the number by which severities are ranked."""
    return getattr(row, _key([row])) if row.state.rattles else -1.0


def _spread(points: Sequence[BranchPoint], apart: float, gaps: Sequence[str]) -> Iterator[int]:
    """Yield the places of points at least some distance apart, farther where all gaps are quiet."""
    # The first is among them, and both points beside each beginning or end of rattle.
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
    names = [name.removesuffix("''") for name in accelerations_at(system, gap)]
    own = [each for each in whole.coordinates if each.coordinate in names]
    signal = max(own, key=lambda each: math.inf if math.isnan(each.rms) else each.rms)
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
        _level(signal.rms, reference),
        signal.peak,
        0.0,
        signal.coordinate if "." in signal.coordinate else f"{signal.coordinate}''",
    )


def _level(rms: float, reference: float) -> float:
    return -math.inf if rms == 0.0 else 20.0 * math.log10(rms / reference)


def _rows_of_lanes(
    system: System,
    motion: LaneMotion,
    sweep: SettledSweep,
    gaps: Sequence[str],
    names: Sequence[Sequence[str]],
    reference: float,
) -> Iterator[Severity]:
    """Yield the severity of each gap in a motion settled by equal steps."""
    structure, (every, *parts) = system.structure, names
    pace = motion.value if sweep.parameter == structure.pace else system[structure.pace]
    per_second = structure.frequency * pace / (2.0 * math.pi)
    of_work = 1.0 if system.units is None else system.units.angle
    for gap, state, own in zip(gaps, lane_states(motion, sweep.contacts, gaps), parts, strict=True):
        place = sweep.contacts.index(gap)
        signal = max((every.index(name) for name in own), key=lambda k: motion.rms[k])
        impacts, rms = float(motion.sides[place].sum()), float(motion.rms[signal])
        often = chance_of(int(motion.parted[place]), motion.watched)
        yield Severity(
            gap,
            sweep.met,
            motion.value,
            state,
            motion.period,
            impacts,
            impacts * per_second,
            math.nan if system.turns is None else impacts * float(system.turns),
            float(motion.peak[place]),
            float(motion.approach[place]),
            float(motion.power[place]) * of_work,
            rms,
            float(motion.kurtosis[signal]),
            _level(rms, reference),
            float(motion.largest[signal]),
            float(motion.error[signal]),
            every[signal],
            often.value,
            *((often.value, often.value) if motion.period else (often.low, often.high)),
        )


def worst_of(
    system: System,
    parameter: str,
    severities: Sequence[Severity],
    gap: str,
    starts: int,
    seed: int,
    sweeps: Sequence[SettledSweep],
    shares: dict[tuple[str, float], float],
) -> Worst | None:
    """Return the worst motion of a gap, with the share of random starts that lead to it; None if the gap is quiet.

    Shares of motions by equal steps are kept by how they are met and their value: one may be the worst of several gaps.
    """
    rows = [row for row in severities if row.gap == gap and row.state.rattles]
    if not rows:
        return None
    worst = max(rows, key=_rank)
    share, motion = math.nan, regime_word(Regime.PERIODIC, worst.period) if worst.period else NOT_PERIODIC
    lanes = (motion for sweep in sweeps if sweep.met == worst.met for motion in sweep.lanes)
    settled = next((motion for motion in lanes if motion.value == worst.value), None)
    if settled is not None and not worst.period:
        motion = f"{NOT_PERIODIC} in {settled.watched} forcing periods"
    if starts and settled is not None:
        if (place := (worst.met, worst.value)) not in shares:
            (started,) = started_piece(system, parameter, starts, seed, [(settled,)])
            shares[place] = started.led[0] / started.count
        share = shares[place]
    elif starts:
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
    kinds = found.regimes.tolist()
    most = Regime(max(kinds, key=kinds.count))
    if most is Regime.QUASI_PERIODIC:  # or a transient that takes thousands of periods
        most = Regime(take_another_look(system, found.states[kinds.index(most)])[0])
    return most.text if most in (Regime.CHAOTIC, Regime.QUASI_PERIODIC) else NOT_PERIODIC


_TINTS = {GapState.ONE_SIDE: ("one", "rattles on one side"), GapState.BOTH_SIDES: ("both", "rattles on both sides")}
_LOOKS = ("third", "main", "before", "fourth")  # of gaps beside the chosen one
_SAMPLED = 64  # samples of a forcing period of a motion without period


@pictured(RattleBands, size=(8.0, 9.0))
def rattle_picture(found: RattleBands, gap: str | None = None) -> Picture:
    """Describe the bands of a gap, the worst if none is named, over the response, with severity and impacts below."""
    worst = next((each.severity for each in ranked(found)), None)
    gap, units = chosen_gap(found.gaps, gap or (worst and worst.gap)), found.system.units
    every = {each: moved_by(found.system, each)[0] for each in (gap, *found.gaps)}  # the chosen one is the first
    moved, others = every[gap], [each for each in every if each != gap and found.of(each)]
    drawn = "accelerations only" if worst and found._unit(Worst(worst, math.nan, 0)) else "not drawn here"
    curves = [
        NamedCurve(f"{sweep.met}-{number}", stretch.branch, *_look(found, sweep.met), stretch.points)
        for sweep in found.sweeps
        for number, stretch in enumerate(sweep.stretches, start=1)
    ]
    return Picture(
        found.system,
        (found.parameter, f"half.{moved}"),
        curves,
        partial(_parts_of_bands, found, every),
        sentences=[found.sentence(each) for each in every],
        heading=[found.sentence(gap), *([f"of {', '.join(others)}: {drawn}"] if others else [])],
        contacts=tuple(every),
        of=gap,
        script="[stretch.branch for sweep in record.sweeps for stretch in sweep.stretches]",
        words=("", f"amplitude of {moved}" + (f" [{units.signal(moved)[1]}]" if units else "")),
        height=1.25,
        reach={found.parameter: found.within, f"half.{moved}": (0.0, None)},
    )


def ranked(found: RattleBands) -> list[Worst]:
    """Return the worst motions of the gaps from loud to quiet: first those whose part has a radius, then the others."""
    return sorted(found.worst, key=lambda each: (found._unit(each) == "rad/s^2", -_rank(each.severity)))


def chosen_gap(gaps: Sequence[str], gap: str | None) -> str:
    """Return a gap that is named, or the first one."""
    name = gaps[0] if gap is None else gap
    if name not in gaps:
        raise ModelError(f"gap is {gap!r}; {did_you_mean(name, gaps)}")
    return name


def _look(found: RattleBands, met: str) -> tuple[str, str]:
    """Return the style and the legend of motions that are met in a way."""
    if met not in list(Direction):
        return "other", "other motions"
    return met, f"{found.parameter.rpartition('.')[2].replace('_', ' ')} {met}"


def _parts_of_bands(found: RattleBands, moved: Mapping[str, str]) -> Parts:
    over, units = found.parameter, found.system.units
    bands = [band for gap in found.gaps for band in found.of(gap)]
    ends = [(band.gap, *pair) for band in bands for pair in (("from", band.low), ("to", band.high))]
    unit = units.parameter(over) if units else ""
    return Parts(
        layers=list(_samples(found, dict.fromkeys(moved.values()))),
        shades=[each for gap in found.gaps for each in _shades(found, gap)],
        lines=[
            Line(over, end.value, _end_words(end, f"{end.value:.6g}"), end.is_located, gap, end.kind)
            for gap, _, end in ends
        ],
        below=[each for gap in found.gaps for each in _severity_panels(found, gap)],
        ends=[
            End(f"{word} {end.value:.7g} {unit}".rstrip(), end.kind, end.special, found._moved(end, 2), gap)
            for gap, word, end in ends
        ],
        within={over: found.within},
        more={"measures": {gap: f"half.{name}" for gap, name in moved.items()}},
    )


def _samples(found: RattleBands, moved: Iterable[str]) -> Iterator[Series]:
    """Yield the amplitudes of some coordinates in the motions that were sampled, because they have no branch."""
    wanted = [((found.parameter, f"half.{name}"), found.system.coordinates.index(name)) for name in moved]
    for sweep in found.sweeps:
        own = [motion for motion in sweep.lanes if not motion.diverged]
        for mark, periodic in (("dots", True), ("crosses", False)):
            chosen = [motion for motion in own if bool(motion.period) is periodic]
            for axes, place in wanted if chosen else ():
                half = [0.5 * float(motion.extremes[2, place] - motion.extremes[0, place]) for motion in chosen]
                yield Series([motion.value for motion in chosen], half, mark, _look(found, sweep.met)[0], axes=axes)
    for axes, _ in wanted if any(row.period == 0 for row in found.severities) else ():
        bars = any(not each.motion.orbit for sweep in found.sweeps for each in sweep.samples)
        text = "not periodic while watched" + "; bar: least to largest amplitude of its periods" * bars
        yield Series([], [], "crosses", "measured", text, axes=axes)
    for sweep in found.sweeps:
        look = _look(found, sweep.met)[0]
        for mark, own in (
            ("dots", [each for each in sweep.samples if each.motion.orbit]),
            ("crosses", [each for each in sweep.samples if not each.motion.orbit]),
        ):
            motions = [each.motion.motion(_WATCHED, _SAMPLED).q for each in own]
            values = [each.value for each in own]
            for axes, place in wanted if own else ():
                paths = [q[:, place] for q in motions]
                yield Series(values, [0.5 * float(np.ptp(path)) for path in paths], mark, look, axes=axes)
                if mark == "crosses":  # from the smallest to the largest of single periods
                    halves = [0.5 * np.ptp(path[: _WATCHED * _SAMPLED].reshape(_WATCHED, -1), axis=1) for path in paths]
                    ends = [(float(each.min()), float(each.max()), math.nan) for each in halves]
                    yield Series(np.repeat(values, 3), np.ravel(ends), "line", look, axes=axes)


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
    key = _key(row for row in rows if row.state.rattles)
    part = next((row.part for row in rows if row.part), "")
    title = {
        "approach": f"approach velocity{f' [{units.state(chr(39))}]' if units else ''}",
        "rms": f"rms acceleration of {part.removesuffix('.acceleration')} [{units.signal(part)[1] if units else ''}]",
        "peak": "peak torque [N m]" if units else "peak force",
    }[key]
    worst = [each.severity for each in found.worst if each.severity.gap == gap][:1]
    stars = [Series([each.value], [getattr(each, key)], "stars", "worst", "worst") for each in worst]
    unit = units.signal(part)[1] if units and key == "rms" else ""
    same, *others = _of_others(found, gap, unit).items()
    title = f"rms acceleration [{unit}]" if same[1] else title
    yield Panel(title, found.parameter, [*_along(found, rows, key), *same[1], *stars], gap)
    for other, series in others:
        yield Panel(f"rms acceleration [{other}]", found.parameter, series, gap, height=0.7)
    many = "impacts per s" if units else "impacts per time"
    yield Panel(many, found.parameter, list(_along(found, rows, "per_second")), gap, height=0.8)


def _of_others(found: RattleBands, gap: str, unit: str) -> dict[str, list[Series]]:
    """Return the largest accelerations along the parameter behind other gaps that rattle, by unit."""
    of_unit: dict[str, list[Series]] = {unit: []}
    others = (each for each in ranked(found) if unit and each.severity.gap != gap)
    for each, look in zip(others, cycle(_LOOKS), strict=False):
        largest: dict[float, float] = {}
        for row in (row for row in found.severities if row.gap == each.severity.gap):
            largest[row.value] = max(row.rms, largest.get(row.value, 0.0))
        text = f"{each.severity.gap} ({each.severity.part.removesuffix('.acceleration')})"
        of_unit.setdefault(found._unit(each), []).append(Series([*largest], [*largest.values()], "line", look, text))
    return of_unit


def _along(found: RattleBands, rows: Sequence[Severity], key: str) -> Iterator[Series]:
    """Yield the series of one figure along the motions met in each way; the legend has the first marks of each."""
    values = sorted({row.value for row in rows})
    step = float(np.median(np.diff(values))) if values[1:] else math.inf
    for met in dict.fromkeys(row.met for row in rows):
        own = [row for row in rows if row.met == met]
        look, text = _look(found, met)
        x, y = np.array([(row.value, getattr(row, key)) for row in own]).T
        # other motions are met here and there: no line leads over more than two steps without one
        apart = np.flatnonzero(np.diff(x) > 2.5 * step) + 1 if look == "other" else []
        yield Series(np.insert(x, apart, math.nan), np.insert(y, apart, math.nan), "line", look)
        is_periodic = np.array([row.period > 0 for row in own])
        for mark, chosen in (("dots", is_periodic), ("crosses", ~is_periodic)):
            if chosen.any():
                yield Series(x[chosen], y[chosen], mark, look, text)
                text = ""

"""Answers on the page: the description of a record's picture, its sentences and its tables as JSON values.

A record that is not described (see `gapwalk.picture_parts`) has its sentences and tables alone.
"""

from __future__ import annotations

import base64
from collections.abc import Callable, Iterator, Sequence
from dataclasses import fields
from functools import lru_cache, partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gapwalk.answers.order_map import orders_of
from gapwalk.answers.run_up import RunUp
from gapwalk.answers.shown_measure import shown_measure
from gapwalk.attractors.basins import BasinShares
from gapwalk.attractors.spectrum import BAND, SECOND, Sound, Tracked, Waterfall, line_name, turns_of, unit_of
from gapwalk.bifurcation.branch import Branch
from gapwalk.bifurcation.loci import Locus
from gapwalk.errors import GapwalkError
from gapwalk.explorer.diagram_lines import quantity_words
from gapwalk.flow.flow import PERIOD
from gapwalk.meanings import FILLS
from gapwalk.model.system import System
from gapwalk.model.words import line_words, order_words, parameter_symbol, parameter_words, signal_words
from gapwalk.picture_parts import (
    SECTION,
    Cells,
    Cloud,
    Description,
    End,
    NamedCurve,
    Panel,
    Parts,
    Picture,
    Series,
    Whole,
    description_of,
    pictured,
)
from gapwalk.plot.picture import lay_out, picture_of, png_bytes, sheet_bytes
from gapwalk.plot.style import in_style
from gapwalk.studies.branch_family import Family, SpecialPointPath
from gapwalk.studies.options import ParameterRange
from gapwalk.studies.run_up_study import RunUpStudy
from gapwalk.studies.study_kind import Finding
from gapwalk.studies.sweep_study import Sweep, Way
from gapwalk.summary import Table, text_of

# Pictures on the page of records whose picture on paper shows other things: shares, sweeps, families.

Json = dict[str, Any]

_DIGITS = 7  # that a screen can show


def numbers(values: ArrayLike) -> list[float | None]:
    """Return numbers with the digits that a screen can show; None for what is not finite."""
    array = np.asarray(values, dtype=float)
    return [float(f"{value:.{_DIGITS}g}") if np.isfinite(value) else None for value in array.tolist()]


def share_bars(found: BasinShares) -> list[Json]:
    """Return the shares of starts as bars, with their confidence limits."""
    return [
        {
            "name": each.name,
            "share": each.share,
            "low": each.low,
            "high": each.high,
            "text": f"{each.share:.1%} ({each.low:.1%} to {each.high:.1%})",
            "color": FILLS[number % len(FILLS)],
        }
        for number, each in enumerate(found.shares)
    ]


@pictured(BasinShares, forms=())
def shares_picture(found: BasinShares) -> Picture:
    """Describe the share of random starts that lead to each attractor, with its confidence limits."""
    shares = ", ".join(f"{each.name} {each.share:.1%}" for each in found.shares)
    said = [f"Of {len(found.labels):,} random starts: {shares}"]
    return Picture(found.system, parts=lambda: Parts(more={"shares": share_bars(found)}), sentences=said)


_LEVELS = 700  # of the section points at one value: points nearer to each other than a pixel are drawn once
_SAID = 5  # bands that the sentence names
_COORDINATES = 4  # whose sections are drawn
_SHOWN_VALUES = 6000  # points of one order of values that a page draws without waiting
_LOOKS = {
    Way.UP: ("rising", "rising parameter"),
    Way.DOWN: ("falling", "falling parameter"),
    Way.AGAIN: ("main", "each value from the start"),
}


@pictured(Sweep, forms=())
def sweep_picture(found: Sweep) -> Picture:
    """Describe the points of the section over the parameter, in a colour for each order of the values."""
    return Picture(
        found.system,
        (found.parameter, f"{SECTION}{found.system.coordinates[0]}"),
        (),
        partial(_parts_of_sweep, found),
        sentences=_bands_met(found),
    )


def _bands_met(found: Sweep) -> list[str]:
    """Return the motions that the first direction meets, one after the other; nothing if there are none yet."""
    way, bands = found.lanes[0].way, found.bands(0)
    if not bands:
        return []
    bands = bands[::-1] if way is Way.DOWN else bands
    ends = [band.low if way is Way.DOWN else band.high for band in bands]
    met = ", ".join(f"{band.regime} to {end:.4g}" for band, end in zip(bands[:_SAID], ends[:_SAID], strict=True))
    more = f", and {len(bands) - _SAID} more" if len(bands) > _SAID else ""
    return [f"{_LOOKS[way][1].capitalize()}: {met}{more}"]


def _parts_of_sweep(found: Sweep) -> Parts:
    ways = [way for way in Way if any(lane.way is way for lane in found.lanes)]
    coordinates = found.system.coordinates[:_COORDINATES]
    return Parts(
        layers=[_layer(found, way, each) for each in coordinates for way in ways],
        quantities=[f"{SECTION}{each}" for each in coordinates],
        within={found.parameter: (float(found.values[0]), float(found.values[-1]))},
    )


def _layer(found: Sweep, way: Way, coordinate: str) -> Series:
    """Return the points of all lanes of one order, without those that a screen cannot tell apart."""
    parts = [found.section(coordinate, place) for place, lane in enumerate(found.lanes) if lane.way is way]
    x, y = (np.concatenate(each) for each in zip(*parts, strict=True))
    if len(y):
        height = float(np.ptp(y)) or 1.0
        level = np.rint((y - y.min()) / height * _LEVELS)
        _, places = np.unique(np.column_stack([x, level]), axis=0, return_index=True)
        places = places[:: -(-len(places) // _SHOWN_VALUES)]
        x, y = x[places], y[places]
    return Series(x, y, "dots", *_LOOKS[way], axes=(found.parameter, f"{SECTION}{coordinate}"))


@pictured(Family, forms=())
def family_picture(found: Family, measure: str = "") -> Picture:
    """Describe the branches of all members, and their special points joined from one to the next."""
    names = tuple(name for name in found.over.names if name in found.system.parameters)
    name = parameter_symbol(found.over.name, found.system.units if found.over.name in names else None)
    values = [member.value for member in found.members]
    ends = f"{len(values)} values of {name} from {values[0]:.6g} to {values[-1]:.6g}"
    several = [path for path in found.point_paths if len(path.places) > 1]
    return Picture(
        found.system,
        (found.parameter, measure or shown_measure(found.system, None)),
        [
            NamedCurve(f"{each} at {found.over.name} = {member.value:.6g}", branch)
            for member in found.members
            for each, branch in member.named
        ],
        partial(_parts_of_family, found, several),
        sentences=[f"{ends}: {len(several)} special points continue from member to member"],
        parameters=names,
        script="record.branches",
    )


def _parts_of_family(found: Family, several: list[SpecialPointPath]) -> Parts:
    """Return the depth of each curve in three dimensions, and the paths of special points."""
    name = found.over.name
    words = parameter_words(name, found.system.units) if name in found.system.parameters else name
    values = [member.value for member in found.members for _ in member.branches]
    places: dict[tuple[int, int], int] = {}
    for member in found.members:
        for index in range(len(member.branches)):
            places[member.number, index] = len(places)
    ribs = [_rib(path, places) for path in several]
    more = {"space": {"words": words, "values": values}, "ribs": ribs}
    return Parts(within={found.parameter: found.within}, more=more)


def _rib(path: SpecialPointPath, places: dict[tuple[int, int], int]) -> Json:
    """Return the special points of a path by the indices of their curves; inexact where a connection is a guess."""
    points = [[places[place.member, place.branch], place.special] for place in path.places]
    return {"kind": path.kind.value, "text": path.name, "exact": path.exact, "points": points}


# View of one run-up on the page: amplitudes over the speed, up and down, an order map, and what can be heard of it.
#
# The order map and the lines of single orders are those of one signal, which the page chooses, with a measured record
# next to them if there is one. All maps of an answer have one scale of amplitudes.

_SHOWN_COORDINATES = 6  # whose motion is drawn over a diagram
_PERIODS = 1500  # of a leg that are drawn; of more, the extremes of several
_SIGNALS = 24  # that can be heard
_ORDERS = 10  # highest multiple of the excitation in a map, where the study asks for none
_WINDOW, _LEAST = 8, 2  # turns of a spectrum, where the study says none; forcing periods at least
_WINDOWS = 240  # columns of a map
_DEPTH = 60.0  # dB below the largest amplitude of all maps that a map shows
_TRACKS = 3  # orders whose amplitudes are drawn over the speed; of the loads, twice as many
_RATE = 48_000  # samples per second
_WAYS = {True: ("rising", "rising speed"), False: ("falling", "falling speed")}


@pictured(RunUp, forms=())
def run_up_picture(found: RunUp, signal: str = "") -> Picture:
    """Describe half the range of a coordinate in each period over the speed, and below the signal and the forces."""
    signal, names, pace = signal or found.loudest, found.system.coordinates, found.system.structure.pace
    axes = pace, f"half.{signal if signal in names else names[0]}"
    return Picture(found.system, axes, (), partial(_parts_of_picture, found, signal, axes), sentences=found.sentences)


def _parts_of_picture(run: RunUp, signal: str, axes: tuple[str, str]) -> Parts:
    """Return the amplitude over the speed for each coordinate, the histories below, and what can be heard."""
    pace, system = axes[0], run.system
    below = [Panel(signal_words(signal, system.units), pace, list(_extremes(run, signal)))]
    for each in run.peaks:
        if each.force:
            title = f"force of {each.contact}" + " [N m]" * bool(system.units)
            star = Series([each.speed], [each.force], "stars", "worst", "largest")
            below.append(Panel(title, pace, [*_extremes(run, f"{each.contact}.force"), star]))
    names = dict.fromkeys((axes[1].partition(".")[2], *system.coordinates[:_SHOWN_COORDINATES]))
    return Parts(
        layers=[each for name in names for each in _amplitudes(legs(run, name), (pace, f"half.{name}"))],
        below=below,
        within={pace: (float(run.speed.min()), float(run.speed.max()))},
        more={"heard": _heard(run, signal)},
    )


def _amplitudes(tracked: Sequence[Tracked], axes: tuple[str, str], measured: str = "") -> Iterator[Series]:
    """Yield half the range of each period over the speed, for each way; of a record with its name."""
    for way in (True, False):
        parts = [_thinned(*leg.extremes()) for leg in tracked if leg.rises is way]
        if not parts:
            continue
        speed, low, high = (np.concatenate(each) for each in zip(*parts, strict=True))
        look, words = _WAYS[way]
        text = f"{measured or 'run-up'}, {words}: each period"
        mark, look = ("crosses", "measured") if measured else ("dots", look)
        yield Series(speed, 0.5 * (high - low), mark, look, text, axes=axes)


def _extremes(run: RunUp, signal: str) -> Iterator[Series]:
    seen: set[bool] = set()
    for leg in legs(run, signal):
        speed, low, high = _thinned(*leg.extremes())
        look, words = _WAYS[leg.rises]
        text = "" if leg.rises in seen else f"extremes of each period, {words}"
        seen.add(leg.rises)
        yield Series(speed, low, "line", look, text)
        yield Series(speed, high, "line", look)


def _heard(run: RunUp, signal: str) -> Json:
    """Return the signals to listen to, and the speed over the seconds that the sound lasts."""
    units = run.system.units
    forces = [f"{each.contact}.force" for each in run.peaks if each.force]
    others = [name for name in run.signals if name.endswith(("''", ".torque"))]
    asked = signal if signal.endswith(("''", ".force", ".torque")) else f"{run.loudest}''"
    names = list(dict.fromkeys((asked, *forces, *others)))[:_SIGNALS]
    second = 1.0 if units else SECOND
    return {
        "signals": [[name, signal_words(name, units)] for name in names],
        "seconds": numbers(run.course.time / second),
        "speeds": numbers(run.course.speed),
        "pitch": float(run.system.structure.frequency * second / PERIOD),
    }


class HeardRunUp:
    """Order maps and sounds of a run-up, over the orders and with the windows that its study asks for."""

    def __init__(self, view: AnswerView) -> None:
        asked = getattr(view.finding, "asked", None)
        self.view, self.record = view, view.record
        self._asked = asked if isinstance(asked, RunUpStudy) else None

    def heard(self, signal: str, record: Tracked | None = None, name: str = "") -> Json:
        """Return order maps and the lines of single orders of a signal, with a measured record laid over."""
        run, system = self.record, self.record.system
        own = legs(run, signal)
        maps = [(_WAYS[leg.rises][1], leg.rises, "", self._map(leg)) for leg in own]
        measured = () if record is None else record.legs()
        maps += [(f"{name}, {_WAYS[leg.rises][1]}", leg.rises, name, self._map(leg)) for leg in measured]
        kept = [(*rest, found) for *rest, found in maps if found is not None]
        if not kept:
            return {"maps": [], "tracks": [], "layers": [], "why": "It is shorter than two forcing periods."}
        top = max(float(found.amplitudes[:, 1:].max()) for *_, found in kept) or 1.0
        axes = system.structure.pace, f"half.{signal}"
        layers = _amplitudes(measured, axes, name) if signal in system.coordinates else ()
        return {
            "maps": [
                {"text": text, "rises": rises, "measured": of, **_plain_map(found, top)}
                for text, rises, of, found in kept
            ],
            "top": top,
            "depth": _DEPTH,
            "unit": unit_of(system, signal),
            "across": order_words(system.units),
            "turns": float(system.turns or 1),
            "tracks": [
                *(self._track(order, kept, signal) for order in self._orders(kept)),
                *self._levels(kept, signal),
            ],
            "layers": [self.view.json_of(each) for each in layers],
            "why": "",
        }

    def _map(self, leg: Tracked) -> Waterfall | None:
        """Return the spectra along a leg, of windows as long as the study says; None if it is too short."""
        asked, turns = self._asked, float(self.record.system.turns or 1)
        count = (leg.theta[-1] - leg.theta[0]) / PERIOD
        window = min(turns_of(self.record.system, asked.window if asked else _WINDOW), int(count) // 2)
        if window < _LEAST:
            return None
        top = (asked.orders if asked else 0.0) or _ORDERS * turns
        top = min(top, (leg.samples / 2.0 - 1.0) * turns)
        step = max(0.25, (count - window) / _WINDOWS / window)
        return leg.waterfall(top, window, 1.0 - min(1.0, step), over_speed=True)

    def _track(self, order: float, kept: Sequence[Any], signal: str) -> Json:
        """Return the amplitude of one order over the speed, up and down, computed and measured."""
        turns = self.record.system.turns
        title = f"{line_words(line_name(order, turns=turns))} of {signal}"
        return self._over_speed(f"order {title}" if turns else title, kept, lambda found: found.cut(order), signal)

    def _levels(self, kept: Sequence[Any], signal: str) -> Iterator[Json]:
        """Yield the root mean square over the speed, and that in the band of rattle."""
        yield self._over_speed(f"overall, root mean square of {signal}", kept, lambda found: found.overall, signal)
        if any(np.isfinite(found.band).any() for *_, found in kept):
            title = f"rattle, {BAND[0]:.0f} to {BAND[1]:.0f} Hz, root mean square of {signal}"
            yield self._over_speed(title, kept, lambda found: found.band, signal)

    def _over_speed(
        self, title: str, kept: Sequence[Any], sizes: Callable[[Waterfall], NDArray[np.float64]], signal: str
    ) -> Json:
        """Return a panel of a quantity of the maps over the speed, up and down, computed and measured."""
        system, series, seen = self.record.system, [], set()
        for _, rises, measured, found in kept:
            look, words = _WAYS[rises]
            text = f"{measured}, {words}" if measured else words
            mark, look = ("crosses" if rises else "dots", "measured") if measured else ("line", look)
            series.append(Series(found.values, sizes(found), mark, look, "" if text in seen else text))
            seen.add(text)
        unit = unit_of(system, signal)
        return self.view.json_of(Panel(f"{title} [{unit}]" if unit else title, system.structure.pace, series))

    def _orders(self, kept: Sequence[Any]) -> list[float]:
        """Return the orders of the loads that all maps have, or the strongest orders."""
        top = min(float(found.orders[-1]) for *_, found in kept)
        return [each for each in orders_of(self.record.system) if each <= top][: 2 * _TRACKS] or _orders(kept)

    def sound(self, signal: str, rate: int = _RATE) -> Sound:
        """Return a signal of the run-up as a sound; raise a ModelError if there is no such signal."""
        return _sound(self.record, signal, rate)


@lru_cache(maxsize=4)
def _sound(run: RunUp, signal: str, rate: int) -> Sound:
    return run.sound(signal, rate=rate)


def legs(run: RunUp, signal: str) -> tuple[Tracked, ...]:
    """Return the parts of a run-up in which the speed rises or falls."""
    tracked = run.tracked(signal)
    return tracked.legs() or (tracked,)


def _plain_map(found: Waterfall, top: float) -> Json:
    """Return a map as JSON values: amplitudes in dB from 0 to 255, of which 255 is the largest of all maps."""
    heights = found.amplitudes[:, 1:]
    with np.errstate(divide="ignore"):
        levels = np.clip(1.0 + 20.0 * np.log10(heights / top) / _DEPTH, 0.0, 1.0)
    cells = np.rint(255.0 * levels).astype(int)
    return {
        "x": numbers(found.values),
        "orders": numbers(found.orders[1:]),
        "cells": ["".join(f"{value:02x}" for value in row) for row in cells.tolist()],
    }


def _orders(kept: Sequence[Any]) -> list[float]:
    """Return the strongest multiples of the excitation, of which a line over the speed is drawn."""
    first: Waterfall = kept[0][-1]
    turns = float(first.turns or 1)
    whole = [place for place, order in enumerate(first.orders) if order and abs(order / turns % 1.0 - 0.5) > 0.499]
    strength = {place: max(float(found.amplitudes[:, place].max()) for *_, found in kept if place < found.orders.size)
                for place in whole}  # fmt: skip
    best = sorted(sorted(strength, key=lambda place: -strength[place])[:_TRACKS])
    return [float(first.orders[place]) for place in best]


def _thinned(
    speed: NDArray[np.float64], low: NDArray[np.float64], high: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return the extremes of several periods in place of those of one, if there are too many."""
    every = max(1, -(-len(speed) // _PERIODS))
    firsts = np.arange(0, len(speed), every)
    if every == 1 or not len(firsts):
        return speed, low, high
    return speed[firsts], np.minimum.reduceat(low, firsts), np.maximum.reduceat(high, firsts)


_ROWS = 60  # of a table
_DPI = 110  # of pictures of surfaces, whose facets would be megabytes as vectors
_MOST = 250_000  # cells that a page draws without waiting; of more, every second (third, ...) of a row and a column


class AnswerView:
    """Content of the page for one record. Amounts are in the units of the model."""

    def __init__(self, found: Any) -> None:
        """Take the finding of a study, or the record of a Python function."""
        self.finding = found if isinstance(found, Finding) else None
        self.record: Any = found if self.finding is None else self.finding.record
        described = description_of(type(self.record))
        options = {} if described is None else _asked(self.finding, described)
        planned = _planned(self.finding)
        self.picture = planned if described is None else described.describe(self.record, **options)

    def curves(self) -> list[tuple[str, Branch | Locus]]:
        """Return its branches and loci with their names; branches come first."""
        return [(each.name, each.curve) for each in self.picture.curves]

    @property
    def axes(self) -> tuple[str, str] | None:
        """Names of the quantities of the axes over which it is shown; None if it has no place in a diagram."""
        return self.picture.axes

    @property
    def system(self) -> System:
        """The system of the record."""
        return self.picture.system or self.record.system

    def sentences(self) -> list[str]:
        """Return the answer in sentences; of unfinished work without a record, how much is stored."""
        first = [part for part in self._summary()[:1] if isinstance(part, str)]
        return list(self.picture.sentences) or first or ([] if self.finding is None else [self.finding.stored])

    def content(self) -> Json:
        """Return all of it as JSON values."""
        sentences, picture, finding = self.sentences(), self.picture, self.finding
        rest = [part for part in self._summary() if part not in sentences]
        notes = () if finding is None or self.record is None else (*finding.notes, *finding.failures)
        return {
            "sentences": sentences,
            "parts": [_plain(part) for part in rest if part != ""],
            "notes": list(notes),
            "contacts": list(picture.contacts),
            "axes": self.axes,
            "complete": getattr(finding or self.record, "complete", True),
            "pictures": [each.text for each in picture.wholes],
            **self._drawn(picture.parts()),
        }

    def _drawn(self, parts: Parts) -> Json:
        drawn: Json = {"ends": [end for each in parts.ends if (end := self._end(each)) is not None]}
        for each in fields(parts):
            if each.name not in ("ends", "paper", "more", "within", "quantities"):
                items = getattr(parts, each.name)
                items = [line for series in items for line in _lines(series)] if each.name == "layers" else items
                drawn[each.name] = [self.json_of(item) for item in items]
        drawn["within"] = {name: list(ends) for name, ends in parts.within.items()}
        drawn["quantities"] = quantity_words(parts.quantities, self.system) if parts.quantities else []
        return {name: value for name, value in drawn.items() if value} | dict(parts.more)

    def json_of(self, part: Any) -> Json:
        """Return a part of a picture as JSON values."""
        match part:
            case Series():
                drawn = {"x": numbers(part.x), "y": numbers(part.y), "axes": list(part.axes)}
                return (
                    drawn
                    | {name: getattr(part, name) for name in ("mark", "look", "text", "of")}
                    | ({"notes": list(part.notes)} if part.notes else {})
                )
            case Panel():
                across, lines = part.across or parameter_words(part.over, self.system.units), part.series
                if part.logarithmic:
                    across, lines = f"{across}, power of ten", [each._replace(x=np.log10(each.x)) for each in lines]
                drawn = {name: getattr(part, name) for name in ("title", "over", "of", "fitted")}
                series = [self.json_of(line) for each in lines for line in _lines(each)]
                return drawn | {"across": across, "series": series}
            case Cloud():
                place = self.picture.place_of(part.special)
                drawn = {"x": numbers(part.x), "quantiles": numbers(part.quantiles), "place": place, "special": None}
                return part._asdict() | drawn
            case Cells():
                every = max(1, int(np.ceil(np.sqrt(part.codes.size / _MOST))))
                return {
                    "axes": list(self.axes or ()),
                    "within": [list(ends) for ends in part.within],
                    "rows": part.codes[::every, ::every].tolist(),
                    "entries": [_entry(*each) for each in part.entries],
                    "of": part.of,
                }
        return part._asdict()

    def _end(self, end: End) -> Json | None:
        """Return a place that the answer names; None if it is a special point of none of the curves."""
        from gapwalk.explorer.motion_panels import gradient_content  # panels know the results, and these their answers

        place = {} if end.gradient else self.picture.place_of(end.special)
        if place is None:
            return None
        found: Json = {"text": end.text, "kind": end.kind, "of": end.of, **place}
        if end.gradient is None:
            return {**found, "most": end.most}
        try:
            return {**found, "place": end.place, "gradient": gradient_content(end.gradient())}
        except GapwalkError as error:
            return {**found, "place": end.place, "gradient": {"reason": str(error)}}

    def _summary(self) -> Sequence[Any]:
        of = self.finding or self.record
        parts = () if self.record is None else of.summary() if hasattr(of, "summary") else (repr(of),)
        return [part.strip("\n") if isinstance(part, str) else part for part in parts]


def _planned(finding: Finding | None) -> Picture:
    """Return a picture with nothing but the axes of what a study asks for, if it is over two ranges of parameters."""
    asked = getattr(finding, "asked", None)
    over = getattr(asked, "over", None)
    if asked is None or not isinstance(over, ParameterRange):
        return Picture(None)
    within = {over.parameter: over.ends, asked.parameter: tuple(sorted((asked.begin, asked.end)))}
    return Picture(None, (over.parameter, asked.parameter), parts=lambda: Parts(within=within))


def _asked(finding: Finding | None, described: Description) -> Json:
    """Return those options of a picture that the study names."""
    asked = getattr(finding, "asked", None) or getattr(finding, "options", None)
    names = {each.name for each in described.options} & {"measure", "signal"}
    return {name: value for name in names if (value := getattr(asked, name, ""))}


def _lines(series: Series) -> Iterator[Series]:
    """Yield a series as the page draws it: what lies between two lines, as both lines; nothing of a text alone."""
    if series.mark == "none":
        return
    if series.mark != "between":
        yield series
        return
    for k, y in enumerate(np.asarray(series.y)):
        yield series._replace(y=y, mark="line", text="" if k else series.text)


def _entry(text: str, color: str) -> Json:
    """Return the entry of a code of cells: with a colour of its own, or with a tint of the style sheet."""
    if color.startswith("#"):
        return {"tint": "", "color": color, "wild": False, "text": text}
    return {"tint": color.removesuffix("-wild"), "wild": color.endswith("-wild"), "text": text}


def _plain(part: Any) -> str | Json:
    """Return a part of a summary as JSON values: a text, or a table."""
    if isinstance(part, str):
        return part
    if not isinstance(part, Table):
        return text_of((part,))
    return {
        "head": [list(column) for column in part.columns],
        "rows": [list(row) for row in part.rows[:_ROWS]],
        "groups": list(part.groups),
        "left_out": max(0, len(part.rows) - _ROWS),
    }


def has_picture(record: object) -> bool:
    """Return True if the page draws a record of this type, and shows more than sentences and tables."""
    return description_of(type(record)) is not None


def drawn_on_paper(whole: Whole) -> dict[str, str]:
    """Draw a picture of `gapwalk.plot`; return its words, its form and its content: an SVG, or a PNG in base64."""
    figure = picture_of(whole.record, **whole.options)
    if whole.form == "svg":
        content = sheet_bytes(figure, "svg").decode()
    else:
        lay_out(figure)
        with in_style():
            content = base64.b64encode(png_bytes(figure, _DPI)).decode()
    return {"text": whole.text, "form": whole.form, "content": content}

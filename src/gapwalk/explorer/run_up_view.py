"""View of one run-up on the page: amplitudes over the speed, up and down, an order map, and what can be heard of it.

The order map and the lines of single orders are those of one signal, which the page chooses, with a measured record
next to them if there is one. All maps of an answer have one scale of amplitudes.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import lru_cache, partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from gapwalk.answers.run_up import RunUp
from gapwalk.attractors.spectrum import SECOND, Sound, Tracked, Waterfall, line_name, unit_of
from gapwalk.explorer.page_pictures import Json, numbers
from gapwalk.flow.flow import PERIOD
from gapwalk.model.words import line_words, order_words, signal_words
from gapwalk.picture_parts import Panel, Parts, Picture, Series, pictured
from gapwalk.studies.run_up_study import RunUpStudy

if TYPE_CHECKING:
    from gapwalk.explorer.answer_view import AnswerView

_COORDINATES = 6  # whose motion is drawn over a diagram
_PERIODS = 1500  # of a leg that are drawn; of more, the extremes of several
_SIGNALS = 24  # that can be heard
_ORDERS = 10  # highest multiple of the excitation in a map, where the study asks for none
_WINDOW, _LEAST = 8, 2  # forcing periods of a spectrum, where the study says none; at least
_WINDOWS = 240  # columns of a map
_DEPTH = 60.0  # dB below the largest amplitude of all maps that a map shows
_TRACKS = 3  # orders whose amplitudes are drawn over the speed
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
    names = dict.fromkeys((axes[1].partition(".")[2], *system.coordinates[:_COORDINATES]))
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
            "tracks": [self._track(order, kept, signal) for order in _orders(kept)],
            "layers": [self.view.json_of(each) for each in layers],
            "why": "",
        }

    def _map(self, leg: Tracked) -> Waterfall | None:
        """Return the spectra along a leg, of windows as long as the study says; None if it is too short."""
        asked, turns = self._asked, float(self.record.system.turns or 1)
        count = (leg.theta[-1] - leg.theta[0]) / PERIOD
        window = min(asked.window if asked else _WINDOW, int(count) // 2)
        if window < _LEAST:
            return None
        top = (asked.orders if asked else 0.0) or _ORDERS * turns
        top = min(top, (leg.samples / 2.0 - 1.0) * turns)
        step = max(0.25, (count - window) / _WINDOWS / window)
        return leg.waterfall(top, window, 1.0 - min(1.0, step), over_speed=True)

    def _track(self, order: float, kept: Sequence[Any], signal: str) -> Json:
        """Return the amplitude of one order over the speed, up and down, computed and measured."""
        system, series, seen = self.record.system, [], set()
        for _, rises, measured, found in kept:
            place = int(np.argmin(np.abs(found.orders - order)))
            look, words = _WAYS[rises]
            text = f"{measured}, {words}" if measured else words
            mark, look = ("crosses" if rises else "dots", "measured") if measured else ("line", look)
            series.append(Series(found.values, found.amplitudes[:, place], mark, look, "" if text in seen else text))
            seen.add(text)
        title = f"{line_words(line_name(order, turns=system.turns))} of {signal}"
        title = f"order {title}" if system.turns else title
        unit = unit_of(system, signal)
        title = f"{title} [{unit}]" if unit else title
        return self.view.json_of(Panel(title, system.structure.pace, series))

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

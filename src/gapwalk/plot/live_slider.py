"""A record that follows a slider, in a notebook or a window: coarse at each step, and computed whole at rest."""

from __future__ import annotations

from contextlib import suppress
from itertools import groupby
from typing import Any

import numpy as np
from matplotlib import pyplot
from matplotlib.axes import Axes
from matplotlib.widgets import Slider

from gapwalk.bifurcation.branch import Branch
from gapwalk.bifurcation.loci import Codim2, Locus
from gapwalk.bifurcation.special_point import Kind
from gapwalk.errors import GapwalkError, ModelError
from gapwalk.model.system import System
from gapwalk.model.words import parameter_words
from gapwalk.plot.picture import draw
from gapwalk.plot.style import CODIM2, LINES, locus_options, symbol_style
from gapwalk.studies.live_answer import LiveAnswer, Seen
from gapwalk.studies.live_locus import LiveLocus
from gapwalk.studies.live_response import LiveResponse
from gapwalk.studies.live_shares import LiveShares

_REST = 300  # milliseconds after a step of the slider from which on it is at rest


class LivePicture:
    """The picture above a slider."""

    def __init__(self, answer: LiveAnswer, record: Any, system: System, parameter: str, *shown: Any) -> None:
        self.answer, self.record, self.system, self.parameter, self.shown = answer, record, system, parameter, shown
        self.seen: Any = None
        _, self.axes = pyplot.subplots()
        self.axes.figure.subplots_adjust(left=0.18, bottom=0.22)
        self.timer: Any = self.axes.figure.canvas.new_timer(interval=_REST)
        self.timer.single_shot = True
        self.timer.add_callback(self.rest)
        self.draw(record)

    def step(self, value: float) -> None:
        """Draw what is known at once for a value of the slider."""
        self.system = self.system.at({self.parameter: value})
        self.seen = self.answer.coarse(self.system)
        if self.seen is not None:
            self.draw(self.seen)
        self.timer.stop()
        self.timer.start()

    def rest(self) -> None:
        """Compute the record itself at the value of the slider, and draw it."""
        with suppress(GapwalkError):  # then the coarse picture stays
            self.record = self.answer.exact(self.system)
            self.draw(self.record)

    def draw(self, found: Any) -> None:
        """Draw a coarse picture with the labels of the axes that are there, or a record."""
        axes = self.axes
        labels, within = (axes.get_xlabel(), axes.get_ylabel()), np.array([axes.get_xlim(), axes.get_ylim()])
        axes.clear()
        if isinstance(found, Seen):
            _draw_seen(axes, found)
            both = (np.append(*each) for each in zip((found.x, found.y), within, strict=True))
            xlim, ylim = ((np.nanmin(ends), np.nanmax(ends)) for ends in both)
            axes.set(xlabel=labels[0], ylabel=labels[1], xlim=xlim, ylim=ylim)
        else:
            draw(found, *self.shown, ax=axes)
        axes.figure.canvas.draw_idle()


def _draw_seen(axes: Axes, seen: Seen) -> None:
    """Draw curves in pieces of one look, each up to the first point of the next, and their special points."""
    x, y, begin = np.array(seen.x), np.array(seen.y), 0
    for look, group in groupby(seen.looks):
        end = begin + len(list(group))
        place = slice(begin, end + 1)
        is_locus = look not in (*LINES, "settled")
        options = locus_options(Kind.named(look)) if is_locus else LINES.get(look, LINES["neutral"]).options()
        axes.plot(x[place], y[place], **options)
        begin = end
    for kind, *at in seen.marks:
        is_codim2 = kind in list(Codim2) and kind != Kind.GRAZING
        axes.plot(*at, **(CODIM2[Codim2(kind)] if is_codim2 else symbol_style(Kind.named(kind))).options())


def live_slider(record: Any, parameter: str, to: tuple[float, float], measure: str = "half") -> Slider:
    """Return the slider that changes a parameter of a record, below its picture."""
    system: System = record.points[0].orbit.system if isinstance(record, Branch | Locus) else record.system
    over = {Branch: ["parameter"], Locus: ["first", "second"]}.get(type(record), [])
    if parameter in [getattr(record, name) for name in over]:
        raise ModelError(f"{parameter} is what the {type(record).__name__.lower()} is over; write another parameter")
    low, high, value = *(float(each) for each in to), system[parameter]
    if not low <= value <= high or not low < high:
        raise ModelError(f"to is ({low:.10g}, {high:.10g}), but {parameter} is {value:.10g}; write a range around it")
    if isinstance(record, Branch):
        answer: LiveAnswer = LiveResponse.of_branch(record, measure)
    else:
        answer = LiveLocus.of_locus(record) if isinstance(record, Locus) else LiveShares.of_shares(record)
    live = LivePicture(answer, record, system, parameter, *[measure] * isinstance(record, Branch))
    place = live.axes.figure.add_axes((0.25, 0.04, 0.6, 0.04))
    slider = Slider(place, parameter_words(parameter, system.units), low, high, valinit=value)
    slider.drawon = False  # the step draws all
    slider.live = live  # type: ignore[attr-defined]
    slider.on_changed(live.step)
    return slider

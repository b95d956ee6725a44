"""A branch that follows a slider, in a notebook or a window: moved at each step, and walked again at rest."""

from __future__ import annotations

from contextlib import suppress
from typing import Any

from matplotlib import pyplot
from matplotlib.widgets import Slider

from gapwalk.bifurcation import start_branch
from gapwalk.bifurcation.branch import Branch
from gapwalk.bifurcation.follow import follow
from gapwalk.bifurcation.moved_curve import Mark, marks, moved
from gapwalk.continuation.curve_points import BranchPoint
from gapwalk.continuation.walk import Walk, WalkOptions
from gapwalk.errors import GapwalkError, ModelError
from gapwalk.model.measures import full_measure
from gapwalk.model.words import parameter_words
from gapwalk.orbit.harmonic_balance import Balance
from gapwalk.orbit.method import Method
from gapwalk.orbit.shooting import Shooting
from gapwalk.plot.branches import name_axes, pieces_of
from gapwalk.plot.picture import draw
from gapwalk.plot.style import LINES, symbol_style

_QUICK: tuple[Method, ...] = (Balance(error=0.01), Shooting(tolerance=1e-6))  # the second where the first is refused
_STEPS = WalkOptions(initial_step=0.01, largest_step=0.02, largest_turn=0.3, max_points=1000)
_REST = 300  # milliseconds after a step of the slider from which on it is at rest


class LiveBranch:
    """The picture behind a slider: coarse points of the branch, and the branch itself at rest."""

    def __init__(self, branch: Branch, parameter: str, measure: str) -> None:
        self.branch, self.parameter, self.measure = branch, parameter, measure
        _, self.axes = pyplot.subplots()
        self.axes.figure.subplots_adjust(bottom=0.22)
        self.way = 1 if branch.values[-1] >= branch.values[0] else -1
        self.end = float(max(branch.values) if self.way > 0 else min(branch.values))
        self.walk_quickly()
        self.timer: Any = self.axes.figure.canvas.new_timer(interval=_REST)
        self.timer.single_shot = True
        self.timer.add_callback(self.rest)

    def walk_quickly(self) -> None:
        """Walk the points that are moved."""
        first = self.branch.points[0].orbit
        for method in _QUICK:
            with suppress(ModelError):
                start = start_branch(first, self.branch.parameter, self.end, self.way, method)
                self.corrector, walk = start.corrector, Walk(start.first, start.within, start.corrector, _STEPS)
                self.points = [start.first, *walk]
                return

    def step(self, value: float) -> None:
        """Move the points to a value of the parameter of the slider, and draw them."""
        system = self.points[0].orbit.system.at({self.parameter: value})
        points = moved(self.corrector, self.points, system)
        if len(points) > 1:
            self.points = points
            self.draw_coarse(points, list(marks(points, float(self.corrector.scales[-1]))))
        self.timer.stop()
        self.timer.start()

    def draw_coarse(self, points: list[BranchPoint], special: list[Mark]) -> None:
        """Draw moved points, with what happens between them."""
        self.axes.clear()
        branch = Branch(self.branch.parameter, self.branch.period, tuple(points), (), self.branch.ends)
        for piece in pieces_of(branch, self.measure):
            self.axes.plot(piece.x, piece.y, **LINES[piece.label].options())
        for each in special:
            self.axes.plot([each.value], [each.measure(self.measure)], **symbol_style(each.kind).options())
        name_axes(self.axes, branch, self.measure)
        self.axes.figure.canvas.draw_idle()

    def rest(self) -> None:
        """Follow the branch itself at the value of the slider, and draw it with its special points."""
        with suppress(GapwalkError):  # then the coarse picture stays
            self.branch = follow(self.points[0].orbit, self.branch.parameter, self.end, report=lambda *_: None)
            self.walk_quickly()
            self.axes.clear()
            draw(self.branch, self.measure, ax=self.axes)
            self.axes.figure.canvas.draw_idle()


def live_slider(branch: Branch, parameter: str, to: tuple[float, float], measure: str) -> Slider:
    """Return the slider that changes a parameter of a branch, below its picture."""
    system, value = branch.system, branch.system[parameter]
    if parameter == branch.parameter:
        raise ModelError(f"{parameter} is what the branch is over; write another parameter for the slider")
    low, high = (float(each) for each in to)
    if not low <= value <= high or not low < high:
        raise ModelError(f"to is ({low:.10g}, {high:.10g}), but {parameter} is {value:.10g}; write a range around it")
    live = LiveBranch(branch, parameter, full_measure(measure, system.coordinates))
    place = live.axes.figure.add_axes((0.25, 0.04, 0.6, 0.04))
    slider = Slider(place, parameter_words(parameter, system.units), low, high, valinit=value)
    slider.drawon = False  # the step draws all
    slider.live = live  # type: ignore[attr-defined]
    slider.on_changed(live.step)
    draw(branch, live.measure, ax=live.axes)
    return slider

"""Pictures of run-ups: the time history over the speed with the response below, and largest forces over the rate."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from gapwalk.answers.run_up import JumpDelay, RunUp
from gapwalk.attractors.spectrum import Waterfall
from gapwalk.bifurcation.branch import Branch
from gapwalk.model.system import System
from gapwalk.model.words import parameter_words, signal_words
from gapwalk.plot.branches import draw_branches, line_entries
from gapwalk.plot.motions import fill_waterfall
from gapwalk.plot.picture import AnyFigure, Finish, Inches, draws, write_answer, write_legend, write_letters
from gapwalk.plot.style import BLUE, GREY, VERMILLION, dots, stroke

_DELAY = "#f9dfcc"
_THIN = 40_000  # points of a history up to which all are drawn


def _run_up_size(
    run: RunUp, signal: str = "", *, branch: Branch | None = None, orders: float = 0.0, **_: object
) -> Inches:
    return 8.0, 4.4 + 3.4 * (branch is not None) + 3.0 * (orders > 0.0)


@draws(RunUp, panels=True, size=_run_up_size)
def draw_run_up(
    run: RunUp,
    figure: AnyFigure,
    signal: str = "",
    *,
    branch: Branch | None = None,
    orders: float = 0.0,
    window: int = 8,
    title: str = "",
) -> Finish:
    """Draw a signal of a run-up over the speed; below it the response that a slow sweep meets, and a waterfall."""
    signal = signal or run.loudest
    delays: tuple[JumpDelay, ...] = ()
    if branch is not None and run.course.is_one_way:
        delays = run.delays(branch, run.coordinate_of(signal))
    write_answer(figure, title, [*run.sentences, *(each.words(run.system) for each in delays)])
    heights = [1.0, *[0.95] * (branch is not None), *[0.85] * (orders > 0.0)]
    panels = figure.subplots(len(heights), 1, squeeze=False, height_ratios=heights)[:, 0].tolist()
    if len(panels) > 1:
        write_letters(panels)
    draw_history_over_speed(run, panels[0], signal)
    finish = None if branch is None else _lay_over(run, panels[1], branch, run.coordinate_of(signal), delays)
    if orders > 0.0:
        _draw_orders(run, panels[-1], run.waterfall(signal, orders, window))
    return finish


def _draw_orders(run: RunUp, ax: Axes, found: Waterfall) -> None:
    """Draw the waterfall below the other panels, over the same speeds or times."""
    mesh = fill_waterfall(found, ax)
    words = f"amplitude of {signal_words(found.signal, found.units)}"
    ax.figure.colorbar(mesh, ax=ax, label=words, location="bottom", aspect=60, pad=0.03, extend="min")
    ax.set_ylabel("multiples of Ω" if found.turns is None else "order")  # the room is small
    along = run.speed if run.course.is_invertible else run.time
    low, high, first = float(along.min()), float(along.max()), float(found.values[0])
    sign = 1.0 if along[-1] > along[0] else -1.0  # the picture of a waterfall counts its speeds from the first one
    ticks = [tick for tick in MaxNLocator(8, steps=[1, 2, 2.5, 5, 10]).tick_values(low, high) if low <= tick <= high]
    ax.set_xticks([sign * (tick - first) for tick in ticks], [f"{tick:g}" for tick in ticks])
    ax.set_xlim(sign * (low - first), sign * (high - first))


def _force(system: System) -> str:
    return "torque" if system.units else "force"


def _lay_over(run: RunUp, ax: Axes, branch: Branch, coordinate: str, delays: Sequence[JumpDelay]) -> Finish:
    """Draw the response, half the range of each period of the run-up over it, and the delays of jumps shaded."""
    finish = draw_branches(branch, ax, f"half.{coordinate}", legend=False, labels=False)
    speed, half = run.half(coordinate)
    ax.set_autoscale_on(True)
    ax.plot(speed, half, zorder=6, **dots(4.5, VERMILLION))
    ax.autoscale_view()
    ax.set_autoscale_on(False)
    late = [each for each in delays if np.isfinite(each.jump)]
    for delay in late:
        ax.axvspan(*sorted((delay.fold, delay.jump)), color=_DELAY, linewidth=0, zorder=0)
    if run.course.is_invertible:
        ax.set_xlim(run.speed.min(), run.speed.max())
        ax.margins(x=0.01)
    entries: list[tuple[str, Any]] = [("run-up, each period", dots(4.5, VERMILLION)), *line_entries([branch])]
    entries += [("from the fold to the jump", _DELAY)] * bool(late)
    write_legend(ax, entries, "above")
    return finish


def draw_history_over_speed(run: RunUp, ax: Axes, signal: str) -> None:
    """Draw one signal over the speed, or over time where the speed does not change in one direction."""
    values, units = run.signal(signal), run.system.units
    over_speed = run.course.is_invertible
    every = max(1, len(values) // _THIN)
    x = run.speed if over_speed else run.time
    ax.plot(x[::every], values[::every], **stroke(GREY, 0.5), zorder=2)
    entries = [("motion", stroke(GREY, 0.8))]
    if over_speed:
        speed, low, high = run.envelope(signal)
        for side in (low, high):
            ax.plot(speed, side, **stroke(BLUE, 1.3), zorder=4)
        entries += [("extremes of each period", stroke(BLUE, 1.3))]
    peaks = [peak for peak in run.peaks if peak.force]
    for peak in peaks:
        ax.axvline(peak.speed if over_speed else peak.time, **stroke(VERMILLION, 0.8, (0, (4, 3))), zorder=1)
    entries += [(f"largest contact {_force(run.system)}", stroke(VERMILLION, 0.8, (0, (4, 3))))] * bool(peaks)
    ax.set_xlabel(parameter_words(run.system.structure.pace, units) if over_speed else "time" + " [s]" * bool(units))
    ax.set_ylabel(signal_words(signal, units))
    ax.margins(x=0.01)
    if over_speed:
        ax.set_xlim(run.speed.min(), run.speed.max())
    write_legend(ax, entries, "above")

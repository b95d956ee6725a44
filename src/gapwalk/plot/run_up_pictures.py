"""Pictures of run-ups: the time history over the speed with the response below, and largest forces over the rate."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from gapwalk.answers.goals import peaks
from gapwalk.answers.run_up import JumpDelay, RunUp
from gapwalk.answers.run_ups import RunUps
from gapwalk.attractors.spectrum import Waterfall
from gapwalk.bifurcation.branch import Branch
from gapwalk.errors import ModelError
from gapwalk.model.system import System
from gapwalk.model.words import parameter_words, signal_words
from gapwalk.plot.branches import draw_branches, line_entries
from gapwalk.plot.motions import fill_waterfall
from gapwalk.plot.picture import AnyFigure, Finish, Inches, draws, write_answer, write_legend, write_letters
from gapwalk.plot.style import BLACK, BLUE, GREY, VERMILLION, dots, stroke

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


@draws(RunUps, panels=True, size=(8.0, 6.6))
def draw_run_ups(
    found: RunUps,
    figure: AnyFigure,
    contact: str | None = None,
    *,
    branch: Branch | None = None,
    title: str = "",
) -> None:
    """Draw the largest force of a contact over the rate, and its envelope over the speed below."""
    if not found.contacts:
        raise ModelError("these run-ups have no contact, so there is no force to draw")
    units, pace = found.system.units, found.system.structure.pace
    contact = contact or max(found.contacts, key=lambda name: float(np.nanmax(found.peaks(name), initial=0.0)))
    write_answer(figure, title, found.sentences)
    upper, lower = figure.subplots(2, 1)
    write_letters((upper, lower))
    rates, (low, middle, high) = found.quantiles(contact)
    upper.plot(found.rates, found.peaks(contact), **dots(2.5, GREY), zorder=2)
    several = len(found.courses) > 2 * len(rates) and len(rates) > 1
    if several:
        upper.fill_between(rates, low, high, color=BLUE, alpha=0.18, linewidth=0, zorder=1)
        upper.plot(rates, middle, **stroke(BLUE, 1.6), zorder=4)
    speed_unit = units.parameter(pace) if units else ""
    upper.set_xlabel(f"rate of {pace}" + (f" [{speed_unit}/s]" if units else ""))
    force = f"{_force(found.system)} of {contact}" + " [N m]" * bool(units)
    upper.set_ylabel(f"largest {force}")
    entries = [("a run-up", dots(2.5, GREY))]
    if several:
        entries += [("half of them are below", stroke(BLUE, 1.6)), ("5 % to 95 %", stroke(BLUE, 6.0, alpha=0.3))]
    write_legend(upper, entries, "above")
    draw_envelopes(found, lower, contact, branch)
    lower.set_ylabel(force)


def draw_envelopes(found: RunUps, ax: Axes, contact: str, branch: Branch | None = None) -> None:
    """Draw quantiles, over all run-ups, of the largest force of a contact near each speed, and that of a response."""
    forces = found.forces[:, :, found.contacts.index(contact)].ravel()
    speeds, good = found.speeds.ravel(), np.isfinite(found.forces[:, :, found.contacts.index(contact)].ravel())
    edges = np.linspace(speeds.min(), speeds.max(), min(found.bins, 100) + 1)
    place = np.clip(np.digitize(speeds, edges) - 1, 0, len(edges) - 2)
    kept = [forces[good & (place == k)] for k in range(len(edges) - 1)]
    filled = [k for k, each in enumerate(kept) if len(each)]
    x = 0.5 * (edges[:-1] + edges[1:])[filled]
    middle, most, worst = (np.array([np.quantile(kept[k], level) for k in filled]) for level in (0.5, 0.95, 1.0))
    ax.plot(x, worst, **stroke(VERMILLION, 1.2), zorder=3)
    ax.plot(x, most, **stroke(BLUE, 1.2, (0, (4, 2))), zorder=4)
    ax.plot(x, middle, **stroke(BLUE, 1.6), zorder=4)
    ax.set_xlabel(parameter_words(found.system.structure.pace, found.system.units))
    ax.margins(x=0.01)
    entries = [("half of them are below", stroke(BLUE, 1.6)), ("95 %", stroke(BLUE, 1.2, (0, (4, 2))))]
    entries.append(("largest of all", stroke(VERMILLION, 1.2)))
    if branch is not None:
        entries += [(f"{name} response", options) for name, options in _draw_slow_force(ax, branch, contact)]
    write_legend(ax, entries, "above")


def _draw_slow_force(ax: Axes, branch: Branch, contact: str) -> list[tuple[str, dict[str, Any]]]:
    """Draw the largest force along a response, stable and unstable; return the lines of the legend."""
    speeds = branch.values
    signal = f"{contact}.force"  # that of its stages, as along the run-ups
    forces = np.array([max(peaks(point.orbit, signal)) for point in branch.points])
    is_stable = np.array([point.stable for point in branch.points])
    lines = {"stable": stroke(BLACK, 1.2, zorder=5), "unstable": stroke(BLACK, 0.8, (0, (3, 2)), zorder=5)}
    drawn = []
    for (name, options), own in zip(lines.items(), (is_stable, ~is_stable), strict=True):
        joined = own.copy()
        joined[1:] |= own[:-1]  # up to the first point of the other kind, so that no gap is left
        if own.any():
            ax.plot(speeds, np.where(joined, forces, np.nan), **options)
            drawn.append((name, options))
    return drawn

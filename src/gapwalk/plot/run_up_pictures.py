"""Pictures of run-ups: the time history over the speed with the response below, and largest forces over the rate."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes

from gapwalk.answers.run_up import RunUp
from gapwalk.answers.run_ups import RunUps
from gapwalk.bifurcation.branch import Branch
from gapwalk.errors import ModelError
from gapwalk.model.words import parameter_words, signal_words
from gapwalk.plot.branches import draw_branches
from gapwalk.plot.picture import Finish, draws
from gapwalk.plot.sheet import AnyFigure, Inches, write_legend
from gapwalk.plot.style import BLACK, BLUE, GREY, VERMILLION, dots, stroke

_THIN = 40_000  # points of a history up to which all are drawn


def _run_up_size(run: RunUp, signal: str | None = None, *, branch: Branch | None = None) -> Inches:
    return 8.0, 4.2 + 3.6 * (branch is not None)


@draws(RunUp, panels=True, size=_run_up_size)
def draw_run_up(run: RunUp, figure: AnyFigure, signal: str | None = None, *, branch: Branch | None = None) -> Finish:
    """Draw a signal of a run-up over the speed, and half its range per period over the response below.

    Parameters
    ----------
    run, figure
        The run-up and the figure.
    signal
        A coordinate, velocity, contact force or torque, as in `RunUp.signal`; by default the coordinate of the contact
        with the largest force.
    branch
        A response over the speed, of the same system: then the signal must be a coordinate.
    """
    signal = signal or run.loudest
    if branch is not None and signal not in run.system.coordinates:
        raise ModelError(
            f"{signal} is no coordinate; a response below needs one of {', '.join(run.system.coordinates)}"
        )
    panels = figure.subplots(1 + (branch is not None), 1, squeeze=False, sharex=True)[:, 0]
    draw_history_over_speed(run, panels[0], signal)
    if branch is None:
        return None
    panels[0].set_xlabel("")
    finish = draw_branches(branch, panels[1], f"half.{signal}", legend=False, labels=False)
    speed, half = run.half(signal)
    panels[1].set_autoscale_on(True)
    panels[1].plot(speed, half, zorder=6, **dots(4.5, VERMILLION), label="run-up")
    panels[1].autoscale_view()
    panels[1].set_autoscale_on(False)
    for delay in run.delays(branch, signal):
        panels[1].axvspan(*sorted((delay.fold, delay.jump)), color=VERMILLION, alpha=0.12, linewidth=0)
    run_up = ("run-up: each period", dots(4.5, VERMILLION))
    write_legend(panels[1], [("response", stroke(BLACK, 1.4)), run_up], "inside")
    return finish


def draw_history_over_speed(run: RunUp, ax: Axes, signal: str) -> None:
    """Draw one signal over the speed, or over time where the speed does not change in one direction."""
    values, units = run.signal(signal), run.system.units
    one_way = np.all(run.course.rates > 0.0) or np.all(run.course.rates < 0.0)
    every = max(1, len(values) // _THIN)
    x = run.speed if one_way else run.time
    ax.plot(x[::every], values[::every], **stroke(GREY, 0.5), zorder=2)
    speed, low, high = run.envelope(signal)
    if one_way:
        for side in (low, high):
            ax.plot(speed, side, **stroke(BLUE, 1.3), zorder=4)
        for peak in run.peaks:
            if peak.force:
                ax.axvline(peak.speed, **stroke(VERMILLION, 0.8, (0, (4, 3))), zorder=1)
    ax.set_xlabel(parameter_words(run.system.structure.pace, units) if one_way else "time" + " [s]" * bool(units))
    ax.set_ylabel(signal_words(signal, units))
    ax.margins(x=0.01)
    if one_way:
        entries = [("motion", stroke(GREY, 0.8)), ("extremes of each period", stroke(BLUE, 1.3))]
        entries += [("largest contact force", stroke(VERMILLION, 0.8, (0, (4, 3))))] * any(p.force for p in run.peaks)
        write_legend(ax, entries, "above")


@draws(RunUps, panels=True, size=(8.0, 6.6))
def draw_run_ups(found: RunUps, figure: AnyFigure, contact: str | None = None) -> None:
    """Draw the largest force of a contact over the rate, and its envelope over the speed below.

    Parameters
    ----------
    found, figure
        The run-ups and the figure.
    contact
        Name of the contact; by default the one with the largest force.
    """
    if not found.contacts:
        raise ModelError("these run-ups have no contact, so there is no force to draw")
    units, pace = found.system.units, found.system.structure.pace
    contact = contact or max(found.contacts, key=lambda name: float(np.nanmax(found.peaks(name), initial=0.0)))
    upper, lower = figure.subplots(2, 1)
    rates, (low, middle, high) = found.quantiles(contact)
    upper.plot(found.rates, found.peaks(contact), **dots(2.5, GREY), zorder=2)
    several = len(found.courses) > 2 * len(rates) and len(rates) > 1
    if several:
        upper.fill_between(rates, low, high, color=BLUE, alpha=0.18, linewidth=0, zorder=1)
        upper.plot(rates, middle, **stroke(BLUE, 1.6), zorder=4)
    speed_unit = units.parameter(pace) if units else ""
    upper.set_xlabel(f"rate of {pace}" + (f" [{speed_unit}/s]" if units else ""))
    force = f"force of {contact}" + " [N m]" * bool(units)
    upper.set_ylabel(f"largest {force}")
    entries = [("a run-up", dots(2.5, GREY))]
    if several:
        entries += [("half of them are below", stroke(BLUE, 1.6)), ("5 % to 95 %", stroke(BLUE, 6.0, alpha=0.3))]
    write_legend(upper, entries, "above")
    draw_envelopes(found, lower, contact)
    lower.set_ylabel(force)


def draw_envelopes(found: RunUps, ax: Axes, contact: str) -> None:
    """Draw quantiles, over all run-ups, of the largest force of a contact near each speed."""
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
    write_legend(ax, [*entries, ("largest of all", stroke(VERMILLION, 1.2))], "above")

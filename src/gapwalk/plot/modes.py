"""Mode shapes: of a drive train along its inertias, of any other system by its coordinates."""

from __future__ import annotations

import math
import os
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from gapwalk.errors import ModelError
from gapwalk.model.modes import Modes
from gapwalk.model.system import System
from gapwalk.model.train import geometry
from gapwalk.model.train.assembly import TrainAssembly
from gapwalk.plot.sheet import new_sheet, sheet_bytes
from gapwalk.plot.style import BLACK, BLUE, GREY, SIZE, in_style, rc
from gapwalk.study.export import write_whole

_SHOWN = 6  # modes
_NAMED = 40  # places along a train, or coordinates, that have their names below


def save_modes(system: System, modes: Modes, path: str | os.PathLike[str], title: str = "") -> None:
    """Write a picture of the slowest modes.

    Parameters
    ----------
    system
        The system.
    modes
        Its modes.
    path
        A name that ends in ``.png`` or ``.svg``.
    title
        What stands above it.

    Raises
    ------
    ModelError
        For another ending.
    StoreError
        If the file cannot be written.
    """
    form = Path(path).suffix.lower().lstrip(".")
    if form not in ("png", "svg"):
        raise ModelError(f"{os.fspath(path)} is no name for a picture; give it the ending .png or .svg")
    write_whole(path, sheet_bytes(draw_modes(system, modes, title), form))


def draw_modes(system: System, modes: Modes, title: str = "") -> Figure:
    """The slowest modes as a matplotlib figure, one panel each."""
    shown = min(len(modes), _SHOWN)
    with in_style():
        figure = new_sheet((SIZE[0], 0.8 + 1.05 * shown))
        figure.suptitle(title.replace("$", r"\$"), x=0.01, ha="left", fontsize=rc()["axes.titlesize"], wrap=True)
        panels = figure.subplots(shown, 1, sharex=True, squeeze=False)[:, 0]
        names = _names(system, modes)
        for number, ax in enumerate(panels):
            _draw(system, modes, number, ax, len(names))
            frequency = modes.frequencies[number]
            rate = f"{frequency / (2 * math.pi):.4g} Hz" if system.units else f"{frequency:.4g}"
            text = "no vibration" if math.isnan(frequency) else rate
            ax.set_ylabel(f"{number + 1}\n{text}", rotation=0, ha="right", va="center")
            ax.axhline(0.0, color=GREY, linewidth=0.7)
            ax.set_ylim(-1.25, 1.25)
            ax.set_yticks([-1, 0, 1])
        if len(names) <= _NAMED:
            panels[-1].set_xticks(range(len(names)), names, rotation=35 if len(names) > 6 else 0, ha="center")
        kind = "" if system.units else " (angular)"
        quantity = "angles, each times the ratio to the first inertia" if modes.inertias else "coordinates"
        panels[-1].set_xlabel(f"{quantity}; on the left the natural frequencies{kind}")
    return figure


def _names(system: System, modes: Modes) -> tuple[str, ...]:
    """What stands along the axis."""
    assembly = system.structure.assembly
    held = isinstance(assembly, TrainAssembly) and not assembly.form.is_free
    return (*(modes.inertias or modes.coordinates), *["ground"] * held)


def _draw(system: System, modes: Modes, number: int, ax: Axes, places: int) -> None:
    """Draw one mode over as many places."""
    assembly = system.structure.assembly
    if not isinstance(assembly, TrainAssembly):
        shape = modes.shapes[:, number]
        ax.vlines(range(len(shape)), 0.0, shape, color=BLUE, linewidth=1.4)
        ax.plot(shape, linestyle="none", marker="o", markersize=4, color=BLACK)
        return
    form = assembly.form
    heights = _reflected(assembly, system.values, modes.angles[:, number])
    heights = np.append(heights, 0.0)[:places]
    for link in form.links:
        ends = list(link.ends)
        ax.plot(ends, heights[ends], color=BLUE, linewidth=1.4, linestyle="--" if link.contact else "-")
    ax.plot(heights, linestyle="none", marker="o", markersize=4, color=BLACK)


def _reflected(
    assembly: TrainAssembly, values: NDArray[np.float64], angles: NDArray[np.float64]
) -> NDArray[np.float64]:
    """The angles as they are felt at the first inertia, the largest of them 1: across gears the line goes on."""
    heights = angles / geometry.speeds(assembly.form, assembly.form.ratios(values))
    return heights / np.abs(heights).max()

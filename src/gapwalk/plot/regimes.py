"""The picture of a regime map: kinds of motion in the plane of two parameters, and how hard contacts hit."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap, to_hex
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from numpy.typing import NDArray

from gapwalk.attractor.regime import Regime
from gapwalk.attractor.regimes import Regimes
from gapwalk.errors import ModelError
from gapwalk.plot.legend import draw_fill_legend
from gapwalk.plot.style import DPI, GREY, RC, diagram_size
from gapwalk.plot.words import parameter_words

_NAMED = 8  # periods with a colour of their own
_FIRST = "#f6f2e4"  # of period 1
_SEQUENCE = "YlGnBu"  # of the other periods, from light to dark
_LONGER, _TORUS, _CHAOS, _UNDECIDED, _RUNAWAY = "#8b5a9e", "#e8702a", "#000000", "#b5b5b5", "#ffffff"
_FIGURES = "cividis"  # of peak forces and impacts: even to any eye


class _Entry(NamedTuple):
    """One entry of the legend: its text, its colour, and which cells have it."""

    text: str
    color: str
    cells: NDArray[np.bool_]


def plot_regimes(found: Regimes, *, ax: Axes | None = None) -> Axes:
    """Draw the kinds of motion in the plane of the two parameters.

    Parameters
    ----------
    found
        The map.
    ax
        Where to draw; by default a new figure (without pyplot).
    """
    if ax is None:
        with mpl.rc_context(RC):
            ax = Figure(figsize=diagram_size(1), dpi=DPI, layout="constrained").add_subplot()
    entries = list(_entries(found))
    codes = np.zeros(found.regimes.shape)
    for code, entry in enumerate(entries):
        codes[entry.cells] = code
    colors = ListedColormap([entry.color for entry in entries])
    _draw_cells(ax, found, codes, cmap=colors, vmin=-0.5, vmax=len(entries) - 0.5)
    handles = [Patch(facecolor=e.color, edgecolor=GREY, linewidth=0.5, label=e.text) for e in entries]
    draw_fill_legend(ax, handles, _check_words(found), columns=6)
    return ax


def plot_figure_of_contact(found: Regimes, which: str = "peak force", contact: int = 0, *, ax: Axes) -> Axes:
    """Draw the peak force or the impacts a period of one contact in the plane, with a scale.

    Parameters
    ----------
    found
        The map.
    which
        ``"peak force"`` or ``"impacts"``.
    contact
        Number of the contact.
    ax
        Where to draw.

    Raises
    ------
    ModelError
        If the map has no such figures.
    """
    figures = {"peak force": found.peak_force, "impacts": found.impacts}
    if which not in figures:
        raise ModelError(f'there is no figure {which!r} of a contact; write "peak force" or "impacts"')
    values = figures[which]
    if not 0 <= contact < values.shape[2]:
        raise ModelError(f"the map has figures of {values.shape[2]} contacts, so there is none of number {contact}")
    name = found.system.structure.contacts[contact].name
    cells = values[..., contact]
    top = float(np.nanquantile(cells, 0.998)) if np.isfinite(cells).any() else 1.0
    image = _draw_cells(ax, found, cells, cmap=_FIGURES, vmin=0.0, vmax=max(top, np.finfo(float).tiny))
    text = f"peak force of {name}" if which == "peak force" else f"impacts of {name} a forcing period"
    ax.figure.colorbar(image, ax=ax, label=text, pad=0.015, fraction=0.05, extend="max")
    return ax


def draw_regimes(found: Regimes, title: str = "", panels: tuple[str, ...] = ("peak force",)) -> Figure:
    """The picture of a regime map as a matplotlib figure, without pyplot.

    Parameters
    ----------
    found
        The map.
    title
        Of the picture.
    panels
        What is shown below the regimes: ``"peak force"``, ``"impacts"``, both or neither; those of the first contact.
    """
    shown = panels if found.peak_force.shape[2] else ()
    with mpl.rc_context(RC):
        figure = Figure(figsize=diagram_size(1 + len(shown)), dpi=DPI, layout="constrained")
        axes = figure.subplots(1 + len(shown), 1, sharex=True, squeeze=False)[:, 0]
        axes[0].set_title(title.replace("$", r"\$"), wrap=True)
        plot_regimes(found, ax=axes[0])
        for which, ax in zip(shown, axes[1:], strict=True):
            plot_figure_of_contact(found, which, ax=ax)
        for ax in axes[:-1]:
            ax.set_xlabel("")
    return figure


def _draw_cells(ax: Axes, found: Regimes, cells: NDArray, **options):
    (left, right), (bottom, top) = found.within
    image = ax.imshow(
        cells,
        extent=(left, right, bottom, top),
        origin="lower",
        aspect="auto",
        interpolation="nearest",
        zorder=1,
        **options,
    )
    ax.grid(visible=False)
    ax.set_xlim(left, right)
    ax.set_ylim(bottom, top)
    ax.set_xlabel(parameter_words(found.first))
    ax.set_ylabel(parameter_words(found.second))
    return image


def _entries(found: Regimes) -> Iterator[_Entry]:
    """What occurs in a map: the periods, then the other kinds of motion."""
    scale = mpl.colormaps[_SEQUENCE]
    periods = [m for m in range(1, _NAMED + 1) if np.any(found.periods == m)]
    for m in periods:
        color = _FIRST if m == 1 else to_hex(scale(0.22 + 0.78 * (m - 2) / (_NAMED - 2)))
        yield _Entry(f"period {m}", color, found.periods == m)
    others = (
        (f"period {_NAMED + 1} and more", _LONGER, found.periods > _NAMED),
        ("quasi-periodic", _TORUS, found.regimes == Regime.QUASI_PERIODIC),
        ("chaotic", _CHAOS, found.regimes == Regime.CHAOTIC),
        ("undecided", _UNDECIDED, found.regimes == Regime.UNDECIDED),
        ("runs away", _RUNAWAY, found.regimes == Regime.RUNAWAY),
    )
    for text, color, cells in others:
        if cells.any():
            yield _Entry(text, color, cells)


def _check_words(found: Regimes) -> str:
    checked, different = found.check.checked, len(found.check.different)
    if not checked:
        return "not checked with the exact flow"
    return f"checked with the exact flow: {different} of {checked} cells differed"

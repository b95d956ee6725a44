"""The picture of a regime map: kinds of motion in the plane of two parameters, and how hard contacts hit."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import NDArray

from gapwalk.attractor.regime import Regime, regime_word
from gapwalk.attractor.regimes import Regimes
from gapwalk.bifurcation.branch import Kind
from gapwalk.bifurcation.locus import Locus
from gapwalk.errors import ModelError
from gapwalk.motion.signal import contact_to_show
from gapwalk.plot.legend import draw_fill_legend
from gapwalk.plot.regime_colors import NAMED, legend_words, period_of, regime_color
from gapwalk.plot.sheet import NewFigure, new_sheet, open_axes
from gapwalk.plot.size import takes_size
from gapwalk.plot.style import BLACK, GREY, SYMBOLS, diagram_size, in_style
from gapwalk.plot.words import parameter_words

_FIGURES = "cividis"  # of peak forces and impacts: even to any eye


_DASHES: dict[Kind, Any] = {
    Kind.FOLD: "-",
    Kind.FLIP: (0, (4.0, 1.5)),
    Kind.NEIMARK_SACKER: (0, (5.0, 1.2, 1.2, 1.2)),
    Kind.GRAZING: (0, (1.2, 1.2)),
}
"""Dashes of the loci of each kind."""


class _Entry(NamedTuple):
    """One entry of the legend: its text, its colour, and which cells have it."""

    text: str
    color: str
    cells: NDArray[np.bool_]


@takes_size
def plot_regimes(found: Regimes, *, ax: Axes | None = None, loci: Iterable[Locus] = ()) -> Axes:
    """Draw the kinds of motion in the plane of the two parameters.

    Parameters
    ----------
    found
        The map.
    ax
        Where to draw; by default in a new figure of pyplot.
    loci
        Loci of bifurcations in the same plane, drawn over it.

    Raises
    ------
    ModelError
        For a locus of other parameters.
    """
    if ax is None:
        ax = open_axes(diagram_size(1))
    entries = list(_entries(found))
    codes = np.zeros(found.regimes.shape)
    for code, entry in enumerate(entries):
        codes[entry.cells] = code
    colors = ListedColormap([entry.color for entry in entries])
    _draw_cells(ax, found, codes, cmap=colors, vmin=-0.5, vmax=len(entries) - 0.5)
    handles = [Patch(facecolor=e.color, edgecolor=GREY, linewidth=0.5, label=e.text) for e in entries]
    lines = _draw_loci(ax, found, list(loci))
    draw_fill_legend(ax, [*handles, *lines], _check_words(found), columns=6)
    return ax


def plot_contact_figures(
    found: Regimes, which: str = "peak force", contact: int | str | None = None, *, ax: Axes
) -> Axes:
    """Draw the peak force or the impacts a period of one contact in the plane, with a scale.

    Parameters
    ----------
    found
        The map.
    which
        ``"peak force"`` or ``"impacts"``.
    contact
        Name or number of the contact; by default the one that is hit hardest.
    ax
        Where to draw.

    Raises
    ------
    ModelError
        If the map has no such figures, or the system no such contact.
    """
    figures = {"peak force": found.peak_force, "impacts": found.impacts}
    if which not in figures:
        raise ModelError(f'there is no figure {which!r} of a contact; write "peak force" or "impacts"')
    values = figures[which]
    place = _place_of(found, contact)
    name = found.system.structure.contacts[place].name
    cells = values[..., place]
    top = float(np.nanquantile(cells, 0.998)) if np.isfinite(cells).any() else 1.0
    image = _draw_cells(ax, found, cells, cmap=_FIGURES, vmin=0.0, vmax=max(top, np.finfo(float).tiny))
    text = f"peak force of {name}" if which == "peak force" else f"impacts of {name} a forcing period"
    ax.figure.colorbar(image, ax=ax, label=text, pad=0.015, fraction=0.05, extend="max")
    return ax


def _place_of(found: Regimes, contact: int | str | None) -> int:
    names = [form.name for form in found.system.structure.contacts][: found.peak_force.shape[2]]
    if not names:
        raise ModelError("the map has no figures of contacts")
    if contact is None:
        forces = np.nan_to_num(found.peak_force).reshape(-1, len(names)).max(axis=0)
        return contact_to_show(found.system, "", forces)
    if isinstance(contact, str) and contact in names:
        return names.index(contact)
    if isinstance(contact, int) and 0 <= contact < len(names):
        return contact
    raise ModelError(f"the map has no figures of a contact {contact!r}; contacts are {', '.join(names)}")


@takes_size
def draw_regimes(
    found: Regimes,
    title: str = "",
    panels: Sequence[str] = ("peak force",),
    loci: Iterable[Locus] = (),
    on: NewFigure = new_sheet,
    contact: int | str | None = None,
) -> Figure:
    """The picture of a regime map.

    Parameters
    ----------
    found
        The map.
    title
        Of the picture.
    panels
        What is shown below the regimes: ``"peak force"``, ``"impacts"``, both or neither.
    loci
        Loci of bifurcations in the same plane, drawn over the regimes.
    on
        Makes the figure; by default without pyplot.
    contact
        Name or number of the contact that these are of; by default the one that is hit hardest.
    """
    shown = panels if found.peak_force.shape[2] else ()
    figure = on(diagram_size(1 + len(shown)))
    with in_style():
        axes = figure.subplots(1 + len(shown), 1, sharex=True, squeeze=False)[:, 0]
        axes[0].set_title(title.replace("$", r"\$"), wrap=True)
        plot_regimes(found, ax=axes[0], loci=loci)
        for which, ax in zip(shown, axes[1:], strict=True):
            plot_contact_figures(found, which, contact, ax=ax)
        for ax in axes[:-1]:
            ax.set_xlabel("")
    return figure


def _draw_loci(ax: Axes, found: Regimes, loci: list[Locus]) -> list[Line2D]:
    """Draw loci black on white, which is seen on any colour; the entries of the legend."""
    for locus in loci:
        if (locus.first, locus.second) != (found.first, found.second):
            raise ModelError(
                f"a locus is in the plane of {locus.first} and {locus.second}, and the map in that of {found.first} "
                f"and {found.second}"
            )
        values = np.vstack((locus.values, locus.values[:1])) if locus.is_closed else locus.values
        ax.plot(values[:, 0], values[:, 1], color="white", linewidth=2.6, zorder=3)
        ax.plot(values[:, 0], values[:, 1], zorder=4, **_line(locus.kind))
    kinds = [kind for kind in _DASHES if any(locus.kind is kind for locus in loci)]
    return [Line2D([], [], label=SYMBOLS[kind].text.split(" (")[0], **_line(kind)) for kind in kinds]


def _line(kind: Kind) -> dict[str, Any]:
    return {"color": BLACK, "linewidth": 1.1, "linestyle": _DASHES[kind]}


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
    ax.set_xlabel(parameter_words(found.first, found.system.units))
    ax.set_ylabel(parameter_words(found.second, found.system.units))
    return image


def _entries(found: Regimes) -> Iterator[_Entry]:
    """What occurs in a map: the periods, then the other kinds of motion."""
    kinds = np.unique(np.stack((found.regimes, found.periods), axis=-1).reshape(-1, 2), axis=0)
    for text, word in legend_words({regime_word(*pair) for pair in kinds.tolist()}).items():
        m = period_of(word)
        if m is None:
            cells = found.regimes == next(regime for regime in Regime if regime.text == word)
        else:
            cells = found.periods == m if m <= NAMED else found.periods > NAMED
        yield _Entry(text, regime_color(word), cells)


def _check_words(found: Regimes) -> str:
    checked, different = found.check.checked, len(found.check.different)
    if not checked:
        return "not checked with the exact flow"
    return f"checked with the exact flow: {different} of {checked} cells differed"

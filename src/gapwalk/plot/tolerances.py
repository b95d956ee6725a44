"""Picture of tolerances: the response, the distributions of its special points, and what matters for each."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from gapwalk.answers.shown_measure import shown_measure
from gapwalk.answers.tolerance import BINS, Tolerance, reach
from gapwalk.bifurcation.special_point import Kind
from gapwalk.model.words import parameter_symbol, parameter_words
from gapwalk.plot import style
from gapwalk.plot.branches import draw_branches
from gapwalk.plot.picture import AnyFigure, Finish, draws, write_answer, write_legend

# From dark to light and of different hues (Okabe and Ito 2008), so that neighbours also differ in grey.
_FILLS = ("#0b56a4", "#f3c55b", "#8fcdf1", "#d55e00", "#9adbc3", "#7a3b69", "#f0e442", "#cc79a7")
_REST, _MOST = "#dedede", len(_FILLS)
_WIDE = 0.82  # height of a distribution, as a share of its row
_NARROW = 0.05  # share of the range below which the widest distribution is a needle
_SHOWN = 0.003, 0.997  # quantiles between which a distribution is drawn at least


def _size(found: Tolerance, measure: str = "", **_: object) -> tuple[float, float]:
    return 8.0, 5.4 + 0.5 * len(found.points)


@draws(Tolerance, panels=True, size=_size)
def draw_tolerance(found: Tolerance, figure: AnyFigure, measure: str = "", *, title: str | None = None) -> Finish:
    """Draw the nominal response, below it the distribution of each special point, and bars of Sobol indices."""
    rows = max(1, len(found.points))
    halves: Any = figure.subfigures(2, 1, height_ratios=[3.6, 1.6 + 0.5 * rows])
    top, bottom = halves
    ax = top.subplots()
    low, high = reach(found)
    measure = measure or shown_measure(found.branch.system, found)
    finish = draw_branches(found.branch, ax, measure, legend="above", within=(low, high))
    left, right = bottom.subplots(1, 2, sharey=True, width_ratios=[2.2, 1.0])
    is_narrow = _is_narrow(found, high - low)
    _draw_distributions(left, found, None if is_narrow else (low, high))
    _draw_bars(right, bottom, found)
    if found.band is not None:
        for panel in (ax,) if is_narrow else (ax, left):
            panel.axvspan(*found.band, color=style.SHADE, zorder=0)
    text = f"{int(found.known.sum()):,} samples of {len(found.names)} parameters"
    if found.band is not None and found.known.any():
        symbol = parameter_symbol(found.parameter, found.branch.system.units)
        between = f"{found.band[0]:g} and {found.band[1]:g}"
        text += f": a fold between {symbol} = {between} in {found.chance(*found.band)}"
    write_answer(figure, title or "", [text])
    return finish


def _is_narrow(found: Tolerance, width: float) -> bool:
    """Return True if the distributions are needles in the range of the picture."""
    low, high = found.quantiles(0.05, 0.95)
    return bool(np.nanmax(high - low, initial=0.0) < _NARROW * width)


def _draw_distributions(ax: Axes, found: Tolerance, within: tuple[float, float] | None) -> None:
    """Draw a row for each point: its distribution, its median and the middle 90 % of it.

    Without a range, each distribution is drawn about the nominal value, which is written beside it.
    """
    origins = np.array([0.0 if within else special.value for special in found.points])
    quantiles = found.quantiles(0.05, 0.5, 0.95) - origins
    values = found.values[found.known] - origins
    for row, special in enumerate(found.points):
        column = values[:, row][~np.isnan(values[:, row])]
        look = style.symbol_style(special.kind)
        color = style.GREY if special.kind is Kind.GRAZING else look.color
        if len(column) > 1:
            heights, edges = np.histogram(column, bins=min(BINS, max(5, int(np.sqrt(len(column))))))
            top = row + 0.4 - _WIDE * heights / heights.max()
            ax.stairs(top, edges, baseline=row + 0.4, fill=True, color=color, alpha=0.45, zorder=2)
            low, middle, high = quantiles[:, row]
            ax.plot([low, high], [row + 0.4] * 2, color=style.BLACK, linewidth=style.points(1.6), zorder=3)
            ax.plot([middle], [row + 0.4], "|", color=style.BLACK, markersize=style.points(8), zorder=3)
        ax.plot(
            [special.value - origins[row]], [row + 0.4], "o", color=style.BLACK, markersize=style.points(3), zorder=4
        )
    texts = [f"{each.kind}{f' {each.contact}' if each.contact else ''}" for each in found.points]
    if within is None:
        texts = [f"{text}  {each.value:.5g}" for text, each in zip(texts, found.points, strict=True)]
    for row, chance in enumerate(found.exists if found.known.any() else ()):
        if chance.count < chance.samples:
            texts[row] += f"\nin {100.0 * chance.value:.3g} %"
    ax.set_yticks(range(len(texts)), texts)
    words = parameter_words(found.parameter, found.branch.system.units)
    if within is None:
        farthest = float(np.nanmax(np.abs(found.quantiles(*_SHOWN) - origins), initial=0.0))
        ax.set(xlim=(-1.05 * farthest, 1.05 * farthest), xlabel=f"shift of {words}")
    else:
        ax.set(xlim=within, xlabel=words)
    ax.set_ylim(len(texts) - 0.5, -0.6)
    ax.xaxis.set_major_locator(MaxNLocator(5))
    ax.set_title("distribution; bar: middle 90 %, dot: nominal", fontsize=style.points(8.5))


def _draw_bars(ax: Axes, figure: AnyFigure, found: Tolerance) -> None:
    """Draw first-order Sobol indices as stacked bars; what is left is grey."""
    first = np.array([np.nan_to_num(each.first) for each in found.influences]).reshape(-1, len(found.names))
    order = np.argsort(-first.sum(axis=0), kind="stable")[:_MOST].tolist()
    rows, left = np.arange(len(first)), np.zeros(len(first))
    entries = []
    for color, k in zip(_FILLS, order, strict=False):
        options = {"color": color, "edgecolor": style.BLACK, "linewidth": style.points(0.4)}
        ax.barh(rows, first[:, k], 0.6, left=left, **options)
        entries.append((found.names[k], color))
        left = left + first[:, k]
    ax.barh(rows, np.maximum(0.0, 1.0 - left), 0.6, left=left, color=_REST, zorder=1)
    entries.append(("interactions and rest", _REST))
    ax.set(xlim=(0.0, 1.0), xlabel="share of the variance")
    ax.set_title("what matters (Sobol)", fontsize=style.points(8.5))
    ax.tick_params(axis="y", labelleft=False)
    write_legend(figure, entries)

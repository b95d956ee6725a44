"""Two motions side by side: histories on the left, spectra on the right (paper, figures 3, 5 to 7)."""

from __future__ import annotations

from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure

from gapwalk.attractor.contrast import Contrast, SignalPair
from gapwalk.plot.pair import FIRST, SECOND, draw_histories, draw_lines
from gapwalk.plot.sheet import open_window
from gapwalk.plot.size import points, takes_size
from gapwalk.plot.style import in_style
from gapwalk.plot.words import order_words, pace_words

_WIDTH, _HEIGHT, _ABOVE = 9.5, 2.9, 0.5  # of a row, and of title and legend, in inches


@takes_size
def plot_contrast(found: Contrast, title: str | None = None, *, figure: Figure | SubFigure | None = None):
    """Draw two motions side by side.

    Parameters
    ----------
    found
        As from `gapwalk.contrast`.
    title
        By default the frequencies of the two motions.
    figure
        Where to draw; by default a new figure of pyplot.
    """
    if figure is None:
        figure = open_window(_size(found))
    with in_style():
        _draw(figure, found, title)
    return figure


def _size(found: Contrast) -> tuple[float, float]:
    return _WIDTH, _HEIGHT * len(found.pairs) + _ABOVE


def _draw(figure: Figure | SubFigure, found: Contrast, title: str | None) -> None:
    axes = figure.subplots(len(found.pairs), 2, squeeze=False, width_ratios=[1.35, 1.0])
    for (left, right), pair in zip(axes, found.pairs, strict=True):
        draw_histories(left, pair.theta, pair.histories, found.names, pair.signal)
        if pair.agreement is not None:
            text = f"rms difference {pair.agreement.relative:.2g}, correlation {pair.agreement.correlation:.4f}"
            left.set_title(text, fontsize=points(8.5))
        _draw_spectra(right, pair)
    handles, labels = axes[0][0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=2, handlelength=3.0)
    figure.suptitle(_title(found) if title is None else title, x=0.01, ha="left", fontsize=points(10.5), wrap=True)


def _draw_spectra(ax: Axes, pair: SignalPair) -> None:
    turns = pair.spectra[0].system.turns
    if pair.agreement is not None:
        draw_lines(ax, pair.agreement.lines, pair.signal, turns)
        return
    largest = max(float(found.amplitudes[1:].max()) for found in pair.spectra)
    for found, style in zip(pair.spectra, (FIRST, SECOND), strict=True):
        ax.plot(found.orders[1:], found.amplitudes[1:], **{**style, "linewidth": 0.8})
    ax.set_yscale("log")
    ax.set_xlim(0.0, 8.0 * (turns or 1))
    ax.set_ylim(1e-4 * largest, 3.0 * largest)
    ax.set_xlabel(order_words(turns))
    ax.set_ylabel(f"amplitude of {pair.signal}")


def _title(found: Contrast) -> str:
    first, second = (pace_words(motion.system) for motion in found.motions)
    where = first if first == second else f"{first} and {second.partition(' = ')[2]}"
    return f"{found.names[0]} and {found.names[1]} at {where}"

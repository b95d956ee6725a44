"""Spectra over multiples of W: exact lines of periodic motions, curves of all others."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MultipleLocator

from gapwalk.attractor.spectrum import Spectrum
from gapwalk.plot.labels import Label, place_labels
from gapwalk.plot.sheet import make_layout
from gapwalk.plot.style import BLACK
from gapwalk.plot.words import line_words, order_words, signal_words

_DEPTH = 1e-4  # smallest line that is shown, relative to the largest
_NAMED = 5  # lines that have their names beside them
_NOTABLE = 0.03  # height of those, relative to the largest


def plot_spectrum(found: Spectrum, *, ax: Axes, top: float | None = None, labels: bool = True) -> Axes:
    """Draw the amplitudes of a spectrum over its orders, on a logarithmic scale.

    Parameters
    ----------
    found
        The spectrum.
    ax
        Where to draw; in its final size if lines are to be named.
    top
        The highest order; by default as far as lines are notable.
    labels
        Whether the highest lines are named (``2W``, ``W/3``).
    """
    heights = found.amplitudes.copy()
    heights[0] = abs(heights[0])
    largest = float(heights[1:].max()) if len(heights) > 1 else 0.0
    floor = _DEPTH * (largest or 1.0)
    top = top or _extent(found, largest)
    shown = (found.orders > 0) & (found.orders <= top)
    orders, heights = found.orders[shown], np.maximum(heights[shown], floor)
    if found.period:
        ax.vlines(orders, floor, heights, color=BLACK, linewidth=1.2)
        ax.plot(orders, heights, linestyle="none", marker="o", markersize=2.6, color=BLACK)
    else:
        ax.plot(orders, heights, color=BLACK, linewidth=0.8)
    ax.set_yscale("log")
    ax.set_xlim(0.0, top)
    ax.set_ylim(floor, 4.0 * (largest or 1.0))
    ax.xaxis.set_major_locator(MultipleLocator(max(1.0, np.ceil(top / 8))))
    ax.set_xlabel(order_words(found.system.turns))
    ax.set_ylabel(f"amplitude of {signal_words(found.signal, found.system.units)}")
    if labels:
        make_layout(ax)
        named = [
            Label(line_words(peak.name), peak.order, peak.amplitude)
            for peak in found.peaks(_NAMED, _NOTABLE)
            if peak.order <= top and "." not in peak.name
        ]
        curve = np.column_stack(
            (np.repeat(orders, 3), np.column_stack((heights * 0 + floor, heights, heights)).ravel())
        )
        place_labels(ax, named, curve, np.column_stack((orders, heights)))
    return ax


def _extent(found: Spectrum, largest: float) -> float:
    notable = found.orders[found.amplitudes > 30 * _DEPTH * largest]
    unit = found.system.turns or 1
    return unit * float(np.ceil(min(max(float(notable.max(initial=0.0)) / unit, 2.0), 12.0) + 0.3))

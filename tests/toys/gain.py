"""An answer in one file: the gain of a linear oscillator over the frequency, with its largest value."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

import gapwalk as gw
from gapwalk.notebook import Shown
from gapwalk.picture_parts import Line, Panel, Parts, Picture, Series, Shade, pictured
from gapwalk.summary import SummaryParts, summarizes


@dataclass(frozen=True, eq=False)
class Gain(Shown):
    """The gain over the frequency."""

    system: gw.System
    frequencies: np.ndarray
    gains: np.ndarray

    @summarizes
    def summary(self) -> SummaryParts:
        """Return where it is largest."""
        best = int(self.gains.argmax())
        yield f"the gain is largest, {self.gains[best]:.4g}, at {self.frequencies[best]:.4g}"


@pictured(Gain)
def gain_picture(found: Gain) -> Picture:
    """Describe the gain with its largest value, and the share of it below."""
    axes, best = ("frequency", "half.x"), int(found.gains.argmax())
    at, share = float(found.frequencies[best]), found.gains / found.gains[best]

    def parts() -> Parts:
        return Parts(
            layers=[
                Series(found.frequencies, found.gains, "line", "main", "gain", axes=axes),
                Series([at], [found.gains[best]], "stars", "worst", "largest", axes=axes),
            ],
            shades=[Shade("frequency", at - 0.1, at + 0.1, "goal", "near the resonance")],
            lines=[Line("frequency", at, f"{at:.4g}")],
            below=[Panel("share of the largest", "frequency", [Series(found.frequencies, share)])],
            within={"frequency": (float(found.frequencies[0]), float(found.frequencies[-1]))},
        )

    return Picture(found.system, axes, (), parts, heading=[str(found.summary())])


def gain() -> Gain:
    """The gain of x'' + 0.2 x' + x = cos(frequency t)."""
    system = gw.System(["x"], [[1.0]], [[0.2]], harmonics=[gw.Harmonic(1.0, {"x": 1.0})], frequency=1.0)
    frequencies = np.linspace(0.5, 1.5, 101)
    return Gain(system, frequencies, 1.0 / np.hypot(1.0 - frequencies**2, 0.2 * frequencies))

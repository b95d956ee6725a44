"""The colours of regimes: the same in the strips of a sweep and in a map."""

from __future__ import annotations

import matplotlib as mpl
from matplotlib.colors import to_hex

from gapwalk.attractor.regime import Regime

NAMED = 8
"""Periods with a colour of their own."""

_FIRST = "#f6f2e4"  # of period 1
_SEQUENCE = "YlGnBu"  # of the other periods, from light to dark
_LONGER = "#8b5a9e"
_OTHERS = {
    Regime.QUASI_PERIODIC.text: "#e8702a",
    Regime.CHAOTIC.text: "#000000",
    Regime.UNDECIDED.text: "#b5b5b5",
    Regime.RUNAWAY.text: "#ffffff",
}
_UNKNOWN = "#4d4d4d"


def regime_color(word: str) -> str:
    """The colour of a regime, given in words: ``period 3``, ``chaotic``, ..."""
    m = period_of(word)
    if m is None:
        return _OTHERS.get(word, _UNKNOWN)
    if m > NAMED:
        return _LONGER
    return _FIRST if m == 1 else to_hex(mpl.colormaps[_SEQUENCE](0.22 + 0.78 * (m - 2) / (NAMED - 2)))


def period_of(word: str) -> int | None:
    """M of ``period m``; None for other regimes."""
    digits = word.removeprefix("period ")
    return int(digits) if word.startswith("period ") and digits.isdigit() else None


def legend_words(words: set[str]) -> dict[str, str]:
    """What a legend has for some regimes, in its order: what each entry is called, and a regime that has its colour."""
    periods = {m: word for word in words if (m := period_of(word)) is not None}
    entries = {periods[m]: periods[m] for m in sorted(periods) if m <= NAMED}
    if periods and max(periods) > NAMED:
        entries[f"period {NAMED + 1} and more"] = periods[max(periods)]
    order = [*_OTHERS, *sorted(words - _OTHERS.keys())]
    return entries | {word: word for word in order if word in words and period_of(word) is None}

"""Panel of what moves a special point most: each parameter's percent per percent, and the shift that it causes."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from gapwalk.bifurcation.loci.gradient import Gradient, gradient, moving_names
from gapwalk.bifurcation.special_point import SpecialPoint
from gapwalk.errors import GapwalkError
from gapwalk.model.words import parameter_symbol, parameter_words

_BATCH = 8  # parameters whose derivatives are computed at once: a click waits no longer than for these
_FAINT = 1e-4  # error of a slope, relative to the largest one in percent per percent, above which it is marked
_NOTHING = 1e-12  # of the largest, below which a number is rounding
_MOST = 400  # parameters that are listed


class GradientWork:
    """Gradient of a special point, computed in parts, so that a click need not wait for all of it."""

    def __init__(self, special: SpecialPoint) -> None:
        self.special = special
        self._found: list[Gradient] = []
        self._reason = ""

    def parts(self) -> Iterator[Callable[[], None]]:
        """Yield the computations, part by part; after an error there are no further ones."""
        special = self.special
        names = moving_names(special.orbit.system, special.parameter) if special.parameter else ()
        for start in range(0, max(1, len(names)), _BATCH):
            if not self._reason:
                yield lambda chosen=names[start : start + _BATCH]: self._compute(chosen)

    def _compute(self, names: tuple[str, ...]) -> None:
        try:
            self._found.append(gradient(self.special, names))
        except GapwalkError as error:
            self._reason = str(error)

    def content(self) -> dict[str, Any]:
        """Return the gradient for the page, or the reason why there is none; see `gradient_content`."""
        if self._reason:
            return {"reason": self._reason}
        names = tuple(name for each in self._found for name in each.names)
        slopes, errors = (np.concatenate([getattr(each, key) for each in self._found]) for key in ("slopes", "errors"))
        return gradient_content(Gradient(self.special, names, slopes, errors))


def gradient_of(special: SpecialPoint) -> dict[str, Any]:
    """Return the gradient of a special point for the page; see `gradient_content`."""
    work = GradientWork(special)
    for part in work.parts():
        part()
    return work.content()


def gradient_content(found: Gradient) -> dict[str, Any]:
    """Return a gradient for the page."""
    special = found.special
    units, parameter = special.orbit.system.units, special.parameter
    shares, values = found.elasticities, found.values
    doubts = np.abs(found.errors * values / special.value)
    largest = float(np.nanmax(np.abs(shares), initial=0.0))
    return {
        "parameter": parameter,
        "symbol": parameter_symbol(parameter),
        "unit": units.parameter(parameter) if units else "",
        "at": special.value,
        "rows": [
            {
                "name": found.names[k],
                "words": parameter_words(found.names[k], units),
                "unit": units.parameter(found.names[k]) if units else "",
                "value": float(values[k]),
                "slope": _plain(found.slopes[k] if abs(shares[k]) > _NOTHING * largest else 0.0),
                "share": _plain(shares[k] if abs(shares[k]) > _NOTHING * largest else 0.0),
                "doubtful": bool(doubts[k] > _FAINT * largest),
            }
            for k in found.distinct[:_MOST]
        ],
    }


def _plain(value: float) -> float | None:
    """Return a number; None for percent of a point at zero."""
    return float(value) if np.isfinite(value) else None

"""The picture of a response with settled motions: its stretches, and a band between the least and the largest value."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from gapwalk.bifurcation.band import runs_of
from gapwalk.bifurcation.branch import Branch
from gapwalk.model.measures import full_measure
from gapwalk.picture_parts import NamedCurve, Parts, Picture, Series, pictured

_SHOWN, _MOST = ("half", "max", "min", "mean"), 12  # measures that the page offers, of these first coordinates
_VALUES = 300  # parameters of a system over which the page can show settled motions too


@dataclass(frozen=True, eq=False)
class Stretches:
    """The stretches of a response, of which the first has its settled motions."""

    branches: tuple[Branch, ...]  #: The stretches.
    measure: str = "half"  #: The measure that is shown first.

    def summary(self) -> list[Any]:
        """Return what each stretch says."""
        return [part for branch in self.branches for part in branch.summary(points=False)]


def band_series(branches: Sequence[Branch], measure: str) -> Iterator[Series]:
    """Yield the bands of settled motions as series: what lies between least and largest value, and the mean."""
    kind = {"max": "largest", "min": "least"}.get(measure.partition(".")[0], "mean")
    text = "least to largest, settled", f"{kind}, settled"
    for branch in branches:
        measure = full_measure(measure, branch.system.coordinates)
        if measure.startswith("half.") or measure.startswith("peak_to_peak."):
            text = "largest deviation from the mean, to either side", "settled, no orbit followed"
        for run in runs_of(branch.bands):
            shown = [(band.value, heights) for band in run if (heights := band.shown(branch.system, measure))]
            if shown:
                values, (low, middle, high) = [value for value, _ in shown], np.array([each for _, each in shown]).T
                axes = branch.parameter, measure
                yield Series(values, np.array((low, high)), "between", "most", text[0], axes=axes)
                yield Series(values, middle, "line", "main", text[1], axes=axes)
                text = "", ""


def _settled(branches: Sequence[Branch]) -> dict[str, Any]:
    """Return what the page says of each settled motion, in the order of their series, and the other parameters."""
    found = [(each, branch.system) for branch in branches for run in runs_of(branch.bands) for each in run]
    system, parameter = branches[0].system, branches[0].parameter
    values = dict(system.parameters) if len(system.parameters) <= _VALUES else {}
    return {
        "kinds": [each.kind_words for each, _ in found],
        "contacts": [each.separation_words(own) for each, own in found],
        "fixed": {name: value for name, value in values.items() if name != parameter},
    }


@pictured(Stretches, forms=())
def _describe(found: Stretches) -> Picture:
    first = found.branches[0]
    measure = full_measure(found.measure, first.system.coordinates)
    shown = dict.fromkeys([measure, *(f"{kind}.{q}" for q in first.system.coordinates[:_MOST] for kind in _SHOWN)])
    return Picture(
        first.system,
        (first.parameter, measure),
        [
            NamedCurve(f"P{each.period}-{number}", each)
            for number, each in enumerate(found.branches, start=1)
            if each.points
        ],
        lambda: Parts(
            [each for name in shown for each in band_series(found.branches, name)],
            more={"settled": _settled(found.branches)},
        ),
        sentences=[text for n, text in enumerate(found.summary()) if not n or str(text).startswith("settled, ")],
        script="record.branches",
    )

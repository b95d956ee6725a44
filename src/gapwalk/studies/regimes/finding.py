"""What the study of a regime map has found, as JSON values and as tables."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from gapwalk.attractors.regime import regime_word
from gapwalk.attractors.regimes import Regimes
from gapwalk.studies.columns import parameter_headings
from gapwalk.studies.finding import Finding, Rows, plain_numbers

_ARRAYS = ("regimes", "periods", "exponents", "peak_force", "impacts", "states")


@dataclass(frozen=True)
class RegimeFinding(Finding):
    """A regime map, as far as it has come, and how many of its chunks of cells are done."""

    regimes: Regimes
    done: int
    total: int

    @property
    def record(self) -> Regimes:
        """The regime map."""
        return self.regimes

    @property
    def complete(self) -> bool:
        """Whether nothing is left to do."""
        return self.regimes.complete

    @property
    def stored(self) -> str:
        """How many chunks have been done."""
        return f"{self.done} of {self.total} chunks of cells are stored"

    @property
    def notes(self) -> tuple[str, ...]:
        """What could not be done."""
        return self.regimes.notes

    def document(self, points: bool) -> dict[str, Any]:
        """How many cells have each regime, and how far the words hold; with everything cell by cell if wanted."""
        found = self.regimes
        document: dict[str, Any] = {"chunks": {"done": self.done, "total": self.total}}
        document |= {
            "plane": dict(zip((found.first, found.second), map(list, found.within), strict=True)),
            "resolution": list(found.resolution),
            "cells": found.cells,
            "check": asdict(found.check) | {"different": list(found.check.different)},
            "error": found.error,
        }
        if points:
            document["contacts"] = [contact.name for contact in found.system.structure.contacts]
            document |= {name: plain_numbers(getattr(found, name).tolist()) for name in _ARRAYS}
        return document

    def tables(self) -> Mapping[str, Callable[[], Rows]]:
        """What there is at each cell."""
        return {"cells": lambda: _cell_rows(self.regimes)}


def _cell_rows(found: Regimes) -> Iterator[list[object]]:
    contacts = [contact.name for contact in found.system.structure.contacts][: found.impacts.shape[2]]
    headings = [f"{what}.{contact}" for what in ("peak.force", "impacts") for contact in contacts]
    names = parameter_headings([found.first, found.second], found.system.coordinates)
    yield [*names, "regime", "period", "exponent", *headings]
    (across, up), (rows, columns) = found.axes, found.regimes.shape
    for row, column in np.ndindex(rows, columns):
        regime, period = int(found.regimes[row, column]), int(found.periods[row, column])
        exponent = float(found.exponents[row, column])
        yield [
            float(across[column]),
            float(up[row]),
            regime_word(regime, period),
            period,
            "" if np.isnan(exponent) else exponent,
            *found.peak_force[row, column].tolist(),
            *found.impacts[row, column].tolist(),
        ]

"""What the study of basins of attraction has found, as JSON values and as tables."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass
from typing import Any

from gapwalk.attractors.basins import Basins
from gapwalk.attractors.box import state_names
from gapwalk.attractors.sorting import RUNAWAY, UNRESOLVED
from gapwalk.studies.finding import Finding, Rows

_WORDS = {UNRESOLVED: "unresolved", RUNAWAY: "runs away"}


@dataclass(frozen=True)
class BasinFinding(Finding):
    """Basins of attraction; None until all is done, and how many of its chunks of cells are done."""

    basins: Basins | None
    done: int
    total: int

    @property
    def record(self) -> Basins | None:
        """The basins."""
        return self.basins

    @property
    def complete(self) -> bool:
        """Whether nothing is left to do."""
        return self.basins is not None and self.basins.complete

    @property
    def stored(self) -> str:
        """How many chunks have been done."""
        return f"{self.done} of {self.total} chunks of cells are stored"

    @property
    def notes(self) -> tuple[str, ...]:
        """What could not be done."""
        return () if self.basins is None else self.basins.notes

    def document(self, points: bool) -> dict[str, Any]:
        """The attractors with their cells, and how far the labels hold; with the label of each cell if wanted."""
        found = self.basins
        document: dict[str, Any] = {"chunks": {"done": self.done, "total": self.total}}
        if found is None:
            return document
        window = found.window
        document |= {
            "plane": dict(zip((window.across, window.up), map(list, window.within), strict=True)),
            "resolution": list(found.resolution),
            "attractors": [
                {
                    "name": name,
                    "kind": attractor.kind.value,
                    "period": attractor.period,
                    "cells": found.cells[name],
                    "state": attractor.state.tolist(),
                    "evidence": list(attractor.evidence),
                }
                for name, attractor in zip(found.names, found.attractors, strict=True)
            ],
            "unresolved": found.unresolved,
            "runaway": found.runaway,
            "check": {**asdict(found.check), "share": found.check.share, "limit": found.check.limit},
            "error": found.error,
        }
        if points:
            document["labels"] = found.labels.tolist()
        return document

    def tables(self) -> Mapping[str, Callable[[], Rows]]:
        """Where each cell leads, and the attractors."""
        if self.basins is None:
            return {}
        found = self.basins
        return {"cells": lambda: _cell_rows(found), "attractors": lambda: _attractor_rows(found)}


def _cell_rows(found: Basins) -> Iterator[list[object]]:
    across, up = (axis.tolist() for axis in found.axes)
    names = dict(enumerate(found.names)) | _WORDS
    yield [found.window.across, found.window.up, "leads.to"]
    for y, row in zip(up, found.labels.tolist(), strict=True):
        for x, label in zip(across, row, strict=True):
            yield [x, y, names[label]]


def _attractor_rows(found: Basins) -> Iterator[list[object]]:
    yield ["name", "kind", "period", "cells", *(f"{q}(0)" for q in state_names(found.system.coordinates))]
    for name, attractor in zip(found.names, found.attractors, strict=True):
        yield [name, attractor.kind.value, attractor.period, found.cells[name], *attractor.state.tolist()]

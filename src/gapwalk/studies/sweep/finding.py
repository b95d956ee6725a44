"""What the study of a sweep has found, as JSON values and as tables."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from gapwalk.attractors.box import state_names
from gapwalk.studies.columns import parameter_headings
from gapwalk.studies.finding import Finding, Rows, plain_numbers
from gapwalk.studies.sweep.record import Sweep


@dataclass(frozen=True)
class SweepFinding(Finding):
    """A sweep, as far as it has been driven."""

    sweep: Sweep

    @property
    def record(self) -> Sweep:
        """The sweep."""
        return self.sweep

    @property
    def complete(self) -> bool:
        """Whether it was driven to its end."""
        return self.sweep.complete

    @property
    def stored(self) -> str:
        """How many values have been done."""
        done = int(np.count_nonzero(self.sweep.regimes != ""))
        return f"{done} of {self.sweep.regimes.size} values are stored"

    @property
    def can_be_drawn(self) -> bool:
        """Whether there is any section point: all motions may have run away."""
        return not np.isnan(self.sweep.sections).all()

    @property
    def failures(self) -> tuple[str, ...]:
        """Where motions could not be followed."""
        return self.sweep.notes

    def document(self, points: bool) -> dict[str, Any]:
        """The lanes with their bands of equal regimes; with the section points if wanted."""
        sweep = self.sweep
        document: dict[str, Any] = {
            "parameter": sweep.parameter,
            "values": sweep.values.tolist(),
            "lanes": [self._lane_document(number) for number in range(len(sweep.lanes))],
        }
        if points:
            for number, lane in enumerate(document["lanes"]):
                lane["sections"] = plain_numbers(sweep.sections[number].tolist())
        return document

    def tables(self) -> Mapping[str, Callable[[], Rows]]:
        """The section points, and what each motion is."""
        return {"points": self._point_rows, "regimes": self._regime_rows}

    def _lane_document(self, number: int) -> dict[str, Any]:
        sweep, lane = self.sweep, self.sweep.lanes[number]
        return {
            "way": lane.way.value,
            "start": lane.start,
            "state": lane.state.tolist(),
            "bands": [
                {"regime": band.regime, "from": band.low, "to": band.high, "values": band.count}
                for band in sweep.bands(number)
            ],
            "transients": sweep.transients[number].tolist(),
            "settled": sweep.settled[number].tolist(),
            "regimes": sweep.regimes[number].tolist(),
        }

    def _point_rows(self) -> Iterator[list[object]]:
        names = self.sweep.system.coordinates
        yield ["way", "start", *parameter_headings([self.sweep.parameter], names), "point", *state_names(names)]
        sections = self.sweep.sections.reshape(-1, *self.sweep.sections.shape[2:])
        for head, section in zip(self._heads(), sections, strict=True):
            for number, state in enumerate(section[~np.isnan(section[:, 0])].tolist(), start=1):
                yield [*head, number, *state]

    def _regime_rows(self) -> Iterator[list[object]]:
        names = self.sweep.system.coordinates
        yield ["way", "start", *parameter_headings([self.sweep.parameter], names), "regime", "transient", "settled"]
        flat = (self.sweep.regimes.ravel(), self.sweep.transients.ravel(), self.sweep.settled.ravel())
        for head, regime, transient, settled in zip(self._heads(), *(part.tolist() for part in flat), strict=True):
            yield [*head, regime, transient, settled]

    def _heads(self) -> Iterator[tuple[object, ...]]:
        values = self.sweep.values.tolist()
        return ((lane.way.value, lane.start, value) for lane in self.sweep.lanes for value in values)

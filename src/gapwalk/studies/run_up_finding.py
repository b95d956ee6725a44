"""The finding of run-ups: largest forces, jumps beside those of the response, and tables of one motion or of many."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from gapwalk.answers.jump_delay import JumpDelay
from gapwalk.answers.run_up import RunUp
from gapwalk.answers.run_ups import LEVELS, RunUps
from gapwalk.attractors.spectrum import order_heading
from gapwalk.bifurcation.branch import Branch
from gapwalk.model.system import System
from gapwalk.orbit.measures import parameter_headings
from gapwalk.studies.study_kind import Finding, Rows, plain_numbers
from gapwalk.summary import SummaryParts, TableRows, summarizes

if TYPE_CHECKING:
    from gapwalk.studies.run_up_study import RunUpStudy


@dataclass(frozen=True, eq=False)
class SlowResponse:
    """The response over the speeds of a run-up, as a slow sweep meets it; or the reason why there is none."""

    #: The response, walked from the first speed to the last one; None if no periodic motion was found there.
    branch: Branch | None
    note: str = ""  #: A sentence where the response is not known over the whole range; else empty.


@dataclass(frozen=True, eq=False)
class RunUpFinding(Finding):
    """Finding of run-ups: a single motion, or the largest forces of many."""

    asked: RunUpStudy
    found: RunUp | RunUps | None
    done: int
    response: SlowResponse | None = None

    @property
    def record(self) -> RunUp | RunUps | None:
        """The run-up, or the run-ups so far."""
        return self.found

    @property
    def complete(self) -> bool:
        """True if all run-ups are done, and the response if it is wanted."""
        return self.done == self.asked.count and not (self.asked.with_response and self.response is None)

    @property
    def stored(self) -> str:
        """Describe how many run-ups are stored."""
        text = f"{self.done} of {self.asked.count} run-ups are stored"
        if not self.asked.with_response:
            return text
        return f"{text}; their response is {'stored too' if self.response else 'not computed yet'}"

    @property
    def notes(self) -> tuple[str, ...]:
        """The reason why a part of the response is not known."""
        return (self.response.note,) if self.response is not None and self.response.note else ()

    @property
    def drawn(self) -> dict[str, Any]:
        """Options of the picture: the response that lies below, and the orders of the waterfall."""
        options: dict[str, Any] = {"branch": self.response.branch if self.response else None}
        if isinstance(self.found, RunUp):
            options |= {"signal": self.signal, "orders": self.asked.orders, "window": self.asked.window}
        return options

    @property
    def signal(self) -> str:
        """Signal of the table and of the picture of a single run-up."""
        return self.asked.signal or (self.found.loudest if isinstance(self.found, RunUp) else "")

    @cached_property
    def delays(self) -> tuple[JumpDelay, ...]:
        """Jumps of a single run-up beside those of the response; none while the speed changes its direction."""
        found, response = self.found, self.response
        if not isinstance(found, RunUp) or response is None or response.branch is None or not found.course.is_one_way:
            return ()
        return found.delays(response.branch, found.coordinate_of(self.signal))

    @summarizes
    def summary(self) -> SummaryParts:
        """Return the largest forces, with their spread for many run-ups, and the jumps beside those of the response."""
        if self.found is None:
            return
        yield from self.found.summary()
        yield from (each.words(self.found.system) for each in self.delays)

    def document(self, points: bool) -> dict[str, Any]:
        """Return the largest forces; for a single run-up with the history of its signal if points are wanted."""
        found = self.found
        if found is None:
            return {}
        document: dict[str, Any] = {"run_ups": self.done, "sentences": list(found.sentences)}
        if isinstance(found, RunUp):
            document["peaks"] = [each._asdict() for each in found.peaks]
            if self.response is not None:
                document["jumps"] = [{k: plain_numbers(v) for k, v in each._asdict().items()} for each in self.delays]
            if points:
                signal = self.signal
                document["history"] = {
                    "signal": signal, "time": found.time.tolist(), "speed": found.speed.tolist(),
                    "values": found.signal(signal).tolist(),
                }  # fmt: skip
            return document
        document |= {"error": found.error, "worst": found.worst, "rates": found.rates.tolist()}
        document["contacts"] = {
            name: {"peaks": plain_numbers(found.peaks(name).tolist()), "speeds": found.places(name).tolist()}
            for name in found.touching
        }
        return document

    def tables(self) -> Mapping[str, Callable[[], Rows]]:
        """Return the largest forces; and the history and events of one run-up, or quantiles over the rate of many."""
        found = self.found
        if found is None:
            return {}
        if isinstance(found, RunUp):
            tables: dict[str, Callable[[], Rows]] = {
                "peaks": TableRows(lambda: _peak_rows(found), units={"force": ".force", "fastest": "'"}),
                "history": TableRows(lambda: self._history_rows(found), 1, self.signal),
                "envelope": lambda: self._envelope_rows(found),
            }
            if self.response is not None:
                pace = found.system.structure.pace
                tables["jumps"] = TableRows(self._jump_rows, units=dict.fromkeys(("fold", "jump", "delay"), pace))
            if self.asked.orders:
                tables["orders"] = TableRows(lambda: self._order_rows(found), 1, self.signal)
            return tables
        system, pace = found.system, found.system.structure.pace
        rate = f"{system.units.parameter(pace)}/s" if system.units else ""
        shares = {f"{name} {level:.0%}": ".force" for name in found.touching for level in LEVELS}
        return {
            "peaks": TableRows(
                lambda: _run_rows(found), units={"rate": rate, "phase": "rad", "peak.": ".force", f"{pace}.": pace}
            ),
            "rates": TableRows(lambda: _rate_rows(found), 1, units={"rate": rate, **shares}),
        }

    def _history_rows(self, found: RunUp) -> Iterator[list[object]]:
        signal = self.signal
        yield ["time", *_pace_heading(found.system), "theta", signal]
        columns = (found.time, found.speed, found.theta, found.signal(signal))
        yield from map(list, np.stack(columns, axis=1).tolist())

    def _envelope_rows(self, found: RunUp) -> Iterator[list[object]]:
        signal = self.signal
        yield [*_pace_heading(found.system), f"min.{signal}", f"max.{signal}"]
        yield from map(list, np.stack(found.envelope(signal), axis=1).tolist())

    def _jump_rows(self) -> Iterator[list[object]]:
        yield ["fold", "jump", "delay"]
        for each in self.delays:
            row: list[object] = [*plain_numbers([*each])]
            yield row

    def _order_rows(self, found: RunUp) -> Iterator[list[object]]:
        spectra = found.waterfall(self.signal, self.asked.orders, self.asked.window)
        heading = [spectra.parameter] if spectra.parameter == "time" else _pace_heading(found.system)
        yield [*heading, *map(order_heading, spectra.orders)]
        yield from map(list, np.column_stack((spectra.values, spectra.amplitudes)).tolist())


def _pace_heading(system: System) -> list[str]:
    return [*parameter_headings([system.structure.pace], system.coordinates)]


def _peak_rows(found: RunUp) -> Iterator[list[object]]:
    yield ["contact", "force", *_pace_heading(found.system), "time", "theta", "impacts", "fastest"]
    for each in found.peaks:
        row: list[object] = [*each]
        yield row


def _run_rows(found: RunUps) -> Iterator[list[object]]:
    names = found.touching
    pace = found.system.structure.pace
    yield ["rate", "phase", *(f"{what}.{name}" for name in names for what in ("peak", pace, "impacts"))]
    columns = [found.rates, found.phases]
    for name in names:
        impacts = found.impacts[:, :, found.contacts.index(name)].sum(axis=(1, 2))
        columns += [found.peaks(name), found.places(name), impacts]
    yield from map(list, plain_numbers(np.stack(columns, axis=1).tolist()))


def _rate_rows(found: RunUps) -> Iterator[list[object]]:
    names = found.touching
    yield ["rate", *(f"{name} {level:.0%}" for name in names for level in LEVELS)]
    tables = [found.quantiles(name) for name in names]
    if tables:
        yield from map(list, np.vstack([tables[0][0], *(values for _, values in tables)]).T.tolist())

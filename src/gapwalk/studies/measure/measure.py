"""A record beside the motion of a model: aligned, and fitted if that is wanted."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from gapwalk.errors import ModelError
from gapwalk.measurement.alignment import Alignment, align
from gapwalk.measurement.estimate import Estimate
from gapwalk.measurement.fit import Fit, fit
from gapwalk.measurement.measured_record import Record
from gapwalk.orbit.find import find_orbit
from gapwalk.studies.finding import Rows, plain_numbers
from gapwalk.studies.measure.table import MeasuredModel


@dataclass(frozen=True, eq=False)
class Measured:
    """A record beside a motion.

    Attributes
    ----------
    model
        What was asked.
    alignment
        Record and motion, after a fit if there was one.
    fit
        The fitted parameters; None if none was asked for.
    """

    model: MeasuredModel
    alignment: Alignment
    fit: Fit | None

    @property
    def notes(self) -> tuple[str, ...]:
        """What else there is to say, in sentences."""
        return self.alignment.doubts if self.fit is None else self.fit.notes

    @property
    def failures(self) -> tuple[str, ...]:
        """Why the result is not to be trusted, in sentences."""
        return () if self.fit is None else self.fit.failures

    def document(self) -> dict[str, Any]:
        """The same as plain JSON values."""
        found, orbit = self.alignment, self.alignment.orbit
        return {
            "title": self.model.title,
            "record": {"name": found.record.name, "samples": len(found.theta), "periods": found.periods},
            "signal": dict(found.signal.terms),
            "frequency": orbit.system.frequency,
            "orbit": {
                "period": orbit.period,
                "stable": orbit.stable,
                "pattern": orbit.pattern,
                "state": orbit.state.tolist(),
            },
            "agreement": _agreement(found),
            "lines": [line._asdict() | {"difference": line.difference} for line in found.agreement.lines],
            "fit": None if self.fit is None else _fit_document(self.fit),
            "notes": list(self.notes),
            "failures": list(self.failures),
        }

    def tables(self) -> Mapping[str, Callable[[], Rows]]:
        """The two histories, their lines, and the fitted parameters."""
        tables: dict[str, Callable[[], Rows]] = {"history": self._history_rows, "lines": self._line_rows}
        return tables if self.fit is None else {"parameters": self._parameter_rows, **tables}

    def _history_rows(self) -> Iterator[Sequence[object]]:
        found = self.alignment
        yield ["theta", "measured", "computed"]
        yield from np.column_stack((found.theta, found.measured, found.computed)).tolist()

    def _line_rows(self) -> Iterator[Sequence[object]]:
        yield ["order", "measured", "computed", "difference", "shift"]
        for line in self.alignment.agreement.lines:
            yield [line.order, line.first, line.second, line.difference, line.shift]

    def _parameter_rows(self) -> Iterator[Sequence[object]]:
        assert self.fit is not None
        yield list(Estimate._fields)
        yield from (list(each) for each in (*self.fit.estimates, self.fit.phase))


def measure(model: MeasuredModel, record: Record) -> Measured:
    """Put a record beside the motion of a model, and fit the parameters that the model names.

    Raises
    ------
    ModelError
        If the record does not suit the motion, or nobody knows the frequency.
    ConvergenceError
        If there is no such motion, or no fit is found.
    """
    system, measured = model.system, record.frequency(model.order)
    if measured is not None:
        system = system.at(frequency=measured)
    elif not model.frequency_given:
        raise ModelError("frequency is missing in the model, and the record has no speed; write frequency = ...")
    orbit = find_orbit(system, model.period, model.start)
    if not model.fit:
        return Measured(model, align(orbit, record, model.signal, order=model.order), None)
    found = fit(orbit, record, model.fit, model.signal, bounds=model.bounds, order=model.order)
    return Measured(model, found.after, found)


def _agreement(found: Alignment) -> dict[str, float]:
    agreed = found.agreement
    return {
        "rms": agreed.rms,
        "relative": agreed.relative,
        "correlation": agreed.correlation,
        "phase": found.phase,
    }


def _fit_document(found: Fit) -> dict[str, Any]:
    estimates = [plain_numbers(list(each)) for each in (*found.estimates, found.phase)]
    return {
        "parameters": [dict(zip(Estimate._fields, each, strict=True)) for each in estimates],
        "correlation": plain_numbers(found.correlation.tolist()),
        "evaluations": found.evaluations,
        "before": _agreement(found.before),
    }

"""Systems, options, ends and the state of a walk as plain JSON values, and back without loss.

Floats survive because Python writes the shortest text that reads back as the same number.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from gapwalk.bifurcation.detect import DetectorState
from gapwalk.bifurcation.diagram import Origin
from gapwalk.continuation.branch import Kind
from gapwalk.continuation.walk import End, EndReason
from gapwalk.model.contact import DampingLaw, Side
from gapwalk.model.structure import ContactForm, HarmonicForm, StageForm, Structure
from gapwalk.model.system import System

Plain = Any
"""What JSON can write."""


@dataclass(frozen=True, slots=True)
class Progress:
    """Where a walk has come to, but for its last two points: they are stored as points."""

    step: float
    count: int
    detector: DetectorState


def plain_system(system: System) -> Plain:
    """A system: what it is made of, and every parameter by name."""
    structure = system.structure
    return {
        "coordinates": list(structure.coordinates),
        "contacts": [
            {
                "name": contact.name,
                "stages": [{"name": stage.name, "side": stage.side.value} for stage in contact.stages],
                "damping": contact.damping.value,
                "reciprocal": contact.reciprocal,
            }
            for contact in structure.contacts
        ],
        "harmonics": [{"name": harmonic.name, "order": harmonic.order} for harmonic in structure.harmonics],
        "parameters": dict(system.parameters),
    }


def system_of(plain: Plain) -> System:
    """The system; any of KeyError, TypeError, ValueError (a ModelError is one) if there is none of this kind."""
    parameters = plain["parameters"]
    if 3 * len(plain["coordinates"]) ** 2 > len(parameters):  # before names without number are made up
        raise ValueError("a system has more parameters than are given")
    structure = Structure(
        tuple(_word(name) for name in plain["coordinates"]),
        tuple(
            ContactForm(
                _word(contact["name"]),
                tuple(StageForm(_word(s["name"], empty=True), Side(s["side"])) for s in contact["stages"]),
                DampingLaw(contact["damping"]),
                bool(contact["reciprocal"]),
            )
            for contact in plain["contacts"]
        ),
        tuple(HarmonicForm(_word(harmonic["name"]), int(harmonic["order"])) for harmonic in plain["harmonics"]),
    )
    if set(parameters) != set(structure.names):
        raise ValueError("the parameters are not those of the system")
    values = [float(parameters[name]) for name in structure.names]
    return System.from_values(structure, values).at()  # `at` refuses values that no system can have


def with_tuples(values: Mapping[str, Any]) -> dict[str, Any]:
    """The same with tuples in place of lists, as frozen options have them."""
    return {name: tuple(value) if isinstance(value, list) else value for name, value in values.items()}


def plain_end(end: End) -> Plain:
    """The end of a walk."""
    return {"reason": end.reason.name, "value": end.value, "detail": end.detail}


def end_of(plain: Plain) -> End:
    """The end; errors as `system_of`."""
    return End(EndReason[plain["reason"]], float(plain["value"]), str(plain["detail"]))


def plain_origin(origin: Origin | None) -> Plain:
    """Where a branch begins or ends on another."""
    return None if origin is None else {"parent": origin.parent, "special": origin.special}


def origin_of(plain: Plain) -> Origin | None:
    """The same; errors as `system_of`."""
    return None if plain is None else Origin(str(plain["parent"]), int(plain["special"]))


def plain_progress(progress: Progress) -> Plain:
    """Where a walk has come to."""
    detector = progress.detector
    return {
        "step": progress.step,
        "count": progress.count,
        "rates": {kind.value: float(rate) for kind, rate in detector.rates.items()},
        "recent": {kind.value: [float(zero) for zero in zeros] for kind, zeros in detector.recent.items()},
    }


def progress_of(plain: Plain) -> Progress:
    """Where it has come to; errors as `system_of`."""
    rates: Mapping[str, float] = plain["rates"]
    recent: Mapping[str, list[float]] = plain["recent"]
    detector = DetectorState(
        {Kind(kind): float(rate) for kind, rate in rates.items()},
        {Kind(kind): tuple(float(zero) for zero in zeros) for kind, zeros in recent.items()},
    )
    return Progress(float(plain["step"]), int(plain["count"]), detector)


def _word(name: str, *, empty: bool = False) -> str:
    if not name.isidentifier() and not (empty and name == ""):
        raise ValueError(f"{name!r} is no name")
    return name

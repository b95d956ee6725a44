"""Systems, options, ends and the state of a walk as plain JSON values, and back without loss.

Floats survive because Python writes the shortest text that reads back as the same number.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from gapwalk.bifurcation.branch import Kind
from gapwalk.bifurcation.detect import DetectorState
from gapwalk.bifurcation.diagram import Origin
from gapwalk.continuation.walk import End, EndReason
from gapwalk.model.structure import Structure
from gapwalk.model.system import System
from gapwalk.model.train.assembly import TrainAssembly
from gapwalk.study.store.plain_parts import contact_of, harmonic_of, plain_contact, plain_harmonic, word
from gapwalk.study.store.plain_train import plain_train, train_of

Plain = Any
"""What JSON can write."""

_MANY = 10_000  # parameters; beyond, zeros of matrices are not written
_COORDINATES = 5_000  # at most, in a file


@dataclass(frozen=True, slots=True)
class Progress:
    """Where a walk has come to, but for its last two points: they are stored as points."""

    step: float
    count: int
    detector: DetectorState


def plain_system(system: System) -> Plain:
    """A system: what it is made of, and its parameters by name."""
    structure = system.structure
    head: Plain = {
        "coordinates": list(structure.coordinates),
        "contacts": [plain_contact(contact) for contact in structure.contacts],
        "harmonics": [plain_harmonic(harmonic) for harmonic in structure.harmonics],
    }
    if isinstance(structure.assembly, TrainAssembly):
        head["train"] = plain_train(structure.assembly)
    return head | {"parameters": plain_parameters(system)}


def plain_parameters(system: System) -> dict[str, float]:
    """The parameters by name; of very many, zeros in vectors and matrices are left out."""
    if len(system.parameters) <= _MANY:
        return dict(system.parameters)
    names, values = system.structure.names, system.values
    places = {*np.flatnonzero(values).tolist(), *names.single}
    return {names[place]: float(values[place]) for place in sorted(places)}


def system_of(plain: Plain) -> System:
    """The system; any of KeyError, TypeError, ValueError (a ModelError is one) if there is none of this kind."""
    structure, parameters = _structure_of(plain), plain["parameters"]
    names = structure.names
    places = [names.place(name) for name in parameters]
    values = np.zeros(len(names))
    values[places] = [float(value) for value in parameters.values()]
    if not set(range(len(names)) if len(names) <= _MANY else names.single) <= set(places):
        raise ValueError("the parameters are not those of the system")
    return System.from_values(structure, values).at()  # `at` refuses values that no system can have


def _structure_of(plain: Plain) -> Structure:
    if "train" in plain:
        return train_of(plain["train"])
    if len(plain["coordinates"]) > min(
        _COORDINATES, len(plain["parameters"])
    ):  # before room is made for their matrices
        raise ValueError("a system has more parameters than are given")
    return Structure(
        tuple(word(name) for name in plain["coordinates"]),
        tuple(contact_of(contact) for contact in plain["contacts"]),
        tuple(harmonic_of(harmonic) for harmonic in plain["harmonics"]),
    )


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

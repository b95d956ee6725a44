"""A sketch of the system of a file that is wrong: it has the names of the file, so that studies can be checked."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from gapwalk.model.contact import Side
from gapwalk.model.large_files import expand
from gapwalk.model.model_fields import Names
from gapwalk.model.model_file import check_system
from gapwalk.model.model_source import Source
from gapwalk.model.system import System

_DAMPING = ("damping", "impact_damping", "viscous_damping")


@dataclass(frozen=True, slots=True)
class Sketch:
    """What is known of the system of a file.

    Parameters
    ----------
    system
        A system with the names of the file.
    guessed
        Whether its numbers mean nothing, because some in the file are wrong.
    """

    system: System
    guessed: bool = False


def sketch_of(source: Source) -> Sketch | None:
    """A sketch of the system of a file that is wrong.

    None where not even the names are known, or the file describes a drive train.
    """
    source, _ = expand(source)
    coordinates = Names.of(source.data).coordinates or []
    data = {key: source.data[key] for key in ("coordinates", "contact", "harmonic") if key in source.data}
    data["stiffness"] = [0.0] * len(coordinates)
    part, _ = check_system(replace(source, data=data))
    if part:
        return Sketch(part.system())
    contacts, harmonics = data.get("contact", []), data.get("harmonic", [])
    if not coordinates or not _is_list_of_tables(contacts) or not _is_list_of_tables(harmonics):
        return None
    direction = {coordinates[0]: 1.0}
    data |= {
        "coordinates": coordinates,
        "contact": [_contact(table, direction) for table in contacts],
        "harmonic": [
            {**_taken(table, ("name", "order")), "amplitude": 0.0, "acts_on": direction} for table in harmonics
        ],
    }
    part, _ = check_system(replace(source, data=data))
    return Sketch(part.system(), guessed=True) if part else None


def _contact(table: Mapping[str, Any], direction: Mapping[str, float]) -> dict[str, Any]:
    """A contact of the same parameters."""
    found = _taken(table, ("name",))
    found |= {key: table[key] if key == "damping" else 0.0 for key in _DAMPING if key in table}
    found |= {key: direction for key in ("deflection", "force") if key in table or key == "deflection"}
    stages = table.get("stage")
    if stages is None or not _is_list_of_tables(stages):
        return {**found, **_taken(table, ("side",), Side), "clearance": 0.0, "stiffness": 1.0}
    found["stage"] = [
        {**_taken(stage, ("name",)), **_taken(stage, ("side",), Side), "clearance": float(place), "stiffness": 1.0}
        for place, stage in enumerate(stages)
    ]
    return found


def _taken(table: Mapping[str, Any], keys: Sequence[str], allowed: type[Side] | None = None) -> dict[str, Any]:
    """What stands under some keys, as far as it is allowed."""
    known = {key: table[key] for key in keys if key in table}
    return {key: value for key, value in known.items() if allowed is None or value in list(allowed)}


def _is_list_of_tables(value: object) -> bool:
    return isinstance(value, list) and all(isinstance(table, Mapping) for table in value)

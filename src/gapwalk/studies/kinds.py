"""The kinds of study that a model file may hold, each with the schema of its table."""

from __future__ import annotations

from functools import cache
from importlib import import_module

from gapwalk.studies.tables import StudyPart

# Each is loaded only when a file has one: a frequency response need not wait for the code of basins.
_HOMES = {
    "response": "branch_table.ResponsePart",
    "diagram": "branch_table.DiagramPart",
    "map": "map.table.MapPart",
    "locus": "locus.table.LocusPart",
    "family": "family.table.FamilyPart",
    "settle": "settle.table.SettlePart",
    "sweep": "sweep.table.SweepPart",
    "basins": "basins.table.BasinsPart",
    "regimes": "regimes.table.RegimesPart",
}

KINDS = tuple(_HOMES)
"""The values of ``kind``."""


def part_of(kind: str) -> type[StudyPart]:
    """The schema of a kind of study, one of `KINDS`."""
    module, _, name = _HOMES[kind].rpartition(".")
    return getattr(import_module(f"gapwalk.studies.{module}"), name)


@cache
def all_keys() -> frozenset[str]:
    """The keys of all kinds of study."""
    return frozenset(info.alias or name for kind in KINDS for name, info in part_of(kind).model_fields.items())

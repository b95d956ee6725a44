"""The kinds of study, by the names that model files call them."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Annotated

from annotated_types import Ge

from gapwalk.errors import ModelError
from gapwalk.model.registry import Registry

if TYPE_CHECKING:
    from gapwalk.studies.kind import StudyKind

INLINE = "inline"
"""In ``Annotated``, marks a field whose own fields are keys of the table around it."""

OPEN = "open"
"""In ``Annotated``, marks a field that a table may leave out though it has no default: it depends on the system."""

Counted = Annotated[int, Ge(1)]
"""1, 2, 3, ..., as options have it: a bound that the schema of a table knows too."""

# Each is loaded only when it is asked for: a frequency response need not wait for the code of basins.
_HOMES = {
    "response": "response_study.ResponseOptions",
    "diagram": "diagram_study.DiagramStudyOptions",
    "map": "map_study.MapStudyOptions",
    "locus": "locus_study.LocusStudyOptions",
    "family": "family_study.FamilyStudy",
    "settle": "settle_study.SettleStudyOptions",
    "sweep": "sweep_study.SweepStudy",
    "basins": "basin_study.BasinStudy",
    "regimes": "regime_study.RegimeStudy",
}
_added: Registry[type[StudyKind]] = Registry("kind of study", "kinds of study")


def kinds() -> tuple[str, ...]:
    """The values of ``kind``."""
    return (*_HOMES, *_added)


def kind_of(name: str) -> type[StudyKind]:
    """A kind of study by its name, one of `kinds`; a LookupError if there is none."""
    if name in _added:
        return _added[name]
    module, _, found = _HOMES[name].rpartition(".")
    return getattr(import_module(f"gapwalk.studies.{module}"), found)


def add_kind(kind: type[StudyKind]) -> type[StudyKind]:
    """Register a kind of study under its `kind`, also as a decorator; a class that is defined again replaces itself.

    Raises
    ------
    ModelError
        If another kind has the name.
    """
    if kind.kind in _HOMES and kind is not kind_of(kind.kind):
        raise ModelError(f"there is a kind of study {kind.kind!r} already; choose another name")
    return _added.add(kind.kind, kind)

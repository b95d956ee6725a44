"""The options of studies as plain JSON values, and back without loss."""

from __future__ import annotations

from dataclasses import asdict
from importlib import import_module
from typing import Any

from pydantic import TypeAdapter

from gapwalk.orbit.balance.options import Balance
from gapwalk.orbit.shooting import Shooting
from gapwalk.study.options import BranchOptions, StudyOptions

# Each is loaded only when a result holds it, as with `gapwalk.study.kinds`.
_HOMES = {
    "response": "options.ResponseOptions",
    "diagram": "options.DiagramStudyOptions",
    "map": "options.MapStudyOptions",
    "locus": "locus.study_options.LocusStudyOptions",
    "family": "family.study_options.FamilyStudyOptions",
    "settle": "settle.study_options.SettleStudyOptions",
    "sweep": "sweep.study_options.SweepStudyOptions",
    "basins": "basins.study_options.BasinStudyOptions",
    "regimes": "regimes.study_options.RegimeStudyOptions",
}
_METHODS: dict[str, type[Shooting | Balance]] = {each.name: each for each in (Shooting, Balance)}


def plain_options(options: StudyOptions) -> Any:
    """The options of a study, with its kind, and the method of one of branches with its name."""
    plain = {"kind": options.kind, **asdict(options)}
    if isinstance(options, BranchOptions):
        plain["method"] = plain_method(options.method)
    return plain


def plain_method(method: Shooting | Balance) -> dict[str, Any]:
    """A way to find orbits, with its name."""
    return {"name": method.name, **asdict(method)}


def options_of(plain: Any) -> StudyOptions:
    """The options; any of KeyError, TypeError, ValueError if there are none of this kind."""
    values = dict(plain)
    kind = values.pop("kind")
    options = _class_of(kind)
    if issubclass(options, BranchOptions):
        # a file from before there were two methods has the options of the only one
        method = dict(values.pop("method", None) or {"name": Shooting.name, **values.pop("shooting")})
        values["method"] = TypeAdapter(_METHODS[method.pop("name")]).validate_python(method)
    return TypeAdapter(options).validate_python(values)


def _class_of(kind: str) -> type[StudyOptions]:
    if kind not in _HOMES:
        raise ValueError(f"there is no study of the kind {kind!r}")
    module, _, name = _HOMES[kind].rpartition(".")
    return getattr(import_module(f"gapwalk.study.{module}"), name)

"""The options of studies as plain JSON values, and back without loss."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from pydantic import TypeAdapter

from gapwalk.orbit.balance.options import Balance
from gapwalk.orbit.shooting import Shooting
from gapwalk.study.basins.study_options import BasinStudyOptions
from gapwalk.study.family.study_options import FamilyStudyOptions
from gapwalk.study.options import BranchOptions, DiagramStudyOptions, MapStudyOptions, ResponseOptions, StudyOptions
from gapwalk.study.regimes.study_options import RegimeStudyOptions
from gapwalk.study.settle.study_options import SettleStudyOptions
from gapwalk.study.sweep.study_options import SweepStudyOptions

_OPTIONS: dict[str, type[StudyOptions]] = {
    each.kind: each
    for each in (
        ResponseOptions,
        DiagramStudyOptions,
        MapStudyOptions,
        FamilyStudyOptions,
        SettleStudyOptions,
        SweepStudyOptions,
        BasinStudyOptions,
        RegimeStudyOptions,
    )
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
    if kind not in _OPTIONS:
        raise ValueError(f"there is no study of the kind {kind!r}")
    if issubclass(_OPTIONS[kind], BranchOptions):
        # a file from before there were two methods has the options of the only one
        method = dict(values.pop("method", None) or {"name": Shooting.name, **values.pop("shooting")})
        values["method"] = TypeAdapter(_METHODS[method.pop("name")]).validate_python(method)
    return TypeAdapter(_OPTIONS[kind]).validate_python(values)

"""The options of studies as plain JSON values, and back without loss."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from pydantic import TypeAdapter

from gapwalk.study.basins.study_options import BasinStudyOptions
from gapwalk.study.options import DiagramStudyOptions, MapStudyOptions, ResponseOptions, StudyOptions
from gapwalk.study.regimes.study_options import RegimeStudyOptions
from gapwalk.study.settle.study_options import SettleStudyOptions
from gapwalk.study.sweep.study_options import SweepStudyOptions

_OPTIONS: dict[str, type[StudyOptions]] = {
    each.kind: each
    for each in (
        ResponseOptions,
        DiagramStudyOptions,
        MapStudyOptions,
        SettleStudyOptions,
        SweepStudyOptions,
        BasinStudyOptions,
        RegimeStudyOptions,
    )
}


def plain_options(options: StudyOptions) -> Any:
    """The options of a study, with its kind."""
    return {"kind": options.kind, **asdict(options)}


def options_of(plain: Any) -> StudyOptions:
    """The options; any of KeyError, TypeError, ValueError if there are none of this kind."""
    values = dict(plain)
    kind = values.pop("kind")
    if kind not in _OPTIONS:
        raise ValueError(f"there is no study of the kind {kind!r}")
    return TypeAdapter(_OPTIONS[kind]).validate_python(values)

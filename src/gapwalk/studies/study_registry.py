"""The kinds of study, by their names in model files."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, TypeVar

from gapwalk.errors import ModelError
from gapwalk.model.registry import Registry

if TYPE_CHECKING:
    from gapwalk.studies.study_kind import StudyKind

K = TypeVar("K", bound="StudyKind")

INLINE = "inline"
"""In ``Annotated``, marks a field whose own fields are keys of the table around it."""

OPEN = "open"
"""In ``Annotated``, marks a field that a table may leave out though it has no default: it depends on the system."""

MAX_VALUES = 100_000
"""Largest number of values of a parameter, of periods and of branches."""


def check_values(name: str, values: object, least: int, parameter: str) -> None:
    """Require a number of values of a parameter, at least `least`, or a tuple of its values."""
    if isinstance(values, tuple):
        fits = len(values) >= least and all(isinstance(each, float | int) and math.isfinite(each) for each in values)
    else:
        fits = isinstance(values, int) and not isinstance(values, bool) and least <= values <= MAX_VALUES
    if not fits:
        allowed = f"an integer from {least} to {MAX_VALUES:,}, or values of {parameter}"
        raise ModelError(f"{name} is {values!r}; it must be {allowed}")


# Each is loaded only when it is asked for: a frequency response need not wait for the code of basins.
_KINDS: Registry[type[StudyKind]] = Registry(
    "kind of study",
    "kinds of study",
    {
        "response": "gapwalk.studies.response_study.ResponseOptions",
        "diagram": "gapwalk.studies.diagram_study.DiagramStudyOptions",
        "map": "gapwalk.studies.map_study.MapStudyOptions",
        "locus": "gapwalk.studies.locus_study.LocusStudyOptions",
        "family": "gapwalk.studies.family_study.FamilyStudy",
        "settle": "gapwalk.studies.settle_study.SettleStudyOptions",
        "sweep": "gapwalk.studies.sweep_study.SweepStudy",
        "basins": "gapwalk.studies.basin_study.BasinStudy",
        "regimes": "gapwalk.studies.regime_study.RegimeStudy",
        "tolerance": "gapwalk.studies.tolerance_study.ToleranceStudy",
        "rattle": "gapwalk.studies.rattle_study.RattleStudy",
        "threshold": "gapwalk.studies.threshold_study.ThresholdStudy",
        "run-up": "gapwalk.studies.run_up_study.RunUpStudy",
        "design": "gapwalk.studies.design_study.DesignStudy",
        "backbone": "gapwalk.studies.backbone_study.BackboneStudy",
        "self-excited": "gapwalk.studies.self_excited_study.SelfExcitedStudy",
        "tori": "gapwalk.studies.tori_study.ToriStudy",
        "scan": "gapwalk.studies.scan_study.ScanStudy",
    },
)


def kinds() -> tuple[str, ...]:
    """Return the names of all kinds of study."""
    return _KINDS.names


def added_kinds() -> tuple[str, ...]:
    """Return the names of the kinds of study that are not the package's own."""
    return _KINDS.added


def kind_of(name: str) -> type[StudyKind]:
    """Return a kind of study by its name, one of `kinds`."""
    return _KINDS.named(name)


def add_kind(kind: type[K]) -> type[K]:
    """Register a kind of study under its `kind`, also as a decorator; a redefined class replaces the old one.

    Parameters
    ----------
    kind
        The class of the study.

    Returns
    -------
    type
        The class itself.

    Raises
    ------
    ModelError
        If another kind has the name.

    Examples
    --------
    >>> gw.studies.add_kind(type(study.options)) is type(study.options)  # as gapwalk has done
    True
    """
    _KINDS.add(kind.kind, kind)
    return kind

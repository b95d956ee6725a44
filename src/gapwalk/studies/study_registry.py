"""The kinds of study, by their names in model files."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache, partial
from operator import ge, le, lt
from typing import TYPE_CHECKING, Annotated, Any, get_args, get_origin, get_type_hints

from annotated_types import Ge, Gt, Le

from gapwalk.errors import ModelError
from gapwalk.model.registry import Registry

if TYPE_CHECKING:
    from gapwalk.studies.study_kind import StudyKind

INLINE = "inline"
"""In ``Annotated``, marks a field whose own fields are keys of the table around it."""

OPEN = "open"
"""In ``Annotated``, marks a field that a table may leave out though it has no default: it depends on the system."""

Counted = Annotated[int, Ge(1)]
"""1, 2, 3, ..., as options have it: a bound that the schema of a table knows too."""

MAX_VALUES = 100_000
"""Largest number of values of a parameter, of periods and of branches."""


def check_integers(options: object, most: float = math.inf, **least: int) -> None:
    """Refuse options that are not integers in their range."""
    for name, low in least.items():
        value = getattr(options, name)
        if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= most:
            allowed = f">= {low}" if most == math.inf else f"from {low} to {most:,}"
            raise ModelError(f"{name} is {value!r}; it must be an integer {allowed}")


def check_bounds(options: object) -> None:
    """Refuse values beyond the bounds of their fields, as ``Annotated[int, Ge(0)]``; schemas check those of tables."""
    for name, kind, fits, allowed in _bounds(type(options)):
        value = getattr(options, name)
        if value is None or isinstance(value, tuple | str):  # another member of a union
            continue
        if isinstance(value, bool) or not isinstance(value, kind) or not all(each(value) for each in fits):
            raise ModelError(f"{name} is {value!r}; it must be {allowed}")


@cache
def _bounds(kind: type) -> tuple[tuple[str, Any, tuple[Callable[[Any], bool], ...], str], ...]:
    """Return fields with bounds: name, types, tests of a value, and what is allowed in words."""
    found = []
    for name, hint in get_type_hints(kind, include_extras=True).items():
        for each in [hint] if get_origin(hint) is Annotated else get_args(hint):
            number, *marks = get_args(each) or (None,)
            limits = {
                type(mark): getattr(mark, type(mark).__name__.lower())
                for mark in marks
                if isinstance(mark, Ge | Gt | Le)
            }
            if number not in (int, float) or not limits:
                continue
            fits = tuple(partial(_TESTS[each], limit) for each, limit in limits.items())
            low = "> " + f"{limits[Gt]:g}" if Gt in limits else ">= " + f"{limits.get(Ge, 0):g}"
            words = f"from {limits[Ge]:g} to {limits[Le]:,}" if Le in limits and Ge in limits else low
            kinds = int if number is int else int | float
            found.append((name, kinds, fits, f"an integer {words}" if number is int else words))
    return tuple(found)


_TESTS: dict[Any, Callable[[Any, Any], bool]] = {Ge: le, Gt: lt, Le: ge}  # of a limit and a value


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


def add_kind(kind: type[StudyKind]) -> type[StudyKind]:
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
    return _KINDS.add(kind.kind, kind)

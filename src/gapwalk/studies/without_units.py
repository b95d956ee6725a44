"""A study of a drive train with units in the non-dimensional form of that train."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any

from gapwalk.errors import ModelError
from gapwalk.model.drivetrain.nondimensional import NonDimensional, nondimensional
from gapwalk.studies.options import ParameterRange
from gapwalk.studies.study_file import Study
from gapwalk.studies.study_kind import StudyKind


def without_units(study: Study) -> Study:
    """Return a study in non-dimensional form; its changes state the scaling of its numbers."""
    form = nondimensional(study.system)
    changes = (*study.changes, ("units", f"none: {form.scales.words}"))
    return replace(study, system=form.system, options=_options(study.options, form), changes=changes)


def _options(options: StudyKind, form: NonDimensional) -> StudyKind:
    if options.kind == "basins":
        raise ModelError(
            "basins are found in a plane of states, in the units of the file; leave --units none out for them"
        )
    given = {each.name: getattr(options, each.name) for each in fields(options)}
    changed: dict[str, Any] = {}
    if "parameter" in given:
        name = given["parameter"]
        changed = {"parameter": form.name(name)}
        changed |= {end: form.value(name, given[end]) for end in ("begin", "end")}
        if given.get("near") is not None:
            changed["near"] = form.value(name, given["near"])
        changed["search_values"] = _scaled(given.get("search_values"), name, form)
    second = given.get("second")
    if isinstance(second, ParameterRange):
        name = second.parameter
        ends = (form.value(name, value) for value in (second.begin, second.end))
        changed["second"] = ParameterRange(form.name(name), *ends)
        changed["sections"] = _scaled(given.get("sections"), name, form)
    if isinstance(start := given.get("start"), tuple):
        changed["start"] = tuple(form.state(start).tolist())
    if isinstance(starts := given.get("starts"), tuple):
        changed["starts"] = tuple(tuple(form.state(state).tolist()) for state in starts)
    return replace(options, **{key: value for key, value in changed.items() if key in given})


def _scaled(values: Any, name: str, form: NonDimensional) -> Any:
    """Return values of a parameter in non-dimensional form; a number of values is unchanged."""
    return tuple(form.value(name, value) for value in values) if isinstance(values, tuple) else values

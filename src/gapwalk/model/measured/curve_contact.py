"""Contacts whose springs follow a measured curve: each corner is a stage; and the key ``curve`` of model files."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gapwalk.errors import ModelError
from gapwalk.model.contact import Contact, Side, Stage
from gapwalk.model.measured.measured_table import NamedFile, WantedColumn, read_table
from gapwalk.model.measured.spring_curve import ERROR, Corner, Curve, spring_curve
from gapwalk.model.model_source import Source
from gapwalk.model.problems import Problem, given
from gapwalk.model.units import QuantityKind, Unit

LAW = "piecewise"
"""The force law of a measured curve."""

CURVED = ("contact", "shaft", "gear")
"""The tables of model files that may have the key ``curve``."""


@dataclass(frozen=True, eq=False)
class MeasuredCurve:
    """The measured points of a contact, and the curve through them."""

    name: str  #: Name of the contact, shaft or gear.
    curve: Curve  #: The curve.
    #: deflection, force: shape (points,): The points: angles in the unit of the file, torques in N m.
    deflection: NDArray[np.float64]
    force: NDArray[np.float64]
    angle: Unit | None = None  #: That unit; None for plain numbers.


_OWN = ("curve", "interpolation", "error")
_WITHOUT = (
    "law",
    "clearance",
    "stiffness",
    "cubic",
    "side",
    "stage",
    "preload",
    "quadratic",
    "offset",
    "even_quadratic",
)


def measured_spring(
    name: str,
    deflection: Mapping[str, float],
    curve: Curve | str | os.PathLike[str],
    *,
    scale: float = 1.0,
    force: Mapping[str, float] | None = None,
) -> Contact:
    """Make a contact from a measured curve of force over deflection.

    Parameters
    ----------
    name
        Prefix of its parameters' names: ``clutch.scale``, ``clutch.corner1.clearance``, ...
    deflection
        The deflection by coordinate name.
    curve
        The curve, as from `spring_curve`; or a CSV file with a column of deflections and one of forces, without units.
    scale
        Factor of the whole force.
    force
        Where it acts; by default along its deflection.

    Returns
    -------
    Contact
        The contact, with a stage for each corner.

    Raises
    ------
    ModelError
        If the file is no curve.

    Examples
    --------
    >>> curve = gw.laws.spring_curve([-4, -2, 2, 4], [-10, 0, 0, 10])
    >>> [(stage.clearance, stage.stiffness) for stage in gw.laws.measured_spring("clutch", {"x": 1.0}, curve).stages]
    [(2.0, 5.0)]
    """
    if not isinstance(curve, Curve):
        curve = _read("", curve, "linear", ERROR, None).curve
    stages, numbers = stages_of_curve(curve)
    return Contact(name, deflection, stages, force, LAW, numbers, scale=scale)


def stages_of_curve(curve: Curve) -> tuple[tuple[Stage, ...], dict[str, float]]:
    """Return the stages of a curve from the inside out, and the parameters of its contact as a whole."""
    value, slope, quadratic, cubic = curve.base
    corners, numbers = list(curve.corners), {}
    found: list[Stage] = []
    at_rest = next((corner for corner in corners if corner.position == 0.0), None)
    if at_rest is not None:  # another polynomial on each side
        corners.remove(at_rest)
        left = Corner(-0.0, -1, value, slope, quadratic, cubic)
        total = [part + change for part, change in zip(curve.base, at_rest.change, strict=True)]
        found += [_stage(each) for each in (Corner(0.0, 1, *total), left) if any(each.change)]
    elif any(curve.base):
        found.append(Stage(0.0, slope, cubic))
        numbers = {"offset": value, "even_quadratic": quadratic}
    outer = [_stage(corner) for corner in corners]
    mirrored = {(stage.clearance, *_numbers(stage)): stage for stage in outer if stage.side is Side.NEGATIVE}
    for stage in sorted(outer, key=lambda stage: (stage.clearance, stage.side is Side.NEGATIVE)):
        key = (stage.clearance, *_numbers(stage))
        if stage.side is Side.POSITIVE and key in mirrored:
            found.append(replace(stage, side=Side.BOTH))
        elif stage.side is Side.POSITIVE or not _has_mirror(stage, outer):
            found.append(stage)
    if not found:
        raise ModelError("the curve is zero everywhere; a contact needs a force")
    names = _names(found) if len(found) > 1 else [""]
    return tuple(replace(stage, name=name) for stage, name in zip(found, names, strict=True)), numbers


def _stage(corner: Corner) -> Stage:
    side = Side.POSITIVE if corner.side > 0 else Side.NEGATIVE
    even = {"preload": corner.side * corner.step, "quadratic": corner.side * corner.quadratic}
    numbers = {name: value for name, value in even.items() if value}
    return Stage(abs(corner.position), corner.slope, corner.cubic, side, numbers=numbers)


def _numbers(stage: Stage) -> tuple[float, ...]:
    return stage.stiffness, stage.cubic, stage.numbers.get("preload", 0.0), stage.numbers.get("quadratic", 0.0)


def _has_mirror(stage: Stage, stages: Sequence[Stage]) -> bool:
    """Return True if the same stage acts on the other side."""
    key = (stage.clearance, *_numbers(stage))
    return any(each.side is not stage.side and (each.clearance, *_numbers(each)) == key for each in stages)


def _names(stages: Sequence[Stage]) -> Iterator[str]:
    count = 0
    for stage in stages:
        if stage.clearance == 0.0:
            yield {Side.BOTH: "base", Side.POSITIVE: "right", Side.NEGATIVE: "left"}[stage.side]
        else:
            count += 1
            yield f"corner{count}"


def _read(
    name: str,
    file: str | os.PathLike[str] | NamedFile,
    interpolation: Any,
    error: Any,
    kinds: tuple[QuantityKind, QuantityKind] | None,
) -> MeasuredCurve:
    """Read a curve from a CSV file, with angles in the unit of the file."""
    deflection, force = kinds or (None, None)
    wanted = [
        WantedColumn("deflection", deflection, ("angle", "twist", "displacement", "x")),
        WantedColumn("torque" if kinds else "force", force, ("torque", "force", "moment", "load", "f")),
    ]
    table = read_table(file, wanted)
    angle = table[wanted[0].role].unit
    x, f = table[wanted[0].role].values(angle), table[wanted[1].role].values()
    return MeasuredCurve(name, spring_curve(x, f, interpolation, error), x, f, angle)


def with_curves(source: Source, *, units: bool) -> tuple[dict[str, Any], list[Problem]]:
    """Replace the key ``curve`` of contacts, shafts and gears by the stages of the measured curve."""
    data, problems = dict(source.data), []
    for key in CURVED:
        tables = data.get(key)
        if not isinstance(tables, list):
            continue
        tables = data[key] = list(tables)
        for number, table in enumerate(tables):
            if not isinstance(table, Mapping) or "curve" not in table:
                continue
            try:
                tables[number] = _with_stages(table, units=units)
            except (ModelError, ValueError) as error:
                tables[number] = {each: value for each, value in table.items() if each not in _OWN}
                tables[number] |= {"clearance": 0.0, "stiffness": "1 N m/rad" if units else 1.0}
                problems.append(source.problem(f"is {_given(table['curve'])}: {error}", (key, number, "curve")))
    return data, problems


def _with_stages(table: Mapping[str, Any], *, units: bool) -> dict[str, Any]:
    """Return the table of a contact with stages in place of its curve."""
    if both := [each for each in _WITHOUT if each in table]:
        raise ModelError(f"it is given together with {both[0]}; the curve has all of the force, leave {both[0]} out")
    measured = measured_curve(table, units=units)
    stages, numbers = stages_of_curve(measured.curve)
    rest = {each: value for each, value in table.items() if each not in _OWN}
    own = {name: _with_unit(name, value, measured.angle) for name, value in numbers.items() if value}
    return rest | own | {"law": LAW, "stage": [_stage_table(stage, measured.angle) for stage in stages]}


def measured_curve(table: Mapping[str, Any], *, units: bool) -> MeasuredCurve:
    """Return the curve of the table of a contact, which has the content of its file (`NamedFile`)."""
    if not isinstance(table["curve"], NamedFile):
        raise ModelError('it must be the name of a CSV file, as in curve = "clutch.csv"')
    kinds = (QuantityKind.ANGLE, QuantityKind.TORQUE) if units else None
    interpolation, error = table.get("interpolation", "linear"), table.get("error", ERROR)
    if interpolation not in ("linear", "cubic"):
        raise ModelError(f'interpolation is {given(interpolation)}; it is "linear" or "cubic"')
    if units and interpolation == "cubic":
        raise ModelError('interpolation is "cubic", which is not available with units; write interpolation = "linear"')
    return _read(str(table.get("name", "")), table["curve"], interpolation, error, kinds)


def _stage_table(stage: Stage, angle: Unit | None) -> dict[str, Any]:
    numbers = {"clearance": stage.clearance, "stiffness": stage.stiffness, "cubic": stage.cubic, **stage.numbers}
    found: dict[str, Any] = {name: _with_unit(name, value, angle) for name, value in numbers.items()}
    found["side"] = stage.side.value
    return found | ({"name": stage.name} if stage.name else {})


def _given(value: object) -> str:
    return given(value.name if isinstance(value, NamedFile) else value)


def _with_unit(name: str, value: float, angle: Unit | None) -> float | str:
    if angle is None or not value:
        return value
    kinds = {"clearance": angle.text, "stiffness": f"N m/{angle.text}", "preload": "N m", "offset": "N m"}
    return f"{value!r} {kinds[name]}" if name in kinds else value

"""Quantities with units in a drive train: search, checks, and conversion to numbers."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeVar

from gapwalk.model.contact import Stage
from gapwalk.model.drivetrain.train_parts import Gear, Inertia, Link, Shaft
from gapwalk.model.loads import Load
from gapwalk.model.units import Quantity, QuantityKind, Units, has_unit, kind_of, read_quantity, units_of

_OF_LINKS = ("stiffness", "damping", "clearance", "cubic")
_OF_STAGES = ("clearance", "stiffness", "cubic")

Change = Callable[[str, Any], Any]
"""Another value for a quantity, by its name and value."""

L = TypeVar("L", bound=Link)


@dataclass(frozen=True)
class Contents:
    """All parts of a train that have quantities."""

    inertias: Sequence[Inertia]
    shafts: Sequence[Shaft]
    gears: Sequence[Gear]
    mean: Mapping[str, Any]
    harmonics: Sequence[Load]
    pace: Any

    def changed(self, change: Change, pace: str) -> Contents:
        """Return the parts with other values of their quantities; `pace` is the name of the frequency or the speed."""
        return Contents(
            tuple(replace(each, inertia=change(f"{each.name}.inertia", each.inertia)) for each in self.inertias),
            tuple(_link(each, change) for each in self.shafts),
            tuple(_link(each, change) for each in self.gears),
            {name: change(f"mean.{name}", value) for name, value in self.mean.items()},
            tuple(
                replace(each, **_numbers(each.name, {p.name: getattr(each, p.name) for p in each.parameters}, change))
                for each in self.harmonics
            ),
            change(pace, self.pace),
        )


def without_units(contents: Contents, units: Units | None, pace: str) -> tuple[Contents, Units | None, list[str]]:
    """The parts with plain numbers in place of quantities, each in the unit of its kind.

    Parameters
    ----------
    contents
        The parts.
    units
        The units of what is a plain number already; None if nothing has been read before.
    pace
        ``"frequency"``, or ``"speed"`` where that is given.

    Returns
    -------
    contents, units
        The parts, and their units; None if nothing has a unit.
    problems : list of str
        What is wrong: each begins with the name of a quantity.
    """
    found, problems = _collected(contents, pace, mixed=units is not None)
    if problems or not found:
        return contents, units, problems
    # periods of the excitation per turn: orders 2, 4 and 6 of a shaft repeat twice in each of its turns
    turns = math.gcd(*(each.order for each in contents.harmonics)) or 1
    known = units or units_of(found, turns if pace == "speed" else None)

    def numbered(name: str, value: Any) -> Any:
        return known.number(value, value.kind) if isinstance(value, Quantity) else value

    def read(name: str, value: Any) -> Any:
        kind = kind_of(name)
        return read_quantity(value, kind) if kind is not None and isinstance(value, str) else value

    return contents.changed(read, pace).changed(numbered, pace), known, []


def _collected(contents: Contents, pace: str, *, mixed: bool) -> tuple[list[Quantity], list[str]]:
    """All quantities with units, and what is wrong; plain numbers are, unless all are so or `mixed` allows them."""
    values: list[tuple[str, Any]] = []

    def note(name: str, value: Any) -> Any:
        values.append((name, value))
        return value

    contents.changed(note, pace)
    if not any(has_unit(value) for name, value in values if kind_of(name) is not QuantityKind.PHASE):
        values = [(name, value) for name, value in values if has_unit(value)] if mixed else []
    found, problems = [], []
    for name, value in values:
        kind = kind_of(name)
        plain = not isinstance(value, str | Quantity)
        if kind is None or value is None or (plain and (mixed or value == 0)):  # nothing is zero in any unit
            continue
        try:
            found.append(read_quantity(value, kind))
        except ValueError as error:
            problems.append(f"{name} {error}")
    return found, problems


def _link(link: L, change: Change) -> L:
    values = {what: change(f"{link.name}.{what}", getattr(link, what)) for what in _OF_LINKS}
    stages = tuple(_stage(link, number, stage, change) for number, stage in enumerate(link.stages))
    return replace(link, stages=stages, numbers=_numbers(link.name, link.numbers, change), **values)


def _stage(link: Link, number: int, stage: Stage, change: Change) -> Stage:
    prefix = f"{link.name}.{stage.name or f'stage[{number}]'}"
    values = {what: change(f"{prefix}.{what}", getattr(stage, what)) for what in _OF_STAGES}
    return replace(stage, numbers=_numbers(prefix, stage.numbers, change), **values)


def _numbers(prefix: str, numbers: Mapping[str, Any], change: Change) -> dict[str, Any]:
    return {what: change(f"{prefix}.{what}", value) for what, value in numbers.items()}

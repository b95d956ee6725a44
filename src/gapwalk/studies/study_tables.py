"""Common parts of the tables ``[study]`` of all kinds, and of those of maps over a plane."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import MISSING, dataclass
from enum import StrEnum
from typing import Annotated, Any

from annotated_types import Ge, Le, MinLen
from pydantic import (
    AfterValidator,
    BeforeValidator,
    Field,
    ValidationInfo,
    WrapValidator,
    field_validator,
)

from gapwalk.errors import ModelError
from gapwalk.model.bounds import Counted
from gapwalk.model.measured.measured_table import NamedFile
from gapwalk.model.problems import did_you_mean, given
from gapwalk.model.schema import Part, Text, one_of
from gapwalk.model.system import System
from gapwalk.model.units import PACES, has_unit, kind_of, read_quantity
from gapwalk.studies.study_registry import MAX_VALUES

Within = tuple[tuple[float, float], tuple[float, float]]
"""The ranges of two axes."""

MAX_CELLS = 10_000_000
"""Of a map over a plane; of each some hundred bytes are kept."""


CountOrValues = Annotated[int, Ge(1), Le(MAX_VALUES)] | Annotated[tuple[float, ...], MinLen(1)]
"""How many values, spread evenly over a range; or the values themselves."""


PARAMETERS = (
    Mapping[str, tuple[float, float]],
    MISSING,
    'The two parameters and their ranges, the horizontal one first: ``{"frequency": (0.2, 1.2), "mean.q1": (0, 1)}``.',
)
"""Argument of a function: the plane of two parameters; see `gapwalk.studies.study_kind.StudyKind.call_types`."""
CELLS = (int | tuple[int, int], 128, "Cells along each axis, or (columns, rows).")
"""Argument of a function: the resolution of a plane."""


def check_inside(values: Sequence[float], key: str, ends: tuple[Any, ...]) -> None:
    """Raise a ModelError, beginning with the key, if one of its values lies outside a range."""
    low, high = sorted(ends)
    for value in values:
        if not low <= value <= high:
            raise ModelError(f"{key} has {value:g}, outside the range from {low:g} to {high:g}")


def check_resolution(given: int | tuple[int, int]) -> tuple[int, int]:
    """Return the number of columns and rows; raise a ModelError that says what to write if they are invalid."""
    both = (given, given) if isinstance(given, int) else tuple(given)
    if len(both) != 2 or any(isinstance(n, bool) or not isinstance(n, int) or n < 1 for n in both):
        raise ModelError(f"resolution is {given!r}; write a number of cells, or (columns, rows)")
    if both[0] * both[1] > MAX_CELLS:
        raise ModelError(f"resolution is {both[0]:,} x {both[1]:,} cells; there may be {MAX_CELLS:,}, as 4000 x 2500")
    return both


def check_parameters(system: System, plane: Mapping[str, Sequence[float]]) -> tuple[tuple[str, str], Within]:
    """Return the two parameters of a plane, horizontal one first, and their ranges; raise a ModelError if invalid."""
    if len(plane) != 2:
        raise ModelError(
            f"a plane has two axes, but {len(plane)} ranges were given ({', '.join(plane) or 'none'}); write "
            '{"frequency": (0.2, 1.2), "harmonic1.amplitude": (0, 1)}'
        )
    first, second = plane
    return (first, second), (check_range(system, first, plane[first]), check_range(system, second, plane[second]))


def check_range(system: System, name: str, given: Sequence[float]) -> tuple[float, float]:
    """Return the range of a parameter, the smaller value first; raise a ModelError if an end of it is invalid."""
    try:
        low, high = (float(value) for value in given)
    except (TypeError, ValueError):
        raise ModelError(f"the range of {name} is {given!r}; write two numbers (low, high)") from None
    for value in (low, high):
        there = system.at({name: value})
        if (limits := system.structure.pace_limits).tables and not limits.covers(there[system.structure.pace]):
            raise ModelError(f"the range of {name} is from {low:g} to {high:g}, but {limits.words}: stay within it")
    if not low < high:
        raise ModelError(f"the range of {name} is from {low:g} to {high:g}: it is empty; write (low, high)")
    return low, high


@dataclass(frozen=True)
class Surroundings:
    """Context of the validators of a study.

    Examples
    --------
    >>> import dataclasses
    >>> [each.name for each in dataclasses.fields(gw.studies.Surroundings)][:2]
    ['system', 'frequency_given']
    """

    #: The system; if the file is wrong elsewhere, one with the same parameters; None if even those are unknown.
    system: System | None
    frequency_given: bool  #: True if the file gives the frequency.
    alone: bool = True  #: True if there is no other study in the file.
    taken: tuple[str, ...] = ()  #: Names of the studies before it.
    #: Returns the keys of all kinds of study, which are not allowed as names of studies.
    all_keys: Callable[[], frozenset[str]] = frozenset
    #: True if the numbers of the system are placeholders: then values of parameters are not checked.
    guessed: bool = False
    #: Reads a file that the model file names; see `gapwalk.model.measured.measured_table.read_named`.
    read: Callable[[str], NamedFile] | None = None


def _state_length(start: tuple[float, ...], info: ValidationInfo[Surroundings]) -> tuple[float, ...]:
    system = info.context.system
    if system and len(start) not in {2 * system.size, system.state_size}:
        more = f", and perhaps the extensions ({', '.join(system.state_names[2 * system.size :])})"
        raise ValueError(
            f"is a list of {len(start)} numbers; it must have {2 * system.size}: the positions at t = 0, "
            f"then the velocities{more if system.structure.memories else ''}"
        )
    return start


class Start(StrEnum):
    """Start of the search for the first orbit of a study."""

    REST = "rest"
    """Newton's method from the state zero."""
    SETTLE = "settle"
    """Newton's method from the state that a transient from rest has reached."""


_STATE = "the state at t = 0, a list of numbers"

State = Annotated[tuple[float, ...], AfterValidator(_state_length)]
"""A state at t = 0: positions, then velocities, then extensions, which are 0 if they are left out."""

CountOrStates = Counted | Annotated[tuple[State, ...], MinLen(1)]
"""How many states; or the states themselves."""

RestOrState = Annotated[str, BeforeValidator(one_of(["rest"], _STATE))] | State
"""Where a motion begins: from rest, or from a state."""

StartOrState = Annotated[Start, BeforeValidator(one_of(Start, _STATE))] | State
"""Where an orbit is looked for: from rest, from where a transient settles, or from a state."""

Resolution = Annotated[Counted | tuple[Counted, Counted], AfterValidator(check_resolution)]
"""Cells along each axis of a plane, or columns and rows; as columns and rows."""


def check_signal(signal: str, known: Sequence[str]) -> str:
    """Refuse an unknown signal; accept any if the signals are not known.

    Parameters
    ----------
    signal
        Name of the signal.
    known
        Names of the signals that there are; empty if they are not known.

    Returns
    -------
    str
        The name itself.

    Raises
    ------
    ValueError
        If it is unknown.
    """
    if known and signal not in known:
        raise ValueError(f"is {given(signal)}; {did_you_mean(signal, list(known))}")
    return signal


def check_parameter(parameter: str, surroundings: Surroundings) -> str:
    """Refuse a parameter that the system does not have."""
    if surroundings.system:
        try:
            surroundings.system.structure.place(parameter)
        except ModelError as error:
            raise ValueError(f"is {given(parameter)}, but {error}") from None
    return parameter


def check_value(value: float, parameter: str | None, surroundings: Surroundings) -> float:
    """Refuse a value that a parameter cannot have; ignore an unknown parameter, which is refused elsewhere."""
    system = None if surroundings.guessed else surroundings.system
    if system is None and parameter in PACES:
        system, parameter = System(["q"], [[1.0]]), "frequency"  # any has one
    if system and parameter:
        try:
            system.at({parameter: value})
        except ModelError as error:
            raise ValueError(f"is not allowed: {error}") from None
    return value


def _with_unit(value: object, handler: Callable[[object], Any], info: ValidationInfo[Surroundings]) -> Any:
    """Convert a text with a unit to a number in the unit of the parameter, if it has one."""
    parameter, system = info.data.get("parameter"), info.context.system
    if parameter is None and has_unit(value):
        return math.nan  # its unit is unknown while the parameter is wrong itself
    if not isinstance(parameter, str) or value is None or isinstance(value, bool | list | Mapping):
        return handler(value)
    if system is None:  # the file is wrong elsewhere, so it is unknown if it has units
        kind = kind_of(parameter)
        return read_quantity(value, kind).number if kind and isinstance(value, str) else handler(value)
    if system.units is None or not system.units.parameter(parameter) or (value == 0 and not isinstance(value, str)):
        return handler(value)
    return handler(system.units.read(parameter, value))


WITH_UNIT = WrapValidator(_with_unit)
"""Reads texts with units where the parameter of the same table has a unit."""


class StudyPart(Part):
    """Keys that the tables of all kinds of study share; `gapwalk.studies.derived_schema` adds those of each kind."""

    name: Text | None = Field(default=None, validate_default=True)
    title: Text = ""
    set: Any = None  # other values of the system; read by `gapwalk.studies.set_values`

    @field_validator("name")
    @classmethod
    def _can_name_a_file(cls, name: str | None, info: ValidationInfo[Surroundings]) -> str | None:
        if name is None:
            if not info.context.alone:
                raise ValueError('is missing; the result is called by it, as in name = "light-load"')
            return None
        if not re.fullmatch(r"\w[\w-]*", name):
            raise ValueError(f"is {given(name)}; write letters, digits, - and _, as in light-load")
        if name in info.context.all_keys():
            raise ValueError(f"is {given(name)}, which is a key of studies; choose another name")
        if name.casefold() in (
            other.casefold() for other in info.context.taken
        ):  # on some disks they would be one file
            raise ValueError(f"is {given(name)}, which is taken already; choose another name")
        return name

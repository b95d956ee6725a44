"""The table ``[study]`` of a model file: what the schemas of all kinds of study have in common."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Annotated, Any

from pydantic import (
    AfterValidator,
    BeforeValidator,
    Field,
    ValidationInfo,
    WrapValidator,
    field_validator,
    model_validator,
)

from gapwalk.continuation.walk_options import WalkOptions
from gapwalk.errors import ModelError
from gapwalk.model.model_fields import Count, Number, Positive, Text, one_of
from gapwalk.model.problems import did_you_mean, given
from gapwalk.model.schema import Part, by_shape, tagged
from gapwalk.model.system import System
from gapwalk.model.units import PACES, has_unit, kind_of, read_quantity
from gapwalk.orbit.harmonic_balance.balance import Balance
from gapwalk.orbit.measures import MEASURES
from gapwalk.orbit.method import Method
from gapwalk.orbit.orbit_equation import MAX_PERIOD
from gapwalk.orbit.shooting import Shooting
from gapwalk.studies.method_table import BalancePart, ShootingPart, method_name
from gapwalk.studies.options import Start, StudyOptions


@dataclass(frozen=True)
class Surroundings:
    """What the validators of a study may look at.

    Parameters
    ----------
    system
        The system; if the file is wrong elsewhere, one with the same parameters; None if even those are unknown.
    frequency_given
        Whether the file gives the frequency.
    alone
        Whether there is no other study in the file.
    taken
        Names of the studies before it.
    all_keys
        Gives the keys of all kinds of study: none of them can name one.
    guessed
        Whether the numbers of the system mean nothing: then values of parameters are not looked at.
    """

    system: System | None
    frequency_given: bool
    alone: bool = True
    taken: tuple[str, ...] = ()
    all_keys: Callable[[], frozenset[str]] = frozenset
    guessed: bool = False


class WalkPart(Part):
    """Numerical options of the walk: ``[study.walk]``."""

    initial_step: Positive | None = None
    smallest_step: Positive | None = None
    largest_step: Positive | None = None
    largest_turn: Positive | None = None
    iterations: Count | None = None
    max_points: Count | None = None

    @model_validator(mode="after")
    def _makes_options(self) -> WalkPart:
        self.options()
        return self

    def options(self) -> WalkOptions:
        """The options; what the table does not give has the default of `WalkOptions`."""
        return WalkOptions(**self.model_dump(exclude_unset=True))


def _state_length(start: list[float], info: ValidationInfo[Surroundings]) -> list[float]:
    system = info.context.system
    if system and len(start) != 2 * system.size:
        raise ValueError(
            f"is a list of {len(start)} numbers; it must have {2 * system.size}: the positions at t = 0, "
            "then the velocities"
        )
    return start


def _start_shape(value: object) -> str:
    return "state" if isinstance(value, list) else "word"


_StartName = Annotated[Start, BeforeValidator(one_of(Start, "the state at t = 0, a list of numbers"))]


class Rest(StrEnum):
    """The one start that has a name where no orbit is looked for."""

    REST = "rest"


_RestName = Annotated[Rest, BeforeValidator(one_of(Rest, "the state at t = 0, a list of numbers"))]
_State = Annotated[list[Number], AfterValidator(_state_length)]
State = _State
"""A state at t = 0: positions, then velocities."""

RestOrState = Annotated[
    Annotated[_RestName, tagged("word")] | Annotated[_State, tagged("state")], by_shape(_start_shape)
]
"""Where a motion begins: from rest, or from a state."""

StartOrState = Annotated[
    Annotated[_StartName, tagged("word")] | Annotated[_State, tagged("state")], by_shape(_start_shape)
]
"""Where an orbit is looked for: from rest, from where a transient settles, or from a state."""


def plain_start(start: str | list[float]) -> str | tuple[float, ...]:
    """A start as options have it."""
    return str(start) if isinstance(start, str) else tuple(start)


def check_signal(signal: str, known: Sequence[str]) -> str:
    """Refuse a signal that is none of those that are known; nothing is said if none is known."""
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
    """Refuse a value that a parameter cannot have; nothing is said of a parameter that is wrong itself."""
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
    """Read a text with a unit where the parameter has one; the number is in the unit of that parameter."""
    parameter, system = info.data.get("parameter"), info.context.system
    if parameter is None and has_unit(value):
        return math.nan  # nobody knows its unit while the parameter is wrong itself
    kind = kind_of(parameter) if isinstance(parameter, str) else None
    if value is None or kind is None or isinstance(value, bool | list | Mapping):
        return handler(value)
    if system is None:  # the file is wrong elsewhere, so nobody knows whether it has units
        return read_quantity(value, kind).number if isinstance(value, str) else handler(value)
    if system.units is None or (value == 0 and not isinstance(value, str)):
        return handler(value)
    return handler(system.units.read(str(parameter), value))


Value = Annotated[Number, WrapValidator(_with_unit)]
"""A value of the parameter that is named beside it: a number, or a text with a unit where the system has units."""


class StudyPart(Part):
    """What the schemas of all kinds of study have in common.

    A new kind is a subclass with a literal `kind` of its own, its place in `gapwalk.studies.kinds`, and a dataclass of
    options.
    """

    name: Text | None = Field(default=None, validate_default=True)
    title: Text = ""
    set: Any = None  # other values of the system; read by `gapwalk.studies.changes`

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

    @property
    def unused(self) -> tuple[str, ...]:
        """Names of tables that stand in it and change nothing."""
        return ()

    def system(self, system: System) -> System:
        """The system at the beginning of the study."""
        return system

    def options(self, system: System) -> StudyOptions:
        """The options of the study of this system."""
        raise NotImplementedError


class RangePart(StudyPart):
    """What the schemas of the studies over one parameter have in common: its name, and its range."""

    parameter: Text = Field(description='write what is walked, as in parameter = "frequency"')
    begin: Value | None = Field(default=None, alias="from", validate_default=True)
    end: Value = Field(alias="to", description="write the value at which the walk ends")

    @field_validator("parameter")
    @classmethod
    def _exists(cls, parameter: str, info: ValidationInfo[Surroundings]) -> str:
        return check_parameter(parameter, info.context)

    @field_validator("begin", "end")
    @classmethod
    def _is_allowed(cls, value: float | None, info: ValidationInfo[Surroundings]) -> float | None:
        parameter, surroundings = info.data.get("parameter"), info.context
        if value is None:
            if parameter in PACES and not surroundings.frequency_given:
                raise ValueError("is missing; the file gives no frequency to start at either")
            return None
        return check_value(value, parameter, surroundings)

    @field_validator("end")
    @classmethod
    def _differs_from_the_beginning(cls, end: float, info: ValidationInfo[Surroundings]) -> float:
        begin, parameter, system = info.data.get("begin"), info.data.get("parameter"), info.context.system
        if begin is None and "begin" in info.data and parameter and system and not info.context.guessed:
            begin = system[parameter]
        if begin == end:
            raise ValueError(f"is {end:g}, where the walk begins; give it somewhere to go")
        return end

    def system(self, system: System) -> System:
        """The system at the first value of the parameter."""
        return system if self.begin is None else system.at({self.parameter: self.begin})


class BranchPart(RangePart):
    """What the schemas of the studies of branches have in common: a first orbit, and how it is walked."""

    period: Annotated[Count, Field(le=MAX_PERIOD)] = 1
    start: StartOrState = Start.SETTLE
    measure: Text = ""
    walk: WalkPart = Field(default_factory=WalkPart)
    method: Annotated[str, BeforeValidator(method_name)] | None = None
    shooting: ShootingPart = Field(default_factory=ShootingPart)  # both may stand, so that one word changes the method
    balance: BalancePart = Field(default_factory=BalancePart, validate_default=True)
    verify: bool = False

    @field_validator("measure")
    @classmethod
    def _can_be_measured(cls, measure: str, info: ValidationInfo[Surroundings]) -> str:
        kind, _, coordinate = measure.partition(".")
        system = info.context.system
        if kind not in MEASURES or not coordinate:
            raise ValueError(
                f"is {given(measure)}; it must be one of {', '.join(MEASURES)}, a dot and a coordinate, as in half.q1"
            )
        if system and coordinate not in system.coordinates:
            hint = did_you_mean(coordinate, system.coordinates)
            raise ValueError(f"is {given(measure)}, but {coordinate} is no coordinate; {hint}")
        return measure

    @field_validator("method")
    @classmethod
    def _has_contacts(cls, method: str | None, info: ValidationInfo[Surroundings]) -> str | None:
        system, needs = info.context.system, Method.named(method).needs_contacts if method else ""
        if needs and system and not system.structure.contacts:
            raise ValueError(
                f"is {given(method)}, which {needs}, and there is no contact; write {given(Shooting.name)}"
            )
        return method

    @field_validator("balance", mode="before")
    @classmethod
    def _is_meant(cls, balance: object, info: ValidationInfo[Surroundings]) -> object:
        if isinstance(balance, Mapping) and info.data.get("method", "") is None:
            raise ValueError(
                f"is for harmonic balance, but no method is named, which means {given(Shooting.name)}; "
                f"write method = {given(Balance.name)} in the study, or leave the table out"
            )
        return balance

    @field_validator("balance")
    @classmethod
    def _suits_the_excitation(cls, balance: BalancePart, info: ValidationInfo[Surroundings]) -> BalancePart:
        if info.context.system and info.data.get("method") == Balance.name:
            balance.options().pose(info.context.system)
        return balance

    @property
    def unused(self) -> tuple[str, ...]:
        """The tables of other methods, if there are any."""
        return tuple(
            f"study.{name}"
            for name in ("shooting", "balance")
            if name in self.model_fields_set and getattr(self, name).method.name != (self.method or Shooting.name)
        )

    def _options(self) -> Method:
        """The method with its options: the defaults, where no table is for it."""
        method = Method.named(self.method or Shooting.name)
        return next((part.options() for part in (self.shooting, self.balance) if part.method is method), method())

    def given(self, system: System) -> dict[str, Any]:
        """The options that all kinds have, by name; keys that are not given have the defaults of `StudyOptions`."""
        found: dict[str, Any] = {
            "parameter": self.parameter,
            "begin": self.system(system)[self.parameter],
            "end": self.end,
            "measure": self.measure or f"half.{system.coordinates[0]}",
            "walk": self.walk.options(),
            "verify": self.verify,
            "method": self._options(),
        }
        if "period" in self.model_fields_set:
            found["period"] = self.period
        if "start" in self.model_fields_set:
            found["start"] = tuple(self.start) if isinstance(self.start, list) else self.start
        return found

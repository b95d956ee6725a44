"""The tables of loads in a model file: ``[[harmonic]]`` and those of other kinds, in systems and in drive trains."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import fields as dataclass_fields
from functools import lru_cache
from typing import Annotated, Any, ClassVar, Self, get_type_hints

from pydantic import (
    Field,
    ModelWrapValidatorHandler,
    PlainValidator,
    PrivateAttr,
    ValidationInfo,
    WrapValidator,
    create_model,
    field_validator,
    model_validator,
)

from gapwalk.errors import ModelError
from gapwalk.model.laws.grammar import FormulaError
from gapwalk.model.loads import LOADS, Load
from gapwalk.model.loads.over_speed import OverSpeed, over_speed_data, read_factor
from gapwalk.model.measured.measured_table import NamedFile
from gapwalk.model.parameter import Parameter
from gapwalk.model.problems import given
from gapwalk.model.schema import (
    MAX_COORDINATES,
    Direction,
    Name,
    Names,
    Number,
    Order,
    Part,
    Positive,
    Text,
    by_shape,
    claim,
    measured,
    number_of,
    tagged,
)
from gapwalk.model.units import QuantityKind, has_unit


class LoadBase(Part):
    """A load that repeats with the excitation, as ``[[harmonic]]``; see `load_fields`."""

    kind: ClassVar[type[Load]]
    _units: bool = PrivateAttr(default=False)
    _made: Any = PrivateAttr(default=None)

    order: Order = 1
    name: Name | None = Field(default=None, validate_default=True)

    @model_validator(mode="wrap")
    @classmethod
    def _has_a_name(cls, table: Any, handler: ModelWrapValidatorHandler[Self], info: ValidationInfo[Any]) -> Self:
        """Name a variation for what it varies, if the name of its order is taken."""
        if not cls.kind.is_periodic and isinstance(table, Mapping) and "order" in table:
            raise ValueError(f"has an order, but it is {cls.kind.words}; leave order out")
        if isinstance(table, Mapping) and "name" not in table:
            name = default_name(cls.kind.key, table, info.context.taken)
            if name != f"{cls.kind.key}{table.get('order', 1)}":
                table = {**table, "name": name}
        return handler(table)

    @field_validator("name")
    @classmethod
    def _is_free(cls, name: str | None, info: ValidationInfo[Names]) -> str | None:
        if name is not None:
            claim(name, info)
        elif "order" in info.data:
            name = f"{cls.kind.key}{info.data['order']}"
            if name in info.context.taken:
                raise ValueError(f"is missing, and the default {given(name)} is taken already; write another")
            info.context.taken.add(name)
        return name

    @model_validator(mode="after")
    def _makes_a_load(self, info: ValidationInfo[Names]) -> LoadBase:
        self._units = info.context.units
        if not getattr(self, "acts_on", True) and not getattr(self, "varies", None):
            raise ModelError(
                "acts_on is missing; write on what it acts, as in { q1 = 1.0 }, or what it varies instead: "
                'varies = "mesh.stiffness"'
            )
        try:
            self._made = self.load()
        except ModelError as error:
            raise ValueError(f"is refused: {error}") from None
        return self

    @property
    def made(self) -> Any:
        """The load of the table, which was made when it was checked."""
        return self._made

    def load(self, **changes: Any) -> Any:
        """Make the load, with other values of some keys."""
        counted = ("mesh", "turns_of")  # of loads of drive trains
        numbers = {name: value for name, value in dict(self).items() if value is not None and name not in counted}
        numbers |= changes
        if not self.kind.is_periodic:
            del numbers["order"]
        return self.kind.from_table({**numbers, "name": numbers.get("name", "")}, units=self._units)


def default_name(key: str, table: Mapping[str, Any], taken: Collection[str]) -> str:
    """Return the name of a load without one: ``harmonic2``, or ``mesh_stiffness_harmonic2`` if that is taken."""
    order, varied = table.get("order", 1), table.get("varies")
    if not LOADS[key].is_periodic:
        return key
    name = f"{key}{order}" if isinstance(order, int) else f"{key}{order}".replace(".", "_")
    if name in taken and isinstance(varied, str):
        return f"{varied.replace('.', '_')}_{name}"
    return name


_Varied = Annotated[
    Annotated[Text, tagged("name")]
    | Annotated[list[Text], Field(min_length=1, max_length=MAX_COORDINATES), tagged("names")]
    | Annotated[dict[Text, Number], Field(min_length=1), tagged("factors")],
    by_shape(lambda value: "factors" if isinstance(value, Mapping) else "names" if isinstance(value, list) else "name"),
]
_FILE = 'write the name of a CSV file, as in file = "gas.csv"'


def _is_file(value: object) -> NamedFile:
    """Refuse what is not the name of a file; the file has been read before."""
    if not isinstance(value, NamedFile):
        raise ValueError(f"is {given(value)}; {_FILE}")
    return value


def _over_speed(value: object, info: ValidationInfo[Names]) -> OverSpeed:
    """Read a factor over the speed: a formula, or a table in a file."""
    try:
        if isinstance(value, NamedFile):
            return read_factor(value, units=info.context.units)
        if isinstance(value, str):
            return over_speed_data(value)
    except FormulaError as error:
        raise ValueError(f"is {given(value)}, column {error.column}: {error.reason}") from None
    except ModelError as error:
        raise ValueError(str(error).removeprefix("over_speed ")) from None
    raise ValueError(f'is {given(value)}; write a formula such as "1 + 0.1*W", or the name of a file such as "gas.csv"')


_PLAIN = {
    int: Annotated[int, Field(strict=True)],
    float: Number,
    str: Text,
    OverSpeed: Annotated[Any, PlainValidator(_over_speed)],
    NamedFile: Annotated[Any, PlainValidator(_is_file)],
}
"""Types of further keys of loads in model files."""


def _size_of(parameter: Parameter) -> Any:
    """Make the type of a parameter's value in a table: a fraction or an angle where the load varies something."""
    measures = {kind: measured(kind).func for kind in (QuantityKind.ANGLE, QuantityKind.TORQUE)}

    def check(value: object, handler: Callable[[object], Any], info: ValidationInfo[Names]) -> Any:
        kind = kind_of_size(info.data.get("varies"))
        if kind is not None:
            return measures[kind](value, handler, info)  # pyright: ignore
        if has_unit(value):
            raise ValueError(f"is {given(value)}; it is a fraction of what varies, so write it without a unit")
        return handler(value)

    number = Number if parameter.least is None else Annotated[Number, Field(ge=parameter.least)]
    return Annotated[number, WrapValidator(check)]


def kind_of_size(varied: object) -> QuantityKind | None:
    """Return the kind of the amplitude of a load by what it varies: a torque, an angle, or None for a fraction."""
    if not varied:
        return QuantityKind.TORQUE
    names = [varied] if isinstance(varied, str) else list(varied) if isinstance(varied, Mapping | list) else []
    displaced = any(str(name).rpartition(".")[2] in DISPLACED for name in names)
    return QuantityKind.ANGLE if displaced else None


DISPLACED = ("deflection", "clearance", "angle")
"""Last words of what varies by a displacement, and not by a fraction."""


@lru_cache
def _load_part(kind: type[Load], base: type[LoadBase]) -> type[LoadBase]:
    fields, named = {}, {each.name: each for each in dataclass_fields(kind)}
    varied: Any = _Varied
    direction: Any = Direction
    if "varies" in named:
        fields["varies"] = (varied | None, None)
        if not kind.has_levels:
            fields["acts_on"] = (direction | None, None)
    for each in kind.parameters:
        number = _size_of(each) if each.name == "amplitude" and "varies" in named else number_of(each)
        fields[each.name] = (number, Field(description=each.words) if each.default is None else each.default)
    hints, own = get_type_hints(kind), [name for name in named if name not in {*fields, "acts_on", "order", "name"}]
    keys = kind.table_keys or {name: (hints[name], named[name].default) for name in own}
    for name, (type_, default) in keys.items():
        number = _PLAIN.get(type_, type_)
        if name in kind.frequencies:
            number = Annotated[Positive, measured(QuantityKind.FREQUENCY)]
        fields[name] = (number, Field(description=_FILE) if default is ... else default)
    if "varies" not in named:
        fields["acts_on"] = (Direction, Field(description="write on which coordinates it acts, as in { q1 = 1.0 }"))
    part = create_model(f"{kind.__name__}Part", __base__=base, **fields)
    part.kind = kind
    return part


def load_fields(base: type[LoadBase] = LoadBase) -> dict[str, Any]:
    """Make the fields of the tables of all registered loads, one list for each kind."""
    lists: dict[str, Any] = {key: list[_load_part(kind, base)] for key, kind in LOADS.items()}  # pyright: ignore
    return {key: (each, Field(default=[], max_length=MAX_COORDINATES)) for key, each in lists.items()}


def loads_of(part: Part) -> list[Any]:
    """Make the loads of a model file."""
    return [each.made for key in LOADS for each in getattr(part, key, ())]

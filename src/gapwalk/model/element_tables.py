"""Tables of elements in a model file: forces by formulas, friction, loads, and measured curves."""

from __future__ import annotations

import math
import os
import re
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from dataclasses import fields as dataclass_fields
from functools import lru_cache
from typing import Annotated, Any, ClassVar, Self, get_type_hints

import numpy as np
from numpy.typing import NDArray
from pydantic import (
    AfterValidator,
    ConfigDict,
    Field,
    ModelWrapValidatorHandler,
    PlainValidator,
    ValidationError,
    ValidationInfo,
    ValidatorFunctionWrapHandler,
    WrapValidator,
    create_model,
    field_validator,
    model_validator,
)

from gapwalk.errors import ModelError
from gapwalk.model.channels.channel_file import NamedFile
from gapwalk.model.contact import Contact, Side, Stage, friction
from gapwalk.model.contact import force as make_force
from gapwalk.model.drivetrain.train_orders import Counted
from gapwalk.model.laws import FRICTION, Expression
from gapwalk.model.laws.formula import FormulaError, formula_of
from gapwalk.model.loads import LOADS, Load
from gapwalk.model.loads.load import OverSpeed, over_speed_data, read_factor
from gapwalk.model.measured.measured_table import WantedColumn, read_table
from gapwalk.model.measured.spring_curve import ERROR, Corner, Curve, spring_curve
from gapwalk.model.model_source import Source
from gapwalk.model.problems import Problem, did_you_mean, given
from gapwalk.model.registry import Parameter
from gapwalk.model.schema import (
    MAX_COORDINATES,
    Count,
    Direction,
    Name,
    Names,
    NonNegative,
    Number,
    Order,
    OwnName,
    Part,
    Positive,
    Text,
    Vector,
    by_shape,
    claim,
    measured,
    number_of,
    tagged,
    with_placeholders,
)
from gapwalk.model.states import STATE_KINDS, State, StateKind
from gapwalk.model.units import QuantityKind, Unit, has_unit


class Element(Part):
    """A table of a contact or a load. If it is invalid, one of the same names is made, by which studies are checked."""

    @model_validator(mode="wrap")
    @classmethod
    def _has_its_names(cls, table: Any, handler: ModelWrapValidatorHandler[Self], info: ValidationInfo[Any]) -> Self:
        names, taken = info.context, {*info.context.taken}
        try:
            found = handler(table)
        except ValidationError as error:
            if names.what == "coordinate" and isinstance(table, Mapping):
                names.taken, taken = taken, names.taken
                with suppress(ValidationError, ValueError):
                    handler(with_placeholders(table, error, names)).enter(names)
                names.taken |= taken
            raise
        found.enter(names)
        return found

    def enter(self, names: Names) -> None:
        """Make the element, and enter it; raise a ValueError if it is refused as a whole."""


@contextmanager
def refusing(prefix: str) -> Iterator[None]:
    """Turn what a part is refused for into an error of its table, without the name with which it begins."""
    try:
        yield
    except ModelError as error:
        raise ValueError(f"is refused: {str(error).removeprefix(prefix)}") from None


class ForcePart(Element):
    """A force by a formula: ``[[force]]``. All keys that the schema does not know are parameters of the formula."""

    model_config = ConfigDict(extra="allow", frozen=True)

    name: OwnName = Field(description="its parameters begin with it, as in spring.k")
    law: Text = Field(description='write its formula, as in "k*x + c*v": x is its deflection, v the rate of it')
    deflection: Direction | None = None
    deflections: Annotated[dict[Name, Direction], Field(min_length=1, max_length=MAX_COORDINATES)] | None = None
    acts_on: Direction | None = None

    def enter(self, names: Names) -> None:
        """See `Element.enter`."""
        try:
            names.elements.setdefault("force", []).append(self.force([*(names.coordinates or []), *names.states]))
        except FormulaError as error:
            raise ValueError(f"law is {given(self.law)}, column {error.column}: {error.reason}") from None
        except ModelError as error:
            raise ValueError(f"is refused: {str(error).removeprefix(f'contact {self.name!r}: ')}") from None

    def force(self, coordinates: Sequence[str]) -> Contact:
        """Make the force. A formula without a deflection is one of the coordinates that it names."""
        moves: Any = self.deflections or self.deflection
        if self.deflections and self.deflection:
            raise ModelError("deflection is given together with deflections; leave one of the two out")
        if moves is None:
            names = [*coordinates, *(f"{name}'" for name in coordinates)]
            used = formula_of(self.law, [*names, "v"] if coordinates == ["x"] else names).variables
            found = {"x" if name == "v" and "v" not in coordinates else name.removesuffix("'") for name in used}
            if not found:
                raise ModelError(
                    f"the formula {given(self.law)} names none of the coordinates {', '.join(coordinates)}; write "
                    "deflection = { q1 = 1.0 }, which the formula calls x"
                )
            moves = {name: {name: 1.0} for name in coordinates if name in found}
        numbers, keys = self.model_extra or {}, {*type(self).model_fields}
        made = make_force(self.name, moves, self.law, acts_on=self.acts_on, numbers=self._numbers(numbers, moves))
        for each in made.law.parameters:
            if each.name in keys:
                raise ModelError(f"the formula has a parameter {each.name!r}, which is a key of the table; rename it")
        return made

    def _numbers(self, numbers: Mapping[str, Any], moves: Mapping[str, Any]) -> dict[str, float]:
        """Return the parameters of the formula; refuse what is none, or no number."""
        several = all(isinstance(each, Mapping) for each in moves.values())
        known = [each.name for each in Expression(self.law, tuple(moves) if several else ("x",)).parameters]
        for name, value in numbers.items():
            if name not in known:
                hint = did_you_mean(name, [*known, *type(self).model_fields], "its parameters are")
                raise ModelError(f"{name} is no parameter of the formula {given(self.law)}; {hint}")
            if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
                raise ModelError(f"{name} is {given(value)}; it must be a finite number")
        for name in known:
            if name == "W":  # the frequency
                continue
            if name not in numbers:
                raise ModelError(f"{name} is missing; the formula {given(self.law)} needs it: write {name} = 1.0")
        return dict(numbers)


# The tables of states without inertia in a model file, ``[[state]]`` and those of kinds with formulas of their own.


class StateBase(Element):
    """A state without inertia: the keys that all of its tables have."""

    name: OwnName = Field(description="formulas call the state by it, and its parameters begin with it")

    def enter(self, names: Names) -> None:
        """See `Element.enter`."""
        with refusing(f"state {self.name!r}: "):
            made = self.state()
            names.taken |= {each.name for each in made.contacts([*(names.coordinates or []), *names.states])}
        names.elements.setdefault("state", []).append(made)

    def state(self) -> State:
        """Make the state."""
        raise NotImplementedError


class StatePart(StateBase):
    """A state by formulas: ``[[state]]``. All keys that the schema does not know are parameters of the formulas."""

    model_config = ConfigDict(extra="allow", frozen=True)

    rate: Text = Field(description='write the formula of its rate, as in "(x - z)*k/c": z is the state itself')
    force: Text = ""
    deflection: Direction | None = None
    deflections: Annotated[dict[Name, Direction], Field(min_length=1, max_length=MAX_COORDINATES)] | None = None
    acts_on: Direction | None = None

    def state(self) -> State:
        """Make the state."""
        if self.deflections and self.deflection:
            raise ModelError("deflection is given together with deflections; leave one of the two out")
        moves: Any = self.deflections or self.deflection
        numbers: Any = self.model_extra or {}
        return State(self.name, self.rate, moves, force=self.force, acts_on=self.acts_on, numbers=numbers)


class KindOfStateBase(StateBase):
    """A state of a kind that has formulas of its own."""

    state_kind: ClassVar[StateKind]

    deflection: Direction = Field(description="write by which coordinates it deflects, as in { q1 = 1.0 }")

    def state(self) -> State:
        """Make the state."""
        known = [*self.state_kind.whole, *(each.name for each in self.state_kind.parameters)]
        return State.of(
            self.state_kind.name, self.name, self.deflection, **{each: getattr(self, each) for each in known}
        )


def state_fields() -> dict[str, Any]:
    """Make the fields of the tables of states, one list for each kind."""
    parts: dict[str, Any] = {"state": StatePart}
    for kind in STATE_KINDS.values():
        fields: dict[str, Any] = {
            each.name: (number_of(each), Field(description=each.words) if each.default is None else each.default)
            for each in kind.parameters
        }
        fields |= {name: (int, default) for name, default in kind.whole.items()}
        parts[kind.name] = create_model(f"{kind.name.title()}Part", __base__=KindOfStateBase, **fields)
        parts[kind.name].state_kind = kind
    return {key: (list[part], Field(default=[], max_length=MAX_COORDINATES)) for key, part in parts.items()}


# The table of dry friction in a model file, ``[[friction]]``, in systems and in drive trains.


class FrictionBase(Element):
    """Dry friction: the keys that it has in systems and in drive trains; see `friction_part`."""

    name: OwnName = Field(description="its parameters begin with it, as in brake.limit")
    normal: Name | None = None

    @classmethod
    def hint_for(cls, key: str, value: object) -> str:
        """Return the line to write in place of a key of another name."""
        words = {
            "mu": 'the coefficient of friction is coefficient, beside normal = "stop", the contact that presses',
            "force": "the force in slip is limit",
            "torque": "the torque in slip is limit",
            "damping": "a damper beside it belongs in the matrix damping, or in a [[shaft]]",
            "hysteresis": "the force in slip is limit; a [[contact]] has hysteresis",
            "clearance": "friction that acts beyond a clearance is the hysteresis of a [[contact]]",
            "law": "friction with a stiffness is a Jenkins element, without one Coulomb's; leave law out",
        }
        return words.get(key, "")

    def enter(self, names: Names) -> None:
        """See `Element.enter`."""
        given = self.given
        if "limit" in given and "coefficient" in given:
            raise ValueError("has limit together with coefficient; leave one of the two out")
        if "coefficient" in given and self.normal is None:
            raise ValueError(
                'has a coefficient, but no normal; write which contact presses, as in normal = "stop", or write the '
                "force in slip: limit = 0.3"
            )
        if "coefficient" not in given and self.normal is not None:
            raise ValueError("has normal, but no coefficient; write coefficient = 0.3, say")
        if not given.keys() & {"limit", "coefficient"}:
            raise ValueError(
                'has no limit; write limit = ..., the force in slip, or coefficient = 0.3 and normal = "stop", the '
                "contact that presses"
            )
        if "stiffness" in given and "static" in given:
            raise ValueError(
                "has static together with stiffness; a Jenkins element begins to slip at its limit: leave one of the "
                "two out"
            )

    @property
    def given(self) -> dict[str, Any]:
        """The numbers that the table gives."""
        found = {name: getattr(self, name) for name in FRICTION}
        return {name: value for name, value in found.items() if value is not None}


class PlainFrictionBase(FrictionBase):
    """Dry friction on a deflection of a system."""

    deflection: Direction = Field(description="write by which coordinates it slips, as in { q1 = 1.0 }")
    force: Vector | None = None
    numbers: dict[Name, Number] = Field({}, description="the parameters of the formula of limit")

    def enter(self, names: Names) -> None:
        """See `Element.enter`."""
        super().enter(names)
        if self.numbers and not isinstance(self.given.get("limit"), str):
            raise ValueError('has numbers, but limit is no formula; write limit = "1/(1 + d*abs(v))", say')
        with refusing(f"contact {self.name!r}: "):
            try:
                names.elements.setdefault("friction", []).extend(self.contacts())
            except FormulaError as error:
                text = given(self.given["limit"])
                raise ValueError(f"limit is {text}, column {error.column}: {error.reason}") from None

    def contacts(self) -> tuple[Contact, ...]:
        """Make the friction, with the formula of its limit if it has one."""
        more: Any = {"numbers": self.numbers, **self.given}
        made = friction(self.name, self.deflection, normal=self.normal or "", force=self.force, **more)
        return made if isinstance(made, tuple) else (made,)


def _or_formula(value: Any, handler: ValidatorFunctionWrapHandler) -> Any:
    is_quantity = isinstance(value, str) and re.match(r"\s*\d[\d.eE+-]*\s*[^\W\d_]", value)
    return value if isinstance(value, str) and not is_quantity else handler(value)


def friction_part(base: type[FrictionBase] = PlainFrictionBase) -> Any:
    """Return the schema of a table of dry friction, with its numbers."""
    fields: dict[str, Any] = {
        name: (Annotated[number_of(each) | None, Field(description=each.words)], None)
        for name, each in FRICTION.items()
    }
    if base is PlainFrictionBase:
        kind, default = fields["limit"]
        fields["limit"] = Annotated[kind, WrapValidator(_or_formula)], default
    return create_model(base.__name__.replace("Base", "Part"), __base__=base, **fields)


# The tables of loads in a model file: ``[[harmonic]]`` and those of other kinds, in systems and in drive trains.


class LoadBase(Element):
    """A load that repeats with the excitation, as ``[[harmonic]]``; see `load_fields`."""

    kind: ClassVar[type[Load]]

    order: Order = 1
    name: Name | None = Field(default=None, validate_default=True)

    @model_validator(mode="before")
    @classmethod
    def _has_a_name(cls, table: Any, info: ValidationInfo[Any]) -> Any:
        """Name a variation for what it varies, if the name of its order is taken."""
        if not cls.kind.is_periodic and isinstance(table, Mapping) and "order" in table:
            raise ValueError(f"has an order, but it is {cls.kind.words}; leave order out")
        if isinstance(table, Mapping) and "name" not in table:
            name = default_name(cls.kind.key, table, info.context.taken)
            if name != f"{cls.kind.key}{table.get('order', 1)}":
                table = {**table, "name": name}
        return table

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

    def enter(self, names: Names) -> None:
        """See `Element.enter`."""
        if not getattr(self, "acts_on", True) and not getattr(self, "varies", None):
            raise ModelError(
                "acts_on is missing; write on what it acts, as in { q1 = 1.0 }, or what it varies instead: "
                'varies = "mesh.stiffness"'
            )
        with refusing(""):
            names.elements.setdefault(self.kind.key, []).append(self.load(units=names.units))

    def load(self, *, units: bool, **changes: Any) -> Any:
        """Make the load, with other values of some keys."""
        counted = ("mesh", "turns_of", "pole_pairs", "slots")  # of loads of drive trains
        numbers = {name: value for name, value in dict(self).items() if value is not None and name not in counted}
        numbers |= changes
        if not self.kind.is_periodic:
            del numbers["order"]
        return self.kind.from_table({**numbers, "name": numbers.get("name", "")}, units=units)


_TrainOrder = Annotated[Positive, AfterValidator(lambda order: int(order) if float(order).is_integer() else order)]
"""A whole number, or a fraction; loads of drive trains count it."""


class TrainLoadBase(LoadBase):
    """A load of a drive train, whose order may count teeth or turns, and may be a fraction."""

    order: _TrainOrder = 1  # pyright: ignore[reportIncompatibleVariableOverride]
    mesh: Name | None = None
    turns_of: Name | None = None
    pole_pairs: Count | None = None
    slots: Count | None = None

    def load(self, *, units: bool, **changes: Any) -> Load | Counted:
        """Make the load, with the way in which its order is counted."""
        mesh, turns_of, order = self.mesh or "", self.turns_of or "", self.order
        is_whole = float(order).is_integer()
        load = super().load(units=units, order=int(order) if is_whole else 1, **changes)
        if is_whole and not (mesh or turns_of or self.pole_pairs or self.slots):
            return load
        given = order if "order" in self.model_fields_set else None
        return Counted(load, mesh, turns_of, given, self.pole_pairs, self.slots)


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
    by_shape(factors=Mapping, names=list, name=object),
]
_FILE = 'write the name of a CSV file, as in {} = "gas.csv"'


def _is_file(value: object) -> NamedFile:
    """Refuse what is not the name of a file; the file has been read before."""
    if not isinstance(value, NamedFile):
        raise ValueError(f"is {given(value)}; {_FILE.format('file')}")
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
    float | None: Annotated[Number | None, Field()],
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
        number, words = _PLAIN.get(type_, type_), _FILE.format(name)
        if name in kind.frequencies:
            number = Annotated[Positive, measured(QuantityKind.FREQUENCY)]
        elif isinstance(type_, QuantityKind):
            bound = Positive if default is ... else NonNegative
            number, words = Annotated[bound, measured(type_)], f"it is {type_.words} > 0"
        fields[name] = (number, Field(description=words) if default is ... else default)
    if "varies" not in named:
        fields["acts_on"] = (Direction, Field(description="write on which coordinates it acts, as in { q1 = 1.0 }"))
    part = create_model(f"{kind.__name__}Part", __base__=base, **fields)
    part.kind = kind
    return part


def load_fields(base: type[LoadBase] = LoadBase) -> dict[str, Any]:
    """Make the fields of the tables of all registered loads, one list for each kind."""
    lists: dict[str, Any] = {key: list[_load_part(kind, base)] for key, kind in LOADS.items()}  # pyright: ignore
    return {key: (each, Field(default=[], max_length=MAX_COORDINATES)) for key, each in lists.items()}


# Contacts whose springs follow a measured curve: each corner is a stage; and the key ``curve`` of model files.

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
        The vector along which it acts, by coordinate name; by default its deflection.

    Returns
    -------
    Contact
        The contact, with a stage for each corner.

    Raises
    ------
    ModelError
        If the file contains no curve.

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
    right = {(stage.clearance, *_numbers(stage)) for stage in outer if stage.side is Side.POSITIVE}
    for stage in sorted(outer, key=lambda stage: (stage.clearance, stage.side is Side.NEGATIVE)):
        key = (stage.clearance, *_numbers(stage))
        if stage.side is Side.POSITIVE and key in mirrored:
            found.append(replace(stage, side=Side.BOTH))
        elif stage.side is Side.POSITIVE or key not in right:
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

"""The tables of model files: contacts with their stages and laws, loads, damping, and the system as a whole."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import lru_cache, wraps
from typing import Annotated, Any, TypeVar

from pydantic import (
    AfterValidator,
    BeforeValidator,
    Field,
    ValidationError,
    ValidationInfo,
    WrapValidator,
    create_model,
    field_validator,
    model_validator,
)

from gapwalk.errors import ModelError
from gapwalk.model.contact import (
    OF_FRICTION,
    RIGID,
    SPRING_OF_FRICTION,
    Contact,
    ContactParts,
    Side,
    Stage,
    order_problems,
)
from gapwalk.model.element_tables import Element, ForcePart, friction_part, load_fields, state_fields
from gapwalk.model.laws import HYSTERESIS, LAWS, STIFFNESS, Law, Rigid, law_of, law_parameters, law_with
from gapwalk.model.loads import LOADS
from gapwalk.model.problems import given
from gapwalk.model.registry import Parameter
from gapwalk.model.schema import (
    MAX_COORDINATES,
    Centre,
    Direction,
    Matrix,
    Name,
    Names,
    NonNegative,
    Number,
    OwnName,
    Part,
    Positive,
    RegularMatrix,
    Text,
    Vector,
    by_shape,
    number_of,
    one_of,
    tagged,
    without_repeats,
)
from gapwalk.model.system import Damping, ModalDamping, ProportionalDamping, System
from gapwalk.model.units import QuantityKind

MAX_STUDIES = 200
"""Largest number of studies in one file: all of them are checked to read one."""

T = TypeVar("T")
SideName = Annotated[Side, BeforeValidator(one_of(Side))]


class StageBase(Part):
    """One spring of a contact: ``[[contact.stage]]``, with the parameters of its force law; see `stages_field`."""

    name: Name | None = None

    @classmethod
    def hint_for(cls, key: str, value: object) -> str:
        """Return the line to write in place of a key of the contact as a whole."""
        if key == SPRING_OF_FRICTION:
            return "the friction of all stages has one spring; write it above the tables of the stages"
        return _hysteresis_for(key)


def _hysteresis_for(key: str) -> str:
    """Return the line to write in place of friction in the table of springs; empty for any other key."""
    return "write hysteresis = ..., the limit of friction beside these springs" if key == "friction" else ""


def stage_of(part: Part, name: str) -> Stage:
    """Make a stage from its own table, or from the table of its contact."""
    found = given_of(part, "stage_parameters")
    of_stage = {key: getattr(part, key, None) for key in ("restitution", HYSTERESIS.name)}
    if not isinstance(part, StageBase):
        of_stage.pop("restitution")  # it is a number of the contact as a whole
        if "stiffness" not in found and getattr(part, "restitution", None) is not None:
            found["stiffness"] = RIGID
    found |= {key: value for key, value in of_stage.items() if value is not None}
    plain = {key: found.pop(key) for key in ("clearance", "stiffness", "cubic") if key in found}
    side, centre = getattr(part, "side", None) or Side.BOTH, getattr(part, "centre", None) or 0.0
    return Stage(**{"clearance": 0.0, **plain}, side=side, name=name, numbers=found, centre=centre)


def given_of(part: Part, which: str) -> dict[str, Any]:
    """Return the values of those parameters that a table gives."""
    values = {name: getattr(part, name, None) for name in law_parameters(which)}
    return {name: value for name, value in values.items() if value is not None}


def law_fields(which: str) -> dict[str, Any]:
    """Make the fields of the parameters in a table, all of them optional."""
    found: dict[str, Any] = {}
    for name, each in law_parameters(which).items():
        found[name] = (Annotated[_field_of(each) | None, Field(validate_default=True, description=each.words)], None)
    return found


def _field_of(parameter: Parameter) -> Any:
    return Annotated[number_of(parameter), or_rigid()] if parameter == STIFFNESS else number_of(parameter)


def or_rigid() -> WrapValidator:
    """Make a validator that accepts the word for a rigid stop in place of a stiffness."""

    def check(value: object, handler: Callable[[object], Any]) -> Any:
        if isinstance(value, str) and value.isalpha() and value != RIGID:
            raise ValueError(
                f'is {given(value)}; it must be a stiffness, or "rigid" for a rigid stop with a restitution'
            )
        if value == math.inf:
            raise ValueError('is inf; write stiffness = "rigid" with a restitution for a rigid stop')
        return value if value == RIGID else handler(value)

    return WrapValidator(check)


def friction_fields() -> dict[str, Any]:
    """Make the fields of the friction beside the springs of a contact."""
    numbers = HYSTERESIS, Parameter(SPRING_OF_FRICTION, QuantityKind.STIFFNESS, "it is the spring that sticks")
    return {each.name: (Annotated[number_of(each) | None, Field(description=each.words)], None) for each in numbers}


def belongs_to_the_law(cls: type[Part], value: object, info: ValidationInfo[Names]) -> object:
    """Refuse a parameter of a stage that the force law of the contact lacks, and ask for one that it needs."""
    law, name = info.context.law, info.field_name
    if RIGID in (info.data.get("stiffness"), value):
        if value not in (None, RIGID) and name != "clearance":
            raise ValueError(f"is {given(value)}, but the stage is rigid; leave it out")
        return value
    parameter = next((each for each in law.stage_parameters if each.name == name), None)
    if name == "stiffness" and isinstance(law, Rigid) and value is not None:
        raise ValueError(
            f'is {given(value)}, but by its restitution or its law the contact is rigid; write stiffness = "rigid", or '
            "leave those out: a spring loses energy by impact_damping"
        )
    if parameter is None and value is not None:
        raise ValueError(f"is {given(value)}, but the law {given(law.name)} has no such parameter")
    if parameter is not None and value is None and parameter.default is None:
        raise ValueError(f"is missing; {parameter.words}")
    return value


def by_registered_kinds(make: Callable[[], T]) -> Callable[[], T]:
    """Decorate a function that makes a schema from all registered force laws and loads: it is made once for them."""
    made = lru_cache(lambda *_: make())
    return wraps(make)(lambda: made(*LAWS.values(), *LOADS.values()))


def _in_order(tables: object, handler: Callable[[object], Any]) -> Any:
    """Check the order of the stages even if some of them have problems, so that all problems are reported at once."""
    problem = _order_problem(tables)
    if problem is None:
        return handler(tables)
    try:
        handler(tables)
    except ValidationError as error:
        details: Any = [
            *error.errors(),
            {"type": "value_error", "input": tables, "ctx": {"error": ValueError(problem)}},
        ]
        raise ValidationError.from_exception_data(error.title, details) from None
    raise ValueError(problem)


def _order_problem(tables: object) -> str | None:
    """Describe the first error in the order of those stages whose clearance is a plain number."""
    stages = [table for table in tables if isinstance(table, Mapping)] if isinstance(tables, list) else []
    known = [(table.get("side", Side.BOTH), table.get("clearance")) for table in stages if "centre" not in table]
    numbers = [
        (Side(side), clearance)
        for side, clearance in known
        if side in [*Side] and isinstance(clearance, int | float) and not isinstance(clearance, bool)
    ]
    return next((f"is {each}" for each in order_problems(numbers)), None)


def stages_field(least: int) -> Any:
    """Make the field of a contact's stages, from the inside out, with the parameters of all registered force laws."""
    size: Any = Field(min_length=least, max_length=MAX_COORDINATES)
    return Annotated[list[_stage_part()], size, WrapValidator(_in_order)]  # pyright: ignore


@by_registered_kinds
def _stage_part() -> type[StageBase]:
    fields = law_fields("stage_parameters")
    check: Any = {"belongs_to_the_law": field_validator(*fields)(classmethod(belongs_to_the_law))}
    check["suits_the_stiffness"] = field_validator("restitution", HYSTERESIS.name)(classmethod(_suits_the_stiffness))
    fields |= {"side": (SideName, Side.BOTH), "centre": (Centre, 0.0)}
    fields[HYSTERESIS.name] = friction_fields()[HYSTERESIS.name]
    bounce: Any = Annotated[Number, Field(ge=0.0, le=1.0)]
    fields["restitution"] = (bounce | None, Field(None, validate_default=True))
    return create_model("StagePart", __base__=StageBase, __validators__=check, **fields)


def _suits_the_stiffness(cls: type[Part], value: float | None, info: ValidationInfo[Names]) -> float | None:
    """Refuse a restitution of springs, and hysteresis of a rigid stop; ask for a restitution."""
    bounces, rigid = info.field_name == "restitution", info.data.get("stiffness") == RIGID
    if bounces and value is not None and not rigid and not isinstance(info.context.law, Rigid):
        raise ValueError(f'is {given(value)}, but the stage is a spring; write stiffness = "rigid", or leave it out')
    if not bounces and value is not None and (rigid or isinstance(info.context.law, Rigid)):
        raise ValueError(f"is {given(value)}, but the stage is rigid, and loses energy by restitution; leave it out")
    if bounces and value is None and rigid and not isinstance(info.context.law, Rigid):
        raise ValueError("is missing; it is the rate after an impact over the rate before, as in restitution = 0.8")
    return value


LawName = Annotated[Any, BeforeValidator(lambda name: LAWS[one_of(LAWS)(name)])]


class LawTable(Part):
    """A table with a force law: ``[[contact]]``, ``[[shaft]]`` and ``[[gear]]``."""

    law: LawName | None = None

    @classmethod
    def hint_for(cls, key: str, value: object) -> str:
        """See `Part.hint_for`."""
        return _hysteresis_for(key)

    @model_validator(mode="before")
    @classmethod
    def _knows_its_law(cls, table: Any, info: ValidationInfo[Any]) -> Any:
        """Give the tables of the stages their law."""
        info.context.law = law_of_table(table)
        return table


def law_of_table(table: Any) -> Law:
    """Return the law that a table names, or the first law with its parameters; the table may have any problems."""
    table = table if isinstance(table, Mapping) else {}
    named = table.get("law")
    if isinstance(named, str) and named in LAWS:
        return LAWS[named]
    if table.get("stiffness") == RIGID:
        return law_of("rigid")
    apart = ("restitution",) if table.get("stage") else ()  # it is that of a rigid stage then
    try:
        return law_with([name for name in law_parameters("parameters") if name in table and name not in apart])
    except ModelError:
        return law_of("elastic")


def _law_to_write(name: str) -> str:
    """Return the line to write where a table gives the name of a force law as its damping."""
    return (
        f"write law = {given(name)}"
        if name in LAWS
        else f"write law, which must be one of {', '.join(map(given, LAWS))}"
    )


def is_no_law(damping: object) -> object:
    """Refuse the name of a force law in place of the damping of a shaft or gear, and explain where it belongs."""
    if isinstance(damping, str) and re.fullmatch("[a-z-]{3,}", damping):
        names = [each.name for each in LAWS[damping].parameters] if damping in LAWS else []
        more = f" and {' and '.join(names)} = ..." if names else ""
        raise ValueError(
            f"is {given(damping)}; it must be the number of a damper that acts always. For a force law of the springs "
            f"with a clearance, {_law_to_write(damping)}{more}"
        )
    return damping


class ContactBase(LawTable, Element):
    """A contact: ``[[contact]]``, with its one stage in short form or with tables of stages; see `system_part`."""

    name: OwnName = Field(description="its parameters begin with it, as in stage2.clearance")
    deflection: Direction = Field(description="write by which coordinates it deflects, as in { q1 = 1.0 }")
    force: Vector | None = None

    @classmethod
    def hint_for(cls, key: str, value: object) -> str:
        """Return the line to write in place of ``damping``, which is a key of the system as a whole."""
        if key != "damping":
            return _hysteresis_for(key)
        if isinstance(value, str):
            return _law_to_write(value)
        names = dict.fromkeys(each.name for law in LAWS.values() if law.is_damped for each in law.parameters)
        return f"a contact has the damping of its force law; write {' or '.join(names)}"

    def enter(self, names: Names) -> None:
        """See `Element.enter`."""
        try:
            made = self.contacts()
        except ModelError as error:
            reason = str(error).removeprefix(f"contact {self.name!r}: ")
            raise ValueError(f"is refused: {reason}") from None
        for each in made:
            if each.name != self.name and each.name in names.taken:
                why = f"adds the contact {given(each.name)}, its friction or its rigid stop"
                raise ValueError(f"{why}, but that name is taken; choose another")
            names.taken.add(each.name)
        names.elements.setdefault("contact", []).append(made)

    def contacts(self) -> tuple[Contact, ...]:
        """Make the contact, and the friction and the rigid stop beside it."""
        own = given_of(self, "parameters")
        tables: list[StageBase] = getattr(self, "stage", None) or []
        if tables:
            names = [table.name or f"stage{place}" for place, table in enumerate(tables, start=1)]
            # a single stage needs no name: its parameters have that of the contact
            stages = [stage_of(part, name if len(tables) > 1 else "") for part, name in zip(tables, names, strict=True)]
        else:
            stages = [stage_of(self, "")]
        of_friction = {name: value for name in OF_FRICTION if (value := getattr(self, name)) is not None}
        if not tables:
            of_friction.pop(HYSTERESIS.name, None)  # it is that of the stage
        return ContactParts(self.name, self.deflection, stages, self.force, self.law, {**own, **of_friction}).contacts()


def _is_in_one_place(cls: type[Part], value: object, info: ValidationInfo[Names]) -> object:
    """Refuse a parameter of a stage that belongs in a table of its own, and ask for one that is needed."""
    if "stage" not in info.data:
        return value
    if info.data["stage"] is None:
        return value if info.field_name in ("side", "centre") else belongs_to_the_law(cls, value, info)
    if value is not None:
        raise ValueError("is given together with tables [[contact.stage]]; move it into one of them")
    return value


def _suits_the_law(cls: type[Part], value: float | None, info: ValidationInfo[Names]) -> float | None:
    """Refuse a parameter that the force law lacks, and ask for one that it needs."""
    name = str(info.field_name)
    others = [each for each in law_parameters("parameters") if each != name and info.data.get(each) is not None]
    own = {each.name for each in info.context.law.parameters}
    if value is not None and others and not {name, *others} <= own:
        raise ValueError(f"is given together with {others[0]}; a contact has one of the two")
    law = info.data.get("law")
    if law is None:
        return value
    optional = {each.name for each in law.parameters if each.optional}
    if name in own - optional and value is None:
        raise ValueError(f"is missing; the law {given(law.name)} needs it")
    if name not in own and value is not None:
        raise ValueError(f"is {value}, but law is {given(law.name)}; leave one of the two out")
    return value


def study_tables(study: object) -> object:
    """Refuse a study that is neither a table nor a list of tables; its content is read elsewhere."""
    tables = study if isinstance(study, list) and study else [study]
    if not all(isinstance(table, Mapping) for table in tables):
        raise ValueError(f"is {given(study)}; it must be a table [study], or several tables [[study]]")
    if len(tables) > MAX_STUDIES:
        raise ValueError(f"is a list of {len(tables):,} tables; a file may have {MAX_STUDIES} studies")
    return study


class DampingPart(Part):
    """The table of a damping: in proportion to mass and stiffness, or by the ratios of the modes."""

    mass: Number | None = None
    stiffness: Number | None = None
    ratios: (
        Annotated[
            Annotated[NonNegative, tagged("one")] | Annotated[list[NonNegative], Field(min_length=1), tagged("many")],
            by_shape(many=list, one=object),
        ]
        | None
    ) = None

    @model_validator(mode="after")
    def _says_one_thing(self) -> DampingPart:
        if self.ratios is not None and (self.mass is not None or self.stiffness is not None):
            raise ValueError("has ratios together with mass or stiffness; leave one of the two out")
        return self

    def damping(self) -> Damping:
        """Make the damping."""
        if self.ratios is not None:
            return ModalDamping(self.ratios)
        return ProportionalDamping(self.mass or 0.0, self.stiffness or 0.0)


DampingField = Annotated[
    Annotated[DampingPart, tagged("table")] | Annotated[Matrix, tagged("numbers")],
    by_shape(table=Mapping, numbers=object),
]
"""A damping in a model file: its matrix, the diagonal of it, or a table."""


class SystemBase(Part):
    """A model file; see `system_part`.

    Its tables ``[study]``, ``[measurement]`` and ``[reduction]`` are read by `gapwalk.studies`.
    """

    title: Text = ""
    coordinates: Annotated[list[Name], AfterValidator(without_repeats)] = Field(
        min_length=1,
        max_length=MAX_COORDINATES,
        description='list the names of the degrees of freedom, as in ["q1", "q3"]',
    )
    mass: RegularMatrix | None = None
    stiffness: Matrix = Field(description="write the matrix K, a list of rows")
    damping: DampingField | None = None
    gyroscopic: Matrix | None = None
    centrifugal: Matrix | None = None
    over_speed: dict[Text, Text] = Field(default={})
    mean: Vector = Field(default={})
    force: Annotated[list[ForcePart], Field(max_length=MAX_COORDINATES)] = Field(default=[])
    frequency: Positive | None = None
    study: Annotated[Any, AfterValidator(study_tables)] = None
    measurement: Any = None
    reduction: Any = None  # read by `gapwalk.studies.study_file`

    def system(self, elements: Mapping[str, list[Any]]) -> System:
        """Make the system, with what its tables have made; at the frequency 1 if the file gives none."""
        return system_of(
            elements,
            coordinates=self.coordinates,
            stiffness=self.stiffness,
            damping=self.damping.damping() if isinstance(self.damping, DampingPart) else self.damping,
            mass=self.mass,
            mean=self.mean,
            frequency=self.frequency or 1.0,
            gyroscopic=self.gyroscopic,
            centrifugal=self.centrifugal,
            over_speed=self.over_speed,
        )


def system_of(elements: Mapping[str, list[Any]], **keys: Any) -> System:
    """Make a system with the contacts and loads of tables."""
    contacts = {made[0].name: made for made in elements.get("contact", ())}
    return System(
        contacts=[
            *(each for made in contacts.values() for each in made),
            *(each for key in ("friction", "force") for each in elements.get(key, ())),
        ],
        harmonics=[_displacing(load, contacts) for load in loads_of(elements)],
        states=elements.get("state", ()),
        **keys,
    )


def loads_of(elements: Mapping[str, list[Any]]) -> list[Any]:
    """Return the loads that the tables of a file have made."""
    return [each for key in LOADS for each in elements.get(key, ())]


def _displacing(load: Any, contacts: Mapping[str, tuple[Contact, ...]]) -> Any:
    """Return a load that displaces the friction and the rigid stop beside a contact as it displaces the contact."""
    varies = dict(load.varies)
    for name, factor in load.varies.items():
        first, _, rest = name.partition(".")
        for each in contacts.get(first, ()):
            # a clearance that varies is no motion, and friction has none
            if rest == "deflection" or (rest == "clearance" and each.stages):
                varies.setdefault(f"{each.name}.{rest}", factor)
    return load if varies == load.varies else replace(load, varies=varies)


@by_registered_kinds
def system_part() -> type[SystemBase]:
    """Return the schema of a model file."""
    of_stages, own = law_fields("stage_parameters"), dict(sorted(law_fields("parameters").items()))
    side: Any = Annotated[SideName | None, Field(validate_default=True)]
    checks: Any = {
        "is_in_one_place": field_validator(*of_stages, "side", "centre")(classmethod(_is_in_one_place)),
        "suits_the_law": field_validator(*own)(classmethod(_suits_the_law)),
    }
    fields: dict[str, Any] = {"stage": (stages_field(1) | None, None), **of_stages, "side": (side, None), **own}
    fields["centre"] = (Annotated[Centre | None, Field(validate_default=True)], None)
    fields |= friction_fields()
    contact: Any = create_model("ContactPart", __base__=ContactBase, __validators__=checks, **fields)
    contacts: Any = (list[contact], Field(default=[], max_length=MAX_COORDINATES))
    friction: Any = (list[friction_part()], Field(default=[], max_length=MAX_COORDINATES))
    return create_model(
        "SystemPart", __base__=SystemBase, contact=contacts, friction=friction, **state_fields(), **load_fields()
    )

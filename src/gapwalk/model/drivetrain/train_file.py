"""Drive trains in a model file: ``[[inertia]]``, ``[[shaft]]`` and ``[[gear]]`` in place of matrices."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Annotated, Any, ClassVar

from pydantic import (
    AfterValidator,
    BeforeValidator,
    ConfigDict,
    Field,
    ValidationInfo,
    create_model,
    field_validator,
    model_validator,
)

from gapwalk.errors import ModelError
from gapwalk.model.contact import OF_FRICTION, Side, friction_name, stop_name
from gapwalk.model.drivetrain.bearing import Bearing
from gapwalk.model.drivetrain.planetary import Planetary
from gapwalk.model.drivetrain.train import PARTS, Train
from gapwalk.model.drivetrain.train_orders import LONGEST
from gapwalk.model.drivetrain.train_parts import NOT_NEGATIVE, OF_DRAGS, Drag, Force, Friction, Gear, Inertia, Shaft
from gapwalk.model.element_tables import FrictionBase, TrainLoadBase, default_name, friction_part, load_fields
from gapwalk.model.loads import LOADS
from gapwalk.model.model_source import Source
from gapwalk.model.model_tables import (
    LawTable,
    SideName,
    by_registered_kinds,
    friction_fields,
    given_of,
    is_no_law,
    law_fields,
    loads_of,
    or_rigid,
    stage_of,
    stages_field,
    study_tables,
)
from gapwalk.model.problems import Path, Problem, did_you_mean, given
from gapwalk.model.schema import (
    MAX_COORDINATES,
    Centre,
    Clearance,
    Count,
    CubicStiffness,
    InertiaName,
    Name,
    Names,
    NonNegative,
    Number,
    Part,
    Positive,
    Text,
    Torque,
    by_shape,
    measured,
    number_of,
    tagged,
)
from gapwalk.model.system import System
from gapwalk.model.units import Quantity, QuantityKind

_KEYS = ("inertia", "shaft", "gear", "planetary", "bearing")
_PACED = ("shaft", "gear", "friction")
_TOP = ("mean", "reaction", "reference", "longest", "frequency", "speed")

# The quantities of a part: all are numbers in consistent units, or all are texts such as "0.12 kg m^2".
_Inertia = Annotated[NonNegative, measured(QuantityKind.INERTIA)]
_Radius = Annotated[Positive, measured(QuantityKind.LENGTH)]
_Stiffness = Annotated[Positive, measured(QuantityKind.STIFFNESS), or_rigid()]
_Damping = Annotated[NonNegative, measured(QuantityKind.DAMPING), BeforeValidator(is_no_law)]
_Pace = Annotated[Positive, measured(QuantityKind.FREQUENCY)]


def _are_two(names: list[str]) -> list[str]:
    if names[0] == names[1]:
        raise ValueError(f"joins {given(names[0])} to itself; name two different inertias")
    return names


_Ends = Annotated[list[Name], Field(min_length=2, max_length=2), AfterValidator(_are_two)]


class PacedPart(Part):
    """A part whose numbers may depend on the speed."""

    over_speed: Text | dict[Text, Text] | None = None
    main_numbers: ClassVar[tuple[str, ...]] = ("stiffness",)
    """The numbers that one formula multiplies: those of them that are given."""

    def factors(self) -> Iterator[tuple[str, str]]:
        """Iterate over the names of the numbers that depend on the speed, with their factors."""
        given, name = self.over_speed or {}, getattr(self, "name", "")
        main = [what for what in self.main_numbers if getattr(self, what) is not None] or self.main_numbers[:1]
        for what, text in (given if isinstance(given, dict) else dict.fromkeys(main, given)).items():
            of_friction = f"{friction_name(name)}.limit" if what == "hysteresis" else f"{name}.{what}"
            yield of_friction, text


class InertiaPart(Part):
    """A body: ``[[inertia]]``; one whose motion is prescribed has no moment of inertia."""

    name: Name = Field(description="shafts, gears and torques refer to it")
    inertia: _Inertia | None = None
    radius: _Radius | None = None

    def part(self) -> Inertia:
        """Make the inertia."""
        return Inertia(self.name, self.inertia, self.radius)


class LinkBase(PacedPart, LawTable):
    """A shaft, clutch or spline, ``[[shaft]]``, and the keys that it has in common with a gear; see `train_part`."""

    name: Name = Field(description="its parameters begin with it, as in clutch.stiffness")
    between: _Ends = Field(description='name the two inertias that it joins, as in ["flywheel", "hub"]')
    stiffness: _Stiffness | None = None
    damping: _Damping = 0.0
    clearance: Clearance | None = None
    cubic: CubicStiffness = 0.0
    side: SideName = Side.BOTH
    centre: Centre = 0.0

    def part(self) -> Shaft | Gear:
        """Make the shaft or the gear."""
        plain = ("stiffness", "damping", "clearance", "cubic", "law", "side", "centre")
        springs = {name: getattr(self, name) for name in plain}
        of_friction = {name: value for name in OF_FRICTION if (value := getattr(self, name)) is not None}
        springs["numbers"] = given_of(self, "parameters") | of_friction
        springs["stages"] = tuple(stage_of(part, part.name or "") for part in getattr(self, "stage", ()))
        first, second = self.between
        if not isinstance(self, GearBase):
            return Shaft(self.name, (first, second), **springs)
        return Gear(self.name, (first, second), self.ratio, teeth=self.teeth, **springs)


class GearBase(LinkBase):
    """A gear mesh: ``[[gear]]``."""

    teeth: (
        Annotated[
            Annotated[Count, tagged("first")]
            | Annotated[list[Count], Field(min_length=2, max_length=2), tagged("both")],
            by_shape(both=list, first=object),
        ]
        | None
    ) = None
    ratio: Number | None = Field(default=None, validate_default=True)

    @field_validator("ratio")
    @classmethod
    def _is_known(cls, ratio: float | None, info: ValidationInfo[Names]) -> float | None:
        if ratio is None and not isinstance(info.data.get("teeth", []), list):  # teeth that are wrong are not there
            raise ValueError(
                "is missing; it is the speed of the first inertia divided by that of the second. Or write the numbers "
                "of teeth, as in teeth = [27, 41]"
            )
        return ratio


_Spring = Annotated[Positive, measured(QuantityKind.STIFFNESS)]
_Damper = Annotated[NonNegative, measured(QuantityKind.DAMPING)]


class PlanetaryPart(Part):
    """A planetary set or a differential: ``[[planetary]]``."""

    name: Name = Field(description="its meshes and planets begin with it, as in set_sun.stiffness")
    sun: Name | None = None
    ring: Name | None = None
    carrier: Name | None = None
    teeth: Annotated[list[Count], Field(min_length=3, max_length=3)] | None = None
    ratio: Number | None = None
    planets: Count = 3
    planet_inertia: _Inertia | None = None
    lumped: bool = True
    stiffness: _Spring | None = None
    damping: _Damper = 0.0
    clearance: Clearance | None = None
    ring_stiffness: _Spring | None = None
    ring_damping: _Damper | None = None
    ring_clearance: Clearance | None = None
    impact_damping: Annotated[NonNegative, measured(QuantityKind.IMPACT)] | None = None
    orbit_inertia: _Inertia | None = None
    bearing_stiffness: _Spring | None = None
    bearing_damping: _Damper = 0.0
    pressure_angle: Number = 20.0

    def part(self) -> Planetary:
        """Make the set."""
        return Planetary(**dict(self))


class BearingPart(Part):
    """A bearing in which a gear moves sideways: ``[[bearing]]``."""

    name: Name = Field(description="its parameters begin with it, as in front.stiffness")
    carries: Name = Field(description="name the inertia of the gear")
    radius: Any = Field(description='write the base radius of the gear, as in "40 mm"')
    mass: Any = Field(description='write what moves sideways, as in "1.2 kg"')
    stiffness: Any = Field(description='write its stiffness, as in "2e8 N/m"')
    damping: Any = 0.0
    clearance: Any = None
    angle: Number | dict[Name, Number] = 0.0

    def part(self) -> Bearing:
        """Make the bearing."""
        return Bearing(**dict(self))


class TorquePart(Part):
    """A torque by a formula: ``[[force]]``. All keys that the schema does not know are parameters of the formula."""

    model_config = ConfigDict(extra="allow", frozen=True)

    name: Name = Field(description="its parameters begin with it, as in drag.a")
    between: _Ends = Field(description='name the two inertias on which it acts, as in ["gearbox", "ground"]')
    law: Text = Field(
        description='write its formula, as in "a*v + b*v*abs(v)": x is the angle of the first inertia less that of the '
        "second, v its rate"
    )

    def part(self) -> Force:
        """Make the torque."""
        first, second = self.between
        return Force(self.name, (first, second), self.law, numbers=self.model_extra or {})


class TrainFrictionBase(PacedPart, FrictionBase):
    """Dry friction between two inertias, or between one and the ground."""

    between: _Ends = Field(description='name the two inertias between which it slips, as in ["hub", "ground"]')
    ratio: Number | None = None

    main_numbers = ("coefficient", "limit")

    def part(self) -> Friction:
        """Make the friction."""
        first, second = self.between
        return Friction(self.name, (first, second), normal=self.normal or "", ratio=self.ratio, numbers=self.given)


class DragBase(PacedPart):
    """Drag between parts that turn at different speeds: ``[[drag]]``; keys unknown here are those of its formula."""

    model_config = ConfigDict(extra="allow", frozen=True)

    name: Name = Field(description="its parameters begin with it, as in bearing.linear")
    between: _Ends = Field(description='name the two parts that slip, as in ["gear1", "output"] or ["gear1", "ground"]')
    exponent: Count = 2
    law: Text | None = Field(
        default=None,
        description='write a formula of the slip s instead, as in "a*s + b*s**3": the speed of the first less that of '
        "the second",
    )
    group: Name | None = None

    main_numbers = NOT_NEGATIVE

    @model_validator(mode="after")
    def _has_known_keys(self, info: ValidationInfo[Names]) -> DragBase:
        for name in self.model_extra or () if self.law is None else ():
            hint = did_you_mean(name, [*(each.name for each in OF_DRAGS), "exponent", "group"], "its keys are")
            example = '"0.01 N m s/rad"' if info.context.units else "0.01"
            raise ValueError(f"has no key {name}; write its torque as in linear = {example}, or by a law; {hint}")
        return self

    def part(self) -> Drag:
        """Make the drag."""
        first, second = self.between
        numbers = {each.name: value for each in OF_DRAGS if (value := getattr(self, each.name)) is not None}
        more: Any = {"law": self.law, "exponent": self.exponent, "group": self.group or ""}
        return Drag(self.name, (first, second), numbers={**numbers, **(self.model_extra or {})}, **more)


_OF_DRAGS: dict[str, Any] = {  # that without a kind has a unit of its own, as the parameters of a formula
    each.name: (number_of(each) | None if each.kind else Any, None) for each in OF_DRAGS
}
DragPart: Any = create_model("DragPart", __base__=DragBase, **_OF_DRAGS)


class TrainBase(Part):
    """A model file that describes a drive train; see `train_part`."""

    title: Text = ""
    inertia: list[InertiaPart] = Field(
        min_length=1, max_length=MAX_COORDINATES, description="write a table [[inertia]] for each body"
    )
    mean: dict[Annotated[Text, InertiaName], Torque] = Field(default={})
    reaction: Name | None = None
    reference: Name = ""
    longest: Count = LONGEST
    frequency: _Pace | None = None
    speed: _Pace | None = None
    force: Annotated[list[TorquePart], Field(max_length=MAX_COORDINATES)] = Field(default=[])
    groups: dict[Name, NonNegative] = Field(default={})
    over_speed: dict[Text, Text] = Field(default={})
    study: Annotated[Any, AfterValidator(study_tables)] = None
    measurement: Any = None  # read by `gapwalk.studies.measurement_fit`
    reduction: Any = None  # read by `gapwalk.studies.study_file`

    @field_validator("speed")
    @classmethod
    def _is_the_only_one(cls, speed: Quantity | float | None, info: ValidationInfo[Names]) -> Quantity | float | None:
        if speed is not None and not isinstance(speed, Quantity):
            raise ValueError('is a number; a speed has a unit, as in "1500 rpm". Without units, write frequency')
        if speed is not None and info.data.get("frequency") is not None:
            raise ValueError("is given together with frequency; leave one of the two out")
        return speed

    @model_validator(mode="after")
    def _tells_its_unit(self, info: ValidationInfo[Names]) -> TrainBase:
        if info.context.units and self.frequency is None and self.speed is None:
            raise ValueError(
                'the excitation has neither speed nor frequency; write speed = "1500 rpm" (then orders are counted per '
                'turn) or frequency = "50 Hz"'
            )
        return self

    def system(self, elements: Mapping[str, list[Any]]) -> System:
        """Make the system of the train, with the loads that its tables have made."""
        parts: list[Any] = [each for key in (*_PACED, "drag") for each in getattr(self, key, ())]
        made: dict[str, Any] = {
            group: [part.part() for part in getattr(self, kind, ())] for group, kind in PARTS.items()
        }
        train = Train(
            **made,
            mean=self.mean,
            harmonics=loads_of(elements),
            frequency=self.frequency or 1.0,
            reaction=self.reaction,
            speed=self.speed,  # pyright: ignore[reportArgumentType]
            groups=self.groups,
            over_speed={name: text for part in parts for name, text in part.factors()} | self.over_speed,
            reference=self.reference,
            longest=self.longest,
        )
        return train.system()


@by_registered_kinds
def train_part() -> type[TrainBase]:
    """Return the schema of a model file with a drive train."""
    fields = {**law_fields("parameters"), **friction_fields(), "stage": (stages_field(0), Field(default=[]))}
    made: dict[str, Any] = {
        "shaft": create_model("ShaftPart", __base__=LinkBase, **fields),
        "gear": create_model("GearPart", __base__=GearBase, **fields),
        "drag": DragPart,
        "friction": friction_part(TrainFrictionBase),
        "planetary": PlanetaryPart,
        "bearing": BearingPart,
    }
    links: Any = {k: (list[part], Field(default=[], max_length=MAX_COORDINATES)) for k, part in made.items()}
    return create_model("TrainPart", __base__=TrainBase, **links, **load_fields(TrainLoadBase))


def describes_train(data: Mapping[str, Any]) -> bool:
    """Return True if the content of a model file has parts of a drive train."""
    return any(key in data for key in _KEYS)


def train_problems(error: ModelError, source: Source) -> Iterator[Problem]:
    """Make a problem of each line of an error, at the part with which it begins."""
    places: dict[str, Path] = {name: (name,) for name in _TOP}
    beside: dict[str, Path] = {}  # of contacts that a table makes beside its springs
    for kind in (*PARTS.values(), *LOADS):
        for number, table in enumerate(source.data.get(kind, ())):
            name = table.get("name") or default_name(kind, table, places)
            places[name] = (kind, number)
            beside |= dict.fromkeys((stop_name(name), friction_name(name)), (kind, number))
    for line in dict.fromkeys(str(error).splitlines()):
        subject, _, rest = line.partition(" ")
        name, *keys = subject.split(".")
        if name in places:
            yield source.problem(rest, (*places[name], *keys))
        elif name in beside:
            yield source.problem(f"is refused: {line}", beside[name])
        else:
            yield source.problem(line)

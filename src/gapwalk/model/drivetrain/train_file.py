"""Drive trains in a model file: ``[[inertia]]``, ``[[shaft]]`` and ``[[gear]]`` in place of matrices."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Annotated, Any

from pydantic import AfterValidator, Field, ValidationInfo, field_validator, model_validator

from gapwalk.errors import ModelError
from gapwalk.model.contact import Stage
from gapwalk.model.drivetrain.train import Train
from gapwalk.model.drivetrain.train_parts import Gear, Inertia, Shaft
from gapwalk.model.model_fields import (
    MAX_COORDINATES,
    Clearance,
    CubicStiffness,
    InertiaName,
    Name,
    Names,
    NonNegative,
    Number,
    Positive,
    Text,
    Torque,
    measured,
    without_repeats,
)
from gapwalk.model.model_source import Source
from gapwalk.model.model_tables import HarmonicPart, Stages, study_tables
from gapwalk.model.problems import Path, Problem
from gapwalk.model.schema import Part
from gapwalk.model.system import System
from gapwalk.model.units import Quantity, QuantityKind

_KEYS = ("inertia", "shaft", "gear")

# The quantities of a part: all are numbers in consistent units, or all are texts such as "0.12 kg m^2".
_Inertia = Annotated[Positive, measured(QuantityKind.INERTIA)]
_Stiffness = Annotated[Positive, measured(QuantityKind.STIFFNESS)]
_Damping = Annotated[NonNegative, measured(QuantityKind.DAMPING)]
_PerRate = Annotated[NonNegative, measured(QuantityKind.IMPACT)]
_Pace = Annotated[Positive, measured(QuantityKind.FREQUENCY)]
_Ends = Annotated[list[Name], Field(min_length=2, max_length=2), AfterValidator(without_repeats)]


class InertiaPart(Part):
    """A body: ``[[inertia]]``."""

    name: Name = Field(description="shafts, gears and torques call it by that")
    inertia: _Inertia = Field(description="it is the moment of inertia")

    def part(self) -> Inertia:
        """The inertia that the table describes."""
        return Inertia(self.name, self.inertia)


class LinkPart(Part):
    """What shafts and gears have in common."""

    name: Name = Field(description="its parameters are called by it, as in clutch.stiffness")
    between: _Ends = Field(description='name the two inertias that it joins, as in ["flywheel", "hub"]')
    stiffness: _Stiffness | None = None
    damping: _Damping = 0.0
    clearance: Clearance | None = None
    cubic: CubicStiffness = 0.0
    impact_damping: _PerRate | None = None
    viscous_damping: _Damping | None = None
    stage: Stages = Field(default=[])

    def springs(self) -> dict[str, Any]:
        """All but the name and the ends, as `Shaft` and `Gear` have it."""
        stages = (
            Stage(part.clearance, part.stiffness, part.cubic, part.side, name=part.name or "") for part in self.stage
        )
        names = ("stiffness", "damping", "clearance", "cubic", "impact_damping", "viscous_damping")
        return {"stages": tuple(stages), **{name: getattr(self, name) for name in names}}


class ShaftPart(LinkPart):
    """A shaft, clutch or spline: ``[[shaft]]``."""

    def part(self) -> Shaft:
        """The shaft that the table describes."""
        first, second = self.between
        return Shaft(self.name, (first, second), **self.springs())


class GearPart(LinkPart):
    """A gear mesh: ``[[gear]]``."""

    ratio: Number = Field(description="it is the speed of the first inertia divided by that of the second")

    def part(self) -> Gear:
        """The gear that the table describes."""
        first, second = self.between
        return Gear(self.name, (first, second), self.ratio, **self.springs())


class TrainPart(Part):
    """A model file that describes a drive train."""

    title: Text = ""
    inertia: list[InertiaPart] = Field(
        min_length=1, max_length=MAX_COORDINATES, description="write a table [[inertia]] for each body"
    )
    shaft: list[ShaftPart] = Field(default=[], max_length=MAX_COORDINATES)
    gear: list[GearPart] = Field(default=[], max_length=MAX_COORDINATES)
    mean: dict[Annotated[Text, InertiaName], Torque] = Field(default={})
    reaction: Name | None = None
    frequency: _Pace | None = None
    speed: _Pace | None = None
    harmonic: list[HarmonicPart] = Field(default=[], max_length=MAX_COORDINATES)
    study: Annotated[Any, AfterValidator(study_tables)] = None
    reduction: Any = None  # read by `gapwalk.studies.reduced`

    @field_validator("speed")
    @classmethod
    def _is_the_only_one(cls, speed: Quantity | float | None, info: ValidationInfo[Names]) -> Quantity | float | None:
        if speed is not None and not isinstance(speed, Quantity):
            raise ValueError('is a number; a speed has a unit, as in "1500 rpm". Without units, write frequency')
        if speed is not None and info.data.get("frequency") is not None:
            raise ValueError("stands beside frequency; leave one of the two out")
        return speed

    @model_validator(mode="after")
    def _tells_its_unit(self, info: ValidationInfo[Names]) -> TrainPart:
        if info.context.units and self.frequency is None and self.speed is None:
            raise ValueError(
                'the excitation has neither speed nor frequency; write speed = "1500 rpm" (then orders are counted per '
                'turn) or frequency = "50 Hz"'
            )
        return self

    def train(self) -> Train:
        """The train that the file describes."""
        return Train(
            inertias=[part.part() for part in self.inertia],
            shafts=[part.part() for part in self.shaft],
            gears=[part.part() for part in self.gear],
            mean=self.mean,
            harmonics=[part.harmonic() for part in self.harmonic],
            frequency=self.frequency or 1.0,
            reaction=self.reaction,
            speed=self.speed,  # pyright: ignore[reportArgumentType]
        )

    def system(self) -> System:
        """The system of that train."""
        return self.train().system()


def describes_train(data: Mapping[str, Any]) -> bool:
    """Whether the content of a model file has parts of a drive train."""
    return any(key in data for key in _KEYS)


def train_problems(error: ModelError, source: Source) -> Iterator[Problem]:
    """The lines of an error, each at the part that it begins with."""
    places: dict[str, Path] = {name: (name,) for name in ("mean", "reaction", "frequency", "speed")}
    for kind in (*_KEYS, "harmonic"):
        for number, table in enumerate(source.data.get(kind, ())):
            places[table.get("name", f"harmonic{table.get('order', 1)}")] = (kind, number)
    for line in dict.fromkeys(str(error).splitlines()):
        subject, _, rest = line.partition(" ")
        name, *keys = subject.split(".")
        if name in places:
            yield source.problem(rest, (*places[name], *keys))
        else:
            yield source.problem(line)

"""The model file: the TOML form of a system, and how it becomes one."""

from __future__ import annotations

import hashlib
import os
from typing import Annotated, Any

import numpy as np
from pydantic import AfterValidator, BeforeValidator, Field, ValidationInfo, field_validator, model_validator

from gapwalk.errors import ModelError
from gapwalk.model.contact import Contact, DampingLaw, Side, Stage
from gapwalk.model.damping_table import DampingField, DampingPart
from gapwalk.model.drivetrain.train_file import TrainPart, describes_train, train_problems
from gapwalk.model.large_files import MATRICES, expand
from gapwalk.model.model_fields import (
    MAX_COORDINATES,
    Direction,
    Matrix,
    Name,
    Names,
    NonNegative,
    Number,
    Positive,
    RegularMatrix,
    Text,
    Vector,
    claim,
    one_of,
    without_repeats,
)
from gapwalk.model.model_source import Source, read_source
from gapwalk.model.model_tables import HarmonicPart, SideName, StagePart, Stages, study_tables
from gapwalk.model.problems import ModelFileError, Problem, given
from gapwalk.model.schema import Part, refusal, validate
from gapwalk.model.system import System

_LawName = Annotated[DampingLaw, BeforeValidator(one_of(DampingLaw))]

# The key that gives the coefficient of each law.
_COEFFICIENTS = {
    DampingLaw.NONE: None,
    DampingLaw.VISCOUS: "viscous_damping",
    DampingLaw.HUNT_CROSSLEY: "impact_damping",
    DampingLaw.HUNT_CROSSLEY_AS_PRINTED: "impact_damping",
}


class ContactPart(Part):
    """A contact: ``[[contact]]``, with its one stage in short form or with tables of stages."""

    name: Name = Field(description="its parameters are called by it, as in stage2.clearance")
    deflection: Direction = Field(description="write by which coordinates it deflects, as in { q1 = 1.0 }")
    force: Vector | None = None
    stage: Annotated[Stages, Field(min_length=1)] | None = None
    clearance: NonNegative | None = Field(default=None, validate_default=True)
    stiffness: Number | None = Field(default=None, validate_default=True)
    cubic: Number | None = Field(default=None, validate_default=True)
    side: SideName | None = Field(default=None, validate_default=True)
    damping: _LawName | None = None
    impact_damping: NonNegative | None = Field(default=None, validate_default=True)
    viscous_damping: NonNegative | None = Field(default=None, validate_default=True)

    @field_validator("name")
    @classmethod
    def _is_free(cls, name: str, info: ValidationInfo[Names]) -> str:
        claim(name, info)
        return name

    @field_validator("clearance", "stiffness", "cubic", "side")
    @classmethod
    def _is_in_one_place(cls, value: object, info: ValidationInfo[Names]) -> object:
        long_form = info.data.get("stage", value) is not None
        if "stage" in info.data and long_form and value is not None:
            raise ValueError("stands beside tables [[contact.stage]]; move it into one of them")
        description = StagePart.model_fields[str(info.field_name)].description
        if "stage" in info.data and not long_form and value is None and description:
            raise ValueError(f"is missing; {description}")
        return value

    @field_validator("impact_damping", "viscous_damping")
    @classmethod
    def _suits_the_law(cls, value: float | None, info: ValidationInfo[Names]) -> float | None:
        if value is not None and info.data.get("impact_damping") is not None:
            raise ValueError("stands beside impact_damping; a contact has one of the two")
        law = info.data.get("damping")
        if law is None:
            return value
        wanted = _COEFFICIENTS[law] == info.field_name
        if wanted and value is None:
            raise ValueError(f"is missing; the law {given(law.value)} needs it")
        if not wanted and value is not None:
            raise ValueError(f"is {value}, but damping is {given(law.value)}; leave one of the two out")
        return value

    @model_validator(mode="after")
    def _makes_a_contact(self) -> ContactPart:
        try:
            self.contact()
        except ModelError as error:
            reason = str(error).removeprefix(f"contact {self.name!r}: ")
            raise ValueError(f"is refused: {reason}") from None
        return self

    def contact(self) -> Contact:
        """The contact that the table describes."""
        tables = self.stage or [
            StagePart.model_construct(
                clearance=self.clearance,
                stiffness=self.stiffness,
                cubic=self.cubic or 0.0,
                side=self.side or Side.BOTH,
            )
        ]
        names = [table.name or f"stage{place}" for place, table in enumerate(tables, start=1)]
        stages = tuple(
            # One stage alone needs no name: its parameters are called after the contact.
            Stage(part.clearance, part.stiffness, part.cubic, part.side, name if len(tables) > 1 else "")
            for part, name in zip(tables, names, strict=True)
        )
        damping = self.damping
        if damping is None:
            damping = DampingLaw.HUNT_CROSSLEY if self.impact_damping is not None else DampingLaw.NONE
            damping = DampingLaw.VISCOUS if self.viscous_damping is not None else damping
        coefficients = (self.impact_damping or 0.0, self.viscous_damping or 0.0)
        return Contact(self.name, self.deflection, stages, self.force, damping, *coefficients)


class SystemPart(Part):
    """A model file. Its tables ``[study]``, ``[measurement]`` and ``[reduction]`` are read by `gapwalk.studies`."""

    title: Text = ""
    coordinates: Annotated[list[Name], AfterValidator(without_repeats)] = Field(
        min_length=1,
        max_length=MAX_COORDINATES,
        description='list the names of the degrees of freedom, as in ["q1", "q3"]',
    )
    mass: RegularMatrix | None = None
    stiffness: Matrix = Field(description="write the matrix K, a list of rows")
    damping: DampingField | None = None
    mean: Vector = Field(default={})
    frequency: Positive | None = None
    contact: list[ContactPart] = Field(default=[], max_length=MAX_COORDINATES)
    harmonic: list[HarmonicPart] = Field(default=[], max_length=MAX_COORDINATES)
    study: Annotated[Any, AfterValidator(study_tables)] = None
    measurement: Any = None
    reduction: Any = None  # read by `gapwalk.studies.reduced`

    def system(self, frequency: float | None = None) -> System:
        """The system that the file describes, at `frequency` if the file gives none."""
        return System(
            coordinates=self.coordinates,
            stiffness=self.stiffness,
            damping=self.damping.damping() if isinstance(self.damping, DampingPart) else self.damping,
            mass=self.mass,
            contacts=[part.contact() for part in self.contact],
            mean=self.mean,
            harmonics=[part.harmonic() for part in self.harmonic],
            frequency=self.frequency or frequency or 1.0,
        )


ModelPart = SystemPart | TrainPart
"""What a model file says of the system, in one of its two forms: equations of motion, or a drive train."""


def check_system(source: Source) -> tuple[ModelPart | None, list[Problem]]:
    """Check the system part of a model file.

    Returns
    -------
    part : SystemPart, TrainPart or None
        What the file says, if nothing is wrong with it.
    problems : list of Problem
        Everything that is wrong with it.
    """
    if describes_train(source.data):
        return _check_train(source)
    source, unread = expand(source)
    part, problems = validate(SystemPart, source.data, source, context=lambda: Names.of(source.data))
    missing = {problem.path for problem in unread}
    problems = unread + [problem for problem in problems if problem.path not in missing]
    if part and not problems:
        try:
            part.system()
        except ModelError as error:
            return None, [source.problem(refusal(error))]
    return (None if problems else part), problems


def matrices_digest(source: Source, part: ModelPart) -> str:
    """A digest of the matrices that a source takes from files beside it; empty if it takes none."""
    named = [key for key in MATRICES if isinstance(source.data.get(key), str)]
    if not named:
        return ""
    digest = hashlib.sha256(" ".join(named).encode())
    for key in named:
        digest.update(np.array(getattr(part, key), dtype=float).tobytes())
    return digest.hexdigest()


def _check_train(source: Source) -> tuple[TrainPart | None, list[Problem]]:
    part, problems = validate(TrainPart, source.data, source, context=lambda: Names.of_train(source.data))
    if part:
        try:
            part.system()
        except ModelError as error:
            return None, [*train_problems(error, source)]
    return part, problems


def read_system(path: str | os.PathLike[str]) -> System:
    """Read the system of a model file; its study, if it has one, is not looked at.

    Parameters
    ----------
    path
        A TOML file. ``gapwalk new FILE`` writes one to begin with.

    Raises
    ------
    ModelFileError
        With everything that is wrong, each problem with its line.
    """
    source = read_source(path)
    part, problems = check_system(source)
    if not gives_pace(source):
        problems.append(source.problem("is missing; write the frequency W of the excitation", ("frequency",)))
    if part is None or problems:
        raise ModelFileError(in_order(problems))
    return part.system()


def gives_pace(source: Source) -> bool:
    """Whether a file gives the frequency of the excitation, or the speed of a shaft in its place."""
    return "frequency" in source.data or "speed" in source.data


def in_order(problems: list[Problem]) -> list[Problem]:
    """The problems in the order of the file."""
    return sorted(problems, key=lambda problem: problem.line or 0)

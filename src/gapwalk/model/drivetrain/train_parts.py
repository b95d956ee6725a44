"""The parts of a drive train: inertias, shafts, and gear meshes, each with its numbers.

A number may also be a text with a unit, which `Train` reads: ``Inertia("hub", "0.005 kg m^2")``.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import KW_ONLY, dataclass, replace

from gapwalk.errors import ModelError
from gapwalk.model.contact import Contact, DampingLaw, Stage

GROUND = "ground"
"""The name of what never moves; a shaft may end there."""


@dataclass(frozen=True)
class Inertia:
    """A rigid body that turns (or, in a chain of masses, moves).

    Parameters
    ----------
    name
        Its parameter is called ``name.inertia``.
    inertia
        Moment of inertia, > 0, in kg m^2 or any consistent unit.
    """

    name: str
    inertia: float


@dataclass(frozen=True)
class Link(ABC):
    """What joins two inertias: springs with and without clearances, and a damper, all of them optional.

    Parameters
    ----------
    name
        Prefix of its parameters' names, as in ``clutch.stiffness``, and name of its deflection.
    between
        The two inertias.
    stiffness
        Of the spring, > 0; None if there are only stages, or no springs at all: a shaft with damping alone is a drag,
        as that of a bearing, or of a fluid coupling. Where nothing else holds its two inertias together, the angle
        between them is free and left out: see `Train`.
    damping
        Of the damper, >= 0; it acts always, also within a gap.
    clearance
        Half the backlash of that spring, as an angle, if there is any.
    stages
        Further springs, from the inside out; names are made up for those that have none.
    cubic
        Coefficient of the cubic term of the spring beyond the clearance; there is none without a clearance.
    impact_damping, viscous_damping
        Of the contact of the springs that have a clearance: the coefficient of Hunt and Crossley's law, or that of a
        damper which acts while they touch. One of the two at most.
    """

    name: str
    between: tuple[str, str]
    _: KW_ONLY
    stiffness: float | None = None
    damping: float = 0.0
    clearance: float | None = None
    stages: tuple[Stage, ...] = ()
    cubic: float = 0.0
    impact_damping: float | None = None
    viscous_damping: float | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "stages", tuple(self.stages))

    @property
    @abstractmethod
    def is_rigid(self) -> bool:
        """Whether it holds its two inertias together without any spring."""

    @abstractmethod
    def problems(self) -> Iterator[str]:
        """What is wrong with its numbers, one sentence each, without its name."""

    @property
    def is_drag(self) -> bool:
        """Whether it damps, and holds nothing."""
        return not (self.is_rigid or self.has_springs)

    @property
    def has_springs(self) -> bool:
        """Whether anything of it is elastic."""
        return self.stiffness is not None or bool(self.stages)

    def contact(self) -> Contact | None:
        """Its springs with clearances; None if there are none.

        Raises
        ------
        ModelError
            If there can be no such springs.
        """
        alone = len(self.stages) + (self.stiffness is not None) == 1  # then its parameters need no name of a stage
        stages = []
        if self.stiffness is not None and self.clearance is not None:
            stages.append(Stage(self.clearance, self.stiffness, self.cubic, name="" if alone else "stage1"))
        for number, stage in enumerate(self.stages, start=1 if self.stiffness is None else 2):
            stages.append(replace(stage, name=stage.name or ("" if alone else f"stage{number}")))
        if not stages:
            return None
        law = DampingLaw.HUNT_CROSSLEY if self.impact_damping is not None else DampingLaw.NONE
        law = DampingLaw.VISCOUS if self.viscous_damping is not None else law
        coefficients = (self.impact_damping or 0.0, self.viscous_damping or 0.0)
        return Contact(self.name, {self.name: 1.0}, tuple(stages), None, law, *coefficients)

    def spring_problems(self) -> Iterator[str]:
        """What is wrong with its springs and dampers, one sentence each, without its name."""
        if self.stiffness is None and self.clearance is not None:
            yield "has a clearance, but no stiffness beyond it; write stiffness = ..."
        if self.cubic and self.clearance is None:
            yield "has a cubic term, but no clearance; put it into a stage with clearance = 0.0"
        if self.impact_damping is not None and self.viscous_damping is not None:
            yield "has impact_damping and viscous_damping; leave one of the two out"
            return
        for what in ("impact_damping", "viscous_damping"):
            if getattr(self, what) is not None and self.clearance is None and not self.stages:
                yield f"has {what}, but no clearance; write damping = ... for a damper that acts always"
        try:
            self.contact()
        except ModelError as error:
            yield f"is refused: {str(error).removeprefix(f'contact {self.name!r}: ')}"


@dataclass(frozen=True)
class Shaft(Link):
    """A spring with a damper between two inertias, or between one and the ground, with or without clearance.

    Its twist is the angle of the first inertia less that of the second. Without a clearance the spring acts always;
    with one it acts beyond it (a spline, say). Stages act in addition, each beyond its own clearance (a clutch). The
    second of its inertias may be ``"ground"``. Parameters are those of `Link`.
    """

    @property
    def is_rigid(self) -> bool:
        """Whether it holds its two inertias together without any spring."""
        return False

    def problems(self) -> Iterator[str]:
        """What is wrong with its numbers, one sentence each, without its name."""
        if not self.has_springs and self.clearance is None and not self.damping:
            yield (
                "has no stiffness; write stiffness = ..., or stages with a clearance and a stiffness each, or "
                "damping = ... for a drag"
            )
        yield from self.spring_problems()


@dataclass(frozen=True)
class Gear(Link):
    """A gear mesh (or belt, or chain drive) between two inertias: rigid, or with the stiffness of its teeth.

    All angles are counted such that they grow together as the train turns. The deflection of the mesh is the angle of
    the first inertia less `ratio` times that of the second, so its stiffness, damping and clearance are those that are
    felt at the first: teeth of k N/m with j m of backlash on a base circle of radius r m have the stiffness k r^2 and
    the clearance j / (2 r). The other parameters are those of `Link`.

    Parameters
    ----------
    ratio
        Speed of the first inertia divided by that of the second, not zero.
    stiffness
        None for a rigid mesh, which makes one body of its two inertias.
    """

    ratio: float

    @property
    def is_rigid(self) -> bool:
        """Whether it holds its two inertias together without any spring."""
        return not self.has_springs

    def problems(self) -> Iterator[str]:
        """What is wrong with its numbers, one sentence each, without its name."""
        if self.is_rigid and self.damping:
            yield "has damping, but no stiffness, so it is rigid; leave damping out, or write stiffness = ..."
        if GROUND in self.between:
            yield "ends at the ground, but a gear joins two inertias; write a shaft instead"
        yield from self.spring_problems()

"""The parts of a drive train: inertias, shafts, and gear meshes, each with its numbers.

A number may also be a text with a unit, which `Train` reads: ``Inertia("hub", "0.005 kg m^2")``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, field, fields, replace
from typing import Any, Self

from gapwalk.errors import ModelError
from gapwalk.model.contact import Contact, Stage
from gapwalk.model.laws import Law, law_with

GROUND = "ground"
"""The name of the ground, which does not move; a shaft may end there."""

Change = Callable[[str, Any], Any]
"""A function that returns another value for a quantity, from its name and its value."""

_OF_LINKS = ("stiffness", "damping", "clearance", "cubic")
_OF_STAGES = ("clearance", "stiffness", "cubic")


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

    def _converted(self, change: Change) -> Inertia:
        """Return it with another value of its quantity."""
        return replace(self, inertia=change(f"{self.name}.inertia", self.inertia))


@dataclass(frozen=True, init=False)
class Link:
    """A connection of two inertias: springs with and without clearances, and a damper, all of them optional.

    Parameters
    ----------
    name
        Prefix of its parameters' names, as in ``clutch.stiffness``, and name of its deflection.
    between
        The two inertias.
    stiffness
        Stiffness of the spring, > 0; None if there are only stages, or no springs at all: a shaft with damping alone is
        a drag, as that of a bearing, or of a fluid coupling. Where nothing else holds its two inertias together, the
        angle between them is free and left out: see `Train`.
    damping
        Coefficient of the damper, >= 0; it acts always, also within a gap.
    clearance
        Half the backlash of that spring, as an angle, if there is any.
    stages
        Further springs, from the inside out; names are made up for those that have none.
    cubic
        Coefficient of the cubic term of the spring beyond the clearance; there is none without a clearance.
    law
        The force law of the contact of the springs that have a clearance, or its name; by default the first that has
        the parameters which are given.
    impact_damping, viscous_damping
        The parameter of Hunt and Crossley's law, or of a damper which acts while they touch. One of the two at most.
    numbers
        Parameters of any law by name; they may also be given as arguments.
    """

    name: str
    between: tuple[str, str]
    _: KW_ONLY
    stiffness: float | None = None
    damping: float = 0.0
    clearance: float | None = None
    stages: tuple[Stage, ...] = ()
    cubic: float = 0.0
    law: Law | str | None = None
    numbers: Mapping[str, float] = field(default_factory=dict, hash=False)

    def __init__(
        self,
        name: str,
        between: tuple[str, str],
        *,
        stiffness: float | None = None,
        damping: float = 0.0,
        clearance: float | None = None,
        stages: Sequence[Stage] = (),
        cubic: float = 0.0,
        law: Law | str | None = None,
        numbers: Mapping[str, float] | None = None,
        **more: float | None,
    ) -> None:
        given = {**(numbers or {}), **{what: value for what, value in more.items() if value is not None}}
        parts = (name, between, stiffness, damping, clearance, tuple(stages), cubic, law, given)
        for each, value in zip(fields(Link), parts, strict=True):
            object.__setattr__(self, each.name, value)

    @property
    def is_rigid(self) -> bool:
        """True if it connects its two inertias rigidly."""
        return False

    @property
    def is_drag(self) -> bool:
        """True for a damper without any spring."""
        return not (self.is_rigid or self.has_springs)

    @property
    def has_springs(self) -> bool:
        """True if any of its springs is elastic."""
        return self.stiffness is not None or bool(self.stages)

    def contact(self) -> Contact | None:
        """Return its springs with clearances as a contact; None if there are none.

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
        law = law_with(self.numbers) if self.law is None else self.law
        return Contact(self.name, {self.name: 1.0}, tuple(stages), None, law, self.numbers)

    def _converted(self, change: Change) -> Self:
        """Return it with other values of its quantities, in the order in which they choose the units of a train."""

        def changed(prefix: str, values: Mapping[str, Any]) -> dict[str, Any]:
            return {what: change(f"{prefix}.{what}", value) for what, value in values.items()}

        values = changed(self.name, {what: getattr(self, what) for what in _OF_LINKS})
        stages = []
        for number, stage in enumerate(self.stages):
            prefix = f"{self.name}.{stage.name or f'stage[{number}]'}"
            own = changed(prefix, {what: getattr(stage, what) for what in _OF_STAGES})
            stages.append(replace(stage, **own, numbers=changed(prefix, stage.numbers)))
        return replace(self, **values, stages=tuple(stages), numbers=changed(self.name, self.numbers))

    def problems(self) -> Iterator[str]:
        """List the errors of its numbers, one sentence each, without its name."""
        if self.stiffness is None and self.clearance is not None:
            yield "has a clearance, but no stiffness beyond it; write stiffness = ..."
        if self.cubic and self.clearance is None:
            yield "has a cubic term, but no clearance; put it into a stage with clearance = 0.0"
        if self.law is None:
            try:
                law_with(self.numbers)
            except ModelError as error:
                yield f"has {' and '.join(self.numbers)}; {error}: leave one of the two out"
                return
        for what in ("law", *self.numbers):
            if (what != "law" or self.law is not None) and self.clearance is None and not self.stages:
                yield f"has {what}, but no clearance; write damping = ... for a damper that acts always"
        try:
            self.contact()
        except ModelError as error:
            yield f"is refused: {str(error).removeprefix(f'contact {self.name!r}: ')}"


@dataclass(frozen=True, init=False)
class Shaft(Link):
    """A spring with a damper between two inertias, or between one and the ground, with or without clearance.

    Its twist is the angle of the first inertia less that of the second. Without a clearance the spring acts always;
    with one it acts beyond it (a spline, say). Stages act in addition, each beyond its own clearance (a clutch). The
    second of its inertias may be ``"ground"``. Parameters are those of `Link`.
    """

    def problems(self) -> Iterator[str]:
        """List the errors of its numbers, one sentence each, without its name."""
        if not self.has_springs and self.clearance is None and not self.damping:
            yield (
                "has no stiffness; write stiffness = ..., or stages with a clearance and a stiffness each, or "
                "damping = ... for a drag"
            )
        yield from super().problems()


@dataclass(frozen=True, init=False)
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

    def __init__(self, name: str, between: tuple[str, str], ratio: float, **springs: Any) -> None:
        super().__init__(name, between, **springs)
        object.__setattr__(self, "ratio", ratio)

    @property
    def is_rigid(self) -> bool:
        """True if it connects its two inertias rigidly."""
        return not self.has_springs

    def problems(self) -> Iterator[str]:
        """List the errors of its numbers, one sentence each, without its name."""
        if self.is_rigid and self.damping:
            yield "has damping, but no stiffness, so it is rigid; leave damping out, or write stiffness = ..."
        if GROUND in self.between:
            yield "ends at the ground, but a gear joins two inertias; write a shaft instead"
        yield from super().problems()

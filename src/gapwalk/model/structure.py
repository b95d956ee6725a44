"""The structure of a system: what there is, without numbers, and the name and place of every parameter."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from gapwalk.model.contact import DampingLaw, Side
from gapwalk.model.names import NameBlock, ParameterNames
from gapwalk.model.units import Units


@dataclass(frozen=True, slots=True)
class StageForm:
    """A stage without its numbers: its name within the contact, and its side."""

    name: str
    side: Side


@dataclass(frozen=True, slots=True)
class ContactForm:
    """A contact without its numbers. A reciprocal one acts along its own deflection."""

    name: str
    stages: tuple[StageForm, ...]
    damping: DampingLaw
    reciprocal: bool

    @property
    def damping_name(self) -> str | None:
        """The last part of the name of the damping coefficient, if the law has one."""
        if self.damping is DampingLaw.NONE:
            return None
        return "viscous_damping" if self.damping is DampingLaw.VISCOUS else "impact_damping"

    def stage_prefix(self, stage: StageForm) -> str:
        """What the names of the stage's parameters begin with."""
        return f"{self.name}.{stage.name}" if stage.name else self.name


class Breakpoint(NamedTuple):
    """Where a stage begins on one side: number of its contact, side (1 or -1), place of its clearance."""

    contact: int
    side: int
    place: int


@dataclass(frozen=True, slots=True)
class HarmonicForm:
    """A harmonic without its numbers: its name and its order."""

    name: str
    order: int


class Assembly(Protocol):
    """How the equations of motion come from numbers of another kind, such as those of the parts of a drive train.

    An assembly is a value: hashable, and equal to one of the same parts.
    """

    @property
    def names(self) -> ParameterNames:
        """The names of its own numbers; the first is the frequency, or what it is proportional to."""
        ...

    @property
    def units(self) -> Units | None:
        """The units of its own numbers; None if they are plain numbers."""
        ...

    def expand(self, values: NDArray[Any]) -> NDArray[Any]:
        """The values of the equations of motion, real or complex as its own values are, in their order."""
        ...

    def accelerations(self, values: NDArray[Any]) -> NDArray[Any]:
        """``M^-1 [K | C | d_1 ... | m | s_1 ...]``, the columns of all contacts and harmonics, shape (n, columns).

        Made directly, zeros stay zeros; a flow is compiled for the others only.
        """
        ...

    def problems(self, values: NDArray[np.float64]) -> Iterator[str]:
        """What is wrong with its own numbers, one sentence each."""
        ...


@dataclass(frozen=True)
class Structure:
    """Everything about a system but its numbers. Systems of equal structure share one compiled flow.

    The numbers live in one flat vector; `names` gives the parameter at each place of it. Where an assembly stands
    between them and the equations of motion, the numbers are those of the assembly.
    """

    coordinates: tuple[str, ...]
    contacts: tuple[ContactForm, ...]
    harmonics: tuple[HarmonicForm, ...]
    assembly: Assembly | None = None

    @property
    def size(self) -> int:
        """Number of degrees of freedom."""
        return len(self.coordinates)

    def __hash__(self) -> int:
        return self._hash

    @cached_property
    def _hash(self) -> int:  # kept, because every look-up of a compiled flow asks for it
        return hash((self.coordinates, self.contacts, self.harmonics, self.assembly))

    @cached_property
    def names(self) -> ParameterNames:
        """The names of all parameters, in the order of the value vector."""
        return self.assembly.names if self.assembly else ParameterNames(tuple(self._blocks()), self.coordinates)

    @property
    def units(self) -> Units | None:
        """The units of the parameters; None if they are plain numbers."""
        return self.assembly.units if self.assembly else None

    @cached_property
    def pace(self) -> str:
        """The name of the first parameter: ``frequency``, or ``speed`` in a train that is driven at a speed."""
        return self.names[0]

    @cached_property
    def frequency(self) -> float:
        """The angular frequency W of the excitation at the value 1 of the first parameter."""
        return self.units.frequency if self.units else 1.0

    @cached_property
    def breakpoints(self) -> tuple[Breakpoint, ...]:
        """The breakpoint of each switch of the flow, in the order of the switches."""
        return tuple(
            Breakpoint(index, side, self.place(f"{contact.stage_prefix(stage)}.clearance"))
            for index, contact in enumerate(self.contacts)
            for stage in contact.stages
            for side in stage.side.signs
        )

    @cached_property
    def equations(self) -> Structure:
        """The structure whose numbers are those of the equations of motion."""
        return Structure(self.coordinates, self.contacts, self.harmonics) if self.assembly else self

    def expand(self, values: NDArray[Any]) -> NDArray[Any]:
        """The values of `equations` that belong to values of this structure."""
        return self.assembly.expand(values) if self.assembly else values

    def place(self, name: str) -> int:
        """The place of one parameter.

        Raises
        ------
        ModelError
            If there is no parameter of that name; the message offers the nearest ones.
        """
        return self.names.place(name)

    def block(self, prefix: str, *shape: int) -> NDArray[np.intp]:
        """Places of the consecutive parameters that begin with `prefix`, as an index array of `shape`."""
        return self.names.start(prefix) + np.arange(int(np.prod(shape))).reshape(shape)

    def _blocks(self) -> Iterator[NameBlock]:
        yield NameBlock("frequency")
        yield from (NameBlock(matrix, 2) for matrix in ("mass", "damping", "stiffness"))
        yield NameBlock("mean", 1)
        for harmonic in self.harmonics:
            yield from (NameBlock(f"{harmonic.name}.{what}") for what in ("amplitude", "phase"))
            yield NameBlock(f"{harmonic.name}.acts_on", 1)
        for contact in self.contacts:
            yield NameBlock(f"{contact.name}.deflection", 1)
            if not contact.reciprocal:
                yield NameBlock(f"{contact.name}.force", 1)
            for stage in contact.stages:
                prefix = contact.stage_prefix(stage)
                yield from (NameBlock(f"{prefix}.{what}") for what in ("clearance", "stiffness", "cubic"))
            if contact.damping_name:
                yield NameBlock(f"{contact.name}.{contact.damping_name}")

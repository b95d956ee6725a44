"""The structure of a system: its parts without numbers, the names of its parameters, and which values they may have.

Names of large vectors and matrices are computed on request.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from gapwalk.errors import ModelError
from gapwalk.model.contact import ContactForm
from gapwalk.model.laws import Term, closed_form_of
from gapwalk.model.loads import LoadForm
from gapwalk.model.problems import near_names
from gapwalk.model.registry import NameBlock, ParameterNames
from gapwalk.model.units import Units

# Variations over the angle by loads: numbers of contacts and forces, and their deflections.

_SHOWN = 5  # names that are listed if none is similar to the unknown one


class Variation(NamedTuple):
    """A number of a contact that varies over the angle."""

    contact: int  #: Number of the contact.
    #: Number of its stage, of those of its form; -1 for a number of the contact as a whole, or a deflection.
    stage: int
    name: str  #: Name of the parameter in its law, or that of the deflection in its formula.
    is_deflection: bool  #: True for a deflection, which varies by the loads themselves: by a displacement.
    loads: tuple[tuple[int, float], ...]  #: The numbers of the loads, each with a factor.


def varied(contacts: Sequence[ContactForm], load: LoadForm, name: str) -> Iterator[tuple[Variation, float]]:
    """Find the numbers that a load varies, by a name such as ``mesh.stiffness``: each with a sign."""

    def refuse(reason: str) -> ModelError:
        return ModelError(f"{load.name} varies {name!r}, {reason}")

    first, _, rest = name.partition(".")
    index = next((index for index, each in enumerate(contacts) if each.name == first), None)
    if index is None or not rest:
        known = [f"{each.name}.{number}" for each in contacts for number in _varying_numbers(each)]
        near = near_names(name, known) or known[:_SHOWN]
        if first in ("stiffness", "damping", "mass"):
            raise refuse(
                "an entry of a matrix, which does not vary: leave it out of the matrix, and write it as a force with a "
                'law such as "k*x" and k = 1.0, named spring say, and varies = "spring.k"'
            )
        raise refuse(
            "which is not a number of a contact or a force; "
            + (f"write {' or '.join(map(repr, near))}" if near else "there are none")
        )
    contact = contacts[index]
    stage_name, _, last = rest.rpartition(".")
    stages = [place for place, stage in enumerate(contact.stages) if stage_name in ("", stage.name)]
    displaced = contact.deflections
    jumps = load.kind.has_levels
    if not stage_name and last in displaced:
        if jumps:
            raise refuse("which cannot jump; vary it by harmonics")
        yield Variation(index, -1, contact.law.arguments[displaced.index(last)], True, ()), 1.0
    elif last == "clearance" and contact.stages and stages:
        signs = {sign for stage in contact.stages for sign in stage.side.signs}
        if jumps:
            raise refuse("which cannot jump; vary it by harmonics")
        if len(signs) > 1 or stage_name:
            raise refuse(
                "but the clearance can only vary with all stages of a contact on one side. Write two contacts, "
                'side = "positive" and side = "negative", and vary the clearance of both'
            )
        # the force depends on the depth alone: a wider gap on one side is a smaller deflection
        yield Variation(index, -1, contact.law.arguments[0], True, ()), -float(signs.pop())
    elif stages and last in {each.name for each in contact.law.stage_parameters[1:]}:
        own = [last, *(["cubic"] if last == "stiffness" and contact.law.has_stage_parameter("cubic") else [])]
        yield from ((Variation(index, place, each, False, ()), 1.0) for place in stages for each in own)
    elif not stage_name and last in {each.name for each in contact.law.parameters}:
        yield Variation(index, -1, last, False, ()), 1.0
    else:
        known = [f"{first}.{number}" for number in _varying_numbers(contact)]
        raise refuse(f"which is not one of its numbers; write one of {', '.join(map(repr, known))}")


def _varying_numbers(contact: ContactForm) -> list[str]:
    """List the names of what can vary in a contact, without that of the contact."""
    of_stages = [each.name for each in contact.law.stage_parameters if contact.stages]
    return [*contact.deflections, *of_stages, *(each.name for each in contact.law.parameters)]


_ROUNDING = 1e-9  # of the range of a table: so close to its end, a value is within


class JumpTerm(NamedTuple):
    """A product of a number and of parameters, given by their places."""

    factor: float
    places: tuple[int, ...]


class PaceLimits(NamedTuple):
    """The range of the first parameter, frequency or speed, in which all loads are known, and the tables that end."""

    low: float
    high: float
    tables: str

    @property
    def words(self) -> str:
        """Say which table ends, and where."""
        return f"{self.tables} covers {self.low:.6g} to {self.high:.6g}"

    def covers(self, value: float) -> bool:
        """Return True if a value is in the range, but for rounding."""
        if not self.tables:
            return True
        slack = _ROUNDING * (self.high - self.low)
        return self.low - slack <= value <= self.high + slack


class Breakpoint(NamedTuple):
    """The beginning of a stage on one side: number of its contact, side (1 or -1), place of its clearance."""

    contact: int
    side: int
    place: int


class Assembly(Protocol):
    """Assembly of the equations of motion from other numbers, such as those of the parts of a drive train.

    An assembly is hashable, and equal to one of the same parts.
    """

    @property
    def names(self) -> ParameterNames:
        """Names of the numbers from which it computes; the first is the frequency, or a speed proportional to it."""
        ...

    @property
    def units(self) -> Units | None:
        """Units of these numbers; None if they are plain numbers."""
        ...

    @property
    def is_paced(self) -> bool:
        """True if numbers of the equations of motion depend on the frequency or speed, beside those of loads."""
        ...

    def expand(self, values: NDArray[Any]) -> NDArray[Any]:
        """Return the values of the equations of motion in their order, real or complex as its own values."""
        ...

    def accelerations(self, values: NDArray[Any]) -> NDArray[Any] | None:
        """Return ``M^-1 [K | C | d_1 ... | m | s_1 ...]``, with columns of all contacts and loads, shape (n, columns).

        Computed directly, zeros remain exact; a flow is compiled for the other entries only. None if they follow from
        the matrices of `expand`.
        """
        ...

    def problems(self, values: NDArray[np.float64]) -> Iterator[str]:
        """List the errors of these numbers, one sentence each."""
        ...


@dataclass(frozen=True)
class Structure:
    """A system without its numbers. Systems of equal structure share one compiled flow.

    The numbers are in one flat vector; `names` has the parameter at each place of it. With an assembly, they are the
    numbers of the assembly, which computes the equations of motion from them.
    """

    coordinates: tuple[str, ...]
    contacts: tuple[ContactForm, ...]
    harmonics: tuple[LoadForm, ...]
    assembly: Assembly | None = None

    @property
    def size(self) -> int:
        """Number of degrees of freedom, n."""
        return len(self.coordinates)

    @cached_property
    def memories(self) -> tuple[int, ...]:
        """Numbers of the contacts with a state of their own, which follows positions and velocities in a state."""
        return tuple(index for index, contact in enumerate(self.contacts) if contact.law.has_memory)

    @cached_property
    def friction(self) -> tuple[int, ...]:
        """Numbers of the contacts that are dry friction."""
        return tuple(index for index, contact in enumerate(self.contacts) if contact.law.is_dry)

    @cached_property
    def state_size(self) -> int:
        """Size of a state: n positions, n velocities, and the state of each contact with a memory."""
        return 2 * len(self.coordinates) + len(self.memories)

    @cached_property
    def state_names(self) -> tuple[str, ...]:
        """Names of the entries of a state: ``q1``, its rate ``q1'``, and ``brake.extension`` of a contact."""
        rates = (f"{name}'" for name in self.coordinates)
        return (*self.coordinates, *rates, *(f"{self.contacts[place].name}.extension" for place in self.memories))

    @cached_property
    def reactions(self) -> tuple[tuple[int, int], ...]:
        """(contact, number of its switch or -1) of all reactions: friction that sticks rigidly, and rigid stops."""
        found, switch = [], 0
        for index, contact in enumerate(self.contacts):
            if contact.law.is_dry and not contact.law.has_memory:
                found.append((index, -1))
            if contact.law.rebounds:
                found += [(index, switch + place) for place, shape in enumerate(contact.shapes) if shape.innermost]
            switch += len(contact.sides)
        return tuple(found)

    def host(self, contact: int) -> int | None:
        """Return the number of the contact that hosts another one; None if it has no host."""
        name = self.contacts[contact].law.host
        return next((place for place, each in enumerate(self.contacts) if each.name == name), None) if name else None

    def __hash__(self) -> int:
        return self._hash

    @cached_property
    def _hash(self) -> int:  # stored, because every look-up of a compiled flow needs it
        return hash((self.coordinates, self.contacts, self.harmonics, self.assembly))

    @cached_property
    def names(self) -> ParameterNames:
        """The names of all parameters, in the order of the value vector."""
        return self.assembly.names if self.assembly else ParameterNames(tuple(self._blocks()), self.coordinates)

    @property
    def units(self) -> Units | None:
        """The units of the parameters; None if they are plain numbers."""
        return self.assembly.units if self.assembly else None

    @property
    def is_paced(self) -> bool:
        """True if numbers of the equations of motion depend on the frequency or speed, beside those of loads."""
        return self.assembly is not None and self.assembly.is_paced

    @cached_property
    def pace(self) -> str:
        """The name of the first parameter: ``frequency``, or ``speed`` in a train that is driven at a speed."""
        return self.names[0]

    @cached_property
    def frequency(self) -> float:
        """The angular frequency W of the excitation if the first parameter has the value 1."""
        return self.units.frequency if self.units else 1.0

    @cached_property
    def breakpoints(self) -> tuple[Breakpoint, ...]:
        """The breakpoint of each switch of the flow, in the order of the switches."""
        return tuple(
            Breakpoint(index, side, self.place(f"{contact.stage_prefix(stage)}.clearance"))
            for index, contact in enumerate(self.contacts)
            for stage, side in contact.sides
        )

    @cached_property
    def clearance_sizes(self) -> tuple[float, ...]:
        """The size of the unit of each clearance in `breakpoints`, in the unit of deflections."""
        names = [self.names[place] for _, _, place in self.breakpoints]
        return tuple(self.units.factors(names).tolist() if self.units else [1.0] * len(names))

    @cached_property
    def two_sided(self) -> tuple[tuple[int, bool, tuple[JumpTerm, ...]], ...]:
        """For each switch of the flow the place of its clearance, and True if another switch has the same one.

        Then the terms by whose sum the force of that stage jumps from one side to the other if it has no gap.
        """
        places, first, found = [place for _, _, place in self.breakpoints], 0, []
        for contact in self.contacts:
            own = places[first : first + len(contact.sides)]
            terms = (closed_form_of(contact.law, contact.shapes) if contact.has_closed_form else None) or ()
            for place in own:
                jump = [
                    JumpTerm(contact.sides[term.stage][1] * term.factor, self._numbers_of(contact, term))
                    for term in terms
                    if own[term.stage] == place and term.power == term.rate == 0
                ]
                found.append((place, own.count(place) == 2, tuple(jump)))
            first += len(own)
        return tuple(found)

    def _numbers_of(self, contact: ContactForm, term: Term) -> tuple[int, ...]:
        """Return the places of the parameters by which a term of a contact's force is multiplied."""
        prefix = contact.stage_prefix(contact.sides[term.stage][0])
        names = [
            *(f"{contact.name}.{each}" for each in term.numbers),
            *(f"{prefix}.{each}" for each in term.stage_numbers),
        ]
        return tuple(map(self.place, names))

    @cached_property
    def driving(self) -> tuple[LoadForm, ...]:
        """The loads that act on coordinates; the others vary numbers of contacts."""
        return tuple(load for load in self.harmonics if not load.varies)

    @cached_property
    def variations(self) -> tuple[Variation, ...]:
        """The numbers of contacts that vary over the angle, and the loads by which they do."""
        found: dict[Variation, list[tuple[int, float]]] = {}
        for number, load in enumerate(self.harmonics):
            for name, factor in load.varies:
                for variation, sign in varied(self.contacts, load, name):
                    found.setdefault(variation, []).append((number, sign * factor))
        return tuple(variation._replace(loads=tuple(loads)) for variation, loads in found.items())

    @cached_property
    def pace_limits(self) -> PaceLimits:
        """The range of the first parameter in which all loads are known: that of their tables over the speed."""
        low, high, names = 0.0, math.inf, []
        for load in self.harmonics:
            for points, name in load.tables:
                low, high = max(low, points[0] / self.frequency), min(high, points[-1] / self.frequency)
                names.append(name)
        return PaceLimits(low, high, " and ".join(dict.fromkeys(names)))

    @cached_property
    def equations(self) -> Structure:
        """Structure with the plain parameters of the equations of motion, without an assembly."""
        return Structure(self.coordinates, self.contacts, self.harmonics) if self.assembly else self

    def expand(self, values: NDArray[Any]) -> NDArray[Any]:
        """Compute the values of `equations` from values of this structure."""
        return self.assembly.expand(values) if self.assembly else values

    def place(self, name: str) -> int:
        """Return the place of one parameter."""
        return self.names.place(name)

    def block(self, prefix: str, *shape: int) -> NDArray[np.intp]:
        """Return the places of the consecutive parameters that begin with `prefix`, as an index array of `shape`."""
        return self.names.start(prefix) + np.arange(math.prod(shape)).reshape(shape)

    def _blocks(self) -> Iterator[NameBlock]:
        yield NameBlock("frequency")
        yield from (NameBlock(matrix, 2) for matrix in ("mass", "damping", "stiffness"))
        yield NameBlock("mean", 1)
        for load in self.harmonics:
            yield from map(NameBlock, load.parameters)
            if not load.varies:
                yield NameBlock(load.shape, 1)
        for contact in self.contacts:
            for vector in contact.vectors:
                yield NameBlock(vector, 1)
            if not contact.reciprocal:
                yield NameBlock(f"{contact.name}.force", 1)
            yield from map(NameBlock, contact.parameters)

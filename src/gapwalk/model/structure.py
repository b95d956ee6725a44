"""The structure of a system: what there is, without numbers, and the name and place of every parameter."""

from __future__ import annotations

import difflib
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from gapwalk.errors import ModelError
from gapwalk.model.contact import DampingLaw, Side


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
        return f"{self.name}.{stage.name}" if len(self.stages) > 1 else self.name


@dataclass(frozen=True, slots=True)
class HarmonicForm:
    """A harmonic without its numbers: its name and its order."""

    name: str
    order: int


@dataclass(frozen=True)
class Structure:
    """Everything about a system but its numbers. Systems of equal structure share one compiled flow.

    The numbers live in one flat vector; `names` gives the parameter at each place of it.
    """

    coordinates: tuple[str, ...]
    contacts: tuple[ContactForm, ...]
    harmonics: tuple[HarmonicForm, ...]

    @property
    def size(self) -> int:
        """Number of degrees of freedom."""
        return len(self.coordinates)

    def __hash__(self) -> int:
        return self._hash

    @cached_property
    def _hash(self) -> int:  # kept, because every look-up of a compiled flow asks for it
        return hash((self.coordinates, self.contacts, self.harmonics))

    @cached_property
    def names(self) -> tuple[str, ...]:
        """The names of all parameters, in the order of the value vector."""
        return tuple(self._generate_names())

    @cached_property
    def places(self) -> dict[str, int]:
        """The place of each parameter in the value vector."""
        return {name: place for place, name in enumerate(self.names)}

    def place(self, name: str) -> int:
        """The place of one parameter.

        Raises
        ------
        ModelError
            If there is no parameter of that name; the message offers the nearest ones.
        """
        try:
            return self.places[name]
        except (KeyError, TypeError):
            raise ModelError(self._unknown(name)) from None

    def block(self, prefix: str, *shape: int) -> np.ndarray:
        """Places of the consecutive parameters that begin with `prefix`, as an index array of `shape`."""
        q = self.coordinates[0]
        first = self.places.get(f"{prefix}.{q}.{q}", self.places.get(f"{prefix}.{q}"))
        if first is None:
            raise KeyError(prefix)
        return first + np.arange(int(np.prod(shape))).reshape(shape)

    def _generate_names(self):
        qs = self.coordinates
        yield "frequency"
        for matrix in ("mass", "damping", "stiffness"):
            yield from (f"{matrix}.{row}.{column}" for row in qs for column in qs)
        yield from (f"mean.{q}" for q in qs)
        for harmonic in self.harmonics:
            yield from (f"{harmonic.name}.amplitude", f"{harmonic.name}.phase")
            yield from (f"{harmonic.name}.acts_on.{q}" for q in qs)
        for contact in self.contacts:
            yield from (f"{contact.name}.deflection.{q}" for q in qs)
            if not contact.reciprocal:
                yield from (f"{contact.name}.force.{q}" for q in qs)
            for stage in contact.stages:
                prefix = contact.stage_prefix(stage)
                yield from (f"{prefix}.{what}" for what in ("clearance", "stiffness", "cubic"))
            if contact.damping_name:
                yield f"{contact.name}.{contact.damping_name}"

    def _unknown(self, name: str) -> str:
        near = difflib.get_close_matches(str(name), self.names, n=3, cutoff=0.5)
        if not near:
            last = str(name).rsplit(".", 1)[-1]
            near = [known for known in self.names if known.rsplit(".", 1)[-1] == last][:3]
        hint = f"did you mean {' or '.join(repr(known) for known in near)}?" if near else ""
        return f"there is no parameter {name!r}; {hint or 'system.parameters lists them all'}"

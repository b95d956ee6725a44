"""A train without its numbers: its parts, how they are connected, and the place of each of its numbers."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gapwalk.model.drivetrain.link_tree import Edge, Tree, tree_of
from gapwalk.model.names import NameBlock, ParameterNames
from gapwalk.model.structure import ContactForm, HarmonicForm


@dataclass(frozen=True, slots=True)
class LinkForm:
    """A shaft or gear without its numbers.

    Parameters
    ----------
    name
        Its name.
    ends
        Its ends by number; the ground follows the last inertia.
    geared
        Whether it has a ratio.
    fixed
        The ratio where it is no parameter: on a closed loop it follows from the others.
    rigid
        Whether it has no springs.
    always
        Whether it has a spring that acts always.
    contact
        Its springs with clearances.
    """

    name: str
    ends: tuple[int, int]
    geared: bool
    fixed: float | None
    rigid: bool
    always: bool
    contact: ContactForm | None

    @property
    def drag(self) -> bool:
        """Whether it damps, and holds nothing."""
        return not (self.rigid or self.always or self.contact)

    @property
    def has_ratio(self) -> bool:
        """Whether its ratio is a parameter."""
        return self.geared and self.fixed is None


@dataclass(frozen=True, slots=True)
class TorqueForm:
    """A term of the excitation without its numbers: its name, its order, and on which inertias it acts."""

    harmonic: HarmonicForm
    acts_on: tuple[int, ...]


@dataclass(frozen=True)
class TrainForm:
    """The parts of a train without their numbers.

    Parameters
    ----------
    inertias
        Their names.
    links
        Shafts, then gears.
    torques
        The excitation.
    reaction
        The inertia that takes what the other mean torques leave over, by number; None if nothing does.
    """

    inertias: tuple[str, ...]
    links: tuple[LinkForm, ...]
    torques: tuple[TorqueForm, ...] = ()
    reaction: int | None = None

    def _check_read(self) -> None:
        """A ValueError if its parts do not fit together."""
        ends = [end for link in self.links for end in link.ends]
        inertias = [number for torque in self.torques for number in torque.acts_on]
        if not all(0 <= end <= self.ground for end in ends):
            raise ValueError("a link of the train ends nowhere")
        if not all(0 <= number < self.ground for number in (*inertias, self.reaction or 0)):
            raise ValueError("a torque acts on no inertia")

    def __hash__(self) -> int:
        return self._hash

    @cached_property
    def _hash(self) -> int:
        return hash((self.inertias, self.links, self.torques, self.reaction))

    @property
    def ground(self) -> int:
        """The number of the ground."""
        return len(self.inertias)

    @cached_property
    def tree(self) -> Tree:
        """The connections of the links."""
        return tree_of([Edge(link.ends, link.rigid, link.drag) for link in self.links], self.ground)

    @property
    def is_free(self) -> bool:
        """Whether the train can turn as a whole."""
        return self.tree.root != self.ground

    @cached_property
    def springs(self) -> tuple[int, ...]:
        """The links whose deflections are the coordinates, in the order of the links."""
        return tuple(sorted(step.link for step in self.tree.steps if not self.links[step.link].rigid))

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Names of the coordinates: that of a slip is no deflection, so it has a name of its own."""
        return tuple(
            f"{link.name}_slip" if link.drag else link.name for link in map(self.links.__getitem__, self.springs)
        )

    @cached_property
    def slips(self) -> tuple[int, ...]:
        """The coordinates by number that are slips: of drags between inertias that nothing else holds together."""
        return tuple(place for place, link in enumerate(self.springs) if self.links[link].drag)

    @cached_property
    def contacts(self) -> tuple[tuple[int, ContactForm], ...]:
        """The links with clearances, with their contacts."""
        return tuple((number, link.contact) for number, link in enumerate(self.links) if link.contact)

    @cached_property
    def loaded(self) -> tuple[int, ...]:
        """The inertias whose mean torques are parameters."""
        return tuple(number for number in range(len(self.inertias)) if number != self.reaction)

    @cached_property
    def names(self) -> ParameterNames:
        """The names of all numbers."""
        return ParameterNames(tuple(map(NameBlock, self._generate_names())))

    def inertia(self, values: NDArray[Any]) -> NDArray[Any]:
        """The inertias, shape (inertias,)."""
        return values[1 : 1 + len(self.inertias)]

    def mean(self, values: NDArray[Any]) -> NDArray[Any]:
        """The mean torques, shape (inertias,), with none for the reaction."""
        mean = np.zeros(len(self.inertias), dtype=values.dtype)
        mean[list(self.loaded)] = values[1 + len(self.inertias) :][: len(self.loaded)]
        return mean

    def shape(self, values: NDArray[Any], torque: TorqueForm) -> NDArray[Any]:
        """How a term of the excitation is spread over the inertias, shape (inertias,)."""
        shape = np.zeros(len(self.inertias), dtype=values.dtype)
        first = self.names.start(f"{torque.harmonic.name}.amplitude") + 2
        shape[list(torque.acts_on)] = values[first : first + len(torque.acts_on)]
        return shape

    def size_and_phase(self, values: NDArray[Any], torque: TorqueForm) -> NDArray[Any]:
        """Amplitude and phase of a term of the excitation."""
        first = self.names.start(f"{torque.harmonic.name}.amplitude")
        return values[first : first + 2]

    def ratios(self, values: NDArray[Any]) -> NDArray[Any]:
        """The ratios of all links, shape (links,); that of a shaft is 1."""
        return self._numbers(values, "ratio", [1.0 if link.fixed is None else link.fixed for link in self.links])

    def stiffnesses(self, values: NDArray[Any]) -> NDArray[Any]:
        """The stiffnesses of the springs that act always, shape (links,)."""
        return self._numbers(values, "stiffness", [0.0] * len(self.links))

    def dampings(self, values: NDArray[Any]) -> NDArray[Any]:
        """The coefficients of the dampers that act always, shape (links,)."""
        return self._numbers(values, "damping", [0.0] * len(self.links))

    def springs_and_law(self, values: NDArray[Any], contact: ContactForm) -> NDArray[Any]:
        """The numbers of the stages of a contact, then that of its damping law."""
        first = self.names.start(f"{contact.stage_prefix(contact.stages[0])}.clearance")
        return values[first : first + 3 * len(contact.stages) + bool(contact.damping_name)]

    def _numbers(self, values: NDArray[Any], what: str, otherwise: list[float]) -> NDArray[Any]:
        which, places = self._places[what]
        numbers = np.array(otherwise, dtype=values.dtype)
        numbers[which] = values[places]
        return numbers

    @cached_property
    def _places(self) -> dict[str, tuple[NDArray[np.intp], NDArray[np.intp]]]:
        """Which links have a ratio, a spring that acts always, a damper; and where those numbers stand."""
        having = {
            "ratio": [link.has_ratio for link in self.links],
            "stiffness": [link.always for link in self.links],
            "damping": [not link.rigid for link in self.links],
        }
        found = {}
        for what, which in having.items():
            numbers = np.flatnonzero(which)
            places = [self.names.start(f"{self.links[number].name}.{what}") for number in numbers]
            found[what] = numbers, np.array(places, dtype=np.intp)
        return found

    def _generate_names(self) -> Iterator[str]:
        yield "frequency"
        yield from (f"{name}.inertia" for name in self.inertias)
        yield from (f"mean.{self.inertias[number]}" for number in self.loaded)
        for link in self.links:
            yield from (f"{link.name}.{what}" for what in _own_numbers(link))
            yield from _contact_names(link.contact) if link.contact else ()
        for torque in self.torques:
            name = torque.harmonic.name
            yield from (f"{name}.amplitude", f"{name}.phase")
            yield from (f"{name}.acts_on.{self.inertias[number]}" for number in torque.acts_on)


def _own_numbers(link: LinkForm) -> Iterator[str]:
    if link.has_ratio:
        yield "ratio"
    if link.always:
        yield "stiffness"
    if not link.rigid:
        yield "damping"


def _contact_names(contact: ContactForm) -> Iterator[str]:
    for stage in contact.stages:
        yield from (f"{contact.stage_prefix(stage)}.{what}" for what in ("clearance", "stiffness", "cubic"))
    if contact.damping_name:
        yield f"{contact.name}.{contact.damping_name}"

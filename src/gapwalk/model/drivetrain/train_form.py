"""A train without its numbers: its parts, how they are connected, and the place of each of its numbers.

The connections of the parts of a train: a tree of links that reaches all of them, and the links that close loops.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gapwalk.model.loads import LoadForm
from gapwalk.model.names import NameBlock, ParameterNames
from gapwalk.model.structure import ContactForm


@dataclass(frozen=True, slots=True)
class Edge:
    """A link as the tree sees it: its two ends as numbers (the ground has one of its own), and what it does.

    A rigid one holds its ends together, a drag damps their relative motion and holds nothing.
    """

    ends: tuple[int, int]
    rigid: bool
    drag: bool = False


@dataclass(frozen=True, slots=True)
class Step:
    """One step through the tree: the link, and its two ends in the direction of the step."""

    link: int
    parent: int
    child: int


@dataclass(frozen=True, slots=True)
class Tree:
    """The steps from a root to all inertias that are connected to it.

    Parameters
    ----------
    root
        The ground where there is one, or else the first inertia.
    steps
        In an order in which each begins where another has ended.
    chords
        The links that are not in the tree: each closes a loop.
    looped
        The links on loops that do not lead through the ground: on each, the ratios must multiply to one.
    """

    root: int
    steps: tuple[Step, ...]
    chords: tuple[int, ...]
    looped: frozenset[int]


def tree_of(edges: Sequence[Edge], ground: int) -> Tree:
    """The tree; rigid links are in it wherever they can, and links to the ground only where nothing else will do.

    Drags close loops: they are in the tree only where nothing else holds what they join.
    """
    chosen = _spanning(edges, ground)
    root = ground if any(ground in edge.ends and not edge.drag for edge in edges) else 0
    steps = _walk(edges, chosen, root)
    chords = tuple(number for number in range(len(edges)) if number not in chosen)
    parents = {step.child: step for step in steps}
    loops = [_loop(edges, parents, chord) for chord in chords]
    inner = [loop for loop in loops if not any(ground in edges[link].ends for link in loop)]
    return Tree(root, steps, chords, frozenset(link for loop in inner for link in loop))


def _spanning(edges: Sequence[Edge], ground: int) -> set[int]:
    """The links of the tree (Kruskal)."""
    leaders: dict[int, int] = {}

    def leader(node: int) -> int:
        while (above := leaders.get(node, node)) != node:
            leaders[node] = leaders.get(above, above)
            node = above
        return node

    chosen = set()
    for number in sorted(range(len(edges)), key=lambda k: (edges[k].drag, ground in edges[k].ends, not edges[k].rigid)):
        first, second = map(leader, edges[number].ends)
        if first != second:
            leaders[first] = second
            chosen.add(number)
    return chosen


def _walk(edges: Sequence[Edge], chosen: set[int], root: int) -> tuple[Step, ...]:
    links_at: dict[int, list[int]] = {}
    for number in sorted(chosen):
        for end in edges[number].ends:
            links_at.setdefault(end, []).append(number)
    steps, seen, waiting = [], {root}, deque([root])
    while waiting:
        node = waiting.popleft()
        for number in links_at.get(node, ()):
            first, second = edges[number].ends
            other = second if node == first else first
            if other not in seen:
                seen.add(other)
                waiting.append(other)
                steps.append(Step(number, node, other))
    return tuple(steps)


def _loop(edges: Sequence[Edge], parents: dict[int, Step], chord: int) -> set[int]:
    """The links of the loop that a chord closes."""
    found = {chord}
    for end in edges[chord].ends:  # what both ways to the root share is not on the loop
        way, node = set(), end
        while node in parents:
            way.add(parents[node].link)
            node = parents[node].parent
        found ^= way
    return found


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
        """True for a damper without any spring."""
        return not (self.rigid or self.always or self.contact)

    @property
    def has_ratio(self) -> bool:
        """True if its ratio is a parameter."""
        return self.geared and self.fixed is None


@dataclass(frozen=True, slots=True)
class TorqueForm:
    """A term of the excitation without its numbers: its name, its order, and on which inertias it acts."""

    harmonic: LoadForm
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
        """Raise a ValueError if its parts are inconsistent."""
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
        """True if the train can rotate as a whole."""
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
        """Return the distribution of a term of the excitation over the inertias, shape (inertias,)."""
        shape = np.zeros(len(self.inertias), dtype=values.dtype)
        first = self._first(torque) + len(torque.harmonic.parameters)
        shape[list(torque.acts_on)] = values[first : first + len(torque.acts_on)]
        return shape

    def parameters(self, values: NDArray[Any], torque: TorqueForm) -> NDArray[Any]:
        """The parameters of a term of the excitation: amplitude and phase of a harmonic."""
        first = self._first(torque)
        return values[first : first + len(torque.harmonic.parameters)]

    def _first(self, torque: TorqueForm) -> int:
        names = (*torque.harmonic.parameters, *(f"{torque.harmonic.shape}.{self.inertias[k]}" for k in torque.acts_on))
        return self.names.start(names[0])

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
        """The numbers of the stages of a contact, then those of its own."""
        names = contact.parameters
        first = self.names.start(names[0])
        return values[first : first + len(names)]

    def _numbers(self, values: NDArray[Any], what: str, otherwise: list[float]) -> NDArray[Any]:
        which, places = self._places[what]
        numbers = np.array(otherwise, dtype=values.dtype)
        numbers[which] = values[places]
        return numbers

    @cached_property
    def _places(self) -> dict[str, tuple[NDArray[np.intp], NDArray[np.intp]]]:
        """Links with a ratio, a spring or a damper that always acts, and the places of those numbers."""
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
            yield from link.contact.parameters if link.contact else ()
        for torque in self.torques:
            yield from torque.harmonic.parameters
            yield from (f"{torque.harmonic.shape}.{self.inertias[number]}" for number in torque.acts_on)


def _own_numbers(link: LinkForm) -> Iterator[str]:
    if link.has_ratio:
        yield "ratio"
    if link.always:
        yield "stiffness"
    if not link.rigid:
        yield "damping"

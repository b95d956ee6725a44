"""A train without its numbers: its parts, how they are connected, and the place of each of its numbers.

The parts are connected by a tree of links that reaches all of them, and by links that close loops.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.model.drivetrain.made_loads import Displacing, MeanOf
from gapwalk.model.laws import Expression
from gapwalk.model.loads import LoadForm
from gapwalk.model.structure import ContactForm, NameBlock, ParameterNames


@dataclass(frozen=True, slots=True)
class LinkForm:
    """A shaft or gear without its numbers."""

    name: str  #: Its name.
    ends: tuple[int, int]  #: Its ends by number; the ground follows the last inertia.
    geared: bool  #: True if it has a ratio.
    fixed: float | None  #: The ratio where it is no parameter: on a closed loop it follows from the others.
    rigid: bool  #: True if it has no springs.
    always: bool  #: True if it has a spring that acts always.
    #: Its contacts: springs with clearances, the friction beside them, a rigid stop; or its formula, or its friction.
    parts: tuple[ContactForm, ...]

    @property
    def contact(self) -> ContactForm | None:
        """Its springs with clearances or its rigid stop, or its formula, or its friction; None if it acts always."""
        first = self.parts[0] if self.parts else None
        return None if first is None or first.name != self.name else first

    @property
    def beside(self) -> tuple[ContactForm, ...]:
        """The contacts beside that one."""
        return self.parts[1:] if self.contact else self.parts

    @property
    def drag(self) -> bool:
        """True for a damper without any spring."""
        return not (self.rigid or self.always or self.contact)

    @property
    def by_formula(self) -> bool:
        """True if its torque is a formula or friction, so that it has no damper."""
        return self.contact is not None and not self.contact.law.stage_parameters

    @property
    def loose(self) -> bool:
        """True for friction, and a formula that does not depend on its deflection: it joins nothing."""
        law = self.contact.law if self.contact else None
        if law is not None and law.is_dry:
            return True
        return isinstance(law, Expression) and "x" not in law.formula.variables

    @property
    def own_numbers(self) -> tuple[str, ...]:
        """Names of its numbers, without those of its contact."""
        has = {"ratio": self.geared and self.fixed is None, "stiffness": self.always}
        has["damping"] = not self.rigid and not self.by_formula
        return tuple(what for what, value in has.items() if value)


@dataclass(frozen=True, slots=True)
class TorqueForm:
    """A term of the excitation without its numbers: its name, its order, and on which inertias it acts."""

    harmonic: LoadForm  #: The load. What it varies are numbers and deflections of contacts.
    acts_on: tuple[int, ...]  #: The inertias.
    #: The links whose springs and dampers that act always it displaces, each with a factor.
    displaces: tuple[tuple[int, float], ...] = ()


class LoadPart(NamedTuple):
    """A load of the equations of motion."""

    form: LoadForm  #: The load.
    torque: int  #: The term of the excitation from which it comes.
    link: int = -1  #: The link that it displaces; -1 for none.
    factor: float = 0.0  #: The factor of that displacement.
    reacts: bool = False  #: True for the reaction to the mean of that term.


@dataclass(frozen=True, slots=True)
class Step:
    """One step through the tree: the link, and its two ends in the direction of the step."""

    link: int
    parent: int
    child: int


@dataclass(frozen=True, slots=True)
class Tree:
    """The steps from a root to all inertias that are connected to it."""

    root: int  #: The ground if there is one, otherwise the first inertia.
    steps: tuple[Step, ...]  #: In an order in which each begins where another has ended.
    chords: tuple[int, ...]  #: The links that are not in the tree: each closes a loop.
    #: The links on loops that do not lead through the ground: on each, the ratios must multiply to one.
    looped: frozenset[int]


def tree_of(links: Sequence[LinkForm], ground: int) -> Tree:
    """Build the tree: it prefers rigid links, and contains links to the ground only where necessary.

    Drags close loops: they are in the tree only if no other link connects their inertias. Formulas of the rate alone
    always do.
    """
    chosen = _spanning(links, ground)
    root = ground if any(ground in link.ends and not (link.drag or link.loose) for link in links) else 0
    steps = _walk(links, chosen, root)
    chords = tuple(number for number in range(len(links)) if number not in chosen)
    parents = {step.child: step for step in steps}
    loops = [_loop(links, parents, chord) for chord in chords]
    inner = [loop for loop in loops if not any(ground in links[number].ends for number in loop)]
    return Tree(root, steps, chords, frozenset(link for loop in inner for link in loop))


def _spanning(links: Sequence[LinkForm], ground: int) -> set[int]:
    """Choose the links of the tree, in order of preference (Kruskal)."""
    leaders: dict[int, int] = {}

    def leader(node: int) -> int:
        while (above := leaders.get(node, node)) != node:
            leaders[node] = leaders.get(above, above)
            node = above
        return node

    chosen = set()
    for number in sorted(range(len(links)), key=lambda k: (links[k].drag, ground in links[k].ends, not links[k].rigid)):
        first, second = map(leader, links[number].ends)
        if first != second and not links[number].loose:
            leaders[first] = second
            chosen.add(number)
    return chosen


def _walk(links: Sequence[LinkForm], chosen: set[int], root: int) -> tuple[Step, ...]:
    links_at: dict[int, list[int]] = {}
    for number in sorted(chosen):
        for end in links[number].ends:
            links_at.setdefault(end, []).append(number)
    steps, seen, waiting = [], {root}, deque([root])
    while waiting:
        node = waiting.popleft()
        for number in links_at.get(node, ()):
            first, second = links[number].ends
            other = second if node == first else first
            if other not in seen:
                seen.add(other)
                waiting.append(other)
                steps.append(Step(number, node, other))
    return tuple(steps)


def _loop(links: Sequence[LinkForm], parents: dict[int, Step], chord: int) -> set[int]:
    """Find the links of the loop that a chord closes."""
    found = {chord}
    for end in links[chord].ends:  # what both ways to the root share is not on the loop
        way, node = set(), end
        while node in parents:
            way.add(parents[node].link)
            node = parents[node].parent
        found ^= way
    return found


@dataclass(frozen=True)
class TrainForm:
    """The parts of a train without their numbers."""

    inertias: tuple[str, ...]  #: Their names.
    links: tuple[LinkForm, ...]  #: Shafts, then gears.
    torques: tuple[TorqueForm, ...] = ()  #: The excitation.
    #: Index of the inertia on which the torque acts that balances the constant torques; None if there is none.
    reaction: int | None = None

    def _check_read(self) -> None:
        """Raise a ValueError if its parts are inconsistent."""
        ends = [end for link in self.links for end in link.ends]
        inertias = [number for torque in self.torques for number in torque.acts_on]
        if not all(0 <= end <= self.ground for end in ends):
            raise ValueError("a link of the train ends nowhere")
        if not all(0 <= number < self.ground for number in (*inertias, self.reaction or 0)):
            raise ValueError("a torque acts on no inertia")
        if not all(0 <= link < len(self.links) for torque in self.torques for link, _ in torque.displaces):
            raise ValueError("a displacement is that of no link")

    @property
    def ground(self) -> int:
        """The number of the ground."""
        return len(self.inertias)

    @cached_property
    def tree(self) -> Tree:
        """The connections of the links."""
        return tree_of(self.links, self.ground)

    @property
    def is_free(self) -> bool:
        """True if the train can rotate as a whole."""
        return self.tree.root != self.ground

    @property
    def held(self) -> list[int]:
        """The inertia of each connected part of the train at which it is joined to the ground; empty if it is free."""
        return [step.child for step in self.tree.steps if step.parent == self.ground]

    @cached_property
    def ends(self) -> NDArray[np.intp]:
        """The inertias at the first end of each link, then those at the second, shape (2 links,)."""
        return np.array([link.ends for link in self.links]).T.ravel()

    @cached_property
    def springs(self) -> tuple[int, ...]:
        """The links whose deflections are the coordinates, in the order of the links."""
        return tuple(sorted(step.link for step in self.tree.steps if not self.links[step.link].rigid))

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Names of the coordinates; a slip has its own name, because it is not a deflection."""
        return tuple(
            f"{link.name}_slip" if link.drag else link.name for link in map(self.links.__getitem__, self.springs)
        )

    @cached_property
    def slips(self) -> tuple[int, ...]:
        """Numbers of the coordinates that are slips, i.e. of drags between inertias that no other link connects."""
        return tuple(place for place, link in enumerate(self.springs) if self.links[link].drag)

    @cached_property
    def contacts(self) -> tuple[tuple[int, ContactForm], ...]:
        """The contacts of all links, each with the number of its link."""
        return tuple((number, contact) for number, link in enumerate(self.links) for contact in link.parts)

    @cached_property
    def loads(self) -> tuple[LoadPart, ...]:
        """The loads of the equations: terms of the excitation, reactions to them, and displacements of linear links."""
        found = []
        for number, torque in enumerate(self.torques):
            load = torque.harmonic
            if torque.acts_on or load.varies:
                found.append(LoadPart(load, number))
            if self.reaction is not None and torque.acts_on and 0 in load.orders:
                mean: Any = MeanOf(load.kind)
                form = LoadForm(f"{load.name}_reaction", load.order, mean, load.constants)
                found.append(LoadPart(form, number, reacts=True))
            alone = not load.varies and len(torque.displaces) == 1
            for link, factor in torque.displaces:
                name = load.name if alone else f"{load.name}_{self.links[link].name}"
                kind: Any = Displacing(load.kind)
                found.append(LoadPart(LoadForm(name, load.order, kind, load.constants), number, link, factor))
        return tuple(found)

    @property
    def acting(self) -> tuple[LoadPart, ...]:
        """Those of the loads that act on inertias."""
        return tuple(part for part in self.loads if part.link < 0 and not part.form.varies)

    @cached_property
    def loaded(self) -> tuple[int, ...]:
        """The inertias whose mean torques are parameters."""
        return tuple(number for number in range(len(self.inertias)) if number != self.reaction)

    @cached_property
    def names(self) -> ParameterNames:
        """The names of all numbers."""
        names = ["frequency", *(f"{name}.inertia" for name in self.inertias)]
        names += [f"mean.{self.inertias[number]}" for number in self.loaded]
        for link in self.links:
            names += [f"{link.name}.{what}" for what in link.own_numbers]
            names += [name for contact in link.parts for name in contact.parameters]
        for torque in self.torques:
            names += [*torque.harmonic.parameters, *self._shape_names(torque)]
        return ParameterNames(tuple(map(NameBlock, names)))

    def _shape_names(self, torque: TorqueForm) -> list[str]:
        return [f"{torque.harmonic.shape}.{self.inertias[number]}" for number in torque.acts_on]

    @cached_property
    def places(self) -> dict[str, tuple[list[int], list[int]]]:
        """The links that have a number ``"ratio"``, ``"stiffness"`` or ``"damping"`` of their own, and its places."""
        found: dict[str, tuple[list[int], list[int]]] = {"ratio": ([], []), "stiffness": ([], []), "damping": ([], [])}
        for number, link in enumerate(self.links):
            for what in link.own_numbers:
                found[what][0].append(number)
                found[what][1].append(self.names.start(f"{link.name}.{what}"))
        return found

    def numbers(self, names: Sequence[str], values: NDArray[Any]) -> NDArray[Any]:
        """Return the numbers of some names, which follow one another."""
        first = self.names.start(names[0]) if names else 0
        return values[first : first + len(names)]

    def shape(self, values: NDArray[Any], torque: TorqueForm) -> NDArray[Any]:
        """Return the distribution of a term of the excitation over the inertias, shape (inertias,)."""
        shape = np.zeros(len(self.inertias), dtype=values.dtype)
        shape[list(torque.acts_on)] = self.numbers(self._shape_names(torque), values)
        return shape

"""Equations of motion of a train from the numbers of its parts, without the rotation of the train as a whole.

The coordinates ``x`` are the deflections of the springs along a tree of links. With the angles ``theta`` of the
inertias, ``theta = T x + r psi``: `r` holds the speeds at which a free train turns as a whole, and the columns of `T`
have no angular momentum, ``r^T J T = 0``. So ``psi`` drops out, exactly, whatever the loads, and what is left is

    T^T J T x'' + L^T C L x' + L^T K L x + sum_k e_k f_k = T^T (torques)

with the deflections ``L x`` of all links. An inertia whose motion is prescribed is taken for the ground, and displaces
the links that end at it. A train that the ground holds has no ``r``. Padmanabhan and Singh (1995),
equations 1 to 18, do the same for three inertias, and divide by the masses.

Where a drag alone joins two groups of inertias (a fluid coupling), the angle ``x_s`` between them is in no equation,
only its rate is, and with a mean torque it grows for ever. So the coordinate is a leaky integral ``y`` of the rate,

    x_s' = y' + g y

That changes no motion: a steady slip is the constant ``g y``, and one multiplier is ``exp(-g T)`` where that of the
angle would be 1. With ``G = diag(g)``, zero for deflections, the equations become

    M x'' + (C + M G) x' + (K + C G) x + ...

for ``x_s`` has no stiffness and deflects no contact. The leak g is twice the rate at which the drag by itself ends the
slip: it follows from inertias and damping alone, and the equations of two inertias keep two different multipliers.

Method: docs/numerics/drive-trains.md
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from gapwalk.model.contact import ContactForm
from gapwalk.model.drivetrain.train_parts import Displacing, MeanOf
from gapwalk.model.laws import Expression
from gapwalk.model.loads import Line, LoadForm
from gapwalk.model.registry import NameBlock, ParameterNames
from gapwalk.model.structure import Structure
from gapwalk.model.system import System
from gapwalk.model.units import Units

if TYPE_CHECKING:
    from scipy.sparse import csr_array


# A train without its numbers: its parts, how they are connected, and the place of each of its numbers.
#
# The parts are connected by a tree of links that reaches all of them, and by links that close loops.


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


CONSISTENT = 1e-9  # relative error of the ratios around a loop
_LONG = 100  # links above which products of sparse matrices are cheaper: below, each costs more than all of its sums

Matrix: TypeAlias = "csr_array | NDArray[Any]"
"""A matrix: sparse for a long train."""


@dataclass(frozen=True)
class TrainAssembly:
    """Assembly of the equations of motion from the numbers of a train of this form."""

    form: TrainForm  #: The train without its numbers.
    units: Units | None = None  #: Units of its numbers; None for plain numbers, which are in consistent units already.

    @property
    def names(self) -> ParameterNames:
        """The names of all numbers of its parts."""
        return self._names

    @cached_property
    def _names(self) -> ParameterNames:
        names = self.form.names
        if self.units is None or self.units.pace == names[0]:
            return names
        return ParameterNames((NameBlock(self.units.pace), *names.blocks[1:]))

    def numbers(self, values: NDArray[Any]) -> TrainNumbers:
        """Return the train with its numbers, converted to consistent units."""
        return TrainNumbers(self.form, values if self.units is None else values * self._factors)

    @cached_property
    def _factors(self) -> NDArray[np.float64]:
        return np.ones(1) if self.units is None else self.units.factors(self.names)

    def expand(self, values: NDArray[Any]) -> NDArray[Any]:
        """Return the values of the equations of motion, in symmetric form."""
        numbers = self.numbers(values)
        form, turned, deflections = self.form, numbers.angles, numbers.deflections
        mass = turned.T @ (numbers.inertia[:, None] * turned)
        damping, stiffness = (
            deflections.T @ (each[:, None] * deflections) for each in (numbers.damping, numbers.stiffness)
        )
        if form.slips:
            damping, stiffness = damping + mass * numbers.leaks, stiffness + damping * numbers.leaks
        mean, *torques = numbers.torques
        parts, acting = [numbers.values[:1], mass.ravel(), damping.ravel(), stiffness.ravel()], iter(torques)
        parts.append(turned.T @ mean)
        for load, number, link, factor, _ in form.loads:
            parts.append(form.numbers(form.torques[number].harmonic.parameters, numbers.values))
            if link >= 0:
                parts += [numbers.stiffness[[link]], numbers.damping[[link]], -factor * deflections[link]]
            elif not load.varies:
                parts.append(turned.T @ next(acting))
        for number, contact in form.contacts:
            parts += [deflections[number], form.numbers(contact.parameters, numbers.values)]
        return np.concatenate(parts)

    def accelerations(self, values: NDArray[Any]) -> NDArray[Any]:
        """Return the columns of stiffness, damping, contacts, mean load and excitation, divided by the masses.

        ``T^T J T`` is the inverse of ``W B^-1 W^T``, with the deflections ``W`` of the coordinates by the bodies that
        rigid gears make of the inertias, and the inertias ``B`` of those. So nothing is solved, and zeros stay zeros.
        """
        numbers = self.numbers(values)
        bodies, flexed, inverse = numbers.flexed
        stiffness, damping = (
            inverse @ (each[:, None] * numbers.deflections) for each in (numbers.stiffness, numbers.damping)
        )
        if self.form.slips:
            stiffness, damping = stiffness + damping * numbers.leaks, damping + np.diag(numbers.leaks)
        by_links = _filled(inverse)
        contacts = by_links[:, [number for number, _ in self.form.contacts]]
        torques = flexed @ (bodies.T @ np.stack(numbers.torques, axis=1))
        columns, driving = [torques[:, 0]], iter(torques.T[1:])
        for load, _, link, factor, _ in self.form.loads:
            if link >= 0:
                columns.append(-factor * by_links[:, link])
            elif not load.varies:
                columns.append(next(driving))
        return np.concatenate((stiffness, damping, contacts, np.stack(columns, axis=1)), axis=1)

    def problems(self, values: NDArray[np.float64]) -> Iterator[str]:
        """List the errors of the numbers, one sentence each."""
        for name, value in zip(self.names, values.tolist(), strict=True):
            what = name.rsplit(".", 1)[-1]
            if what == "inertia" and not value > 0:
                yield f"{name} is {value:g}; it must be > 0: leave a part without inertia out, and join its neighbours"
            elif what == "ratio" and value == 0:
                yield f"{name} is 0; it must be the speed of the first inertia over that of the second"
            elif what.endswith("damping") and not value >= 0:
                yield f"{name} is {value:g}; it must be >= 0"
        numbers = TrainNumbers(self.form, values)
        for link, value in zip(self.form.links, numbers.stiffness.tolist(), strict=True):
            if link.always and not value > 0:
                yield f"{link.name}.stiffness is {value:g}; it must be > 0"
        for link in (self.form.springs[place] for place in self.form.slips):
            if numbers.damping[link] == 0.0:
                yield (
                    f"{self.form.links[link].name}.damping is 0; it must be > 0, for nothing else joins its two "
                    "inertias: compute what is on either side of it as a train of its own"
                )

    def loop_problems(self, values: NDArray[np.float64]) -> Iterator[str]:
        """List the errors of closed loops, once only: the ratios on them are not parameters."""
        form, numbers = self.form, TrainNumbers(self.form, values)
        ratios, speeds, body = numbers.ratios, numbers.speeds, numbers.bodies[0]
        for number in form.tree.chords:
            link, (first, second) = form.links[number], form.links[number].ends
            if number not in form.tree.looped:
                continue
            slips = link.drag or link.loose
            wanted = speeds[first] / speeds[second]
            if abs(ratios[number] / wanted - 1.0) > CONSISTENT and not slips:
                here = f"its ratio is {ratios[number]:.10g}" if link.geared else "as a shaft it has the ratio 1"
                yield (
                    f"{link.name} closes a loop, and {here}, but by the other way round it is {wanted:.10g}: the train "
                    "is locked; correct one of the ratios on the loop"
                )
            elif link.loose and numbers.deflections[number][list(form.slips)].any():
                across = next(form.links[form.springs[place]].name for place in form.slips)
                yield (
                    f"{link.name} acts across {across}, which slips: the equations have no such friction or formula "
                    "yet. A linear drag may act there: write it as a [[shaft]] with damping = ... alone"
                )
            elif not link.rigid and body[first] == body[second]:
                yield f"{link.name} never deflects, for rigid gears hold its two inertias together; leave it out"


@dataclass(frozen=True, eq=False)
class TrainNumbers:
    """A train with its numbers, real or complex, and the vectors and matrices that follow from them."""

    form: TrainForm  #: The train without its numbers.
    values: NDArray[Any]  #: The numbers in the order of `TrainForm.names`, in consistent units.

    @cached_property
    def inertia(self) -> NDArray[Any]:
        """The inertias, shape (inertias,)."""
        return self.values[1 : 1 + len(self.form.inertias)]

    @cached_property
    def ratios(self) -> NDArray[Any]:
        """The ratios of all links, shape (links,); that of a shaft is 1."""
        return self._of_links("ratio", [1.0 if link.fixed is None else link.fixed for link in self.form.links])

    @cached_property
    def stiffness(self) -> NDArray[Any]:
        """The stiffnesses of the springs that act always, shape (links,)."""
        return self._of_links("stiffness", [0.0] * len(self.form.links))

    @cached_property
    def damping(self) -> NDArray[Any]:
        """The coefficients of the dampers that act always, shape (links,)."""
        return self._of_links("damping", [0.0] * len(self.form.links))

    def _of_links(self, what: str, otherwise: list[float]) -> NDArray[Any]:
        which, places = self.form.places[what]
        numbers = np.array(otherwise, dtype=self.values.dtype)
        numbers[which] = self.values[places]
        return numbers

    @cached_property
    def _steps(self) -> list[tuple[Step, Any]]:
        """The steps through the tree, each with the angle of its child by that of its parent while nothing deflects."""
        found = []
        for step in self.form.tree.steps:
            forward, ratio = self.form.links[step.link].ends[0] == step.parent, self.ratios[step.link]
            found.append((step, 1 / ratio if forward else ratio))
        return found

    @cached_property
    def speeds(self) -> NDArray[Any]:
        """The speeds at which the inertias turn together, the first at 1, shape (inertias,).

        Of a train that is connected to the ground, those at which it would turn without that connection.
        """
        found = np.ones(len(self.form.inertias) + 1, dtype=self.ratios.dtype)
        for step, factor in self._steps:
            if step.parent != self.form.ground:
                found[step.child] = found[step.parent] * factor
        return found[:-1]

    @cached_property
    def _turned(self) -> NDArray[Any]:
        """The angles of the inertias, and of the ground, by the coordinates while the root of the tree is at rest."""
        columns = {link: column for column, link in enumerate(self.form.springs)}
        found = np.zeros((len(self.form.inertias) + 1, len(columns)), dtype=self.ratios.dtype)
        for step, factor in self._steps:
            angle = found[step.child]
            np.multiply(found[step.parent], factor, out=angle)
            if step.link in columns:
                forward = self.form.links[step.link].ends[0] == step.parent
                angle[columns[step.link]] += -factor if forward else 1.0
        return found

    @cached_property
    def angles(self) -> NDArray[Any]:
        """The matrix T: angles of the inertias by the coordinates, without momentum, shape (inertias, n)."""
        turned = self._turned[:-1]
        if not self.form.is_free:
            return turned
        momentum = (self.inertia * self.speeds) @ turned
        return turned - np.outer(self.speeds, momentum / np.sum(self.inertia * self.speeds * self.speeds))

    @cached_property
    def deflections(self) -> NDArray[Any]:
        """The deflections of the links by the coordinates, shape (links, n)."""
        form = self.form
        found = np.zeros((len(form.links), len(form.springs)), dtype=self.ratios.dtype)
        found[list(form.springs), range(len(form.springs))] = 1.0
        for chord in form.tree.chords:
            if not form.links[chord].rigid:
                first, second = form.links[chord].ends
                found[chord] = self._turned[first] - self.ratios[chord] * self._turned[second]
        return found

    @cached_property
    def bodies(self) -> tuple[NDArray[np.intp], NDArray[Any], int]:
        """The body of each inertia, its angle by that of the body, and the number of bodies.

        Rigid gears make one body of several inertias.
        """
        count = len(self.form.inertias)
        body, turn = np.zeros(count + 1, dtype=np.intp), np.ones(count + 1, dtype=self.ratios.dtype)
        known = 1 if self.form.is_free else 0
        for step, factor in self._steps:
            if self.form.links[step.link].rigid:
                body[step.child], turn[step.child] = body[step.parent], turn[step.parent] * factor
            else:
                body[step.child], known = known, known + 1
        return body[:count], turn[:count], known

    @cached_property
    def flexed(self) -> tuple[Matrix, Matrix, Matrix]:
        """Angles of the inertias by those of the bodies, of shape (inertias, bodies), and what follows from them.

        That is deflections of the coordinates by the bodies over their inertias, and accelerations by forces of links.
        """
        form, (body, turn, known) = self.form, self.bodies
        count, links = len(body), len(form.links)
        turned = self._matrix(turn, np.arange(count), body, (count, known))
        # deflections of the links by the angles of the inertias, then of the bodies
        ends = form.ends
        weights, moving = np.concatenate((np.ones(links), -self.ratios)), ends != form.ground
        places = np.tile(np.arange(links), 2)[moving]
        pulls = self._matrix(weights[moving], places, ends[moving], (links, count)) @ turned
        each = np.arange(known)
        inverse = self._matrix(1.0 / ((turned * turned).T @ self.inertia), each, each, (known, known))
        flexed = pulls[list(form.springs)] @ inverse
        return turned, flexed, flexed @ pulls.T

    def _matrix(
        self, entries: NDArray[Any], rows: NDArray[np.intp], columns: NDArray[np.intp], shape: tuple[int, int]
    ) -> Matrix:
        """Return the matrix of these entries."""
        if len(self.form.links) > _LONG:
            from scipy.sparse import csr_array  # imported late, because the import is slow

            return csr_array((entries, (rows, columns)), shape=shape)
        found = np.zeros(shape, dtype=entries.dtype)
        found[rows, columns] = entries
        return found

    @cached_property
    def leaks(self) -> NDArray[Any]:
        """The leaks g of the coordinates, shape (n,): 0 for deflections."""
        form, found = self.form, np.zeros(len(self.form.springs), dtype=self.values.dtype)
        if form.slips:
            inverse = _filled(self.flexed[2])
            for place in form.slips:
                column = self.deflections[:, place]
                drag = column @ (self.damping * column)  # with that of other drags in parallel
                found[place] = 2.0 * inverse[place, form.springs[place]] * drag
        return found

    @cached_property
    def torques(self) -> list[NDArray[Any]]:
        """The mean torques, and each load that acts on inertias at the size 1, each shape (inertias,)."""
        form, mean = self.form, np.zeros(len(self.form.inertias), dtype=self.values.dtype)
        mean[list(form.loaded)] = self.values[1 + len(form.inertias) :][: len(form.loaded)]
        if form.reaction is not None:
            mean += self._reaction(mean)
        found = [mean]
        for part in form.acting:
            shape = form.shape(self.values, form.torques[part.torque])
            found.append(self._reaction(shape) if part.reacts else shape)
        return found

    def _reaction(self, torques: NDArray[Any]) -> NDArray[Any]:
        """Return the torque of the reaction that balances some torques, shape (inertias,)."""
        place, found = self.form.reaction, np.zeros_like(torques)
        found[place] = -(self.speeds @ torques) / self.speeds[place]
        return found

    @cached_property
    def turning(self) -> NDArray[Any]:
        """The accelerations of the inertias by their torques as a free train turns as a whole.

        Shape (inertias, 1 + loads on inertias): by the mean torques, then by each load at the size 1. Together
        with `angles`, which have no momentum, they are all of the motion: the angles are ``T x + r psi``, and
        ``r^T J r psi'' = r^T (torques)``. Zeros if the train is connected to the ground.
        """
        if not self.form.is_free:
            return np.zeros((len(self.form.inertias), len(self.torques)), dtype=self.values.dtype)
        moved = self.speeds @ np.stack(self.torques, axis=1)
        return np.outer(self.speeds, moved) / np.sum(self.inertia * self.speeds * self.speeds)

    @property
    def sizes(self) -> list[tuple[Line, ...]]:
        """The lines of each of the `torques`, of which the first, the mean, is constant."""
        form, values = self.form, self.values
        return [(Line(0, 1.0, 0.0),)] + [
            part.form.lines(values[0], form.numbers(form.torques[part.torque].harmonic.parameters, values))
            for part in form.acting
        ]

    @property
    def unbalanced(self) -> float:
        """The constant torque that nothing balances, in terms of the first inertia; 0 with a reaction."""
        if self.form.reaction is not None:  # it leaves rounding errors at most
            return 0.0
        sizes = [sum(line.cosine for line in lines if not line.order) for lines in self.sizes]
        return float(self.speeds @ np.stack(self.torques, axis=1) @ sizes / self.speeds[0])


def _filled(matrix: Matrix) -> NDArray[Any]:
    return matrix if isinstance(matrix, np.ndarray) else matrix.toarray()


def of_angles(
    system: System, stiffness: NDArray[np.float64], damping: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return stiffness and damping matrices with the angles of slips as coordinates, from those by the slips."""
    assembly = system.structure.assembly
    if not isinstance(assembly, TrainAssembly) or not assembly.form.slips:
        return stiffness, damping
    stiffness = stiffness.copy()
    stiffness[:, assembly.form.slips] = 0.0  # no spring acts on the angle of a slip, nor any contact
    return stiffness, damping - system.matrix("mass") * assembly.numbers(system.values).leaks


def structure_of(assembly: TrainAssembly) -> Structure:
    """Make the structure of the system of a train."""
    form = assembly.form
    contacts = tuple(contact for _, contact in form.contacts)
    return Structure(form.coordinates, contacts, tuple(load.form for load in form.loads), assembly)

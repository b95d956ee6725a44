"""Equations of motion of a train from the numbers of its parts, without the rotation of the train as a whole.

With the deflections ``x`` of springs that do not depend on each other, the angles of the inertias are
``theta = T x + r psi``; `r` holds the speeds at which a free train turns as a whole, and the columns of `T` have no
angular momentum. So ``psi`` drops out, exactly. With the deflections ``L x`` of all links,

    T^T J T x'' + L^T C L x' + L^T K L x + sum_k e_k f_k = T^T (torques)

An inertia whose motion is prescribed is taken for the ground. The slip of a drag that alone joins two groups of parts
is a leaky integral y, ``x_s' = y' + g y``, which changes no motion; with ``G = diag(g)``, zero for deflections,

    M x'' + (C + M G) x' + (K + C G) x + ...

The leak g is twice the rate at which the drag by itself ends the slip. Where drags act on absolute rates, psi is one
more coordinate, the *turn*, in units of `TURN_UNIT` angles; a torque ``-k psi`` on the reaction keeps its mean rate 0.

Bodies without inertia have equations of first order: with the deflections w of the coordinates as such a body turns by
itself as columns of W, ``x = y + g W (W^T W)^-1 W^T y'``.

Method: docs/numerics/notes/models.md
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.bracketed_root import find_root
from gapwalk.model.contact import ContactForm
from gapwalk.model.drivetrain.train_parts import LEAK, NOT_NEGATIVE, Displacing, MeanOf, speed_number
from gapwalk.model.drivetrain.train_rows import LinkForm, ways_of
from gapwalk.model.laws import Expression
from gapwalk.model.laws.formula import GROUP_SCALE, MEAN_SLIP, MEAN_SPEED, NUMPY_FUNCTIONS, PACE, is_computed
from gapwalk.model.loads import Line, LoadForm
from gapwalk.model.loads.load import FactorOverSpeed
from gapwalk.model.registry import NameBlock, ParameterNames
from gapwalk.model.structure import Structure
from gapwalk.model.units import Units

# A train without its numbers: its parts, how they are connected, and the place of each of its numbers.


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


@dataclass(frozen=True)
class TrainForm:
    """The parts of a train without their numbers."""

    inertias: tuple[str, ...]  #: Their names.
    links: tuple[LinkForm, ...]  #: Shafts, then gears.
    torques: tuple[TorqueForm, ...] = ()  #: The excitation.
    #: Index of the inertia on which the torque acts that balances the constant torques; None if there is none.
    reaction: int | None = None
    #: Mean speed of the reference inertia over the frequency W, in consistent units; 0 if the train does not turn.
    pace: float = 0.0
    angle: float = 1.0  #: The unit of angles in rad.
    #: Index of the reference inertia; None if its motion is prescribed.
    reference: int | None = None
    #: Mean speeds, over that of the reference, of the inertias at which a train with a prescribed motion begins.
    starts: tuple[tuple[int, float], ...] = ()
    groups: tuple[str, ...] = ()  #: The groups of drags: the number of each multiplies them.
    over_speed: tuple[tuple[str, FactorOverSpeed], ...] = ()  #: The numbers that depend on the speed.
    massless: tuple[int, ...] = ()  #: The inertias of bodies without inertia: see `gapwalk.model.states`.
    lag: float = 0.0  #: The lag of the coordinates that carry them, in consistent units.
    #: True if the mean speed is kept by what `TrainNumbers.hold` does; in a run-up it is prescribed.
    keeps_speed: bool = True
    basis: tuple[int, ...] = ()  #: The links whose deflections are independent, rigid ones first.
    root: int = 0  #: An inertia that turns with the train, or the ground if the links hold it.

    def _check_read(self) -> None:
        """Raise a ValueError if its parts are inconsistent."""
        ends = [end for link in self.links for end in link.ends]
        inertias = [number for torque in self.torques for number in torque.acts_on]
        if not all(0 <= end <= self.ground for end in ends):
            raise ValueError("a link of the train has an end that is not a part")
        if not all(0 <= number < self.ground for number in (*inertias, self.reaction or 0)):
            raise ValueError("a torque acts on no inertia")
        if not all(0 <= link < len(self.links) for torque in self.torques for link, _ in torque.displaces):
            raise ValueError("a displacement belongs to none of the links")
        own = {link for link in self.basis if 0 <= link < len(self.links)}
        if len(own) != len(self.basis) or len(own) + self.is_free != self.ground or not 0 <= self.root <= self.ground:
            raise ValueError("the links of the train do not give the angles of its parts")

    @property
    def ground(self) -> int:
        """The number of the ground."""
        return len(self.inertias)

    @cached_property
    def branched(self) -> bool:
        """True if some link has more than two ends."""
        return any(link.row for link in self.links)

    @cached_property
    def chords(self) -> list[int]:
        """The links whose deflections follow from those of others."""
        return [number for number in range(len(self.links)) if number not in self.basis]

    @property
    def slow(self) -> tuple[str, ...]:
        """The names of the inertias of bodies without inertia."""
        return tuple(self.inertias[number] for number in self.massless)

    @property
    def is_free(self) -> bool:
        """True if the train can rotate as a whole."""
        return self.root != self.ground

    @property
    def held(self) -> list[int]:
        """The inertia of each connected part of the train at which it is joined to the ground; empty if it is free."""
        ends = [self.links[link].ends for link in sorted(self.basis) if not self.branched]
        return [end for pair in ends if self.ground in pair for end in pair if end != self.ground]

    @cached_property
    def springs(self) -> tuple[int, ...]:
        """The links whose deflections are the coordinates, in the order of the links."""
        return tuple(sorted(link for link in self.basis if not self.links[link].rigid))

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Names of the coordinates; a slip has its own name, because it is not a deflection, and so has the turn."""
        names = [
            f"{link.name}_slip" if link.slides else link.name for link in map(self.links.__getitem__, self.springs)
        ]
        return (*names, TURN) if self.has_turn else tuple(names)

    @cached_property
    def turning(self) -> tuple[int, ...]:
        """The links that slip on as the train turns."""
        return tuple(number for number, link in enumerate(self.links) if link.turns)

    @cached_property
    def has_turn(self) -> bool:
        """True if the last coordinate is the rotation of a free train as a whole, on which drags act."""
        acts = (self.links[each] for each in self.turning)
        acts_on_it = any(link.parts or set(link.own_numbers) & {"damping", "linear"} for link in acts)
        return self.is_free and (acts_on_it or any(link.speeds for link in self.links))

    @cached_property
    def adrift(self) -> tuple[int, ...]:
        """Numbers of the coordinates that no spring holds: slips, and the turn."""
        return (*self.slips, len(self.springs)) if self.has_turn else self.slips

    @cached_property
    def slips(self) -> tuple[int, ...]:
        """Numbers of the coordinates that are slips, i.e. of drags between inertias that no other link connects."""
        return tuple(place for place, link in enumerate(self.springs) if self.links[link].slides)

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
        names += [f"{group}.{OF_GROUPS}" for group in self.groups]
        for link in self.links:
            names += [f"{link.name}.{what}" for what in link.own_numbers]
            names += [name for contact in link.parts for name in contact.parameters if not is_computed(name)]
        for torque in self.torques:
            names += [*torque.harmonic.parameters, *self._shape_names(torque)]
        return ParameterNames(tuple(map(NameBlock, names)))

    def _shape_names(self, torque: TorqueForm) -> list[str]:
        return [f"{torque.harmonic.shape}.{self.inertias[number]}" for number in torque.acts_on]

    @cached_property
    def places(self) -> dict[str, tuple[list[int], list[int]]]:
        """The links that have a number ``"ratio"``, ``"stiffness"``, ... of their own, and its places."""
        found: dict[str, tuple[list[int], list[int]]] = {each: ([], []) for each in _OF_LINKS}
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
TURN = "turn"
"""The name of the coordinate that is the rotation of a free train as a whole, beside its mean."""
TURN_UNIT = 1000.0
"""The angle of the first inertia, in that of the train, at the turn 1."""
OF_GROUPS = "drag"
"""The last part of the name of the number that multiplies a group of drags."""
_OF_LINKS = ("ratio", "stiffness", "damping", "linear", "constant")
_LEAK = 0.2  # of the frequency
_HELD = 2.0 / 9.0  # of the squared rate of decay: then the turn returns at 1/3 and 2/3 of that rate
_HELD_MOST = 3e-4  # of W: so far below it the torque that holds the turn is constant over a period
_HELD_ALONE = 1e-5  # of W, where no drag is known to end the turn
_MOVED = 1e-9  # deflection of a link by a body without inertia from which that moves it
_STILL = 1e-12  # speed over that of the root, of an inertia at rest


_latest: list[tuple[Any, Any, Any]] = [
    (None, None, None)
]  # the last train with its numbers, after what they follow from


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

    @property
    def is_paced(self) -> bool:
        """True if drags or formulas depend on the mean speed."""
        return bool(self.form.turning or self.form.over_speed) or any(
            is_computed(name) for _, contact in self.form.contacts for name in contact.parameters
        )

    def balanced_at(self, values: NDArray[np.float64]) -> float | None:
        """Return the value of the first parameter at which a train without a reaction turns steadily; None if none."""

        def excess(factor: float) -> float:
            return self.numbers(np.array([values[0] * factor, *values[1:]])).unbalanced

        factors = np.geomspace(1e-3, 1e3, 121).tolist()
        signs = [excess(factor) > 0.0 for factor in factors]
        for low, high, before, after in zip(factors, factors[1:], signs, signs[1:], strict=False):
            if before != after:
                return float(values[0] * find_root(excess, low, high).place)
        return None

    def numbers(self, values: NDArray[Any]) -> TrainNumbers:
        """Return the train with its numbers, converted to consistent units."""
        # one set of coefficients asks for the same numbers three times
        known, content, found = _latest[0]
        key = values.dtype.char, values.tobytes()
        if known is self and content == key:
            return found
        values = values.copy() if self.units is None else values * self._factors
        for name, factor in self.form.over_speed:
            values[self.form.names.place(name)] *= factor.value(values[0])
        found = TrainNumbers(self.form, values)
        _latest[0] = self, key, found
        return found

    @cached_property
    def _factors(self) -> NDArray[np.float64]:
        return np.ones(1) if self.units is None else self.units.factors(self.names)

    def lagging(self, values: NDArray[Any]) -> NDArray[Any] | None:
        """Return the matrix G of the lag of bodies without inertia, shape (n, n); None if there are none."""
        if not self.form.massless:
            return None
        nodes = self.numbers(values).nodes[1]
        return self.form.lag * nodes @ np.linalg.solve(nodes.T @ nodes, nodes.T)

    def expand(self, values: NDArray[Any]) -> NDArray[Any]:
        """Return the values of the equations of motion, in symmetric form."""
        numbers, lagging = self.numbers(values), self.lagging(values)
        form, turned, deflections = self.form, numbers.angles, numbers.deflections
        mass = turned.T @ (numbers.inertia[:, None] * turned)
        if form.has_turn and not form.slips:
            mass[-1, :-1] = mass[:-1, -1] = 0.0
        stiffness, damping = numbers.matrices(deflections.T, mass, turned.T)
        if lagging is not None:
            mass, damping = mass + damping @ lagging, damping + stiffness @ lagging
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
            parts += [*numbers.vectors(number, contact), numbers.of_contact(number, contact)]
        return np.concatenate(parts)

    def accelerations(self, values: NDArray[Any]) -> NDArray[Any] | None:
        """Return the columns of stiffness, damping, contacts, mean load and excitation, divided by the masses.

        ``T^T J T`` is the inverse of ``W B^-1 W^T``, with the deflections ``W`` of the coordinates by the bodies that
        rigid gears make of the inertias, and the inertias ``B`` of those. So nothing is solved, and zeros stay zeros.
        """
        if self.form.massless:
            return None
        numbers = self.numbers(values)
        bodies, flexed, inverse = numbers.flexed
        stiffness, damping = numbers.matrices(inverse, np.eye(len(inverse)), flexed @ bodies.T)
        contacts = inverse[:, [number for number, _ in self.form.contacts]]
        torques = flexed @ (bodies.T @ np.stack(numbers.torques, axis=1))
        columns, driving = [torques[:, 0]], iter(torques.T[1:])
        for load, _, link, factor, _ in self.form.loads:
            if link >= 0:
                columns.append(-factor * inverse[:, link])
            elif not load.varies:
                columns.append(next(driving))
        return np.concatenate((stiffness, damping, contacts, np.stack(columns, axis=1)), axis=1)

    def problems(self, values: NDArray[np.float64]) -> Iterator[str]:
        """List the errors of the numbers, one sentence each."""
        for name, value in zip(self.names, values.tolist(), strict=True):
            what = name.rsplit(".", 1)[-1]
            if what == "inertia" and name.removesuffix(".inertia") in self.form.slow:
                if value:
                    yield f"{name} is {value:g}, but the train was made without it; make it again with that inertia"
            elif what == "inertia" and not value > 0:
                yield f"{name} is {value:g}; it must be > 0: leave a part without inertia out, and join its neighbours"
            elif what == "ratio" and value == 0:
                yield f"{name} is 0; it must be the speed of the first inertia over that of the second"
            elif (what.endswith("damping") or what in NOT_NEGATIVE) and not value >= 0:
                unit = f" {self.units.parameter(name)}" if self.units else ""
                yield f"{name} is {value:g}{unit}; it must be >= 0"
        numbers = TrainNumbers(self.form, values)
        for link, value in zip(self.form.links, numbers.stiffness.tolist(), strict=True):
            if link.always and not value > 0:
                yield f"{link.name}.stiffness is {value:g}; it must be > 0"
        if self.form.massless:
            yield from numbers.node_problems()
        for link in (self.form.springs[place] for place in self.form.slips):
            if numbers.damping[link] == 0.0 and self.form.links[link].drag:
                yield (
                    f"{self.form.links[link].name}.damping is 0; it must be > 0, for nothing else joins its two "
                    "inertias: compute what is on either side of it as a train of its own"
                )

    def loop_problems(self, values: NDArray[np.float64], looped: Collection[str]) -> Iterator[str]:
        """List the errors of closed loops, once only: the ratios on them are not parameters."""
        form, numbers = self.form, TrainNumbers(self.form, values)
        ratios, speeds = numbers.ratios, numbers.speeds
        across = [k for k in form.chords if form.links[k].dry and numbers.deflections[k][list(form.slips)].any()]
        for number in across:
            coupling = next(form.links[form.springs[place]].name for place in form.slips)
            yield (
                f"{form.links[number].name} acts across {coupling}, which slips; such friction cannot be "
                'computed. A drag may act there: write a [[force]] with law = "t*tanh(v/a)"'
            )
        for number in form.chords:
            link, (first, second) = form.links[number], form.links[number].ends
            if number in across or not (form.branched or link.name in looped):
                continue
            slips = link.drag or link.loose or form.branched  # there exact fractions have told whether it can turn
            wanted = 1.0 if slips else speeds[first] / speeds[second]
            if abs(ratios[number] / wanted - 1.0) > CONSISTENT and not slips:
                here = f"its ratio is {ratios[number]:.10g}" if link.geared else "as a shaft it has the ratio 1"
                yield (
                    f"{link.name} closes a loop, and {here}, but by the other way round it is {wanted:.10g}: the train "
                    "is locked; correct one of the ratios on the loop"
                )
            elif not link.rigid and numbers.never_deflects(number):
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
        return self._of_links("stiffness")

    @cached_property
    def damping(self) -> NDArray[Any]:
        """The coefficients of the dampers that act always, shape (links,)."""
        return self._of_links("damping") + self._of_links("linear") * self.scales

    @cached_property
    def scales(self) -> NDArray[Any]:
        """The factors of all links by the groups of drags to which they belong, shape (links,)."""
        found = np.ones(len(self.form.links), dtype=self.values.dtype)
        for number, link in enumerate(self.form.links):
            if link.group:
                found[number] = self.values[self.form.names.start(f"{link.group}.{OF_GROUPS}")]
        return found

    @cached_property
    def mean_speeds(self) -> NDArray[Any]:
        """The mean speeds of the inertias and of the ground, shape (inertias + 1,), in consistent units."""
        form = self.form
        scale = 1.0 if form.reference is None else self.speeds[form.reference]
        return np.append(self.speeds / scale, 0.0) * (self.values[0] * form.pace)

    @cached_property
    def mean_slips(self) -> NDArray[Any]:
        """The mean slips of all links, shape (links,): 0 but for those that slip on as the train turns."""
        form, speeds = self.form, self.mean_speeds
        found = np.zeros(len(form.links), dtype=speeds.dtype)
        for number in form.turning:
            link, (first, second) = form.links[number], form.links[number].ends
            other = speeds[second] if second != form.ground else link.rest * self.values[0] * form.pace
            found[number] = speeds[first] - self.ratios[number] * other
        return found

    @cached_property
    def steady_drags(self) -> NDArray[Any]:
        """The torques of drags at the mean speed that are no contacts, shape (links,): by damping, and constant."""
        ways = np.array([link.way for link in self.form.links])
        return self.damping * self.mean_slips + self._of_links("constant") * (self.scales * ways)

    @cached_property
    def drags(self) -> NDArray[Any]:
        """The torques of all links at their mean slips, shape (links,): 0 but for those that slip on."""
        found = self.steady_drags.copy()
        for number, contact in self.form.contacts:
            if number in self.form.turning:
                found[number] += self._at_rest(number, contact)
        return found

    def _at_rest(self, number: int, contact: ContactForm) -> Any:
        """Return the torque of a formula or of friction while the train turns steadily."""
        numbers = dict(
            zip((each.name for each in contact.law.parameters), self.of_contact(number, contact), strict=True)
        )
        if not isinstance(contact.law, Expression):
            return numbers.get("limit", 0.0) * self.form.links[number].way  # that by a normal force is not known yet
        formula = contact.law.formula
        still: dict[str, Any] = dict.fromkeys(formula.variables, 0.0) | numbers
        modes = formula.modes_at(still, NUMPY_FUNCTIONS)
        return formula.value(still, NUMPY_FUNCTIONS, modes)

    def of_contact(self, number: int, contact: ContactForm) -> NDArray[Any]:
        """Return the numbers of a contact, with those that follow from the mean speed of the train."""
        form, link = self.form, self.form.links[number]
        known = [name for name in contact.parameters if not is_computed(name)]
        given = dict(zip(known, form.numbers(known, self.values), strict=True))
        if link.turns and contact.law.is_dry and (name := f"{contact.name}.speed") in given:
            given[name] = given[name] - self.mean_slips[number]
        return np.array(
            [given[name] if name in given else self._computed(link, number, name) for name in contact.parameters],
            dtype=self.values.dtype,
        )

    def _computed(self, link: LinkForm, number: int, name: str) -> Any:
        """Return a number of a formula that follows from the speed of the train."""
        what = name.rpartition(".")[2]
        if what == GROUP_SCALE:
            return self.scales[number]
        if what == PACE:
            return self.values[0] * self.form.pace
        if what == MEAN_SLIP:
            return self.mean_slips[number]
        return self.mean_speeds[link.speeds[int(what.removeprefix(MEAN_SPEED))]]

    def vectors(self, number: int, contact: ContactForm) -> list[NDArray[Any]]:
        """Return the vectors of the deflections of a contact, and the one along which it acts if it is another one."""
        link, own, found = self.form.links[number], self.deflections[number], []
        for each in contact.law.arguments:
            place = speed_number(each)
            vector = own if place is None else self.angles[link.speeds[place]]
            found.append(vector * self.leaks if each.endswith(LEAK) else vector)
        return found if contact.reciprocal else [*found, own]

    def _of_links(self, what: str, otherwise: list[float] | None = None) -> NDArray[Any]:
        which, places = self.form.places[what]
        numbers = np.array(otherwise or [0.0] * len(self.form.links), dtype=self.values.dtype)
        numbers[which] = self.values[places]
        return numbers

    @cached_property
    def speeds(self) -> NDArray[Any]:
        """The speeds at which the inertias turn together, the first at 1, or those at which a held train begins."""
        form = self.form
        if form.is_free:
            return self._solved[:, -1]
        begin = np.ones(len(form.inertias), dtype=self.ratios.dtype)
        for child, speed in form.starts:
            begin[child] = speed
        held = [form.branched or form.ground in form.links[link].ends for link in form.basis]
        return self._solved @ np.where(held, self.rows[list(form.basis)] @ begin, 0.0)

    @property
    def referring(self) -> NDArray[np.float64]:
        """The speeds by which angles are referred to the first inertia: 1 for what stands still as the train turns."""
        found = np.real(self.speeds)
        return np.where(found == 0.0, 1.0, found)

    @cached_property
    def rows(self) -> NDArray[Any]:
        """The deflections of all links by the angles of the inertias, shape (links, inertias)."""
        form = self.form
        found = np.zeros((len(form.links), len(form.inertias) + 1), dtype=self.ratios.dtype)
        for number, link in enumerate(form.links):
            for end, weight in link.row or zip(link.ends, (1.0, -self.ratios[number]), strict=True):
                found[number, end] += weight
        return found[:, :-1]

    @cached_property
    def _solved(self) -> NDArray[Any]:
        """The angles of the inertias by the independent deflections, then by the angle of the root if it is free."""
        rows = self.rows[list(self.form.basis)]
        if self.form.is_free:
            rows = np.vstack((rows, np.eye(1, rows.shape[1], self.form.root)))
        found = np.linalg.inv(rows)
        return np.where(np.abs(np.real(found)) < _STILL, found - np.real(found), found)

    @cached_property
    def ways(self) -> NDArray[Any]:
        """The motions of the inertias that deflect no rigid link, shape (inertias, ways), as sparse as they are."""
        return ways_of(self.rows[[link for link in self.form.basis if self.form.links[link].rigid]])

    @property
    def _turned(self) -> NDArray[Any]:
        """The angles of the inertias by the coordinates while the root is at rest."""
        return self._solved[:, [self.form.basis.index(link) for link in self.form.springs]]

    @cached_property
    def angles(self) -> NDArray[Any]:
        """The matrix T: angles of the inertias by the coordinates, without momentum, shape (inertias, n)."""
        turned = self._turned
        if not self.form.is_free:
            return turned
        momentum = (self.inertia * self.speeds) @ turned
        found = turned - np.outer(self.speeds, momentum / self.whole)
        if not self.form.has_turn:
            return found
        slips = list(self.form.slips)
        found[:, slips] -= np.outer(self.speeds, self._shifts)
        return np.column_stack((found, TURN_UNIT * self.speeds))

    @cached_property
    def _shifts(self) -> NDArray[Any]:
        """The turn by each slip at which the reference stands still: its mean speed is W, whatever slips."""
        slips, place = list(self.form.slips), self.form.reference or 0
        turned = self._turned[:, slips]
        momentum = (self.inertia * self.speeds) @ turned
        return turned[place] / self.speeds[place] - momentum / self.whole

    @cached_property
    def whole(self) -> Any:
        """The inertia of a free train as a whole, in terms of its first one."""
        return np.sum(self.inertia * self.speeds * self.speeds)

    @cached_property
    def hold(self) -> Any:
        """The stiffness by which the turn is held at its mean."""
        decay = self.decay
        if not self.form.keeps_speed:
            return 0.0
        if not decay:
            return self.whole * (_HELD_ALONE * self.values[0]) ** 2
        square, most = _HELD * decay * decay, (_HELD_MOST * self.values[0]) ** 2
        return self.whole * (most if np.real(square) > np.real(most) else square)

    @cached_property
    def steadying(self) -> Any:
        """The damper of the turn beside that stiffness: 0 unless no drag is known to end it."""
        return 0.0 if self.decay or not self.form.keeps_speed else 2.0 * _HELD_ALONE * self.values[0] * self.whole

    @cached_property
    def decay(self) -> Any:
        """The rate at which drags that are linear or square end the turn, at the mean speed."""
        form, slopes = self.form, self.damping.copy()
        for number, contact in form.contacts:
            link, name = form.links[number], f"{form.links[number].name}.quadratic"
            if link.turns and link.own is not None and name in contact.parameters:
                square = self.values[form.names.start(name)] * self.scales[number]
                slope = 2.0 * link.way * square * self.mean_slips[number]
                slopes[number] = slopes[number] + slope * form.angle**2  # its formula squares the slip in rad/s
        own = list(form.turning)
        slips = self.deflections[own, -1] / TURN_UNIT
        return np.sum(slopes[own] * slips * slips) / self.whole

    @property
    def held_by(self) -> NDArray[Any]:
        """The torques on the inertias that hold the turn, by its stiffness: of the reaction, or on all as they turn."""
        if self.form.reaction is None:
            return self.inertia * self.speeds / self.whole
        found = np.zeros(len(self.form.inertias), dtype=self.values.dtype)
        found[self.form.reaction] = 1.0 / self.speeds[self.form.reaction]
        return found

    @cached_property
    def deflections(self) -> NDArray[Any]:
        """The deflections of the links by the coordinates, shape (links, n)."""
        form = self.form
        found = np.zeros((len(form.links), len(form.coordinates)), dtype=self.ratios.dtype)
        found[list(form.springs), range(len(form.springs))] = 1.0
        for chord in form.chords:
            if form.links[chord].turns or not form.links[chord].rigid:
                # no other link feels the rotation of the train as a whole
                angles = self.angles if form.links[chord].turns else self._turned
                found[chord, : angles.shape[1]] = self.rows[chord] @ angles
        return found

    def never_deflects(self, number: int) -> bool:
        """Return True if rigid links hold the ends of a link together."""
        row = self.rows[number]
        return bool(np.abs(row @ self.ways).max() < CONSISTENT * np.abs(row).max())

    @cached_property
    def nodes(self) -> tuple[list[str], NDArray[Any]]:
        """The name of an inertia of each body without inertia, and the columns W, shape (n, such bodies)."""
        form = self.form
        light = [way for way in self.ways.T if way[list(form.massless)].any()]
        nodes = np.zeros((len(form.coordinates), len(light)), dtype=self.ways.dtype)
        nodes[: len(form.springs)] = self.rows[list(form.springs)] @ np.array(light).T
        return [form.inertias[np.flatnonzero(way)[0]] for way in light], nodes

    def node_problems(self) -> Iterator[str]:
        """List what is wrong at bodies without inertia: what joins them must be linear, and have a damper."""
        form, (names_of_nodes, nodes) = self.form, self.nodes
        moved = np.abs(self.deflections @ nodes) > _MOVED
        for name, column in zip(names_of_nodes, moved.T, strict=True):
            ends = [form.links[number] for number in np.flatnonzero(column)]
            names, here = " and ".join(link.name for link in ends), f"{name}.inertia is 0"
            bent = [link.name for link in ends if link.parts or link.turns]
            alone = len(ends) == 1 and not np.any(np.array(self.torques)[:, form.inertias.index(name)])
            damped, springs = np.any(self.damping[column]), self.stiffness[column]
            if alone and not damped:
                yield f"{here}, and {names} alone holds it, so that no torque acts there: leave both out"
            elif bent and not alone:  # alone it has no torque, whatever its spring is
                yield (
                    f"{here}; it must be > 0 beside {bent[0]}, which is no linear spring or damper: only those may "
                    "join a part without inertia"
                )
            elif form.slips:
                yield (
                    f"{here}; it must be > 0 in a train with a drag that alone joins two parts of it: give it a small "
                    "inertia, or join its shafts in series"
                )
            elif not damped and len(springs) == 2 and not any(link.geared for link in ends):
                yield (
                    f"{here}, and {names} have no damping, so that it follows them at once: join them in series, as "
                    f"one shaft with stiffness = {float(np.prod(springs) / np.sum(springs)):.10g}"
                )
            elif not damped:
                yield (
                    f"{here}, and {names} have no damping, so that no equation gives its rate: give one of them a "
                    "damping, or the part an inertia"
                )

    @cached_property
    def flexed(self) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
        """Angles of inertias by ways, deflections by torques on ways, and accelerations by forces of links."""
        form, turned = self.form, self.ways
        pulls, mass = self.rows @ turned, turned.T @ (self.inertia[:, None] * turned)
        # without links of more than two ends each inertia belongs to one way
        inverse = np.linalg.inv(mass) if form.branched else np.diag(1.0 / mass.diagonal())
        flexed = pulls[list(form.springs)] @ inverse
        by_links = flexed @ pulls.T
        if form.has_turn:  # of the torques on ways, and of those of the links that slip on: no other turns the whole
            whole = inverse @ (turned.T @ (self.inertia * self.speeds)) / (self.whole * TURN_UNIT)
            slip, shifts = list(form.turning), self._shifts / TURN_UNIT
            row = np.zeros(len(form.links), dtype=whole.dtype)
            row[slip] = (pulls @ whole)[slip]
            for place, shift in zip(form.slips, shifts, strict=True):
                whole, row = whole + shift * flexed[place], row + shift * by_links[place]
            flexed, by_links = np.vstack((flexed, whole)), np.vstack((by_links, row))
        return turned, flexed, by_links

    def matrices(
        self, links: NDArray[Any], mass: NDArray[Any], inertias: NDArray[Any]
    ) -> tuple[NDArray[Any], NDArray[Any]]:
        """Return stiffness and damping of equations that weigh forces of links and torques on inertias so."""
        stiffness, damping = (links @ (each[:, None] * self.deflections) for each in (self.stiffness, self.damping))
        if self.form.slips:
            stiffness, damping = stiffness + damping * self.leaks, damping + mass * self.leaks
        if self.form.has_turn:
            held = inertias @ self.held_by
            stiffness[:, -1] += TURN_UNIT * self.hold * held
            damping[:, -1] += TURN_UNIT * self.steadying * held
        return stiffness, damping

    @cached_property
    def leaks(self) -> NDArray[Any]:
        """The leaks g of the coordinates, shape (n,): 0 for deflections."""
        form, found = self.form, np.zeros(len(self.form.coordinates), dtype=self.values.dtype)
        if form.slips:
            inverse = self.flexed[2]
            for place in form.slips:
                column = self.deflections[:, place]
                drag = column @ (self.damping * column)  # with that of other drags in parallel
                known = 2.0 * inverse[place, form.springs[place]] * drag
                found[place] = known if known else _LEAK * self.values[0]  # any leak: that of a formula is not known
        return found

    @cached_property
    def torques(self) -> list[NDArray[Any]]:
        """The mean torques, with those of drags, and each load on inertias at the size 1, each shape (inertias,)."""
        form, mean = self.form, np.zeros(len(self.form.inertias), dtype=self.values.dtype)
        mean[list(form.loaded)] = self.values[1 + len(form.inertias) :][: len(form.loaded)]
        balanced = mean
        if form.turning:
            mean, balanced = mean + self._dragged(self.steady_drags), mean + self._dragged(self.drags)
        if form.reaction is not None:
            mean = mean + self._reaction(balanced)
        found = [mean]
        for part in form.acting:
            shape = form.shape(self.values, form.torques[part.torque])
            found.append(self._reaction(shape) if part.reacts else shape)
        return found

    def _dragged(self, drags: NDArray[Any]) -> NDArray[Any]:
        """Return the torques on the inertias by those of the links that slip on, shape (inertias,)."""
        own = list(self.form.turning)
        return -drags[own] @ self.rows[own]

    def _reaction(self, torques: NDArray[Any]) -> NDArray[Any]:
        """Return the torque of the reaction that balances some torques, shape (inertias,)."""
        place, found = self.form.reaction, np.zeros_like(torques)
        found[place] = -(self.speeds @ torques) / self.speeds[place]
        return found

    @cached_property
    def turning(self) -> NDArray[Any]:
        """The accelerations of inertias by `torques` as a free train turns as a whole; zeros if that is a coordinate.

        Shape (inertias, 1 + loads on inertias): with ``T x + r psi``, ``r^T J r psi'' = r^T (torques)``.
        """
        if not self.form.is_free or self.form.has_turn:
            return np.zeros((len(self.form.inertias), len(self.torques)), dtype=self.values.dtype)
        moved = self.speeds @ np.stack(self.torques, axis=1)
        return np.outer(self.speeds, moved) / self.whole

    @property
    def sizes(self) -> list[tuple[Line, ...]]:
        """The lines of each of the `torques`, of which the first, the mean, is constant."""
        form, values = self.form, self.values
        return [(Line(0, 1.0, 0.0),)] + [
            part.form.lines(values[0], form.numbers(form.torques[part.torque].harmonic.parameters, values))
            for part in form.acting
        ]

    def driven(self, orders: Sequence[int]) -> NDArray[Any]:
        """Return the accelerations of `turning`: means, cosines and sines of orders, shape (inertias, 1 + 2 orders)."""
        lines = np.zeros((len(self.sizes), 1 + 2 * len(orders)), dtype=self.values.dtype)
        for row, given in zip(lines, self.sizes, strict=True):
            for order, cosine, sine in given:
                place = 1 + orders.index(order) if order else 0
                row[place] += cosine
                if order:
                    row[place + len(orders)] += sine
        return self.turning @ lines

    @property
    def unbalanced(self) -> float:
        """The constant torque that nothing balances, in terms of the first inertia; 0 with a reaction."""
        if self.form.reaction is not None:  # it leaves rounding errors at most
            return 0.0
        sizes = [sum(line.cosine for line in lines if not line.order) for lines in self.sizes]
        by_contacts = self._dragged(self.drags - self.steady_drags)
        return float(self.speeds @ (np.stack(self.torques, axis=1) @ sizes + by_contacts) / self.speeds[0])


def structure_of(assembly: TrainAssembly) -> Structure:
    """Make the structure of the system of a train."""
    form = assembly.form
    contacts = tuple(contact for _, contact in form.contacts)
    return Structure(form.coordinates, contacts, tuple(load.form for load in form.loads), assembly)


def steadied(system: Any, strobes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the last of some strobes (2 or more, state_size) with the turn where it ends if all else repeats."""
    assembly, n = system.structure.assembly, system.size
    if not isinstance(assembly, TrainAssembly) or not assembly.form.has_turn:
        return strobes[-1]
    numbers = assembly.numbers(system.values)
    decay, fast = numbers.decay + numbers.steadying / numbers.whole, numbers.hold / numbers.whole
    rates = np.roots([1.0, decay, fast])
    duration = 2.0 * np.pi / numbers.values[0]
    vectors = np.array([[1.0, 1.0], rates])
    across = np.real(vectors * np.exp(rates * duration) @ np.linalg.inv(vectors))
    turn = strobes[:, [n - 1, 2 * n - 1]]
    left = np.mean(turn[1:] - turn[:-1] @ across.T, axis=0)
    found = strobes[-1].copy()
    found[[n - 1, 2 * n - 1]] = np.linalg.solve(np.eye(2) - across, left)
    return found

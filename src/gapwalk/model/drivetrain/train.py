"""The drive train: inertias, shafts and gears with their torques, and the system that they make up."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from itertools import pairwise
from numbers import Real
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gapwalk.errors import ModelError
from gapwalk.model.drivetrain.train_assembly import TrainAssembly, structure_of
from gapwalk.model.drivetrain.train_form import LinkForm, TorqueForm, TrainForm, tree_of
from gapwalk.model.drivetrain.train_parts import GROUND, Change, Gear, Inertia, Link, Shaft
from gapwalk.model.loads import Load, LoadForm
from gapwalk.model.problems import did_you_mean
from gapwalk.model.structure import ContactForm
from gapwalk.model.system import System, checked
from gapwalk.model.units import Quantity, QuantityKind, Units, has_unit, kind_of, read_quantity, units_of

_RESERVED = ("frequency", "speed", "mass", "damping", "stiffness", "mean", "study", GROUND)


@dataclass(frozen=True)
class Train:
    """A drive train (or any chain or tree of bodies and springs), free or held by the ground.

    Parameters
    ----------
    inertias, shafts, gears
        Its parts; all of them are connected. Loops may be closed, as far as the ratios around them agree.
    mean
        Constant torques by inertia. Where they do not balance, a free train accelerates steadily as a whole.
    harmonics
        Periodic torques; ``acts_on`` names inertias.
    frequency
        The fundamental frequency W (angular), > 0; with a unit, in Hz, rpm or rad/s.
    reaction
        Name of the inertia on which the torque acts that balances the other mean torques of a free train;
        the mean torque of that one is then no parameter.
    speed
        In place of the frequency: the speed of a shaft, as ``"1500 rpm"``; orders of the excitation are then counted
        per turn of it. The parameter is called ``speed``.
    units
        The units of its numbers; None for plain numbers. It is found from the texts.

    Notes
    -----
    Where a drag alone joins two parts of the train (a fluid coupling, ``coupling`` say), they slip, and a mean torque
    makes the angle between them grow for ever. The equations do not depend on it, so it is no coordinate. In its place
    stands ``coupling_slip``, a leaky integral of the rate of slip; it is no angle that could be measured. The rate of
    slip is ``coupling.torque`` over ``coupling.damping``.

    Its quantities are all plain numbers in consistent units, or all texts with units, such as ``"0.14 kg m^2"``,
    ``"30 N m/deg"``, ``"3 deg"``, ``"120 N m"``; a 0 needs none. A train with units holds numbers in them, and `units`
    says which.

    Raises
    ------
    ModelError
        With everything that is wrong, one reason a line.
    """

    inertias: Sequence[Inertia]
    shafts: Sequence[Shaft] = ()
    gears: Sequence[Gear] = ()
    mean: Mapping[str, float] = field(default_factory=dict, hash=False)
    harmonics: Sequence[Load] = ()
    frequency: float = 1.0
    reaction: str | None = None
    speed: str | Quantity | None = None
    units: Units | None = None

    def __post_init__(self) -> None:
        for name in ("inertias", "shafts", "gears", "harmonics"):
            object.__setattr__(self, name, tuple(getattr(self, name)))
        problems = [*_name_problems(self)] or self._read_units()
        problems = problems or [*_number_problems(self)] or [*_part_problems(self)]
        if not problems:
            problems = [*_connection_problems(self)]
        if problems:
            raise ModelError("\n".join(dict.fromkeys(problems)))
        assembly, values = self._assembled()
        problems = [*assembly.loop_problems(values)]
        if not assembly.form.is_free and self.reaction is not None:
            problems.append(f"reaction is {self.reaction!r}, but the ground takes the mean torques; leave it out")
        if problems:
            raise ModelError("\n".join(problems))
        self.system()

    @property
    def links(self) -> tuple[Link, ...]:
        """Shafts, then gears."""
        return (*self.shafts, *self.gears)

    def system(self) -> System:
        """Make its system: coordinates are deflections of shafts and gears, parameters those of its parts."""
        assembly, values = self._assembled()
        structure = structure_of(assembly)
        return System.from_values(structure, checked(structure, values))

    def _read_units(self) -> list[str]:
        """Put numbers in place of all quantities with units; return the errors of these."""
        if self.speed is not None and (not has_unit(self.speed) or self.frequency != 1.0):
            return [f'speed is {self.speed!r}; write a speed such as speed="1500 rpm", or frequency=..., not both']
        if self.speed is not None and self.units is not None:
            return [f"speed is {self.speed!r}, but this train has its units already; make a new one for another pace"]
        values: dict[str, Any] = {}
        self._converted(values.setdefault)
        mixed = self.units is not None  # then plain numbers are in its units already
        if not any(has_unit(value) for name, value in values.items() if kind_of(name) is not QuantityKind.PHASE):
            values = {name: value for name, value in values.items() if has_unit(value)} if mixed else {}
        found: dict[str, Quantity] = {}
        problems = []
        for name, value in values.items():
            kind, is_plain = kind_of(name), not isinstance(value, str | Quantity)
            if kind is None or value is None or (is_plain and (mixed or value == 0)):  # nothing is zero in any unit
                continue
            try:
                found[name] = read_quantity(value, kind)
            except ValueError as error:
                problems.append(f"{name} {error}")
        if problems or not found:
            return problems
        # periods of the excitation per turn: orders 2, 4 and 6 of a shaft repeat twice in each of its turns
        turns = None if self.speed is None else math.gcd(*(each.order for each in self.harmonics)) or 1
        units = self.units or units_of(found.values(), turns)
        changed = self._converted(
            lambda name, value: units.number(found[name], found[name].kind) if name in found else value
        )
        if self.speed is not None:
            changed |= {"frequency": changed["speed"], "speed": None}
            changed["harmonics"] = tuple(
                replace(each, order=each.order // (turns or 1)) for each in changed["harmonics"]
            )
        for name, value in {**changed, "units": units}.items():
            object.__setattr__(self, name, value)
        return []

    def _converted(self, change: Change) -> dict[str, Any]:
        """Return its fields with other values of all quantities."""
        pace = "frequency" if self.speed is None else "speed"
        return {
            **{
                group: tuple(each._converted(change) for each in getattr(self, group))
                for group in ("inertias", "shafts", "gears")
            },
            "mean": {name: change(f"mean.{name}", value) for name, value in self.mean.items()},
            "harmonics": tuple(
                replace(
                    each, **{p.name: change(f"{each.name}.{p.name}", getattr(each, p.name)) for p in each.parameters}
                )
                for each in self.harmonics
            ),
            pace: change(pace, getattr(self, pace)),
        }

    def replaced(self, part: str, **changes: Any) -> Train:
        """Return the train with other values of one part: ``train.replaced("shaft7", clearance=0.01)``.

        In a train with units a number is in the unit of its kind, and a text has its own: ``clearance="0.5 deg"``.

        Raises
        ------
        ModelError
            If there is no such part, or the train cannot be so.
        """
        groups = {"inertias": self.inertias, "shafts": self.shafts, "gears": self.gears}
        for group, parts in groups.items():
            if part in [each.name for each in parts]:
                changed = tuple(replace(each, **changes) if each.name == part else each for each in parts)
                return replace(self, **{group: changed})
        known = [each.name for parts in groups.values() for each in parts]
        raise ModelError(f"there is no part {part!r}; {did_you_mean(part, known)}")

    def _assembled(self) -> tuple[TrainAssembly, NDArray[np.float64]]:
        numbers, links = self._joined()
        looped = tree_of(links, len(self.inertias)).looped
        form = TrainForm(
            tuple(inertia.name for inertia in self.inertias),
            tuple(
                replace(form, fixed=link.ratio) if number in looped and isinstance(link, Gear) else form
                for number, (link, form) in enumerate(zip(self.links, links, strict=True))
            ),
            tuple(
                TorqueForm(LoadForm.of(each), tuple(numbers[name] for name in each.acts_on)) for each in self.harmonics
            ),
            None if self.reaction is None else numbers[self.reaction],
        )
        return TrainAssembly(form, self.units), np.array([*self._numbers(form)], dtype=float)

    def _joined(self) -> tuple[dict[str, int], list[LinkForm]]:
        """Return the numbers of the inertias and of the ground by name, and the links between them."""
        numbers = {inertia.name: number for number, inertia in enumerate(self.inertias)} | {GROUND: len(self.inertias)}
        forms = []
        for link in self.links:
            contact = link.contact()
            form = None if contact is None else ContactForm.of(contact, reciprocal=True)
            always = link.stiffness is not None and link.clearance is None
            ends = numbers[link.between[0]], numbers[link.between[1]]
            forms.append(LinkForm(link.name, ends, isinstance(link, Gear), None, link.is_rigid, always, form))
        return numbers, forms

    def _numbers(self, form: TrainForm) -> Iterator[float]:
        """Iterate over all numbers in the order of `TrainForm.names`."""
        yield self.frequency
        yield from (inertia.inertia for inertia in self.inertias)
        yield from (self.mean.get(form.inertias[number], 0.0) for number in form.loaded)
        for link, of_link in zip(self.links, form.links, strict=True):
            yield from (getattr(link, what) for what in of_link.own_numbers)
            if contact := link.contact():
                yield from contact.values()
        for harmonic in self.harmonics:
            yield from (*harmonic.values(), *harmonic.acts_on.values())


def chain(count: int, inertia: float, stiffness: float, damping: float = 0.0, *, held: bool = False) -> Train:
    """Make a chain of equal inertias ``disc1``, ``disc2``, ... with equal shafts ``shaft1``, ... between them.

    Parameters
    ----------
    count
        Number of inertias, >= 1.
    inertia, stiffness, damping
        Of each inertia, of each shaft.
    held
        Whether a last shaft joins the last inertia to the ground.

    Raises
    ------
    ModelError
        If there can be no such chain.
    """
    names = [f"disc{number}" for number in range(1, count + 1)] + ["ground"] * held
    pairs = pairwise(names)
    shafts = [Shaft(f"shaft{i}", pair, stiffness=stiffness, damping=damping) for i, pair in enumerate(pairs, start=1)]
    return Train([Inertia(name, inertia) for name in names[:count]], shafts)


def _name_problems(train: Train) -> Iterator[str]:
    parts = [("inertia", train.inertias), ("shaft", train.shafts), ("gear", train.gears), ("harmonic", train.harmonics)]
    counts = Counter(str(part.name) for _, group in parts for part in group)
    for kind, group in parts:
        for part in group:
            if not isinstance(part.name, str) or not part.name.isidentifier():
                yield f"{kind} name {part.name!r}: write a word of letters, digits and underscores"
            elif part.name in _RESERVED:
                yield f"{part.name} is taken as a name already; choose another one for the {kind}"
            elif counts[part.name] > 1:
                yield f"{part.name} has the name of another part; give each a name of its own"


def _number_problems(train: Train) -> Iterator[str]:
    """List the values that should be numbers, but are not."""
    for part in (*train.inertias, *train.links):
        for each in fields(part):
            value = getattr(part, each.name)
            if each.name in ("name", "between", "stages", "law", "numbers") or (value is None and each.default is None):
                continue
            if isinstance(value, bool) or not isinstance(value, Real):
                yield f"{part.name}.{each.name} is {value!r}; it must be a number"


def _part_problems(train: Train) -> Iterator[str]:
    inertias = [inertia.name for inertia in train.inertias]
    if not inertias:
        yield "inertias is empty; name at least one"
        return
    if not train.links:
        yield "there are neither shafts nor gears; join the inertias by some"
    for link in train.links:
        yield from (f"{link.name} {problem}" for problem in link.problems())
        ends = link.between
        if not isinstance(ends, tuple | list) or len(ends) != 2:
            yield f'{link.name} joins {ends!r}; write the names of two inertias, as in ("a", "b")'
            continue
        for end in ends:
            if end not in inertias and end != GROUND:
                yield f"{link.name} joins {end!r}, which is no inertia; {did_you_mean(str(end), inertias)}"
        if ends[0] == ends[1]:
            yield f"{link.name} joins {ends[0]} to itself; name two different inertias"
        elif ends[0] == GROUND:
            yield f"{link.name} begins at the ground; write the ground second"
        if isinstance(link, Gear) and not 0 < abs(link.ratio) < math.inf:
            meaning = "it must be the speed of the first inertia over that of the second"
            yield f"{link.name}.ratio is {link.ratio:g}; {meaning}"
    torques = [("mean", train.mean), *((f"{each.name}.acts_on", each.acts_on) for each in train.harmonics)]
    for what, names in torques:
        yield from (
            f"{what} names {name!r}, which is no inertia; {did_you_mean(name, inertias)}"
            for name in names
            if name not in inertias
        )
    if train.reaction is not None:
        if train.reaction not in inertias:
            yield f"reaction is {train.reaction!r}, which is no inertia; {did_you_mean(train.reaction, inertias)}"
        elif train.mean.get(train.reaction):
            yield f"mean.{train.reaction} and reaction = {train.reaction!r} are both given; leave one of the two out"


def _connection_problems(train: Train) -> Iterator[str]:
    """Report parts that are not connected, and parts that cannot move."""
    _, links = train._joined()
    tree = tree_of(links, len(train.inertias))
    reached = {tree.root, *(step.child for step in tree.steps)}
    apart = [inertia.name for number, inertia in enumerate(train.inertias) if number not in reached]
    if apart:
        more = f", nor are {', '.join(apart[1:5])}{', ...' * (len(apart) > 5)}" if apart[1:] else ""
        to = "the ground" if tree.root == len(train.inertias) else train.inertias[0].name
        yield f"{apart[0]} is joined to {to} by nothing{more}; write a shaft or a gear between them"
        return
    drags = [link for link in (train.links[step.link] for step in tree.steps) if link.is_drag]
    for link in drags:
        first, second = link.between
        if second == GROUND and tree.root != len(train.inertias):
            yield (
                f"{link.name} has damping, but no stiffness, and nothing else holds the train to the ground: its drag "
                "depends on the speed at which the train turns as a whole, which is no part of the equations; give "
                f"{first} a mean torque instead, or {link.name} a stiffness"
            )
        elif f"{link.name}_slip" in {part.name for part in (*train.inertias, *train.links)}:
            yield f"{link.name}_slip is the name of how far {link.name} slips; choose another one for the part"
    if not drags and all(link.rigid or link.drag for link in links):
        link = next(link for link in train.links if link.is_rigid)
        yield f"{link.name} is rigid, as all links are, so nothing vibrates; give a shaft or a gear stiffness"

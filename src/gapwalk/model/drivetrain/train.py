"""The drive train: inertias, shafts and gears with their torques, and the system that they make up."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gapwalk.errors import ModelError
from gapwalk.model.contact import Contact
from gapwalk.model.drivetrain.train_assembly import TrainAssembly, structure_of
from gapwalk.model.drivetrain.train_checks import (
    connection_problems,
    name_problems,
    number_problems,
    part_problems,
    slip_problems,
)
from gapwalk.model.drivetrain.train_form import LinkForm, TorqueForm, TrainForm, tree_of
from gapwalk.model.drivetrain.train_orders import (
    LONGEST,
    Counted,
    common_orders,
    fixed_ratios,
    multiples_of,
    plain_load,
    with_load,
)
from gapwalk.model.drivetrain.train_parts import GROUND, Change, Gear, Inertia, Link, Shaft
from gapwalk.model.drivetrain.train_torques import Force, Friction
from gapwalk.model.drivetrain.train_variations import (
    displaced_gears,
    gapless_links,
    load_problems,
    own_kinds,
    prescribed_inertias,
    ratio_of,
    targets_of,
)
from gapwalk.model.loads import Load, LoadForm
from gapwalk.model.problems import did_you_mean, given
from gapwalk.model.structure import ContactForm
from gapwalk.model.system import System
from gapwalk.model.units import (
    PLAIN,
    Quantity,
    QuantityKind,
    Unit,
    Units,
    has_unit,
    kind_of,
    read_formula_number,
    read_quantity,
    units_of,
)
from gapwalk.model.value_checks import checked


@dataclass(frozen=True)
class Train:
    """A drive train (or any chain or tree of bodies and springs), free or connected to the ground.

    Raises
    ------
    ModelError
        With everything that is wrong, one reason a line.

    Notes
    -----
    Where a drag alone joins two parts of the train (a fluid coupling, ``coupling`` say), they slip, and a mean torque
    makes the angle between them grow for ever. The equations do not depend on it, so it is no coordinate. In its place
    stands ``coupling_slip``, a leaky integral of the rate of slip; it is no angle that could be measured. The rate of
    slip is ``coupling.torque`` over ``coupling.damping``.

    Its quantities are all plain numbers in consistent units, or all texts with units, such as ``"0.14 kg m^2"``,
    ``"30 N m/deg"``, ``"3 deg"``, ``"120 N m"``; a 0 needs none. A train with units holds numbers in them, and `units`
    says which.

    Examples
    --------
    >>> driveline.coordinates, driveline.parameters["speed"]
    (('clutch', 'mesh'), 800.0)
    >>> train.replaced("mesh", clearance="0.05 deg").system().parameters["mesh.clearance"]
    0.05
    """

    #: inertias, shafts, gears, forces, frictions: Its parts; all of them are connected. Closed loops are allowed if the
    #: ratios around them agree.
    inertias: Sequence[Inertia]
    shafts: Sequence[Shaft] = ()
    gears: Sequence[Gear] = ()
    #: Constant torques by inertia. Where they do not balance, a free train accelerates steadily as a whole.
    mean: Mapping[str, float] = field(default_factory=dict, hash=False)
    #: Periodic torques, whose ``acts_on`` names inertias; and loads that vary a number of a shaft or gear instead:
    #: ``varies="mesh.stiffness"``, ``"mesh.deflection"`` (a transmission error), or ``"flywheel.angle"`` (the motion of
    #: that inertia is prescribed). Where an order counts teeth, or is a fraction, it is a `Counted` load.
    harmonics: Sequence[Load | Counted] = ()
    frequency: float = 1.0  #: The fundamental frequency W (angular), > 0; with a unit, in Hz, rpm or rad/s.
    #: Name of the inertia on which the torque acts that balances the other mean torques of a free train; the mean
    #: torque of that one is then no parameter.
    reaction: str | None = None
    #: In place of the frequency: the speed of a shaft, as ``"1500 rpm"``; orders of the excitation are then counted per
    #: turn of it. The parameter is called ``speed``.
    speed: str | Quantity | None = None
    units: Units | None = None  #: The units of its numbers; None for plain numbers. It is found from the texts.
    forces: Sequence[Force] = ()
    #: Name of the inertia whose speed is given; by default the first. Only `Counted` loads need it.
    reference: str = ""
    longest: int = LONGEST  #: The largest number of periods of the slowest load in the common period of all loads.
    frictions: Sequence[Friction] = ()

    def __post_init__(self) -> None:
        for name in ("inertias", "shafts", "gears", "forces", "frictions", "harmonics"):
            object.__setattr__(self, name, tuple(getattr(self, name)))
        if not self.reference and self.inertias:
            object.__setattr__(self, "reference", self.inertias[0].name)
        problems = [*name_problems(self)] or self._read_units()
        problems = problems or [*number_problems(self)] or [*part_problems(self)]
        problems = problems or [*load_problems(self)] or [*connection_problems(self)]
        if problems:
            raise ModelError("\n".join(dict.fromkeys(problems)))
        if self.speed is not None:
            self._count_orders()
        assembly, values = self._assembled()
        problems = [*slip_problems(self, assembly.numbers(values)), *assembly.loop_problems(values)]
        if self.reaction is not None and (apart := assembly.form.held[1:]):
            problems.append(
                f"reaction is {self.reaction!r}, but the ground alone joins {assembly.form.inertias[apart[0]]} to "
                "another part of the train, so no torque of one part balances those of the other; leave it out, and "
                "balance each part by mean = { ... }"
            )
        if problems:
            raise ModelError("\n".join(problems))
        self.system()

    @property
    def links(self) -> tuple[Link, ...]:
        """Shafts, then gears, then forces and friction."""
        return (*self.shafts, *self.gears, *self.forces, *self.frictions)

    def system(self) -> System:
        """Make its system: coordinates are deflections of shafts and gears, parameters those of its parts."""
        assembly, values = self._assembled()
        structure = structure_of(assembly)
        _ = structure.variations  # refuses what there is not
        return System.from_values(structure, checked(structure, values))

    def _read_units(self) -> list[str]:
        """Put numbers in place of all quantities with units; return the errors of these."""
        if self.speed is not None and (not has_unit(self.speed) or self.frequency != 1.0):
            return [f'speed is {self.speed!r}; write a speed such as speed="1500 rpm", or frequency=..., not both']
        if self.speed is not None and self.units is not None:
            return [f"speed is {self.speed!r}, but this train has its units already; make a new one for another pace"]
        values: dict[str, Any] = {}
        self._converted(values.setdefault)
        own = own_kinds(self)
        kinds = {name: own[name] if name in own else kind_of(name) for name in values}
        formulas = {f"{force.name}.{name}" for force in self.forces for name in force.numbers}
        mixed = self.units is not None  # then plain numbers are in its units already
        if not any(has_unit(value) for name, value in values.items() if kinds[name] is not QuantityKind.PHASE):
            values = {name: value for name, value in values.items() if has_unit(value)} if mixed else {}
        found: dict[str, tuple[float, Unit]] = {}
        quantities, problems = [], []
        for name, value in values.items():
            kind, is_plain = kinds[name], not isinstance(value, str | Quantity)
            if value is None or (is_plain and (mixed or value == 0)):  # nothing is zero in any unit
                continue
            try:
                if kind is not None:
                    quantities.append(read_quantity(value, kind))
                    found[name] = quantities[-1].number, Unit(quantities[-1].unit, quantities[-1].factor)
                elif name in formulas:
                    found[name] = read_formula_number(value)
                elif not is_plain:
                    raise ValueError(f"is {given(value)}; it is a plain number, so write it without a unit")
            except ValueError as error:
                problems.append(f"{name} {error}")
        if problems or not found:
            return problems
        units = self.units or units_of(
            quantities,
            None if self.speed is None else 1,  # until orders are counted
            [
                (name, kind, found[name][1] if name in found else PLAIN)
                for name, kind in own.items()
                if kind is not QuantityKind.FREQUENCY
            ],
        )

        def number(name: str, value: Any) -> Any:
            if name not in found:
                return value
            (size, unit), kind = found[name], kinds[name]
            # a parameter of a formula has its own unit, which the train remembers
            wanted = units.unit(name) if kind is None else units.of(kind)
            return size if unit.factor == wanted.factor else size * (unit.factor / wanted.factor)

        changed = self._converted(number)
        for name, value in {**changed, "units": units}.items():
            object.__setattr__(self, name, value)
        return []

    def _count_orders(self) -> None:
        """Make the common period of all loads that of the excitation: orders 2, 4 and 6 repeat twice in each turn."""
        assert self.units is not None
        turns = common_orders(self)[0]
        loads = [
            each
            if isinstance(each, Counted) or not each.is_periodic
            else replace(each, order=int(each.turn_order / turns))
            for each in self.harmonics
        ]
        counted = int(turns) if turns.denominator == 1 else turns
        units = replace(self.units, turns=counted, shaft=self.reference)
        for name, value in {"frequency": self.speed, "speed": None, "harmonics": tuple(loads), "units": units}.items():
            object.__setattr__(self, name, value)

    def _converted(self, change: Change) -> dict[str, Any]:
        """Return its fields with other values of all quantities."""
        pace = "frequency" if self.speed is None else "speed"

        def changed(each: Load | Counted) -> Load | Counted:
            load = plain_load(each)
            names = [parameter.name for parameter in load.parameters]
            names += load.frequencies if getattr(load, "growth", True) else ()
            values = {name: change(f"{load.name}.{name}", getattr(load, name)) for name in names}
            return with_load(each, replace(load, **values))

        return {
            **{
                group: tuple(each._converted(change) for each in getattr(self, group))
                for group in ("inertias", "shafts", "gears", "forces", "frictions")
            },
            "mean": {name: change(f"mean.{name}", value) for name, value in self.mean.items()},
            pace: change(pace, getattr(self, pace)),
            "harmonics": tuple(map(changed, self.harmonics)),
        }

    def replaced(self, part: str, **changes: Any) -> Train:
        """Return the train with other values of one part: ``train.replaced("shaft7", clearance=0.01)``.

        In a train with units a number is in the unit of its kind, and a text has its own: ``clearance="0.5 deg"``.

        Parameters
        ----------
        part
            Name of the part.
        **changes
            New values by the names of its fields.
        """
        groups = {"inertias": self.inertias, "shafts": self.shafts, "gears": self.gears, "forces": self.forces}
        groups |= {"frictions": self.frictions}
        for group, parts in groups.items():
            if part in [each.name for each in parts]:
                changed = tuple(replace(each, **changes) if each.name == part else each for each in parts)
                return replace(self, **{group: changed})
        known = [each.name for parts in groups.values() for each in parts]
        raise ModelError(f"there is no part {part!r}; {did_you_mean(part, known)}")

    def _assembled(self) -> tuple[TrainAssembly, NDArray[np.float64]]:
        numbers, links = self._joined()
        free = [inertia.name for inertia in self.inertias if numbers[inertia.name] != numbers[GROUND]]
        looped, ratios = tree_of(links, len(free)).looped, fixed_ratios(self) | displaced_gears(self)
        form = TrainForm(
            tuple(free),
            tuple(
                replace(form, fixed=ratio_of(link))
                if form.geared and (number in looped or link.name in ratios)
                else form
                for number, (link, form) in enumerate(zip(self.links, links, strict=True))
            ),
            tuple(self._torques(numbers, links)),
            None if self.reaction is None else numbers[self.reaction],
        )
        counts = Counter([load.form.name for load in form.loads])
        counts.update(part.name for part in (*self.inertias, *self.links))
        for name in (name for name, count in counts.items() if count > 1):
            raise ModelError(
                f"{name} is a name that the train gives a load of its own; choose another one for the part"
            )
        return TrainAssembly(form, self.units), np.array([*self._numbers(form)], dtype=float)

    def _torques(self, numbers: Mapping[str, int], links: Sequence[LinkForm]) -> Iterator[TorqueForm]:
        """Iterate over the terms of the excitation, with orders as multiples of the frequency W."""
        turns = Fraction((self.units and self.units.turns) or 1)
        frequency = self.units.frequency if self.units else 1.0
        for each, order in zip(self.harmonics, multiples_of(self, turns), strict=True):
            load = plain_load(each)
            load = load.in_train(self.units) if self.units else load
            scaled = load.frequencies if getattr(load, "growth", True) else ()
            constants = tuple(
                (name, value * frequency if name in scaled else value) for name, value in load.constants()
            )
            varies, displaces = targets_of(self, load, links)
            form = LoadForm(load.name, order, type(load), constants, varies)
            yield TorqueForm(form, tuple(numbers[name] for name in load.acts_on), displaces)

    def _joined(self) -> tuple[dict[str, int], list[LinkForm]]:
        """Return the numbers of the inertias and of the ground by name, and the links between them.

        An inertia whose motion is prescribed has the number of the ground.
        """
        prescribed = prescribed_inertias(self)
        free = [inertia.name for inertia in self.inertias if inertia.name not in prescribed]
        numbers = {name: number for number, name in enumerate(free)}
        numbers |= dict.fromkeys((*prescribed, GROUND), len(free))
        gapless = gapless_links(self)
        forms = []
        for link in self.links:
            parts = tuple(ContactForm.of(each, reciprocal=True) for each in self._contacts(link))
            always = link.acts_always and link.name not in gapless
            ends = numbers[link.between[0]], numbers[link.between[1]]
            geared = isinstance(link, Gear | Friction) and link.ratio is not None
            forms.append(LinkForm(link.name, ends, geared, None, link.is_rigid, always, parts))
        return numbers, forms

    def _contacts(self, link: Link) -> tuple[Contact, ...]:
        """Return the contacts of a link: its springs with clearances, its friction, its rigid stop, or its formula."""
        return link.contacts(link.name in gapless_links(self), self.units.angle if self.units else 1.0)

    def _numbers(self, form: TrainForm) -> Iterator[float]:
        """Iterate over all numbers in the order of `TrainForm.names`."""
        yield self.frequency
        yield from (each.inertia or 0.0 for each in self.inertias if each.name in form.inertias)
        yield from (self.mean.get(form.inertias[number], 0.0) for number in form.loaded)
        for link, of_link in zip(self.links, form.links, strict=True):
            yield from (getattr(link, what) for what in of_link.own_numbers)
            for contact in self._contacts(link):
                yield from contact.values()
        for load in map(plain_load, self.harmonics):
            yield from (*load.values(), *load.acts_on.values())


def chain(count: int, inertia: float, stiffness: float, damping: float = 0.0, *, held: bool = False) -> Train:
    """Make a chain of equal inertias ``disc1``, ``disc2``, ... with equal shafts ``shaft1``, ... between them.

    Parameters
    ----------
    count
        Number of inertias, >= 1.
    inertia, stiffness, damping
        Properties of each inertia, and of each shaft.
    held
        True if a last shaft connects the last inertia to the ground.

    Returns
    -------
    Train
        The chain.

    Raises
    ------
    ModelError
        If there can be no such chain.

    Examples
    --------
    >>> gw.train.chain(3, 1.0, 100.0, held=True).system().coordinates
    ('shaft1', 'shaft2', 'shaft3')
    """
    names = [f"disc{number}" for number in range(1, count + 1)] + ["ground"] * held
    pairs = pairwise(names)
    shafts = [Shaft(f"shaft{i}", pair, stiffness=stiffness, damping=damping) for i, pair in enumerate(pairs, start=1)]
    return Train([Inertia(name, inertia) for name in names[:count]], shafts)

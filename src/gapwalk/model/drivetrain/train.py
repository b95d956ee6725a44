"""The drive train: inertias, shafts and gears with their torques, and the system that they make up."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from fractions import Fraction
from functools import cached_property
from itertools import pairwise
from numbers import Real
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gapwalk.errors import ModelError
from gapwalk.model.contact import OF_FRICTION, RIGID, Contact, ContactForm, friction_name, stop_name
from gapwalk.model.drivetrain.bearing import Bearing, on_bearings
from gapwalk.model.drivetrain.planetary import Mesh, Planet, Planetary
from gapwalk.model.drivetrain.train_assembly import (
    CONSISTENT,
    TorqueForm,
    TrainAssembly,
    TrainForm,
    TrainNumbers,
    structure_of,
)
from gapwalk.model.drivetrain.train_orders import (
    LONGEST,
    Counted,
    common_orders,
    displaced_gears,
    fixed_ratios,
    formula_numbers,
    gapless_links,
    load_problems,
    multiples_of,
    own_kinds,
    phased_loads,
    plain_load,
    prescribed_inertias,
    ratio_of,
    targets_of,
    with_load,
)
from gapwalk.model.drivetrain.train_parts import (
    GROUND,
    Change,
    Drag,
    Force,
    Friction,
    Gear,
    Inertia,
    Link,
    Shaft,
    Slips,
    acts_along_its_slip,
)
from gapwalk.model.drivetrain.train_rows import LinkForm, Solved, reduced, row_of, solved
from gapwalk.model.laws.formula import is_computed
from gapwalk.model.loads import Load, LoadForm
from gapwalk.model.loads.load import FactorOverSpeed
from gapwalk.model.problems import did_you_mean, given
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

# Errors of a drive train: names, numbers, parts, and how they are connected.

_RESERVED = ("frequency", "speed", "mass", "damping", "stiffness", "mean", "study", GROUND)
PARTS = {
    "inertias": "inertia", "shafts": "shaft", "gears": "gear", "forces": "force", "frictions": "friction",
    "drags": "drag", "planetaries": "planetary", "bearings": "bearing",
}  # fmt: skip
"""The fields of a train that hold its parts, each with the table of one in a file."""


def name_problems(train: Train) -> Iterator[str]:
    """List names that no parameter can have, or that two parts have."""
    parts = [(kind, part) for group, kind in PARTS.items() for part in getattr(train, group)]
    parts += [("harmonic", load) for load in train.harmonics]
    counts = Counter(str(part.name) for _, part in parts)
    for kind, part in parts:
        if not isinstance(part.name, str) or not part.name.isidentifier():
            yield f"{kind} name {part.name!r}: write a word of letters, digits and underscores"
        elif part.name in _RESERVED:
            yield f"{part.name} is taken as a name already; choose another one for the {kind}"
        elif counts[part.name] > 1:
            yield f"{part.name} has the name {part.name} of another part; give each a name of its own"
        elif kind in ("shaft", "gear"):
            rigid = RIGID in (stage.stiffness for stage in part.stages)
            dry = any(OF_FRICTION[0] in each.numbers for each in (part, *part.stages))
            made = {friction_name(part.name): dry, stop_name(part.name): rigid}
            for name in (name for name, exists in made.items() if exists and counts[name]):
                yield f"{part.name} makes {name}, but another part has that name; choose another one for it"


_NO_NUMBERS = ("teeth", "normal", "group", "exponent", "weights", "counted", "carrier", "side")


def number_problems(train: Train) -> Iterator[str]:
    """List the values that should be numbers, but are not."""
    for part in (*train.inertias, *train.links):
        for each in fields(part):
            value = getattr(part, each.name)
            if each.name in ("name", "between", "stages", "law", "numbers", *_NO_NUMBERS) or (
                value is None and (each.default is None or isinstance(part, Friction))
            ):
                continue
            if each.name == "stiffness" and value == RIGID:
                continue
            if isinstance(value, bool) or not isinstance(value, Real):
                yield f"{part.name}.{each.name} is {value!r}; it must be a number"
    for name, radius in ((each.name, each.radius) for each in train.inertias if isinstance(each.radius, Real)):
        if train.units is None:
            yield f"{name}.radius is {radius:g}, but this train has no units; leave it out"
        elif not 0 < radius < math.inf:
            yield f'{name}.radius is {radius:g}; it must be positive, as in "35 mm"'


def part_problems(train: Train) -> Iterator[str]:
    """List the errors of the parts, one by one."""
    inertias = [inertia.name for inertia in train.inertias]
    if not inertias:
        yield "inertias is empty; name at least one"
        return
    if not train.links:
        yield "there are neither shafts nor gears; join the inertias by some"
    for link in train.links:
        yield from (f"{link.name} {problem}" for problem in link.problems())
        ends = link.between
        if isinstance(link, Mesh):
            continue  # its set has been checked
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
        ratio = link.ratio if isinstance(link, Gear | Friction) else None
        if isinstance(ratio, int | float) and not 0 < abs(ratio) < math.inf:
            yield f"{link.name}.ratio is {ratio:g}; it must be the speed of the first inertia over that of the second"
    loads = map(plain_load, train.harmonics)
    torques = [("mean", train.mean), *((f"{each.name}.acts_on", each.acts_on) for each in loads)]
    for what, name in ((what, name) for what, names in torques for name in names if name not in inertias):
        yield f"{what} names {name!r}, which is no inertia; {did_you_mean(name, inertias)}"
    if train.reference not in inertias:
        yield f"reference is {train.reference!r}, which is no inertia; {did_you_mean(train.reference, inertias)}"
    if train.reaction is not None:
        if train.reaction not in inertias:
            yield f"reaction is {train.reaction!r}, which is no inertia; {did_you_mean(train.reaction, inertias)}"
        elif train.mean.get(train.reaction):
            yield f"mean.{train.reaction} and reaction = {train.reaction!r} are both given; leave one of the two out"


def set_problems(train: Train) -> Iterator[str]:
    """List the errors of planetary sets and bearings, and names of their parts that are taken."""
    inertias = [each.name for each in train.inertias if not isinstance(each, Planet)]
    groups = (getattr(train, group) for group in [*PARTS][:6])
    taken = {part.name for group in groups for part in group if not isinstance(part, Planet)}
    for each in train.branches:
        of_gear = isinstance(each, Bearing)
        found = [*(each.problems(inertias, train.gears) if of_gear else each.problems(inertias))]
        yield from (f"{each.name} {problem}" for problem in found)
        made = () if found else (each.inertia(train.units),) if of_gear else (*each.inertias, *each.links)
        for part in (part for part in made if part.name in taken):
            yield f"{each.name} makes {part.name}, but another part has that name; choose another one for it"


def connection_problems(train: Train) -> Iterator[str]:
    """Report parts that are not connected, that turn at speeds of their own, or that cannot move."""
    found, whole, moved = train._solved, train._whole, prescribed_inertias(train)
    names = [inertia.name for inertia in train.inertias if inertia.name not in moved]
    reached, rows = {GROUND if found.is_held else names[0]}, [{*row} for row in found.follow.values()]
    while joined := [row for row in rows if row & reached and not row <= reached]:
        reached.update(*joined)
    apart = [name for name in names if name not in reached]
    if apart and len(found.free) > 1 - found.is_held:
        more = f", nor are {', '.join(apart[1:5])}{', ...' * (len(apart) > 5)}" if apart[1:] else ""
        to = "the ground" if found.is_held else train.inertias[0].name
        yield f"{apart[0]} is not connected to {to}{more}; write a shaft or a gear between them"
        return
    if train.branches:
        yield from _turning_problems(train, found, whole, moved)
    drags = [link for link in train.links if link.is_drag and link.name in found.basis]
    for link in drags:
        if f"{link.name}_slip" in {part.name for part in (*train.inertias, *train.links)}:
            yield f"{link.name}_slip names the slip of {link.name}; choose another one for the part"
    if not drags and all(link.is_rigid or link.is_drag for link in train.links):
        first = [*train.branches, *train.links][0].name
        yield f"{first} is rigid, as all links are, so nothing vibrates; give a shaft or a gear stiffness"


def _turning_problems(train: Train, found: Solved, whole: Solved, moved: Sequence[str]) -> Iterator[str]:
    """Report how a train with links of more than two ends cannot turn."""
    if len(found.free) > 1:
        first, second = found.free[:2]
        yield (
            f"{train.branches[0].name} lets {first} and {second} turn at speeds of their own, so their mean "
            'speeds are unknown; hold a member, as in ring = "ground", join two of them by a shaft, or let a '
            f'linear drag end the slip: a [[drag]] with between = ["{first}", "{second}"] and linear = ...'
        )
    elif found.free and moved:
        yield f"nothing joins {found.free[0]} to {moved[0]}, whose motion is prescribed; write a shaft with a stiffness"
    elif not whole.free and not any(GROUND in link.between for link in train.links if not link.is_drag):
        yield "the ratios of gears and planetary sets lock the train: it cannot turn; correct one of them"
    elif found.free and not train._speeds:
        yield (
            f"reference is {train.reference!r}, which stands still as the train turns; write the name of an inertia "
            f"that turns, as reference = {found.free[0]!r}"
        )
    elif train.reaction is not None and train._speeds and not train._speeds[train.reaction]:
        yield f"reaction is {train.reaction!r}, which stands still as the train turns; name an inertia that turns"


def speed_problems(train: Train, numbers: TrainNumbers) -> Iterator[str]:
    """List what acts on the speeds of the parts of a train, but cannot: drags, and formulas of speeds."""
    form = numbers.form
    for link, part in zip(train.links, form.links, strict=True):
        needs = isinstance(link, Force) and link.needs_speed
        if (part.turns or needs) and not form.pace:
            what = "slips as the train turns" if part.turns else "is a formula of the speed"
            if train.units:
                way = 'the file has no speed; write speed = "1500 rpm" in place of the frequency'
            else:
                way = "a spring holds the train to the ground, so that its mean speed is 0; leave it out of the formula"
            yield f"{link.name} {what}, but {way}"
        elif isinstance(link, Force):
            prescribed = [end for end in link.speeds.values() if end not in form.inertias]
            if prescribed:
                yield f"{link.name} has the speed of {prescribed[0]} in its formula, whose motion is prescribed; use W"
        elif isinstance(link, Friction) and part.way:
            pair = {*link.between}
            for other in (each for each in (*train.shafts, *train.gears) if {*each.between} == pair):
                ratio = ratio_of(other)
                wanted = ratio if tuple(other.between) == tuple(link.between) else 1.0 / ratio
                yield (
                    f"{link.name} acts beside {other.name}, but its ratio is {ratio_of(link):g}, by which it would "
                    f"slip all the time; write ratio = {wanted:.10g}"
                )
        elif isinstance(link, Drag):
            if numbers.never_deflects(form.links.index(part)):
                yield f"{link.name} never slips, for rigid gears hold its two inertias together; leave it out"
            dry = [name for name in ("constant", "breakaway") if name in link.numbers]
            if dry and not part.way:
                yield (
                    f"{link.name}.{dry[0]} is a torque against a mean slip, but its two parts turn at the same speed; "
                    f"write dry friction: a table [[friction]] with between = {list(link.between)} and limit = ..."
                )


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
    makes the angle between them grow without bound. The equations do not depend on it, so it is no coordinate. In its
    place stands ``coupling_slip``, a leaky integral of the rate of slip, which is no measurable angle. The rate of slip
    is ``coupling.torque`` over ``coupling.damping``.

    Its quantities are all plain numbers in consistent units, or all texts with units, such as ``"0.14 kg m^2"``, ``"30
    N m/deg"``, ``"3 deg"``, ``"120 N m"``; a 0 needs none. A train with units stores numbers; `units` has their units.

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
    #: Name of the inertia whose mean torque balances all others in a free train; this torque is then no parameter.
    reaction: str | None = None
    #: In place of the frequency: the speed of a shaft, as ``"1500 rpm"``; orders of the excitation are then counted per
    #: turn of it. The parameter is called ``speed``.
    speed: str | Quantity | None = None
    units: Units | None = None  #: The units of its numbers; None for plain numbers. It is found from the texts.
    forces: Sequence[Force] = ()
    #: Name of the inertia whose speed is given; by default the first inertia. Only `Counted` loads need it.
    reference: str = ""
    longest: int = LONGEST  #: Most periods of the slowest load that the common period of all loads may have.
    frictions: Sequence[Friction] = ()
    #: Drags between parts that turn at different speeds, and on the casing.
    drags: Sequence[Drag] = ()
    planetaries: Sequence[Planetary] = ()  #: Planetary sets and differentials; they add inertias of their planets.
    bearings: Sequence[Bearing] = ()  #: Bearings in which gears move sideways; each adds an inertia.
    #: The factor of each group of drags; 1 by default.
    groups: Mapping[str, float] = field(default_factory=dict, hash=False)
    #: Factors of numbers that depend on the speed, by their names: ``{"arc.limit": "1 + 0.01*W**2"}``, with W the
    #: angular speed of the reference shaft.
    over_speed: Mapping[str, str] = field(default_factory=dict, hash=False)

    def __post_init__(self) -> None:
        for name in (*PARTS, "harmonics"):
            object.__setattr__(self, name, tuple(getattr(self, name)))
        if not self.reference and self.inertias:
            object.__setattr__(self, "reference", self.inertias[0].name)
        problems = [*name_problems(self)] or self._read_units() or [*set_problems(self)]
        if self.branches and not problems:
            own = [each for each in self.inertias if not isinstance(each, Planet)]
            planets = [each for planetary in self.planetaries for each in planetary.inertias]
            planets += [each.inertia(self.units) for each in self.bearings]
            object.__setattr__(self, "inertias", (*own, *planets))
            object.__setattr__(self, "harmonics", tuple(phased_loads(self)))
        problems = problems or [*number_problems(self)] or [*part_problems(self)]
        problems = problems or [*load_problems(self)] or [*connection_problems(self)]
        if problems:
            raise ModelError("\n".join(dict.fromkeys(problems)))
        if self.speed is not None:
            self._count_orders()
        assembly, values = self._assembled()
        problems = [*speed_problems(self, assembly.numbers(values)), *assembly.loop_problems(values, self._looped)]
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
    def branches(self) -> tuple[Planetary | Bearing, ...]:
        """The parts whose links have more than two ends."""
        return (*self.planetaries, *self.bearings)

    @property
    def meshes(self) -> Sequence[Gear]:
        """The gears; the deflections of those on bearings include the displacements of the bearings."""
        return on_bearings(self.gears, self.bearings) if self.bearings else self.gears

    @cached_property
    def links(self) -> tuple[Link, ...]:
        """Shafts, then gears, forces, friction, drags, and the links of sets and bearings."""
        made = [link for each in self.planetaries for link in each.links]
        made += [each.shaft(self.units) for each in self.bearings]
        return (*self.shafts, *self.meshes, *self.forces, *self.frictions, *self.drags, *made)

    def system(self) -> System:
        """Make the train's system: coordinates are deflections of shafts and gears, parameters those of its parts."""
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
        formulas = {*formula_numbers(self)}
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
        numbers = [(n, kind, found[n][1] if n in found else PLAIN) for n, kind in own.items()]
        numbers = [each for each in numbers if each[1] is not QuantityKind.FREQUENCY]
        turns = None if self.speed is None else 1  # until orders are counted
        units = self.units or units_of(quantities, turns, numbers)
        sizes: dict[str, Any] = {}
        for name, (size, unit) in found.items():
            kind = kinds[name]
            # a parameter of a formula has its own unit, which the train remembers
            wanted = units.unit(name) if kind is None else units.of(kind)
            sizes[name] = size if unit.factor == wanted.factor else size * (unit.factor / wanted.factor)
        changed = self._converted(sizes.get)
        for name, value in {**changed, "units": units}.items():
            object.__setattr__(self, name, value)
        return []

    def _count_orders(self) -> None:
        """Make the common period of all loads that of the excitation: orders 2, 4 and 6 repeat twice in each turn."""
        assert self.units is not None
        turns = common_orders(self)[0]
        loads = [
            replace(each, order=int(each.turn_order / turns)) if isinstance(each, Load) and each.is_periodic else each
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

        groups = [group for group in PARTS if group != "bearings"]  # whose numbers follow from lengths and masses
        return {
            **{group: tuple(each._converted(change) for each in getattr(self, group)) for group in groups},
            "mean": {name: change(f"mean.{name}", value) for name, value in self.mean.items()},
            pace: change(pace, getattr(self, pace)),
            "harmonics": tuple(map(changed, self.harmonics)),
        }

    def replaced(self, part: str, **changes: Any) -> Train:
        """Return the train with other values of one part: ``train.replaced("shaft7", clearance=0.01)``.

        In a train with units a number is in the train's unit for such a quantity; a text has its own: ``"0.5 deg"``.

        Parameters
        ----------
        part
            Name of the part.
        **changes
            New values by the names of its fields.
        """
        groups = {group: getattr(self, group) for group in PARTS}
        for group, parts in groups.items():
            if part in [each.name for each in parts]:
                changed = tuple(replace(each, **changes) if each.name == part else each for each in parts)
                return replace(self, **{group: changed})
        known = [each.name for parts in groups.values() for each in parts]
        raise ModelError(f"there is no part {part!r}; {did_you_mean(part, known)}")

    def _assembled(self) -> tuple[TrainAssembly, NDArray[np.float64]]:
        numbers, links = self._joined()
        free = [inertia.name for inertia in self.inertias if numbers[inertia.name] != numbers[GROUND]]
        ratios = fixed_ratios(self) | displaced_gears(self) | self._looped
        places = {link.name: number for number, link in enumerate(self.links)}
        turning = numbers[self.reference] if self.branches else 0
        speeds, prescribed = self._speeds, prescribed_inertias(self)
        turns = Fraction((self.units and self.units.turns) or 1)
        known = speeds and (self.units is None or self.units.turns)
        form = TrainForm(
            tuple(free),
            tuple(
                replace(form, fixed=ratio_of(link)) if form.geared and (link.name in ratios or form.row) else form
                for link, form in zip(self.links, links, strict=True)
            ),
            tuple(self._torques(numbers, links)),
            None if self.reaction is None else numbers[self.reaction],
            pace=1.0 / (float(turns) * (self.units.angle if self.units else 1.0)) if known else 0.0,
            angle=self.units.angle if self.units else 1.0,
            reference=None if self.reference in prescribed else numbers[self.reference],
            starts=tuple((numbers[name], speeds[name]) for name in free if prescribed and speeds),
            groups=tuple(dict.fromkeys(drag.group for drag in self.drags if drag.group)),
            basis=tuple(places[name] for name in self._solved.basis),
            root=turning if self._solved.free else len(free),
        )
        form = replace(form, over_speed=tuple(self._factors(form)))
        counts = Counter([load.form.name for load in form.loads])
        counts.update(part.name for part in (*self.inertias, *self.links))
        for name in (name for name, count in counts.items() if count > 1):
            told = "a name that the train gives a load of its own; choose another one for the part"
            raise ModelError(f"{name} is {told}")
        values = np.array([*self._numbers(form)], dtype=float)
        assembly = TrainAssembly(form, self._units)
        train = assembly.numbers(values)
        bodies = [way != 0.0 for way in train.ways.T] if not self.branches else []
        slow = tuple(
            sorted(int(each) for body in bodies if not train.inertia[body].any() for each in np.flatnonzero(body))
        )
        if slow and self.frequency > 0.0:
            form = replace(form, massless=slow, lag=1.0 / float(train.values[0]))
            assembly = TrainAssembly(form, self._units)
        return assembly, values

    def _factors(self, form: TrainForm) -> Iterator[tuple[str, FactorOverSpeed]]:
        """Iterate over the numbers that depend on the speed."""
        for name, text in self.over_speed.items():
            last = name.rpartition(".")[2]
            if name not in form.names or last in ("inertia", "ratio", "frequency", "clearance", "phase"):
                known = [each for each in form.names if each.rpartition(".")[2] in ("stiffness", "damping", "limit")]
                hint = did_you_mean(name, known)
                raise ModelError(f"over_speed names {name!r}, which is not a number that can vary; {hint}")
            factor = FactorOverSpeed(text)
            yield name, factor.in_train(self.units) if self.units else factor

    def _torques(self, numbers: Mapping[str, int], links: Sequence[LinkForm]) -> Iterator[TorqueForm]:
        """Iterate over the terms of the excitation, with orders as multiples of the frequency W."""
        turns = Fraction((self.units and self.units.turns) or 1)
        frequency = self.units.frequency if self.units else 1.0
        for each, order in zip(self.harmonics, multiples_of(self, turns), strict=True):
            load = plain_load(each)
            load = load.in_train(self.units) if self.units else load
            scaled = load.frequencies if getattr(load, "growth", True) else ()
            constants = tuple((n, value * frequency if n in scaled else value) for n, value in load.constants())
            varies, displaces = targets_of(self, load, links)
            form = LoadForm(load.name, order, type(load), constants, varies)
            yield TorqueForm(form, tuple(numbers[name] for name in load.acts_on), displaces)

    def _joined(self) -> tuple[dict[str, int], list[LinkForm]]:
        """Return the numbers of the inertias and of the ground (or what is prescribed) by name, and the links."""
        prescribed = prescribed_inertias(self)
        free = [inertia.name for inertia in self.inertias if inertia.name not in prescribed]
        numbers = {name: number for number, name in enumerate(free)}
        numbers |= dict.fromkeys((*prescribed, GROUND), len(free))
        gapless = gapless_links(self)
        forms = []
        for link in self.links:
            made = self._contacts(link)
            parts = tuple(ContactForm.of(each, reciprocal=acts_along_its_slip(each.law)) for each in made)
            always = link.acts_always and link.name not in gapless
            ends = numbers[link.between[0]], numbers[link.between[1]]
            geared = isinstance(link, Gear | Friction) and link.ratio is not None
            form = LinkForm(link.name, ends, geared, None, link.is_rigid, always, parts)
            if link.row:
                row = [(numbers[end], float(weight)) for end, weight in link.row.items()]
                form = replace(form, row=tuple(each for each in row if each[0] != numbers[GROUND]))
            if isinstance(link, Drag):
                form = replace(form, own=link.own, group=link.group)
            elif isinstance(link, Force):
                form = replace(form, speeds=tuple(numbers[end] for end in link.speeds.values()))
            way = self._ways.get(link.name)
            if way is not None:
                form = replace(form, turns=True, way=way, rest=self._speeds.get(link.between[1], 0.0))
            forms.append(form)
        return numbers, forms

    def _contacts(self, link: Link) -> tuple[Contact, ...]:
        """Return the contacts of a link: its springs with clearances, its friction, its rigid stop, or its formula."""
        angle = self.units.angle if self.units else 1.0
        return link.contacts(link.name in gapless_links(self), angle, Slips(self._ways.get(link.name), self._leaks))

    @property
    def _units(self) -> Units | None:
        """Its units, with the radii of its inertias in m."""
        radii = [(each.name, each.radius) for each in self.inertias if each.radius is not None]
        if self.units is None or not radii:
            return self.units
        size = self.units.of(QuantityKind.LENGTH).factor
        return replace(self.units, radii=tuple((name, radius * size) for name, radius in radii))

    @cached_property
    def _speeds(self) -> dict[str, float]:
        """The mean speeds of all inertias over that of the reference; empty if a spring holds the train still."""
        turning = self._whole.speeds(self.reference) if len(self._whole.free) == 1 else {}
        return {name: float(speed) for name, speed in turning.items()}

    @cached_property
    def _solved(self) -> Solved:
        """The rows of all links."""
        return solved(self.links, [each.name for each in self.inertias], prescribed_inertias(self))

    @cached_property
    def _whole(self) -> Solved:
        """Those rows while no motion is prescribed."""
        return solved(self.links, [each.name for each in self.inertias])

    @cached_property
    def _sprung(self) -> Solved:
        """The rows of springs and rigid links between inertias alone."""
        links = [link for link in self.links if not link.is_drag and (link.row or GROUND not in link.between)]
        return solved(links, [each.name for each in self.inertias])

    @cached_property
    def _exact_speeds(self) -> Mapping[str, Fraction]:
        """The speeds over that of the reference, of inertias that springs and rigid links join to it."""
        return (self._whole if self.branches else self._sprung).speeds(self.reference)

    @cached_property
    def _leaks(self) -> bool:
        """True if drags alone join some parts of the train."""
        return any(link.is_drag for link in self.links if link.name in self._solved.basis)

    @cached_property
    def _looped(self) -> frozenset[str]:
        """The links on loops that do not lead through the ground: on each, the ratios must multiply to one."""
        found, beside = self._solved, {GROUND, *prescribed_inertias(self)}
        held = {link.name for link in self.links if not link.row and beside & {*link.between}}
        looped = set[str]()
        for link in self.links:
            slips = link.name in self._ways or (self.branches and (link.is_drag or not self._whole.free))
            if not slips and link.name not in (*found.basis, *looped, *held):
                loop, left = {link.name, *found.made_of(row_of(link))}, reduced(row_of(link), self._sprung.follow)
                looped |= loop if len(left) == 1 or not loop & held else set()  # of one angle: by a wrong ratio
        return frozenset(looped)

    @cached_property
    def _ways(self) -> dict[str, int]:
        """The signs of the mean slips of the links that slip on as the train turns, by their names."""
        found = {}
        for link in self.links if self._speeds else ():
            first, second = (self._speeds.get(end, 0.0) for end in link.between)
            slip = first - ratio_of(link) * second
            still = abs(slip) <= CONSISTENT * abs(first)
            apart = reduced(row_of(link), self._sprung.follow)
            alone = still and len(apart) > 1 and GROUND not in apart
            if (isinstance(link, Drag) and not alone) or ((link.is_drag or link.only_follows) and not still):
                found[link.name] = 0 if still else int(math.copysign(1.0, slip))
        return found

    def _numbers(self, form: TrainForm) -> Iterator[float]:
        """Iterate over all numbers in the order of `TrainForm.names`."""
        yield self.frequency
        yield from (each.inertia or 0.0 for each in self.inertias if each.name in form.inertias)
        yield from (self.mean.get(form.inertias[number], 0.0) for number in form.loaded)
        yield from (self.groups.get(group, 1.0) for group in form.groups)
        for link, of_link in zip(self.links, form.links, strict=True):
            given = None if of_link.own is None else link.numbers
            yield from (getattr(link, what) if given is None else given[what] for what in of_link.own_numbers)
            for contact in self._contacts(link):
                names = contact.law.parameters
                own = zip((f"{contact.name}.{each.name}" for each in names), contact.numbers.values(), strict=False)
                yield from contact.values() if contact.stages else (v for n, v in own if not is_computed(n))
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
        If the number of inertias or one of the properties is not allowed.

    Examples
    --------
    >>> gw.train.chain(3, 1.0, 100.0, held=True).system().coordinates
    ('shaft1', 'shaft2', 'shaft3')
    """
    names = [f"disc{number}" for number in range(1, count + 1)] + ["ground"] * held
    pairs = pairwise(names)
    shafts = [Shaft(f"shaft{i}", pair, stiffness=stiffness, damping=damping) for i, pair in enumerate(pairs, start=1)]
    return Train([Inertia(name, inertia) for name in names[:count]], shafts)

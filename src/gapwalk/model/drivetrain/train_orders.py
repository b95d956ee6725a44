"""Orders of the loads of a drive train: per turn of an inertia or per tooth of a mesh, with their common period.

The excitation repeats after the shortest time in which each load repeats a whole number of times. Where two wheels
share no factor of their numbers of teeth (a hunting tooth), that is a long time: 27 teeth against 41 repeat after 41
turns of the first.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import TYPE_CHECKING, Any

from gapwalk.errors import ModelError
from gapwalk.model import bounds
from gapwalk.model.bounds import Finite, has
from gapwalk.model.contact import OF_FRICTION, Side
from gapwalk.model.drivetrain.planetary import QUANTITIES, Mesh
from gapwalk.model.drivetrain.train_parts import GROUND, Force, Friction, Gear, Link
from gapwalk.model.drivetrain.train_rows import LinkForm
from gapwalk.model.loads import Load
from gapwalk.model.problems import did_you_mean
from gapwalk.model.units import QuantityKind, kind_of

if TYPE_CHECKING:
    from gapwalk.model.drivetrain.train import Train


LONGEST = 30
"""Periods of the slowest load in the common period, beyond which a train is refused unless it allows more."""

_LARGEST_PART = 1000  # of an order that is a fraction


@dataclass(frozen=True)
class Counted:
    """A load of a drive train whose order counts teeth of a mesh, or turns of another inertia than the reference.

    Examples
    --------
    >>> gw.train.Counted(gw.Harmonic(0.2, varies="mesh1.stiffness", order=2), mesh="mesh1").exact_order
    Fraction(2, 1)
    """

    #: The load. Its order is multiplied by the number of teeth of the mesh's first gear, and by the ratio of the speed
    #: of that gear (or of the inertia) to that of the reference shaft. Phases are those of the excitation, at ``W t =
    #: 0``.
    load: Load
    mesh: str = ""  #: Name of a gear with `Gear.teeth`.
    turns_of: str = ""  #: Name of an inertia instead.
    #: The order in place of that of the load; it may be a fraction, such as 0.5 for a cycle of four strokes.
    order: float | None = None
    #: Pairs of poles of an electric machine: then its order counts electrical periods, of which a turn has this number.
    pole_pairs: int | None = None
    #: Slots of its stator: then its order counts periods of the cogging torque, of which a turn has the least common
    #: multiple of slots and poles.
    slots: int | None = None

    def __post_init__(self) -> None:
        for key in ("pole_pairs", "slots"):
            if (number := getattr(self, key)) is not None and not has(bounds.Counted, number):
                raise ModelError(f"{self.name} has {key} = {number!r}; it must be a whole number >= 1, such as 4")
        if self.slots is not None and self.pole_pairs is None:
            raise ModelError(
                f"{self.name} has slots, but no pole_pairs; cogging repeats with both: write pole_pairs = 4"
            )
        for other in ("pole_pairs", "turns_of"):
            if self.mesh and getattr(self, other):
                raise ModelError(f"{self.name} has both mesh and {other}; leave one of the two out")
        for key, what in (("mesh", "a gear"), ("turns_of", "an inertia")):
            if not isinstance(name := getattr(self, key), str):
                raise ModelError(
                    f"{self.name} has {key} = {name!r}, which is not the name of {what}; a fraction is written "
                    "Counted(load, order=0.5)"
                )
        given = self.load.turn_order if self.order is None else self.order
        if isinstance(given, bool) or not isinstance(given, int | float | Fraction) or not 0 < given < math.inf:
            raise ModelError(f"{self.name} has the order {given!r}; it must be a number > 0")
        if abs(self.exact_order - Fraction(given)) > Fraction(1, 10**9) * self.exact_order:
            raise ModelError(
                f"{self.name} has the order {given!r}, which is no fraction of small numbers, so the excitation would "
                "not repeat; write one such as 0.5 or 1.5"
            )

    @property
    def name(self) -> str:
        """The name of the load."""
        return self.load.name

    @property
    def exact_order(self) -> Fraction:
        """The order as an exact fraction, in the periods that this load counts."""
        given = self.load.turn_order if self.order is None else Fraction(self.order)
        return given.limit_denominator(_LARGEST_PART)

    @property
    def periods(self) -> int:
        """The periods in a turn that its order counts: those of an electric machine, or 1."""
        poles = 2 * (self.pole_pairs or 0)
        return (poles // 2 or 1) if self.slots is None else math.lcm(self.slots, poles)


def plain_load(load: Load | Counted) -> Load:
    """Return the load without the way in which its order is counted."""
    return load.load if isinstance(load, Counted) else load


def with_load(counted: Load | Counted, load: Load) -> Load | Counted:
    """Return a load whose order is counted as that of another one."""
    return replace(counted, load=load) if isinstance(counted, Counted) else load


def real_orders(train: Train) -> list[Fraction]:
    """Return the orders of the loads: per turn of the reference shaft, or as multiples of the frequency."""
    unit = Fraction((train.units and train.units.turns) or 1)
    found = []
    for load in train.harmonics:
        if isinstance(load, Counted):
            found.append(load.exact_order * load.periods * _counted(train, load)[0])
        else:  # until they are counted, the orders of a curve over a cycle of two turns are halves
            found.append(load.turn_order if train.speed is not None else load.order * unit)
    return found


def fixed_ratios(train: Train) -> frozenset[str]:
    """Return the gears on whose ratios orders depend; these are no parameters: the orders would change with them."""
    loads = (load for load in train.harmonics if isinstance(load, Counted))
    return frozenset(gear for load in loads for gear in _counted(train, load)[1])


def _counted(train: Train, load: Counted) -> tuple[Fraction, tuple[str, ...]]:
    """Return what a load counts per turn of the reference shaft, and the gears on which that depends."""
    gear = _gear(train, load) if load.mesh else None
    if isinstance(gear, Mesh):
        return abs(tooth_rate(train, load, gear)), tuple(each.name for each in train.gears)
    if not (at := gear.between[0] if gear else load.turns_of):
        return Fraction(1), ()
    speed, path = _speed(train, load, at)
    return (abs(speed) * (gear.first_teeth or 0), (*path, gear.name)) if gear else (abs(speed), path)


def common_orders(train: Train) -> tuple[Fraction, list[int]]:
    """Return the order at which all loads repeat together, and theirs as multiples of it."""
    orders = real_orders(train)
    turns = _common(orders)
    periods = min(filter(None, orders), default=turns) / turns
    if periods > train.longest:
        raise ModelError(_too_long(train, orders, turns, periods))
    return turns, [int(order / turns) for order in orders]


def multiples_of(train: Train, turns: Fraction) -> list[int]:
    """Return the orders of the loads as multiples of the frequency W, of which a turn has `turns` periods."""
    found = []
    for load, order in zip(train.harmonics, real_orders(train), strict=True):
        multiple = order / turns
        if multiple.denominator != 1:
            counted = "per turn of the reference shaft" if turns != 1 else "in multiples of the frequency"
            way = (
                f"multiply the orders of all loads by {multiple.denominator}, and write the frequency "
                f"{train.frequency / multiple.denominator:.10g}"
            )
            if train.units:
                way = (
                    'write speed = "1000 rpm" in place of the frequency: the period is then the common one of all loads'
                )
            raise ModelError(
                f"{load.name} has the order {order} {counted}, which is no whole multiple of {turns}; {way}"
            )
        found.append(int(multiple))
    return found


def _common(orders: Sequence[Fraction]) -> Fraction:
    bottom = math.lcm(*(order.denominator for order in orders))
    return Fraction(math.gcd(*(int(order * bottom) for order in orders)) or 1, bottom)


def _too_long(train: Train, orders: Sequence[Fraction], turns: Fraction, periods: Fraction) -> str:
    """Say that the common period is long, and which loads to leave out."""
    groups: dict[str, list[int]] = {}
    for place, load in enumerate(train.harmonics):
        groups.setdefault((load.mesh or load.turns_of) if isinstance(load, Counted) else "", []).append(place)
    hints = []
    for name, places in groups.items():
        left = [order for place, order in enumerate(orders) if place not in places and order]
        common = _common(left)
        if left and min(left) / common <= train.longest:
            what = f"the loads counted by {name}" if name else "the loads counted per turn of the reference shaft"
            hints.append(f"{what} ({_turns(1 / common)} remain)")
    first = [load.name for load in train.harmonics][orders.index(min(filter(None, orders)))]
    return (
        f"{first} repeats {periods} times before all loads repeat together, after {_turns(1 / turns)} of the reference "
        "shaft (a hunting tooth): each computation of an orbit takes that long"
        + (f"; leave out {' or '.join(hints)}" if hints else "; leave some orders out")
        + f", choose numbers of teeth with common factors, or write longest = {math.ceil(periods)} to allow it"
    )


def _turns(count: Fraction) -> str:
    return f"{count} turn" if count <= 1 else f"{count} turns"


def tooth_rate(train: Train, load: Counted, mesh: Mesh) -> Fraction:
    """Return the teeth of a planetary set that pass a planet per turn of the reference, forwards or backwards."""
    name, teeth = mesh.counted
    speeds = [Fraction(0) if each == GROUND else _speed(train, load, each)[0] for each in (name, mesh.carrier)]
    if speeds[0] == speeds[1]:
        raise ModelError(f"{load.name} counts teeth of {mesh.name}, which do not roll on each other as the train turns")
    return teeth * (speeds[0] - speeds[1])


def _gear(train: Train, load: Counted) -> Gear | Mesh:
    gears: dict[str, Any] = {gear.name: gear for gear in train.gears}
    for each in train.planetaries:
        meshes = {link.name: link for link in each.links if isinstance(link, Mesh) and link.counted[1]}
        if meshes:
            gears |= {each.name: next(iter(meshes.values()))} | meshes
        elif each.name == load.mesh:
            raise ModelError(
                f"{load.name} counts its order per tooth of {each.name}, which has a ratio alone; write teeth = "
                f"[30, 20, 70] for {each.name}: those of sun, planet and ring"
            )
    if isinstance(found := gears.get(load.mesh), Mesh):
        return found
    if load.mesh not in gears:
        raise ModelError(f"{load.name}.mesh is {load.mesh!r}, which is no gear; {did_you_mean(load.mesh, [*gears])}")
    if gears[load.mesh].teeth is None:
        raise ModelError(
            f"{load.name} counts its order per tooth of {load.mesh}, which has no teeth; write teeth = 27 for "
            f"{load.mesh}, the number of {gears[load.mesh].between[0]}"
        )
    return gears[load.mesh]


def _speed(train: Train, load: Counted, name: str) -> tuple[Fraction, tuple[str, ...]]:
    """Return the speed of an inertia over that of the reference, and the gears on which it depends."""
    inertias = [inertia.name for inertia in train.inertias]
    if name not in inertias:
        raise ModelError(f"{load.name}.turns_of is {name!r}, which is no inertia; {did_you_mean(name, inertias)}")
    speeds = train._exact_speeds
    if name not in speeds:
        raise ModelError(f"{load.name} counts turns of {name}, which no shafts and gears join to {train.reference}")
    row = {name: Fraction(1)}
    row[train.reference] = row.get(train.reference, 0) - speeds[name]
    between = {gear.name for gear in train.gears} if train.branches else train._whole.made_of(row)
    path = [gear for gear in train.gears if gear.name in between]
    if wrong := next((gear for gear in path if gear.exact_ratio is None), None):
        raise ModelError(
            f"{load.name} counts turns behind {wrong.name}, whose ratio {wrong.ratio!r} is no fraction of small "
            f"numbers, so the excitation would not repeat; write teeth = [27, 41] for {wrong.name}"
        )
    return speeds[name], tuple(gear.name for gear in path)


def phased_loads(train: Train) -> Iterator[Load | Counted]:
    """Iterate over the loads, with one for each planet in place of those that vary the meshes of planets apart.

    The phase of order n falls by n z_s times the angle between two planets on the carrier; that of the ring, too.
    """
    groups = {
        f"{each.name}_{what}": each
        for each in train.planetaries
        for what in ("sun", "ring")
        if len(each.places) > 1 and getattr(each, what) is not None
    }
    for each in train.harmonics:
        load = plain_load(each)
        named = [name for name in load.varies if name.partition(".")[0] in groups]
        if not named:
            yield each
            continue
        mesh = groups[named[0].partition(".")[0]]
        phased = "phase" in [parameter.name for parameter in load.parameters]
        if not isinstance(each, Counted) or not each.mesh or not phased or len(named) < len(load.varies):
            raise ModelError(
                f"{load.name}.varies names {named[0]}, the meshes of {mesh.planets} planets in different phases, so "
                f'it is a [[harmonic]] counted by their teeth; write mesh = "{mesh.name}", and leave out the rest'
            )
        link = _gear(train, each)
        assert isinstance(link, Mesh)
        way = math.copysign(1.0, tooth_rate(train, each, link))
        unit = train.units.of(QuantityKind.PHASE).factor if train.units else 1.0
        teeth = (mesh.teeth or (0,))[0]
        for place, angle in zip(mesh.places, mesh.angles, strict=True):
            shift = math.remainder(-way * float(each.exact_order) * teeth * angle, 2.0 * math.pi) / unit
            varies = {f"{n.partition('.')[0]}{place}.{n.partition('.')[2]}": value for n, value in load.varies.items()}
            phase: Any = vars(load)["phase"]
            yield with_load(
                each, replace(load, **{"phase": phase + shift, "varies": varies, "name": f"{load.name}{place}"})
            )


# Numbers of a train that its loads vary: stiffnesses of links, transmission errors, prescribed motions of inertias.
# See "Drive trains" in docs/numerics/notes/models.md.

_DISPLACED = ("deflection", "clearance", "angle")
_SPRINGS = ("stiffness", "stage1.stiffness")


def own_kinds(train: Train) -> dict[str, QuantityKind | None]:
    """Return the kinds of those quantities whose names do not tell it: None of fractions and of numbers of formulas."""
    found: dict[str, QuantityKind | None] = {}
    for load in map(plain_load, train.harmonics):
        displaced = any(name.rpartition(".")[2] in _DISPLACED for name in load.varies)
        found |= {f"{load.name}.{name}": QuantityKind.FREQUENCY for name in load.frequencies}
        for parameter in load.parameters if load.varies else ():
            if kind_of(f"{load.name}.{parameter.name}") is QuantityKind.TORQUE:
                found[f"{load.name}.{parameter.name}"] = QuantityKind.ANGLE if displaced else None
    for each in train.planetaries:
        found |= {f"{each.name}.{what}": kind_of(f"{each.name}.{what.rpartition('_')[2]}") for what in QUANTITIES[:-1]}
    return found | dict.fromkeys(formula_numbers(train))


def formula_numbers(train: Train) -> list[str]:
    """Return the names of the parameters of formulas, each of which has a unit of its own."""
    return [
        f"{part.name}.{name}"
        for part in (*train.forces, *train.drags)
        for name in part.numbers
        if part.law is not None or name == "quadratic"
    ]


def prescribed_inertias(train: Train) -> tuple[str, ...]:
    """Return the names of the inertias whose motion is prescribed."""
    varied = {name for load in map(plain_load, train.harmonics) for name in load.varies}
    return tuple(inertia.name for inertia in train.inertias if f"{inertia.name}.angle" in varied)


def gapless_links(train: Train) -> frozenset[str]:
    """Return the names of the links with a spring that acts always, whose stiffness varies."""
    varied = {name for load in map(plain_load, train.harmonics) for name in load.varies}
    return frozenset(
        link.name
        for link in train.links
        if link.acts_always and any(f"{link.name}.{each}" in varied for each in _SPRINGS)
    )


def displaced_gears(train: Train) -> frozenset[str]:
    """Return the gears whose ratio multiplies a prescribed motion, so that it is no parameter."""
    prescribed = prescribed_inertias(train)
    geared = [*train.gears, *(each for each in train.frictions if each.ratio is not None)]
    branched = bool(prescribed and train.branches)  # then mean speeds depend on all of them
    return frozenset(each.name for each in geared if branched or each.between[1] in prescribed)


def targets_of(
    train: Train, load: Load, links: Sequence[LinkForm]
) -> tuple[tuple[tuple[str, float], ...], tuple[tuple[int, float], ...]]:
    """Return the numbers and deflections of contacts that a load varies, and the linear links that it displaces."""
    numbers = {link.name: number for number, link in enumerate(train.links)}
    beside = {each.name for link in links for each in link.beside}
    varies: list[tuple[str, float]] = []
    displaces: list[tuple[int, float]] = []
    for name, factor in load.varies.items():
        first, _, rest = name.partition(".")
        moved: list[tuple[int, float]] = []
        if first in numbers and rest == "deflection":
            moved = [(numbers[first], 1.0)]
        elif first not in numbers and first not in beside:
            moved = [*_ends_at(train, first)]
        else:
            link = train.links[numbers[first]] if first in numbers else None
            apart = link is not None and link.centre and link.side is Side.BOTH and "." not in rest
            halves = ["positive.", "negative."] if apart else [""]
            varies += [(f"{first}.{half}{rest}", factor) for half in halves]
            if rest == "clearance" and first in numbers:  # a rigid stop has one too, which friction does not feel
                stops = [each for each in links[numbers[first]].beside if each.stages]
                varies += [(f"{each.name}.clearance", factor) for each in stops]
        for number, sign in moved:
            link = links[number]
            varies += [(f"{each.name}.deflection", factor * sign) for each in link.parts]
            if not (link.rigid or link.by_formula):
                displaces.append((number, factor * sign))
    return tuple(varies), tuple(displaces)


def _ends_at(train: Train, inertia: str) -> Iterator[tuple[int, float]]:
    """Iterate over the links that end at an inertia, with their deflections by its angle."""
    for number, link in enumerate(train.links):
        if link.row is not None:
            if inertia in link.row:
                yield number, float(link.row[inertia])
        elif link.between[0] == inertia:
            yield number, 1.0
        elif link.between[1] == inertia:
            yield number, -ratio_of(link)


def ratio_of(link: Link) -> float:
    """Return the ratio of a link; that of a shaft is 1."""
    ratio = link.ratio if isinstance(link, Gear | Friction) else None
    return 1.0 if ratio is None else ratio


def load_problems(train: Train) -> Iterator[str]:
    """List the errors of what the loads vary, and of inertias whose motion is prescribed."""
    links = {link.name: link for link in train.links}
    for load in map(plain_load, train.harmonics):
        displaced = {name.rpartition(".")[2] in _DISPLACED for name in load.varies}
        if len(displaced) > 1:
            yield (
                f"{load.name}.varies names a displacement, whose amplitude is an angle, and another number, whose "
                "amplitude is a fraction of it; write two loads"
            )
        for name in load.varies:
            if reason := _refusal(train, load, name, links):
                yield f"{load.name}.varies is {name!r}, {reason}"
        for parameter in load.parameters:
            value = getattr(load, parameter.name)
            if not has(Finite, value):
                yield f"{load.name}.{parameter.name} is {value!r}; it must be a number"
    yield from _prescription_problems(train)


def _refusal(train: Train, load: Load, name: str, links: Mapping[str, Link]) -> str:
    """Return the reason for which a load cannot vary something; empty if it can, as far as the train knows."""
    first, _, rest = name.partition(".")
    inertias = [inertia.name for inertia in train.inertias]
    jumps = load.has_levels
    if first in inertias:
        if rest != "angle":
            return f'which cannot vary; varies = "{first}.angle" prescribes the motion of {first}'
        return "which cannot jump; vary it by harmonics" if jumps else ""
    if any(first == each.name for link in links.values() for each in link.contacts() if each.name != link.name):
        return ""  # friction or a rigid stop beside springs
    if first not in links:
        return f"but there is no shaft or gear {first!r}; {did_you_mean(first, [*links, *inertias])}"
    link = links[first]
    if not rest:
        return f'which is no number; write varies = "{first}.stiffness" or "{first}.deflection"'
    if rest == "damping":
        return (
            f'but a damper that acts always does not vary; write varies = "{first}.stiffness", or a torque by a '
            "formula with a damping of its own"
        )
    if rest == "ratio":
        return f'but a ratio does not vary; varies = "{first}.deflection" is a transmission error'
    if link.is_rigid:
        return f"but {first} is rigid; write stiffness = ... for {first}"
    if rest == "deflection":
        return "which cannot jump; vary it by harmonics" if jumps else ""
    if isinstance(link, Force | Friction):
        return ""
    if rest in _SPRINGS and link.is_drag:
        return f"but {first} has no spring; write stiffness = ... for {first}"
    if rest == "clearance" and link.clearance is None and not link.stages:
        return f"but {first} has no clearance; write clearance = ... for {first}"
    if link.acts_always and rest in _SPRINGS and (link.numbers.keys() - OF_FRICTION or link.law is not None):
        return (
            f"but {first} has a spring that acts always and stages with a force law of their own; write two shafts "
            "between its inertias, one for the spring that varies"
        )
    return ""


def _prescription_problems(train: Train) -> Iterator[str]:
    prescribed = prescribed_inertias(train)
    for inertia in train.inertias:
        if inertia.name not in prescribed and inertia.inertia is None:
            yield (
                f"{inertia.name} has no inertia; write inertia = ..., or prescribe its motion by a load that "
                f'varies = "{inertia.name}.angle"'
            )
        elif inertia.name in prescribed and inertia.inertia is not None:
            yield (
                f"{inertia.name}.inertia is {inertia.inertia:g}, but its motion is prescribed, so it has no effect; "
                "leave it out"
            )
    if len(prescribed) == len(train.inertias):
        yield f"{prescribed[0]} and all other inertias have a prescribed motion, so nothing vibrates"
    acting = [(load.name, name) for load in map(plain_load, train.harmonics) for name in load.acts_on]
    for load, name in acting:
        if name in prescribed:
            yield f"{load}.acts_on names {name}, whose motion is prescribed; leave it out"
    for name in train.mean:
        if name in prescribed:
            yield f"mean names {name}, whose motion is prescribed; leave it out"
    if train.reaction in prescribed:
        yield f"reaction is {train.reaction!r}, whose motion is prescribed, so it takes the mean torques; leave it out"
    for link in train.links:
        ends = [*link.row] if link.row is not None else link.between
        held = [end for end in ends if end in (*prescribed, GROUND)]
        if len(held) == len(ends):
            yield f"{link.name} joins {held[0]} and {held[1]}, neither of which is free to move; leave it out"
        elif held and held[0] != GROUND and link.is_rigid:
            other = next(end for end in ends if end not in held)
            yield (
                f"{link.name} is rigid, so the motion of {other} is prescribed with that of {held[0]}; write stiffness "
                f"= ... for {link.name}, or prescribe the motion of {other} and leave {held[0]} out"
            )

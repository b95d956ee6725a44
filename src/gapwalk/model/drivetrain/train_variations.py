"""Numbers of a train that its loads vary: stiffnesses of links, transmission errors, prescribed motions of inertias.

Only springs in a contact vary over the angle. So a spring that acts always becomes a stage without a gap if, and only
if, a load varies its stiffness. A displacement of a spring or damper that acts always is a load, and needs no contact.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

from gapwalk.model.contact_parts import OF_FRICTION
from gapwalk.model.drivetrain.train_form import LinkForm
from gapwalk.model.drivetrain.train_orders import plain_load
from gapwalk.model.drivetrain.train_parts import GROUND, Gear, Link
from gapwalk.model.drivetrain.train_torques import Force, Friction
from gapwalk.model.loads import Load
from gapwalk.model.problems import did_you_mean
from gapwalk.model.units import QuantityKind, kind_of

if TYPE_CHECKING:
    from gapwalk.model.drivetrain.train import Train

_DISPLACED = ("deflection", "clearance", "angle")
_SPRINGS = ("stiffness", "stage1.stiffness")


def own_kinds(train: Train) -> dict[str, QuantityKind | None]:
    """Return the kinds of those quantities whose names do not tell it.

    A load that varies a stiffness is a fraction; one that varies a deflection is an angle. Parameters of formulas are
    of no kind.
    """
    found: dict[str, QuantityKind | None] = {}
    for load in map(plain_load, train.harmonics):
        displaced = any(name.rpartition(".")[2] in _DISPLACED for name in load.varies)
        found |= {f"{load.name}.{name}": QuantityKind.FREQUENCY for name in load.frequencies}
        for parameter in load.parameters if load.varies else ():
            if kind_of(f"{load.name}.{parameter.name}") is QuantityKind.TORQUE:
                found[f"{load.name}.{parameter.name}"] = QuantityKind.ANGLE if displaced else None
    for force in train.forces:
        found |= {f"{force.name}.{name}": None for name in force.numbers}
    return found


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
    return frozenset(each.name for each in geared if each.between[1] in prescribed)


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
            varies.append((name, factor))
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
        if link.between[0] == inertia:
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
            if isinstance(value, bool) or not isinstance(value, int | float):
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
    for load in map(plain_load, train.harmonics):
        yield from (
            f"{load.name}.acts_on names {name}, whose motion is prescribed; leave it out"
            for name in load.acts_on
            if name in prescribed
        )
    for name in train.mean:
        if name in prescribed:
            yield f"mean names {name}, whose motion is prescribed; leave it out"
    if train.reaction in prescribed:
        yield f"reaction is {train.reaction!r}, whose motion is prescribed, so it takes the mean torques; leave it out"
    for link in train.links:
        held = [end for end in link.between if end in (*prescribed, GROUND)]
        if len(held) == 2:
            yield f"{link.name} joins {held[0]} and {held[1]}, neither of which is free to move; leave it out"
        elif held and held[0] != GROUND and link.is_rigid:
            other = next(end for end in link.between if end != held[0])
            yield (
                f"{link.name} is rigid, so the motion of {other} is prescribed with that of {held[0]}; write stiffness "
                f"= ... for {link.name}, or prescribe the motion of {other} and leave {held[0]} out"
            )

"""Errors of a drive train: names, numbers, parts, and how they are connected."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator
from dataclasses import fields
from numbers import Real
from typing import TYPE_CHECKING, Any

from gapwalk.model.contact import RIGID
from gapwalk.model.contact_parts import OF_FRICTION, friction_name, stop_name
from gapwalk.model.drivetrain.train_form import tree_of
from gapwalk.model.drivetrain.train_orders import plain_load
from gapwalk.model.drivetrain.train_parts import GROUND, Gear, Link
from gapwalk.model.drivetrain.train_torques import Friction
from gapwalk.model.problems import did_you_mean

if TYPE_CHECKING:
    from gapwalk.model.drivetrain.train import Train

_RESERVED = ("frequency", "speed", "mass", "damping", "stiffness", "mean", "study", GROUND)


def name_problems(train: Train) -> Iterator[str]:
    """List names that no parameter can have, or that two parts have."""
    parts: Any = [("inertia", train.inertias), ("shaft", train.shafts), ("gear", train.gears), ("force", train.forces)]
    parts += [("friction", train.frictions), ("harmonic", train.harmonics)]
    counts = Counter(str(part.name) for _, group in parts for part in group)
    for kind, group in parts:
        for part in group:
            if not isinstance(part.name, str) or not part.name.isidentifier():
                yield f"{kind} name {part.name!r}: write a word of letters, digits and underscores"
            elif part.name in _RESERVED:
                yield f"{part.name} is taken as a name already; choose another one for the {kind}"
            elif counts[part.name] > 1:
                yield f"{part.name} has the name of another part; give each a name of its own"
            elif kind in ("shaft", "gear"):
                rigid = RIGID in (stage.stiffness for stage in part.stages)
                made = {friction_name(part.name): makes_friction(part), stop_name(part.name): rigid}
                for name in (name for name, exists in made.items() if exists and counts[name]):
                    yield f"{part.name} makes {name}, but another part has that name; choose another one for it"


def makes_friction(link: Link) -> bool:
    """Return True if a link has friction beside its springs."""
    return any(OF_FRICTION[0] in numbers for numbers in (link.numbers, *(stage.numbers for stage in link.stages)))


def number_problems(train: Train) -> Iterator[str]:
    """List the values that should be numbers, but are not."""
    for part in (*train.inertias, *train.links):
        for each in fields(part):
            value = getattr(part, each.name)
            if each.name in ("name", "between", "stages", "law", "numbers", "teeth", "normal") or (
                value is None and (each.default is None or isinstance(part, Friction))
            ):
                continue
            if each.name == "stiffness" and value == RIGID:
                continue
            if isinstance(value, bool) or not isinstance(value, Real):
                yield f"{part.name}.{each.name} is {value!r}; it must be a number"


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
        if (
            isinstance(link, Gear | Friction)
            and isinstance(link.ratio, int | float)
            and not 0 < abs(link.ratio) < math.inf
        ):
            meaning = "it must be the speed of the first inertia over that of the second"
            yield f"{link.name}.ratio is {link.ratio:g}; {meaning}"
    torques = [
        ("mean", train.mean),
        *((f"{each.name}.acts_on", each.acts_on) for each in map(plain_load, train.harmonics)),
    ]
    for what, names in torques:
        yield from (
            f"{what} names {name!r}, which is no inertia; {did_you_mean(name, inertias)}"
            for name in names
            if name not in inertias
        )
    if train.reference not in inertias:
        yield f"reference is {train.reference!r}, which is no inertia; {did_you_mean(train.reference, inertias)}"
    if train.reaction is not None:
        if train.reaction not in inertias:
            yield f"reaction is {train.reaction!r}, which is no inertia; {did_you_mean(train.reaction, inertias)}"
        elif train.mean.get(train.reaction):
            yield f"mean.{train.reaction} and reaction = {train.reaction!r} are both given; leave one of the two out"


def connection_problems(train: Train) -> Iterator[str]:
    """Report parts that are not connected, and parts that cannot move."""
    numbers, links = train._joined()
    tree = tree_of(links, numbers[GROUND])
    reached = {tree.root, *(step.child for step in tree.steps)}
    apart = [inertia.name for inertia in train.inertias if numbers[inertia.name] not in {*reached, numbers[GROUND]}]
    if apart:
        more = f", nor are {', '.join(apart[1:5])}{', ...' * (len(apart) > 5)}" if apart[1:] else ""
        to = "the ground" if tree.root == numbers[GROUND] else train.inertias[0].name
        yield f"{apart[0]} is not connected to {to}{more}; write a shaft or a gear between them"
        return
    held = any(GROUND in link.between and not link.is_drag for link in train.links)
    for link in train.links:
        if GROUND in link.between and link.is_drag and not held:
            if isinstance(link, Friction):
                yield (
                    f"{link.name} is friction against the ground, and nothing holds the train to the ground: its slip "
                    "is the speed at which the train turns as a whole, which is no part of the equations, and it never "
                    f"sticks; give {link.between[0]} its torque as a mean torque instead, or hold the train by a shaft"
                )
                continue
            drag = "a torque that depends on the rate alone" if link.only_follows else "damping, but no stiffness"
            yield (
                f"{link.name} has {drag}, and nothing else holds the train to the ground: its drag "
                "depends on the speed at which the train turns as a whole, which is no part of the equations; give "
                f"{link.between[0]} a mean torque instead, or {link.name} a stiffness"
            )
    drags = [link for link in (train.links[step.link] for step in tree.steps) if link.is_drag]
    for link in drags:
        held_by = [end for end in link.between if end != GROUND and numbers[end] == numbers[GROUND]]
        if held_by and tree.root != numbers[GROUND]:
            yield (
                f"{link.name} has damping, but no stiffness, and nothing else joins the train to {held_by[0]}, whose "
                "motion is prescribed; write a stiffness"
            )
        elif f"{link.name}_slip" in {part.name for part in (*train.inertias, *train.links)}:
            yield f"{link.name}_slip is the name of how far {link.name} slips; choose another one for the part"
    if not drags and all(link.rigid or link.drag or link.loose for link in links):
        link = next(link for link in train.links if link.is_rigid or link.is_drag)
        yield f"{link.name} is rigid, as all links are, so nothing vibrates; give a shaft or a gear stiffness"

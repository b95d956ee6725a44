"""Errors of a drive train: names, numbers, parts, and how they are connected."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator
from dataclasses import fields
from numbers import Real
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from gapwalk.model.contact import RIGID
from gapwalk.model.contact_parts import OF_FRICTION, friction_name, stop_name
from gapwalk.model.drivetrain.train_assembly import CONSISTENT, TrainNumbers
from gapwalk.model.drivetrain.train_form import LinkForm, tree_of
from gapwalk.model.drivetrain.train_orders import plain_load
from gapwalk.model.drivetrain.train_parts import GROUND, Gear, Link
from gapwalk.model.drivetrain.train_torques import Friction
from gapwalk.model.laws.formula import NUMPY_FUNCTIONS
from gapwalk.model.problems import did_you_mean
from gapwalk.model.units import QuantityKind

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


def slip_problems(train: Train, numbers: TrainNumbers) -> Iterator[str]:
    """List the drags between parts that turn at different speeds, with the loads that come nearest to them."""
    form, names = numbers.form, numbers.form.inertias
    scale = numbers.speeds[names.index(train.reference)] if train.reference in names else 1.0
    speeds = np.append(numbers.speeds / scale, 0.0)
    for place, (link, part) in enumerate(zip(train.links, form.links, strict=True)):
        (first, second), ratio = part.ends, numbers.ratios[place]
        slip = speeds[first] - ratio * speeds[second]
        held = not form.is_free and place not in form.tree.looped
        if held or not (part.drag or part.loose) or abs(slip) <= CONSISTENT * abs(speeds[first]):
            continue
        acts = [f"{names[first]} = -1.0"] + [f"{names[each]} = {ratio:.10g}" for each in (second,) if each < len(names)]
        lines = [f'name = "{link.name}"', f"amplitude = {_torque_in_slip(train, numbers, place, slip)}"]
        lines.append(f"acts_on = {{ {', '.join(acts)} }}")
        if part.drag and train.units and train.units.turns:
            lines += ["growth = 1", f'at = "{train.frequency:.10g} {train.units.parameter(train.units.pace)}"']
        where = "the ground" if second == form.ground else f"{names[second]}, which turns at another speed,"
        yield (
            f"{link.name} slips against {where} all the time as the train turns, and the equations have no such drag "
            f"yet: leave it out, and write its constant torque as a table [[steady]] with {', '.join(lines)}; "
            f"{_neglected(link, part, speeds)}"
        )


def _neglected(link: Link, part: LinkForm, speeds: NDArray[np.float64]) -> str:
    """Say what a constant torque in place of a drag neglects."""
    if isinstance(link, Friction):
        first, second = part.ends
        mesh = (
            "" if not speeds[second] else f". If it is in a mesh, write ratio = {speeds[first] / speeds[second]:.10g}"
        )
        return f"that is exact as long as the slip keeps its direction{mesh}"
    at = "that leaves" if part.drag else "that is its torque at this speed, and leaves"
    spring = (
        ""
        if part.ends[1] < len(speeds) - 1
        else (". A spring to the ground cannot stand for it: the mean torques of the train would flow through it")
    )
    return f"{at} out the damping of vibrations by {link.name}{spring}"


def _torque_in_slip(train: Train, numbers: TrainNumbers, place: int, slip: float) -> str:
    """Return the torque of a drag at the mean rate of its slip, as it is written; ``...`` if that is not known."""
    link, part, units = train.links[place], numbers.form.links[place], train.units
    if isinstance(link, Friction):
        limit = link.numbers.get("limit")
        torque = None if limit is None else math.copysign(limit, slip)
        return _written(torque, units.of(QuantityKind.TORQUE).text if units else "")
    if units is None or units.turns is None:  # then the speed of the train is no number of the model
        return "..."
    rate = slip * numbers.values[0] / float(units.turns) / units.angle
    contact = part.contact
    if contact is None:
        return _written(numbers.damping[place] * rate, "N m")
    formula: Any = contact.law
    names = [each.name for each in formula.parameters]
    given = dict(zip(names, numbers.form.numbers(contact.parameters, numbers.values), strict=True))
    moved = given | {"x": 0.0, "x'": rate, "v": rate}
    modes = formula.formula.modes_at(moved, NUMPY_FUNCTIONS)
    return _written(formula.formula.value(moved, NUMPY_FUNCTIONS, modes), "N m")


def _written(torque: float | None, unit: str) -> str:
    if torque is None:
        return "..."
    return f'"{torque:.10g} {unit}"' if unit else f"{torque:.6g}"

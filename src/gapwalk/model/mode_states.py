"""The states of a machine with gaps in which it has modes of its own: teeth, stages of a clutch, friction.

A gear is loose if a mesh alone joins it to the train, and no mean torque, reaction or load acts on it. Then only drags
press its teeth together, and its mesh may be closed or open.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from gapwalk.model.drivetrain.train_assembly import TrainAssembly
from gapwalk.model.modes import ModeState
from gapwalk.model.spring import Spring, springs_of
from gapwalk.model.system import System

_FEW = 4  # contacts of a system without gears of which each is opened alone


def mode_states(system: System) -> tuple[ModeState, ...]:
    """Return the states of a system: the first has the first stage of every contact closed, and friction slips."""
    springs = springs_of(system)
    closed = [int(bool(each.slopes)) for each in springs]
    gaps = [place for place, each in enumerate(springs) if any(slope.clearance > 0.0 for slope in each.slopes)]
    loose, meshes = loose_gears(system), _meshes(system)
    stages = [place for place in gaps if place not in meshes]
    dry, slips = bool(system.structure.friction), ", friction slips" * bool(system.structure.friction)
    first = "all closed" if gaps else "no gaps"
    found = [ModeState(f"{first}{slips}", tuple(closed))]
    found += [ModeState(f"{first}, friction sticks", tuple(closed), stuck=True)] * dry
    bare = [0 if place in loose else count for place, count in enumerate(closed)]
    gone = f", {_listed([springs[place].form.name for place in loose])} open" if loose else ""
    if loose:
        found.append(ModeState(f"{gone.removeprefix(', ')}{slips}", tuple(bare)))
    if not meshes and len(gaps) > 1:  # no train of gears
        stages = gaps if len(gaps) <= _FEW else []
        found.append(ModeState(f"all open{slips}", tuple(0 if place in gaps else n for place, n in enumerate(closed))))
    for place in stages:
        for count, words in _counts(springs[place]):
            own = tuple(count if place == each else n for each, n in enumerate(bare))
            found.append(ModeState(f"{springs[place].form.name} {words}{gone}{slips}", own))
    return tuple(found)


def _counts(spring: Spring) -> Iterator[tuple[int, str]]:
    """Yield the other numbers of closed stages of a contact, in words; those of both sides where they differ."""
    yield 0, "within its gap"
    sides = {sign: [each for each in spring.slopes if each.sign == sign] for sign in (1, -1)}
    first = 1 if sides[1] else -1
    for sign in (first, -first):
        for count, each in enumerate(sides[sign], start=1):
            pair = sides[-sign][count - 1 : count]
            known = sign != first and pair and pair[0].stiffness == each.stiffness
            if not known and (count, sign) != (1, first):
                yield sign * count, f"in {each.stage or f'stage {count}'}{'+' if sign > 0 else '-'}"


def _meshes(system: System) -> dict[int, int]:
    """Return the links of the contacts that are teeth, by the numbers of the contacts."""
    assembly = system.structure.assembly
    if not isinstance(assembly, TrainAssembly):
        return {}
    form = assembly.form
    return {
        place: link
        for place, (link, contact) in enumerate(form.contacts)
        if form.links[link].geared and contact.stages and not contact.law.is_dry
    }


def loose_gears(system: System) -> tuple[int, ...]:
    """Return the numbers of the contacts that are teeth of loose gears."""
    assembly, meshes = system.structure.assembly, _meshes(system)
    if not meshes or not isinstance(assembly, TrainAssembly):
        return ()
    form = assembly.form
    held = {form.ground, *(each for load in form.torques for each in load.acts_on)}
    held |= {number for number in form.loaded if system[f"mean.{form.inertias[number]}"]}
    held |= set() if form.reaction is None else {form.reaction}
    joins = [link.ends for link in form.links if not (link.drag or link.loose or link.own is not None)]
    found = []
    for place, link in meshes.items():
        ends = form.links[link].ends
        others = [pair for pair in joins if pair != ends or joins.count(pair) > 1]
        parts = _parts(form.ground + 1, others)
        if len({*parts[[*ends]]}) > 1 and not {*parts[[*ends]]} <= {*parts[[*held]]}:
            found.append(place)
    return tuple(found)


def _parts(count: int, joins: list[tuple[int, int]]) -> NDArray[np.intp]:
    """Return the number of the part to which each inertia belongs, and the ground."""
    from scipy.sparse import coo_array  # slow to import
    from scipy.sparse.csgraph import connected_components

    rows, columns = np.array(joins, dtype=int).reshape(-1, 2).T
    return connected_components(coo_array((np.ones(len(joins)), (rows, columns)), (count, count)), directed=False)[1]


def _listed(names: list[str]) -> str:
    if len(names) > _FEW:
        return f"{len(names)} loose gears"
    return f"{', '.join(names[:-1])} and {names[-1]}" if names[1:] else names[0]

"""Drive trains without their numbers as plain JSON values, and back."""

from __future__ import annotations

import math
from typing import Any

from gapwalk.model.structure import Structure
from gapwalk.model.train.assembly import TrainAssembly, structure_of
from gapwalk.model.train.form import LinkForm, TorqueForm, TrainForm
from gapwalk.model.units import QuantityKind, Unit, Units
from gapwalk.study.store.plain_parts import contact_of, harmonic_of, plain_contact, plain_harmonic, word


def plain_train(assembly: TrainAssembly) -> dict[str, Any]:
    """The parts of a train and how they hang together."""
    form = assembly.form
    return {
        "inertias": list(form.inertias),
        "links": [
            {
                "name": link.name,
                "ends": list(link.ends),
                "geared": link.geared,
                "fixed": link.fixed,
                "rigid": link.rigid,
                "always": link.always,
                "contact": plain_contact(link.contact) if link.contact else None,
            }
            for link in form.links
        ],
        "torques": [{**plain_harmonic(torque.harmonic), "acts_on": list(torque.acts_on)} for torque in form.torques],
        "reaction": form.reaction,
        "units": None if assembly.units is None else _plain_units(assembly.units),
    }


def train_of(plain: dict[str, Any]) -> Structure:
    """The structure of the train; any of KeyError, TypeError, ValueError if there is none of this kind."""
    count = len(plain["inertias"])
    links = tuple(
        LinkForm(
            word(link["name"]),
            _ends(link["ends"], count + 1),
            bool(link["geared"]),
            None if link["fixed"] is None else float(link["fixed"]),
            bool(link["rigid"]),
            bool(link["always"]),
            None if link["contact"] is None else contact_of(link["contact"]),
        )
        for link in plain["links"]
    )
    torques = tuple(
        TorqueForm(harmonic_of(torque), tuple(_number(each, count) for each in torque["acts_on"]))
        for torque in plain["torques"]
    )
    reaction = None if plain["reaction"] is None else _number(plain["reaction"], count)
    form = TrainForm(tuple(word(name) for name in plain["inertias"]), links, torques, reaction)
    units = plain.get("units")
    return structure_of(TrainAssembly(form, None if units is None else _units_of(units)))


def _plain_units(units: Units) -> dict[str, Any]:
    chosen = {kind.name: {"unit": unit.text, "factor": unit.factor} for kind, unit in units.chosen}
    return {"chosen": chosen, "turns": units.turns}


def _units_of(plain: dict[str, Any]) -> Units:
    chosen = []
    for name, unit in plain["chosen"].items():
        text, factor = str(unit["unit"]), float(unit["factor"])
        if not 0.0 < factor < math.inf or not text.isprintable():
            raise ValueError(f"{text!r} is no unit")
        chosen.append((QuantityKind[name], Unit(text, factor)))
    turns = plain["turns"]
    if turns is not None and not (isinstance(turns, int) and turns >= 1):
        raise ValueError(f"{turns!r} is no number of periods in a turn")
    return Units(tuple(chosen), turns)


def _ends(given: Any, count: int) -> tuple[int, int]:
    first, second = given
    return _number(first, count), _number(second, count)


def _number(given: Any, count: int) -> int:
    if given not in range(count):
        raise ValueError(f"{given!r} is the number of no inertia")
    return int(given)

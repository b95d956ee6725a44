"""``gapwalk modes``: static equilibria of a system, and its natural frequencies and modes about them."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gapwalk.cli.output import DONE, print_json, show, show_files
from gapwalk.errors import ModelError
from gapwalk.model.coefficients import load_sizes
from gapwalk.model.doubts import reaction_hint, train_doubts
from gapwalk.model.drivetrain.train_assembly import TrainAssembly
from gapwalk.model.equilibria import Equilibrium, Rest, find_equilibria
from gapwalk.model.model_source import read_source
from gapwalk.model.modes import Clearances, Modes, find_modes
from gapwalk.model.system import System
from gapwalk.model.units import Units
from gapwalk.model.words import parameter_symbol
from gapwalk.results.codec import plain
from gapwalk.studies.set_values import parse_changes
from gapwalk.studies.study_file import check_system
from gapwalk.summary import Table

_COLUMNS = 8  # most entries of a mode that get a column each; of longer modes the largest entries are named
_LARGEST = 3
_ROWS = 30  # modes that are printed; --json has all of them


def show_modes(file: Path, changes: list[str], picture: Path | None, *, json: bool) -> int:
    """Print the static equilibria of the system of a model file, and its modes; a study is not needed."""
    model, system = check_system(read_source(file), parse_changes(changes))
    title = model.title
    rest = find_equilibria(system)
    found = [(f"about the static equilibrium ({each})", find_modes(system, each)) for each in rest.equilibria]
    closed, reason = _closed(system)
    if closed is not None and not any(np.array_equal(closed.frequencies, each.frequencies) for _, each in found):
        found.append((_closed_words(system), closed))
    fixed = {each: find_modes(system, each) for each in _fixed(system)} if closed is not None else {}
    found += [(_closed_words(system, each), modes) for each, modes in fixed.items()]
    if picture is not None and not found:
        raise ModelError(f"there are no modes to draw: there is no static equilibrium, and {reason}")
    if picture is not None:
        from gapwalk.plot import save

        save(found[0][1], picture, system=system, title=title)
    if json:
        print_json(_document(title, system, rest, closed, fixed, picture))
        return DONE
    lines = [*variation_lines(system), *_rest_lines(rest, system.units), *[f"  {reason}"] * bool(reason)]
    lines += [f"  {note}" for note in rest.notes]
    show([title or str(file), *train_lines(system), *lines, *(f"warning: {each}" for each in train_doubts(system))])
    for heading, modes in found:
        if not len(modes):
            show([f"\nNatural vibrations {heading}: none, because nothing can move"])
            continue
        show([f"\nNatural vibrations {heading}:", _table(modes, system)])
        if len(modes) > _ROWS:
            last = _number(modes.frequencies[-1])
            show([f"... and {len(modes) - _ROWS} more, up to W = {last} (--json has all)"])
    if picture is not None:
        show_files([picture])
    return DONE


def _closed(system: System) -> tuple[Modes | None, str]:
    """Return the modes with all contacts closed; or None and the reason why there are none."""
    try:
        return find_modes(system, "closed"), ""
    except ModelError as error:
        return None, str(error)


def _fixed(system: System) -> list[Clearances]:
    """Return the linearisations in which friction sticks, or stops are held, if the system has such contacts."""
    held = any(form.law.rebounds for form in system.structure.contacts)
    return [Clearances.STUCK] * bool(system.structure.friction) + [Clearances.HELD] * held


def _closed_words(system: System, at: Clearances = Clearances.CLOSED) -> str:
    """Describe a linearisation that does not depend on the load."""
    contacts = system.structure.contacts
    stages = [form for form in contacts if form.stages and not form.law.rebounds]
    words = ["with the first stage of every contact closed"] * bool(stages)
    rigid = "held" if at == Clearances.HELD else "open"
    words += [f"with rigid stops {rigid}"] * any(form.law.rebounds for form in contacts)
    formulas = any(not (form.stages or form.law.is_dry) for form in contacts)
    words += ["at zero deflection of the forces by formulas"] * formulas
    words += ["with dry friction that sticks"] * (at != Clearances.CLOSED and bool(system.structure.friction))
    return ", and ".join(words) or "with the first stage of every contact closed"


def variation_lines(system: System) -> list[str]:
    """Say in a line how what varies over the angle enters static equilibria and modes; no line if nothing varies."""
    names = {False: [], True: []}
    for each in system.structure.variations:
        form = system.structure.contacts[each.contact]
        if each.is_deflection:
            name = form.vectors[form.law.arguments.index(each.name)]
        else:
            name = f"{form.name if each.stage < 0 else form.stage_prefix(form.stages[each.stage])}.{each.name}"
        names[each.is_deflection].append(name)
    varied, moved = (", ".join(dict.fromkeys(names[which])) for which in (False, True))
    words = [f"{varied} at the mean value"] * bool(varied) + [f"{moved} without prescribed displacement"] * bool(moved)
    return [f"  what varies over the angle is left out: {', '.join(words)}"] if words else []


def train_lines(system: System) -> list[str]:
    """Describe a drive train as a whole; return no lines for another system."""
    assembly = system.structure.assembly
    if not isinstance(assembly, TrainAssembly):
        return []
    form = assembly.form
    links = [link for link in form.links if not (link.loose or link.drag or link.own is not None)]
    gears = sum(link.geared for link in links)
    meshes = sum(bool(link.row) and not link.geared for link in links)
    counts = {"inertia": len(form.inertias), "shaft": len(links) - gears - meshes, "gear": gears}
    counts |= {"mesh of planets": meshes} if meshes else {}
    counts |= {"drag": len(form.links) - len(links)} if form.turning else {}
    plural = {"mesh of planets": "meshes of planets"}
    parts = ", ".join(f"{n} {word if n == 1 else plural.get(word, f'{word}s')}" for word, n in counts.items())
    if not form.is_free:
        unbalanced = assembly.numbers(system.values).unbalanced if len(form.held) < 2 else 0.0
        lines = [f"  train: {parts}; connected to the ground"]
        if unbalanced:
            size = f"{abs(unbalanced):.6g}{' N m' if system.units else ''}"
            hint = reaction_hint(assembly, system)
            lines.append(f"  the ground takes the mean torques, {size} at {form.inertias[0]}; or write {hint}")
        return lines
    return [f"  train: {parts}; free to rotate as a whole; this rotation is removed"]


def _rest_lines(rest: Rest, units: Units | None) -> list[str]:
    if not rest:
        reason = ": nothing balances the mean load" if rest.complete else " was found"
        return [f"  no static equilibrium{reason}"]
    angle, torque = (f" {units.signal('')[1]}", " N m") if units else ("", "")
    lines = []
    for each in rest.equilibria:
        forces = ", ".join(
            f"{contact.name} {contact.force:.4g}{torque}"
            if contact.slips
            else f"{contact.name} {contact.deflection:.4g}{angle} (force {contact.force:.4g}{torque})"
            for contact in each.contacts
        )
        lines.append(f"  static equilibrium with {each}{forces and f': {forces}'}")
    return [*lines, *["  there may be more static equilibria"] * (not rest.complete)]


def _table(modes: Modes, system: System) -> Table:
    resonances = resonance_values(system, modes) if system.units else {}
    rates = ("rad/s", "Hz") if system.units else ("W", "W / 2 pi")
    names, shapes = (modes.inertias, modes.angles) if modes.inertias else (modes.coordinates, modes.shapes)
    is_wide = len(names) > _COLUMNS
    headings = [f">{each}" for each in ("mode", *rates, *resonances, "damping", *(() if is_wide else names))]
    rows = []
    for number, (frequency, ratio) in enumerate(zip(modes.frequencies[:_ROWS], modes.damping_ratios, strict=False)):
        entries = [_entry(entry) for entry in shapes[:, number]]
        if is_wide:
            most = np.argsort(-np.abs(shapes[:, number]), kind="stable")[:_LARGEST]
            # without a blank between: a line is not broken there
            entries = [", ".join(f"{names[place]}:{entries[place]}" for place in most)]
        numbers = (frequency, frequency / (2 * math.pi), *(values[number] for values in resonances.values()), ratio)
        rows.append([str(modes.numbers[number] or "-"), *map(_number, numbers), *entries])
    spare = [f">{each}" for each in (_weakest_first(system, list(resonances)) if resonances else ())[:-1]]
    return Table([*headings, "moves most"] if is_wide else headings, rows, spare=spare)


def resonance_values(system: System, modes: Modes) -> dict[str, NDArray[np.float64]]:
    """Return values of the first parameter at which each order of the excitation meets each mode, by headings."""
    structure, units = system.structure, system.units
    orders = sorted({order for load in structure.harmonics for order in load.multiples})
    turns = 1 if units is None else units.turns or 1
    symbol = parameter_symbol(structure.pace, units)
    return {f"{symbol}, order {order * turns}": modes.frequencies / order / structure.frequency for order in orders}


def _weakest_first(system: System, headings: list[str]) -> list[str]:
    """Return the headings of orders in `resonance_values`, that of the weakest excitation first."""
    orders = sorted({order for load in system.structure.harmonics for order in load.multiples})
    sizes = load_sizes(system)
    of = {heading: sizes.get(order, 0.0) for heading, order in zip(headings, orders, strict=True)}
    return sorted(headings, key=lambda each: of[each])


def _entry(value: float | complex) -> str:
    """Write an entry of a mode; a complex one with the angle, in degrees, by which it is ahead."""
    if not isinstance(value, complex):
        return f"{value:+.3f}"
    return f"{abs(value):.3f} {round(math.degrees(math.atan2(value.imag, value.real))):+d}°"


def _number(value: float) -> str:
    return "" if math.isnan(value) else f"{value:.6g}"


def _document(
    title: str, system: System, rest: Rest, closed: Modes | None, fixed: dict[Clearances, Modes], picture: Path | None
) -> dict[str, Any]:
    return {
        "title": title,
        "coordinates": list(system.coordinates),
        "inertias": list(closed.inertias) if closed else [],
        "complete": rest.complete,
        "notes": list(rest.notes),
        "rest": [_rest_document(system, each) for each in rest.equilibria],
        "closed": _modes_document(closed) if closed else None,
        **{each.value: _modes_document(modes) for each, modes in fixed.items()},
        "resonances": plain(resonance_values(system, closed)) if closed else None,
        "picture": None if picture is None else str(picture),
    }


def _rest_document(system: System, rest: Equilibrium) -> dict[str, Any]:
    return {
        "position": dict(zip(system.coordinates, rest.position.tolist(), strict=True)),
        "contacts": [{**plain(contact), "open": contact.is_open} for contact in rest.contacts],
        "loose": rest.loose,
        "stable": rest.stable,
        "modes": _modes_document(find_modes(system, rest)),
    }


def _modes_document(modes: Modes) -> list[dict[str, Any]]:
    columns = (modes.numbers, modes.frequencies, modes.damping_ratios, modes.shapes.T, modes.angles.T)
    return [
        {
            **{"number": number, "frequency": frequency, "damping_ratio": ratio},
            "shape": dict(zip(modes.coordinates, shape, strict=True)),
            "angles": dict(zip(modes.inertias, angles, strict=True)),
        }
        for number, frequency, ratio, shape, angles in zip(*map(plain, columns), strict=True)
    ]

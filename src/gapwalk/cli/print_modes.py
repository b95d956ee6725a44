"""``gapwalk modes``: static equilibria of a system, and its natural frequencies and modes about them."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich import box
from rich.table import Table

from gapwalk.cli.console import console
from gapwalk.cli.outcome import DONE, print_json, printable
from gapwalk.model.drivetrain.train_assembly import TrainAssembly
from gapwalk.model.equilibria import Equilibrium, Rest, rest_of
from gapwalk.model.model_file import check_system, in_order
from gapwalk.model.model_source import read_source
from gapwalk.model.modes import Modes, modes_of
from gapwalk.model.problems import ModelFileError
from gapwalk.model.system import System
from gapwalk.model.units import Units
from gapwalk.plot.words import parameter_symbol
from gapwalk.studies.changes import change_source, change_system, parse_changes

_COLUMNS = 8  # most entries of a mode that get a column each; of longer modes the largest entries are named
_LARGEST = 3
_ROWS = 30  # modes that are printed; --json has all of them


def show_modes(file: Path, changes: list[str], picture: Path | None, *, json: bool) -> int:
    """Print the static equilibria of the system of a model file, and its modes; a study is not needed."""
    title, system = _read(file, changes)
    rest = rest_of(system)
    found = {f"about the static equilibrium ({each})": modes_of(system, each) for each in rest.equilibria}
    closed = modes_of(system, "closed")
    if not any(np.array_equal(closed.frequencies, each.frequencies) for each in found.values()):
        found["with the first stage of every contact closed"] = closed
    if picture is not None:
        from gapwalk.plot import save

        save(next(iter(found.values())), picture, system=system, title=title)
    if json:
        print_json(_document(title, system, rest, closed, picture))
        return DONE
    screen = console()
    for line in [printable(title) or str(file), *train_lines(system), *_rest_lines(rest, system.units)]:
        screen.print(line, soft_wrap=True)
    for heading, modes in found.items():
        screen.print(f"\nNatural vibrations {heading}:", soft_wrap=True)
        screen.print(_table(modes, system))
        if len(modes) > _ROWS:
            screen.print(
                f"... and {len(modes) - _ROWS} more, up to W = {_number(modes.frequencies[-1])} (--json has all)"
            )
    if picture is not None:
        screen.print(f"written: {picture}", soft_wrap=True)
    return DONE


def _read(file: Path, changes: list[str]) -> tuple[str, System]:
    source, rest, problems = change_source(read_source(file), parse_changes(changes))
    part, found = check_system(source)
    problems += found
    if part is None or problems:
        raise ModelFileError(in_order(problems))
    system, problems = change_system(part.system(), source, {}, rest)
    if problems:
        raise ModelFileError(problems)
    return part.title, system


def train_lines(system: System) -> list[str]:
    """Describe a drive train as a whole; return no lines for another system."""
    assembly = system.structure.assembly
    if not isinstance(assembly, TrainAssembly):
        return []
    form = assembly.form
    gears = sum(link.geared for link in form.links)
    parts = f"{len(form.inertias)} inertias, {len(form.links) - gears} shafts, {gears} gears"
    if not form.is_free:
        return [f"  train: {parts}; connected to the ground"]
    lines = [f"  train: {parts}; free to rotate as a whole; this rotation is removed"]
    acceleration = assembly.acceleration(system.values)
    if np.abs(assembly.mean(system.values)).max() > 0 and np.abs(acceleration).max() > 0:
        first, units = form.inertias[0], system.units
        size = f"{acceleration[0] * units.angle:.6g} rad/s^2" if units else f"{acceleration[0]:.6g}"
        lines.append(
            f"  mean torques do not balance: it accelerates steadily, {first} at {size}; "
            f'reaction = "{form.inertias[-1]}" would balance them'
        )
    return lines


def _rest_lines(rest: Rest, units: Units | None) -> list[str]:
    if not rest:
        lost = (
            "no static equilibrium: the mean load drives it away"
            if rest.complete
            else "no static equilibrium was found"
        )
        return [f"  {lost}"]
    lines, angle, torque = [], "", ""
    if units:
        angle, torque = f" {units.signal('')[1]}", " N m"
    for each in rest.equilibria:
        forces = ", ".join(
            f"{contact.name} {contact.deflection:.4g}{angle} (force {contact.force:.4g}{torque})"
            for contact in each.contacts
        )
        lines.append(f"  static equilibrium with {each}" + (f": {forces}" if forces else ""))
    if not rest.complete:
        lines.append("  there may be more static equilibria")
    return lines


def _table(modes: Modes, system: System) -> Table:
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, show_edge=False)
    resonances = resonance_values(system, modes) if system.units else {}
    rates = ("rad/s", "Hz") if system.units else ("W", "W / 2 pi")
    for heading in ("mode", *rates, *resonances, "damping"):
        table.add_column(heading, justify="right")
    names, shapes = (modes.inertias, modes.angles) if modes.inertias else (modes.coordinates, modes.shapes)
    if wide := len(names) > _COLUMNS:
        table.add_column("moves most")
    else:
        for name in names:
            table.add_column(name, justify="right")
    for number, (frequency, ratio) in enumerate(zip(modes.frequencies[:_ROWS], modes.damping_ratios, strict=False)):
        shape = shapes[:, number]
        entries = [_largest(names, shape)] if wide else [f"{entry:+.3f}" for entry in shape]
        rates = (frequency, frequency / (2 * math.pi), *(values[number] for values in resonances.values()), ratio)
        table.add_row(str(number + 1), *map(_number, rates), *entries)
    return table


def resonance_values(system: System, modes: Modes) -> dict[str, NDArray[np.float64]]:
    """Return values of the first parameter at which each order of the excitation meets each mode, by headings."""
    structure, units = system.structure, system.units
    orders = sorted({harmonic.order for harmonic in structure.harmonics})
    turns = 1 if units is None else units.turns or 1
    symbol = parameter_symbol(structure.pace, units)
    return {f"{symbol}, order {order * turns}": modes.frequencies / order / structure.frequency for order in orders}


def _largest(names: tuple[str, ...], shape: NDArray[np.float64]) -> str:
    most = np.argsort(-np.abs(shape), kind="stable")[:_LARGEST]
    return ", ".join(f"{names[place]} {shape[place]:+.3f}" for place in most)


def _number(value: float) -> str:
    return "" if math.isnan(value) else f"{value:.6g}"


def _document(title: str, system: System, rest: Rest, closed: Modes, picture: Path | None) -> dict[str, Any]:
    return {
        "title": title,
        "coordinates": list(system.coordinates),
        "inertias": list(closed.inertias),
        "complete": rest.complete,
        "rest": [_rest_document(system, each) for each in rest.equilibria],
        "closed": _modes_document(closed),
        "resonances": {name: _plain(values) for name, values in resonance_values(system, closed).items()},
        "picture": None if picture is None else str(picture),
    }


def _rest_document(system: System, rest: Equilibrium) -> dict[str, Any]:
    return {
        "position": dict(zip(system.coordinates, rest.position.tolist(), strict=True)),
        "contacts": [
            {
                "name": contact.name,
                "open": contact.is_open,
                "side": contact.side,
                "closed": list(contact.closed),
                "deflection": contact.deflection,
                "force": contact.force,
            }
            for contact in rest.contacts
        ],
        "loose": rest.loose,
        "stable": rest.stable,
        "modes": _modes_document(modes_of(system, rest)),
    }


def _plain(values: NDArray[np.float64]) -> list[float | None]:
    return [None if math.isnan(value) else value for value in values.tolist()]


def _modes_document(modes: Modes) -> list[dict[str, Any]]:
    return [
        {
            "frequency": None if math.isnan(frequency) else frequency,
            "damping_ratio": None if math.isnan(ratio) else ratio,
            "shape": dict(zip(modes.coordinates, modes.shapes[:, number].tolist(), strict=True)),
            "angles": dict(zip(modes.inertias, modes.angles[:, number].tolist(), strict=True)),
        }
        for number, (frequency, ratio) in enumerate(
            zip(modes.frequencies.tolist(), modes.damping_ratios.tolist(), strict=True)
        )
    ]

"""Doubts about a system that is in order: its damping, shafts without a spring, mean torques that do not balance."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from gapwalk.model.drivetrain.train_assembly import TrainAssembly
from gapwalk.model.modes import dissipation_doubts
from gapwalk.model.system import System
from gapwalk.model.words import value_words


def doubts_of(system: System) -> list[str]:
    """Return the doubts about a system, a sentence each."""
    return [*dissipation_doubts(system), *train_doubts(system)]


def train_doubts(system: System) -> Iterator[str]:
    """Yield the doubts about a drive train as a whole."""
    assembly = system.structure.assembly
    if not isinstance(assembly, TrainAssembly):
        return
    form, units = assembly.form, system.units
    for link in form.links:
        if link.drag and link.own is None and not link.row and form.ground not in link.ends:
            one, other = (form.inertias[end] for end in link.ends)
            yield (
                f'shaft "{link.name}" has no stiffness: {one} and {other} turn against each other, with its damping '
                "alone between them; write its stiffness, or [[drag]] if that is meant"
            )
    numbers = assembly.numbers(system.values)
    unbalanced = numbers.unbalanced if form.is_free and len(form.held) < 2 else 0.0
    if not unbalanced:
        return
    acceleration = unbalanced / float(np.sum(numbers.inertia * numbers.speeds**2))
    size = f"{acceleration * units.angle:.6g} rad/s^2" if units else f"{acceleration:.6g}"
    steady = assembly.balanced_at(system.values) if form.turning else None
    found = "" if steady is None else f"; at {value_words(steady, system.structure.pace, units, 6)} drags balance them"
    yield (
        f"mean torques do not balance: the train accelerates, {form.inertias[0]} by {size}{found}; "
        f"{reaction_hint(assembly, system)} would balance them"
    )


def reaction_hint(assembly: TrainAssembly, system: System) -> str:
    """Write the key that lets the last inertia without a torque take the mean torques."""
    taken = np.flatnonzero(assembly.numbers(system.values).torques[0] == 0.0)
    return f'reaction = "{assembly.form.inertias[taken[-1] if len(taken) else -1]}"'

"""The measure of motions that the table, the pictures, the page and the files of a study show."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from gapwalk.model.coefficients import coefficients_of, layout_of
from gapwalk.model.measures import full_measure
from gapwalk.model.system import System


def shown_measure(system: System, asked: object) -> str:
    """Return the measure of a request or of its record: the one it names, or the amplitude of what it is about."""
    # That is the coordinate that deflects the first gap most that it names, or its first signal; else the first one.
    if isinstance(measure := getattr(asked, "measure", None), str) and measure:
        return full_measure(measure, system.coordinates)
    coordinates, contacts = system.coordinates, [form.name for form in system.structure.contacts]
    for name in filter(lambda each: isinstance(each, str), _named(asked)):  # a record may have a method of this name
        if (base := name.rstrip("'")) in coordinates:
            return f"half.{base}"
        owners = [each for each in contacts if f"{name}.".startswith(f"{each}.")]
        if owners and (moved := moved_by(system, max(owners, key=len))):
            return f"half.{moved[0]}"
    return f"half.{coordinates[0]}"


def _named(asked: object) -> Iterator[str]:
    """Yield the gaps, signals and parameters that a request or a record is about."""
    for goal in getattr(asked, "goals", ()):
        yield getattr(goal, "gap", "") or getattr(goal, "signal", "")
    yield from getattr(asked, "gaps", ())
    yield from getattr(getattr(asked, "spreads", None), "varied", ())
    yield getattr(asked, "signal", "") or ""


def moved_by(system: System, gap: str) -> list[str]:
    """Return the coordinates that deflect a gap, those that deflect it most first."""
    place = [contact.name for contact in system.structure.contacts].index(gap)
    slots = layout_of(system.structure).contacts[place]
    vector = np.abs(coefficients_of(system)[slots.deflection])
    return [system.coordinates[k] for k in np.argsort(-vector, kind="stable").tolist() if vector[k]]

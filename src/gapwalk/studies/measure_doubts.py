"""Doubts about the measure that a study shows: one that a rigid stop holds at its clearance shows nothing."""

from __future__ import annotations

import numpy as np

from gapwalk.model.system import System
from gapwalk.studies.options import BranchOptions
from gapwalk.studies.study_kind import StudyKind


def measure_doubts(system: System, options: StudyKind) -> list[str]:
    """Describe what is wrong with the measure that a study of branches shows, a sentence each.

    Beyond the clearance of a rigid stop there is no motion: where the stop is struck, the largest value of its
    coordinate is that clearance, whatever the motion does.
    """
    if not isinstance(options, BranchOptions):
        return []
    kind, _, coordinate = options.measure.partition(".")
    if coordinate not in system.coordinates:
        return []
    above, below = _stops(system, coordinate)
    held = {"max": above, "min": below, "half": above if below else ""}.get(kind, "")
    if not held:
        return []
    both = f"{above} and {below}" if kind == "half" and above != below else held
    clearance, struck = ("clearances", "they are") if both != held else ("clearance", "it is")
    other = f"rms.{coordinate}" if above and below else f"half.{coordinate}"
    return [
        f"{options.measure} is the {clearance} of {both} wherever {struck} struck, for a rigid stop lets nothing "
        f'beyond; write measure = "{other}", which shows the motion'
    ]


def _stops(system: System, coordinate: str) -> tuple[str, str]:
    """Return the rigid stops that bound a coordinate alone, above and below; empty for none."""
    place, found = system.coordinates.index(coordinate), ["", ""]
    moved = {variation.contact for variation in system.structure.variations if variation.is_deflection}
    for number, form in enumerate(system.structure.contacts):
        vector = system.vector(form.vectors[0])
        if form.law.rebounds and number not in moved and np.flatnonzero(vector).tolist() == [place]:
            for contact, side, _ in system.breakpoints:
                if contact == number:
                    found[0 if side * vector[place] > 0.0 else 1] = form.name
    return found[0], found[1]

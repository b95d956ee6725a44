"""The force law of the coordinate that keeps the time of a second tone, and systems that have one."""

from __future__ import annotations

from gapwalk.model.laws import Expression
from gapwalk.model.system import System

CLOCK = "frequency*frequency*x + frequency*(x*x + (v/frequency)*(v/frequency) - 1)*v"
"""Force of the self-excited oscillator whose only stable motion is ``cos(frequency t)``."""


def has_tone(system: System) -> bool:
    """Return True if a system has a second tone: then its tori have a known rotation number, and nothing locks."""
    return any(form.law == Expression(CLOCK) for form in system.structure.contacts)

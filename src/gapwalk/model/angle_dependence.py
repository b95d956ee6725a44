"""Dependence of the equations of a system on the angle of its excitation: by loads, or by numbers that vary."""

from __future__ import annotations

from gapwalk.model.coefficients import coefficients_of, layout_of
from gapwalk.model.system import System


def loads_act(system: System) -> bool:
    """Return True if a load that depends on the angle acts on a system."""
    layout, coefficients = layout_of(system.structure), coefficients_of(system)
    first = 2 * layout.structure.size + len(layout.structure.contacts) + 1
    return bool(coefficients[layout.accelerations[:, first:]].any() or layout.cycles)


def numbers_vary(system: System) -> bool:
    """Return True if a number of a system varies over the angle."""
    layout, coefficients = layout_of(system.structure), coefficients_of(system)
    waves = [wave for slots in layout.contacts for wave in slots.waves.values()]
    waves += [wave for slots in layout.contacts for stage in slots.stages for wave in stage.waves.values()]
    return any(coefficients[wave.lines].any() or wave.cycles for wave in waves)

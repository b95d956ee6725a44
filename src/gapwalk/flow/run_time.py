"""Positions of the run-time parameters of the equations of one system."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from functools import cached_property
from itertools import accumulate

import numpy as np
from numpy.typing import NDArray

from gapwalk.model.coefficients import CoefficientLayout


@dataclass(frozen=True, eq=False)
class RunTimeParameters:
    """Run-time parameters of the equations for one coefficient layout and one pattern of non-zero coefficients."""

    layout: CoefficientLayout  #: Positions of the coefficients in an array.
    #: shape (number of coefficients,), bool: True for each coefficient that is included; the others are zero.
    pattern: NDArray[np.bool_]
    #: For each sensitivity, the slots of the coefficients that vary along its direction.
    varying: tuple[NDArray[np.intp], ...] = ()
    #: True if the speed changes with the angle. Then the pattern covers the slots of a ramp (`gapwalk.flow.ramp`).
    ramp: bool = False

    #: Run-time parameters: the first of each kind.
    first_switch: int = field(init=False)  #: 1 while a stage of a contact touches, otherwise 0.
    first_weight: int = field(init=False)  #: Weights of the event functions of these.
    first_mode: int = field(init=False)  #: Modes of laws.
    first_waiting: int = field(init=False)  #: 1 while the guard of a mode that may wait vanishes all the time.
    first_level: int = field(init=False)  #: 1 at the high level of a cycle of two levels, otherwise 0.
    first_slip: int = field(init=False)  #: 1 or -1 in slip of friction, 0 in stick.
    first_stick: int = field(init=False)  #: 1 in stick of friction, otherwise 0.
    first_held: int = field(init=False)  #: 1 while a rigid stop is held, otherwise 0.
    length: int = field(init=False)  #: The unit of length, in units of the model.
    first_coefficient: int = field(init=False)  #: The coefficients.

    def __post_init__(self) -> None:
        switches, modes, dry = len(self.switches), len(self.modes), len(self.dry)
        numbers = [switches, switches, modes, modes * self.may_wait, len(self.layout.cycles), dry, dry, len(self.stops)]
        places = accumulate([self.first_component(len(self.varying)), *numbers, 1])
        for name, place in zip(_FIRSTS, places, strict=True):
            object.__setattr__(self, name, place)

    @cached_property
    def active(self) -> NDArray[np.intp]:
        """Slots of the coefficients that are included, in the order of their run-time parameters."""
        slots = np.flatnonzero(self.pattern)
        return slots if self.ramp else np.roll(slots, -1)  # of a ramp the square of the speed is the last one

    @cached_property
    def indices(self) -> dict[int, int]:
        """Run-time parameter of each active slot."""
        return {int(slot): self.first_coefficient + i for i, slot in enumerate(self.active)}

    def first_component(self, index: int) -> int:
        """Return the run-time parameter of the first component of a direction."""
        return sum(len(slots) for slots in self.varying[:index])

    @cached_property
    def components(self) -> NDArray[np.intp]:
        """Indices of the components of all directions, in the joined coefficients of all directions."""
        return np.concatenate([index * len(self.pattern) + slots for index, slots in enumerate(self.varying)])

    @cached_property
    def may_wait(self) -> bool:
        """True if guards may vanish all the time, because contacts are held."""
        return bool(self.layout.structure.reactions)

    @cached_property
    def formulas(self) -> bool:
        """True if any force is a formula, which may have no value somewhere."""
        return any(contact.form.law.is_formula for contact in self.layout.contacts)

    @cached_property
    def dry(self) -> tuple[int, ...]:
        """Numbers of the contacts that are dry friction."""
        return self.layout.structure.friction

    @cached_property
    def stops(self) -> tuple[int, ...]:
        """Numbers of the switches of rigid stops."""
        return tuple(switch for _, switch in self.layout.structure.reactions if switch >= 0)

    @cached_property
    def modes(self) -> tuple[tuple[int, int], ...]:
        """(contact, mode of its law) of every mode."""
        return tuple(
            (index, mode)
            for index, contact in enumerate(self.layout.contacts)
            for mode in range(contact.form.law.mode_count)
        )

    @cached_property
    def switches(self) -> tuple[tuple[int, int], ...]:
        """(contact, stage) of every switch."""
        return tuple(
            (index, stage) for index, contact in enumerate(self.layout.contacts) for stage in range(len(contact.stages))
        )


_FIRSTS = [each.name for each in fields(RunTimeParameters) if not each.init]

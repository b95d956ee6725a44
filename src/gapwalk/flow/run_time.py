"""Positions of the run-time parameters of the equations of one system."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

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
    def first_switch(self) -> int:
        """Run-time parameter of the first switch."""
        return self.first_component(len(self.varying))

    @cached_property
    def first_weight(self) -> int:
        """Run-time parameter of the first weight of an event function."""
        return self.first_switch + len(self.switches)

    @cached_property
    def first_mode(self) -> int:
        """Run-time parameter of the first mode of a law."""
        return self.first_weight + len(self.switches)

    @cached_property
    def first_waiting(self) -> int:
        """Run-time parameter of the first mode that may wait: 1 while its guard vanishes all the time, otherwise 0."""
        return self.first_mode + len(self.modes)

    @cached_property
    def may_wait(self) -> bool:
        """True if guards may vanish all the time, because contacts are held."""
        return bool(self.layout.structure.reactions)

    @cached_property
    def first_level(self) -> int:
        """Run-time parameter of the first cycle of two levels: 1 at the high one, otherwise 0."""
        return self.first_waiting + len(self.modes) * self.may_wait

    @cached_property
    def first_slip(self) -> int:
        """Run-time parameter of the first slip of friction: 1 or -1 in slip, 0 in stick."""
        return self.first_level + len(self.layout.cycles)

    @cached_property
    def first_stick(self) -> int:
        """Run-time parameter of the first stick of friction: 1 in stick, otherwise 0."""
        return self.first_slip + len(self.dry)

    @cached_property
    def first_held(self) -> int:
        """Run-time parameter of the first switch of a rigid stop: 1 while the stop is held, otherwise 0."""
        return self.first_stick + len(self.dry)

    @cached_property
    def length(self) -> int:
        """Run-time parameter of the unit of length, in units of the model."""
        return self.first_held + len(self.stops)

    @cached_property
    def first_coefficient(self) -> int:
        """Run-time parameter of the first coefficient."""
        return self.length + 1

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

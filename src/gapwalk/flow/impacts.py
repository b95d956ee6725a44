"""Impacts on rigid stops: the reset of the rates, impacts that follow each other ever faster, and derivatives.

An impact changes the velocities along its force, ``v+ = v - w (u - u+) / (e.w)`` with ``w = M^-1 d``, the
rate u of the deflection before it, and the rate u+ after it that the law gives. An impulse is larger than any force of
friction, so what sticks may slip from there on.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gapwalk.flow.dry_switches import DrySwitches
from gapwalk.flow.event_rule import pass_event
from gapwalk.flow.forces import Angles
from gapwalk.flow.mode_switches import ModeSwitches

_TAIL = 1e-6  # radians that further impacts may last together for the contact to be held at once
_INTO = 1e-13  # share of the size of the velocities above which a stop that is held is struck too
_AT_ONCE = 200  # the most impacts at one instant


class Impacts:
    """Impacts of the motions of one integrator.

    Parameters
    ----------
    dry
        Its modes of friction and stops.
    modes
        The modes of its laws, which are set for the rates after an impact: those of ``abs(v)`` jump with them.
    """

    def __init__(self, dry: DrySwitches, modes: ModeSwitches) -> None:
        self._dry, self._layout, self._modes = dry, dry.layout, modes

    def strike(self, switch: int, theta: float) -> list[int]:
        """Reset the state at an impact on the stop of a switch, and transform its derivatives.

        Impacts that would last together for a moment only are summed up: the contact is held from here on. Their
        impulses act along one direction, so that leaves an error of the second order of that time.

        Returns
        -------
        list of int
            The switches of further stops, which were held, and which the impulse presses on.
        """
        dry, begin, first = self._dry, self._dry.read(theta), self._dry.stop_reaction[switch]
        before, struck = dry.state[: dry.size].copy(), [first]
        reset = partial(self._reset, struck, ())
        while True:
            dry.state[: dry.size] = after = reset(before, dry.base, theta)
            if self._modes.mode_count:
                self._modes.refresh(theta, dry.closed)
            into = self._struck_too(struck, theta)
            if into is None or len(struck) > _AT_ONCE:
                break
            struck.append(into)
        dry.after_impact(theta)
        several = struck.count(first) > 1  # these, too, become ever weaker
        ends = [number for number in dict.fromkeys(struck if several else struck[:1]) if self._ends(number, theta)]
        if ends and (several or len(struck) == 1):
            reset = partial(self._reset, struck if several else (), ends)
            dry.state[: dry.size] = after = reset(before, dry.base, theta)
            dry.after_impact(theta, ends)
        if dry.columns:
            now, guard = dry.read(theta), partial(self._depth, first)
            flows = [float(dry.base[0]) * np.concatenate(each[:3]) for each in (begin, now)]
            dry.rows()[:] = pass_event(
                dry.rows(), dry.along(), before, dry.base, theta, guard, reset, lambda _, passed: flows[int(passed)]
            )
        dry.state[: dry.size] = after
        dry.kink(begin, theta)
        return [self._layout.structure.reactions[number][1] for number in dict.fromkeys(struck) if number != first]

    def _struck_too(self, struck: Sequence[int], theta: float) -> int | None:
        """Return the reaction of a stop that was held or struck, and into which the last impulse has driven the motion.

        What lies between two stops goes back and forth in no time, until neither of them is approached.
        """
        dry = self._dry
        for number, sign in dry.sign_of.items():
            touches = number != struck[-1] and (number in dry.held or number in struck)
            if touches and sign * dry.gap(number, theta)[1] > _INTO * dry.speed():
                return number
        return None

    def _ends(self, number: int, theta: float) -> bool:
        """Return True if all further impacts on a stop follow within a moment."""
        dry, sign = self._dry, self._dry.sign_of[number]
        contact = self._layout.structure.reactions[number][0]
        slots = self._layout.contacts[contact]
        numbers = Angles(self._layout, dry.base, theta).named(slots.numbers, slots.waves)
        restitution = -float(slots.form.law.rebound(1.0, numbers))
        towards, left = sign * dry.acceleration(contact, dry.read(theta), theta), -sign * dry.gap(number, theta)[1]
        if towards <= 0.0 or restitution >= 1.0:
            return False
        return 2.0 * max(left, 0.0) <= _TAIL * float(dry.base[0]) * towards * (1.0 - restitution)

    def _reset(
        self, struck: Sequence[int], ends: Sequence[int], state: NDArray, coefficients: NDArray, theta: Any
    ) -> NDArray:
        """Return the state after impacts on some stops, one after the other, and plastic ones that end on theirs."""
        n, angles = self._dry.n, Angles(self._layout, coefficients, theta)
        for number, plastic in [*((each, False) for each in struck), *((each, True) for each in ends)]:
            slots = self._layout.contacts[self._layout.structure.reactions[number][0]]
            vector, push = coefficients[..., slots.deflection], coefficients[..., slots.force]
            push = push / np.sum(vector * push, axis=-1)[..., None]
            rate = np.sum(vector * state[..., n : 2 * n], axis=-1) + angles.sway(slots, 0, 1)
            after = 0.0 * rate if plastic else slots.form.law.rebound(rate, angles.named(slots.numbers, slots.waves))
            q, v = state[..., :n], state[..., n : 2 * n] + (after - rate)[..., None] * push
            if plastic:
                q = q - self._depth(number, state, coefficients, theta)[..., None] * push
            state = np.concatenate((q, v, state[..., 2 * n :]), axis=-1)
        return state

    def _depth(self, number: int, state: NDArray, coefficients: NDArray, theta: Any) -> NDArray:
        """Return the deflection beyond a stop, real or complex."""
        contact, switch = self._layout.structure.reactions[number]
        slots = self._layout.contacts[contact]
        stage = slots.stages[self._dry.equations.switches[switch][1]]
        x = np.sum(coefficients[..., slots.deflection] * state[..., : self._dry.n], axis=-1)
        return (
            x + Angles(self._layout, coefficients, theta).sway(slots) - stage.sign * coefficients[..., stage.clearance]
        )

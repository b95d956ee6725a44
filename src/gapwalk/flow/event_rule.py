"""The general rule by which derivatives of a motion pass an event.

Over theta the motion is ``y' = F(y, theta)``, with ``F-`` before the event and ``F+`` after it. The event is where a
guard ``g(y, theta)`` vanishes, and there the state may be reset to ``R(y, theta)``. With ``den = g_y F- + g_theta``

    S  = R_y + (F+ - R_y F- - R_theta) (x) g_y / den                              state transition
    s+ = R_y s- + R_p + (F+ - R_y F- - R_theta) (g_y s- + g_p) / den              sensitivity to a parameter

(di Bernardo, Budd, Champneys and Kowalczyk 2008, chapter 2). All derivatives are taken by a complex step, so a force
law provides its formulas only.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gapwalk.flow.forces import Angles, contact_force
from gapwalk.model.coefficients import CoefficientLayout, ContactSlots, coefficients_of, layout_of
from gapwalk.model.laws import closed_form_of
from gapwalk.model.laws.friction import Coulomb
from gapwalk.model.system import System

_AT_REST = 1e-150  # divisor in place of a rate of 0, for a jump that does not vanish with the rate
_STEP = 1e-150  # of the complex step
_ANGLE = 0.7  # an angle at which what varies is not zero by chance
# share of the accelerations of a motion as wide as the gap below which a jump is none: the multiplier that grows beside
# its graze does so within the square of that, where the graze is not located
_SLIGHT = 1e-5

Formula = Callable[[NDArray[Any], NDArray[Any], Any], NDArray[Any]]
"""A function of states, shape (..., 2n), coefficients, shape (..., number of coefficients), and theta."""
Quotient = Callable[[float, float], float]
"""A function of a rate and of theta."""


def pass_event(
    changes: NDArray[np.float64],
    directions: NDArray[np.float64],
    state: NDArray[np.float64],
    coefficients: NDArray[np.float64],
    theta: float,
    guard: Formula,
    reset: Formula,
    flows: tuple[NDArray[np.float64], NDArray[np.float64]],
) -> NDArray[np.float64]:
    """Return the changes of the state after an event by the general rule, shape (columns, 2n)."""
    # Shapes: `changes` (columns, 2n); `directions` (columns, number of coefficients).
    before, after = flows
    rows, step = len(changes), 1j * _STEP  # the last row below is the motion itself
    states = state + step * np.vstack((changes, before))
    numbers, thetas = np.empty((rows + 1, len(coefficients)), dtype=complex), np.full(rows + 1, theta, dtype=complex)
    numbers[:rows], numbers[rows], thetas[rows] = coefficients + step * directions, coefficients, theta + step
    resets, guards = (np.imag(formula(states, numbers, thetas)) / _STEP for formula in (reset, guard))
    return resets[:rows] + np.outer(guards[:rows] / guards[rows], after - resets[rows])


def jump_of(layout: CoefficientLayout, contact: int, stage: int) -> Callable[[NDArray[np.float64]], Quotient] | None:
    """Return the jump of a contact's force where a stage closes, divided by the rate; None if it never jumps."""
    # The result is a function of the coefficients that returns a function of the rate and of theta.
    slots = layout.contacts[contact]
    products = closed_form_of(slots.form.law, slots.form.shapes)
    if products is None or (slots.varies and any(term.power == 0 for term in products)):
        return lambda coefficients: (
            lambda rate, theta: _difference(layout, slots, stage, coefficients, rate, theta) / (rate or _AT_REST)
        )
    numbers = slots.stages[stage].numbers
    terms = [
        (term.factor, [*(slots.numbers[e] for e in term.numbers), *(numbers[e] for e in term.stage_numbers)], term.rate)
        for term in products
        if term.stage == stage and term.power == 0
    ]

    def quotients(coefficients: NDArray[np.float64]) -> Quotient:
        known = [(factor * math.prod(coefficients[places].tolist()), rate - 1) for factor, places, rate in terms]
        if all(power == 0 for _, power in known):
            total = sum(factor for factor, _ in known)
            return lambda rate, theta: total
        return lambda rate, theta: sum(factor * (rate or _AT_REST) ** power for factor, power in known)

    return quotients if terms else None


def _difference(
    layout: CoefficientLayout,
    slots: ContactSlots,
    stage: int,
    coefficients: NDArray[np.float64],
    rate: float,
    theta: float,
) -> float:
    """Return the jump of a contact's force where a stage closes, with only the stages inside of it closed."""
    here = slots.stages[stage]
    clearance = coefficients[here.clearance]
    inside = [each.sign == here.sign and coefficients[each.clearance] < clearance for each in slots.stages]
    after = [closed or number == stage for number, closed in enumerate(inside)]
    moves, angles = [(np.asarray(here.sign * clearance), np.asarray(rate))], Angles(layout, coefficients, theta)
    forces = [contact_force(slots, angles, moves, closed) for closed in (after, inside)]
    return float(forces[0] - forces[1])


@lru_cache(maxsize=256)
def jumping_switches(system: System, *, friction: bool = True) -> frozenset[int]:
    """Return the numbers of the switches whose touch, however soft, has an effect that grows as the root of its depth.

    These are rigid stops, stages that add friction that sticks rigidly, and stages whose force begins with a jump, such
    as a preload: its impulse is as long as the touch. Damping begins with the rate of the touch, so it is none of them.
    With `friction` False, stages that only add friction are left out: its impulse reverses within the touch.
    """
    layout, coefficients, structure = layout_of(system.structure), coefficients_of(system), system.structure
    hosts = {each.law.host for each in structure.contacts if isinstance(each.law, Coulomb) and each.law.by == "stages"}
    found, switch = set[int](), 0
    for slots in layout.contacts:
        for stage in range(len(slots.stages)):
            jumps = slots.form.law.rebounds or (friction and slots.form.name in hosts)
            if jumps or _jumps_at_rest(layout, slots, stage, coefficients):
                found.add(switch)
            switch += 1
    return frozenset(found)


@lru_cache(maxsize=256)
def one_way_switches(system: System) -> frozenset[int]:
    """Return the numbers of the switches whose damping acts one way only: a touch, however soft, changes multipliers.

    Its impulse grows with the depth of the touch, as that of a force that jumps does with the root.
    """
    layout, coefficients = layout_of(system.structure), coefficients_of(system)
    places = [(slots, stage) for slots in layout.contacts for stage in range(len(slots.stages))]
    found = set[int]()
    for switch, (slots, stage) in enumerate(places):
        rate = coefficients[slots.stages[stage].clearance]
        ways = [_difference(layout, slots, stage, coefficients, way * rate, _ANGLE) for way in (1.0, -1.0)]
        if abs(sum(ways)) > _SLIGHT * max(map(abs, ways)):
            found.add(switch)
    return frozenset(found) - jumping_switches(system)


def _jumps_at_rest(
    layout: CoefficientLayout, slots: ContactSlots, stage: int, coefficients: NDArray[np.float64]
) -> bool:
    products = closed_form_of(slots.form.law, slots.form.shapes)
    if products is not None and not any(term.stage == stage and term.power == term.rate == 0 for term in products):
        return False
    jump = _difference(layout, slots, stage, coefficients, 0.0, _ANGLE)
    along = float(coefficients[slots.deflection] @ coefficients[slots.force])
    return abs(along * jump) > _SLIGHT * float(coefficients[slots.stages[stage].clearance] / coefficients[0] ** 2)

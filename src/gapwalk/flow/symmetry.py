"""Symmetries of a system: changes of sign and exchanges of coordinates that map motions onto motions.

A symmetric gap under a load of odd harmonics is the most frequent case: with every coordinate of the opposite sign,
half a forcing period later, the equations are the same. Orbits that share such a symmetry keep it all along their
branch; it is lost at a branch point, where the branch of the less symmetric orbits leaves.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import permutations, product

import numpy as np
from numpy.typing import NDArray

from gapwalk.flow.forces import Angles, accelerations
from gapwalk.model.coefficients import CoefficientLayout, Wave, coefficients_of, layout_of
from gapwalk.model.laws import Law
from gapwalk.model.system import System

_ALL = 4  # coordinates up to which all exchanges and signs are tried; beyond, only common signs and reversals
_SAMPLES, _SEED = 12, 1995  # random states at which the equations are compared
_DECADES, _FARTHEST = (1e-4, 1e-3, 1e-2, 1e-1, 1e1, 1e2), 1e6  # sizes of motions at which formulas are compared
_EQUAL = 1e-9  # difference of accelerations, relative to the largest, that counts as rounding


@dataclass(frozen=True)
class Symmetry:
    """A symmetry: coordinate i moves as ``signs[i]`` times coordinate ``order[i]`` did."""

    order: tuple[int, ...]  #: For each coordinate, the one whose place it takes.
    signs: tuple[int, ...]  #: For each coordinate, +1 or -1.
    shift: float  #: Forcing periods by which the motion is shifted: 0 or 1/2.

    def defect(self, extremes: NDArray[np.float64], floor: float = 0.0) -> float:
        """Return the asymmetry of an orbit by its `Orbit.extremes`, as a share of its largest amplitude."""
        # Extremes and means do not depend on where a motion begins, so the shift does not matter. An amplitude below
        # `floor` counts as `floor`: anything much smaller is rounding.
        largest, smallest, mean = (extremes[list(self.order), k] for k in range(3))
        flipped = np.array(self.signs) < 0
        here = np.column_stack((largest, smallest, mean))
        here[flipped] = -np.column_stack((smallest, largest, mean))[flipped]
        size = max(floor, 0.5 * float(np.ptp(extremes[:, :2], axis=1).max()))
        return float(np.abs(here - extremes[:, :3]).max()) / size if size > 0.0 else 0.0

    def moves_switches(self, system: System) -> tuple[int, ...]:
        """Return for each breakpoint the one that it is mapped to; itself if there is none."""
        switches = []
        for contact, side, clearance in system.breakpoints:
            form = system.structure.contacts[contact]
            moved, given = np.zeros(system.size), side * system.vector(form.vectors[0])
            for place, (source, sign) in enumerate(zip(self.order, self.signs, strict=True)):
                moved[source] += sign * given[place]
            switches.append((moved, given, clearance))
        return tuple(
            next((j for j, (_, e, c) in enumerate(switches) if np.allclose(moved, e) and np.isclose(clearance, c)), own)
            for own, (moved, _, clearance) in enumerate(switches)
        )


def symmetries_of(system: System) -> tuple[Symmetry, ...]:
    """Return the symmetries of a system at its present values, other than the identity."""
    # They are found by comparing accelerations at random states, which works for every force law. With more than four
    # coordinates, only a change of all signs and the reversed order are examined.
    n, generator = system.size, np.random.default_rng(_SEED)
    theta = generator.uniform(0.0, math.tau, _SAMPLES)
    # at size 0 only the loads act, which large forces would hide; then at size 1, and beyond each of the clearances
    clearances = {abs(clearance) for _, _, clearance in system.breakpoints}
    reaches = sorted({0.0, 1.0, *(2.0 * each for each in clearances if math.isfinite(each)), *_formula_reaches(system)})
    states, layout, coefficients = [], layout_of(system.structure), coefficients_of(system)
    for reach in reaches:
        q, v = reach * generator.uniform(-1.0, 1.0, (2, _SAMPLES, n))
        with np.errstate(all="ignore"):  # a formula may have no value, or no finite one, at some states
            states.append((q, v, accelerations(layout, coefficients, theta, q, v)))
    found = [Symmetry(order, signs, shift) for order, signs in _candidates(n) for shift in (0.0, 0.5)]
    identity = Symmetry(tuple(range(n)), (1,) * n, 0.0)
    return tuple(each for each in found if each != identity and _holds(each, system, theta, states))


def finds_all(system: System) -> bool:
    """Return True if `symmetries_of` examines all exchanges and changes of sign for a system."""
    return system.size <= _ALL


def _holds(
    symmetry: Symmetry, system: System, theta: NDArray[np.float64], states: Sequence[tuple[NDArray[np.float64], ...]]
) -> bool:
    """Return True if the accelerations at states that the symmetry maps onto each other are mapped likewise."""
    # `states` are positions, velocities and accelerations. The springs of friction, the stages that host it, and rigid
    # stops are not in the accelerations: they are compared one by one.
    layout, coefficients, order = layout_of(system.structure), coefficients_of(system), list(symmetry.order)
    if not _moves_dry(symmetry, layout, coefficients, theta):
        return False
    for q, v, here in states:
        with np.errstate(all="ignore"):
            moved = [each[:, order] * symmetry.signs for each in (q, v, here)]
            there = accelerations(layout, coefficients, theta + math.tau * symmetry.shift, moved[0], moved[1])
        known = np.isfinite(here).all(axis=1)
        if not np.array_equal(known, np.isfinite(there).all(axis=1)):
            return False
        if known.any() and float(np.abs(there - moved[2])[known].max()) > _EQUAL * float(np.abs(here[known]).max()):
            return False
    return True


def _moves_dry(
    symmetry: Symmetry, layout: CoefficientLayout, coefficients: NDArray[np.float64], theta: NDArray[np.float64]
) -> bool:
    """Return True if each friction element and rigid stop is mapped to one with the same numbers."""
    # An element of the deflection ``e.q`` and the acceleration D becomes one of ``s e P`` and ``s P D``, where P is the
    # symmetry and s a sign: so its displacement, the speed of its base and its side change their signs with s.
    order, signs = list(symmetry.order), np.array(symmetry.signs, dtype=float)
    here, there = (
        _dry_elements(layout, coefficients, theta),
        _dry_elements(layout, coefficients, theta + math.tau * symmetry.shift),
    )
    for law, vector, push, turning, kept in here:
        moved = vector[order] * signs, push[order] * signs
        if not any(
            law == other
            and all(
                np.allclose(factor * one, two, rtol=_EQUAL, atol=_EQUAL * (1e-300 + np.abs(two).max(initial=0.0)))
                for factor, one, two in (
                    (sign, moved[0], image[0]),
                    (sign, moved[1], image[1]),
                    (sign, turning, image[2]),
                    (1.0, kept, image[3]),
                )
            )
            for other, *image in there
            for sign in (1.0, -1.0)
        ):
            return False
    return True


def _dry_elements(
    layout: CoefficientLayout, coefficients: NDArray[np.float64], theta: NDArray[np.float64]
) -> list[tuple[Law, NDArray, NDArray, NDArray, NDArray]]:
    """Return law, deflection and acceleration of friction and of stages; what has a sign, and the other numbers."""
    angles, found = Angles(layout, coefficients, theta), []

    def rows(numbers: Mapping[str, int], waves: Mapping[str, Wave], without: str) -> NDArray:
        named = angles.named(numbers, waves)
        kept = [value + np.zeros(len(theta)) for name, value in named.items() if name != without]
        return np.array(kept).reshape(-1, len(theta))

    for slots in layout.contacts:
        law = slots.form.law
        if not (law.is_dry or law.rebounds or law.has_stage_parameter("hysteresis")):
            continue
        sway = angles.sway(slots) + np.zeros(len(theta))
        vectors = coefficients[slots.deflection], coefficients[slots.force]
        own = rows(slots.numbers, slots.waves, "speed")
        if law.is_dry:
            speed = np.full(len(theta), coefficients[slots.numbers["speed"]])
            found.append((law, *vectors, np.stack((sway, speed)), own))
            continue
        for stage in slots.stages:
            side = np.full(len(theta), float(stage.sign))
            kept = np.vstack((own, rows(stage.numbers, stage.waves, "")))
            found.append((law, *vectors, np.stack((sway, side)), kept))
    return found


def _formula_reaches(system: System) -> set[float]:
    """Return sizes of motions at which formulas are compared: a kink may be at any of their numbers, or any length."""
    forms = [form for form in system.structure.contacts if not form.stages]
    if not forms:
        return set()
    values = system.equations
    numbers = {2.0 * abs(values[f"{form.name}.{each.name}"]) for form in forms for each in form.law.parameters}
    return {each for each in numbers if 0.0 < each < _FARTHEST} | {*_DECADES}


def _candidates(n: int) -> list[tuple[tuple[int, ...], tuple[int, ...]]]:
    if n <= _ALL:
        return list(product(permutations(range(n)), product((1, -1), repeat=n)))
    straight = tuple(range(n))
    return list(product((straight, straight[::-1]), ((1,) * n, (-1,) * n)))

"""Positions in which all static forces balance: that of least energy, or one for each combination of closed stages."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from gapwalk.errors import ConvergenceError
from gapwalk.model.spring import Range, Slope, Spring, springs_of
from gapwalk.model.system import System

_TINY = 1e-9  # share of a clearance, or of a force, that counts as none
_WEAKEST = 10  # decades by which the spring is weaker than the others that holds what is free to move
_TURNS = 200  # combinations that are tried where there are too many
_LEFT = 1e-6  # share of the load that may be left over


def tangent(
    system: System, closed: Sequence[tuple[Slope, ...]], x: NDArray[np.float64] | None = None
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Stiffness and damping matrices for small motions while these stages are closed, each shape (n, n).

    About a position `x`, or, without one, just past the clearances of the stages, where no force has built up.
    """
    stiffness, damping = system.matrix("stiffness").copy(), system.matrix("damping").copy()
    for spring, slopes in zip(springs_of(system), closed, strict=True):
        force, slope = 0.0, sum(each.stiffness for each in slopes)
        if x is not None:
            force, slope = spring.pull(float(spring.deflection @ x), slopes)
        along = np.outer(spring.force, spring.deflection)
        stiffness += slope * along
        damping += spring.drag(force, slopes) * along
    return stiffness, damping


def has_least_energy(stiffness: NDArray[np.float64], springs: Sequence[Spring]) -> bool:
    """Whether forces follow from an energy that curves upwards everywhere."""
    if any(not spring.form.reciprocal for spring in springs):
        return False
    for spring in springs:
        for sign in (1, -1):
            side = [each for each in spring.slopes if each.sign == sign]
            if any(each.cubic < 0 for each in side) or any(np.cumsum([each.stiffness for each in side]) < 0):
                return False
    return curves_upwards(stiffness)


def curves_upwards(matrix: NDArray[np.float64]) -> bool:
    """Whether a matrix is symmetric and has no negative eigenvalue."""
    size = np.abs(matrix).max()
    if np.abs(matrix - matrix.T).max() > 1e-12 * size:
        return False
    return size == 0 or bool(np.linalg.eigvalsh(matrix)[0] > -1e-12 * len(matrix) * size)


def least_energy(
    system: System, stiffness: NDArray[np.float64], load: NDArray[np.float64], springs: Sequence[Spring]
) -> NDArray[np.float64] | None:
    """The position of least energy; of many, that nearest to zero; None if the energy falls for ever.

    A weak spring on all coordinates makes it unique. It is weakened step by step: with the weakest from the beginning,
    the first step of Newton's method would leave a gap by many orders of magnitude.
    """
    mass, weight = system.matrix("mass"), float(np.abs(load).max())
    slopes = [slope for spring in springs for slope in spring.slopes]
    size = np.abs(stiffness).max() + sum(abs(s.stiffness) + np.cbrt(abs(s.cubic) * weight**2) for s in slopes)
    x, holding = np.zeros(len(load)), (size or 1.0) / np.abs(mass).max() * mass
    for power in range(0, _WEAKEST + 1, 2):
        x = _held(stiffness, 10.0**-power * holding, load, springs, x)
    force, slope = _pulls(stiffness, load, springs, x)
    settled = x - np.linalg.solve(slope + 10.0**-_WEAKEST * holding, force)
    left, best = min(
        ((float(np.abs(_pulls(stiffness, load, springs, each)[0]).max()), each) for each in (settled, x)),
        key=lambda pair: pair[0],
    )
    return best if left <= _LEFT * weight else None


def _held(
    stiffness: NDArray[np.float64],
    holding: NDArray[np.float64],
    load: NDArray[np.float64],
    springs: Sequence[Spring],
    x: NDArray[np.float64],
) -> NDArray[np.float64]:
    """The position of least energy with a further linear spring, from a start."""
    held = stiffness + holding

    def energy(x: NDArray[np.float64]) -> float:
        stored = sum(spring.energy(float(spring.deflection @ x)) for spring in springs)
        return float(0.5 * x @ held @ x - load @ x + stored)

    for _ in range(100):
        force, slope = _pulls(held, load, springs, x)
        step = -np.linalg.solve(slope, force)
        share, here = 1.0, energy(x)
        while share > 1e-6 and energy(x + share * step) > here + 1e-14 * abs(here):
            share *= 0.5
        x = x + share * step
        if np.abs(step).max() <= 1e-12 * np.abs(x).max() or share <= 1e-6:
            return x
    raise ConvergenceError("the position of least energy under the mean load was not found in 100 steps")


def _pulls(
    stiffness: NDArray[np.float64], load: NDArray[np.float64], springs: Sequence[Spring], x: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The force that is left over at a position, and the stiffness there; all contacts are reciprocal."""
    force, slopes = stiffness @ x - load, stiffness.copy()
    for spring in springs:
        depth = float(spring.deflection @ x)
        pull, slope = spring.pull(depth, spring.closed(depth))
        force += pull * spring.deflection
        slopes += slope * np.outer(spring.deflection, spring.deflection)
    return force, slopes


def within(
    stiffness: NDArray[np.float64], load: NDArray[np.float64], springs: Sequence[Spring], ranges: Sequence[Range]
) -> NDArray[np.float64] | None:
    """An equilibrium with just these stages closed; None if there is none."""
    found = _balanced(stiffness, load, springs, ranges)
    return None if found is None else _placed(*found, springs, ranges)


def by_turns(
    stiffness: NDArray[np.float64],
    load: NDArray[np.float64],
    springs: Sequence[Spring],
    ranges: Sequence[Sequence[Range]],
) -> Iterator[Sequence[Range]]:
    """Combinations of stages, from that at zero on: each is closed where the one before it balances."""
    x = np.zeros(len(load))
    for _ in range(_TURNS):
        depths = [float(spring.deflection @ x) for spring in springs]
        chosen = [
            next(each for each in of_contact if each[1] <= depth <= each[2])
            for depth, of_contact in zip(depths, ranges, strict=True)
        ]
        yield chosen
        found = _balanced(stiffness, load, springs, chosen)
        if found is None:
            return
        x = found[0]


def _balanced(
    stiffness: NDArray[np.float64], load: NDArray[np.float64], springs: Sequence[Spring], ranges: Sequence[Range]
) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
    """Where forces balance if these stages act wherever it is, and the directions in which it is free to move."""
    x, free = np.zeros(len(load)), np.zeros((len(load), 0))
    bent = any(each.cubic for closed, _, _ in ranges for each in closed)
    for _ in range(100 if bent else 2):
        force, slopes = stiffness @ x - load, stiffness.copy()
        for spring, (closed, low, high) in zip(springs, ranges, strict=True):
            depth = float(spring.deflection @ x)
            at = depth if any(each.cubic for each in closed) else float(np.clip(depth, low, high))
            pull, slope = spring.pull(at, closed)
            force += (pull + slope * (depth - at)) * spring.force
            slopes += slope * np.outer(spring.force, spring.deflection)
        left, sizes, right = np.linalg.svd(slopes)
        lost = sizes <= 1e-12 * max(sizes[0], np.finfo(float).tiny)
        parts = left.T @ force
        if np.abs(parts[lost]).max(initial=0.0) > _TINY * max(np.abs(load).max(), np.abs(force).max()):
            return None
        step = -right[~lost].T @ (parts[~lost] / sizes[~lost])
        x, free = x + step, right[lost].T
        if np.abs(step).max() <= 1e-13 * np.abs(x).max():
            break
    else:
        return None if bent else (x, free)
    return x, free


def _placed(
    x: NDArray[np.float64],
    free: NDArray[np.float64],
    springs: Sequence[Spring],
    ranges: Sequence[Range],
) -> NDArray[np.float64] | None:
    """The position, moved as it is free to, so that all deflections are in their ranges; None if they cannot be."""
    rows, bounds = [], []
    for spring, (closed, low, high) in zip(springs, ranges, strict=True):
        for sign, end in ((1.0, high), (-1.0, -low)):
            if math.isfinite(end):
                inner = (bool(closed) and end < 0) or end == 0  # a breakpoint belongs to the range inside of it
                rows.append(sign * spring.deflection)
                bounds.append(end - _TINY * abs(end) if inner else end + _TINY * abs(end))
    if not rows:
        return x
    room = np.array(bounds) - np.array(rows) @ x
    if (room >= 0).all():
        return x
    if not free.shape[1]:
        return None
    from scipy.optimize import linprog  # slow to import, and seldom needed

    table = np.hstack((np.array(rows) @ free, np.ones((len(rows), 1))))
    found = linprog(
        [0.0] * free.shape[1] + [-1.0], table, room, bounds=[(None, None)] * free.shape[1] + [(0, np.abs(room).max())]
    )
    return x + free @ found.x[:-1] if found.success else None

"""Starts of a search: the box of states that a system may visit, and starts spread evenly over it."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from gapwalk.model.coefficients import ContactSlots, coefficients_of, layout_of
from gapwalk.model.system import System
from gapwalk.orbit.orbit import Orbit

_REACH = 20.0  # a gap this many times wider than the motion without it is assumed never to close
_SAMPLES = 64  # samples per forcing period of the velocities of a known orbit
_RESONANCE = 5.0  # upper bound of the amplitude of a linear resonance, in static deflections
_SINGULAR = 1e12  # condition number above which a stiffness does not support the system


def state_box(system: System, known: Iterable[Orbit] = (), spread: float = 1.5) -> NDArray[np.float64]:
    """Return the half-widths of a box about zero that contains the motions of a system with a margin; shape (2n,).

    Positions: as far as the static load, the widths of the gaps and the excitation move the system while its contacts
    touch, and at least as wide as the gaps; if a contact has one side only, as far as the system moves without it.
    Velocities: the positions times the natural frequency of the coordinate with the others fixed and the contacts
    touching, or times the excitation frequency if that is higher. Known orbits enlarge the box if necessary.

    Parameters
    ----------
    system
        The system.
    known
        Orbits that the box must contain.
    spread
        Factor by which the box is enlarged.
    """
    stiffness, positions = _touching(system)
    positions[positions == 0.0] = positions.max() or 1.0
    rates = np.sqrt(np.abs(stiffness.diagonal()))
    box = np.append(positions, positions * np.maximum(rates, system.frequency))
    for orbit in known:
        motion = orbit.motion(_SAMPLES)
        box = np.maximum(box, np.abs(np.hstack((motion.q, motion.v))).max(axis=0))
    return spread * box


def spread_starts(box: NDArray[np.float64], count: int, seed: int, value: float) -> NDArray[np.float64]:
    """Return starts spread evenly over a box by a scrambled Sobol sequence, shape (count, 2n).

    They depend only on the seed and the value of the parameter, not on what else is searched.
    """
    from scipy.stats import qmc  # imported late, because the import takes longer than everything else here

    engine = qmc.Sobol(len(box), scramble=True, rng=generator(seed, value))
    points = engine.random_base2((count - 1).bit_length())[:count]
    return (2.0 * points - 1.0) * box


def generator(seed: int, value: float, block: int = 0) -> np.random.Generator:
    """Return the random numbers for one value of the parameter, and for one block of starts there."""
    return np.random.default_rng([seed, int(np.float64(value).view(np.uint64)), block])


def _touching(system: System) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the stiffness per unit of mass with the contacts touching, and the extent of the positions.

    A gap far wider than the motion without it is left out: a stop that is never reached does not affect the motion.
    """
    layout, coefficients, n = layout_of(system.structure), coefficients_of(system), system.size
    rows = coefficients[layout.accelerations]
    mean = rows[:, 2 * n + len(layout.contacts)]
    stiffness, load = rows[:, :n].copy(), np.abs(mean)
    free, widths = _linear_motion(system, rows, stiffness, load, np.inf), np.zeros(n)
    bounded = len(layout.contacts) > 0
    for contact in layout.contacts:
        vector, force = coefficients[contact.deflection], coefficients[contact.force]
        moved = vector != 0.0
        reach = _REACH * float(np.abs(vector[moved]) @ free[moved])
        sides = [_side(contact, sign, coefficients, reach) for sign in (1, -1)]
        slope, pull, width = max(sides)
        stiffness += slope * np.outer(force, vector)
        load = load + pull * np.abs(force)
        widths[moved] = np.maximum(widths[moved], width / np.abs(vector[moved]))
        bounded = bounded and min(sides)[0] > 0.0
    if not bounded and np.all(np.isfinite(free)):
        return stiffness, np.maximum(free, widths)
    touching = _linear_motion(system, rows, stiffness, load, _RESONANCE)
    return stiffness, np.maximum(np.where(np.isfinite(touching), touching, 0.0), widths)


def _linear_motion(
    system: System,
    rows: NDArray[np.float64],
    stiffness: NDArray[np.float64],
    load: NDArray[np.float64],
    resonance: float,
) -> NDArray[np.float64]:
    """Return the extent of the positions of a linear system under static load and excitation; infinite if unsupported.

    A resonance is limited to `resonance` times the deflection under static loads: gaps detune it, and contacts damp it.
    """
    n, orders = system.size, layout_of(system.structure).orders
    if np.linalg.cond(stiffness) > _SINGULAR:
        return np.full(n, np.inf)
    flexibility = np.abs(np.linalg.inv(stiffness))
    static, amplitudes = flexibility @ load, np.zeros(n)
    believed = static.copy()
    for index, order in enumerate(orders):
        w = order * system.frequency
        force = rows[:, index - 2 * len(orders)] - 1j * rows[:, index - len(orders)]
        dynamic = stiffness - w**2 * np.eye(n) + 1j * w * rows[:, n : 2 * n]
        resonant = np.linalg.cond(dynamic) > _SINGULAR
        amplitudes += np.inf if resonant else np.abs(np.linalg.solve(dynamic, force))
        believed += flexibility @ np.abs(force)
    return static + (np.minimum(amplitudes, resonance * believed) if resonance < np.inf else amplitudes)


def _side(
    contact: ContactSlots, sign: int, coefficients: NDArray[np.float64], reach: float
) -> tuple[float, float, float]:
    """Return the stiffness of a contact on one side, the load of its springs over their gaps, and its widest gap."""
    slope = pull = width = 0.0
    for stage in contact.stages:
        clearance = float(coefficients[stage.clearance])
        if stage.sign == sign and clearance <= reach:
            # a cubic spring counts with its stiffness at a depth of one clearance
            spring = float(coefficients[stage.stiffness] + coefficients[stage.cubic] * clearance**2)
            slope, pull, width = slope + spring, pull + abs(spring) * clearance, max(width, clearance)
    return slope, pull, width

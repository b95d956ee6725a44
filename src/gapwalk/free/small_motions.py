"""Small motions of a system without excitation: their matrices at a state, and the length beyond which they change."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gapwalk.flow.forces import accelerations
from gapwalk.model.coefficients import CoefficientLayout, coefficients_of, layout_of
from gapwalk.model.spring import springs_of
from gapwalk.model.system import System

_STEP = 1e-150  # complex step
_OCTAVES = np.arange(-60, 61)  # lengths that are tried, as powers of two
_CHANGED = 0.3  # relative change of a matrix at which motions are no longer small
_SLIGHT = 1e-6  # damping, relative to a frequency, whose changes do not count
_FEW = 8  # coordinates that are displaced one by one


def tangents(
    layout: CoefficientLayout, coefficients: NDArray[np.float64], q: NDArray[np.float64], v: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return stiffness and damping for small motions about states, per unit of mass, each shape (..., n, n).

    They are exact to rounding, by a complex step; at a breakpoint those of its open side.
    """
    steps = 1j * _STEP * np.eye(q.shape[-1])
    with np.errstate(all="ignore"):
        by_positions = [np.imag(accelerations(layout, coefficients, 0.0, q + step, v + 0j)) for step in steps]
        by_rates = [np.imag(accelerations(layout, coefficients, 0.0, q + 0j, v + step)) for step in steps]
    return -np.stack(by_positions, axis=-1) / _STEP, -np.stack(by_rates, axis=-1) / _STEP


def companion(stiffness: NDArray[np.float64], damping: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the matrix of small motions in positions and velocities, shape (2n, 2n)."""
    size = len(stiffness)
    return np.block([[np.zeros((size, size)), np.eye(size)], [-stiffness, -damping]])


def length_at_rest(system: System, positions: NDArray[np.float64]) -> float:
    """Return a length of a system: its largest clearance, or the smallest motion that is not small, or 1.

    Shapes: `positions` (n,).
    """
    gaps = [slope.clearance for spring in springs_of(system) for slope in spring.slopes if slope.clearance > 0.0]
    if gaps:
        return max(gaps)
    layout, coefficients, size = layout_of(system.structure), coefficients_of(system), system.size
    stiffness, damping = tangents(layout, coefficients, positions, np.zeros(size))
    frequency = float(np.sqrt(np.abs(stiffness).max()))
    ways = np.vstack((np.ones(size), np.eye(size)[:_FEW]))
    moved = (np.exp2(_OCTAVES.astype(float))[:, None, None] * ways).reshape(-1, size)
    still = np.zeros_like(moved)
    found = [1.0]
    for q, v in ((moved, still), (still, moved * frequency)):
        changed = tangents(layout, coefficients, positions + q, v)
        off = np.zeros(len(moved), dtype=bool)
        for matrix, other, least in zip((stiffness, damping), changed, (0.0, _SLIGHT * frequency), strict=True):
            size_of = max(float(np.abs(matrix).max()), least)
            change = np.abs(other - matrix).max(axis=(1, 2))
            off |= ~(change <= _CHANGED * size_of) & (size_of > 0.0)
        lengths = np.abs(moved[off]).max(axis=1)
        found += [float(lengths.min())] if len(lengths) else []
    return min(found[1:], default=1.0)

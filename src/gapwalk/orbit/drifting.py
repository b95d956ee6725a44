"""Directions in which a motion may drift: no force depends on a position there, only on rates.

A system that moves over the ground by dry friction or drag has such a direction. Its motions repeat up to a translation
along it: its increment in a period follows from the motion, and the position at the start is arbitrary. The equation of
an orbit therefore takes 0 for this position, and one multiplier for each direction is exactly 1.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from gapwalk.flow.flow import Arc
from gapwalk.model.laws import Friction
from gapwalk.model.system import System

_NOTHING = 1e-12  # share of the largest entry below which a position has no effect

Array = NDArray[np.float64]


def drifts_of(system: System) -> Array:
    """Return the directions, orthonormal, in which only rates are resisted and no force depends on a position."""
    # Shape (n, directions). A train has no such coordinates: its slips are states of their own.
    n, structure = system.size, system.structure
    if structure.assembly is not None:
        return np.zeros((n, 0))
    stiffness = system.matrix("stiffness")
    if _holds_all(stiffness.tobytes(), n):
        return np.zeros((n, 0))
    bound = [
        system.vector(each)
        for form in structure.contacts
        if not isinstance(form.law, Friction)
        for each in form.vectors
    ]
    free = _null(np.vstack([_scaled(stiffness), *map(_scaled, bound)]))
    rubs = [system.vector(form.vectors[0]) for form in structure.contacts if isinstance(form.law, Friction)]
    resisted = np.vstack([_scaled(system.matrix("damping")), *map(_scaled, rubs)]) @ free
    return free if np.linalg.matrix_rank(resisted, _NOTHING) == free.shape[1] else np.zeros((n, 0))


@lru_cache(maxsize=16)
def _holds_all(stiffness: bytes, n: int) -> bool:
    """Return True if a stiffness matrix has full rank; it is asked of each orbit of a branch, mostly of one matrix."""
    matrix = np.frombuffer(stiffness).reshape(n, n)
    return bool(np.linalg.matrix_rank(matrix, _NOTHING * np.abs(matrix).max(initial=0.0)) == n)


def _scaled(matrix: Array) -> Array:
    return np.atleast_2d(matrix) / (np.abs(matrix).max(initial=0.0) or 1.0)


def _null(matrix: Array) -> Array:
    """Return the directions that a matrix takes to zero, orthonormal, in its columns."""
    _, sizes, rows = np.linalg.svd(matrix)
    return rows[int(np.sum(sizes > _NOTHING)) :].T


def brought_back(drifts: Array, states: Array) -> Array:
    """Return states, shape (..., state_size), each translated along the drifts to the position 0."""
    if not drifts.shape[1]:
        return states
    moved, n = states.copy(), len(drifts)
    moved[..., :n] -= states[..., :n] @ drifts @ drifts.T
    return moved


def together(drifts: Array, states: Array) -> Array:
    """Return states of one motion, shape (count, state_size), translated so that the first is at the position 0."""
    return states + (brought_back(drifts, states[0]) - states[0])


def returned(drifts: Array, arcs: list[Arc]) -> list[Arc]:
    """Return the arcs of one period, the last of which ends at the position 0 along the drifts."""
    last, n = arcs[-1], len(drifts)
    assert last.transition is not None
    reset = np.eye(len(last.state))
    reset[:n, :n] -= drifts @ drifts.T
    along = None if last.sensitivity is None else reset @ last.sensitivity
    return [*arcs[:-1], last._replace(state=reset @ last.state, transition=reset @ last.transition, sensitivity=along)]

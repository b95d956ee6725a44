"""Whether a system can have the values that it is given."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from gapwalk.errors import ModelError
from gapwalk.model.structure import Structure

_LARGEST = 1e150  # its square is a number still


def checked(structure: Structure, values: NDArray[np.float64]) -> NDArray[np.float64]:
    """The values, if a system can have them; a ModelError with all reasons otherwise."""
    problems = [
        f"{structure.names[int(place)]} is {values[place]}; it must be a finite number"
        for place in np.flatnonzero(~np.isfinite(values))
    ]
    problems += [
        f"{structure.names[int(place)]} is {values[place]:g}; it must be at most {_LARGEST:g} in size, for its square "
        "must be a number too: choose other units"
        for place in np.flatnonzero(np.isfinite(values) & (np.abs(values) > _LARGEST))
    ]
    if not problems:
        problems = list(value_problems(structure, values))
    if problems:
        raise ModelError("\n".join(problems))
    return values


def value_problems(structure: Structure, values: NDArray[np.float64]) -> Iterator[str]:
    """What is wrong with finite values, one sentence each."""
    if not values[0] > 0:
        yield f"{structure.pace} is {values[0]}; it must be > 0"
    elif values[0] < 1.0 / _LARGEST:
        yield f"{structure.pace} is {values[0]:g}; it must be at least {1.0 / _LARGEST:g}: choose other units"
    if structure.assembly:
        yield from structure.assembly.problems(values)
        yield from _clearance_problems(structure, values)
        return
    n = structure.size
    yield from mass_problems(structure.coordinates, values[structure.block("mass", n, n)])
    for contact in structure.contacts:
        if not values[structure.block(f"{contact.name}.deflection", n)].any():
            yield f"{contact.name}.deflection is zero for every coordinate; it must name at least one that moves it"
    yield from _clearance_problems(structure, values)


def _clearance_problems(structure: Structure, values: NDArray[np.float64]) -> Iterator[str]:
    for contact in structure.contacts:
        for sign in (1, -1):
            inner = -math.inf
            for stage in contact.stages:
                if sign not in stage.side.signs:
                    continue
                name = f"{contact.stage_prefix(stage)}.clearance"
                clearance = float(values[structure.place(name)])
                if clearance < 0:
                    yield f"{name} is {clearance}; it must be >= 0"
                elif clearance <= inner:
                    yield f"{name} is {clearance}; it must exceed that of the stage inside it, {inner}"
                inner = clearance


def mass_problems(coordinates: Sequence[str], mass: NDArray[np.float64]) -> Iterator[str]:
    """What is wrong with a finite mass matrix.

    A symmetric one is that of the kinetic energy, so it is positive definite. Of equations that were mixed with one
    another afterwards, whose matrix is not symmetric, nothing can be said but that they can be solved.
    """
    rows = f" (its rows are {mass.tolist()})" if len(mass) < 4 else ""
    inertia = np.diagonal(mass)
    sizes = np.abs(mass).max(axis=1)
    symmetric = np.allclose(mass, mass.T, rtol=1e-9, atol=1e-12 * sizes.min())
    if symmetric and inertia.min() < 0:
        lowest = int(inertia.argmin())
        yield (
            f"mass gives {coordinates[lowest]} the inertia {inertia[lowest]:g}; it must be > 0. Write equations in "
            "which M q'' has the sign of K q"
        )
        return
    # scaled first, so that a small inertia beside a large one is not taken for none
    unit = np.sqrt(np.where(sizes > 0, sizes, 1.0))
    scaled = mass / np.outer(unit, unit)
    if np.count_nonzero(mass) == np.count_nonzero(inertia):
        values = np.diagonal(scaled)
    else:
        values = np.linalg.eigvalsh(scaled) if symmetric else np.linalg.svd(scaled, compute_uv=False)
    if np.abs(values).min() <= 1e-13 * np.abs(values).max():
        yield (
            f"mass is singular{rows}; every coordinate needs an inertia. A system that can turn as a whole is written "
            "in relative coordinates"
        )
    elif symmetric and values.min() < 0:
        yield (
            f"mass is not positive definite{rows}, so that some motions had a negative kinetic energy; look at the "
            "signs and sizes of what stands beside its diagonal"
        )

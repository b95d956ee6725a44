"""Whether a system can have the values that it is given."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from gapwalk.errors import ModelError
from gapwalk.model.structure import Structure


def checked(structure: Structure, values: NDArray[np.float64]) -> NDArray[np.float64]:
    """The values, if a system can have them; a ModelError with all reasons otherwise."""
    problems = [
        f"{structure.names[int(place)]} is {values[place]}; it must be a finite number"
        for place in np.flatnonzero(~np.isfinite(values))
    ]
    if not problems:
        problems = list(value_problems(structure, values))
    if problems:
        raise ModelError("\n".join(problems))
    return values


def value_problems(structure: Structure, values: NDArray[np.float64]) -> Iterator[str]:
    """What is wrong with finite values, one sentence each."""
    if not values[0] > 0:
        yield f"frequency is {values[0]}; it must be > 0"
    if structure.assembly:
        yield from structure.assembly.problems(values)
        yield from _clearance_problems(structure, values)
        return
    n = structure.size
    mass = values[structure.block("mass", n, n)]
    if not _is_regular(mass):
        yield (
            f"mass is singular{f' (its rows are {mass.tolist()})' if n < 4 else ''}; every coordinate needs "
            "an inertia. A system that can turn as a whole is written in relative coordinates"
        )
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


def _is_regular(mass: NDArray[np.float64]) -> bool:
    sizes = np.abs(mass).max(axis=1)
    if not sizes.all():
        return False
    if np.count_nonzero(mass) == np.count_nonzero(np.diagonal(mass)):
        return True
    # scaled first, so that a small inertia beside a large one is not taken for none
    scaled = mass / np.sqrt(np.outer(sizes, sizes))
    singular = np.linalg.svd(scaled, compute_uv=False)
    return bool(singular[-1] > 1e-13 * singular[0])

"""What makes a model file of a large system short: matrices in files beside it, and coordinates by their number."""

from __future__ import annotations

import os
from contextlib import suppress
from dataclasses import replace

from gapwalk.model.matrix_file import read_matrix
from gapwalk.model.model_fields import MAX_COORDINATES
from gapwalk.model.model_source import Source
from gapwalk.model.problems import Problem, given

MATRICES = ("mass", "damping", "stiffness")
"""Keys of a model file that may name a file with a matrix."""


def expand(source: Source) -> tuple[Source, list[Problem]]:
    """Put matrices that stand in files of their own, and the names of counted coordinates, into a source.

    ``stiffness = "stiffness.mtx"`` names a file beside the model file, ``coordinates = 100`` stands for q1 ... q100.

    Returns
    -------
    source : Source
        With all in its place.
    problems : list of Problem
        The files that cannot be used.
    """
    data, problems = dict(source.data), []
    count = data.get("coordinates")
    if isinstance(count, int) and not isinstance(count, bool):
        if 1 <= count <= MAX_COORDINATES:
            data["coordinates"] = [f"q{number}" for number in range(1, count + 1)]
        else:
            problems.append(source.problem(_count_problem(count), ("coordinates",)))
            data["coordinates"] = []
    for key in MATRICES:
        value = data.get(key)
        if isinstance(value, str):
            try:
                data[key] = read_matrix(_place_of(value, source)).tolist()
            except ValueError as error:
                problems.append(source.problem(f"is {given(value)}, {error}", (key,)))
                del data[key]
    return replace(source, data=data), problems


def matrix_paths(source: Source) -> tuple[str, ...]:
    """The files beside a source that it takes matrices from, as far as it may ask for them."""
    found = []
    for value in map(source.data.get, MATRICES):
        if isinstance(value, str):
            with suppress(ValueError):
                found.append(_place_of(value, source))
    return tuple(found)


def _place_of(name: str, source: Source) -> str:
    """The file of a matrix; a ValueError if the source may not ask for it."""
    path = os.path.join(os.path.dirname(source.name), name)
    if source.within:
        inside = os.path.realpath(source.within)
        if os.path.commonpath((os.path.realpath(path), inside)) != inside:
            raise ValueError(f"which lies outside of the folder {os.path.basename(inside)}; put the file into it")
    return path


def _count_problem(count: int) -> str:
    return f"is {given(count)}; it must be a list of names, or their number, from 1 to {MAX_COORDINATES}"

"""Matrices whose rows have names: degrees of freedom of nodes, from finite-element programs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gapwalk.model.problems import given
from gapwalk.model.schema import MAX_COORDINATES

FIXED = 1e35
"""A diagonal entry of a stiffness matrix from which on its coordinate is fixed: Abaqus writes 1e36 there."""

_DIRECTIONS = {0: "", 1: "_x", 2: "_y", 3: "_z", 4: "_rx", 5: "_ry", 6: "_rz"}


class UnusableError(ValueError):
    """A matrix that cannot be used, although its file is of the right form."""


@dataclass(frozen=True, eq=False)
class LabelledMatrix:
    """A square matrix, with the names of its rows if its file has some."""

    matrix: NDArray[np.float64]  #: shape (n, n): The matrix; or its diagonal, shape (n,).
    names: tuple[str, ...] = ()  #: Names such as ``n12_z``, one for each row; empty if the file has none.

    def tobytes(self) -> bytes:
        """Return the content as bytes, for digests."""
        return self.matrix.tobytes() + " ".join(self.names).encode()


Label = tuple[int, int]
"""Number of a node and of a degree of freedom: 1 to 3 along x, y, z; 4 to 6 about them; 0 of a scalar point."""


def name_of(label: Label) -> str:
    """Return the name of a coordinate, such as ``n12_z``; ``n12_d8`` of a degree of freedom beyond the sixth."""
    node, direction = label
    return f"n{node}{_DIRECTIONS.get(direction, f'_d{direction}')}"


def assembled(entries: Mapping[tuple[Any, Any], float], *, symmetric: bool | None) -> LabelledMatrix:
    """Make the matrix of its entries."""
    if not entries:
        raise UnusableError("which holds no entries")
    labels: list[Any] = sorted({label for pair in entries for label in pair})
    is_indexed = isinstance(labels[0], int)
    count = labels[-1] if is_indexed else len(labels)
    if count > MAX_COORDINATES:
        raise UnusableError(
            f"which holds a matrix of {count:,} rows; there may be {MAX_COORDINATES:,}: condense the model to fewer "
            "degrees of freedom (a substructure, superelement or Guyan reduction) before it is written"
        )
    if is_indexed:
        labels = list(range(1, count + 1))
    if symmetric is None:
        symmetric = not any(row != column and (column, row) in entries for row, column in entries)
    places = {label: place for place, label in enumerate(labels)}
    matrix = np.zeros((len(labels), len(labels)))
    for (row, column), value in entries.items():
        matrix[places[row], places[column]] = value
        if symmetric and row != column:
            other = entries.get((column, row), value)
            if other != value:
                at = " and ".join(str(each) if is_indexed else name_of(each) for each in (row, column))
                raise UnusableError(f"which is said to be symmetric, but has {value:g} and {other:g} between {at}")
            matrix[places[column], places[row]] = value
    return LabelledMatrix(matrix, () if is_indexed else tuple(map(name_of, labels)))


def arranged(matrices: Mapping[str, LabelledMatrix], coordinates: object) -> tuple[dict[str, Any], list[str] | None]:
    """Arrange matrices whose rows have names in one order of coordinates.

    Coordinates that have an entry of 1e36 on the diagonal of the stiffness, as Abaqus marks fixed ones, are left out.
    Coordinates that one of the files lacks have zeros in its matrix.
    """
    named = {key: each for key, each in matrices.items() if each.names}
    if not named:
        return {key: each.matrix for key, each in matrices.items()}, None
    first = named.get("stiffness") or next(iter(named.values()))
    names = list(dict.fromkeys((*first.names, *(name for each in named.values() for name in each.names))))
    if "stiffness" in named:
        diagonal = dict(zip(first.names, np.abs(first.matrix.diagonal()), strict=True))
        names = [name for name in names if diagonal.get(name, 0.0) < FIXED]
    if coordinates is not None:
        listed = coordinates if isinstance(coordinates, list) else []
        if sorted(map(str, listed)) != sorted(names):
            some = ", ".join(names[:6]) + (", ..." if len(names) > 6 else "")
            raise ValueError(
                f"is {given(coordinates)}, but the files name {len(names)} coordinates ({some}); leave the key out, or "
                "list all of them in the order that you want"
            )
        names = [str(name) for name in listed]
    arrays: dict[str, Any] = {}
    for key, each in matrices.items():
        if not each.names:
            arrays[key] = each.matrix
            continue
        places = {name: place for place, name in enumerate(each.names)}
        found = [(new, places[name]) for new, name in enumerate(names) if name in places]
        new, old = (
            (np.array(part, dtype=int) for part in zip(*found, strict=True)) if found else (np.zeros(0, int),) * 2
        )
        arrays[key] = np.zeros((len(names), len(names)))
        arrays[key][np.ix_(new, new)] = each.matrix[np.ix_(old, old)]
    return arrays, names

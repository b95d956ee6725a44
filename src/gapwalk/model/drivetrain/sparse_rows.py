"""A matrix of a train: sparse for a long one."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from scipy.sparse import csr_array

Matrix: TypeAlias = "csr_array | NDArray[Any]"
"""A matrix: sparse for a long train."""


def with_row(matrix: Matrix, row: NDArray[Any]) -> Matrix:
    """Return a matrix with one more row."""
    if isinstance(matrix, np.ndarray):
        return np.vstack((matrix, row))
    from scipy.sparse import csr_array, vstack  # imported late, because the import is slow

    return csr_array(vstack((matrix, csr_array(row[None])), format="csr"))


def filled(matrix: Matrix) -> NDArray[Any]:
    """Return a matrix with its zeros."""
    return matrix if isinstance(matrix, np.ndarray) else matrix.toarray()

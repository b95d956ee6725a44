"""Scrambled Sobol points, bit for bit those of `scipy.stats.qmc.Sobol`, which takes half a second to import.

Method: Joe and Kuo (2008), whose direction numbers SciPy contains; scrambled by a random lower triangular matrix and a
digital shift (Matousek 1998).
"""

from __future__ import annotations

from functools import cache
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

_BITS = 30
_PLACES = 2 ** np.arange(_BITS, dtype=np.uint32)


def sobol_points(dimension: int, power: int, rng: np.random.Generator) -> NDArray[np.float64]:
    """Return the first points of a scrambled Sobol sequence, in the unit cube.

    Parameters
    ----------
    dimension
        Dimension of the cube.
    power
        The number of points is 2 to this power.
    rng
        Random numbers for the scrambling.

    Returns
    -------
    array of shape (2**power, dimension)
        The points.
    """
    rng = rng.spawn(1)[0]  # as SciPy does
    shift = rng.integers(2, size=(dimension, _BITS), dtype=np.uint32) @ _PLACES
    lower = np.tril(rng.integers(2, size=(dimension, _BITS, _BITS), dtype=np.uint32), -1)
    lower += np.eye(_BITS, dtype=np.uint32)
    # rows from the lowest bit of the result to the highest, columns from the lowest bit of the direction number
    matrix = lower[:, ::-1, ::-1].astype(np.int64)
    digits = (_directions(dimension)[:, :, None] // _PLACES) % 2  # (dimension, direction, bit)
    scrambled = (digits.astype(np.int64) @ matrix.transpose(0, 2, 1) % 2).astype(np.uint32) @ _PLACES
    points = np.empty((1 << power, dimension), dtype=np.uint32)
    points[0] = shift
    for bit in range(power):  # in the order of the Gray code: the second half mirrors the first, one bit apart
        half = 1 << bit
        points[half : 2 * half] = points[:half][::-1] ^ scrambled[:, bit]
    return np.asarray(points * 2.0**-_BITS, dtype=np.float64)


def _directions(dimension: int) -> NDArray[np.uint32]:
    """Return the direction numbers, shape (dimension, bits), the highest bit first."""
    polynomials, first = _known_directions()
    if dimension > len(polynomials):
        raise ValueError(f"the dimension is {dimension}; the direction numbers end at {len(polynomials)}")
    numbers = np.ones((dimension, _BITS), dtype=np.uint32)
    for row, polynomial in enumerate(polynomials[1:dimension].tolist(), start=1):
        degree = polynomial.bit_length() - 1
        values = first[row, :degree].tolist()
        for k in range(degree, _BITS):
            value = values[k - degree]
            for j in range(degree):
                if polynomial >> (degree - 1 - j) & 1:
                    value ^= values[k - 1 - j] << (j + 1)
            values.append(value)
        numbers[row] = values[:_BITS]
    return np.asarray(numbers * _PLACES[::-1], dtype=np.uint32)


@cache
def _known_directions() -> tuple[NDArray[np.uint32], NDArray[np.uint32]]:
    """Return the polynomials and the first direction numbers of each dimension, as SciPy contains them."""
    spec = find_spec("scipy")
    assert spec is not None
    assert spec.origin is not None
    with np.load(Path(spec.origin).parent / "stats" / "_sobol_direction_numbers.npz") as content:
        return content["poly"].astype(np.uint32), content["vinit"].astype(np.uint32)

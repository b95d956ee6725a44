"""Fourier lines of real periodic functions: forms, products, and zeros.

A function of ``phi`` with K lines is ``x = Re sum_k c_k exp(i k phi)``, k = 0 ... K, with real ``c_0``. *Lines* are the
``c_k``. Its *real form* is ``[c_0, Re c_1 ... Re c_K, -Im c_1 ... -Im c_K]``, coefficients of 1, cosines and sines.
Its *spectrum* is two-sided: ``x = sum_k s_k exp(i k phi)``, k = -K ... K, so that products become convolutions.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

_MANY = 32  # angles from which products are faster than exponentials


def two_sided(half: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """The spectrum of which one half, k = 0 ... K, is given."""
    return np.concatenate((half[..., :0:-1].conj(), half), axis=-1)


def waves(phi: NDArray[np.float64], count: int) -> NDArray[np.complex128]:
    """``exp(i k phi)`` for k = 0 ... count, shape (..., count + 1)."""
    if phi.size < _MANY:
        return np.exp(phi[..., None] * _exponents(count))
    powers = np.empty((*phi.shape, count + 1), dtype=complex)
    powers[..., 0] = 1.0
    powers[..., 1:] = np.exp(1j * phi)[..., None]
    return np.multiply.accumulate(powers, axis=-1, out=powers)


def differentiated(lines: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Lines of the derivative by phi."""
    return _exponents(lines.shape[-1] - 1) * lines


@lru_cache(maxsize=64)
def _exponents(count: int) -> NDArray[np.complex128]:
    return 1j * np.arange(count + 1, dtype=np.complex128)


class Grid(NamedTuple):
    """A grid that resolves K lines.

    Attributes
    ----------
    phi : shape (samples + 1,)
        Angles, evenly from 0 to 2 pi, both included.
    values, slopes : shape (2K + 1, samples + 1)
        From a real form to the values and the derivatives by phi on the grid.
    """

    phi: NDArray[np.float64]
    values: NDArray[np.float64]
    slopes: NDArray[np.float64]


@lru_cache(maxsize=32)
def grid(count: int) -> Grid:
    """The grid for K lines: eight cells to the shortest wave."""
    samples = 8 * max(8, count)
    phi = 2.0 * np.pi * np.arange(samples + 1) / samples
    phi[-1] = 2.0 * np.pi
    wave, k = waves(phi % (2.0 * np.pi), count), np.arange(count + 1)
    values = np.hstack((wave.real, wave.imag[:, 1:]))
    slopes = np.hstack((-k * wave.imag, k[1:] * wave.real[:, 1:]))
    return Grid(phi, np.ascontiguousarray(values.T), np.ascontiguousarray(slopes.T))

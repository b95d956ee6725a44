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


def real_form(lines: NDArray[np.complex128]) -> NDArray[np.float64]:
    """Real form, shape (..., 2K + 1), of lines of shape (..., K + 1)."""
    return np.concatenate((lines.real, -lines.imag[..., 1:]), axis=-1)


def from_real_form(real: NDArray[np.float64]) -> NDArray[np.complex128]:
    """Lines, shape (..., K + 1), of a real form of shape (..., 2K + 1)."""
    count = real.shape[-1] // 2
    lines = real[..., : count + 1].astype(complex)
    lines[..., 1:] -= 1j * real[..., count + 1 :]
    return lines


def spectrum(lines: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Two-sided spectrum, shape (..., 2K + 1), of lines of shape (..., K + 1)."""
    half = 0.5 * lines
    half[..., 0] = lines[..., 0].real
    return two_sided(half)


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


def multiplication(half: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """The matrix that takes the real form of x to the lines of the product ``u x``, shape (..., K + 1, 2K + 1).

    `half` is the spectrum of u for k = 0 ... 2K. With it, ``u cos j`` has the line ``u_(k-j) + u_(k+j)`` and
    ``u sin j`` the line ``i (u_(k+j) - u_(k-j))``; half of that for k = 0.
    """
    differences, sums = _places((half.shape[-1] - 1) // 2)
    full = two_sided(half)
    minus, plus = full[..., differences], full[..., sums]
    matrix = np.concatenate((plus + minus, 1j * (plus - minus)[..., 1:]), axis=-1)
    matrix[..., 0, :] *= 0.5
    return matrix


@lru_cache(maxsize=64)
def _exponents(count: int) -> NDArray[np.complex128]:
    return 1j * np.arange(count + 1, dtype=np.complex128)


@lru_cache(maxsize=32)
def _places(count: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Places of lines k - j and k + j in a spectrum of 2K lines."""
    k = np.arange(count + 1)
    return 2 * count + k[:, None] - k, 2 * count + k[:, None] + k


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

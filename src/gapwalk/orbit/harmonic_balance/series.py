"""A periodic motion as a finite Fourier series: its values, its turning points, and its means, all in closed form.

A function of ``phi`` with K lines is ``x = Re sum_k c_k exp(i k phi)``, k = 0 ... K, with real ``c_0``. *Lines* are the
``c_k``. Its *real form* is ``[c_0, Re c_1 ... Re c_K, -Im c_1 ... -Im c_K]``, coefficients of 1, cosines and sines.
Its *spectrum* is two-sided: ``x = sum_k s_k exp(i k phi)``, k = -K ... K, so that products become convolutions.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from gapwalk.flow.flow import PERIOD

_MANY = 32  # angles from which products are faster than exponentials


@dataclass(frozen=True, eq=False)
class Series:
    """``q(theta) = Re sum_k lines_k exp(i k theta / m)``."""

    lines: NDArray[np.complex128]  #: shape (n, K + 1): Complex amplitudes of each coordinate.
    period: int  #: m, forcing periods.
    frequency: float  #: W.

    def states(self, theta: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return positions and velocities (over time) at angles of the excitation, shape (samples, 2n)."""
        wave = waves(np.asarray(theta) / self.period, self.lines.shape[1] - 1)
        rates = (self.frequency / self.period) * (_exponents(self.lines.shape[1] - 1) * self.lines)
        return np.hstack(((wave @ self.lines.T).real, (wave @ rates.T).real))

    def start(self) -> NDArray[np.float64]:
        """Return the state at theta = 0, shape (2n,)."""
        # all waves are 1 there, so this is the sum of the lines, and of those of the derivative by phi
        exponents = _exponents(self.lines.shape[1] - 1)
        state = (self.lines @ np.column_stack((np.ones_like(exponents), exponents))).real.T.ravel()
        state[len(self.lines) :] *= self.frequency / self.period
        return state

    def turns(self) -> list[NDArray[np.float64]]:
        """Return the angles theta at which each coordinate turns, and its values there; shape (2, turns) each."""
        from gapwalk.orbit.harmonic_balance.kernels import turns  # numba takes longer to load than all the rest

        phi, _, slopes = grid(self.lines.shape[1] - 1)
        found = [turns(row, phi, slopes) for row in self.lines]
        for row in found:
            row[0] = row[0] * self.period % (PERIOD * self.period)
        return found

    def extremes(self) -> NDArray[np.float64]:
        """Return maximum, minimum, mean and root mean square of each coordinate, shape (n, 4)."""
        mean = self.lines[:, 0].real
        square = mean**2 + 0.5 * (np.abs(self.lines[:, 1:]) ** 2).sum(axis=1)
        largest, smallest = mean.copy(), mean.copy()
        for index, (_, values) in enumerate(self.turns()):
            if len(values):
                largest[index], smallest[index] = values.max(), values.min()
        return np.column_stack((largest, smallest, mean, np.sqrt(square)))


def waves(phi: NDArray[np.float64], count: int) -> NDArray[np.complex128]:
    """Return ``exp(i k phi)`` for k = 0 ... count, shape (..., count + 1)."""
    if phi.size < _MANY:
        return np.exp(phi[..., None] * _exponents(count))
    powers = np.empty((*phi.shape, count + 1), dtype=complex)
    powers[..., 0] = 1.0
    powers[..., 1:] = np.exp(1j * phi)[..., None]
    return np.multiply.accumulate(powers, axis=-1, out=powers)


@lru_cache(maxsize=64)
def _exponents(count: int) -> NDArray[np.complex128]:
    return 1j * np.arange(count + 1, dtype=np.complex128)


@lru_cache(maxsize=32)
def grid(count: int) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return a grid that resolves K lines, with eight cells per shortest wave."""
    samples = 8 * max(8, count)
    phi = 2.0 * np.pi * np.arange(samples + 1) / samples
    phi[-1] = 2.0 * np.pi
    wave, k = waves(phi % (2.0 * np.pi), count), np.arange(count + 1)
    values = np.hstack((wave.real, wave.imag[:, 1:]))
    slopes = np.hstack((-k * wave.imag, k[1:] * wave.real[:, 1:]))
    return phi, np.ascontiguousarray(values.T), np.ascontiguousarray(slopes.T)

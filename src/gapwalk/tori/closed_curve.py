"""Closed curves by trigonometric interpolation: an odd number of states at equally spaced phases.

Sample j of a curve is its state at the phase ``2 pi j / N``. With an odd N every harmonic up to (N - 1)/2 has its sine
and cosine, so that interpolation, rotation and differentiation are circulant matrices without an exception.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

TURN = 2.0 * np.pi
"""One turn of the phase of a curve, in radians."""

_LAST = 0.25  # share of the harmonics, the highest, that count as the tail of a series


def phases(count: int) -> NDArray[np.float64]:
    """Return the phases of the samples of a curve, in radians; shape (count,)."""
    return TURN * np.arange(count) / count


def odd(count: int) -> int:
    """Return the smallest odd number that is not below `count`."""
    return count | 1


def rotation_matrices(count: int, turns: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the matrix that rotates the samples of a curve by a share of a turn, and its derivative by that share.

    The product of the matrix with the samples, shape (count, size), has the state at the phase ``psi_j + 2 pi turns``
    in row j. Both matrices are circulant: entry (j, k) depends on j - k alone.
    """
    harmonics = np.arange(1, count // 2 + 1)
    angles = np.outer(phases(count) + TURN * turns, harmonics)
    row = (1.0 + 2.0 * np.cos(angles).sum(axis=1)) / count
    slope = -2.0 * TURN * (np.sin(angles) @ harmonics) / count
    places = (np.arange(count)[:, None] - np.arange(count)) % count
    return row[places], slope[places]


def amplitudes(states: NDArray[np.float64]) -> NDArray[np.complex128]:
    """Return the complex amplitudes of the harmonics 0 to (N - 1)/2 of a curve, shape (harmonics, size).

    The curve is ``u(psi) = Re sum_k a_k exp(i k psi)``.
    """
    found = np.fft.rfft(states, axis=0) / len(states)
    found[1:] *= 2.0
    return found


def at_phases(states: NDArray[np.float64], psi: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the states of a curve at any phases, in radians; shape (len(psi), size)."""
    found = amplitudes(states)
    waves = np.exp(1j * np.outer(psi, np.arange(len(found))))
    return (waves @ found).real


def in_steps(states: NDArray[np.float64], step: float, first: int, count: int) -> NDArray[np.float64]:
    """Return the states of a curve at `count` successive multiples of a step of the phase, from `first` times it on.

    The shape is (count, size). Waves of such phases are products of those of few phases: place ``a`` in one of the rows
    of `width` phases, and row ``b``.
    """
    found = amplitudes(states)
    harmonics, width = np.arange(len(found)), math.isqrt(count - 1) + 1
    inside = np.exp(1j * np.outer(step * np.arange(width), harmonics))
    rows = np.exp(1j * np.outer(step * (first + width * np.arange(width)), harmonics))
    terms = (inside.T[:, :, None] * found[:, None, :]).reshape(len(found), -1)
    return (rows @ terms).real.reshape(width * width, -1)[:count]


def resampled(states: NDArray[np.float64], count: int) -> NDArray[np.float64]:
    """Return the same curve with another, odd number of samples."""
    return at_phases(states, phases(count))


def tangents(states: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the derivative of a curve by its phase at each sample, shape (N, size)."""
    found = amplitudes(states)
    found = 1j * np.arange(len(found))[:, None] * found
    found[1:] /= 2.0
    return np.fft.irfft(found * len(states), n=len(states), axis=0)


def tail(states: NDArray[np.float64]) -> float:
    """Return the size of the highest quarter of the harmonics, as a share of the largest harmonic from 1 on.

    Where it is not small the samples are too few, or the curve is not smooth.
    """
    sizes = np.abs(amplitudes(states))[1:].max(axis=1)
    last = max(1, int(_LAST * len(sizes)))
    return float(sizes[-last:].max() / max(sizes.max(), np.finfo(float).tiny))


def of_quasi_periodic(
    samples: NDArray[np.float64], rotation: float, count: int, weights: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the closed curve on which a sequence of states rotates by a known share of a turn each time.

    The amplitude of harmonic k is the weighted average of ``samples[n] exp(-2 pi i k n rotation)``. With smooth weights
    that vanish at both ends, it converges faster than any power of the number of samples (Das, Saiki, Sander and Yorke
    2017, Nonlinearity 30, 4111-4140), and the curve may have any shape.

    Shapes: `samples` (length, size); `weights` (length,).
    """
    turns = TURN * rotation * np.arange(len(samples))
    found = np.array([(weights * np.exp(-1j * k * turns)) @ samples for k in range(count // 2 + 1)])
    found[1:] *= 2.0
    waves = np.exp(1j * np.outer(phases(count), np.arange(len(found))))
    return (waves @ found).real

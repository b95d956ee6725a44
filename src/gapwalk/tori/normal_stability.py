"""Stability of a torus: the growth of small deviations from it, without the one along it.

The transition matrix along the curve carries its tangent into the tangent at the rotated phase. In orthonormal frames
whose first vector is the tangent it is block triangular, and the other diagonal block N(psi) carries deviations modulo
the tangent. Exponents are averages of ``log R_ii`` of QR factors along ``N(psi + rho k)``. The factors converge to
functions of the phase, so that smooth weights make the averages converge faster than any power of their number. Next to
a resonance the phases repeat nearly and the averages converge slowly, so that their error is estimated and stated.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lapack

from gapwalk.attractors.lyapunov import birkhoff_weights
from gapwalk.tori.closed_curve import TURN, in_steps, tangents

_SETTLING = 200  # returns until the frames have aligned
_AVERAGED = (600, 2400, 9600)  # returns over which the growth is averaged, until the error is small
_ENOUGH = 1e-7  # error of an exponent that is small
_LEAST = 1e-300  # growth below which a direction counts as lost at once
_SPREAD = 12.0  # logarithm of the largest ratio of growths in a product of returns that keeps 10 digits of the least
_BLOCKS = (8, 4, 2)  # returns whose product is factorised at once, if the growths in it differ no more


def normal_exponents(
    states: NDArray[np.float64], transitions: NDArray[np.float64], rotation: float, unit: NDArray[np.float64]
) -> tuple[NDArray[np.float64], float]:
    """Return the growth of deviations from a torus in one return to the curve, and the error of the largest.

    Shapes: `states` (N, size); `transitions` (N, size, size); `unit` (size,).
    """
    count, size = states.shape
    scaled = (transitions * unit / unit[:, None]).reshape(count, -1)
    slopes = tangents(states / unit)
    frame, growth = np.eye(size - 1), np.zeros((0, size - 1))
    done, block, exponents, error = 0, 0, np.zeros(size - 1), np.inf
    for averaged in _AVERAGED:
        returns = _SETTLING + averaged - done
        along = in_steps(slopes, TURN * rotation, done, returns + 1)
        frames = _frames(along / np.linalg.norm(along, axis=1)[:, None])
        maps = in_steps(scaled, TURN * rotation, done, returns).reshape(-1, size, size)
        normal = (frames[1:].transpose(0, 2, 1) @ maps @ frames[:-1])[:, 1:, 1:]
        block, done = block or _block(normal), _SETTLING + averaged
        frame, grown = _carried(_products(normal, block), frame)
        growth = np.vstack((growth, grown))
        logarithms = np.log(np.maximum(growth[_SETTLING // block :], _LEAST)) / block
        half = birkhoff_weights(averaged // block // 2) @ logarithms[: averaged // block // 2]
        exponents = birkhoff_weights(averaged // block) @ logarithms
        error = float(abs(half.max() - exponents.max()))
        if error < _ENOUGH:
            break
    return np.sort(exponents)[::-1], error


def _block(matrices: NDArray[np.float64]) -> int:
    """Return how many successive matrices to multiply before their product is factorised."""
    sizes = np.linalg.svd(matrices[:_SETTLING], compute_uv=False)
    spread = float(np.log(sizes[:, 0] / np.maximum(sizes[:, -1], _LEAST)).max())
    return next((block for block in _BLOCKS if block * spread < _SPREAD), 1)


def _products(matrices: NDArray[np.float64], block: int) -> NDArray[np.float64]:
    """Return the products of each so many successive matrices, a power of two, the last one on the left."""
    while block > 1:
        matrices, block = matrices[1::2] @ matrices[::2], block // 2
    return matrices


def _carried(
    matrices: NDArray[np.float64], frame: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Carry a frame through matrices by QR factors; return it, and how far each of its vectors grew in each.

    LAPACK is called directly: ``numpy.linalg.qr`` takes eight times as long for matrices of this size.
    """
    growth = np.empty(matrices.shape[:2])
    for place, matrix in enumerate(matrices):
        factors, scales, _, _ = lapack.dgeqrf(matrix.dot(frame))
        growth[place] = factors.diagonal()
        frame = lapack.dorgqr(factors, scales)[0]
    return frame, np.abs(growth)


def _frames(along: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return orthonormal frames whose first vector is a given unit vector, up to its sign, by Householder reflections.

    The shape is (k, size, size), with the vectors in columns.
    """
    size = along.shape[1]
    mirrors = along.copy()
    mirrors[:, 0] += np.where(along[:, 0] < 0.0, -1.0, 1.0)
    mirrors /= np.linalg.norm(mirrors, axis=1)[:, None]
    return np.eye(size) - 2.0 * mirrors[:, :, None] * mirrors[:, None, :]

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

from gapwalk.attractors.lyapunov import birkhoff_weights
from gapwalk.tori.closed_curve import TURN, at_phases, tangents

_SETTLING = 200  # returns until the frames have aligned
_AVERAGED = (600, 2400, 9600)  # returns over which the growth is averaged, until the error is small
_ENOUGH = 1e-7  # error of an exponent that is small
_LEAST = 1e-300  # growth below which a direction counts as lost at once


def normal_exponents(
    states: NDArray[np.float64], transitions: NDArray[np.float64], rotation: float, unit: NDArray[np.float64]
) -> tuple[NDArray[np.float64], float]:
    """Return the growth of deviations from a torus in one return to the curve, and the error of the largest.

    Parameters
    ----------
    states : shape (N, size)
        The curve.
    transitions : shape (N, size, size)
        Derivative of the image of each state by the state.
    rotation
        The rotation number.
    unit : shape (size,)
        Scales of the entries of a state.

    Returns
    -------
    exponents : shape (size - 1,)
        The growth as natural logarithms, largest first.
    error
        Estimated error of the largest: the difference from the average over the first half of the returns.
    """
    count, size = states.shape
    scaled = (transitions * unit / unit[:, None]).reshape(count, -1)
    slopes = tangents(states / unit)
    frame, growth = np.eye(size - 1), np.zeros((0, size - 1))
    done, exponents, error = 0, np.zeros(size - 1), np.inf
    for averaged in _AVERAGED:
        psi = TURN * rotation * np.arange(done, _SETTLING + averaged + 1, dtype=np.float64)
        along = at_phases(slopes, psi)
        frames = _frames(along / np.linalg.norm(along, axis=1)[:, None])
        maps = at_phases(scaled, psi[:-1]).reshape(-1, size, size)
        normal = (frames[1:].transpose(0, 2, 1) @ maps @ frames[:-1])[:, 1:, 1:]
        frame, grown = _carried(normal, frame)
        growth, done = np.vstack((growth, grown)), _SETTLING + averaged
        logarithms = np.log(np.maximum(growth[_SETTLING:], _LEAST))
        half = birkhoff_weights(averaged // 2) @ logarithms[: averaged // 2]
        exponents = birkhoff_weights(averaged) @ logarithms
        error = float(abs(half.max() - exponents.max()))
        if error < _ENOUGH:
            break
    return np.sort(exponents)[::-1], error


def _carried(
    matrices: NDArray[np.float64], frame: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Carry a frame through matrices by QR factors; return it, and how far each of its vectors grew in each."""
    growth = np.empty(matrices.shape[:2])
    for place, matrix in enumerate(matrices):
        frame, upper = np.linalg.qr(matrix @ frame)
        growth[place] = np.abs(np.diagonal(upper))
    return frame, growth


def _frames(along: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return orthonormal frames whose first vector is a given unit vector, up to its sign, by Householder reflections.

    The shape is (k, size, size), with the vectors in columns.
    """
    size = along.shape[1]
    mirrors = along.copy()
    mirrors[:, 0] += np.where(along[:, 0] < 0.0, -1.0, 1.0)
    mirrors /= np.linalg.norm(mirrors, axis=1)[:, None]
    return np.eye(size) - 2.0 * mirrors[:, :, None] * mirrors[:, None, :]

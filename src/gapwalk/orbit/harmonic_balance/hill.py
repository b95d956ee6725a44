"""The monodromy matrix of a balanced motion by Hill's matrix, projected, so that no eigenvalues need be sorted."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from gapwalk.orbit.harmonic_balance.monodromy import Linearised
from gapwalk.orbit.harmonic_balance.sampled_forces import Pairs


def projected_monodromy(
    linearised: Linearised, tangents: NDArray[np.complex128], length: float, pairs: Pairs
) -> NDArray[np.float64]:
    """Compute the monodromy matrix of positions and momenta over one period, shape (2n, 2n).

    Shapes: `tangents` (2 contacts, 2K + 1).

    Notes
    -----
    With ``z_k = exp(i k W t / m) y`` the equation ``y' = sum_l L_l exp(i l W t / m) y`` has constant coefficients,
    ``z_k' = i k (W/m) z_k + sum_l L_l z_(k+l)``: Hill's matrix. The monodromy matrix is the middle row of its
    exponential, applied to ``z_k(0) = y(0)`` (Bayer and Leine 2023, Nonlinear Dynamics 111, 8439-8466: the Koopman-Hill
    projection). Classical methods take 2n of its eigenvalues, and may take the wrong ones.
    """
    steady, parts = linearised.steady, linearised.parts
    size, count = len(steady), (tangents.shape[1] - 1) // 2
    spectra = _two_sided(tangents)  # k = -2K ... 2K
    if len(pairs.forces):
        by_deflection, by_rate = (_two_sided(pairs.spectra[:, which]) for which in (0, 1))
        dampers = spectra[len(parts) // 2 + linearised.damped]
        products = [np.convolve(rate, damper, "same") for damper in dampers for rate in by_rate]
        spectra = np.vstack((spectra, by_deflection, by_rate, *products))
        parts = np.concatenate((parts, linearised.pair_parts(pairs)))
    harmonics = np.tensordot(spectra.T, parts, axes=1)
    harmonics[2 * count] += steady
    k = np.arange(2 * count + 1)
    blocks = harmonics[2 * count + k[None, :] - k[:, None]]
    matrix = blocks.transpose(0, 2, 1, 3).reshape(len(k) * size, len(k) * size)
    rates = 2j * np.pi / length * (k - count)
    matrix[np.diag_indices(len(matrix))] += np.repeat(rates, size)
    spread = expm(matrix * length)
    middle = spread[count * size : (count + 1) * size]
    return middle.reshape(size, len(k), size).sum(axis=1).real


def _two_sided(spectra: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Return the parts with negative k, too, of spectra of real functions."""
    return np.concatenate((spectra[:, :0:-1].conj(), spectra), axis=1)

"""Compiled kernels of the equation of harmonic balance: residual, Jacobian, and the forces on neglected lines."""

from __future__ import annotations

import numpy as np

from gapwalk.orbit.harmonic_balance.kernels import kernel, part


@part
def _tangent(forces, shift, w, k, j):
    """Return the lines k of the change of a force with the cosine and with the sine j of its deflection.

    With the spectrum u of the tangent, ``u cos j`` has the line ``u_(k-j) + u_(k+j)`` and ``u sin j`` the line
    ``i (u_(k+j) - u_(k-j))``; half of that for k = 0.
    """
    iw = complex(0.0, w)
    far = forces[1, k + j] + iw * forces[3, k + j]
    if k >= j:
        near = forces[1, k - j] + iw * forces[3, k - j]
    else:
        near = forces[1, j - k].conjugate() + iw * forces[3, j - k].conjugate()
    if k == j:
        near -= shift
        if k == 0:
            far -= shift
    half = 0.5 if k == 0 else 1.0
    return half * (far + near), half * (far - near)


@part
def _pair_tangent(spectra, frequencies, k, j):
    """Return the lines k of the change of a force by a formula, as `_tangent`, with the tangents by x and by its rate.

    The rate of the cosine j is the sine times -w, that of the sine the cosine times w.
    """
    iw = complex(0.0, frequencies[j])
    far = spectra[0, k + j] - iw * spectra[1, k + j]
    if k >= j:
        near = spectra[0, k - j] + iw * spectra[1, k - j]
    else:
        near = spectra[0, j - k].conjugate() + iw * spectra[1, j - k].conjugate()
    half = 0.5 if k == 0 else 1.0
    return half * (far + near), half * (far - near)


@part
def _add_pairs(pair_forces, pair_arguments, pair_spectra, frequencies, flexibility, jacobian):
    """Add what the derivatives of forces by formulas contribute to the Jacobian."""
    contacts, count = flexibility.shape[1], len(flexibility) - 1
    size = 2 * count + 1
    for pair in range(len(pair_forces)):
        d, e = pair_forces[pair], pair_arguments[pair]
        for k in range(count + 1):
            for j in range(count + 1):
                cosine, sine = _pair_tangent(pair_spectra[pair], frequencies, k, j)
                for c in range(contacts):
                    row, column = c * size + k, e * size + j
                    by_cosine, by_sine = flexibility[k, c, d] * cosine, flexibility[k, c, d] * sine
                    jacobian[row, column] += by_cosine.real
                    if j:
                        jacobian[row, column + count] -= by_sine.imag
                    if k:
                        jacobian[row + count, column] -= by_cosine.imag
                    if j and k:
                        jacobian[row + count, column + count] -= by_sine.real


@kernel(
    "Tuple((f8[::1], f8[:, ::1], c16[:, ::1], c16[:, ::1]))"
    "(c16[:, ::1], c16[:, :, ::1], c16[:, :, ::1], f8[::1], f8[::1], f8[::1], c16[:, ::1], c16[:, :, ::1],"
    " i8[::1], i8[::1], c16[:, :, ::1])"
)
def balance(
    lines,
    forces,
    moved,
    shift,
    frequencies,
    slopes,
    free,
    flexibility,
    pair_forces,
    pair_arguments,
    pair_spectra,
):
    """Compute residual and Jacobian in real forms; forces and derivatives by the parameter, shape (K + 1, contacts).

    `free` and `flexibility` have the lines first, as have the forces that are returned.
    """
    contacts, count = len(lines), lines.shape[1] - 1
    size = 2 * count + 1
    total, change = np.empty((count + 1, contacts), np.complex128), np.empty((count + 1, contacts), np.complex128)
    for c in range(contacts):
        for k in range(count + 1):
            iw = complex(0.0, frequencies[k])
            total[k, c] = forces[c, 0, k] - shift[c] * lines[c, k] + iw * forces[c, 2, k]
            change[k, c] = moved[c, 0, k] + iw * moved[c, 1, k] + complex(0.0, slopes[k]) * forces[c, 2, k]
    residual, jacobian = np.empty(contacts * size), np.empty((contacts * size, contacts * size))
    for c in range(contacts):
        for k in range(count + 1):
            rest = lines[c, k] - free[k, c]
            for d in range(contacts):
                rest += flexibility[k, c, d] * total[k, d]
            # of line 0 the imaginary part is zero and has no place: the real part of line K is written over it
            residual[c * size + count + k] = -rest.imag
            residual[c * size + k] = rest.real
    for d in range(contacts):
        for k in range(count + 1):
            for j in range(count + 1):
                cosine, sine = _tangent(forces[d], shift[d], frequencies[k], k, j)
                for c in range(contacts):
                    row, column = c * size + k, d * size + j
                    # again, what has no place is written over
                    by_cosine, by_sine = flexibility[k, c, d] * cosine, flexibility[k, c, d] * sine
                    jacobian[row + count, column + count] = -by_sine.real
                    jacobian[row, column + count] = -by_sine.imag
                    jacobian[row + count, column] = -by_cosine.imag
                    jacobian[row, column] = by_cosine.real
    _add_pairs(pair_forces, pair_arguments, pair_spectra, frequencies, flexibility, jacobian)
    for index in range(contacts * size):
        jacobian[index, index] += 1.0
    return residual, jacobian, total, change


@kernel("c16[:, ::1](c16[:, ::1], c16[:, :, ::1], f8[::1], f8[::1], i8[::1], i8[::1], c16[:, :, ::1])")
def changed(step, forces, shift, frequencies, pair_forces, pair_arguments, pair_spectra):
    """Compute the change of the forces with that of the deflections, shapes (K + 1, contacts), (contacts, K + 1)."""
    contacts, count = step.shape[0], step.shape[1] - 1
    result = np.zeros((count + 1, contacts), np.complex128)
    for c in range(contacts):
        for k in range(count + 1):
            for j in range(count + 1):
                cosine, sine = _tangent(forces[c], shift[c], frequencies[k], k, j)
                result[k, c] += cosine * step[c, j].real
                if j:
                    result[k, c] -= complex(0.0, 1.0) * sine * step[c, j].imag
    for pair in range(len(pair_forces)):
        d, e = pair_forces[pair], pair_arguments[pair]
        for k in range(count + 1):
            for j in range(count + 1):
                cosine, sine = _pair_tangent(pair_spectra[pair], frequencies, k, j)
                result[k, d] += cosine * step[e, j].real
                if j:
                    result[k, d] -= complex(0.0, 1.0) * sine * step[e, j].imag
    return result


@kernel("c16[:, ::1](c16[:, :, ::1], f8[::1])")
def beyond(forces, frequencies):
    """Compute the forces on the lines from K + 1 to 2K, whose frequencies are given, shape (K, contacts)."""
    count = len(frequencies)
    result = np.empty((count, len(forces)), np.complex128)
    for c in range(len(forces)):
        for k in range(count):
            result[k, c] = forces[c, 0, count + 1 + k] + complex(0.0, frequencies[k]) * forces[c, 2, count + 1 + k]
    return result


@kernel("f8(c16[:, ::1], c16[:, ::1])")
def share(neglected, lines):
    """Return the largest sum of amplitudes in neglected lines, shape (K, contacts), relative to the other lines."""
    largest, kept = 0.0, 0.0
    for c in range(len(lines)):
        some, others = 0.0, 0.0
        for k in range(len(neglected)):
            some += abs(neglected[k, c])
            others += abs(lines[c, k + 1])
        largest, kept = max(largest, some), max(kept, others)
    return largest / kept if kept > 0.0 else 0.0

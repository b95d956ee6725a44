"""What harmonic balance computes at every point on a few hundred numbers, compiled: zeros, forces, derivatives.

In NumPy's calls these loops would cost ten times as much as in themselves. Machine code is kept beside this file (or in
numba's folder of the user), so that a process loads it within milliseconds; the first one compiles it.

Kernels that call one another stand together in this file: numba compiles anew when the file of a kernel changes, but
does not look at the files of those that it calls.
"""

from __future__ import annotations

from typing import Any

import numba
import numpy as np

_ITERATIONS = 60  # bisection alone would need about 50; Newton's method takes 4
_QUICK = 6
_ROUNDING = 1e-14  # of an angle up to 2 pi, with that of the series
_CLOSE = 3e-6  # last step of Halley's method, whose errors grow with the cube of the step
_TINY = 1e-300

# No assumption that there is no NaN: a motion that ran away must be seen. Division follows NumPy's rules.
OPTIONS = {"error_model": "numpy", "fastmath": {"contract", "reassoc", "nsz"}, "nogil": True}


def kernel(signature: str):
    """Compile a function for one signature, and keep the machine code where there is a place for it."""

    def compiled(function: Any) -> Any:
        try:
            return numba.njit(signature, cache=True, **OPTIONS)(function)
        except RuntimeError:  # neither the package nor the user has a folder that can be written
            return numba.njit(signature, **OPTIONS)(function)

    return compiled


@numba.njit(**OPTIONS)
def _at(lines, phi):
    """Value, slope and bend at an angle of the function with some lines."""
    wave, turn = 1.0 + 0.0j, complex(np.cos(phi), np.sin(phi))
    value, slope, bend = lines[0].real, 0.0, 0.0
    for k in range(1, len(lines)):
        wave *= turn
        product = lines[k] * wave
        value += product.real
        slope -= k * product.imag
        bend -= k * k * product.real
    return value, slope, bend


@numba.njit(**OPTIONS)
def _zero(lines, low, high, at_low, at_high):
    """One zero by Halley's method; by Newton's with bisection where that leaves the bracket."""
    phi = low + (high - low) * (at_low / (at_low - at_high))
    for _ in range(_QUICK):
        value, slope, bend = _at(lines, phi)
        change = value * slope / (slope * slope - 0.5 * value * bend + _TINY)
        phi -= change
        if abs(change) < _CLOSE:
            if low - _ROUNDING <= phi <= high + _ROUNDING:
                return phi
            break
    rises, phi = at_high > at_low, 0.5 * (low + high)
    for _ in range(_ITERATIONS):
        value, slope, _ = _at(lines, phi)
        if (value > 0.0) == rises:
            high = phi
        else:
            low = phi
        following = phi - value / (slope + _TINY)
        if not low <= following <= high:
            following = 0.5 * (low + high)
        change, phi = abs(following - phi), following
        if change < _ROUNDING:
            break
    return phi


@kernel("f8[::1](c16[:, ::1], f8[::1], f8[::1], f8[::1], f8[::1])")
def zeros(lines, low, high, at_low, at_high):
    """One zero of each function of shape (functions, K + 1), between angles at which its sign differs."""
    result = np.empty(len(lines))
    for index in range(len(lines)):
        result[index] = _zero(lines[index], low[index], high[index], at_low[index], at_high[index])
    return result


@numba.njit(**OPTIONS)
def _sampled(lines, values, slopes):
    """Values and slopes of functions on the grid, each of shape (functions, samples + 1)."""
    count, samples = lines.shape[1] - 1, values.shape[1]
    result = np.zeros((2, len(lines), samples))
    for c in range(len(lines)):
        for k in range(count + 1):
            cosine, sine = lines[c, k].real, -lines[c, k].imag
            for s in range(samples):
                result[0, c, s] += cosine * values[k, s]
                result[1, c, s] += cosine * slopes[k, s]
            if k:
                for s in range(samples):
                    result[0, c, s] += sine * values[count + k, s]
                    result[1, c, s] += sine * slopes[count + k, s]
    return result


@numba.njit(**OPTIONS)
def _visits(lines, contact, sign, clearance, phi, values, slopes):
    """Crossings of every breakpoint: angles, switches, whether each enters; and what is closed at phi = 0."""
    sampled = _sampled(lines, values, slopes)
    switches, cells, size = len(contact), len(phi) - 1, lines.shape[1]
    angles, switch = np.empty(2 * switches * cells), np.empty(2 * switches * cells, dtype=np.int64)
    enters, starts = np.empty(2 * switches * cells, dtype=np.bool_), np.empty(switches, dtype=np.bool_)
    function, rates, number = np.empty(size, dtype=np.complex128), np.empty(size, dtype=np.complex128), 0
    for j in range(switches):
        c = contact[j]
        for k in range(size):
            function[k] = sign[j] * lines[c, k]
            rates[k] = complex(-k * function[k].imag, k * function[k].real)
        function[0] -= clearance[j]
        then = sign[j] * sampled[0, c, 0] - clearance[j]
        inside = then > 0.0
        starts[j] = inside
        for cell in range(cells):
            now, then = then, sign[j] * sampled[0, c, cell + 1] - clearance[j]
            low, high = phi[cell], phi[cell + 1]
            if (then > 0.0) != inside:
                inside = not inside
                angles[number] = _zero(function, low, high, now, then)
                switch[number], enters[number] = j, inside
                number += 1
                continue
            # an extremum in the cell, so near to the breakpoint that the slopes may lead there?
            speed, after = sign[j] * sampled[1, c, cell], sign[j] * sampled[1, c, cell + 1]
            if inside != (speed < 0.0) or inside == (after < 0.0):
                continue
            if not min(abs(now), abs(then)) < phi[1] * max(abs(speed), abs(after)):
                continue
            middle = _zero(rates, low, high, speed, after)
            turn = _at(function, middle)[0]
            if (turn > 0.0) != inside:
                angles[number] = _zero(function, low, middle, now, turn)
                angles[number + 1] = _zero(function, middle, high, turn, then)
                switch[number], enters[number] = j, not inside
                switch[number + 1], enters[number + 1] = j, inside
                number += 2
    return angles[:number].copy(), switch[:number].copy(), enters[:number].copy(), starts


@numba.njit(**OPTIONS)
def _indicator(j, angles, switch, enters, starts, longest):
    """Spectrum, k = 0 ... longest, of the function that is 1 while a stage is closed.

    In closed form: ``(exp(-i k enters) - exp(-i k leaves)) / (2 pi i k)`` summed over the visits.
    """
    result = np.zeros(longest + 1, dtype=np.complex128)
    mean = 1.0 if starts[j] else 0.0
    for index in range(len(angles)):
        if switch[index] != j:
            continue
        sign = 1.0 if enters[index] else -1.0
        mean -= sign * angles[index] / (2.0 * np.pi)
        wave, turn = complex(sign, 0.0), complex(np.cos(angles[index]), -np.sin(angles[index]))
        for k in range(1, longest + 1):
            wave *= turn
            result[k] += wave
    for k in range(1, longest + 1):
        result[k] = complex(result[k].imag, -result[k].real) / (2.0 * np.pi * k)
    result[0] = mean
    return result


@numba.njit(**OPTIONS)
def _powers(indicator, depth, degree, kept):
    """Spectra, k = 0 ... kept, of an indicator times 1, xi ... xi^degree; xi has the spectrum `depth`, k = 0 ... K."""
    longest, count = len(indicator) - 1, len(depth) - 1
    result = np.empty((degree + 1, kept + 1), dtype=np.complex128)
    result[0] = indicator[: kept + 1]
    # real and imaginary parts, from k = -K on, lie apart: so the loops over k fill the registers
    real, imaginary = np.empty(count + longest + 1), np.empty(count + longest + 1)
    for k in range(longest + 1):
        real[count + k], imaginary[count + k] = indicator[k].real, indicator[k].imag
    for exponent in range(1, degree + 1):
        for k in range(1, count + 1):
            real[count - k], imaginary[count - k] = real[count + k], -imaginary[count + k]
        longest -= count
        a, b = np.zeros(longest + 1), np.zeros(longest + 1)
        for k in range(longest + 1):
            a[k], b[k] = real[count + k] * depth[0].real, imaginary[count + k] * depth[0].real
        for j in range(1, count + 1):
            p, q = depth[j].real, depth[j].imag
            for k in range(longest + 1):
                left, right = count + k - j, count + k + j
                a[k] += (real[left] + real[right]) * p + (imaginary[right] - imaginary[left]) * q
                b[k] += (imaginary[left] + imaginary[right]) * p + (real[left] - real[right]) * q
        for k in range(longest + 1):
            real[count + k], imaginary[count + k] = a[k], b[k]
        for k in range(kept + 1):
            result[exponent, k] = complex(a[k], b[k])
    return result


_FORCES = (
    "Tuple((c16[:, :, ::1], c16[:, :, ::1], f8[::1], i8[::1], b1[::1]))"
    "(c16[:, ::1], i8[::1], f8[::1], f8[::1], f8[:, :, ::1], f8[:, :, ::1], b1, f8[::1], f8[:, ::1], f8[:, ::1])"
)


@kernel(_FORCES)
def contact_forces(lines, contact, sign, clearance, table, slope_table, moves, phi, values, slopes):
    """Lines of g, g', P and P' of each contact, derivatives of g and P by the parameter, and the visits; see `Forces`.

    The spectra of g' and P' are as they are; g, P and their derivatives by the parameter are lines.
    """
    contacts, count, degree = len(lines), lines.shape[1] - 1, table.shape[2] - 1
    angles, switch, enters, starts = _visits(lines, contact, sign, clearance, phi, values, slopes)
    forces = np.zeros((4, contacts, 2 * count + 1), dtype=np.complex128)
    moved = np.zeros((2, contacts, count + 1), dtype=np.complex128)
    depth = np.empty(count + 1, dtype=np.complex128)
    for j in range(len(contact)):
        indicator = _indicator(j, angles, switch, enters, starts, (2 + degree) * count)
        if indicator[0].real == 0.0:
            continue
        c = contact[j]
        for k in range(1, count + 1):
            depth[k] = 0.5 * sign[j] * lines[c, k]
        depth[0] = sign[j] * lines[c, 0].real - clearance[j]
        powers = _powers(indicator, depth, degree, 2 * count)
        for exponent in range(degree + 1):
            for row in range(4):
                factor = table[j, row, exponent]
                if factor != 0.0:
                    for k in range(2 * count + 1):
                        forces[row, c, k] += factor * powers[exponent, k]
            if moves:
                for row in range(2):
                    for k in range(count + 1):
                        moved[row, c, k] += slope_table[j, row, exponent] * powers[exponent, k]
    for c in range(contacts):  # from spectra to lines
        for k in range(1, 2 * count + 1):
            forces[0, c, k] *= 2.0
            forces[2, c, k] *= 2.0
        for k in range(1, count + 1):
            moved[0, c, k] *= 2.0
            moved[1, c, k] *= 2.0
    return forces, moved, angles, switch, enters


_BALANCE = (
    "Tuple((f8[::1], f8[:, ::1], c16[:, ::1], c16[:, ::1]))"
    "(c16[:, ::1], c16[:, :, ::1], c16[:, :, ::1], f8[::1], f8[::1], f8[::1], c16[:, ::1], c16[:, :, ::1])"
)


@kernel(_BALANCE)
def balance(lines, forces, moved, shift, frequencies, slopes, free, flexibility):
    """Residual and Jacobian in real forms; lines of the total forces, and of their derivatives by the parameter.

    `free` and `flexibility` have the lines first. The derivative of a force at a line k by the real form of its
    deflection follows from the spectrum u of its tangent: ``u cos j`` has the line ``u_(k-j) + u_(k+j)``, ``u sin j``
    the line ``i (u_(k+j) - u_(k-j))``; half of that for k = 0.
    """
    contacts, count = len(lines), lines.shape[1] - 1
    size = 2 * count + 1
    total, change = np.empty_like(lines), np.empty_like(lines)
    for c in range(contacts):
        for k in range(count + 1):
            iw = complex(0.0, frequencies[k])
            total[c, k] = forces[0, c, k] - shift[c] * lines[c, k] + iw * forces[2, c, k]
            change[c, k] = moved[0, c, k] + iw * moved[1, c, k] + complex(0.0, slopes[k]) * forces[2, c, k]
    residual, jacobian = np.empty(contacts * size), np.zeros((contacts * size, contacts * size))
    for c in range(contacts):
        for k in range(count + 1):
            rest = lines[c, k] - free[k, c]
            for d in range(contacts):
                rest += flexibility[k, c, d] * total[d, k]
            residual[c * size + k] = rest.real
            if k:
                residual[c * size + count + k] = -rest.imag
    for d in range(contacts):
        for k in range(count + 1):
            iw, half = complex(0.0, frequencies[k]), 0.5 if k == 0 else 1.0
            for j in range(count + 1):
                far = forces[1, d, k + j] + iw * forces[3, d, k + j]
                if k >= j:
                    near = forces[1, d, k - j] + iw * forces[3, d, k - j]
                else:
                    near = forces[1, d, j - k].conjugate() + iw * forces[3, d, j - k].conjugate()
                if k == j:
                    near -= shift[d]
                if k == 0 and j == 0:
                    far -= shift[d]
                cosine, sine = half * (far + near), half * (far - near)
                for c in range(contacts):
                    row, column = c * size + k, d * size + j
                    product = flexibility[k, c, d] * cosine
                    jacobian[row, column] = product.real
                    if k:
                        jacobian[row + count, column] = -product.imag
                    if j:
                        product = flexibility[k, c, d] * sine
                        jacobian[row, column + count] = -product.imag
                        if k:
                            jacobian[row + count, column + count] = -product.real
    for index in range(contacts * size):
        jacobian[index, index] += 1.0
    return residual, jacobian, total, change


@kernel("c16[::1](c16[::1], c16[::1])")
def product(spectrum, lines):
    """Lines, k = 0 ... K, of the product of a function with a spectrum, k = 0 ... 2K, and one with K lines."""
    count = len(lines) - 1
    result = np.empty_like(lines)
    for k in range(count + 1):
        value = 2.0 * spectrum[k] * lines[0]
        for j in range(1, count + 1):
            near = spectrum[k - j] if k >= j else spectrum[j - k].conjugate()
            value += near * lines[j] + spectrum[k + j] * lines[j].conjugate()
        result[k] = value
    result[0] *= 0.5
    return result

"""Compiled kernels of harmonic balance: zeros and turning points of series, and contact forces.

At every point harmonic balance computes with a few hundred numbers: the overhead of NumPy calls would cost many times
as much as the arithmetic. Machine code is stored next to the file of each kernel, or in numba's folder of the user, so
that a process loads it in a fraction of a second; only the first one compiles it, in about 15 seconds.

Three rules. Kernels are in one file with the parts that they call: numba compiles again when the file of a kernel
changes, but does not look at other files. They are written in numbers, not in whole arrays: each expression of arrays
brings in code for shapes, broadcasting and error messages, which takes longer to compile than the kernel. And parts are
inlined: otherwise the process that compiles a kernel would call parts that were compiled one by one, a process that
loads it parts that were optimised with it, and the two might round differently.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numba
import numpy as np

# NaN must be allowed, so that a divergent motion is noticed. Division follows NumPy's rules.
_OPTIONS: dict[str, Any] = {
    "error_model": "numpy",
    "fastmath": {"contract", "reassoc", "nsz"},
    "nogil": True,
    "no_cfunc_wrapper": True,
}
_PART: dict[str, Any] = {**_OPTIONS, "no_cpython_wrapper": True, "forceinline": True}


def kernel(signature: str) -> Callable[[Any], Any]:
    """Compile a function for one signature, and store the machine code if there is a folder for it."""

    def compiled(function: Any) -> Any:
        try:
            return numba.njit(signature, cache=True, **_OPTIONS)(function)
        except RuntimeError:  # neither the package nor the user has a folder that can be written
            return numba.njit(signature, **_OPTIONS)(function)

    return compiled


def part(function: Any) -> Any:
    """Compile a function with the kernels that call it."""
    return numba.njit(**_PART)(function)


_ITERATIONS = 60  # bisection alone would need about 50; Newton's method takes 4
_QUICK = 6
_ROUNDING = 1e-14  # of an angle up to 2 pi, with that of the series
_CLOSE = 3e-6  # last step of Halley's method, whose errors grow with the cube of the step
_TINY = 1e-300


@part
def _at(lines, phi):
    """Evaluate a function with given lines at an angle: value, slope and second derivative."""
    wave, turn = 1.0 + 0.0j, complex(np.cos(phi), np.sin(phi))
    value, slope, bend = lines[0].real, 0.0, 0.0
    for k in range(1, len(lines)):
        wave *= turn
        term = lines[k] * wave
        value += term.real
        slope -= k * term.imag
        bend -= k * k * term.real
    return value, slope, bend


@part
def _zero(lines, low, high, at_low, at_high):
    """Find one zero by Halley's method; by bisection where that leaves the bracket."""
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


@part
def _rate(lines):
    """Return the lines of the derivative by phi."""
    result = np.empty(len(lines), np.complex128)
    for k in range(len(lines)):
        result[k] = complex(-k * lines[k].imag, k * lines[k].real)
    return result


@part
def _sampled(lines, table):
    """Evaluate a function on a grid; the table maps its real form to the values."""
    result, count = np.zeros(table.shape[1]), len(lines) - 1
    for row in range(2 * count + 1):
        part = lines[row].real if row <= count else -lines[row - count].imag
        for s in range(len(result)):
            result[s] += part * table[row, s]
    return result


@kernel("c16[:, ::1](f8[:, :])")
def from_real_form(real):
    """Return lines, shape (functions, K + 1), of real forms of shape (functions, 2K + 1)."""
    count = real.shape[1] // 2
    result = np.empty((len(real), count + 1), np.complex128)
    for row in range(len(real)):
        result[row, 0] = real[row, 0]
        for k in range(1, count + 1):
            result[row, k] = complex(real[row, k], -real[row, count + k])
    return result


@kernel("f8[:, ::1](c16[:, :])")
def real_form(lines):
    """Return real forms, shape (functions, 2K + 1), of lines of shape (functions, K + 1)."""
    count = lines.shape[1] - 1
    result = np.empty((len(lines), 2 * count + 1))
    for row in range(len(lines)):
        result[row, 0] = lines[row, 0].real
        for k in range(1, count + 1):
            result[row, k], result[row, count + k] = lines[row, k].real, -lines[row, k].imag
    return result


@part
def _first(rows, number):
    """Return the first columns of an array."""
    result = np.empty((len(rows), number))
    for row in range(len(rows)):
        for index in range(number):
            result[row, index] = rows[row, index]
    return result


@kernel("f8[:, ::1](c16[::1], f8[::1], f8[:, ::1])")
def turns(lines, phi, slopes):
    """Find the angles at which a function turns, and its values there, shape (2, turns), from its lines."""
    # Turning points are bracketed on a grid (see `grid`), then found by Halley's method.
    speeds, rates, number = _sampled(lines, slopes), _rate(lines), np.int64(0)
    found = np.empty((2, len(phi)))
    for cell in range(len(phi) - 1):
        if (speeds[cell] > 0.0) != (speeds[cell + 1] > 0.0):
            found[0, number] = _zero(rates, phi[cell], phi[cell + 1], speeds[cell], speeds[cell + 1])
            found[1, number] = _at(lines, found[0, number])[0]
            number += 1
    return _first(found, number)


@part
def _enter(found, number, switch, function, low, high, at_low, at_high):
    """Append one crossing of a breakpoint to a list of angles, slopes, whether the slope is positive, and switches."""
    found[0, number] = _zero(function, low, high, at_low, at_high)
    found[1, number] = _at(function, found[0, number])[1]
    found[2, number] = 1.0 if at_high > at_low else 0.0
    found[3, number] = switch
    return number + 1


@part
def _crossings(switch, function, depths, speeds, phi, found, number):
    """Append every zero of a function, given by its lines and its values on a grid, to a list."""
    for cell in range(len(phi) - 1):
        low, high, now, then = phi[cell], phi[cell + 1], depths[cell], depths[cell + 1]
        if (now > 0.0) != (then > 0.0):
            number = _enter(found, number, switch, function, low, high, now, then)
            continue
        # two zeros on both sides of an extremum in the cell, so near to zero that the slopes may point there?
        speed, after = speeds[cell], speeds[cell + 1]
        if (now > 0.0) != (speed < 0.0) or (now > 0.0) == (after < 0.0):
            continue
        if min(abs(now), abs(then)) < phi[1] * max(abs(speed), abs(after)):
            middle = _zero(_rate(function), low, high, speed, after)
            turn = _at(function, middle)[0]
            if (turn > 0.0) != (now > 0.0):
                number = _enter(found, number, switch, function, low, middle, now, turn)
                number = _enter(found, number, switch, function, middle, high, turn, then)
    return number


@part
def _indicator(found, first, last, starts, longest):
    """Return the spectrum, k = 0 ... longest, of the function that is 1 while a stage is closed."""
    # In closed form: ``(exp(-i k enters) - exp(-i k leaves)) / (2 pi i k)`` summed over the visits.
    result = np.zeros(longest + 1, np.complex128)
    mean = 1.0 if starts else 0.0
    for index in range(first, last):
        phi, sign = found[0, index], 2.0 * found[2, index] - 1.0
        mean -= sign * phi / (2.0 * np.pi)
        wave, turn = complex(sign, 0.0), complex(np.cos(phi), -np.sin(phi))
        for k in range(1, longest + 1):
            wave *= turn
            result[k] += wave
    for k in range(1, longest + 1):
        result[k] = complex(result[k].imag, -result[k].real) / (2.0 * np.pi * k)
    result[0] = mean
    return result


@part
def _powers(indicator, function, degree, kept):
    """Return the spectra, k = 0 ... kept, of an indicator times 1, xi ... xi^degree; xi has the given lines."""
    longest, count = len(indicator) - 1, len(function) - 1
    result = np.empty((degree + 1, kept + 1), np.complex128)
    # real and imaginary parts, from k = -K on, lie apart: so the loops over k fill the registers
    real, imaginary = np.empty(count + longest + 1), np.empty(count + longest + 1)
    a, b = np.empty(longest + 1), np.empty(longest + 1)
    for k in range(longest + 1):
        a[k], b[k] = indicator[k].real, indicator[k].imag
    for exponent in range(degree + 1):
        if exponent:
            longest -= count
            for k in range(longest + 1):
                a[k], b[k] = real[count + k] * function[0].real, imaginary[count + k] * function[0].real
            for j in range(1, count + 1):
                p, q = 0.5 * function[j].real, 0.5 * function[j].imag
                for k in range(longest + 1):
                    left, right = count + k - j, count + k + j
                    a[k] += (real[left] + real[right]) * p + (imaginary[right] - imaginary[left]) * q
                    b[k] += (imaginary[left] + imaginary[right]) * p + (real[left] - real[right]) * q
        for k in range(longest + 1):
            real[count + k], imaginary[count + k] = a[k], b[k]
        for k in range(1, count + 1):
            real[count - k], imaginary[count - k] = a[k], -b[k]
        for k in range(kept + 1):
            result[exponent, k] = complex(a[k], b[k])
    return result


@part
def _add(table, powers, result):
    """Add the sum of some powers to each row."""
    for row in range(len(result)):
        for exponent in range(len(powers)):
            factor = table[row, exponent]
            if factor != 0.0:
                for k in range(result.shape[1]):
                    result[row, k] += factor * powers[exponent, k]


@part
def _add_waves(orders, table, powers, result):
    """Add the sum of some powers, each times a function of the angle, to each row."""
    # With the spectrum h of a power, ``h cos l`` has the spectrum ``(h_(k-l) + h_(k+l)) / 2`` and ``h sin l`` that of
    # ``(h_(k-l) - h_(k+l)) / 2i``.
    for row in range(len(result)):
        for exponent in range(len(powers)):
            for place in range(len(orders)):
                cosine, sine = table[row, exponent, place], table[row, exponent, len(orders) + place]
                if cosine == 0.0 and sine == 0.0:
                    continue
                order, down, up = orders[place], complex(0.5 * cosine, -0.5 * sine), complex(0.5 * cosine, 0.5 * sine)
                for k in range(result.shape[1]):
                    lower = powers[exponent, k - order] if k >= order else powers[exponent, order - k].conjugate()
                    result[row, k] += down * lower + up * powers[exponent, k + order]


@part
def _gated(found, first, last, starts, gate, open_first, jumps, merged):
    """Merge the visits of a stage with the angles at which its gate opens and closes."""
    # Returns the number of changes of the function that is 1 while both are, and 1 if it is so at first.
    closed, opened, number = starts, open_first, np.int64(0)
    place, jump, begins = first, np.int64(0), 1.0 if starts and open_first else 0.0
    while True:
        while jump < jumps.shape[1] and int(jumps[2, jump]) != gate:
            jump += 1
        if place == last and jump == jumps.shape[1]:
            return number, begins
        before = closed and opened
        if jump == jumps.shape[1] or (place < last and found[0, place] <= jumps[0, jump]):
            phi, closed = found[0, place], found[2, place] > 0.0
            place += 1
        else:
            phi, opened = jumps[0, jump], jumps[1, jump] > 0.0
            jump += 1
        if before != (closed and opened):
            merged[0, number], merged[2, number] = phi, 0.0 if before else 1.0
            number += 1


@part
def _sort(rows, number):
    """Sort the first columns by the first row, by insertion: they are few, and nearly in order."""
    for last in range(1, number):
        place = last
        while place > 0 and rows[0, place] < rows[0, place - 1]:
            for row in range(len(rows)):
                rows[row, place], rows[row, place - 1] = rows[row, place - 1], rows[row, place]
            place -= 1


@kernel(
    "Tuple((c16[:, :, ::1], c16[:, :, ::1], f8[:, ::1]))"
    "(c16[:, ::1], i8[::1], f8[::1], f8[::1], f8[:, :, ::1], f8[:, :, ::1], f8[::1], f8[:, ::1], f8[:, ::1],"
    " i8[::1], i8[::1], f8[::1], f8[:, ::1], f8[:, :, :, ::1], f8[:, :, :, ::1])"
)
def contact_forces(
    lines,
    contact,
    sign,
    clearance,
    table,
    slope_table,
    phi,
    values,
    slopes,
    orders,
    gate,
    first_open,
    jumps,
    wave_table,
    wave_slope_table,
):
    """Compute the forces along deflections with given lines; see `Forces`, and `Laws` for the variation over the angle.

    Returns lines of g, the spectrum of g', and the same of P, shape (contacts, 4, 2K + 1); lines of the derivatives of
    g and P by the parameter, shape (contacts, 2, K + 1); and, by angle, the crossings of breakpoints in rows of angles,
    derivatives of the deflection by phi, whether it closes, and the switch.
    """
    contacts, count, degree = len(lines), lines.shape[1] - 1, table.shape[2] - 1
    forces = np.zeros((contacts, 4, 2 * count + 1), np.complex128)
    moved = np.zeros((contacts, 2, count + 1), np.complex128)
    found, number = np.empty((4, 2 * len(contact) * len(phi))), np.int64(0)
    function = np.empty(count + 1, np.complex128)
    merged = np.empty((4, 2 * len(phi) + jumps.shape[1] if len(first_open) else 0))
    kept = 2 * count
    for place in range(len(orders)):
        kept = max(kept, 2 * count + orders[place])
    for j in range(len(contact)):
        c, before = contact[j], number
        for k in range(count + 1):
            function[k] = sign[j] * lines[c, k]
        function[0] -= clearance[j]
        depths = _sampled(function, values)
        number = _crossings(j, function, depths, _sampled(function, slopes), phi, found, number)
        if depths[0] > 0.0 or number > before:
            longest = degree * count + kept
            if gate[j] < 0:
                indicator = _indicator(found, before, number, depths[0] > 0.0, longest)
            else:
                opened = first_open[gate[j]] > 0.0
                changes, begins = _gated(found, before, number, depths[0] > 0.0, gate[j], opened, jumps, merged)
                indicator = _indicator(merged, np.int64(0), changes, begins > 0.0, longest)
            powers = _powers(indicator, function, degree, kept)
            _add(table[j], powers, forces[c])
            _add(slope_table[j], powers, moved[c])
            _add_waves(orders, wave_table[j], powers, forces[c])
            _add_waves(orders, wave_slope_table[j], powers, moved[c])
        if gate[j] >= 0:
            number = before  # they are those of the switch itself
    for index in range(number):  # from the penetration to the deflection
        found[1, index] *= sign[int(found[3, index])]
    for c in range(contacts):  # from spectra to lines
        for k in range(1, 2 * count + 1):
            forces[c, 0, k] *= 2.0
            forces[c, 2, k] *= 2.0
        for k in range(1, count + 1):
            moved[c, 0, k] *= 2.0
            moved[c, 1, k] *= 2.0
    _sort(found, number)
    return forces, moved, _first(found, number)


# Compiled kernels of the equation of harmonic balance: residual, Jacobian, and the forces on neglected lines.


@part
def _tangent(forces, shift, w, k, j):
    """Return the lines k of the change of a force with the cosine and with the sine j of its deflection."""
    # With the spectrum u of the tangent, ``u cos j`` has the line ``u_(k-j) + u_(k+j)`` and ``u sin j`` the line ``i
    # (u_(k+j) - u_(k-j))``; half of that for k = 0.
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
    lines, forces, moved, shift, frequencies, slopes, free, flexibility, pair_forces, pair_arguments, pair_spectra
):
    """Compute residual and Jacobian in real forms; forces and derivatives by the parameter, shape (K + 1, contacts)."""
    # `free` and `flexibility` have the lines first, as have the forces that are returned.
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

"""The monodromy matrix of a balanced motion by one pass over its period: steps of Magnus' series between contacts."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gapwalk.orbit.harmonic_balance.compiled import kernel, part
from gapwalk.orbit.harmonic_balance.linearised import Linearised

_REACH = 0.7  # largest angle by which the fastest part of the system turns in one step
_FINE = 2  # steps to the shortest wave of the motion, at least
_NODES = 0.5 + np.sqrt(0.15) * np.array([-1.0, 0.0, 1.0])  # Gauss and Legendre's, on 0 ... 1
_FEWEST = 8
_LANES = 16  # steps that are taken side by side: they fill the registers, and their matrices the cache
_INVERSE = 1.0 / np.cumprod([1.0, *range(1, 12)])  # of the factorials


def monodromy(
    linearised: Linearised, lines: NDArray[np.complex128], breaks: NDArray[np.float64], length: float
) -> NDArray[np.float64]:
    """How changes of positions and momenta are mapped over one period, shape (2n, 2n).

    Parameters
    ----------
    linearised
        The linearised equations.
    lines : shape (contacts, K + 1)
        Deflections of the motion.
    breaks
        Angles phi at which a breakpoint is passed, in their order: no step reaches across one.
    length
        The period, in units of time.

    Notes
    -----
    Between two contact events the coefficients are smooth. Magnus' series of sixth order (Blanes, Casas, Oteo and Ros
    2009, Physics Reports 470, section 5.4) takes each step's values at three Gauss nodes; a constant generator is
    exact at once.
    """
    steps = max(_FEWEST, _FINE * (lines.shape[1] - 1), int(np.ceil(length * linearised.rate / _REACH)))
    laws = linearised.laws
    return _transition(lines, steps, breaks, length, linearised.steady, linearised.parts, *laws.switches, laws.rates)


@part
def _multiply(a, b, result):
    """Products of square matrices; here and below, the steps stand side by side in the last dimension."""
    size = len(a)
    for i in range(size):
        for j in range(size):
            for s in range(_LANES):
                result[i, j, s] = a[i, 0, s] * b[0, j, s]
            for k in range(1, size):
                for s in range(_LANES):
                    result[i, j, s] += a[i, k, s] * b[k, j, s]


@part
def _combine(a, x, b, y, c, z, result):
    """The sum of three matrices with factors."""
    for i in range(len(x)):
        for j in range(len(x)):
            for s in range(_LANES):
                result[i, j, s] = a * x[i, j, s] + b * y[i, j, s] + c * z[i, j, s]


@part
def _commute(a, b, spare, result):
    """Commutators."""
    _multiply(a, b, result)
    _multiply(b, a, spare)
    _combine(1.0, result, -1.0, spare, 0.0, spare, result)


@part
def _knots(steps, breaks):
    """Where steps end: evenly over the period, and at breakpoints."""
    knots = np.empty(steps + 1 + len(breaks))
    for index in range(steps + 1):
        knots[index] = 2.0 * np.pi / steps * index
    for number in range(len(breaks)):
        place = steps + 1 + number
        while knots[place - 1] > breaks[number]:
            knots[place] = knots[place - 1]
            place -= 1
        knots[place] = breaks[number]
    return knots


@part
def _deflections(lines, phi, result):
    """Values at some angles of a function with some lines."""
    cosines, sines, p, q = np.empty(_LANES), np.empty(_LANES), np.empty(_LANES), np.empty(_LANES)
    for s in range(_LANES):
        cosines[s], sines[s], p[s], q[s], result[s] = np.cos(phi[s]), np.sin(phi[s]), 1.0, 0.0, lines[0].real
    for k in range(1, len(lines)):
        re, im = lines[k].real, lines[k].imag
        for s in range(_LANES):
            p[s], q[s] = p[s] * cosines[s] - q[s] * sines[s], p[s] * sines[s] + q[s] * cosines[s]
            result[s] += re * p[s] - im * q[s]


@part
def _generate(lines, phi, steady, parts, contact, sign, clearance, rates, result):
    """The generators at some angles."""
    x = np.empty(_LANES)
    for a in range(len(steady)):
        for b in range(len(steady)):
            for s in range(_LANES):
                result[a, b, s] = steady[a, b]
    for c in range(len(lines)):
        _deflections(lines[c], phi, x)
        slopes = np.zeros((2, _LANES))
        for j in range(len(contact)):
            if contact[j] == c:
                for s in range(_LANES):
                    depth = sign[j] * x[s] - clearance[j]
                    if depth > 0.0:
                        slopes[0, s] += _polynomial(rates[j, 0], depth)
                        slopes[1, s] += _polynomial(rates[j, 1], depth)
        for kind in range(2):
            for a in range(len(steady)):
                for b in range(len(steady)):
                    part = parts[kind * len(lines) + c, a, b]
                    if part != 0.0:
                        for s in range(_LANES):
                            result[a, b, s] += part * slopes[kind, s]


@part
def _polynomial(coefficients, x):
    value = 0.0
    for power in range(len(coefficients) - 1, -1, -1):
        value = value * x + coefficients[power]
    return value


@part
def _logarithms(h, nodes, work, result):
    """Logarithms of the steps' transitions, from the generators at their three nodes."""
    size = len(result)
    second, third, inner, outer, spare, other = work[0], work[1], work[2], work[3], work[4], work[5]
    for a in range(size):
        for b in range(size):
            for s in range(_LANES):
                start, middle, end = nodes[0, a, b, s], nodes[1, a, b, s], nodes[2, a, b, s]
                result[a, b, s] = h[s] * middle
                second[a, b, s] = h[s] * (np.sqrt(15.0) / 3.0) * (end - start)
                third[a, b, s] = h[s] * (10.0 / 3.0) * (end - 2.0 * middle + start)
    _commute(result, second, spare, inner)
    _combine(2.0, third, 1.0, inner, 0.0, inner, other)
    _commute(result, other, spare, outer)
    _combine(1.0, second, -1.0 / 60.0, outer, 0.0, outer, outer)
    _combine(1.0, inner, -1.0, third, -20.0, result, other)
    _commute(other, outer, spare, inner)
    _combine(1.0, result, 1.0 / 12.0, third, 1.0 / 240.0, inner, result)


@part
def _exponentials(x, work, result):
    """Exponentials of small matrices, by Taylor's polynomial of degree 11 in five products."""
    square, cube, product = work[0], work[1], work[2]
    _multiply(x, x, square)
    _multiply(square, x, cube)
    for first in (9, 6, 3, 0):
        if first < 9:
            _multiply(result, cube, product)
        _combine(1.0 if first < 9 else 0.0, product, _INVERSE[first + 1], x, _INVERSE[first + 2], square, result)
        for a in range(len(x)):
            for s in range(_LANES):
                result[a, a, s] += _INVERSE[first]


@kernel("f8[:, ::1](c16[:, ::1], i8, f8[::1], f8, f8[:, ::1], f8[:, :, ::1], i8[::1], f8[::1], f8[::1], f8[:, :, ::1])")
def _transition(lines, steps, breaks, length, steady, parts, contact, sign, clearance, rates):
    """The product of the transitions of all steps, some of them at a time."""
    size, knots = len(steady), _knots(steps, breaks)
    matrix, moved = np.zeros((size, size)), np.zeros((size, size))
    for a in range(size):
        matrix[a, a] = 1.0
    nodes, work = np.zeros((3, size, size, _LANES)), np.zeros((6, size, size, _LANES))
    logarithms, exponentials = np.zeros((size, size, _LANES)), np.zeros((size, size, _LANES))
    starts, widths, phi, times = np.zeros(_LANES), np.zeros(_LANES), np.zeros(_LANES), np.zeros(_LANES)
    for first in range(0, len(knots) - 1, _LANES):
        for s in range(_LANES):  # steps beyond the last one have no width
            step = min(first + s, len(knots) - 1)
            starts[s], widths[s] = knots[step], knots[min(step + 1, len(knots) - 1)] - knots[step]
        for node in range(3):
            for s in range(_LANES):
                phi[s] = starts[s] + widths[s] * _NODES[node]
                times[s] = widths[s] * length / (2.0 * np.pi)
            _generate(lines, phi, steady, parts, contact, sign, clearance, rates, nodes[node])
        _logarithms(times, nodes, work, logarithms)
        _exponentials(logarithms, work, exponentials)
        for s in range(min(_LANES, len(knots) - 1 - first)):
            for a in range(size):
                for b in range(size):
                    moved[a, b] = 0.0
                    for k in range(size):
                        moved[a, b] += exponentials[a, k, s] * matrix[k, b]
            matrix, moved = moved, matrix
    return matrix

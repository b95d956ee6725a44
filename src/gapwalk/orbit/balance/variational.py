"""The monodromy matrix of a balanced motion by one pass over its period: steps of Magnus' series between contacts."""

from __future__ import annotations

import numba
import numpy as np
from numpy.typing import NDArray

from gapwalk.orbit.balance.kernels import OPTIONS, kernel
from gapwalk.orbit.balance.linearised import Linearised

_REACH = 0.7  # largest angle by which the fastest part of the system turns in one step
_FINE = 3  # steps to the shortest wave of the motion, at least
_NODES = 0.5 + np.sqrt(0.15) * np.array([-1.0, 0.0, 1.0])  # Gauss and Legendre's, on 0 ... 1
_FEWEST = 8
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


@numba.njit(**OPTIONS)
def _multiply(a, b, result):
    """The product of two square matrices."""
    size = len(a)
    for i in range(size):
        for j in range(size):
            result[i, j] = 0.0
        for k in range(size):
            factor = a[i, k]
            for j in range(size):
                result[i, j] += factor * b[k, j]


@numba.njit(**OPTIONS)
def _commute(a, b, work, result):
    """The commutator of two square matrices."""
    _multiply(a, b, result)
    _multiply(b, a, work)
    for i in range(len(a)):
        for j in range(len(a)):
            result[i, j] -= work[i, j]


@numba.njit(**OPTIONS)
def _generator(lines, phi, steady, parts, contact, sign, clearance, rates, result):
    """The generator at an angle; whether any contact is closed there."""
    contacts, count = len(lines), lines.shape[1] - 1
    result[:] = steady
    closed = False
    for c in range(contacts):
        x, wave, turn = lines[c, 0].real, 1.0 + 0.0j, complex(np.cos(phi), np.sin(phi))
        for k in range(1, count + 1):
            wave *= turn
            x += (lines[c, k] * wave).real
        for j in range(len(contact)):
            depth = sign[j] * x - clearance[j]
            if contact[j] != c or not depth > 0.0:
                continue
            closed = True
            for kind in range(2):
                slope = 0.0
                for power in range(rates.shape[2] - 1, -1, -1):
                    slope = slope * depth + rates[j, kind, power]
                if slope == 0.0:
                    continue
                for a in range(len(steady)):
                    for b in range(len(steady)):
                        result[a, b] += slope * parts[kind * contacts + c, a, b]
    return closed


@kernel("f8[:, ::1](c16[:, ::1], i8, f8[::1], f8, f8[:, ::1], f8[:, :, ::1], i8[::1], f8[::1], f8[::1], f8[:, :, ::1])")
def _transition(lines, steps, breaks, length, steady, parts, contact, sign, clearance, rates):
    """The product of the transitions of all steps."""
    size = len(steady)
    work = np.zeros((9, size, size))
    x, square, cube, power, spare = work[0], work[1], work[2], work[3], work[4]
    second, third, inner, outer = work[5], work[6], work[7], work[8]
    nodes = np.zeros((3, size, size))
    matrix, moved = np.eye(size), np.empty((size, size))
    before, known, passed = 0.0, -1.0, 0
    for step in range(steps + len(breaks)):
        # the next of the even angles or the breakpoints
        after = 2.0 * np.pi * (step - passed + 1) / steps
        if passed < len(breaks) and breaks[passed] <= after:
            after = breaks[passed]
            passed += 1
        width, h = after - before, (after - before) * length / (2.0 * np.pi)
        start, before = before, after
        if not width > 0.0:
            continue
        closed = False
        for node in range(3):
            phi = start + width * _NODES[node]
            closed |= _generator(lines, phi, steady, parts, contact, sign, clearance, rates, nodes[node])
        if closed or abs(h - known) > 1e-15 * h:
            # x: the logarithm of the transition
            for a in range(size):
                for b in range(size):
                    x[a, b] = h * nodes[1, a, b]
                    second[a, b] = h * (np.sqrt(15.0) / 3.0) * (nodes[2, a, b] - nodes[0, a, b])
                    third[a, b] = (10.0 / 3.0) * (h * (nodes[2, a, b] + nodes[0, a, b]) - 2.0 * x[a, b])
            if closed:
                _commute(x, second, spare, inner)
                for a in range(size):
                    for b in range(size):
                        power[a, b] = 2.0 * third[a, b] + inner[a, b]
                _commute(x, power, spare, outer)
                for a in range(size):
                    for b in range(size):
                        outer[a, b] = second[a, b] - outer[a, b] / 60.0
                        power[a, b] = inner[a, b] - third[a, b] - 20.0 * x[a, b]
                _commute(power, outer, spare, inner)
                for a in range(size):
                    for b in range(size):
                        x[a, b] += third[a, b] / 12.0 + inner[a, b] / 240.0
            # its exponential by Taylor's polynomial of degree 11
            _multiply(x, x, square)
            _multiply(square, x, cube)
            for first in (9, 6, 3, 0):
                if first < 9:
                    _multiply(power, cube, spare)
                for a in range(size):
                    for b in range(size):
                        value = x[a, b] * _INVERSE[first + 1] + square[a, b] * _INVERSE[first + 2]
                        power[a, b] = value + spare[a, b] if first < 9 else value
                    power[a, a] += _INVERSE[first]
            known = -1.0 if closed else h
        _multiply(power, matrix, moved)
        matrix, moved = moved, matrix
    return matrix

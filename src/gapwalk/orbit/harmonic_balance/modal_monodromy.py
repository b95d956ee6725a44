"""The monodromy matrix of a balanced motion of many degrees of freedom, in the eigenvectors of the linear part.

Between two contacts each eigenvector changes independently and exactly. While contacts are closed, their forces are
determined by a few numbers for each contact and step, so a step changes the matrix by one of low rank. The cost grows
with the square of the number of eigenvectors, not with its cube.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gapwalk.orbit.harmonic_balance.compliance import Poles
from gapwalk.orbit.harmonic_balance.contact_forces import Laws
from gapwalk.orbit.harmonic_balance.series import waves

_REACH = 0.4  # largest angle by which the fastest eigenvector, or a closed contact, turns in one step
_FINE = 4  # smallest number of steps per shortest wave of the motion
_NODES = 0.5 + np.sqrt(1.0 / 12.0) * np.array([-1.0, 1.0])  # Gauss and Legendre's two, on 0 ... 1
_POINTS, _WEIGHTS = (0.5 * each for each in np.polynomial.legendre.leggauss(4))
_POINTS = _POINTS + 0.5


def modal_monodromy(
    poles: Poles,
    shift: NDArray[np.float64],
    laws: Laws,
    lines: NDArray[np.complex128],
    breaks: NDArray[np.float64],
    length: float,
    period: int,
) -> NDArray[np.float64]:
    """Compute the monodromy matrix of the amplitudes of the eigenvectors, shape (poles, poles).

    Shapes: `shift` (contacts,).

    Notes
    -----
    With ``z' = lambda z - (inputs g' + lambda inputs P') x`` and ``x = deflections z`` (P as in
    `gapwalk.orbit.harmonic_balance.monodromy`), the forces over a step are interpolated between two Gauss nodes, at
    which they are solved for: an exponential method of collocation, of fourth order, exact for the linear part.

    Of a pair of conjugate eigenvalues one is used, with real and imaginary part of its amplitude.
    """
    times, spring, damper = _steps(poles, shift, laws, lines, breaks, length, period)
    half = poles.values.imag >= 0.0
    values, inputs = poles.values[half], poles.inputs[half]
    paired = values.imag > 0.0
    deflections = poles.deflections[:, half] * (1.0 + paired)
    ends = np.exp(times[:, None] * values)
    outer = _weights(values, times, 1.0)
    solution = np.linalg.inv(_coupling(poles.residual, values, inputs, deflections, times, spring, damper))
    identity = np.eye(len(values), dtype=np.complex128)
    matrix = np.concatenate((identity, 1j * identity[:, paired]), axis=1)
    touched = (spring != 0.0).any(axis=1) | (damper != 0.0).any(axis=1)
    for p, active in enumerate(touched):
        if not active.any():
            matrix *= ends[p][:, None]
            continue
        both = np.concatenate((active, active))
        rows = np.concatenate([deflections[active] * np.exp(times[p] * node * values) for node in _NODES])
        at_nodes = solution[p][both][:, both] @ (rows @ matrix).real
        tangents = spring[p][:, active, None] + damper[p][:, active, None] * values
        pushes = (tangents * inputs[:, active].T * outer[p][:, None]).reshape(-1, len(values)).T
        matrix *= ends[p][:, None]
        matrix.real -= pushes.real @ at_nodes
        matrix.imag -= pushes.imag @ at_nodes
    return np.vstack((matrix.real, matrix.imag[paired]))


def _steps(poles: Poles, shift, laws: Laws, lines, breaks, length: float, period: int):
    """Return the steps' lengths in time, and the tangents of the contacts' springs and dampers at their nodes.

    There is one step for each interval in which no contact is closed and no share is moved.
    """
    slopes = np.bincount(laws.contact, laws.stiffness, len(lines))
    contact = np.sqrt(np.abs(np.diagonal((poles.deflections * poles.values) @ poles.inputs)) * slopes).max(initial=0.0)
    fastest = max(float(np.abs(poles.values).max()), float(contact))
    count = max(8, _FINE * (lines.shape[1] - 1), int(np.ceil(length * fastest / _REACH)))
    knots = np.sort(np.concatenate((2.0 * np.pi / count * np.arange(count + 1), breaks)))
    knots = knots[np.append(True, np.diff(knots) > 0.0)]
    widths = np.diff(knots)
    phi = knots[:-1, None] + widths[:, None] * _NODES
    deflections = (waves(phi, lines.shape[1] - 1) @ lines.T).real
    spring, damper = laws.tangents(deflections, phi, period)
    spring = spring - shift
    free = ~((spring != 0.0).any(axis=(1, 2)) | (damper != 0.0).any(axis=(1, 2)))
    # consecutive steps without contact forces are joined into one
    first = np.flatnonzero(~(free & np.append(False, free[:-1])))
    times = np.add.reduceat(widths, first) * (length / (2.0 * np.pi))
    return times, spring[first], damper[first]


def _weights(values: NDArray[np.complex128], times: NDArray[np.float64], end: float) -> NDArray[np.complex128]:
    """Compute the effect of forces linear between two nodes up to a share `end` of a step, shape (steps, 2, poles).

    It is the integral of ``exp(lambda (end h - s)) l_j(s)`` over s from 0 to ``end h``.
    """
    s = end * _POINTS
    gains = np.exp(times[:, None, None] * (end - s)[:, None] * values)
    other = _NODES[::-1]
    shapes = (end * _WEIGHTS)[:, None] * (s[:, None] - other) / (_NODES - other)
    weights = np.tensordot(gains, shapes.astype(complex), axes=(1, 0)).transpose(0, 2, 1) * times[:, None, None]
    return np.asarray(weights, dtype=np.complex128)


def _coupling(residual, values, inputs, deflections, times, spring, damper) -> NDArray[np.float64]:
    """Compute how deflections at the nodes of a step affect each other, shape (steps, 2 contacts, 2 contacts)."""
    contacts = len(deflections)
    residues = (deflections.T[:, :, None] * inputs[:, None, :]).reshape(len(values), -1)
    coupling = np.tile(np.eye(2 * contacts), (len(times), 1, 1))
    for i, node in enumerate(_NODES):
        inner = _weights(values, times, node)
        for j in range(2):
            flexible = (inner[:, j] @ residues).real.reshape(-1, contacts, contacts)
            moving = ((inner[:, j] * values) @ residues).real.reshape(-1, contacts, contacts)
            part = coupling[:, i * contacts : (i + 1) * contacts, j * contacts : (j + 1) * contacts]
            part += (flexible + (i == j) * residual) * spring[:, None, j]
            part += moving * damper[:, None, j]
    return coupling

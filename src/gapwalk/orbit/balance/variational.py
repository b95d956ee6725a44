"""The monodromy matrix of a balanced motion by one pass over its period: steps of Magnus' series between contacts."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gapwalk.orbit.balance.linearised import Linearised
from gapwalk.orbit.balance.lines import waves

_REACH = 0.7  # largest angle by which the fastest part of the system turns in one step
_FINE = 3  # steps to the shortest wave of the motion, at least
_NODES = 0.5 + np.sqrt(0.15) * np.array([-1.0, 0.0, 1.0])  # Gauss and Legendre's, on 0 ... 1
_FEWEST = 8


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
        Angles phi at which a breakpoint is passed: no step reaches across one.
    length
        The period, in units of time.

    Notes
    -----
    Between two contact events the coefficients are smooth. Magnus' series of sixth order (Blanes, Casas, Oteo and Ros
    2009, Physics Reports 470, section 5.4) takes each step's values at three Gauss nodes; a constant generator is
    exact at once. All steps are taken together, and their product is formed pairwise.
    """
    steps = max(_FEWEST, _FINE * (lines.shape[1] - 1), int(np.ceil(length * linearised.rate / _REACH)))
    even = 2.0 * np.pi / steps * np.arange(steps + 1)
    knots = np.sort(np.concatenate((even, breaks)))
    widths = np.diff(knots)
    phi = knots[:-1, None] + widths[:, None] * _NODES
    deflections = (waves(phi, lines.shape[1] - 1) @ lines.T).real
    tangents = np.concatenate(linearised.laws.tangents(deflections), axis=-1)
    steady, parts = linearised.steady, linearised.parts
    generators = steady + (tangents @ parts.reshape(len(parts), -1)).reshape(*phi.shape, *steady.shape)
    times: NDArray[np.float64] = widths.astype(float) * (length / (2.0 * np.pi))
    return _product(_exponentials(_magnus(generators, times[:, None, None])))


def _magnus(a: NDArray[np.float64], h: NDArray[np.float64]) -> NDArray[np.float64]:
    """Logarithms of the steps' transitions, from the generators at their three nodes, shape (steps, 3, N, N)."""
    first = h * a[:, 1]
    second = h * (np.sqrt(15.0) / 3.0 * (a[:, 2] - a[:, 0]))
    third = (10.0 / 3.0) * (h * (a[:, 2] + a[:, 0]) - 2.0 * first)
    inner = _commutator(first, second)
    outer = second - _commutator(first, 2.0 * third + inner) / 60.0
    return first + third / 12.0 + _commutator(inner - third - 20.0 * first, outer) / 240.0


def _commutator(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    return a @ b - b @ a


def _exponentials(x: NDArray[np.float64]) -> NDArray[np.float64]:
    """Exponentials of small matrices, by Taylor's polynomial of degree 11 in five products."""
    square = x @ x
    cube = square @ x
    identity = np.eye(x.shape[-1])
    result = _quadratic(x, square, identity, 9)
    for first in (6, 3, 0):
        result = result @ cube + _quadratic(x, square, identity, first)
    return result


def _quadratic(
    x: NDArray[np.float64], square: NDArray[np.float64], identity: NDArray[np.float64], first: int
) -> NDArray[np.float64]:
    return x * _INVERSE[first + 1] + square * _INVERSE[first + 2] + identity * _INVERSE[first]


_INVERSE = 1.0 / np.cumprod([1.0, *range(1, 12)])  # of the factorials


def _product(matrices: NDArray[np.float64]) -> NDArray[np.float64]:
    """The product of matrices that are applied in their order."""
    while len(matrices) > 1:
        last = matrices[-1:] if len(matrices) % 2 else matrices[:0]
        pairs = matrices[1::2] @ matrices[: len(matrices) - len(last) : 2]
        matrices = np.concatenate((pairs, last)) if len(last) else pairs
    return matrices[0]

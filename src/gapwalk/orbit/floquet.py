"""Floquet multipliers of an orbit, and the stability that follows from them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.errors import NumericalError
from gapwalk.late_scipy import lapack, linalg

REAL = 1e-9
"""Largest relative imaginary part of a multiplier that counts as real."""

_BORDER = 1e-6  # distance from the unit circle within which a multiplier may count on either side
_FEW = 8  # number of multipliers up to which plain numbers are faster than arrays
_ROUNDED = 1e-12  # rounding of a multiplier that is apart from the others, over the largest
_SMALL = 0.02  # size of multipliers whose changes are irrelevant: their motions decay within a period


class Instability(NamedTuple):
    """Numbers of multipliers outside the unit circle, by where they left it, and of those on it."""

    above: int  #: Number of real ones above +1.
    below: int  #: Number of real ones below -1.
    pairs: int  #: Number of complex conjugate pairs.
    neutral: int = 0  #: Number of multipliers that lie on the unit circle within their error, as of undamped motions.

    @property
    def total(self) -> int:
        """Dimension of the unstable manifold."""
        return self.above + self.below + 2 * self.pairs

    @property
    def label(self) -> str:
        """``stable``, ``neutral``, or the kind of instability: ``below`` (-1), ``above`` (+1), ``pair`` (Hopf)."""
        if self.below:
            return "below"
        if self.above:
            return "above"
        if self.pairs:
            return "pair"
        return "neutral" if self.neutral else "stable"

    @property
    def words(self) -> str:
        """The label, after ``unstable`` if it is a kind of instability."""
        return f"unstable ({self.label})" if self.total else self.label


def multipliers(transitions: Sequence[NDArray[np.float64]]) -> NDArray[np.complex128]:
    """Return the eigenvalues of the product of the segments' transition matrices, largest modulus first."""
    # Large multipliers would spoil the accuracy of the others if the product were formed. So it is kept as ``U D V``
    # with a graded diagonal D between well-conditioned matrices, by a pivoted QR decomposition for each factor, and the
    # eigenvalues are those of the graded matrix ``D (V U)`` (Bai, Lee, Li and Xu 2011, Linear Algebra and its
    # Applications 435, on long chains of products).
    matrix = transitions[0]
    if len(transitions) > 1:
        left, sizes, right = np.eye(len(matrix)), np.ones(len(matrix)), np.eye(len(matrix))
        for transition in transitions:
            left, upper, order = linalg.qr(transition @ left * sizes, pivoting=True)
            sizes = np.abs(upper.diagonal())
            right = (upper / np.where(sizes > 0.0, sizes, 1.0)[:, None]) @ right[order]
        matrix = sizes[:, None] * (right @ left)
    real, imaginary, _, _, info = lapack.dgeev(matrix, compute_vl=0, compute_vr=0)
    if info:
        raise NumericalError("the eigenvalues of the monodromy matrix did not converge")
    values = map(complex, real.tolist(), imaginary.tolist())
    return np.array(sorted(values, key=abs, reverse=True))


def classify(values: NDArray[np.complex128], error: float = 0.0) -> Instability:
    """Count the multipliers outside the unit circle, and those on it within rounding or a known error."""
    plain = values.tolist()
    neutral = [mu for mu in plain if abs(abs(mu) - 1.0) < max(_BORDER, error)]
    if neutral:
        largest = abs(plain[0])
        neutral = [mu for mu in neutral if abs(abs(mu) - 1.0) <= max(_rounding(mu, plain, largest), error)]
    outside = [mu for mu in plain if abs(mu) > 1.0 and mu not in neutral]
    real = [mu.real for mu in outside if abs(mu.imag) <= REAL * abs(mu)]
    above = sum(mu > 0 for mu in real)
    return Instability(above, len(real) - above, (len(outside) - len(real)) // 2, len(neutral))


def _rounding(value: complex, values: Sequence[complex], largest: float) -> float:
    """Return the rounding error of a multiplier's modulus: the nearer the next one, the larger, as of a double root."""
    # Of a conjugate pair it is that of their product, which does not depend on their distance.
    rounded = _ROUNDED * max(1.0, largest)
    others = [abs(other - value) for other in values if other != value and other != value.conjugate()]
    return rounded / min(1.0, max(min(others, default=1.0), math.sqrt(rounded)))


def is_on_border(values: NDArray[np.complex128]) -> bool:
    """Return True if a multiplier is so near the unit circle that it may count as stable or unstable."""
    return nearest_to_circle(values) < _BORDER


def nearest_to_circle(values: NDArray[np.complex128]) -> float:
    """Return the distance of the nearest multiplier from the unit circle; infinite without multipliers."""
    return min([abs(abs(value) - 1.0) for value in values.tolist()], default=math.inf)


def largest_move(a: NDArray[np.complex128], b: NDArray[np.complex128]) -> float:
    """Return the largest move of a multiplier from one set to the other, with nearest multipliers paired."""
    # Multipliers outside the unit circle count relative to their size; very small ones do not count.
    first, second = (sorted(each.tolist(), key=abs, reverse=True) for each in (a, b))
    count = max(sum(abs(value) > _SMALL for value in each) for each in (first, second))
    if count > _FEW:
        return _largest_of_many(np.array(first[:count]), np.array(second[:count]))
    if not count:
        return 0.0
    first, second = first[:count], second[:count]
    ways = [[abs(one - other) / max(1.0, min(abs(one), abs(other))) for other in second] for one in first]
    nearest = [min(own) for own in ways]
    if len({own.index(least) for own, least in zip(ways, nearest, strict=True)}) == count:
        return max(nearest)  # each has another nearest one: these are the pairs
    moves = sorted((move, row, column) for row, own in enumerate(ways) for column, move in enumerate(own))
    rows, columns, largest = set(range(count)), set(range(count)), 0.0
    for move, row, column in moves:
        if row in rows and column in columns:
            largest = move
            rows.remove(row)
            columns.remove(column)
    return largest


def _largest_of_many(first: NDArray[np.complex128], second: NDArray[np.complex128]) -> float:
    """Return the largest move from one of two equally long sets to the other, for sets that arrays suit better."""
    sizes = np.maximum(1.0, np.minimum.outer(np.abs(first), np.abs(second)))
    moves, largest = np.abs(np.subtract.outer(first, second)) / sizes, 0.0
    while moves.size:  # those that are each other's nearest are pairs, all at once; then those of the others
        columns, rows = moves.argmin(axis=1), moves.argmin(axis=0)
        paired = rows[columns] == np.arange(len(moves))
        largest = max(largest, float(moves[paired, columns[paired]].max()))
        moves = np.delete(moves[~paired], columns[paired], axis=1)
    return largest


def change_words(before: Instability, after: Instability) -> str:
    """Return a change of stability in words."""
    texts = [f"unstable({side.total})" if side.total else side.label for side in (before, after)]
    return texts[0] if texts[0] == texts[1] else " -> ".join(texts)

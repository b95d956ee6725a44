"""Floquet multipliers of an orbit, and the stability that follows from them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.errors import NumericalError
from gapwalk.flow.flow import Modes
from gapwalk.late_scipy import lapack, linalg

REAL = 1e-9
"""Largest relative imaginary part of a multiplier that counts as real."""

_BORDER = 1e-6  # distance from the unit circle within which a multiplier may count on either side
_FEW = 8  # number of multipliers up to which plain numbers are faster than arrays
_ROUNDED = 1e-12  # rounding of a multiplier that is apart from the others, over the largest
_SMALL = 0.02  # size of multipliers whose changes are irrelevant: their motions decay within a period

_MANY, _RANK = 300, 24  # numbers of a state from which a matrix is tried as one of low rank, and the highest rank
_NEGLIGIBLE, _NOISE = 2e-12, 1e-11  # singular values, and errors of numbers of the matrix, that are rounding
_CUBED, _SUMMED = 1e-6, 1e-11  # step of cubic convergence; error of the sums, for each number
_ITERATIONS, _SPLIT, _STRAY = 30, 9, 0.1  # of Aberth's method; that at which pairs are split, and most of these
_ASIDE, _UNLIKE = 1e-6j, 1e-3  # distances at the start, from the values and of the partners, as a share


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


def multipliers(transitions: Sequence[NDArray[np.float64]], near: Modes | None = None) -> NDArray[np.complex128]:
    """Return the eigenvalues of the product of the segments' transition matrices, largest modulus first.

    If there is one segment, `near` are the modes of a linear system that the motion follows for most of the time.
    """
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
    if near is not None and len(matrix) >= _MANY and (few := _beside_modes(matrix, near)) is not None:
        return few[np.argsort(-np.abs(few), kind="stable")]
    real, imaginary, _, _, info = lapack.dgeev(matrix, compute_vl=0, compute_vr=0)
    if info:
        raise NumericalError("the eigenvalues of the monodromy matrix did not converge")
    values = map(complex, real.tolist(), imaginary.tolist())
    return np.array(sorted(values, key=abs, reverse=True))


@np.errstate(divide="ignore", invalid="ignore", over="ignore")  # what is not finite is refused
def _beside_modes(matrix: NDArray[np.float64], near: Modes) -> NDArray[np.complex128] | None:
    """Return the eigenvalues of a matrix that differs by a low rank k from the exponential of some modes.

    They are the zeros of ``det(1 + V^T (D - z)^-1 U)`` for the matrix ``D + U V^T``, whose 2 x 2 blocks D are those of
    the modes: a matrix of k x k. All are improved at once from the values of the modes (Aberth 1973, Mathematics of
    Computation 27). The result is None if they do not converge, or do not have the sums of the matrix.
    """
    values, count, trials = near.values, len(matrix) // 2, _trials(len(matrix))
    own, cross = values.real, values.imag

    def rest(columns: NDArray[np.float64]) -> NDArray[np.float64]:
        x, y = columns[::2], columns[1::2]
        found = near.inverse @ (matrix @ (near.basis @ columns))
        found[::2] -= own[:, None] * x + cross[:, None] * y
        found[1::2] -= own[:, None] * y - cross[:, None] * x
        return found

    left = np.linalg.qr(rest(trials[:, :_RANK]))[0]
    right = (left.T @ near.inverse) @ matrix @ near.basis
    x, y = left[::2].T, left[1::2].T
    right[:, ::2] -= own * x - cross * y
    right[:, 1::2] -= own * y + cross * x
    apart = rest(trials[:, _RANK:]) - left @ (right @ trials[:, _RANK:])  # of other columns: the rank may be higher
    if not np.abs(apart).max() <= _NOISE * max(1.0, float(np.abs(right).max())):
        return None
    turned, sizes, right = np.linalg.svd(right, full_matrices=False)
    rank = max(1, int(np.count_nonzero(sizes > _NEGLIGIBLE * max(1.0, sizes[0]))))
    if 2 * rank * rank > len(matrix):  # then the way without it takes less time
        return None
    left, right = left @ (turned[:, :rank] * sizes[:rank]), right[:rank].T
    (u, w), (x, y) = ((each[::2, :, None], each[1::2, :, None]) for each in (right, left))
    x, y = x.transpose(0, 2, 1), y.transpose(0, 2, 1)
    table = np.concatenate((u * x + w * y, cross[:, None, None] * (w * x - u * y))).reshape(2 * count, -1)
    found, mirrored, open_ones = values * (1.0 + _ASIDE), np.arange(count), np.arange(count)
    for turn in range(_ITERATIONS):
        if turn == _SPLIT:  # pairs that do not converge may be real: their partners become unknowns of their own
            if len(open_ones) > _STRAY * count:
                return None
            mirrored = np.setdiff1d(mirrored, open_ones)
            partners = found[open_ones].conj() * (1.0 + _UNLIKE)
            found, open_ones = (
                np.append(found, partners),
                np.append(open_ones, len(found) + np.arange(len(open_ones))),
            )
        z = found[open_ones]
        ahead = own - z[:, None]
        share = 1.0 / ((values - z[:, None]) * (values.conj() - z[:, None]))
        along = ahead * share
        both = np.empty((2, 2, len(z), 2, count))
        for place, each in enumerate((along, share, 2.0 * along * along - share, 2.0 * along * share)):
            both[0, place // 2, :, place % 2], both[1, place // 2, :, place % 2] = each.real, each.imag
        real, imaginary = (both.reshape(-1, 2 * count) @ table).reshape(2, 2, len(z), rank, rank)
        small, changes = real + 1j * imaginary
        try:
            logarithm = np.trace(np.linalg.solve(small + np.eye(rank), changes), axis1=1, axis2=2)
        except np.linalg.LinAlgError:
            return None
        apart = z[:, None] - np.concatenate((found, found[mirrored].conj()))
        apart[np.arange(len(z)), open_ones] = np.inf
        step = 1.0 / (logarithm - 2.0 * along.sum(axis=1) - (1.0 / apart).sum(axis=1))
        if not np.isfinite(step).all():
            return None
        found[open_ones] = z - step
        open_ones = open_ones[np.abs(step) > _CUBED]
        if not len(open_ones):
            break
    found = np.concatenate((found, found[mirrored].conj()))
    pairs = np.array([found.real.sum(), (found * found).real.sum()])
    sums = np.trace(matrix), np.sum(matrix * matrix.T)
    is_clear = np.abs(np.abs(found) - 1.0).min() > _BORDER  # else rounding decides, of which the other way has less
    if len(open_ones) or not is_clear or not np.abs(pairs - sums).max() <= _SUMMED * count:
        return None
    found.imag[np.abs(found.imag) < _NOISE] = 0.0
    return found


@lru_cache(maxsize=4)
def _trials(size: int) -> NDArray[np.float64]:
    """Return random columns, always the same: a matrix of low rank times these spans its range."""
    return np.random.default_rng(1).standard_normal((size, _RANK + 2))


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

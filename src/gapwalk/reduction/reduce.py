"""Reduction of a system with many degrees of freedom to those at its contacts and its lowest modes.

Method: docs/numerics/reduction.md
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gapwalk.errors import ModelError
from gapwalk.model.system import System
from gapwalk.reduction.basis import HARMONICS, Accuracy, Bases, Basis, kept_of, resonances_of
from gapwalk.reduction.reduction import Reduction, reduced_system
from gapwalk.reduction.sparse_matrices import Matrices, matrices_of

_ERROR = 1e-2
_REFERENCE = 2.0  # highest frequency, in highest harmonics, of the modes that approximate the resonances


def reduce(
    system: System,
    *,
    modes: int | None = None,
    error: float | None = None,
    up_to: float | None = None,
    keep: Sequence[str] = (),
) -> Reduction:
    """Reduce a system by Craig and Bampton's method, retaining its contact coordinates.

    The reduced system is an ordinary system: shooting, continuation, sweeps, basins and regime maps apply to it. The
    coordinates at which contacts act, and loads on one or two coordinates, are retained under their own names. All
    other coordinates are replaced by ``mode1``, ``mode2``, ...

    Parameters
    ----------
    system
        The system; its mass and stiffness matrices are symmetric, its damping is arbitrary.
    modes
        The number of modes; or None for as many as the `error` requires.
    error
        Largest relative error of the deflections of contacts under harmonic forces; 0.01 by default. See
        `Reduction.error`.
    up_to
        The highest excitation frequency W for which the reduced system is intended; by default that of the system.
    keep
        Further coordinates to retain, for example for measurements or loads.

    Raises
    ------
    ModelError
        If the matrices are not symmetric, or an option is invalid.
    NumericalError
        If the modes cannot be computed.

    Notes
    -----
    Craig and Bampton (1968), AIAA Journal 6, 1313-1319. The reduced system is exact in static equilibrium.
    """
    _check(system, modes, error, up_to)
    system = system.equations  # of a drive train: its machine elements do not exist in the reduced system
    highest = system.frequency if up_to is None else float(up_to)
    matrices = matrices_of(system)
    bases = Bases(matrices, kept_of(matrices, system.coordinates, keep))
    accuracy = _accuracy(matrices, bases, highest)
    basis, small = _best(bases, accuracy, _ERROR if error is None else error) if modes is None else _of(bases, modes)
    return Reduction(system, reduced_system(system, basis, small), basis, highest, accuracy.error(small))


def _check(system: System, modes: int | None, error: float | None, up_to: float | None) -> None:
    problems = []
    if not isinstance(system, System):
        raise ModelError(f"{system!r} is not a System; write reduce(gw.System(...), ...)")
    if modes is not None and error is not None:
        problems.append("modes and error are both given; give one of them: the error decides the number of modes")
    if modes is not None and (isinstance(modes, bool) or not isinstance(modes, int) or modes < 0):
        problems.append(f"modes is {modes!r}; it must be an integer >= 0, or None for as many as the error requires")
    if error is not None and not (isinstance(error, int | float) and 1e-8 <= error <= 1.0):
        problems.append(f"error is {error!r}; it must lie between 1e-8 and 1 (a fraction of the deflections)")
    if up_to is not None and not (isinstance(up_to, int | float) and 0.0 < up_to < np.inf):
        problems.append(
            f"up_to is {up_to!r}; it must be a frequency > 0: the highest of the excitation, as in up_to=2.0"
        )
    if problems:
        raise ModelError("\n".join(problems))


def _accuracy(matrices: Matrices, bases: Bases, highest: float) -> Accuracy:
    """Prepare the comparison at the resonances of a reference with many modes."""
    reference = bases.with_modes(bases.modes_up_to(_REFERENCE * HARMONICS * highest) + 2)
    return Accuracy(matrices, highest, resonances_of(reference.reduce(matrices)))


def _of(bases: Bases, modes: int, *, inertia: bool = False) -> tuple[Basis, Matrices]:
    basis = bases.with_modes(modes, inertia=inertia)
    return basis, basis.reduce(bases.matrices)


def _best(bases: Bases, accuracy: Accuracy, error: float) -> tuple[Basis, Matrices]:
    """Return the smallest basis whose error is small enough: modes alone, or modes and the response to inertia."""
    found = [_fewest(bases, accuracy, error, inertia=inertia) for inertia in (False, True)]
    return min(found, key=lambda each: each[0].size)


def _fewest(bases: Bases, accuracy: Accuracy, error: float, *, inertia: bool) -> tuple[Basis, Matrices]:
    """Find the fewest modes whose error is small enough, by bisection."""

    def is_enough(modes: int) -> bool:
        return accuracy.error(_of(bases, modes, inertia=inertia)[1]) <= error

    few, many = -1, max(1, bases.modes_up_to(accuracy.highest))
    while many < bases.interior.size and not is_enough(many):
        few, many = many, min(2 * many, bases.interior.size)
    while many - few > 1:
        middle = (few + many) // 2
        few, many = (few, middle) if is_enough(middle) else (middle, many)
    return _of(bases, many, inertia=inertia)

"""Reduce a system of many degrees of freedom to a few: those at its contacts, and its lowest modes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gapwalk.errors import ModelError
from gapwalk.model.system import System
from gapwalk.reduction.basis import Bases, Basis
from gapwalk.reduction.flexibility import HARMONICS, Accuracy, resonances_of
from gapwalk.reduction.kept import kept_of
from gapwalk.reduction.matrices import Matrices, matrices_of
from gapwalk.reduction.reduction import Reduction
from gapwalk.reduction.translation import reduced_system

_ERROR = 1e-2
_REFERENCE = 2.0  # frequency, in highest harmonics, of the modes that tell where the resonances are


def reduce(
    system: System,
    *,
    modes: int | None = None,
    error: float | None = None,
    up_to: float | None = None,
    keep: Sequence[str] = (),
) -> Reduction:
    """Reduce a system by Craig and Bampton's method, its contact coordinates kept.

    The reduced system is an ordinary one: it can be shot, walked, swept, and mapped in basins and regimes. Kept are the
    coordinates at which contacts act, and loads that act on one or two of them, under their own names; of all others
    ``mode1``, ``mode2``, ... are left.

    Parameters
    ----------
    system
        The system; its mass and stiffness matrices are symmetric, its damping is any.
    modes
        How many modes; or None for as many as the `error` takes.
    error
        Largest relative error of the deflections of contacts under harmonic forces; 0.01 by default. See
        `Reduction.error`.
    up_to
        The highest frequency W of the excitation that the reduced system is to serve; by default that of the system.
    keep
        Further coordinates to keep, which are to be measured or loaded.

    Raises
    ------
    ModelError
        If the matrices are not symmetric, or an option makes no sense.
    NumericalError
        If the modes cannot be computed.

    Notes
    -----
    Craig and Bampton (1968), AIAA Journal 6, 1313-1319. At rest the reduced system is exact.
    """
    _check(system, modes, error, up_to)
    system = system.equations  # of a drive train; its parts have no part in what is left
    highest = system.frequency if up_to is None else float(up_to)
    matrices = matrices_of(system)
    bases = Bases(matrices, kept_of(matrices, system.coordinates, keep))
    accuracy = _accuracy(matrices, bases, highest)
    basis, small = _best(bases, accuracy, _ERROR if error is None else error) if modes is None else _of(bases, modes)
    return Reduction(system, reduced_system(system, basis, small), basis, highest, accuracy.error(small))


def _check(system: System, modes: int | None, error: float | None, up_to: float | None) -> None:
    problems = []
    if not isinstance(system, System):
        raise ModelError(f"{system!r} is no System; write reduce(gw.System(...), ...)")
    if modes is not None and error is not None:
        problems.append("modes and error are both given; give one of them: the error decides the number of modes")
    if modes is not None and (isinstance(modes, bool) or not isinstance(modes, int) or modes < 0):
        problems.append(f"modes is {modes!r}; it must be an integer >= 0, or None for as many as the error takes")
    if error is not None and not (isinstance(error, int | float) and 1e-8 <= error <= 1.0):
        problems.append(f"error is {error!r}; it must lie between 1e-8 and 1 (a share of the deflections)")
    if up_to is not None and not (isinstance(up_to, int | float) and 0.0 < up_to < np.inf):
        problems.append(
            f"up_to is {up_to!r}; it must be a frequency > 0: the highest of the excitation, as in up_to=2.0"
        )
    if problems:
        raise ModelError("\n".join(problems))


def _accuracy(matrices: Matrices, bases: Bases, highest: float) -> Accuracy:
    """The comparison at the resonances of a reference with many modes."""
    reference = bases.with_modes(bases.modes_up_to(_REFERENCE * HARMONICS * highest) + 2)
    return Accuracy(matrices, highest, resonances_of(reference.reduce(matrices)))


def _of(bases: Bases, modes: int, *, inertia: bool = False) -> tuple[Basis, Matrices]:
    basis = bases.with_modes(modes, inertia=inertia)
    return basis, basis.reduce(bases.matrices)


def _best(bases: Bases, accuracy: Accuracy, error: float) -> tuple[Basis, Matrices]:
    """The smallest basis whose error is small enough: of modes alone, or with the response to inertia."""
    found = [_fewest(bases, accuracy, error, inertia=inertia) for inertia in (False, True)]
    return min(found, key=lambda each: each[0].size)


def _fewest(bases: Bases, accuracy: Accuracy, error: float, *, inertia: bool) -> tuple[Basis, Matrices]:
    """The fewest modes, found by bisection, whose error is small enough."""

    def is_enough(modes: int) -> bool:
        return accuracy.error(_of(bases, modes, inertia=inertia)[1]) <= error

    few, many = -1, max(1, bases.modes_up_to(accuracy.highest))
    while many < bases.interior.size and not is_enough(many):
        few, many = many, min(2 * many, bases.interior.size)
    while many - few > 1:
        middle = (few + many) // 2
        few, many = (few, middle) if is_enough(middle) else (middle, many)
    return _of(bases, many, inertia=inertia)

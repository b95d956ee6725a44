"""Reduction of a system with many degrees of freedom to those at its contacts and its lowest modes.

Method: docs/numerics/reduction.md
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gapwalk.errors import ModelError
from gapwalk.flow.motion import Motion
from gapwalk.model.structure import Structure
from gapwalk.model.system import System
from gapwalk.orbit.orbit import Orbit
from gapwalk.reduction.basis import HARMONICS, Accuracy, Bases, Basis, resonances_of
from gapwalk.reduction.sparse_matrices import Matrices, matrices_of

if TYPE_CHECKING:
    from gapwalk.bifurcation.branch import Branch
    from gapwalk.orbit.harmonic_balance import Balance
    from gapwalk.reduction.reduction_error import BranchCheck, OrbitCheck

_MODES = "mode"
_ROUNDING = 1e-13  # relative change of a parameter below which it is only rounding
MATRICES = ("mass", "damping", "stiffness")
_ERROR = 1e-2
_REFERENCE = 2.0  # highest frequency, in highest harmonics, of the modes that approximate the resonances


@dataclass(frozen=True)
class Reduction:
    """A system of many degrees of freedom reduced to few, as returned by `reduce`.

    The reduced system has every parameter of contacts and of the excitation, and those of the retained coordinates,
    under their own names. It has no parameters of other coordinates (``stiffness.q7.q8``, ``mean.q7``). A matrix entry
    of retained coordinates includes the static contribution of the others. So its value differs from that in the full
    system, but a change of it is the same change in both.

    Examples
    --------
    >>> small = gw.reduce(gw.train.chain(9, 1.0, 100.0, held=True).system(), modes=3, keep=["shaft1"])
    >>> small.modes, small.frequencies.shape
    (3, (3,))
    """

    #: full, system: The full system, and the reduced one.
    full: System
    system: System
    basis: Basis  #: The vectors that span the motions.
    up_to: float  #: Highest frequency of the excitation for which it was made.
    #: Largest relative error of the deflections of contacts under harmonic forces of the contacts and under the loads:
    #: up to that frequency, and, with the k-th multiple weighted by 1/k^2, up to ten times that. `check` estimates the
    #: resulting error of a motion and of special points.
    error: float

    @property
    def kept(self) -> tuple[str, ...]:
        """The retained coordinates, which belong to the reduced system too."""
        return self.system.coordinates[: len(self.basis.kept)]

    @property
    def modes(self) -> int:
        """The number of modes."""
        return len(self.basis.squares)

    @property
    def frequencies(self) -> NDArray[np.float64]:
        """Natural frequencies (angular) of the modes, with the retained coordinates fixed; shape (modes,)."""
        return np.sqrt(np.maximum(self.basis.squares, 0.0))

    def full_at(self, reduced: System) -> System:
        """Return the full system with the parameter values of the reduced one, such as `orbit.system`.

        Parameters
        ----------
        reduced
            The reduced system, at other values.
        """
        if reduced.structure != self.system.structure:
            raise ModelError("the system is not the reduced one at other values; take `reduction.system.at(...)`")
        ours, theirs = self._shared
        values = self.full.values.copy()
        values[theirs] = reduced.values[ours]
        change = reduced.values - self.system.values
        change[np.abs(change) <= _ROUNDING * np.abs(self.system.values)] = 0.0
        change[ours] = 0.0
        ours, theirs = self._retained
        values[theirs] += change[ours]
        change[ours] = 0.0
        if change.any():
            name = reduced.structure.names[int(np.flatnonzero(change)[0])]
            raise ModelError(
                f"{name} was changed, but belongs to a mode: the full system has no such parameter; change the full "
                "system and reduce it again"
            )
        return System.from_values(self.full.structure, values)

    def expand(self, motion: Orbit | Motion, samples: int | None = None) -> Motion:
        """Expand a motion of the reduced system to all coordinates.

        Parameters
        ----------
        motion
            An orbit (one period is used) or a sampled motion.
        samples
            Samples per forcing period, for an orbit.
        """
        sampled = motion.motion(samples) if isinstance(motion, Orbit) else motion
        full, back = self.full_at(sampled.system), self.basis.vectors.T
        moved = sampled.q @ back, sampled.v @ back, sampled.events, sampled.z
        return Motion(full, sampled.theta, *moved, sampled.slips, sampled.holds)

    def expand_state(self, state: ArrayLike) -> NDArray[np.float64]:
        """Expand a state of the reduced system, shape (..., state_size), to all coordinates.

        Returns
        -------
        array
            States of the full system, shape (..., state_size of the full system).
        """
        given, r = np.asarray(state, dtype=float), self.system.size
        if given.ndim == 0 or given.shape[-1] != self.system.state_size:
            raise ModelError(
                f"the state has shape {given.shape}; it must have {self.system.state_size} numbers: positions, "
                "then velocities, then extensions"
            )
        back = self.basis.vectors.T
        return np.concatenate((given[..., :r] @ back, given[..., r : 2 * r] @ back, given[..., 2 * r :]), axis=-1)

    def check(self, found: Orbit | Branch, method: Balance | None = None) -> OrbitCheck | BranchCheck:
        """Estimate the error of an orbit, or of a branch with its special points, compared with the full system.

        Both are inserted in the full system's own equations, in harmonic balance, where its linear part is exact.

        Parameters
        ----------
        found
            An orbit or a branch of the reduced system, by shooting or by harmonic balance.
        method
            Options of the harmonic balance; by default 15 harmonics, or as many as the orbits were found with.
        """
        from gapwalk.reduction.reduction_error import check_branch, check_orbit  # imported late: few need it

        return check_orbit(self, found, method) if isinstance(found, Orbit) else check_branch(self, found, method)

    @cached_property
    def _shared(self) -> tuple[list[int], list[int]]:
        """Indices of the parameters that belong to no coordinate, in the reduced and in the full system."""
        names = scalars_of(self.system.structure)
        structures = (self.system.structure, self.full.structure)
        ours, theirs = ([structure.place(name) for name in names] for structure in structures)
        return ours, theirs

    @cached_property
    def _retained(self) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Indices of the parameters of retained coordinates alone, in both systems; a change is the same in both."""
        kept, sides = self.basis.kept, []
        for structure, at in ((self.system.structure, np.arange(len(kept))), (self.full.structure, kept)):
            n = structure.size
            squares = [structure.block(which, n, n)[np.ix_(at, at)].ravel() for which in MATRICES]
            sides.append(np.concatenate(squares + [structure.block(prefix, n)[at] for prefix in vectors_of(structure)]))
        return sides[0], sides[1]

    def __repr__(self) -> str:
        return (
            f"Reduction({self.full.size} degrees of freedom to {self.system.size}: {len(self.kept)} retained, "
            f"{self.modes} modes; contacts deflect within {self.error:.2g} up to frequency {self.up_to:.6g})"
        )


def reduced_system(full: System, basis: Basis, small: Matrices) -> System:
    """Build the reduced system with all values of the full one."""
    structure = structure_of(full.structure, basis)
    n, r = full.size, basis.size
    values = np.zeros(len(structure.names))
    for which in MATRICES:
        values[structure.block(which, r, r)] = getattr(small, which).toarray()
    for prefix in vectors_of(structure):
        values[structure.block(prefix, r)] = full.values[full.structure.block(prefix, n)] @ basis.vectors
    for name in scalars_of(structure):
        values[structure.place(name)] = full[name]
    return System.from_values(structure, values).at()  # `at` checks what `from_values` does not


def structure_of(full: Structure, basis: Basis) -> Structure:
    """Return the structure of the reduced system: the retained coordinates by name, then mode1, mode2, ..."""
    kept = tuple(full.coordinates[place] for place in basis.kept)
    taken = {*kept, *(contact.name for contact in full.contacts), *(harmonic.name for harmonic in full.harmonics)}
    prefix, count = _MODES, basis.size - len(kept)
    while any(f"{prefix}{number}" in taken for number in range(1, count + 1)):
        prefix += "_"
    names = (*kept, *(f"{prefix}{number}" for number in range(1, count + 1)))
    return Structure(names, full.contacts, full.harmonics)


def vectors_of(structure: Structure) -> list[str]:
    """Return the prefixes of the names of parameters that belong to one coordinate each."""
    found = ["mean", *(load.shape for load in structure.driving)]
    for contact in structure.contacts:
        found += [*contact.vectors, *([] if contact.reciprocal else [contact.push])]
    return found


def scalars_of(structure: Structure) -> list[str]:
    """Return the names of the parameters that belong to no coordinate: they are the same in both systems."""
    found = ["frequency"]
    for harmonic in structure.harmonics:
        found += harmonic.parameters
    for contact in structure.contacts:
        found += contact.parameters
    return found


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

    Returns
    -------
    Reduction
        The reduced system, and its error.

    Raises
    ------
    ModelError
        If the matrices are not symmetric, or an option is invalid.
    NumericalError
        If the modes cannot be computed.

    Notes
    -----
    Craig and Bampton (1968), AIAA Journal 6, 1313-1319. The reduced system is exact in static equilibrium.

    Examples
    --------
    >>> chain = gw.train.chain(9, 1.0, 100.0, held=True).system()
    >>> small = gw.reduce(chain.at(frequency=1.0), modes=3, keep=["shaft1"])
    >>> small.system.coordinates
    ('shaft1', 'mode1', 'mode2', 'mode3')
    """
    _check(system, modes, error, up_to)
    system = system.equations  # of a drive train: its machine elements do not exist in the reduced system
    highest = system.frequency if up_to is None else float(up_to)
    matrices = matrices_of(system)
    bases = Bases.of(matrices, system.coordinates, keep)
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
    """Compute the resonances of a reference basis with many modes, at which smaller bases are compared."""
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

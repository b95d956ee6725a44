"""A reduction: the full system, the reduced one, and the way back."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gapwalk.errors import ModelError
from gapwalk.model.system import System
from gapwalk.motion.motion import Motion
from gapwalk.orbit.orbit import Orbit
from gapwalk.reduction.basis import Basis
from gapwalk.reduction.translation import Translation

if TYPE_CHECKING:
    from gapwalk.bifurcation.branch import Branch
    from gapwalk.orbit.balance import Balance
    from gapwalk.reduction.branch_check import BranchCheck
    from gapwalk.reduction.orbit_check import OrbitCheck


@dataclass(frozen=True)
class Reduction:
    """A system of many degrees of freedom as one of few; `reduce` makes it.

    Every parameter of contacts and of the excitation is one of the reduced system, under its own name, and so are those
    of the kept coordinates. Of the parameters of other coordinates (``stiffness.q7.q8``, ``mean.q7``) none is left. A
    matrix entry of kept coordinates contains what the others give at rest, so its value is another, but a change of it
    is the same change in both.

    Attributes
    ----------
    full, system
        The full system, and the reduced one.
    basis
        The vectors in which motions are looked for.
    up_to
        Highest frequency of the excitation for which it was made.
    error
        Largest relative error of the deflections of contacts under harmonic forces of the contacts and under the loads:
        up to that frequency, and, the k-th multiple weighted by 1/k^2, up to ten times that. `check` says what it
        means for a motion, and for special points.
    """

    full: System
    system: System
    basis: Basis
    up_to: float
    error: float

    @property
    def kept(self) -> tuple[str, ...]:
        """The coordinates that are kept; they are those of the reduced system too."""
        return self.system.coordinates[: len(self.basis.kept)]

    @property
    def modes(self) -> int:
        """The number of modes."""
        return len(self.basis.squares)

    @property
    def frequencies(self) -> NDArray[np.float64]:
        """Natural frequencies (angular) of the modes, with the kept coordinates held; shape (modes,)."""
        return np.sqrt(np.maximum(self.basis.squares, 0.0))

    def full_at(self, reduced: System) -> System:
        """The full system with the parameter values of the reduced one, such as `orbit.system`.

        Raises
        ------
        ModelError
            If it is not the reduced system at other values, or a parameter of a mode was changed.
        """
        return self._translation.full_at(reduced)

    def expand(self, motion: Orbit | Motion, samples: int | None = None) -> Motion:
        """A motion of the reduced system in all coordinates.

        Parameters
        ----------
        motion
            An orbit, of which one period is taken, or a sampled motion.
        samples
            Samples a forcing period, of an orbit.
        """
        sampled = motion.motion(samples) if isinstance(motion, Orbit) else motion
        full, back = self.full_at(sampled.system), self.basis.vectors.T
        return Motion(full, sampled.theta, sampled.q @ back, sampled.v @ back, sampled.events)

    def expand_state(self, state: ArrayLike) -> NDArray[np.float64]:
        """A state of the reduced system, shape (..., 2 r), in all coordinates, shape (..., 2 n).

        Raises
        ------
        ModelError
            If it is none of the reduced system.
        """
        given, r = np.asarray(state, dtype=float), self.system.size
        if given.ndim == 0 or given.shape[-1] != 2 * r:
            raise ModelError(
                f"the state has shape {given.shape}; it must have {2 * r} numbers: positions, then velocities"
            )
        back = self.basis.vectors.T
        return np.concatenate((given[..., :r] @ back, given[..., r:] @ back), axis=-1)

    def check(self, found: Orbit | Branch, method: Balance | None = None) -> OrbitCheck | BranchCheck:
        """How far an orbit, or a branch with its special points, is from that of the full system.

        Both are put to the full system's own equations, in harmonic balance, where its linear part is exact.

        Parameters
        ----------
        found
            An orbit or a branch of the reduced system, by shooting or by harmonic balance.
        method
            How to balance; by default 15 harmonics, or as many as the orbits were found with.

        Raises
        ------
        ModelError
            If it is no orbit or branch of the reduced system, or the parameter of the branch has no meaning in the full
            one.
        NumericalError
            If the motion cannot be balanced with so few harmonics.
        """
        if isinstance(found, Orbit):
            from gapwalk.reduction.orbit_check import check_orbit

            return check_orbit(self, found, method)
        from gapwalk.reduction.branch_check import check_branch

        return check_branch(self, found, method)

    @cached_property
    def _translation(self) -> Translation:
        return Translation(self.full, self.system, self.basis.kept)

    def __repr__(self) -> str:
        return (
            f"Reduction({self.full.size} degrees of freedom to {self.system.size}: {len(self.kept)} kept, "
            f"{self.modes} modes; contacts deflect within {self.error:.2g} up to frequency {self.up_to:.6g})"
        )

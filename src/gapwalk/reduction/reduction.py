"""The record of a reduction: the full system, the reduced one, and the conversion back."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gapwalk.errors import ModelError
from gapwalk.flow.motion import Motion
from gapwalk.model.system import System
from gapwalk.orbit.orbit import Orbit
from gapwalk.reduction.basis import Basis
from gapwalk.reduction.translation import Translation

if TYPE_CHECKING:
    from gapwalk.bifurcation.branch import Branch
    from gapwalk.orbit.harmonic_balance import Balance
    from gapwalk.reduction.branch_check import BranchCheck
    from gapwalk.reduction.orbit_check import OrbitCheck


@dataclass(frozen=True)
class Reduction:
    """A system of many degrees of freedom reduced to few, as returned by `reduce`.

    The reduced system has every parameter of contacts and of the excitation, and those of the retained coordinates,
    under their own names. It has no parameters of other coordinates (``stiffness.q7.q8``, ``mean.q7``). A matrix entry
    of retained coordinates includes the static contribution of the others. So its value differs from that in the full
    system, but a change of it is the same change in both.

    Attributes
    ----------
    full, system
        The full system, and the reduced one.
    basis
        The vectors that span the motions.
    up_to
        Highest frequency of the excitation for which it was made.
    error
        Largest relative error of the deflections of contacts under harmonic forces of the contacts and under the loads:
        up to that frequency, and, with the k-th multiple weighted by 1/k^2, up to ten times that. `check` estimates the
        resulting error of a motion and of special points.
    """

    full: System
    system: System
    basis: Basis
    up_to: float
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

        Raises
        ------
        ModelError
            If it is not the reduced system at other values, or a parameter of a mode was changed.
        """
        return self._translation.full_at(reduced)

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
        return Motion(full, sampled.theta, sampled.q @ back, sampled.v @ back, sampled.events)

    def expand_state(self, state: ArrayLike) -> NDArray[np.float64]:
        """Expand a state of the reduced system, shape (..., 2 r), to all coordinates, shape (..., 2 n).

        Raises
        ------
        ModelError
            If it is not a state of the reduced system.
        """
        given, r = np.asarray(state, dtype=float), self.system.size
        if given.ndim == 0 or given.shape[-1] != 2 * r:
            raise ModelError(
                f"the state has shape {given.shape}; it must have {2 * r} numbers: positions, then velocities"
            )
        back = self.basis.vectors.T
        return np.concatenate((given[..., :r] @ back, given[..., r:] @ back), axis=-1)

    def check(self, found: Orbit | Branch, method: Balance | None = None) -> OrbitCheck | BranchCheck:
        """Estimate the error of an orbit, or of a branch with its special points, compared with the full system.

        Both are inserted in the full system's own equations, in harmonic balance, where its linear part is exact.

        Parameters
        ----------
        found
            An orbit or a branch of the reduced system, by shooting or by harmonic balance.
        method
            Options of the harmonic balance; by default 15 harmonics, or as many as the orbits were found with.

        Raises
        ------
        ModelError
            If it is not an orbit or branch of the reduced system, or the parameter of the branch has no meaning in the
            full one.
        NumericalError
            If so few harmonics do not suffice for the motion.
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
            f"Reduction({self.full.size} degrees of freedom to {self.system.size}: {len(self.kept)} retained, "
            f"{self.modes} modes; contacts deflect within {self.error:.2g} up to frequency {self.up_to:.6g})"
        )

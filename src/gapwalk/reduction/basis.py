"""The basis of a reduction: Craig and Bampton's, with static responses to distributed forces in addition to the modes.

With q_b the retained coordinates and q_i the others,

    [ q_b ]   [  I    0  ] [ q_b ]
    [ q_i ] = [ Psi  Phi ] [ eta ]

where Psi are the static shapes in which the interior follows the retained coordinates, and Phi its lowest modes with
these coordinates fixed (Craig and Bampton 1968, AIAA Journal 6, 1313-1319). So the reduced system is exact in static
equilibrium, under all contact forces and loads, and the error of its flexibility grows with the square of the frequency
over that of the first omitted mode. For forces that act on many coordinates, their static response (made orthogonal to
the modes) is included instead of retained coordinates. For high accuracy, the response to the inertia of the shapes Psi
is more effective than the same number of additional modes: the error then grows with the fourth power.

Method: docs/numerics/reduction.md
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from gapwalk.reduction.interior import Interior
from gapwalk.reduction.retained import Kept
from gapwalk.reduction.sparse_matrices import Matrices


@dataclass(frozen=True, eq=False)
class Basis:
    """The vectors that span the motions of a reduced system.

    Attributes
    ----------
    kept : shape (kept,)
        Indices of the retained coordinates.
    squares : shape (modes,)
        Squares of the frequencies of the modes, with the retained coordinates fixed.
    vectors : shape (n, kept + modes)
        ``q = vectors z``, z being the retained coordinates and the amplitudes of the modes.
    """

    kept: NDArray[np.intp]
    squares: NDArray[np.float64]
    vectors: NDArray[np.float64]

    @property
    def size(self) -> int:
        """The number of vectors."""
        return self.vectors.shape[1]

    def reduce(self, matrices: Matrices) -> Matrices:
        """Project the system on this basis; entries that are zero or one by construction are set exactly."""
        small = matrices.projected(self.vectors)
        b = len(self.kept)
        mass, stiffness = small.mass.toarray(), small.stiffness.toarray()
        stiffness[b:, :b] = stiffness[:b, b:] = 0.0
        stiffness[b:, b:] = np.diag(self.squares)
        mass[b:, b:] = np.eye(len(self.squares))
        return replace(
            small,
            mass=sp.csc_array(0.5 * (mass + mass.T)),
            stiffness=sp.csc_array(0.5 * (stiffness + stiffness.T)),
        )


@dataclass(frozen=True)
class Bases:
    """The bases of a system with different numbers of modes.

    Parameters
    ----------
    matrices
        The full system.
    kept
        The coordinates and forces that are retained.
    """

    matrices: Matrices
    kept: Kept

    @cached_property
    def interior(self) -> Interior:
        """The system with the retained coordinates fixed, including any in which it could still move rigidly."""
        interior = Interior(self.matrices, self.kept.places)
        while (loose := interior.loose_coordinate()) is not None:
            interior = Interior(self.matrices, np.sort(np.append(interior.kept, loose)))
        return interior

    def with_modes(self, count: int, *, inertia: bool = False) -> Basis:
        """Return the basis with the lowest modes and, if `inertia`, the response to the inertia of the shapes Psi."""
        interior = self.interior
        forces = np.hstack((self.kept.spread, interior.inertial_forces)) if inertia else self.kept.spread
        squares, shapes = interior.enriched(count, forces)
        b = len(interior.kept)
        vectors = np.zeros((self.matrices.size, b + len(squares)))
        vectors[interior.kept, np.arange(b)] = 1.0
        vectors[interior.places, :b] = interior.constraint_shapes
        vectors[interior.places, b:] = shapes
        return Basis(interior.kept, squares, vectors)

    def modes_up_to(self, frequency: float) -> int:
        """Count the modes below a frequency."""
        interior, wanted = self.interior, 40
        while True:
            squares, _ = interior.modes(wanted)
            below = int(np.count_nonzero(squares <= frequency**2))
            if below < len(squares) or len(squares) < wanted or len(squares) == interior.size:
                return below
            wanted *= 2

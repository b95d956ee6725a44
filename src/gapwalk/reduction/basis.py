"""The basis of a reduction: Craig and Bampton's, with the static response to spread forces beside the modes.

With q_b the coordinates that are kept and q_i the others,

    [ q_b ]   [  I    0  ] [ q_b ]
    [ q_i ] = [ Psi  Phi ] [ eta ]

where Psi are the shapes in which the interior follows the kept coordinates at rest, and Phi its lowest modes with
these held (Craig and Bampton 1968, AIAA Journal 6, 1313-1319). So the reduced system is exact at rest, under every
contact force and every load, and the error of its flexibility grows with the square of the frequency over that of the
first mode that is left out. Forces that act on many coordinates bring their static response, made orthogonal to the
modes, instead of kept coordinates. Where much accuracy is asked for, the response to the inertia of the shapes Psi
serves better than as many modes more: the error then grows with the fourth power.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from gapwalk.reduction.interior import Interior
from gapwalk.reduction.kept import Kept
from gapwalk.reduction.matrices import Matrices


@dataclass(frozen=True, eq=False)
class Basis:
    """The vectors in which motions are looked for.

    Attributes
    ----------
    kept : shape (kept,)
        Places of the coordinates that are kept.
    squares : shape (modes,)
        Squares of the frequencies of the modes, with the kept coordinates held.
    vectors : shape (n, kept + modes)
        ``q = vectors z``, z being the kept coordinates and the amplitudes of the modes.
    """

    kept: NDArray[np.intp]
    squares: NDArray[np.float64]
    vectors: NDArray[np.float64]

    @property
    def size(self) -> int:
        """How many vectors there are."""
        return self.vectors.shape[1]

    def reduce(self, matrices: Matrices) -> Matrices:
        """The system in this basis; what is zero or one by construction is just that."""
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
        What is kept of it.
    """

    matrices: Matrices
    kept: Kept

    @cached_property
    def interior(self) -> Interior:
        """The system with the kept coordinates held, and more of them where it could still move as a whole."""
        interior = Interior(self.matrices, self.kept.places)
        while (loose := interior.loose_coordinate()) is not None:
            interior = Interior(self.matrices, np.sort(np.append(interior.kept, loose)))
        return interior

    def with_modes(self, count: int, *, inertia: bool = False) -> Basis:
        """The basis with the lowest modes; with the response to the inertia of the shapes Psi, if that is wanted."""
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
        """How many modes lie below a frequency."""
        interior, wanted = self.interior, 40
        while True:
            squares, _ = interior.modes(wanted)
            below = int(np.count_nonzero(squares <= frequency**2))
            if below < len(squares) or len(squares) < wanted or len(squares) == interior.size:
                return below
            wanted *= 2

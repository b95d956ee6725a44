"""Damping without its matrix: in proportion to mass and stiffness, or by modal ratios."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gapwalk.errors import ModelError

_ROUNDING = 1e-10  # relative size of what counts as a rounding error of a matrix or of a square of a frequency


@dataclass(frozen=True, slots=True)
class ProportionalDamping:
    """Damping ``C = mass * M + stiffness * K`` (Rayleigh's).

    Raises
    ------
    ModelError
        If one of them is not a finite number.

    Examples
    --------
    >>> gw.System(["x"], [[4.0]], damping=gw.ProportionalDamping(0.1, 0.02)).matrix("damping")  # 0.1 M + 0.02 K
    array([[0.18]])
    """

    mass: float = 0.0  #: Factor of the mass matrix, in 1/time.
    stiffness: float = 0.0  #: Factor of the stiffness matrix, in units of time.

    def __post_init__(self) -> None:
        for name, value in (("mass", self.mass), ("stiffness", self.stiffness)):
            if not _is_number(value):
                raise ModelError(
                    f"{name} of a proportional damping is {value!r}; it must be a number, as in {name}=0.02"
                )

    def matrix(self, mass: NDArray[np.float64], stiffness: NDArray[np.float64]) -> NDArray[np.float64]:
        """Compute the damping matrix, shape (n, n).

        Parameters
        ----------
        mass, stiffness : shape (n, n)
            The mass and the stiffness matrix.

        Returns
        -------
        array, shape (n, n)
            The damping matrix.
        """
        return self.mass * mass + self.stiffness * stiffness


@dataclass(frozen=True, slots=True)
class ModalDamping:
    """Damping ratios of the undamped modes of the system with open contacts.

    Raises
    ------
    ModelError
        If there is no ratio, or one is negative or not a number.

    Examples
    --------
    >>> gw.System(["x"], [[4.0]], damping=gw.ModalDamping([0.05])).matrix("damping")  # 2 zeta w
    array([[0.2]])
    """

    #: Shares of the critical damping, from the mode of the lowest frequency on. The last ratio is used for all higher
    #: modes, so that one number suffices for all modes. A motion without stiffness remains undamped.
    ratios: float | Sequence[float]

    def __post_init__(self) -> None:
        given: Any = (self.ratios,) if _is_number(self.ratios) else self.ratios
        if isinstance(given, str) or not isinstance(given, Sequence | np.ndarray) or not len(given):
            raise ModelError(
                f"ratios is {self.ratios!r}; write one number, as in ModalDamping(0.02), or one for each mode"
            )
        for ratio in given:
            if not _is_number(ratio) or ratio < 0.0:
                raise ModelError(f"ratios has {ratio!r}; a damping ratio must be a number >= 0, as in 0.02 for 2 %")
        object.__setattr__(self, "ratios", tuple(float(ratio) for ratio in given))

    def matrix(self, mass: NDArray[np.float64], stiffness: NDArray[np.float64]) -> NDArray[np.float64]:
        """Compute the damping matrix ``sum of 2 zeta_k w_k (M phi_k) (M phi_k)^T``, with ``phi_k^T M phi_k = 1``.

        Parameters
        ----------
        mass, stiffness : shape (n, n)
            The mass and the stiffness matrix.

        Returns
        -------
        array, shape (n, n)
            The damping matrix.
        """
        for name, matrix in (("mass", mass), ("stiffness", stiffness)):
            if not np.allclose(matrix, matrix.T, rtol=0.0, atol=_ROUNDING * np.abs(matrix).max(initial=0.0)):
                raise ModelError(
                    f"the {name} matrix is not symmetric, so there are no modes to damp; write the damping matrix"
                )
        from scipy.linalg import eigh  # slow to import, and not needed to check a file

        try:
            squares, modes = eigh(stiffness, mass)
        except np.linalg.LinAlgError:
            raise ModelError("the mass matrix is not positive definite, so there are no modes to damp") from None
        if squares[0] < -_ROUNDING * np.abs(squares).max():
            raise ModelError(
                f"the stiffness has a mode with the square {squares[0]:.3g} of a frequency: it grows by itself, and "
                "has no damping ratio; write the damping matrix"
            )
        given = np.atleast_1d(np.asarray(self.ratios, dtype=float))[: len(squares)]
        ratios = np.append(given, np.full(len(squares) - len(given), given[-1]))
        acting = mass @ modes
        squares[squares < _ROUNDING * np.abs(squares).max()] = 0.0
        return (acting * (2.0 * ratios * np.sqrt(squares))) @ acting.T


Damping = ProportionalDamping | ModalDamping
"""Damping without its matrix."""


def _is_number(value: object) -> bool:
    return not isinstance(value, bool) and isinstance(value, int | float | np.number) and math.isfinite(float(value))

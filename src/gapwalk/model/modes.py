"""Natural frequencies and mode shapes of a system, linearised with certain clearances closed."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from gapwalk.errors import ModelError
from gapwalk.model.drivetrain.train_assembly import TrainAssembly, of_angles
from gapwalk.model.equilibria import Equilibrium
from gapwalk.model.problems import did_you_mean
from gapwalk.model.spring import springs_of
from gapwalk.model.statics import tangent
from gapwalk.model.system import System
from gapwalk.notebook.shown import Shown

_Vibrations = tuple[NDArray[np.complex128], NDArray[np.complex128], NDArray[np.float64]]


class Clearances(StrEnum):
    """Which stages are closed where a system is linearised, whatever its mean load."""

    OPEN = "open"
    """None."""
    CLOSED = "closed"
    """The first stage of every contact."""


@dataclass(frozen=True, eq=False)
class Modes(Shown):
    """Undamped natural vibrations, slowest first.

    Parameters
    ----------
    frequencies : shape (n,)
        Angular natural frequencies; 0 for a motion that nothing drives back, NaN for one that grows or is no vibration.
    shapes : shape (n, n)
        A mode in each column, by the coordinates.
    damping_ratios : shape (n,)
        Shares of critical damping, of light damping; NaN where the frequency is 0 or NaN.
    coordinates
        Names of the coordinates.
    inertias
        Names of the inertias of a drive train; otherwise empty.
    angles : shape (inertias, n)
        A mode in each column, by the inertias of a drive train; otherwise empty. That of a free train has no momentum.

    Notes
    -----
    The largest entry of a column is 1, of `angles` for a drive train and of `shapes` otherwise.
    """

    frequencies: NDArray[np.float64]
    shapes: NDArray[np.float64]
    damping_ratios: NDArray[np.float64]
    coordinates: tuple[str, ...]
    inertias: tuple[str, ...]
    angles: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.frequencies)

    def __repr__(self) -> str:
        shown = ", ".join(f"{frequency:.6g}" for frequency in self.frequencies[:6])
        return f"Modes({shown}{', ...' if len(self) > 6 else ''})"


def modes_of(system: System, at: Equilibrium | str = Clearances.CLOSED) -> Modes:
    """Natural frequencies and modes of a system.

    Parameters
    ----------
    system
        Any system; that of a `Train` has modes by its inertias too.
    at
        ``"closed"``: with the first stage of every contact closed; ``"open"``: with none; or an equilibrium from
        `rest_of`, with what is closed there.

    Raises
    ------
    ModelError
        For any other word.
    """
    if isinstance(at, Equilibrium):
        stiffness, damping = at.stiffness, at.damping
    elif at in [*Clearances]:
        closed = [spring.innermost() if at == Clearances.CLOSED else () for spring in springs_of(system)]
        stiffness, damping = tangent(system, closed)
    else:
        raise ModelError(f"at is {at!r}; it must be an equilibrium, or {did_you_mean(str(at), [*Clearances])}")
    stiffness, damping = of_angles(system, stiffness, damping)
    squares, left, right = _vibrations(stiffness, system.matrix("mass"))
    angles = _angles(system)
    sizes = (angles @ right) if angles.size else right
    right = right / sizes[np.abs(sizes).argmax(axis=0), range(len(squares))]
    floor = 1e-12 * len(squares) * np.abs(squares).max(initial=0.0)  # rounding of the largest
    real = np.abs(squares.imag) <= 1e-9 * np.abs(squares)
    frequencies = np.where(real & (squares.real > -floor), np.sqrt(np.maximum(squares.real, 0.0)), np.nan)
    frequencies[np.abs(squares) <= floor] = 0.0
    inertias = system.structure.assembly.form.inertias if isinstance(system.structure.assembly, TrainAssembly) else ()
    return Modes(
        frequencies,
        right,
        _damping_ratios(system, damping, frequencies, left, right),
        system.coordinates,
        inertias,
        angles @ right if angles.size else np.zeros((0, len(squares))),
    )


def _vibrations(stiffness: NDArray[np.float64], mass: NDArray[np.float64]) -> _Vibrations:
    """Squares of the natural frequencies with left and right vectors, slowest first."""
    from scipy.linalg import eig, eigh  # slow to import

    if np.allclose(mass, mass.T, rtol=1e-12, atol=0.0) and np.allclose(
        stiffness, stiffness.T, rtol=0.0, atol=1e-12 * np.abs(stiffness).max()
    ):
        squares, right = eigh(0.5 * (stiffness + stiffness.T), 0.5 * (mass + mass.T))
        return squares.astype(complex), right, right
    squares, left, right = eig(stiffness, mass, left=True, right=True)
    order = np.argsort(squares.real, kind="stable")
    left, right = left[:, order], right[:, order]
    turn = right[np.abs(right).argmax(axis=0), range(len(order))]
    return squares[order], left.conj(), (right / turn).real


def _angles(system: System) -> NDArray[np.float64]:
    assembly = system.structure.assembly
    return assembly.angles(system.values) if isinstance(assembly, TrainAssembly) else np.zeros((0, system.size))


def _damping_ratios(
    system: System,
    damping: NDArray[np.float64],
    frequencies: NDArray[np.float64],
    left: NDArray[np.complex128],
    right: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Shares of critical damping to first order: the modes are those of the undamped system."""
    damped = np.sum(left * (damping @ right), axis=0)
    moved = np.sum(left * (system.matrix("mass") @ right), axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(frequencies > 0, np.real(damped / moved) / (2.0 * frequencies), np.nan)

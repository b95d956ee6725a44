"""Natural frequencies, mode shapes and dissipation of a system, linearised with certain clearances closed."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from gapwalk.errors import ModelError
from gapwalk.model.drivetrain.train_assembly import TrainAssembly, of_angles
from gapwalk.model.equilibria import Equilibrium, tangent
from gapwalk.model.gyroscopic import SYMMETRIC, gyroscopic_part, whirls
from gapwalk.model.problems import did_you_mean
from gapwalk.model.spring import springs_of
from gapwalk.model.system import System
from gapwalk.notebook import Shown

_DEPENDENT = 1e-9  # share of a constraint below which it depends on others
_ZERO_RATE = 1e-12  # share of the largest rate of dissipation below which a negative one is rounding


class Clearances(StrEnum):
    """The stages that are closed in a linearisation, irrespective of the mean load."""

    OPEN = "open"
    """None."""
    CLOSED = "closed"
    """The first stage of every contact; rigid stops are open, and dry friction is left out."""
    STUCK = "stuck"
    """The first stage of every contact, and all dry friction sticks: by its spring, or rigidly."""
    HELD = "held"
    """As stuck, and every rigid stop is held."""


@dataclass(frozen=True, eq=False)
class Modes(Shown):
    """Undamped natural vibrations, slowest first.

    Notes
    -----
    The largest entry of a column is 1, of `angles` for a drive train and of `shapes` otherwise. There are as many modes
    as coordinates, less what sticks rigidly or is held.

    Examples
    --------
    >>> modes = gw.find_modes(driveline)
    >>> modes.frequencies.shape, modes.inertias
    ((2,), ('engine', 'gear', 'box'))
    """

    #: shape (modes,): Angular natural frequencies; 0 for a motion without stiffness, NaN for one that grows or is not a
    #: vibration.
    frequencies: NDArray[np.float64]
    #: shape (n, modes): A mode in each column, by the coordinates. Complex where gyroscopic terms let coordinates move
    #: one after the other: the motion is the real part of the column times ``exp(i W t)``.
    shapes: NDArray[np.float64] | NDArray[np.complex128]
    #: shape (modes,): Shares of critical damping, of light damping; NaN where the frequency is 0 or NaN.
    damping_ratios: NDArray[np.float64]
    coordinates: tuple[str, ...]  #: Names of the coordinates.
    inertias: tuple[str, ...]  #: Names of the inertias of a drive train; otherwise empty.
    #: shape (inertias, modes): A mode in each column, by the inertias of a drive train; otherwise empty. A free train's
    #: have no momentum.
    angles: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.frequencies)

    def __repr__(self) -> str:
        shown = ", ".join(f"{frequency:.6g}" for frequency in self.frequencies[:6])
        return f"Modes({shown}{', ...' if len(self) > 6 else ''})"


def find_modes(system: System, at: Equilibrium | str = Clearances.CLOSED) -> Modes:
    """Compute natural frequencies and modes of a system without losses.

    Gyroscopic terms, the skew part of the damping matrix, lose no energy and are kept.

    Parameters
    ----------
    system
        Any system; the modes of a `Train` are also given by its inertias.
    at
        ``"closed"``: with the first stage of every contact closed; ``"open"``: with none; ``"stuck"``: closed, and all
        dry friction sticks, by the spring of a Jenkins element or rigidly; ``"held"``: stuck, and every rigid stop is
        held; all with the slopes of formulas at zero deflection. Otherwise dry friction is left out, and rigid stops
        are open. Or an equilibrium from `find_equilibria`, with the stages that are closed there, and the slopes there.
        Numbers that vary over the angle have their mean value.

    Returns
    -------
    Modes
        Frequencies and shapes, slowest first.

    Raises
    ------
    ModelError
        For any other word, if a formula has no finite value and slope at zero deflection, or if there are gyroscopic
        terms in equations that do not show their energy.

    Examples
    --------
    >>> gw.find_modes(system, at="open").frequencies, gw.find_modes(system, at="closed").frequencies
    (array([1.]), array([4.58257569]))
    """
    left = right = np.eye(system.size)
    if isinstance(at, Equilibrium):
        stiffness, damping = at.stiffness, at.damping
    elif at in [*Clearances]:
        closed = [
            spring.innermost() if at != Clearances.OPEN and spring.slopes else () for spring in springs_of(system)
        ]
        stuck = at in (Clearances.STUCK, Clearances.HELD)
        stiffness, damping = tangent(system, closed, stuck=stuck)
        if stuck:
            left, right = _left_free(system, stops=at == Clearances.HELD)
    else:
        raise ModelError(f"at is {at!r}; it must be an equilibrium, or {did_you_mean(str(at), [*Clearances])}")
    stiffness, damping = of_angles(system, stiffness, damping)
    gyroscopic = gyroscopic_part(system, stiffness, damping)
    losses = damping if gyroscopic is None else damping - gyroscopic
    mass, stiffness, losses = (left.T @ each @ right for each in (system.matrix("mass"), stiffness, losses))
    if gyroscopic is None or not right.size:
        squares, vectors, decay = _vibrations(mass, stiffness, losses)
    else:
        squares, vectors, decay = whirls(mass, left.T @ gyroscopic @ right, stiffness, losses)
    shapes = right @ vectors
    assembly, inertias, angles = system.structure.assembly, (), np.zeros((0, len(squares)))
    if isinstance(assembly, TrainAssembly):
        inertias, angles = assembly.form.inertias, assembly.numbers(system.values).angles @ shapes
    sizes = angles if angles.size else shapes
    largest = sizes[np.abs(sizes).argmax(axis=0), range(len(squares))]
    floor = 1e-12 * len(squares) * np.abs(squares).max(initial=0.0)  # rounding of the largest
    real = np.abs(squares.imag) <= 1e-9 * np.abs(squares)
    frequencies = np.where(real & (squares.real > -floor), np.sqrt(np.maximum(squares.real, 0.0)), np.nan)
    frequencies[np.abs(squares) <= floor] = 0.0
    with np.errstate(divide="ignore", invalid="ignore"):
        ratios = np.where(frequencies > 0, decay / frequencies, np.nan)
    return Modes(frequencies, shapes / largest, ratios, system.coordinates, inertias, np.real(angles / largest))


def _left_free(system: System, *, stops: bool) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return bases of the forces and of the motions that rigid friction that sticks, and held stops, leave free."""
    held = [
        spring
        for spring in springs_of(system)
        if (spring.form.law.is_dry and not spring.form.law.has_memory) or (stops and spring.form.law.rebounds)
    ]
    if not held:
        return np.eye(system.size), np.eye(system.size)
    from scipy.linalg import null_space  # slow to import

    deflections, pushes = (
        np.array([vector / np.linalg.norm(vector) for vector in each])
        for each in ([spring.deflection for spring in held], [spring.force for spring in held])
    )
    right = null_space(deflections, rcond=_DEPENDENT)
    left = right if np.allclose(deflections, pushes, rtol=1e-12, atol=0.0) else null_space(pushes, rcond=_DEPENDENT)
    if left.shape != right.shape:
        raise ModelError(
            "contacts that hold the same motion act along different vectors; leave all but one of them out"
        )
    return left, right


def _vibrations(
    mass: NDArray[np.float64], stiffness: NDArray[np.float64], losses: NDArray[np.float64]
) -> tuple[NDArray[np.complex128], NDArray[np.float64], NDArray[np.float64]]:
    """Compute squares of the frequencies, shapes, and rates of decay to first order, without gyroscopic terms."""
    from scipy.linalg import eig, eigh  # slow to import

    if np.allclose(mass, mass.T, rtol=1e-12, atol=1e-12 * np.abs(mass).max(initial=0.0)) and np.allclose(
        stiffness, stiffness.T, rtol=0.0, atol=1e-12 * np.abs(stiffness).max(initial=0.0)
    ):
        squares, right = eigh(0.5 * (stiffness + stiffness.T), 0.5 * (mass + mass.T))
        squares, left = squares.astype(complex), right
    else:
        squares, left, right = eig(stiffness, mass, left=True, right=True)
        order = np.argsort(squares.real, kind="stable")
        squares, left, right = squares[order], left[:, order].conj(), right[:, order]
        right = (right / right[np.abs(right).argmax(axis=0), range(len(order))]).real
    damped, moved = (np.sum(left * (matrix @ right), axis=0) for matrix in (losses, mass))
    with np.errstate(divide="ignore", invalid="ignore"):
        return squares, right, 0.5 * np.real(damped / moved)


def dissipation_doubts(system: System) -> list[str]:
    """Describe damping that feeds energy in, or is zero, a sentence each.

    The rates at which the damping takes energy out of free motions are the eigenvalues of ``M^-1 C``. If one is
    negative, motions grow until a contact limits them, or without limit; if all are zero, resonances have no limit.
    """
    doubts = []
    damping = of_angles(system, system.matrix("stiffness"), system.matrix("damping"))[1]
    rates = np.linalg.eigvals(np.linalg.solve(system.matrix("mass"), damping)).real
    dragging = any(not form.stages and form.law.is_damped for form in system.structure.contacts)
    if not dragging and (not damping.any() or _is_gyroscopic(system, damping)):
        doubts.append(
            f"damping is zero{' but for gyroscopic terms' * bool(damping.any())}: no motion settles, and at a "
            "resonance nothing limits it while the gaps are open; give the system a damping, however small"
        )
    elif rates.min() < -_ZERO_RATE * np.abs(rates).max():
        doubts.append(
            f"damping is negative: it feeds energy in, at the rate {rates.min():.4g} (the lowest eigenvalue of M^-1 C, "
            "per unit of time), so that motions may grow without end; look at the signs of the damping"
        )
    for contact in system.structure.contacts:
        for parameter in contact.law.parameters:
            name = f"{contact.name}.{parameter.name}"
            if parameter.least is not None and system[name] < parameter.least:
                doubts.append(f"{name} is {system[name]:g}: negative, so that the contact feeds energy in")
    return doubts


def _is_gyroscopic(system: System, damping: NDArray[np.float64]) -> bool:
    """Return True if a damping matrix takes out no energy, as far as the equations show it."""
    try:
        found = gyroscopic_part(system, system.matrix("stiffness"), damping)
    except ModelError:
        return False
    return found is not None and bool(np.abs(damping - found).max() <= SYMMETRIC * np.abs(damping).max())

"""Natural frequencies, mode shapes and dissipation of a system, linearised with certain clearances closed."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from gapwalk.errors import ModelError
from gapwalk.model.coefficients import layout_of
from gapwalk.model.contact import ContactForm
from gapwalk.model.drivetrain.train_assembly import TrainAssembly
from gapwalk.model.equilibria import Equilibrium, tangent
from gapwalk.model.paced_matrices import PacedMatrices
from gapwalk.model.problems import did_you_mean
from gapwalk.model.spring import springs_of
from gapwalk.model.system import System
from gapwalk.notebook import Shown

# Gyroscopic terms: the part of the damping matrix that loses no energy, and the masses by which energy is measured.
#
# With the symmetric masses of the kinetic energy, the power that damping takes out is ``v C v``, to which the skew
# part of C adds nothing. It belongs to free vibrations as mass and stiffness do: their modes are then complex, and
# whirl.

SYMMETRIC = 1e-9  # relative asymmetry of a matrix that counts as rounding
_LARGE = 40  # coordinates beyond which no other masses are looked for: the equations grow with the fourth power

Array = NDArray[np.float64]


def states_of(system: System) -> tuple[str, ...]:
    """Return the names of the states without inertia of a system, or of the inertias without any of a train."""
    assembly = system.structure.assembly
    if isinstance(assembly, TrainAssembly):
        return assembly.form.slow
    return assembly.states if isinstance(assembly, PacedMatrices) else ()


def _of_angles(
    system: System, stiffness: NDArray[np.float64], damping: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return stiffness and damping matrices with the angles of slips as coordinates, from those by the slips."""
    assembly = system.structure.assembly
    if not isinstance(assembly, TrainAssembly) or not assembly.form.adrift:
        return stiffness, damping
    stiffness = stiffness.copy()
    stiffness[:, assembly.form.adrift] = 0.0  # no spring acts on such an angle, nor any contact
    return stiffness, damping - system.matrix("mass") * assembly.numbers(system.values).leaks


def gyroscopic_part(system: System, stiffness: Array, damping: Array) -> Array | None:
    """Return the part of a damping matrix that loses no energy; None if there is none.

    In the modes of ``M^-1 K`` it lets two modes act on each other with opposite signs. Whether it does is seen in any
    form of the equations; how large it is needs their energy.
    """
    if is_symmetric(damping) or isinstance(system.structure.assembly, TrainAssembly):
        return None
    mass = system.matrix("mass")
    if is_symmetric(mass) and is_symmetric(stiffness) and _are_reciprocal(system):
        return 0.5 * (damping - damping.T)
    shapes = np.linalg.eig(np.linalg.solve(mass, stiffness))[1]
    acting = np.linalg.lstsq(shapes, np.linalg.solve(mass, damping) @ shapes, rcond=None)[0]
    both = np.real(acting * acting.T)
    if both.min() >= -SYMMETRIC * np.abs(both).max():
        return None
    energy = mass_of_energy(system, strict=True)
    moved = energy @ np.linalg.solve(mass, damping)
    return 0.5 * mass @ np.linalg.solve(energy, moved - moved.T)


def whirls(
    mass: Array, gyroscopic: Array, stiffness: Array, losses: Array
) -> tuple[NDArray[np.complex128], NDArray[np.complex128], Array]:
    """Compute the modes of ``M q'' + G q' + K q = 0``."""
    n = len(mass)
    rows = np.linalg.solve(mass, np.hstack((stiffness, gyroscopic, losses)))
    unit = max(np.sqrt(np.abs(rows[:, :n]).max()), np.abs(rows[:, n : 2 * n]).max())  # a frequency
    still = np.zeros((n, n))
    matrix = np.block([[still, np.eye(n)], [-rows[:, :n] / unit**2, -rows[:, n : 2 * n] / unit]])
    values, left, right = _eigen(matrix)
    at_rest = np.abs(values) ** 2 <= 1e-12 * n * np.abs(values).max() ** 2
    # vectors of equal values need not be dual to each other; of those that rest there may be too few
    pairs = left.conj().T @ right
    pairs[at_rest], pairs[:, at_rest] = 0.0, 0.0
    pairs[np.ix_(at_rest, at_rest)] = np.eye(int(at_rest.sum()))
    lost = np.block([[still, still], [still, rows[:, 2 * n :] / unit]])
    decay = np.real(np.diag(np.linalg.solve(pairs, left.conj().T @ lost @ right)))
    ahead = np.flatnonzero((values.imag > 0.0) & ~at_rest)
    rest = np.flatnonzero((values.imag == 0.0) | at_rest)  # in pairs, of which one grows
    rest = rest[np.argsort(-values[rest].real, kind="stable")][: n - len(ahead)]
    chosen = np.concatenate((rest, ahead))
    squares = -(values[chosen] ** 2)
    order = np.argsort(squares.real, kind="stable")
    chosen = chosen[order]
    return squares[order] * unit**2, right[:n, chosen], decay[chosen] * unit


def _eigen(matrix: Array) -> tuple[NDArray[np.complex128], NDArray[np.complex128], NDArray[np.complex128]]:
    from scipy.linalg import eig  # slow to import

    values, left, right = eig(matrix, left=True, right=True)
    return values, left.astype(complex), right.astype(complex)


def mass_of_energy(system: System, *, strict: bool = False) -> Array:
    """Return the masses of the kinetic energy: the mass matrix, or that for which the contacts act on themselves.

    Equations that were divided by masses, or combined, have matrices that are not symmetric. Their energy has the
    symmetric mass matrix A with ``A M^-1 d = e`` for each contact, and a symmetric ``A M^-1 K``. If `strict`, a
    symmetric mass matrix alone is not taken for it.
    """
    if states := states_of(system):
        raise ModelError(
            f"the energy is not known of a system with states without inertia ({', '.join(states)}): its springs and "
            "dampers in series are not separated; leave them out, or look at the motion and its multipliers"
        )
    n, mass, stiffness = system.size, system.matrix("mass"), system.matrix("stiffness")
    forms = _single(system)
    known = is_symmetric(mass)
    reciprocal = _are_reciprocal(system) and bool(forms or not strict)
    if known and (reciprocal or is_symmetric(_potential(system, stiffness, mass))):
        return mass
    if strict and n > _LARGE:
        raise ModelError(_NO_GYROSCOPE)
    table = layout_of(system.structure).table(system.values)
    basis = [(i, j) for i in range(n) for j in range(i, n)]
    shapes = np.zeros((len(basis), n, n))
    for shape, (i, j) in zip(shapes, basis, strict=True):
        shape[i, j] = shape[j, i] = 1.0
    rows, wanted = [], []
    for place, form in forms:
        vector = system.vector(form.vectors[0])
        scale = np.abs(vector).max()
        rows.append((shapes @ table[:, 2 * n + place]).T / scale)
        wanted.append(vector / scale)
    moved = shapes @ table[:, :n]
    upper = np.triu_indices(n, 1)
    size = np.abs(table[:, :n]).max() or 1.0
    rows.append((moved - moved.transpose(0, 2, 1))[:, upper[0], upper[1]].T / size)
    wanted.append(np.zeros(len(upper[0])))
    equations, right = np.vstack(rows), np.concatenate(wanted)
    found, _, rank, _ = np.linalg.lstsq(equations, right, rcond=1e-12)
    candidate = np.tensordot(found, shapes, axes=1)
    exact = rank == len(basis) and np.abs(equations @ found - right).max() <= SYMMETRIC
    if exact and np.linalg.eigvalsh(candidate).min() > 0.0:
        return candidate
    if known and not strict:
        return mass
    raise ModelError(_NO_GYROSCOPE if strict else _NO_ENERGY)


_NO_ENERGY = (
    "the mass matrix is not symmetric, and there is no symmetric one for which each contact acts along its own "
    "deflection, so that no energy is known; write the equations of motion as forces on the coordinates"
)
_NO_GYROSCOPE = (
    "the damping matrix has gyroscopic terms, but mass and stiffness matrix are not both symmetric, so that no energy "
    "is known that separates them from losses; write the equations of motion as forces on the coordinates, with "
    "symmetric matrices mass and stiffness"
)


def _single(system: System) -> list[tuple[int, ContactForm]]:
    """Return number and form of each contact with one deflection."""
    return [(place, form) for place, form in enumerate(system.structure.contacts) if not form.vectors[1:]]


def _are_reciprocal(system: System) -> bool:
    """Return True if each contact acts along its own deflection."""
    pairs = ((system.vector(form.push), system.vector(form.vectors[0])) for _, form in _single(system))
    return all(np.allclose(push, vector) for push, vector in pairs)


def _potential(system: System, stiffness: Array, mass: Array) -> Array:
    """Return the stiffness matrix without what leaky coordinates of a train add to it."""
    assembly = system.structure.assembly
    if not isinstance(assembly, TrainAssembly):
        return stiffness
    leaks = assembly.numbers(system.values).leaks
    return stiffness - (system.matrix("damping") - mass * leaks) * leaks


def is_symmetric(matrix: Array) -> bool:
    """Return True if a matrix is symmetric but for rounding."""
    return bool(np.abs(matrix - matrix.T).max() <= SYMMETRIC * np.abs(matrix).max())


_DEPENDENT = 1e-9  # share of a constraint below which it depends on others
_RIGID = 1e-6  # share of the highest frequency below which a mode is a motion without stiffness
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


@dataclass(frozen=True)
class ModeState:
    """The stages that are closed, and the friction that sticks, in a linearisation irrespective of the mean load."""

    text: str  #: The state in words.
    #: For each contact the number of its stages that are closed, on the positive side; negative: on the other one.
    closed: tuple[int, ...]
    stuck: bool = False  #: True if dry friction sticks.


@dataclass(frozen=True, eq=False)
class Modes(Shown):
    """Undamped natural vibrations, slowest first.

    Notes
    -----
    The largest entry of a column is 1, of `angles` for a drive train and of `shapes` otherwise. There are as many modes
    as coordinates, less what sticks rigidly or is held.
    """

    #: shape (modes,): Angular natural frequencies; 0 for a motion without stiffness, NaN for one that grows or is not a
    #: vibration.
    frequencies: NDArray[np.float64]
    #: shape (n, modes): A mode in each column, by the coordinates. Complex where gyroscopic terms let coordinates move
    #: one after the other: the motion is the real part of the column times ``exp(i W t)``.
    shapes: NDArray[np.float64] | NDArray[np.complex128]
    #: shape (modes,): Shares of critical damping, of light damping (exact with states without inertia); NaN where the
    #: frequency is 0 or NaN.
    damping_ratios: NDArray[np.float64]
    coordinates: tuple[str, ...]  #: Names of the coordinates.
    inertias: tuple[str, ...]  #: Names of the inertias of a drive train; otherwise empty.
    #: shape (inertias, modes): A mode in each column, by the inertias of a drive train; otherwise empty. A free train's
    #: have no momentum.
    angles: NDArray[np.float64]

    @property
    def numbers(self) -> NDArray[np.int64]:
        """Number of each mode, 1 for the slowest vibration; 0 of a motion without stiffness, or that grows."""
        rates = np.nan_to_num(self.frequencies)
        vibrates = rates > _RIGID * max(float(rates.max(initial=0.0)), np.finfo(float).tiny)
        return np.where(vibrates, np.cumsum(vibrates), 0)

    def __len__(self) -> int:
        return len(self.frequencies)

    def __repr__(self) -> str:
        shown = ", ".join(f"{frequency:.6g}" for frequency in self.frequencies[:6])
        return f"Modes({shown}{', ...' if len(self) > 6 else ''})"


def find_modes(system: System, at: Equilibrium | ModeState | str = Clearances.CLOSED) -> Modes:
    """Compute natural frequencies and modes of a system without losses.

    Gyroscopic terms, the skew part of the damping matrix, lose no energy and are kept. States without inertia join
    springs and dampers in series, which belong to the vibrations: then the modes are those with all losses, and what
    does not vibrate is no mode.

    Parameters
    ----------
    system
        Any system; the modes of a `Train` are also given by its inertias.
    at
        ``"closed"``: with the first stage of every contact closed; ``"open"``: with none; ``"stuck"``: closed, and all
        dry friction sticks, by the spring of a Jenkins element or rigidly; ``"held"``: stuck, and every rigid stop is
        held; all with the slopes of formulas at zero deflection. Dry friction that is not stuck is left out, and rigid
        stops that are not held are open. Or an equilibrium from `find_equilibria`, with the stages that are closed
        there, and the slopes there. Numbers that vary over the angle have their mean value.

    Returns
    -------
    Modes
        Frequencies and shapes, slowest first.

    Raises
    ------
    ModelError
        For any other word, if a formula has no finite value and slope at zero deflection, or if there are gyroscopic
        terms in equations from which no kinetic energy follows.

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
    elif isinstance(at, ModeState):
        closed = [spring.first(count) for spring, count in zip(springs_of(system), at.closed, strict=True)]
        stiffness, damping = tangent(system, closed, stuck=at.stuck)
        if at.stuck:
            left, right = _left_free(system, stops=False)
    else:
        raise ModelError(f"at is {at!r}; it must be an equilibrium, or {did_you_mean(str(at), [*Clearances])}")
    if states_of(system):
        mass, damping, stiffness = (left.T @ each @ right for each in (system.matrix("mass"), damping, stiffness))
        return _damped_modes(system, mass, damping, stiffness, right)
    stiffness, damping = _of_angles(system, stiffness, damping)
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


def _damped_modes(system: System, mass: Array, damping: Array, stiffness: Array, basis: Array) -> Modes:
    """Compute the modes of a system with states without inertia: size and damping ratio of each pair of eigenvalues."""
    assembly, n = system.structure.assembly, len(mass)
    rows = np.linalg.solve(mass, np.hstack((stiffness, damping)))
    found = np.linalg.eig(np.block([[np.zeros((n, n)), np.eye(n)], [-rows]]))
    values, vectors = (each.astype(np.complex128) for each in found)
    ahead = np.flatnonzero(values.imag > _ZERO_RATE * np.abs(values).max(initial=0.0))
    ahead = ahead[np.argsort(np.abs(values[ahead]), kind="stable")]
    values, shapes = values[ahead], basis @ vectors[:n, ahead]
    assert isinstance(assembly, TrainAssembly | PacedMatrices)
    lagging = assembly.lagging(system.values)
    assert lagging is not None
    shapes = shapes + values * (lagging @ shapes)
    names, inertias, angles = assembly.names.coordinates, (), np.zeros((0, len(values)))
    if isinstance(assembly, TrainAssembly):
        names, inertias = system.coordinates, assembly.form.inertias
        angles = assembly.numbers(system.values).angles @ shapes
    sizes = angles if angles.size else shapes
    largest = sizes[np.abs(sizes).argmax(axis=0), range(len(values))]
    frequencies = np.abs(values)
    return Modes(frequencies, shapes / largest, -values.real / frequencies, names, inertias, np.real(angles / largest))


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
    if states_of(system):  # they damp by themselves
        return []
    doubts = []
    damping = _of_angles(system, system.matrix("stiffness"), system.matrix("damping"))[1]
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

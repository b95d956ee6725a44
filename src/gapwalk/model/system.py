"""The system: a frozen value of a structure and named numbers."""

from __future__ import annotations

import math
import os
import reprlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gapwalk.errors import ModelError
from gapwalk.model.bounds import Bounded, Finite
from gapwalk.model.contact import Contact, ContactForm
from gapwalk.model.laws.formula import Expression, is_computed
from gapwalk.model.loads import Load, LoadForm
from gapwalk.model.loads.load import FactorOverSpeed
from gapwalk.model.paced_matrices import GROWING, PacedMatrices
from gapwalk.model.states import LAG, State, carried
from gapwalk.model.structure import JumpTerm, Structure
from gapwalk.model.units import Units
from gapwalk.model.value_checks import checked
from gapwalk.notebook import Shown
from gapwalk.summary import SummaryParts, summarizes

# Damping without its matrix: in proportion to mass and stiffness, or by modal ratios.

_ROUNDING = 1e-10  # relative size of what counts as a rounding error of a matrix or of a square of a frequency


@dataclass(frozen=True, slots=True)
class ProportionalDamping(Bounded):
    """Damping ``C = mass * M + stiffness * K`` (Rayleigh's).

    Raises
    ------
    ModelError
        If `mass` or `stiffness` is not a finite number.

    Examples
    --------
    >>> gw.System(["x"], [[4.0]], damping=gw.ProportionalDamping(0.1, 0.02)).matrix("damping")  # 0.1 M + 0.02 K
    array([[0.18]])
    """

    mass: Finite = 0.0  #: Factor of the mass matrix, in 1/time.
    stiffness: Finite = 0.0  #: Factor of the stiffness matrix, in units of time.

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
    #: modes, so that one number suffices for all modes. Modes without stiffness remain undamped.
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
                    f"the {name} matrix is not symmetric, so modal damping is impossible; write the damping matrix"
                )
        from scipy.linalg import eigh  # slow to import, and not needed to check a file

        try:
            squares, modes = eigh(stiffness, mass)
        except np.linalg.LinAlgError:
            raise ModelError("the mass matrix is not positive definite, so modal damping is impossible") from None
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


class _Parameters(Mapping[str, float]):
    """The parameters of a system by name."""

    def __init__(self, system: System) -> None:
        self._system = system

    def __getitem__(self, name: str) -> float:
        if name not in self._system.structure.names:
            raise KeyError(name)
        return self._system[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._system.structure.names)

    def __len__(self) -> int:
        return len(self._system.structure.names)

    def __repr__(self) -> str:
        return repr(dict(self))


class System(Shown):
    r"""A mechanical system with contacts under periodic excitation.

    .. math:: M q'' + C q' + K q + \sum_k d_k f_k(e_k \cdot q, e_k \cdot q')
              = m + \sum_h F_h \cos(h W t + \phi_h)

    A system never changes; `at` gives another one with other values. Units are the user's own, as long as
    they are consistent (or non-dimensional, as in the paper's section 2).

    Parameters
    ----------
    coordinates
        Names of the n degrees of freedom.
    stiffness, damping, mass : array_like or sparse, shape (n, n)
        The matrices K, C and M; mass is the identity by default, damping zero. The damping may be given otherwise:
        `ProportionalDamping`, or `ModalDamping` by its ratios.
    contacts
        The contacts, any number.
    mean
        The constant load by coordinate name.
    harmonics
        The terms of the periodic excitation, or loads of other kinds that repeat with it.
    frequency
        The fundamental frequency W (angular), > 0.
    gyroscopic, centrifugal : array_like or sparse, shape (n, n)
        Matrices G and H of a rotor that turns at the speed W: ``W G`` is added to the damping, ``W**2 H`` to the
        stiffness. A force by a formula may contain W, too.
    over_speed
        Factors of other numbers that depend on the frequency, by their names: ``{"brake.limit": "1 + 0.1*W"}``.
    states
        States without inertia. A coordinate whose row and column of the mass matrix are zero is such a state, too; its
        equation is of first order, by its damping.

    Raises
    ------
    ModelError
        With everything that is wrong, one reason a line.

    Examples
    --------
    >>> mass = gw.System(["x"], mass=[2.0], damping=[0.1], stiffness=[8.0], harmonics=[gw.Harmonic(0.5, {"x": 1.0})])
    >>> mass.at({"harmonic1.amplitude": 1.0}, frequency=1.5).frequency
    1.5
    """

    # numbers that other systems may share, and its own by place; the first is for `coefficients_of`
    __slots__ = ("_coefficients", "_equations", "_own", "_shared", "structure")
    structure: Structure
    _shared: NDArray[np.float64]
    _own: dict[int, float]

    def __init__(
        self,
        coordinates: Sequence[str],
        stiffness: ArrayLike,
        damping: ArrayLike | Damping | None = None,
        mass: ArrayLike | None = None,
        contacts: Sequence[Contact] = (),
        mean: Mapping[str, float] | None = None,
        harmonics: Sequence[Load] = (),
        frequency: float = 1.0,
        *,
        gyroscopic: ArrayLike | None = None,
        centrifugal: ArrayLike | None = None,
        over_speed: Mapping[str, str] | None = None,
        states: Sequence[State] = (),
    ) -> None:
        names, n = (*coordinates, *(state.name for state in states)), len(coordinates)
        problems: list[str] = []
        contacts = [part for each in contacts for part in (each if isinstance(each, tuple) else (each,))]
        for state in states:
            try:
                made = state.contacts(names)
            except ModelError as error:
                problems.append(str(error))
            else:
                contacts += made
        problems += _name_problems(names, contacts, harmonics)
        pressing = {each.law.host for each in contacts if each.law.is_dry}
        contacts = [
            replace(each, law=replace(each.law, is_limit=True))
            if each.name in pressing and isinstance(each.law, Expression)
            else each
            for each in contacts
        ]
        copies = {name: own for each in contacts for name, own in each.shares.items()}
        law = damping if isinstance(damping, ProportionalDamping | ModalDamping) else None
        matrices = {
            what: _matrix(what, given, n, default, problems)
            for what, given, default in (
                ("mass", mass, np.eye(n)),
                ("damping", None if law else damping, np.zeros((n, n))),
                ("stiffness", stiffness, np.zeros((n, n))),
            )
        }
        if law and not problems and all(np.isfinite(matrix).all() for matrix in matrices.values()):
            try:
                matrices["damping"] = law.matrix(matrices["mass"], matrices["stiffness"])
            except ModelError as error:
                problems.append(f"damping: {error}")
        given_growing = {"gyroscopic": gyroscopic, "centrifugal": centrifugal}
        growing = tuple(name for name, given in given_growing.items() if given is not None)
        matrices |= {name: _matrix(name, given_growing[name], n, np.zeros((n, n)), problems) for name in growing}
        matrices = {what: np.pad(matrix, (0, len(states))) for what, matrix in matrices.items()}
        matrices["damping"][range(n, len(names)), range(n, len(names))] = 1.0  # z' of each state, in its equation
        parts: dict[str, Any] = {"frequency": [frequency], **matrices}
        parts["mean"] = _vector("mean", mean or {}, names, problems)
        for load, form in zip(harmonics, map(LoadForm.of, harmonics), strict=True):
            parts |= {name: [value] for name, value in zip(form.parameters, load.values(), strict=True)}
            if not load.varies:
                parts[form.shape] = _vector(form.shape, load.acts_on, names, problems)
        for contact, form in zip(contacts, map(ContactForm.of, contacts), strict=True):
            vectors = dict(zip(form.vectors, contact.vectors, strict=True))
            vectors |= {} if contact.force is None else {form.push: contact.force}
            found: dict[str, Any] = {name: _vector(name, given, names, problems) for name, given in vectors.items()}
            numbers = zip(form.parameters, contact.values(), strict=True)
            found |= {name: [value] for name, value in numbers if value is not None}  # the others follow from W
            parts |= {copies.get(name, name): given for name, given in found.items()}
        if problems:
            raise ModelError("\n".join(problems))
        at_rest = ~(matrices["mass"].any(axis=0) | matrices["mass"].any(axis=1))
        massless = tuple(np.flatnonzero(at_rest).tolist())
        slow = {names[place] for place in massless}
        contacts, harmonics, copies = carried(slow, contacts, harmonics, copies)
        forms = tuple(map(ContactForm.of, contacts))
        inner = tuple(f"{name}{LAG}" if name in slow else name for name in names)
        structure = Structure(inner, forms, tuple(map(LoadForm.of, harmonics)))
        factors = tuple((name, FactorOverSpeed(text)) for name, text in (over_speed or {}).items())
        if slow or growing or factors or copies or any(is_computed(name) for form in forms for name in form.parameters):
            lag = 1.0 / frequency if slow and frequency > 0.0 else 0.0
            assembly = PacedMatrices(structure, growing, factors, massless, lag, len(states), tuple(copies.items()))
            structure = replace(structure, assembly=assembly)
        for name, _ in factors:
            structure.place(name)  # refuses what there is not
        _ = structure.variations  # refuses what there is not
        values = [np.ravel(np.asarray(parts[block.prefix], dtype=float)) for block in structure.names.blocks]
        self._set(structure, checked(structure, np.concatenate(values)))

    def at(self, changes: Mapping[str, float | str] | None = None, **more: float | str) -> System:
        """Return the system with other parameter values.

        Parameters
        ----------
        changes
            New values by parameter name, for example ``{"stage2.clearance": 0.5}``. In a system with units a number is
            in the unit of its parameter, and a text has its own: ``{"clutch.clearance": "2 deg"}``.
        **more
            The same, for names without a dot: ``system.at(frequency=0.5)``.
        """
        values = self.values.copy()
        for name, value in {**(changes or {}), **more}.items():
            place = self.structure.place(name)
            if self.units and isinstance(value, str):
                try:
                    value = self.units.read(name, value)
                except ValueError as error:
                    raise ModelError(f"{name} {error}") from None
            if isinstance(value, bool) or not isinstance(value, int | float | np.floating | np.integer):
                raise ModelError(f"{name} is {value!r}; it must be a number")
            try:
                values[place] = value
            except OverflowError:
                raise ModelError(f"{name} is an integer of too many digits; it must be below 1.8e308") from None
        return System.from_values(self.structure, checked(self.structure, values))

    @classmethod
    def from_values(cls, structure: Structure, values: ArrayLike) -> System:
        """Make a system from its structure and its flat vector of values, in the order of `structure.names`.

        It uses the vector without a copy or a check, and makes it read-only: for values that are known to be valid.
        """
        system = object.__new__(cls)
        system._set(structure, np.asarray(values, dtype=float))
        return system

    @classmethod
    def beside(cls, other: System, place: int, value: float) -> System:
        """Make a system that differs from another one by the value at one place, which is not checked.

        It uses the values of the other one, without a copy, until `values` is read.

        Parameters
        ----------
        other
            The other system.
        place
            Index of the parameter in `values`.
        value
            Its new value.
        """
        system = object.__new__(cls)
        system._set(other.structure, other.values, {place: float(value)})
        return system

    @property
    def values(self) -> NDArray[np.float64]:
        """The values of all parameters, in the order of `structure.names`; read-only."""
        if self._own:
            values = self._shared.copy()
            values[[*self._own]] = [*self._own.values()]
            self._set(self.structure, values)
        return self._shared

    @property
    def shared(self) -> tuple[NDArray[np.float64], dict[int, float]]:
        """Values that other systems may share, and its own values by place, which replace them (`beside`)."""
        return self._shared, self._own

    def _at(self, place: int) -> float:
        """Return the value at one place."""
        return self._own[place] if place in self._own else float(self._shared[place])

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Names of the degrees of freedom."""
        return self.structure.coordinates

    @property
    def size(self) -> int:
        """Number n of degrees of freedom."""
        return self.structure.size

    @property
    def state_size(self) -> int:
        """Size of a state: n positions, n velocities, and the state of each contact with a memory."""
        return self.structure.state_size

    @property
    def state_names(self) -> tuple[str, ...]:
        """Names of the entries of a state: ``q1``, its rate ``q1'``, and ``brake.extension`` of a contact."""
        return self.structure.state_names

    def state_scales(self, length: float = 1.0, frequency: float | None = None) -> NDArray[np.float64]:
        """Return the size of each entry of a state in a motion of a given size, shape (state_size,).

        A velocity counts as `length` times a frequency, by default the frequency W of the excitation. The extension of
        a contact is a length.

        Parameters
        ----------
        length
            The length, in the unit of the coordinates.
        frequency
            Angular frequency, in rad per unit of time.

        Returns
        -------
        array, shape (state_size,)
            In the units of the state.
        """
        scales = np.full(self.state_size, float(length))
        scales[self.size : 2 * self.size] *= self.frequency if frequency is None else frequency
        return scales

    @property
    def frequency(self) -> float:
        """The fundamental angular frequency W of the excitation, irrespective of the unit of the first parameter."""
        return self._at(0) * self.structure.frequency

    @property
    def turns(self) -> int | Fraction | None:
        """Periods of the excitation in one turn of the shaft whose speed is the first parameter; a fraction for some.

        Orders are then counted per turn of that shaft. None where the first parameter is the frequency W of the
        excitation: there orders are multiples of W.
        """
        return None if self.units is None else self.units.turns

    @property
    def units(self) -> Units | None:
        """The units of its parameters; None if they are plain numbers.

        With units, coordinates are in the unit of its angles, contact forces in N m, and time in s.
        """
        return self.structure.units

    @property
    def parameters(self) -> Mapping[str, float]:
        """Every parameter with its value."""
        return _Parameters(self)

    @property
    def equations(self) -> System:
        """The equations of motion as a system: of a drive train a system of its own, otherwise the system itself."""
        if self.structure.assembly is None:
            return self
        try:
            return self._equations
        except AttributeError:
            values = self.structure.expand(self.values)
            object.__setattr__(self, "_equations", System.from_values(self.structure.equations, values))
            return self._equations

    def __getitem__(self, name: str) -> float:
        """Return the value of one parameter."""
        return self._at(self.structure.place(name))

    @property
    def breakpoints(self) -> list[tuple[int, int, float]]:
        """Number of the contact, side (1 or -1) and clearance of each switch of the flow (a stage on one side)."""
        found = zip(self.structure.breakpoints, self.structure.clearance_sizes, strict=True)
        return [(contact, side, self._at(place) * size) for (contact, side, place), size in found]

    @property
    def gapless(self) -> tuple[bool, ...]:
        """True for each switch whose stage acts on both sides without a gap, and without a jump of the force."""
        return tuple(
            [
                paired and self._at(place) == 0.0 and not (jump and self._jump(jump))
                for place, paired, jump in self.structure.two_sided
            ]
        )

    def _jump(self, terms: tuple[JumpTerm, ...]) -> float:
        return sum(term.factor * math.prod(map(self._at, term.places)) for term in terms)

    def matrix(self, which: str) -> NDArray[np.float64]:
        """Return the ``"mass"``, ``"damping"`` or ``"stiffness"`` matrix, shape (n, n).

        Returns
        -------
        array, shape (n, n)
            The matrix.
        """
        system, n = self.equations, self.size
        start = system.structure.names.start(which)
        return system.values[start : start + n * n].reshape(n, n).copy()

    def vector(self, which: str) -> NDArray[np.float64]:
        """Return the vector ``"mean"``, ``"stage2.deflection"``, ``"harmonic1.acts_on"`` and so on, shape (n,).

        Returns
        -------
        array, shape (n,)
            One entry for each coordinate.
        """
        system, start = self.equations, self.equations.structure.names.start(which)
        return system.values[start : start + self.size].copy()

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, System):
            return NotImplemented
        return self.structure == other.structure and np.array_equal(self.values, other.values)

    def __hash__(self) -> int:
        return hash((self.structure, self.values.tobytes()))

    @summarizes
    def summary(self) -> SummaryParts:
        """Return the frequency or speed, then coordinates, contacts, excitation and units in words."""
        yield f"{self.structure.pace} = {pace_number(self, 6)}"
        yield from self.contents

    @property
    def contents(self) -> Iterator[str]:
        """Coordinates, contacts with their laws, excitation with its orders, and units, a line each."""
        contacts = (
            f"{form.name} ({f'{len(form.stages)} stages, ' if len(form.stages) > 1 else ''}{form.law.title})"
            for form in self.structure.contacts
        )
        loads = [
            (_load_words(form, self.turns or 1), [name for name, _ in form.varies]) for form in self.structure.harmonics
        ]
        varying = [f"{' and '.join(names)} by {load}" for load, names in loads if names]
        yield f"coordinates: {', '.join(self.coordinates)}"
        yield f"contacts: {', '.join(contacts) or 'none'}"
        yield f"excitation: {', '.join(load for load, names in loads if not names) or 'none'}"
        if varying:
            yield f"varying: {', '.join(varying)}"
        if self.units:
            yield f"units: {self.units.words}"

    def __repr__(self) -> str:
        contacts = ", ".join(contact.name for contact in self.structure.contacts) or "none"
        pace = f"{self.structure.pace}={pace_number(self, 6)}"
        return f"System(coordinates={', '.join(self.coordinates)}; contacts={contacts}; {pace})"

    def __setattr__(self, name: str, value: object) -> None:
        raise AttributeError(f"a System never changes; write system.at({{{name!r}: ...}}) for another one")

    def __reduce__(self):
        return System.from_values, (self.structure, self.values)

    def _set(self, structure: Structure, values: NDArray[np.float64], own: dict[int, float] | None = None) -> None:
        values.flags.writeable = False
        for name, value in (("structure", structure), ("_shared", values), ("_own", own or {})):
            object.__setattr__(self, name, value)


def _load_words(form: LoadForm, turns: int | Fraction) -> str:
    """Describe a load by its name and its order, or by what its kind says of it."""
    notes = [form.kind.notes(dict(form.constants)), form.factor.words if form.factor else ""]
    order = f" of order {form.order * turns}" if form.kind.is_periodic and not notes[0] else ""
    text = "; ".join(filter(None, notes))
    return f"{form.name}{order}{f' ({text})' if text else ''}"


def pace_number(system: System, digits: int = 8) -> str:
    """Write the first parameter of a system with its unit, as it was given: ``0.5``, or ``902 rpm``."""
    structure = system.structure
    unit = "" if structure.units is None else structure.units.parameter(structure.pace)
    return f"{system[structure.pace]:.{digits}g} {unit}".rstrip()


def pace_text(system: System, digits: int = 8) -> str:
    """Write the first parameter with its name and unit: ``frequency 0.5``, or ``speed 902 rpm``."""
    return f"{system.structure.pace} {pace_number(system, digits)}"


def check_system(value: object, call: str) -> None:
    """Refuse an argument that is not a system, and explain how to make one."""
    if isinstance(value, System):
        return
    if isinstance(value, str | os.PathLike):
        hint = f"read the file first: gw.read_model({os.fspath(value)!r})"
    elif callable(getattr(value, "system", None)):
        hint = "write its system()"
    elif isinstance(getattr(value, "system", None), System):
        hint = "write its .system"
    else:
        hint = 'make one with gw.System(...), or read one: gw.read_study("model.toml").system'
    raise ModelError(f"{call} takes a System, not {reprlib.repr(value)}; {hint}")


def _matrix(what: str, given, n: int, default, problems: list[str]) -> NDArray[np.float64]:
    if given is None:
        return default
    try:
        # of sparse matrices by what they can do: their package takes a tenth of a second to import
        matrix = np.asarray(given.toarray() if hasattr(given, "toarray") else given, dtype=float)
    except (TypeError, ValueError):
        problems.append(f"{what} is {given!r}; it must be a matrix of {n} x {n} numbers")
        return default
    if matrix.shape == (n,):  # as in a model file
        return np.diag(matrix)
    if matrix.shape != (n, n):
        shapes = f"({n}, {n}), a row per coordinate, or ({n},), its diagonal"
        problems.append(f"{what} has shape {matrix.shape}; it must be {shapes}")
        return default
    return matrix


def _vector(what: str, given: Mapping[str, float], names: tuple[str, ...], problems: list[str]):
    vector = np.zeros(len(names))
    for name, value in given.items():
        if name not in names:
            problems.append(f"{what} names {name!r}, which is no coordinate; they are {', '.join(names)}")
        else:
            vector[names.index(name)] = value
    return vector


def _name_problems(coordinates, contacts, harmonics):
    if not coordinates:
        yield "coordinates is empty; name at least one degree of freedom"
    taken = {"frequency", "mass", "damping", "stiffness", "mean", *GROWING}
    for kind, names in (
        ("coordinate", coordinates),
        ("contact", [contact.name for contact in contacts]),
        ("harmonic", [harmonic.name for harmonic in harmonics]),
    ):
        for index, name in enumerate(names):
            if not isinstance(name, str) or not name.isidentifier():
                yield f"{kind} name {name!r}: write a word of letters, digits and underscores"
            elif name in names[:index]:
                yield f"{kind} name {name!r} is used twice; give one of them another name"
            elif kind != "coordinate" and name in taken:
                yield f"{kind} name {name!r} is taken; choose another name"
        if kind != "coordinate":
            taken.update(names)

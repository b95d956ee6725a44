"""A sampled motion: positions, velocities, accelerations, contact forces and contact events over time.

Motions of a drive train have further signals: accelerations of its inertias, torques in its shafts and gears. The
coordinates of a train are deflections, and its rotation as a whole is left out of the equations of motion. Its
acceleration is known nevertheless, since the torques determine it: the absolute acceleration of every inertia is that
of ``T x + r psi`` with ``r^T J r psi'' = r^T (torques)`` (see `gapwalk.model.drivetrain.train_assembly`). Figure 8 of
the paper shows u3'' of three inertias. Absolute angles and speeds depend on the history of the train and are unknown.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from operator import attrgetter
from typing import Annotated, Any, NamedTuple, overload

import numpy as np
from annotated_types import Ge
from numpy.polynomial.legendre import legder, leggauss, legroots, legval, legvander
from numpy.typing import NDArray

from gapwalk.errors import ModelError
from gapwalk.flow.constraints import Constraint
from gapwalk.flow.contact_events import ContactEvent
from gapwalk.flow.flow import PERIOD, Restarts, flow_of, flow_with
from gapwalk.flow.forces import Angles, Dry, accelerations, balance, contact_deflections, contact_forces
from gapwalk.flow.friction_state import Hold, Kink, SlipEvent
from gapwalk.model.bounds import Finite, Positive, check
from gapwalk.model.coefficients import CoefficientLayout, coefficients_of, layout_of
from gapwalk.model.contact import ContactForm
from gapwalk.model.drivetrain.train_assembly import TrainAssembly
from gapwalk.model.drivetrain.train_parts import Displacing
from gapwalk.model.loads import Line
from gapwalk.model.paced_matrices import PacedMatrices
from gapwalk.model.problems import did_you_mean
from gapwalk.model.structure import Structure
from gapwalk.model.system import System
from gapwalk.notebook import Shown
from gapwalk.summary import Rows, TableRows, Tables, rows_of

# Forces and accelerations along a motion with dry friction and rigid stops, from the modes of the flow.
#
# What sticks rigidly, or is held at a stop, has a force that is no function of the state alone: it follows from the
# constraints of all that are held together (`gapwalk.flow.constraints`). Which are held is in the log of the flow; for
# a state without a log, they are those with which a motion from that state begins.

_MOMENT = 1e-9  # radians over which a motion is begun to learn its modes
_AT = 1e-9  # radians within which an event is at an instant


class DryModes(NamedTuple):
    """Modes of dry friction and of rigid stops, at one instant or at some."""

    #: shape (..., contacts that are friction): 1 or -1 in slip, by its direction; 0 in stick. The order is that of
    #: `Structure.friction`.
    slips: NDArray[np.int8]
    #: shape (..., reactions): True for each reaction of `Structure.reactions` that is held: rigid friction in stick,
    #: and stops.
    held: NDArray[np.bool_]

    def at(self, sample: int) -> DryModes:
        """Return the modes at one of the instants."""
        return DryModes(self.slips[sample], self.held[sample])

    def order(self, structure: Structure) -> list[int]:
        """Return the numbers of the reactions held at one instant: stops first."""
        # Where they depend on each other, friction has no reaction.
        reactions = structure.reactions
        return sorted(np.flatnonzero(self.held).tolist(), key=lambda each: (reactions[each][1] < 0, each))


def is_dry(structure: Structure) -> bool:
    """Return True if a system has dry friction or rigid stops, whose forces depend on modes of the flow."""
    return bool(structure.memories or structure.reactions)


def modes_along(
    structure: Structure,
    theta: NDArray[np.float64],
    slips: Sequence[SlipEvent],
    holds: Sequence[Hold],
    *,
    before: bool = False,
) -> DryModes:
    """Return the modes at some angles of a motion, from its logs."""
    edges = theta - _AT if before else np.maximum(theta, min((hold.theta for hold in holds), default=-np.inf))
    found = np.zeros((len(theta), len(structure.friction)), dtype=np.int8)
    for place, contact in enumerate(structure.friction):
        own = [event for event in slips if event.contact == contact]
        if own:
            found[:, place] = np.array([event.slip for event in own])[_latest([event.theta for event in own], edges)]
    if not structure.reactions:
        return DryModes(found, np.zeros((len(theta), 0), dtype=bool))
    patterns = np.zeros((len(holds), len(structure.reactions)), dtype=bool)
    for row, hold in zip(patterns, holds, strict=True):
        row[list(hold.reactions)] = True
    return DryModes(found, patterns[_latest([hold.theta for hold in holds], edges)])


def _latest(times: Sequence[float], theta: NDArray[np.float64]) -> NDArray[np.intp]:
    """Return for each angle the index of the last of some increasing times that is not after it; -1 before all."""
    return np.searchsorted(np.array(times), theta, side="right") - 1


def modes_at(
    layout: CoefficientLayout,
    coefficients: NDArray[np.float64],
    theta: NDArray[np.float64],
    states: NDArray[np.float64],
) -> DryModes:
    """Return the modes with which motions begin in some states, shape (samples, state_size)."""
    structure, flow, rows = layout.structure, flow_with(layout, coefficients), []
    for angle, state in zip(theta.tolist(), states, strict=True):
        begun = flow.sample(coefficients, state, np.array([angle, angle + _MOMENT]))
        rows.append(modes_along(structure, np.array([angle]), begun.slips, begun.holds))
    slips = np.array([row.slips[0] for row in rows]).reshape(len(rows), len(structure.friction))
    return DryModes(slips, np.array([row.held[0] for row in rows]).reshape(len(rows), len(structure.reactions)))


def acceleration_at(
    layout: CoefficientLayout, coefficients: NDArray[np.float64], theta: float, state: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the acceleration in one state, with the modes with which a motion begins there, shape (n,)."""
    n = layout.structure.size
    if not is_dry(layout.structure):
        return accelerations(layout, coefficients, theta, state[:n], state[n : 2 * n])
    angle, states = np.array([theta]), state[None]
    modes, (q, v, z) = modes_at(layout, coefficients, angle, states), np.split(states, (n, 2 * n), axis=1)
    return forces_and_accelerations(layout, coefficients, angle, q, v, z, modes)[1][0]


def forces_and_accelerations(
    layout: CoefficientLayout,
    coefficients: NDArray,
    theta: NDArray,
    q: NDArray,
    v: NDArray,
    z: NDArray,
    modes: DryModes | None,
) -> tuple[NDArray, NDArray]:
    """Compute the forces of all contacts, reactions included, and the accelerations; real or complex."""
    # Shapes: `theta` (samples,); `q`, `v` (samples, n); `z` (samples, memories).
    angles = Angles(layout, coefficients, theta)
    if modes is None:
        forces = contact_forces(layout, coefficients, theta, q, v, angles=angles)
        return forces, accelerations(layout, coefficients, theta, q, v)
    forces = contact_forces(layout, coefficients, theta, q, v, angles=angles, dry=Dry(modes.slips.astype(float), z))
    turning, total = np.zeros_like(forces, shape=q.shape), forces.copy()
    patterns, which = np.unique(modes.held, axis=0, return_inverse=True)
    for number, pattern in enumerate(patterns):
        rows = np.flatnonzero(which.ravel() == number)
        moved = q[rows], v[rows], forces[rows], angles.waves[rows]
        constraint = Constraint(layout, coefficients, DryModes(modes.slips[rows[0]], pattern).order(layout.structure))
        held = constraint.coefficients()
        turning[rows] = balance(held[layout.accelerations], *moved)
        found = balance(held[layout.reactions[constraint.independent]], *moved)
        for contact, reaction in zip(constraint.contacts, found.T, strict=True):
            total[rows, contact] += reaction
    return total, turning


@dataclass(frozen=True, eq=False)
class Motion(Shown):
    """A motion of `system`, sampled at `theta` and exact at each sample."""

    system: System  #: The system that moves.
    theta: NDArray[np.float64]  #: shape (samples,): Angle of the fundamental excitation, ``W t``, in radians.
    #: q, v: shape (samples, n): Positions and velocities (over time).
    q: NDArray[np.float64]
    v: NDArray[np.float64]
    events: tuple[ContactEvent, ...]  #: The crossings of breakpoints, in order.
    #: shape (samples, memories): Extensions of the contacts with a state of their own, in the order of
    #: `Structure.memories`; by default zero.
    z: NDArray[np.float64] = field(default_factory=lambda: np.empty((0, 0)))
    slips: tuple[SlipEvent, ...] = ()  #: The modes of dry friction at the first sample, then their changes, in order.
    #: What sticks rigidly, or is held at a stop, at the first sample; then its changes, in order. Without them, the
    #: modes at each sample are those with which a motion begins there.
    holds: tuple[Hold, ...] = ()
    impacts: tuple[Kink, ...] = ()  #: The impacts on rigid stops, in order, with the velocities before and after.

    def __post_init__(self) -> None:
        if not self.z.size:
            object.__setattr__(self, "z", np.zeros((len(self.theta), len(self.system.structure.memories))))

    @classmethod
    def of(
        cls,
        system: System,
        theta: NDArray[np.float64],
        states: NDArray[np.float64],
        events: Iterable[ContactEvent] = (),
        slips: Iterable[SlipEvent] = (),
        holds: Iterable[Hold] = (),
        impacts: Iterable[Kink] = (),
    ) -> Motion:
        """Make a motion from its states, shape (samples, state_size), and its logs."""
        # Shapes: `theta` (samples,); `states` (samples, state_size).
        q, v, z = np.split(states, (system.size, 2 * system.size), axis=1)
        return cls(system, theta, q, v, tuple(events), z, tuple(slips), tuple(holds), tuple(impacts))

    @property
    def states(self) -> NDArray[np.float64]:
        """Positions, velocities and extensions, shape (samples, state_size)."""
        return np.hstack((self.q, self.v, self.z))

    @property
    def time(self) -> NDArray[np.float64]:
        """Time of each sample, shape (samples,)."""
        return self.theta / self.system.frequency

    @cached_property
    def a(self) -> NDArray[np.float64]:
        """Accelerations, shape (samples, n)."""
        return self._dynamics[1]

    @cached_property
    def forces(self) -> NDArray[np.float64]:
        """Contact forces ``f_k``, shape (samples, contacts); reactions of what sticks or is held are among them."""
        return self._dynamics[0]

    @cached_property
    def _dynamics(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        structure, modes = self.system.structure, None
        if structure.reactions:
            modes = self.modes
        elif is_dry(structure):  # extensions alone determine the forces
            count = len(self.theta)
            modes = DryModes(np.zeros((count, len(structure.friction)), np.int8), np.zeros((count, 0), bool))
        moved = self.theta, self.q, self.v, self.z
        return forces_and_accelerations(layout_of(structure), self._coefficients, *moved, modes)

    @cached_property
    def modes(self) -> DryModes:
        """Modes of dry friction, and of rigid stops, at each sample."""
        if self.holds:
            return modes_along(self.system.structure, self.theta, self.slips, self.holds)
        return modes_at(layout_of(self.system.structure), self._coefficients, self.theta, self.states)

    @cached_property
    def rates(self) -> NDArray[np.float64]:
        """Derivatives of the states over time, shape (samples, state_size); extensions follow while friction sticks."""
        structure, layout, numbers = self.system.structure, layout_of(self.system.structure), self._coefficients
        extending, friction = np.zeros_like(self.z), structure.friction
        for place, contact in enumerate(structure.memories):
            slots = layout.contacts[contact]
            rate = self.v @ numbers[slots.deflection] - numbers[slots.numbers["speed"]]
            rate = rate + Angles(layout, numbers, self.theta).sway(slots, 0, 1)
            extending[:, place] = rate * (self.slip[:, friction.index(contact)] == 0.0)
        return np.hstack((self.v, self.a, extending))

    @property
    def slip(self) -> NDArray[np.float64]:
        """Modes of dry friction, shape (samples, contacts that are friction): 1 or -1 in slip, 0 in stick."""
        return self.modes.slips.astype(float)

    @cached_property
    def deflections(self) -> NDArray[np.float64]:
        """Contact deflections ``e_k^T q``, shape (samples, contacts)."""
        return contact_deflections(layout_of(self.system.structure), self._coefficients, self.theta, self.q)

    def deflection_rate(self, contact: int) -> NDArray[np.float64]:
        """Return the rate of the deflection of a contact."""
        slots = layout_of(self.system.structure).contacts[contact]
        sway = Angles(layout_of(self.system.structure), self._coefficients, self.theta).sway(slots, 0, 1)
        return self.v @ self._coefficients[slots.deflection] + sway

    @cached_property
    def contacts(self) -> tuple[ContactRecord, ...]:
        """The contact log: which stage closed or opened, when, on which side, and how fast."""
        switches = switch_names(self.system)
        return tuple(
            ContactRecord(
                event.theta, event.theta / self.system.frequency, *switches[event.switch], event.enters, event.velocity
            )
            for event in self.events
        )

    def signal(self, name: str) -> NDArray[np.float64]:
        """Return one time history by name, shape (samples,)."""
        place, size, structure = signal_place(self.system, name), self.system.size, self.system.structure
        widths = {"q": size, "v": size, "a": size, "forces": len(structure.contacts), "z": len(structure.memories)}
        widths["slip"] = len(structure.friction)
        for kind, width in widths.items():  # only what is asked for is computed
            if place < width:
                return getattr(self, kind)[:, place] * signal_factor(self.system, name)
            place -= width
        return self._of_train[:, place] * signal_factor(self.system, name)

    def tables(self) -> Tables:
        """Return the tables of all signals over the angle, and of the contact log."""
        return {"signals": TableRows(self._signal_rows, 1), "contacts": lambda: rows_of(map(asdict, self.contacts))}

    def _signal_rows(self) -> Rows:
        names = signal_names(self.system)
        columns = [self.theta, self.time, *map(self.signal, names)]
        yield ["theta", "time", *names]
        yield from np.column_stack(columns).tolist()

    def impulses(self, name: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the impulses of a signal where rigid stops strike, which `signal` leaves out."""
        # An acceleration or a force is infinite there for no time; its integral is that of the jump of velocities.
        place, structure, size = signal_place(self.system, name), self.system.structure, self.system.size
        theta = np.array([impact.theta for impact in self.impacts])
        jumps = np.array([after - before for before, after in (impact.velocities for impact in self.impacts)])
        jumps = jumps.reshape(len(theta), size)
        layout, forces = layout_of(structure), np.zeros((len(theta), len(structure.contacts)))
        stops = [index for index, contact in enumerate(structure.contacts) if contact.law.rebounds]
        if stops:  # M times the jump of velocities is the sum of the impulses, each along its vector
            pushes = np.array([self._coefficients[layout.contacts[index].force] for index in stops])
            forces[:, stops] = -np.linalg.lstsq(pushes.T, jumps.T, rcond=None)[0].T
        rest = np.zeros_like(jumps)
        columns = [rest, rest, jumps, forces, *(np.zeros((len(theta), 1)),) * (structure.state_size - 2 * size)]
        columns += [np.zeros((len(theta), len(structure.friction)))]
        if assembled_signals(structure):
            still = assembled_histories(self.system, theta, rest, rest, rest, np.zeros_like(forces))
            columns.append(assembled_histories(self.system, theta, rest, rest, jumps, forces) - still)
        sizes = self.system.frequency * np.hstack(columns)[:, place] * signal_factor(self.system, name)
        return theta[sizes != 0.0], sizes[sizes != 0.0]

    @cached_property
    def _of_train(self) -> NDArray[np.float64]:
        return assembled_histories(self.system, self.theta, self.q, self.v, self.a, self.forces)

    @cached_property
    def _coefficients(self) -> NDArray[np.float64]:
        return coefficients_of(self.system)


@dataclass(frozen=True)
class ContactRecord:
    """One entry of the contact log, with the names of the model."""

    #: theta, time: Instant of the event: in radians of the fundamental excitation, and in units of time.
    theta: float
    time: float
    #: contact, stage, side: Name of the contact, name of the stage ("" if there is only one), +1 or -1.
    contact: str
    stage: str
    side: int
    closes: bool  #: True where the stage closes, False where it opens.
    velocity: float  #: Rate of the deflection over time; where the stage closes, its size is the approach velocity.


@overload
def integrate(
    system: System, start: NDArray[np.float64], periods: float = 1.0, samples: int = 256, phase: float = 0.0
) -> Motion: ...


@overload
def integrate(
    system: System, start: Sequence[NDArray[np.float64]], periods: float = 1.0, samples: int = 256, phase: float = 0.0
) -> tuple[Motion, ...]: ...


def integrate(
    system: System, start: Any, periods: float = 1.0, samples: int = 256, phase: float = 0.0
) -> Motion | tuple[Motion, ...]:
    """Integrate a system from a state, and sample the motion.

    Parameters
    ----------
    system
        The system.
    start : shape (state_size,)
        Positions, velocities and extensions at `phase`; extensions that are left out are zero. Or a list of such
        states, for an ensemble: ``list(states)`` for an array with one row for each.
    periods
        Length in forcing periods, > 0: forwards in time.
    samples
        Samples per forcing period.
    phase
        Angle of the fundamental excitation at the start, in radians.

    Returns
    -------
    Motion
        The motion, with its contact events; of a list of states a tuple with the motion of each.

    Raises
    ------
    FlowError
        If the motion diverges or chatters without end.
    ModelError
        If the state has the wrong length, or `periods` or `samples` are not positive.

    Notes
    -----
    Taylor series with events located to rounding, as in Biscani and Izzo (2021, 2022), Monthly Notices of the Royal
    Astronomical Society.

    Examples
    --------
    >>> motion = gw.integrate(system, np.array([0.0, 2.0]), periods=0.5)
    >>> [(event.enters, round(event.theta, 6)) for event in motion.events]
    [(True, 0.301576), (False, 0.695754)]
    """
    check("periods", periods, Positive)
    check("samples", samples, Annotated[float, Ge(1)])
    if isinstance(start, list | tuple) and start and np.ndim(start[0]) == 1:
        return tuple(integrate(system, each, periods, samples, phase) for each in start)
    count = max(1, round(samples * periods))
    return sample(system, np.asarray(start), phase + PERIOD * periods * np.arange(count + 1) / count)


def sample(system: System, state: NDArray[np.float64], theta: NDArray[np.float64], restarts: Restarts = ()) -> Motion:
    """Sample the motion from a state at ``theta[0]`` at the increasing angles `theta`; see `Flow.sample`."""
    initial = check_state(system, state)
    found = flow_of(system).sample(coefficients_of(system), initial, theta, restarts)
    return Motion.of(system, theta, found.states, *found.logs)


def check_state(system: System, state) -> NDArray[np.float64]:
    """Return the state, or that of an orbit, as an array of finite numbers, with extensions of zero if it has none."""
    try:
        array = np.asarray(getattr(state, "state", state), dtype=float)
    except (TypeError, ValueError):
        array = np.array([np.nan])
    size, count = system.state_size, 2 * system.size
    if array.shape not in {(size,), (count,)} or not np.all(np.isfinite(array)):
        order = f"{size} finite numbers ({', '.join(system.state_names)})"
        without = f"; the first {count} are enough if the others are 0" if size > count else ""
        raise ModelError(f"a state of this system is {order}, not {state!r}{without}")
    return np.append(array, np.zeros(size - len(array)))


def switch_names(system: System) -> list[tuple[str, str, int]]:
    """Return contact, stage and side of each switch of the system's flow, in their order."""
    contacts = system.structure.contacts
    return [(contact.name, stage.name, sign) for contact in contacts for stage, sign in contact.sides]


def signal_place(system: System, name: str) -> int:
    """Return the place of a signal in `signal_names`."""
    # The name of a contact is short for its force, unless a coordinate has that name. In a drive train it is not short
    # for the force, because a link's name is that of its deflection.
    known = signal_names(system)
    if name in known:
        return known.index(name)
    is_train = isinstance(system.structure.assembly, TrainAssembly)
    forces = {} if is_train else {form.name: form for form in system.structure.contacts}
    if name not in forces:
        raise ModelError(f"there is no signal {name!r}; {did_you_mean(str(name), known, 'signals are')}")
    return known.index(force_of(forces[name]))


def signal_names(system: System) -> list[str]:
    """Return the names of all signals of a motion of `system`."""
    derivatives = [name + dash for dash in ("", "'", "''") for name in system.coordinates]
    structure, extensions = system.structure, system.state_names[2 * system.size :]
    modes = [f"{structure.contacts[index].name}.slip" for index in structure.friction]
    return [*derivatives, *map(force_of, structure.contacts), *extensions, *modes, *assembled_signals(structure)]


def force_of(contact: ContactForm) -> str:
    """Return the name of the signal that is the force of a contact."""
    return f"{contact.name}.force"


def assembled_signals(structure: Structure) -> list[str]:
    """Return names of signals that an assembly makes: of a drive train, or of states without inertia.

    Of a state ``z`` they are ``z`` and its rate ``z'``: another coordinate carries it. Of a train they are ``box''`` of
    an inertia, ``clutch.torque`` of a link, ``bearing.speed`` of one that slips as the train turns (its whole slip),
    and ``box.angle``, ``box.speed``, ``box.acceleration``: those of an inertia beside the rotation at the mean speed.
    """
    assembly = structure.assembly
    if isinstance(assembly, PacedMatrices):
        return [f"{name}{dash}" for dash in ("", "'") for name in assembly.states]
    if not isinstance(assembly, TrainAssembly):
        return []
    form = assembly.form
    links = [f"{link.name}.torque" for link in form.links if not link.rigid]
    slips = [f"{form.links[number].name}.speed" for number in form.turning]
    quick = [name for name in form.inertias if name not in form.slow]  # of others no acceleration is known
    of_inertias = [f"{name}.{what}" for what in ("angle", "speed") for name in form.inertias]
    of_inertias += [f"{name}.acceleration" for name in quick]
    return [*(f"{name}''" for name in quick), *links, *slips, *of_inertias]


def acceleration_names(system: System) -> list[str]:
    """Return the names of the accelerations: of the inertias of a train, otherwise of the coordinates."""
    assembly = system.structure.assembly
    if isinstance(assembly, TrainAssembly):
        return [f"{name}.acceleration" for name in assembly.form.inertias if name not in assembly.form.slow]
    return [f"{name}''" for name in system.coordinates]


def accelerations_at(system: System, contact: str) -> list[str]:
    """Return the names of the accelerations of the parts that a contact meets."""
    assembly = system.structure.assembly
    if isinstance(assembly, TrainAssembly):
        link = next(link for link in assembly.form.links if f"{contact}.".startswith(f"{link.name}."))
        inertias = assembly.form.inertias
        # the part that can fly is held by fewer links without a gap than the one that it meets, else by fewer links
        links = [each for each in assembly.form.links if not each.drag]
        tight = [each for each in links if each.always or (each.rigid and not each.contact)]
        held = {end: [sum(end in each.ends for each in some) for some in (tight, links)] for end in link.ends}
        ends = {inertias[end] for end in link.ends if end < len(inertias) and held[end] == min(held.values())}
        known = acceleration_names(system)
        return [name for name in known if name.rpartition(".")[0] in ends] or known
    vector = system.vector(next(each for each in system.structure.contacts if each.name == contact).vectors[0])
    return [f"{name}''" for name, weight in zip(system.coordinates, vector, strict=True) if weight]


def signal_factor(system: System, name: str) -> float:
    """Return the factor of a signal from the consistent units of the equations of motion to its own."""
    return 1.0 if system.units is None else system.units.signal(name)[0]


def assembled_histories(
    system: System, theta: NDArray | float, q: NDArray, v: NDArray, a: NDArray, forces: NDArray
) -> NDArray:
    """Compute all signals of `assembled_signals`, shape (samples, signals), real or complex."""
    # Shapes: `theta` (samples,); `q`, `v`, `a` (samples, n); `forces` (samples, contacts).
    assembly = system.structure.assembly
    assert isinstance(assembly, TrainAssembly | PacedMatrices)
    if (lagging := assembly.lagging(system.values)) is not None:
        q, v = q + v @ lagging.T, v + a @ lagging.T
    if isinstance(assembly, PacedMatrices):
        slow = list(assembly.massless)
        return np.hstack((q[..., slow], v[..., slow]))
    form, train = assembly.form, assembly.numbers(system.values)
    rates, a = v + train.leaks * q, a + train.leaks * v  # of the angles, which include those of slipping links
    angle, orders = np.asarray(theta), layout_of(system.structure).orders
    displaced = np.zeros((*np.shape(theta), len(form.links)), dtype=train.values.dtype)
    for torque in form.torques:
        numbers = form.numbers(torque.harmonic.parameters, train.values)
        for link, factor in torque.displaces:  # k u + c u'
            kind: Any = Displacing(torque.harmonic.kind)
            spring = [*numbers, train.stiffness[link], train.damping[link]]
            lines = replace(torque.harmonic, kind=kind).lines(train.values[0], spring)
            displaced[..., link] += factor * _wave(lines, angle)
    # the rotation as a whole by loads that repeat, beside the one that is a coordinate, and its integrals of the mean 0
    mean, *waves = train.driven(orders).T
    moved, speeds, turned = a @ train.angles.T + mean, rates @ train.angles.T, q @ train.angles.T
    for order, cosine, sine in zip(orders, waves[: len(orders)], waves[len(orders) :], strict=True):
        if cosine.any() or sine.any():
            c, s, pace = np.cos(order * angle)[..., None], np.sin(order * angle)[..., None], order * train.values[0]
            moved = moved + c * cosine + s * sine
            speeds = speeds + (s * cosine - c * sine) / pace
            turned = turned - (c * cosine + s * sine) / pace**2
    # the torque of each link: of its permanent spring and damper, and of its contact
    torques = displaced + train.stiffness * (q @ train.deflections.T) + train.damping * (rates @ train.deflections.T)
    torques = torques + train.steady_drags
    for place, (number, _) in enumerate(form.contacts):
        torques[..., number] += forces[..., place]
    slips = (rates @ train.deflections.T + train.mean_slips)[..., list(form.turning)]
    known = [number for number, link in enumerate(form.links) if not link.rigid]
    moved = moved[..., [number for number in range(len(form.inertias)) if number not in form.massless]]
    return np.hstack((moved, torques[..., known], slips, turned, speeds, moved))


def one_sided_drags(structure: Structure) -> list[str]:
    """Return the names of the drags whose torque is that of one direction of slip; see `drags_turned_back`."""
    assembly = structure.assembly
    if not isinstance(assembly, TrainAssembly):
        return []
    links = [assembly.form.links[number] for number in assembly.form.turning]
    return [link.name for link in links if link.own is not None and link.way and (link.parts or "constant" in link.own)]


def drags_turned_back(motion: Motion) -> list[str]:
    """Return the names of the drags that slip in the other direction somewhere along a motion.

    Their constant, square and Stribeck torques are those of the direction of the mean slip, without an event where the
    slip ends: beyond it they are wrong.
    """
    slips = {name: motion.signal(f"{name}.speed") for name in one_sided_drags(motion.system.structure)}
    return [name for name, slip in slips.items() if slip.min() * slip.max() <= 0.0]


def _wave(lines: Iterable[Line], theta: NDArray) -> NDArray:
    """Return the sum of some lines at some angles."""
    return np.zeros_like(theta) + np.sum(
        [cosine * np.cos(h * theta) + sine * np.sin(h * theta) for h, cosine, sine in lines], axis=0
    )


# A motion at the nodes of Gauss's rule, for integrals along it that are accurate to rounding.
#
# The motion is analytic between its events: crossings of breakpoints, impacts, beginnings of slip and stick, kinks of
# laws and jumps of loads. Intervals of Gauss's rule end at all of them.

_ORDER = 12  # nodes in each interval
_WIDEST = PERIOD / 32  # largest width of an interval
_PER_STEP = 0.5  # the same, as a share of the mean Taylor step of the flow
_LOGS = tuple(map(attrgetter, ("contacts", "slips", "holds", "impacts")))
_NARROWEST = 1e-9  # narrower intervals between events are omitted
_NODES, _WEIGHTS = leggauss(_ORDER)
_SERIES = (
    (np.arange(_ORDER)[:, None] + 0.5) * legvander(_NODES, _ORDER - 1).T * _WEIGHTS
)  # Legendre's, of values at them


class Quadrature(NamedTuple):
    """A motion at the nodes of Gauss's rule."""

    motion: Motion  #: The motion; its samples are the nodes, and its events the crossings of breakpoints.
    #: shape (nodes,): Weights of the nodes over time (not theta); their sum is the duration of the motion.
    weights: NDArray[np.float64]

    def largest(self, values: NDArray[np.float64], first: int = 0, stop: int | None = None) -> float:
        """Return the largest value of a function of the motion from its values at all nodes, near some of them."""
        own = values[first:stop]
        if not len(own):
            return 0.0
        # between two edges it is analytic: the polynomial through the nodes there is exact almost to rounding
        interval = (first + int(np.argmax(own))) // _ORDER * _ORDER
        series = _SERIES @ values[interval : interval + _ORDER]
        turns = legroots(legder(series))
        inside = turns.real[(turns.imag == 0.0) & (np.abs(turns.real) < 1.0)]
        return max(float(own.max()), float(legval(np.concatenate((inside, [-1.0, 1.0])), series).max()))

    def largest_size(self, values: NDArray[np.float64], first: int = 0, stop: int | None = None) -> float:
        """Return the largest magnitude, as `largest`; a magnitude itself has a kink where it vanishes."""
        return max(self.largest(values, first, stop), self.largest(-values, first, stop))


def quadrature(system: System, state: NDArray[np.float64], periods: int, restarts: Restarts = ()) -> Quadrature:
    """Integrate the motion from a state at theta = 0 and sample it at Gauss nodes over some forcing periods."""
    # At the angles of `restarts` the motion continues from their states.
    end = PERIOD * periods
    flow, coefficients = flow_of(system), coefficients_of(system)
    parts = pairwise([(0.0, state), *restarts, (end, state)])
    arcs = [flow.integrate(coefficients, own, start, stop, sums=False) for (start, own), (stop, _) in parts]
    logs = [[each for arc in arcs for each in log(arc)] for log in _LOGS]
    changes = [each.theta for log in logs[:3] for each in log]
    kinks = flow.kinks(coefficients, state, end)  # and jumps: it is not analytic there either
    widest = min(_WIDEST, _PER_STEP * end / sum(arc.steps for arc in arcs))  # fast vibrations take short steps
    edges = np.unique(np.concatenate(([0.0], changes, kinks, [end])))
    edges = edges[np.concatenate(([True], np.diff(edges) > _NARROWEST))]
    parts = [np.linspace(a, b, 1 + int(np.ceil((b - a) / widest)))[:-1] for a, b in pairwise(edges)]
    starts = np.concatenate(parts)
    widths = np.diff(np.append(starts, end))
    thetas = (starts[:, None] + 0.5 * widths[:, None] * (_NODES + 1.0)).ravel()
    found = sample(system, state, np.concatenate(([0.0], thetas)), restarts)
    motion = Motion.of(system, thetas, found.states[1:], *logs)
    return Quadrature(motion, (0.5 * widths[:, None] * _WEIGHTS).ravel() / system.frequency)


# A signal of a motion: a coordinate, velocity, acceleration or contact force, or a sum of several with factors.

_STEP = 1e-150  # of the complex step, as in `gapwalk.model.coefficients`


@dataclass(frozen=True)
class Signal:
    """A sum of signals with factors, as a sensor measures it.

    Examples
    --------
    >>> gw.measure.Signal((("x''", 1.0), ("x", -2.0))).of(orbit.motion(8)).shape
    (9,)
    """

    terms: tuple[tuple[str, float], ...]  #: Names as in `Motion.signal`, each with its factor.
    label: str = ""  #: Label of the signal; by default the sum as a text.

    @property
    def name(self) -> str:
        """Its label, or without one the sum as a text: ``q1''``, or ``0.5 q1'' - 2 q3``."""
        if self.label:
            return self.label
        if len(self.terms) == 1 and self.terms[0][1] == 1.0:
            return self.terms[0][0]
        text = " ".join(f"{'-' if factor < 0 else '+'} {_size(factor)}{name}" for name, factor in self.terms)
        return text.removeprefix("+ ").replace("- ", "-", 1) if text.startswith("- ") else text.removeprefix("+ ")

    def of(self, motion: Motion) -> NDArray[np.float64]:
        """Return its values along a motion, shape (samples,)."""
        return np.sum([factor * motion.signal(name) for name, factor in self.terms], axis=0)

    def slope(
        self,
        motion: Motion,
        states: NDArray[np.float64],
        coefficients: NDArray[np.float64] | None = None,
        theta: float = 0.0,
    ) -> NDArray[np.float64]:
        """Return its derivative along a direction in states, coefficients and theta, to rounding, shape (samples,).

        Dry friction slips or sticks as before, and the instants at which a signal jumps stay the same.
        """
        system, layout, step = motion.system, layout_of(motion.system.structure), 1j * _STEP
        n = system.size
        q, v = motion.q + step * states[:, :n], motion.v + step * states[:, n : 2 * n]
        numbers = coefficients_of(system) + step * (0.0 if coefficients is None else coefficients)
        angles = motion.theta + step * theta
        z = motion.z + step * states[:, 2 * n :]
        modes = motion.modes if is_dry(system.structure) else None
        forces, a = forces_and_accelerations(layout, numbers, angles, q, v, z, modes)
        columns = [q, v, a, forces, z, *([] if modes is None else [modes.slips])]
        if of_train := assembled_signals(system.structure):
            is_train = isinstance(system.structure.assembly, TrainAssembly)
            if is_train and coefficients is not None and any(name in of_train for name, _ in self.terms):
                raise ModelError(
                    f"the slope of {self.name} by a parameter is not known: it depends on parameters of the "
                    "train directly; fit to a coordinate, or to its acceleration"
                )
            columns.append(assembled_histories(system, angles, q, v, a, forces))
        everything: NDArray[np.complex128] = np.hstack(columns)
        shifted = everything.imag / _STEP
        factors = [(signal_place(system, name), factor * signal_factor(system, name)) for name, factor in self.terms]
        return np.sum([factor * shifted[:, place] for place, factor in factors], axis=0)


def signal_of(system: System, given: str | Mapping[str, float] | Signal) -> Signal:
    """Return a signal of a system's motions from its name, or from names with factors."""
    if isinstance(given, str):
        terms = ((given, 1.0),)
    else:
        terms = given.terms if isinstance(given, Signal) else tuple(given.items())
    for name, factor in terms:
        signal_place(system, name)
        check(f"the factor of {name}", factor, Finite)
    if not any(factor for _, factor in terms):
        raise ModelError("a signal names at least one of the system's, as in \"q1''\" or { \"q1''\" = 1.0 }")
    return given if isinstance(given, Signal) else Signal(terms)


def contact_to_show(
    system: System, signal: str, forces: NDArray[np.float64], events: Iterable[ContactEvent] = ()
) -> int:
    """Return the place of the contact whose force a picture shows by default."""
    # It is the one that the signal names. Otherwise it is a contact that touches, if possible one that acts on the
    # signal's coordinate, and of these the one that closes most often, then the one with the largest force.
    #
    # Shapes: `forces` (contacts,).
    base, coordinates, sizes = signal.rstrip("'"), system.coordinates, np.nan_to_num(forces)

    closings = Counter(system.structure.breakpoints[each.switch].contact for each in events if each.enters)

    def rank(place: int) -> tuple[bool, bool, bool, int, float]:
        form, size = system.structure.contacts[place], float(sizes[place])
        own = base in coordinates and any(system.vector(each)[coordinates.index(base)] for each in form.vectors)
        return base.partition(".")[0] == form.name, size > 0.0, own, closings[place], size

    return max(range(len(sizes)), key=rank)


def _size(factor: float) -> str:
    return "" if abs(factor) == 1.0 else f"{abs(factor):g} "


# The depth of a motion beyond the breakpoint of a switch, with its derivatives.


class Gauge:
    """Gauge of the depth of a motion beyond the breakpoint of a switch: positive where the stage is closed.

    The deflection may contain a prescribed displacement, so the depth depends on the angle too.
    """

    def __init__(self, layout: CoefficientLayout, switch: int) -> None:
        stages = [(contact, stage) for contact in layout.contacts for stage in contact.stages]
        self._layout = layout
        self._contact, stage = stages[switch]
        self._clearance, self._sign = stage.clearance, stage.sign

    @property
    def sways(self) -> bool:
        """True if the deflection contains a prescribed displacement."""
        return self._contact.sway is not None

    def vector(self, coefficients: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the derivative of the depth by the positions, shape (n,)."""
        return self._sign * coefficients[self._contact.deflection]

    def read(
        self, coefficients: NDArray[np.float64], theta: float, state: NDArray[np.float64]
    ) -> tuple[float, float, float]:
        """Return the depth beyond the breakpoint, and its first and second derivatives over time."""
        turning = float(self.vector(coefficients) @ acceleration_at(self._layout, coefficients, theta, state))
        return *self.depth(coefficients, theta, state), turning + self._sway(coefficients, theta, 2)

    def depth(self, coefficients: NDArray[np.float64], theta: float, state: NDArray[np.float64]) -> tuple[float, float]:
        """Return the depth beyond the breakpoint, and its derivative over time."""
        n, vector = self._layout.structure.size, self.vector(coefficients)
        depth, rate = (float(vector @ each) for each in (state[:n], state[n : 2 * n]))
        depth, rate = (each + self._sway(coefficients, theta, order) for order, each in enumerate((depth, rate)))
        return depth - float(coefficients[self._clearance]), rate

    def _sway(self, coefficients: NDArray[np.float64], theta: float, order: int) -> float:
        """Return the contribution of a prescribed displacement to the derivative of some order."""
        if self._contact.sway is None:
            return 0.0
        return self._sign * float(Angles(self._layout, coefficients, theta).sway(self._contact, 0, order))

    def slopes(
        self,
        coefficients: NDArray[np.float64],
        direction: NDArray[np.float64],
        theta: float,
        state: NDArray[np.float64],
    ) -> tuple[float, float]:
        """Return the derivatives of the depth and of its rate along a direction of the coefficients, at one state."""
        n, vector = self._layout.structure.size, self.vector(direction)
        depth, rate = float(vector @ state[:n]), float(vector @ state[n : 2 * n])
        if (sway := self._contact.sway) is not None:
            count, orders = len(self._layout.orders), np.array(self._layout.orders, dtype=float)
            waves, (cosines, sines) = Angles(self._layout, coefficients, theta).waves, np.split(coefficients[sway], 2)
            by_time = np.concatenate((-orders * waves[count:], orders * waves[:count])) / coefficients[0]
            depth += self._sign * float(direction[sway] @ waves)
            # the rate over time is that over theta times the frequency, which may be along the direction
            over_theta = orders @ (sines * waves[:count] - cosines * waves[count:])
            by_frequency = -float(over_theta) * direction[0] / coefficients[0] ** 2
            rate += self._sign * (float(direction[sway] @ by_time) + by_frequency)
        return depth - float(direction[self._clearance]), rate

"""Second, independent implementation of the equations of motion, from the named matrices, for many systems at once.

Nothing here comes from `gapwalk.flow`, because code must not verify its own results. The formulas of the force laws and
loads are those of `gapwalk.model`, the only place where they stand, and are tested against closed forms; which stages
act, which modes a law is in, and what varies over the angle is decided here.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gapwalk.model.contact import ContactForm
from gapwalk.model.laws import Stages, StageTerms
from gapwalk.model.laws.formula import NUMPY_FUNCTIONS
from gapwalk.model.structure import Structure
from gapwalk.model.system import System

Array = NDArray[np.float64]
Lanes = slice | NDArray[np.intp]

_STEP = 1e-150  # of the complex step
_ALL = slice(None)


class Equations:
    """Equations ``M q'' + C q' + K q + sum d f = mean + sum F cos(h W t + phi)`` of L systems of one structure.

    The active stage of each contact and the levels of loads that jump are arguments, so that the right-hand sides are
    smooth between these events. The modes of laws without stages follow from the state: forces are continuous there.
    """

    def __init__(self, systems: Sequence[System]) -> None:
        structure = systems[0].equations.structure
        values = np.array([system.equations.values for system in systems])
        same = values[:, 1:] == values[:1, 1:]
        shared = bool(np.all(same))  # along the frequency all matrices are equal
        if shared:
            values = values[:1]
        n = self.size = structure.size
        self.frequency = np.array([system.frequency for system in systems])

        def vectors(names: Sequence[str]) -> Array:
            found = [values[:, structure.block(name, n)] for name in names]
            return np.stack(found, axis=-1) if found else np.zeros((len(values), n, 0))

        def named(prefix: str, names: Sequence[str]) -> dict[str, Array]:
            return {name: values[:, structure.place(f"{prefix}.{name}")] for name in names}

        contacts = self._contacts = structure.contacts
        self._loads = _Loads(structure, values, self.frequency)
        driving = [number for number, load in enumerate(structure.harmonics) if not load.varies]
        stiffness, damping, mass = (
            values[:, structure.block(which, n, n)] for which in ("stiffness", "damping", "mass")
        )
        push, mean = vectors([form.push for form in contacts]), vectors(["mean"])
        shapes = vectors([structure.harmonics[number].shape for number in driving])
        solved = np.linalg.solve(mass, np.concatenate((stiffness, damping, push, mean, shapes), axis=2))
        columns = np.cumsum([n, n, len(contacts), 1])
        parts: list[Array] = [np.asarray(part, dtype=float) for part in np.split(solved, columns, axis=2)]
        self._stiffness, self._damping, self._push, mean, self._shapes = parts
        self._mean, self._driving = mean[:, :, 0], np.array(driving, dtype=np.intp)
        # the deflections of all contacts, one after the other: a contact has one for each argument of its law
        self._vectors = vectors([name for form in contacts for name in form.vectors]).transpose(0, 2, 1)
        arguments = [(form.name, argument) for form in contacts for argument in form.law.arguments]
        starts = np.cumsum([0, *(len(form.vectors) for form in contacts)])
        self._of_contact = [range(*pair) for pair in zip(starts[:-1].tolist(), starts[1:].tolist(), strict=True)]
        self._first = starts[:-1]
        stages = [
            (index, sign, form.stage_prefix(stage))
            for index, form in enumerate(contacts)
            for stage in form.stages
            for sign in stage.side.signs
        ]
        self.contact_of = np.array([index for index, _, _ in stages], dtype=np.intp)
        self.signs = np.array([sign for _, sign, _ in stages], dtype=float)
        places = [structure.place(f"{prefix}.clearance") for _, _, prefix in stages]
        self._clearance = values[:, np.array(places, dtype=np.intp)]
        names = [[each.name for each in contacts[index].law.stage_parameters] for index, _, _ in stages]
        self._of_stages = [named(prefix, each) for (_, _, prefix), each in zip(stages, names, strict=True)]
        self._own = [named(form.name, [each.name for each in form.law.parameters]) for form in contacts]
        # what the loads add to a deflection, and by what share they change a number: factors by load
        varied = _varied(structure)
        count = len(structure.harmonics)
        self._displaced = np.array([varied.get(each, np.zeros(count)) for each in arguments]).reshape(
            len(arguments), count
        )
        self._shares = {name: factors for name, factors in varied.items() if name not in arguments}
        self._prefixes = [prefix for _, _, prefix in stages]
        self._free = -np.trace(self._damping, axis1=1, axis2=2)
        contact = np.repeat(np.arange(len(contacts)), [len(each) for each in self._of_contact])
        self._drag = np.sum(self._vectors * self._push[:, :, contact].transpose(0, 2, 1), axis=2)
        self._damped = [form.law.is_damped for form in contacts]
        switches = [np.flatnonzero(self.contact_of == index).tolist() for index in range(len(contacts))]
        self._switches = [[*zip(own, form.shapes, strict=True)] for own, form in zip(switches, contacts, strict=True)]
        self.guard_count = sum(form.law.mode_count for form in contacts)

    @property
    def jump_count(self) -> int:
        """Number of loads that jump between two levels."""
        return len(self._loads.jumping)

    def jumps(self, lane: int) -> Iterator[Array]:
        """Yield, for each load that jumps, the angles in ``[0, 2 pi)`` at which it does, of one of the systems."""
        return self._loads.jumps(lane)

    def levels(self, theta: Array, lanes: Lanes = _ALL) -> Array:
        """Return 1 for each load that is at its high level, and otherwise 0; shape (L, loads that jump)."""
        return self._loads.levels(theta, lanes)

    def deflections(self, theta: Array, moved: Array, lanes: Lanes = _ALL, derivative: int = 0) -> Array:
        """Return the first deflection of each contact, with what is added to it, shape (L, contacts)."""
        # Shapes: `theta` (L,); `moved` (L, n).
        found = times(of_lanes(self._vectors, lanes)[:, self._first], moved)
        if self._displaced.any():
            found = found + self._loads.at(theta, lanes, None, derivative) @ self._displaced[self._first].T
        return found

    def depths(self, deflections: Array, lanes: Lanes = _ALL) -> Array:
        """Return the depths beyond the breakpoints, shape (L, switches)."""
        return self.signs * deflections[:, self.contact_of] - of_lanes(self._clearance, lanes)

    def rates(
        self, theta: Array, state: Array, closed: Array, lanes: Lanes = _ALL, levels: Array | None = None
    ) -> Array:
        """Return the derivatives over theta of positions, velocities, and the logarithm of a volume of states."""
        # Shapes: `theta` (L,); `state` (L, 2n + 1); `closed` (L, switches); `levels` (L, loads that jump).
        n = self.size
        q, v = state[:, :n], state[:, n : 2 * n]
        loads = self._loads.at(theta, lanes, levels)
        force, contraction = self._contact_forces(loads, *self._moves(theta, q, v, lanes, loads), closed, lanes)
        acceleration = (
            of_lanes(self._mean, lanes)
            + times(of_lanes(self._shapes, lanes), loads[:, self._driving])
            - times(of_lanes(self._stiffness, lanes), q)
            - times(of_lanes(self._damping, lanes), v)
            - times(of_lanes(self._push, lanes), force)
        )
        divergence = of_lanes(self._free, lanes) - contraction
        return np.column_stack((v, acceleration, divergence)) / self.frequency[lanes, None]

    def guards(
        self, theta: Array, state: Array, closed: Array, lanes: Lanes = _ALL, levels: Array | None = None
    ) -> Array:
        """Return the guards of the modes of all laws, shape (L, `guard_count`): kinks are where they change sign."""
        # Parameters as in `rates`.
        loads, n = self._loads.at(theta, lanes, levels), self.size
        x, rate = self._moves(theta, state[:, :n], state[:, n : 2 * n], lanes, loads)
        found = []
        for index, form in enumerate(self._contacts):
            if form.law.mode_count:
                stages, numbers = self._arguments(index, loads, x, rate, closed, lanes)
                found += self._decided(form, stages, numbers, rate[:, self._first[index]])
        return np.stack([np.broadcast_to(np.real(each), len(state)) for each in found], axis=1)

    @property
    def graded(self) -> NDArray[np.bool_]:
        """True for each guard of a law with fractional powers, where the force has no derivatives of higher order."""
        found = [[form.law.has_edges] * form.law.mode_count for form in self._contacts]
        return np.array([each for own in found for each in own], dtype=bool)

    def _moves(self, theta: Array, q: Array, v: Array, lanes: Lanes, loads: Array) -> tuple[Array, Array]:
        """Return all deflections and their rates over time, shape (L, arguments of all laws) each."""
        vectors = of_lanes(self._vectors, lanes)
        x, rate = times(vectors, q), times(vectors, v)
        if self._displaced.any():
            x = x + loads @ self._displaced.T
            slopes = self._loads.at(theta, lanes, None, 1) * self.frequency[lanes, None]
            rate = rate + slopes @ self._displaced.T
        return x, rate

    def _contact_forces(self, loads: Array, x: Array, rate: Array, closed: Array, lanes: Lanes) -> tuple[Array, Array]:
        """Return the contact forces, shape (L, contacts), and the rate at which they contract volumes, shape (L,)."""
        forces, contraction = np.zeros((len(x), len(self._contacts))), np.zeros(len(x))
        drag = of_lanes(self._drag, lanes)
        for index, form in enumerate(self._contacts):
            places, law = self._of_contact[index], form.law
            stages, numbers = self._arguments(index, loads, x, rate, closed, lanes)
            self._decided(form, stages, numbers, rate[:, places[0]])
            if not self._damped[index]:
                forces[:, index] = law.force(rate[:, places[0]], stages, numbers)
                continue
            moves = stages.deflections
            for place, argument in zip(places, law.arguments, strict=True):
                # the derivative by one rate at a time
                aside = rate[:, place] + 1j * _STEP
                stages.deflections = {**moves, argument: (x[:, place], aside)}
                found = law.force(aside if place == places[0] else rate[:, places[0]], stages, numbers)
                forces[:, index] = np.real(found)
                contraction += drag[:, place] * (np.imag(found) / _STEP)
        return forces, contraction

    def _arguments(
        self, index: int, loads: Array, x: Array, rate: Array, closed: Array, lanes: Lanes
    ) -> tuple[Stages, dict[str, Array]]:
        """Return the stages and numbers of the law of a contact, with no mode decided yet."""
        form, places = self._contacts[index], self._of_contact[index]
        stages = [
            StageTerms(
                shape.sign,
                x[:, places[0]] - shape.sign * of_lanes(self._clearance, lanes)[:, k],
                closed[:, k],
                shape.innermost,
                self._named(self._prefixes[k], self._of_stages[k], loads, lanes),
            )
            for k, shape in self._switches[index]
        ]
        moves = {name: (x[:, place], rate[:, place]) for name, place in zip(form.law.arguments, places, strict=True)}
        modes = [np.zeros(len(x))] * form.law.mode_count
        found = Stages(stages, deflections=moves, modes=modes, functions=NUMPY_FUNCTIONS)
        return found, self._named(form.name, self._own[index], loads, lanes)

    @staticmethod
    def _decided(form: ContactForm, stages: Stages, numbers: Mapping[str, Array], rate: Array) -> list[Array]:
        """Decide the modes of a law, which are set in `stages`, and return its guards."""
        guards: list[Array] = []
        for _ in range(form.law.mode_count and form.law.mode_count + 1):  # a guard may depend on modes before its own
            guards = list(form.law.guards(rate, stages, numbers))
            modes = [(np.real(each) > 0.0) * np.ones(len(rate)) for each in guards]
            if all(np.array_equal(a, b) for a, b in zip(modes, stages.modes, strict=True)):
                break
            stages.modes = modes
        return guards

    def _named(self, prefix: str, numbers: Mapping[str, Array], loads: Array, lanes: Lanes) -> dict[str, Array]:
        found = {}
        for name, values in numbers.items():
            factors, value = self._shares.get((prefix, name)), of_lanes(values, lanes)
            found[name] = value if factors is None else value * (1.0 + loads @ factors)
        return found


class _Loads:
    """All loads of L systems over the angle, those that vary numbers among them."""

    def __init__(self, structure: Structure, values: Array, frequency: Array) -> None:
        loads = structure.harmonics
        places = [[structure.place(name) for name in load.parameters] for load in loads]
        lines = [load.lines(frequency, values[:, where].T) for load, where in zip(loads, places, strict=True)]
        self._orders = np.array([line.order for each in lines for line in each], dtype=float)
        of_load = [load for load, each in enumerate(lines) for _ in each]
        self._sums = np.eye(len(loads))[of_load].reshape(len(of_load), len(loads))
        full = len(frequency)
        self._cosines, self._sines = (
            np.stack([np.broadcast_to(part, full) for part in parts], axis=1) if parts else np.zeros((full, 0))
            for parts in (
                [line.cosine for each in lines for line in each],
                [line.sine for each in lines for line in each],
            )
        )
        self.jumping = [number for number, load in enumerate(loads) if load.kind.has_levels]
        self._cycles = [2.0 * np.pi / loads[number].order for number in self.jumping]
        levels = [loads[number].levels(frequency, values[:, places[number]].T) for number in self.jumping]
        self._low, self._high, self._up, self._down = (
            np.stack([np.broadcast_to(part, full) for part in parts], axis=1) if parts else np.zeros((full, 0))
            for parts in ([each[place] for each in levels] for place in range(4))
        )

    def at(self, theta: Array, lanes: Lanes, levels: Array | None = None, derivative: int = 0) -> Array:
        """Return the values of all loads, or a derivative of them over theta, shape (L, loads)."""
        cosines, sines = of_lanes(self._cosines, lanes), of_lanes(self._sines, lanes)
        for _ in range(derivative):
            cosines, sines = self._orders * sines, -self._orders * cosines
        angles = theta[:, None] * self._orders
        found = (cosines * np.cos(angles) + sines * np.sin(angles)) @ self._sums
        if self.jumping and not derivative:
            high = self.levels(np.real(theta), lanes) if levels is None else levels
            low, high_level = of_lanes(self._low, lanes), of_lanes(self._high, lanes)
            found[:, self.jumping] = low + (high_level - low) * high
        return found

    def levels(self, theta: Array, lanes: Lanes) -> Array:
        """See `Equations.levels`."""
        up, down = of_lanes(self._up, lanes), of_lanes(self._down, lanes)
        return np.asarray((theta[:, None] - up) % np.array(self._cycles) < down - up, dtype=float)

    def jumps(self, lane: int) -> Iterator[Array]:
        """See `Equations.jumps`."""
        for place, cycle in enumerate(self._cycles):
            starts = cycle * np.arange(round(2.0 * np.pi / cycle))
            both = [(each[lane, place] + starts) % (2.0 * np.pi) for each in (self._up, self._down)]
            yield np.sort(np.concatenate(both))


def of_lanes(values: Array, lanes: Lanes) -> Array:
    """Return values for some lanes: one for all is one for these."""
    return values if len(values) == 1 else values[lanes]


def _varied(structure: Structure) -> dict[tuple[str, str], Array]:
    """Return the numbers that loads vary, by prefix and name, with a factor for each load."""
    # A number of a stage has the prefix of the stage, a number of a whole contact and a deflection the contact's name.
    found: dict[tuple[str, str], Array] = {}
    for number, load in enumerate(structure.harmonics):
        for text, factor in load.varies:
            for prefix, name, sign in _targets(structure, text):
                factors = found.setdefault((prefix, name), np.zeros(len(structure.harmonics)))
                factors[number] += sign * factor
    return found


def _targets(structure: Structure, text: str) -> Iterator[tuple[str, str, float]]:
    """Find the numbers that a text such as ``mesh.stiffness`` names: prefixes, names, and signs."""
    contact, *words = text.split(".")
    (form,) = [each for each in structure.contacts if each.name == contact]
    prefixes = [form.stage_prefix(stage) for stage in form.stages if words[:-1] in ([], [stage.name])]
    several, first = bool(form.law.arguments[1:]), form.law.arguments[0]
    own = [*(form.law.arguments if several else ()), *(each.name for each in form.law.parameters)]
    if words == ["deflection"] and not several:
        yield contact, first, 1.0
    elif len(words) == 1 and words[0] in own:
        yield contact, words[0], 1.0
    elif words[-1] == "clearance":
        (sign,) = {sign for stage in form.stages for sign in stage.side.signs}
        yield contact, first, -float(sign)  # the depth beyond a wider gap is smaller
    else:
        for prefix in prefixes:
            yield prefix, words[-1], 1.0
            if words[-1] == "stiffness" and form.law.has_stage_parameter("cubic"):
                yield prefix, "cubic", 1.0  # the whole force varies


def times(matrices: NDArray[Any], vectors: NDArray[Any]) -> NDArray[Any]:
    """Return products of matrices (one, or one for each vector) and vectors, shape (L, rows)."""
    if len(matrices) == 1:
        return vectors @ matrices[0].T
    return (matrices @ vectors[:, :, None])[:, :, 0]

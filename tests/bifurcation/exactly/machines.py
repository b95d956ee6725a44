"""Random machines that are linear between events: with elastic stops, dry friction, or a spring that slips."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations, pairwise

import numpy as np

import gapwalk as gw
from gapwalk import Kind, SpecialPoint
from gapwalk.flow.motion import switch_names
from tests.bifurcation.exactly.flights import LONG, Mark, located

_BRIEF, _TOUCH = 3e-3, 1e-5  # radians of a phase of friction, and of a contact, that only begins at a special point


def determinant(matrix: np.ndarray) -> np.longdouble:
    """Return the determinant of a matrix by elimination with pivots."""
    rows, product = matrix.copy(), LONG(1)
    for k in range(len(rows)):
        pivot = k + int(np.argmax(np.abs(rows[k:, k])))
        if pivot != k:
            rows[[k, pivot]], product = rows[[pivot, k]], -product
        if not rows[k, k]:
            return LONG(0)
        product *= rows[k, k]
        rows[k + 1 :] -= np.outer(rows[k + 1 :, k] / rows[k, k], rows[k])
    return product


def compound(matrix: np.ndarray) -> np.ndarray:
    """Return the matrix of the minors of order two: its eigenvalues are the products of two eigenvalues."""
    pairs = [*combinations(range(len(matrix)), 2)]
    return np.array([[matrix[i, k] * matrix[j, m] - matrix[i, m] * matrix[j, k] for k, m in pairs] for i, j in pairs])


_TESTS = {
    Kind.FOLD: lambda matrix: determinant(matrix - np.eye(len(matrix), dtype=LONG)),
    Kind.BRANCH_POINT: lambda matrix: determinant(matrix - np.eye(len(matrix), dtype=LONG)),
    Kind.FLIP: lambda matrix: determinant(matrix + np.eye(len(matrix), dtype=LONG)),
    Kind.NEIMARK_SACKER: lambda matrix: determinant(compound(matrix) - np.eye(len(compound(matrix)), dtype=LONG)),
}


@dataclass(frozen=True)
class Stopped:
    """One or two masses with elastic stops: deflection, clearance, stiffness and side of each."""

    mass: np.ndarray
    damping: np.ndarray
    stiffness: np.ndarray
    stops: tuple[tuple[np.ndarray, float, float, int], ...]
    mean: np.ndarray
    load: np.ndarray

    @classmethod
    def random(cls, seed: int) -> Stopped:
        """Draw one; in some the second mass is held by damping alone."""
        shape, numbers = np.random.default_rng([seed // 10, 77]), np.random.default_rng([seed, 770])
        n, is_loose = int(shape.choice([1, 2, 2])), bool(shape.random() < 0.35)
        springs = numbers.uniform(0.3, 1.2, n + 1)
        stiffness = np.diag(springs[:-1] + springs[1:]) - np.diag(springs[1:-1], 1) - np.diag(springs[1:-1], -1)
        vector = np.eye(n)[-1]
        if n == 2 and is_loose:
            stiffness, vector = np.diag([springs[0], 0.0]), np.array([1.0, -1.0])
        sides = [1, -1] if (n == 2 and is_loose) or shape.random() < 0.5 else [1]
        clearance, hardness = numbers.uniform(0.3, 1.0), 10.0 ** numbers.uniform(0.3, 1.7)
        stops = [(vector, clearance, hardness, side) for side in sides]
        if shape.random() < 0.4:
            stops.append((np.eye(n)[0], numbers.uniform(0.4, 1.2), 10.0 ** numbers.uniform(0.0, 1.5), 1))
        mean = np.eye(n)[-1] * (0.0 if shape.random() < 0.5 else numbers.uniform(-0.3, 0.3))
        mass, damping = np.diag(numbers.uniform(0.6, 1.4, n)), np.diag(numbers.uniform(0.05, 0.25, n))
        return cls(mass, damping, stiffness, tuple(stops), mean, numbers.uniform(0.4, 1.2) * np.eye(n)[0])

    @property
    def system(self) -> gw.System:
        """The machine at the beginning of its range."""
        names = [f"q{number}" for number in range(len(self.mass))]
        contacts = []
        for number, (vector, clearance, stiffness, side) in enumerate(self.stops):
            deflection = {name: float(part) for name, part in zip(names, vector, strict=True) if part}
            word = "positive" if side > 0 else "negative"
            contacts.append(gw.stop(f"s{number}", deflection, clearance, stiffness, side=word))
        mean = {name: float(part) for name, part in zip(names, self.mean, strict=True) if part}
        loads = [gw.Harmonic(float(self.load[0]), {"q0": 1.0})]
        return gw.System(names, self.stiffness, self.damping, self.mass, contacts, mean, loads, 0.6)

    def generator(self, closed: frozenset[int] | None, pace: np.longdouble) -> np.ndarray:
        """See `located`: the modes are the stops that are closed."""
        n, stiffness, constant = len(self.mass), self.stiffness.astype(LONG), self.mean.astype(LONG)
        for vector, clearance, spring, side in (self.stops[number] for number in closed or ()):
            stiffness = stiffness + LONG(spring) * np.outer(vector, vector)
            constant = constant + LONG(spring) * LONG(side) * LONG(clearance) * vector
        found = np.zeros((2 * n + 3, 2 * n + 3), dtype=LONG)
        found[:n, n : 2 * n] = np.eye(n)
        parts = (-stiffness, -self.damping.astype(LONG), self.load.astype(LONG), np.zeros(n, dtype=LONG), constant)
        found[n : 2 * n] = np.column_stack(parts) / np.diag(self.mass).astype(LONG)[:, None]
        found[2 * n, 2 * n + 1], found[2 * n + 1, 2 * n] = -pace, pace
        return found

    def value(self, special: SpecialPoint) -> np.longdouble:
        """Return the frequency of a special point with 80 bits."""
        orbit, n = special.orbit, len(self.mass)
        rows = [
            np.array([*vector, *np.zeros(n + 2), -side * LONG(clearance)])[None]
            for vector, clearance, _, side in self.stops
        ]
        events, touch = [(event.theta, event.switch) for event in orbit.events], []
        if special.kind is Kind.GRAZING:
            names = [f"{contact} {'+' if side > 0 else '-'}" for contact, _, side in switch_names(orbit.system)]
            switch = names.index(special.contact)
            turns = orbit.turning_depths[switch]
            touch = [(float(turns.thetas[int(np.argmin(np.abs(turns.values)))]), -1 - switch)]
            for number in range(len(self.stops)):
                for one, other in pairwise([event for event in events if event[1] == number]):
                    if other[0] - one[0] < _TOUCH and one in events:
                        events = [event for event in events if event not in (one, other)]
        closed = frozenset(
            number
            for number, row in enumerate(rows)
            if self.stops[number][3] * (row[0, :n] @ orbit.state[:n] + row[0, -1]) > 0
        )
        marks = list[Mark]()
        for angle, switch in sorted(events + touch):
            closed = closed ^ {switch} if switch >= 0 else closed
            marks.append(Mark(angle, rows[switch if switch >= 0 else -1 - switch], closed, switch < 0))
        if not marks:
            marks = [Mark(1.0, np.zeros((0, 2 * n + 3)), closed)]
        return located(self.generator, marks, orbit.period, orbit.state, special.value, _TESTS.get(special.kind))


@dataclass(frozen=True)
class Rubbing:
    """One mass with dry friction: ``m x'' + c x' + k x + R sign x' = mean + F cos W t``."""

    mass: float
    damping: float
    stiffness: float
    bound: float
    mean: float
    load: float

    @classmethod
    def random(cls, seed: int) -> Rubbing:
        """Draw one; every second is without damping or without mean."""
        numbers = np.random.default_rng([seed, 771])
        damping, mean = numbers.uniform(0.0, 0.2) * (seed % 2), numbers.uniform(-0.2, 0.2) * (seed // 2 % 2)
        load = numbers.uniform(0.6, 1.5)
        return cls(
            numbers.uniform(0.6, 1.4), damping, numbers.uniform(0.6, 1.4), load * numbers.uniform(0.15, 0.6), mean, load
        )

    @property
    def system(self) -> gw.System:
        """The machine at the beginning of its range."""
        contacts, loads = [gw.friction("f", {"x": 1.0}, self.bound)], [gw.Harmonic(self.load, {"x": 1.0})]
        return gw.System(
            ["x"], [[self.stiffness]], [[self.damping]], [[self.mass]], contacts, {"x": self.mean}, loads, 0.6
        )

    def generator(self, mode: int, pace: np.longdouble) -> np.ndarray:
        """See `located`: the modes are the directions of slip."""
        found = np.zeros((5, 5), dtype=LONG)
        found[2, 3], found[3, 2] = -pace, pace
        if mode:
            found[0, 1] = 1
            found[1] = self.force(mode) / LONG(self.mass)
            found[1, 1] = -LONG(self.damping) / LONG(self.mass)
        return found

    def force(self, side: int) -> np.ndarray:
        """Return the row of the force on the resting mass beyond the bound of a direction."""
        return np.array([-self.stiffness, 0, self.load, 0, LONG(self.mean) - side * LONG(self.bound)], dtype=LONG)

    def value(self, special: SpecialPoint) -> np.longdouble:
        """Return the frequency of a special point with 80 bits; nan where it is none of sliding."""
        orbit, rate = special.orbit, np.eye(5, dtype=LONG)[1][None]
        what, side = getattr(special.kind, "what", ""), 1 if special.contact.endswith("+") else -1
        own = [each for each in orbit.margins if each.what == what and each.side == side]
        if not own or special.kind is Kind.SLIP_ONSET:
            return LONG(np.nan)
        theta = min(own, key=lambda each: abs(each.value) / each.range).theta
        phases = [phase for phase in orbit.friction[0] if phase.length > _BRIEF]
        marks = list[Mark]()
        for before, phase in pairwise([phases[-1], *phases]):
            if before.mode != phase.mode:
                row = rate if before.mode else self.force(phase.mode)[None]
                marks.append(Mark(phase.start, row, phase.mode))
        if what == "stop":
            place = min(
                (number for number, mark in enumerate(marks) if mark.rows is rate),
                key=lambda number: abs(np.angle(np.exp(1j * (marks[number].angle - theta)))),
            )
            before = marks[place - 1].mode
            marks[place] = marks[place]._replace(rows=np.vstack((rate, self.force(-before))))
        marks.sort(key=lambda mark: mark.angle)
        if what != "stop":
            mode = next((mark.mode for mark in reversed(marks) if mark.angle < theta), marks[-1].mode)
            marks.append(Mark(theta, rate if what == "rate" else self.force(side)[None], mode, touches=True))
            marks.sort(key=lambda mark: mark.angle)
        return located(self.generator, marks, orbit.period, orbit.state, special.value)


@dataclass(frozen=True)
class Slipping:
    """One mass with a spring that slips: it does not as long as its amplitude is below ``R/kt``, in closed form."""

    damping: float
    stiffness: float
    spring: float
    bound: float

    @classmethod
    def random(cls, seed: int) -> Slipping:
        """Draw one."""
        numbers = np.random.default_rng([seed, 772])
        return cls(*numbers.uniform((0.02, 0.5, 0.2, 0.3), (0.2, 1.2, 1.0, 0.9)))

    @property
    def system(self) -> gw.System:
        """The machine at the beginning of its range."""
        contacts = [gw.friction("f", {"x": 1.0}, self.bound, stiffness=self.spring)]
        return gw.System(
            ["x"], [[self.stiffness]], [[self.damping]], None, contacts, {}, [gw.Harmonic(1.0, {"x": 1.0})], 0.2
        )

    def value(self, special: SpecialPoint) -> np.longdouble:
        """Return the frequency at which ``kt`` times the amplitude of the motion without slip is R."""
        if special.kind is not Kind.SLIP_ONSET:
            return LONG(np.nan)
        total, damping = LONG(self.stiffness) + LONG(self.spring), LONG(self.damping)
        half, rest = damping**2 / 2 - total, total**2 - (LONG(self.spring) / LONG(self.bound)) ** 2
        roots = [np.sqrt(abs(-half + sign * np.sqrt(half**2 - rest))) for sign in (-1, 1)]
        return min(roots, key=lambda root: abs(root - special.value))

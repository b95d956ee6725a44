"""The forces of contacts as polynomials of the penetration and the rate, and the static springs that follow from them.

Equilibria, the search for orbits and harmonic balance need the forces in this form. For any other law see
`gapwalk.model.static_force`.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, reduce
from operator import itemgetter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gapwalk.model.coefficients import CoefficientLayout, ContactSlots, StageSlots, coefficients_of, layout_of
from gapwalk.model.contact import ContactForm
from gapwalk.model.laws import Law, Stages, StageTerms, Term, closed_form_of
from gapwalk.model.system import System


@dataclass(frozen=True, eq=False)
class ForcePolynomials:
    """Sources of the polynomials of a layout: each term of a law adds to one switch, rate and power.

    A switch is a stage on one side; its penetration is ``xi = sign * x - clearance``.
    """

    #: contacts, signs, clearances: shape (switches,): Contact, side, and slot of the clearance of each switch.
    contacts: NDArray[np.intp]
    signs: NDArray[np.float64]
    clearances: NDArray[np.intp]
    #: Number of switches, of powers of the rate (2 at least), and of powers of the penetration (2 at least).
    shape: tuple[int, int, int]
    _factors: NDArray[np.float64]  # shape (terms,), the terms in the order of their places
    _slots: NDArray[np.intp]  # shape (most factors of a term, terms): the slot after the last one has the value 1
    _places: NDArray[np.intp]  # in the table, as one index

    def table(self, coefficients: NDArray[Any]) -> NDArray[Any]:
        """Return the force of each switch by powers of the rate and of the penetration.

        Shapes: `coefficients` (number of coefficients, ...).
        """
        rest = coefficients.shape[1:]
        known = np.concatenate((coefficients, np.ones((1, *rest))))
        values = reduce(np.multiply, known[self._slots], self._factors.reshape(-1, *(1 for _ in rest)))
        table = np.zeros((math.prod(self.shape), *rest), known.dtype)
        table[self._places[self._first]] = np.add.reduceat(values, self._first)
        return table.reshape(*self.shape, *rest)

    @cached_property
    def _first(self) -> NDArray[np.intp]:
        """The first term of each place."""
        return np.flatnonzero(np.diff(self._places, prepend=-1))

    @property
    def is_damped(self) -> bool:
        """True if the rate occurs."""
        return bool(np.unravel_index(self._places, self.shape)[1].any())

    def integrated(self) -> ForcePolynomials:
        """Integrate the factor of the rate over the deflection, and drop the terms of other rates.

        Its table has one power of the penetration more.
        """
        switch, rate, power = np.unravel_index(self._places, self.shape)
        shape = (self.shape[0], 2, self.shape[2] + 1)
        factors = np.where(rate == 1, self._factors * self.signs[switch] / (power + 1), self._factors)
        places = np.ravel_multi_index((switch, rate, power + rate), shape)
        return replace(self, shape=shape, _factors=factors, _places=places)


Product = tuple[tuple[int, int, int], float, list[int]]
"""A product of coefficients: its switch, rate and power, its factor, and the slots of the coefficients."""


def arranged(
    layout: CoefficientLayout,
    switches: Sequence[tuple[int, StageSlots]],
    products: Sequence[Product],
    shape: tuple[int, int, int] | None = None,
) -> ForcePolynomials:
    """Arrange products of coefficients as polynomials of switches, each with the number of its contact.

    The shape is the smallest one by default.
    """
    terms = sorted(products, key=itemgetter(0))
    if shape is None:
        rates, powers = (1 + max([1, *(place[axis] for place, _, _ in terms)]) for axis in (1, 2))
        shape = (len(switches), rates, powers)
    most = max((len(found) for _, _, found in terms), default=0)
    padded = [[*found, *[len(layout)] * (most - len(found))] for _, _, found in terms]
    places = np.array([place for place, _, _ in terms], dtype=np.intp).reshape(-1, 3)
    return ForcePolynomials(
        np.array([index for index, _ in switches], dtype=np.intp),
        np.array([float(stage.sign) for _, stage in switches]),
        np.array([stage.clearance for _, stage in switches], dtype=np.intp),
        shape,
        np.array([factor for _, factor, _ in terms]),
        np.array(padded, dtype=np.intp).reshape(len(terms), most).T.copy(),
        np.ravel_multi_index(tuple(places.T), shape),
    )


@dataclass(frozen=True, slots=True)
class Slope:
    """A stage on one side of its contact, beyond ``sign * clearance``."""

    stage: str  #: Its name.
    #: sign, clearance: Its side, and its clearance there.
    sign: int
    clearance: float
    #: pull, drag: Coefficients of the powers of its penetration: of its static force, and of what the force grows by
    #: with the rate of the deflection.
    pull: tuple[float, ...]
    drag: tuple[float, ...]
    curved: bool  #: True if they are only tangents at the breakpoint.

    @property
    def stiffness(self) -> float:
        """Slope that the stage adds to the force at its clearance."""
        return self.sign * self.pull[1]

    @property
    def bends(self) -> bool:
        """True if the force is not a linear function of the penetration."""
        return self.curved or any(self.pull[2:])

    @property
    def softens(self) -> bool:
        """True if the slope may decrease with the penetration, or the force begins with a pull inwards."""
        return self.curved or any(self.sign * each < 0.0 for each in (self.pull[0], *self.pull[2:]))

    def depth(self, x: float) -> float:
        """Return the penetration at a deflection; it is negative while the stage is open."""
        return self.sign * x - self.clearance

    def largest_slope(self, force: float) -> float:
        """Estimate the largest slope up to a static force of some size."""
        powers = enumerate(self.pull[1:], start=1)
        return sum(abs(each) ** (1.0 / power) * force ** (1.0 - 1.0 / power) for power, each in powers if each)


_STEP = 1e-150  # of the complex step

Range = tuple[tuple[Slope, ...], float, float]
"""A range of a deflection: the stages that are closed in it, its lower and its upper end."""


@dataclass(frozen=True, eq=False)
class Spring:
    """The spring of a contact."""

    form: ContactForm  #: The contact without its numbers.
    #: deflection, force: shape (n,): The vectors e and d.
    deflection: NDArray[np.float64]
    force: NDArray[np.float64]
    slopes: tuple[Slope, ...]  #: Its stages on each side, from the inside out.

    def pull(self, x: float, closed: tuple[Slope, ...]) -> tuple[float, float]:
        """Return force and slope at a deflection while these stages are closed."""
        force = slope = 0.0
        for each in closed:
            depth = each.depth(x)
            force += _value(each.pull, depth)
            slope += each.sign * _value([power * part for power, part in enumerate(each.pull)][1:], depth)
        return force, slope

    def drag(self, x: float | None, closed: tuple[Slope, ...]) -> float:
        """Return the derivative of the force by the rate of the deflection; by default, just past the clearances."""
        return sum(_value(each.drag, 0.0 if x is None else each.depth(x)) for each in closed)

    def energy(self, x: float) -> float:
        """Return the energy stored at a deflection."""
        parts = [[0.0, *(part / (power + 1) for power, part in enumerate(each.pull))] for each in self.slopes]
        depths = [max(each.depth(x), 0.0) for each in self.slopes]
        found = zip(self.slopes, parts, depths, strict=True)
        return sum(each.sign * _value(part, depth) for each, part, depth in found)

    def closed(self, x: float, margin: float = 0.0) -> tuple[Slope, ...]:
        """Return the stages that are closed at a deflection, beyond a margin."""
        return tuple(each for each in self.slopes if each.depth(x) > margin)

    def innermost(self) -> tuple[Slope, ...]:
        """Return the stage that closes first, on the positive side if there is one."""
        sides = [[each for each in self.slopes if each.sign == sign] for sign in (1, -1)]
        return tuple(next(side for side in sides if side)[:1])

    def first(self, count: int) -> tuple[Slope, ...]:
        """Return the first stages on the positive side; on the other one for a negative count, or where none is."""
        sides = {sign: [each for each in self.slopes if each.sign == sign] for sign in (1, -1)}
        chosen = sides[1 if count > 0 and sides[1] else -1]
        return tuple(chosen[: abs(count)])

    def ranges(self) -> Iterator[Range]:
        """Return the ranges of the deflection in which no stage closes or opens, with the closed stages."""
        up, down = ([each for each in self.slopes if each.sign == sign] for sign in (1, -1))
        for sign, side in ((1, up), (-1, down)):
            ends = [each.clearance for each in side] + [math.inf]
            for count in range(1, len(side) + 1):
                low, high = sorted((sign * ends[count - 1], sign * ends[count]))
                yield tuple(side[:count]), low, high
        yield (), -down[0].clearance if down else -math.inf, up[0].clearance if up else math.inf


def springs_of(system: System) -> tuple[Spring, ...]:
    """Return the springs of all contacts of a system; that of a formula has no stages.

    Where a force law is no polynomial of the penetration, they are its tangents at the breakpoints. Numbers that vary
    over the angle have their mean value.
    """
    springs, coefficients = [], coefficients_of(system)
    for slots in layout_of(system.structure).contacts:
        law, names = slots.form.law, [stage.name for stage, _ in slots.form.sides]
        # a rigid stop has no force until it is reached, and then any
        terms = () if law.rebounds else closed_form_of(law, slots.form.shapes)
        lines = _tangents(slots, coefficients) if terms is None else _polynomials(slots, terms, coefficients)
        slopes = tuple(
            Slope(name, stage.sign, float(coefficients[stage.clearance]), pull, drag, terms is None)
            for name, stage, (pull, drag) in zip(names, slots.stages, lines, strict=True)
        )
        push = system.vector(slots.form.push)
        springs.append(Spring(slots.form, coefficients[slots.deflection], push, slopes))
    return tuple(springs)


_Powers = tuple[tuple[float, ...], tuple[float, ...]]  # of the penetration: without the rate, and with it


def _polynomials(slots: ContactSlots, terms: Iterable[Term], coefficients: NDArray[np.float64]) -> list[_Powers]:
    """Return the force of each stage on each side as polynomials."""
    terms = tuple(terms)
    tables = np.zeros((len(slots.stages), 2, 1 + max([1, *(term.power for term in terms)])))
    for factor, own, of_stage, number, power, rate in terms:
        if rate < 2:  # at rest, higher powers of the rate do nothing
            stage = slots.stages[number]
            found = [*map(slots.numbers.__getitem__, own), *map(stage.numbers.__getitem__, of_stage)]
            tables[number, rate, power] += factor * stage.sign**power * math.prod(coefficients[found].tolist())
    return [(tuple(pull), tuple(drag)) for pull, drag in tables.tolist()]


def _tangents(slots: ContactSlots, coefficients: NDArray[np.float64]) -> list[_Powers]:
    """Return the force of each stage on each side at its breakpoint, with its derivatives, as polynomials."""
    own, found = {name: coefficients[slot] for name, slot in slots.numbers.items()}, []
    for stage in slots.stages:
        numbers = {name: coefficients[slot] for name, slot in stage.numbers.items()}
        modes = _modes_inside(
            slots.form.law, StageTerms(stage.sign, stage.sign * _STEP, 1.0, stage.innermost, numbers), own
        )
        by_depth, by_rate = (
            complex(slots.form.law.force(rate, Stages([terms], modes=modes), own))
            for terms, rate in (
                (StageTerms(stage.sign, 1j * _STEP, 1.0, stage.innermost, numbers), 0.0),
                (StageTerms(stage.sign, 0.0, 1.0, stage.innermost, numbers), 1j * _STEP),
            )
        )
        found.append(((by_depth.real, stage.sign * by_depth.imag / _STEP), (by_rate.imag / _STEP, 0.0)))
    return found


def _modes_inside(law: Law, terms: StageTerms, numbers: Mapping[str, float]) -> list[float]:
    """Return the modes of a law at rest just past a breakpoint."""
    modes = [0.0] * law.mode_count
    for place in range(law.mode_count):  # a guard may depend on earlier modes
        modes[place] = float(law.guards(0.0, Stages([terms], modes=modes), numbers)[place] > 0.0)
    return modes


def _value(polynomial: Sequence[float], x: float) -> float:
    """Evaluate a polynomial by Horner's rule."""
    value = 0.0
    for part in reversed(polynomial):
        value = value * x + part
    return value

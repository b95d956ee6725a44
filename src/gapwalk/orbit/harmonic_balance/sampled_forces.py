"""Forces by formulas along a motion given by its lines: sampled, with as many samples as it takes.

The force ``f(x_1, x_1', x_2, ..., theta)`` of a formula is no polynomial, and has no spectrum in closed form. There are
two ways to compute its lines, with their derivatives by each deflection and each rate, which come from a complex step.

*Evenly*, if the formula is analytic: its lines decrease exponentially, and so do the errors of sampling. The number of
samples is doubled until the upper half of the resolved lines, of the force and of its derivatives, is below 1e-13 of
the largest one: the lines that are folded down are smaller still.

*Between breaks*, if it has kinks (``abs``, ``min``, ``max``, fractional powers), or if its numbers jump over the angle.
The angles of the kinks are found, and Gauss's rule is applied to panels that end there (`panels`). Panels are halved
until the last coefficients of Legendre's series, weighed by the length of the panel, are below 1e-12 of the largest.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np
from numpy.polynomial import Polynomial, legendre
from numpy.typing import NDArray

from gapwalk.errors import NumericalError
from gapwalk.flow.forces import Angles, contact_force, is_at_high, stages_of
from gapwalk.model.coefficients import CoefficientLayout, ContactSlots
from gapwalk.orbit.harmonic_balance.linear_part import ForcesLessShares, Share, firsts_of, jumps_of, waves

# Spectra of periodic functions with kinks and jumps at known angles, by Gauss's rule on panels between these.
#
# Beside a kink a function may behave as a fractional power of the distance, as the force of Hertz. There the panels
# are stretched: with the distance proportional to the fourth power of the variable of integration, multiples of a half
# become even powers. Panels are halved until each is resolved, so that two kinks may be close together.

_NODES, _WEIGHTS = legendre.leggauss(20)
_LAST = 3  # coefficients of Legendre's series that show what is not resolved
_STRETCH = 4
_HALVINGS = 40
_RESOLVED = 1e-12  # what each panel may leave unresolved, relative to the integral of the largest value
_BATCH = 2_000_000  # numbers in one matrix of waves


class Panels(NamedTuple):
    """Panels between angles, and whether a break is at their ends; arrays of the same length."""

    low: NDArray[np.float64]
    high: NDArray[np.float64]
    begins: NDArray[np.bool_]
    ends: NDArray[np.bool_]

    def halves(self) -> Panels:
        """Halve all panels."""
        middle, none = 0.5 * (self.low + self.high), np.zeros(len(self.low), dtype=bool)
        both = (self.low, middle), (middle, self.high), (self.begins, none), (none, self.ends)
        return Panels(*(np.concatenate(pair) for pair in both))


def spectra_between(
    breaks: NDArray[np.float64],
    count: int,
    longest: int,
    values_at: Callable[[NDArray[np.float64]], tuple[NDArray[np.float64], NDArray[np.float64]]],
) -> tuple[NDArray[np.complex128], float]:
    """Compute the spectra, k = 0 ... longest, of some functions, and what is left unresolved of them."""
    panels, largest, left = _even(breaks, count), 0.0, 0.0
    result: NDArray[np.complex128] = np.zeros((1, longest + 1), dtype=complex)
    for halving in range(_HALVINGS + 1):
        width = panels.high - panels.low
        share, slope = _places(panels)
        phi = panels.low[:, None] + width[:, None] * share
        values, factors = values_at(phi.ravel())
        values = values.reshape(len(values), *phi.shape)
        largest = largest or float((factors * np.abs(values).max(axis=(1, 2))).max())
        coefficients = (values * slope) @ _last_coefficients()
        off = (factors[:, None] * np.abs(coefficients).max(axis=2)).max(axis=0) * width * (count / (2.0 * np.pi))
        coarse = off > _RESOLVED * largest
        if halving == _HALVINGS:
            left, coarse = float(off.max()) / (largest or 1.0), np.zeros_like(coarse)
        fine = ~coarse
        weights = (0.5 * _WEIGHTS) * slope[fine] * width[fine, None]
        result = result + _spectra(phi[fine].ravel(), (values[:, fine] * weights).reshape(len(values), -1), longest)
        if not coarse.any():
            break
        low, high, begins, ends = panels
        panels = Panels(low[coarse], high[coarse], begins[coarse], ends[coarse]).halves()
    return result, left


def _even(breaks: NDArray[np.float64], count: int) -> Panels:
    """Make panels of about the same length that end at breaks."""
    if not len(breaks):
        knots = 2.0 * np.pi * np.arange(count + 1) / count
        none = np.zeros(count, dtype=bool)
        return Panels(knots[:-1], knots[1:], none, none)
    parts = []
    for low, high in zip(breaks, np.append(breaks[1:], breaks[0] + 2.0 * np.pi), strict=True):
        number = max(1, int(np.ceil(count * (high - low) / (2.0 * np.pi))))
        knots = low + (high - low) * np.arange(number + 1) / number
        knots[-1] = high
        parts.append((knots[:-1], knots[1:], np.arange(number) == 0, np.arange(number) == number - 1))
    return Panels(*(np.concatenate(each) for each in zip(*parts, strict=True)))


def _places(panels: Panels) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the places of the nodes within the panels, from 0 to 1, and their derivatives; shape (panels, nodes)."""
    share, slope = np.empty((2, len(panels.low), len(_NODES)))
    for begins in (False, True):
        for ends in (False, True):
            here = (panels.begins == begins) & (panels.ends == ends)
            share[here], slope[here] = _stretched(begins, ends)
    return share, slope


@lru_cache(maxsize=4)
def _stretched(begins: bool, ends: bool) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the place within a panel and its derivative, at the nodes; breaks are at one of its ends, or both."""
    t = 0.5 + 0.5 * _NODES
    if begins and ends:  # the integral of (t (1 - t))**3, normalised
        polynomial = Polynomial([0.0, 0.0, 0.0, 0.0, 35.0, -84.0, 70.0, -20.0])
        return polynomial(t), polynomial.deriv()(t)
    if begins:
        return t**_STRETCH, _STRETCH * t ** (_STRETCH - 1)
    if ends:
        return 1.0 - (1.0 - t) ** _STRETCH, _STRETCH * (1.0 - t) ** (_STRETCH - 1)
    return t, np.ones_like(t)


@lru_cache(maxsize=1)
def _last_coefficients() -> NDArray[np.float64]:
    """Return the matrix from values at the nodes to the last coefficients of Legendre's series."""
    count = len(_NODES)
    rows = legendre.legvander(_NODES, count - 1)[:, -_LAST:] * _WEIGHTS[:, None]
    return rows * (np.arange(count - _LAST, count) + 0.5)


def _spectra(phi: NDArray[np.float64], weighted: NDArray[np.float64], longest: int) -> NDArray[np.complex128]:
    """Return the spectra of functions, from their values at angles times the weights of these."""
    result: NDArray[np.complex128] = np.zeros((len(weighted), longest + 1), dtype=complex)
    size = max(1, _BATCH // (longest + 1))
    for first in range(0, len(phi), size):
        part = slice(first, first + size)
        result += weighted[:, part] @ np.exp(-1j * np.multiply.outer(phi[part], np.arange(longest + 1)))
    return result / (2.0 * np.pi)


# Zeros of many functions of the angle at once, by Newton's method within brackets on a grid.

Array = NDArray[np.float64]
Function = Callable[[Array, NDArray[np.intp]], tuple[Array, Array]]
"""It has angles, and the number of the bracket or interval of each; it returns values and slopes."""

ASIDE = 1e-6
"""Radians to another angle, for a rough second derivative."""

_ITERATIONS = 60  # bisection alone would need about 50; Newton's method takes 4
_TOLERANCE = 2e-15


def zeros_on(
    function: Function, phi: Array, which: NDArray[np.intp], opens: NDArray[np.bool_]
) -> tuple[list[int], list[float]]:
    """Return the zeros of a function between neighbouring points, each after the number of the point before it."""
    # Two zeros between two points are found, too, if the slopes there point to an extremum beyond zero.
    value, slope = function(phi, which)
    above, cells = value > 0.0, np.flatnonzero(opens)
    changes = cells[above[cells] != above[cells + 1]]
    same = cells[above[cells] == above[cells + 1]]
    side, width = np.where(above[same], 1.0, -1.0), phi[same + 1] - phi[same]
    dips = (side * slope[same] < 0.0) & (side * slope[same + 1] > 0.0)
    dips &= np.minimum(abs(value[same]), abs(value[same + 1])) < width * np.maximum(
        abs(slope[same]), abs(slope[same + 1])
    )
    same, side = same[dips], side[dips]
    low, high, numbers = phi[changes], phi[changes + 1], changes
    if len(same):
        pieces = which[same]

        def turned(phi: Array, each: NDArray[np.intp]) -> tuple[Array, Array]:
            now = function(phi, pieces[each])[1]
            return now, (function(phi + ASIDE, pieces[each])[1] - now) / ASIDE

        middle = roots(turned, phi[same], phi[same + 1])
        beyond = side * function(middle, pieces)[0] < 0.0
        same, middle = same[beyond], middle[beyond]
        low, high = np.concatenate((low, phi[same], middle)), np.concatenate((high, middle, phi[same + 1]))
        numbers = np.concatenate((changes, same, same))
    found = roots(lambda phi, each: function(phi, which[numbers[each]]), low, high)
    return numbers.tolist(), found.tolist()


def roots(function: Function, low: Array, high: Array) -> Array:
    """Return a zero of a function between each two angles at which its signs differ, all at once."""
    # By Newton's method, or bisection where that leaves the bracket. The function has angles with the numbers of their
    # brackets, and returns its values and its slopes, which may be rough.
    if not len(low):
        return low
    low, high, each = low.copy(), high.copy(), np.arange(len(low))
    rises = function(high, each)[0] > 0.0
    found = 0.5 * (low + high)
    phi = found.copy()
    for _ in range(_ITERATIONS):
        value, slope = function(phi, each)
        above = (value > 0.0) == rises[each]
        high[each[above]], low[each[~above]] = phi[above], phi[~above]
        with np.errstate(all="ignore"):
            following = phi - value / slope
        inside = (following >= low[each]) & (following <= high[each])
        following = np.where(inside, following, 0.5 * (low[each] + high[each]))
        found[each] = following
        going = np.abs(following - phi) > _TOLERANCE
        if not going.any():
            break
        each, phi = each[going], following[going]
    return found


_STEP = 1e-150  # of the complex step
_FOLDED = 1e-13  # largest line of the upper half, relative to the largest one
_TINY = 1e-300
_FEWEST = 64
_MOST = 1 << 15  # samples; for more than 512 lines, 64 for each line
_ASIDE = 1e-9  # radians from a jump, at which the levels beside it are read
_APPROACH = 2.0 * np.outer(0.4 ** np.arange(10), [-1.0, 1.0]).ravel()  # to a fractional power, over the lines


class Pairs(NamedTuple):
    """The derivatives of forces by formulas along a motion, by each deflection that they depend on, and its rate."""

    #: forces, arguments: shape (pairs,): Number of the deflection with which the force acts, and of the one that it
    #: depends on.
    forces: NDArray[np.intp]
    arguments: NDArray[np.intp]
    #: shape (pairs, 2, 2K + 1): Spectra, k = 0 ... 2K, of the derivative by the deflection and of that by its rate.
    spectra: NDArray[np.complex128]

    def and_those(self, others: Pairs) -> Pairs:
        """Return these, followed by others."""
        return Pairs(
            np.concatenate((self.forces, others.forces)),
            np.concatenate((self.arguments, others.arguments)),
            np.concatenate((self.spectra, others.spectra)),
        )


class Sampled(NamedTuple):
    """Lines of the forces by formulas."""

    places: NDArray[np.intp]  #: shape (formulas,): Number of the deflection with which each acts.
    lines: NDArray[np.complex128]  #: shape (formulas, 2K + 1): The lines k = 0 ... 2K.
    #: shape (formulas, K + 1): Their derivatives by the parameter, with the motion constant.
    slopes: NDArray[np.complex128]
    pairs: Pairs  #: The derivatives by the motion.
    #: The angles phi, in order, at which a kink is passed or a number jumps, and some that approach fractional powers,
    #: beside which an integration needs steps that become smaller and smaller.
    breaks: NDArray[np.float64]


class Formulas(ForcesLessShares):
    """The forces by formulas."""

    def sample(self, lines: NDArray[np.complex128], period: int) -> Sampled:
        """Compute the lines of all forces along deflections with some lines, shape (deflections, K + 1)."""
        places, found, slopes, pairs, breaks = [], [], [], [], [np.zeros(0)]
        for place, slots in formulas_in(self.layout):
            curve = self._along(place, slots, lines, period)
            spectra, kinks = curve.between_breaks() if curve.is_broken else (curve.evenly(), np.zeros(0))
            spectra[:2, 1:] *= 2.0
            places.append(place)
            found.append(spectra[0])
            slopes.append(spectra[1, : lines.shape[1]])
            pairs += [(place, place + each, spectra[2 + 2 * each :][:2]) for each in range(len(slots.deflections))]
            breaks.append(kinks)
            if slots.form.law.has_edges:
                breaks.append((kinks[:, None] + _APPROACH / lines.shape[1]).ravel() % (2.0 * np.pi))
        forces, arguments, derivatives = zip(*pairs, strict=True)
        several = Pairs(np.array(forces), np.array(arguments), np.array(derivatives))
        return Sampled(np.array(places), np.array(found), np.array(slopes), several, np.sort(np.concatenate(breaks)))

    def tangents(self, lines: NDArray[np.complex128], phi: NDArray[np.float64], period: int) -> NDArray[np.float64]:
        """Return the derivatives at some angles, shape (pairs, 2, angles): by each deflection, and by its rate."""
        found = []
        for place, slots in formulas_in(self.layout):
            curve = self._along(place, slots, lines, period)
            found.append(curve.values(phi)[2:].reshape(-1, 2, len(phi)))
        return np.concatenate(found)

    def _along(self, place: int, slots: ContactSlots, lines: NDArray[np.complex128], period: int) -> _Curve:
        """Return one formula along a motion."""
        shares = tuple(share for share in self.shares if share.place == place)
        return _Curve(self, slots, lines[place : place + len(slots.deflections)], period, shares)


@dataclass(frozen=True, eq=False)
class _Curve:
    """One formula along one motion, with the lines of its deflections."""

    formulas: Formulas
    slots: ContactSlots
    lines: NDArray[np.complex128]
    period: int
    shares: tuple[Share, ...]

    @property
    def is_broken(self) -> bool:
        """True if the formula has kinks, or if its numbers jump."""
        return bool(self.slots.form.law.mode_count or self._cycles)

    @cached_property
    def _cycles(self) -> list[int]:
        """The cycles of its numbers."""
        return sorted({number for wave in self.slots.waves.values() for number, _ in wave.cycles})

    @cached_property
    def rates(self) -> NDArray[np.complex128]:
        """The lines of the rates over time."""
        return self.lines * (1j * np.arange(self.lines.shape[1]) / (self.period * self.formulas.coefficients[0]))

    @cached_property
    def _sizes(self) -> NDArray[np.float64]:
        """Factors by which the force and its derivatives are compared."""
        # A derivative counts by the force that belongs to a change as large as the motion, that by a parameter not.
        sums = [np.abs(each).sum(axis=1) for each in (self.lines, self.rates)]
        return np.array([1.0, 0.0, *np.stack(sums, axis=1).ravel()])

    def evenly(self) -> NDArray[np.complex128]:
        """Return spectra of the force, of its derivative by the parameter, and of those by each deflection and rate."""
        count = self.lines.shape[1] - 1
        samples = max(_FEWEST, 1 << (8 * count - 1).bit_length())
        while True:
            x, v = (np.fft.irfft(_halved(each) * samples, samples) for each in (self.lines, self.rates))
            phi = 2.0 * np.pi * np.arange(samples) / samples
            spectra = np.fft.rfft(self._values(phi, x, v)) / samples
            sizes = np.abs(spectra)
            folded, largest = ((self._sizes * each.max(axis=1)).max() for each in (sizes[:, samples // 4 :], sizes))
            unresolved = float(folded / max(largest, _TINY))
            if unresolved <= _FOLDED:
                return spectra[:, : 2 * count + 1].copy()
            if samples >= max(_MOST, 64 * count):
                raise self._too_fast(f"{samples} samples", unresolved)
            samples *= 2

    def between_breaks(self) -> tuple[NDArray[np.complex128], NDArray[np.float64]]:
        """Return the same spectra, and the angles phi of the breaks."""
        count = self.lines.shape[1] - 1
        kinks, jumps = self._kinks(max(_FEWEST, 16 * count)), self._jumps
        breaks = np.unique(np.concatenate((kinks, jumps[0])) % (2.0 * np.pi))

        def values_at(phi: NDArray[np.float64]):
            x, v = self._motion(phi)
            return self._values(phi, x, v), self._sizes

        spectra, unresolved = spectra_between(breaks, max(8, 2 * count), 2 * count, values_at)
        if unresolved:
            raise self._too_fast("panels between its kinks", unresolved)
        if jumps[1].any():
            spectra[1] += self._moved_jumps(*jumps, 2 * count)
        return spectra, breaks

    def values(self, phi: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the force, its derivative by the parameter, and those by each deflection and rate, at some angles."""
        return self._values(phi, *self._motion(phi))

    def _motion(self, phi: NDArray) -> tuple[NDArray, NDArray]:
        """Return the deflections and their rates at some angles, shape (arguments, angles)."""
        turns = waves(phi, self.lines.shape[1] - 1)
        return (turns @ self.lines.T).real.T, (turns @ self.rates.T).real.T

    def _values(
        self, phi: NDArray[np.float64], x: NDArray[np.float64], v: NDArray[np.float64], levels: list[bool] | None = None
    ) -> NDArray[np.float64]:
        """Return the force and its derivatives, also at one end of a jump, which the levels say."""
        slots, known = self.slots, self.formulas
        moves, stepped = list(zip(x, v, strict=True)), 1j * _STEP
        theta = self.period * phi if slots.waves else 0.0
        here = Angles(known.layout, known.coefficients, theta, levels)
        # over time, the rate is that over theta times the frequency, which may be the parameter
        faster = 1.0 - stepped * known.slope[0] / known.coefficients[0]
        with np.errstate(all="ignore"):
            moved = Angles(known.layout, known.coefficients + stepped * known.slope, theta, levels)
            found = [self._force(moved, [(x, v * faster) for x, v in moves])]
            for place, (deflection, rate) in enumerate(moves):
                for beside in ((deflection + stepped, rate), (deflection, rate + stepped)):
                    found.append(self._force(here, [*moves[:place], beside, *moves[place + 1 :]]))
        values = np.array([np.broadcast_to(each, x.shape[1:]) for each in found], dtype=complex)
        result = np.concatenate((np.real(values[:1]), np.imag(values) / _STEP))
        if not np.isfinite(result).all():
            raise NumericalError(f"the formula of the force {slots.form.name!r} has no value along the motion")
        return result

    def _force(self, angles: Angles, moves: list[tuple[NDArray, NDArray]]) -> NDArray:
        """Return the force without its share."""
        (x, rate), force = moves[0], contact_force(self.slots, angles, moves)
        return force - sum(share.spring * x + share.damper * rate for share in self.shares)

    def _guards(self, phi: NDArray) -> NDArray:
        """Return the guards of all modes at some angles, shape (modes, angles); complex for complex steps of phi."""
        known, slots = self.formulas, self.slots
        turns = waves(phi, self.lines.shape[1] - 1)
        k = 1j * np.arange(self.lines.shape[1])
        moves = []
        for lines, rates in zip(self.lines, self.rates, strict=True):
            values = [(turns @ each).real + 1j * _STEP * (turns @ (k * each)).real for each in (lines, rates)]
            moves.append((values[0], values[1]))
        theta = self.period * (phi + 1j * _STEP) if slots.waves else 0.0
        angles = Angles(known.layout, known.coefficients, theta)
        with np.errstate(all="ignore"):
            stages = stages_of(slots, angles, moves)
            found = slots.form.law.guards(moves[0][1], stages, angles.named(slots.numbers, slots.waves))
        return np.array([np.broadcast_to(each, phi.shape) for each in found], dtype=complex)

    def _kinks(self, cells: int) -> NDArray[np.float64]:
        """Return the angles at which a guard changes its sign, bracketed on a grid, by Newton's method or bisection."""
        if not self.slots.form.law.mode_count:
            return np.zeros(0)
        grid = 2.0 * np.pi * np.arange(cells + 1) / cells
        above = np.real(self._guards(grid)) > 0.0
        modes, places = np.nonzero(above[:, 1:] != above[:, :-1])
        if not len(modes):
            return np.zeros(0)
        low, high, rises = grid[places], grid[places + 1], above[modes, places + 1]
        phi, each = 0.5 * (low + high), np.arange(len(modes))
        for _ in range(_ITERATIONS):
            values = self._guards(phi)[modes, each]
            right = (np.real(values) > 0.0) == rises
            low, high = np.where(right, low, phi), np.where(right, phi, high)
            with np.errstate(all="ignore"):
                following = phi - np.real(values) / (np.imag(values) / _STEP)
            following = np.where((following > low) & (following < high), following, 0.5 * (low + high))
            change, phi = np.abs(following - phi).max(), following
            if change < 1e-15 * 2.0 * np.pi:
                break
        return np.sort(phi)

    @property
    def _jumps(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """The angles phi at which its numbers jump, and their derivatives by the parameter."""
        known, gates = self.formulas, [frozenset([cycle]) for cycle in self._cycles]
        if not gates:
            return np.zeros(0), np.zeros(0)
        jumps = jumps_of(known.layout, gates, known.coefficients, known.slope)
        return jumps.over(self.period)[0], np.tile(jumps.slopes, self.period) / self.period

    def _moved_jumps(
        self, angles: NDArray[np.float64], moves: NDArray[np.float64], longest: int
    ) -> NDArray[np.complex128]:
        """Return the change of the spectrum of the force if the angles of jumps move."""
        known = self.formulas
        result: NDArray[np.complex128] = np.zeros(longest + 1, dtype=complex)
        for phi, move in zip(angles, moves, strict=True):
            at, forces = np.array([phi]), []
            for theta in (self.period * phi - _ASIDE, self.period * phi + _ASIDE):
                levels = [bool(is_at_high(cycle, known.coefficients, theta)) for cycle in known.layout.cycles]
                forces.append(self._values(at, *self._motion(at), levels)[0, 0])
            result += move * (forces[0] - forces[1]) * np.exp(-1j * phi * np.arange(longest + 1))
        return result / (2.0 * np.pi)

    def _too_fast(self, what: str, unresolved: float) -> NumericalError:
        return NumericalError(
            f"{what} leave {unresolved:.2g} of the force {self.slots.form.name!r} unresolved; its formula changes too "
            "fast for harmonic balance: use the method shooting"
        )


def formulas_in(layout: CoefficientLayout) -> list[tuple[int, ContactSlots]]:
    """Return each force by a formula, after the number of the deflection with which it acts."""
    contacts = zip(firsts_of(layout.structure), layout.contacts, strict=True)
    laws = ((place, slots, slots.form.law) for place, slots in contacts)
    return [(place, slots) for place, slots, law in laws if not law.stage_parameters and not law.is_dry]


def _halved(lines: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Return the spectra, k = 0 ... K, of lines."""
    spectra = 0.5 * lines
    spectra[:, 0] *= 2.0
    return spectra


NO_PAIRS = Pairs(np.zeros(0, np.intp), np.zeros(0, np.intp), np.zeros((0, 2, 1), complex))
"""The pairs of a system without formulas."""

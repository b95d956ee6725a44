"""Static equilibria of a system under its mean load alone, with the clearances that are open there.

An equilibrium is a position in which all static forces balance: that of least energy, or one for each combination of
closed stages.

Method: docs/numerics/notes/tori.md
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise, product
from typing import Any, NamedTuple

import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import NDArray

from gapwalk.bracketed_root import find_root
from gapwalk.errors import ConvergenceError
from gapwalk.model.coefficients import coefficients_of, layout_of, static_load
from gapwalk.model.laws.formula import MEAN_SLIP
from gapwalk.model.spring import Range, Slope, Spring, springs_of
from gapwalk.model.static_force import StaticForce, formula_matrices, formulas_of, static_forces_of
from gapwalk.model.system import System

# Search for positions in which the static forces of any laws balance: by all roots of polynomials, or from samples.
#
# One coordinate with polynomial forces has all its rests among the real roots. Otherwise sign changes of the force are
# bracketed on a fine grid (one coordinate), or Newton's method starts from many points (several): some may be missed.

_OCTAVES = np.arange(-100, 101)  # lengths that are tried, as powers of two of the unit of length
_PER_OCTAVE = 24  # points of the grid of one coordinate
_BENDS = 0.3  # relative change of the slope at which a force is no longer linear
_WIDE, _EVEN = 32.0, 4001  # half-width of an even grid, in the smallest length at which a force bends; its points
_STARTS, _FEW, _WORK = 256, 8, 20_000  # most and fewest starts of Newton's method; starts times coordinates squared
_BOX = 4.0  # half-width of the box of starts, in lengths at which a force bends
_DECADES = 20.0  # powers of two by which starts of all magnitudes differ
MOST = 9
"""Rests by formulas that are listed, those nearest to zero: a pendulum may have any number."""

_ITERATIONS, _HALVINGS = 60, 14
_ROUNDED = 1e-7  # smallest displacement of a rest, as a share of its distance from zero
_BALANCED = 1e-11  # unbalanced force, as a share of the sum of all forces, that is rounding
_ROUNDING = 1e-13  # of a polynomial, as a share of the sum of its terms
_SOLVED = 1_000  # combinations of stages whose polynomials are solved


def balance_of(system: System) -> StaticBalance:
    """Return the static forces of a system under its mean load."""
    return StaticBalance(system.matrix("stiffness"), static_load(system), static_forces_of(system), springs_of(system))


class Unbalanced(NamedTuple):
    """The unbalanced static force."""

    #: force, sizes: shape (..., n): The force, and the sum of the sizes of all its parts.
    force: NDArray[np.float64]
    sizes: NDArray[np.float64]
    slope: NDArray[np.float64]  #: shape (..., n, n): Its derivative by the position.


@dataclass(frozen=True, eq=False)
class StaticBalance:
    """The static forces of a system with contacts by any laws."""

    #: stiffness, load: shapes (n, n), (n,): Stiffness matrix and constant load.
    stiffness: NDArray[np.float64]
    load: NDArray[np.float64]
    forces: Sequence[StaticForce]  #: All contacts.
    springs: Sequence[Spring]  #: The springs of all contacts.

    def unbalanced(self, q: NDArray[np.float64]) -> Unbalanced:
        """Compute the unbalanced force at positions of shape (..., n)."""
        force, sizes = q @ self.stiffness.T - self.load, np.abs(q) @ np.abs(self.stiffness.T) + np.abs(self.load)
        slope = np.broadcast_to(self.stiffness, (*force.shape, len(self.load))).copy()
        for each in self.forces:
            own, stiffness, _ = each.at(q)
            force = force + own[..., None] * each.direction
            # terms of one formula that cancel each other are seen in its slopes
            terms = np.abs(own) + (np.abs(stiffness) * np.abs(q @ each.deflections.T)).sum(axis=-1)
            sizes = sizes + terms[..., None] * np.abs(each.direction)
            slope += each.direction[:, None] * (stiffness @ each.deflections)[..., None, :]
        return Unbalanced(force, sizes, slope)

    def restoring(self, x: NDArray[np.float64], way: NDArray[np.float64], share: float = 1e-3) -> int:
        """Return the sign of the force that pulls back from a small displacement of a rest along a direction.

        1 if it pulls back on both sides, -1 if it pushes away on one, 0 if there is none on one side. A slope may be
        zero at a rest, or different on both sides of it.

        Shapes: `x`, `way` (n,).
        """
        lengths = self.lengths[self.lengths > 0.0]
        step = max(share * float(lengths.min() if len(lengths) else 1.0), _ROUNDED * float(np.abs(x).max()))
        signs = []
        for sign in (1.0, -1.0):
            force, sizes, _ = self.unbalanced(x + sign * step * way)
            nothing = not np.isfinite(force).all() or np.abs(force).max() <= _BALANCED * sizes.max()
            signs.append(0 if nothing else int(np.sign(sign * force @ way)))
        return min(signs) if min(signs) < 0 else min(signs, key=abs)

    def rests(self) -> tuple[list[NDArray[np.float64]], bool]:
        """Return positions in which all forces balance, and True if there are no others."""
        if len(self.load) > 1:
            return self._from_samples(), False
        roots = self._polynomial_roots()
        if roots is not None:
            return [np.array([root]) for root in roots], True
        return [np.array([root]) for root in self._bracketed()], False

    # -- one coordinate ------------------------------------------------------------------------------------------------

    def _polynomial_roots(self) -> list[float] | None:
        """Return all rests of one coordinate; None if a force is no polynomial, or there are too many ranges."""
        formulas = [each for each in self.forces if each.is_formula]
        springs = [spring for spring in self.springs if spring.slopes]
        if any(each.statics is None for each in formulas) or any(s.curved for each in springs for s in each.slopes):
            return None
        if sum(len(spring.slopes) + 1 for spring in springs) > _SOLVED:
            return None
        linear = Polynomial([-self.load[0], self.stiffness[0, 0]])
        for each in formulas:
            for powers, factor in (each.statics or {}).items():
                moved = math.prod(e**power for e, power in zip(each.deflections[:, 0], powers, strict=True))
                linear = linear + each.direction[0] * factor * moved * Polynomial.basis(sum(powers))
        # between the breakpoints of all contacts, ordered along the coordinate
        ends = sorted(
            {slope.sign * slope.clearance / float(each.deflection[0]) for each in springs for slope in each.slopes}
        )
        found: list[float] = []
        for low, high in pairwise([-math.inf, *ends, math.inf]):
            inside = _between(low, high)
            total = linear
            for spring in springs:
                e = float(spring.deflection[0])
                for slope in spring.closed(e * inside):
                    depth = Polynomial([-slope.clearance, slope.sign * e])
                    for power, part in enumerate(slope.pull):
                        total = total + float(spring.force[0]) * part * depth**power
            if not total.coef.any():  # free to move in this range
                found.append(min(max(0.0, low), high))
                continue
            found += [root for root in real_roots(total) if low <= root <= high]
        return _different(found)

    def _bracketed(self) -> list[float]:
        """Return rests of one coordinate at which the force changes its sign on a grid of all magnitudes."""

        def force(x: float) -> float:
            return float(self.unbalanced(np.array([x]))[0].item())

        sizes = np.exp2(np.arange(_OCTAVES[0], _OCTAVES[-1], 1.0 / _PER_OCTAVE))
        ends = [s.sign * s.clearance / float(each.deflection[0]) for each in self.springs for s in each.slopes]
        even = [length * np.linspace(-_WIDE, _WIDE, _EVEN) for length in self.lengths[:, 0]]
        grid = np.unique(np.concatenate((-sizes, [0.0], sizes, ends, *even)))
        values = self.unbalanced(grid[:, None])[0][:, 0]
        grid, values = grid[np.isfinite(values)], values[np.isfinite(values)]
        still = np.flatnonzero(values == 0.0)
        found = []
        if len(still):  # of neighbours that all are rests, that nearest to zero
            for group in np.split(still, np.flatnonzero(np.diff(still) > 1) + 1):
                found.append(min(grid[group].tolist(), key=abs))
        signs = np.sign(values)
        changes = np.flatnonzero(signs[:-1] * signs[1:] < 0.0)
        for place in changes[np.argsort(np.abs(grid[changes]), kind="stable")].tolist():
            if len(found) > 2 * MOST:
                break
            low, high = grid[place : place + 2].tolist()
            root = _bracket(force, low, high)
            if abs(force(root)) <= min(abs(values[place]), abs(values[place + 1])):  # and no pole
                found.append(root)
        return _different(found)

    # -- several coordinates -------------------------------------------------------------------------------------------

    @cached_property
    def speeds(self) -> NDArray[np.float64]:
        """The smallest rates of each coordinate at which formulas bend, shape (any, n)."""
        return self._by_coordinate((each, [_bend(each, of_rates=True)]) for each in self.forces if each.is_formula)

    def _by_coordinate(self, found: Iterable[tuple[StaticForce, Sequence[float]]]) -> NDArray[np.float64]:
        """Return the change of each coordinate that alone causes some changes of deflections."""
        rows = []
        for each, sizes in found:
            largest = np.abs(each.deflections).max(axis=0)
            moved = largest > 0.0
            rows += [np.where(moved, size / np.where(moved, largest, 1.0), 0.0) for size in sizes if size]
        return np.array(rows).reshape(-1, len(self.load))

    def peak_loads(self, system: System) -> NDArray[np.float64]:
        """Return the largest size of what the loads add to the mean load, shape (n,).

        Displacements that are prescribed count with the slopes at zero.
        """
        layout, coefficients, n = layout_of(system.structure), coefficients_of(system), len(self.load)
        driving = coefficients[layout.accelerations][:, 2 * n + len(layout.contacts) + 1 :]
        peak = np.abs(system.matrix("mass") @ driving).sum(axis=1)
        for each in self.forces:
            slopes = each.at(np.zeros(n)).stiffness
            for name, slope in zip(each.form.law.arguments, slopes, strict=True):
                if name in each.slots.waves and np.isfinite(slope):
                    sway = np.abs(coefficients[each.slots.waves[name].lines]).sum()
                    peak += np.abs(slope * each.direction) * sway
        return peak

    @cached_property
    def lengths(self) -> NDArray[np.float64]:
        """Changes of each coordinate at which a formula bends, a stage begins or another force leads: (any, n)."""
        own = self._by_coordinate(
            (each, [_bend(each), *each.clearances] if each.is_formula else each.clearances) for each in self.forces
        )
        return np.vstack((own, *self._leads()))

    def _leads(self) -> Iterator[NDArray[np.float64]]:
        """Return changes of one coordinate at which the largest part of its balance becomes another one, in rows.

        The parts are the load, the linear terms of the stiffness matrix, and each contact: it does not matter which of
        them has a term that others balance.
        """
        still = [float(each.at(np.zeros(len(self.load))).force) for each in self.forces]
        load = self.load - sum(f * each.direction for f, each in zip(still, self.forces, strict=True))
        moved = [
            np.abs(each.deflections).max(axis=0) * np.abs(each.direction) for each in self.forces if each.is_formula
        ]
        sizes = np.exp2(_OCTAVES.astype(float))
        for place in np.flatnonzero(np.sum(moved, axis=0)) if moved else ():
            way = np.eye(len(self.load))[place]
            parts = [np.full(len(sizes), abs(load[place])), abs(self.stiffness[place, place]) * sizes]
            for at_rest, each in zip(still, self.forces, strict=True):
                both = [each.at(sign * sizes[:, None] * way).force - at_rest for sign in (1.0, -1.0)]
                parts.append(np.abs(each.direction[place]) * np.abs(both).max(axis=0))
            known = np.isfinite(parts).all(axis=0)
            leading = np.argmax(np.array(parts)[:, known], axis=0)
            changes = sizes[known][1:][leading[1:] != leading[:-1]]
            yield changes[:, None] * way

    def near(self, rests: Sequence[NDArray[np.float64]]) -> list[NDArray[np.float64]]:
        """Return the rests that are not far from zero, at least one; a pendulum has any number of others."""
        rests = sorted(rests, key=lambda x: float(np.abs(x).max()))
        reach = _BOX * self.lengths.max(axis=0, initial=0.0)
        return [x for place, x in enumerate(rests) if not place or (np.abs(x) <= reach).all()]

    def _starts(self) -> NDArray[np.float64]:
        """Return starts: zero, even samples of boxes, and samples of all magnitudes, shape (starts, n)."""
        from scipy.stats import qmc  # slow to import

        n = len(self.load)
        count = 1 << (min(max(_WORK // n**2, _FEW), _STARTS) - 1).bit_length()
        lengths, rng = self.lengths, np.random.default_rng(0)
        largest = np.max(lengths, axis=0, initial=0.0)
        points = 2.0 * qmc.Sobol(2 * n, rng=rng).random(count) - 1.0
        where, magnitude = points[:, :n], np.exp2(_DECADES * points[:, n:])
        for place, own in enumerate(lengths.T):
            one = own[own > 0.0] if own.any() else np.zeros(1)
            where[0::4, place] *= _BOX * rng.choice(one, len(where[0::4]))
            where[2::4, place] *= rng.choice(one, len(where[2::4]))
        where[1::4] *= _BOX * largest
        where[3::4] *= magnitude[3::4] * largest  # forces such as logarithms have no length of their own
        return np.vstack((np.zeros(n), where))

    def _from_samples(self) -> list[NDArray[np.float64]]:
        """Find positions of balance by Newton's method with shortened steps, from all starts at once."""
        x = self._starts()
        force, sizes, slope = self.unbalanced(x)
        done = [x[:0]]
        for _ in range(_ITERATIONS):
            balanced = np.abs(force).max(axis=1) <= _BALANCED * sizes.max(axis=1)
            done.append(x[balanced])
            going = ~balanced & np.isfinite(force).all(axis=1) & np.isfinite(slope).all(axis=(1, 2))
            x, force, slope = x[going], force[going], slope[going]
            if not len(x):
                break
            step = _steps(slope, force)
            before, moved = np.linalg.norm(force, axis=1), np.zeros(len(x), dtype=bool)
            force, sizes = force.copy(), np.zeros_like(force)
            share = 1.0
            for _ in range(_HALVINGS):
                (left,) = np.nonzero(~moved)
                other = x[left] + share * step[left]
                found = self.unbalanced(other)
                better = np.linalg.norm(found[0], axis=1) < (1.0 - 0.1 * share) * before[left]
                those = left[better]
                x[those], moved[those] = other[better], True
                force[those], sizes[those], slope[those] = (each[better] for each in found)
                if moved.all():
                    break
                share *= 0.5
            x, force, sizes, slope = x[moved], force[moved], sizes[moved], slope[moved]
        found = []
        for each in self._polished(np.vstack(done)):
            if not any(np.abs(each - other).max() <= 1e-7 * np.abs(other).max() for other in found):
                found.append(each)
        return found

    def _polished(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Improve positions of balance by two more steps, to rounding."""
        for _ in range(2):
            force, _, slope = self.unbalanced(x)
            usable = np.isfinite(slope).all(axis=(1, 2))
            other = x.copy()
            other[usable] += _steps(slope[usable], force[usable])
            better = np.abs(self.unbalanced(other)[0]).max(axis=1) < np.abs(force).max(axis=1)
            x = np.where(better[:, None], other, x)
        return x


def _steps(slope: NDArray[np.float64], force: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the steps of Newton's method, the shortest ones where a slope is singular."""
    return -(np.linalg.pinv(slope, rcond=1e-12) @ force[..., None])[..., 0]


def real_roots(polynomial: Polynomial) -> list[float]:
    """Return all real roots of a polynomial in order, each once.

    Between two neighbouring extremes it is monotonous, so that there is one root at most: it is bracketed. An extreme
    that is zero up to rounding is a multiple root.
    """
    parts = np.trim_zeros(np.asarray(polynomial.coef, dtype=np.float64), "b")
    if len(parts) and parts[0] == 0.0:
        others = real_roots(Polynomial(np.trim_zeros(parts, "f")))
        return sorted([0.0, *others])
    degree = len(parts) - 1
    if degree < 1:
        return []
    polynomial = Polynomial(parts)
    # Fujiwara's bound of the roots, which is of any unit of length
    powers = np.arange(1, degree + 1)
    bound = 2.0 * float(np.max(np.abs(parts[-2::-1] / parts[-1]) ** (1.0 / powers))) or 1.0
    inner = [x for x in real_roots(polynomial.deriv()) if abs(x) < bound] if degree > 1 else []
    points = [-bound * 1.001, *inner, bound * 1.001]
    values = [0.0 if _is_rounding(parts, x) else float(polynomial(x)) for x in points]
    found = [x for x, value in zip(points, values, strict=True) if value == 0.0]
    for (low, below), (high, above) in pairwise(zip(points, values, strict=True)):
        if below * above < 0.0:
            found.append(_bracket(polynomial, low, high))
    return sorted(found)


def _bracket(function: Callable[[float], float], low: float, high: float) -> float:
    """Return the zero of a function between two values of different sign, to rounding even if it is tiny."""
    try:
        return find_root(function, low, high, absolute=1e-300, most=2000).place
    except ValueError:  # at a pole the function has no value
        return math.nan


def _is_rounding(parts: NDArray[Any], x: float) -> bool:
    terms = parts * float(x) ** np.arange(len(parts))
    return abs(float(terms.sum())) <= _ROUNDING * float(np.abs(terms).sum())


def _between(low: float, high: float) -> float:
    """Return a point between two ends, which may be infinite."""
    if math.isinf(low) and math.isinf(high):
        return 0.0
    if math.isinf(low):
        return high - abs(high) - 1.0
    if math.isinf(high):
        return low + abs(low) + 1.0
    return 0.5 * (low + high)


def _different(points: list[float]) -> list[float]:
    """Return points in order, each once."""
    found: list[float] = []
    for point in sorted(points):
        if not found or abs(point - found[-1]) > 1e-9 * max(abs(point), abs(found[-1])):
            found.append(point)
    return found


def _bend(formula: StaticForce, *, of_rates: bool = False) -> float:
    """Return the smallest size of deflections, or of rates, at which the slopes of a formula change; 0 if never."""
    count = len(formula.deflections)
    signs = np.array(list(product((1.0, -1.0), repeat=min(count, 4))))
    signs = np.hstack((signs, np.ones((len(signs), count - signs.shape[1]))))
    points = np.exp2(_OCTAVES.astype(float))[:, None, None] * signs
    tangents = formula.by_deflections(0.0 * points, points) if of_rates else formula.by_deflections(points)
    smallest = [0.0]
    for slopes in (tangents.damping,) if of_rates else (tangents.stiffness, tangents.damping):
        usable = np.isfinite(slopes).all(axis=(1, 2))
        slopes, octaves = slopes[usable], _OCTAVES[usable]
        if len(slopes):
            sizes, change = np.abs(slopes).max(axis=(1, 2)), np.abs(slopes - slopes[:1]).max(axis=(1, 2))
            bent = octaves[change > _BENDS * np.maximum(sizes, sizes[0])]
            # one that bends at any length, such as x**3, has none of its own
            smallest += [2.0 ** float(bent[0])] if len(bent) and bent[0] > octaves[1] else []
    return min(filter(None, smallest), default=0.0)


_NEGLIGIBLE = 1e-9  # share of a clearance, or of a force, that counts as none
_WEAKEST = 10  # decades by which the spring is weaker than the others that holds what is free to move
_TURNS = 200  # combinations that are tried where there are too many
_LEFT = 1e-6  # share of the load that may be left over
_TRIED = 5_000  # combinations of stages that are tried one by one
_TINY = 1e-9  # share of a deflection that counts as none


@dataclass(frozen=True)
class ContactRest:
    """A contact in a static equilibrium."""

    name: str  #: Name of the contact.
    #: deflection, force: Its deflection, and the force of its spring.
    deflection: float
    force: float
    side: int  #: The side on which it touches: +1, -1, or 0 if it is open.
    #: The stages that are closed, from the inside out; the only stage of a contact may have no name.
    closed: tuple[str, ...]
    #: True for a force by a formula: it has no sides and stages. Of several deflections, `deflection` is the first.
    is_formula: bool = False
    #: True for a drag between parts that turn at different speeds: its deflection grows on, and means nothing.
    slips: bool = False

    @property
    def is_open(self) -> bool:
        """True if it has stages, and none of them is closed."""
        return not self.side and not self.is_formula

    def __str__(self) -> str:
        if self.is_formula:
            return f"{self.name} at {self.deflection:.4g}"
        if self.is_open:
            return f"{self.name} open"
        return f"{self.name} closed{'+' if self.side > 0 else '-'}{f' ({self.closed[-1]})' if self.closed[-1] else ''}"


@dataclass(frozen=True, eq=False)
class Equilibrium:
    """A static equilibrium of a system."""

    position: NDArray[np.float64]  #: shape (n,): The coordinates.
    contacts: tuple[ContactRest, ...]  #: Each contact there.
    #: stiffness, damping: shape (n, n): The matrices for small motions about it.
    stiffness: NDArray[np.float64]
    damping: NDArray[np.float64]
    #: Number of independent directions in which the system can move without any force, free in its gaps. The position
    #: is then one of many.
    loose: int
    stable: bool  #: True if the equilibrium is stable.

    def __str__(self) -> str:
        texts = [str(contact) for contact in self.contacts if not contact.slips] or ["no contacts"]
        texts += [f"free to move in {self.loose} direction{'s' if self.loose > 1 else ''}"] * bool(self.loose)
        return ", ".join([*texts, *["unstable"] * (not self.stable)])


@dataclass(frozen=True)
class Rest:
    """The static equilibria of a system."""

    #: The stable ones first, then those nearest to zero; nine at most of forces by formulas. Empty if there is none:
    #: the mean load drives the system away.
    equilibria: tuple[Equilibrium, ...]
    complete: bool  #: True if these are known to be all equilibria.
    #: What was left out, a sentence each: dry friction, with which there is a continuum of rests; rigid stops, which
    #: are open; rests within the jump of a force.
    notes: tuple[str, ...] = ()

    def __bool__(self) -> bool:
        return bool(self.equilibria)


def tangent(
    system: System, closed: Sequence[tuple[Slope, ...]], *, stuck: bool = False
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Compute stiffness and damping matrices for small motions while these stages are closed, each shape (n, n).

    Just past the clearances of the stages, where no force has built up, and at zero deflection of forces by formulas.
    Dry friction is left out; with `stuck`, Jenkins elements stick, and have the stiffness of their springs.
    """
    stiffness, damping = formula_matrices(system)
    stiffness += system.matrix("stiffness")
    damping += system.matrix("damping")
    for spring, slopes in zip(springs_of(system), closed, strict=True):
        along = np.outer(spring.force, spring.deflection)
        stiffness += sum(each.stiffness for each in slopes) * along
        damping += spring.drag(None, slopes) * along
        if stuck and spring.form.law.has_memory:
            stiffness += system.equations[f"{spring.form.name}.stiffness"] * along
    return stiffness, damping


def left_out(system: System) -> tuple[str, ...]:
    """Say how dry friction and rigid stops enter static equilibria and modes, a sentence each."""
    forms = system.structure.contacts
    dry, rigid = ([form.name for form in forms if getattr(form.law, which)] for which in ("is_dry", "rebounds"))
    notes = []
    if dry:
        notes.append(
            f"dry friction is left out ({', '.join(dry)}): with it all positions about an "
            "equilibrium at which it can hold are equilibria too"
        )
    if rigid:
        notes.append(f"rigid stops are open ({', '.join(rigid)}): equilibria against one are not computed")
    return tuple(notes)


def find_equilibria(system: System) -> Rest:
    """Find the static equilibria of a system under its mean load, without its excitation.

    Where no spring ever softens and forces follow from an energy, the equilibrium is that of least energy, found by
    Newton's method. Otherwise there may be several: each combination of closed stages is tried. If there are too many,
    the search goes from each combination to the one that is closed at its equilibrium. With cubic terms that soften,
    one combination may have several equilibria.

    With forces by formulas (or other laws that are not polynomials) there may be any number of equilibria. With one
    coordinate and polynomial forces, all are found, as real roots; otherwise a search from many positions finds those
    nearest to zero, and `Rest.complete` is False. Numbers that vary over the angle have their mean value, and
    prescribed displacements are zero. Dry friction is left out, and rigid stops are open (`Rest.notes`).

    Parameters
    ----------
    system
        The system.

    Returns
    -------
    Rest
        The equilibria, the stable ones first.

    Raises
    ------
    ConvergenceError
        If the least energy is not found.

    Examples
    --------
    >>> pressed = gw.System(["x"], [[1.0]], contacts=[gw.stop("stop", {"x": 1.0}, 1.0, 3.0)], mean={"x": 5.0})
    >>> gw.find_equilibria(pressed).equilibria[0].position  # x + 3 (x - 1) = 5
    array([2.])
    """
    springs, forces = springs_of(system), static_forces_of(system)
    stiffness, load = system.matrix("stiffness"), static_load(system)
    formulas = [each for each in forces if each.is_formula]
    if any(slope.curved for spring in springs for slope in spring.slopes) or not all(
        each.is_linear_at_rest for each in formulas
    ):
        positions, complete = balance_of(system).rests()
        return _rest(system, positions, springs, complete)
    for each in formulas:
        zero = each.at(np.zeros(system.size))
        stiffness = stiffness + np.outer(each.direction, zero.stiffness @ each.deflections)
        load = load - zero.force * each.direction
    statics = _Statics(stiffness, load, springs)
    if statics.has_least_energy:
        position = statics.least_energy(system.matrix("mass"))
        return _rest(system, [] if position is None else [position], springs, complete=True, only=position is not None)
    ranges = [tuple(spring.ranges()) for spring in springs]
    few = math.prod(map(len, ranges)) <= _TRIED
    complete = few and not any(slope.bends for spring in springs for slope in spring.slopes)
    tried = product(*ranges) if few else statics.by_turns(ranges)
    positions = [x for each in tried if (x := statics.within(each)) is not None]
    unit = max((np.abs(x).max() for x in positions), default=0.0) or 1.0
    different = {tuple(np.round(x / unit, 9)): x for x in positions}
    return _rest(system, [*different.values()], springs, complete)


def _rest(
    system: System,
    positions: Sequence[NDArray[np.float64]],
    springs: Sequence[Spring],
    complete: bool,
    *,
    only: bool = False,
) -> Rest:
    """Make a record of positions, nearest to zero first; one of those between which the system moves freely.

    Unless there is only one position, further ones may be on breakpoints at which a force jumps.
    """
    found: dict[object, Equilibrium] = {}
    most = MOST if formulas_of(system) else len(positions)
    for number, position in enumerate(sorted(positions, key=lambda x: float(np.abs(x).max()))):
        each = _equilibrium(system, position, springs)
        if each is not None:
            forces = tuple(float(f"{contact.force:.6g}") for contact in each.contacts)
            key = (forces, tuple(contact.closed for contact in each.contacts)) if each.loose else number
            found.setdefault(key, each)
        if len(found) > most:
            break
    nearest = [*found.values()][:most]
    ordered = sorted(nearest, key=lambda each: not each.stable)
    complete = complete and len(found) == len(nearest) and not any(each.form.law.rebounds for each in springs)
    jumping = [each.form.name for each in springs if not only and any(slope.pull[0] for slope in each.slopes)]
    text = (
        f"a rest on a breakpoint at which a force jumps ({', '.join(jumping)}) is not computed: the force there has "
        "any size between its values on both sides. Give the jump a width: a stage of stiffness jump/width there, "
        "and one of stiffness -jump/width at the clearance plus the width"
    )
    return Rest(tuple(ordered), complete and not jumping, (*left_out(system), *[text] * bool(jumping)))


def _equilibrium(system: System, x: NDArray[np.float64], springs: Sequence[Spring]) -> Equilibrium | None:
    """Make a record of a position; None if a formula has no finite slope there, or it is beyond a rigid stop."""
    contacts, forces = [], static_forces_of(system)
    stiffness, damping = system.matrix("stiffness").copy(), system.matrix("damping").copy()
    stiffest = np.abs(stiffness).max()
    for spring, force in zip(springs, forces, strict=True):
        depth, law = float(spring.deflection @ x), force.at(x)
        if not law.is_finite:
            return None
        if spring.form.law.is_dry:
            continue
        margin = _TINY * max(abs(depth), *(each.clearance for each in spring.slopes), 0.0)
        slopes = spring.closed(depth, margin)
        if slopes and spring.form.law.rebounds:
            return None
        names, side = tuple(each.stage for each in slopes), slopes[0].sign if slopes else 0
        own = float(law.force) if slopes or force.is_formula else 0.0
        slips = any(name.rpartition(".")[2] == MEAN_SLIP for name in spring.form.parameters)
        contacts.append(ContactRest(spring.form.name, depth, own, side, names, force.is_formula, slips))
        if force.is_formula or any(each.curved for each in slopes):
            stiff, drag = law.stiffness @ force.deflections, law.damping @ force.deflections
        else:
            stiff = spring.pull(depth, slopes)[1] * spring.deflection
            drag = spring.drag(depth, slopes) * spring.deflection
        stiffness += np.outer(force.direction, stiff)
        damping += np.outer(force.direction, drag)
        innermost = 0.0 if force.is_formula else sum(each.stiffness for each in spring.innermost())
        stiffest += abs(innermost) * np.abs(np.outer(force.direction, spring.deflection)).max()
    if np.array_equal(stiffness, stiffness.T):
        sizes, ways = np.linalg.eigh(stiffness)
        sizes, ways = np.abs(sizes), ways.T
    else:
        _, sizes, ways = np.linalg.svd(stiffness)
    free, stable = ways[sizes <= 1e-10 * max(sizes.max(), stiffest)], _is_stable(system, stiffness, damping)
    loose = len(free)
    if any(force.is_formula for force in forces):
        balance = balance_of(system)
        signs = [
            balance.restoring(x, way) for way in free
        ]  # a cubic force has no slope at zero, and holds nevertheless
        loose = signs.count(0)
        if len(x) == 1 and any(force.form.law.mode_count for force in forces):  # a kink may be at the rest itself
            signs.append(balance.restoring(x, np.ones(1), 1e-6))
        stable = stable and min(signs, default=0) >= 0
    return Equilibrium(x, tuple(contacts), stiffness, damping, loose, stable)


@dataclass(frozen=True, eq=False)
class _Statics:
    """Data for the static forces of a system: stiffness matrix, mean load, and the springs of its contacts."""

    stiffness: NDArray[np.float64]
    load: NDArray[np.float64]
    springs: Sequence[Spring]

    @property
    def has_least_energy(self) -> bool:
        """True if the forces derive from a convex energy."""
        for spring in self.springs:
            for sign in (1, -1):
                side = [each for each in spring.slopes if each.sign == sign]
                if any(each.softens for each in side) or any(np.cumsum([each.stiffness for each in side]) < 0):
                    return False
        return all(spring.form.reciprocal for spring in self.springs) and _curves_upwards(self.stiffness)

    def least_energy(self, mass: NDArray[np.float64]) -> NDArray[np.float64] | None:
        """Find the position of least energy; of many, that nearest to zero; None if the energy has no lower bound.

        A weak spring on all coordinates makes it unique. It is weakened step by step: with the weakest from the
        beginning, the first step of Newton's method would leave a gap by many orders of magnitude.
        """
        weight = float(np.abs(self.load).max())
        slopes = [slope for spring in self.springs for slope in spring.slopes]
        size = np.abs(self.stiffness).max() + sum(each.largest_slope(weight) for each in slopes)
        x, holding = np.zeros(len(self.load)), (size or 1.0) / np.abs(mass).max() * mass
        for power in range(0, _WEAKEST + 1, 2):
            x = replace(self, stiffness=self.stiffness + 10.0**-power * holding)._minimum(x)
        force, slope = self._pulls(x)
        settled = x - np.linalg.solve(slope + 10.0**-_WEAKEST * holding, force)
        left, best = min(
            ((float(np.abs(self._pulls(each)[0]).max()), each) for each in (settled, x)), key=lambda pair: pair[0]
        )
        return best if left <= _LEFT * weight else None

    def _minimum(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Find the position of least energy from a start, by Newton's method with shortened steps."""

        def energy(x: NDArray[np.float64]) -> float:
            stored = sum(spring.energy(float(spring.deflection @ x)) for spring in self.springs)
            return float(0.5 * x @ self.stiffness @ x - self.load @ x + stored)

        for _ in range(100):
            force, slope = self._pulls(x)
            step = -np.linalg.solve(slope, force)
            share, here = 1.0, energy(x)
            while share > 1e-6 and energy(x + share * step) > here + 1e-14 * abs(here):
                share *= 0.5
            x = x + share * step
            if np.abs(step).max() <= 1e-12 * np.abs(x).max() or share <= 1e-6:
                return x
        raise ConvergenceError("the position of least energy under the mean load was not found in 100 steps")

    def _pulls(self, x: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Compute the unbalanced force at a position, and the stiffness there; all contacts are reciprocal."""
        force, slopes = self.stiffness @ x - self.load, self.stiffness.copy()
        for spring in self.springs:
            depth = float(spring.deflection @ x)
            pull, slope = spring.pull(depth, spring.closed(depth))
            force += pull * spring.deflection
            slopes += slope * np.outer(spring.deflection, spring.deflection)
        return force, slopes

    def by_turns(self, ranges: Sequence[Sequence[Range]]) -> Iterator[Sequence[Range]]:
        """List combinations of closed stages from the one at zero on; each is at the equilibrium of the one before."""
        x = np.zeros(len(self.load))
        for _ in range(_TURNS):
            depths = [float(spring.deflection @ x) for spring in self.springs]
            chosen = [
                next(each for each in of_contact if each[1] <= depth <= each[2])
                for depth, of_contact in zip(depths, ranges, strict=True)
            ]
            yield chosen
            found = self._balanced(chosen)
            if found is None:
                return
            x = found[0]

    def _balanced(self, ranges: Sequence[Range]) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
        """Find the equilibrium if these stages act everywhere, and the directions in which it is free to move."""
        x, free = np.zeros(len(self.load)), np.zeros((len(self.load), 0))
        bent = any(each.bends for closed, _, _ in ranges for each in closed)
        for _ in range(100 if bent else 2):
            force, slopes = self.stiffness @ x - self.load, self.stiffness.copy()
            for spring, (closed, low, high) in zip(self.springs, ranges, strict=True):
                depth = float(spring.deflection @ x)
                at = depth if any(each.bends for each in closed) else float(np.clip(depth, low, high))
                pull, slope = spring.pull(at, closed)
                force += (pull + slope * (depth - at)) * spring.force
                slopes += slope * np.outer(spring.force, spring.deflection)
            left, sizes, right = np.linalg.svd(slopes)
            lost = sizes <= 1e-12 * max(sizes[0], np.finfo(float).tiny)
            parts = left.T @ force
            largest = max(np.abs(self.load).max(), np.abs(force).max())
            if np.abs(parts[lost]).max(initial=0.0) > _NEGLIGIBLE * largest:
                return None
            step = -right[~lost].T @ (parts[~lost] / sizes[~lost])
            x, free = x + step, right[lost].T
            if np.abs(step).max() <= 1e-13 * np.abs(x).max():
                return x, free
        return None if bent else (x, free)

    def within(self, ranges: Sequence[Range]) -> NDArray[np.float64] | None:
        """Find an equilibrium with exactly these stages closed; None if there is none.

        A position that is free to move is moved until all deflections are in their ranges.
        """
        found = self._balanced(ranges)
        if found is None:
            return None
        (x, free), rows, bounds = found, [], []
        for spring, (closed, low, high) in zip(self.springs, ranges, strict=True):
            for sign, end in ((1.0, high), (-1.0, -low)):
                if math.isfinite(end):
                    inner = (bool(closed) and end < 0) or end == 0  # a breakpoint belongs to the range inside of it
                    rows.append(sign * spring.deflection)
                    bounds.append(end - _NEGLIGIBLE * abs(end) if inner else end + _NEGLIGIBLE * abs(end))
        if not rows:
            return x
        room = np.array(bounds) - np.array(rows) @ x
        if (room >= 0).all():
            return x
        if not free.shape[1]:
            return None
        from scipy.optimize import linprog  # slow to import, and seldom needed

        table = np.hstack((np.array(rows) @ free, np.ones((len(rows), 1))))
        limits = [(None, None)] * free.shape[1] + [(0, np.abs(room).max())]
        moved = linprog([0.0] * free.shape[1] + [-1.0], table, room, bounds=limits)
        return x + free @ moved.x[:-1] if moved.success else None


def _curves_upwards(matrix: NDArray[np.float64]) -> bool:
    """Return True if a matrix is symmetric and has no negative eigenvalue."""
    size = np.abs(matrix).max()
    if np.abs(matrix - matrix.T).max() > 1e-12 * size:
        return False
    return size == 0 or bool(np.linalg.eigvalsh(matrix)[0] > -1e-12 * len(matrix) * size)


def _is_stable(system: System, stiffness: NDArray[np.float64], damping: NDArray[np.float64]) -> bool:
    if _curves_upwards(stiffness) and _curves_upwards(damping):
        return True  # as Kelvin and Tait have it; of a large system the eigenvalues below would take long
    n = system.size
    rates = np.linalg.solve(system.matrix("mass"), np.hstack((stiffness, damping)))
    matrix = np.block([[np.zeros((n, n)), np.eye(n)], [-rates[:, :n], -rates[:, n:]]])
    values = np.linalg.eigvals(matrix)
    return bool(values.real.max() <= 1e-7 * np.abs(values).max())

"""Motions in which a part floats within its clearance: only an open contact restrains it, so they are not isolated.

A loose gear on a bearing that has drag, but no stiffness, is restrained by its mesh alone. While the mesh rattles, its
motion is an isolated orbit like any other. A motion in which the mesh touches nowhere, however, may be shifted within
the clearance: the orbits form a family at each value of a parameter, and a multiplier is exactly 1.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.flow.flow import PERIOD, Flow, flow_of
from gapwalk.flow.forces import Angles
from gapwalk.model.coefficients import ContactSlots, coefficients_of, layout_of
from gapwalk.model.drivetrain.train_assembly import TrainAssembly
from gapwalk.model.static_force import StaticForce, formulas_of
from gapwalk.model.system import System
from gapwalk.orbit.drifting import drifts_of
from gapwalk.orbit.orbit import Orbit

# Centring of an element whose friction never slips: the one orbit of a continuum that a branch follows.
#
# A Jenkins element that never slips may have its slider anywhere in a range: the extension z only has to stay within
# its limits on both sides. Where the motion grows, the range shrinks, and slip begins on both sides once it has shrunk
# to a point: there the extension is as large on one side as on the other. So in a symmetric system a branch follows
# the orbit whose extension has such equal extremes. It is continuous where slip begins and ends. Any other orbit of
# the continuum would be pushed along the end of the range, where the motion is at a corner.

_SAMPLES = 32  # per forcing period, between which the deflection turns at most once
_SECANTS = 6  # steps of the secant method, before an interval is halved
_STEPS = 40  # of both
_STILL = 1e-8  # share of a rate that counts as 0: the deflection depends on the square of the error of an angle
_STEP = 1e-150  # of the complex step


class Centre(NamedTuple):
    """Middle between the largest and the smallest deflection of a motion, less its displacement at the start."""

    value: float  #: The middle.
    #: shape (segments * state_size,): Its derivative by the states at the start of each segment.
    by_unknowns: NDArray[np.float64]
    by_parameter: float  #: Its derivative along a direction of the coefficients.


def centre_of(
    flow: Flow,
    light: Flow,
    slots: ContactSlots,
    coefficients: NDArray[np.float64],
    direction: NDArray[np.float64],
    knots: Sequence[float],
    states: NDArray[np.float64],
    picks: Sequence[Any] = (max, min),
) -> Centre:
    """Compute the centre of the deflection of a contact over one period, or one of its extremes."""
    # Shapes: `states` (segments, state_size).
    deflection = _Deflection(light, slots, coefficients)
    turns = [turn for number, pair in enumerate(pairwise(knots)) for turn in deflection.turns(number, *pair, states)]
    n, size = flow.equations.layout.structure.size, states.shape[1]
    value, by_unknowns, by_parameter = 0.0, np.zeros(states.size), 0.0
    for pick in picks:
        _, segment, theta = pick(turns)
        state, transition, along = states[segment], np.eye(size), np.zeros(size)
        if theta > knots[segment]:
            arc = flow.integrate(coefficients, state, knots[segment], theta, direction)
            assert arc.transition is not None
            assert arc.sensitivity is not None
            state, transition, along = arc.state, arc.transition, arc.sensitivity
        vector = coefficients[slots.deflection]
        value += deflection.at(theta, state)
        by_unknowns[segment * size : (segment + 1) * size] += vector @ transition[:n]
        by_parameter += float(vector @ along[:n] + direction[slots.deflection] @ state[:n])
        by_parameter += deflection.sway_changes(direction, theta)
    sway = deflection.at(knots[0], np.zeros(size))
    share = 1.0 / len(picks)
    by_parameter = share * by_parameter - deflection.sway_changes(direction, knots[0])
    return Centre(share * value - sway, share * by_unknowns, by_parameter)


def spare_of(orbit: Orbit, contact: int) -> dict[int, float]:
    """Return what the extension of a spring that never slips lacks to its limit on each side."""
    structure, coefficients = orbit.system.structure, coefficients_of(orbit.system)
    slots = layout_of(structure).contacts[contact]
    limit, stiffness = (float(coefficients[slots.numbers[name]]) for name in ("limit", "stiffness"))
    deflection, states = _Deflection(flow_of(orbit.system), slots, coefficients), orbit.state[None]
    places = [place for place, _, _ in deflection.turns(0, 0.0, PERIOD * orbit.period, states)]
    extension = float(orbit.state[2 * structure.size + structure.memories.index(contact)])
    slider = deflection.at(0.0, orbit.state) - extension
    return {side: limit / stiffness - max(side * (place - slider) for place in places) for side in (1, -1)}


class _Deflection:
    """The deflection of one contact along motions."""

    def __init__(self, flow: Flow, slots: ContactSlots, coefficients: NDArray[np.float64]) -> None:
        self._flow, self._slots, self._coefficients = flow, slots, coefficients
        self._layout, self._vector = flow.equations.layout, coefficients[slots.deflection]

    def at(self, theta: Any, states: NDArray[np.float64], order: int = 0) -> Any:
        """Return the deflection at states, shape (..., state_size), or its rate over time (order 1)."""
        n = len(self._vector)
        moved = states[..., order * n : (order + 1) * n] @ self._vector
        return moved + Angles(self._layout, self._coefficients, theta).sway(self._slots, 0, order)

    def sway_changes(self, direction: NDArray[np.float64], theta: float) -> float:
        """Return the derivative of the prescribed displacement along a direction of the coefficients."""
        moved = Angles(self._layout, self._coefficients + 1j * _STEP * direction, theta).sway(self._slots)
        return float(np.imag(moved)) / _STEP

    def turns(
        self, segment: int, start: float, stop: float, states: NDArray[np.float64]
    ) -> list[tuple[float, int, float]]:
        """Return the largest and the smallest deflection of a segment, with its number and the angle of each."""
        thetas = np.linspace(start, stop, 2 + int(_SAMPLES * (stop - start) / PERIOD))
        sampled = self._flow.sample(self._coefficients, states[segment], thetas).states
        places, rates = self.at(thetas, sampled), self.at(thetas, sampled, 1)
        found = [(float(places[0]), segment, start), (float(places[-1]), segment, stop)]
        width = (thetas[1] - thetas[0]) * float(self._coefficients[0])
        for way in (1.0, -1.0):
            inner = np.flatnonzero((way * rates[:-1] > 0.0) & (way * rates[1:] <= 0.0))
            if not len(inner):
                continue
            first, last = way * rates[inner], way * rates[inner + 1]
            peaks = way * places[inner] + 0.5 * width * first**2 / (first - last)
            # that is the peak of a parabola: where friction stops the motion in between, it may be lower or higher
            for place in np.flatnonzero(peaks + 0.5 * width * np.maximum(first, -last) >= peaks.max()):
                k = int(inner[place])
                found += [(float(places[each]), segment, float(thetas[each])) for each in (k, k + 1)]
                found += self._peak(segment, thetas[k : k + 2], rates[k : k + 2], sampled[k])
        return found

    def _peak(
        self, segment: int, thetas: NDArray[np.float64], rates: NDArray[np.float64], state: NDArray[np.float64]
    ) -> list[tuple[float, int, float]]:
        """Return the deflection at angles ever nearer to where its rate vanishes between two of them."""
        (low, high), found = thetas.tolist(), list[tuple[float, int, float]]()
        (at_low, at_high), begin = rates.tolist(), low
        (last, rate), (other, its_rate) = (low, at_low), (high, at_high)
        for _ in range(_STEPS):
            theta = last - rate * (last - other) / (rate - its_rate) if rate != its_rate else high
            # the rate has a corner where friction begins to stick, and is 0 from there on: then halve
            if not low < theta < high or len(found) >= _SECANTS:
                theta = 0.5 * (low + high)
            if not low < theta < high or min(abs(at_low), abs(at_high)) <= _STILL * float(np.abs(rates).max()):
                break
            there = self._flow.integrate(self._coefficients, state, begin, theta).state
            found.append((float(self.at(theta, there)), segment, theta))
            (other, its_rate), (last, rate) = (last, rate), (theta, float(self.at(theta, there, 1)))
            if rate * at_low > 0.0:
                low, at_low = theta, rate
            else:
                high, at_high = theta, rate
        return found


_NOTHING = 1e-12  # share of the largest singular value of the stiffness below which one is zero up to rounding
_FEW, _MANY = 16, 256  # samples of an orbit, per forcing period, at which formulas are evaluated
_TOUCHES = 1e-8  # smallest depth, as a share of a clearance, at which a contact restrains anything
_LOOSE = (0, 1)  # phases of `Orbit.held` of a stop on which the motion never rests


def unheld(system: System) -> NDArray[np.float64]:
    """Return the directions in which the stiffness matrix has no spring, orthonormal, shape (n, ways)."""
    # There, only contacts and formulas can restrain the system; where it drifts, nothing does, nor needs to.
    stiffness, drifts = system.matrix("stiffness"), drifts_of(system)
    _, sizes, rows = np.linalg.svd(stiffness + (np.abs(stiffness).max() or 1.0) * drifts @ drifts.T)
    return rows[sizes <= _NOTHING * sizes[0]].T


def floats(orbit: Orbit, ways: NDArray[np.float64]) -> str:
    """Return the reason why an orbit is not isolated, but one of a family, with advice; empty if it is isolated."""
    # Shapes: `ways` (n, ways).
    if not ways.shape[1]:
        return ""
    system, touching, opened = orbit.system, [], []
    depths = list(zip(system.breakpoints, orbit.turning_depths, strict=True))
    formulas = formulas_of(system)
    if any(_are_held(formulas, orbit, ways, samples) for samples in (_FEW, _MANY)):
        return ""
    held = [_held(each, orbit, _MANY) @ ways for each in formulas]
    for place, contact in enumerate(system.structure.contacts):
        if not contact.stages:
            continue
        deflection = system.vector(f"{contact.name}.deflection")
        if np.abs(deflection @ ways).max() <= _NOTHING * np.abs(deflection).max():
            continue
        own = [(switch, each[2], turns.values) for switch, (each, turns) in enumerate(depths) if each[0] == place]
        # what stays beyond a breakpoint is pressed there, however stiff the stage is
        closed = any(
            orbit.held.get(switch, _LOOSE) != _LOOSE or not values or min(values) > 0.0 or max(values) > _TOUCHES * gap
            for switch, gap, values in own
        )
        (touching if closed else opened).append((contact.name, deflection @ ways))
    rows = np.vstack([*held, *(row for _, row in touching), np.zeros_like(ways[:0])])
    if np.linalg.matrix_rank(rows) == ways.shape[1]:
        return ""
    advice = "give it a stiffness, however small, or begin where the contact closes"
    if isinstance(assembly := system.structure.assembly, TrainAssembly):
        deflections = assembly.numbers(system.values).deflections @ ways
        for link, moved in zip(assembly.form.links, deflections, strict=True):
            if link.slides and np.abs(moved).max() > _NOTHING:
                advice = f"give {link.name} a stiffness, however small, or begin where the contact closes"
                break
    if not opened:
        return f"no spring restrains it in some direction, so each such motion is one of a family; {advice}"
    names = " and ".join(name for name, _ in opened)
    return (
        f"{names} {'touch' if opened[1:] else 'touches'} nowhere, and no other spring restrains the floating part: it "
        f"may lie anywhere within its clearance, so each such motion is one of a family; {advice}"
    )


def _are_held(formulas: Sequence[StaticForce], orbit: Orbit, ways: NDArray[np.float64], samples: int) -> bool:
    """Return True if formulas alone restrain the system in all these directions."""
    rows = [_held(each, orbit, samples) @ ways for each in formulas]
    return bool(rows) and np.linalg.matrix_rank(np.vstack(rows)) == ways.shape[1]


def _held(formula: StaticForce, orbit: Orbit, samples: int) -> NDArray[np.float64]:
    """Return the vectors along which a formula restrains the system somewhere on an orbit, shape (rows, n)."""
    # A formula of the rate alone restrains nothing, and neither does one where its force is constant.
    motion = orbit.motion(samples)
    slopes = formula.at(motion.q, motion.v).stiffness
    slopes = slopes[np.isfinite(slopes).all(axis=1)]
    largest = np.abs(slopes).max(initial=0.0)
    if largest == 0.0:
        return np.zeros((0, orbit.system.size))
    # as few rows as there are deflections, with the sizes of the slopes over the orbit
    return np.linalg.qr(slopes / largest, mode="r") @ formula.deflections

"""Options of a search, and the starts that follow from them at each value of the parameter.

Starts are spread evenly over the box of states that a system may visit.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
from annotated_types import Ge, Gt
from numpy.typing import NDArray

from gapwalk.ensemble.start import within_stops
from gapwalk.errors import ModelError
from gapwalk.model.coefficients import coefficients_of, layout_of
from gapwalk.model.spring import Spring, springs_of
from gapwalk.model.static_force import formula_matrices, formulas_of
from gapwalk.model.static_search import balance_of
from gapwalk.model.system import System
from gapwalk.orbit.orbit import Orbit

_MOST = 100_000  # largest number of starts
_REACH = 20.0  # a gap this many times wider than the motion without it is assumed never to close
_REDRAWS = 10  # times that the number of starts is doubled to find enough within rigid stops
_SAMPLES = 64  # samples per forcing period of the velocities of a known orbit
_RESONANCE = 5.0  # upper bound of the amplitude of a linear resonance, in static deflections
_NOTHING = 1e-12  # share of the largest extent below which that of another coordinate is rounding
_STEPPED = 2.0  # largest motion after a load is applied at once, in static deflections
_BENT = 3.0  # extent of the positions, in lengths at which a formula bends
_SINGULAR = 1e12  # condition number above which a stiffness does not support the system


@dataclass(frozen=True, slots=True)
class SearchOptions:
    """Thoroughness of a search at each value of the parameter.

    The defaults suit many values, several of which lie on each isolated branch; at a single value use more starts.

    Examples
    --------
    >>> gw.SearchOptions(starts=100, newton_starts=50, seed=3).starts
    100
    """

    starts: Annotated[int, Ge(1)] = 24  #: Starts of transients at each value of the parameter.
    #: Longest period, in forcing periods, of the orbits on which a transient may settle.
    periods: Annotated[int, Ge(1)] = 8
    #: Number of starts at each value that Newton's method uses too, to find unstable orbits; 0 for none.
    newton_starts: Annotated[int, Ge(0)] = 24
    #: Periods, in forcing periods, of the orbits that Newton's method searches for. One of those starts in m is used
    #: for period m; orbits of shorter periods are found too.
    newton_periods: tuple[Annotated[int, Ge(1)], ...] = (1, 2, 3, 4, 5, 6, 7, 8)
    #: Forcing periods after which a transient whose returns no longer shrink counts as not periodic.
    patience: Annotated[int, Ge(16)] = 400
    #: Half-widths of the box of starts about zero, 2n numbers: positions, then velocities. By default it is derived
    #: from the system; see `state_box`. Extensions begin at zero.
    box: tuple[Annotated[float, Gt(0)], ...] | None = None
    spread: Annotated[float, Gt(0)] = 1.5  #: Ratio of the derived box to the motions.
    #: Seed of the starts: the same seed gives the same result for the same values. With 500 starts or more in all, many
    #: are followed at once, and others of the unstable orbits may be found than with fewer.
    seed: Annotated[int, Ge(0)] = 0
    #: Starts in one piece of work. It affects the result, because a piece does not use what others find.
    block: Annotated[int, Ge(1)] = 24

    def __post_init__(self) -> None:
        for name, least in (("starts", 1), ("periods", 1), ("patience", 16), ("block", 1)):
            _check_integer(name, getattr(self, name), least)
        for name in ("newton_starts", "seed"):
            _check_integer(name, getattr(self, name), 0)
        if max(self.starts, self.newton_starts) > _MOST:
            raise ModelError(f"starts is {self.starts}, newton_starts {self.newton_starts}; at most {_MOST:,} each")
        for period in self.newton_periods:
            _check_integer("each of newton_periods", period, 1)
        if self.newton_starts and not self.newton_periods:
            raise ModelError("newton_periods is empty; name at least one period, or write newton_starts = 0")
        if not 0.0 < self.spread < math.inf:
            raise ModelError(f"spread is {self.spread!r}; it must be a number > 0")


def state_box(system: System, known: Iterable[Orbit] = (), spread: float = 1.5) -> NDArray[np.float64]:
    """Return the half-widths of a box about zero that contains the motions of a system with a margin; shape (2n,).

    Positions: as far as the static load, the widths of the gaps and the excitation move the system while its contacts
    touch, and at least as wide as the gaps; if a contact has one side only, as far as the system moves without it. With
    forces by formulas, about each static equilibrium.
    Velocities: the positions times the natural frequency of the coordinate with the others fixed and the contacts
    touching, or times the excitation frequency if that is higher. Known orbits enlarge the box if necessary.
    """
    stiffness, positions = _touching(system)
    positions[positions <= _NOTHING * positions.max()] = positions.max() or 1.0
    rates = np.sqrt(np.abs(stiffness.diagonal()))
    box = np.append(positions, positions * np.maximum(rates, system.frequency))
    for orbit in known:
        motion = orbit.motion(_SAMPLES)
        box = np.maximum(box, np.abs(np.hstack((motion.q, motion.v))).max(axis=0))
    return spread * box


def with_extensions(system: System, box: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a box with half-widths for extensions, those of the deflections within the box; shape (state_size,)."""
    structure, n = system.structure, system.size
    vectors = (system.vector(structure.contacts[place].vectors[0]) for place in structure.memories)
    return np.append(box, [float(np.abs(vector) @ box[:n]) for vector in vectors])


def _touching(system: System) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the stiffness per unit of mass with the contacts touching, and the extent of the positions.

    With forces by formulas there is one for each of the static equilibria, and the largest counts. The positions then
    contain the equilibria under the mean load, twice those under the peaks of all loads, and, where the motion is not
    far smaller or an equilibrium is unstable, the lengths at which formulas bend: such as a limit cycle.
    """
    layout, coefficients = layout_of(system.structure), coefficients_of(system)
    rows, n = coefficients[layout.accelerations], system.size
    if not formulas_of(system):
        return _about(system, rows)
    balance = balance_of(system)
    rests = balance.near(balance.rests()[0]) or [np.zeros(n)]
    stiffest, extent, unstable = np.zeros((n, n)), np.abs(rests).max(axis=0), False
    for rest in rests:
        tangents = rows.copy()
        for matrix, part in zip(formula_matrices(system, rest, strict=False), (slice(n), slice(n, 2 * n)), strict=True):
            tangents[:, part] += np.linalg.solve(system.matrix("mass"), matrix)
        stiffness, positions = _about(system, tangents)
        stiffest = np.where(np.abs(stiffness) > np.abs(stiffest), stiffness, stiffest)
        extent = np.maximum(extent, np.abs(rest) + np.where(np.isfinite(positions), positions, 0.0))
        flow = np.block([[np.zeros((n, n)), np.eye(n)], [-tangents[:, :n], -tangents[:, n : 2 * n]]])
        unstable = unstable or bool(np.linalg.eigvals(flow).real.max() > 0.0)
    peak = balance.peak_loads(system)
    for load in (balance.load + peak, balance.load - peak):
        for rest in balance.near(replace(balance, load=load).rests()[0])[:1]:
            extent = np.maximum(extent, _STEPPED * np.abs(rest))
    rates = np.maximum(np.sqrt(np.abs(stiffest.diagonal())), system.frequency)
    for lengths in (*balance.lengths, *(balance.speeds / rates)):
        if unstable or (lengths <= _REACH * extent)[lengths > 0.0].all():
            extent = np.maximum(extent, _BENT * lengths)
    return stiffest, extent


def _about(system: System, rows: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the stiffness per unit of mass with the contacts touching, and the extent of the positions.

    A gap far wider than the motion without it is left out: a stop that is never reached does not affect the motion.
    """
    layout, coefficients, n = layout_of(system.structure), coefficients_of(system), system.size
    mean = rows[:, 2 * n + len(layout.contacts)]
    stiffness, load = rows[:, :n].copy(), np.abs(mean)
    free, widths = _linear_motion(system, rows, stiffness, load, np.inf), np.zeros(n)
    bounded = any(contact.stages for contact in layout.contacts)
    for contact, spring in zip(layout.contacts, springs_of(system), strict=True):
        if not contact.stages:
            continue
        vector, force = coefficients[contact.deflection], coefficients[contact.force]
        moved = vector != 0.0
        reach = _REACH * float(np.abs(vector[moved]) @ free[moved])
        sides = [_side(spring, sign, reach) for sign in (1, -1)]
        slope, pull, width = max(sides)
        if contact.sway is not None:  # a displacement that is prescribed is felt like a wider gap
            sway = float(np.abs(coefficients[contact.sway]).sum())
            pull, width = pull + abs(slope) * sway, width + sway
        stiffness += slope * np.outer(force, vector)
        load = load + pull * np.abs(force)
        widths[moved] = np.maximum(widths[moved], width / np.abs(vector[moved]))
        bounded = bounded and min(sides)[0] > 0.0
    if not bounded and np.all(np.isfinite(free)):
        return stiffness, np.maximum(free, widths)
    touching = _linear_motion(system, rows, stiffness, load, _RESONANCE)
    return stiffness, np.maximum(np.where(np.isfinite(touching), touching, 0.0), widths)


def _linear_motion(
    system: System,
    rows: NDArray[np.float64],
    stiffness: NDArray[np.float64],
    load: NDArray[np.float64],
    resonance: float,
) -> NDArray[np.float64]:
    """Return the extent of the positions of a linear system under static load and excitation; infinite if unsupported.

    A resonance is limited to `resonance` times the deflection under static loads: gaps detune it, and contacts damp it.
    """
    n, orders = system.size, layout_of(system.structure).orders
    if np.linalg.cond(stiffness) > _SINGULAR:
        return np.full(n, np.inf)
    flexibility = np.abs(np.linalg.inv(stiffness))
    static, amplitudes = flexibility @ load, np.zeros(n)
    believed = static.copy()
    for index, order in enumerate(orders):
        w = order * system.frequency
        force = rows[:, index - 2 * len(orders)] - 1j * rows[:, index - len(orders)]
        dynamic = stiffness - w**2 * np.eye(n) + 1j * w * rows[:, n : 2 * n]
        resonant = np.linalg.cond(dynamic) > _SINGULAR
        amplitudes += np.inf if resonant else np.abs(np.linalg.solve(dynamic, force))
        believed += flexibility @ np.abs(force)
    return static + (np.minimum(amplitudes, resonance * believed) if resonance < np.inf else amplitudes)


def _side(spring: Spring, sign: int, reach: float) -> tuple[float, float, float]:
    """Return, for one side of a contact: the stiffness, the sum of spring stiffness times gap, and the widest gap."""
    slope = pull = width = 0.0
    for stage in spring.slopes:
        if stage.sign == sign and stage.clearance <= reach:
            # a spring that is not linear counts with its stiffness at a depth of one clearance
            stiffness = sign * sum(each * stage.clearance**power for power, each in enumerate(stage.pull[1:]))
            slope, pull = slope + stiffness, pull + abs(stiffness) * stage.clearance
            width = max(width, stage.clearance)
    return slope, pull, width


def spread_starts(
    systems: Sequence[System], box: NDArray[np.float64], count: int, seed: int, value: float
) -> NDArray[np.float64]:
    """Return starts spread evenly over a box by a scrambled Sobol sequence, shape (count, state_size).

    They depend only on the seed and the value of the parameter, not on what else is searched. Those beyond a rigid stop
    of one of the systems are left out, and others follow. Extensions are zero.
    """
    from scipy.stats import qmc  # imported late, because the import takes longer than everything else here

    power, states, points = (count - 1).bit_length(), np.empty((0, 0)), np.empty((0, 0))
    for more in range(_REDRAWS):
        engine = qmc.Sobol(len(box), scramble=True, rng=generator(seed, value))
        points = (2.0 * engine.random_base2(power + more) - 1.0) * box
        states = np.pad(points, ((0, 0), (0, systems[0].state_size - len(box))))
        for system in systems:
            states = states[within_stops(system, states)]
        if len(states) >= count:
            return states[:count]
    raise ModelError(
        f"only {len(states)} of {len(points)} states in the box of starts are within the rigid stops; give a smaller "
        "box"
    )


def generator(seed: int, value: float, block: int = 0) -> np.random.Generator:
    """Return the random numbers for one value of the parameter, and for one block of starts there."""
    return np.random.default_rng([seed, int(np.float64(value).view(np.uint64)), block])


def _check_integer(name: str, value: object, least: int) -> None:
    if isinstance(value, bool) or not isinstance(value, int) or value < least:
        raise ModelError(f"{name} is {value!r}; it must be an integer >= {least}")

"""Range of a walk, and scales of a branch: changes of the unknowns that weigh as much as one of the parameter."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gapwalk.errors import ModelError
from gapwalk.model.coefficients import coefficients_of, layout_of
from gapwalk.model.spring import springs_of
from gapwalk.model.static_force import formulas_of, static_forces_of
from gapwalk.model.structure import PaceLimits
from gapwalk.model.system import System
from gapwalk.orbit.harmonic_balance.linear_part import firsts_of, linear_of
from gapwalk.orbit.orbit import Orbit
from gapwalk.orbit.orbit_equation import OrbitEquation

_OWN = 12.5  # a wider range is measured near a value by this many times the size of the value
_OCTAVES = 2.0  # change of the frequency, as a share of itself, that weighs as much as ten clearances
_REACH = 20.0  # clearances larger than this many times the first orbit are assumed never to close
_SLOWEST, _FASTEST = 0.25, 16.0  # limits, in natural frequencies, of the frequency by which velocities are scaled
_CLEARANCES = 10.0  # change of an orbit, in clearances, that weighs as much as the natural change of the parameter
_EVEN, _BY_RATIO = 33, 65  # values at which the response is computed: evenly spaced, and with equal ratios
_LOWEST = 1e-9  # share of the highest value at which the equal ratios begin in a range that begins at zero
_SAMPLES = 32  # of an orbit, per forcing period, at which the tangents of formulas are taken
_PEAKS = 3  # number of peaks that are refined
_SHARP = 1e-3  # accuracy of a peak, as a share of the interval between two values


@dataclass(frozen=True, slots=True)
class Range:
    """Range of a parameter."""

    #: low, high: Its limits.
    low: float
    high: float
    #: True if the parameter is the frequency. Frequencies are compared by ratio: the response at a hundredth of the
    #: frequency is no less rich, and half the frequency is equally far away everywhere.
    is_relative: bool = False
    #: Change of any other parameter that changes the motion considerably, if known; infinite otherwise.
    natural: float = math.inf
    #: The limits beyond which a load is not known, and the tables over the speed that end there; see
    #: `Structure.pace_limits`. None if there are none.
    tables: PaceLimits | None = None

    def __contains__(self, value: object) -> bool:
        return isinstance(value, float) and self.low <= value <= self.high

    @property
    def width(self) -> float:
        """Difference of the limits."""
        return self.high - self.low

    def bound(self, value: float) -> float:
        """Return the limit of the range that a value outside it has passed."""
        return self.low if value < self.low else self.high

    def nearness(self, value: float) -> float:
        """Return the width that counts near a value, as a share of the width of the range."""
        size = abs(value) if self.is_relative else max(abs(value), self.natural)
        return min(1.0, _OWN * size / self.width)

    def weight(self, value: float, scale: float) -> float:
        """Return the weight of a parameter measured in units of `scale`, near a value, relative to the unknowns.

        With this weight, angles and distances do not depend on the width of the range.
        """
        return scale / (_OCTAVES * abs(value)) if self.is_relative and value != 0.0 else 1.0

    def along(self, parameter: str, system: System) -> Range:
        """Return this range for a parameter of a system; it ends where a table of a load over the speed does."""
        is_relative, tables = system.structure.place(parameter) == 0, system.structure.pace_limits
        if not (is_relative and tables.tables):
            return replace(self, is_relative=is_relative)
        low, high = max(self.low, tables.low), min(self.high, tables.high)
        if not low < high:
            raise ModelError(f"{tables.words}, and the range from {self.low:.10g} to {self.high:.10g} is beyond it")
        return replace(self, low=low, high=high, is_relative=True, tables=tables)

    def table_at(self, bound: float) -> str:
        """Say which table over the speed ends at a limit of the range; empty if none does."""
        if self.tables is None or bound not in (self.tables.low, self.tables.high):
            return ""
        return self.tables.words


def check_range(start: float, to: float | tuple[float, float]) -> Range:
    """Return the range from the start to `to`, or the range given; raise a ModelError if the start is outside it."""
    low, high = sorted((start, to) if isinstance(to, int | float) else to)
    if not low < high:
        raise ModelError(f"the branch starts at {start:.10g} and should be followed to {to}: the range is empty")
    if not low <= start <= high:
        raise ModelError(f"the branch starts at {start:.10g}, outside the range from {low:.10g} to {high:.10g}")
    return Range(float(low), float(high))


def scales_of(equation: OrbitEquation, orbit: Orbit, within: Range) -> NDArray[np.float64]:
    """Return the scales of the unknowns and of the parameter, shape (N + 1,), for the branch of an orbit in a range.

    Scales are bounded, so a part of a range is followed in the same way whatever the width of the whole
    range. Frequencies and velocities are scaled by a typical frequency. Other parameters are scaled by the
    width of the range, or by `Range.natural` if that is smaller, and the unknowns as in `unknown_scales`. Since the
    motion may be a million times larger at the other end of the range, lengths are scaled by the largest expected
    motion (`linear_growth`).
    """
    parameter = equation.parameter or ""
    length = _length(orbit, lambda: linear_growth(orbit.system, parameter, within))
    frequency = _typical_frequency(orbit)
    scale = frequency if within.is_relative else min(within.width, within.natural)
    return powers_of_two(np.append(equation.scales(_CLEARANCES * length, frequency), scale))


def with_natural_change(within: Range, equation: OrbitEquation, orbit: Orbit) -> Range:
    """Return the range of a parameter that is not the frequency, with its `Range.natural` computed from an orbit.

    The natural change would move the orbit by ten clearances; it is the value itself if that is larger.
    """
    if within.is_relative:
        return within
    value = orbit.system[equation.parameter or ""]
    evaluation = equation.evaluate(equation.unknowns(orbit), value)
    try:
        slope = np.linalg.solve(evaluation.by_unknowns, -np.asarray(evaluation.by_parameter))
    except np.linalg.LinAlgError:
        slope = np.zeros(1)
    speed = float(np.abs(slope / unknown_scales(equation, orbit)[: len(slope)]).max())
    moved = 1.0 / speed if speed > 0.0 else 0.0
    natural = max(abs(value), moved if math.isfinite(moved) else 0.0)
    return replace(within, natural=natural or math.inf)


def unknown_scales(equation: OrbitEquation, orbit: Orbit) -> NDArray[np.float64]:
    """Return the scales of the unknowns of an equation near an orbit, shape (N,).

    Positions are scaled by the largest clearance (the natural length of a system with gaps), or by the amplitude of
    the orbit if that is larger or no gap is within its reach; velocities by that length times the frequency. The scales
    are divided among the unknowns so that an orbit that changes by a tenth of that length counts as 1 % of the range.
    """
    return equation.scales(_CLEARANCES * _length(orbit))


def _length(orbit: Orbit, growth: Callable[[], float] | None = None) -> float:
    """Return the largest clearance within reach of an orbit, or its amplitude if that is larger.

    If no gap is within reach, the motion can still grow: by up to `growth`, until it closes the smallest gap.
    """
    clearances = [
        orbit.system[f"{contact.stage_prefix(stage)}.clearance"]
        for contact in orbit.system.structure.contacts
        for stage in contact.stages
    ]
    gaps = [clearance for clearance in clearances if clearance > 0.0]
    amplitude = 0.5 * float(np.ptp(orbit.extremes[:, :2], axis=1).max())
    reach = _REACH * float(np.abs(orbit.extremes[:, :2]).max())
    if growth is not None and all(gap > reach for gap in gaps):
        grown = min([growth(), *gaps])
        if np.isfinite(grown):
            amplitude, reach = max(amplitude, grown), max(reach, _REACH * grown)
    return max([amplitude, *(gap for gap in gaps if gap <= reach)]) or 1.0


def powers_of_two(scales: NDArray[np.float64]) -> NDArray[np.float64]:
    """Round scales to powers of two, so that scaling causes no rounding: a walk from 2.0 begins exactly at 2.0."""
    return np.exp2(np.round(np.log2(scales)))


def _typical_frequency(orbit: Orbit) -> float:
    """Return the frequency of an orbit, limited to the neighbourhood of the natural frequency of its system.

    The natural frequency is the root mean square over the modes with all gaps open, or, for a system that only its
    contacts support, with all gaps closed. Of a force by a formula it has the mean tangent over the orbit.
    """
    system = orbit.system
    linear = linear_of(layout_of(system.structure), coefficients_of(system))
    closed = np.zeros(len(linear.deflections))
    closed[firsts_of(system.structure)] = [
        max((each.stiffness for each in spring.slopes), default=0.0) for spring in springs_of(system)
    ]
    formulas = _mean_stiffness(orbit)
    for stiffness in (np.zeros(len(closed)), closed):
        square = float(np.trace(linear.shifted(stiffness) + formulas)) / system.size
        if square > 0.0:
            natural = math.sqrt(square)
            return min(max(system.frequency, _SLOWEST * natural), _FASTEST * natural)
    return system.frequency


def _mean_stiffness(orbit: Orbit) -> NDArray[np.float64]:
    """Return the mean over an orbit of what formulas add to the stiffness per unit of mass, shape (n, n)."""
    system = orbit.system
    formulas, total = formulas_of(system), np.zeros((system.size, system.size))
    if not formulas:
        return total
    motion = orbit.motion(_SAMPLES)
    for each in formulas:
        tangents = each.at(motion.q, motion.v)
        slopes = tangents.stiffness[tangents.is_finite]  # the slope may be infinite at single points
        total += np.outer(each.direction, slopes.sum(axis=0) @ each.deflections)
    return np.asarray(np.linalg.solve(system.matrix("mass"), total) / len(motion.q), dtype=np.float64)


def linear_growth(system: System, parameter: str, within: Range) -> float:
    """Return the largest amplitude that any coordinate reaches along a parameter while all gaps stay open.

    Peaks are located by Brent's method between the neighbouring values, so that none is missed at light damping. The
    result is 0 where linear theory does not apply, because a stage without clearance is not a linear spring.
    """
    if not _is_linear_inside_its_gaps(system):
        return 0.0
    from scipy.optimize import minimize_scalar  # imported late: slow to import, and rarely needed

    place, low, high = system.structure.place(parameter), within.low, within.high
    values = np.linspace(low, high, _EVEN)
    if within.is_relative or low >= 0.0:  # at some values the motion is then a good part of its largest
        low = max(low, _LOWEST * high)
        values = np.unique(np.append(np.linspace(low, high, _EVEN), np.geomspace(low, high, _BY_RATIO)[1:-1]))

    def size(value: float) -> float:
        return _amplitude(System.beside(system, place, value))

    sizes = [size(value) for value in values.tolist()]
    padded = [-math.inf, *sizes, -math.inf]
    peaks = [k for k in range(len(sizes)) if padded[k] <= padded[k + 1] >= padded[k + 2]]
    largest = 0.0
    for peak in sorted(peaks, key=lambda k: sizes[k])[-_PEAKS:]:
        around = values[max(peak - 1, 0)], values[min(peak + 1, len(values) - 1)]
        accuracy = {"xatol": _SHARP * (around[1] - around[0])}
        found = minimize_scalar(lambda value: -size(float(value)), bounds=around, method="bounded", options=accuracy)
        largest = max(largest, sizes[peak], -float(found.fun))
    return largest


def _is_linear_inside_its_gaps(system: System) -> bool:
    """Return True if all stages without a clearance, if there are any, and all formulas are linear and do not vary."""
    formulas = formulas_of(system)
    if any(not each.is_linear or {*each.slots.waves} - {*each.form.law.arguments} for each in formulas):
        return False
    for spring, slots in zip(springs_of(system), layout_of(system.structure).contacts, strict=True):
        tight = [slope for slope in spring.slopes if slope.clearance == 0.0]
        if any(slope.bends or slope.pull[0] for slope in tight) or sum(slope.sign for slope in tight) != 0:
            return False
        if tight and (spring.form.law.is_damped or any(stage.waves for stage in slots.stages)):
            return False
    return True


def _amplitude(system: System) -> float:
    """Return the largest amplitude of a coordinate, summed over all harmonics, while all gaps are open.

    Stages that have no clearance belong to the stiffness, and so do formulas. Displacements that are prescribed in
    their deflections are loads.
    """
    layout, n = layout_of(system.structure), system.size
    coefficients = coefficients_of(system)
    linear = linear_of(layout, coefficients)
    stiffness, damping, loads = linear.stiffness.copy(), linear.damping.copy(), linear.loads[:, 1:].copy()
    frequencies = np.array(layout.orders) * system.frequency
    pushes = linear.contacts.T[firsts_of(layout.structure)]
    forces = zip(static_forces_of(system), springs_of(system), pushes, strict=True)
    for force, spring, push in forces:
        if force.is_formula:
            _, own_stiffness, own_damping = force.at(np.zeros(n))
        else:
            own_stiffness = np.array([sum(each.stiffness for each in spring.slopes if each.clearance == 0 < each.sign)])
            own_damping = np.zeros(1)
        stiffness += np.outer(push, own_stiffness @ force.deflections)
        damping += np.outer(push, own_damping @ force.deflections)
        for place, name in enumerate(force.form.law.arguments):
            if name in force.slots.waves:
                cosines, sines = np.split(coefficients[force.slots.waves[name].lines], 2)
                felt = own_stiffness[place] + 1j * frequencies * own_damping[place]
                loads -= np.outer(push, felt * (cosines - 1j * sines))
    total = np.zeros(n)
    for frequency, load in zip(frequencies, loads.T, strict=True):
        matrix = stiffness - frequency**2 * np.eye(n) + 1j * frequency * damping
        try:
            total += np.abs(np.linalg.solve(matrix, load))
        except np.linalg.LinAlgError:  # no damping, at resonance
            return math.inf
    return float(total.max())

"""Prediction of the next point of a branch, and its correction onto the branch.

The predictor extrapolates the cubic through two points and their tangents, which also interpolates between them. The
corrector is Newton's method on the bordered system, which also gives the tangent.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import pairwise
from operator import truediv
from typing import NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from gapwalk.bracketed_root import zero_between_signs
from gapwalk.continuation.curve_points import BranchPoint
from gapwalk.errors import ConvergenceError, ModelError, NumericalError
from gapwalk.late_fields import is_known, late
from gapwalk.late_scipy import lapack
from gapwalk.model.coefficients import coefficients_of, layout_of
from gapwalk.model.spring import springs_of
from gapwalk.model.static_force import formulas_of
from gapwalk.model.structure import PaceLimits
from gapwalk.model.system import System
from gapwalk.orbit.harmonic_balance.linear_part import firsts_of, linear_of, open_response
from gapwalk.orbit.orbit import Orbit
from gapwalk.orbit.orbit_equation import Equation, Evaluation, OrbitEquation

# Range of a walk, and scales of a branch: changes of the unknowns that weigh as much as one of the parameter.

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
        """Return the weight of a parameter measured in units of `scale`, near a value, relative to the unknowns."""
        # With this weight, angles and distances do not depend on the width of the range.
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
    """Return the scales of the unknowns and of the parameter, shape (N + 1,), for the branch of an orbit in a range."""
    # Scales are bounded, so a part of a range is followed in the same way whatever the width of the whole range.
    # Frequencies and velocities are scaled by a typical frequency. Other parameters are scaled by the width of the
    # range, or by `Range.natural` if that is smaller, and the unknowns as in `unknown_scales`. Since the motion may be
    # a million times larger at the other end of the range, lengths are scaled by the largest expected motion
    # (`linear_growth`).
    parameter = equation.parameter or ""
    length = _length(orbit, lambda: linear_growth(orbit.system, parameter, within))
    frequency = _typical_frequency(orbit)
    scale = frequency if within.is_relative else min(within.width, within.natural)
    return powers_of_two(np.append(equation.scales(_CLEARANCES * length, frequency), scale))


def with_natural_change(within: Range, equation: OrbitEquation, orbit: Orbit) -> Range:
    """Return the range of a parameter that is not the frequency, with its `Range.natural` computed from an orbit."""
    # The natural change would move the orbit by ten clearances; it is the value itself if that is larger.
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
    """Return the scales of the unknowns of an equation near an orbit, shape (N,)."""
    # Positions are scaled by the largest clearance (the natural length of a system with gaps), or by the amplitude of
    # the orbit if that is larger or no gap is within its reach; velocities by that length times the frequency. The
    # scales are divided among the unknowns so that an orbit that changes by a tenth of that length counts as 1 % of the
    # range.
    return equation.scales(_CLEARANCES * _length(orbit))


def _length(orbit: Orbit, growth: Callable[[], float] | None = None) -> float:
    """Return the largest clearance within reach of an orbit, or its amplitude if that is larger."""
    # If no gap is within reach, the motion can still grow: by up to `growth`, until it closes the smallest gap.
    gaps = [clearance for _, _, clearance in orbit.system.breakpoints if clearance > 0.0]
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
    """Return the frequency of an orbit, limited to the neighbourhood of the natural frequency of its system."""
    # The natural frequency is the root mean square over the modes with all gaps open, or, for a system that only its
    # contacts support, with all gaps closed. Of a force by a formula it has the mean tangent over the orbit.
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
    """Return the largest amplitude that any coordinate reaches along a parameter while all gaps stay open."""
    # Peaks are located by Brent's method between the neighbouring values, so that none is missed at light damping. The
    # result is 0 where linear theory does not apply, because a stage without clearance is not a linear spring.
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
    """Return the largest amplitude of a coordinate, summed over all harmonics, while all gaps are open."""
    try:
        return float(np.abs(open_response(system)[1]).sum(axis=1).max(initial=0.0))
    except np.linalg.LinAlgError:  # no damping, at resonance
        return math.inf


TRUST = 1e-7
"""Residual below which the next Newton step, with exact derivatives, is accurate to rounding."""

_LOST = 2.0  # growth of the residual from one iteration to the next at which the corrector gives up
_CONTRACTION = 0.5  # largest ratio of successive steps that converge; at a graze the ratio is about a third
_EXACT = 1e-14  # residual, relative to the unknowns, that is only rounding if another step does not reduce it
_ROUNDING = 1e-13  # length of a step that rounding alone can cause
_POLISH = 1e-5  # longest last step once the residual is within tolerance: a longer one means a nearly singular Jacobian
_SHALLOW = 1e-3  # share of the depth of the shallowest contact: after a longer step the multipliers are others
_LOGARITHM = 300.0 * math.log(10.0)  # of the largest determinant that is returned with its true size
_ACROSS = 0.3  # cosine of the angle to the direction of travel below which the tangent is solved for again
_ALONG = 0.5  # cosine of the angle between tangents up to which points are interpolated along one of them
_AGREES = 0.3  # distance of the quintic from the cubic, as a share of that of the cubic from the tangent
_FEW, _KEPT, _KEPT_LARGE = 50, 32, 2  # unknowns up to which evaluations are kept, and how many; of more if dear
_CHORDS, _SURE = 12, 1e-12  # steps with the derivatives of a neighbour, and the residual before the last one
_TRUSTED = 1e-7  # longest step if only `trust` is met: by a crossing the tangent turns by 0.1 rad in 1e-6


class Course(NamedTuple):
    """Direction in which a branch continues."""

    tangent: NDArray[np.float64]  #: shape (N + 1,): Unit tangent of the branch, in scaled variables.
    #: Determinant of the Jacobian bordered by the tangent, for unscaled unknowns. With scaled unknowns it would depend
    #: on the units, and it would overflow when there are many unknowns.
    determinant: float


class Correction(NamedTuple):
    """Corrected point, and how it was reached."""

    x: NDArray[np.float64]  #: shape (N + 1,): The point, in scaled variables.
    evaluation: Evaluation  #: The equation evaluated there.
    iterations: int  #: Newton steps taken.
    distance: float  #: Distance from the predicted to the corrected point.
    last: float  #: Length of the last Newton step.
    course: Course | None = None  #: Direction in which the branch continues there; None if it was not computed.


class Corrector:
    """Newton corrector for the branch of one equation, in scaled variables.

    Shapes: `scales` (N + 1,).
    """

    def __init__(self, equation: Equation, scales: NDArray[np.float64], iterations: int = 7) -> None:
        self.equation, self.scales, self.iterations = equation, scales, iterations
        self._unknown_scales, self._last_scale = scales[:-1], float(scales[-1])
        # residuals are lengths: a frequency among the unknowns says nothing of their size
        self._lengths = slice(len(scales) - 1 - getattr(equation, "frequencies", 0))
        self._smallest = min(1.0, _largest(self._unknown_scales[self._lengths]))  # smaller unknowns count as zero
        self._column_scales = [*self._unknown_scales.tolist(), 1.0]
        self._recent: dict[bytes, Evaluation] = {}  # of the last points, if they have few unknowns
        self.is_dear: bool = getattr(equation, "is_dear", False)

    def correct(
        self, guess: NDArray[np.float64], normal: NDArray[np.float64], trust: float = 0.0, near: float = math.inf
    ) -> Correction | None:
        """Return the point of the branch in the plane through `guess` with that `normal`; None if Newton fails."""
        # Once the residual is within the tolerance (or within `trust`, if that is larger), one more short step is taken
        # without a further evaluation. It leaves about the square of the residual, so the point is accurate to
        # rounding, while the evaluation belongs to a point one such step away. `trust` is for multipliers that need few
        # digits. A step longer than `near`, or not much shorter than the step before, is always evaluated: where the
        # branch bends within 1e-10, a residual of 1e-10 says little, and the error after the step is not its square.
        #
        # Each step solves the bordered system
        #
        #     [ G_u     G_a  ] [ du ]     [ -G ]
        #     [ normal^T     ] [ da ]  =  [  0 ]
        x, last, before = guess, 0.0, np.inf
        for iteration in range(self.iterations + 1):
            unknowns = x[:-1] * self._unknown_scales
            try:
                evaluation = self.equation.evaluate(unknowns, x.item(-1) * self._last_scale)
            except NumericalError:
                return None
            size, scale = _largest(evaluation.residual), max(self._smallest, _largest(unknowns[self._lengths]))
            solved = size <= self.equation.tolerance * scale
            if not solved and not size <= _LOST * before:
                return None
            # the second right-hand side gives the tangent of the branch
            right = np.zeros((len(x), 2), order="F")
            np.negative(evaluation.residual, out=right[:-1, 0])
            right[-1, 1] = 1.0
            factors, pivots, steps, singular = lapack.dgesv(self._bordered(evaluation, normal), right, 1, 1)
            step = steps[:, 0]
            length = np.inf if singular else length_of(step)
            near_enough = near if not last else min(near, _CONTRACTION * last)
            shallow = max(_SHALLOW * evaluation.reach / self._unknown_scales.item(0), _ROUNDING)
            exact = _CONTRACTION * before < size <= _EXACT * scale  # the residual is only rounding
            if solved and (length <= min(max(near_enough, _ROUNDING), shallow) or exact):
                x = x + step if length < _POLISH else x
                course = None if singular else self._course(factors, pivots, steps[:, 1])
                return Correction(x, evaluation, iteration, length_of(x - guess), last, course)
            if singular:
                return None
            x, last, before = x + step, length, size
            if size <= trust * scale and length < min(_TRUSTED, near_enough, shallow):
                course = self._course(factors, pivots, steps[:, 1])
                return Correction(x, evaluation, iteration + 1, length_of(x - guess), last, course)
        return None

    def correct_beside(self, guess: NDArray[np.float64], normal: NDArray[np.float64]) -> Correction | None:
        """Return the result of `correct` by the derivatives at the nearest known point; None if they do not serve.

        They are improved by Broyden's method (Kelley 1995, Iterative Methods for Linear and Nonlinear Equations, 7.3).
        """
        known = self._derived_near(guess) if self.is_dear else None
        if known is None:
            return None
        factors, pivots, singular = lapack.dgetrf(self._bordered(known, normal))
        x, steps, lengths, before = guess, list[NDArray[np.float64]](), list[float](), math.inf
        for iteration in range(0 if singular else _CHORDS):
            unknowns = x[:-1] * self._unknown_scales
            try:
                evaluation = self.evaluate_late(x)
            except NumericalError:
                return None
            size, scale = _largest(evaluation.residual), max(self._smallest, _largest(unknowns[self._lengths]))
            step = -lapack.dgetrs(factors, pivots, np.append(evaluation.residual, 0.0))[0]
            for (each, later), square in zip(pairwise(steps), lengths, strict=False):
                step = step + (each @ step / square) * later
            if steps:
                step = step / (1.0 - steps[-1] @ step / lengths[-1])
            length, last = length_of(step), length_of(steps[-1]) if steps else math.inf
            if not (size <= _LOST * before and (length <= _CONTRACTION * last or length <= _ROUNDING)):
                return None
            shallow = max(_SHALLOW * evaluation.reach / self._unknown_scales.item(0), _ROUNDING)
            is_exact = _CONTRACTION * before < size <= _EXACT * scale
            x = x + step
            if size <= min(_SURE, self.equation.tolerance) * scale and (length <= shallow or is_exact):
                return Correction(x, evaluation, iteration, length_of(x - guess), last)
            steps.append(step)
            lengths.append(length * length)
            before = size
        return None

    def _derived_near(self, x: NDArray[np.float64]) -> Evaluation | None:
        """Return the evaluation at the nearest known point at which the derivatives are known."""
        derived = ((key, each) for key, each in self._recent.items() if is_known(each, "by_unknowns"))
        nearest = min(derived, key=lambda pair: length_of(np.frombuffer(pair[0]) - x), default=None)
        return None if nearest is None else nearest[1]

    def exact_point(self, x: NDArray[np.float64], along: NDArray[np.float64], arclength: float) -> BranchPoint:
        """Return the branch point at a corrected `x`, evaluated exactly there and oriented along `along`."""
        return self.point(Correction(x, self.evaluate_late(x), 0, 0.0, 0.0), along, arclength)

    def evaluate(self, x: NDArray[np.float64]) -> Evaluation:
        """Evaluate the equation at scaled variables; errors as `Equation.evaluate`."""
        return self.equation.evaluate(x[:-1] * self._unknown_scales, float(x[-1] * self.scales[-1]))

    def evaluate_late(self, x: NDArray[np.float64]) -> Evaluation:
        """Evaluate the equation with its derivatives late where they are dear; see `OrbitEquation.evaluate_late`."""
        if not self.is_dear:
            return self.evaluate(x)
        equation = cast("OrbitEquation", self.equation)
        return equation.evaluate_late(x[:-1] * self._unknown_scales, float(x[-1] * self.scales[-1]))

    def evaluated_near(self, x: NDArray[np.float64]) -> Evaluation:
        """Return the evaluation at a point, or at most a last Newton step away from it, where its derivatives do too.

        Errors as `Equation.evaluate`.
        """
        known = self._recent.get(x.tobytes())
        return self.evaluate(x) if known is None else known

    def forget(self) -> None:
        """Forget the evaluations of earlier points, so that a step does not depend on whether the walk was resumed."""
        self._recent.clear()

    def tangent(self, evaluation: Evaluation, along: NDArray[np.float64]) -> Course:
        """Return the unit tangent at a point, oriented along `along`, and the determinant bordered by it."""
        matrix = self._bordered(evaluation, along)
        right = np.zeros((len(along), 1))
        right[-1] = 1.0
        factors, pivots, solution, singular = lapack.dgesv(matrix, right)
        if not singular:
            return self._course(factors, pivots, solution[:, 0])
        tangent = np.linalg.svd(matrix[:-1])[2][-1]
        tangent *= np.sign(tangent @ along) or 1.0
        return Course(tangent, self._determinant(evaluation, tangent))

    def jacobian(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the derivatives of the residual by all scaled variables at `x`, shape (N, N + 1)."""
        evaluation = self.evaluate(x)
        assert evaluation.by_parameter is not None
        return np.column_stack((evaluation.by_unknowns, evaluation.by_parameter)) * self.scales

    def uncorrected(self, x: NDArray[np.float64], tangent: NDArray[np.float64], arclength: float) -> BranchPoint:
        """Return the branch point at `x` without correction, for places where Newton's method is ill-posed."""
        return self.evaluated(x, self.evaluate(x), tangent, arclength)

    def crossed(
        self, x: NDArray[np.float64], tangent: NDArray[np.float64], arclength: float, count: int = 1
    ) -> BranchPoint:
        """Return the branch point near `x` where others cross, in the plane of `count` directions."""
        # The point is corrected in all directions except those of the other branches. In them the bordered Jacobian is
        # singular, and `x` is known more accurately than Newton's method could determine it.
        evaluation = self.evaluate(x)
        left, sizes, ways = np.linalg.svd(self._bordered(evaluation, tangent))
        off = left.T @ np.append(-evaluation.residual, 0.0)
        return self.uncorrected(x + ways[:-count].T @ (off[:-count] / sizes[:-count]), tangent, arclength)

    def evaluated(
        self, x: NDArray[np.float64], evaluation: Evaluation, tangent: NDArray[np.float64], arclength: float
    ) -> BranchPoint:
        """Return the branch point at `x`, given its evaluation and tangent."""
        course = Course(tangent, self._determinant(evaluation, tangent))
        return self._placed(x, evaluation, course, arclength)

    def _placed(self, x: NDArray[np.float64], evaluation: Evaluation, course: Course, arclength: float) -> BranchPoint:
        value = x.item(-1) * self._last_scale
        if len(x) <= _FEW or self.is_dear:
            if len(self._recent) >= (_KEPT if len(x) <= _FEW else _KEPT_LARGE):
                late_ones = (key for key, each in self._recent.items() if not is_known(each, "by_unknowns"))
                del self._recent[next(late_ones, next(iter(self._recent)))]
            self._recent[x.tobytes()] = evaluation
        orbit = self.equation.orbit(x[:-1] * self._unknown_scales, value, evaluation)
        return BranchPoint(value, orbit, x, *course, arclength)

    def point(self, correction: Correction, along: NDArray[np.float64], arclength: float) -> BranchPoint:
        """Return the branch point of a correction."""
        course = correction.course
        if not is_known(correction.evaluation, "by_unknowns"):
            later = cache(lambda: self.tangent(correction.evaluation, along))
            course = Course(late(lambda: later().tangent), late(lambda: later().determinant))
            return self._placed(correction.x, correction.evaluation, course, arclength)
        way = 0.0 if course is None else float(course.tangent @ along)
        if course is None or abs(way) < _ACROSS:
            course = self.tangent(correction.evaluation, along)
        elif way < 0.0:
            course = Course(-course.tangent, -course.determinant)
        return self._placed(correction.x, correction.evaluation, course, arclength)

    def at_value(self, guess: NDArray[np.float64], value: float) -> Correction | None:
        """Return the point of the branch at a given value of the parameter, from a guess."""
        normal = np.zeros(len(guess))
        normal[-1] = 1.0
        start = guess.copy()
        start[-1] = value / self.scales[-1]
        return self.correct(start, normal)

    def point_near(
        self,
        guess: NDArray[np.float64],
        normal: NDArray[np.float64],
        arclength: float = 0.0,
        along: NDArray[np.float64] | None = None,
        near: float = math.inf,
        within: float = math.inf,
    ) -> BranchPoint | None:
        """Return the branch point in the plane through a guess, oriented along its normal or a given direction."""
        # It is None if Newton fails, or leads farther away than `within`; `near` is as in `correct`.
        correction = self.correct(guess, normal, near=near)
        if correction is None or correction.distance > within:
            return None
        return self.point(correction, normal if along is None else along, arclength)

    def point_ahead(self, point: BranchPoint, distance: float, within: float = math.inf) -> BranchPoint | None:
        """Return the branch point at a distance from another one along its tangent; None as in `point_near`."""
        guess = point.x + distance * point.tangent
        return self.point_near(guess, point.tangent, point.arclength + distance, within=within)

    def point_at(
        self, guess: NDArray[np.float64], value: float, along: NDArray[np.float64], arclength: float = 0.0
    ) -> BranchPoint | None:
        """Return the branch point at a value of the parameter, oriented along a direction; None if Newton fails."""
        correction = self.at_value(guess, value)
        return None if correction is None else self.point(correction, along, arclength)

    def _bordered(self, evaluation: Evaluation, border: NDArray[np.float64]) -> NDArray[np.float64]:
        assert evaluation.by_parameter is not None
        size = len(border)
        matrix = np.empty((size, size), order="F")
        np.multiply(evaluation.by_unknowns, self._unknown_scales, out=matrix[:-1, :-1])
        np.multiply(evaluation.by_parameter, self._last_scale, out=matrix[:-1, -1])
        matrix[-1] = border
        return matrix

    def _course(self, factors: NDArray[np.float64], pivots: NDArray[np.intp], along: NDArray[np.float64]) -> Course:
        """Return tangent and determinant from the factors of a bordered matrix and its solution along the border."""
        # replacing the border by the unit tangent t/|t| multiplies the determinant by t.t/|t| (Cramer's rule)
        length = length_of(along)
        return Course(along / length, self._product(factors, pivots) * length)

    def _determinant(self, evaluation: Evaluation, border: NDArray[np.float64]) -> float:
        """Return the determinant of the Jacobian bordered by a unit vector; see `Course`."""
        factors, pivots, singular = lapack.dgetrf(self._bordered(evaluation, border))
        return 0.0 if singular else self._product(factors, pivots)

    def _product(self, factors: NDArray[np.float64], pivots: NDArray[np.intp]) -> float:
        """Return the determinant of a bordered matrix, for unscaled unknowns, from its factors."""
        swaps = sum(place != row for row, place in enumerate(pivots.tolist()))
        size = bounded_product(list(map(truediv, factors.diagonal().tolist(), self._column_scales)))
        return -size if swaps % 2 else size


def _largest(vector: NDArray[np.float64]) -> float:
    """Return the largest absolute component (for short vectors several times faster than NumPy's)."""
    return max(map(abs, vector.tolist()))


def length_of(vector: NDArray[np.float64]) -> float:
    """Return the length of a vector (for short vectors several times faster than NumPy's)."""
    return math.sqrt(vector.dot(vector))


def bounded_product(factors: list[float]) -> float:
    """Return the product of nonzero numbers, with the correct sign even where its size overflows or underflows."""
    # In that case its size is 1e300 or 1e-300, which is sufficient where only the sign matters.
    product = math.prod(factors)
    if 0.0 < abs(product) < math.inf:
        return product
    logarithm = sum(math.log(abs(factor)) for factor in factors)
    sign = -1.0 if sum(factor < 0.0 for factor in factors) % 2 else 1.0
    return sign * math.exp(min(max(logarithm, -_LOGARITHM), _LOGARITHM))


def ahead(
    earlier: BranchPoint | None, previous: BranchPoint | None, point: BranchPoint, step: float
) -> list[NDArray[np.float64]]:
    """Return guesses for the point one step ahead, best first: by a polynomial through known points, by the tangent."""
    # The polynomial is the cubic through two points or, if the point before them agrees, the quintic through three.
    straight = point.x + step * point.tangent
    if previous is None or point.orbit.stuck:  # a cubic would amplify errors of what friction keeps, fivefold in a step
        return [straight]
    length = point.arclength - previous.arclength
    if not 0.0 < step < 3.0 * length:
        return [straight]
    curved = hermite(previous, point, 1.0 + step / length)
    bent = length_of(curved - straight)
    if bent > 0.5 * step:
        return [straight]
    # both guesses lie on the same plane across the tangent
    curved += ((straight - curved) @ point.tangent) * point.tangent
    if earlier is not None and length < 3.0 * (previous.arclength - earlier.arclength):
        finer = interpolated((earlier, previous, point), point, step)
        if finer is not None and length_of(finer - curved) < _AGREES * bent:
            curved = finer
    return [curved, straight]


def interpolated(points: Sequence[BranchPoint], origin: BranchPoint, ahead: float) -> NDArray[np.float64] | None:
    """Return the place ahead of a point on the polynomial through some points, with their tangents."""
    # The polynomial is a function of the distance along the tangent at that point. Unlike the arclength, which sums
    # chords, this distance is exact, so that the order of the polynomial counts. The result is None if the branch turns
    # away from the tangent.
    along = origin.tangent
    rates = [float(point.tangent @ along) for point in points]
    if min(rates) < _ALONG:
        return None
    places = [float((point.x - origin.x) @ along) for point in points]
    total = np.zeros(len(along))
    for point, place, rate in zip(points, places, rates, strict=True):
        others = [each for each in places if each != place]
        weight = math.prod((ahead - each) / (place - each) for each in others) ** 2
        off, slope = ahead - place, sum(1.0 / (place - each) for each in others)
        total += (weight * (1.0 - 2.0 * slope * off)) * point.x + (weight * off / rate) * point.tangent
    return total


def hermite(a: BranchPoint, b: BranchPoint, share: float) -> NDArray[np.float64]:
    """Evaluate the cubic through two points with their tangents: `share` 0 is the first, 1 the second, > 1 is ahead."""
    length, t = b.arclength - a.arclength, share
    return (
        (1 + 2 * t) * (1 - t) ** 2 * a.x
        + t * (1 - t) ** 2 * length * a.tangent
        + t * t * (3 - 2 * t) * b.x
        + t * t * (t - 1) * length * b.tangent
    )


# Location of a zero of a function between two neighbouring points of a branch, on corrected points.

_LOCATED = 1e-11  # accuracy, as a share of the step
_ATTEMPTS = 40  # evaluations


class Zero(NamedTuple):
    """Place of a zero in a step."""

    share: float  #: Share of the step.
    point: BranchPoint  #: The point there.
    #: Change of the parameter in the last iteration; the length of the step where Newton's method failed on the way.
    width: float


def zero_in_step(
    before: BranchPoint, after: BranchPoint, corrector: Corrector, function: Callable[[BranchPoint], float]
) -> Zero:
    """Locate the zero of a function that changes its sign in a step, by Brent's method; else its nearest point."""
    length = after.arclength - before.arclength
    tried: list[tuple[float, float, BranchPoint]] = []

    def height(share: float) -> float:
        if share in (0.0, 1.0):
            point = before if share == 0.0 else after
        else:
            guess, arclength = hermite(before, after, share), before.arclength + share * length
            point = corrector.point_near(guess, before.tangent, arclength)
            if point is None:
                raise ConvergenceError("Newton's method fails inside a step")
        tried.append((share, function(point), point))
        return tried[-1][1]

    try:
        zero_between_signs(height, 0.0, 1.0, absolute=_LOCATED, most=_ATTEMPTS)
    except NumericalError:
        share, _, point = min(tried, key=lambda each: abs(each[1]))
        return Zero(share, point, abs(after.value - before.value))
    share, _, point = tried[-1]
    return Zero(share, point, abs(point.value - tried[-2][2].value))

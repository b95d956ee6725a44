"""Tori as equations: a closed curve that the m-th stroboscopic map carries into itself.

    u(psi + 2 pi rho) = P^m(u(psi))

The unknowns are N states of the curve, at equally spaced phases, and the rotation number rho. The same curve with
another beginning of the phase is a solution too; a phase condition selects one (Schilder, Osinga and Vogt 2005, SIAM J.
Appl. Dyn. Syst. 4, 459-488). With two parameters, rho may be kept, and the second parameter is the unknown.

Method: docs/numerics/notes/tori.md
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Any, cast

import numpy as np
from annotated_types import Ge, Le
from numpy.typing import NDArray
from scipy.linalg import lapack

from gapwalk.attractors.lyapunov import birkhoff_weights
from gapwalk.attractors.rotation import rotation
from gapwalk.attractors.section import Strobe
from gapwalk.attractors.settle import Attractor, Settled
from gapwalk.continuation.corrector import Correction, Corrector, Course, length_of
from gapwalk.errors import ConvergenceError, ModelError, NumericalError
from gapwalk.flow.equations import smallness
from gapwalk.flow.flow import PERIOD, Arc, flow_of
from gapwalk.flow.motion import is_dry
from gapwalk.model.bounds import check_fields
from gapwalk.model.coefficients import ParameterPlane, loads_act, numbers_vary
from gapwalk.model.system import System
from gapwalk.orbit.orbit_equation import Equation, Evaluation
from gapwalk.orbit.sticking import transition_of
from gapwalk.tori.torus import (
    Torus,
    error_of,
    has_tone,
    normal_exponents,
    odd,
    of_quasi_periodic,
    resampled,
    rotation_matrices,
    tangents,
)


@dataclass(frozen=True, eq=False)
class TorusLinearisation:
    """Residual and derivatives of a `TorusEquation` at some unknowns, without the zeros of its Jacobian."""

    arcs: list[Arc]  #: The arcs over m forcing periods from each state.
    residual: NDArray[np.float64]  #: shape (N * size + 1,): The residual, and that of the phase condition.
    transitions: NDArray[np.float64]  #: shape (N, size, size): The transition matrices of the arcs.
    rotation: NDArray[np.float64]  #: shape (N, N): The matrix that rotates the samples.
    #: shape (N * size + 1, 2): Derivatives of the residual by the last unknown and by the parameter.
    columns: NDArray[np.float64]
    phase_row: NDArray[np.float64]  #: shape (N * size,): Derivatives of the phase condition.

    def dense(self) -> NDArray[np.float64]:
        """Return the Jacobian by the unknowns, without the parameter."""
        count, size = self.transitions.shape[:2]
        jacobian = np.zeros((count * size + 1, count * size + 1))
        blocks = jacobian[:-1, :-1].reshape(count, size, count, size)
        for entry in range(size):
            blocks[:, entry, :, entry] = -self.rotation
        places = np.arange(count)
        blocks[places, :, places, :] += self.transitions
        jacobian[:, -1] = self.columns[:, 0]
        jacobian[-1, :-1] = self.phase_row
        return jacobian

    def product(self, changes: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the changes of the residual with some changes of all unknowns and the parameter, in columns."""
        count, size = self.transitions.shape[:2]
        curves = changes[:-2].reshape(count, size, -1)
        rotated = (self.rotation @ curves.reshape(count, -1)).reshape(curves.shape)
        moved = (self.transitions @ curves - rotated).reshape(count * size, -1)
        return np.vstack((moved, self.phase_row @ changes[:-2])) + self.columns @ changes[-2:]


@dataclass(frozen=True, eq=False)
class TorusEquation:
    """Equations of a torus of N samples in N states and the rotation number, or in N states and a second parameter.

    The Jacobian of the residual by the unknowns, with the transition matrices ``DP_j``, the rotation matrix S of the
    samples and the identity I of a state:

        [ DP_1                        |                ]
        [       ...        -  S (x) I |  -dS/drho u    ]
        [            DP_N             |                ]
        [ ------------------------------------------- ]
        [ u_ref'_1   ...    u_ref'_N  |  0             ]
    """

    system: System  #: The system.
    parameter: str  #: The parameter to follow.
    #: m, the number of curves that the strobes visit in turn, or of forcing periods after which they return to one.
    curves: int
    reference: NDArray[np.float64]  #: shape (N, state_size): The curve whose phase a solution has.
    kept: float | None = None  #: Rotation number to keep; None if it is the last unknown.
    second: str = ""  #: The parameter that is the last unknown if the rotation number is kept.
    tolerance: float = 1e-10  #: Largest residual of a torus, relative to the size of its states.
    last_scale: float = 0.5  #: Scale of the last unknown: half a turn, or the range of the second parameter.

    def __post_init__(self) -> None:
        refuse_without_tori(self.system)
        for name in self._names:
            self.system.structure.place(name)

    @property
    def count(self) -> int:
        """N, the number of samples."""
        return len(self.reference)

    @property
    def _names(self) -> tuple[str, ...]:
        return (self.parameter, self.second) if self.second else (self.parameter,)

    @cached_property
    def _plane(self) -> ParameterPlane:
        return ParameterPlane(self.system, self._names)

    @cached_property
    def _flow(self) -> Any:
        return flow_of(self.system, *self._names, transition=True)

    @cached_property
    def _phase_row(self) -> NDArray[np.float64]:
        """Derivatives of the phase condition: the curve does not move along its tangents, on average."""
        unit = self.system.state_scales()
        row = tangents(self.reference / unit) / unit
        return (row / np.abs(row).max() / self.count).ravel()

    def split(
        self, unknowns: NDArray[np.float64], value: float
    ) -> tuple[NDArray[np.float64], float, tuple[float, ...]]:
        """Return the states, the rotation number, and the values of the parameters that belong to unknowns."""
        states, last = unknowns[:-1].reshape(self.count, -1), float(unknowns[-1])
        return (states, last, (value,)) if self.kept is None else (states, self.kept, (value, last))

    def system_at(self, unknowns: NDArray[np.float64], value: float) -> System:
        """Return the system that unknowns and a value of the parameter belong to."""
        return self._plane.system_at(*self.split(unknowns, value)[2])

    def evaluate(self, unknowns: NDArray[np.float64], value: float) -> Evaluation:
        """Return residual and derivatives; the evidence is the `TorusLinearisation`."""
        found = self.linearise(unknowns, value)
        return Evaluation(found.residual, found.dense(), found.columns[:, 1], found)

    def linearise(self, unknowns: NDArray[np.float64], value: float) -> TorusLinearisation:
        """Return residual and derivatives as they are: blocks along the curve, and a rotation; errors as `evaluate`."""
        states, rotation, point = self.split(unknowns, value)
        coefficients, slopes = self._plane.coefficients(*point)
        stop = PERIOD * self.curves
        arcs: list[Arc] = [self._flow.integrate(coefficients, state, 0.0, stop, slopes) for state in states]
        matrix, slope = rotation_matrices(self.count, rotation)
        residual = (np.array([arc.state for arc in arcs]) - matrix @ states).ravel()
        along = np.array([arc.sensitivity for arc in arcs]).reshape(residual.size, -1)
        last = -(slope @ states).ravel() if self.kept is None else along[:, 1]
        phase = float(self._phase_row @ (states - self.reference).ravel())
        return TorusLinearisation(
            arcs,
            np.append(residual, phase),
            np.array([transition_of(arc) for arc in arcs]),
            matrix,
            np.vstack((np.column_stack((last, along[:, 0])), np.zeros(2))),
            self._phase_row,
        )

    def scales(self, states: NDArray[np.float64], smallest: float) -> NDArray[np.float64]:
        """Return the scales of the unknowns: a motion of its own size counts as 1, whatever the number of samples."""
        unit = self.system.state_scales()
        length = max(float((np.abs(states) / unit).max()), smallest, smallness(self.system))
        return np.append(np.tile(unit * length, self.count) * np.sqrt(self.count), self.last_scale)


def refuse_without_tori(system: System) -> None:
    """Raise a ModelError for a system whose tori are not computed: with friction, rigid stops, or no excitation."""
    if is_dry(system.structure):
        raise ModelError(
            "tori of systems with dry friction or rigid stops are not computed: where the sequence of slip, stick and "
            "impacts changes along a torus, it has corners; settle() and classify() find the stable ones, "
            "lyapunov() their exponents"
        )
    if not (loads_act(system) or numbers_vary(system) or has_tone(system)):
        raise ModelError(
            "nothing excites this system: tori are computed as closed curves of strobes, once in each period of the "
            "excitation, and a free motion has none; gw.free.follow_self_excited(...) follows its periodic motions. "
            "Tori that begin at their Neimark-Sacker points are not computed; settle() shows stable ones"
        )


# Corrector of tori: Newton's method whose dense Jacobian is factorised once for all passes.
#
# The bordered Jacobian of a curve with N samples has some N * size rows. Its factors at the guess serve the later
# passes too: their systems are solved by iterative refinement, whose products use the blocks and the rotation of the
# exact Jacobian. So every pass is one of Newton's method, and only the first one factorises a matrix.

_DIVERGING = 2.0  # growth of the residual from one iteration to the next at which the corrector gives up
_CONTRACTION = 0.5  # largest ratio of successive steps that converge; of residuals, above which one is rounding
_QUADRATIC = 1e-7  # residual, over the size of the motion, and step, after which the next one reaches rounding
_POLISH = 1e-5  # longest last step
_EXACT = 3e-14  # residual, over the size of the motion, that is only rounding
_REFINEMENTS = 8
_REFINED = 1e-10  # residual of a linear system, over its right-hand side, at which its solution is accepted
_FASTER = 0.3  # ratio of successive such residuals above which the matrix is factorised again
_NONE = np.zeros((0, 0))  # the Jacobian of a torus is kept as its blocks

Array = NDArray[np.float64]


class _Factors:
    """Factors of a bordered Jacobian, which also solve systems with others near it."""

    def __init__(self, scales: Array, normal: Array) -> None:
        self.scales, self.normal = scales, normal
        self._factors: tuple[Array, NDArray[np.intp]] | None = None

    def solve(self, found: TorusLinearisation, right: Array) -> Array | None:
        """Return the solutions for some right-hand sides in columns, in scaled variables; None if singular."""
        if self._factors is not None:
            solution = self._refined(found, right)
            if solution is not None:
                return solution
        size = len(self.scales)
        matrix = np.empty((size, size), order="F")
        matrix[:-1, :-1], matrix[:-1, -1], matrix[-1] = found.dense(), found.columns[:, 1], self.normal
        matrix[:-1] *= self.scales
        factors, pivots, singular = lapack.dgetrf(matrix, overwrite_a=True)
        if singular:
            return None
        self._factors = factors, pivots
        return lapack.dgetrs(factors, pivots, right)[0]

    def _refined(self, found: TorusLinearisation, right: Array) -> Array | None:
        assert self._factors is not None
        wanted = np.abs(right).max(axis=0)
        solution, residual, before = np.zeros_like(right), right, math.inf
        for _ in range(_REFINEMENTS):
            solution = solution + lapack.dgetrs(*self._factors, residual)[0]
            product = found.product(solution * self.scales[:, None])
            residual = right - np.vstack((product, self.normal @ solution))
            off = float((np.abs(residual).max(axis=0) / wanted).max())
            if off <= _REFINED:
                return solution
            if not off < _FASTER * before:
                return None
            before = off
        return None


class TorusCorrector(Corrector):
    """Corrector for families of tori; see `Corrector`.

    Shapes: `scales` (N * size + 2,).
    """

    def __init__(self, curves: TorusEquation, scales: Array) -> None:
        super().__init__(cast(Equation, cast(object, curves)), scales)
        self.curves = curves

    def correct(self, guess: Array, normal: Array, trust: float = 0.0, near: float = math.inf) -> Correction | None:
        """Return the torus of the family in the plane through `guess` with that `normal`; None if Newton fails."""
        # The residual need only be so small that the next pass reaches rounding: the error of a torus is measured
        # between its samples, so that a wrong pass would be seen there.
        factors, right = _Factors(self.scales, normal), np.zeros((len(guess), 2), order="F")
        right[-1, 1] = 1.0
        x, last, before = guess, 0.0, math.inf
        for iteration in range(self.iterations + 1):
            unknowns = x[:-1] * self.scales[:-1]
            try:
                found = self.curves.linearise(unknowns, float(x[-1] * self.scales[-1]))
            except NumericalError:
                return None
            size, scale = (float(np.abs(each).max()) for each in (found.residual, unknowns))
            solved = size <= self.curves.tolerance * scale
            if not solved and not size <= _DIVERGING * before:
                return None
            right[:-1, 0], right[-1, 0] = -found.residual, 0.0
            steps = factors.solve(found, right)
            if steps is None:
                return None
            length = length_of(steps[:, 0])
            converges = solved and (not last or length <= _CONTRACTION * last or size >= _CONTRACTION * before)
            if converges or size <= _EXACT * scale or max(size / scale, length) <= _QUADRATIC:
                # where the residual is only rounding, a long step means a nearly singular Jacobian, as at a resonance
                x = x + steps[:, 0] if length < _POLISH else x
                along = steps[:, 1]
                evaluation = Evaluation(found.residual, _NONE, found.columns[:, 1], found)
                course = Course(along / length_of(along), math.nan)
                return Correction(x, evaluation, iteration, length_of(x - guess), last, course)
            x, last, before = x + steps[:, 0], length, size
        return None

    def tangent(self, evaluation: Evaluation, along: Array) -> Course:
        """Return the unit tangent at a point, oriented along `along`; its determinant is not computed."""
        right = np.zeros((len(along), 1), order="F")
        right[-1] = 1.0
        found = _Factors(self.scales, along).solve(evaluation.evidence, right)
        if found is None:
            raise NumericalError("the tangent of a family of tori is not unique")
        return Course(found[:, 0] / length_of(found[:, 0]), math.nan)


# Finding one torus: from a settled quasi-periodic motion, at fixed parameters, by Newton's method.
#
# Method: docs/numerics/notes/tori.md

STROBES = (1024, 4096)
"""Strobes on each curve from which a torus is sought, fewer first: they take longer than the torus itself."""

_ITERATIONS = 12  # Newton steps
_LOST = 100.0  # growth of the residual at which Newton's method gives up


_Share = Annotated[float, Ge(1e-13), Le(1e-2)]
_Samples = Annotated[int, Ge(9), Le(4097)]


@dataclass(frozen=True, slots=True)
class TorusOptions:
    """Accuracy of tori.

    Examples
    --------
    >>> gw.tori.TorusOptions(accuracy=1e-6, max_samples=129).samples
    33
    """

    #: Largest distance between a curve and its image, relative to the size of the motion; it is measured between the
    #: samples too, and decides their number.
    accuracy: _Share = 1e-9
    #: Number of samples of a curve at the start; even numbers count as the next odd one.
    samples: _Samples = 33
    max_samples: _Samples = 513  #: The most samples.
    #: Largest distance, as for `accuracy`, that is accepted with the largest number of samples; it must also be small
    #: compared with the curve. Where a contact grazes along a torus, the second derivative of its curve is not bounded,
    #: and the accuracy may be out of reach.
    tolerated: _Share = 1e-5

    def __post_init__(self) -> None:
        check_fields(self)
        if self.samples > self.max_samples:
            raise ModelError(f"samples is {self.samples}, more than max_samples = {self.max_samples}")

    def finer(self, count: int) -> int | None:
        """Return the next number of samples, 1.5 times as many; None if that would be too many."""
        more = min(odd(3 * count // 2), odd(self.max_samples - 1))
        return more if more > count else None

    def accepts(self, torus: Torus) -> bool:
        """Return True if a torus is accurate enough for its number of samples."""
        if not torus.is_resolved:
            return False
        return torus.error <= (self.accuracy if self.finer(torus.count) else max(self.accuracy, self.tolerated))


def find_torus(motion: Settled | Attractor | Torus, options: TorusOptions | None = None) -> Torus:
    """Find the torus on which a motion has settled, as an invariant curve of the stroboscopic map.

    Parameters
    ----------
    motion
        The settled motion (`gw.settle`, `gw.classify`), or a torus to compute with other options.
    options
        Accuracy and number of samples.

    Returns
    -------
    Torus
        With its rotation number, measured error and stability.

    Raises
    ------
    ModelError
        For a system with dry friction or rigid stops, or without excitation.
    ConvergenceError
        If the motion is not quasi-periodic, or its torus is not smooth enough for the accuracy.

    Examples
    --------
    >>> import gapwalk as gw
    >>> torus = gw.tori.find_torus(gw.settle(gw.paper.case("13"), frequency=0.672))
    >>> torus.curves, round(torus.rotation, 8)
    (2, 0.31612601)
    """
    options = options or TorusOptions()
    refuse_without_tori(motion.system)
    if isinstance(motion, Torus):
        return resolved_torus(motion.system, motion.states, motion.rotation, motion.curves, options)
    if motion.orbit is not None:
        raise ConvergenceError(
            f"the motion is periodic (period {motion.orbit.period}); a torus needs a quasi-periodic one. Tori begin at "
            "Neimark-Sacker points: gw.tori.follow_tori(special_point, ...)"
        )
    for strobes in STROBES:
        try:
            return resolved_torus(motion.system, *_start(motion, strobes, options), options)
        except NumericalError:
            if strobes == STROBES[-1]:
                raise
    raise AssertionError("there is a last number of strobes")


def resolved_torus(
    system: System, curve: NDArray[np.float64], turns: float, curves: int, options: TorusOptions
) -> Torus:
    """Return the torus next to a curve, with as many samples as its accuracy needs."""
    count = odd(options.samples - 1) if len(curve) < options.samples else len(curve)
    while True:
        curve = resampled(curve, count)
        try:
            torus = solve(system, curves, turns, curve)
        except NumericalError as error:
            problem, found = str(error), None
        else:
            if options.accepts(torus):
                return torus
            problem, found = f"its error is {torus.error:.2g} with {torus.count} samples", torus
        more = options.finer(count)
        if more is None:
            grazes = (
                "; a contact grazes along it, so that it is smooth only piecewise" if found and found.grazes else ""
            )
            raise ConvergenceError(
                f"no torus found to an accuracy of {options.accuracy:g}: {problem}{grazes}; raise tolerated or "
                "max_samples"
            )
        count = more
        if found is not None:
            curve, turns = found.states, found.rotation


def _start(motion: Settled | Attractor, count: int, options: TorusOptions) -> tuple[NDArray[np.float64], float, int]:
    """Return a curve, a rotation number and the number of curves from so many strobes of a settled motion."""
    strobe, state = Strobe(motion.system), motion.strobes[-1]
    strobes = strobe.run(state, count)
    first = rotation(np.vstack((motion.strobes, strobes)))
    if first is None:
        raise ConvergenceError(
            "the strobes of the motion lie on no closed curves; it may be chaotic (gw.classify), or not settled yet"
        )
    if first.curves > 1:  # as many of each curve
        strobes = np.vstack((strobes, strobe.run(strobes[-1], count * (first.curves - 1))))
    sharper = rotation(strobes, first.curves) or first
    on_one = strobes[:: sharper.curves]
    curve = of_quasi_periodic(on_one, sharper.number, odd(options.samples - 1), birkhoff_weights(len(on_one)))
    return curve, sharper.number, sharper.curves


def solve(system: System, curves: int, turns: float, curve: NDArray[np.float64]) -> Torus:
    """Return the torus next to a curve, with as many samples, by Newton's method."""
    equation = TorusEquation(system, system.structure.names[0], curves, curve)
    value = float(system.values[0])
    unknowns = np.append(curve, turns).astype(np.float64)
    unit = np.append(np.tile(system.state_scales(), len(curve)), 1.0)
    before = np.inf
    for _ in range(_ITERATIONS):
        evaluation = equation.evaluate(unknowns, value)
        size = float(np.abs(evaluation.residual / unit).max() / np.abs(unknowns / unit)[:-1].max())
        if size <= equation.tolerance and size >= _CONTRACTION * before:
            return torus_of(equation, unknowns, value, evaluation)
        if not size < _LOST * before:
            break
        before = size
        unknowns = unknowns - np.linalg.solve(evaluation.by_unknowns, evaluation.residual).astype(np.float64)
    raise ConvergenceError(f"Newton's method did not converge to a torus; the last residual is {before:.2g}")


def torus_of(equation: TorusEquation, unknowns: NDArray[np.float64], value: float, evaluation: Evaluation) -> Torus:
    """Return the record of a solution, with its error between the samples and its stability."""
    states, turns, _ = equation.split(unknowns, value)
    system, found = equation.system_at(unknowns, value), evaluation.evidence
    growth = normal_exponents(states, found.transitions, turns, system.state_scales())
    touches = [len(arc.contacts) for arc in found.arcs]
    error = error_of(system, equation.curves, turns, states)
    return Torus(system, equation.curves, turns % 1.0, states.copy(), error, *growth, (min(touches), max(touches)))

"""Finding one torus: from a settled quasi-periodic motion, at fixed parameters, by Newton's method.

Method: docs/numerics/tori.md
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Ge, Gt
from numpy.typing import NDArray

from gapwalk.attractors.attractor import Attractor, Settled
from gapwalk.attractors.lyapunov import birkhoff_weights
from gapwalk.attractors.rotation import rotation
from gapwalk.attractors.section import Strobe
from gapwalk.errors import ConvergenceError, ModelError, NumericalError
from gapwalk.model.system import System
from gapwalk.orbit.orbit_equation import Evaluation
from gapwalk.tori.closed_curve import odd, of_quasi_periodic, resampled
from gapwalk.tori.normal_stability import normal_exponents
from gapwalk.tori.torus import Torus, error_of
from gapwalk.tori.torus_equation import TorusEquation, refuse_without_tori

STROBES = (1024, 4096)
"""Strobes on each curve from which a torus is sought, fewer first: they take longer than the torus itself."""

_ITERATIONS = 12  # Newton steps
_CONTRACTION = 0.5  # ratio of successive residuals above which a small one is only rounding
_LOST = 100.0  # growth of the residual at which Newton's method gives up


@dataclass(frozen=True, slots=True)
class TorusOptions:
    """Accuracy of tori.

    Examples
    --------
    >>> gw.tori.TorusOptions(accuracy=1e-6, max_samples=129).samples
    33
    """

    #: Largest distance between a curve and its image, relative to the size of the motion, between the samples too,
    #: which decides on the number of samples.
    accuracy: Annotated[float, Gt(0)] = 1e-9
    #: Number of samples of a curve at the start; even numbers count as the next odd one.
    samples: Annotated[int, Ge(9)] = 33
    max_samples: Annotated[int, Ge(9)] = 513  #: The most samples.
    #: Largest such distance of a torus with the most samples, which states its error; it must be small beside the size
    #: of the curve too. Where a contact grazes along a torus, the second derivative of its curve is not bounded, and
    #: the accuracy may be out of reach.
    tolerated: Annotated[float, Gt(0)] = 1e-5

    def __post_init__(self) -> None:
        for name in ("accuracy", "tolerated"):
            value = getattr(self, name)
            if not 1e-13 <= value <= 1e-2:
                raise ModelError(f"{name} is {value!r}; it must lie between 1e-13 and 1e-2")
        for name in ("samples", "max_samples"):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, int) or not 9 <= value <= 4097:
                raise ModelError(f"{name} is {value!r}; it must be an integer from 9 to 4097")
        if self.samples > self.max_samples:
            raise ModelError(f"samples is {self.samples}, more than max_samples = {self.max_samples}")

    def finer(self, count: int) -> int | None:
        """Return the next number of samples, half as many more; None if that would be too many."""
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

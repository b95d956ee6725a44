"""Periodic orbits as equations: the interface between continuation and the methods, and Newton's method.

Newton's method here solves for one orbit at fixed parameters, damped so that it converges from rough starts.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple, Protocol

import numpy as np
from annotated_types import Ge, Le
from numpy.typing import NDArray

from gapwalk.errors import ConvergenceError, FlowError
from gapwalk.flow.equations import smallness
from gapwalk.model.bounds import check
from gapwalk.model.coefficients import ParameterLine, coefficients_of
from gapwalk.model.system import System
from gapwalk.orbit.orbit import Orbit, phases

if TYPE_CHECKING:
    from gapwalk.orbit.shooting import TouchEquation

MAX_PERIOD = 10_000
"""Largest number of forcing periods of an orbit; events and samples of each are stored."""
_SAMPLES = 4  # evaluations that show the rounding of a residual
_BESIDE = 1e-14  # distance of these from the solution, relative to the size of the unknowns and of the parameter
_RUNAWAY = 1e12  # size above which unknowns are not a motion, as at an undamped resonance


class Equation(Protocol):
    """Periodic orbit as N equations in N unknowns and one named parameter; continuation requires no more than this."""

    @property
    def parameter(self) -> str | None:
        """Name of the parameter that may vary."""
        ...

    @property
    def tolerance(self) -> float:
        """Largest residual of a solution, relative to the size of the unknowns."""
        ...

    def evaluate(self, unknowns: NDArray[np.float64], value: float) -> Evaluation:
        """Return residual and derivatives; raise a NumericalError where they do not exist."""
        # Shapes: `unknowns` (N,).
        ...

    def orbit(self, unknowns: NDArray[np.float64], value: float, evaluation: Evaluation) -> Orbit:
        """Return the orbit of a solution."""
        # Shapes: `unknowns` (N,).
        ...

    def unknowns(self, orbit: Orbit) -> NDArray[np.float64]:
        """Return the unknowns of an orbit found by any method."""
        ...


@dataclass(frozen=True)
class OrbitEquation:
    """Equation of the orbits of one method; see `Equation`.

    To add a discretisation of orbits, derive from this a frozen dataclass with a default for `options`, and write a
    `Method` that creates it. `evaluate`, `orbit`, `unknowns`, `scales`, `start`, `otherwise` and `embed` are required;
    the others have defaults. Continuation, special points and all code that uses these require no more.

    Examples
    --------
    >>> equation = gw.Shooting(segments=2).pose(system, "frequency")
    >>> equation.unknowns(orbit).shape, equation.system_at(0.7).frequency
    ((4,), 0.7)
    """

    system: System  #: The system.
    parameter: str | None = None  #: The named parameter to follow, or None.
    period: int = 1  #: m, number of forcing periods.
    #: Method that posed the equation; it poses other systems, parameters and periods in the same way.
    options: Any = None

    def __post_init__(self) -> None:
        check_period(self.period)
        if self.parameter is not None:
            self.system.structure.place(self.parameter)

    @property
    def tolerance(self) -> float:
        """Largest residual of a solution, relative to the size of the unknowns."""
        return self.options.tolerance

    @cached_property
    def line(self) -> ParameterLine:
        """Systems along the parameter."""
        assert self.parameter is not None
        return ParameterLine(self.system, self.parameter)

    def coefficients(self, value: float) -> tuple[NDArray[np.float64], NDArray[np.float64] | None]:
        """Return the coefficients of the flow at a value of the parameter, and their derivative if there is one."""
        return (coefficients_of(self.system), None) if self.parameter is None else self.line.coefficients(value)

    def system_at(self, value: float) -> System:
        """Return the system at a value of the parameter; the equation's own if it has no parameter."""
        return self.system if self.parameter is None else self.line.system_at(value)

    def evaluate(self, unknowns: NDArray[np.float64], value: float) -> Evaluation:
        """See `Equation.evaluate`."""
        raise NotImplementedError

    def evaluate_late(self, unknowns: NDArray[np.float64], value: float) -> Evaluation:
        """Return the evaluation; derivatives that cost far more than the residual are computed at their first use."""
        return self.evaluate(unknowns, value)

    @property
    def is_dear(self) -> bool:
        """True if derivatives cost far more than the residual, so those of a nearby point are used where possible."""
        return False

    def orbit(self, unknowns: NDArray[np.float64], value: float, evaluation: Evaluation) -> Orbit:
        """See `Equation.orbit`."""
        raise NotImplementedError

    def unknowns(self, orbit: Orbit) -> NDArray[np.float64]:
        """Return the unknowns of an orbit that was found by any method, shape (N,)."""
        raise NotImplementedError

    def with_other_phases(self, orbit: Orbit) -> list[NDArray[np.float64]]:
        """Return the unknowns of a motion that begins later: at each other place where the excitation is the same.

        For an orbit of period m these are m - 1, or more if the excitation repeats within a forcing period.
        """
        return [self.unknowns(orbit.begun_in(state)) for state in phases(orbit)[1:]]

    def scales(self, length: float, frequency: float | None = None) -> NDArray[np.float64]:
        """Return the change of each unknown that counts as much as a displacement of this length; shape (N,).

        Velocities count as lengths times a frequency, by default that of the system.
        """
        raise NotImplementedError

    def start(self, state: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the unknowns of the motion from a state, as a start for Newton's method."""
        raise NotImplementedError

    def otherwise(self) -> OrbitEquation:
        """Return the equation of the same orbits with another or finer discretisation, for an error estimate."""
        raise NotImplementedError

    def embed(self, direction: NDArray[np.float64], other: OrbitEquation) -> NDArray[np.float64]:
        """Convert a change of the unknowns to the unknowns of `otherwise()`, of which additional ones do not change."""
        raise NotImplementedError

    @property
    def by_touches(self) -> Callable[..., TouchEquation] | None:
        """Function that creates the `TouchEquation` of the same orbits; None if there is none."""
        return None

    def inaccuracy(self, orbit: Orbit) -> str:
        """Return the reason why the orbit of a solution is not accurate enough, with advice; empty if it is."""
        return ""

    def finer(self) -> OrbitEquation | None:
        """Return the equation of the same orbits with a finer resolution, or None if the method has none."""
        return None

    def divided(self, state: NDArray[np.float64]) -> Iterator[tuple[OrbitEquation, NDArray[np.float64]]]:
        """Yield finer equations with starts, for a state whose motion leaves a strongly unstable orbit nearby."""
        yield from ()


class Evaluation(NamedTuple):
    """Residual and derivatives at one point."""

    residual: NDArray[np.float64]  #: shape (N,): Zero on an orbit.
    by_unknowns: NDArray[np.float64]  #: shape (N, N): Its derivative with respect to the unknowns.
    #: shape (N,), or None: Its derivative with respect to the parameter, if the equation has one.
    by_parameter: NDArray[np.float64] | None
    evidence: Any  #: Data that the equation needs to construct an orbit from a solution.
    #: Change of the unknowns within which the derivatives are valid: the depth of the shallowest touch, since the
    #: contribution of a touch grows with the square root of its depth; 0 where friction begins the period in another
    #: mode than that in which it ends it. Infinite if it is not known.
    reach: float = math.inf


@dataclass(frozen=True, slots=True)
class Newton:
    """Options of Newton's method."""

    iterations: int = 40  #: Largest number of iterations.
    #: Largest number of halvings of a step that does not reduce the residual; then it is taken nevertheless.
    halvings: int = 6


def check_period(period: object) -> None:
    """Raise a ModelError unless this can be m, the number of forcing periods of an orbit."""
    check("period", period, Annotated[int, Ge(1), Le(MAX_PERIOD)])


def solve(
    equation: OrbitEquation, unknowns: NDArray[np.float64], value: float, options: Newton | None = None
) -> tuple[NDArray[np.float64], Evaluation]:
    """Return the solution nearest to a start, and the evaluation there."""
    options = options or Newton()
    try:
        evaluation = equation.evaluate(unknowns, value)
    except FlowError as error:
        raise ConvergenceError(f"the motion from the start of Newton's method cannot be followed: {error}") from error
    for _ in range(options.iterations):
        if is_solved(equation, unknowns, evaluation):
            break
        step = np.linalg.lstsq(evaluation.by_unknowns, -evaluation.residual, rcond=1e-14)[0]
        unknowns, evaluation = _damped(equation, unknowns, value, evaluation, step, options.halvings)
    if is_solved(equation, unknowns, evaluation):
        return _polished(equation, unknowns, value, evaluation)
    raise ConvergenceError(
        f"no period-{equation.period} orbit found in {options.iterations} Newton iterations; the last residual is "
        f"{np.abs(evaluation.residual).max():.3g}"
    )


def places_beside(x: NDArray[np.float64], scales: NDArray[np.float64]) -> list[NDArray[np.float64]]:
    """Return unknowns and value 1e-14 aside, always in the same directions: nearer, much of the rounding is the same.

    Shapes: `x`, `scales` (N + 1,).
    """
    sizes = np.append(scales[:-1] * float(np.abs(x[:-1] / scales[:-1]).max()), abs(float(x[-1])))
    return [x + _BESIDE * sizes * way for way in _ways(len(x))]


def roundings(
    x: NDArray[np.float64],
    evaluation: Evaluation,
    places: Sequence[NDArray[np.float64]],
    evaluations: Iterable[Evaluation],
) -> NDArray[np.float64]:
    """Return samples of the rounding errors of a residual, shape (samples, N), from its evaluations at `places_beside`.

    What differs there from the linear change is rounding, however it arises: in each step of a flow, and amplified by
    what follows it.
    """
    assert evaluation.by_parameter is not None
    samples = []
    for place, beside in zip(places, evaluations, strict=True):
        off = place - x
        linear = evaluation.by_unknowns @ off[:-1] + evaluation.by_parameter * off[-1]
        samples.append(beside.residual - evaluation.residual - linear)
    return np.array(samples)


@lru_cache(maxsize=16)
def _ways(size: int) -> NDArray[np.float64]:
    """Return the directions in which a residual is sampled, shape (samples, size)."""
    return np.random.default_rng(0).uniform(-1.0, 1.0, (_SAMPLES, size))


def is_solved(equation: OrbitEquation, unknowns: NDArray[np.float64], evaluation: Evaluation) -> bool:
    """Return True if the residual is within the equation's tolerance, relative to the size of the unknowns."""
    scale = max(smallness(equation.system), float(np.abs(unknowns).max()))
    if scale > _RUNAWAY:
        return False
    return float(np.abs(evaluation.residual).max()) <= equation.tolerance * scale


def _polished(equation: OrbitEquation, unknowns: NDArray[np.float64], value: float, evaluation: Evaluation):
    """Take one more step, which leaves only rounding errors, if it helps and if the orbit is an isolated one."""
    try:
        better = unknowns - np.linalg.solve(evaluation.by_unknowns, evaluation.residual)
        trial = equation.evaluate(better, value)
    except (np.linalg.LinAlgError, FlowError):
        return unknowns, evaluation
    if np.abs(trial.residual).max() < np.abs(evaluation.residual).max():
        return better, trial
    return unknowns, evaluation


def _damped(equation, unknowns, value, evaluation, step, halvings):
    """Return the longest of the halved steps that reduces the residual; if none does, the longest that has one."""
    before, longest = np.linalg.norm(evaluation.residual), None
    for halving in range(halvings + 1):
        trial = unknowns + 0.5**halving * step
        try:
            reached = trial, equation.evaluate(trial, value)
        except FlowError:
            continue
        if np.linalg.norm(reached[1].residual) < before:
            return reached
        longest = longest or reached
    if longest is None:
        raise ConvergenceError("Newton's method left the region in which the motion can be followed")
    return longest

"""What the walk needs to know of a way to pose periodic orbits; shooting is one, harmonic balance another."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from gapwalk.errors import ModelError
from gapwalk.model.system import System
from gapwalk.orbit.method import Method
from gapwalk.orbit.orbit import Orbit

if TYPE_CHECKING:
    from gapwalk.orbit.touch import TouchEquation

MAX_PERIOD = 10_000
"""Forcing periods of an orbit, at most; events and samples of each are kept."""


def check_period(period: object) -> None:
    """A ModelError unless this can be m, the number of forcing periods of an orbit."""
    if isinstance(period, bool) or not isinstance(period, int) or not 1 <= period <= MAX_PERIOD:
        raise ModelError(
            f"period is {period!r}; it must be an integer from 1 to {MAX_PERIOD} (forcing periods of the orbit)"
        )


class Evaluation(NamedTuple):
    """Residual and derivatives at one point.

    Attributes
    ----------
    residual : shape (N,)
        Zero on an orbit.
    by_unknowns : shape (N, N)
        Its derivative by the unknowns.
    by_parameter : shape (N,), or None
        Its derivative by the parameter, if the equation has one.
    evidence
        Whatever the equation wants back to make an orbit of a solution.
    reach
        Change of the unknowns beyond which the derivatives are others: the depth of the shallowest touch, as what a
        touch adds to them grows with the root of its depth. Infinite where nothing of the kind is known.
    """

    residual: NDArray[np.float64]
    by_unknowns: NDArray[np.float64]
    by_parameter: NDArray[np.float64] | None
    evidence: Any
    reach: float = math.inf


class Equation(Protocol):
    """A periodic orbit of `system` as N equations in N unknowns and, possibly, one named parameter.

    The walk asks for no more.
    """

    @property
    def system(self) -> System:
        """The system, at whatever value of the parameter."""
        ...

    @property
    def parameter(self) -> str | None:
        """The named parameter that may vary."""
        ...

    @property
    def period(self) -> int:
        """m, forcing periods of the orbit."""
        ...

    @property
    def tolerance(self) -> float:
        """Largest residual, relative to the size of the unknowns, of a solution."""
        ...

    def evaluate(self, unknowns: NDArray[np.float64], value: float) -> Evaluation:
        """Residual and derivatives; a NumericalError where they do not exist."""
        ...

    def orbit(self, unknowns: NDArray[np.float64], value: float, evaluation: Evaluation) -> Orbit:
        """The orbit of a solution."""
        ...

    def unknowns(self, orbit: Orbit) -> NDArray[np.float64]:
        """The unknowns of an orbit that was found in whatever way."""
        ...


class OrbitEquation(Equation, Protocol):
    """An equation that can be posed anew: for an orbit found in another way, more finely, or for another period.

    To add a way to pose orbits, write a class with these members, and a `Method` that makes it; the walk, the special
    points and everything above ask for no more.
    """

    @property
    def options(self) -> Method:
        """The way in which it is posed; it poses other systems, parameters and periods alike."""
        ...

    @property
    def by_touches(self) -> Callable[..., TouchEquation] | None:
        """Makes the `TouchEquation` of the same orbits, from what that asks for beside them; None if there is none."""
        ...

    def scales(self, length: float, frequency: float | None = None) -> NDArray[np.float64]:
        """How large a change of each unknown weighs as much as a motion of one length; shape (N,).

        Velocities count as lengths times a frequency, by default the system's.
        """
        ...

    def doubt(self, orbit: Orbit) -> str:
        """Why an orbit of a solution is not to be trusted as a motion, and what to change; empty if it is."""
        ...

    def finer(self) -> OrbitEquation | None:
        """The same orbits posed with a finer resolution, where the method leaves that open; otherwise None."""
        ...

    def start(self, state: NDArray[np.float64]) -> NDArray[np.float64]:
        """The unknowns of the motion from a state, from which Newton's method can start."""
        ...

    def otherwise(self) -> OrbitEquation:
        """The same orbits posed in another way, or more finely: how far solutions of both differ tells their error."""
        ...

    def embed(self, direction: NDArray[np.float64], other: OrbitEquation) -> NDArray[np.float64]:
        """A change of the unknowns as one of the unknowns of `otherwise()`; where those are more, the rest is zero."""
        ...

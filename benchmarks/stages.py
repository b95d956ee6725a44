"""The integrator of the baseline: SciPy's DOP853, which an event stops at each contact and which restarts there."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

RELATIVE, ABSOLUTE = 1e-9, 1e-11


@dataclass(frozen=True)
class Exit:
    """An event that ends a stage.

    Parameters
    ----------
    gap
        Function of theta and the state that crosses zero there.
    rising
        Whether it crosses zero from below; a crossing in the other direction enters the stage, and is ignored.
    leads_to
        Index of the next stage.
    """

    gap: Callable[[float, NDArray[np.float64]], float]
    rising: bool
    leads_to: int

    def event(self):
        """Return this event as a function for `solve_ivp`."""

        def event(theta: float, y: NDArray[np.float64]) -> float:
            return self.gap(theta, y)

        event.terminal = True
        event.direction = 1.0 if self.rising else -1.0
        return event


@dataclass(frozen=True)
class Stage:
    """The smooth equations between two contacts: their right-hand side, and the events that end them."""

    slope: Callable[[float, NDArray[np.float64]], object]
    exits: Sequence[Exit]


def integrate(stages: Sequence[Stage], stage: int, y: NDArray[np.float64], stop: float) -> NDArray[np.float64]:
    """Return the state at theta = `stop`, from the state `y` at 0 in a stage.

    A start on an event loses no event: each stage looks only for crossings in the direction that leaves it.
    """
    theta = 0.0
    while True:
        exits = stages[stage].exits
        events = [way.event() for way in exits]
        arc = solve_ivp(
            stages[stage].slope, (theta, stop), y, method="DOP853", rtol=RELATIVE, atol=ABSOLUTE, events=events
        )
        if arc.status < 0:
            raise RuntimeError(arc.message)
        y, theta = arc.y[:, -1], float(arc.t[-1])
        if arc.status == 0:
            return y
        stage = next(way.leads_to for way, times in zip(exits, arc.t_events, strict=True) if len(times))

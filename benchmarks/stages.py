"""The baseline's integrator: SciPy's DOP853, stopped at each contact by an event and started again behind it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

RELATIVE, ABSOLUTE = 1e-9, 1e-11


@dataclass(frozen=True)
class Exit:
    """A way out of a stage.

    Parameters
    ----------
    gap
        Function of theta and the state that crosses zero there.
    rising
        Whether it does so rising; the other way it is the entry, and is not looked for.
    leads_to
        Index of the next stage.
    """

    gap: Callable[[float, NDArray[np.float64]], float]
    rising: bool
    leads_to: int

    def event(self):
        """The same for `solve_ivp`."""

        def event(theta: float, y: NDArray[np.float64]) -> float:
            return self.gap(theta, y)

        event.terminal = True
        event.direction = 1.0 if self.rising else -1.0
        return event


@dataclass(frozen=True)
class Stage:
    """The smooth equations between two contacts: their right-hand side, and where they cease to hold."""

    slope: Callable[[float, NDArray[np.float64]], object]
    exits: Sequence[Exit]


def integrate(stages: Sequence[Stage], stage: int, y: NDArray[np.float64], stop: float) -> NDArray[np.float64]:
    """The state at theta = `stop`, from the state `y` at 0 in a stage.

    No event is missed by starting on one: each stage looks only for crossings in the direction that leaves it.
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

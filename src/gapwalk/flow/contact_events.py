"""Contact events of a motion: the saltation matrix, and the callbacks through which heyoka reports events.

Over theta the motion is ``y' = F(y, theta)``, with ``F-`` before the event and ``F+`` after it. The event is where a
guard ``g(y)`` vanishes, and there the state may be reset to ``R(y)``. With ``den = g_y F- + g_theta``

    S  = R_y + (F+ - R_y F- - R_theta) (x) g_y / den                              state transition
    s+ = R_y s- + R_p + (F+ - R_y F- - R_theta) (g_y s- + g_p) / den              sensitivity to a parameter

(di Bernardo, Budd, Champneys and Kowalczyk 2008, chapter 2). Here no guard and no reset depends on theta. All
derivatives are taken by a complex step, so a force law provides its formulas only. Where the state is not reset and
the force does not jump, the rule is the identity, and nothing is computed.

heyoka copies the callbacks together with the integrator, and holds them where Python's garbage collector does not look.
A callback that refers to the owner of the integrator would keep both alive for good, 2 MB for each structure. Callbacks
therefore hold a weak reference, and each copy of an integrator has its own.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any
from weakref import ref

import numpy as np
from numpy.typing import NDArray

_STEP = 1e-150  # of the complex step

Formula = Callable[[NDArray[Any], NDArray[Any]], NDArray[Any]]
"""A function of states, shape (..., 2n), and of coefficients, shape (..., number of coefficients)."""


def pass_event(
    changes: NDArray[np.float64],
    directions: NDArray[np.float64],
    state: NDArray[np.float64],
    coefficients: NDArray[np.float64],
    guard: Formula,
    reset: Formula,
    flow: Callable[[NDArray[np.float64], bool], NDArray[np.float64]],
) -> NDArray[np.float64]:
    """Return the changes of the state after an event by the general rule, shape (columns, 2n).

    Parameters
    ----------
    changes : shape (columns, 2n)
        Changes before the event.
    directions : shape (columns, number of coefficients)
        Change of the coefficients along each column; zero for a change of the initial state.
    state, coefficients
        State and coefficients at the event, before the reset.
    guard, reset
        The functions g and R.
    flow
        The right-hand sides F at a state, before (False) and after (True) the event.
    """

    def along(formula: Formula, change: NDArray, direction: NDArray | float) -> NDArray[np.float64]:
        found: NDArray[np.complex128] = formula(state + 1j * _STEP * change, coefficients + 1j * _STEP * direction)
        return found.imag / _STEP

    before, after = flow(state, False), flow(reset(state, coefficients), True)
    slip = after - along(reset, before, np.zeros_like(coefficients))
    late = along(guard, changes, directions) / along(guard, before, np.zeros_like(coefficients))
    return along(reset, changes, directions) + np.outer(late, slip)


class EventCall:
    """Callbacks of one event, which call ``owner.at_event(index, ...)``; see `answer_events`.

    Parameters
    ----------
    index
        Index of the event among those of its owner.
    """

    __slots__ = ("index", "owner")

    def __init__(self, index: int) -> None:
        self.index = index
        self.owner: Any = None

    def __deepcopy__(self, memo: Any) -> EventCall:
        """Return the callback for a copy of the integrator, which has another owner."""
        return EventCall(self.index)

    def switch(self, integrator: Any, _direction: int) -> bool:
        """Report a terminal event to the owner; return whether the integrator continues."""
        return self.owner().at_event(self.index, integrator.time)

    def turn(self, integrator: Any, theta: float, _direction: int) -> None:
        """Report an event that does not stop the integrator."""
        self.owner().at_event(self.index, theta)


def answer_events(owner: Any, events: Iterable[Any]) -> None:
    """Connect the callbacks of an integrator's events, methods of `EventCall`s, to ``owner.at_event``."""
    for event in events:
        event.callback.__self__.owner = ref(owner)

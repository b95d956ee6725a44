"""User-defined events: a function of the orbit changes its sign."""

from __future__ import annotations

import math
import reprlib
from collections.abc import Callable, Sequence
from typing import Any

from gapwalk.bifurcation.special_point import Kind
from gapwalk.continuation.curve_points import BranchPoint
from gapwalk.errors import ModelError
from gapwalk.orbit.orbit import Orbit


class Event(Kind):
    """User-defined special point, where a function of the orbit passes zero, such as a limit of a contact force.

    The point is located like a bifurcation, with an error estimate, and stored among the branch's special points.

    Parameters
    ----------
    name
        Name in tables and pictures.
    function
        Function of an orbit that returns a number, in any unit, which varies smoothly along the branch.

    Raises
    ------
    ModelError
        If the name is that of another kind of special point, or the function is not callable.

    Examples
    --------
    The point where the amplitude of x passes 1.2:

    >>> limit = gw.Event("amplitude 1.2", lambda orbit: orbit.measure("half.x") - 1.2)
    >>> followed = gw.follow(orbit, "frequency", 1.2, events=[limit])
    >>> round(followed.special("amplitude 1.2")[0].value, 9)
    0.974812347
    """

    _of_orbit: Callable[[Orbit], float]

    def __new__(cls, name: str, function: Callable[[Orbit], float]) -> Event:  # noqa: D102 - as the class
        if name in Kind.known() or not str(name).strip():
            raise ModelError(f"the event is called {name!r}; choose a name that no other kind of special point has")
        if not callable(function):
            raise ModelError(
                f"the function of the event {name!r} is {function!r}; it must be callable with an orbit, such as "
                'lambda orbit: orbit.measure("max.q1") - 2.0'
            )
        event = super().__new__(cls, name)
        event._of_orbit = function
        return event

    def function(self, point: BranchPoint) -> float:
        """Evaluate the user's function at a point."""
        value = float(self._of_orbit(point.orbit))
        if not math.isfinite(value):
            raise ModelError(
                f"the function of the event {str(self)!r} is {value} at {point.value:.10g}; it must always be finite"
            )
        return value

    def __reduce__(self) -> tuple[Any, ...]:
        return Event, (str(self), self._of_orbit)


def check_events(events: Sequence[Event]) -> None:
    """Raise a ModelError if an entry is not an event, or if two have the same name."""
    if isinstance(events, Event) or not isinstance(events, Sequence) or not all(isinstance(e, Event) for e in events):
        raise ModelError(
            f"events is {reprlib.repr(events)}; write a list of events: "
            'events=[gw.Event("limit", lambda orbit: orbit.measure("max.q1") - 2.0)]'
        )
    if len(set(events)) < len(events):
        raise ModelError(f"two events have the same name: {', '.join(events)}; each needs a name of its own")

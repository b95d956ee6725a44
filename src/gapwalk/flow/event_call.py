"""What heyoka calls at events: objects that a copy of an integrator has of its own, and that keep nothing alive.

heyoka copies the callbacks of an integrator with it. And it holds them where Python's garbage collector does not look:
a callback that held what holds the integrator kept both for good, 2 MB for each structure.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any
from weakref import ref


class EventCall:
    """The callbacks of one event: they call ``owner.at_event(index, ...)``; see `answer_events`.

    Parameters
    ----------
    index
        Of the event among those of its owner.
    """

    __slots__ = ("index", "owner")

    def __init__(self, index: int) -> None:
        self.index = index
        self.owner: Any = None

    def __deepcopy__(self, memo: Any) -> EventCall:
        """That of a copy of the integrator, which has another owner."""
        return EventCall(self.index)

    def switch(self, integrator: Any, _direction: int) -> bool:
        """Answer a terminal event; whether the integrator goes on."""
        return self.owner().at_event(self.index, integrator.time)

    def turn(self, integrator: Any, theta: float, _direction: int) -> None:
        """Answer an event that stops nothing."""
        self.owner().at_event(self.index, theta)


def answer_events(owner: Any, events: Iterable[Any]) -> None:
    """Have the callbacks of an integrator's events, each a method of an `EventCall`, call ``owner.at_event``."""
    for event in events:
        event.callback.__self__.owner = ref(owner)

"""The phases of dry friction over one period of an orbit: slip in one direction, slip in the other, and stick."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from gapwalk.flow.dry_state import SlipEvent

_SIGNS = {1: "+", -1: "-", 0: "0"}


class FrictionPhase(NamedTuple):
    """A phase of friction: its mode, 1 or -1 in slip and 0 in stick, and the angles at which it begins and ends.

    The end of the last phase lies in the next period if it passes the end of its own.
    """

    mode: int
    start: float
    stop: float

    @property
    def length(self) -> float:
        """Its duration in radians."""
        return self.stop - self.start

    def contains(self, theta: float, full: float, margin: float = 0.0) -> bool:
        """Return True if an angle lies within it, on a circle of circumference `full`."""
        return (theta - self.start + margin) % full <= self.length + 2.0 * margin

    def away(self, theta: float, full: float) -> float:
        """Return the distance of an angle from it, on a circle of circumference `full`; 0 within it."""
        after = (theta - self.start) % full
        return 0.0 if after <= self.length else min(after - self.length, full - after)


def friction_phases(slips: Sequence[SlipEvent], contact: int, full: float) -> list[FrictionPhase]:
    """Return the phases of one contact in one period, in order; one that lasts all the period begins at 0.

    Parameters
    ----------
    slips
        The log of an orbit, with the modes at the start of the period first.
    contact
        Number of the contact.
    full
        Length of the period in radians.
    """
    own = [event for event in slips if event.contact == contact]
    turns = [event for before, event in zip([own[-1], *own[:-1]], own, strict=True) if event.slip != before.slip]
    if not turns:
        return [FrictionPhase(event.slip, 0.0, full) for event in own[:1]]
    stops = [*(event.theta for event in turns[1:]), turns[0].theta + full]
    return [FrictionPhase(event.slip, event.theta, stop) for event, stop in zip(turns, stops, strict=True)]


def text_of(phases: Sequence[FrictionPhase]) -> str:
    """Return the modes of successive phases as a text, such as ``+0-0``."""
    return "".join(_SIGNS[phase.mode] for phase in phases)


def stick_words(phases: Sequence[FrictionPhase]) -> str:
    """Return how often friction sticks in a period, such as ``2 sticks``."""
    modes = [phase.mode for phase in phases]
    if not any(modes):
        return "sticks"
    count = modes.count(0)
    return "slips" if not count else f"{count} stick{'s' if count > 1 else ''}"

"""The excitation: harmonics of one fundamental frequency, each with its order, amplitude, phase and place."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from gapwalk.errors import ModelError


@dataclass(frozen=True)
class Harmonic:
    """One term ``amplitude * s * cos(order * W * t + phase)`` of the excitation.

    Parameters
    ----------
    amplitude
        In units of a force (of a torque).
    acts_on
        The vector ``s`` by coordinate name, for example ``{"q1": 1.0}``.
    order
        Multiple of the fundamental frequency, an integer >= 1.
    phase
        In radians.
    name
        Prefix of its parameters' names; ``harmonic<order>`` by default.
    """

    amplitude: float
    acts_on: Mapping[str, float] = field(hash=False)
    order: int = 1
    phase: float = 0.0
    name: str = ""

    def __post_init__(self) -> None:
        check_order(self.order)
        if not self.name:
            object.__setattr__(self, "name", f"harmonic{int(self.order)}")
        object.__setattr__(self, "order", int(self.order))


def check_order(order: float) -> None:
    """Refuse an order that is no positive integer, and say why."""
    if isinstance(order, bool) or not isinstance(order, int | float) or not abs(order) < math.inf:
        raise ModelError(f"order is {order!r}; it must be an integer >= 1")
    if order != int(order):
        raise ModelError(
            f"order is {order}; it must be an integer >= 1: with a non-integer order the excitation is not "
            "periodic in 2 pi/W, so no periodic motion exists. If the orders are commensurate (1 and 1.5, "
            "say), make the largest common divisor the fundamental (orders 2 and 3)"
        )
    if order < 1:
        raise ModelError(f"order is {order}; it must be an integer >= 1 (a constant load belongs in `mean`)")

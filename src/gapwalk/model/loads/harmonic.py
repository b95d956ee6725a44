"""Harmonics of the fundamental frequency."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from gapwalk.model.loads.load import Line, Load
from gapwalk.model.parameter import Parameter
from gapwalk.model.units import QuantityKind


@dataclass(frozen=True)
class Harmonic(Load):
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

    key, words = "harmonic", "a term of the excitation"
    parameters = (
        Parameter("amplitude", QuantityKind.TORQUE, "it is the size of the load"),
        Parameter("phase", QuantityKind.PHASE, "it is the phase", default=0.0),
    )

    amplitude: float
    acts_on: Mapping[str, float] = field(hash=False)
    order: int = 1
    phase: float = 0.0
    name: str = ""

    @classmethod
    def lines(cls, order: int, frequency: Any, numbers: Mapping[str, Any]) -> Iterable[Line]:
        """See `Load.lines`."""
        size, angle = numbers["amplitude"], numbers["phase"]
        yield Line(order, size * np.cos(angle), size * -np.sin(angle))

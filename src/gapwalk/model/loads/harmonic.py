"""Harmonics of the fundamental frequency."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from gapwalk.model.loads.load import Line, Load
from gapwalk.model.loads.over_speed import OverSpeed
from gapwalk.model.parameter import Parameter
from gapwalk.model.units import QuantityKind


@dataclass(frozen=True)
class Harmonic(Load):
    """One term ``amplitude * s * cos(order * W * t + phase)`` of the excitation, or of a variation.

    Examples
    --------
    >>> gw.Harmonic(0.1, {"x": 1.0}, growth=2).name  # the force of an unbalance of 0.1
    'harmonic1'
    """

    key, words, frequencies = "harmonic", "a term of the excitation", ("at",)
    parameters = (
        Parameter("amplitude", QuantityKind.TORQUE, "it is the size of the load"),
        Parameter("phase", QuantityKind.PHASE, "it is the phase", default=0.0),
    )

    #: In units of a force (of a torque); as a variation, a fraction of the number that varies, or a displacement.
    amplitude: float
    #: The vector ``s`` by coordinate name, for example ``{"q1": 1.0}``.
    acts_on: Mapping[str, float] = field(default_factory=dict, hash=False)
    order: int = 1  #: Multiple of the fundamental frequency, an integer >= 1.
    phase: float = 0.0  #: In radians.
    name: str = ""  #: Prefix of its parameters' names; ``harmonic<order>`` by default.
    #: What it varies instead: ``"mesh.stiffness"``, or several names with factors.
    varies: Mapping[str, float] = field(default_factory=dict, hash=False)
    #: Power 0, 1 or 2 of the frequency with which it grows: the term is ``amplitude * (W / at)**growth``. The force of
    #: an unbalance and the torque of an accelerated inertia grow with the power 2.
    growth: int = 0
    at: float = 1.0  #: The frequency W at which it has its amplitude.
    #: A factor that depends on the speed: a smooth formula of the angular frequency, such as ``"1 + 0.1*W"``, or a
    #: `SpeedTable`.
    over_speed: OverSpeed = ()

    @classmethod
    def lines(cls, order: int, frequency: Any, numbers: Mapping[str, Any]) -> Iterable[Line]:
        """See `Load.lines`."""
        size, angle = cls.grown(numbers["amplitude"], frequency, numbers), numbers["phase"]
        yield Line(order, size * np.cos(angle), size * -np.sin(angle))

"""Constant loads that depend on the speed, such as the friction of bearings."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

from gapwalk.model.loads.load import Line, Load
from gapwalk.model.loads.over_speed import OverSpeed
from gapwalk.model.parameter import Parameter
from gapwalk.model.units import QuantityKind


@dataclass(frozen=True)
class Steady(Load):
    """A load that is constant over the angle, and depends on the speed by a factor.

    Examples
    --------
    >>> gw.loads.Steady(0.2, {"x": 1.0}, over_speed="1 + 0.1*W").name  # unlike `mean`, which depends on nothing
    'steady'
    """

    key, words, frequencies = "steady", "a constant load that depends on the speed", ("at",)
    is_periodic, order = False, 0
    parameters = (Parameter("amplitude", QuantityKind.TORQUE, "it is the size of the load"),)

    amplitude: float  #: In units of a force (of a torque).
    #: The vector along which it acts, by coordinate name.
    acts_on: Mapping[str, float] = field(default_factory=dict, hash=False)
    #: The factor: a smooth formula of the angular frequency, such as ``"1 + 0.1*W"``, or a `SpeedTable`.
    over_speed: OverSpeed = ()
    #: growth, at: Power 0, 1 or 2 of the frequency with which it grows, and the frequency W at which it has its
    #: amplitude.
    growth: int = 0
    at: float = 1.0
    name: str = ""  #: Prefix of its parameters' names.

    @classmethod
    def lines(cls, order: int, frequency: Any, numbers: Mapping[str, Any]) -> Iterable[Line]:
        """See `Load.lines`."""
        yield Line(0, cls.grown(numbers["amplitude"], frequency, numbers))

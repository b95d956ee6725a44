"""Variations with two levels, such as the stiffness of spur gears with one and two pairs of teeth in contact."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from gapwalk.errors import ModelError
from gapwalk.model.loads.load import Levels, Line, Load
from gapwalk.model.parameter import Parameter
from gapwalk.model.units import QuantityKind


@dataclass(frozen=True)
class Rectangle(Load):
    """A variation with two levels and the mean 0: high for a share of each cycle, and low for the rest of it.

    The number that varies is its mean times ``1 + amplitude`` where ``cos(order * W * t + phase) > cos(pi * share)``,
    and ``1 - amplitude * share / (1 - share)`` elsewhere. For spur gears with a contact ratio of 1.6 the share is 0.6:
    so long are two pairs of teeth in contact.

    Examples
    --------
    >>> gw.loads.Rectangle(0.2, {"mesh.stiffness": 1.0}, order=27, share=0.6).name
    'rectangle27'
    """

    key, words = "rectangle", "a variation with two levels"
    parameters = (
        Parameter("amplitude", None, "it is the height of the higher level over the mean, as a fraction of it"),
        Parameter("share", None, "it is the share of each cycle at the higher level", 0.5, 0.0),
        Parameter("phase", QuantityKind.PHASE, "it is the phase", default=0.0),
    )
    has_levels = True

    amplitude: float  #: Height of the higher level over the mean, as a fraction of it.
    #: What it varies: ``"mesh.stiffness"``, or several names with factors. No deflection and no clearance: they cannot
    #: jump.
    varies: Mapping[str, float] = field(default_factory=dict, hash=False)
    order: int = 1  #: Cycles per forcing period, an integer >= 1.
    share: float = 0.5  #: Share of each cycle at the higher level, between 0 and 1.
    phase: float = 0.0  #: In radians; with 0, the middle of the higher level is at ``W t = 0``.
    name: str = ""  #: Prefix of its parameters' names; ``rectangle<order>`` by default.
    acts_on: Mapping[str, float] = field(default_factory=dict, hash=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        for problem in self.problems({"share": self.share}):
            raise ModelError(problem)

    @classmethod
    def problems(cls, numbers: Mapping[str, float]) -> Iterator[str]:
        """See `Load.problems`."""
        if not 0.0 < numbers["share"] < 1.0:
            yield f"share is {numbers['share']!r}; it must be between 0 and 1, both excluded"

    @classmethod
    def lines(cls, order: int, frequency: Any, numbers: Mapping[str, Any]) -> Iterable[Line]:
        """Give no lines: the variation jumps; see `levels`."""
        return ()

    @classmethod
    def levels(cls, order: int, frequency: Any, numbers: Mapping[str, Any]) -> Levels:
        """See `Load.levels`."""
        high, share = numbers["amplitude"], numbers["share"]
        middle, half = -numbers["phase"] / order, math.pi * share / order
        return Levels(-high * share / (1.0 - share), high, middle - half, middle + half)

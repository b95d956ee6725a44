"""A toy load: an unbalance, whose force grows with the square of the frequency."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from gapwalk.laws import Parameter
from gapwalk.loads import Line, Load, register


@dataclass(frozen=True)
class Unbalance(Load):
    """``moment * (order W)^2 cos(order W t)``."""

    key, words = "unbalance", "the force of an unbalance"
    parameters = (Parameter("moment", None, "it is the mass times its distance from the axis"),)

    moment: float
    acts_on: Mapping[str, float] = field(hash=False)
    order: int = 1
    name: str = ""

    @classmethod
    def lines(cls, order, frequency, numbers):
        """See `Load.lines`."""
        yield Line(order, numbers["moment"] * (order * frequency) * (order * frequency))


register(Unbalance)

"""Loads that a train makes of those that it is given: displacements of its links, and reactions to their means.

A displacement ``u`` over the angle of the excitation (a transmission error, an inertia whose motion is prescribed) is
added to the deflection ``x`` of a link. Where springs have clearances, it enters their deflection
(`gapwalk.model.structure.Variation`). The torque of a spring that acts always and of a damper is linear,
``k (x + u) + c (x' + u')``, so ``-(k u + c u')`` is a load along the link, like any other to every backend.

The mean of a measured torque, or of one that depends on the speed, would accelerate a free train for ever, as a mean
torque would: the reaction balances it, at every speed. The periodic part shakes the train as a whole, reaction or not.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from gapwalk.model.laws import STIFFNESS
from gapwalk.model.loads import Line, Load
from gapwalk.model.parameter import Parameter
from gapwalk.model.units import QuantityKind

_DAMPING = Parameter("damping", QuantityKind.DAMPING, "it is the damper that acts always", 0.0, 0.0)


@dataclass(frozen=True)
class _Made:
    """A load that a train makes of one of some kind."""

    kind: type[Load]  #: The kind of load of which it is made.

    has_levels, is_periodic = False, True
    frequencies = ()
    note = ""

    @property
    def key(self) -> str:
        """The table of the load of which it is made."""
        return self.kind.key

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """The parameters of that load."""
        return self.kind.parameters

    def notes(self, constants: Mapping[str, Any]) -> str:
        """Return its own note: that load has described itself."""
        return self.note


@dataclass(frozen=True)
class Displacing(_Made):
    """A load by which a displacement acts on a linear link."""

    words = "a displacement of a shaft or gear"

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Parameters of the displacement, then stiffness and damping of the link."""
        return (*self.kind.parameters, STIFFNESS, _DAMPING)

    def lines(self, order: int, frequency: Any, numbers: Mapping[str, Any]) -> Iterable[Line]:
        """Give the torque ``k u + c u'``; see `Load.lines`."""
        stiffness, damping = numbers["stiffness"], numbers["damping"]
        for each in self.kind.lines(order, frequency, numbers):
            rate = damping * (each.order * frequency)
            yield Line(
                each.order,
                stiffness * each.cosine + rate * each.sine,
                stiffness * each.sine - rate * each.cosine,
            )


@dataclass(frozen=True)
class MeanOf(_Made):
    """A load that is the constant part of another one, as the reaction balances it."""

    words = note = "the reaction to the mean of a load"
    is_periodic = False

    def lines(self, order: int, frequency: Any, numbers: Mapping[str, Any]) -> Iterable[Line]:
        """Give the constant lines of the load; see `Load.lines`."""
        return (line for line in self.kind.lines(order, frequency, numbers) if not line.order)

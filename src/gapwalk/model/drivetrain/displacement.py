"""Prescribed displacements of shafts and gears: transmission errors, and inertias whose motion is prescribed.

A displacement ``u`` over the angle of the excitation is added to the deflection ``x`` of a link. Where springs have
clearances, it enters their deflection (`gapwalk.model.structure.Variation`). The torque of a spring that acts always
and of a damper is linear, ``k (x + u) + c (x' + u')``, so ``-(k u + c u')`` is a load along the link, like any other to
every backend.
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
class Displacing:
    """A load by which a displacement acts on a linear link: a kind of load with two more parameters.

    Parameters
    ----------
    kind
        The kind of load that gives the displacement.
    """

    kind: type[Load]

    has_levels, is_periodic = False, True
    frequencies = ()
    words = "a displacement of a shaft or gear"

    @property
    def key(self) -> str:
        """The table of the displacement in a model file."""
        return self.kind.key

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Parameters of the displacement, then stiffness and damping of the link."""
        return (*self.kind.parameters, STIFFNESS, _DAMPING)

    def notes(self, constants: Mapping[str, Any]) -> str:
        """Return nothing: the displacement itself has said it."""
        return ""

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

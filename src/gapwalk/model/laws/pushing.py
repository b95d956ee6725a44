"""Springs and dampers that push, and never pull."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from gapwalk.model.laws.closed_form import Stages
from gapwalk.model.laws.contact_laws import spring
from gapwalk.model.laws.law import Law
from gapwalk.model.parameter import Parameter
from gapwalk.model.units import QuantityKind


class Pushing(Law):
    """``f = max(0, g + c v)`` on each side: the damper acts while the sum pushes, as in Modelica's ``ElastoBacklash``.

    As a contact opens, the damping force would pull from some depth on; there the force is 0 instead. It ends
    continuously: the mode of a side is 1 while its sum pushes.

    Examples
    --------
    >>> gw.Contact("stop", {"x": 1.0}, [gw.Stage(1.0, 20.0)], law="pushing", numbers={"viscous_damping": 0.1}).law.name
    'pushing'
    """

    name, words = "pushing", "springs and a viscous damper that push, and never pull"
    parameters = (Parameter("viscous_damping", QuantityKind.DAMPING, "it is the coefficient of the damper", None, 0.0),)

    @property
    def mode_count(self) -> int:
        """One mode for each side."""
        return 2

    def problems(self, numbers: Mapping[str, float]) -> Iterator[str]:
        """Refuse a damper of 0: each side would begin and cease to push at the breakpoint itself."""
        if not numbers["viscous_damping"] > 0.0:
            given = numbers["viscous_damping"]
            yield f'viscous_damping is {given:g}; it must be > 0: without a damper write law = "elastic"'

    @property
    def is_damped(self) -> bool:
        """True: the damper dissipates."""
        return True

    def guards(self, rate: Any, stages: Stages, numbers: Mapping[str, Any]) -> list[Any]:
        """See `Law.guards`; while a side is open its mode follows the rate, so that it is 1 where a contact begins."""
        found = []
        for sign in (1, -1):
            own = [stage for stage in stages if stage.sign == sign]
            touching = stages.total([0.0 * rate, *(stage.closed for stage in own if stage.innermost)])
            force = stages.total([0.0 * rate, *(stage.closed * spring(stage) for stage in own)])
            found.append(sign * (force + (numbers["viscous_damping"] * touching + (1.0 - touching)) * rate))
        return found

    def force(self, rate: Any, stages: Stages, numbers: Mapping[str, Any]) -> Any:
        """See `Law.force`."""
        parts = []
        for sign, mode in zip((1, -1), stages.modes, strict=True):
            for stage in stages:
                if stage.sign == sign:
                    damper = numbers["viscous_damping"] * rate if stage.innermost else 0.0
                    parts.append(mode * (stage.closed * (spring(stage) + damper)))
        return stages.total(parts)

"""Springs with clearances: without damping, with a damper while they touch, and with damping by their force."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from gapwalk.model.laws.closed_form import Stages, StageTerms
from gapwalk.model.laws.law import Law
from gapwalk.model.parameter import Parameter
from gapwalk.model.units import QuantityKind


def spring(stage: StageTerms) -> Any:
    """Return the force of a closed stage: ``stiffness * xi + cubic * xi**3``, ``xi`` its depth."""
    return stage["stiffness"] * stage.depth + stage["cubic"] * (stage.depth * stage.depth * stage.depth)


class Elastic(Law):
    """``f = g``: the springs alone. Each stage acts beyond its clearance, in addition to the stages inside it.

    Examples
    --------
    >>> gw.Contact("stop", {"x": 1.0}, [gw.Stage(1.0, 20.0)], law="elastic").law.name
    'elastic'
    """

    name, words = "elastic", "springs without damping"

    def force(self, rate: Any, stages: Stages, numbers: Mapping[str, Any]) -> Any:
        """See `Law.force`."""
        return stages.total(stage.closed * spring(stage) for stage in stages)


class Viscous(Elastic):
    """``f = g + c v`` while any stage touches (Dubowsky and Freudenstein 1971); it jumps at contact.

    Examples
    --------
    >>> gw.Contact("stop", {"x": 1.0}, [gw.Stage(1.0, 20.0)], law="viscous", viscous_damping=0.1).numbers
    {'viscous_damping': 0.1}
    """

    name, words = "viscous", "springs, and a viscous damper while they touch"
    parameters = (Parameter("viscous_damping", QuantityKind.DAMPING, "it is the coefficient of the damper", 0.0, 0.0),)

    def force(self, rate: Any, stages: Stages, numbers: Mapping[str, Any]) -> Any:
        """See `Law.force`."""
        touching = stages.total(stage.closed for stage in stages if stage.innermost)
        return super().force(rate, stages, numbers) + numbers["viscous_damping"] * touching * rate


class HuntCrossley(Elastic):
    """``f = g + beta |g| v`` (Hunt and Crossley 1975): it dissipates on both sides.

    Examples
    --------
    >>> gw.Contact("stop", {"x": 1.0}, [gw.Stage(1.0, 20.0)], law="hunt-crossley", impact_damping=0.1).law.name
    'hunt-crossley'
    """

    name, words = "hunt-crossley", "springs, and damping in proportion to their force"
    parameters = (
        Parameter(
            "impact_damping", QuantityKind.IMPACT, "it is the factor beta of the damping by force and rate", 0.0, 0.0
        ),
    )

    def force(self, rate: Any, stages: Stages, numbers: Mapping[str, Any]) -> Any:
        """See `Law.force`."""
        size = stages.total(stage.sign * (stage.closed * spring(stage)) for stage in stages)
        return super().force(rate, stages, numbers) + numbers["impact_damping"] * (size * rate)


class HuntCrossleyAsPrinted(HuntCrossley):
    """``f = g (1 + beta v)`` (paper, equation 15): it feeds energy in on the negative side.

    Examples
    --------
    >>> law = "hunt-crossley-as-printed"
    >>> gw.Contact("stop", {"x": 1.0}, [gw.Stage(1.0, 20.0)], law=law, impact_damping=0.1).law.name
    'hunt-crossley-as-printed'
    """

    name, words = "hunt-crossley-as-printed", "the same without the magnitude: energy is fed in on the negative side"

    def force(self, rate: Any, stages: Stages, numbers: Mapping[str, Any]) -> Any:
        """See `Law.force`."""
        force = Elastic.force(self, rate, stages, numbers)
        return force + numbers["impact_damping"] * (force * rate)

"""Springs whose damping grows with their force, after Hunt and Crossley."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from gapwalk.model.laws.closed_form import Stages
from gapwalk.model.laws.elastic import Elastic, spring
from gapwalk.model.parameter import Parameter
from gapwalk.model.units import QuantityKind


class HuntCrossley(Elastic):
    """``f = g + beta |g| v`` (Hunt and Crossley 1975): it dissipates on both sides."""

    name, words = "hunt-crossley", "springs, and damping in proportion to their force"
    parameters = (
        Parameter(
            "impact_damping",
            QuantityKind.IMPACT,
            "it is the factor beta of the damping by force and rate",
            default=0.0,
            least=0.0,
        ),
    )

    def force(self, rate: Any, stages: Stages, numbers: Mapping[str, Any]) -> Any:
        """See `Law.force`."""
        size = stages.total(stage.sign * (stage.closed * spring(stage)) for stage in stages)
        return super().force(rate, stages, numbers) + numbers["impact_damping"] * (size * rate)


class HuntCrossleyAsPrinted(HuntCrossley):
    """``f = g (1 + beta v)`` (paper, equation 15): it feeds energy in on the negative side."""

    name, words = "hunt-crossley-as-printed", "the same without the magnitude: energy is fed in on the negative side"

    def force(self, rate: Any, stages: Stages, numbers: Mapping[str, Any]) -> Any:
        """See `Law.force`."""
        force = Elastic.force(self, rate, stages, numbers)
        return force + numbers["impact_damping"] * (force * rate)

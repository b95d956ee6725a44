"""Springs with a viscous damper that acts while they touch."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from gapwalk.model.laws.closed_form import Stages
from gapwalk.model.laws.elastic import Elastic
from gapwalk.model.parameter import Parameter
from gapwalk.model.units import QuantityKind


class Viscous(Elastic):
    """``f = g + c v`` while any stage touches (Dubowsky and Freudenstein 1971); it jumps at contact."""

    name, words = "viscous", "springs, and a viscous damper while they touch"
    parameters = (
        Parameter(
            "viscous_damping", QuantityKind.DAMPING, "it is the coefficient of the damper", default=0.0, least=0.0
        ),
    )

    def force(self, rate: Any, stages: Stages, numbers: Mapping[str, Any]) -> Any:
        """See `Law.force`."""
        touching = stages.total(stage.closed for stage in stages if stage.innermost)
        return super().force(rate, stages, numbers) + numbers["viscous_damping"] * touching * rate

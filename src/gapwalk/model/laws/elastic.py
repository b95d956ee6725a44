"""Springs with clearances, without damping."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from gapwalk.model.laws.closed_form import Stages, StageTerms
from gapwalk.model.laws.law import Law


def spring(stage: StageTerms) -> Any:
    """The force of a closed stage: ``stiffness * xi + cubic * xi**3``, ``xi`` its depth."""
    return stage["stiffness"] * stage.depth + stage["cubic"] * (stage.depth * stage.depth * stage.depth)


class Elastic(Law):
    """``f = g``: the springs alone. Each stage acts beyond its clearance, in addition to the stages inside it."""

    name, words = "elastic", "springs without damping"

    def force(self, rate: Any, stages: Stages, numbers: Mapping[str, Any]) -> Any:
        """See `Law.force`."""
        return stages.total(stage.closed * spring(stage) for stage in stages)

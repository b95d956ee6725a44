"""Springs whose force is another polynomial beyond each clearance: with a preload, and measured curves."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from gapwalk.model.laws.closed_form import Stages
from gapwalk.model.laws.law import CLEARANCE, CUBIC, STIFFNESS, Law
from gapwalk.model.parameter import Parameter
from gapwalk.model.units import QuantityKind


class Piecewise(Law):
    """A polynomial beyond each clearance: ``scale * sum of (preload + stiffness xi + quadratic xi**2 + cubic xi**3)``.

    ``xi`` is the depth of a stage on its side, and its force is towards the gap. A preload is a force with which a
    stage begins: the force jumps where it closes. ``offset`` is a constant force and ``even_quadratic`` a quadratic
    term that does not change its sign, both while the innermost stage is closed: with them a stage without a clearance
    is the middle piece of a measured curve.

    Examples
    --------
    >>> curve = gw.laws.measured_spring("clutch", {"x": 1.0}, gw.laws.spring_curve([-4, -2, 2, 4], [-9, -1, 1, 10]))
    >>> curve.law.name
    'piecewise'
    """

    name, words = "piecewise", "a polynomial beyond each clearance, with a preload"
    parameters = (
        Parameter("scale", None, "it is the factor of the whole force", 1.0, optional=True),
        Parameter(
            "offset",
            QuantityKind.TORQUE,
            "it is a constant force while the innermost stage is closed",
            0.0,
            optional=True,
        ),
        Parameter(
            "even_quadratic",
            None,
            "it is a quadratic term of the same sign on both sides",
            0.0,
            None,
            -2,
            1,
            optional=True,
        ),
    )
    stage_parameters = (
        CLEARANCE,
        STIFFNESS,
        CUBIC,
        Parameter("preload", QuantityKind.TORQUE, "it is the force with which the stage begins", 0.0),
        Parameter("quadratic", None, "it is the coefficient of the quadratic term", 0.0, None, -2, 1),
    )

    def force(self, rate: Any, stages: Stages, numbers: Mapping[str, Any]) -> Any:
        """See `Law.force`."""
        parts = []
        for stage in stages:
            depth, closed = stage.depth, stage.closed
            odd = stage["stiffness"] * depth + stage["cubic"] * (depth * depth * depth)
            even = stage["preload"] + stage["quadratic"] * (depth * depth)
            parts.append(closed * (odd + stage.sign * even))
            if stage.innermost:
                parts.append(closed * (numbers["offset"] + numbers["even_quadratic"] * (depth * depth)))
        return numbers["scale"] * stages.total(parts)

"""Point of a branch: an orbit, its place on the branch, and the direction in which the branch continues."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from gapwalk.late_fields import LateFields
from gapwalk.orbit.floquet import Instability
from gapwalk.orbit.orbit import Orbit, measure_names
from gapwalk.summary import row_of


class OrbitOnCurve:
    """An orbit at a point of a curve, with the direction in which the curve continues."""

    orbit: Any
    x: Any
    tangent: Any

    def _check_read(self) -> None:
        """Raise a ValueError if its parts do not fit together."""
        if self.x.ndim != 1 or len(self.x) < 2 or self.tangent.shape != self.x.shape:
            raise ValueError("the unknowns of a point are not as many as the components of its tangent")

    def measure(self, name: str) -> float:
        """Return one measure of the motion; see `Orbit.measure`."""
        return self.orbit.measure(name)


@dataclass(frozen=True, eq=False)
class BranchPoint(LateFields, OrbitOnCurve):
    """One orbit on a branch."""

    _late: ClassVar[tuple[str, ...]] = ("tangent", "determinant")
    _row: ClassVar = "parameter=value stable instability=instability.label contacts=orbit.pattern"

    value: float  #: Value of the parameter that is followed.
    orbit: Orbit  #: The orbit; its system carries all parameter values.
    x: NDArray[np.float64]  #: shape (N + 1,): Unknowns of the equation, then the parameter, in scaled variables.
    #: shape (N + 1,): Unit tangent of the branch there, in scaled variables, in the direction of the walk.
    tangent: NDArray[np.float64]
    #: Determinant of the Jacobian bordered by the tangent (see `Course`); its sign changes where branches cross.
    determinant: float
    arclength: float  #: Scaled arclength from the start of the walk.
    #: Cache of values derived from the point that are needed repeatedly.
    memo: dict[Any, Any] = field(default_factory=dict, repr=False, compare=False, metadata={"stored": False})

    @property
    def stable(self) -> bool:
        """True if the orbit is stable."""
        return self.orbit.stable

    @property
    def instability(self) -> Instability:
        """Number of multipliers outside the unit circle, and where they left it."""
        return self.orbit.instability

    def __repr__(self) -> str:
        return f"BranchPoint({self.value:.10g}, {self.instability.words}, contacts {self.orbit.pattern})"


def method_values(orbit: Orbit) -> list[float]:
    """Return the values under these headings; they are empty for an orbit that was found by shooting."""
    return [getattr(orbit, name) for name in orbit.method.columns]


def method_document(orbit: Orbit) -> dict[str, float]:
    """Return the method-specific values as JSON values."""
    return dict(zip(orbit.method.columns, method_values(orbit), strict=True))


def point_row(point: Any, measure: str = "") -> dict[str, Any]:
    """Return the row of a point, special or not, in a table: its numbers, measures, and the values of its method.

    `measure` is one more, if it is not among those of the coordinates.
    """
    orbit, names = point.orbit, measure_names(point.orbit.system.coordinates)
    measures = {name: orbit.measure(name) for name in dict.fromkeys((*names, *filter(None, (measure,))))}
    return {**row_of(point), "measures": measures, **method_document(orbit)}


def motion_row(orbit: Orbit) -> dict[str, float]:
    """Return the state of an orbit at theta = 0, and its multipliers in polar form, by their headings."""
    polar = np.column_stack((np.abs(orbit.multipliers), np.angle(orbit.multipliers))).ravel().tolist()
    states = [f"{name}(0)" for name in orbit.system.state_names]
    multipliers = [f"{part}.multiplier{i + 1}" for i in range(len(states)) for part in ("modulus", "argument")]
    return dict(zip((*states, *multipliers), (*orbit.state.tolist(), *polar), strict=True))

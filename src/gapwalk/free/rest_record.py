"""Records of equilibria along a parameter: the points, what happens along them, and why they end."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from gapwalk.free.backbone_record import BackboneEnd
from gapwalk.model.system import System
from gapwalk.notebook import Shown
from gapwalk.summary import Rows, SummaryParts, Table, row_of, rows_of, summarizes

_ROUNDING = 1e-9  # real part of an eigenvalue that is rounding, as a share of the largest eigenvalue


@dataclass(frozen=True, eq=False)
class RestPoint:
    """One equilibrium.

    Examples
    --------
    >>> point = rests.points[0]
    >>> point.value, point.stable, point.position
    (-0.5, True, array([0.]))
    """

    _row: ClassVar = {
        "parameter": "value",
        "stable": "stable",
        "unstable": "unstable",
        "growth": "growth",
        "frequency": "frequency",
        "contacts": "pattern",
    }

    value: float  #: Value of the parameter.
    position: NDArray[np.float64]  #: shape (n,): The coordinates.
    #: shape (2n,): Eigenvalues of small motions about it, largest real part first, per unit of time.
    eigenvalues: NDArray[np.complex128]
    pattern: str  #: Which contacts are closed, in words.

    @property
    def stuck(self) -> tuple[int, ...]:
        """Contacts whose friction never slips: none."""
        return ()

    @property
    def unstable(self) -> int:
        """Number of eigenvalues with a positive real part."""
        return int(np.sum(self.eigenvalues.real > _ROUNDING * np.abs(self.eigenvalues).max()))

    @property
    def stable(self) -> bool:
        """True if no small motion grows."""
        return self.unstable == 0

    @property
    def growth(self) -> float:
        """The largest real part of the eigenvalues, per unit of time."""
        return float(self.eigenvalues[0].real)

    @property
    def frequency(self) -> float:
        """Angular frequency of the motion that grows fastest, or decays most slowly."""
        return abs(float(self.eigenvalues[0].imag))

    @property
    def pair(self) -> complex:
        """The complex eigenvalue nearest to the imaginary axis, above the real axis; nan if all are real."""
        above = self.eigenvalues[self.eigenvalues.imag > _ROUNDING * np.abs(self.eigenvalues).max()]
        return complex(above[np.argmin(np.abs(above.real))]) if len(above) else complex(math.nan, math.nan)

    def __repr__(self) -> str:
        state = "stable" if self.stable else f"unstable ({self.unstable})"
        return f"RestPoint({self.value:.10g}, {state}{', ' * bool(self.pattern)}{self.pattern})"


class RestEventKind(StrEnum):
    """Kind of event along equilibria.

    Examples
    --------
    >>> gw.free.RestEventKind.HOPF.value
    'Hopf point'
    """

    HOPF = "Hopf point"
    FOLD = "fold"
    CROSSING = "other equilibria cross"
    BORDER = "a contact changes"


@dataclass(frozen=True, eq=False)
class RestEvent:
    """Equilibrium at which something changes.

    Examples
    --------
    >>> event = rests.events[0]
    >>> event.kind.value, abs(event.value) < 1e-9, round(event.frequency, 9)
    ('Hopf point', True, 1.0)
    """

    _row: ClassVar = {
        "kind": "kind",
        "parameter": "point.value",
        "uncertainty": "uncertainty",
        "unstable.before": "before",
        "unstable.after": "after",
        "frequency": "frequency",
        "contact": "contact",
        "closes": "closes",
        "turns": "turns",
    }

    kind: RestEventKind  #: What changes.
    point: RestPoint  #: The equilibrium.
    uncertainty: float  #: Estimated error of its value of the parameter.
    #: before, after: Numbers of unstable eigenvalues before and after it, in the direction of the walk.
    before: int
    after: int
    frequency: float = 0.0  #: At a Hopf point, the angular frequency of the motions that begin there; otherwise 0.
    contact: str = ""  #: Where a contact changes, its name with the stage and side; otherwise empty.
    closes: bool = False  #: True where that contact closes, in the direction of the walk.
    turns: bool = False  #: True where the parameter turns back.

    @property
    def value(self) -> float:
        """Value of the parameter."""
        return self.point.value

    @property
    def words(self) -> str:
        """What happens, in words."""
        if self.kind is RestEventKind.HOPF:
            return f"{self.kind.value}, frequency {self.frequency:.8g}"
        if self.kind is RestEventKind.BORDER:
            what = "closes" if self.closes else "opens"
            return f"{self.contact} {what}{', and the equilibria turn back' * self.turns}"
        return self.kind.value

    def __repr__(self) -> str:
        return f"RestEvent({self.words} at {self.value:.10g} +- {self.uncertainty:.0e})"


RestEnd = BackboneEnd
"""Place and reason of an end."""


@dataclass(frozen=True, eq=False)
class Rests(Shown):
    """Equilibria along one parameter.

    Examples
    --------
    >>> rests.parameter, len(rests.hopf_points)
    ('damper.mu', 1)
    """

    system: System  #: The system without excitation.
    parameter: str  #: Name of the parameter.
    points: tuple[RestPoint, ...]  #: The equilibria in the order of the walk.
    #: Hopf points, folds, crossings, and contacts that close or open, in the order of the walk.
    events: tuple[RestEvent, ...]
    ends: tuple[RestEnd, RestEnd]  #: Both ends.

    @property
    def values(self) -> NDArray[np.float64]:
        """The parameter at each point, shape (points,)."""
        return np.array([point.value for point in self.points])

    @property
    def hopf_points(self) -> tuple[RestEvent, ...]:
        """The Hopf points, at which periodic motions begin."""
        return tuple(event for event in self.events if event.kind is RestEventKind.HOPF)

    def coordinate(self, name: str) -> NDArray[np.float64]:
        """Return a coordinate at each point.

        Returns
        -------
        array, shape (points,)
            In the unit of the coordinate.
        """
        place = self.system.coordinates.index(name)
        return np.array([point.position[place] for point in self.points])

    @property
    def failures(self) -> tuple[str, ...]:
        """Ends at which the numerics gave up, in sentences."""
        return tuple(str(end) for end in self.ends if end.is_failure)

    @summarizes
    def summary(self) -> SummaryParts:
        """Return the range, the events and the ends, in words."""
        first, last = self.points[0].value, self.points[-1].value
        stable = sum(point.stable for point in self.points)
        yield (
            f"equilibria over {self.parameter} from {first:.8g} to {last:.8g}: {len(self.points)} points, "
            f"{stable} of them stable"
        )
        if self.events:
            yield Table(
                ("what", f">{self.parameter}", ">±", ">unstable"),
                [
                    (each.words, f"{each.value:.10g}", f"{each.uncertainty:.0e}", f"{each.before} to {each.after}")
                    for each in self.events
                ],
            )
        for place, end in zip(("first", "last"), self.ends, strict=True):
            yield f"{place} end: {end}"

    def tables(self) -> Mapping[str, Callable[[], Rows]]:
        """Return the tables of points and events."""
        return {
            "points": lambda: rows_of(map(row_of, self.points)),
            "events": lambda: rows_of(map(row_of, self.events)),
        }

    def __repr__(self) -> str:
        return f"Rests({self.parameter}, {len(self.points)} equilibria, {len(self.events)} events)"

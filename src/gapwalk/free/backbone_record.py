"""Records of a backbone: its free vibrations, what happens along it, and why it ends."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from gapwalk.flow.motion import Motion, integrate
from gapwalk.model.system import System
from gapwalk.notebook import Shown
from gapwalk.summary import Rows, SummaryParts, Table, row_of, rows_of, summarizes

_GROWS = 1e-5  # modulus of a multiplier beyond 1 that is not rounding: two of them are 1, as a double eigenvalue


@dataclass(frozen=True, eq=False)
class BackbonePoint:
    """One free vibration.

    Examples
    --------
    >>> point = backbone.points[-1]
    >>> point.stable, point.touches
    (True, 2)
    """

    _row: ClassVar = {
        "frequency": "value",
        "energy": "energy",
        "amplitude": "amplitude",
        "stable": "stable",
        "touches": "touches",
    }

    value: float  #: The frequency, in the unit of the model.
    #: start, rates: shape (n,): Positions and velocities at the start: at rest, if there are no gyroscopic terms.
    start: NDArray[np.float64]
    rates: NDArray[np.float64]
    #: shape (n,): Half the distance between the places of rest for each coordinate; half its peak to peak where a
    #: motion whirls.
    half: NDArray[np.float64]
    energy: float  #: Energy, without that at zero positions; nan if the equations do not show it (see `potential_of`).
    multipliers: NDArray[np.complex128]  #: shape (2n,): Floquet multipliers, largest modulus first; two of them are 1.
    touches: int  #: Number of contact events in a period.

    @property
    def stuck(self) -> tuple[int, ...]:
        """Contacts whose friction never slips: none."""
        return ()

    @property
    def amplitude(self) -> float:
        """That of `half` of the coordinate that swings most."""
        return float(self.half.max())

    @property
    def state(self) -> NDArray[np.float64]:
        """The state at the start: positions, then velocities; shape (2n,)."""
        return np.append(self.start, self.rates)

    @property
    def stable(self) -> bool:
        """True if no multiplier is outside the unit circle."""
        return bool(np.abs(self.multipliers).max() <= 1.0 + _GROWS)

    def __repr__(self) -> str:
        return f"BackbonePoint({self.value:.10g}, amplitude {self.amplitude:.6g}, {self.touches} contact events)"


class BackboneEventKind(StrEnum):
    """Kind of event along a backbone.

    Examples
    --------
    >>> gw.free.BackboneEventKind.TURN.value
    'the frequency turns'
    """

    TURN = "the frequency turns"
    CROSSING = "another backbone crosses"


@dataclass(frozen=True, eq=False)
class BackboneEvent:
    """Free vibration at which a backbone turns, as near an internal resonance, or at which another one crosses.

    Examples
    --------
    >>> len(backbone.events)
    0
    """

    _row: ClassVar = {
        "kind": "kind",
        "frequency": "point.value",
        "uncertainty": "uncertainty",
        "energy": "point.energy",
        "amplitude": "point.amplitude",
    }

    kind: BackboneEventKind  #: What happens.
    point: BackbonePoint  #: The free vibration.
    uncertainty: float  #: Estimated error of its frequency.

    @property
    def value(self) -> float:
        """The frequency."""
        return self.point.value

    def __repr__(self) -> str:
        return f"BackboneEvent({self.kind.value} at {self.value:.10g} +- {self.uncertainty:.0e})"


@dataclass(frozen=True, slots=True)
class BackboneEnd:
    """Place and reason of the end of a backbone.

    Examples
    --------
    >>> print(backbone.ends[0])
    the backbone begins here, at 1
    """

    reason: str  #: The reason, as a sentence.
    value: float  #: The frequency there.
    is_failure: bool = False  #: True if the numerics gave up.

    def __str__(self) -> str:
        return f"{self.reason}, at {self.value:.8g}"


@dataclass(frozen=True, eq=False)
class Backbone(Shown):
    """Free vibrations of one family: how frequency and amplitude belong together without damping and excitation.

    Examples
    --------
    >>> backbone.mode, len(backbone.points) > 20
    (1, True)
    >>> bool(backbone.values[-1] > backbone.values[0])
    True
    """

    system: System  #: The system without losses.
    mode: int  #: Number of the linear mode from which it begins, from 1; 0 if it began at a given release.
    points: tuple[BackbonePoint, ...]  #: The free vibrations, from the beginning on.
    events: tuple[BackboneEvent, ...]  #: Turns of the frequency, and crossings.
    ends: tuple[BackboneEnd, BackboneEnd]  #: Its two ends.

    @property
    def values(self) -> NDArray[np.float64]:
        """The frequency at each point, shape (points,)."""
        return np.array([point.value for point in self.points])

    @property
    def energies(self) -> NDArray[np.float64]:
        """The energy at each point, shape (points,)."""
        return np.array([point.energy for point in self.points])

    def half(self, coordinate: str) -> NDArray[np.float64]:
        """Return half the peak to peak of a coordinate between the places of rest, at each point.

        Returns
        -------
        array, shape (points,)
            In the unit of the coordinate.
        """
        place = self.system.coordinates.index(coordinate)
        return np.array([point.half[place] for point in self.points])

    def motion(self, point: BackbonePoint, samples: int = 256) -> Motion:
        """Return the motion of a point over a period, sampled."""
        system = self.system.at({self.system.structure.pace: point.value})
        return integrate(system, point.state, 1, samples)

    @property
    def failures(self) -> tuple[str, ...]:
        """Ends at which the numerics gave up, in sentences."""
        return tuple(str(end) for end in self.ends if end.is_failure)

    @summarizes
    def summary(self) -> SummaryParts:
        """Return the range, the events and the end, in words."""
        first, last = self.points[0], self.points[-1]
        what = f"backbone of mode {self.mode}" if self.mode else "backbone"
        yield (
            f"{what}: {len(self.points)} free vibrations, frequency {first.value:.8g} to {last.value:.8g}, amplitude "
            f"{first.amplitude:.4g} to {last.amplitude:.4g}; {sum(point.stable for point in self.points)} are stable"
        )
        if self.events:
            yield Table(
                ("what", ">frequency", ">±", ">amplitude"),
                [
                    (each.kind.value, f"{each.value:.9g}", f"{each.uncertainty:.0e}", f"{each.point.amplitude:.6g}")
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
        return (
            f"Backbone({len(self.points)} free vibrations, {self.points[0].value:.6g} to {self.points[-1].value:.6g})"
        )

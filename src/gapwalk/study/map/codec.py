"""Points of a locus as bytes, and back bit for bit."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from gapwalk.bifurcation.locus import LocusPoint
from gapwalk.model.system import System
from gapwalk.study.store.orbit_codec import OrbitCodec, Packed, as_bytes


class LocusCodec:
    """Packs the points of one locus.

    The row of a point holds both parameters, then both of its orbit (they differ by rounding at most), angle,
    arclength; by harmonic balance N + 1, for the number of harmonics may grow along a locus; x (N + 1); tangent
    (N + 1); then that of its orbit.

    Parameters
    ----------
    system
        The system of the map; the orbits differ from it by the two parameters alone.
    first, second
        Names of the parameters.
    period
        m of the orbits.
    unknowns
        N + 1, the number of scaled variables of its first point.
    balanced
        Whether its orbits were found by harmonic balance.
    """

    def __init__(
        self, system: System, first: str, second: str, period: int, unknowns: int, *, balanced: bool = False
    ) -> None:
        self.period, self.unknowns = period, unknowns
        self._orbits = OrbitCodec(system, (first, second), period, balanced=balanced)

    def pack(self, points: Sequence[LocusPoint]) -> Packed:
        """The bytes of some points."""
        return as_bytes([self._row(point) for point in points]), as_bytes(
            event for point in points for event in point.orbit.events
        )

    def unpack(self, packed: Packed, count: int) -> list[LocusPoint]:
        """The points of their bytes; a ValueError if they are not those of `count` points."""
        numbers, points = self._orbits.numbers(packed, count, 6 + 2 * self.unknowns), []
        for _ in range(count):
            first, second, *values, angle, arclength = numbers.take(6).tolist()
            n = numbers.take_count() if self._orbits.balanced else self.unknowns
            x, tangent = numbers.take(n), numbers.take(n)
            points.append(
                LocusPoint((first, second), self._orbits.orbit(numbers, values), angle, x, tangent, arclength)
            )
        numbers.check_empty()
        return points

    def _row(self, point: LocusPoint) -> NDArray[np.float64]:
        values = self._orbits.values(point.orbit)
        head = [*point.values, *values, point.angle, point.arclength]
        if self._orbits.balanced:
            head.append(len(point.x))
        return np.concatenate((head, point.x, point.tangent, self._orbits.row(point.orbit, values)))

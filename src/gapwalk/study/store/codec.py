"""Points of a branch as bytes, and back bit for bit: what a result file keeps of them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gapwalk.continuation.point import BranchPoint
from gapwalk.model.system import System
from gapwalk.orbit.orbit import Orbit
from gapwalk.study.store.orbit_codec import Numbers, OrbitCodec, Packed, as_bytes


class PointCodec:
    """Packs the points of one branch, and the orbit it started from.

    The row of a point holds value, determinant, arclength; by harmonic balance N + 1, for the number of harmonics may
    grow along a branch; x (N + 1); tangent (N + 1); then that of its orbit.

    Parameters
    ----------
    system
        The system of the branch; its orbits differ from it by the value of the parameter alone.
    parameter
        Name of the parameter.
    period
        m of the orbits.
    unknowns
        N + 1, the number of scaled variables of its first point.
    balanced
        Whether its orbits were found by harmonic balance.
    """

    def __init__(self, system: System, parameter: str, period: int, unknowns: int, *, balanced: bool = False) -> None:
        self.period, self.unknowns = period, unknowns
        self._orbits = OrbitCodec(system, (parameter,), period, balanced=balanced)
        self._start = system[parameter]

    def pack(self, points: Sequence[BranchPoint]) -> Packed:
        """The bytes of some points."""
        rows = [
            np.concatenate((self._head(point), point.x, point.tangent, self._orbits.row(point.orbit, [point.value])))
            for point in points
        ]
        return as_bytes(rows), as_bytes(event for point in points for event in point.orbit.events)

    def unpack(self, packed: Packed, count: int) -> list[BranchPoint]:
        """The points of their bytes; a ValueError if they are not those of `count` points."""
        numbers, points = self._orbits.numbers(packed, count, 3 + 2 * self.unknowns), []
        for _ in range(count):
            value, determinant, arclength = numbers.take(3).tolist()
            n = numbers.take_count() if self._orbits.balanced else self.unknowns
            x, tangent = numbers.take(n), numbers.take(n)
            orbit = self._orbits.orbit(numbers, [value])
            points.append(BranchPoint(value, orbit, x, tangent, determinant, arclength))
        numbers.check_empty()
        return points

    def pack_orbit(self, orbit: Orbit) -> Packed:
        """The bytes of the orbit from which the branch starts."""
        return as_bytes([self._orbits.row(orbit, [self._start])]), as_bytes(orbit.events)

    def unpack_orbit(self, packed: Packed) -> Orbit:
        """That orbit; a ValueError if the bytes are not those of one."""
        numbers: Numbers = self._orbits.numbers(packed, 1)
        orbit = self._orbits.orbit(numbers, [self._start])
        numbers.check_empty()
        return orbit

    def _head(self, point: BranchPoint) -> list[float]:
        head = [point.value, point.determinant, point.arclength]
        return [*head, len(point.x)] if self._orbits.balanced else head

"""Points of a branch as bytes, and back bit for bit: what a result file keeps of them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from gapwalk.continuation.point import BranchPoint
from gapwalk.model.system import System
from gapwalk.motion.motion import switch_names
from gapwalk.motion.switching import ContactEvent
from gapwalk.orbit.orbit import Orbit

Packed = tuple[bytes, bytes]
"""A row of numbers for each orbit or point, and a row of four for each contact event; little-endian float64."""


class PointCodec:
    """Packs the points of one branch, and the orbit it started from.

    The row of an orbit holds, in this order: residual, steps, number of events; state (2n); real and imaginary part
    of each multiplier (2n times 2); maximum, minimum, mean and rms of each coordinate (n times 4). That of a point
    has before it: value, determinant, arclength; x (N + 1); tangent (N + 1). That of an event: theta, switch,
    enters, velocity.

    The extremes are kept although they follow from the rest: a picture then needs no integration.

    Parameters
    ----------
    system
        The system of the branch; its orbits differ from it by the value of the parameter alone.
    parameter
        Name of the parameter.
    period
        m of the orbits.
    unknowns
        N + 1, the number of scaled variables.
    """

    def __init__(self, system: System, parameter: str, period: int, unknowns: int) -> None:
        self.system, self.period, self.unknowns = system, period, unknowns
        self._place = system.structure.place(parameter)
        self._switches = len(switch_names(system))
        self._orbit_width = 3 + 10 * system.size
        self._point_width = 3 + 2 * unknowns + self._orbit_width

    def pack(self, points: Sequence[BranchPoint]) -> Packed:
        """The bytes of some points."""
        rows = [
            np.concatenate(([p.value, p.determinant, p.arclength], p.x, p.tangent, self._row(p.orbit, p.value)))
            for p in points
        ]
        return _bytes(rows), _bytes([event for point in points for event in point.orbit.events])

    def unpack(self, packed: Packed, count: int) -> list[BranchPoint]:
        """The points of their bytes; a ValueError if they are not those of `count` points."""
        rows, events = self._tables(packed, self._point_width, count)
        n, taken, points = self.unknowns, 0, []
        for row, (value, determinant, arclength) in zip(rows, rows[:, :3].tolist(), strict=True):
            orbit = self._orbit(row[3 + 2 * n :], value, events, taken)
            taken += len(orbit.events)
            points.append(BranchPoint(value, orbit, row[3 : 3 + n], row[3 + n : 3 + 2 * n], determinant, arclength))
        if taken != len(events):
            raise ValueError(f"{len(events)} contact events are stored where the points have {taken}")
        return points

    def pack_orbit(self, orbit: Orbit) -> Packed:
        """The bytes of the orbit from which the branch starts."""
        row = self._row(orbit, float(orbit.system.values[self._place]))
        return _bytes([row]), _bytes(orbit.events)

    def unpack_orbit(self, packed: Packed) -> Orbit:
        """That orbit; a ValueError if the bytes are not those of one."""
        rows, events = self._tables(packed, self._orbit_width, 1)
        orbit = self._orbit(rows[0], float(self.system.values[self._place]), events, 0)
        if len(orbit.events) != len(events):
            raise ValueError(f"{len(events)} contact events are stored where the orbit has {len(orbit.events)}")
        return orbit

    def _row(self, orbit: Orbit, value: float) -> NDArray[np.float64]:
        if orbit.period != self.period or not np.array_equal(orbit.system.values, self._values(value)):
            raise ValueError("an orbit does not belong to the branch that it is stored with")
        return np.concatenate(
            (
                [orbit.residual, orbit.steps, len(orbit.events)],
                orbit.state,
                np.ascontiguousarray(orbit.multipliers, dtype=complex).view(float),
                orbit.extremes.ravel(),
            )
        )

    def _orbit(self, row: NDArray[np.float64], value: float, events: list[ContactEvent], first: int) -> Orbit:
        n = self.system.size
        residual, steps, count = row[:3].tolist()
        if not (0 <= steps == int(steps) and 0 <= count == int(count) <= len(events) - first):
            raise ValueError("the numbers of steps and of contact events of an orbit make no sense")
        orbit = Orbit(
            System.from_values(self.system.structure, self._values(value)),
            self.period,
            row[3 : 3 + 2 * n],
            row[3 + 2 * n : 3 + 6 * n].view(complex),
            tuple(events[first : first + int(count)]),
            residual,
            int(steps),
        )
        orbit.__dict__["extremes"] = row[3 + 6 * n :].reshape(n, 4)  # where the cached property looks first
        return orbit

    def _values(self, value: float) -> NDArray[np.float64]:
        values = self.system.values.copy()
        values[self._place] = value
        return values

    def _tables(self, packed: Packed, width: int, count: int) -> tuple[NDArray[np.float64], list[ContactEvent]]:
        rows, events = (np.frombuffer(part, dtype="<f8").astype(float) for part in packed)
        if count < 1 or len(rows) != count * width or len(events) % 4:
            raise ValueError(f"{len(rows)} and {len(events)} numbers are stored where {count} points were promised")
        theta, switch, enters, velocity = events.reshape(-1, 4).T
        if not np.isin(switch, np.arange(self._switches)).all() or not np.isin(enters, (0.0, 1.0)).all():
            raise ValueError("a contact event belongs to no contact")
        columns = (theta.tolist(), switch.astype(int).tolist(), enters.astype(bool).tolist(), velocity.tolist())
        return rows.reshape(count, width), [ContactEvent(*event) for event in zip(*columns, strict=True)]


def _bytes(rows: Sequence[object]) -> bytes:
    return np.asarray(rows, dtype="<f8").tobytes()

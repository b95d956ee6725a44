"""Orbits, and points of a branch, as bytes, and back bit for bit: what a result file keeps of them."""

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


class OrbitCodec:
    """Packs orbits of one system and period that differ by the values of some parameters.

    The row of an orbit holds, in this order: residual, steps, number of events; state (2n); real and imaginary part
    of each multiplier (2n times 2); maximum, minimum, mean and rms of each coordinate (n times 4). The row of an
    event: theta, switch, enters, velocity.

    The extremes are kept although they follow from the rest: a picture then needs no integration.

    Parameters
    ----------
    system
        The system; its orbits differ from it by the values of the parameters alone.
    parameters
        Names of the parameters.
    period
        m of the orbits.
    """

    def __init__(self, system: System, parameters: Sequence[str], period: int) -> None:
        self.system, self.period = system, period
        self.width = 3 + 10 * system.size
        self._places = [system.structure.place(parameter) for parameter in parameters]
        self._switches = len(switch_names(system))

    def row(self, orbit: Orbit, values: Sequence[float]) -> NDArray[np.float64]:
        """The numbers of an orbit but for its events; a ValueError if it does not exist at these values."""
        if orbit.period != self.period or not np.array_equal(orbit.system.values, self._values(values)):
            raise ValueError("an orbit does not belong to the branch that it is stored with")
        return np.concatenate(
            (
                [orbit.residual, orbit.steps, len(orbit.events)],
                orbit.state,
                np.ascontiguousarray(orbit.multipliers, dtype=complex).view(float),
                orbit.extremes.ravel(),
            )
        )

    def orbit(self, row: NDArray[np.float64], values: Sequence[float], events: list[ContactEvent], first: int) -> Orbit:
        """The orbit of a row at some values of the parameters; its events are those from `first` on."""
        n = self.system.size
        residual, steps, count = row[:3].tolist()
        if not (0 <= steps == int(steps) and 0 <= count == int(count) <= len(events) - first):
            raise ValueError("the numbers of steps and of contact events of an orbit make no sense")
        orbit = Orbit(
            System.from_values(self.system.structure, self._values(values)),
            self.period,
            row[3 : 3 + 2 * n],
            row[3 + 2 * n : 3 + 6 * n].view(complex),
            tuple(events[first : first + int(count)]),
            residual,
            int(steps),
        )
        orbit.__dict__["extremes"] = row[3 + 6 * n :].reshape(n, 4)  # where the cached property looks first
        return orbit

    def values(self, orbit: Orbit) -> list[float]:
        """The values of the parameters at which an orbit exists."""
        return orbit.system.values[self._places].tolist()

    def tables(self, packed: Packed, width: int, count: int) -> tuple[NDArray[np.float64], list[ContactEvent]]:
        """The rows, of some width, and the events of packed bytes; a ValueError if they are not `count` rows."""
        rows, events = (np.frombuffer(part, dtype="<f8").astype(float) for part in packed)
        if count < 1 or len(rows) != count * width or len(events) % 4:
            raise ValueError(f"{len(rows)} and {len(events)} numbers are stored where {count} points were promised")
        theta, switch, enters, velocity = events.reshape(-1, 4).T
        if not np.isin(switch, np.arange(self._switches)).all() or not np.isin(enters, (0.0, 1.0)).all():
            raise ValueError("a contact event belongs to no contact")
        columns = (theta.tolist(), switch.astype(int).tolist(), enters.astype(bool).tolist(), velocity.tolist())
        return rows.reshape(count, width), [ContactEvent(*event) for event in zip(*columns, strict=True)]

    def _values(self, values: Sequence[float]) -> NDArray[np.float64]:
        changed = self.system.values.copy()
        changed[self._places] = values
        return changed


class PointCodec:
    """Packs the points of one branch, and the orbit it started from.

    The row of a point holds value, determinant, arclength; x (N + 1); tangent (N + 1); then that of its orbit.

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
        self.period, self.unknowns = period, unknowns
        self._orbits = OrbitCodec(system, (parameter,), period)
        self._start = system[parameter]

    def pack(self, points: Sequence[BranchPoint]) -> Packed:
        """The bytes of some points."""
        rows = [
            np.concatenate(
                ([p.value, p.determinant, p.arclength], p.x, p.tangent, self._orbits.row(p.orbit, [p.value]))
            )
            for p in points
        ]
        return as_bytes(rows), as_bytes([event for point in points for event in point.orbit.events])

    def unpack(self, packed: Packed, count: int) -> list[BranchPoint]:
        """The points of their bytes; a ValueError if they are not those of `count` points."""
        n, taken, points = self.unknowns, 0, []
        rows, events = self._orbits.tables(packed, 3 + 2 * n + self._orbits.width, count)
        for row, (value, determinant, arclength) in zip(rows, rows[:, :3].tolist(), strict=True):
            orbit = self._orbits.orbit(row[3 + 2 * n :], [value], events, taken)
            taken += len(orbit.events)
            points.append(BranchPoint(value, orbit, row[3 : 3 + n], row[3 + n : 3 + 2 * n], determinant, arclength))
        check_taken(taken, events)
        return points

    def pack_orbit(self, orbit: Orbit) -> Packed:
        """The bytes of the orbit from which the branch starts."""
        return as_bytes([self._orbits.row(orbit, [self._start])]), as_bytes(orbit.events)

    def unpack_orbit(self, packed: Packed) -> Orbit:
        """That orbit; a ValueError if the bytes are not those of one."""
        rows, events = self._orbits.tables(packed, self._orbits.width, 1)
        orbit = self._orbits.orbit(rows[0], [self._start], events, 0)
        check_taken(len(orbit.events), events)
        return orbit


def check_taken(taken: int, events: Sequence[ContactEvent]) -> None:
    """A ValueError unless all events that were stored belong to an orbit."""
    if taken != len(events):
        raise ValueError(f"{len(events)} contact events are stored where the orbits have {taken}")


def as_bytes(rows: Sequence[object]) -> bytes:
    """Rows of numbers as little-endian float64."""
    return np.asarray(rows, dtype="<f8").tobytes()

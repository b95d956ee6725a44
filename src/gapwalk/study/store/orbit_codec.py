"""Orbits as bytes, and back bit for bit: those of shooting, and those of harmonic balance with their series."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from gapwalk.model.system import System
from gapwalk.motion.motion import switch_names
from gapwalk.motion.switching import ContactEvent
from gapwalk.orbit.balance import BalancedOrbit, Series
from gapwalk.orbit.orbit import Orbit

Packed = tuple[bytes, bytes]
"""A row of numbers for each orbit or point, and a row of four for each contact event; little-endian float64."""


class Numbers:
    """The numbers and the events of packed bytes, taken one after the other.

    Parameters
    ----------
    packed
        The bytes.
    switches
        Number of switches that an event may belong to.
    count, width
        Number of rows, and how many numbers each has, if that is the same for all.
    """

    def __init__(self, packed: Packed, switches: int, count: int, width: int | None) -> None:
        self._numbers, rows = (np.frombuffer(part, dtype="<f8").astype(float) for part in packed)
        self._count, self._at, self._taken = count, 0, 0
        if count < 0 or len(rows) % 4 or (width is not None and len(self._numbers) != count * width):
            raise ValueError(self._wrong(len(rows)))
        theta, switch, enters, velocity = rows.reshape(-1, 4).T
        if not np.isin(switch, np.arange(switches)).all() or not np.isin(enters, (0.0, 1.0)).all():
            raise ValueError("a contact event belongs to no contact")
        columns = (theta.tolist(), switch.astype(int).tolist(), enters.astype(bool).tolist(), velocity.tolist())
        self._events = [ContactEvent(*event) for event in zip(*columns, strict=True)]

    def take(self, count: int) -> NDArray[np.float64]:
        """The next numbers; a ValueError if there are not as many."""
        start, self._at = self._at, self._at + count
        if self._at > len(self._numbers):
            raise ValueError(self._wrong(4 * len(self._events)))
        return self._numbers[start : self._at]

    def take_count(self) -> int:
        """The next number, which counts others; a ValueError if it cannot."""
        (count,) = self.take(1).tolist()
        if not 0 <= count == int(count) <= len(self._numbers):
            raise ValueError("a number that counts others makes no sense")
        return int(count)

    def take_events(self, count: int) -> tuple[ContactEvent, ...]:
        """The next events; a ValueError if there are not as many."""
        start, self._taken = self._taken, self._taken + count
        if self._taken > len(self._events):
            raise ValueError("the numbers of steps and of contact events of an orbit make no sense")
        return tuple(self._events[start : self._taken])

    def check_empty(self) -> None:
        """A ValueError unless all numbers and events have been taken."""
        if self._at != len(self._numbers):
            raise ValueError(self._wrong(4 * len(self._events)))
        if self._taken != len(self._events):
            raise ValueError(f"{len(self._events)} contact events are stored where the orbits have {self._taken}")

    def _wrong(self, events: int) -> str:
        return f"{len(self._numbers)} and {events} numbers are stored where {self._count} points were promised"


class OrbitCodec:
    """Packs orbits of one system and period that differ by the values of some parameters.

    The row of an orbit holds, in this order: residual, steps, number of events; state (2n); real and imaginary part
    of each multiplier (2n times 2); maximum, minimum, mean and rms of each coordinate (n times 4). By harmonic balance
    there follow K, the number of lines; the truncation error; real and imaginary part of each line, from 0 to K, of
    each coordinate, then of the deflection of each contact. The row of an event: theta, switch, enters, velocity.

    The extremes are kept although they follow from the rest: a picture then needs no integration.

    Parameters
    ----------
    system
        The system; its orbits differ from it by the values of the parameters alone.
    parameters
        Names of the parameters.
    period
        m of the orbits.
    balanced
        Whether they were found by harmonic balance.
    """

    def __init__(self, system: System, parameters: Sequence[str], period: int, *, balanced: bool = False) -> None:
        self.system, self.period, self.balanced = system, period, balanced
        self._places = [system.structure.place(parameter) for parameter in parameters]
        self._switches = len(switch_names(system))

    def row(self, orbit: Orbit, values: Sequence[float]) -> NDArray[np.float64]:
        """The numbers of an orbit but for its events; a ValueError if it does not exist at these values."""
        if orbit.period != self.period or not np.array_equal(orbit.system.values, self._values(values)):
            raise ValueError("an orbit does not belong to the branch that it is stored with")
        if isinstance(orbit, BalancedOrbit) is not self.balanced:
            raise ValueError("an orbit was found in another way than the branch that it is stored with")
        parts = [
            np.array([orbit.residual, orbit.steps, len(orbit.events)]),
            orbit.state,
            _reals(orbit.multipliers),
            orbit.extremes.ravel(),
        ]
        if isinstance(orbit, BalancedOrbit):
            count = orbit.series.lines.shape[1] - 1
            parts += [np.array([count, orbit.truncation]), _reals(orbit.series.lines), _reals(orbit.deflections.lines)]
        return np.concatenate(parts)

    def orbit(self, numbers: Numbers, values: Sequence[float]) -> Orbit:
        """The orbit of the next row, at some values of the parameters; a ValueError if it makes no sense."""
        n = self.system.size
        residual, steps, count = numbers.take(3).tolist()
        if not (0 <= steps == int(steps) and 0 <= count == int(count)):
            raise ValueError("the numbers of steps and of contact events of an orbit make no sense")
        system = System.from_values(self.system.structure, self._values(values))
        state, multipliers = numbers.take(2 * n), numbers.take(4 * n).view(complex)
        extremes = numbers.take(4 * n).reshape(n, 4)
        what = (system, self.period, state, multipliers, numbers.take_events(int(count)), residual, int(steps))
        orbit = BalancedOrbit(*what, *self._series(numbers, system)) if self.balanced else Orbit(*what)
        orbit.__dict__["extremes"] = extremes  # where the cached property looks first
        return orbit

    def _series(self, numbers: Numbers, system: System) -> tuple[Series, Series, float]:
        """Coordinates, deflections, and truncation error of an orbit that was found by harmonic balance."""
        count, (truncation,) = numbers.take_count(), numbers.take(1).tolist()
        coordinates, deflections = (
            Series(numbers.take(2 * rows * (count + 1)).view(complex).reshape(rows, -1), self.period, system.frequency)
            for rows in (self.system.size, len(self.system.structure.contacts))
        )
        return coordinates, deflections, truncation

    def values(self, orbit: Orbit) -> list[float]:
        """The values of the parameters at which an orbit exists."""
        return orbit.system.values[self._places].tolist()

    def numbers(self, packed: Packed, count: int, others: int = 0) -> Numbers:
        """The numbers of packed bytes, which should be `count` rows; a ValueError if they cannot be.

        Rows by shooting are all of one length: that of an orbit, and of `others` beside it.
        """
        return Numbers(packed, self._switches, count, None if self.balanced else others + 3 + 10 * self.system.size)

    def _values(self, values: Sequence[float]) -> NDArray[np.float64]:
        changed = self.system.values.copy()
        changed[self._places] = values
        return changed


def as_bytes(rows: Iterable[Sequence[float] | NDArray[np.float64]]) -> bytes:
    """Rows of numbers as little-endian float64."""
    arrays = [np.asarray(row, dtype="<f8") for row in rows]
    return np.concatenate(arrays).tobytes() if arrays else b""


def _reals(values: NDArray[np.complex128]) -> NDArray[np.float64]:
    """Real and imaginary parts, one after the other."""
    return np.ascontiguousarray(values, dtype=complex).ravel().view(float)

"""Run-ups by equal steps: a register of eight motions whose speeds change over the angle of the excitation.

Steps are equal over the angle, ``h = dtheta / W``, some whole number of them between two samples. A forcing period is
divided into pieces, within which all numbers are those of the mean speed; from piece to piece they follow the speed.
The rotation of a train as a whole is simply integrated. Friction is treated as at constant speed.

Method: docs/numerics/notes/answers.md
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.ensemble.lane_code import WIDTH
from gapwalk.ensemble.lanes import DAMPED, TURN, Lanes, aligned, even, steps_of
from gapwalk.flow.flow import PERIOD
from gapwalk.flow.ramp import Ramped

PIECES = 16
"""Pieces of a forcing period, each with the numbers of its mean speed."""
_FAR = 1e9  # speed, in terms of the lowest one, at which the orders of the loads decide how long a step is


class Turned(NamedTuple):
    """Figures of one forcing period, or of the part of one that is left at the end."""

    times: NDArray[np.float64]  #: shape (pieces + 1, lanes): Times at the ends of the pieces.
    #: shape (samples, rows, lanes): Samples but for the first, with the rows of `CodeWriter.sample_rows`; empty unless
    #: samples are wanted.
    samples: NDArray[np.float64]
    notes: NDArray[np.float64]  #: shape (pieces, rows, lanes): Notes of each piece, with the rows of `Code.notes`.


class RampLanes(Lanes):
    """At most eight run-ups of one system, each from its own angle and state and at its own speeds.

    Shapes: `states` (count, state_size), `angles` (count,).
    """

    def __init__(
        self,
        ramped: Ramped,
        states: NDArray[np.float64],
        angles: NDArray[np.float64],
        lowest: float,
        *,
        kinds: Sequence[str] = (),
        sampled: bool = False,
        finer: float = 1.0,
    ) -> None:
        structure = ramped.system.structure
        rates = np.zeros(ramped.growth.shape[1])
        rates[ramped.means] = ramped.carried
        varied = (ramped.growth[1:] != 0.0).any(axis=0) | (rates != 0.0)
        pattern = varied | (ramped.growth[0] != 0.0)
        varied[0] = pattern[0] = True
        first = ramped.coefficients(lowest, 0.0)
        super().__init__(
            structure, np.tile(first, (len(states), 1)), states, kinds=kinds, pattern=pattern, finer=finer,
            apart=bool(np.ptp(angles)), sampled=sampled,
        )  # fmt: skip
        slots = [slot for slot in self.code.rows if isinstance(slot, int) and varied[slot]]
        self._rows, self._growth = [self.code.rows[slot] for slot in slots], ramped.growth[:, slots, None]
        self._rates, self._reciprocal = rates[slots, None], slots.index(0) if 0 in slots else None
        self._angles = angles[np.minimum(np.arange(WIDTH), len(angles) - 1)]
        self._tables: dict[tuple[int, float], NDArray[np.float64]] = {}
        self._kept = len(self.code.begin) - sum(kind == "side" for kind, _ in self.code.notes)
        self._begin = self.code.begin[: self._kept, None]
        self._places = [_place(each) for each in (self._state[0], self._slopes[0], self._notes[0])]
        most, least = (
            float(steps_of(self.layout, ramped.coefficients(each, 0.0)[None])[0]) for each in (lowest, _FAR * lowest)
        )
        self._per_time, self._least = finer * most * lowest, finer * least
        # one spring in place of stick for the whole run-up, as stiff as the longest step allows
        fast, own = TURN * most * lowest / PERIOD, self._coefficients[0]
        for index in self.code.dry:
            if ("spring", index) in self.code.rows:
                slots = self.layout.contacts[index]
                inverse = float(own[slots.deflection] @ own[slots.force])
                self._numbers[0, self.code.rows["spring", index]] = fast**2 / inverse
                self._numbers[0, self.code.rows["damper", index]] = 2.0 * DAMPED * fast / inverse

    def _set_steps(self, block: int) -> None:
        """Leave the steps to `turns`: each forcing period has its own."""

    def turns(
        self,
        speeds: Callable[[NDArray[np.float64]], tuple[NDArray[np.float64], NDArray[np.float64]]],
        last: float,
        samples: int,
        pieces: int = PIECES,
    ) -> Iterator[Turned]:
        """Run up over an angle, and yield each forcing period.

        `speeds` returns time and speed W at some angles from the start, shape (angles, lanes); there are `samples` in
        a forcing period, and one at the end.
        """
        unit = PERIOD / samples
        for number in range(max(math.ceil(last / PERIOD - 1e-9), 1)):
            begun = number * PERIOD
            left = min(last - begun, PERIOD)
            whole = math.floor(left / unit + 1e-6)
            ends = np.unique(np.round(np.linspace(0, whole, min(pieces, max(whole, 1)) + 1)).astype(int))
            knots = ends * unit
            if left > knots[-1] + 1e-9:  # the last sample is at the end
                knots = np.append(knots, left)
            times, speed = speeds(begun + knots)
            spans, wide = np.diff(times, axis=0), np.diff(knots)
            per = even(math.ceil(max(self._per_time / speed.min(), self._least) / samples))
            counts = np.minimum(np.diff(ends, append=ends[-1] + 1), samples)[: len(wide)]
            numbers = self._numbers_at(
                wide[:, None] / spans, np.diff(speed, axis=0) / spans, spans / (per * counts[:, None])
            )
            taken, table = (
                aligned((int(counts.sum()), self.code.sample_rows, WIDTH)),
                self._table(per * samples, PERIOD),
            )
            notes, done = np.zeros((len(wide), *self._notes[0].shape)), 0
            for piece, count in enumerate(counts.tolist()):
                there = table[2 * per * int(ends[piece]) :]
                if piece >= len(ends) - 1:
                    there = self._table(per, float(wide[-1]), begun + float(knots[-2]))
                self._advance_piece(numbers[piece], there, per, count, taken[done:])
                notes[piece] = self._notes[0]
                done += count
            yield Turned(times, taken, notes)

    def _advance_piece(self, numbers, table, per: int, count: int, taken: NDArray[np.float64]) -> None:
        self._notes[0, : self._kept] = self._begin
        given = (*map(_place, (numbers, table)), *self._places)
        if self.code.sample_rows:
            self.code.sampled(*given, per, count, _place(taken))
        else:
            self.code.advance(*given, per * count)

    def _numbers_at(self, speed, acceleration, step) -> NDArray[np.float64]:
        """Return the numbers of pieces, shape (pieces, rows, lanes)."""
        found = aligned((len(speed), *self._numbers[0].shape))
        found[:] = self._numbers[0]
        found[:, 0] = step
        w, (g0, g1, g2) = speed[:, None], self._growth
        values = g0 + w * (g1 + w * g2) + acceleration[:, None] * self._rates
        if self._reciprocal is not None:
            values[:, self._reciprocal] = 1.0 / speed
        found[:, self._rows] = values
        return found

    def _table(self, steps: int, wide: float, begun: float = 0.0) -> NDArray[np.float64]:
        """Return cosines and sines of all orders, and the angle, at each half step, maybe for each lane."""
        key = (steps, begun)
        if key not in self._tables or wide != PERIOD:
            theta = begun + np.linspace(0.0, wide, 2 * steps + 1)[:, None] + self._angles
            theta = theta if self.code.apart else theta[:, :1]
            turned = theta[:, None] * np.array(self.layout.orders, dtype=float)[:, None]
            rows = np.concatenate((np.cos(turned), np.sin(turned), theta[:, None]), axis=1)
            self._tables[key] = aligned(rows.shape)
            self._tables[key][:] = rows
        return self._tables[key]


def _place(array: NDArray[np.float64]) -> int:
    return array.__array_interface__["data"][0]

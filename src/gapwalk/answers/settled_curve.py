"""Settled motions along a response where it cannot be followed, by equal steps: from one value to the next.

At each value the motion starts from that of the value before, with its slow part extrapolated linearly. This hardly
helps motions without period, so these are settled at as many values at once as can be computed side by side.

Method: docs/numerics/notes/ensembles.md
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from gapwalk.answers.gap_states import usual_gaps
from gapwalk.answers.lane_sweep import is_many
from gapwalk.attractors.lane_settling import LaneMotion, Start, settle_lanes, slow_places
from gapwalk.bifurcation.band import Band
from gapwalk.ensemble.batch_flow import state_at_rest
from gapwalk.ensemble.lane_code import WIDTH
from gapwalk.errors import NumericalError
from gapwalk.model.coefficients import ParameterLine
from gapwalk.model.system import System

STEPS = 200
"""Steps of the range."""
FEW = 5
"""Separations in a period from which on an orbit is not followed."""
LARGE = 24
"""Numbers of a state above which an orbit costs more with its derivatives than it takes to settle at all steps."""


class SettledCurve:
    """Settled motions at steps of a range, from its first value to its last."""

    def __init__(self, system: System, parameter: str, ends: tuple[float, float]) -> None:
        self.system, self.parameter = system, parameter
        self.values: list[float] = np.linspace(*ends, STEPS + 1).tolist()
        self.step, self._sign = abs(ends[1] - ends[0]) / STEPS, np.sign(ends[1] - ends[0])
        gaps, forms = usual_gaps(system), system.structure.equations.contacts
        self._parts = np.array([form.name in gaps for form in forms])
        self._slow = slow_places(system)

    @classmethod
    def of(cls, system: System, parameter: str, ends: tuple[float, float]) -> SettledCurve | None:
        """Return the curve of a system whose gaps interact so often that it needs one; otherwise None."""
        return cls(system, parameter, ends) if is_many(system) else None

    def beyond(self, value: float) -> int:
        """Return the number of the first step beyond a value; one more than there are if it is the last."""
        return int(np.searchsorted(self._sign * np.array(self.values), self._sign * value + 1e-9 * self.step, "right"))

    def at(self, place: int, state: NDArray[np.float64] | None = None) -> Band:
        """Settle at one step, from a state nearby, or from rest."""
        return self._settled([place], state)[0]

    def spread(self, every: int) -> list[Band]:
        """Settle at every such step of the range, each from rest."""
        return self._settled(range(0, len(self.values), every), None)

    def ahead(self, place: int, state: NDArray[np.float64]) -> dict[int, Band]:
        """Settle at as many steps from one on as a register has lanes, each from the same state."""
        places = range(place, min(place + WIDTH, len(self.values)))
        return dict(zip(places, self._settled(places, state), strict=True))

    def after(self, bands: Sequence[Band]) -> list[Band]:
        """Settle at the next step, from the last motions before; without a period, at several steps."""
        last, place = bands[-1], self.beyond(bands[-1].value)
        state = last.state.copy()
        if bands[1:] and last.period == bands[-2].period == 1:
            near = abs(last.value - bands[-2].value) < 1.5 * self.step
            state[self._slow] += near * (state[self._slow] - bands[-2].state[self._slow])
        count = 1 if last.period else WIDTH
        return self._settled(range(place, min(place + count, len(self.values))), state)

    def is_simple(self, bands: Sequence[Band], period: int) -> bool:
        """Return True if an orbit of a period can be followed through the last motions: they part rarely, and alike."""
        if self.system.structure.state_size > LARGE:
            return False
        few = all(band.period == period and band.total * period < FEW for band in bands)
        totals = [band.total * period for band in bands]
        return few and max(totals) - min(totals) < 1.5

    def _settled(self, places: Sequence[int], state: NDArray[np.float64] | None) -> list[Band]:
        starts, line = [], ParameterLine(self.system, self.parameter)
        for place in places:
            here = line.system_at(self.values[place])
            begun = state_at_rest(here) if state is None else state
            starts.append(Start(place, self.values[place], here, begun, is_warm=state is not None))
        found = {start.key: motion for start, motion in settle_lanes(starts)}
        if any(motion.diverged for motion in found.values()):
            raise NumericalError("the settled motion grows without bound")
        return [self._band(found[place]) for place in places]

    def _band(self, motion: LaneMotion) -> Band:
        separations = np.where(self._parts, motion.sides.sum(axis=1), np.nan)
        return Band(motion.value, motion.state, motion.period, motion.extremes, separations)

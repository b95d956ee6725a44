"""Survey of an orbit in one pass: extrema and means of each coordinate, and turning points of the deflections."""

from __future__ import annotations

from bisect import bisect_left
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.flow.flow import PERIOD, Turn, flow_of
from gapwalk.model.coefficients import coefficients_of

if TYPE_CHECKING:
    from gapwalk.orbit.orbit import Orbit


class Turns(NamedTuple):
    """Turning points of a quantity along an orbit: their angles, increasing, and its values there.

    Plain lists are used, because there are few turning points and they are needed at every step of a walk.
    """

    thetas: list[float]
    values: list[float]

    def nearest(self, theta: float, full: float) -> int:
        """Return the index of the turning point nearest to an angle, on a circle of circumference `full`."""
        after = bisect_left(self.thetas, theta)
        before, after = after - 1, after % len(self.thetas)
        nearer = apart(self.thetas[before], theta, full) <= apart(self.thetas[after], theta, full)
        return before if nearer else after


@dataclass(frozen=True, eq=False)
class Survey:
    """Results of one pass over an orbit, accurate to rounding.

    Attributes
    ----------
    turns
        Angles at which the deflection of each contact turns, and its values there.
    visited
        Positions at the start, and at the turning points of coordinates and deflections.
    means : shape (2, n)
        Mean of each coordinate, and of its square.
    """

    turns: tuple[Turns, ...]
    visited: list[list[float]]
    means: NDArray[np.float64]

    @cached_property
    def extremes(self) -> NDArray[np.float64]:
        """Maximum, minimum, mean and root mean square of each coordinate, shape (n, 4)."""
        visited = np.array(self.visited)
        return np.column_stack((visited.max(axis=0), visited.min(axis=0), self.means[0], np.sqrt(self.means[1])))


def survey(orbit: Orbit) -> Survey:
    """Integrate an orbit once more, with the integrals of its positions, and record every turning point."""
    flow, coefficients = flow_of(orbit.system, survey=True), coefficients_of(orbit.system)
    length, n = PERIOD * orbit.period, orbit.system.size
    integrals, turns = flow.survey(coefficients, orbit.state, length)
    rows = flow.equations.turning
    contacts = []
    for contact in flow.equations.layout.contacts:
        factors = [(i, f) for i, f in enumerate(coefficients[contact.deflection].tolist()) if f] or [(0, 0.0)]
        event = factors[0][0]
        if len(factors) > 1:
            event = next(k for k, (slots, _) in enumerate(rows) if slots is contact.deflection)
        contacts.append(_turns_along(factors, [turn for turn in turns if turn.event == event]))
    visited = [orbit.state[:n].tolist(), *(turn.positions for turn in turns)]
    return Survey(tuple(contacts), visited, integrals / length)


def apart(a: float, b: float, full: float) -> float:
    """Return the distance of two angles on a circle of circumference `full`."""
    return abs((a - b + full / 2) % full - full / 2)


def _turns_along(factors: list[tuple[int, float]], turns: list[Turn]) -> Turns:
    """Return the turning points of a deflection, given its non-zero factors."""
    values = [sum([factor * turn.positions[i] for i, factor in factors]) for turn in turns]
    return Turns([turn.theta for turn in turns], values)

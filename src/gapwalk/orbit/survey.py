"""One pass over an orbit: extremes and means of each coordinate, and where each contact's deflection turns."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.model.coefficients import coefficients_of
from gapwalk.motion.flow import PERIOD, Turn, flow_of

if TYPE_CHECKING:
    from gapwalk.orbit.orbit import Orbit


class Survey(NamedTuple):
    """What one pass over an orbit shows, exact to rounding.

    Attributes
    ----------
    extremes : shape (n, 4)
        Maximum, minimum, mean and root mean square of each coordinate.
    turns
        For each contact the angles at which its deflection turns, and its values there; shape (2, turns).
    """

    extremes: NDArray[np.float64]
    turns: tuple[NDArray[np.float64], ...]


def survey(orbit: Orbit) -> Survey:
    """Integrate an orbit once more with its positions' integrals, and note every point at which something turns."""
    flow, coefficients = flow_of(orbit.system, survey=True), coefficients_of(orbit.system)
    length, n = PERIOD * orbit.period, orbit.system.size
    integrals, turns = flow.survey(coefficients, orbit.state, length)
    mean, square = integrals / length
    visited = np.array([orbit.state[:n], *(turn.positions for turn in turns)])
    extremes = np.column_stack((visited.max(axis=0), visited.min(axis=0), mean, np.sqrt(square)))
    rows = flow.equations.turning
    contacts = []
    for contact in flow.equations.layout.contacts:
        vector = coefficients[contact.deflection]
        if np.count_nonzero(vector) > 1:
            event = next(k for k, (slots, _) in enumerate(rows) if slots is contact.deflection)
        else:
            event = int(np.argmax(np.abs(vector)))
        contacts.append(_turns_along(vector, [turn for turn in turns if turn.event == event]))
    return Survey(extremes, tuple(contacts))


def _turns_along(vector: NDArray[np.float64], turns: list[Turn]) -> NDArray[np.float64]:
    """Angles and values of a deflection at its turning points, shape (2, turns)."""
    return np.array([[turn.theta, float(vector @ turn.positions)] for turn in turns]).reshape(-1, 2).T

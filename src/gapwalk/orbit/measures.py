"""Measures of one orbit: extrema, mean, rms and harmonics of any of its signals.

`survey` finds the extrema and means of each coordinate, and the turning points of the deflections, in one pass.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Sequence
from fractions import Fraction
from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.errors import ModelError
from gapwalk.flow.flow import PERIOD, flow_of
from gapwalk.flow.forces import Angles
from gapwalk.flow.length_unit import magnitude
from gapwalk.flow.turning_points import Turn
from gapwalk.model.coefficients import coefficients_of
from gapwalk.model.problems import near_names
from gapwalk.model.words import full_measure
from gapwalk.orbit.friction_phases import Margin, margins_of

if TYPE_CHECKING:
    from gapwalk.orbit.orbit import Orbit

_TURNS = 1e-9  # rate of a deflection, over the size of a state, that is only rounding where it turns at the start
_SAMPLES = 96  # per forcing period: those of a motion with friction

MEASURES = ("max", "min", "half", "mean", "rms")


def measure_names(coordinates: Sequence[str]) -> list[str]:
    """Return the headings of the measures: maximum, minimum, half the peak to peak, mean and rms of each coordinate."""
    return [f"{kind}.{q}" for q in coordinates for kind in MEASURES]


def parameter_headings(parameters: Sequence[str], coordinates: Sequence[str]) -> list[str]:
    """Return headings of parameters: their names, but ``parameter mean.q1`` if a measure is called ``mean.q1``."""
    taken = measure_names(coordinates)
    return [f"parameter {name}" if name in taken else name for name in parameters]


class Turns(NamedTuple):
    """Turning points of a quantity along an orbit: their angles, increasing, and its values there.

    Plain lists are used, because there are few turning points and they are needed at every step of a walk.

    Examples
    --------
    >>> [round(value, 6) for value in impacting.turns[0].values]  # of the deflection of the stop
    [1.254466, -1.539058]
    """

    thetas: list[float]  #: Angles, in radians.
    values: list[float]  #: Values of the quantity there.

    def nearest(self, theta: float, full: float) -> int:
        """Return the index of the turning point nearest to an angle, on a circle of circumference `full`."""
        after = bisect_left(self.thetas, theta)
        before, after = after - 1, after % len(self.thetas)
        nearer = apart(self.thetas[before], theta, full) <= apart(self.thetas[after], theta, full)
        return before if nearer else after


def measure(orbit: Orbit, name: str) -> float:
    """See `Orbit.measure`."""
    coordinates = orbit.system.coordinates
    kind, _, signal = full_measure(name, coordinates).partition(".")
    if kind in MEASURES:
        if signal in coordinates:
            row = orbit.extremes[coordinates.index(signal)]
        else:
            motion = orbit.motion(8 * orbit.samples)
            values = motion.signal(signal)  # its largest sample is its maximum to about 1e-5
            row = values.max(), values.min(), values[:-1].mean(), np.sqrt(np.mean(values[:-1] ** 2))
            impulses = motion.impulses(signal)[1]
            if len(impulses):  # of rigid stops: it is infinite there
                struck = [(impulses > 0.0).any(), (impulses < 0.0).any()]
                high, low = np.where(struck, (np.inf, -np.inf), row[:2])
                row = high, low, row[2] + impulses.sum() / (PERIOD * orbit.period), np.inf
        if kind == "half":
            return float(row[0] - row[1]) / 2
        return float(row[("max", "min", "mean", "rms").index(kind)])
    if kind.startswith("h") and signal and not near_names(kind, MEASURES):
        return abs(harmonic(orbit, kind[1:], signal))
    if near := near_names(name, [*coordinates, *(f"{each}.{q}" for each in MEASURES for q in coordinates)]):
        raise ModelError(f"there is no measure {name!r}; did you mean {' or '.join(near)}?")
    raise ModelError(
        f"there is no measure {name!r}; write one of {', '.join(MEASURES)}, h0, h1, ... , a dot and a signal, "
        f"such as half.{coordinates[0]}"
    )


def harmonic(orbit: Orbit, order: str | int | Fraction, signal: str) -> complex:
    """Return the complex amplitude of a harmonic (``Re(c exp(i h theta))``); its order is a multiple of 1/m.

    Orders count turns of the forcing frequency, or of a shaft whose speed is a parameter.
    """
    turns = orbit.system.turns
    try:
        line = Fraction(order) / (turns or 1) * orbit.period
    except ValueError:
        raise ModelError(f"harmonic {order!r} is not an order; write h0, h1, h2, ... or h1/2") from None
    if line.denominator != 1 or line < 0:
        step = f"1/{orbit.period} of W" if turns is None else f"multiples of order {Fraction(turns) / orbit.period}"
        raise ModelError(f"a period-{orbit.period} orbit has harmonics of {step}, not of {order}")
    motion = orbit.motion(4 * orbit.samples)
    values = motion.signal(signal)[:-1]
    lines = np.fft.rfft(values) / len(values)
    if line >= len(lines):
        raise ModelError(f"harmonic {order} lies beyond the {len(lines) - 1} lines that this orbit resolves")
    theta, sizes = motion.impulses(signal)
    pulses = np.sum(sizes * np.exp(-1j * int(line) / orbit.period * theta)) / (PERIOD * orbit.period)
    return complex(lines[int(line)] + pulses) * (1 if line == 0 else 2)


class Survey(NamedTuple):
    """Survey of one orbit."""

    turns: tuple[Turns, ...]  #: Angles at which the deflection of each contact turns, and its values there.
    visited: list[list[float]]  #: Positions at the start, and at the turning points of coordinates and deflections.
    means: NDArray[np.float64]  #: shape (2, n): Mean of each coordinate, and of its square.
    margins: list[Margin]  #: Distances of friction from changes of its sequence of slip and stick.
    #: shape (period + 1, state_size): States at the start of each forcing period, and at the end; None of motions with
    #: friction or rigid stops.
    returns: NDArray[np.float64] | None = None


def survey(orbit: Orbit) -> Survey:
    """Integrate an orbit once more, with the integrals of its positions, and record every turning point."""
    flow, coefficients = flow_of(orbit.system, survey=True), coefficients_of(orbit.system)
    length, n, structure = PERIOD * orbit.period, orbit.system.size, orbit.system.structure
    thetas = PERIOD * np.arange(orbit.period + 1.0)
    if structure.friction:
        starts = [phase.start % length for phases in orbit.friction.values() for phase in phases]
        thetas = np.sort(np.concatenate((_even(orbit.period), starts)))
        if (same := thetas[1:] == thetas[:-1]).any():
            thetas = np.delete(thetas, np.flatnonzero(same))
    integrals, turns, found = flow.survey(coefficients, orbit.state, thetas, orbit.known_states)
    contacts = []
    for contact in flow.equations.layout.contacts:
        factors = [(i, f) for i, f in enumerate(coefficients[contact.deflection].tolist()) if f] or [(0, 0.0)]
        event = factors[0][0]  # the deflection turns with its only coordinate, or has an event of its own
        sways = contact.sway is not None
        if len(factors) > 1 or sways:
            event = next(k for k, (slots, _) in enumerate(flow.equations.turning) if slots is contact.deflection)
        own = [turn for turn in turns if turn.event == event]
        if len(own) % 2 and not sways and not structure.friction and not structure.reactions:
            # turns alternate: of an odd number one is lost at the start, as where a free motion begins at its extremum
            rate = sum([factor * float(orbit.state[n + i]) for i, factor in factors])
            if abs(rate) <= _TURNS * magnitude(orbit.state, orbit.system):
                own.insert(0, Turn(event, 0.0, orbit.state[:n].tolist()))
        values: list[float] = [sum([factor * turn.positions[i] for i, factor in factors]) for turn in own]
        if sways:
            angles = Angles(flow.equations.layout, coefficients, np.array([turn.theta for turn in own]))
            values = (np.array(values) + angles.sway(contact)).tolist()
        contacts.append(Turns([turn.theta for turn in own], values))
    visited = [orbit.state[:n].tolist(), *(turn.positions for turn in turns)]
    margins = []
    if structure.friction and orbit.is_exact:
        margins = margins_of(orbit, thetas, found, flow.readings)
    returns = None if structure.friction or structure.reactions else found.states
    return Survey(tuple(contacts), visited, integrals / length, margins, returns)


@lru_cache(maxsize=16)
def _even(period: int) -> NDArray[np.float64]:
    """Return the even samples of a motion with friction over some forcing periods."""
    return np.linspace(0.0, PERIOD * period, _SAMPLES * period + 1)


def apart(a: float, b: float, full: float) -> float:
    """Return the distance of two angles on a circle of circumference `full`."""
    return abs((a - b + full / 2) % full - full / 2)

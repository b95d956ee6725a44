"""Figures of one orbit: extremes, mean, rms and harmonics of any of its signals."""

from __future__ import annotations

from fractions import Fraction
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from gapwalk.errors import ModelError
from gapwalk.motion.flow import PERIOD
from gapwalk.motion.motion import Motion, sample

if TYPE_CHECKING:
    from gapwalk.orbit.orbit import Orbit

MEASURES = ("max", "min", "half", "mean", "rms")


def measure(orbit: Orbit, name: str) -> float:
    """See `Orbit.measure`."""
    kind, _, signal = name.partition(".")
    if signal in orbit.system.coordinates and kind in MEASURES:
        return pick(orbit.extremes[orbit.system.coordinates.index(signal)], kind)
    if kind in MEASURES:
        values = _fine_signal(orbit, signal)
        mean, rms = float(values[:-1].mean()), float(np.sqrt(np.mean(values[:-1] ** 2)))
        return pick(np.array([values.max(), values.min(), mean, rms]), kind)
    if kind.startswith("h") and signal:
        return abs(harmonic(orbit, kind[1:], signal))
    raise ModelError(
        f"there is no measure {name!r}; write one of {', '.join(MEASURES)}, h0, h1, ... , a dot and a signal, "
        "such as half.q1"
    )


def pick(row: NDArray[np.float64], kind: str) -> float:
    """One measure from a row of maximum, minimum, mean and rms."""
    if kind == "half":
        return float(row[0] - row[1]) / 2
    return float(row[("max", "min", "mean", "rms").index(kind)])


def harmonic(orbit: Orbit, order: str | int | Fraction, signal: str) -> complex:
    """Complex amplitude of a harmonic (``Re(c exp(i h theta))``); the order is a multiple of 1/m of W."""
    try:
        line = Fraction(order) * orbit.period
    except ValueError:
        raise ModelError(f"harmonic {order!r} is no order; write h0, h1, h2, ... or h1/2") from None
    if line.denominator != 1 or line < 0:
        raise ModelError(f"a period-{orbit.period} orbit has harmonics of 1/{orbit.period} of W, not of {order}")
    values = orbit.motion(4 * orbit.samples).signal(signal)[:-1]
    lines = np.fft.rfft(values) / len(values)
    if line >= len(lines):
        raise ModelError(f"harmonic {order} lies beyond the {len(lines) - 1} lines that this orbit resolves")
    return complex(lines[int(line)]) * (1 if line == 0 else 2)


def extremes(orbit: Orbit) -> NDArray[np.float64]:
    """Maximum, minimum, mean and rms of each coordinate, shape (n, 4), exact to about 1e-10 of the amplitude.

    Sampled at even angles and at each contact, so that the motion is smooth between neighbours.
    """
    count = orbit.samples * orbit.period
    even = PERIOD * orbit.period * np.arange(count + 1) / count
    theta = with_contacts(even, orbit)
    motion = sample(orbit.system, orbit.state, theta)
    evenly = motion.q if len(theta) == len(even) else motion.q[np.searchsorted(theta, even)]
    high, low = motion.q.max(axis=0), motion.q.min(axis=0)
    for i, unit in enumerate(np.eye(orbit.system.size)):
        turns = turning_points(motion, unit)[1]
        if len(turns):
            high[i], low[i] = max(high[i], turns.max()), min(low[i], turns.min())
    mean, rms = evenly[:-1].mean(axis=0), np.sqrt((evenly[:-1] ** 2).mean(axis=0))
    return np.column_stack((high, low, mean, rms))


def with_contacts(even: NDArray[np.float64], orbit: Orbit) -> NDArray[np.float64]:
    """The angles `even`, and those of the orbit's contacts that do not coincide with one of them."""
    if not orbit.events:
        return even
    touches = np.array([event.theta for event in orbit.events])
    spacing = even[1] - even[0]
    apart = np.abs(touches / spacing - np.round(touches / spacing)) > 1e-6
    return np.unique(np.concatenate((even, touches[apart])))


def turning_points(motion: Motion, vector: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Angles and values of all turning points of ``vector . q`` between the samples of a motion.

    Each comes from the quintic through positions, velocities and accelerations at the samples on either side.
    """
    x, v = motion.q @ vector, motion.v @ vector
    k = np.flatnonzero(v[:-1] * v[1:] <= 0.0)
    k = k[v[k] != 0.0]
    if not len(k):
        return np.zeros(0), np.zeros(0)
    a = motion.a @ vector
    h = (motion.theta[k + 1] - motion.theta[k]) / motion.system.frequency
    share, rise = _turn(x[k + 1] - x[k], h * v[k], h * v[k + 1], h * h * a[k] / 2, h * h * a[k + 1] / 2)
    return motion.theta[k] + share * (motion.theta[k + 1] - motion.theta[k]), x[k] + rise


def _turn(jump, c1, d1, c2, d2) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Where, in [0, 1], the quintics turn whose slopes have opposite signs at the ends, and how far they rise there."""
    c3 = 10 * jump - 6 * c1 - 4 * d1 - 3 * c2 + d2
    c4 = -15 * jump + 8 * c1 + 7 * d1 + 3 * c2 - 2 * d2
    c5 = 6 * jump - 3 * c1 - 3 * d1 - c2 + d2
    u = c1 / (c1 - d1)
    for _ in range(5):
        slope = c1 + u * (2 * c2 + u * (3 * c3 + u * (4 * c4 + u * 5 * c5)))
        bend = 2 * c2 + u * (6 * c3 + u * (12 * c4 + u * 20 * c5))
        u = np.clip(u - slope / np.where(bend == 0.0, np.inf, bend), 0.0, 1.0)
    return u, u * (c1 + u * (c2 + u * (c3 + u * (c4 + u * c5))))


def _fine_signal(orbit: Orbit, signal: str) -> NDArray[np.float64]:
    """A signal sampled finely enough that its largest sample is its maximum to about 1e-5."""
    return orbit.motion(8 * orbit.samples).signal(signal)


"""The rotation number of a motion on a torus: the fraction of the closed curve that its strobes advance each time.

The curve need not be round, star-shaped or plane. A candidate for the rotation number is a frequency in the spectrum of
the strobes, or the sum or difference of two. For the right candidate, and for no other, the polygon through the strobes
in the order of their phases ``k rho mod 1`` goes once round the curve with the smallest length. The number itself then
follows from the drift of the phase of the first harmonic between windows, with the weights of the weighted Birkhoff
average, so that other lines do not disturb it (Laskar's frequency analysis, 1993, Physica D 67, 257-281).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gapwalk.attractors.lyapunov import birkhoff_weights

_LEAST = 256  # the fewest strobes on each curve
_CONSTANT = 1e-10  # deviation of a signal, over the largest of all, that is rounding: a rate while friction sticks
_LINES = 8  # number of the strongest spectral lines from which candidates are made
_GAP = 0.05  # the widest gap between phases: a rational number would visit only a few places
_SMOOTH = 1.3  # largest length of the polygon over the least length that connects the strobes: 1 for a curve
_CERTAIN = 1e-4  # the largest error of an accepted rotation number
_MOST = 1024  # the most strobes with which curves are tested


@dataclass(frozen=True, slots=True)
class Rotation:
    """The rotation number of strobes on closed curves."""

    #: Turns per return to the same curve, between 0 and 1/2: a strobe map cannot distinguish rho from 1 - rho.
    number: float
    error: float  #: Estimated error of the number.
    curves: int  #: Number of curves, visited in turn: the period of the orbit that the torus surrounds.
    #: Length of the closed polygon through the strobes in the order of their phases, over the length of their minimum
    #: spanning tree: 1 for a curve, much more if the order or the number of curves is wrong.
    roughness: float


def rotation(strobes: NDArray[np.float64], max_curves: int = 16) -> Rotation | None:
    """Compute the rotation number of a motion from its strobes; None if they do not lie on a few closed curves."""
    # Shapes: `strobes` (count, state_size).
    deviation = strobes.std(axis=0)
    scaled = (strobes - strobes.mean(axis=0)) / np.where(
        deviation > _CONSTANT * deviation.max(), deviation, max(1.0, deviation.max())
    )
    for curves in range(1, max_curves + 1):
        on_one = scaled[::curves]
        if len(on_one) < _LEAST:
            return None
        found = _on_one_curve(on_one)
        if found is not None:
            number, error, roughness = found
            return Rotation(float(min(number, 1.0 - number)), float(error), curves, roughness)
    return None


def _on_one_curve(states: NDArray[np.float64]) -> tuple[float, float, float] | None:
    """Return number, error and roughness of strobes on one curve; None if they lie on no curve."""
    centred = states - states.mean(axis=0)
    places = _chosen(len(states))
    few = centred[places]
    candidates = [number for number in _candidates(centred) if _widest_gap(places * number) <= _GAP]
    if not candidates:
        return None
    best = min(candidates, key=lambda number: _way_round(few, places * number))
    number, error = _refine(centred, best)
    roughness = _way_round(few, places * number) / _least_length(few)
    return (number % 1.0, error, roughness) if roughness <= _SMOOTH and error <= _CERTAIN else None


def _chosen(count: int) -> NDArray[np.intp]:
    """Select strobes at random for the test of a curve: a regular selection would have another rotation number."""
    if count <= _MOST:
        return np.arange(count)
    return np.sort(np.random.default_rng(0).choice(count, _MOST, replace=False))


def _candidates(states: NDArray[np.float64]) -> list[float]:
    """Return the refined frequencies of strong lines of any coordinate, and sums and differences of two of them."""
    from scipy.signal import find_peaks, windows  # imported late: it takes long

    count = len(states)
    power = (np.abs(np.fft.rfft(states * windows.hann(count, sym=False)[:, None], axis=0)) ** 2).sum(axis=1)
    places = find_peaks(np.concatenate(([0.0], power, [0.0])))[0] - 1
    strongest = places[np.argsort(-power[places])][:_LINES]
    lines = [_refine(states, place / count)[0] for place in strongest if place > 0]
    both = [a + sign * b for i, a in enumerate(lines) for b in lines[:i] for sign in (1, -1)]
    folded = [min(number % 1.0, -number % 1.0) for number in (*lines, *both)]
    return [number for number in folded if number > 0.5 / count]


def _widest_gap(turns: NDArray[np.floating]) -> float:
    """Return the widest gap between phases."""
    phases = np.sort(turns % 1.0)
    return float(np.diff(phases, append=phases[0] + 1.0).max())


def _way_round(states: NDArray[np.float64], turns: NDArray[np.floating]) -> float:
    """Return the length of the closed polygon through the strobes in the order of their phases."""
    ring = states[np.argsort(turns % 1.0)]
    return float(np.linalg.norm(ring - np.roll(ring, 1, axis=0), axis=1).sum())


def _least_length(states: NDArray[np.float64]) -> float:
    """Return the length of the minimum spanning tree of the strobes, built by Prim's algorithm."""
    outside, latest, length = states[1:].T.copy(), states[0], 0.0
    nearest = np.full(outside.shape[1], np.inf)  # square of the distance of each to the tree
    for _ in range(len(nearest)):
        np.minimum(nearest, ((outside - latest[:, None]) ** 2).sum(axis=0), out=nearest)
        place = int(np.argmin(nearest))
        length, latest = length + float(np.sqrt(nearest[place])), outside[:, place].copy()
        outside[:, place], nearest[place] = outside[:, -1], nearest[-1]
        outside, nearest = outside[:, :-1], nearest[:-1]
    return length


def _refine(states: NDArray[np.float64], number: float) -> tuple[float, float]:
    """Refine a frequency from its phase drift between windows; the error is the difference of two pairs of windows."""
    error = np.inf
    window = len(states) // 2
    weights = birkhoff_weights(window)
    starts = (0, (len(states) - window) // 2, len(states) - window)
    for _ in range(3):
        amplitudes = np.array([_amplitudes(states[s : s + window], number, s, weights) for s in starts])
        signal = int(np.argmax(np.abs(amplitudes).min(axis=0)))
        first, middle, last = amplitudes[:, signal]
        early = float(np.angle(middle / first)) / (2 * np.pi * (starts[1] - starts[0]))
        late = float(np.angle(last / middle)) / (2 * np.pi * (starts[2] - starts[1]))
        number += 0.5 * (early + late)
        error = abs(late - early)
    return number, max(error, np.finfo(float).eps)


def _amplitudes(states: NDArray[np.float64], number: float, start: int, weights: NDArray[np.float64]) -> NDArray:
    """Return the weighted amplitude of one frequency in each signal of a window that begins at the strobe `start`."""
    angles = 2.0 * np.pi * number * np.arange(start, start + len(states))
    return (weights * np.cos(angles)) @ states - 1j * ((weights * np.sin(angles)) @ states)

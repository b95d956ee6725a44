"""The rotation number of a motion on a torus: how far its strobes go round the closed curve each time.

The curve need not be round, nor star-shaped, nor in a plane. A candidate for the rotation number is a frequency in the
spectrum of the strobes, or a difference of two; for the right one, and for no other, the strobes in the order of their
phases ``k rho mod 1`` go once round the curve by the shortest way. The number itself then comes from the drift of the
phase of the first harmonic between windows, with the weights of the weighted Birkhoff average, so that other lines do
not disturb it (Laskar's frequency analysis, 1993, Physica D 67, 257-281).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gapwalk.attractor.average import birkhoff_weights

_LEAST = 256  # the fewest strobes on each curve
_LINES = 8  # strongest lines of the spectrum from which candidates are made
_GAP = 0.05  # the widest gap between the phases: a rational number would visit a few places only
_SMOOTH = 1.3  # length of the way round over the least that joins the strobes: 1 for a curve
_CERTAIN = 1e-4  # the largest error of a rotation number that is one
_MOST = 1024  # strobes by which curves are judged


@dataclass(frozen=True, slots=True)
class Rotation:
    """The rotation number of strobes on closed curves.

    Attributes
    ----------
    number
        Turns of each return to the same curve, between 0 and 1/2: a strobe map cannot tell rho from 1 - rho.
    error
        Estimate of its error.
    curves
        Number of curves, visited in turn: the period of the orbit that the torus surrounds.
    roughness
        Length of the way round through the strobes, in the order of their phases, over the least length that joins
        them (of the minimum spanning tree): 1 for a curve, much more if the order or the number of curves is wrong.
    """

    number: float
    error: float
    curves: int
    roughness: float


def rotation(strobes: NDArray[np.float64], max_curves: int = 16) -> Rotation | None:
    """The rotation number of a motion from its strobes; None if they do not lie on a few closed curves.

    Parameters
    ----------
    strobes : shape (count, 2n)
        Successive strobes of the settled motion: 256 or more a curve; the error falls fast with their number.
    max_curves
        The most curves.
    """
    deviation = strobes.std(axis=0)
    scaled = (strobes - strobes.mean(axis=0)) / np.where(deviation > 0.0, deviation, 1.0)
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
    """Number, error and roughness of strobes on one curve; None if they lie on none."""
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
    """Strobes by which curves are judged: at random, because any regular choice would see another rotation."""
    if count <= _MOST:
        return np.arange(count)
    return np.sort(np.random.default_rng(0).choice(count, _MOST, replace=False))


def _candidates(states: NDArray[np.float64]) -> list[float]:
    """Frequencies of strong lines of any coordinate, refined, and the sums and differences of two of them."""
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
    """The widest gap between phases."""
    phases = np.sort(turns % 1.0)
    return float(np.diff(phases, append=phases[0] + 1.0).max())


def _way_round(states: NDArray[np.float64], turns: NDArray[np.floating]) -> float:
    """Length of the closed way through the strobes in the order of their phases."""
    ring = states[np.argsort(turns % 1.0)]
    return float(np.linalg.norm(ring - np.roll(ring, 1, axis=0), axis=1).sum())


def _least_length(states: NDArray[np.float64]) -> float:
    """Length of the shortest tree that joins all strobes, which Prim's method joins one by one."""
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
    """A frequency from the drift of its phase between windows, and how far two pairs of windows disagree."""
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
    """Weighted amplitude of one frequency in each signal of a window that begins at the strobe `start`."""
    angles = 2.0 * np.pi * number * np.arange(start, start + len(states))
    return (weights * np.cos(angles)) @ states - 1j * ((weights * np.sin(angles)) @ states)

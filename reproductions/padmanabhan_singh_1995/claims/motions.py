"""What checks look at in settled motions: histories, force peaks, lines of spectra."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gapwalk.attractor.attractor import Attractor
from gapwalk.attractor.spectrum import spectrum
from gapwalk.orbit.orbit import Orbit
from gapwalk.study.result import Result
from gapwalk.study.settle.finding import SettleFinding

_SAMPLES = 512


def attractor_of(result: Result) -> Attractor:
    """The attractor that a job has settled on."""
    assert isinstance(result.finding, SettleFinding)
    return result.finding.attractor


def over_two_periods(result: Result, signal: str) -> NDArray[np.float64]:
    """A signal of a periodic motion, evenly sampled over two forcing periods."""
    attractor = attractor_of(result)
    assert attractor.orbit is not None
    values = attractor.orbit.motion(_SAMPLES).signal(signal)[:-1]
    return np.tile(values, 2 // attractor.period or 1)


def difference(first: NDArray[np.float64], second: NDArray[np.float64]) -> float:
    """The rms of the difference of two signals, as a share of the rms of the first about its mean."""
    return float(np.sqrt(np.mean((first - second) ** 2)) / np.std(first))


def force_peaks(orbit: Orbit) -> tuple[int, int]:
    """How often the contact is pressed most, on each side, in one full period: what a picture of its force shows.

    Between two peaks the contact need not open, so there may be more peaks than impacts.
    """
    turns = np.array(orbit.survey.turns[0].values)
    clearance = orbit.system["stage2.clearance"]
    highest = (turns > np.roll(turns, 1)) & (turns > np.roll(turns, -1)) & (turns > clearance)
    lowest = (turns < np.roll(turns, 1)) & (turns < np.roll(turns, -1)) & (turns < -clearance)
    return int(highest.sum()), int(lowest.sum())


def lines(orbit: Orbit, signal: str) -> NDArray[np.float64]:
    """The amplitudes of the harmonics of W of a periodic motion, the first first."""
    found = spectrum(orbit, signal)
    whole = np.isclose(found.orders % 1.0, 0.0) & (found.orders > 0.5)
    return found.amplitudes[whole]

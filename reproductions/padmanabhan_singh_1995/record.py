"""The record that stands for the measured one of figure 8, which is not printed as numbers: it is synthetic."""

from __future__ import annotations

import numpy as np

from gapwalk.measurement.alignment import Alignment, align
from gapwalk.measurement.record import Record
from gapwalk.motion.flow import PERIOD
from gapwalk.orbit.orbit import Orbit
from gapwalk.study.result import Result
from reproductions.padmanabhan_singh_1995.motion import orbit_of
from reproductions.padmanabhan_singh_1995.third_inertia import third_inertia

NOISE = 0.1
"""Standard deviation of the noise, relative to that of the motion."""

_SAMPLES, _PERIODS, _SEED = 160, 6, 1995  # a forcing period; forcing periods; of the noise
_PHASE = 1.0  # rad, where the record begins


def synthetic_record(orbit: Orbit) -> Record:
    """A record of u3'' of a motion, as a sensor with white noise would give it: no measurement, and it says so."""
    begin = round(_PHASE / PERIOD * _SAMPLES)
    once = third_inertia(orbit.system).of(orbit.motion(_SAMPLES))[:-1]
    exact = np.tile(once, -(-(_PERIODS + 1) // orbit.period))[begin : begin + _PERIODS * _SAMPLES + 1]
    noise = np.random.default_rng(_SEED).normal(0.0, NOISE * float(np.std(once)), len(exact))
    time = PERIOD / orbit.system.frequency * np.arange(len(exact)) / _SAMPLES
    return Record(time, exact + noise, name="SYNTHETIC, no measurement")


def beside_record(computed: Result, recorded: Result) -> Alignment:
    """u3'' of a settled motion, aligned with the synthetic record of another one.

    Parameters
    ----------
    computed, recorded
        Results of jobs that ended on periodic motions at the same frequency.
    """
    orbit = orbit_of(computed)
    return align(orbit, synthetic_record(orbit_of(recorded)), third_inertia(orbit.system))

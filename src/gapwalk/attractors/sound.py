"""Sounds: a signal of a motion over true time, at its true pitch and level, and WAV files of it.

Each sample is that of the exact flow at its instant; nothing is interpolated. The level is in the unit of the signal,
so a quiet motion and a rattling one sound as differently loud as they are. What is infinite for no time, as an
acceleration where a rigid stop strikes, is a sample whose area is the impulse.
"""

from __future__ import annotations

import math
import os
import struct
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gapwalk.attractors.attractor import Settled
from gapwalk.errors import ModelError, StoreError
from gapwalk.files import why_no_file
from gapwalk.flow.flow import PERIOD
from gapwalk.flow.motion import Motion, integrate, sample
from gapwalk.model.problems import given
from gapwalk.model.system import System
from gapwalk.orbit.orbit import Orbit
from gapwalk.summary import Described

RATE = 48_000
"""Samples per second."""
SECOND = 2.0 * math.pi * 90.0
"""Units of time that a second lasts without units: the excitation at frequency 1 is then heard at 90 Hz."""

_RATES = (4_000, 384_000)
_MOST = 30_000_000  # samples: ten minutes
_DEPTH = 2**23 - 1  # largest value of a sample of 24 bits
_ROUND = (1.0, 2.0, 5.0, 10.0)
_LOG_SAMPLES = 64  # per period, of the motion from which impulses are taken


@dataclass(frozen=True, eq=False)
class Sound(Described):
    """A signal over true time.

    Examples
    --------
    >>> tone = gw.analysis.sound(orbit, "x", 0.1)
    >>> tone.rate, len(tone.values) == round(0.1 * tone.rate)
    (48000, True)
    """

    #: signal, unit: Name of the signal, and its unit; empty without units.
    signal: str
    unit: str
    rate: int  #: Samples per second.
    values: NDArray[np.float64]  #: shape (samples,): The signal, in its unit.
    second: float = 1.0  #: Units of the model's time that a second lasts: 1 for a model with units.

    @property
    def duration(self) -> float:
        """Length in seconds."""
        return len(self.values) / self.rate

    @property
    def peak(self) -> float:
        """Largest magnitude without the mean, which nobody hears."""
        return float(np.abs(self._heard).max(initial=0.0))

    @property
    def level(self) -> float:
        """Root mean square without the mean."""
        return float(np.sqrt(np.mean(self._heard**2)))

    @property
    def full_scale(self) -> float:
        """The next of 1, 2, 5, 10, 20, ... above the peak: the amplitude that `wav` makes the largest sample."""
        if not self.peak > 0.0:
            return 1.0
        power = 10.0 ** math.floor(math.log10(self.peak))
        return next(step * power for step in _ROUND if step * power >= self.peak)

    @property
    def _heard(self) -> NDArray[np.float64]:
        return self.values - self.values.mean()

    def wav(self, full_scale: float | None = None) -> bytes:
        """Return the content of a WAV file of one channel, 24 bits; a comment in it says what full scale is.

        Parameters
        ----------
        full_scale
            Amplitude, in the unit of the signal, that becomes the largest sample. Files with one full scale keep the
            ratio of their levels. By default `full_scale`.
        """
        scale = self.full_scale if full_scale is None else full_scale
        if isinstance(scale, bool) or not isinstance(scale, int | float) or not (scale > 0.0 and math.isfinite(scale)):
            raise ModelError(f"full_scale is {given(scale)}; it must be a positive amplitude of {self.signal}")
        if self.peak > scale * (1.0 + 1e-12):
            raise ModelError(
                f"{self.signal} reaches {self.peak:.4g} {self.unit}".rstrip()
                + f", above the full scale of {scale:g}: the sound would be distorted. Write "
                f"full_scale={self.full_scale:g} or more, for all sounds that are compared"
            )
        levels = np.rint(self._heard * (_DEPTH / scale)).astype("<i4")
        content = levels.view(np.uint8).reshape(-1, 4)[:, :3].tobytes()
        note = f"{self.signal}, full scale {scale:g} {self.unit}".rstrip()
        form = struct.pack("<HHIIHH", 1, 1, self.rate, 3 * self.rate, 3, 24)
        comment = b"INFO" + _chunk(b"ICMT", note.encode() + b"\0")
        body = b"WAVE" + _chunk(b"fmt ", form) + _chunk(b"LIST", comment) + _chunk(b"data", content)
        return _chunk(b"RIFF", body)

    def save(self, path: str | os.PathLike[str], full_scale: float | None = None) -> None:
        """Write a WAV file; see `wav`. Raise a StoreError if it cannot be written."""
        content = self.wav(full_scale)
        if why := why_no_file(path):
            raise StoreError(f"{os.fspath(path)} {why}")
        try:
            Path(path).write_bytes(content)
        except OSError as error:
            raise StoreError(f"{os.fspath(path)} cannot be written: {error.strerror or error}") from None

    def __repr__(self) -> str:
        return (
            f"Sound({self.signal}, {self.duration:.4g} s at {self.rate} Hz, peak {self.peak:.4g} {self.unit}".rstrip()
            + ")"
        )


def sound(
    motion: Orbit | Settled,
    signal: str,
    seconds: float = 3.0,
    *,
    rate: int = RATE,
    second: float | None = None,
) -> Sound:
    """Compute the sound of a settled motion, at its true pitch and level.

    Parameters
    ----------
    motion
        An orbit, which need not be stable, or a settled motion.
    signal
        As in `Motion.signal`: usually an acceleration (``"gear''"``) or the force of a contact (``"mesh.force"``).
    seconds
        Length in seconds.
    rate
        Samples per second.
    second
        Units of time that a second lasts, for a model without units; by default so many that the excitation at
        frequency 1 is heard at 90 Hz.

    Returns
    -------
    Sound
        The samples, in the unit of the signal.

    Raises
    ------
    ModelError
        If there is no such signal, or a number is out of its range.

    Examples
    --------
    >>> import gapwalk as gw
    >>> mass = gw.System(
    ...     ["x"], mass=[1.0], damping=[0.1], stiffness=[1.0], harmonics=[gw.Harmonic(0.1, {"x": 1.0})], frequency=1.0
    ... )
    >>> heard = gw.analysis.sound(gw.find_orbit(mass), "x''")
    >>> round(heard.peak, 6), heard.duration
    (1.0, 3.0)
    """
    system = motion.system
    lasts = second_of(system, second)
    times = instants(seconds, rate) * lasts
    theta = times * system.frequency
    orbit = motion if isinstance(motion, Orbit) else motion.orbit
    if orbit is None:
        found = sample(system, motion.state, theta)
        values, struck, whole = found.signal(signal), found, theta[-1]
    else:
        # a periodic motion is integrated over one period, also where it is unstable: it would be left
        whole = orbit.period * PERIOD
        angles, places = np.unique(theta % whole, return_inverse=True)
        values = sample(system, orbit.state, angles).signal(signal)[places]
        struck = integrate(system, orbit.state, orbit.period, _LOG_SAMPLES) if system.structure.reactions else None
    if struck is not None and struck.impacts:
        values = values + _struck(struck, signal, theta, whole, rate / lasts)
    return Sound(signal, unit_of(system, signal), rate, values, lasts)


def _struck(motion: Motion, signal: str, theta: NDArray[np.float64], whole: float, rate: float) -> NDArray[np.float64]:
    """Return impulses as samples: each is divided between two neighbours, and its area is kept."""
    angles, sizes = motion.impulses(signal)
    found, step = np.zeros(len(theta)), theta[1] - theta[0]
    for turn in range(int(theta[-1] // whole) + 1):
        places = (angles + turn * whole) / step
        first = np.floor(places).astype(int)
        part = places - first
        for at, share in ((first, 1.0 - part), (first + 1, part)):
            inside = (at >= 0) & (at < len(theta))
            np.add.at(found, at[inside], (share * sizes)[inside])
    return found * (rate / motion.system.frequency)  # an integral over theta becomes one over time


def instants(seconds: float, rate: int) -> NDArray[np.float64]:
    """Return the times of the samples of a sound, in seconds."""
    if isinstance(rate, bool) or not isinstance(rate, int) or not _RATES[0] <= rate <= _RATES[1]:
        raise ModelError(f"rate is {given(rate)}; it must be an integer from {_RATES[0]} to {_RATES[1]} samples per s")
    if isinstance(seconds, bool) or not isinstance(seconds, int | float) or not 2.0 <= seconds * rate <= _MOST:
        raise ModelError(f"seconds is {given(seconds)}; it must be a length up to {_MOST / rate:g} s")
    return np.arange(int(seconds * rate + 1e-9)) / rate


def second_of(system: System, second: float | None) -> float:
    """Return the units of time that a second lasts."""
    if system.units is not None:
        if second not in (None, 1.0):
            raise ModelError("this model has units, so its time is in seconds; leave second out")
        return 1.0
    if second is None:
        return SECOND
    if isinstance(second, bool) or not isinstance(second, int | float) or not 0.0 < second < math.inf:
        raise ModelError(f"second is {given(second)}; it must be a positive number of units of time")
    return float(second)


def unit_of(system: System, signal: str) -> str:
    """Return the unit of a signal; empty without units."""
    return "" if system.units is None else system.units.signal(signal)[1]


def _chunk(name: bytes, content: bytes) -> bytes:
    """Return a part of a RIFF file, whose length is even."""
    return name + struct.pack("<I", len(content)) + content + b"\0" * (len(content) % 2)

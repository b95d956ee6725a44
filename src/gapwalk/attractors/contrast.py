"""Comparison of two motions, for example under two damping laws: histories, spectra, and their agreement."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gapwalk.attractors.agreement import Agreement, agreement, orders_of
from gapwalk.attractors.settled import Settled
from gapwalk.attractors.spectrum import Spectrum, SpectrumOptions, spectrum
from gapwalk.errors import ModelError
from gapwalk.flow.motion import force_of, integrate
from gapwalk.orbit.orbit import Orbit

_SAMPLES = 1024  # per forcing period
_LONG = 6  # forcing periods shown of motions that do not repeat sooner
_LINES = 20  # highest order of the lines that are compared


@dataclass(frozen=True, eq=False)
class SignalPair:
    """One signal of two motions.

    Attributes
    ----------
    signal
        Name of the signal.
    theta : shape (samples,)
        Angles of the excitation.
    histories : shape (2, samples)
        Histories of the first and of the second motion, at the same phases of the excitation.
    spectra
        Spectra of the first and of the second motion.
    agreement
        Agreement of the histories; None if a motion has no period.
    """

    signal: str
    theta: NDArray[np.float64]
    histories: NDArray[np.float64]
    spectra: tuple[Spectrum, Spectrum]
    agreement: Agreement | None


@dataclass(frozen=True, repr=False)
class Contrast:
    """A comparison of two motions.

    Attributes
    ----------
    names
        Names of the two motions.
    motions
        The two motions.
    pairs
        Their signals, in pairs.
    """

    names: tuple[str, str]
    motions: tuple[Orbit | Settled, Orbit | Settled]
    pairs: tuple[SignalPair, ...]

    def plot(self, title: str | None = None, **options: Any):
        """Draw histories and spectra of all signals (paper, figures 3 and 5 to 7); see `gapwalk.plot.draw`."""
        from gapwalk.plot import draw

        return draw(self, title=title, **options)

    def __repr__(self) -> str:
        texts = [
            f"{pair.signal} no common period"
            if pair.agreement is None
            else f"{pair.signal} differs by {pair.agreement.relative:.3g} of its rms"
            for pair in self.pairs
        ]
        return f"Contrast({self.names[0]}, {self.names[1]}: {'; '.join(texts)})"


def contrast(
    first: Orbit | Settled,
    second: Orbit | Settled,
    signals: Sequence[str] = (),
    *,
    names: tuple[str, str] = ("first", "second"),
    options: SpectrumOptions | None = None,
) -> Contrast:
    """Compare histories and spectra of two motions, for example under two damping laws (paper, section 4).

    Both are sampled at the same phases of the excitation. Their systems may differ in everything but their signals.

    Parameters
    ----------
    first, second
        Orbits or settled motions.
    signals
        As in `Motion.signal`; by default the acceleration of the first coordinate, and the force of each contact.
    names
        Names of the two motions.
    options
        Options of the spectra.

    Raises
    ------
    ModelError
        If one of the motions has no such signal.
    FlowError
        If a motion diverges.
    """
    system = first.system
    if len(names) != 2:
        raise ModelError(f"names is {names!r}; it must be two texts")
    known = [f"{system.coordinates[0]}''", *map(force_of, system.structure.contacts)]
    periods = [first.period or 0, second.period or 0]
    shared = math.lcm(*periods) if all(periods) else 0
    length = shared if 0 < shared <= 8 * _LONG else _LONG
    motions = [integrate(motion.system, motion.state, length, _SAMPLES) for motion in (first, second)]
    theta = motions[0].theta
    pairs = []
    for signal in signals or known:
        histories = np.array([motion.signal(signal) for motion in motions])
        spectra = spectrum(first, signal, options), spectrum(second, signal, options)
        found = None
        if length == shared:
            found = agreement(theta[:-1], histories[0, :-1], histories[1, :-1], orders_of(length, _LINES), system.turns)
        pairs.append(SignalPair(signal, theta, histories, spectra, found))
    return Contrast((names[0], names[1]), (first, second), tuple(pairs))

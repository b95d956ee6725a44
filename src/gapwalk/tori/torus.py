"""Record of a torus: its curve, rotation number, error and stability."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from gapwalk.attractors.section import Strobe
from gapwalk.errors import ModelError
from gapwalk.flow.flow import PERIOD, flow_of
from gapwalk.model.coefficients import coefficients_of
from gapwalk.model.system import System, pace_text
from gapwalk.notebook import Shown
from gapwalk.tori.closed_curve import TURN, at_phases, phases, tail

_NEUTRAL = 1e-7  # growth per return to a curve below which a deviation counts as not growing
_CERTAIN = 3.0  # errors by which a growth must exceed zero
_RESOLVED = 5e-4  # largest error of a curve, as a share of its own size: with twice as much simulations show no torus
_ANGLES = 64  # angles of a forcing period at which measures are taken


@dataclass(frozen=True, eq=False)
class Torus(Shown):
    """Quasi-periodic motion: one of the m closed curves that its strobes visit in turn, and how they rotate on it.

    Notes
    -----
    See docs/numerics/tori.md.

    Examples
    --------
    >>> torus.curves, torus.stable, bool(torus.error < 1e-9)
    (1, True, True)
    >>> round(torus.rotation, 9)
    0.447213595
    """

    system: System  #: The system that moves.
    curves: int  #: m, the number of curves: the period of the orbit that the torus surrounds.
    #: Rotation number: the share of a turn by which a strobe has advanced on its curve after m forcing periods, between
    #: 0 and 1. With the phase reversed it would be ``1 - rotation``.
    rotation: float
    states: NDArray[np.float64]  #: shape (N, state_size): The states of the curve at the phases ``2 pi j / N``.
    #: Largest distance between the curve and its image, between the samples, relative to the size of the motion. The
    #: motion from each phase is integrated for it; it is no estimate.
    error: float
    #: shape (state_size - 1,): Growth of small deviations from the torus in m forcing periods, as natural logarithms,
    #: largest first. The torus is stable if all are negative.
    exponents: NDArray[np.float64]
    exponent_error: float  #: Estimated error of the largest of them.
    #: The least and the largest number of contact events in m forcing periods along the curve. If they differ, a
    #: contact grazes somewhere on the torus, and the curve is smooth only piecewise.
    touches: tuple[int, int]

    def _check_read(self) -> None:
        """Raise a ValueError if its parts do not fit together."""
        if self.states.ndim != 2 or self.states.shape[1] != self.system.state_size or len(self.states) % 2 == 0:
            raise ValueError(f"a curve of shape {self.states.shape} does not belong to this system")
        if self.exponents.shape != (self.system.state_size - 1,):
            raise ValueError("the exponents of a torus are not as many as its normal directions")

    @property
    def stuck(self) -> tuple[int, ...]:
        """Contacts whose friction never slips: none, since systems with friction have no tori here."""
        return ()

    @property
    def count(self) -> int:
        """Number of samples of the curve."""
        return len(self.states)

    @property
    def largest_exponent(self) -> float:
        """Largest growth of deviations in m forcing periods, as a natural logarithm."""
        return float(self.exponents[0])

    @property
    def unstable(self) -> int:
        """Number of directions in which deviations grow."""
        return int((self.exponents > max(_NEUTRAL, _CERTAIN * self.exponent_error)).sum())

    @property
    def stable(self) -> bool:
        """True if motions nearby settle on the torus."""
        return self.unstable == 0

    @property
    def grazes(self) -> bool:
        """True if a contact grazes somewhere on the torus."""
        return self.touches[0] != self.touches[1]

    @property
    def tail(self) -> float:
        """Size of the highest quarter of the harmonics of the curve, relative to its largest harmonic."""
        return tail(self.states / self.system.state_scales())

    @property
    def frequencies(self) -> tuple[float, float]:
        """The two angular frequencies of the motion: that of the excitation, and ``rotation / m`` times it."""
        return self.system.frequency, self.system.frequency * self.rotation / self.curves

    @property
    def size(self) -> float:
        """Largest distance of the curve from its mean, as a position; velocities count divided by the frequency."""
        away = (self.states - self.states.mean(axis=0)) / self.system.state_scales()
        return float(np.abs(away).max())

    @property
    def is_resolved(self) -> bool:
        """True if the error is small beside the curve itself, and not only beside the motion."""
        return self.error <= _RESOLVED * relative_size(self)

    def state(self, psi: float = 0.0) -> NDArray[np.float64]:
        """Return the state of the curve at a phase, in radians; shape (state_size,).

        Returns
        -------
        array, shape (state_size,)
            Positions, then velocities, in units of the model.
        """
        return at_phases(self.states, np.array([psi]))[0]

    @cached_property
    def sections(self) -> tuple[NDArray[np.float64], ...]:
        """The m curves that the strobes visit in turn, each of shape (N, state_size)."""
        found, strobe = [self.states], Strobe(self.system)
        for _ in range(self.curves - 1):
            found.append(np.array([strobe.arc(state).state for state in found[-1]]))
        return tuple(found)

    def strobes(self, count: int) -> NDArray[np.float64]:
        """Return successive strobes of the motion from phase 0, without integration; shape (count, state_size).

        Returns
        -------
        array, shape (count, state_size)
            Positions, then velocities, in units of the model.
        """
        steps = np.arange(count)
        turns = TURN * self.rotation * (steps // self.curves).astype(np.float64)
        found = np.empty((count, self.states.shape[1]))
        for place, curve in enumerate(self.sections):
            mine = steps % self.curves == place
            found[mine] = at_phases(curve, turns[mine])
        return found

    def surface(self, samples: int = 32) -> NDArray[np.float64]:
        """Return the states of the torus over one forcing period of each curve.

        The shape is ``(m * samples + 1, N + 1, state_size)``: over the angle of the excitation, then over the phase.
        Both ends of the phase are the same; the last angle is the first curve again, rotated.

        Parameters
        ----------
        samples
            Angles of the excitation in each forcing period.

        Returns
        -------
        array, shape (m * samples + 1, N + 1, state_size)
            Positions, then velocities, in units of the model.
        """
        thetas = np.linspace(0.0, PERIOD * self.curves, samples * self.curves + 1)
        flow, coefficients = flow_of(self.system), coefficients_of(self.system)
        found = np.array([flow.sample(coefficients, state, thetas).states for state in self.states])
        return np.concatenate((found, found[:1])).transpose(1, 0, 2)

    def measure(self, name: str) -> float:
        """Return ``max.``, ``min.`` or ``half.`` (half the difference) of a coordinate over the torus, as ``max.q1``.

        They are taken at 64 angles of each forcing period and at all N phases.

        Parameters
        ----------
        name
            ``max.``, ``min.`` or ``half.``, and a coordinate.
        """
        what, _, coordinate = name.partition(".")
        if what not in ("max", "min", "half") or coordinate not in self.system.coordinates:
            raise ModelError(
                f"a torus has no measure {name!r}; it has max, min and half of each coordinate, such as "
                f"'max.{self.system.coordinates[0]}'"
            )
        high, low = self._extremes[:, self.system.coordinates.index(coordinate)]
        return float({"max": high, "min": low, "half": 0.5 * (high - low)}[what])

    @cached_property
    def _extremes(self) -> NDArray[np.float64]:
        """Largest and least value of each coordinate, shape (2, n)."""
        positions = self.surface(_ANGLES)[:, :, : self.system.size]
        return np.array((positions.max(axis=(0, 1)), positions.min(axis=(0, 1))))

    def __repr__(self) -> str:
        state = "stable" if self.stable else f"unstable ({self.unstable})"
        curves = "one curve" if self.curves == 1 else f"{self.curves} curves"
        return (
            f"Torus({pace_text(self.system)}, {curves}, rotation number {self.rotation:.12g}, {state}, "
            f"error {self.error:.1g})"
        )


def relative_size(torus: Torus) -> float:
    """Return the size of a torus over that of its motion."""
    return torus.size / float(np.abs(torus.states / torus.system.state_scales()).max())


def reversed_torus(torus: Torus) -> Torus:
    """Return the same torus with the phase of its curve the other way round: the rotation number is 1 less the old."""
    places = -np.arange(torus.count) % torus.count
    return replace(torus, states=torus.states[places], rotation=1.0 - torus.rotation)


def error_of(system: System, curves: int, rotation: float, states: NDArray[np.float64]) -> float:
    """Return the largest distance between a curve and its image half-way between the samples; see `Torus.error`."""
    psi = phases(len(states)) + np.pi / len(states)
    strobe, unit = Strobe(system), system.state_scales()
    reached = np.array([strobe.arc(state, curves).state for state in at_phases(states, psi)])
    away = np.abs((reached - at_phases(states, psi + TURN * rotation)) / unit).max()
    return float(away / np.abs(states / unit).max())

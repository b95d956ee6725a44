"""Record of a torus: its curve, rotation number, error and stability."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lapack

from gapwalk.attractors.lyapunov import birkhoff_weights
from gapwalk.attractors.section import Strobe
from gapwalk.errors import ModelError
from gapwalk.flow.flow import PERIOD, flow_of
from gapwalk.model.coefficients import coefficients_of
from gapwalk.model.laws import Expression
from gapwalk.model.system import System, pace_text
from gapwalk.notebook import Shown

# Closed curves by trigonometric interpolation: an odd number of states at equally spaced phases.
#
# Sample j of a curve is its state at the phase ``2 pi j / N``. With an odd N every harmonic up to (N - 1)/2 has its
# sine and cosine, so that interpolation, rotation and differentiation are circulant matrices without an exception.

TURN = 2.0 * np.pi
"""One turn of the phase of a curve, in radians."""

_LAST = 0.25  # share of the harmonics, the highest, that count as the tail of a series


def phases(count: int) -> NDArray[np.float64]:
    """Return the phases of the samples of a curve, in radians; shape (count,)."""
    return TURN * np.arange(count) / count


def odd(count: int) -> int:
    """Return the smallest odd number that is not below `count`."""
    return count | 1


def rotation_matrices(count: int, turns: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the matrix that rotates the samples of a curve by a share of a turn, and its derivative by that share."""
    # The product of the matrix with the samples, shape (count, size), has the state at the phase ``psi_j + 2 pi turns``
    # in row j. Both matrices are circulant: entry (j, k) depends on j - k alone.
    harmonics = np.arange(1, count // 2 + 1)
    angles = np.outer(phases(count) + TURN * turns, harmonics)
    row = (1.0 + 2.0 * np.cos(angles).sum(axis=1)) / count
    slope = -2.0 * TURN * (np.sin(angles) @ harmonics) / count
    places = (np.arange(count)[:, None] - np.arange(count)) % count
    return row[places], slope[places]


def amplitudes(states: NDArray[np.float64]) -> NDArray[np.complex128]:
    """Return the complex amplitudes of the harmonics 0 to (N - 1)/2 of a curve, shape (harmonics, size)."""
    # The curve is ``u(psi) = Re sum_k a_k exp(i k psi)``.
    found = np.fft.rfft(states, axis=0) / len(states)
    found[1:] *= 2.0
    return found


def at_phases(states: NDArray[np.float64], psi: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the states of a curve at any phases, in radians; shape (len(psi), size)."""
    found = amplitudes(states)
    waves = np.exp(1j * np.outer(psi, np.arange(len(found))))
    return (waves @ found).real


def in_steps(states: NDArray[np.float64], step: float, first: int, count: int) -> NDArray[np.float64]:
    """Return the states of a curve at `count` successive multiples of a step of the phase, from `first` times it on."""
    # The shape is (count, size). Waves of such phases are products of those of few phases: place ``a`` in one of the
    # rows of `width` phases, and row ``b``.
    found = amplitudes(states)
    harmonics, width = np.arange(len(found)), math.isqrt(count - 1) + 1
    inside = np.exp(1j * np.outer(step * np.arange(width), harmonics))
    rows = np.exp(1j * np.outer(step * (first + width * np.arange(width)), harmonics))
    terms = (inside.T[:, :, None] * found[:, None, :]).reshape(len(found), -1)
    return (rows @ terms).real.reshape(width * width, -1)[:count]


def resampled(states: NDArray[np.float64], count: int) -> NDArray[np.float64]:
    """Return the same curve with another, odd number of samples."""
    return at_phases(states, phases(count))


def tangents(states: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the derivative of a curve by its phase at each sample, shape (N, size)."""
    found = amplitudes(states)
    found = 1j * np.arange(len(found))[:, None] * found
    found[1:] /= 2.0
    return np.fft.irfft(found * len(states), n=len(states), axis=0)


def tail(states: NDArray[np.float64]) -> float:
    """Return the size of the highest quarter of the harmonics, as a share of the largest harmonic from 1 on."""
    # Where it is not small the samples are too few, or the curve is not smooth.
    sizes = np.abs(amplitudes(states))[1:].max(axis=1)
    last = max(1, int(_LAST * len(sizes)))
    return float(sizes[-last:].max() / max(sizes.max(), np.finfo(float).tiny))


def of_quasi_periodic(
    samples: NDArray[np.float64], rotation: float, count: int, weights: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the closed curve on which a sequence of states rotates by a known share of a turn each time."""
    # The amplitude of harmonic k is the weighted average of ``samples[n] exp(-2 pi i k n rotation)``. With smooth
    # weights that vanish at both ends, it converges faster than any power of the number of samples (Das, Saiki, Sander
    # and Yorke 2017, Nonlinearity 30, 4111-4140), and the curve may have any shape.
    #
    # Shapes: `samples` (length, size); `weights` (length,).
    turns = TURN * rotation * np.arange(len(samples))
    found = np.array([(weights * np.exp(-1j * k * turns)) @ samples for k in range(count // 2 + 1)])
    found[1:] *= 2.0
    waves = np.exp(1j * np.outer(phases(count), np.arange(len(found))))
    return (waves @ found).real


# The force law of the coordinate that keeps the time of a second tone, and systems that have one.

CLOCK = "frequency*frequency*x + frequency*(x*x + (v/frequency)*(v/frequency) - 1)*v"
"""Force of the self-excited oscillator whose only stable motion is ``cos(frequency t)``."""


def has_tone(system: System) -> bool:
    """Return True if a system has a second tone: then its tori have a known rotation number, and nothing locks."""
    return any(form.law == Expression(CLOCK) for form in system.structure.contacts)


# Stability of a torus: the growth of small deviations from it, without the one along it.
#
# The transition matrix along the curve carries its tangent into the tangent at the rotated phase. In orthonormal
# frames whose first vector is the tangent it is block triangular, and the other diagonal block N(psi) carries
# deviations modulo the tangent. Exponents are averages of ``log R_ii`` of QR factors along ``N(psi + rho k)``. The
# factors converge to functions of the phase, so that smooth weights make the averages converge faster than any power
# of their number. Next to a resonance the phases repeat nearly and the averages converge slowly, so that their error
# is estimated and stated.

_SETTLING = 200  # returns until the frames have aligned
_AVERAGED = (600, 2400, 9600)  # returns over which the growth is averaged, until the error is small
_ENOUGH = 1e-7  # error of an exponent that is small
_LEAST = 1e-300  # growth below which a direction counts as lost at once
_SPREAD = 12.0  # logarithm of the largest ratio of growths in a product of returns that keeps 10 digits of the least
_BLOCKS = (8, 4, 2)  # returns whose product is factorised at once, if the growths in it differ no more


def normal_exponents(
    states: NDArray[np.float64], transitions: NDArray[np.float64], rotation: float, unit: NDArray[np.float64]
) -> tuple[NDArray[np.float64], float]:
    """Return the growth of deviations from a torus in one return to the curve, and the error of the largest."""
    # Shapes: `states` (N, size); `transitions` (N, size, size); `unit` (size,).
    count, size = states.shape
    scaled = (transitions * unit / unit[:, None]).reshape(count, -1)
    slopes = tangents(states / unit)
    frame, growth = np.eye(size - 1), np.zeros((0, size - 1))
    done, block, exponents, error = 0, 0, np.zeros(size - 1), np.inf
    for averaged in _AVERAGED:
        returns = _SETTLING + averaged - done
        along = in_steps(slopes, TURN * rotation, done, returns + 1)
        frames = _frames(along / np.linalg.norm(along, axis=1)[:, None])
        maps = in_steps(scaled, TURN * rotation, done, returns).reshape(-1, size, size)
        normal = (frames[1:].transpose(0, 2, 1) @ maps @ frames[:-1])[:, 1:, 1:]
        block, done = block or _block(normal), _SETTLING + averaged
        frame, grown = _carried(_products(normal, block), frame)
        growth = np.vstack((growth, grown))
        logarithms = np.log(np.maximum(growth[_SETTLING // block :], _LEAST)) / block
        half = birkhoff_weights(averaged // block // 2) @ logarithms[: averaged // block // 2]
        exponents = birkhoff_weights(averaged // block) @ logarithms
        error = float(abs(half.max() - exponents.max()))
        if error < _ENOUGH:
            break
    return np.sort(exponents)[::-1], error


def _block(matrices: NDArray[np.float64]) -> int:
    """Return how many successive matrices to multiply before their product is factorised."""
    sizes = np.linalg.svd(matrices[:_SETTLING], compute_uv=False)
    spread = float(np.log(sizes[:, 0] / np.maximum(sizes[:, -1], _LEAST)).max())
    return next((block for block in _BLOCKS if block * spread < _SPREAD), 1)


def _products(matrices: NDArray[np.float64], block: int) -> NDArray[np.float64]:
    """Return the products of each so many successive matrices, a power of two, the last one on the left."""
    while block > 1:
        matrices, block = matrices[1::2] @ matrices[::2], block // 2
    return matrices


def _carried(
    matrices: NDArray[np.float64], frame: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Carry a frame through matrices by QR factors; return it, and how far each of its vectors grew in each."""
    # LAPACK is called directly: ``numpy.linalg.qr`` takes eight times as long for matrices of this size.
    growth = np.empty(matrices.shape[:2])
    for place, matrix in enumerate(matrices):
        factors, scales, _, _ = lapack.dgeqrf(matrix.dot(frame))
        growth[place] = factors.diagonal()
        frame = lapack.dorgqr(factors, scales)[0]
    return frame, np.abs(growth)


def _frames(along: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return orthonormal frames whose first vector is a given unit vector, up to its sign, by Householder reflections.

    The shape is (k, size, size), with the vectors in columns.
    """
    size = along.shape[1]
    mirrors = along.copy()
    mirrors[:, 0] += np.where(along[:, 0] < 0.0, -1.0, 1.0)
    mirrors /= np.linalg.norm(mirrors, axis=1)[:, None]
    return np.eye(size) - 2.0 * mirrors[:, :, None] * mirrors[:, None, :]


_NEUTRAL = 1e-7  # growth per return to a curve below which a deviation counts as not growing
_CERTAIN = 3.0  # errors by which a growth must exceed zero
_RESOLVED = 5e-4  # largest error of a curve, as a share of its own size: with twice as much simulations show no torus
_ANGLES = 64  # angles of a forcing period at which measures are taken


@dataclass(frozen=True, eq=False)
class Torus(Shown):
    """Quasi-periodic motion: one of the m closed curves that its strobes visit in turn, and how they rotate on it.

    Notes
    -----
    See docs/numerics/notes/tori.md.
    """

    stuck = ()  # contacts whose friction never slips: systems with friction have no tori here

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
        """Return the state of the curve at a phase, in radians; shape (state_size,)."""
        return at_phases(self.states, np.array([psi]))[0]

    @cached_property
    def sections(self) -> tuple[NDArray[np.float64], ...]:
        """The m curves that the strobes visit in turn, each of shape (N, state_size)."""
        found, strobe = [self.states], Strobe(self.system)
        for _ in range(self.curves - 1):
            found.append(np.array([strobe.arc(state).state for state in found[-1]]))
        return tuple(found)

    def strobes(self, count: int) -> NDArray[np.float64]:
        """Return successive strobes of the motion from phase 0, without integration; shape (count, state_size)."""
        steps = np.arange(count)
        turns = TURN * self.rotation * (steps // self.curves).astype(np.float64)
        found = np.empty((count, self.states.shape[1]))
        for place, curve in enumerate(self.sections):
            mine = steps % self.curves == place
            found[mine] = at_phases(curve, turns[mine])
        return found

    def surface(self, samples: int = 32) -> NDArray[np.float64]:
        """Return the states of the torus over one forcing period of each curve."""
        # The shape is ``(m * samples + 1, N + 1, state_size)``: over the angle of the excitation, then over the phase.
        # Both ends of the phase are the same; the last angle is the first curve again, rotated.
        thetas = np.linspace(0.0, PERIOD * self.curves, samples * self.curves + 1)
        flow, coefficients = flow_of(self.system), coefficients_of(self.system)
        found = np.array([flow.sample(coefficients, state, thetas).states for state in self.states])
        return np.concatenate((found, found[:1])).transpose(1, 0, 2)

    def measure(self, name: str) -> float:
        """Return ``max.``, ``min.`` or ``half.`` (half the difference) of a coordinate over the torus, as ``max.q1``.

        They are taken at 64 angles of each forcing period and at all N phases.
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

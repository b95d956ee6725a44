"""Whether a motion is on its way into a stable orbit: seen by the return map about it, not by waiting.

Near a flip, a fold or a Neimark-Sacker point a motion may need 10^5 periods to come to rest on its attractor. It need
not be followed that far: where several returns in a row do what the linearised return map of a stable orbit says, up to
a fraction, and the distance shrinks in every mode, it will arrive.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.attractor.strobe import Strobe, size_of
from gapwalk.errors import ConvergenceError, FlowError
from gapwalk.model.system import System
from gapwalk.orbit.find import find_orbit
from gapwalk.orbit.identity import stroboscopic, true_period
from gapwalk.orbit.newton import Newton
from gapwalk.orbit.orbit import Orbit
from gapwalk.orbit.shooting import ShootingEquation

_RETURNS = 8  # returns that are watched
_LINEAR = 0.2  # how far a return may differ from the linear one, relative to the distance from the orbit
_SHARE = 0.5  # the least share of the linear rate at which modes must shrink, or grow
_SLAVED = 0.05  # share of the distance below which a mode is not judged: it may follow the square of the slowest one
_ARRIVED = 1e-9  # distance from the orbit, relative to the motion, below which a motion has arrived
_NEUTRAL = 1e-9  # distance of a multiplier from the unit circle below which it decides nothing
_UNSTABLE = 1.0 + 1e-7  # the least multiplier that repels: without damping it is 1 but for rounding
_LEAVING = 0.05  # distance, relative to the motion, below which it may be leaving an unstable orbit
_GROWTH = 1.05  # of a deviation, over which that is watched
_MOST = 3000  # forcing periods for which it is watched at most
_PUSHED = 0.02  # distance to which it is pushed off, relative to the motion
_NEAR = 0.2  # distance, relative to the motion, within which an orbit is worth a look
_NEWTON = Newton(iterations=8, halvings=1)


@dataclass(frozen=True, eq=False, slots=True)
class Approach:
    """An orbit near a motion, and what the motion does there.

    Attributes
    ----------
    orbit
        The orbit, of its smallest period; its state is the one next to the motion.
    converging
        Whether the orbit is stable and the motion comes to rest on it, or is on it already.
    leaving
        Whether the orbit is unstable and the motion is so near that it leaves as the linearised return map says, which
        may take for ever.
    distance
        Of the motion from the orbit, relative to the size of the motion.
    strobes : shape (periods, 2n)
        The motion while it was watched, a forcing period apart; perhaps none.
    """

    orbit: Orbit
    converging: bool
    leaving: bool
    distance: float
    strobes: NDArray[np.float64]


def nearby_orbit(strobe: Strobe, state: NDArray[np.float64], period: int, least: float) -> Orbit | None:
    """The orbit that Newton's method finds from a state, of its smallest period; None if there is none nearby.

    `least` is the smallest size of a motion, as by `size_of`: a state of rest has none of its own.
    """
    try:
        if not _steps_nearby(strobe.system, state, period, least):
            return None
        orbit = find_orbit(strobe.system, period, state, newton=_NEWTON)
    except (ConvergenceError, FlowError):
        return None
    if np.abs((orbit.state - state) / _scale(orbit, least)).max() > _NEAR:
        return None
    smallest = true_period(orbit)
    if smallest == period:
        return orbit
    try:
        return find_orbit(strobe.system, smallest, orbit.state, newton=_NEWTON)
    except (ConvergenceError, FlowError):
        return None


def _scale(orbit: Orbit, least: float) -> NDArray[np.float64]:
    return size_of(orbit.system, stroboscopic(orbit), least)


def _steps_nearby(system: System, state: NDArray[np.float64], period: int, least: float) -> bool:
    """Whether the first step of Newton's method stays near: on a torus or in chaos most lead nowhere, and far."""
    equation = ShootingEquation(system, None, period)
    evaluation = equation.evaluate(state, 0.0)
    step = np.linalg.lstsq(evaluation.by_unknowns, -evaluation.residual, rcond=1e-14)[0]
    return bool(np.abs(step / size_of(system, state, least)).max() <= _NEAR)


def watch(strobe: Strobe, state: NDArray[np.float64], orbit: Orbit, least: float) -> Approach:
    """Follow a motion over several returns beside an orbit, and judge whether it comes to rest there, or leaves."""
    scale = _scale(orbit, least)
    distance = float(np.abs((state - orbit.state) / scale).max())
    rate, none = float(np.abs(orbit.multipliers).max()), np.empty((0, len(state)))
    if distance <= _ARRIVED:  # without damping an orbit may be neutral, and a motion that is on it stays there
        return Approach(orbit, rate <= 1.0 + _NEUTRAL, rate > _UNSTABLE, distance, none)
    unstable = rate > _UNSTABLE
    if abs(rate - 1.0) <= _NEUTRAL or (unstable and distance > _LEAVING):
        return Approach(orbit, False, False, distance, none)
    modes = _Modes.of(orbit, scale)
    followed = strobe.run(state, _RETURNS * orbit.period)
    track = _returns(orbit, state, followed) / scale
    linear = modes.are_linear(track)
    if unstable and linear:  # followed until its growth is seen beside all else that the motion does
        returns = int(np.clip(np.log(_GROWTH) / np.log(rate), _RETURNS, _MOST // orbit.period))
        followed = np.vstack((followed, strobe.run(followed[-1], (returns - _RETURNS) * orbit.period)))
        track = _returns(orbit, state, followed) / scale
    distance = float(np.abs(track[-1]).max())
    converging = linear and not unstable and modes.shrink(track)
    return Approach(orbit, converging, linear and unstable and modes.grow(track), distance, followed)


def _returns(orbit: Orbit, state: NDArray[np.float64], followed: NDArray[np.float64]) -> NDArray[np.float64]:
    """Deviations from an orbit at each return, of a state and the strobes that follow it."""
    return np.vstack((state, followed[orbit.period - 1 :: orbit.period])) - orbit.state


def pushed_off(orbit: Orbit, state: NDArray[np.float64], least: float) -> NDArray[np.float64]:
    """A state farther from an unstable orbit, in the unstable directions in which the motion leaves it already."""
    scale = _scale(orbit, least)
    modes = _Modes.of(orbit, scale)
    outside = np.abs(modes.values) > 1.0
    parts = np.where(outside, modes.sizes((state - orbit.state) / scale), 0.0)
    if np.abs(parts).max() <= _ARRIVED:  # it sits there: any unstable direction will do
        parts = np.where(outside, 1.0, 0.0)
    away = np.real(modes.vectors @ parts)
    return orbit.state + scale * away * (_PUSHED / np.abs(away).max())


class _Modes(NamedTuple):
    """Eigenvalues and eigenvectors of the linearised return map of an orbit, in scaled deviations from it."""

    values: NDArray[np.complex128]
    vectors: NDArray[np.complex128]
    inverse: NDArray[Any]

    @classmethod
    def of(cls, orbit: Orbit, scale: NDArray[np.float64]) -> _Modes:
        values, vectors = np.linalg.eig((_monodromy(orbit) * scale / scale[:, None]).astype(complex))
        return cls(values, vectors, np.linalg.pinv(vectors))

    def sizes(self, deviations: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Size of each mode in deviations, shape (..., 2n)."""
        return deviations.astype(np.complex128) @ self.inverse.T

    def are_linear(self, track: NDArray[np.float64]) -> bool:
        """Whether each deviation is what the linear return map makes of the one before, but for a fraction of it."""
        modes = self.sizes(track)
        errors = np.linalg.norm(modes[1:] - modes[:-1] * self.values, axis=1)
        return bool(np.all(errors <= _LINEAR * np.linalg.norm(modes[:-1], axis=1) + self._floor))

    def shrink(self, track: NDArray[np.float64]) -> bool:
        """Whether every mode that counts shrinks at half the slowest linear rate at least."""
        first, last = np.abs(self.sizes(track[[0, -1]]))
        wanted = float(np.abs(self.values).max()) ** (_SHARE * (len(track) - 1))
        return bool(np.all(last <= np.maximum(wanted * first, _SLAVED * np.linalg.norm(last)) + self._floor))

    def grow(self, track: NDArray[np.float64]) -> bool:
        """Whether the unstable modes grow at half the linear rate at least."""
        outside = np.abs(self.values) > 1.0
        first, last = np.linalg.norm(self.sizes(track[[0, -1]])[:, outside], axis=1)
        wanted = float(np.abs(self.values).max()) ** (_SHARE * (len(track) - 1))
        return bool(last >= wanted * first)

    @property
    def _floor(self) -> float:
        return _ARRIVED * max(1.0, float(np.abs(self.inverse).max()))


def _monodromy(orbit: Orbit) -> NDArray[np.float64]:
    transition = Strobe(orbit.system, transition=True).arc(orbit.state, orbit.period).transition
    assert transition is not None
    return transition

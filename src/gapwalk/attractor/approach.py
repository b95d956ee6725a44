"""Whether a motion is on its way into a stable orbit: seen by the return map about it, not by waiting.

Near a flip, a fold or a Neimark-Sacker point a motion may need 10^5 periods to come to rest on its attractor. It need
not be followed that far: where several returns in a row do what the linearised return map of a stable orbit says, up to
a fraction, and the distance shrinks in every mode, it will arrive.
"""

from __future__ import annotations

from dataclasses import dataclass

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
_SHRINKS = 0.5  # the least share of the slowest linear rate at which each mode must shrink
_SLAVED = 0.05  # share of the distance below which a mode is not judged: it may follow the square of the slowest one
_ARRIVED = 1e-9  # distance from the orbit, relative to the motion, below which a motion has arrived
_NEUTRAL = 1e-9  # distance of a multiplier from the unit circle below which it decides nothing
_NEAR = 0.2  # distance, relative to the motion, within which an orbit is worth a look
_NEWTON = Newton(iterations=8, halvings=1)


@dataclass(frozen=True, slots=True)
class Approach:
    """An orbit near a motion, and what the motion does there.

    Attributes
    ----------
    orbit
        The orbit, of its smallest period; its state is the one next to the motion.
    converging
        Whether the orbit is stable and the motion comes to rest on it, or is on it already.
    distance
        Of the motion from the orbit, relative to the size of the motion.
    state : shape (2n,)
        Where the motion has come to while it was watched.
    periods
        Forcing periods it was watched for.
    """

    orbit: Orbit
    converging: bool
    distance: float
    state: NDArray[np.float64]
    periods: int


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
    """Follow a motion over several returns beside an orbit, and judge whether it comes to rest there."""
    scale = _scale(orbit, least)
    distance = float(np.abs((state - orbit.state) / scale).max())
    rate = float(np.abs(orbit.multipliers).max())
    if distance <= _ARRIVED:  # without damping an orbit may be neutral, and a motion that is on it stays there
        return Approach(orbit, rate <= 1.0 + _NEUTRAL, distance, state, 0)
    if rate >= 1.0 - _NEUTRAL:
        return Approach(orbit, False, distance, state, 0)
    followed = strobe.run(state, _RETURNS, orbit.period)
    track = np.vstack((state, followed))
    converging = _contracts(_monodromy(orbit), (track - orbit.state) / scale, scale)
    distance = float(np.abs((track[-1] - orbit.state) / scale).max())
    return Approach(orbit, converging, distance, track[-1], _RETURNS * orbit.period)


def _monodromy(orbit: Orbit) -> NDArray[np.float64]:
    transition = Strobe(orbit.system, transition=True).arc(orbit.state, orbit.period).transition
    assert transition is not None
    return transition


def _contracts(monodromy: NDArray[np.float64], track: NDArray[np.float64], scale: NDArray[np.float64]) -> bool:
    """Whether scaled deviations from an orbit follow its linear return map, and shrink in every mode."""
    values, vectors = np.linalg.eig(monodromy * scale / scale[:, None])
    modes = np.linalg.lstsq(vectors, track.T.astype(complex), rcond=None)[0].T
    floor = _ARRIVED * max(1.0, float(np.abs(np.linalg.pinv(vectors)).max()))
    sizes = np.linalg.norm(modes, axis=1)
    errors = np.linalg.norm(modes[1:] - modes[:-1] * values, axis=1)
    if np.any(errors > _LINEAR * sizes[:-1] + floor):
        return False
    wanted = float(np.abs(values).max()) ** (_SHRINKS * (len(track) - 1))
    return bool(np.all(np.abs(modes[-1]) <= np.maximum(wanted * np.abs(modes[0]), _SLAVED * sizes[-1]) + floor))

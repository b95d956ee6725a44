"""Regions around a stable orbit from which every motion converges to it, so that it need not be followed to its end.

The linearised return map A of a stable orbit has a norm in which it is a contraction, ``|x|^2 = x' P x`` with
``A' P A / g^2 - P + I = 0`` for any g above the largest multiplier (Lyapunov's equation). The ellipsoids of that norm
are tested from large to small on the exact flow. The trapping region is the first one for which random points of its
surface, and of smaller ones inside, all return to a smaller ellipsoid. The return map is one-to-one and continuous, so
points inside the surface stay inside.

Near a flip, a fold or a Neimark-Sacker point a motion may need 10^5 periods to reach its attractor. `watch` does not
follow it that far: if several returns in a row agree with the linearised return map of a nearby stable orbit, except
for a given fraction, and the distance shrinks in every mode, the motion will reach the orbit.

Method: docs/numerics/basins.md
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from gapwalk.attractors.section import Strobe, size_of
from gapwalk.errors import ConvergenceError, FlowError
from gapwalk.model.coefficients import coefficients_of, layout_of
from gapwalk.model.system import System
from gapwalk.orbit.find import find_orbit
from gapwalk.orbit.orbit import Orbit, stroboscopic, true_period
from gapwalk.orbit.orbit_equation import Newton
from gapwalk.orbit.shooting import ShootingEquation
from gapwalk.orbit.sticking import released, transition_of

_POINTS = 48  # points on each surface
_SHELLS = np.array([1.0, 0.5, 0.25])
_LARGEST, _SMALLEST = 0.5, 1e-5  # half the size of a trapping region, relative to that of the motion
_SEED = 1995
_NEUTRAL = 1e-9  # distance of a multiplier from the unit circle below which the linear map decides nothing
_RETURNS = 8  # number of returns that are compared with the linear map
_LINEAR = 0.2  # largest difference between a return and the linear one, relative to the distance from the orbit
_SHARE = 0.5  # smallest fraction of the linear rate at which modes must shrink, or grow
_SLAVED = 0.05  # fraction of the distance below which a mode is ignored: it may follow the square of the slowest one
_ARRIVED = 1e-9  # distance from the orbit, relative to the motion, below which a motion has arrived
_UNDECIDED = 1e-9  # distance of a multiplier from the unit circle below which it decides nothing
_UNSTABLE = 1.0 + 1e-7  # smallest unstable multiplier: without damping a multiplier is 1 except for rounding
_LEAVING = 0.05  # distance, relative to the motion, below which a motion may be leaving an unstable orbit
_GROWTH = 1.05  # factor by which a deviation must grow before the growth is judged
_MOST = 3000  # most forcing periods for which that growth is followed
_PUSHED = 0.02  # distance to which a motion is displaced from an unstable orbit, relative to the motion
_NEAR = 0.2  # distance, relative to the motion, within which an orbit is examined
_NEWTON = Newton(iterations=8, halvings=1)


@dataclass(frozen=True, eq=False)
class TrappingRegion:
    """Ellipsoids about the m strobes of a stable orbit."""

    strobes: NDArray[np.float64]  #: shape (m, state_size): The states of the orbit, one forcing period apart.
    #: shape (m, state_size, state_size): A state x is inside the ellipsoid about strobe j where ``|shapes[j] @ (x -
    #: strobes[j])| <= 1``.
    shapes: NDArray[np.float64]

    def holds(self, states: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Mark the states that are inside, shape (count,); states that are not finite are outside."""
        inside = np.zeros(len(states), dtype=bool)
        for strobe, shape in zip(self.strobes, self.shapes, strict=True):
            with np.errstate(over="ignore", invalid="ignore"):  # motions that diverge
                inside |= np.square((states - strobe) @ shape.T).sum(axis=1) <= 1.0
        return inside


@dataclass(frozen=True, eq=False, slots=True)
class Approach:
    """An orbit near a motion, and the behaviour of the motion next to it."""

    orbit: Orbit  #: The orbit, of its smallest period; its state is the one next to the motion.
    converging: bool  #: True if the orbit is stable and the motion converges to it or has reached it.
    #: True if the orbit is unstable and the motion leaves it as the linearised return map predicts. So near to the
    #: orbit this may take arbitrarily long.
    leaving: bool
    distance: float  #: Distance of the motion from the orbit, relative to the size of the motion.
    #: shape (periods, state_size): Strobes of the motion while it was compared with the orbit, one forcing period
    #: apart; may be empty.
    strobes: NDArray[np.float64]


def trapping_region_of(orbit: Orbit) -> TrappingRegion | None:
    """Build the trapping region of an orbit; None if it is not stable, or so weakly that no useful region was found.

    An orbit with friction that never slips has none, since it is one of a continuum: motions nearby reach others of it.
    """
    if orbit.stuck or np.abs(orbit.free_multipliers).max() >= 1.0 - _NEUTRAL:
        return None
    builder = _Builder(orbit)
    first = builder.first_shape()
    if first is None:
        return None
    shapes = [first]
    for phase in range(1, orbit.period):
        shape = builder.shape_before(phase, first)
        if shape is None:
            return None
        shapes.append(shape)
    return TrappingRegion(builder.strobes, np.array(shapes))


class _Builder:
    """Computation of the ellipsoids of one orbit."""

    def __init__(self, orbit: Orbit) -> None:
        self.period = orbit.period
        self.flow = Strobe(orbit.system)
        with_matrix = Strobe(orbit.system, transition=True)
        strobes, matrices = [orbit.state], []
        for _ in range(orbit.period):
            arc = with_matrix.arc(strobes[-1])
            assert arc.transition is not None
            matrices.append(arc.transition)
            strobes.append(arc.state)
        self.strobes = np.array(strobes[:-1])
        self.matrices = matrices
        self.scale = size_of(orbit.system, self.strobes)
        self.rate = 0.5 * (1.0 + float(np.abs(orbit.free_multipliers).max()))
        random = np.random.default_rng(_SEED)
        directions = random.normal(size=(_POINTS, len(orbit.state)))
        self.directions = directions / np.linalg.norm(directions, axis=1)[:, None]

    def first_shape(self) -> NDArray[np.float64] | None:
        """Return the largest ellipsoid about the first strobe that the return map contracts."""
        limit = 0.5 * (1.0 + self.rate)

        def shrinks(shape: NDArray[np.float64]) -> bool:
            return all(
                self._distance(shape, 0, state, self.period) <= limit * shell
                for shell, state in self._surfaces(shape, 0)
            )

        return self._largest(0, shrinks)

    def shape_before(self, phase: int, first: NDArray[np.float64]) -> NDArray[np.float64] | None:
        """Return the largest ellipsoid about another strobe from which all motions reach the one about the first."""

        def arrives(shape: NDArray[np.float64]) -> bool:
            rest = self.period - phase
            return all(self._distance(first, 0, state, rest) <= 1.0 for _, state in self._surfaces(shape, phase))

        return self._largest(phase, arrives)

    def _largest(self, phase: int, is_good) -> NDArray[np.float64] | None:
        """Return the largest accepted ellipsoid of the norm at a strobe; each is half as large as the one before."""
        root = self._root(phase)
        size = _LARGEST
        while size >= _SMALLEST:
            shape = root / size
            if is_good(shape):
                return shape
            size /= 2.0
        return None

    def _root(self, phase: int) -> NDArray[np.float64]:
        """Return a root of P, scaled so that the ellipsoid is as wide as the motion in its widest direction."""
        product = np.eye(len(self.scale))
        for step in range(self.period):
            product = self.matrices[(phase + step) % self.period] @ product
        scaled = product * self.scale / self.scale[:, None] / self.rate
        norm = scipy.linalg.solve_discrete_lyapunov(scaled.T, np.eye(len(self.scale)))
        values, vectors = np.linalg.eigh(norm)
        return np.sqrt(values / values[0])[:, None] * vectors.T / self.scale

    def _surfaces(self, shape: NDArray[np.float64], phase: int):
        """Yield points of an ellipsoid's surface and of smaller ones inside, largest first, with the relative size."""
        offsets = np.linalg.solve(shape, self.directions.T).T
        for shell in _SHELLS:
            for offset in offsets:
                yield shell, self.strobes[phase] + shell * offset

    def _distance(self, shape: NDArray[np.float64], phase: int, state: NDArray[np.float64], periods: int) -> float:
        try:
            end = self.flow.arc(state, periods).state
        except FlowError:
            return np.inf
        return float(np.linalg.norm(shape @ (end - self.strobes[phase])))


def nearby_orbit(strobe: Strobe, state: NDArray[np.float64], period: int, least: float) -> Orbit | None:
    """Find the orbit near a state by Newton's method, reduced to its smallest period; None if there is none nearby.

    `least` is the smallest size of a motion, as in `size_of`: a static equilibrium has the size 0.
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


def _steps_nearby(system: System, state: NDArray[np.float64], period: int, least: float) -> bool:
    """Return True if the first Newton step is short: on a torus or in chaos most steps are long and find no orbit."""
    equation = ShootingEquation(system, None, period)
    evaluation = equation.evaluate(state, 0.0)
    step = np.linalg.lstsq(evaluation.by_unknowns, -evaluation.residual, rcond=1e-14)[0]
    return bool(np.abs(step / size_of(system, state, least)).max() <= _NEAR)


def _scale(orbit: Orbit, least: float) -> NDArray[np.float64]:
    return size_of(orbit.system, stroboscopic(orbit), least)


def watch(strobe: Strobe, state: NDArray[np.float64], orbit: Orbit, least: float) -> Approach:
    """Follow a motion over several returns near an orbit; report whether it converges to the orbit or leaves it."""
    scale = _scale(orbit, least)
    distance = float(np.abs((state - orbit.state) / scale).max())
    rate, none = float(np.abs(orbit.free_multipliers).max()), np.empty((0, len(state)))
    if distance <= _ARRIVED:  # without damping the orbit may be neutral; a motion that is on it stays on it
        return Approach(orbit, rate <= 1.0 + _UNDECIDED, rate > _UNSTABLE, distance, none)
    unstable = rate > _UNSTABLE
    if abs(rate - 1.0) <= _UNDECIDED or (unstable and distance > _LEAVING):
        return Approach(orbit, False, False, distance, none)
    modes = _Modes.of(orbit, scale)
    followed = strobe.run(state, _RETURNS * orbit.period)
    track = _returns(orbit, state, followed) / scale
    linear = modes.are_linear(track)
    if unstable and linear:  # follow it until the growth exceeds the other parts of the motion
        returns = int(np.clip(np.log(_GROWTH) / np.log(rate), _RETURNS, _MOST // orbit.period))
        followed = np.vstack((followed, strobe.run(followed[-1], (returns - _RETURNS) * orbit.period)))
        track = _returns(orbit, state, followed) / scale
    distance = float(np.abs(track[-1]).max())
    converging = linear and not unstable and modes.shrink(track)
    return Approach(orbit, converging, linear and unstable and modes.grow(track), distance, followed)


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
        """Return the components of deviations, shape (..., state_size), in the modes."""
        return deviations.astype(np.complex128) @ self.inverse.T

    def are_linear(self, track: NDArray[np.float64]) -> bool:
        """Return True if each deviation agrees with the linear map of the one before, except for a given fraction."""
        modes = self.sizes(track)
        errors = np.linalg.norm(modes[1:] - modes[:-1] * self.values, axis=1)
        return bool(np.all(errors <= _LINEAR * np.linalg.norm(modes[:-1], axis=1) + self._floor))

    def shrink(self, track: NDArray[np.float64]) -> bool:
        """Return True if every significant mode shrinks at half the slowest linear rate or faster."""
        first, last = np.abs(self.sizes(track[[0, -1]]))
        wanted = float(np.abs(self.values).max()) ** (_SHARE * (len(track) - 1))
        return bool(np.all(last <= np.maximum(wanted * first, _SLAVED * np.linalg.norm(last)) + self._floor))

    def grow(self, track: NDArray[np.float64]) -> bool:
        """Return True if the unstable modes grow at half the linear rate or faster."""
        outside = np.abs(self.values) > 1.0
        first, last = np.linalg.norm(self.sizes(track[[0, -1]])[:, outside], axis=1)
        wanted = float(np.abs(self.values).max()) ** (_SHARE * (len(track) - 1))
        return bool(last >= wanted * first)

    @property
    def _floor(self) -> float:
        return _ARRIVED * max(1.0, float(np.abs(self.inverse).max()))


def _monodromy(orbit: Orbit) -> NDArray[np.float64]:
    arc = Strobe(orbit.system, transition=True).arc(orbit.state, orbit.period)
    layout, coefficients = layout_of(orbit.system.structure), coefficients_of(orbit.system)
    return transition_of(released(layout, coefficients, [arc], orbit.state)[0])


def _returns(orbit: Orbit, state: NDArray[np.float64], followed: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the deviations of a state and of the strobes that follow it from an orbit, at each return."""
    return np.vstack((state, followed[orbit.period - 1 :: orbit.period])) - orbit.state


def pushed_off(orbit: Orbit, state: NDArray[np.float64], least: float) -> NDArray[np.float64]:
    """Displace a state farther from an unstable orbit, along the unstable directions in which it already moves away."""
    scale = _scale(orbit, least)
    modes = _Modes.of(orbit, scale)
    outside = np.abs(modes.values) > 1.0
    parts = np.where(outside, modes.sizes((state - orbit.state) / scale), 0.0)
    if np.abs(parts).max() <= _ARRIVED:  # the state is on the orbit: use all unstable directions
        parts = np.where(outside, 1.0, 0.0)
    away = np.real(modes.vectors @ parts)
    return orbit.state + scale * away * (_PUSHED / np.abs(away).max())

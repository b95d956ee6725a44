"""Settling: follow a transient just long enough to decide to which motion it leads.

The numbers of forcing periods after which a motion nearly returns are candidates for its period. A motion that is not
periodic has settled if averages over it no longer change.

Method: docs/numerics/notes/ensembles.md
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import Annotated, Any, NamedTuple

import numpy as np
from annotated_types import Ge, Gt, Le
from numpy.typing import NDArray

from gapwalk.attractors.lane_settling import Start, settle_lanes
from gapwalk.attractors.lyapunov import (
    Lyapunov,
    LyapunovOptions,
    birkhoff_mean,
    birkhoff_spread,
    lyapunov_run,
    of_multipliers,
)
from gapwalk.attractors.rotation import Rotation, rotation
from gapwalk.attractors.section import Section, Strobe, points_of, size_of, strobe, strobed
from gapwalk.ensemble.lanes import Lanes, prefers_lanes
from gapwalk.errors import ConvergenceError, FlowError
from gapwalk.flow.motion import Motion, integrate
from gapwalk.late_scipy import linalg
from gapwalk.model.bounds import Bounded, Counted
from gapwalk.model.coefficients import coefficients_of, layout_of
from gapwalk.model.drivetrain.train_assembly import steadied
from gapwalk.model.system import System, check_system, pace_text
from gapwalk.notebook import Shown
from gapwalk.orbit.find import find_orbit, initial_state
from gapwalk.orbit.orbit import Orbit, stroboscopic, true_period
from gapwalk.orbit.orbit_equation import Newton
from gapwalk.orbit.shooting import ShootingEquation
from gapwalk.orbit.sticking import kept_words, released, transition_of
from gapwalk.pieces import tell_stage

# Regions around a stable orbit from which every motion converges to it, so that it need not be followed to its end.
#
# The linearised return map A of a stable orbit has a norm in which it is a contraction, ``|x|^2 = x' P x`` with ``A' P
# A / g^2 - P + I = 0`` for any g above the largest multiplier (Lyapunov's equation). The ellipsoids of that norm are
# tested from large to small on the exact flow. The trapping region is the first one for which random points of its
# surface, and of smaller ones inside, all return to a smaller ellipsoid. The return map is one-to-one and continuous,
# so points inside the surface stay inside.
#
# Near a flip, a fold or a Neimark-Sacker point a motion may need 10^5 periods to reach its attractor. `watch` does not
# follow it that far: if several returns in a row agree with the linearised return map of a nearby stable orbit, except
# for a given fraction, and the distance shrinks in every mode, the motion will reach the orbit.
#
# Method: docs/numerics/notes/ensembles.md

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
        for middle, shape in zip(self.strobes, self.shapes, strict=True):
            with np.errstate(over="ignore", invalid="ignore"):  # motions that diverge
                inside |= np.square((states - middle) @ shape.T).sum(axis=1) <= 1.0
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
    """Build the trapping region of an orbit; None if it is not stable, or so weakly that no useful region was found."""
    # An orbit with friction that never slips has none, since it is one of a continuum: motions nearby reach others of
    # it.
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
        norm = linalg.solve_discrete_lyapunov(scaled.T, np.eye(len(self.scale)))
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
    """Find the orbit near a state by Newton's method, reduced to its smallest period; None if there is none nearby."""
    # `least` is the smallest size of a motion, as in `size_of`: a static equilibrium has the size 0.
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


# Records of settled motions: an attractor of any kind with the evidence for it, and the transient that led to it.


@dataclass(frozen=True, eq=False)
class Attractor(Shown):
    """A motion on which others settle."""

    kind: AttractorKind  #: Kind of motion: periodic, quasi-periodic, chaotic, or undecided.
    system: System  #: The system that moves.
    #: Period m of a periodic motion; number of closed curves, visited in turn, of a quasi-periodic one; otherwise 0.
    period: int
    #: shape (count, state_size): States at theta = 0, one forcing period apart: all m of an orbit, or a sample of
    #: another motion.
    strobes: NDArray[np.float64]
    orbit: Orbit | None  #: The orbit of a periodic motion; otherwise None.
    lyapunov: Lyapunov | None  #: The Lyapunov exponents; those of an orbit follow from its multipliers.
    rotation: Rotation | None  #: The rotation number of a quasi-periodic motion.
    evidence: tuple[str, ...]  #: The evidence for the kind, in sentences.

    def _check_read(self) -> None:
        """Raise a ValueError if its parts do not fit together."""
        if self.strobes.ndim != 2 or self.strobes.shape[1] != self.system.state_size or not len(self.strobes):
            raise ValueError(f"strobes of shape {self.strobes.shape} do not belong to this system")

    @property
    def state(self) -> NDArray[np.float64]:
        """A state of the motion at theta = 0, shape (state_size,)."""
        return self.strobes[0]

    @property
    def multipliers(self) -> NDArray[np.complex128] | None:
        """Floquet multipliers of an orbit, largest modulus first; None for any other motion."""
        return None if self.orbit is None else self.orbit.multipliers

    @property
    def label(self) -> str:
        """A short name: ``P3``, ``torus`` (``3 x torus`` if it surrounds an orbit of period 3), ``chaos`` or ``?``."""
        match self.kind:
            case AttractorKind.PERIODIC:
                return f"P{self.period}"
            case AttractorKind.QUASI_PERIODIC:
                return "torus" if self.period <= 1 else f"{self.period} x torus"
            case AttractorKind.CHAOTIC:
                return "chaos"
            case AttractorKind.UNDECIDED:
                return "?"

    def __repr__(self) -> str:
        details = [self.label, pace_text(self.system)]
        if self.rotation is not None:
            details.append(f"rotation number {self.rotation.number:.9g}")
        if self.lyapunov is not None:
            details.append(f"largest exponent {self.lyapunov.exponents[0]:.4g} +- {self.lyapunov.errors[0]:.1g}")
        return f"Attractor({self.kind.value}: {', '.join(details)})"


class AttractorKind(StrEnum):
    """The kind of motion on an attractor."""

    PERIODIC = "periodic"
    QUASI_PERIODIC = "quasi-periodic"
    CHAOTIC = "chaotic"
    UNDECIDED = "undecided"


@dataclass(frozen=True, eq=False)
class Settled(Shown):
    """A motion after its transient."""

    system: System  #: The system that moves.
    #: shape (count, state_size): The last states of the transient at theta = 0, one forcing period apart; positions,
    #: then velocities.
    strobes: NDArray[np.float64]
    periods: int  #: Length of the transient in forcing periods.
    converged: bool  #: True if the motion has settled; if not, `evidence` gives the reason.
    #: The stable orbit to which the motion converges, refined by Newton's method; None if the motion is not periodic.
    orbit: Orbit | None
    #: Distance from the orbit when it was recognised, or drift of the motion's averages between the last two windows;
    #: relative to the size of the motion.
    residual: float
    evidence: tuple[str, ...]  #: The evidence for the decision, in sentences.

    def _check_read(self) -> None:
        """Raise a ValueError if its parts do not fit together."""
        if self.strobes.ndim != 2 or self.strobes.shape[1] != self.system.state_size or not len(self.strobes):
            raise ValueError(f"strobes of shape {self.strobes.shape} do not belong to this system")

    @property
    def period(self) -> int | None:
        """Period m in forcing periods; None if the motion is not periodic."""
        return self.orbit.period if self.orbit is not None else None

    @property
    def state(self) -> NDArray[np.float64]:
        """A state of the settled motion at theta = 0, shape (state_size,); a state of the orbit if there is one."""
        return self.orbit.state if self.orbit is not None else self.strobes[-1]

    def motion(self, periods: int | None = None, samples: int = 256) -> Motion:
        """Return the settled motion, sampled, with its contact events and force-deflection loops."""
        # By default it has as many forcing periods as the orbit, or 64.
        return integrate(self.system, self.state, periods or self.period or 64, samples)

    def section(self, phase: float = 0.0) -> Section:
        """Return the stroboscopic section: of an orbit its points, of other motions states that are known, or more."""
        points = self.period or points_of(self.system)
        if phase == 0.0 and len(self.strobes) >= points > 1 and self.orbit is None:
            return strobed(self.system, self.strobes[-points:])
        return strobe(self.system, self.state, points, phase)

    def __repr__(self) -> str:
        what = f"period {self.period}" if self.period else "not periodic"
        done = "settled" if self.converged else "not settled"
        return (
            f"Settled({what}, {done} after {self.periods} forcing periods at {pace_text(self.system)}, "
            f"residual {self.residual:.2g})"
        )


# The judge of settled motions: it decides from strobes whether a motion has settled, and which period it has.
#
# Transients of single motions, sweeps and regime maps ask this one judge. A motion settles on an orbit if its returns
# after m forcing periods shrink like a geometric series whose sum is small. Any other motion has settled if its
# nearest returns neither shrink nor grow, and its averages no longer change.
#
# Method: docs/numerics/notes/ensembles.md


@dataclass(frozen=True)
class Tolerances:
    """Tolerances of the judge. Distances are relative to the unit of the strobes, such as the size of the motion."""

    #: Distance still to go, below which a motion counts as periodic; the strobes of a settled motion repeat within it.
    #: It is the error of the batch integrator, and below what a figure shows.
    arrived: float = 1e-4
    #: Change over one return, below which that return may give the period. A chaotic motion that passes an unstable
    #: orbit shrinks towards it for a while; it seldom comes so near.
    returned: float = 1e-6
    rounding: float = 1e-11  #: Change over one return, below which only rounding is left; the flow repeats to 1e-13.
    #: Ratio by which all shorter returns must exceed the distance still to go, or else the period may be shorter:
    #: before it arrives, a spiral also returns by chance after longer times.
    clear: float = 1e3
    #: Size of a return, from which it may be that of a torus or of chaos. Smaller returns need no evidence against
    #: their scatter before they count as shrinking.
    large: float = 1e-3
    #: Decrease of the mean logarithm of large returns from one window to the next, from which they shrink.
    decay: float = 0.1
    #: Standard deviation of these logarithms, from which they are those of chaos: these vary by themselves, so the
    #: decrease must exceed two standard errors.
    scatter: float = 0.6
    #: Number of strobes above which a motion without period may have settled; averages are over their later half.
    evidence: int = 192
    #: Distance of return, below which an orbit of that period is searched for by Newton's method.
    promising: float = 0.05
    #: Distance of return, relative to the spread of the strobes, that no torus and no chaos reaches.
    exact: float = 1e-6
    #: A longer period counts only if its distance of return is smaller than those of shorter ones by this factor.
    better: float = 0.5
    #: Numbers of blocks, and the allowed trend over them in standard errors. Few long blocks show the slow decay of a
    #: torus, because its weighted averages are then sharp; but errors from few blocks are themselves uncertain.
    trends: tuple[tuple[int, float], ...] = ((16, 4.5), (8, 6.0), (5, 12.0))
    #: Weight of the remainder after a nearest return: it may change by a hundred times the tolerance.
    small: float = 0.01
    #: Spread of weighted averages, relative to the signal's deviation, above which a motion is chaotic.
    irregular: float = 1e-3


TOLERANCES = Tolerances()
"""The tolerances with which every motion is judged."""

_NOTHING = 1e-20  # square of a difference that is only rounding


class Returns(NamedTuple):
    """The convergence of many motions, from their returns."""

    #: shape (count,): Distance that each motion still has to go to the orbit that it approaches; inf if its returns do
    #: not shrink.
    missing: NDArray[np.float64]
    #: shape (count,): Number of forcing periods after which it repeats there; 0 if that is not certain yet.
    periods: NDArray[np.int_]
    #: shape (count,), bool: True if the nearest returns neither shrink nor grow, and are as large as those of a torus
    #: or of chaos; or if they are exact.
    steady: NDArray[np.bool_]


def judge_returns(track: NDArray[np.float64], longest: int) -> Returns:
    """Judge motions by their returns after up to `longest` forcing periods."""
    # If returns shrink by a factor g each time, a motion still has to go ``r g / (1 - g)`` after the return r: a slow
    # transient near a fold returns just as closely as a fast one, but each time with the same error. The factor is that
    # between two windows at the end of the track, each a third of the track long.
    #
    # Shapes: `track` (strobes, count, state_size).
    length, count, limits = len(track) - 1, track.shape[1], TOLERANCES
    longest = min(longest, length // 3)
    if not longest:
        return Returns(np.full(count, np.inf), np.zeros(count, dtype=int), np.zeros(count, dtype=bool))
    m = np.arange(1, longest + 1)
    windows = m * np.maximum(1, (length - longest) // 3 // m)  # whole returns: strobes of an orbit differ in size
    means, squares = np.empty((2, longest, 2, count))
    for row, (period, window) in enumerate(zip(m.tolist(), windows.tolist(), strict=True)):
        returns = np.abs(track[-2 * window :] - track[-2 * window - period : -period]).max(axis=2)
        logs = np.log(np.maximum(returns, limits.rounding**2)).reshape(2, window, count)
        means[row], squares[row] = logs.mean(axis=1), (logs * logs).mean(axis=1)
    change, last = means[:, 1] - means[:, 0], np.exp(means[:, 1])
    scatter = np.sqrt(np.maximum(squares - means**2, 0.0).mean(axis=1))
    error = np.where(scatter > limits.scatter, 2.0 * scatter * np.sqrt(2.0 * m / windows)[:, None], 0.0)
    least = np.maximum(limits.decay, error)
    is_large = last >= limits.large
    # returns of tori and of chaos shrink by chance, but they are large
    shrinks = change < np.where(is_large, -least, 0.0)
    fall = np.where(shrinks, change, -1.0)
    ratio = np.exp(fall * (m / windows)[:, None])
    # `last` belongs to the middle of the later window; half a window later is the end of the track
    missing = np.where(shrinks, last * np.exp(0.5 * fall) * ratio / (1.0 - ratio), np.inf)
    missing[last <= limits.rounding] = limits.rounding
    shorter = np.minimum.accumulate(np.vstack((np.full((1, count), np.inf), last[:-1])))
    is_period = (last <= limits.returned) & (missing <= limits.arrived) & (shorter > limits.clear * missing)
    periods = np.where(is_period.any(axis=0), m[is_period.argmax(axis=0)], 0)
    nearest = last.argmin(axis=0), np.arange(count)
    is_steady = is_large & (np.abs(change) <= least) | (last <= limits.rounding)
    return Returns(missing[nearest], periods, is_steady[nearest])


def has_settled(states: NDArray[np.float64], longest: int, tolerance: float) -> bool:
    """Decide whether one motion has settled, from all its strobes since its start."""
    # Shapes: `states` (strobes, state_size).
    found = judge_returns(states[:, None], longest)
    if found.missing[0] <= tolerance:
        return True
    if len(states) <= TOLERANCES.evidence or not found.steady[0]:
        return False
    return drift_of(states[len(states) // 2 :], longest).is_settled(tolerance)


def period_of(states: NDArray[np.float64], longest: int) -> int:
    """Return the smallest period after which all strobes of a settled motion return, at most `longest`; 0 if none."""
    for m in range(1, longest + 1):
        if np.abs(states[m:] - states[:-m]).max() <= TOLERANCES.arrived:
            return m
    return 0


class Recurrence(NamedTuple):
    """A number of forcing periods, and the distance of the motion from its start after them, relative to its size."""

    period: int
    distance: float


def recurrences(states: NDArray[np.float64], longest: int, near: float) -> list[Recurrence]:
    """Find periods up to `longest` after which scaled strobes nearly return, each nearer than those before it."""
    # Shapes: `states` (strobes, state_size).
    found: list[Recurrence] = []
    best = np.inf
    for period in range(1, min(longest, len(states) // 2) + 1):
        recent = states[-2 * period :]
        distance = float(np.abs(recent[period:] - recent[:period]).max())
        if distance < near and distance < TOLERANCES.better * best:
            found.append(Recurrence(period, distance))
        best = min(best, distance)
    return found


def exact_returns(system: System, states: NDArray[np.float64]) -> list[Recurrence]:
    """Find periods after which strobes return more closely than on any torus, however small, or in chaos."""
    states = states - states.mean(axis=0)
    return recurrences(states / size_of(system, states), len(states) // 2, TOLERANCES.exact)


class Drift(NamedTuple):
    """The change of the averages of a motion along part of it."""

    #: The largest change, between the halves, of the weighted average of a scaled state or of a product of two.
    change: float
    #: The largest linear trend of averages over blocks, in its standard errors, relative to the allowed one. The errors
    #: come from the residual of the trend, so a slow decay cannot hide by increasing its own error.
    trend: float
    irregular: bool  #: True if weighted averages converge as slowly as those of chaotic motion.
    steady: bool  #: True if the nearest returns neither shrink nor grow; see `Returns`.

    def is_settled(self, tolerance: float) -> bool:
        """Return True if the change is within the tolerance, or, for irregular motion, the trend within its errors."""
        return self.steady and (self.change <= tolerance or (self.irregular and self.trend <= 1.0))

    def text(self, tolerance: float) -> str:
        """Describe a settled motion in words."""
        if self.change > tolerance:
            return f"its averages fluctuate without a trend (at most {self.trend:.2f} times a significant trend)"
        return f"its averages change by no more than {self.change:.1e}"


def drift_of(states: NDArray[np.float64], longest: int) -> Drift:
    """Compute the drift along a sequence of scaled strobes, shape (count, state_size) with a count of 64 or more."""
    # Remainder after the nearest return within `longest` forcing periods (for example the size of a torus about an
    # orbit) is scaled and tested separately: it may be small compared with the motion, and yet far from settled.
    scaled, period = states[:, None], recurrences(states, longest, np.inf)[-1].period
    i, j = np.triu_indices(states.shape[1])
    left = (states[period:] - states[:-period]) ** 2
    left = TOLERANCES.small * left / np.maximum(left.mean(axis=0), _NOTHING)
    states = states[period:]
    observed = np.hstack((states, states[:, i] * states[:, j], left))
    half = len(observed) // 2
    change = np.abs(birkhoff_mean(observed[-half:]) - birkhoff_mean(observed[:half]))
    rough = birkhoff_spread(observed[-half:]) > TOLERANCES.irregular * observed.std(axis=0)
    steady = bool(judge_returns(scaled, longest).steady[0])
    return Drift(float(change.max()), _trend(observed), bool(rough.any()), steady)


def _trend(values: NDArray[np.float64]) -> float:
    """Return the largest linear trend of block averages, in its standard errors, relative to the allowed one."""
    largest = 0.0
    for count, allowed in TOLERANCES.trends:
        length = len(values) // count
        blocks = values[-length * count :].reshape(count, length, -1)
        means = np.array([birkhoff_mean(block) for block in blocks])
        place = np.arange(count) - (count - 1) / 2
        slope = place @ means / (place @ place)
        left = means - means.mean(axis=0) - np.outer(place, slope)
        error = np.sqrt((left**2).sum(axis=0) / (count - 2) / (place @ place))
        largest = max(largest, float((np.abs(slope) / (error + np.finfo(float).eps)).max()) / allowed)
    return largest


_FIRST = 8  # forcing periods before the first test; the total grows by half before each further test
_BY_LANES = 64  # forcing periods up to which a transient is followed by the exact flow alone
_STATIONARY = 1024  # the fewest forcing periods after which a motion may count as settled without being periodic
_STEADY = 1e-6  # of the size of a motion: how near the rotation of a train as a whole is to where it ends
_REST = 1e-3  # size of a motion, relative to the largest so far, below which it may approach a static equilibrium
_RECORDED = 1024  # strobes stored in the record
_FAR = 0.01  # distance from an unstable orbit, relative to the motion, above which the motion is not displaced


@dataclass(frozen=True, slots=True)
class SettleOptions(Bounded):
    """Options of the transient and of the test for settling.

    Examples
    --------
    >>> gw.settle(system, options=gw.SettleOptions(tolerance=1e-3)).converged
    True
    """

    #: Largest number of forcing periods of the transient; a few more may pass while it is compared with an orbit.
    max_periods: Counted = 20_000
    max_period: Counted = 64  #: The longest period m of the orbits that are searched for.
    #: Drift of the averages of a motion without period, relative to the size of the motion, below which it counts as
    #: settled; the averages of a chaotic motion may drift by four standard errors.
    tolerance: Annotated[float, Gt(0), Le(0.1)] = 1e-5


def settle(
    system: System,
    start: str | Sequence[float] | NDArray[np.float64] = "rest",
    options: SettleOptions | None = None,
    *,
    at: Mapping[str, float] | None = None,
    **values: float,
) -> Settled:
    """Follow a motion until it has settled.

    A motion counts as periodic if a stable orbit is found next to it, and if several successive returns approach this
    orbit as its linearised return map predicts. The orbit itself is exact, and a slow transient near a flip or a fold
    is not mistaken for another motion. Any other motion counts as settled when the averages over its third and fourth
    quarter agree.

    Parameters
    ----------
    system
        The system.
    start
        ``"rest"``, or a state at theta = 0: positions, then velocities.
    options
        Largest length of the transient, and the tolerances of the tests that end it.
    at, **values
        Parameter values to change first: ``settle(system, frequency=0.45)``.

    Returns
    -------
    Settled
        The motion after its transient.

    Raises
    ------
    ModelError
        For an invalid start or parameter.
    FlowError
        If the motion diverges.

    Notes
    -----
    Averages of a motion that is not periodic: Das, Saiki, Sander and Yorke (2017), Nonlinearity 30, 4111-4140. Errors
    of averages of chaotic motions: Flyvbjerg and Petersen (1989), Journal of Chemical Physics 91, 461-466.

    Examples
    --------
    >>> import gapwalk as gw
    >>> mass = gw.System(
    ...     ["x"], mass=[1.0], damping=[0.1], stiffness=[1.0], harmonics=[gw.Harmonic(0.1, {"x": 1.0})], frequency=0.5
    ... )
    >>> gw.settle(mass).orbit.period
    1
    """
    check_system(system, "settle")
    options = options or SettleOptions()
    system = system.at(at, **values)
    return _Transient(system, initial_state(system, start), options).follow()


class _Transient:
    """A transient that is being followed, with its strobes since the start or since it was displaced."""

    def __init__(self, system: System, state: NDArray[np.float64], options: SettleOptions) -> None:
        self.strobe, self.options = Strobe(system), options
        self.states, self.periods = state[None, :], 0
        self.drift = Drift(np.inf, np.inf, irregular=False, steady=False)
        self.notes: list[str] = []
        self.largest = 0.0  # size of the motion so far

    def follow(self) -> Settled:
        """Test the motion at growing intervals until it is decided to which motion it leads."""
        target, options = _FIRST, self.options
        if prefers_lanes(self.strobe.system) and options.max_periods > _BY_LANES:
            if (settled := self._by_lanes()) is not None:
                return settled
            target = self.periods + _FIRST
        while True:
            self._advance(min(target, options.max_periods) - self.periods)
            approach = self._look()
            if approach is not None:
                orbit, rate = approach.orbit, float(np.abs(approach.orbit.free_multipliers).max())
                how = f"its distance from a stable orbit of period {orbit.period} is {approach.distance:.1e}"
                how += f" (largest multiplier {rate:.6g}), and it converges to this orbit"
                return self._record(True, orbit, approach.distance, how)
            if self._is_stationary():
                return self._record(True, None, self.drift.change, self.drift.text(options.tolerance))
            if self.periods >= options.max_periods:
                unsettled = f"it had not settled after {self.periods} forcing periods; raise max_periods"
                return self._record(False, None, self.drift.change, unsettled)
            target = self.periods + max(_FIRST, self.periods // 2)

    def _by_lanes(self) -> Settled | None:
        """Settle by equal steps, far faster for a train; a motion with a period is settled exactly from there."""
        system = self.strobe.system
        ((_, motion),) = settle_lanes([Start(0, 0.0, system, self.states[-1])])
        if motion.diverged:
            return None
        self.states, self.periods = motion.state[None], motion.waited + motion.watched
        if motion.period:
            return None
        lanes = Lanes(system.structure, coefficients_of(system)[None], motion.state[None], kinds=())
        strobes = [motion.state]
        for _ in range(motion.watched):
            lanes.advance()
            strobes.append(lanes.states[0])
        self.states = np.array(strobes)
        apart = float(np.max(motion.error / np.maximum(motion.rms, np.finfo(float).tiny)))
        how = (
            f"it does not repeat within 8 forcing periods; from {motion.watched} simulated periods, root mean squares "
            f"of accelerations are known to {100 * apart:.1g} %; a transient that outlasts them is not excluded"
        )
        return self._record(True, None, apart, how)

    def _advance(self, count: int) -> None:
        if count > 0:
            more = self.strobe.run(self.states[-1], count)
            self.largest = float(size_of(self.strobe.system, more, self.largest)[0])
            known = self.states if len(more) < 2 else more
            ahead = steadied(self.strobe.system, known[len(known) // 2 - 1 :])
            away = float(np.abs((ahead - more[-1]) / size_of(self.strobe.system, more)).max())
            # motions restart where the slow rotation of a train ends, at the same phase
            self.states = np.vstack((self.states, more)) if away < _STEADY else ahead[None]
            self.periods += count
            tell_stage(self.periods / self.options.max_periods)

    def _look(self) -> Approach | None:
        """Search for orbits of the promising periods, always including period 1; test stable orbits first."""
        tail, least = self.states[-4 * self.options.max_period :], _REST * self.largest
        scaled = tail / size_of(self.strobe.system, tail)
        periods = {1, *(each.period for each in recurrences(scaled, self.options.max_period, TOLERANCES.promising))}
        nearby = [nearby_orbit(self.strobe, tail[-1], period, least) for period in sorted(periods)]
        for orbit in sorted((orbit for orbit in nearby if orbit is not None), key=lambda orbit: not orbit.stable):
            approach = watch(self.strobe, tail[-1], orbit, least)
            if approach.converging or approach.leaving:
                self.states = np.vstack((self.states, approach.strobes))
                self.periods += len(approach.strobes)
            if approach.converging:
                return approach
            if approach.leaving:
                # a motion that starts next to an unstable orbit looks settled until it has left that orbit
                if approach.distance < _FAR:
                    self.notes.append(f"it was next to an unstable motion of period {orbit.period}, and was moved away")
                    # forget the states before: the motion restarts here, at the same phase
                    self.states = pushed_off(orbit, self.states[-1], least)[None, :]
                return None
        return None

    def _is_stationary(self) -> bool:
        if len(self.states) <= _STATIONARY:
            return False
        tail = self.states[-(len(self.states) // 2) :]
        self.drift = drift_of(tail / size_of(self.strobe.system, tail), self.options.max_period)
        return self.drift.is_settled(self.options.tolerance)

    def _record(self, converged: bool, orbit: Orbit | None, residual: float, how: str) -> Settled:
        kept, evidence = self.states[-_RECORDED:].copy(), (*self.notes, how)
        if orbit is None and not prefers_lanes(
            self.strobe.system
        ):  # its period may be longer than those that were searched for
            found = exact_returns(self.strobe.system, kept[len(kept) // 2 :])
            for period, away in [each for each in found if each.period > self.options.max_period][:1]:
                evidence += (f"it repeats to within {away:.1e} after {period} forcing periods: raise max_period",)
        return Settled(self.strobe.system, kept, self.periods, converged, orbit, float(residual), evidence)


# Classification of the attractor on which a motion settles, with the evidence.
#
# Method: docs/numerics/notes/ensembles.md

_STROBES = 4096  # strobes for a rotation number, if the exponents needed fewer
_KEPT = 2048  # strobes stored in an attractor
_RELAXED = 12.0  # a torus counts as reached when its slowest mode has decayed by exp(-12)
_AGAIN = 512  # forcing periods after which a chaotic motion is examined again: its chaos may have been a transient
_LEAD = 1e-3  # largest error of the leading exponent per forcing period with which a torus differs from chaos

Strobes = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class ClassifyOptions(Bounded):
    """Options of the classification of a motion.

    Examples
    --------
    >>> gw.classify(system, options=gw.ClassifyOptions(settle=gw.SettleOptions(max_period=4))).label
    'P1'
    """

    #: settle, lyapunov: Options of the transient, and of the averages of the Lyapunov exponents.
    settle: SettleOptions = field(default_factory=SettleOptions)
    lyapunov: LyapunovOptions = field(default_factory=LyapunovOptions)
    #: Size of a Lyapunov exponent per forcing period below which it may be zero, as on a torus.
    zero: Annotated[float, Gt(0), Le(0.01)] = 1e-5
    #: Number of standard errors by which an exponent must differ from zero to count as different.
    errors: Annotated[float, Ge(1)] = 5.0


def classify(
    system: System,
    start: str | Sequence[float] | NDArray[np.float64] = "rest",
    options: ClassifyOptions | None = None,
    *,
    at: Mapping[str, float] | None = None,
    **values: float,
) -> Attractor:
    """Find the attractor on which a motion settles: periodic, quasi-periodic or chaotic.

    Parameters
    ----------
    system
        The system.
    start
        ``"rest"``, or a state at theta = 0: positions, then velocities.
    options
        Options of the transient and of the classification.
    at, **values
        Parameter values to change first.

    Returns
    -------
    Attractor
        The attractor, with the evidence that it is periodic, quasi-periodic or chaotic.

    Raises
    ------
    ModelError
        For an invalid start or parameter.
    FlowError
        If the motion diverges.

    Examples
    --------
    >>> gw.classify(system, frequency=0.8).label  # one motion in two forcing periods
    'P2'
    """
    options = options or ClassifyOptions()
    return identify(settle(system, start, options.settle, at=at, **values), options)


def identify(settled: Settled, options: ClassifyOptions | None = None) -> Attractor:
    """Classify the attractor of a motion that has settled."""
    # Periodic: `settle` found a stable orbit. Chaotic: the largest exponent is positive by several errors, and the
    # motion has still not converged to an orbit when it is examined again. Quasi-periodic: the largest exponent is zero
    # within its error, and the strobes go round closed curves with a rotation number that converges. Otherwise:
    # undecided.
    options = options or ClassifyOptions()
    if settled.orbit is not None:
        return _periodic(settled.orbit, settled.evidence)
    settled, exponents, strobes = _measured(settled, options)
    orbit = _late_orbit(settled.system, strobes, options)
    if orbit is not None:
        return _periodic(orbit, (*settled.evidence, "it converged to an orbit while its exponents were averaged"))
    kind, found, words = _judge(settled, exponents, strobes, options)
    curves, evidence = 0 if found is None else found.curves, (*settled.evidence, *words)
    return Attractor(kind, settled.system, curves, strobes[-_KEPT:], None, exponents, found, evidence)


def _periodic(orbit: Orbit, evidence: tuple[str, ...]) -> Attractor:
    exponents = of_multipliers(orbit.system, orbit.free_multipliers, orbit.period)
    evidence = (*evidence, *kept_words(orbit.system.structure, orbit.stuck))
    strobes = stroboscopic(orbit)
    return Attractor(AttractorKind.PERIODIC, orbit.system, orbit.period, strobes, orbit, exponents, None, evidence)


def _measured(settled: Settled, options: ClassifyOptions) -> tuple[Settled, Lyapunov, Strobes]:
    """Compute the exponents, and the strobes over which they are averaged."""
    # A slowly approached torus is first settled further, until its slowest mode has decayed.
    # a train in chaos needs minutes for all its exponents, and seconds for the sign of the largest
    sure = options.errors if prefers_lanes(settled.system) else np.inf
    exponents, strobes = lyapunov_run(settled.system, settled.state, options.lyapunov, sure)
    rates = exponents.per_period
    falling = rates[rates < -np.maximum(options.zero, options.errors * exponents.errors_per_period)]
    if not exponents.regular or not len(falling):
        return settled, exponents, strobes
    decay = -float(falling.max())  # of the slowest mode, per forcing period
    missing = int(np.ceil(_RELAXED / decay)) - settled.periods
    if missing <= 0:
        return settled, exponents, strobes
    state, periods = strobes[-1], settled.periods + len(strobes)
    allowed = min(missing, options.settle.max_periods - periods)
    if allowed > 0:
        state, periods = Strobe(settled.system).run(state, allowed)[-1], periods + allowed
    evidence = (*settled.evidence, f"its slowest mode had decayed by exp(-{decay * periods:.1f})")
    return replace(settled, periods=periods, evidence=evidence), *lyapunov_run(settled.system, state, options.lyapunov)


def _late_orbit(system: System, strobes: Strobes, options: ClassifyOptions) -> Orbit | None:
    """Return the orbit to which the motion has converged meanwhile, if any; its period may be long."""
    last, strobe = strobes[-1], Strobe(system)
    orbit = settle(system, last, replace(options.settle, max_periods=_AGAIN)).orbit
    if orbit is not None:
        return orbit
    for each in exact_returns(system, strobes[-_KEPT:]):
        orbit = nearby_orbit(strobe, last, each.period, 0.0)
        if orbit is not None and watch(strobe, last, orbit, 0.0).converging:
            return orbit
    return None


def _judge(
    settled: Settled, exponents: Lyapunov, strobes: Strobes, options: ClassifyOptions
) -> tuple[AttractorKind, Rotation | None, tuple[str, ...]]:
    """Return the kind of a motion that is not periodic, its rotation number if it has one, and the evidence."""
    lead, error = float(exponents.per_period[0]), float(exponents.errors_per_period[0])
    text = f"its largest exponent is {lead:.3g} +- {error:.1g} per forcing period"
    if lead > options.zero and lead > options.errors * error:
        if exponents.regular:  # a regular motion on an attractor has no positive exponent
            return AttractorKind.UNDECIDED, None, (f"{text}, but without chaos: it is leaving an unstable motion",)
        return AttractorKind.CHAOTIC, None, (f"{text}: positive",)
    if lead < -options.zero and lead < -options.errors * error:
        return AttractorKind.UNDECIDED, None, (f"{text}: negative, but no orbit was found; raise max_period",)
    for period, away in exact_returns(settled.system, strobes[-_KEPT:])[:1]:
        words = f"it repeats to within {away:.1e} after {period} forcing periods, but does not attract other motions"
        return AttractorKind.UNDECIDED, None, (f"{text}: zero", words)
    if len(strobes) < _STROBES:
        strobes = np.vstack((strobes, Strobe(settled.system).run(strobes[-1], _STROBES - len(strobes))))
    found = rotation(strobes)
    if found is not None and error <= _LEAD:
        how = f"its strobes go round {found.curves} closed curve{'s' * (found.curves > 1)} (roughness"
        words = f"{how} {found.roughness:.3f}), rotation number {found.number:.9g}"
        return AttractorKind.QUASI_PERIODIC, found, (f"{text}: zero", words)
    zeros = int(np.sum(np.abs(exponents.per_period) <= options.zero))
    if zeros > 1 and exponents.regular and settled.converged:
        return AttractorKind.QUASI_PERIODIC, None, (f"{text}: zero, as {zeros - 1} other exponents",)
    return AttractorKind.UNDECIDED, None, (f"{text}: zero within its error, but its strobes lie on no curve",)

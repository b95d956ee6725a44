"""Sections: states of a motion at one phase of the excitation, or at its crossings of a plane.

The stroboscopic map takes a state once per forcing period. A plane of crossings is where a linear combination of
positions and velocities has a given value.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from gapwalk.bracketed_root import zero_between_signs
from gapwalk.ensemble.batch_flow import LIMIT
from gapwalk.ensemble.lanes import prefers_lanes
from gapwalk.errors import FlowError, ModelError
from gapwalk.flow.flow import PERIOD, Arc, flow_of
from gapwalk.flow.motion import Motion, check_state, is_dry
from gapwalk.model.bounds import Counted, check
from gapwalk.model.coefficients import coefficients_of, layout_of
from gapwalk.model.system import System
from gapwalk.orbit.drifting import brought_back, drifts_of

_SAMPLES = 128  # samples per forcing period between which crossings are bracketed
_EXACT = 1e-13  # tolerance of an angle
_ROUNDING = 1e-13  # share of the size of a motion below which its height over a plane is 0


@dataclass(frozen=True, eq=False)
class Section:
    """States of one motion at one phase, or on one plane."""

    system: System  #: The system that moves.
    theta: NDArray[np.float64]  #: shape (count,): Angle of the excitation at each state, in radians.
    states: NDArray[np.float64]  #: shape (count, state_size): Positions, velocities and extensions of friction springs.
    text: str  #: The plane or phase of the section, in words.

    def __len__(self) -> int:
        return len(self.theta)

    @property
    def phase(self) -> NDArray[np.float64]:
        """Phase of the excitation at each state, from 0 to one period, in radians; shape (count,)."""
        return self.theta % PERIOD

    def signal(self, name: str) -> NDArray[np.float64]:
        """Return one signal at each state, by the names of `Motion.signal`; shape (count,)."""
        return Motion.of(self.system, self.theta, self.states).signal(name)


class Crossing(StrEnum):
    """The direction in which a motion crosses a plane."""

    UPWARDS = "upwards"
    DOWNWARDS = "downwards"
    BOTH = "both"

    def takes(self, before: float) -> bool:
        """Return True if a crossing counts that starts below (`before` < 0) or above the plane."""
        return self is Crossing.BOTH or (before < 0.0) is (self is Crossing.UPWARDS)


@dataclass(frozen=True)
class Plane:
    """All states at which a weighted sum of positions and velocities has a given value.

    Examples
    --------
    >>> plane = gw.analysis.Plane({"x": 1.0}, level=0.5, crossing="downwards")
    >>> gw.analysis.section(system, orbit.state, plane, periods=2).states.shape
    (2, 2)
    """

    #: The weights by name: ``{"q1": 1.0}``, or ``{"q1": 1.0, "q3'": -0.5}`` with a velocity.
    normal: Mapping[str, float] = field(hash=False)
    level: float = 0.0  #: The value.
    crossing: Crossing = Crossing.UPWARDS  #: ``"upwards"``, ``"downwards"`` or ``"both"``.

    def __post_init__(self) -> None:
        try:
            object.__setattr__(self, "crossing", Crossing(self.crossing))
        except ValueError:
            allowed = ", ".join(repr(each.value) for each in Crossing)
            raise ModelError(f"crossing is {self.crossing!r}; it must be one of {allowed}") from None
        if not any(self.normal.values()):
            raise ModelError('the normal of a plane is zero; name a signal with its weight, such as {"q1": 1.0}')

    def weights(self, system: System) -> NDArray[np.float64]:
        """Return the weights of all entries of a state, shape (state_size,)."""
        names = system.state_names[: 2 * system.size]
        unknown = [name for name in self.normal if name not in names]
        if unknown:
            raise ModelError(f"the normal of a plane names {unknown[0]!r}; it must be one of {', '.join(names)}")
        return np.array([float(self.normal.get(name, 0.0)) for name in system.state_names])

    @property
    def text(self) -> str:
        """The plane in words, such as ``q1 = 1, upwards``."""
        terms = [name if factor == 1.0 else f"{factor:g} {name}" for name, factor in self.normal.items() if factor]
        where = "" if self.crossing is Crossing.BOTH else f", {self.crossing.value}"
        return f"{' + '.join(terms)} = {self.level:g}{where}".replace("+ -", "− ")


def section(system: System, start: NDArray[np.float64], plane: Plane, periods: int = 1000) -> Section:
    """Find the states at which a motion crosses a plane, on the exact flow and to machine precision.

    Crossings are bracketed by 128 samples per forcing period. Two crossings between successive samples are found by
    means of the turning point between them. A start on the plane does not count as a crossing.

    Parameters
    ----------
    system
        The system.
    start : shape (state_size,)
        A state of the settled motion at theta = 0.
    plane
        The plane, and the direction of crossing.
    periods
        Number of forcing periods for which the motion is followed.

    Returns
    -------
    Section
        The states, in the order of the crossings.

    Raises
    ------
    ModelError
        For an invalid state, number of periods or plane.
    FlowError
        If the motion diverges.

    Examples
    --------
    >>> plane = gw.analysis.impact_plane(impacting.system, "stop")
    >>> gw.analysis.section(impacting.system, impacting.state, plane, periods=3).signal("x'").round(6)
    array([1.377284, 1.377284, 1.377284])
    """
    check("periods", periods, Counted)
    crossings = _Crossings(system, plane)
    current, theta = check_state(system, start), 0.0
    for _ in range(periods):
        current = crossings.follow(current, theta)
        theta += PERIOD
    thetas = np.array([theta for theta, _ in crossings.found])
    states = np.array([found for _, found in crossings.found]).reshape(-1, system.state_size)
    return Section(system, thetas, states, plane.text)


class _Crossings:
    """Search for the crossings of a plane by a motion, one forcing period at a time."""

    def __init__(self, system: System, plane: Plane) -> None:
        self._system, self._plane, self._weights = system, plane, plane.weights(system)
        self._flow, self._coefficients = flow_of(system), coefficients_of(system)
        self.found: list[tuple[float, NDArray[np.float64]]] = []

    def follow(self, state: NDArray[np.float64], start: float) -> NDArray[np.float64]:
        """Record all crossings of the period that begins at `start`; return the state at its end."""
        thetas = start + PERIOD * np.arange(_SAMPLES + 1) / _SAMPLES
        sampled = self._flow.sample(self._coefficients, state, thetas)
        states, heights = sampled.states, self._height(sampled.states)
        slopes = self._slope(Motion.of(self._system, thetas, states, *sampled.logs))
        self._refuse_rest(states, heights)
        crossed = np.sign(heights[:-1]) != np.sign(heights[1:])
        approaching = (heights[:-1] * slopes[:-1] < 0.0) & (heights[1:] * slopes[1:] > 0.0)
        for k in np.flatnonzero(crossed | approaching):
            self._find(float(thetas[k]), float(thetas[k + 1]), states[k])
        return states[-1]

    def _height(self, states: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the signed distance of states, shape (..., state_size), from the plane."""
        return states @ self._weights - self._plane.level

    def _slope(self, motion: Motion) -> NDArray[np.float64]:
        """Return the derivative of that distance over theta."""
        n = self._system.size
        return (1.0 / self._system.frequency) * (motion.v @ self._weights[:n] + motion.a @ self._weights[n : 2 * n])

    def _refuse_rest(self, states: NDArray[np.float64], heights: NDArray[np.float64]) -> None:
        """Refuse a plane in which the motion lies for a while, as a rate of 0 while friction sticks."""
        if not is_dry(self._system.structure):
            return
        on = np.abs(heights) <= _ROUNDING * (np.abs(states) @ np.abs(self._weights)).max()
        if np.any(on[1:] & on[:-1]):
            raise ModelError(
                f"the motion lies in the plane {self._plane.text} while friction sticks or a stop is held: it has "
                "no single crossing there; choose another level, or another signal"
            )

    def _find(self, start: float, stop: float, state: NDArray[np.float64]) -> None:
        """Record the crossings in a short interval that begins at a state."""

        def at(theta: float) -> NDArray[np.float64]:
            return self._flow.integrate(self._coefficients, state, start, theta).state if theta > start else state

        def height(theta: float) -> float:
            return float(self._height(at(theta)))

        def slope(theta: float) -> float:
            return float(self._slope(Motion.of(self._system, np.array([theta]), at(theta)[None]))[0])

        crossings: list[tuple[float, float]] = []  # the angle of each, and the height (or slope) before it
        first, last = height(start), height(stop)
        if first == 0.0:  # it starts on the plane: that crossing belongs to the previous interval
            first = slope(start)
            if first * last <= 0.0:  # it turns and comes back
                crossings = [(_root(height, _root(slope, start, stop), stop), first)]
        elif first * last <= 0.0:
            crossings = [(_root(height, start, stop), first)]
        else:
            turn = _root(slope, start, stop)
            middle = height(turn)
            if middle * first < 0.0:
                crossings = [(_root(height, start, turn), first), (_root(height, turn, stop), middle)]
        self.found += [(theta, at(theta)) for theta, before in crossings if self._plane.crossing.takes(before)]


def _root(function: Callable[[float], float], start: float, stop: float) -> float:
    return zero_between_signs(function, start, stop, absolute=_EXACT)


def impact_plane(system: System, contact: str, side: int = 1, *, closes: bool = True) -> Plane:
    """Return the plane on which a contact's innermost stage closes (or opens) on one side.

    Parameters
    ----------
    system
        The system.
    contact
        Name of the contact.
    side
        Side of the contact: +1 or -1.
    closes
        True where the stage closes, False where it opens.

    Returns
    -------
    Plane
        The plane, with the direction of crossing.

    Raises
    ------
    ModelError
        If there is no such contact, or none of its stages acts on that side.

    Examples
    --------
    >>> gw.analysis.impact_plane(system, "stop").text
    'x = 1, upwards'
    """
    forms = {form.name: form for form in system.structure.contacts}
    if contact not in forms:
        raise ModelError(f"there is no contact {contact!r}; contacts are {', '.join(forms) or 'none at all'}")
    form = forms[contact]
    stages = [stage for stage in form.stages if side in stage.side.signs]
    if not stages:
        raise ModelError(f"no stage of {contact!r} acts on the side {side!r}; a side is +1 or -1")
    if layout_of(system.structure).contacts[[*forms].index(contact)].sway is not None:
        raise ModelError(
            f"the deflection of {contact!r} contains a prescribed displacement, so that the plane on which it closes "
            'moves; write a Plane of your own, as in gw.analysis.Plane({"q1": 1.0}, 0.0), or take strobes'
        )
    vector = system.vector(form.vectors[0]).tolist()
    level = side * system.equations[f"{form.stage_prefix(stages[0])}.clearance"]
    upwards = (side > 0) is closes
    normal = {name: factor for name, factor in zip(system.coordinates, vector, strict=True) if factor}
    return Plane(normal, level, Crossing.UPWARDS if upwards else Crossing.DOWNWARDS)


def size_of(system: System, states: NDArray[np.float64], least: float = 0.0) -> NDArray[np.float64]:
    """Compute the size of a motion as a scale for each entry of a state, shape (state_size,), in any units."""
    # The scale of positions and extensions is the largest of them, or the largest velocity over W if that is larger,
    # and at least `least`; the scale of velocities is W times that.
    unit = system.state_scales()
    return unit * max(float((np.abs(states) / unit).max()), least, np.finfo(float).tiny)


def points_of(system: System) -> int:
    """Return the points of a section of a motion without period: fewer where each takes a hundred times as long."""
    return 256 if prefers_lanes(system) else 2000


def strobe(system: System, start: NDArray[np.float64], periods: int = 1000, phase: float = 0.0) -> Section:
    """Compute the stroboscopic section: states one forcing period apart.

    Parameters
    ----------
    system
        The system.
    start : shape (state_size,)
        A state of the settled motion at theta = 0.
    periods
        Number of states.
    phase
        Angle of the excitation at the states, in radians, 0 <= phase < 2 pi.

    Returns
    -------
    Section
        The states.

    Raises
    ------
    ModelError
        For an invalid state, number of states or phase.
    FlowError
        If the motion diverges.

    Examples
    --------
    >>> gw.analysis.strobe(system, orbit.state, periods=2).signal("x").round(6)
    array([0.774443, 0.774443])
    """
    check("periods", periods, Counted)
    if not 0.0 <= phase < PERIOD:
        raise ModelError(f"phase is {phase!r}; it must be an angle in radians, at least 0 and less than 2 pi")
    first = at_phase(system, check_state(system, start), phase)
    return strobed(system, np.vstack((first, Strobe(system, phase).run(first, periods - 1))), phase)


def strobed(system: System, states: NDArray[np.float64], phase: float = 0.0) -> Section:
    """Return the section of states that are one forcing period apart."""
    thetas = phase + PERIOD * np.arange(len(states), dtype=np.float64)
    return Section(system, thetas, states, f"phase {phase / PERIOD:.4g} of the period")


def at_phase(system: System, state: NDArray[np.float64], phase: float) -> NDArray[np.float64]:
    """Return the state at the angle `phase` (0 to one period, in radians) on the motion from `state` at 0."""
    if phase == 0.0:
        return np.asarray(state, dtype=float)
    return flow_of(system).integrate(coefficients_of(system), state, 0.0, phase).state


class Strobe:
    """Advances states of one system by one forcing period, or several."""

    def __init__(self, system: System, phase: float = 0.0, *, transition: bool = False) -> None:
        self.system, self.phase, self._drifts = system, float(phase), drifts_of(system)
        self._flow, self._coefficients = flow_of(system, transition=transition), coefficients_of(system)

    def arc(self, state: NDArray[np.float64], periods: int = 1) -> Arc:
        """Integrate the motion over some forcing periods, with its transition matrix if requested."""
        arc = self._flow.integrate(self._coefficients, state, self.phase, self.phase + PERIOD * periods)
        if not math.hypot(*arc.state.tolist()) <= LIMIT:
            raise FlowError(f"the motion diverges beyond {LIMIT:.0e}; is there a damping that dissipates energy?")
        return arc

    def run(self, state: NDArray[np.float64], count: int, every: int = 1) -> NDArray[np.float64]:
        """Return the next `count` states, `every` forcing periods apart, without the given one."""
        # Their shape is (count, state_size).
        states = np.empty((count, len(state)))
        for k in range(count):
            state = states[k] = brought_back(self._drifts, self.arc(state, every).state)
        return states

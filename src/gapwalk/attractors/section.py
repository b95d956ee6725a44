"""Sections: states of a motion at one phase of the excitation, or at its crossings of a plane."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gapwalk.attractors.section_plane import Height, Plane
from gapwalk.attractors.strobe import Strobe, at_phase, check_count
from gapwalk.errors import ModelError
from gapwalk.flow.flow import PERIOD, Flow, flow_of
from gapwalk.flow.motion import Motion, check_state
from gapwalk.model.coefficients import coefficients_of
from gapwalk.model.system import System

_SAMPLES = 128  # samples per forcing period between which crossings are bracketed
_EXACT = 1e-13  # tolerance of an angle


@dataclass(frozen=True, eq=False)
class Section:
    """States of one motion at one phase, or on one plane.

    Attributes
    ----------
    system
        The system that moves.
    theta : shape (count,)
        Angle of the excitation at each state, in radians.
    states : shape (count, 2n)
        Positions, then velocities.
    text
        The plane or phase of the section, in words.
    """

    system: System
    theta: NDArray[np.float64]
    states: NDArray[np.float64]
    text: str

    def __len__(self) -> int:
        return len(self.theta)

    @property
    def phase(self) -> NDArray[np.float64]:
        """Phase of the excitation at each state, from 0 to one period, in radians; shape (count,)."""
        return self.theta % PERIOD

    def signal(self, name: str) -> NDArray[np.float64]:
        """Return one signal at each state, by the names of `Motion.signal`; shape (count,)."""
        n = self.system.size
        return Motion(self.system, self.theta, self.states[:, :n], self.states[:, n:], ()).signal(name)


def strobe(system: System, state: NDArray[np.float64], periods: int = 1000, phase: float = 0.0) -> Section:
    """Compute the stroboscopic section: states one forcing period apart.

    Parameters
    ----------
    system
        The system.
    state : shape (2n,)
        A state of the settled motion at theta = 0.
    periods
        Number of states.
    phase
        Angle of the excitation at the states, in radians, 0 <= phase < 2 pi.

    Raises
    ------
    ModelError
        For an invalid state, number or phase.
    FlowError
        If the motion diverges.
    """
    check_count("periods", periods)
    if not 0.0 <= phase < PERIOD:
        raise ModelError(f"phase is {phase!r}; it must be an angle in radians, at least 0 and less than 2 pi")
    first = at_phase(system, check_state(system, state), phase)
    states = np.vstack((first, Strobe(system, phase).run(first, periods - 1)))
    thetas = phase + PERIOD * np.arange(periods, dtype=np.float64)
    return Section(system, thetas, states, f"phase {phase / PERIOD:.4g} of the period")


def section(system: System, state: NDArray[np.float64], plane: Plane, periods: int = 1000) -> Section:
    """Find the states at which a motion crosses a plane, each to rounding on the exact flow.

    Crossings are bracketed between 128 samples per forcing period. Two crossings between successive samples are found
    by means of the turning point between them. A motion that starts on the plane does not cross it there.

    Parameters
    ----------
    system
        The system.
    state : shape (2n,)
        A state of the settled motion at theta = 0.
    plane
        The plane, and the direction of crossing.
    periods
        Number of forcing periods for which the motion is followed.

    Raises
    ------
    ModelError
        For an invalid state, number or plane.
    FlowError
        If the motion diverges.
    """
    check_count("periods", periods)
    crossings = _Crossings(system, plane)
    current, start = check_state(system, state), 0.0
    for _ in range(periods):
        current = crossings.follow(current, start)
        start += PERIOD
    thetas = np.array([theta for theta, _ in crossings.found])
    states = np.array([found for _, found in crossings.found]).reshape(-1, 2 * system.size)
    return Section(system, thetas, states, plane.text)


class _Crossings:
    """Finds the crossings of one plane by one motion, one forcing period at a time."""

    def __init__(self, system: System, plane: Plane) -> None:
        self._plane, self._height = plane, Height(system, plane)
        self._flow, self._coefficients = flow_of(system), coefficients_of(system)
        self.found: list[tuple[float, NDArray[np.float64]]] = []

    def follow(self, state: NDArray[np.float64], start: float) -> NDArray[np.float64]:
        """Record all crossings of the period that begins at `start`; return the state at its end."""
        thetas = start + PERIOD * np.arange(_SAMPLES + 1) / _SAMPLES
        states, _ = self._flow.sample(self._coefficients, state, thetas)
        heights, slopes = self._height.of(states), self._height.slope(thetas, states)
        crossed = np.sign(heights[:-1]) != np.sign(heights[1:])
        approaching = (heights[:-1] * slopes[:-1] < 0.0) & (heights[1:] * slopes[1:] > 0.0)
        for k in np.flatnonzero(crossed | approaching):
            step = _Step(self._flow, self._coefficients, float(thetas[k]), float(thetas[k + 1]), states[k])
            for theta, before in step.crossings(self._height):
                if self._plane.crossing.takes(before):
                    self.found.append((theta, step.at(theta)))
        return states[-1]


class _Step:
    """A short interval of a motion in which it may cross a plane."""

    def __init__(self, flow: Flow, coefficients, start: float, stop: float, state: NDArray[np.float64]) -> None:
        self._flow, self._coefficients = flow, coefficients
        self.start, self.stop, self.state = start, stop, state

    def at(self, theta: float) -> NDArray[np.float64]:
        """Return the state at an angle in the interval."""
        if theta <= self.start:
            return self.state
        return self._flow.integrate(self._coefficients, self.state, self.start, theta).state

    def crossings(self, height: Height) -> list[tuple[float, float]]:
        """Return the angles of the crossings in order, each with the height before it."""

        def level(theta: float) -> float:
            return float(height.of(self.at(theta)))

        def slope(theta: float) -> float:
            return float(height.slope(theta, self.at(theta)))

        first, last = level(self.start), level(self.stop)
        if first == 0.0:  # starts on the plane: that crossing belongs to the previous interval
            first = slope(self.start)
            return [] if first * last > 0.0 else self._later(level, slope, first)
        if first * last <= 0.0:
            return [(_root(level, self.start, self.stop), first)]
        turn = _root(slope, self.start, self.stop)
        middle = level(turn)
        if middle * first >= 0.0:
            return []
        return [(_root(level, self.start, turn), first), (_root(level, turn, self.stop), middle)]

    def _later(self, level: Callable[[float], float], slope: Callable[[float], float], first: float):
        """Find the crossing of an interval that starts on the plane and ends on the side opposite to its first move."""
        turn = _root(slope, self.start, self.stop)
        return [(_root(level, turn, self.stop), first)]


def _root(function: Callable[[float], float], start: float, stop: float) -> float:
    from scipy.optimize import brentq  # imported late: it takes long

    value = brentq(function, start, stop, xtol=_EXACT, rtol=4 * np.finfo(float).eps)
    assert isinstance(value, float)
    return value

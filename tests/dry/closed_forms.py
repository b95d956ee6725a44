"""Closed forms of motions with friction and impacts, from the literature or derived here."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np


def den_hartog(ratio: float, fraction: float) -> float:
    """Amplitude over static deflection of an oscillator with Coulomb friction that does not stick (Den Hartog 1931).

    The equation is ``x'' + x + fraction sgn x' = cos(ratio t)``. Over half a period the motion is a free vibration
    about ``fraction`` beside the forced one, and ends with the negative of its start.
    """
    forced = 1.0 / (1.0 - ratio**2)
    friction = math.sin(math.pi / ratio) / (ratio * (1.0 + math.cos(math.pi / ratio)))
    return math.sqrt(forced**2 - (fraction * friction) ** 2)


class OneImpact(NamedTuple):
    """A motion with one impact a period: phase ``W t`` of the impact, and the velocity after it."""

    phase: float
    velocity: float


def one_impact(amplitude: float, damping: float = 0.1, wall: float = 1.0, restitution: float = 0.8) -> list[OneImpact]:
    """Motions of ``x'' + damping x' + x = amplitude cos t`` below a rigid wall, with one impact a period.

    Beside the forced motion ``amplitude/damping sin t`` flies a free vibration that has the same position ``g`` at both
    ends of the flight. Its rates there are ``first g`` and ``last g``; the impact makes the velocity after it
    ``slope g``. Position and rate of the forced motion at the impact then give a quadratic equation for ``g``.
    """
    first, slope = _flight(damping, restitution)
    size = amplitude / damping
    # (wall - g)^2 + ((slope - first) g)^2 = size^2
    a, b, c = 1.0 + (slope - first) ** 2, -wall, wall**2 - size**2
    root = math.sqrt(b * b - a * c)
    found = []
    for g in ((-b + root) / a, (-b - root) / a):
        phase = math.atan2(wall - g, (slope - first) * g)
        found.append(OneImpact(phase, slope * g))
    return found


def one_impact_fold(damping: float = 0.1, wall: float = 1.0, restitution: float = 0.8) -> float:
    """Amplitude at the fold of these motions: there the quadratic equation has one solution."""
    first, slope = _flight(damping, restitution)
    return damping * wall * abs(slope - first) / math.hypot(1.0, slope - first)


def _flight(damping: float, restitution: float) -> tuple[float, float]:
    """Rate of that free vibration at its start over its position there, and the velocity after the impact over it."""
    decay, pace, time = 0.5 * damping, math.sqrt(1.0 - 0.25 * damping**2), 2.0 * math.pi
    fading, cosine, sine = math.exp(-decay * time), math.cos(pace * time), math.sin(pace * time)
    # h = exp(-decay t) (cos pace t + s sin pace t), h(time) = 1
    s = (1.0 / fading - cosine) / sine
    first = -decay + pace * s
    last = -decay + fading * pace * (s * cosine - sine)
    return first, (first - last) / (1.0 + 1.0 / restitution)


def budd_dux(periods: int, restitution: float) -> float:
    """Speed before the impact of ``x'' + x = cos W t``, ``x <= 0``, ``W = 2 periods``: one in so many periods.

    Budd and Dux 1994. The impact is at ``W t = pi/2``; the state map over it has the determinant ``restitution**2``.
    """
    frequency = 2.0 * periods
    return 2.0 * frequency / ((frequency**2 - 1.0) * (1.0 - restitution))


def chatter(height: float, gravity: float, restitution: float, count: int) -> tuple[np.ndarray, float]:
    """Times of the first impacts of a ball that falls on a plate from rest, and the time at which it rests."""
    fall = math.sqrt(2.0 * height / gravity)
    flights = 2.0 * fall * restitution ** np.arange(1, count)
    return fall + np.concatenate(([0.0], np.cumsum(flights))), fall * (1.0 + restitution) / (1.0 - restitution)


def soft_restitution(stiffness: float, damping: float, mass: float = 1.0) -> float:
    """Restitution of an elastic stop with a viscous damper, which acts until the deflection has returned.

    Half a period of a damped free vibration; there is no other force, or the stop is stiff. Friction and other
    elements have no part in an impulse, so ``mass`` is ``1 / (e . M^-1 d)``.
    """
    ratio = damping / (2.0 * math.sqrt(stiffness * mass))
    return math.exp(-ratio * math.pi / math.sqrt(1.0 - ratio**2))


def jenkins_loss(stiffness: float, limit: float, amplitude: float) -> float:
    """Energy that a Jenkins element dissipates a period under a harmonic deflection; 0 if it does not slip."""
    return 4.0 * limit * max(amplitude - limit / stiffness, 0.0)

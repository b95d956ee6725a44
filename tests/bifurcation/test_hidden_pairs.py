"""Pairs of changes of friction that cancel within a step: the rule of bends, on margins whose zeros are known."""

import math
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from gapwalk.bifurcation import friction_along_branch
from gapwalk.bifurcation.friction_along_branch import find_changes
from gapwalk.bifurcation.special_point import StepInterval
from gapwalk.flow.flow import PERIOD
from gapwalk.orbit.sticking import FrictionPhase, Margin

THETA = 1.0  # the angle at which the slip of the first contact is interrupted


class Walk(StepInterval):
    """A step of a walk along which two margins are given: the first of a stick within slip, and another one."""

    def __init__(self, first: float, last: float, value: Callable[[float], float], other: Callable[[float], float]):
        self._value, self._other, self.tried = value, other, 0
        corrector: Any = SimpleNamespace(equation=None)
        super().__init__(corrector, self.point(first), self.point(last))

    def point(self, arclength: float) -> Any:
        value, other = self._value(arclength), self._other(arclength)
        slips = [FrictionPhase(1, 0.0, math.pi), FrictionPhase(-1, math.pi, PERIOD)]
        if value < 0.0:
            ends = THETA + 1e-3 * arclength, THETA + 1e-3 * (arclength + math.sqrt(-value))
            slips[:1] = FrictionPhase(1, 0.0, ends[0]), FrictionPhase(0, *ends), FrictionPhase(1, ends[1], math.pi)
        margins = [Margin(1, "stop", 1, 2.0, other, 10.0)]
        if value >= 0.0:
            margins.append(Margin(0, "rate", 1, THETA, value, 10.0))
        full = [FrictionPhase(1, 0.0, math.pi), FrictionPhase(-1, math.pi, PERIOD)]
        orbit = SimpleNamespace(
            friction={0: slips, 1: full}, margins=margins, is_exact=True, period=1, stuck=(), slips=(), value=value
        )
        return SimpleNamespace(arclength=arclength, orbit=orbit, memo={})

    def _between(self, a: Any, b: Any, arclength: float) -> Any:
        self.tried += 1
        return self.point(arclength)


def margin(rng: np.random.Generator, middle: float, half: float, step: float) -> Callable[[float], float]:
    """A margin that vanishes at two places beside a middle, and bends on the scale of the step or a longer one."""
    size = 10.0 ** rng.uniform(-3.0, 3.0)
    a, pace = rng.uniform(-0.3, 0.3) / step, rng.uniform(0.1, 1.0) / step
    own, by_cosine = size / step**2, rng.random() < 0.5

    def value(arclength: float) -> float:
        u = arclength - middle
        if by_cosine:  # cos(p half) - cos(p u), without cancellation
            product = math.sin(0.5 * pace * (u + half)) * math.sin(0.5 * pace * (u - half))
            return 2.0 * size * product
        return own * (u - half) * (u + half) * math.exp(a * u)

    return value


def jump(rng: np.random.Generator, first: float, last: float) -> Callable[[float], float]:
    """A margin that jumps somewhere in a step, by any amount, or does not."""
    place, size, slope = rng.uniform(first, last), rng.choice([0.0, 10.0 ** rng.uniform(-6.0, 1.0)]), rng.uniform(-1, 1)
    level = 10.0 ** rng.uniform(-6.0, 1.0) + abs(slope) * 3.0 * (last - first)
    return lambda arclength: level + slope * (arclength - first) + size * (arclength > place)


@pytest.mark.parametrize("seed", range(3))
def test_no_pair_of_changes_in_a_step_is_missed(seed: int, monkeypatch) -> None:
    """Steps of any length, and pairs anywhere in them, as close as `finest`; beside a jump as close as stated there."""
    monkeypatch.setattr(friction_along_branch, "margin", lambda orbit, change, near: (THETA, orbit.value))
    rng, missed, tried = np.random.default_rng([44, seed]), [], 0
    for _ in range(100):
        first = rng.uniform(0.0, 10.0)
        step = 10.0 ** rng.uniform(-4.0, 0.0)
        before = first - step * rng.uniform(0.3, 2.0)
        middle = first + step * rng.uniform(0.05, 0.95)
        most = 0.45 * min(middle - first, first + step - middle)
        own = np.random.default_rng(rng.integers(2**32))
        other = jump(own, before, first + step)
        least = 0.6 * min(1e-6, max(1e-11, 1e-4 * step))
        half = most * (least / most) ** rng.random() if least < most else most
        value = margin(own, middle, half, step)
        walk = Walk(first, first + step, value, other)
        ends = walk.points
        found = find_changes(walk, walk.point(before), ends[0], ends[1])
        tried += walk.tried
        places = [each.point.arclength for each in found]
        if len(places) != 2 or np.abs(np.array(places) - [middle - half, middle + half]).max() > 1e-10:
            missed.append((first, step, before, middle, half, places, walk.finest))
    assert missed == []
    assert tried < 100 * 120

"""Second computation of multipliers and stability, with another number of segments."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gapwalk.orbit.floquet import multipliers
from gapwalk.orbit.orbit import Orbit
from gapwalk.orbit.shooting import Shooting, ShootingEquation

_CONTRACTION = 6.0  # logarithm of the change of volume in one segment, beyond which digits are lost
_MOST = 24  # largest number of segments
_POWERS = 6


@dataclass(frozen=True, eq=False)
class Reshot:
    """Result of shooting an orbit again, with more segments.

    Attributes
    ----------
    multipliers : shape (2n,)
        Largest modulus first.
    contraction
        Logarithm of the factor by which volumes of the state space change, from the determinants of the segments.
    growth
        Largest factor by which a small change of the state grows over the period; at least 1.
    """

    multipliers: NDArray[np.complex128]
    contraction: float
    growth: float


def reshoot(orbit: Orbit, segments: int, contraction: float) -> Reshot:
    """Shoot an orbit again with more than `segments`; `contraction` is the logarithm of its change of volume."""
    count = min(_MOST, max(segments + 1, math.ceil(abs(contraction) / _CONTRACTION)))
    equation = ShootingEquation(orbit.system, None, orbit.period, Shooting(count))
    arcs = equation.evaluate(equation.unknowns(orbit), 0.0).evidence
    logarithms = [np.linalg.slogdet(arc.transition) for arc in arcs]
    total = sum(float(size) if sign > 0.0 else math.nan for sign, size in logarithms)
    units = np.repeat([1.0, orbit.system.frequency], orbit.system.size)
    around = np.eye(len(units))
    for arc in arcs:
        around = arc.transition @ around
    growth = float(np.linalg.norm(around * units / units[:, None], 2))
    return Reshot(multipliers([arc.transition for arc in arcs]), total, max(1.0, growth))


def spread(orbit: Orbit, segments: int, contraction: float, asides: Sequence[NDArray[np.float64]]) -> float:
    """Return the variation of the multipliers over some small changes of the state: the largest `distance`."""
    there = reshoot(orbit, segments, contraction).multipliers
    beside = [reshoot(replace(orbit, state=orbit.state + aside), segments, contraction) for aside in asides]
    return max(distance(there, each.multipliers) for each in beside)


def distance(a: NDArray[np.complex128], b: NDArray[np.complex128]) -> float:
    """Return the distance of two sets of multipliers: the largest relative difference of their power sums.

    Multipliers that are about to collide are as sensitive as square roots. Their power sums, the traces of the powers
    of the monodromy matrix, are not.
    """
    size = max(1.0, float(np.abs(a).max()), float(np.abs(b).max()))
    powers = range(1, min(len(a), _POWERS) + 1)
    return max(abs(complex(np.sum((a / size) ** k) - np.sum((b / size) ** k))) for k in powers)

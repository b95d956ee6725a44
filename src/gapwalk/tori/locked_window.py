"""Locked motions: where a rotation number is a fraction p/q, periodic motions take the place of a torus.

They are q points on each of its m curves, an orbit of m q forcing periods, half of them stable in general, half not.
Both kinds meet in folds at the two ends of the window in which the motion is locked.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from gapwalk.bifurcation.follow import follow
from gapwalk.bifurcation.special_point_kind import Kind
from gapwalk.continuation.step_size import WalkOptions
from gapwalk.errors import GapwalkError, NumericalError
from gapwalk.orbit.orbit import Orbit, true_period
from gapwalk.orbit.orbit_equation import Newton, solve
from gapwalk.orbit.shooting import ShootingEquation
from gapwalk.tori.closed_curve import TURN
from gapwalk.tori.torus import Torus

_STARTS = 4  # phases, within one q-th of a turn, from which orbits are looked for
_NEWTON = Newton(iterations=15, halvings=3)
_NEAR = 0.3  # largest distance of a locked orbit from the torus, as a share of its size
_STEPS = WalkOptions(initial_step=1e-4, largest_step=2e-3, max_points=300)
_PERIODS = 120  # the longest orbits that are looked for, in forcing periods


@dataclass(frozen=True, eq=False)
class LockedWindow:
    """Range of the parameter in which motions lock to a fraction.

    Attributes
    ----------
    ratio
        The fraction p/q.
    low, high
        Ends of the range: folds of the locked orbits. An end that was not reached is the last value that was.
    is_whole
        True if both ends are folds.
    orbit
        A locked orbit, stable if there is a stable one.

    Examples
    --------
    >>> windows = [event.window for event in tori.events if event.window is not None]
    >>> all(window.width < 1e-6 for window in windows)
    True
    """

    ratio: Fraction
    low: float
    high: float
    is_whole: bool
    orbit: Orbit

    @property
    def width(self) -> float:
        """Width of the range."""
        return self.high - self.low

    @property
    def words(self) -> str:
        """The range and the period, in words."""
        what = f"period {self.orbit.period}, {'stable' if self.orbit.stable else 'unstable'}"
        return f"{what}, over {'' if self.is_whole else 'at least '}{self.width:.2g} from {self.low:.9g}"


def locked_window(
    torus: Torus, ratio: Fraction, parameter: str, value: float, within: tuple[float, float]
) -> LockedWindow | None:
    """Find the orbits to which a motion locks near a torus whose rotation number is nearly a fraction.

    Parameters
    ----------
    torus
        A torus next to the resonance.
    ratio
        The fraction p/q.
    parameter
        Name of the parameter.
    value
        Value at which the rotation number of the family is the fraction.
    within
        The range in which the locked orbits are followed.
    """
    period = torus.curves * ratio.denominator
    if period > _PERIODS:
        return None
    orbit = _orbit(torus, period, ratio.denominator, parameter, value)
    if orbit is None:
        return None
    low, high = min(*within, value), max(*within, value)
    try:
        branch = follow(orbit, parameter, (low, high), walk=_STEPS)
    except GapwalkError:
        return LockedWindow(ratio, value, value, False, orbit)
    folds = sorted(each.value for each in branch.special_points if each.kind is Kind.FOLD)
    stable = [point.orbit for point in branch.points if point.stable]
    values = [point.value for point in branch.points]
    is_whole = len(folds) >= 2
    ends = (folds[0], folds[-1]) if is_whole else (min(values), max(values))
    return LockedWindow(ratio, *ends, is_whole, stable[len(stable) // 2] if stable else orbit)


def _orbit(torus: Torus, period: int, parts: int, parameter: str, value: float) -> Orbit | None:
    system = torus.system.at({parameter: value})
    equation = ShootingEquation(system, None, period)
    unit = system.state_scales()
    for share in np.arange(_STARTS) / (_STARTS * parts):
        start = torus.state(TURN * float(share))
        try:
            unknowns, evaluation = solve(equation, start, 0.0, _NEWTON)
        except NumericalError:
            continue
        away = (torus.states - unknowns) / unit
        orbit = equation.orbit(unknowns, 0.0, evaluation)
        if np.abs(away).max(axis=1).min() < _NEAR * torus.size and true_period(orbit) == period:
            return orbit
    return None

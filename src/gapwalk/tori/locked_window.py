"""Locked motions: where a rotation number is a fraction p/q, periodic motions take the place of a torus.

They are q points on each of its m curves, an orbit of m q forcing periods, half of them stable in general, half not.
Both kinds meet in folds at the two ends of the window in which the motion is locked.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np

from gapwalk.bifurcation.branch import Branch
from gapwalk.bifurcation.follow import BranchWalk, walk
from gapwalk.bifurcation.special_point import SpecialPoint
from gapwalk.bifurcation.special_point_kind import Kind
from gapwalk.continuation.corrector import Corrector
from gapwalk.continuation.step_size import WalkOptions
from gapwalk.continuation.walk_scales import powers_of_two
from gapwalk.errors import ConvergenceError, GapwalkError, ModelError, NumericalError
from gapwalk.orbit.orbit import Orbit, true_period
from gapwalk.orbit.orbit_equation import Newton, solve
from gapwalk.orbit.shooting import ShootingEquation
from gapwalk.tori.closed_curve import TURN
from gapwalk.tori.torus import Torus, relative_size

_STARTS = 4  # phases, within one q-th of a turn, from which orbits are looked for
_NEWTON = Newton(iterations=15, halvings=3)
_NEAR = 0.3  # largest distance of a locked orbit from the torus, as a share of its size
_STEPS = WalkOptions(initial_step=1e-4, largest_step=2e-3, max_points=300)
_FIRST, _LONGEST = 0.01, 0.05  # such steps, over the way along the curve after which the branch closes on itself
_REPEATED = 1e-2  # distance of two folds that are the same, over the width of the window
_TURNED = 1e-4  # radians over which the direction of the curve is taken
_PERIODS = 120  # the longest orbits that are looked for, in forcing periods


@dataclass(frozen=True, eq=False)
class LockedWindow:
    """Range of the parameter in which motions lock to a fraction.

    Examples
    --------
    >>> windows = [event.window for event in tori.events if event.window is not None]
    >>> all(window.width < 1e-6 for window in windows)
    True
    """

    ratio: Fraction  #: The fraction p/q.
    #: low, high: Ends of the range: folds of the locked orbits. An end that was not reached is the last value that was.
    low: float
    high: float
    is_whole: bool  #: True if both ends are folds.
    orbit: Orbit  #: A locked orbit, stable if there is a stable one.
    folds: tuple[SpecialPoint, ...] = ()  #: The folds at both ends, the lower one first; empty if they were not found.

    def _check_read(self) -> None:
        """Raise a ValueError if its folds are not its ends."""
        if self.folds and tuple(each.value for each in self.folds) != (self.low, self.high):
            raise ValueError("the folds of a locked window are not its ends")

    @property
    def width(self) -> float:
        """Width of the range."""
        return self.high - self.low

    def distance(self, value: float) -> float:
        """Return the distance of a value of the parameter from the range; 0 inside.

        Examples
        --------
        >>> window.distance(window.low)
        0.0
        """
        return max(self.low - value, value - self.high, 0.0)

    @property
    def words(self) -> str:
        """The range and the period, in words."""
        what = f"period {self.orbit.period}, {self.orbit.instability.words}"
        return f"{what}, over {'' if self.is_whole else 'at least '}{self.width:.2g} from {self.low:.9g}"


def find_window(
    torus: Torus, ratio: Fraction | str, parameter: str, near: float, to: tuple[float, float]
) -> LockedWindow:
    """Find the window in which motions lock to a fraction, from a torus next to it.

    Parameters
    ----------
    torus
        A torus whose rotation number is close to the fraction.
    ratio
        The fraction p/q, as ``"1/3"``.
    parameter
        Name of the parameter.
    near
        Value of the parameter inside the window, such as that at which the rotation number of a family is the fraction.
    to
        The range in which the locked orbits are followed.

    Returns
    -------
    LockedWindow
        The window, with its two folds if both ends are in the range.

    Raises
    ------
    ModelError
        If `ratio` is no fraction, its orbits are too long, or `near` lies outside of the range.
    ConvergenceError
        If no locked orbit is found there.

    Examples
    --------
    >>> found = gw.tori.find_window(locking, "1/3", "frequency", 3.0, (2.9, 3.1))
    >>> found.is_whole, found.orbit.period
    (True, 3)
    """
    try:
        fraction = Fraction(ratio)
    except (ValueError, ZeroDivisionError):
        raise ModelError(f"ratio is {ratio!r}; write a fraction, as in ratio='1/3'") from None
    if not min(to) <= near <= max(to):
        raise ModelError(f"near is {near:g}, outside the range from {min(to):g} to {max(to):g}")
    if torus.curves * fraction.denominator > _PERIODS:
        raise ModelError(f"orbits of {fraction} repeat after {torus.curves * fraction.denominator} forcing periods; "
                         f"at most {_PERIODS} are looked for")  # fmt: skip
    window = locked_window(torus, fraction, parameter, near, to)
    if window is None:
        raise ConvergenceError(
            f"no orbits of {torus.curves * fraction.denominator} forcing periods were found near the torus at "
            f"{parameter} = {near:.8g}; give another value of near, where the rotation number is {fraction}"
        )
    return window


def locked_window(
    torus: Torus, ratio: Fraction, parameter: str, value: float, within: tuple[float, float]
) -> LockedWindow | None:
    """Find the orbits to which a motion locks near a torus whose rotation number is nearly a fraction."""
    period = torus.curves * ratio.denominator
    if period > _PERIODS:
        return None
    low, high = min(*within, value), max(*within, value)
    orbit = _orbit(torus, period, ratio.denominator, parameter, value)
    if orbit is None:
        orbit = _orbit_at_phase(torus, period, ratio.denominator, parameter, value, (low, high))
    if orbit is None:
        return None
    value = orbit.system[parameter]
    try:
        branch = _once_round(walk(orbit, parameter, (low, high), walk=_steps(torus, ratio.denominator)))
    except GapwalkError:
        return LockedWindow(ratio, value, value, False, orbit)
    folds = sorted(branch.special(Kind.FOLD), key=lambda each: each.value)
    stable = [point.orbit for point in branch.points if point.stable]
    values = [point.value for point in branch.points]
    chosen = stable[len(stable) // 2] if stable else orbit
    # in a window as narrow as rounding, folds cannot be distinguished
    if len(folds) < 2 or folds[-1].value - folds[0].value <= folds[0].uncertainty + folds[-1].uncertainty:
        return LockedWindow(ratio, min(values), max(values), False, chosen)
    return LockedWindow(ratio, folds[0].value, folds[-1].value, True, chosen, (folds[0], folds[-1]))


def _steps(torus: Torus, parts: int) -> WalkOptions:
    """Return the steps along locked orbits: from one to the next they pass one of so many parts of the curve."""
    part = TURN * relative_size(torus) / parts
    first, longest = min(_STEPS.initial_step, _FIRST * part), min(_STEPS.largest_step, _LONGEST * part)
    return replace(_STEPS, initial_step=first, largest_step=longest)


def _once_round(steps: BranchWalk) -> Branch:
    """Return a branch, walked until its folds repeat: then each orbit has taken the place of the next one on the curve.

    Their places may be too near to each other for the walk to see that the branch has closed.
    """
    folds: list[float] = []
    for _ in steps:
        folds += [each.value for each in steps.special_points if each.kind is Kind.FOLD]
        if len(folds) > 2 and abs(folds[-1] - folds[0]) < _REPEATED * abs(folds[1] - folds[0]):
            break
    return steps.branch


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


def _orbit_at_phase(
    torus: Torus, period: int, parts: int, parameter: str, value: float, within: tuple[float, float]
) -> Orbit | None:
    """Return a locked orbit at a given phase of the torus, and at a value of the parameter that follows from it.

    A window may be narrower than the error of `value`, so that no orbit exists there. Its orbits have all phases, each
    at a value of its own: the state may then move in all directions but along the curve, and the parameter varies.
    """
    system = torus.system.at({parameter: value})
    equation, unit = ShootingEquation(system, parameter, period), system.state_scales()
    corrector = Corrector(equation, powers_of_two(np.append(unit, abs(value) or 1.0)))
    for share in np.arange(_STARTS) / (_STARTS * parts):
        psi = TURN * float(share)
        along = (torus.state(psi + _TURNED) - torus.state(psi - _TURNED)) / corrector.scales[:-1]
        normal = np.append(along / np.linalg.norm(along), 0.0)
        found = corrector.correct(np.append(torus.state(psi), value) / corrector.scales, normal)
        if found is None:
            continue
        unknowns, place = found.x[:-1] * corrector.scales[:-1], float(found.x[-1] * corrector.scales[-1])
        away = np.abs((torus.states - unknowns) / unit).max(axis=1).min()
        if not within[0] <= place <= within[1] or away >= _NEAR * torus.size:
            continue
        orbit = equation.orbit(unknowns, place, found.evaluation)
        if true_period(orbit) == period:
            return orbit
    return None

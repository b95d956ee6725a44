"""Jumps of a run-up beside the folds of the response, at which a slow sweep would jump."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.bifurcation.branch import Branch
from gapwalk.bifurcation.kinds import Kind
from gapwalk.errors import ModelError
from gapwalk.model.system import System
from gapwalk.model.words import value_words

if TYPE_CHECKING:
    from gapwalk.answers.run_up import RunUp

_BESIDE = 6  # points of a branch next to a fold, which lie on one side of it
_NEAR = 0.25  # share of a jump by which a motion may differ from that at the fold and still follow the branch
_OTHER = 0.05  # share of the range of a branch by which another motion differs from that at a fold


class JumpDelay(NamedTuple):
    """A jump that a run-up makes after the fold of a branch at which a slow sweep would jump.

    Examples
    --------
    >>> delay = gw.records.JumpDelay(fold=1.39, jump=1.42, delay=1.5)
    >>> delay.words(system)
    'jump at Ω = 1.42, a time of 1.5 after the fold at Ω = 1.39, where a slow sweep jumps'
    """

    fold: float  #: Speed of the fold.
    #: Speed at which the run-up is half way between the motions before and after. NaN if it never is, or if it does not
    #: follow the branch up to the fold.
    jump: float
    delay: float  #: Time from the fold to the jump.

    def words(self, system: System) -> str:
        """Return the jump and its delay as a sentence."""
        pace, units = system.structure.pace, system.units
        fold = f"the fold at {value_words(self.fold, pace, units, 6)}, where a slow sweep jumps"
        if np.isnan(self.jump):
            return f"no jump after {fold}: the motion did not follow the response up to there, or not beyond"
        late = f"{self.delay:.3g} s" if units else f"a time of {self.delay:.4g}"
        return f"jump at {value_words(self.jump, pace, units, 6)}, {late} after {fold}"


def jump_delays(run: RunUp, branch: Branch, coordinate: str) -> tuple[JumpDelay, ...]:
    """Compare the jumps of a run-up with the folds of a branch, as in `RunUp.delays`."""
    pace, measure = run.system.structure.pace, f"half.{coordinate}"
    if branch.parameter != pace:
        raise ModelError(f"the branch is over {branch.parameter}; a run-up needs a response over {pace}")
    if not run.course.is_one_way:
        raise ModelError("the speed changes its direction; delays are known for a run-up or a run-down alone")
    sign = np.sign(run.course.speed[-1] - run.course.speed[0])
    speed, half = run.half(coordinate)
    values = np.array([point.value for point in branch.points])
    sizes = np.array([point.measure(measure) for point in branch.points])
    stable = np.array([point.orbit.stable for point in branch.points])
    found = []
    for special in branch.special_points:
        if special.kind is not Kind.FOLD or not speed.min() < special.value < speed.max():
            continue
        before = special.point.measure(measure)
        far = np.hypot((values - special.value) / np.ptp(values), (sizes - before) / (np.ptp(sizes) or 1.0))
        beside = np.argsort(far, kind="stable")[:_BESIDE]
        if sign * (np.mean(values[beside]) - special.value) > 0.0 or not stable[beside].any():
            continue  # a stable motion ends there for the other direction, or none does
        steps = np.flatnonzero(
            stable[:-1] & stable[1:] & ((values[:-1] < special.value) != (values[1:] < special.value))
        )
        shares = (special.value - values[steps]) / (values[steps + 1] - values[steps])
        others = sizes[steps] + shares * (sizes[steps + 1] - sizes[steps])
        others = others[np.abs(others - before) > _OTHER * np.ptp(sizes)]
        if not len(others):
            continue
        after = others[np.argmin(np.abs(others - before))]
        beyond, is_after = sign * (speed - special.value) > 0.0, np.abs(half - after) < np.abs(half - before)
        jumped = np.flatnonzero(beyond & is_after)
        follows = np.abs(half[~beyond][-1] - before) < _NEAR * abs(after - before)  # in the last period before it
        jump = float(speed[jumped[0]]) if len(jumped) and follows else float("nan")
        times = np.interp([special.value, jump], *_increasing(run.speed, run.time))
        found.append(JumpDelay(special.value, jump, float(times[1] - times[0])))
    return tuple(found)


def _increasing(x: NDArray[np.float64], y: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    return (x, y) if x[-1] > x[0] else (x[::-1], y[::-1])

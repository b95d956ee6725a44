"""One random system through all that computes motions; a step without a result or a reason is a fault."""

from __future__ import annotations

import math
import signal
import time
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any, TypeVar

import numpy as np

import gapwalk as gw
from gapwalk.attractors import ClassifyOptions, LyapunovOptions, SettleOptions, classify, lyapunov
from gapwalk.continuation.walk import EndReason
from gapwalk.errors import GapwalkError, Interrupted
from gapwalk.verification.dry_dop853 import carry

LONGEST = 60.0
"""Seconds of processor time after which a step counts as a hang, if the trial has no cap."""

_WALK = gw.WalkOptions(max_points=400)
_SETTLE = SettleOptions(max_periods=2000, max_period=16)
_LYAPUNOV = LyapunovOptions(max_periods=256)
_EXPONENTS = LyapunovOptions(max_periods=1024)  # along orbits, where slow decay takes long to show
_CLOSED, _SAME = 1e-9, 1e-6  # of the independent integrator, as in gapwalk.verification
_STEPS, _POINTS = 5, 20  # of the sweep
_SHARE = 0.5  # of the time that is left, for one step
Result = TypeVar("Result")


class HangError(KeyboardInterrupt):
    """A step that took too long; as after Ctrl-C, what it has found is kept."""


@contextmanager
def at_most(seconds: float) -> Iterator[list[float]]:
    """Raise a HangError in the middle of what takes more processor time; the list then has the number of seconds."""
    fired: list[float] = []

    def stop(*_: object) -> None:
        fired.append(seconds)
        raise HangError

    before = signal.signal(signal.SIGPROF, stop)
    signal.setitimer(signal.ITIMER_PROF, seconds, 1.0)
    try:
        yield fired
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)


@dataclass
class Trial:
    """Results and faults of one system.

    Attributes
    ----------
    name
        Which system.
    faults
        Results that verification refuses, exceptions that are no errors of gapwalk, and hangs, in sentences.
    ends
        What each step ended with: a result, or the reason why there is none.
    seconds
        Processor time of each step.
    note
        An error before the first step.
    cap
        Processor time, in seconds, that all steps take at most; a step has half of what the steps before it have left.
    slow
        True if a step was cut off, since it took longer than that.
    outcome
        What became of the branch: why it ended, or why there is none.
    """

    name: str
    faults: list[str] = field(default_factory=list)
    ends: dict[str, str] = field(default_factory=dict)
    seconds: dict[str, float] = field(default_factory=dict)
    note: str = ""
    cap: float = math.inf
    slow: bool = False
    outcome: str = ""

    @property
    def agrees(self) -> bool:
        """True if there is no fault."""
        return not self.faults

    def __str__(self) -> str:
        ends = "".join(f"\n    {step}: {end} ({self.seconds[step]:.1f} s)" for step, end in self.ends.items())
        return self.note or ends + "".join(f"\n    FAULT {each}" for each in self.faults)

    def step(self, name: str, work: Callable[[], Result], words: Callable[[Result], str]) -> Result | None:
        """Do one step; None if there is no result."""
        is_capped = math.isfinite(self.cap)
        longest = _SHARE * (self.cap - sum(self.seconds.values())) if is_capped else LONGEST
        begin, found, fired = time.process_time(), None, list[float]()
        try:
            with at_most(longest) as fired:
                found = work()
            self.ends[name] = words(found)
        except (HangError, Interrupted) as stop:
            if not fired:
                raise
            found = getattr(stop, "found", None)
            self.slow, self.ends[name] = True, f"too slow: it was cut off after {fired[0]:.0f} s"
            if not is_capped:
                self.faults.append(f"{name}: it took more than {LONGEST:g} s")
        except GapwalkError as error:
            self.ends[name] = f"{type(error).__name__}: {error}"
            if len(str(error)) < 20:
                self.faults.append(f"{name}: {self.ends[name]} is no reason")
        except Exception as error:  # whatever it is: it must not come out
            self.ends[name] = f"{type(error).__name__}: {error}"
            self.faults.append(f"{name}: {''.join(traceback.format_exception(error)[-4:])}")
        self.seconds[name] = round(time.process_time() - begin, 2)
        return found


def attempt(name: str, system: gw.System, factor: float = 1.3, sampled: int = 0, cap: float = math.inf) -> Trial:
    """Search an orbit, walk and verify its branch, classify the settled motion, and sweep.

    The range is from its frequency to `factor` times as much. A number `sampled` of orbits are
    integrated by the independent integrator in place of the whole verification. All that takes at most `cap` seconds
    of processor time.
    """
    trial = Trial(name, cap=cap)
    orbit = trial.step("orbit", lambda: gw.find_orbit(system), repr)
    if orbit is not None:
        to = factor * system["frequency"]
        branch = trial.step("branch", lambda: gw.follow(orbit, "frequency", to, walk=_WALK), _branch_words)
        trial.outcome = "too slow" if trial.slow else trial.ends["branch"]
        if branch is not None:
            trial.outcome = trial.outcome if trial.slow else branch.ends[-1].reason.value
            _judge(trial, branch, sampled)
    else:
        trial.outcome = "too slow" if trial.slow else trial.ends["orbit"]
    kept = ClassifyOptions(settle=_SETTLE, lyapunov=_LYAPUNOV)
    attractor = trial.step("motion", lambda: classify(system, options=kept), lambda found: str(found.kind))
    if attractor is not None and attractor.orbit is not None:
        orbit = attractor.orbit
        found = trial.step("exponents", lambda: lyapunov(system, orbit.state, _EXPONENTS), repr)
        if found is not None and orbit.period == 1:
            _compare(trial, found.per_period, orbit)
    options = gw.SweepOptions(steps=_STEPS, points=_POINTS, patience=gw.studies.Patience(48, 300), workers=1)
    between = (system["frequency"], factor * system["frequency"])
    trial.step("sweep", lambda: gw.sweep(system, "frequency", between, options=options), _sweep_words)
    return trial


def _branch_words(branch: gw.Branch) -> str:
    return f"{len(branch.points)} points, {len(branch.special_points)} special points, {branch.ends[-1]}"


def _sweep_words(sweep: gw.Sweep) -> str:
    return f"{sorted(set(sweep.regimes.ravel().tolist()))} {' '.join(sweep.notes)}"


def _judge(trial: Trial, branch: gw.Branch, sampled: int) -> None:
    """Enter as faults what verification refuses, and an end that says nothing."""
    end = branch.ends[-1]
    if end.reason in (EndReason.FAILED, EndReason.STEP) and not end.detail:
        trial.faults.append(f"branch: it ended without a reason: {end}")
    if sampled:
        places = sorted({round(each) for each in np.linspace(0, len(branch.points) - 1, sampled)})
        orbits = [branch.points[place].orbit for place in places]
        trial.step("closure", lambda: _closures(trial, orbits), lambda worst: f"{worst:.1e}")
        return
    found = trial.step("verification", lambda: gw.verify(branch), lambda verified: verified.words)
    if found is not None:
        trial.faults += [f"verification: {breach}" for breach in found.breaches[:3]]


def _closures(trial: Trial, orbits: list[gw.Orbit]) -> float:
    """Enter as faults the orbits that another integrator does not close, or that have other extremes."""
    worst = 0.0
    for orbit, around in zip(orbits, carry(orbits, lambda _: None), strict=True):
        size = max(float(np.abs(around.extremes).max()), np.finfo(float).tiny)
        off = float(np.abs(around.extremes - orbit.extremes[:, :2]).max()) / size
        growth = max(1.0, float(np.abs(orbit.multipliers).max()))
        worst = max(worst, around.closure / growth)
        if around.closure > growth * max(_CLOSED, around.error) or off > growth * max(_SAME, around.error):
            trial.faults.append(
                f"closure: at {orbit.system.frequency!r} the orbit of {orbit.state.tolist()} closes to "
                f"{around.closure:.2g} (error {around.error:.1g}), its extremes differ by {off:.2g}"
            )
    return worst


def _compare(trial: Trial, exponents: Any, orbit: gw.Orbit) -> None:
    """Compare the exponents along a stable orbit with its multipliers, as far as both are resolved."""
    with np.errstate(divide="ignore"):
        expected = np.sort(np.log(np.abs(orbit.multipliers)))[::-1]
    first = max(float(expected[0]), -5.0)
    if abs(max(float(exponents[0]), -5.0) - first) > 0.02 + 0.05 * abs(first):
        trial.faults.append(f"exponents: {exponents[0]:.4g} along an orbit whose first is {expected[0]:.4g}")

"""One random system through all that computes motions; a step without a result or a reason is a fault."""

from __future__ import annotations

import math
import signal
import time
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any, TypeVar

import numpy as np

import gapwalk as gw
from gapwalk.attractors import ClassifyOptions, LyapunovOptions, SettleOptions, classify, lyapunov
from gapwalk.bifurcation.special_point import Kind
from gapwalk.continuation.curve_points import BranchPoint
from gapwalk.continuation.walk import EndReason
from gapwalk.errors import GapwalkError, Interrupted
from gapwalk.studies.sweep_study import Sweep
from tests.sampled_verification import verified

LONGEST = 60.0
"""Seconds of processor time after which a step counts as a hang, if the trial has no cap."""

_WALK = gw.WalkOptions(max_points=400)
_SETTLE = SettleOptions(max_periods=2000, max_period=16)
_LYAPUNOV = LyapunovOptions(max_periods=256)
_EXPONENTS = LyapunovOptions(max_periods=1024)  # along orbits, where slow decay takes long to show
_STEPS, _POINTS = 5, 20  # of the sweep
_FOUND = 1e-7  # relative difference of two special points that are one
_MOVED = 1e-6  # difference of two positions of friction that are not one, as a share of the motion
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
    """Results and faults of one system."""

    name: str  #: Which system.
    faults: list[str] = field(
        default_factory=list
    )  #: Refused results, exceptions that are no errors of gapwalk, and hangs.
    ends: dict[str, str] = field(default_factory=dict)  #: A result of each step, or the reason why there is none.
    seconds: dict[str, float] = field(default_factory=dict)  #: Processor time of each step.
    note: str = ""  #: An error before the first step.
    cap: float = math.inf  #: Processor time in seconds of all steps; a step has half of what is left.
    slow: bool = False  #: True if a step was cut off, since it took longer than that.
    outcome: str = ""  #: What became of the branch: why it ended, or why there is none.
    back: str = ""  #: The same of the one on the way back.

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


def attempt(
    name: str,
    system: gw.System,
    factor: float = 1.3,
    sampled: int = 0,
    cap: float = math.inf,
    *,
    is_short: bool = False,
) -> Trial:
    """Search an orbit, walk and verify its branch and the way back, classify the settled motion, and sweep.

    The range is from its frequency to `factor` times as much. Verification is of all but the orbits, of which a
    number `sampled` is verified (0: all; negative: nothing is verified). All that takes at most `cap` seconds
    of processor time. A short trial has the walks alone.
    """
    trial = Trial(name, cap=cap)
    first = trial.step("orbit", lambda: gw.find_orbit(system), repr)
    if first is not None:
        to = factor * system["frequency"]
        branch = trial.step("branch", lambda: gw.follow(first, "frequency", to, walk=_WALK), _branch_words)
        trial.outcome = "too slow" if trial.slow else trial.ends["branch"]
        if branch is not None:
            trial.outcome = trial.outcome if trial.slow else branch.ends[-1].reason.value
            _judge(trial, branch, sampled)
            _walk_back(trial, branch, to, sampled)
    else:
        trial.outcome = "too slow" if trial.slow else trial.ends["orbit"]
    if is_short:
        return trial
    kept = ClassifyOptions(settle=_SETTLE, lyapunov=_LYAPUNOV)
    attractor = trial.step("motion", lambda: classify(system, options=kept), lambda found: str(found.kind))
    if attractor is not None and attractor.orbit is not None:
        orbit = attractor.orbit
        found = trial.step("exponents", lambda: lyapunov(system, orbit.state, _EXPONENTS), repr)
        if found is not None and orbit.period == 1:
            _compare(trial, found.per_period, orbit)
    options = {"steps": _STEPS, "points": _POINTS, "shortest": 48, "longest": 300, "workers": 1}
    between = (system["frequency"], factor * system["frequency"])
    trial.step("sweep", lambda: gw.sweep(system, "frequency", between, **options), _sweep_words)
    return trial


def _branch_words(branch: gw.Branch) -> str:
    return f"{len(branch.points)} points, {len(branch.special_points)} special points, {branch.ends[-1]}"


def _sweep_words(sweep: Sweep) -> str:
    return f"{sorted(set(sweep.regimes.ravel().tolist()))} {' '.join(sweep.notes)}"


def _judge(trial: Trial, branch: gw.Branch, sampled: int, back: str = "") -> None:
    """Enter as faults what verification refuses, and an end that says nothing."""
    end = branch.ends[-1]
    if end.reason in (EndReason.FAILED, EndReason.STEP) and not end.detail:
        trial.faults.append(f"{back}branch: it ended without a reason: {end}")
    if sampled < 0:
        return
    found = trial.step(f"{back}verification", lambda: verified(branch, sampled), lambda verified: verified.words)
    if found is not None:
        trial.faults += [f"{back}verification: {breach}" for breach in found.breaches[:3]]


def _walk_back(trial: Trial, branch: gw.Branch, to: float, sampled: int) -> None:
    """Walk from the end of the range back to its beginning.

    If the branch reached the end, its last orbit is the first of the way back. The same special points must be found as
    far as that leads; if it ends earlier, which needs a reason as any end does, what it has walked is verified too.
    Otherwise an orbit is sought at the end of the range, and what is walked from there is verified.
    """
    begin, last = branch.points[0].value, branch.points[-1].orbit
    same = branch.ends[-1].reason is EndReason.RANGE and branch.points[-1].value == to and not trial.slow
    beyond = last.system.at(frequency=to)
    first = last if same else trial.step("back orbit", lambda: gw.find_orbit(beyond), repr)
    if first is None:
        trial.back = "too slow" if trial.slow else trial.ends["back orbit"]
        return
    found = trial.step("back branch", lambda: gw.follow(first, "frequency", begin, walk=_WALK), _branch_words)
    trial.back = "too slow" if trial.slow else trial.ends["back branch"]
    if found is None:
        return
    trial.back = trial.back if trial.slow else found.ends[-1].reason.value
    if not same or found.ends[-1].reason is not EndReason.RANGE:
        _judge(trial, found, sampled, "back ")
    if same and not trial.slow:  # what was cut off lacks points
        trial.faults += _differences(branch, found)


def _differences(there: gw.Branch, back: gw.Branch) -> list[str]:
    """Return the special points that only one of two walks along one branch has, as sentences.

    The second walk begins where the first one ends; what lies beyond its own end it cannot have found.
    """
    places = [[each.value for each in branch.special_points] for branch in (there, back)]
    labels = [[(each.kind, each.contact) for each in branch.special_points] for branch in (there, back)]
    begin = _reached(there, back.points[-1].orbit)
    left, faults = [*range(len(places[1]))], []
    for value, label, special in zip(places[0], labels[0], there.special_points, strict=True):
        near = [each for each in left if labels[1][each] == label and abs(places[1][each] - value) < _FOUND * value]
        if near:
            left.remove(min(near, key=lambda each: abs(places[1][each] - value)))
        elif special.point.arclength >= begin and not _is_left_elsewhere(special, back):
            faults.append(f"back: {special!r} is not found on the way back")
    alone = [back.special_points[each] for each in left]
    return faults + [
        f"back: {special!r} is found on the way back only"
        for special in alone
        if not _is_left_elsewhere(special, there)
    ]


def _reached(there: gw.Branch, last: gw.Orbit) -> float:
    """Return the arclength of the first point of a branch that a walk back has passed: the one after its last orbit."""

    def apart(first: gw.Orbit, second: gw.Orbit) -> float:
        places = [
            np.append(each.state / np.abs(last.state).max(), each.system["frequency"]) for each in (first, second)
        ]
        return float(np.linalg.norm(places[0] - places[1]))

    def detour(pair: tuple[BranchPoint, BranchPoint]) -> float:
        return sum(apart(each.orbit, last) for each in pair) - apart(pair[0].orbit, pair[1].orbit)

    return min(pairwise(there.points), key=detour)[1].arclength


def _is_left_elsewhere(special: gw.SpecialPoint, other: gw.Branch) -> bool:
    """Return True if an onset of slip concerns a position of friction at which another walk does not have it.

    Friction that never slips keeps the position at which it was left, which depends on the way of a walk. So does the
    place at which its force reaches the first of its two bounds. In the other walk it then sticks with a reserve at
    another position, or its force is at this bound already, at an edge of the continuum.
    """
    if special.kind is not Kind.SLIP_ONSET:
        return False
    name, sign = special.contact.rsplit(" ", 1)
    structure = special.orbit.system.structure
    contact = [each.name for each in structure.contacts].index(name)
    length = float(np.abs(special.orbit.extremes[:, :2]).max())

    def position(orbit: gw.Orbit) -> float:
        system, n = orbit.system, orbit.system.size
        kept = float(system.vector(structure.contacts[contact].vectors[0]) @ orbit.state[:n])
        memories = structure.memories
        return kept - float(orbit.state[2 * n + memories.index(contact)]) if contact in memories else kept

    for pair in pairwise(other.points):
        if not min(each.value for each in pair) <= special.value <= max(each.value for each in pair):
            continue
        for orbit in (each.orbit for each in pair):
            if [phase.mode for phase in orbit.friction.get(contact, [])] != [0]:
                continue
            at_bound = int(f"{sign}1") in {each.slip for each in orbit.slips if each.contact == contact}
            if at_bound or (
                contact in orbit.stuck and abs(position(orbit) - position(special.orbit)) > _MOVED * length
            ):
                return True
    return False


def _compare(trial: Trial, exponents: Any, orbit: gw.Orbit) -> None:
    """Compare the exponents along a stable orbit with its multipliers, as far as both are resolved."""
    with np.errstate(divide="ignore"):
        expected = np.sort(np.log(np.abs(orbit.multipliers)))[::-1]
    first = max(float(expected[0]), -5.0)
    if abs(max(float(exponents[0]), -5.0) - first) > 0.02 + 0.05 * abs(first):
        trial.faults.append(f"exponents: {exponents[0]:.4g} along an orbit whose first is {expected[0]:.4g}")

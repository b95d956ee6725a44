"""Harmonic balance compared with shooting, over the number of harmonics, of degrees of freedom and of contacts.

    python -m benchmarks balance            # figures 12 and 9b compared with another program
    python -m benchmarks.balance            # the same figures, with 3 to 50 harmonics
    python -m benchmarks.balance chains     # chains of up to 1,000 degrees of freedom

Times are CPU seconds of one core; set OPENBLAS_NUM_THREADS=1, because small matrices gain nothing from threads. The
other program is SKHiPPR, the fastest one for harmonic balance with stability that was found. It locates no special
points.
"""

from __future__ import annotations

import sys
import time
from collections import Counter
from collections.abc import Callable
from typing import TypeVar

import numpy as np

from benchmarks.effort import Effort
from benchmarks.row import Row, Target
from benchmarks.stopwatch import fastest
from gapwalk import Balance, Branch, Harmonic, Kind, System, WalkOptions, backlash, find_orbit, follow
from gapwalk.errors import GapwalkError
from gapwalk.orbit.method import Method
from gapwalk.orbit.shooting import Shooting
from gapwalk.paper import case

HARMONICS = (3, 5, 7, 10, 15, 20, 30, 40, 50)
LONG_STEPS = WalkOptions(largest_step=0.06)
PEER = {("12", 10): 1.2, ("9b", 10): 1.2, ("12", 40): 24.0, ("9b", 40): 25.0}
"""CPU seconds of SKHiPPR for figures and harmonics, with stability, on two cores otherwise idle."""
RATIO = 5.0  # how many times faster this should be
CHAINS = ((25, 3), (50, 3), (100, 3), (100, 1), (100, 6), (100, 10), (1000, 10))

T = TypeVar("T")


def rows(effort: Effort) -> list[Row]:
    """Compare the paper's figures with the other program."""
    return [peer_row(name, harmonics, seconds, effort) for (name, harmonics), seconds in PEER.items()]


def peer_row(name: str, harmonics: int, seconds: float, effort: Effort) -> Row:
    """Measure one figure at one number of harmonics, with every special point that shooting finds."""
    start, method = find_orbit(case(name), frequency=2.0), Balance(harmonics, error=1.0)

    def ours() -> Branch:
        return follow(start, "frequency", to=0.15, method=method, walk=LONG_STEPS)

    known = Counter(special.kind for special in response(name, Shooting(), WalkOptions()).special_points)
    branch = ours()
    found = Counter(special.kind for special in branch.special_points)
    counts = {
        "points": len(branch.points),
        "special points found": (found & known).total(),
        "special points invented": (found - known).total(),
    }
    note = f"figure {name}, H = {harmonics}: {summary(branch)}; {counts['special points invented']} invented"
    targets = (Target(RATIO, "ratio"), Target(known.total(), "found"))
    what = f"figure {name}, H = {harmonics}"
    return Row("Harmonic balance", what, fastest(ours, effort), seconds, "SKHiPPR", targets, counts, note)


def main() -> None:
    """Print the requested lines."""
    if sys.argv[1:] == ["chains"]:
        for size, contacts in CHAINS:
            print(chain_line(size, contacts), flush=True)
        return
    for name in ("12", "9b"):
        reference, seconds = timed(lambda name=name: response(name, Shooting(), WalkOptions()), 3)
        print(f"figure {name}, shooting: {seconds:.2f} s, {summary(reference)}", flush=True)
        for harmonics in HARMONICS:
            print(harmonics_line(name, harmonics, reference), flush=True)


def harmonics_line(name: str, harmonics: int, reference: Branch) -> str:
    """Return time and errors of one of the paper's figures at a number of harmonics."""
    branch, seconds = timed(lambda: response(name, Balance(harmonics, error=1.0), LONG_STEPS), 3)
    errors = [f"{kind.value} {error(branch, reference, kind)}" for kind in (Kind.FOLD, Kind.FLIP, Kind.GRAZING)]
    truncation = max(point.orbit.truncation for point in branch.points)  # type: ignore[attr-defined]
    peer = PEER.get((name, harmonics))
    ratio = "" if peer is None else f"; {peer / seconds:.1f} times as fast as SKHiPPR (target {RATIO:g})"
    return (
        f"  H = {harmonics}: {seconds:.2f} s{ratio}, {summary(branch)}; off by {', '.join(errors)}; neglected "
        f"{truncation:.1e}"
    )


def chain_line(size: int, contacts: int) -> str:
    """Return the time of the frequency response of a chain, with stability and every special point."""
    (branch, started), seconds = timed(lambda: chain_response(size, contacts), 1)
    return f"chain of {size}, {contacts} gaps: {seconds:.1f} s (begun after {started:.1f} s), {summary(branch)}"


def response(name: str, method: Method, walk: WalkOptions) -> Branch:
    """Walk the frequency response of a figure, from 2 down to 0.15."""
    return follow(find_orbit(case(name), frequency=2.0), "frequency", to=0.15, method=method, walk=walk)


def chain_response(size: int, contacts: int) -> tuple[Branch, float]:
    """Walk the response of a chain over its second resonance; also return when the walk began."""
    began, method = time.process_time(), Balance(7, error=0.1)
    orbit = find_orbit(chain(size, contacts), start="rest", method=method)
    started = time.process_time() - began
    walk = WalkOptions(largest_step=0.03)
    return follow(orbit, "frequency", to=0.36, method=method, walk=walk), started


def chain(size: int, contacts: int) -> System:
    """Return a rod between two walls, divided into masses, with gaps to ground; the same rod for every size."""
    names = tuple(f"q{index}" for index in range(size))
    stiffness = (size / 20.0) ** 2 * (2.0 * np.eye(size) - np.eye(size, k=1) - np.eye(size, k=-1))
    damping = 0.02 * np.eye(size) + 0.002 * stiffness
    places = np.linspace(0.5 * size / contacts, size - 0.5 * size / contacts, contacts).astype(int)
    gaps = [
        backlash(f"gap{k}", {names[place]: 1.0}, 0.3 + 0.05 * k, 0.2 * size, impact_damping=0.05)
        for k, place in enumerate(places)
    ]
    drive = Harmonic(0.15 * size / 20.0, {names[size // 20]: 1.0})
    return System(names, stiffness, damping, contacts=gaps, harmonics=[drive], frequency=0.3)


def error(branch: Branch, reference: Branch, kind: Kind) -> str:
    """Return the largest error of the special points of one kind."""
    found, known = (np.array([special.value for special in each.special(kind)]) for each in (branch, reference))
    if len(found) != len(known):
        return f"({len(found)} of {len(known)})"
    return f"{np.abs(found - known).max():.1e}" if len(known) else "-"


def summary(branch: Branch) -> str:
    """Count points and special points of a branch."""
    kinds = ", ".join(f"{len(branch.special(kind))} {kind.value}" for kind in Kind.known() if branch.special(kind))
    return f"{len(branch.points)} points, {kinds or 'no special points'}, {branch.ends[-1].reason.name.lower()}"


def timed(work: Callable[[], T], times: int) -> tuple[T, float]:
    """Return the result of some work, and the fewest CPU seconds that it took."""
    best, result = float("inf"), None
    for _ in range(times):
        began = time.process_time()
        result = work()
        best = min(best, time.process_time() - began)
    assert result is not None
    return result, best


if __name__ == "__main__":
    try:
        main()
    except (GapwalkError, KeyboardInterrupt) as problem:
        sys.exit(str(problem) or "interrupted")

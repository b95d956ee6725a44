"""Explanations of statements that do not hold at the printed numbers, each checked as a claim is."""

from __future__ import annotations

from functools import cache

import numpy as np

import gapwalk as gw
from reproductions.padmanabhan_singh_1995.claims.claim import Finding
from reproductions.padmanabhan_singh_1995.claims.second_reading import explains
from reproductions.padmanabhan_singh_1995.jobs import MEASURE
from reproductions.padmanabhan_singh_1995.quantities import (
    Peak,
    attractor_of,
    flipped,
    highest,
    main_branch,
    members,
    peaks,
    values,
    with_pair,
    words,
)

_START = 25  # forcing periods after a start that are looked at
_FIRST = 4  # impacts of the start, which a figure shows
_STARTS, _SEED = 8, 5  # random starts of Newton's method, in a box of half-width 1
_OFTEN, _SELDOM = 8, 2  # of them
_SLIVER = 0.001  # width of a range that a picture of the response cannot show
_DRAWN = 0.45  # the loops of period 2 that the paper draws lie above
_FLAT = 0.01  # prominence of a peak, as a share of its height, that a picture does not show


@explains("3-impacts", "the figure shows a start", "3-impact", "3-viscous")
def _begins_so(*results: gw.Result) -> Finding:
    """After a start from rest contact closes about every second period at first."""
    parts, fits = [], True
    for name, result in zip(("impact", "viscous"), results, strict=True):
        motion = gw.integrate(result.system, np.zeros(4), _START, 64)
        closed = [event.theta / (2.0 * np.pi) for event in motion.events if event.enters]
        between = np.diff(closed[:_FIRST])
        fits &= len(closed) >= _FIRST and bool(np.all((between > 1.8) & (between < 2.6)))
        parts.append(f"{name} {words([round(each, 2) for each in closed])}")
    return Finding(fits, f"from rest it closes after these periods: {'; '.join(parts)}", f"{_START} periods looked at")


@explains("13-once", "period 4 where the paper draws nothing", "13", "9a")
def _not_drawn(*results: gw.Result) -> Finding:
    found = [v for result in results for each in members(result, 2) for v in values(each.branch, gw.Kind.FLIP)]
    drawn = sorted(each for each in found if each > _DRAWN)
    width = max(drawn, default=0.0) - min(drawn, default=0.0)
    return Finding(
        bool(drawn) and width < _SLIVER,
        f"period 4 above {_DRAWN} only between {' and '.join(f'{each:.5f}' for each in drawn)}, {width:.1g} wide",
        f"the other {len(found) - len(drawn)} flips are on a loop of period 2 below {_DRAWN} that is not drawn",
    )


@explains("23-others", "holds at the phase that is drawn", "9b", "23b")
def _at_the_drawn_phase(single: gw.Result, dual: gw.Result) -> Finding:
    """At the phase of the figure no peak is left that a picture would show."""
    before, after = (_prominences(main_branch(each)) for each in (single, dual))
    return Finding(
        min(before.values()) > 0.1 and max(after.values()) < _FLAT,
        f"prominence, as a share of the height, in phase: {_shares(after)}; with one harmonic: {_shares(before)}; they "
        "do not vanish at 180°",
    )


def _shares(found: dict[int, float]) -> str:
    return ", ".join(f"1/{order}: {share:.2g}" if share else f"1/{order}: no peak" for order, share in found.items())


def _prominences(branch: gw.Branch) -> dict[int, float]:
    """How far the peaks about a third and a quarter of the main one rise above the higher of the dips beside them."""
    main, found = highest(branch).value, {}
    for order in (3, 4):
        near = peaks(branch, main / order * 0.9, main / order * 1.1)
        found[order] = max((_prominence(branch, peak) for peak in near), default=0.0)
    return found


def _prominence(branch: gw.Branch, peak: Peak) -> float:
    heights = branch.measure(MEASURE)
    place = int(np.flatnonzero((branch.values == peak.value) & (heights == peak.height))[0])
    dips = []
    for side in (heights[place::-1], heights[place:]):
        beyond = np.flatnonzero(side > peak.height)
        dips.append(float(side[: beyond[0] if len(beyond) else None].min()))
    return (peak.height - max(dips)) / peak.height


_BETWEEN = ("27-0.3", "27-0.34", "27-0.4", "27-0.44")
_HARD = "Newton's method seldom finds the branch there"


@explains("27-nothing", _HARD, "27", *_BETWEEN)
@explains("27-aperiodic", _HARD, "27", *_BETWEEN)
def _hard_to_find(result: gw.Result, *motions: gw.Result) -> Finding:
    """Newton's method fails from most starts where direct integration settles on periodic motions."""
    below, between = 0.2, (0.3, 0.4)
    low, *gap = [_converged(result.system, value) for value in (below, *between)]
    found = [attractor_of(each) for each in motions]
    labels = words([f"{each.label} at {each.system['harmonic1.amplitude']:g}" for each in found])
    return Finding(
        low >= _OFTEN and max(gap) <= _SELDOM and all(each.period for each in found),
        f"Newton's method converges from {words(gap)} of {_STARTS} starts at {words(list(between))} (from {low} at "
        f"{below}); but from rest {labels}",
    )


@cache
def _converged(system: gw.System, amplitude: float) -> int:
    random, count = np.random.default_rng(_SEED), 0
    for _ in range(_STARTS):
        try:
            gw.find_orbit(system, 1, random.uniform(-1.0, 1.0, 4), at={"harmonic1.amplitude": amplitude})
        except gw.errors.NumericalError:
            continue
        count += 1
    return count


@explains("29-high", "period 1 has a pair there, the motions are others", "29", "29-0.5", "29-0.58")
def _pair_without_torus(result: gw.Result, *motions: gw.Result) -> Finding:
    """Where period 1 loses its stability by a pair, one expects a torus; the motions settle on something else."""
    pairs = [each for each in with_pair(main_branch(result)) if each.meets(0.42, 0.58)]
    found = [attractor_of(each) for each in motions]
    labels = words([f"{each.label} at {each.system['harmonic1.amplitude']:g}" for each in found])
    fits = bool(pairs) and all(each.kind != "quasi-periodic" and each.period != 1 for each in found)
    return Finding(
        fits, f"period 1 is unstable by a pair at {words(pairs)}, where a torus is expected; from rest {labels}"
    )


@explains("summary-heavy", "the paper's own figure 4 contradicts it", "12", "20a", "4a")
def _contradicted(*results: gw.Result) -> Finding:
    twelve, twenty, four = (flipped(main_branch(result)) for result in results)
    return Finding(
        not twelve and not twenty and bool(four),
        f"doubled periods: 12 {words(twelve)}, 20a {words(twenty)}, but 4a (also Tm1 = 0.5) {words(four)}",
    )

"""Explanations of statements that do not hold at the printed numbers, each checked as a claim is."""

from __future__ import annotations

import numpy as np

import gapwalk as gw
from reproductions.padmanabhan_singh_1995.claims.claim import Finding
from reproductions.padmanabhan_singh_1995.claims.second_reading import explains
from reproductions.padmanabhan_singh_1995.jobs import MEASURE
from reproductions.padmanabhan_singh_1995.quantities import (
    Peak,
    Range,
    attractor_of,
    extent,
    flipped,
    highest,
    main_branch,
    members,
    peaks,
    with_pair,
    words,
)

_START = 12  # forcing periods after a start that are looked at
_STARTS, _SEED = 40, 5  # random starts of Newton's method, in a box of half-width 1
_OFTEN, _SELDOM = 39, 20  # of them
_SLIVER = 0.001  # width of a range that a picture of the response cannot show
_DRAWN = 0.45  # the loops of period 2 that the paper draws lie above
_FLAT = 0.01  # prominence of a peak, as a share of its height, that a picture does not show


@explains("3-impacts", "the figure shows a start", "3-impact", "3-viscous")
def _begins_so(*results: gw.Result) -> Finding:
    """Contact closes every second period after a start from rest, and then stays closed."""
    parts, fits = [], True
    for name, result in zip(("impact", "viscous"), results, strict=True):
        motion = gw.integrate(result.system, np.zeros(4), _START, 64)
        closed = [event.theta / (2.0 * np.pi) for event in motion.events if event.enters]
        between = np.diff(closed)
        fits &= len(closed) >= 4 and bool(np.all((between > 1.8) & (between < 2.6)))
        parts.append(f"{name} model: from rest it closes after {words([round(each, 2) for each in closed])} periods")
    return Finding(fits, f"{'; '.join(parts)}, and then stays closed")


@explains("13-once", "period 4 where nothing is drawn", "13", "9a")
def _not_drawn(*results: gw.Result) -> Finding:
    found = [extent(member.branch) for result in results for member in members(result, 4)]
    drawn = [each for each in found if each.low > _DRAWN]
    evidence = (
        f"of period 4 only {words(drawn)} lies where loops of period 2 are drawn, {_width(drawn):.1g} wide; the rest "
        f"is on a loop below {_DRAWN} that is not drawn"
    )
    return Finding(bool(drawn) and _width(drawn) < _SLIVER, evidence)


def _width(found: list[Range]) -> float:
    return max((each.width for each in found), default=0.0)


@explains("23-others", "holds at the phase that is drawn", "9b", "23b")
def _at_the_drawn_phase(single: gw.Result, dual: gw.Result) -> Finding:
    """At the phase of the figure no peak is left that a picture would show."""
    before, after = (_prominences(main_branch(each)) for each in (single, dual))
    evidence = (
        f"prominence of the peaks, as a share of their height: one harmonic {_shares(before)}; two in phase, as the "
        f"figure has it, {_shares(after)}"
    )
    return Finding(min(before.values()) > 0.1 and max(after.values()) < _FLAT, evidence)


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


@explains("27-nothing", "Newton's method seldom finds the branch there", "27")
def _hard_to_find(result: gw.Result) -> Finding:
    below, between = (0.15, 0.24), (0.28, 0.44)
    low, gap = ([_converged(result.system, value) for value in values] for values in (below, between))
    evidence = (
        f"of {_STARTS} random starts it converges from {words(low)} at Te1 = {words(list(below))}, but from "
        f"{words(gap)} at {words(list(between))}"
    )
    return Finding(min(low) >= _OFTEN and max(gap) <= _SELDOM, evidence)


def _converged(system: gw.System, amplitude: float) -> int:
    random, count = np.random.default_rng(_SEED), 0
    for _ in range(_STARTS):
        try:
            gw.find_orbit(system, 1, random.uniform(-1.0, 1.0, 4), at={"harmonic1.amplitude": amplitude})
        except gw.errors.NumericalError:
            continue
        count += 1
    return count


@explains("29-high", "period 1 has a pair there, the motions are others", "29", "29-0.42", "29-0.5", "29-0.58")
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
    evidence = (
        f"it holds for the sets of figures 12 and 20a ({words(twelve)}, {words(twenty)}), while figure 4a of the "
        f"paper, with the same Tm1 = 0.5, has a range of doubled periods: {words(four)}"
    )
    return Finding(not twelve and not twenty and bool(four), evidence)

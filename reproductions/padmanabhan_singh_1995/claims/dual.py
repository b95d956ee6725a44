"""What the paper says of the excitation by two harmonics (its section 6, figures 20 to 29), and in its summary."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

import gapwalk as gw
from reproductions.padmanabhan_singh_1995.claims.claim import BOTH, Finding, claim
from reproductions.padmanabhan_singh_1995.jobs import MEASURE
from reproductions.padmanabhan_singh_1995.quantities import (
    Peak,
    Range,
    attractor_of,
    extent,
    flipped,
    highest,
    main_branch,
    meeting,
    members,
    peaks,
    ranges,
    values,
    with_pair,
    words,
)

_SUPER = (0.24, 0.36)  # about half the first resonance
_FIRST = (0.57, 0.72)  # about the jumps of the first resonance from above


def _jump(branch: gw.Branch, within: tuple[float, float]) -> Range | None:
    """The range between the two folds of a jump."""
    found = values(branch, gw.Kind.FOLD, *within)
    return Range(found[0], found[-1]) if len(found) > 1 else None


@claim(
    "20-peak", "A second harmonic adds a peak with a jump at about half the main resonance.", "12", "20a", short=True
)
def _superharmonic(single: gw.Result, dual: gw.Result) -> Finding:
    branch = main_branch(dual)
    main, found, before = highest(branch), highest(branch, *_SUPER), highest(main_branch(single), *_SUPER)
    jump = _jump(branch, _SUPER)
    evidence = (
        f"peak {found}, {found.value / main.value:.2f} of the main one at {main.value:.3g}, with folds at "
        f"{jump}; without the second harmonic {before.height:.3g}"
    )
    return Finding(jump is not None and found.height > 1.2 * before.height, evidence)


@claim("20-flips", "At 120° periods double there, and period 2 is stable.", "20a", "20b")
def _phase_flips(zero: gw.Result, turned: gw.Result) -> Finding:
    before, after = (meeting(flipped(main_branch(each)), *_SUPER) for each in (zero, turned))
    doubled = [member.branch for member in members(turned, 2) if extent(member.branch).meets(*_SUPER)]
    stable = [extent(branch) for branch in doubled if any(point.stable for point in branch.points)]
    evidence = (
        f"in phase: {words(before)}; at 120°: {words(after)}, with loops of period 2, stable in part, at "
        f"{words(stable)}"
    )
    return Finding(not before and bool(after and stable), evidence)


@claim("21-folds", "The phase moves the folds: the range between them widens.", "20a", "20b", short=True)
def _moved_folds(zero: gw.Result, turned: gw.Result) -> Finding:
    branches = [main_branch(each) for each in (zero, turned)]
    first = [jump for branch in branches if (jump := _jump(branch, _FIRST))]
    lower = [jump for branch in branches if (jump := _jump(branch, _SUPER))]
    evidence = f"in phase, and at 120°: first resonance {words(first)}; superharmonic {words(lower)}"
    both = len(first) == len(lower) == 2
    return Finding(both and all(after.width > before.width for before, after in (first, lower)), evidence)


@claim(
    "22-flips",
    "At 180° periods double near 0.7 to 0.8 too, and near the superharmonic peak.",
    "22",
    others=BOTH,
    short=True,
)
def _antiphase_flips(result: gw.Result) -> Finding:
    found = flipped(main_branch(result))
    above, lower = meeting(found, 0.65, 0.85), meeting(found, *_SUPER)
    return Finding(bool(above and lower), f"doubled periods at {words(found)} (the paper: about 0.8, and there)")


@claim("22-wider", "At 180° the non-linear range is wider still.", "20a", "20b", "22", others=BOTH, short=True)
def _wider(zero: gw.Result, turned: gw.Result, antiphase: gw.Result) -> Finding:
    branches = [main_branch(each) for each in (zero, turned, antiphase)]
    jumps, whole = [_jump(branch, _SUPER) for branch in branches], [_nonlinear(branch) for branch in branches]
    evidence = (
        f"folds at 0°, 120°, 180°: {words(jumps)}; from the lowest fold to the highest flip there: {words(whole)}"
    )
    return Finding(whole[2].width > whole[1].width > whole[0].width, evidence)


def _nonlinear(branch: gw.Branch) -> Range:
    """From the lowest fold to the highest fold or flip about the superharmonic resonance."""
    found = [*values(branch, gw.Kind.FOLD, *_SUPER), *values(branch, gw.Kind.FLIP, *_SUPER)]
    return Range(min(found), max(found)) if found else Range(0.0, 0.0)


def _order_peaks(branch: gw.Branch) -> dict[int, Peak | None]:
    """The highest peak about a half, a third and a quarter of the main one."""
    main = highest(branch).value
    found: dict[int, Peak | None] = {}
    for order in (2, 3, 4):
        near = peaks(branch, main / order * 0.9, main / order * 1.1)
        found[order] = max(near, key=lambda peak: peak.height) if near else None
    return found


def _peak_words(found: dict[int, Peak | None]) -> str:
    return ", ".join(f"1/{order}: {peak or 'none'}" for order, peak in found.items())


@claim("23-single", "One harmonic: peaks at 1/2, 1/3 and 1/4 of the main resonance.", "9b")
def _single_peaks(result: gw.Result) -> Finding:
    branch = main_branch(result)
    found = _order_peaks(branch)
    return Finding(all(found.values()), f"main peak {highest(branch)}; {_peak_words(found)}")


@claim("23-half", "A second harmonic at 2 Ω makes the peak at 1/2 higher.", "9b", "23b")
def _half_grows(single: gw.Result, dual: gw.Result) -> Finding:
    one, two = (_order_peaks(main_branch(each))[2] for each in (single, dual))
    return Finding(
        one is not None and two is not None and two.height > 1.2 * one.height, f"{one} without, {two} with it"
    )


@claim(
    "23-others",
    "With it the peaks at 1/3 and 1/4 vanish, whatever its phase.",
    "9b",
    "23b",
    "23b-120",
    "23b-180",
    others=BOTH,
    short=True,
)
def _others_vanish(*results: gw.Result) -> Finding:
    """From the response to one harmonic, and from those to two at three phases."""
    single, *dual = [_order_peaks(main_branch(result)) for result in results]
    phases = [f"{phase}: {_peak_words(found)}" for phase, found in zip(("0°", "120°", "180°"), dual, strict=True)]
    gone = all(_gone(single[order], found[order]) for found in dual for order in (3, 4))
    return Finding(gone, f"one harmonic: {_peak_words(single)}; two: {'; '.join(phases)}")


def _gone(before: Peak | None, after: Peak | None) -> bool:
    return before is not None and after is None


def _low_heights(branch: gw.Branch, low: float, high: float) -> np.ndarray:
    """The largest amplitude at each of many values of the parameter; where several motions exist, the largest."""
    grid = np.linspace(low, high, 200)
    heights, places = branch.measure(MEASURE), branch.values
    best = np.zeros_like(grid)
    for (a, b), (p, q) in zip(np.c_[places[:-1], places[1:]], np.c_[heights[:-1], heights[1:]], strict=True):
        inside = (grid >= min(a, b)) & (grid <= max(a, b))
        if inside.any() and a != b:
            best[inside] = np.maximum(best[inside], p + (q - p) * (grid[inside] - a) / (b - a))
    return best


@claim("25-peaks", "The same holds for twice the excitation.", "24", "25", others=BOTH, short=True)
def _doubled_peaks(single: gw.Result, dual: gw.Result) -> Finding:
    one, two = (_order_peaks(main_branch(each)) for each in (single, dual))
    half_grows = one[2] is not None and two[2] is not None and two[2].height > one[2].height
    evidence = f"one harmonic: {_peak_words(one)}; two: {_peak_words(two)}"
    return Finding(half_grows and all(_gone(one[order], two[order]) for order in (3, 4)), evidence)


@claim("25-lower", "There the second harmonic lowers the amplitude for Ω ≤ 0.25.", "24", "25")
def _lower_amplitude(single: gw.Result, dual: gw.Result) -> Finding:
    one, two = (_low_heights(main_branch(each), 0.15, 0.25) for each in (single, dual))
    share = float(np.mean(two < one))
    evidence = (
        f"lower at {share:.0%} of the frequencies between 0.15 and 0.25; the highest there is {two.max():.3g} "
        f"with the second harmonic and {one.max():.3g} without, the mean {two.mean():.3g} and {one.mean():.3g}"
    )
    return Finding(two.max() < one.max() and share > 0.5, evidence)


@claim(
    "26-higher", "A second harmonic at 3 Ω raises the low-frequency peaks to twice their height at least.", "9b", "26b"
)
def _third_harmonic(single: gw.Result, dual: gw.Result) -> Finding:
    one, two = (peaks(main_branch(each), 0.15, 0.36) for each in (single, dual))
    rises = [_rises(main_branch(result)) for result in (single, dual)]
    evidence = (
        f"peaks below 0.36: {words(one)}; with 3 Ω: {words(two)}; the highest rises {rises[0]:.3g} and "
        f"{rises[1]:.3g} above the lowest amplitude there"
    )
    heights = [max((peak.height for peak in found), default=0.0) for found in (one, two)]
    return Finding(heights[1] >= 2.0 * heights[0], evidence)


def _rises(branch: gw.Branch) -> float:
    """How far the highest superharmonic peak rises above the lowest amplitude."""
    heights = _low_heights(branch, 0.15, 0.36)
    return float(heights.max() - heights[heights > 0.0].min())


_BARE = (0.3, 0.45)


def isolated(result: gw.Result) -> list[Any]:
    """Return the branches of period 1 that closed on themselves, the widest first."""
    closed = [member for member in members(result, 1) if member.branch.closed]
    return sorted(closed, key=lambda member: -extent(member.branch).width)


def _extents(result: gw.Result) -> list[Range]:
    return [extent(member.branch) for member in isolated(result)]


@claim("27-islands", "At Ω = 0.25 two isolated branches lie over the amplitude.", "27", short=True)
def _two_isolated(result: gw.Result) -> Finding:
    found = _extents(result)
    positive = [each for each in found if each.high > 0.0]
    evidence = (
        f"closed branches at {words(found)}; the equations are the same for −Te1 half a period later, so "
        "those away from 0 come in pairs"
    )
    return Finding(len(positive) == 2, evidence)


@claim("27-beats", "The larger one has two small ranges of quasi-periodic motions.", "27", others=BOTH, short=True)
def _large_pairs(result: gw.Result) -> Finding:
    if not isolated(result):
        return Finding(False, "no isolated branch")
    loop, main = isolated(result)[0].branch, main_branch(result)
    found = [each for each in with_pair(main) if each.high > 0.0]
    evidence = (
        f"on the larger isolated branch ({extent(loop)}): {words(with_pair(loop))}; on the branch that runs through "
        f"the whole range: {words(found)}"
    )
    return Finding(len(with_pair(loop)) == 2, evidence)


@claim("27-flip", "On the smaller one periods double.", "27", short=True)
def _small_flips(result: gw.Result) -> Finding:
    small = isolated(result)[-1].branch
    return Finding(
        bool(values(small, gw.Kind.FLIP)), f"on {extent(small)}: flips at {words(values(small, gw.Kind.FLIP))}"
    )


@claim("27-nothing", "For 0.3 ≤ Te1 ≤ 0.45 there is no periodic motion, stable or not.", "27")
def _nothing_between(result: gw.Result) -> Finding:
    branch = main_branch(result)
    low, high = _BARE
    through = extent(branch).low <= low and extent(branch).high >= high
    stable = [
        Range(max(each.low, low), min(each.high, high))
        for each in ranges(branch, lambda instability: instability.total == 0)
        if each.meets(low, high)
    ]
    evidence = f"one branch of period 1 runs through all of {low}–{high}; it is stable at {words(stable)}"
    return Finding(not through, evidence if through else "no branch of period 1 runs through")


@claim("28-grow", "At Ω = 0.255 both loops are larger.", "27", "28", short=True)
def _grow(first: gw.Result, second: gw.Result) -> Finding:
    before, after = _extents(first), _extents(second)
    evidence = f"at Ω = 0.25: {words(before)}; at 0.255: {words(after)}"
    if len(before) < 2 or len(after) < 2:
        return Finding(False, evidence)
    return Finding(after[0].width > before[0].width and after[-1].width > before[-1].width, evidence)


@claim("28-overlap", "There they overlap.", "28", "28-overlap", others=BOTH, elsewhere=("28",), short=True)
def _overlap(result: gw.Result, *further: gw.Result) -> Finding:
    found = [each for each in _extents(result) if each.high > 0.0]
    evidence = f"at Ω = 0.255: {words(found)}"
    for other in further:
        beyond = [each for each in _extents(other) if each.high > 0.0]
        evidence += f"; at 0.2576: {words(beyond)}"
        if len(beyond) == 1:
            folds = values(main_branch(other), gw.Kind.FOLD, low=0.0)
            evidence += (
                f", for the smaller one is connected there to the branch that runs through; its folds: {words(folds)}"
            )
    return Finding(len(found) == 2 and found[0].meets(found[1].low, found[1].high), evidence)


@claim("28-throughout", "There periodic motions exist throughout the range.", "28", short=True)
def _throughout(result: gw.Result) -> Finding:
    covered = extent(main_branch(result))
    return Finding(covered.width > 1.59, f"a branch of period 1 runs from {covered.low:.3g} to {covered.high:.3g}")


@claim("29-small", "At Ω = 0.35 period 1 is stable for small amplitudes.", "29")
def _small_amplitude(result: gw.Result) -> Finding:
    branch = main_branch(result)
    special = next(each for each in branch.special_points if each.before.total == 0 and each.after.total > 0)
    return Finding(
        branch.points[0].stable,
        f"stable from {branch.values[0]:.3g} up to the {special.kind.value} at {special.value:.4f}",
    )


@claim("29-cascade", "At moderate amplitudes periods double to 2, 4 and more.", "29")
def _cascade(result: gw.Result) -> Finding:
    twice, four = members(result, 2), members(result, 4)
    on_four = sum(len(values(member.branch, gw.Kind.FLIP)) for member in four)
    first = flipped(main_branch(result))
    evidence = (
        f"period 1 is unstable by a flip at {words(first)}; {len(twice)} branches of period 2, {len(four)} of "
        f"period 4 with {on_four} flips"
    )
    return Finding(bool(twice and four) and on_four > 0, evidence)


@claim("29-beats", "Quasi-periodic motions appear.", "29")
def _pairs(result: gw.Result) -> Finding:
    found = {
        f"period {period}": [each for member in members(result, period) for each in with_pair(member.branch)]
        for period in (1, 2)
    }
    return Finding(any(found.values()), "; ".join(f"{name}: {words(each)}" for name, each in found.items()))


def _labels(results: Sequence[gw.Result]) -> list[str]:
    """Say what each motion settles on, and at which amplitude."""
    found = [attractor_of(result) for result in results]
    return [f"{each.label} at {each.system['harmonic1.amplitude']:g}" for each in found]


_HIGH, _MODERATE = ("29-0.65", "29-0.8", "29-0.95"), ("29-0.16", "29-0.27")


@claim("29-high", "At high amplitudes only quasi-periodic motion is stable.", *_HIGH)
def _high_amplitude(*results: gw.Result) -> Finding:
    only = all(attractor_of(each).kind == "quasi-periodic" for each in results)
    return Finding(only, f"from rest: {', '.join(_labels(results))}")


@claim("29-chaos", "Moderate amplitudes lead to chaos.", *_MODERATE)
def _chaos(*results: gw.Result) -> Finding:
    chaotic = any(attractor_of(each).kind == "chaotic" for each in results)
    return Finding(chaotic, f"from rest: {', '.join(_labels(results))}")


@claim(
    "summary-heavy",
    "Under a heavy mean load on the clutch no period doubles.",
    "12",
    "20a",
    "4a",
    "10b",
    others=BOTH,
    short=True,
)
def _heavy(*results: gw.Result) -> Finding:
    names = ("12", "20a", "4a", "10b")
    found = {name: flipped(main_branch(result)) for name, result in zip(names, results, strict=True)}
    evidence = "; ".join(f"set {name}: {words(each)}" for name, each in found.items())
    return Finding(not any(found.values()), f"doubled periods with Tm1 = 0.5 — {evidence}")


@claim("summary-light", "Light loads and a large excitation give the richest behaviour.", "12", "9a", "13", "15")
def _light(*results: gw.Result) -> Finding:
    names = ("12", "14", "13", "15")
    specials = [main_branch(result).special_points for result in results]
    counts = [sum(each.kind is not gw.Kind.GRAZING for each in points) for points in specials]
    parts = [f"{count} in figure {name}" for name, count in zip(names, counts, strict=True)]
    return Finding(
        counts[-1] == max(counts) and counts[0] == min(counts), f"special points of period 1: {', '.join(parts)}"
    )

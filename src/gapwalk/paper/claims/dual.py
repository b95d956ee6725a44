"""What the paper says of a second harmonic of the excitation (its section 6, figures 20 to 26)."""

from __future__ import annotations

import numpy as np

from gapwalk.bifurcation.branch import Branch, Kind
from gapwalk.paper.claims.claim import BOTH, Claim, Outcome, holds
from gapwalk.paper.claims.look import (
    MEASURE,
    Peak,
    Range,
    extent,
    flipped,
    highest,
    limbs,
    main_branch,
    peaks,
    values,
    words,
)
from gapwalk.study.result import Result

_SUPER = (0.24, 0.36)  # about half the first resonance
_FIRST = (0.57, 0.72)  # about the jumps of the first resonance from above


def _jump(branch: Branch, within: tuple[float, float]) -> Range | None:
    """The range between the two folds of a jump."""
    found = values(branch, Kind.FOLD, *within)
    return Range(found[0], found[-1]) if len(found) > 1 else None


def _superharmonic(single: Result, dual: Result) -> Outcome:
    branch = main_branch(dual)
    main, found, before = highest(branch), highest(branch, *_SUPER), highest(main_branch(single), *_SUPER)
    jump = _jump(branch, _SUPER)
    evidence = (
        f"peak {found}, {found.value / main.value:.2f} of the main one at {main.value:.3g}, with folds at "
        f"{jump}; without the "
        f"second harmonic {before.height:.3g}"
    )
    return holds(jump is not None and found.height > 1.2 * before.height, evidence)


def _phase_flips(zero: Result, turned: Result) -> Outcome:
    before, after = (_near(flipped(main_branch(each)), _SUPER) for each in (zero, turned))
    doubled = [limb.branch for limb in limbs(turned, 2) if extent(limb.branch).meets(*_SUPER)]
    stable = [extent(branch) for branch in doubled if any(point.stable for point in branch.points)]
    evidence = (
        f"in phase: {words(before)}; at 120°: {words(after)}, with loops of period 2, stable in part, at "
        f"{words(stable)}"
    )
    return holds(not before and bool(after and stable), evidence)


def _near(found: list[Range], within: tuple[float, float]) -> list[Range]:
    return [each for each in found if each.meets(*within)]


def _moved_folds(zero: Result, turned: Result) -> Outcome:
    branches = [main_branch(each) for each in (zero, turned)]
    first = [jump for branch in branches if (jump := _jump(branch, _FIRST))]
    lower = [jump for branch in branches if (jump := _jump(branch, _SUPER))]
    evidence = f"in phase, and at 120°: first resonance {words(first)}; superharmonic {words(lower)}"
    both = len(first) == len(lower) == 2
    return holds(both and all(after.width > before.width for before, after in (first, lower)), evidence)


def _antiphase_flips(result: Result) -> Outcome:
    found = flipped(main_branch(result))
    above, lower = _near(found, (0.65, 0.85)), _near(found, _SUPER)
    return holds(bool(above and lower), f"doubled periods at {words(found)} (the paper: about 0.8, and there)")


def _wider(zero: Result, turned: Result, antiphase: Result) -> Outcome:
    branches = [main_branch(each) for each in (zero, turned, antiphase)]
    jumps, whole = [_jump(branch, _SUPER) for branch in branches], [_nonlinear(branch) for branch in branches]
    evidence = (
        f"folds at 0°, 120°, 180°: {words(jumps)}; from the lowest fold to the highest flip there: {words(whole)}"
    )
    return holds(whole[2].width > whole[1].width > whole[0].width, evidence)


def _nonlinear(branch: Branch) -> Range:
    """From the lowest fold to the highest fold or flip about the superharmonic resonance."""
    found = [*values(branch, Kind.FOLD, *_SUPER), *values(branch, Kind.FLIP, *_SUPER)]
    return Range(min(found), max(found)) if found else Range(0.0, 0.0)


def _order_peaks(branch: Branch) -> dict[int, Peak | None]:
    """The highest peak about a half, a third and a quarter of the main one."""
    main = highest(branch).value
    found: dict[int, Peak | None] = {}
    for order in (2, 3, 4):
        near = peaks(branch, main / order * 0.9, main / order * 1.1)
        found[order] = max(near, key=lambda peak: peak.height) if near else None
    return found


def _peaks_told(found: dict[int, Peak | None]) -> str:
    return ", ".join(f"1/{order}: {peak or 'none'}" for order, peak in found.items())


def _single_peaks(result: Result) -> Outcome:
    branch = main_branch(result)
    found = _order_peaks(branch)
    return holds(all(found.values()), f"main peak {highest(branch)}; {_peaks_told(found)}")


def _half_grows(single: Result, dual: Result) -> Outcome:
    one, two = (_order_peaks(main_branch(each))[2] for each in (single, dual))
    return holds(one is not None and two is not None and two.height > 1.2 * one.height, f"{one} without, {two} with it")


def _others_vanish(*results: Result) -> Outcome:
    """From the response to one harmonic, and from those to two at three phases."""
    single, *dual = [_order_peaks(main_branch(result)) for result in results]
    told = [f"{phase}: {_peaks_told(found)}" for phase, found in zip(("0°", "120°", "180°"), dual, strict=True)]
    gone = all(_gone(single[order], found[order]) for found in dual for order in (3, 4))
    return holds(gone, f"one harmonic: {_peaks_told(single)}; two: {'; '.join(told)}")


def _gone(before: Peak | None, after: Peak | None) -> bool:
    return before is not None and after is None


def _low_heights(branch: Branch, low: float, high: float) -> np.ndarray:
    """The largest amplitude at each of many values of the parameter; where several motions exist, the largest."""
    grid = np.linspace(low, high, 200)
    heights, places = branch.measure(MEASURE), branch.values
    best = np.zeros_like(grid)
    for (a, b), (p, q) in zip(np.c_[places[:-1], places[1:]], np.c_[heights[:-1], heights[1:]], strict=True):
        inside = (grid >= min(a, b)) & (grid <= max(a, b))
        if inside.any() and a != b:
            best[inside] = np.maximum(best[inside], p + (q - p) * (grid[inside] - a) / (b - a))
    return best


def _doubled_peaks(single: Result, dual: Result) -> Outcome:
    one, two = (_order_peaks(main_branch(each)) for each in (single, dual))
    half_grows = one[2] is not None and two[2] is not None and two[2].height > one[2].height
    evidence = f"one harmonic: {_peaks_told(one)}; two: {_peaks_told(two)}"
    return holds(half_grows and all(_gone(one[order], two[order]) for order in (3, 4)), evidence)


def _lower_amplitude(single: Result, dual: Result) -> Outcome:
    one, two = (_low_heights(main_branch(each), 0.15, 0.25) for each in (single, dual))
    share = float(np.mean(two < one))
    evidence = (
        f"lower at {share:.0%} of the frequencies between 0.15 and 0.25; the highest there is {two.max():.3g} "
        "with the second "
        f"harmonic and {one.max():.3g} without, the mean {two.mean():.3g} and {one.mean():.3g}"
    )
    return holds(two.max() < one.max() and share > 0.5, evidence)


def _third_harmonic(single: Result, dual: Result) -> Outcome:
    one, two = (peaks(main_branch(each), 0.15, 0.36) for each in (single, dual))
    rises = [_rises(main_branch(result)) for result in (single, dual)]
    evidence = (
        f"peaks below 0.36: {words(one)}; with 3 Ω: {words(two)}; the highest rises {rises[0]:.3g} and "
        f"{rises[1]:.3g} above the "
        "lowest amplitude there"
    )
    heights = [max((peak.height for peak in found), default=0.0) for found in (one, two)]
    return holds(heights[1] >= 2.0 * heights[0], evidence)


def _rises(branch: Branch) -> float:
    """How far the highest superharmonic peak rises above the lowest amplitude."""
    heights = _low_heights(branch, 0.15, 0.36)
    return float(heights.max() - heights[heights > 0.0].min())


CLAIMS = (
    Claim(
        "20-peak",
        "A second harmonic adds a peak with a jump at about half the main resonance.",
        ("12", "20a"),
        _superharmonic,
    ),
    Claim("20-flips", "At 120° periods double there, and period 2 is stable.", ("20a", "20b"), _phase_flips),
    Claim("21-folds", "The phase moves the folds: the range between them widens.", ("20a", "20b"), _moved_folds),
    Claim(
        "22-flips",
        "At 180° periods double near 0.7 to 0.8 too, and near the superharmonic peak.",
        ("22",),
        _antiphase_flips,
        BOTH,
        short=True,
    ),
    Claim("22-wider", "At 180° the non-linear range is wider still.", ("20a", "20b", "22"), _wider, BOTH, short=True),
    Claim("23-single", "One harmonic: peaks at 1/2, 1/3 and 1/4 of the main resonance.", ("9b",), _single_peaks),
    Claim("23-half", "A second harmonic at 2 Ω makes the peak at 1/2 higher.", ("9b", "23b"), _half_grows),
    Claim(
        "23-others",
        "With it the peaks at 1/3 and 1/4 vanish, whatever its phase.",
        ("9b", "23b", "23b-120", "23b-180"),
        _others_vanish,
        BOTH,
        short=True,
    ),
    Claim("25-peaks", "The same holds for twice the excitation.", ("24", "25"), _doubled_peaks, BOTH, short=True),
    Claim("25-lower", "There the second harmonic lowers the amplitude for Ω ≤ 0.25.", ("24", "25"), _lower_amplitude),
    Claim(
        "26-higher",
        "A second harmonic at 3 Ω raises the low-frequency peaks to twice their height at least.",
        ("9b", "26b"),
        _third_harmonic,
    ),
)

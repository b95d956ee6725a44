"""What the paper says of the excitation by two harmonics (its section 6, figures 20 to 29), and in its summary."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

import gapwalk as gw
from reproductions.padmanabhan_singh_1995.claims.claim import TOLERANCE, Against, Finding, claim
from reproductions.padmanabhan_singh_1995.quantities import (
    Peak,
    Range,
    attractor_of,
    counted,
    extent,
    flipped,
    heights_at,
    highest,
    main_branch,
    meeting,
    members,
    peaks,
    ranges,
    unstable_width,
    values,
    with_pair,
    words,
)

_SUPER = (0.24, 0.36)  # about half the first resonance
_FIRST = (0.57, 0.72)  # about the jumps of the first resonance from above
_NEAR_JUMP = (0.65, 0.85)  # where the paper has flips at 180 degrees only
_WHOLE = (0.15, 2.0)
_PHASES = ("0°", "120°", "180°")
_LARGE = 0.1  # relative change of an amplitude that is not small
_LIGHT = ("13", "13-dual", "15", "15-dual", "9b", "23b", "24", "25")


def _is_stable(instability: Any) -> bool:
    return instability.total == 0


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
    share = found.value / main.value
    return Finding(
        jump is not None and found.height > 1.2 * before.height,
        f"peak {found} ({share:.2f} of the main one), folds {jump}; without it {before.height:.3g}",
        against=(Against("place of the peak, as a share of the main one's", 0.5, share),),
    )


@claim("20-flips", "At 120° periods double there, and period 2 is stable.", "20a", "20b")
def _phase_flips(zero: gw.Result, turned: gw.Result) -> Finding:
    before, after = (meeting(flipped(main_branch(each)), *_SUPER) for each in (zero, turned))
    doubled = [member.branch for member in members(turned, 2) if extent(member.branch).meets(*_SUPER)]
    stable = [each for branch in doubled for each in ranges(branch, _is_stable)]
    return Finding(
        not before and bool(after and stable),
        f"in phase {words(before)}; at 120° {words(after)}, period 2 has {counted(len(stable), 'stable range')}",
        f"stable period 2 at {words(sorted(stable))}",
    )


@claim("21-folds", "The phase moves the folds: the range between them widens.", "20a", "20b", short=True)
def _moved_folds(zero: gw.Result, turned: gw.Result) -> Finding:
    """A picture does not show a widening by less than the tolerance: then it holds in kind only."""
    branches = [main_branch(each) for each in (zero, turned)]
    found = [[jump for branch in branches if (jump := _jump(branch, within))] for within in (_FIRST, _SUPER)]
    if not all(len(each) == 2 for each in found):
        return Finding(False, f"first resonance {words(found[0])}; superharmonic {words(found[1])}")
    first, lower = (after.width / before.width - 1.0 for before, after in found)
    return Finding(
        first > 0.0 and lower > 0.0,
        f"range between the folds: {first:+.1%} at the first resonance, {lower:+.0%} at the superharmonic one",
        f"first resonance {words(found[0])}; superharmonic {words(found[1])}",
        short=f"the first resonance widens by {first:.1%} only" if first < TOLERANCE else "",
    )


@claim(
    "21-earlier",
    "It moves the folds to come earlier at the first resonance, and at a lower frequency at the superharmonic one.",
    "20a",
    "20b",
    short=True,
)
def _earlier(zero: gw.Result, turned: gw.Result) -> Finding:
    """Folds that a rising frequency meets later are earlier only for a falling one, which the paper does not say."""
    branches = [main_branch(each) for each in (zero, turned)]
    found = [[jump for branch in branches if (jump := _jump(branch, within))] for within in (_FIRST, _SUPER)]
    if not all(len(each) == 2 for each in found):
        return Finding(False, f"first resonance {words(found[0])}; superharmonic {words(found[1])}")
    first, lower = ([b - a for a, b in zip(before, after, strict=True)] for before, after in found)
    return Finding(
        max(lower) < 0.0 and min(first) * max(first) > 0.0,
        f"they move by {' and '.join(f'{each:+.4f}' for each in first)} at the first resonance, by "
        f"{' and '.join(f'{each:+.4f}' for each in lower)} at the superharmonic one",
        short="at the first resonance earlier only if Ω falls" if min(first) > 0.0 else "",
    )


@claim("22-flips", "At 180° periods double near 0.8 too, and near the superharmonic peak.", "22", short=True)
def _antiphase_flips(result: gw.Result) -> Finding:
    found = flipped(main_branch(result))
    above, lower = meeting(found, *_NEAR_JUMP), meeting(found, *_SUPER)
    nearest = min((end for each in above for end in each), key=lambda end: abs(end - 0.8), default=0.0)
    return Finding(
        bool(above and lower),
        f"doubled periods at {words(above)} (the paper: about 0.8) and {words(lower)}",
        against=(Against("flips near the jump", 0.8, nearest),),
    )


@claim("22-additional", "Those near 0.8 are not there in phase and at 120°.", "20a", "20b", "22", short=True)
def _additional(*results: gw.Result) -> Finding:
    found = [meeting(flipped(main_branch(result)), *_NEAR_JUMP) for result in results]
    return Finding(
        not found[0] and not found[1] and bool(found[2]),
        "; ".join(f"{phase} {words(each)}" for phase, each in zip(_PHASES, found, strict=True)),
    )


@claim(
    "22-wider",
    "At 180° the non-linear range is wider than at 120°, as that is than in phase.",
    "20a",
    "20b",
    "22",
    short=True,
)
def _wider(*results: gw.Result) -> Finding:
    """The width in which period 1 is unstable; between the folds of a jump, where several exist, one of them is."""
    found = [unstable_width(main_branch(result), *_SUPER) for result in results]
    return Finding(
        found[0] < found[1] < found[2],
        f"period 1 is unstable over {', '.join(f'{each:.3f}' for each in found)} at 0°, 120°, 180°, in 0.24–0.36",
    )


@claim(
    "summary-phase",
    "More phase between the harmonics brings more motions of other periods.",
    "20a",
    "20b",
    "22",
    "13-dual",
    "13-dual-120",
    "13-dual-180",
    short=True,
)
def _more_phase(*results: gw.Result) -> Finding:
    """In all cases, says the paper: those of figures 20 to 22, and figure 13's lighter load under the same torques."""
    widths = [unstable_width(main_branch(result), *_WHOLE) for result in results]
    heavy, light = (", ".join(f"{each:.3f}" for each in found) for found in (widths[:3], widths[3:]))
    grows = [found[0] < found[1] < found[2] for found in (widths[:3], widths[3:])]
    return Finding(
        any(grows),
        f"period 1 is unstable over {heavy} at 0°, 120°, 180° under the heavy load, {light} under that of figure 13",
        short="" if all(grows) else f"under the {('lighter', 'heavy')[grows[0]]} load only",
    )


@claim(
    "summary-second", "Under a heavy load a second harmonic changes little away from half the resonance.", "12", "20a"
)
def _changes_little(single: gw.Result, dual: gw.Result) -> Finding:
    grid = np.array([each for each in np.linspace(0.15, 2.0, 400) if not _SUPER[0] <= each <= _SUPER[1]])
    one, two = (heights_at(main_branch(each), grid) for each in (single, dual))
    change = np.abs(two / one - 1.0)
    share = float(np.mean(change > _LARGE))
    return Finding(
        float(np.median(change)) < 0.01 and share < 0.25,
        f"median change {np.median(change):.1%}; above {_LARGE:.0%} at {share:.0%} of the frequencies",
        short=f"above {_LARGE:.0%} at {share:.0%} of the frequencies" if share > TOLERANCE else "",
    )


@claim("summary-wider", "Under a light load it acts over a wider range, with more motions of other periods.", *_LIGHT)
def _more_when_light(*results: gw.Result) -> Finding:
    """For four light sets, without and with the second harmonic."""
    widths = [unstable_width(main_branch(result), *_WHOLE) for result in results]
    pairs = dict(zip(("13", "15", "23", "24"), zip(widths[::2], widths[1::2], strict=True), strict=True))
    little = [name for name, (one, two) in pairs.items() if two < (1.0 + TOLERANCE) * one]
    return Finding(
        len(little) < len(pairs),
        "width in which period 1 is unstable, one harmonic and two: "
        + "; ".join(f"set of figure {name} {one:.3f}, {two:.3f}" for name, (one, two) in pairs.items()),
        short=f"not by more than {TOLERANCE:.0%} in the set of figure {' and '.join(little)}" if little else "",
    )


def _order_peaks(branch: gw.Branch) -> dict[int, Peak | None]:
    """The highest peak about a half, a third and a quarter of the main one."""
    main = highest(branch).value
    found: dict[int, Peak | None] = {}
    for order in (2, 3, 4):
        near = peaks(branch, main / order * 0.9, main / order * 1.1)
        found[order] = max(near, key=lambda peak: peak.height) if near else None
    return found


def _peak_words(found: dict[int, Peak | None], orders: Sequence[int] = (2, 3, 4)) -> str:
    return ", ".join(f"1/{order}: {found[order] or 'none'}" for order in orders)


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


@claim("23-others", "With it the peaks at 1/3 and 1/4 vanish, whatever its phase.", "9b", "23b", "23b-180")
def _others_vanish(*results: gw.Result) -> Finding:
    """From the response to one harmonic, and from those to two at two phases."""
    single, *dual = [_order_peaks(main_branch(result)) for result in results]
    phases = [f"{phase} {_peak_words(found, (3, 4))}" for phase, found in zip(("0°", "180°"), dual, strict=True)]
    gone = all(_gone(single[order], found[order]) for found in dual for order in (3, 4))
    return Finding(gone, "; ".join(phases), f"one harmonic: {_peak_words(single)}")


def _gone(before: Peak | None, after: Peak | None) -> bool:
    return before is not None and after is None


@claim("25-peaks", "The second harmonic suppresses superharmonic peaks for twice the excitation too.", "24", "25")
def _doubled_peaks(single: gw.Result, dual: gw.Result) -> Finding:
    """The effect is still observed: it need not be as strong as in figure 23, where peaks vanish."""
    one, two = (_heights_near_peaks(main_branch(each)) for each in (single, dual))
    falls = {order: 1.0 - two[order] / one[order] for order in (3, 4)}
    left = [order for order, peak in _order_peaks(main_branch(dual)).items() if order > 2 and peak is not None]
    return Finding(
        min(falls.values()) > _LARGE,
        f"1/3 falls from {one[3]:.3g} to {two[3]:.3g}, 1/4 from {one[4]:.3g} to {two[4]:.3g}",
        f"peaks: one harmonic {_peak_words(_order_peaks(main_branch(single)))}; two "
        f"{_peak_words(_order_peaks(main_branch(dual)))}",
        short=f"the peak at 1/{left[0]} falls by {falls[left[0]]:.0%} only" if left else "",
    )


def _heights_near_peaks(branch: gw.Branch) -> dict[int, float]:
    """The peaks about a third and a quarter of the main one's frequency; without a peak the highest amplitude there."""
    main, found = highest(branch).value, _order_peaks(branch)
    return {order: (found[order] or highest(branch, main / order * 0.9, main / order * 1.1)).height for order in (3, 4)}


@claim("25-lower", "There the second harmonic lowers the amplitude for Ω ≤ 0.25.", "24", "25")
def _lower_amplitude(single: gw.Result, dual: gw.Result) -> Finding:
    one, two = (heights_at(main_branch(each), np.linspace(0.15, 0.25, 200)) for each in (single, dual))
    share = float(np.mean(two < one))
    return Finding(
        two.max() < one.max() and share > 0.5,
        f"lower at {share:.0%} of 0.15–0.25; highest {one.max():.3g} without it, {two.max():.3g} with it",
        f"mean {one.mean():.3g} without it, {two.mean():.3g} with it",
    )


@claim(
    "26-higher", "A second harmonic at 3 Ω raises the low-frequency peaks to twice their height at least.", "9b", "26b"
)
def _third_harmonic(single: gw.Result, dual: gw.Result) -> Finding:
    """The highest of them is compared; a peak that does not rise so far makes it a statement in kind."""
    one, two = (_order_peaks(main_branch(each)) for each in (single, dual))
    rises = {order: b.height / a.height for order in (2, 3, 4) if (a := one[order]) and (b := two[order])}
    lowest = min(rises, key=lambda order: rises[order])
    tops = [max(peak.height for peak in peaks(main_branch(each), 0.15, 0.36)) for each in (single, dual)]
    return Finding(
        tops[1] >= 2.0 * tops[0],
        ", ".join(f"1/{order}: x {rise:.2g}" for order, rise in rises.items()),
        f"one harmonic {_peak_words(one)}; two {_peak_words(two)}; highest below 0.36: {tops[0]:.3g}, {tops[1]:.3g}",
        short="" if rises[lowest] >= 2.0 else f"the peak at 1/{lowest} is {rises[lowest]:.2f} times as high",
    )


_BARE = (0.3, 0.45)


def isolated(result: gw.Result) -> list[Any]:
    """Return the branches of period 1 that closed on themselves, the widest first."""
    closed = [member for member in members(result, 1) if member.branch.closed]
    return sorted(closed, key=lambda member: -extent(member.branch).width)


def _extents(result: gw.Result) -> list[Range]:
    return [extent(member.branch) for member in isolated(result)]


@claim(
    "27-islands",
    "At Ω = 0.25 two isolated branches lie over the amplitude, on both sides of 0.3–0.45.",
    "27",
    short=True,
)
def _two_isolated(result: gw.Result) -> Finding:
    """The equations are the same for -Te1 half a period later, so a branch away from 0 has a mirror image."""
    positive = [each for each in _extents(result) if each.high > 0.0]
    through = extent(main_branch(result))
    ends = (positive[0].high, positive[-1].low) if positive else ()
    return Finding(
        len(positive) == 2,
        f"closed branches over Te1 at {words(positive)}",
        f"the mirror image of the smaller at −Te1 is a third; period 1 also runs through {through}",
        tuple(map(Against, ("the larger ends", "the smaller begins"), _BARE, ends)),
    )


@claim("27-beats", "The larger one has two small ranges of quasi-periodic motions.", "27", short=True)
def _large_pairs(result: gw.Result) -> Finding:
    if not isolated(result):
        return Finding(False, "0 isolated branches")
    loop, main = isolated(result)[0].branch, main_branch(result)
    found = with_pair(loop)
    through = [each for each in with_pair(main) if each.high > 0.0]
    return Finding(
        len(found) == 2,
        f"on the larger one ({extent(loop)}): {words(found)}",
        f"on the branch that runs through the whole range: {words(through)}",
    )


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
        Range(max(each.low, low), min(each.high, high)) for each in meeting(ranges(branch, _is_stable), low, high)
    ]
    line = f"period 1 runs through all of {low}–{high}, stable at {words(stable)}"
    return Finding(not through, line if through else "no branch of period 1 runs through 0.3–0.45")


_BETWEEN = ("27-0.3", "27-0.34", "27-0.4", "27-0.44")


@claim("27-aperiodic", "There only quasi-periodic or chaotic motions can exist.", *_BETWEEN)
def _aperiodic(*results: gw.Result) -> Finding:
    """From rest; one periodic motion refutes it."""
    found = [attractor_of(result) for result in results]
    return Finding(not any(each.period for each in found), f"from rest {', '.join(_labels(results))}")


@claim("28-grow", "At Ω = 0.255 both loops are larger.", "27", "28", short=True)
def _grow(first: gw.Result, second: gw.Result) -> Finding:
    before, after = _extents(first), _extents(second)
    evidence = f"at Ω = 0.25: {words(before)}; at 0.255: {words(after)}"
    if len(before) < 2 or len(after) < 2:
        return Finding(False, evidence)
    return Finding(after[0].width > before[0].width and after[-1].width > before[-1].width, evidence)


@claim("28-overlap", "There they overlap.", "28", short=True)
def _overlap(result: gw.Result) -> Finding:
    found = [each for each in _extents(result) if each.high > 0.0]
    return Finding(len(found) == 2 and found[0].meets(*found[1]), f"loops over Te1 at {words(found)}")


@claim("28-throughout", "There periodic motions exist throughout the range.", "28", "27", short=True)
def _throughout(result: gw.Result, before: gw.Result) -> Finding:
    """The paper concludes it from the overlap of the loops, but it rests on a branch that is there without one."""
    covered, same = (extent(main_branch(each)) for each in (result, before))
    return Finding(
        covered.width > 1.59,
        f"a branch of period 1 runs over {covered}, and at Ω = 0.25 too ({same}): it does not follow from an overlap",
    )


@claim("29-small", "At Ω = 0.35 period 1 is stable for small amplitudes.", "29")
def _small_amplitude(result: gw.Result) -> Finding:
    branch = main_branch(result)
    special = next(each for each in branch.special_points if each.before.total == 0 and each.after.total > 0)
    return Finding(
        branch.points[0].stable,
        f"stable from {branch.values[0]:.3g} up to the {special.kind.value} at {special.value:.4f}",
    )


@claim("29-cascade", "At moderate amplitudes periods double to stable 2, to 4 and more.", "29", "29-doubled")
def _cascade(result: gw.Result, close: gw.Result) -> Finding:
    twice, four = members(result, 2), members(close, 4)
    on_four = sum(len(values(member.branch, gw.Kind.FLIP)) for member in four)
    stable = [each for member in twice for each in ranges(member.branch, _is_stable)]
    stages = meeting(stable, *extent(close.branches[0]))  # those that double to 4
    first = max(stages, key=lambda each: each.width, default="none")
    return Finding(
        bool(stable and four) and on_four > 0,
        f"{counted(len(twice), 'branch')} of period 2 (stable at {first}), {len(four)} of period 4 with "
        f"{counted(on_four, 'flip')}",
        f"period 1 is unstable by a flip at {words(flipped(main_branch(result)))}; stable period 2: {words(stable)}",
    )


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


_HIGH, _MODERATE = ("29-0.65", "29-0.8", "29-0.95"), "29-0.27"


@claim("29-high", "At high amplitudes only quasi-periodic motion is stable.", *_HIGH)
def _high_amplitude(*results: gw.Result) -> Finding:
    only = all(attractor_of(each).kind == "quasi-periodic" for each in results)
    return Finding(only, f"from rest: {', '.join(_labels(results))}")


@claim("29-chaos", "Moderate amplitudes lead to chaos.", _MODERATE)
def _chaos(result: gw.Result) -> Finding:
    return Finding(attractor_of(result).kind == "chaotic", f"from rest: {_labels([result])[0]}")


@claim("29-route", "Chaos comes by doubled periods or by quasi-periodic motions.", "29-doubled", _MODERATE)
def _route(close: gw.Result, motion: gw.Result) -> Finding:
    """By doubled periods: the motions of periods 2 and 4 lose their stability at flips, one after the other."""
    place = motion.system["harmonic1.amplitude"]
    ends = [_last_stable_flip(close, period) for period in (2, 4)]
    steps = ", ".join(f"period {period} at {end:.4g}" for period, end in zip((2, 4), ends, strict=True))
    return Finding(
        attractor_of(motion).kind == "chaotic" and 0.0 < ends[0] < ends[1] < place,
        f"with growing Te1 stable motions double: {steps}; then {_labels([motion])[0]}",
    )


def _last_stable_flip(result: gw.Result, period: int) -> float:
    """The largest parameter at which stable motions of a period double; 0 if they do not."""
    flips = [flip for member in members(result, period) for flip in member.branch.special(gw.Kind.FLIP)]
    return max((flip.value for flip in flips if 0 in (flip.before.total, flip.after.total)), default=0.0)


@claim("summary-heavy", "Under a heavy mean load on the clutch no period doubles.", "12", "20a", "4a", short=True)
def _heavy(*results: gw.Result) -> Finding:
    found = [flipped(main_branch(result)) for result in results]
    named = zip(("12", "20a", "4a"), found, strict=True)
    return Finding(not any(found), "; ".join(f"set {name}: {words(each)}" for name, each in named))


@claim("summary-light", "Light loads and a large excitation give the richest behaviour.", "12", "9a", "13", "15")
def _light(*results: gw.Result) -> Finding:
    specials = [main_branch(result).special_points for result in results]
    count = [sum(each.kind is not gw.Kind.GRAZING for each in points) for points in specials]
    named = ", ".join(f"{n} in figure {name}" for n, name in zip(count, ("12", "14", "13", "15"), strict=True))
    return Finding(count[-1] == max(count) and count[0] == min(count), f"special points of period 1: {named}")

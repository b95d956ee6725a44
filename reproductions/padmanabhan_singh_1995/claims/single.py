"""What the paper says of the excitation by one harmonic (its section 5, figures 9 to 19)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

import gapwalk as gw
from reproductions.padmanabhan_singh_1995.claims.claim import TOLERANCE, Against, Finding, claim
from reproductions.padmanabhan_singh_1995.jobs import AS_PRINTED, LITERAL, MEASURE, TORI
from reproductions.padmanabhan_singh_1995.quantities import (
    Range,
    attractor_of,
    counted,
    covered,
    extent,
    flipped,
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

_SECOND = (1.1, 1.4)  # about the second resonance
_JUMP = (0.55, 0.9)  # beside the jump of the first
_NOTABLE = 0.05  # of the frequency: what a picture of the whole response would show
_CLOSE = 0.002  # share of the picture by which two curves may differ and still lie on each other


@claim(
    "9-balance",
    "Shooting and harmonic balance with many harmonics give the same responses.",
    "9a",
    "9a-balance",
    "9b",
    "9b-balance",
)
def _balance(*results: gw.Result) -> Finding:
    found = [
        gw.compare(main_branch(balanced), main_branch(shot))
        for shot, balanced in zip(results[::2], results[1::2], strict=True)
    ]
    methods = [result.walked.method for result in results[1::2]]
    harmonics = words([method.harmonics for method in methods if isinstance(method, gw.Balance)])
    apart = ", ".join(f"{each.largest:.1e}" for each in found)
    return Finding(
        all(each.within(_CLOSE) for each in found),
        f"largest distance {apart} of the ranges (κ = 0.1, 0.4), with {harmonics} harmonics",
        f"special points within {', '.join(f'{each.largest_shift:.1e}' for each in found)}",
    )


_LOW = (("9b", 0.16), ("15", 0.24))  # stable motions of period 1 under light loads, at low frequencies


@claim("9-harmonics", "Under light loads harmonic balance needs about 15 to 20 harmonics, most at low frequencies.")
def _many_harmonics() -> Finding:
    coarse, fine = zip(*(_needed(gw.paper.case(case).at(frequency=value)) for case, value in _LOW), strict=True)
    (main, _) = _needed(gw.paper.case("9b").at(frequency=1.9))
    places = ", ".join(f"{case} at {value}" for case, value in _LOW)
    return Finding(
        all(15 <= each <= 20 for each in fine) and main < min(coarse),
        f"1e-4 of the amplitude needs {words(fine)} harmonics ({places}), 1 % needs {words(coarse)}",
        f"above the resonances (9b at 1.9) 1 % needs {main}",
    )


def _needed(system: gw.System) -> tuple[int, int]:
    """Return the harmonics from which on the amplitude stays within 1 % and within 1e-4 of that by shooting."""
    exact = gw.find_orbit(system)
    apart = {}
    for harmonics in range(1, 26):
        balanced = gw.find_orbit(system, 1, exact.state, method=gw.Balance(harmonics, error=1.0))
        apart[harmonics] = abs(balanced.measure(MEASURE) / exact.measure(MEASURE) - 1.0)
    coarse, fine = (max((n for n, share in apart.items() if share > bound), default=0) + 1 for bound in (1e-2, 1e-4))
    return coarse, fine


@claim("9-integration", "Direct integration gives the same motions.", "9a", "9b")
def _integrated(*results: gw.Result) -> Finding:
    """From rest, without continuation: the motion on which each of a few systems settles, beside the branch."""
    worst, count = 0.0, 0
    for result, places in zip(results, ((0.3, 0.9, 1.8), (0.3, 0.9, 1.8)), strict=True):
        for place in places:
            settled = gw.settle(result.system, frequency=place).orbit
            assert settled is not None
            worst = max(worst, _distance_to(main_branch(result), place, settled.measure(MEASURE)))
            count += 1
    return Finding(worst < _CLOSE, f"{count} motions from rest lie within {worst:.1e} of the branches")


def _distance_to(branch: gw.Branch, place: float, height: float) -> float:
    """The smallest relative distance of an amplitude from those of a branch at one frequency."""
    heights, places = branch.measure(MEASURE), branch.values
    inside = np.flatnonzero((places[:-1] - place) * (places[1:] - place) <= 0.0)
    share = (place - places[inside]) / (places[inside + 1] - places[inside])
    return float(np.abs((heights[inside] + share * (heights[inside + 1] - heights[inside])) / height - 1.0).min())


@claim("10-shrinks", "A softer second stage makes the range of doubled periods smaller.", "4a", "10b", short=True)
def _shrinks(stiff: gw.Result, soft: gw.Result) -> Finding:
    before, after = (_sum(flipped(main_branch(each))) for each in (stiff, soft))
    return Finding(
        after < before,
        f"{before:.3f} wide with n1 = 1, {after:.3f} with n1 = 0.8",
        f"at {words(flipped(main_branch(stiff)))} and {words(flipped(main_branch(soft)))}",
    )


def _sum(found: Sequence[Range]) -> float:
    return sum(each.width for each in found)


@claim("10-gone", "With n1 = 0.8 it is gone altogether.", "4a", "10b", short=True)
def _disappears(stiff: gw.Result, soft: gw.Result) -> Finding:
    before, left = (flipped(main_branch(each)) for each in (stiff, soft))
    return Finding(bool(before) and not left, f"n1 = 1: {words(before)}; n1 = 0.8: {words(left)}")


@claim("10-doubled", "Where period 1 is unstable by flips in figure 10a, there are stable motions of period 2.", "4a")
def _doubled(result: gw.Result) -> Finding:
    stable = [each for member in members(result, 2) for each in ranges(member.branch, _is_stable)]
    inside = meeting(stable, *_JUMP)
    flips = meeting(flipped(main_branch(result)), *_JUMP)
    share = sum(covered(inside, *each) for each in flips) / _sum(flips)
    return Finding(
        bool(inside),
        f"stable period 2 at {words(inside)}, {share:.0%} of where period 1 is unstable by flips ({_flips_of(result)})",
    )


def _flips_of(result: gw.Result) -> str:
    return words(meeting(flipped(main_branch(result)), *_JUMP))


def _is_stable(instability: Any) -> bool:
    return instability.total == 0


def resonances(system: gw.System) -> tuple[float, float]:
    """Return the two resonances of a clutch whose second stage is closed all the time."""
    force = np.array([system["stage2.force.q1"], system["stage2.force.q3"]]) * system["stage2.stiffness"]
    squares = np.linalg.eigvals(system.matrix("stiffness") + np.outer(force, [1.0, 0.0]))
    low, high = np.sqrt(np.sort(squares.real))
    return float(low), float(high)


def _spacing_of(system: gw.System) -> float:
    low, high = resonances(system)
    return high - low


_DAMAGED = "K12 of figure 11 cannot be read"


@claim("11-spacing", "The resonances of the two sets are 0.6 and 0.8 apart.", "11a", "11b", lost=_DAMAGED)
def _spacing(first: gw.Result, second: gw.Result) -> Finding:
    """With the scan as it can be read; with the proportions K12 = 0.6, n2 = 0.6 n1 of all other rows set a fits."""
    apart = [_spacing_of(result.system) for result in (first, second)]
    n1 = first.system["stage2.force.q1"]
    usual = _spacing_of(first.system.at({"stiffness.q1.q3": -0.6, "stage2.force.q3": -0.6 * n1}))
    named = tuple(
        Against(f"spacing in set {name}", paper, each)
        for name, paper, each in zip("ab", (0.6, 0.8), apart, strict=True)
    )
    return Finding(
        all(each.off < TOLERANCE for each in named),
        f"{apart[0]:.3f} and {apart[1]:.3f} (the paper: 0.6, 0.8)",
        f"set a with K12 = 0.6 and n2 = 0.6 n1, the proportions of all other rows: {usual:.3f}; K12 is damaged in both",
        named,
    )


def _about(result: gw.Result, resonance: float) -> list[Range]:
    return meeting(flipped(main_branch(result)), resonance - 0.15, resonance + 0.15)


@claim("11-second", "Periods double about the second resonance in set b, but not in set a.", "11a", "11b")
def _second_resonance(first: gw.Result, second: gw.Result) -> Finding:
    found = [_about(result, resonances(result.system)[1]) for result in (first, second)]
    return Finding(
        not found[0] and bool(found[1]),
        f"within 0.15 of the second resonance: a {words(found[0])}; b {words(found[1])}",
        "K12 of both sets is damaged in the scan",
    )


_BEATS = (0.5, 0.7)  # where the paper has them in set b


@claim("11-beats", "Quasi-periodic motions take a wider range in set b (0.5 ≤ Ω ≤ 0.7) than in set a.", "11a", "11b")
def _wider_pair(first: gw.Result, second: gw.Result) -> Finding:
    found = [with_pair(main_branch(result)) for result in (first, second)]
    inside = [covered(each, *_BEATS) for each in found]
    return Finding(
        inside[1] > inside[0] + _NOTABLE,
        f"width of the complex pair in 0.5–0.7: a {inside[0]:.3f}, b {inside[1]:.3f}",
        f"anywhere: a {words(found[0])}; b {words(found[1])}",
    )


@claim("11-stable", "In set a period 1 is stable over 0.5 ≤ Ω ≤ 0.7.", "11a", lost=_DAMAGED)
def _stable_there(result: gw.Result) -> Finding:
    branch = main_branch(result)
    stable = meeting(ranges(branch, _is_stable), *_BEATS)
    share = covered(stable, *_BEATS) / (_BEATS[1] - _BEATS[0])
    flips = words(meeting(flipped(branch), *_BEATS))
    return Finding(share > 1.0 - TOLERANCE, f"stable at {words(stable)}, {share:.0%} of it; doubled periods at {flips}")


@claim(
    "11-tori",
    "Integration confirms quasi-periodic motions where set b has the pair.",
    *(f"11b-{place}" for place in TORI),
)
def _tori(*results: gw.Result) -> Finding:
    """At a few frequencies; where only some of them have a torus, it holds partly."""
    found = [attractor_of(result) for result in results]
    tori = [each for each in found if each.kind == "quasi-periodic"]
    line = ", ".join(
        f"{'undecided' if each.label == '?' else each.label} at {each.system.frequency:g}" for each in found
    )
    where = f"at {words([each.system.frequency for each in tori])} only"
    return Finding(bool(tori), line, short="" if len(tori) == len(found) else where)


@claim("12-folds", "Under a heavy load the response jumps, and no period doubles.", "12", short=True)
def _heavy_folds(result: gw.Result) -> Finding:
    branch = main_branch(result)
    flips, folds = flipped(branch), values(branch, gw.Kind.FOLD)
    return Finding(bool(folds) and not flips, f"folds at {words(folds)}; doubled periods: {words(flips)}")


@claim(
    "12-beats",
    "Under a heavy load quasi-periodic motion takes a small range only, near the first resonance.",
    "12",
    others=(AS_PRINTED,),
    short=True,
)
def _heavy_pair(result: gw.Result) -> Finding:
    found = with_pair(main_branch(result))
    few = bool(found) and sum(each.width for each in found) < 0.05
    return Finding(few, f"unstable by a complex pair: {words(found)}")


@claim(
    "13-flips",
    "With half the mean load, periods double about the second resonance and beside the jump, at 0.62 to 0.85.",
    "13",
    short=True,
)
def _flips(result: gw.Result) -> Finding:
    branch = main_branch(result)
    second, jump = meeting(flipped(branch), *_SECOND), meeting(flipped(branch), *_JUMP)
    named = (Against("lower end", 0.62, jump[0].low), Against("upper end", 0.85, jump[-1].high)) if jump else ()
    return Finding(
        bool(second and jump),
        f"{words(jump)} beside the jump (the paper: 0.62–0.85), {words(second)} about the second resonance",
        against=named,
    )


def _loops_about_second(result: gw.Result) -> list[gw.Branch]:
    return [member.branch for member in members(result, 2) if extent(member.branch).meets(*_SECOND)]


def _loop_pairs(result: gw.Result) -> list[Range]:
    return [each for loop in _loops_about_second(result) for each in with_pair(loop)]


@claim("13-loop", "The loop of period 2 about the second resonance has quasi-periodic motions.", "13")
def _loop_with_pair(result: gw.Result) -> Finding:
    found = _loop_pairs(result)
    return Finding(bool(found), f"a complex pair on it at {words(found)}")


@claim("13-parts", "The loops of period 2 in figures 13 and 14 have unstable parts of the kind +1.", "13", "9a")
def _loop_folds(*results: gw.Result) -> Finding:
    found = [[v for loop in _loops_about_second(result) for v in values(loop, gw.Kind.FOLD)] for result in results]
    return Finding(all(found), f"folds on them: figure 13 {words(found[0])}; figure 14 {words(found[1])}")


@claim("13-natures", "Periods double both super- and subcritically.", "13", short=True)
def _natures(result: gw.Result) -> Finding:
    flips = [each for each in main_branch(result).special(gw.Kind.FLIP) if each.nature]
    found = [f"{each.nature} at {each.value:.4f}" for each in flips]
    return Finding(len({each.nature for each in flips}) == 2, words(found))


@claim("13-once", "Doubled periods do not double again, neither here nor in figure 14.", "13", "9a")
def _no_cascade(*results: gw.Result) -> Finding:
    found = [sorted(v for each in members(result, 2) for v in values(each.branch, gw.Kind.FLIP)) for result in results]
    return Finding(
        not any(found),
        f"period 2 doubles again: figure 13 at {words(found[0])}; figure 14 at {words(found[1])}",
    )


@claim(
    "14-jump",
    "More mean load on the shaft: the doubled periods beside the jump give way to period 1.",
    "13",
    "9a",
    others=(LITERAL,),
    short=True,
)
def _jump_region_gone(before: gw.Result, after: gw.Result) -> Finding:
    first, then = (meeting(flipped(main_branch(each)), *_JUMP) for each in (before, after))
    return Finding(bool(first) and not then, f"figure 13: {words(first)}; figure 14: {words(then)}")


@claim("14-second", "The range of doubled periods about the second resonance shrinks.", "13", "9a", short=True)
def _second_shrinks(before: gw.Result, after: gw.Result) -> Finding:
    first, then = (meeting(flipped(main_branch(each)), *_SECOND) for each in (before, after))
    smaller = bool(first and then) and _sum(then) < _sum(first)
    return Finding(smaller, f"figure 13: {words(first)}; figure 14: {words(then)}")


@claim("14-loop", "The loop of period 2 about the second resonance has no quasi-periodic motions.", "9a")
def _loop_without_pair(result: gw.Result) -> Finding:
    found = _loop_pairs(result)
    return Finding(
        not found,
        f"{counted(len(found), 'range')} with a complex pair on {counted(len(_loops_about_second(result)), 'loop')}",
    )


_RICH = (0.15, 0.45)  # the low frequencies, that figure 15b expands


@claim(
    "15-rich",
    "Twice the excitation: superharmonics at low frequencies, flips and Hopf bifurcations almost throughout.",
    "15",
    "13",
)
def _rich(light: gw.Result, before: gw.Result) -> Finding:
    branch, other = main_branch(light), main_branch(before)
    count, less = (len(peaks(each, high=0.6)) for each in (branch, other))
    flips, pairs = meeting(flipped(branch), *_RICH), meeting(with_pair(branch), *_RICH)
    share = unstable_width(branch, *_RICH) / (_RICH[1] - _RICH[0])
    return Finding(
        count > less and len(flips) > 2 and bool(pairs),
        f"period 1 is unstable at {share:.0%} of 0.15–0.45; {count} peaks below 0.6 (figure 13: {less})",
        f"doubled periods at {words(flips)}, a complex pair at {words(pairs)}",
        (Against("share of 0.15–0.45 where period 1 is unstable", 1.0, share),),
    )


@claim("16-parts", "Its loops of period 2 have Hopf bifurcations, flips and folds.", "16-high", "16")
def _parts(*results: gw.Result) -> Finding:
    loops = [member.branch for result in results for member in members(result, 2)]
    pairs = [each for loop in loops for each in with_pair(loop)]
    flips = [each for loop in loops for each in flipped(loop)]
    folds = sorted(each for loop in loops for each in values(loop, gw.Kind.FOLD))
    widest = [max(found, key=lambda each: each.width) for found in (pairs, flips) if found]
    return Finding(
        bool(pairs and flips and folds),
        f"{counted(len(pairs), 'range')} with a pair, {len(flips)} beyond −1, {counted(len(folds), 'fold')}; "
        f"widest {words(widest)}",
        f"pairs {words(sorted(pairs))}; doubled {words(sorted(flips))}; folds {words(folds)}",
    )


@claim("16-cascade", "Period 2 doubles to stable period 4, and that doubles again.", "16-doubled")
def _cascade(result: gw.Result) -> Finding:
    doubled = members(result, 4)
    stable = [each for member in doubled for each in ranges(member.branch, _is_stable)]
    further = sum(len(values(member.branch, gw.Kind.FLIP)) for member in doubled)
    return Finding(
        bool(stable) and further > 0,
        f"{counted(len(doubled), 'branch')} of period 4, stable over {_sum(stable):.2g} in all, with "
        f"{counted(further, 'flip')}",
        f"stable at {words(sorted(stable))}",
    )


@claim("16-chaos", "Integration confirms chaos in the range of figure 16b.", "15-0.4")
def _chaos(result: gw.Result) -> Finding:
    found = attractor_of(result)
    return Finding(found.kind == "chaotic", f"{found.label} at Ω = {result.system.frequency:g}{_exponent(found)}")


def _exponent(found: Any) -> str:
    """The largest exponent over a forcing period."""
    if not found.lyapunov:
        return ""
    return f", largest exponent {found.lyapunov.exponents[0] * 2.0 * math.pi / found.system.frequency:.2g} a period"


_PRINTED_AT = (0.63, 0.634, 0.636)  # figures 17 to 19
_WANTED = ("periodic", "quasi-periodic", "chaotic")


@claim(
    "17-sequence",
    "Period 3, quasi-periodic and chaotic motion at 0.63, 0.634 and 0.636 (figures 17 to 19).",
    "17",
    "18",
    "19",
)
def _printed_sequence(*results: gw.Result) -> Finding:
    found = [attractor_of(result) for result in results]
    evidence = f"{', '.join(f'{each.label} at {each.system.frequency:g}' for each in found)}"
    return Finding(found[0].period == 3 and tuple(each.kind for each in found) == _WANTED, evidence)


@claim(
    "17-elsewhere",
    "Period 3 gives way to quasi-periodic and that to chaotic motion within a small change of frequency.",
    "17-near",
    "18-near",
    "19-near",
    apart=True,
)
def _sequence(*results: gw.Result) -> Finding:
    found = [attractor_of(result) for result in results]
    evidence = ", ".join(f"{each.label} at Ω = {each.system.frequency:g}" for each in found)
    places = [each.system.frequency for each in found]
    change, paper = max(places) - min(places), _PRINTED_AT[-1] - _PRINTED_AT[0]
    evidence += f": a change by {change:.3f}, {change / paper:.0f} times the {paper:.3f} of the paper"
    return Finding(found[0].period == 3 and tuple(each.kind for each in found) == _WANTED, evidence)

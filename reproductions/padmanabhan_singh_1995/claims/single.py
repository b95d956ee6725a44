"""What the paper says of the excitation by one harmonic (its section 5, figures 9 to 19)."""

from __future__ import annotations

import numpy as np

import gapwalk as gw
from reproductions.padmanabhan_singh_1995.claims.claim import BOTH, Finding, claim
from reproductions.padmanabhan_singh_1995.jobs import AS_PRINTED
from reproductions.padmanabhan_singh_1995.quantities import (
    Range,
    attractor_of,
    extent,
    flipped,
    main_branch,
    meeting,
    members,
    peaks,
    values,
    with_pair,
    words,
)

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
    parts, agree = [], True
    for name, shot, balanced in zip(("κ = 0.1", "κ = 0.4"), results[::2], results[1::2], strict=True):
        compared = gw.compare(main_branch(balanced), main_branch(shot))
        agree &= compared.within(_CLOSE)
        parts.append(
            f"{name}: largest distance {compared.largest:.1e} of the ranges, special points within "
            f"{compared.largest_shift:.1e} of each other"
        )
    method = results[1].walked.method
    assert isinstance(method, gw.Balance)
    return Finding(agree, f"with {method.harmonics} harmonics; {'; '.join(parts)}")


@claim("10-shrinks", "A softer second stage makes the range of doubled periods smaller.", "4a", "10b", short=True)
def _shrinks(stiff: gw.Result, soft: gw.Result) -> Finding:
    before, after = flipped(main_branch(stiff)), flipped(main_branch(soft))
    smaller = sum(each.width for each in after) < sum(each.width for each in before)
    return Finding(smaller, f"doubled periods at {words(before)} for n1 = 1, at {words(after)} for n1 = 0.8")


@claim(
    "10-gone",
    "With n1 = 0.8 it is gone altogether.",
    "10b",
    "10b-softer",
    others=(AS_PRINTED,),
    elsewhere=("10b",),
    short=True,
)
def _disappears(soft: gw.Result, *softer: gw.Result) -> Finding:
    left = flipped(main_branch(soft))
    if not left:
        return Finding(True, "none at n1 = 0.8")
    further = "".join(f"; at n1 = 0.7 there is {words(flipped(main_branch(each)))}" for each in softer)
    return Finding(False, f"at n1 = 0.8 it is still there, at {words(left)}{further}")


def resonances(system: gw.System) -> tuple[float, float]:
    """Return the two resonances of a clutch whose second stage is closed all the time."""
    force = np.array([system["stage2.force.q1"], system["stage2.force.q3"]]) * system["stage2.stiffness"]
    squares = np.linalg.eigvals(system.matrix("stiffness") + np.outer(force, [1.0, 0.0]))
    low, high = np.sqrt(np.sort(squares.real))
    return float(low), float(high)


@claim("11-spacing", "The resonances of the two sets are 0.6 and 0.8 apart.", "11a", "11b", "11a-mended")
def _spacing(first: gw.Result, second: gw.Result, mended: gw.Result) -> Finding:
    pairs = [resonances(result.system) for result in (first, second, mended)]
    apart = [high - low for low, high in pairs]
    evidence = (
        f"with what can be read of the scan they are {apart[0]:.3f} and {apart[1]:.3f} apart, not 0.6 and 0.8; "
        "set a with K12 = 0.6 and n2 = 0.6 n1 = 0.42, the proportions of all other sets, has "
        f"{apart[2]:.3f}"
    )
    return Finding(abs(apart[0] - 0.6) < 0.05 and abs(apart[1] - 0.8) < 0.05, evidence)


def _about(result: gw.Result, resonance: float) -> list[Range]:
    return meeting(flipped(main_branch(result)), resonance - 0.15, resonance + 0.15)


@claim("11-second", "Periods double about the second resonance in set b, but not in set a.", "11a", "11b", "11a-mended")
def _second_resonance(first: gw.Result, second: gw.Result, mended: gw.Result) -> Finding:
    places = [resonances(result.system)[1] for result in (first, second, mended)]
    found = [_about(result, place) for result, place in zip((first, second, mended), places, strict=True)]
    evidence = (
        f"doubled periods within 0.15 of the second resonance: set a at {words(found[0])}, set b at {words(found[1])}; "
        f"set a with K12 = 0.6 and n2 = 0.42: {words(found[2])}. Set b rests on a damaged number"
    )
    return Finding(not found[0] and bool(found[1]), evidence)


@claim(
    "11-beats",
    "Quasi-periodic motions take a wider range in set b (0.5 ≤ Ω ≤ 0.7) than in set a.",
    "11a",
    "11b",
    "11a-mended",
)
def _wider_pair(first: gw.Result, second: gw.Result, mended: gw.Result) -> Finding:
    found = [with_pair(main_branch(result)) for result in (first, second, mended)]
    inside = [sum(min(each.high, 0.7) - max(each.low, 0.5) for each in meeting(ranges, 0.5, 0.7)) for ranges in found]
    evidence = (
        f"unstable by a complex pair between 0.5 and 0.7: {inside[0]:.3f} in set a, {inside[1]:.3f} in set b; "
        f"anywhere: a {words(found[0])}; b {words(found[1])}"
    )
    return Finding(inside[1] > inside[0] + _NOTABLE, evidence)


@claim("12-folds", "Under a heavy load the response jumps, and no period doubles.", "12", short=True)
def _heavy_folds(result: gw.Result) -> Finding:
    branch = main_branch(result)
    flips, folds = flipped(branch), values(branch, gw.Kind.FOLD)
    return Finding(bool(folds) and not flips, f"folds at {words(folds)}; doubled periods: {words(flips)}")


@claim(
    "12-beats",
    "Under a heavy load quasi-periodic motion takes a small range only, near the first resonance.",
    "12",
    others=BOTH,
    short=True,
)
def _heavy_pair(result: gw.Result) -> Finding:
    found = with_pair(main_branch(result))
    few = bool(found) and sum(each.width for each in found) < 0.05
    return Finding(few, f"unstable by a complex pair: {words(found)}")


_SECOND = (1.1, 1.4)  # about the second resonance
_JUMP = (0.55, 0.9)  # beside the jump of the first


@claim(
    "13-flips",
    "With half the mean load, periods double about the second resonance and beside the jump.",
    "13",
    others=BOTH,
)
def _flips(result: gw.Result) -> Finding:
    branch = main_branch(result)
    second, jump = meeting(flipped(branch), *_SECOND), meeting(flipped(branch), *_JUMP)
    evidence = (
        f"at {words(second)} about the second resonance and at {words(jump)} beside the jump (the paper: 0.62–0.85)"
    )
    return Finding(bool(second and jump), evidence)


def _loop_about_second(result: gw.Result) -> list[Range]:
    loops = [member.branch for member in members(result, 2) if extent(member.branch).meets(*_SECOND)]
    return [each for loop in loops for each in with_pair(loop)]


@claim("13-loop", "The loop of period 2 about the second resonance has quasi-periodic motions.", "13")
def _loop_with_pair(result: gw.Result) -> Finding:
    found = _loop_about_second(result)
    return Finding(bool(found), f"on the loop of period 2 about the second resonance, at {words(found)}")


@claim("13-natures", "Periods double both super- and subcritically.", "13")
def _natures(result: gw.Result) -> Finding:
    flips = [each for each in main_branch(result).special(gw.Kind.FLIP) if each.nature]
    found = [f"{each.nature} at {each.value:.4f}" for each in flips]
    return Finding(len({each.nature for each in flips}) == 2, words(found))


@claim("13-once", "Doubled periods do not double again, neither here nor in figure 14.", "13", "9a", others=BOTH)
def _no_cascade(*results: gw.Result) -> Finding:
    found = [[str(extent(member.branch)) for member in members(result, 4)] for result in results]
    evidence = f"period 4 in figure 13: {words(found[0])}; in figure 14: {words(found[1])}"
    return Finding(not any(found), evidence)


@claim(
    "14-jump",
    "More mean load on the shaft: the doubled periods beside the jump give way to period 1.",
    "13",
    "9a",
    others=BOTH,
)
def _jump_region_gone(before: gw.Result, after: gw.Result) -> Finding:
    first, then = (meeting(flipped(main_branch(each)), *_JUMP) for each in (before, after))
    return Finding(bool(first) and not then, f"{words(first)} in figure 13, {words(then)} in figure 14")


@claim("14-second", "The range of doubled periods about the second resonance shrinks.", "13", "9a")
def _second_shrinks(before: gw.Result, after: gw.Result) -> Finding:
    first, then = (meeting(flipped(main_branch(each)), *_SECOND) for each in (before, after))
    smaller = bool(first and then) and sum(each.width for each in then) < sum(each.width for each in first)
    return Finding(smaller, f"{words(first)} in figure 13, {words(then)} in figure 14")


@claim("14-loop", "The loop of period 2 about the second resonance has no quasi-periodic motions.", "9a")
def _loop_without_pair(result: gw.Result) -> Finding:
    found = _loop_about_second(result)
    return Finding(not found, f"unstable by a complex pair on the loop of period 2: {words(found)}")


@claim(
    "15-rich",
    "Twice the excitation: many superharmonics at low frequencies, with doubled periods and quasi-periodic motions.",
    "15",
    "13",
)
def _rich(light: gw.Result, before: gw.Result) -> Finding:
    branch, other = main_branch(light), main_branch(before)
    below = 0.6
    superharmonics = peaks(branch, high=below)
    flips, pairs = meeting(flipped(branch), 0.15, below), meeting(with_pair(branch), 0.15, below)
    evidence = (
        f"below {below}: {len(superharmonics)} peaks (figure 13: {len(peaks(other, high=below))}), doubled periods at "
        f"{words(flips)}, a complex pair at {words(pairs)}"
    )
    return Finding(len(superharmonics) > len(peaks(other, high=below)) and len(flips) > 2 and bool(pairs), evidence)


@claim("16-cascade", "Period 2 doubles to stable period 4, and that doubles again.", "16")
def _cascade(result: gw.Result) -> Finding:
    doubled = members(result, 4)
    stable = [member for member in doubled if any(point.stable for point in member.branch.points)]
    further = sum(len(values(member.branch, gw.Kind.FLIP)) for member in doubled)
    evidence = (
        f"{len(doubled)} branches of period 4, {len(stable)} of them stable in part, such as those at "
        f"{words([extent(member.branch) for member in stable[:3]])}; {further} flips on them"
    )
    return Finding(bool(stable) and further > 0, evidence)


_WANTED = ("periodic", "quasi-periodic", "chaotic")


@claim(
    "17-sequence",
    "Period 3, quasi-periodic and chaotic motion at 0.63, 0.634 and 0.636 (figures 17 to 19).",
    "17",
    "18",
    "19",
    others=BOTH,
)
def _printed_sequence(*results: gw.Result) -> Finding:
    found = [attractor_of(result) for result in results]
    evidence = f"the motions are {words([each.label for each in found])}; 17-elsewhere says where it is"
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
    return Finding(found[0].period == 3 and tuple(each.kind for each in found) == _WANTED, evidence)

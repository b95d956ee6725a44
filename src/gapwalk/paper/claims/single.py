"""What the paper says of stiffness, spacing and heavy loads under one harmonic (its section 5, figures 9 to 12)."""

from __future__ import annotations

import numpy as np

from gapwalk.bifurcation.branch import Kind
from gapwalk.bifurcation.compare import compare
from gapwalk.model.system import System
from gapwalk.orbit.balance import Balance
from gapwalk.paper.claims.claim import BOTH, Claim, Outcome, holds
from gapwalk.paper.claims.look import Range, beating, flipped, main_branch, values, words
from gapwalk.paper.reading import AS_PRINTED
from gapwalk.study.options import BranchOptions
from gapwalk.study.result import Result

_NOTABLE = 0.05  # of the frequency: what a picture of the whole response would show
_CLOSE = 0.002  # share of the picture by which two curves may differ and still lie on each other


def _balance(*results: Result) -> Outcome:
    parts, agree = [], True
    for name, shot, balanced in zip(("κ = 0.1", "κ = 0.4"), results[::2], results[1::2], strict=True):
        difference = compare(main_branch(balanced), main_branch(shot))
        agree &= difference.within(_CLOSE)
        parts.append(
            f"{name}: largest distance {difference.largest:.1e} of the ranges, special points within "
            f"{difference.largest_shift:.1e} of each other"
        )
    options = results[1].options
    assert isinstance(options, BranchOptions)
    assert isinstance(options.method, Balance)
    return holds(agree, f"with {options.method.harmonics} harmonics; {'; '.join(parts)}")


def _shrinks(stiff: Result, soft: Result) -> Outcome:
    before, after = flipped(main_branch(stiff)), flipped(main_branch(soft))
    smaller = sum(each.width for each in after) < sum(each.width for each in before)
    return holds(smaller, f"doubled periods at {words(before)} for n1 = 1, at {words(after)} for n1 = 0.8")


def _disappears(soft: Result, softer: Result) -> Outcome:
    left, further = flipped(main_branch(soft)), flipped(main_branch(softer))
    evidence = f"at n1 = 0.8 it is still there, at {words(left)}"
    return holds(not left, f"{evidence}; at n1 = 0.7 there is {words(further)}" if left else "none at n1 = 0.8")


def resonances(system: System) -> tuple[float, float]:
    """The two resonances of a clutch whose second stage is closed all the time."""
    force = np.array([system["stage2.force.q1"], system["stage2.force.q3"]]) * system["stage2.stiffness"]
    squares = np.linalg.eigvals(system.matrix("stiffness") + np.outer(force, [1.0, 0.0]))
    low, high = np.sqrt(np.sort(squares.real))
    return float(low), float(high)


def _spacing(first: Result, second: Result, mended: Result) -> Outcome:
    pairs = [resonances(result.system) for result in (first, second, mended)]
    apart = [high - low for low, high in pairs]
    evidence = (
        f"with what can be read of the scan they are {apart[0]:.3f} and {apart[1]:.3f} apart, not 0.6 and "
        "0.8; set a with "
        f"K12 = 0.6 and n2 = 0.6 n1 = 0.42, the proportions of all other sets, has {apart[2]:.3f}"
    )
    return holds(abs(apart[0] - 0.6) < 0.05 and abs(apart[1] - 0.8) < 0.05, evidence)


def _about(result: Result, resonance: float) -> list[Range]:
    return [each for each in flipped(main_branch(result)) if each.meets(resonance - 0.15, resonance + 0.15)]


def _second_resonance(first: Result, second: Result, mended: Result) -> Outcome:
    places = [resonances(result.system)[1] for result in (first, second, mended)]
    found = [_about(result, place) for result, place in zip((first, second, mended), places, strict=True)]
    evidence = (
        f"doubled periods within 0.15 of the second resonance: set a at {words(found[0])}, set b at {words(found[1])}; "
        f"set a with K12 = 0.6 and n2 = 0.42: {words(found[2])}. Set b rests on a damaged number"
    )
    return holds(not found[0] and bool(found[1]), evidence)


def _wider_beats(first: Result, second: Result, mended: Result) -> Outcome:
    found = [beating(main_branch(result)) for result in (first, second, mended)]
    inside = [
        sum(min(each.high, 0.7) - max(each.low, 0.5) for each in ranges if each.meets(0.5, 0.7)) for ranges in found
    ]
    evidence = (
        f"unstable by a complex pair between 0.5 and 0.7: {inside[0]:.3f} in set a, {inside[1]:.3f} in set b; "
        "anywhere: "
        f"a {words(found[0])}; b {words(found[1])}"
    )
    return holds(inside[1] > inside[0] + _NOTABLE, evidence)


def _heavy_folds(result: Result) -> Outcome:
    branch = main_branch(result)
    flips, folds = flipped(branch), values(branch, Kind.FOLD)
    return holds(bool(folds) and not flips, f"folds at {words(folds)}; doubled periods: {words(flips)}")


def _heavy_beats(result: Result) -> Outcome:
    found = beating(main_branch(result))
    few = bool(found) and sum(each.width for each in found) < 0.05
    return holds(few, f"unstable by a complex pair: {words(found)}")


CLAIMS = (
    Claim(
        "9-balance",
        "Shooting and harmonic balance with many harmonics give the same responses.",
        ("9a", "9a-balance", "9b", "9b-balance"),
        _balance,
    ),
    Claim("10-shrinks", "A softer second stage makes the range of doubled periods smaller.", ("4a", "10b"), _shrinks),
    Claim(
        "10-gone",
        "With n1 = 0.8 it is gone altogether.",
        ("10b", "10b-softer"),
        _disappears,
        (AS_PRINTED,),
        short=True,
    ),
    Claim(
        "11-spacing", "The resonances of the two sets are 0.6 and 0.8 apart.", ("11a", "11b", "11a-mended"), _spacing
    ),
    Claim(
        "11-second",
        "Periods double about the second resonance in set b, but not in set a.",
        ("11a", "11b", "11a-mended"),
        _second_resonance,
    ),
    Claim(
        "11-beats",
        "Motions that beat take a wider range in set b (0.5 ≤ Ω ≤ 0.7) than in set a.",
        ("11a", "11b", "11a-mended"),
        _wider_beats,
    ),
    Claim("12-folds", "Under a heavy load the response jumps, and no period doubles.", ("12",), _heavy_folds),
    Claim(
        "12-beats",
        "Under a heavy load quasi-periodic motion takes a small range only, near the first resonance.",
        ("12",),
        _heavy_beats,
        BOTH,
        short=True,
    ),
)

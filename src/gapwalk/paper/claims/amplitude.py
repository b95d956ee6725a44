"""What the paper says of motions over the amplitude (its section 6, figures 27 to 29), and in its summary."""

from __future__ import annotations

from gapwalk.attractor.attractor import AttractorKind
from gapwalk.bifurcation.branch import Kind
from gapwalk.bifurcation.diagram import Limb
from gapwalk.continuation.walk import EndReason
from gapwalk.paper.claims.claim import BOTH, Claim, Outcome, Verdict, holds
from gapwalk.paper.claims.look import Range, beating, extent, flipped, limbs, main_branch, ranges, values, words
from gapwalk.paper.reading import AS_PRINTED
from gapwalk.study.result import Result
from gapwalk.study.settle.finding import SettleFinding

_BARE = (0.3, 0.45)


def islands(result: Result) -> list[Limb]:
    """The branches of period 1 that closed on themselves, by their widths, the widest first."""
    closed = [limb for limb in limbs(result, 1) if limb.branch.ends[-1].reason is EndReason.CLOSED]
    return sorted(closed, key=lambda limb: -extent(limb.branch).width)


def _extents(result: Result) -> list[Range]:
    return [extent(limb.branch) for limb in islands(result)]


def _two_islands(result: Result) -> Outcome:
    found = _extents(result)
    positive = [each for each in found if each.high > 0.0]
    evidence = (
        f"closed branches at {words(found)}; the equations are the same for −Te1 half a period later, so "
        "those away from 0 "
        "come in pairs"
    )
    return holds(len(positive) == 2, evidence)


def _large_beats(result: Result) -> Outcome:
    if not islands(result):
        return holds(False, "no island")
    loop, main = islands(result)[0].branch, main_branch(result)
    found = [each for each in beating(main) if each.high > 0.0]
    evidence = (
        f"on the larger island ({extent(loop)}): {words(beating(loop))}; on the branch that runs through the "
        "whole range: "
        f"{words(found)}"
    )
    return holds(len(beating(loop)) == 2, evidence)


def _small_flips(result: Result) -> Outcome:
    small = islands(result)[-1].branch
    return holds(bool(values(small, Kind.FLIP)), f"on {extent(small)}: flips at {words(values(small, Kind.FLIP))}")


def _nothing_between(result: Result) -> Outcome:
    branch = main_branch(result)
    low, high = _BARE
    through = extent(branch).low <= low and extent(branch).high >= high
    stable = [
        Range(max(each.low, low), min(each.high, high))
        for each in ranges(branch, lambda instability: instability.total == 0)
        if each.meets(low, high)
    ]
    evidence = f"one branch of period 1 runs through all of {low}–{high}; it is stable at {words(stable)}"
    return holds(not through, evidence if through else "no branch of period 1 runs through")


def _grow(first: Result, second: Result) -> Outcome:
    before, after = _extents(first), _extents(second)
    evidence = f"at Ω = 0.25: {words(before)}; at 0.255: {words(after)}"
    if len(before) < 2 or len(after) < 2:
        return Outcome(Verdict.NOT_REPRODUCED, evidence)
    return holds(after[0].width > before[0].width and after[-1].width > before[-1].width, evidence)


def _overlap(result: Result, further: Result) -> Outcome:
    found, beyond = ([each for each in _extents(each) if each.high > 0.0] for each in (result, further))
    evidence = f"at Ω = 0.255: {words(found)}; at 0.2576: {words(beyond)}"
    if len(beyond) == 1:
        folds = values(main_branch(further), Kind.FOLD, low=0.0)
        evidence += (
            f", for the smaller one hangs together there with the branch that runs through; its folds: {words(folds)}"
        )
    return holds(len(found) == 2 and found[0].meets(found[1].low, found[1].high), evidence)


def _throughout(result: Result) -> Outcome:
    covered = extent(main_branch(result))
    return holds(covered.width > 1.59, f"a branch of period 1 runs from {covered.low:.3g} to {covered.high:.3g}")


def _small_amplitude(result: Result) -> Outcome:
    branch = main_branch(result)
    special = next(each for each in branch.special_points if each.before.total == 0 and each.after.total > 0)
    return holds(
        branch.points[0].stable,
        f"stable from {branch.values[0]:.3g} up to the {special.kind.value} at {special.value:.4f}",
    )


def _cascade(result: Result) -> Outcome:
    twice, four = limbs(result, 2), limbs(result, 4)
    on_four = sum(len(values(limb.branch, Kind.FLIP)) for limb in four)
    first = flipped(main_branch(result))
    evidence = (
        f"period 1 is unstable by a flip at {words(first)}; {len(twice)} branches of period 2, {len(four)} of "
        f"period 4 with {on_four} flips"
    )
    return holds(bool(twice and four) and on_four > 0, evidence)


def _beats(result: Result) -> Outcome:
    found = {
        f"period {period}": [each for limb in limbs(result, period) for each in beating(limb.branch)]
        for period in (1, 2)
    }
    return holds(any(found.values()), "; ".join(f"{name}: {words(each)}" for name, each in found.items()))


def _attractors(*results: Result) -> list[tuple[float, str, AttractorKind]]:
    found = []
    for result in results:
        assert isinstance(result.finding, SettleFinding)
        attractor = result.finding.attractor
        found.append((attractor.system["harmonic1.amplitude"], attractor.label, attractor.kind))
    return found


def _high_amplitude(*results: Result) -> Outcome:
    *found, lower = _attractors(*results)
    evidence = (
        f"from rest: {', '.join(f'{label} at {value:g}' for value, label, _ in found)}; {lower[1]} at {lower[0]:g}"
    )
    return holds(all(kind is AttractorKind.QUASI_PERIODIC for *_, kind in found), evidence)


def _chaos(*results: Result) -> Outcome:
    found = _attractors(*results)
    evidence = f"from rest: {', '.join(f'{label} at {value:g}' for value, label, _ in found)}"
    return holds(any(kind is AttractorKind.CHAOTIC for *_, kind in found), evidence)


def _heavy(*results: Result) -> Outcome:
    names = ("12", "20a", "4a", "10b")
    found = {name: flipped(main_branch(result)) for name, result in zip(names, results, strict=True)}
    evidence = "; ".join(f"set {name}: {words(each)}" for name, each in found.items())
    return holds(not any(found.values()), f"doubled periods with Tm1 = 0.5 — {evidence}")


def _light(*results: Result) -> Outcome:
    names = ("12", "14", "13", "15")
    counts = [sum(each.kind is not Kind.GRAZING for each in main_branch(result).special_points) for result in results]
    evidence = (
        "special points of period 1: "
        f"{', '.join(f'{count} in figure {name}' for name, count in zip(names, counts, strict=True))}"
    )
    return holds(counts[-1] == max(counts) and counts[0] == min(counts), evidence)


HIGH, MODERATE = ("29-0.65", "29-0.8", "29-0.95", "29-0.2"), ("29-0.16", "29-0.27", "29-0.36")

CLAIMS = (
    Claim("27-islands", "At Ω = 0.25 two isolated branches lie over the amplitude.", ("27",), _two_islands),
    Claim(
        "27-beats",
        "The larger one has two small ranges of motions that beat.",
        ("27",),
        _large_beats,
        BOTH,
        short=True,
    ),
    Claim("27-flip", "On the smaller one periods double.", ("27",), _small_flips),
    Claim("27-nothing", "For 0.3 ≤ Te1 ≤ 0.45 there is no periodic motion, stable or not.", ("27",), _nothing_between),
    Claim("28-grow", "At Ω = 0.255 both loops are larger.", ("27", "28"), _grow),
    Claim("28-overlap", "There they overlap.", ("28", "28-overlap"), _overlap, BOTH, short=True),
    Claim("28-throughout", "There periodic motions exist throughout the range.", ("28",), _throughout),
    Claim("29-small", "At Ω = 0.35 period 1 is stable for small amplitudes.", ("29",), _small_amplitude),
    Claim("29-cascade", "At moderate amplitudes periods double to 2, 4 and more.", ("29",), _cascade),
    Claim("29-beats", "Motions that beat appear.", ("29",), _beats),
    Claim("29-high", "At high amplitudes only quasi-periodic motion is stable.", HIGH, _high_amplitude, (AS_PRINTED,)),
    Claim("29-chaos", "Moderate amplitudes lead to chaos.", MODERATE, _chaos),
    Claim(
        "summary-heavy",
        "Under a heavy mean load on the clutch no period doubles.",
        ("12", "20a", "4a", "10b"),
        _heavy,
        BOTH,
        short=True,
    ),
    Claim(
        "summary-light",
        "Light loads and a large excitation give the richest behaviour.",
        ("12", "9a", "13", "15"),
        _light,
    ),
)

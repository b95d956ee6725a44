"""What the paper says of lighter loads under one harmonic (its section 5, figures 13 to 19)."""

from __future__ import annotations

from gapwalk.attractor.attractor import AttractorKind
from gapwalk.bifurcation.branch import Kind
from gapwalk.paper.claims.claim import BOTH, Claim, Outcome, holds
from gapwalk.paper.claims.look import Range, beating, extent, flipped, limbs, main_branch, peaks, values, words
from gapwalk.study.result import Result
from gapwalk.study.settle.finding import SettleFinding

_SECOND = (1.1, 1.4)  # about the second resonance
_JUMP = (0.55, 0.9)  # beside the jump of the first


def _within(found: list[Range], low: float, high: float) -> list[Range]:
    return [each for each in found if each.meets(low, high)]


def _flips(result: Result) -> Outcome:
    branch = main_branch(result)
    second, jump = _within(flipped(branch), *_SECOND), _within(flipped(branch), *_JUMP)
    evidence = (
        f"at {words(second)} about the second resonance and at {words(jump)} beside the jump (the paper: 0.62–0.85)"
    )
    return holds(bool(second and jump), evidence)


def _loop_about_second(result: Result) -> list[Range]:
    loops = [limb.branch for limb in limbs(result, 2) if extent(limb.branch).meets(*_SECOND)]
    return [each for loop in loops for each in beating(loop)]


def _loop_beats(result: Result) -> Outcome:
    found = _loop_about_second(result)
    return holds(bool(found), f"on the loop of period 2 about the second resonance, at {words(found)}")


def _natures(result: Result) -> Outcome:
    flips = [each for each in main_branch(result).special(Kind.FLIP) if each.nature]
    found = [f"{each.nature} at {each.value:.4f}" for each in flips]
    return holds(len({each.nature for each in flips}) == 2, words(found))


def _no_cascade(*results: Result) -> Outcome:
    found = [[str(extent(limb.branch)) for limb in limbs(result, 4)] for result in results]
    evidence = f"period 4 in figure 13: {words(found[0])}; in figure 14: {words(found[1])}"
    return holds(not any(found), evidence)


def _jump_region_gone(before: Result, after: Result) -> Outcome:
    first, then = (_within(flipped(main_branch(each)), *_JUMP) for each in (before, after))
    return holds(bool(first) and not then, f"{words(first)} in figure 13, {words(then)} in figure 14")


def _second_shrinks(before: Result, after: Result) -> Outcome:
    first, then = (_within(flipped(main_branch(each)), *_SECOND) for each in (before, after))
    smaller = bool(first and then) and sum(each.width for each in then) < sum(each.width for each in first)
    return holds(smaller, f"{words(first)} in figure 13, {words(then)} in figure 14")


def _loop_rests(result: Result) -> Outcome:
    found = _loop_about_second(result)
    return holds(not found, f"unstable by a complex pair on the loop of period 2: {words(found)}")


def _rich(light: Result, before: Result) -> Outcome:
    branch, other = main_branch(light), main_branch(before)
    below = 0.6
    superharmonics = peaks(branch, high=below)
    flips, pairs = _within(flipped(branch), 0.15, below), _within(beating(branch), 0.15, below)
    evidence = (
        f"below {below}: {len(superharmonics)} peaks (figure 13: {len(peaks(other, high=below))}), doubled periods at "
        f"{words(flips)}, a complex pair at {words(pairs)}"
    )
    return holds(len(superharmonics) > len(peaks(other, high=below)) and len(flips) > 2 and bool(pairs), evidence)


def _cascade(result: Result) -> Outcome:
    doubled = limbs(result, 4)
    stable = [limb for limb in doubled if any(point.stable for point in limb.branch.points)]
    further = sum(len(values(limb.branch, Kind.FLIP)) for limb in doubled)
    evidence = (
        f"{len(doubled)} branches of period 4, {len(stable)} of them stable in part, such as those at "
        f"{words([extent(limb.branch) for limb in stable[:3]])}; {further} flips on them"
    )
    return holds(bool(stable) and further > 0, evidence)


def _finding(result: Result) -> SettleFinding:
    assert isinstance(result.finding, SettleFinding)
    return result.finding


_WANTED = (AttractorKind.PERIODIC, AttractorKind.QUASI_PERIODIC, AttractorKind.CHAOTIC)


def _printed_sequence(*results: Result) -> Outcome:
    found = [_finding(result).attractor for result in results]
    evidence = f"from rest {words([each.label for each in found])}; 17-elsewhere says where it is"
    return holds(found[0].period == 3 and tuple(each.kind for each in found) == _WANTED, evidence)


def _sequence(*results: Result) -> Outcome:
    found = [_finding(result).attractor for result in results]
    evidence = ", ".join(f"{each.label} at Ω = {each.system.frequency:g}" for each in found)
    return holds(found[0].period == 3 and tuple(each.kind for each in found) == _WANTED, evidence)


CLAIMS = (
    Claim(
        "13-flips",
        "With half the mean load, periods double about the second resonance and beside the jump.",
        ("13",),
        _flips,
        BOTH,
    ),
    Claim("13-loop", "The loop of period 2 about the second resonance has motions that beat.", ("13",), _loop_beats),
    Claim("13-natures", "Periods double both super- and subcritically.", ("13",), _natures),
    Claim(
        "13-once",
        "Doubled periods do not double again, neither here nor in figure 14.",
        ("13", "9a"),
        _no_cascade,
        BOTH,
    ),
    Claim(
        "14-jump",
        "More mean load on the shaft: the doubled periods beside the jump give way to period 1.",
        ("13", "9a"),
        _jump_region_gone,
        BOTH,
    ),
    Claim(
        "14-second", "The range of doubled periods about the second resonance shrinks.", ("13", "9a"), _second_shrinks
    ),
    Claim("14-loop", "The loop of period 2 about the second resonance has no motions that beat.", ("9a",), _loop_rests),
    Claim(
        "15-rich",
        "Twice the excitation: many superharmonics at low frequencies, with doubled periods and beats.",
        ("15", "13"),
        _rich,
    ),
    Claim("16-cascade", "Period 2 doubles to stable period 4, and that doubles again.", ("15",), _cascade),
    Claim(
        "17-sequence",
        "Period 3, quasi-periodic and chaotic motion at 0.63, 0.634 and 0.636 (figures 17 to 19).",
        ("17", "18", "19"),
        _printed_sequence,
        BOTH,
    ),
    Claim(
        "17-elsewhere",
        "Period 3 gives way to quasi-periodic and that to chaotic motion within a small change of frequency.",
        ("17-near", "18-near", "19-near"),
        _sequence,
    ),
)

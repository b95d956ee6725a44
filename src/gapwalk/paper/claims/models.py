"""What the paper says of viscous and impact damping (its section 4, figures 3 to 8)."""

from __future__ import annotations

import numpy as np

from gapwalk.attractor.attractor import Attractor
from gapwalk.continuation.branch import Kind
from gapwalk.paper.claims.claim import Claim, Outcome, holds
from gapwalk.paper.claims.look import MEASURE, Range, beating, flipped, highest, limbs, main_branch, values, words
from gapwalk.paper.reading import AS_PRINTED
from gapwalk.study.result import Result
from gapwalk.study.settle.finding import SettleFinding

_SAMPLES = 512
_ONCE = "1+/0-"  # the pattern of one impact on the positive side in a whole period
_BEYOND = 0.75  # from here on: beyond the first resonance


def _attractor(result: Result) -> Attractor:
    assert isinstance(result.finding, SettleFinding)
    return result.finding.attractor


def _over_a_period(result: Result, signal: str) -> np.ndarray:
    """A signal of a periodic motion, evenly sampled over two forcing periods."""
    attractor = _attractor(result)
    assert attractor.orbit is not None
    values_ = attractor.orbit.motion(_SAMPLES).signal(signal)[:-1]
    return np.tile(values_, 2 // attractor.period or 1)


def _difference(first: np.ndarray, second: np.ndarray) -> float:
    """The rms of the difference of two signals, as a share of the rms of the first about its mean."""
    return float(np.sqrt(np.mean((first - second) ** 2)) / np.std(first))


def _accelerations(impact: Result, viscous: Result) -> Outcome:
    apart = _difference(*(_over_a_period(each, "q1''") for each in (impact, viscous)))
    return holds(apart < 0.1, f"rms of the difference: {apart:.1%} of that of the acceleration of q1")


def _each_second_period(impact: Result, viscous: Result, *responses: Result) -> Outcome:
    found = [_attractor(each) for each in (impact, viscous)]
    told = words([f"{each.label} with contacts {each.orbit.pattern if each.orbit else '?'}" for each in found])
    near = [_once_in_two(result) for result in responses]
    evidence = (
        f"impact and viscous model: {told}; stable with one impact in two periods: impact {words(near[0])}; viscous "
        f"{words(near[1])}"
    )
    return holds(all(each.orbit is not None and each.orbit.pattern == _ONCE for each in found), evidence)


def _once_in_two(result: Result) -> list[Range]:
    """Where stable motions of period 2 have one impact, on the positive side."""
    stretches = []
    for limb in limbs(result, 2):
        inside = [point.value for point in limb.branch.points if point.stable and point.orbit.pattern == _ONCE]
        stretches += [Range(min(inside), max(inside))] if inside else []
    return sorted(stretches)


def _forces(impact: Result, viscous: Result) -> Outcome:
    apart = _difference(*(_over_a_period(each, "stage2") for each in (impact, viscous)))
    return holds(1e-6 < apart < 0.2, f"rms of the difference: {apart:.1%} of that of the contact force about its mean")


def _same_folds(impact: Result, viscous: Result) -> Outcome:
    one, two = (values(main_branch(each), Kind.FOLD) for each in (impact, viscous))
    evidence = f"impact {words(one)}; viscous {words(two)}"
    return holds(len(one) == len(two) and max(abs(a - b) for a, b in zip(one, two, strict=False)) < 0.05, evidence)


def _smaller_flips(impact: Result, viscous: Result) -> Outcome:
    one, two = (flipped(main_branch(each)) for each in (impact, viscous))
    near = [[each for each in found if each.meets(0.5, 0.9)] for found in (one, two)]
    widths = [sum(each.width for each in found) for found in near]
    evidence = f"impact {words(one)}; viscous {words(two)}; beside the jump {widths[0]:.3f} and {widths[1]:.3f} wide"
    return holds(0.0 < widths[1] < widths[0], evidence)


def _both_beat(impact: Result, viscous: Result) -> Outcome:
    one, two = (beating(main_branch(each)) for each in (impact, viscous))
    loops = [each for limb in limbs(viscous, 2) for each in beating(limb.branch)]
    return holds(
        bool(one and two), f"impact {words(one)}; viscous {words(two)}, but on its loops of period 2 {words(loops)}"
    )


def _higher_peak(impact: Result, viscous: Result) -> Outcome:
    one, two = (highest(main_branch(each)) for each in (impact, viscous))
    return holds(two.height > one.height, f"impact {one}; viscous {two}")


def _same_beyond(impact: Result, viscous: Result) -> Outcome:
    grid = np.linspace(_BEYOND, 1.95, 200)
    curves = [_height_at(main_branch(each), grid) for each in (impact, viscous)]
    apart = np.abs(curves[1] - curves[0])
    worst = int(np.argmax(apart))
    flips = [each for each in flipped(main_branch(viscous)) if each.low > _BEYOND]
    evidence = (
        f"the amplitudes differ by at most {apart[worst]:.2g} (of {curves[0][worst]:.2g}) at "
        f"{grid[worst]:.3g}; only the viscous "
        f"model has doubled periods there, at {words(flips)}"
    )
    return holds(float(apart.max()) < 0.1 * float(curves[0].max()) and not flips, evidence)


def _height_at(branch, grid: np.ndarray) -> np.ndarray:
    """The amplitude at values of the frequency where the branch has no folds."""
    order = np.argsort(branch.values)
    return np.interp(grid, branch.values[order], branch.measure(MEASURE)[order])


def _patterns(result: Result) -> dict[str, Range]:
    """The contact patterns of the motions of period 1, and the ranges of the parameter in which each occurs."""
    found: dict[str, list[float]] = {}
    for point in main_branch(result).points:
        found.setdefault(f"{point.orbit.pattern}{'' if point.stable else ' unstable'}", []).append(point.value)
    return {pattern: Range(min(inside), max(inside)) for pattern, inside in found.items()}


def _told(printed: Result, over_mean: Result) -> str:
    attractor = _attractor(printed)
    pattern = attractor.orbit.pattern if attractor.orbit else "?"
    ranges = ", ".join(f"{name} at {each}" for name, each in _patterns(over_mean).items())
    return f"at the printed loads {attractor.label} with contacts {pattern}; period 1 over Tm1: {ranges}"


def _double_sided(printed: Result, over_mean: Result) -> Outcome:
    orbit = _attractor(printed).orbit
    return holds(orbit is not None and orbit.pattern in ("4+/1-", "1+/4-"), _told(printed, over_mean))


def _single_sided(printed: Result, over_mean: Result) -> Outcome:
    orbit = _attractor(printed).orbit
    single = orbit is not None and orbit.pattern.endswith("+/0-") and orbit.pattern != "0+/0-"
    return holds(single, _told(printed, over_mean))


def _both_sided(printed: Result, over_mean: Result) -> Outcome:
    orbit = _attractor(printed).orbit
    both = orbit is not None and "/" in orbit.pattern and "0" not in (orbit.pattern[0], orbit.pattern[-2])
    return holds(both, f"the measured record is not printed as numbers; {_told(printed, over_mean)}")


def _accelerations_differ(impact: Result, viscous: Result) -> Outcome:
    apart = _difference(*(_over_a_period(each, "q1''") for each in (impact, viscous)))
    patterns = words([orbit.pattern for each in (impact, viscous) if (orbit := _attractor(each).orbit) is not None])
    evidence = (
        f"at the printed loads the stage never opens (contacts {patterns}); rms of the difference "
        f"{apart:.1%}. The higher "
        "damping of this figure is not printed"
    )
    return holds(apart > 0.5, evidence)


CLAIMS = (
    Claim(
        "3-acceleration",
        "At Ω = 1.5 the accelerations of both damping models agree.",
        ("3-impact", "3-viscous"),
        _accelerations,
    ),
    Claim("3-force", "Their contact forces differ slightly.", ("3-impact", "3-viscous"), _forces),
    Claim(
        "3-impacts",
        "One impact happens every two forcing periods.",
        ("3-impact", "3-viscous", "4a", "4b"),
        _each_second_period,
    ),
    Claim("4-folds", "Both damping models jump at about the same frequencies.", ("4a", "4b"), _same_folds),
    Claim("4-flips", "The range of doubled periods is smaller for viscous damping.", ("4a", "4b"), _smaller_flips),
    Claim("4-beats", "Motions of period 1 that beat exist with both.", ("4a", "4b"), _both_beat, (AS_PRINTED,)),
    Claim("4-peak", "The peak is higher with viscous damping.", ("4a", "4b"), _higher_peak),
    Claim("4-beyond", "Beyond the first resonance both give almost the same.", ("4a", "4b"), _same_beyond),
    Claim(
        "5-double",
        "At Ω = 0.17 the impact model hits four times on one side, then once on the other.",
        ("5", "5-mean"),
        _double_sided,
    ),
    Claim("6-single", "There the viscous model hits on one side only.", ("6", "6-mean"), _single_sided),
    Claim("7-differ", "There the accelerations of both models differ.", ("5", "6"), _accelerations_differ),
    Claim(
        "8-double",
        "At a light mean load impacts are double-sided, as in measured rattle.",
        ("5", "5-mean"),
        _both_sided,
    ),
)

"""What the paper says of viscous and impact damping (its section 4, figures 1, 3 and 4)."""

from __future__ import annotations

import numpy as np

from gapwalk.bifurcation.branch import Kind
from gapwalk.motion.hysteresis import Hysteresis
from gapwalk.paper.claims.claim import Claim, Outcome, holds
from gapwalk.paper.claims.look import MEASURE, Range, beating, flipped, highest, limbs, main_branch, values, words
from gapwalk.paper.claims.motions import attractor_of, difference, over_two_periods
from gapwalk.paper.loops import IMPACT, LOOPS, VISCOUS
from gapwalk.paper.reading import AS_PRINTED
from gapwalk.study.result import Result

_ONCE = "1+/0-"  # the pattern of one impact on the positive side in a whole period
_BEYOND = 0.75  # from here on: beyond the first resonance


def _pulls() -> Outcome:
    loop = LOOPS[VISCOUS]
    least = float(loop.force.min())
    return holds(least < 0.0, f"where the bodies part it pulls with {-least:.3g}; {_size(loop)}")


def _never_pulls() -> Outcome:
    loop = LOOPS[IMPACT]
    least = float(loop.force.min())
    return holds(least >= 0.0, f"least force {least:.3g}; {_size(loop)}")


def _size(loop: Hysteresis) -> str:
    return f"the greatest force is {loop.force.max():.3g}, the loss {loop.loss:.3g} a cycle with both laws"


def _accelerations(impact: Result, viscous: Result) -> Outcome:
    apart = difference(*(over_two_periods(each, "q1''") for each in (impact, viscous)))
    return holds(apart < 0.1, f"rms of the difference: {apart:.1%} of that of the acceleration of q1")


def _each_second_period(impact: Result, viscous: Result, *responses: Result) -> Outcome:
    found = [attractor_of(each) for each in (impact, viscous)]
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
    apart = difference(*(over_two_periods(each, "stage2") for each in (impact, viscous)))
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


CLAIMS = (
    Claim("1-viscous", "Viscous damping leaves a force that pulls when the bodies part.", (), _pulls),
    Claim("1-impact", "Impact damping does not.", (), _never_pulls),
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
    Claim(
        "4-beats",
        "Motions of period 1 that beat exist with both.",
        ("4a", "4b"),
        _both_beat,
        (AS_PRINTED,),
        short=True,
    ),
    Claim("4-peak", "The peak is higher with viscous damping.", ("4a", "4b"), _higher_peak),
    Claim("4-beyond", "Beyond the first resonance both give almost the same.", ("4a", "4b"), _same_beyond),
)

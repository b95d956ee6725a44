"""What the paper says of viscous and impact damping (its section 4, figures 3 to 8)."""

from __future__ import annotations

import numpy as np

from gapwalk.attractor.attractor import Attractor
from gapwalk.continuation.branch import Kind
from gapwalk.paper.claims.claim import Claim, Outcome, Verdict, holds
from gapwalk.paper.claims.look import MEASURE, beating, flipped, highest, limbs, main_branch, values, words
from gapwalk.study.result import Result
from gapwalk.study.settle.finding import SettleFinding

_SAMPLES = 512
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


def _impact_each_second(impact: Result, viscous: Result, pattern: Result) -> Outcome:
    found = [_attractor(each) for each in (impact, viscous, pattern)]
    told = [f"{each.label} with contacts {each.orbit.pattern if each.orbit else '?'}" for each in found]
    wanted = [each.orbit is not None and each.period == 2 and each.orbit.pattern == "1+/0-" for each in found]
    evidence = f"impact model: {told[0]}; viscous: {told[1]}; at Ω = 1.3: {told[2]}"
    return holds(wanted[0] and wanted[1], evidence)


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
    return holds(bool(one and two), f"impact {words(one)}; viscous {words(two)}, but on its loops of period 2 {words(loops)}")


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
        f"the amplitudes differ by at most {apart[worst]:.2g} (of {curves[0][worst]:.2g}) at {grid[worst]:.3g}; only the viscous "
        f"model has doubled periods there, at {words(flips)}"
    )
    return holds(float(apart.max()) < 0.1 * float(curves[0].max()) and not flips, evidence)


def _height_at(branch, grid: np.ndarray) -> np.ndarray:
    """The amplitude at values of the frequency where the branch has no folds."""
    order = np.argsort(branch.values)
    return np.interp(grid, branch.values[order], branch.measure(MEASURE)[order])


def _double_sided(printed: Result, near: Result) -> Outcome:
    found, other = _attractor(printed), _attractor(near)
    told = [f"{each.label} with contacts {each.orbit.pattern if each.orbit else '?'}" for each in (found, other)]
    holds_here = found.orbit is not None and found.orbit.pattern in ("4+/1-", "1+/4-")
    evidence = f"at the printed loads {told[0]}; with {_loads(other)}: {told[1]}"
    return holds(holds_here, evidence)


def _single_sided(printed: Result, near: Result) -> Outcome:
    found, other = _attractor(printed), _attractor(near)
    told = [f"{each.label} with contacts {each.orbit.pattern if each.orbit else '?'}" for each in (found, other)]
    single = found.orbit is not None and found.orbit.pattern.endswith("/0-") and not found.orbit.pattern.startswith("0")
    return holds(single, f"at the printed loads {told[0]}; with {_loads(other)}: {told[1]}")


def _loads(attractor: Attractor) -> str:
    system = attractor.system
    return f"Tm1 = {system['mean.q1']:g}, Tm2 = {system['mean.q3']:g}"


def _lines(result: Result) -> list[float]:
    """Amplitudes of the harmonics of the contact force from the first on, relative to the largest."""
    attractor = _attractor(result)
    assert attractor.orbit is not None
    heights = np.abs(np.fft.rfft(attractor.orbit.motion(_SAMPLES).signal("stage2")[:-1]))[1:]
    return list(heights / heights.max())


CLAIMS = (
    Claim("3-acceleration", "At Ω = 1.5 the accelerations of both damping models agree.", ("3-impact", "3-viscous"), _accelerations),
    Claim("3-force", "Their contact forces differ slightly.", ("3-impact", "3-viscous"), _forces),
    Claim("4-folds", "Both damping models jump at about the same frequencies.", ("4a", "4b"), _same_folds),
    Claim("4-flips", "The range of doubled periods is smaller for viscous damping.", ("4a", "4b"), _smaller_flips),
    Claim("4-beats", "Motions of period 1 that beat exist with both.", ("4a", "4b"), _both_beat),
    Claim("4-peak", "The peak is higher with viscous damping.", ("4a", "4b"), _higher_peak),
    Claim("4-beyond", "Beyond the first resonance both give almost the same.", ("4a", "4b"), _same_beyond),
)  # fmt: skip

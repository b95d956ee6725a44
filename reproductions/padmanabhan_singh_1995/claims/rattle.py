"""What the paper says of rattle with both damping models (its section 4, figures 5 to 8)."""

from __future__ import annotations

import math

import numpy as np

from gapwalk.model.system import System
from gapwalk.orbit.orbit import Orbit
from gapwalk.study.result import Result
from reproductions.padmanabhan_singh_1995.claims.claim import Claim, Outcome, Verdict, holds
from reproductions.padmanabhan_singh_1995.claims.look import Range, main_branch, words
from reproductions.padmanabhan_singh_1995.claims.motions import (
    attractor_of,
    difference,
    force_peaks,
    lines,
    over_two_periods,
)
from reproductions.padmanabhan_singh_1995.motion import orbit_of
from reproductions.padmanabhan_singh_1995.record import NOISE, beside_record

_FOUR_ONE = (4, 1)
_PRINTED = {"Tm1": "mean.q1", "Tm2": "mean.q3", "Te1": "harmonic1.amplitude", "Ω": "frequency"}
_BETA = {"β": "stage2.impact_damping"}
_NOTABLE = 0.01  # of the highest line: what a picture of a spectrum shows
_HIGH = 5  # from this harmonic on: the higher ones
_ALIKE = 0.2  # rms difference of two histories that look alike


def distance(system: System, printed: System) -> float:
    """How far a system is from the printed numbers: the root of the sum of squares of the logarithms of their ratios.

    So 0.1 is a change of one number by about a tenth. What is zero in both does not count.
    """
    names = [name for name in (*_PRINTED.values(), *_BETA.values()) if printed[name] != 0.0]
    return math.sqrt(sum(math.log(system[name] / printed[name]) ** 2 for name in names))


def _double_sided(printed: Result, over_mean: Result, over_amplitude: Result) -> Outcome:
    orbit = attractor_of(printed).orbit
    evidence = _at_the_printed(printed, over_mean, over_amplitude)
    return holds(orbit is not None and force_peaks(orbit) in (_FOUR_ONE, _FOUR_ONE[::-1]), evidence)


def _single_sided(printed: Result, over_mean: Result, over_amplitude: Result) -> Outcome:
    orbit = attractor_of(printed).orbit
    return holds(orbit is not None and _hits_one_side(orbit), _at_the_printed(printed, over_mean, over_amplitude))


def _hits_one_side(orbit: Orbit) -> bool:
    return orbit.pattern.endswith("+/0-")


def _at_the_printed(printed: Result, over_mean: Result, over_amplitude: Result) -> str:
    attractor = attractor_of(printed)
    told = _told(attractor.orbit) if attractor.orbit else "no period"
    return (
        f"at the printed loads {attractor.label}, {told}; stable motions of period 1, over Tm1 alone: "
        f"{_patterns(over_mean)}; over Te1 alone: {_patterns(over_amplitude)}"
    )


def _told(orbit: Orbit) -> str:
    up, down = force_peaks(orbit)
    return f"contacts {orbit.pattern}, force peaks {up}+/{down}-"


def _patterns(result: Result) -> str:
    """The contacts of the stable motions of period 1, and the ranges of the parameter in which they occur."""
    found: dict[str, list[float]] = {}
    for point in main_branch(result).points:
        if point.stable:
            found.setdefault(_told(point.orbit), []).append(point.value)
    return ", ".join(f"{told} at {Range(min(inside), max(inside))}" for told, inside in found.items())


def _four_and_one(near: Result, viscous: Result, printed: Result) -> Outcome:
    one, two = orbit_of(near), orbit_of(viscous)
    evidence = (
        f"at {_place(one.system)}: impact model {_told(one)}, viscous model {_told(two)}; distance from the printed "
        f"numbers {distance(one.system, printed.system):.2f}, the root of the sum of squares of the logarithms of "
        "their ratios"
    )
    return holds(force_peaks(one) == _FOUR_ONE and one.stable, evidence)


def _place(system: System) -> str:
    return ", ".join(f"{word} = {system[name]:.4g}" for word, name in (_PRINTED | _BETA).items())


def _one_sided_there(viscous: Result, impact: Result, from_rest: Result) -> Outcome:
    one, two, other = orbit_of(viscous), orbit_of(impact), orbit_of(from_rest)
    evidence = (
        f"at the place of 5-elsewhere, from the motion of the impact model ({_told(two)}): {_told(one)}; from rest: "
        f"{_told(other)}"
    )
    return holds(_hits_one_side(one) and one.stable and not _hits_one_side(two), evidence)


def _many_lines(near: Result) -> Outcome:
    heights = lines(orbit_of(near), "stage2")
    notable = int(np.count_nonzero(heights > _NOTABLE * heights.max()))
    return holds(notable >= 10, f"{notable} lines of the force above {_NOTABLE:.0%} of the highest")


def _weaker_lines(viscous: Result, impact: Result) -> Outcome:
    high = [float(np.linalg.norm(lines(orbit_of(each), "stage2")[_HIGH - 1 :])) for each in (viscous, impact)]
    evidence = (
        f"rms of the force from harmonic {_HIGH} on: viscous model {high[0] / high[1]:.2f} of that of the impact one"
    )
    return holds(high[0] < 0.5 * high[1], evidence)


def _accelerations_differ(impact: Result, viscous: Result) -> Outcome:
    apart = difference(*(over_two_periods(each, "q1''") for each in (impact, viscous)))
    patterns = words([_told(orbit) for each in (impact, viscous) if (orbit := attractor_of(each).orbit) is not None])
    evidence = (
        f"at the printed loads the stage never opens ({patterns}); rms of the difference {apart:.1%}. The higher "
        "damping of this figure is not printed"
    )
    return holds(apart > 0.5, evidence)


def _differ_there(impact: Result, viscous: Result) -> Outcome:
    force, acceleration = (
        difference(*(over_two_periods(each, signal) for each in (viscous, impact))) for signal in ("stage2", "q1''")
    )
    damping = f"C11 = C21 = {viscous.system['damping.q1.q1']:.3g}, β = {impact.system['stage2.impact_damping']:.3g}"
    evidence = (
        f"at the place of 5-elsewhere, {damping}: forces differ by {force:.1%}, accelerations by {acceleration:.1%}"
    )
    return holds(force < _ALIKE and acceleration > 1.5 * force, evidence)


def _both_sided(printed: Result, very_low: Result) -> Outcome:
    orbit, low = attractor_of(printed).orbit, orbit_of(very_low)
    evidence = (
        f"with the printed numbers {_told(orbit) if orbit else 'no period'}; at {_place(low.system)}: {_told(low)}"
    )
    return holds(orbit is not None and _hits_both_sides(orbit), evidence)


def _both_sided_there(very_low: Result) -> Outcome:
    orbit = orbit_of(very_low)
    return holds(_hits_both_sides(orbit) and orbit.stable, f"at {_place(orbit.system)}: {_told(orbit)}")


def _hits_both_sides(orbit: Orbit) -> bool:
    return min(force_peaks(orbit)) > 0


def _like_the_record(impact: Result, viscous: Result, recorded: Result) -> Outcome:
    found = [beside_record(each, recorded).agreement.relative for each in (impact, viscous)]
    evidence = (
        "the measured record is not printed as numbers, so nothing can be compared with it. Beside a SYNTHETIC one, "
        f"computed with impact damping, a little other numbers and {NOISE:.0%} of noise, the rms error of u3'' is "
        f"{found[0]:.1%} with impact and {found[1]:.1%} with viscous damping"
    )
    return Outcome(Verdict.NOT_REPRODUCED, evidence)


CLAIMS = (
    Claim(
        "5-double",
        "At Ω = 0.17 the impact model hits four times on one side, then once on the other.",
        ("5", "5-mean", "5-amplitude"),
        _double_sided,
    ),
    Claim(
        "5-elsewhere",
        "Under other loads it does: the force has four peaks on one side, then one on the other.",
        ("5-near", "6-near", "5"),
        _four_and_one,
    ),
    Claim("5-harmonics", "At least ten to twelve harmonics make up its force.", ("5-near",), _many_lines),
    Claim(
        "6-single",
        "At Ω = 0.17 the viscous model hits on one side only.",
        ("6", "6-mean", "6-amplitude"),
        _single_sided,
    ),
    Claim(
        "6-elsewhere",
        "It does at the place where the impact model hits on both.",
        ("6-near", "5-near", "6-near-rest"),
        _one_sided_there,
    ),
    Claim("6-weaker", "Its higher harmonics are much smaller.", ("6-near", "5-near"), _weaker_lines),
    Claim("7-differ", "With more damping the accelerations of both models differ.", ("5", "6"), _accelerations_differ),
    Claim(
        "7-elsewhere",
        "They do so though the damping is chosen for the forces to be alike.",
        ("7-impact-near", "7-viscous-near"),
        _differ_there,
    ),
    Claim(
        "8-double",
        "At a light mean load impacts are double-sided, as in measured rattle.",
        ("5", "8-impact"),
        _both_sided,
    ),
    Claim("8-elsewhere", "At a very low mean load they are.", ("8-impact",), _both_sided_there),
    Claim(
        "8-record",
        "The computed u3'' resembles the measured one, that of the viscous model does not.",
        ("8-impact", "8-viscous", "8-record"),
        _like_the_record,
    ),
)

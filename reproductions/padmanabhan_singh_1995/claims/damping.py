"""What the paper says of viscous and impact damping (its section 4, figures 1 and 3 to 8)."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

import gapwalk as gw
from reproductions.padmanabhan_singh_1995.claims.claim import Finding, claim
from reproductions.padmanabhan_singh_1995.jobs import AS_PRINTED, MEASURE
from reproductions.padmanabhan_singh_1995.quantities import (
    IMPACT,
    LOOPS,
    NOISE,
    VISCOUS,
    Range,
    aligned_with_record,
    attractor_of,
    difference,
    flipped,
    force_peaks,
    highest,
    lines,
    main_branch,
    members,
    orbit_of,
    over_two_periods,
    values,
    with_pair,
    words,
)

_ONCE = "1+/0-"  # the pattern of one impact on the positive side in a whole period
_BEYOND = 0.75  # from here on: beyond the first resonance


@claim("1-viscous", "Viscous damping leaves a force that pulls when the bodies part.")
def _pulls() -> Finding:
    loop = LOOPS[VISCOUS]
    least = float(loop.force.min())
    return Finding(least < 0.0, f"where the bodies part it pulls with {-least:.3g}; {_size(loop)}")


@claim("1-impact", "Impact damping does not.")
def _never_pulls() -> Finding:
    loop = LOOPS[IMPACT]
    least = float(loop.force.min())
    return Finding(least >= 0.0, f"least force {least:.3g}; {_size(loop)}")


def _size(loop: Any) -> str:
    return f"the greatest force is {loop.force.max():.3g}, the loss {loop.loss:.3g} per cycle with both laws"


@claim("3-acceleration", "At Ω = 1.5 the accelerations of both damping models agree.", "3-impact", "3-viscous")
def _accelerations(impact: gw.Result, viscous: gw.Result) -> Finding:
    apart = difference(*(over_two_periods(each, "q1''") for each in (impact, viscous)))
    return Finding(apart < 0.1, f"rms of the difference: {apart:.1%} of that of the acceleration of q1")


@claim("3-force", "Their contact forces differ slightly.", "3-impact", "3-viscous")
def _forces(impact: gw.Result, viscous: gw.Result) -> Finding:
    apart = difference(*(over_two_periods(each, "stage2") for each in (impact, viscous)))
    return Finding(
        1e-6 < apart < 0.2, f"rms of the difference: {apart:.1%} of that of the contact force about its mean"
    )


def _once_in_two(result: gw.Result) -> list[Range]:
    """Where stable motions of period 2 have one impact, on the positive side."""
    found = []
    for member in members(result, 2):
        inside = [point.value for point in member.branch.points if point.stable and point.orbit.pattern == _ONCE]
        found += [Range(min(inside), max(inside))] if inside else []
    return sorted(found)


@claim("3-impacts", "One impact happens every two forcing periods.", "3-impact", "3-viscous", "4a", "4b")
def _each_second_period(impact: gw.Result, viscous: gw.Result, *responses: gw.Result) -> Finding:
    found = [attractor_of(each) for each in (impact, viscous)]
    labels = words([f"{each.label} with contacts {each.orbit.pattern if each.orbit else '?'}" for each in found])
    near = [_once_in_two(result) for result in responses]
    evidence = (
        f"impact and viscous model: {labels}; stable with one impact in two periods: impact {words(near[0])}; viscous "
        f"{words(near[1])}"
    )
    return Finding(all(each.orbit is not None and each.orbit.pattern == _ONCE for each in found), evidence)


@claim("4-folds", "Both damping models jump at about the same frequencies.", "4a", "4b")
def _same_folds(impact: gw.Result, viscous: gw.Result) -> Finding:
    one, two = (values(main_branch(each), gw.Kind.FOLD) for each in (impact, viscous))
    evidence = f"impact {words(one)}; viscous {words(two)}"
    return Finding(len(one) == len(two) and max(abs(a - b) for a, b in zip(one, two, strict=False)) < 0.05, evidence)


@claim("4-flips", "The range of doubled periods is smaller for viscous damping.", "4a", "4b")
def _smaller_flips(impact: gw.Result, viscous: gw.Result) -> Finding:
    one, two = (flipped(main_branch(each)) for each in (impact, viscous))
    near = [[each for each in found if each.meets(0.5, 0.9)] for found in (one, two)]
    widths = [sum(each.width for each in found) for found in near]
    evidence = f"impact {words(one)}; viscous {words(two)}; beside the jump {widths[0]:.3f} and {widths[1]:.3f} wide"
    return Finding(0.0 < widths[1] < widths[0], evidence)


@claim("4-beats", "Motions of period 1 become quasi-periodic with both.", "4a", "4b", others=(AS_PRINTED,), short=True)
def _both_with_pair(impact: gw.Result, viscous: gw.Result) -> Finding:
    one, two = (with_pair(main_branch(each)) for each in (impact, viscous))
    loops = [each for member in members(viscous, 2) for each in with_pair(member.branch)]
    evidence = f"impact {words(one)}; viscous {words(two)}, but on its loops of period 2 {words(loops)}"
    return Finding(bool(one and two), evidence)


@claim("4-peak", "The peak is higher with viscous damping.", "4a", "4b")
def _higher_peak(impact: gw.Result, viscous: gw.Result) -> Finding:
    one, two = (highest(main_branch(each)) for each in (impact, viscous))
    return Finding(two.height > one.height, f"impact {one}; viscous {two}")


@claim("4-beyond", "Beyond the first resonance both give almost the same.", "4a", "4b")
def _same_beyond(impact: gw.Result, viscous: gw.Result) -> Finding:
    grid = np.linspace(_BEYOND, 1.95, 200)
    curves = [_height_at(main_branch(each), grid) for each in (impact, viscous)]
    apart = np.abs(curves[1] - curves[0])
    worst = int(np.argmax(apart))
    flips = [each for each in flipped(main_branch(viscous)) if each.low > _BEYOND]
    evidence = (
        f"the amplitudes differ by at most {apart[worst]:.2g} (of {curves[0][worst]:.2g}) at "
        f"{grid[worst]:.3g}; only the viscous model has doubled periods there, at {words(flips)}"
    )
    return Finding(float(apart.max()) < 0.1 * float(curves[0].max()) and not flips, evidence)


def _height_at(branch, grid: np.ndarray) -> np.ndarray:
    """The amplitude at values of the frequency where the branch has no folds."""
    order = np.argsort(branch.values)
    return np.interp(grid, branch.values[order], branch.measure(MEASURE)[order])


_FOUR_ONE = (4, 1)
_PRINTED = {"Tm1": "mean.q1", "Tm2": "mean.q3", "Te1": "harmonic1.amplitude", "Ω": "frequency"}
_BETA = {"β": "stage2.impact_damping"}
_NOTABLE = 0.01  # of the highest line: what a picture of a spectrum shows
_HIGH = 5  # from this harmonic on: the higher ones
_ALIKE = 0.2  # rms difference of two histories that look alike


def distance(system: gw.System, printed: gw.System) -> float:
    """How far a system is from the printed numbers: the root of the sum of squares of the logarithms of their ratios.

    So 0.1 is a change of one number by about a tenth. What is zero in both does not count.
    """
    names = [name for name in (*_PRINTED.values(), *_BETA.values()) if printed[name] != 0.0]
    return math.sqrt(sum(math.log(system[name] / printed[name]) ** 2 for name in names))


@claim(
    "5-double",
    "At Ω = 0.17 the impact model hits four times on one side, then once on the other.",
    "5",
    "5-mean",
    "5-amplitude",
    elsewhere=("5",),
)
def _double_sided(printed: gw.Result, *walks: gw.Result) -> Finding:
    orbit = attractor_of(printed).orbit
    evidence = _motion_at(printed, *walks)
    return Finding(orbit is not None and force_peaks(orbit) in (_FOUR_ONE, _FOUR_ONE[::-1]), evidence)


@claim(
    "5-elsewhere",
    "Under other loads it does: the force has four peaks on one side, then one on the other.",
    "5-near",
    "6-near",
    "5",
    apart=True,
)
def _four_and_one(near: gw.Result, viscous: gw.Result, printed: gw.Result) -> Finding:
    one, two = orbit_of(near), orbit_of(viscous)
    evidence = (
        f"at {_place(one.system)}: impact model {_contacts(one)}, viscous model {_contacts(two)}; distance from the "
        f"printed numbers {distance(one.system, printed.system):.2f}, the root of the sum of squares of the logarithms "
        "of their ratios"
    )
    return Finding(force_peaks(one) == _FOUR_ONE and one.stable, evidence)


def _hits_one_side(orbit: gw.Orbit) -> bool:
    return orbit.pattern.endswith("+/0-")


def _motion_at(printed: gw.Result, *walks: gw.Result) -> str:
    """The motion at the loads of a result, and those along walks over Tm1 and Te1 alone, if there are any."""
    attractor = attractor_of(printed)
    contacts = _contacts(attractor.orbit) if attractor.orbit else "no period"
    parts = [f"at Te1 = {printed.system['harmonic1.amplitude']:g} {attractor.label}, {contacts}"]
    for name, walk in zip(("Tm1", "Te1"), walks, strict=False):
        parts.append(f"stable motions of period 1 over {name} alone: {_patterns(walk)}")
    return "; ".join(parts)


def _contacts(orbit: gw.Orbit) -> str:
    up, down = force_peaks(orbit)
    return f"contacts {orbit.pattern}, force peaks {up}+/{down}-"


def _patterns(result: gw.Result) -> str:
    """The contacts of the stable motions of period 1, and the ranges of the parameter in which they occur."""
    found: dict[str, list[float]] = {}
    for point in main_branch(result).points:
        if point.stable:
            found.setdefault(_contacts(point.orbit), []).append(point.value)
    return ", ".join(f"{contacts} at {Range(min(inside), max(inside))}" for contacts, inside in found.items())


@claim("5-harmonics", "At least ten to twelve harmonics make up its force.", "5-near")
def _many_lines(near: gw.Result) -> Finding:
    heights = lines(orbit_of(near), "stage2")
    notable = int(np.count_nonzero(heights > _NOTABLE * heights.max()))
    return Finding(notable >= 10, f"{notable} lines of the force above {_NOTABLE:.0%} of the highest")


def _place(system: gw.System) -> str:
    return ", ".join(f"{word} = {system[name]:.4g}" for word, name in (_PRINTED | _BETA).items())


@claim(
    "6-single",
    "At Ω = 0.17 the viscous model hits on one side only.",
    "6",
    "6-mean",
    "6-amplitude",
    elsewhere=("6",),
)
def _single_sided(printed: gw.Result, *walks: gw.Result) -> Finding:
    orbit = attractor_of(printed).orbit
    return Finding(orbit is not None and _hits_one_side(orbit), _motion_at(printed, *walks))


@claim(
    "6-elsewhere",
    "It does at the place where the impact model hits on both.",
    "6-near",
    "5-near",
    "6-near-rest",
    apart=True,
)
def _one_sided_there(viscous: gw.Result, impact: gw.Result, from_rest: gw.Result) -> Finding:
    one, two, other = orbit_of(viscous), orbit_of(impact), orbit_of(from_rest)
    evidence = (
        f"at the place of 5-elsewhere, from the motion of the impact model ({_contacts(two)}): {_contacts(one)}; "
        f"from rest: {_contacts(other)}"
    )
    return Finding(_hits_one_side(one) and one.stable and not _hits_one_side(two), evidence)


@claim("6-weaker", "Its higher harmonics are much smaller.", "6-near", "5-near", elsewhere=("6", "5"))
def _weaker_lines(viscous: gw.Result, impact: gw.Result) -> Finding:
    high = [float(np.linalg.norm(lines(orbit_of(each), "stage2")[_HIGH - 1 :])) for each in (viscous, impact)]
    evidence = (
        f"rms of the force from harmonic {_HIGH} on: viscous model {high[0] / high[1]:.2f} of that of the impact one"
    )
    return Finding(high[0] < 0.5 * high[1], evidence)


@claim("7-differ", "With more damping the accelerations of both models differ.", "5", "6")
def _accelerations_differ(impact: gw.Result, viscous: gw.Result) -> Finding:
    apart = difference(*(over_two_periods(each, "q1''") for each in (impact, viscous)))
    patterns = words(
        [_contacts(orbit) for each in (impact, viscous) if (orbit := attractor_of(each).orbit) is not None]
    )
    evidence = (
        f"at Te1 = {impact.system['harmonic1.amplitude']:g} {patterns}; rms of the difference {apart:.1%}. The higher "
        "damping of this figure is not printed"
    )
    return Finding(apart > 0.5, evidence)


@claim(
    "7-elsewhere",
    "They do so though the damping is chosen for the forces to be alike.",
    "7-impact-near",
    "7-viscous-near",
    apart=True,
)
def _differ_there(impact: gw.Result, viscous: gw.Result) -> Finding:
    force, acceleration = (
        difference(*(over_two_periods(each, signal) for each in (viscous, impact))) for signal in ("stage2", "q1''")
    )
    damping = f"C11 = C21 = {viscous.system['damping.q1.q1']:.3g}, β = {impact.system['stage2.impact_damping']:.3g}"
    evidence = (
        f"at the place of 5-elsewhere, {damping}: forces differ by {force:.1%}, accelerations by {acceleration:.1%}"
    )
    return Finding(force < _ALIKE and acceleration > 1.5 * force, evidence)


@claim("8-elsewhere", "At a very low mean load impacts are double-sided.", "8-impact", apart=True)
def _both_sided_there(very_low: gw.Result) -> Finding:
    orbit = orbit_of(very_low)
    return Finding(_hits_both_sides(orbit) and orbit.stable, f"at {_place(orbit.system)}: {_contacts(orbit)}")


def _hits_both_sides(orbit: gw.Orbit) -> bool:
    return min(force_peaks(orbit)) > 0


@claim(
    "8-record",
    "The computed u3'' resembles the measured one, that of the viscous model does not.",
    "8-impact",
    "8-viscous",
    "8-record",
)
def _like_the_record(impact: gw.Result, viscous: gw.Result, recorded: gw.Result) -> Finding:
    found = [aligned_with_record(each, recorded).agreement.relative for each in (impact, viscous)]
    evidence = (
        "the measured record is not printed as numbers, so nothing can be compared with it. Compared with a "
        f"SYNTHETIC one (impact damping, a little other numbers, {NOISE:.0%} of noise), the rms error of u3'' is "
        f"{found[0]:.1%} with impact and {found[1]:.1%} with viscous damping"
    )
    return Finding(False, evidence)

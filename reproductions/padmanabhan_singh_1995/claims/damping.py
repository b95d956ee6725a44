"""What the paper says of viscous and impact damping (its section 4, figures 1 and 3 to 8)."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

import gapwalk as gw
from reproductions.padmanabhan_singh_1995.claims.claim import TOLERANCE, Against, Finding, claim
from reproductions.padmanabhan_singh_1995.jobs import matched_damping
from reproductions.padmanabhan_singh_1995.quantities import (
    IMPACT,
    LOOPS,
    START,
    VISCOUS,
    Range,
    attractor_of,
    counted,
    difference,
    flipped,
    force_peaks,
    heights_at,
    highest,
    impact_words,
    lines,
    main_branch,
    meeting,
    members,
    orbit_of,
    over_two_periods,
    third_inertia,
    values,
    with_pair,
    words,
)

_FREQUENCIES = ("5-response", "6-response", "4a", "4b")
_CLOSED = "closed+"  # the pattern of a contact that never opens
_ONCE = "1+/0-"  # the pattern of one impact on the positive side in a whole period
_BEYOND = 0.75  # from here on: beyond the first resonance


@claim("1-viscous", "Viscous damping leaves a force that pulls when the bodies part.")
def _pulls() -> Finding:
    loop = LOOPS[VISCOUS]
    least = float(loop.force.min())
    return Finding(least < 0.0, f"where the bodies part it pulls with {-least:.3g}", _size(loop))


@claim("1-impact", "Impact damping does not.")
def _never_pulls() -> Finding:
    loop = LOOPS[IMPACT]
    least = float(loop.force.min())
    return Finding(least >= 0.0, f"least force {least:.3g}", _size(loop))


def _size(loop: Any) -> str:
    return f"the greatest force is {loop.force.max():.3g}, the loss {loop.loss:.3g} per cycle with both laws"


@claim("3-acceleration", "At Ω = 1.5 the accelerations of both damping models agree.", "3-impact", "3-viscous")
def _accelerations(impact: gw.Result, viscous: gw.Result) -> Finding:
    """Compare settled motions, and starts, which the figure may show; also with beta by the paper's rule."""
    settled, start = _apart(impact, viscous, "q1''"), _apart_at_first(impact, viscous, "q1''")
    match = matched_damping("3-viscous", "3-impact")
    beta = float(match.impact_damping)
    at_first = _apart_at_first(impact, viscous, "q1''", beta)
    return Finding(
        settled < 2.0 * TOLERANCE,
        f"rms of the difference {settled:.1%} settled, {start:.0%} over {START} periods from rest; with β = "
        f"{beta:.3g}, by the paper's rule, {match.difference:.1%} and {at_first:.0%}",
        f"settled on {words([attractor_of(each).label for each in (impact, viscous)])}",
        short=_more_than_slightly(settled, start),
    )


def _more_than_slightly(settled: float, start: float) -> str:
    """How far the two models are apart, where that is more than the tolerance."""
    return f"{settled:.1%} apart, {start:.0%} over the start" if max(settled, start) > TOLERANCE else ""


def _apart_at_first(impact: gw.Result, viscous: gw.Result, signal: str, beta: float | None = None) -> float:
    """The difference over the start from rest."""
    system = impact.system if beta is None else impact.system.at({_BETA["β"]: beta})
    one, two = (gw.integrate(each, np.zeros(4), START, 128).signal(signal) for each in (viscous.system, system))
    return difference(one, two)


def _apart(first: gw.Result, second: gw.Result, signal: str) -> float:
    return difference(*(over_two_periods(each, signal) for each in (first, second)))


@claim("3-force", "Their contact forces differ slightly.", "3-impact", "3-viscous")
def _forces(impact: gw.Result, viscous: gw.Result) -> Finding:
    """Judged as the accelerations are."""
    settled, start = _apart(impact, viscous, "stage2"), _apart_at_first(impact, viscous, "stage2")
    return Finding(
        1e-6 < settled < _ALIKE,
        f"rms of the difference {settled:.1%} settled, {start:.0%} over {START} periods from rest",
        "as shares of the contact force about its mean",
        short=_more_than_slightly(settled, start),
    )


@claim("3-impacts", "One impact happens every two forcing periods.", "3-impact", "3-viscous")
def _each_second_period(*results: gw.Result) -> Finding:
    found = [attractor_of(each) for each in results]
    labels = words([f"{each.label} ({impact_words(each.orbit.pattern if each.orbit else '?')})" for each in found])
    holds = all(each.orbit is not None and each.orbit.pattern == _ONCE for each in found)
    return Finding(holds, f"impact and viscous model settle on {labels}")


@claim("4-matched", "β is chosen so that both models agree where the response has one harmonic.")
def _matched() -> Finding:
    """The rule of section 4, at the frequency of figure 3, for both rows of table 1."""
    rows = {"3": ("3-viscous", "3-impact"), "5": ("6", "5")}
    found = {row: matched_damping(*cases) for row, cases in rows.items()}
    printed = {row: gw.paper.parameter_set(impact).beta for row, (_, impact) in rows.items()}
    apart = {row: _with_beta(match, printed[row]) for row, match in found.items()}
    values = "; ".join(
        f"row of figure {row}: {match.impact_damping:.4f}, printed {printed[row]}" for row, match in found.items()
    )
    details = "; ".join(
        f"row of figure {row}: accelerations differ by {match.difference:.1%}, with the printed β by {apart[row]:.1%}"
        for row, match in found.items()
    )
    named = tuple(
        Against(f"β of the row of figure {row}", printed[row], match.impact_damping) for row, match in found.items()
    )
    return Finding(max(apart.values()) < 0.1, f"β by this rule: {values}", details, named)


def _with_beta(match: Any, beta: float) -> float:
    """The difference of the accelerations with another impact damping."""
    impact = gw.find_orbit(match.impact.system.at({"stage2.impact_damping": beta}), 1, match.impact.state)
    one, two = (each.motion(512).signal("q1''")[:-1] for each in (match.viscous, impact))
    return difference(one, two)


@claim("4-folds", "Both damping models jump at about the same frequencies.", "4a", "4b", short=True)
def _same_folds(impact: gw.Result, viscous: gw.Result) -> Finding:
    """One after the other; of different numbers, each jump of the viscous model and the nearest of the impact model."""
    one, two = (values(main_branch(each), gw.Kind.FOLD) for each in (impact, viscous))
    near = one if len(one) == len(two) else [min(one, key=lambda a: abs(a - b)) for b in two if one]
    apart = [abs(a / b - 1.0) for a, b in zip(near, two, strict=False)]
    far = [f"{each:.1%}" for each in apart if each > TOLERANCE]
    return Finding(
        bool(apart) and max(apart) < 2.0 * TOLERANCE,
        f"impact {words(one)}; viscous {words(two)}",
        short=f"{len(far)} of {len(two)} folds are {' and '.join(far)} apart" if far else "",
    )


@claim("4-flips", "The range of doubled periods is smaller for viscous damping.", "4a", "4b", short=True)
def _smaller_flips(impact: gw.Result, viscous: gw.Result) -> Finding:
    """All ranges together; beside the jump alone, the viscous one is smaller in any case."""
    found = [flipped(main_branch(each)) for each in (impact, viscous)]
    near = [sum(each.width for each in meeting(ranges, 0.5, 0.9)) for ranges in found]
    whole = [sum(each.width for each in ranges) for ranges in found]
    return Finding(
        0.0 < whole[1] < whole[0],
        f"impact {whole[0]:.3f}, viscous {whole[1]:.3f} wide in all ({near[0]:.3f}, {near[1]:.3f} beside the jump)",
        f"impact {words(found[0])}; viscous {words(found[1])}",
    )


@claim("4-beats", "Both models become quasi-periodic.", "4a", "4b")
def _both_with_pair(impact: gw.Result, viscous: gw.Result) -> Finding:
    """On motions of any period; on different ones it is a statement in kind, since the figure draws period 1."""
    found = {
        period: [
            [each for member in members(result, period) for each in with_pair(member.branch)]
            for result in (impact, viscous)
        ]
        for period in (1, 2)
    }
    parts = [f"period {period}: impact {words(one)}, viscous {words(two)}" for period, (one, two) in found.items()]
    either = [any(pair[model] for pair in found.values()) for model in (0, 1)]
    drawn = all(found[1])
    return Finding(
        all(either),
        "; ".join(parts),
        short="" if drawn else "the viscous model on period 2 only, which the paper does not draw",
    )


@claim("4-peak", "The peak is higher with viscous damping.", "4a", "4b", short=True)
def _higher_peak(impact: gw.Result, viscous: gw.Result) -> Finding:
    one, two = (highest(main_branch(each)) for each in (impact, viscous))
    return Finding(two.height > one.height, f"impact {one}; viscous {two}")


_AGREE = 0.01  # of the frequency: ends of ranges that agree


@claim("4-beyond", "Beyond the first resonance both give almost the same.", "4a", "4b", short=True)
def _same_beyond(impact: gw.Result, viscous: gw.Result) -> Finding:
    """The amplitudes agree, and so do the ranges of doubled periods."""
    grid = np.linspace(_BEYOND, 1.95, 200)
    curves = [heights_at(main_branch(each), grid) for each in (impact, viscous)]
    apart = float(np.abs(curves[1] - curves[0]).max() / curves[1].max())
    one, two = ([each for each in flipped(main_branch(result)) if each.low > _BEYOND] for result in (impact, viscous))
    same = len(one) == len(two) and all(
        max(abs(a.low - b.low), abs(a.high - b.high)) < _AGREE for a, b in zip(one, two, strict=True)
    )
    return Finding(
        apart < 0.1 and same,
        f"amplitudes differ by {apart:.1%} of the highest at most; doubled periods: impact {words(one)}, viscous "
        f"{words(two)}",
    )


_FOUR_ONE = (4, 1)
_PRINTED = {"Tm1": "mean.q1", "Tm2": "mean.q3", "Te1": "harmonic1.amplitude", "Ω": "frequency"}
_BETA = {"β": "stage2.impact_damping"}
_NOTABLE = 0.01  # of the highest line: what a picture of a spectrum shows
_HIGH = 5  # from this harmonic on: the higher ones
_ALIKE = 0.2  # rms difference of two histories that look alike
_DIGITS = 2  # of the loads in the tables
_REACH = 0.005  # of Te1: how far the range of a motion is looked for
_HALVINGS = 6  # to narrow down its ends


def distance(system: gw.System, printed: gw.System) -> float:
    """How far a system is from the printed numbers: the root of the sum of squares of the logarithms of their ratios.

    So 0.1 is a change of one number by about a tenth. What is zero in both does not count.
    """
    names = [name for name in (*_PRINTED.values(), *_BETA.values()) if printed[name] != 0.0]
    return math.sqrt(sum(math.log(system[name] / printed[name]) ** 2 for name in names))


@claim("5-double", "At Ω = 0.17 the impact model hits four times on one side, then once on the other.", "5")
def _double_sided(result: gw.Result) -> Finding:
    orbit = attractor_of(result).orbit
    if orbit is None or force_peaks(orbit) not in (_FOUR_ONE, _FOUR_ONE[::-1]):
        return Finding(False, _motion_at(result))
    span = _span_over_force(orbit)
    middle = round(0.5 * (span.low + span.high), _DIGITS)
    printable = span.meets(middle, middle)
    return Finding(
        True,
        f"{_motion_at(result)}; so from Te1 = {span} only",
        f"from one start, not from rest; the tables print loads with {_DIGITS} digits",
        short="" if printable else f"{span.width:.1g} wide: more digits than are printed",
    )


def _span_over_force(orbit: gw.Orbit) -> Range:
    """The range of Te1 over which the motion stays stable and keeps its peaks, to a hundredth of its width."""
    name, wanted = "harmonic1.amplitude", force_peaks(orbit)
    ends = []
    for step in (-_REACH, _REACH):
        points = gw.follow(orbit, name, to=orbit.system[name] + step, walk=gw.WalkOptions(largest_step=0.1)).points
        alike = [point.stable and force_peaks(point.orbit) == wanted for point in points]
        last = (alike.index(False) if False in alike else len(points)) - 1
        good, bad = points[last].orbit, points[min(last + 1, len(points) - 1)].value
        for _ in range(_HALVINGS):
            middle = 0.5 * (good.system[name] + bad)
            tried = gw.find_orbit(good.system.at({name: middle}), 1, good.state)
            if tried.stable and force_peaks(tried) == wanted:
                good = tried
            else:
                bad = middle
        ends.append(good.system[name])
    return Range(ends[0], ends[1])


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
    return Finding(
        force_peaks(one) == _FOUR_ONE and one.stable,
        f"{_contacts(one)}, at {_place(one.system)}",
        f"viscous model {_contacts(two)}; all numbers together are {distance(one.system, printed.system):.2f} from the "
        "printed ones: the root of the sum of squares of the logarithms of their ratios",
    )


def _hits_one_side(orbit: gw.Orbit) -> bool:
    return orbit.pattern.endswith("+/0-")


def _motion_at(result: gw.Result) -> str:
    """The motion at the loads of a result."""
    attractor = attractor_of(result)
    contacts = _contacts(attractor.orbit) if attractor.orbit else "no period"
    return f"at Te1 = {result.system['harmonic1.amplitude']:g} {attractor.label}, {contacts}"


def _contacts(orbit: gw.Orbit) -> str:
    return f"{impact_words(orbit.pattern)}, force peaks {' and '.join(map(str, force_peaks(orbit)))} (+, − side)"


@claim("5-harmonics", "At least ten to twelve harmonics make up its force.", "5")
def _many_lines(result: gw.Result) -> Finding:
    heights = lines(orbit_of(result), "stage2")
    notable = int(np.count_nonzero(heights > _NOTABLE * heights.max()))
    return Finding(notable >= 10, f"{counted(notable, 'line')} of the force above {_NOTABLE:.0%} of the highest")


def _place(system: gw.System) -> str:
    return ", ".join(f"{word} = {system[name]:.4g}" for word, name in (_PRINTED | _BETA).items())


@claim("6-single", "At Ω = 0.17 the viscous model hits on one side only.", "6", "5")
def _single_sided(viscous: gw.Result, impact: gw.Result) -> Finding:
    """With the motion of the impact model at the same place, to which the paper compares it."""
    orbit = attractor_of(viscous).orbit
    opens = orbit is not None and orbit.pattern != _CLOSED
    return Finding(
        orbit is not None and opens and _hits_one_side(orbit),
        _motion_at(viscous),
        f"the impact model there: {_motion_at(impact)}",
    )


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
    return Finding(
        _hits_one_side(one) and one.stable and not _hits_one_side(two),
        f"viscous {_contacts(one)}; impact {_contacts(two)}",
        f"at the place of 5-elsewhere, from the motion of the impact model; from rest: {_contacts(other)}",
    )


@claim("6-weaker", "Its higher harmonics are much smaller.", "6", "5")
def _weaker_lines(viscous: gw.Result, impact: gw.Result) -> Finding:
    high = [_high_lines(each) for each in (viscous, impact)]
    line = f"rms of the force from harmonic {_HIGH} on: viscous {high[0]:.2g}, impact {high[1]:.2g}"
    opens = orbit_of(impact).pattern != _CLOSED
    return Finding(opens and high[0] < 0.5 * high[1], line)


def _high_lines(result: gw.Result) -> float:
    return float(np.linalg.norm(lines(orbit_of(result), "stage2")[_HIGH - 1 :]))


@claim("6-broadband", "Its spectrum has more of a broad band than that of the impact model.", "6", "5")
def _broader(viscous: gw.Result, impact: gw.Result) -> Finding:
    """By the share of the harmonics from the fifth on in the force; a broad band has ten lines at least."""
    counts, shares = [], []
    for each in (viscous, impact):
        heights = lines(orbit_of(each), "stage2")
        counts.append(int(np.count_nonzero(heights > _NOTABLE * heights.max())))
        shares.append(float(np.linalg.norm(heights[_HIGH - 1 :]) / np.linalg.norm(heights)))
    return Finding(
        min(counts) >= 10 and shares[0] > shares[1],
        f"viscous {counted(counts[0], 'line')} above {_NOTABLE:.0%}, share from harmonic {_HIGH} on {shares[0]:.2f}; "
        f"impact {counts[1]}, {shares[1]:.2f}",
    )


_RAISED = "printed loads, with more damping, whose values the paper does not print"
_LOW = 0.5  # below it the frequencies are low


@claim("6-apart", "Under a light mean load the models differ considerably, most at low frequencies.", *_FREQUENCIES)
def _differ_low(*results: gw.Result) -> Finding:
    """The amplitudes of period 1 of rows 5 and 6, and of the heavy load of figure 4 for comparison."""
    light, heavy = results[:2], results[2:]
    low, high = (
        [_largest(pair[0], pair[1], *within) for pair in (light, heavy)] for within in ((0.15, _LOW), (_BEYOND, 1.9))
    )
    return Finding(
        low[0] > 0.2 and low[0] > max(*low[1:], *high),
        f"largest difference of the amplitudes below {_LOW}: light {low[0]:.0%}, heavy {low[1]:.1%}; beyond "
        f"{_BEYOND}: {high[0]:.0%}, {high[1]:.0%}",
    )


def _largest(impact: gw.Result, viscous: gw.Result, low: float, high: float) -> float:
    grid = np.linspace(low, high, 400)
    one, two = (heights_at(main_branch(each), grid) for each in (impact, viscous))
    return float(np.nanmax(np.abs(two / one - 1.0)))


@claim(
    "7-differ",
    "With more damping, chosen so that the forces match, the accelerations of both models differ.",
    "7-impact-raised",
    "7-viscous-raised",
    place=_RAISED,
)
def _accelerations_differ(impact: gw.Result, viscous: gw.Result) -> Finding:
    """The raised damping is not printed: it is chosen, as the paper chose it, and is no changed number."""
    orbits = [orbit_of(each) for each in (impact, viscous)]
    force, acceleration = (_apart(viscous, impact, signal) for signal in ("stage2", "q1''"))
    opens = all(orbit.pattern != _CLOSED for orbit in orbits)
    return Finding(
        opens and force < TOLERANCE and acceleration > 2.0 * TOLERANCE,
        f"with {_damping(impact, viscous)} forces differ by {force:.1%}, accelerations by {acceleration:.1%}",
        f"at Te1 = {impact.system['harmonic1.amplitude']:g}: {words([_contacts(orbit) for orbit in orbits])}",
    )


def _damping(impact: gw.Result, viscous: gw.Result) -> str:
    return f"C11 = C21 = {viscous.system['damping.q1.q1']:.3g}, β = {impact.system['stage2.impact_damping']:.3g}"


@claim(
    "7-spectra", "Their spectra differ in the higher harmonics.", "7-impact-raised", "7-viscous-raised", place=_RAISED
)
def _spectra_differ(impact: gw.Result, viscous: gw.Result) -> Finding:
    """Where the contact opens in both, and the forces match."""
    high = [_high_lines(each) for each in (impact, viscous)]
    opens = all(orbit_of(each).pattern != _CLOSED for each in (impact, viscous))
    apart = high[1] / high[0] - 1.0
    return Finding(
        opens and _apart(viscous, impact, "stage2") < TOLERANCE and abs(apart) > 2.0 * TOLERANCE,
        f"rms of the force from harmonic {_HIGH} on: impact {high[0]:.2g}, viscous {high[1]:.2g} ({apart:+.0%})",
        f"with {_damping(impact, viscous)}",
    )


@claim(
    "7-elsewhere",
    f"They do so where both hit as the paper says, with forces less than {_ALIKE:.0%} apart.",
    "7-impact-near",
    "7-viscous-near",
    apart=True,
)
def _differ_there(impact: gw.Result, viscous: gw.Result) -> Finding:
    force, acceleration = (_apart(viscous, impact, signal) for signal in ("stage2", "q1''"))
    return Finding(
        force < _ALIKE and acceleration > 1.5 * force,
        f"forces differ by {force:.1%}, accelerations by {acceleration:.1%}",
        f"at the place of 5-elsewhere, {_damping(impact, viscous)}",
    )


@claim("8-elsewhere", "At a very low mean load impacts are double-sided.", "8-impact", apart=True)
def _both_sided_there(very_low: gw.Result) -> Finding:
    orbit = orbit_of(very_low)
    return Finding(_hits_both_sides(orbit) and orbit.stable, _contacts(orbit), f"at {_place(orbit.system)}")


def _hits_both_sides(orbit: gw.Orbit) -> bool:
    return min(force_peaks(orbit)) > 0


@claim(
    "8-record",
    "The computed u3'' resembles the measured one, that of the viscous model does not.",
    "8-impact",
    "8-viscous",
    lost="the measured curve is not printed as numbers",
)
def _like_the_record(impact: gw.Result, viscous: gw.Result) -> Finding:
    """The record is lost: nothing can be compared with it."""
    motions = [orbit_of(each) for each in (impact, viscous)]
    one, two = (third_inertia(each.system).of(each.motion(512))[:-1] for each in motions)
    return Finding(
        False,
        f"at {_place(motions[0].system)} u3'' of the two models differ by {difference(one, two):.0%}",
    )

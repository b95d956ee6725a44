"""What a point means for the machine, in one sentence, and what can be done next from there."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from gapwalk.answers.shown_measure import shown_measure
from gapwalk.bifurcation.special_point import SpecialPoint
from gapwalk.continuation.curve_points import BranchPoint
from gapwalk.errors import ModelError
from gapwalk.explorer.diagram_lines import Line
from gapwalk.explorer.opened_file import Exploration
from gapwalk.explorer.page_requests import Place
from gapwalk.explorer.request_tasks import is_same_system
from gapwalk.model.measures import parsed
from gapwalk.model.system import System
from gapwalk.model.words import measure_words, parameter_symbol, value_words
from gapwalk.orbit.orbit import Orbit

_BESIDE = 0.005  # share of the value of a point by which a motion beside it is settled
_LOOK = 1e-3  # share of it at which the motions beyond a fold are looked for
_LEVEL = 0.01  # relative difference of two amplitudes from which one is called larger

_SLIDING = {
    "crossing-sliding": "friction begins or ceases to stick for a moment where its slip reverses",
    "switching-sliding": "friction begins or ceases to slip back for a moment before it sticks",
    "grazing-sliding": "friction begins or ceases to stick for a moment within its slip",
    "adding-sliding": "friction begins or ceases to slip for a moment while it sticks",
    "slip-onset": "friction that sticks all the time begins to slip",
    "held-stop": "a rigid stop begins or ceases to hold what strikes it",
}
_STAYS = {
    "stable": "stable: the machine stays in this motion after a small disturbance",
    "above": "unstable: the machine leaves this motion to one side, as before a jump",
    "below": "unstable: the machine leaves this motion, to one side and to the other in turn",
    "pair": "unstable: the machine leaves this motion in growing beats",
    "neutral": "neutral: a small disturbance neither grows nor decays",
}


class Stretch(NamedTuple):
    """A branch of the same system, in which motions beyond a fold are looked for."""

    parameter: str
    points: Sequence[BranchPoint]


def at_point(orbit: Orbit) -> dict[str, Any]:
    """Return the meaning of a point of a branch, and the next steps from there, for the page; see `at_special`."""
    label = orbit.instability.label
    steps = [] if label == "stable" else [step("settle", "See where it goes: settle from here")]
    return {"text": f"{_STAYS[label]}.".capitalize(), "steps": [*steps, *_LAST]}


def at_special(
    special: SpecialPoint, measure: str, near: Iterable[Stretch] = (), beside: Sequence[BranchPoint] = ()
) -> dict[str, Any]:
    """Return the meaning of a special point for the machine, and the next steps that make sense there."""
    kind = special.kind
    if kind.is_turning:
        text, beyond = _fold(special, measure, list(near))
    elif special.doubles:
        text, beyond = _flip(special)
    elif kind == "neimark-sacker":
        text, beyond = _neimark_sacker(special)
    elif kind == "branch-point":
        text, beyond = "branches of this period cross here; a symmetric motion, for one, can lose its symmetry", None
    elif kind == "grazing":
        text, beyond = f"{special.contact} just touches its stop{_contacts(special, beside)}{_turn(special)}", None
    elif str(kind) in _SLIDING:
        text, beyond = f"{_SLIDING[str(kind)]}{_phases(special, beside)}", None
    else:
        text, beyond = f"the event {str(kind)!r} of the model happens here", None
    steps = []
    if special.ways:
        many = special.orbit.period * kind.times
        words = f"Follow the branch of period {many}" if kind.times > 1 else "Follow the branch across"
        steps.append(step("switch", words))
    if not kind.no_locus and special.multiplicity == 1:
        steps.append(step("locus", "Trace it in a second parameter"))
    if beyond is not None:
        values = {special.parameter: beyond}
        words = value_words(beyond, special.parameter, special.orbit.system.units, 6)
        steps.append(step("settle", f"Settle at {words}", values))
    return {"text": f"At {_at(special)} {text}.", "steps": [*steps, *_LAST]}


def step(do: str, label: str, values: dict[str, float] | None = None) -> dict[str, Any]:
    """Return a step for the page."""
    return {"do": do, "label": label, "values": values or {}}


_LAST = (step("hear", "Hear it"), step("pin", "Compare others with it"))


def _at(special: SpecialPoint) -> str:
    """Write where a point is: ``948 rpm`` of a speed, ``Ω = 0.62`` otherwise."""
    system, name = special.orbit.system, special.parameter
    words = value_words(special.value, name, system.units, 6)
    is_pace = name == system.structure.pace and system.units is not None
    return words.partition(" = ")[2] if is_pace else words


def _when(system: System, parameter: str, way: float) -> str:
    """Write a change of a parameter: ``when slowed down``, or ``when Ω falls``."""
    if parameter == system.structure.pace and system.turns is not None:
        return "when sped up" if way > 0.0 else "when slowed down"
    return f"when {parameter_symbol(parameter).partition(' [')[0]} {'rises' if way > 0.0 else 'falls'}"


def _fold(special: SpecialPoint, measure: str, near: list[Stretch]) -> tuple[str, float | None]:
    """Describe a fold: the motion ends on one side of it, and a stable one jumps."""
    if not special.nature:
        return "the branch turns back", None
    way = -1.0 if "higher" in special.nature else 1.0  # to where there is no such motion
    if special.before.total and special.after.total:
        return "two unstable motions merge and vanish; the machine shows neither of them", None
    beyond = _beyond(special, way)
    when = _when(special.orbit.system, special.parameter, way)
    return f"the motion ends {when}: {_jump(special, way, measure, near)}", beyond


def _jump(special: SpecialPoint, way: float, measure: str, near: list[Stretch]) -> str:
    """Describe where a motion jumps to: to the stable motions that are known beyond the fold."""
    value = special.value + way * _LOOK * (abs(special.value) or 1.0)
    try:
        size, found = special.orbit.measure(measure), list(_stable_at(value, special.parameter, measure, near))
    except ModelError:  # an order that motions of another period do not have
        size, found = math.nan, []
    if not found or not np.isfinite([size, *found]).all():
        return "the machine jumps to a motion that is not among the branches shown"
    ways = {"up" if each > size * (1.0 + _LEVEL) else "down" if each < size * (1.0 - _LEVEL) else "" for each in found}
    word = f"jumps {ways.pop()}" if len(ways) == 1 and "" not in ways else "jumps"
    if len(found) > 1:
        return f"it {word} to one of {len(found)} stable motions known there"
    name, unit = measure_words(measure, None).partition(" (")[0], _unit_of(special, measure)
    return f"it {word} to the stable motion known there ({name} {size:.3g} to {found[0]:.3g}{unit})"


def _unit_of(special: SpecialPoint, measure: str) -> str:
    """Return the unit of a measure with a space before it; empty for a plain number."""
    units = special.orbit.system.units
    asked = parsed(measure)
    unit = asked.unit(units) if asked else ""
    return f" {unit}" if unit else ""


def _stable_at(value: float, parameter: str, measure: str, near: list[Stretch]) -> Iterator[float]:
    """Yield the measure of each stable motion at a value of the parameter, interpolated between two points."""
    for line in near:
        if line.parameter != parameter:
            continue
        for one, other in zip(line.points, line.points[1:], strict=False):
            if (one.value - value) * (other.value - value) < 0.0 and one.stable and other.stable:
                share = (value - one.value) / (other.value - one.value)
                yield (1.0 - share) * one.orbit.measure(measure) + share * other.orbit.measure(measure)


def _flip(special: SpecialPoint) -> tuple[str, float | None]:
    """Describe a flip: beyond it the motion repeats after twice the period, at once or after a jump."""
    many, way = 2 * special.orbit.period, _unstable_way(special)
    if way is None:
        return f"a branch of period {many} begins, of a motion that is unstable on both sides", None
    when, beyond = _when(special.orbit.system, special.parameter, way), _beyond(special, way)
    if special.nature == "subcritical":
        return f"the motion jumps away {when}: no stable motion of period {many} begins there", beyond
    gently = "; the change grows from zero, without a jump" if special.nature == "supercritical" else ""
    return f"{when} the motion changes to one that repeats every {many} forcing periods{gently}", beyond


def _neimark_sacker(special: SpecialPoint) -> tuple[str, float | None]:
    """Describe a Neimark-Sacker point: beats begin beyond it."""
    angle, way = abs(float(np.angle(special.multiplier))), _unstable_way(special)
    length = 2.0 * math.pi * special.orbit.period / angle if angle else math.inf
    beat = f"a beat of about {length:.3g} forcing periods begins"
    if way is None:
        return f"{beat}, of a motion that is unstable on both sides", None
    when = _when(special.orbit.system, special.parameter, way)
    return f"the motion is no longer periodic {when}: {beat}", _beyond(special, way)


def _unstable_way(special: SpecialPoint) -> float | None:
    """Return the direction of the parameter in which a motion loses its stability; None if it is never stable."""
    if bool(special.before.total) == bool(special.after.total):
        return None
    along = math.copysign(1.0, float(special.point.tangent[-1]))
    return along if special.after.total else -along


def _phases(special: SpecialPoint, beside: Sequence[BranchPoint]) -> str:
    """Describe how the phases of friction or of a held stop change, and in which direction of the parameter."""
    if len(beside) != 2 or not special.nature:
        return f" ({special.nature})" if special.nature else ""
    when = _when(special.orbit.system, special.parameter, beside[1].value - beside[0].value)
    return f"; {when}: {special.nature}"


def _contacts(special: SpecialPoint, beside: Sequence[BranchPoint]) -> str:
    """Describe how the contacts in a period change at a graze, if they do."""
    patterns = [point.orbit.pattern for point in beside]
    if len(patterns) != 2 or patterns[0] == patterns[1] or special.turns:
        return ""
    when = _when(special.orbit.system, special.parameter, beside[1].value - beside[0].value)
    return f"; {when} the impacts change from {patterns[0]} to {patterns[1]}"


def _turn(special: SpecialPoint) -> str:
    """Describe the change of stability at a graze, if there is one."""
    if special.turns:
        return ", and the branch turns back"
    way = _unstable_way(special)
    if way is None:
        return ""
    return f", and the motion loses its stability {_when(special.orbit.system, special.parameter, way)}"


def _beyond(special: SpecialPoint, way: float) -> float:
    """Return a value of the parameter a little beyond a point, of few digits."""
    value, size = special.value, _BESIDE * (abs(special.value) or 1.0)
    digits = 3 - math.floor(math.log10(size))
    return round(value + way * size, digits)


# View of what comes next: finds the point of a request, and the branches with which it is compared.

_HEARD = ("hear", "pin")  # steps that need no job, and so no end of the result


def next_of(exploration: Exploration, place: Place) -> dict[str, Any]:
    """Return the meaning of a point for the machine, and the next steps that work now; see `at_special`."""
    exploration.motion(place)  # raises an error if there is none
    with exploration.guard:
        entry = exploration.entry(place.result)
        lines = entry.lines()[place.branch : place.branch + 1]
    line = lines[0] if lines and entry.settled() is None else None
    if line is not None and line.kind is None and place.special is not None:
        _, special = exploration.special(place)
        measure = shown_measure(special.orbit.system, exploration.origin(place).options)
        near = stretches(known_lines(exploration), special, special.orbit.system)
        found = at_special(special, measure, near, neighbours(line, special))
    elif line is not None and line.kind is None and place.point is not None:
        found = at_point(line.points[place.point].orbit)
    else:  # a point of a locus, or a settled motion
        found = {"text": "", "steps": [step("hear", "Hear it"), step("pin", "Compare others with it")]}
    if not entry.state.is_over:
        found["steps"] = [each for each in found["steps"] if each["do"] in _HEARD]
    return found


def neighbours(line: Line, special: SpecialPoint) -> list[BranchPoint]:
    """Return the points of a branch before and after one of its special points; fewer at its ends."""
    at = special.point.arclength
    points = [point for point in line.points if isinstance(point, BranchPoint) and point.arclength != at]
    before = [point for point in points if point.arclength < at][-1:]
    return [*before, *[point for point in points if point.arclength > at][:1]]


def known_lines(exploration: Exploration) -> list[Line]:
    """Return the branches of all results of an exploration that are not deleted."""
    with exploration.guard:
        entries = [entry for entry in exploration.entries.values() if not entry.look.deleted]
        return [line for entry in entries for line in entry.lines() if line.kind is None]


def stretches(lines: Iterable[Line], special: SpecialPoint, system: System) -> Iterator[Stretch]:
    """Yield the branches along the parameter of a special point that belong to its system."""
    for line in lines:
        points = [point for point in line.points if isinstance(point, BranchPoint)]
        if line.parameter == special.parameter and points and is_same_system(points[0].orbit, system, line.parameter):
            yield Stretch(line.parameter, points)

"""View of what comes next: finds the point of a request, and the branches with which it is compared."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

from gapwalk.answers.shown_measure import shown_measure
from gapwalk.bifurcation.special_point import SpecialPoint
from gapwalk.continuation.point_on_branch import BranchPoint
from gapwalk.explorer.exploration import Exploration, Line
from gapwalk.explorer.plan import Place, is_same_system
from gapwalk.explorer.what_next import Stretch, at_point, at_special, step
from gapwalk.model.system import System

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

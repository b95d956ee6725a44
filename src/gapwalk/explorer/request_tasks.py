"""The task that a request of a page becomes: a study of a system, with the title of its result."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from gapwalk.answers.shown_measure import shown_measure
from gapwalk.attractors.spectrum import second_of
from gapwalk.continuation.corrector import check_range
from gapwalk.errors import ModelError
from gapwalk.explorer.engine_tasks import FollowUp, Task, follow_others, follow_special_point, follow_switch
from gapwalk.explorer.opened_file import Entry, Exploration, State
from gapwalk.explorer.page_requests import (
    Action,
    Compute,
    FollowLocus,
    Place,
    RunUp,
    Search,
    Settle,
    Switch,
    Walk,
    plain_action,
)
from gapwalk.explorer.progress_stream import Progress
from gapwalk.explorer.workspace_folder import along_words, changed_words, mark_of, study_title, write_record
from gapwalk.flow.flow import PERIOD
from gapwalk.flow.ramp import Ramped
from gapwalk.model.system import System
from gapwalk.model.words import pace_words, value_words
from gapwalk.orbit.method import Method, chosen
from gapwalk.orbit.orbit import Orbit
from gapwalk.studies.diagram_study import DiagramStudyOptions
from gapwalk.studies.map_study import MapStudyOptions
from gapwalk.studies.options import BranchOptions, ParameterRange
from gapwalk.studies.response_study import ResponseOptions
from gapwalk.studies.run_up_study import RunUpStudy
from gapwalk.studies.settle_study import SettleStudyOptions
from gapwalk.studies.study_file import Study

_SAMPLES, _FEWEST, _TOTAL = 512, 32, 400_000  # of a run-up in a forcing period, and in all


def plan(action: Action, shown: Exploration) -> tuple[str, Task]:
    """Return the title of the result of an action, and its task, still without a result file."""
    if isinstance(action, Compute):
        study = shown.study(action.study, action.values)
        return study_title(study, action.values), Task(study, Path())
    found = _PLANS[type(action)](action, shown)
    base = shown.studies[0].system if shown.studies else None  # titles compare with it; the file may have errors
    title = found.title + changed_words(found.system, base, found.varied)
    whole = f"{found.origin.title.partition(': ')[0]}: {title}" if found.origin.title else title
    # the rest is that of the file: its text, and the matrices and tables beside it
    study = replace(
        found.origin, system=found.system, options=found.options, title=whole, changes=(), name="", unused=()
    )
    return title, Task(study, Path(), found.follow_up)


def prepare(shown: Exploration, action: Action) -> tuple[Entry, Task]:
    """Return a new entry for an action, and the task that computes it, with a result file of its own."""
    shown.refuse_unfinished(action)
    title, task = plan(action, shown)
    output = shown.workspace.claim(shown.file, action.do)
    write_record(output, {"title": title, "action": plain_action(action), "model": mark_of(task.study)})
    entry = Entry(output.stem, title, output, action, State.QUEUED, model=mark_of(task.study))
    with shown.guard:
        shown.entries[entry.key] = entry
    return entry, replace(task, output=output)


def resumed(shown: Exploration, entry: Entry) -> Task:
    """Return the task that continues a stopped result; one that had found nothing begins again."""
    if entry.action is None or not entry.can_resume:
        raise ModelError(f"{entry.title} is complete; there is nothing to resume")
    shown.refuse_unfinished(entry.action)
    if isinstance(entry.action, Compute) and entry.result is not None:
        task = Task(entry.result.study, Path())
    else:
        task = plan(entry.action, shown)[1]
    with shown.guard:
        # the file may have changed since then; a resumed job keeps the study with which it began
        study = task.study if entry.result is None else entry.result.study
        entry.change(result=None, state=State.QUEUED, message="", live=Progress(), grown=(0, 0.0))
    return replace(task, study=study, output=Path(entry.path), resume=True)


class _Planned(NamedTuple):
    """The task and the script of an action."""

    system: System
    options: Any  #: Options of the study.
    title: str  #: Title, still without the values that differ from those of the file.
    varied: set[str]  #: Parameters that the title names.
    origin: Study  #: The study of the result from which it starts.
    follow_up: FollowUp | None = None


def _check_bounds(system: System, name: str, *bounds: float) -> None:
    """Raise a ModelError if the system cannot have one of some values of a parameter."""
    for bound in bounds:
        system.at({name: bound})


def known_branches(action: Search, shown: Exploration, system: System) -> list[tuple[str, int]]:
    """Return the branches that a search need not find: those along its parameter that belong to the searched system."""
    # Each is given by the key of its result and its index there.
    return [
        (key, number)
        for key in action.known
        for number, branch in enumerate(shown.branches(key))
        if branch.parameter == action.parameter and is_same_system(branch.points[0].orbit, system, branch.parameter)
    ]


def is_same_system(orbit: Orbit, system: System, parameter: str) -> bool:
    """Return True if an orbit belongs to a system, at any value of a parameter."""
    own = orbit.system
    same = system.at({parameter: own[parameter]})
    return own.structure == same.structure and bool((own.values == same.values).all())


def orbit_at(place: Place, shown: Exploration) -> Orbit:
    """Return the orbit at a place; raise a ModelError if the motion there is not periodic."""
    motion = shown.motion(place)
    orbit = motion if isinstance(motion, Orbit) else motion.orbit
    if orbit is None:
        raise ModelError("this motion is not periodic, so no branch begins at it; choose a point of a branch")
    return orbit


def _walk(action: Walk, shown: Exploration) -> _Planned:
    orbit, origin = orbit_at(action.start, shown), shown.origin(action.start)
    begin = orbit.system[action.parameter]
    check_range(begin, action.to)
    _check_bounds(orbit.system, action.parameter, action.to)
    options = _from_orbit(ResponseOptions, orbit, origin, action.parameter, begin, action.to)
    period = f"period {orbit.period}, " if orbit.period > 1 else ""
    title = period + along_words(orbit.system, action.parameter, begin, action.to)
    return _Planned(orbit.system, options, title, {action.parameter}, origin)


def _switch(action: Switch, shown: Exploration) -> _Planned:
    line, special = shown.special(action.start)
    parameter, orbit, origin = line.parameter, special.orbit, shown.origin(action.start)
    if not special.ways:
        raise ModelError(
            f"no other branch of periodic motions begins at a {special.kind.value}; choose a flip (PD) or a branch "
            "point (BP)"
        )
    check_range(special.value, (action.low, action.high))
    _check_bounds(orbit.system, parameter, action.low, action.high)
    period = orbit.period * special.kind.times
    options = _from_orbit(DiagramStudyOptions, orbit, origin, parameter, action.low, action.high, period=period)
    at = value_words(special.value, parameter, orbit.system.units, 6)
    title = f"period {period} from the {special.kind.value} at {at}"
    return _Planned(orbit.system, options, title, {parameter}, origin, partial(follow_switch, special))


def _search(action: Search, shown: Exploration) -> _Planned:
    system = shown.base().system if action.start is None else shown.motion(action.start).system
    parameter = action.parameter
    _check_bounds(system, parameter, action.low, action.high)
    if not action.low < action.high:
        given = f"the range of {parameter} is from {action.low:g} to {action.high:g}"
        raise ModelError(f"{given}; its second value must be the larger one")
    known = tuple(shown.branches(key)[number] for key, number in known_branches(action, shown, system))
    origin = shown.base() if action.start is None else shown.origin(action.start)
    options = _others_options(action, system, origin)
    title = f"isolated branches, {along_words(system, parameter, action.low, action.high)}"
    return _Planned(system, options, title, {parameter}, origin, partial(follow_others, known))


def _others_options(action: Search, system: System, origin: Study) -> DiagramStudyOptions:
    """Return the options of a search: those of the diagram from which it starts, if it starts from one."""
    own, measure = origin.options, shown_measure(system, origin.options)
    where = (action.parameter, action.low, action.high)
    if isinstance(own, DiagramStudyOptions):
        limits = replace(own.limits, search_values=action.count)
        return DiagramStudyOptions(
            *where,
            measure,
            method=own.method,
            walk=own.walk,
            max_period=limits.max_period,
            max_branches=limits.max_branches,
            workers=limits.workers,
            search_values=action.count,
            search=limits.search,
        )
    method = own.method if isinstance(own, BranchOptions) else chosen(None)
    return DiagramStudyOptions(*where, measure, method=method, search_values=action.count)


def _locus(action: FollowLocus, shown: Exploration) -> _Planned:
    line, special = shown.special(action.start)
    first, second, system = line.parameter, action.second, special.orbit.system
    origin = shown.origin(action.start)
    if special.kind.no_locus:
        raise ModelError(special.kind.no_locus)
    if first == second:
        raise ModelError(f"choose a second parameter other than {first}: the plane of a locus has two")
    second_low, second_high = sorted((action.second_low, action.second_high))
    for name, low, high in ((first, action.low, action.high), (second, second_low, second_high)):
        _check_bounds(system, name, low, high)
        if not low <= system[name] <= high or low == high:
            given = f"the range of {name} is from {low:g} to {high:g}"
            raise ModelError(f"{given}; it must contain the value of the point, {system[name]:.8g}")
    options = _from_orbit(
        MapStudyOptions,
        special.orbit,
        origin,
        *(first, action.low, action.high),
        method=locus_method(special.orbit, origin),
        second=ParameterRange(second, second_low, second_high),
        sections=(system[second],),
        kinds=(special.kind,),
    )
    at, plane = value_words(special.value, first, system.units, 6), along_words(system, second, second_low, second_high)
    title = f"{special.kind.value} at {at}, {plane}"
    return _Planned(system, options, title, {first, second}, origin, partial(follow_special_point, special))


def locus_method(orbit: Orbit, origin: Study) -> Method:
    """Return the method for a locus: that by which the orbit was found, but shooting in one segment."""
    return method_of(orbit, origin).for_loci()


def _settle(action: Settle, shown: Exploration) -> _Planned:
    if action.start is None:
        origin = shown.base()
        system, start = origin.system, "rest"
    else:
        motion, origin = shown.motion(action.start), shown.origin(action.start)
        system, start = motion.system, tuple(motion.state.tolist())
    system = system.at(dict(action.values))
    options = SettleStudyOptions(signal=system.coordinates[0], start=start)
    return _Planned(system, options, f"settled at {pace_words(system)}", {system.structure.pace}, origin)


def _run_up(action: RunUp, shown: Exploration) -> _Planned:
    origin = shown.base() if action.start is None else shown.origin(action.start)
    system = origin.system if action.start is None else shown.motion(action.start).system
    system = system.at(dict(action.values))
    options = run_up_study(action, system)
    pace, low, high = system.structure.pace, action.low, action.high
    ends = (high, low) if action.way == "down" else (low, high)
    back = " and back" if action.way == "both" else ""
    title = f"run-up, {along_words(system, pace, *ends)}{back} in {options.times[-1] / _second(system):.4g} s"
    return _Planned(system, options, title, {pace}, origin)


def run_up_study(action: RunUp, system: System) -> RunUpStudy:
    """Return the study of a run-up; raise a ModelError if the system cannot run up."""
    if not action.low < action.high:
        given = f"the range of {system.structure.pace} is from {action.low:g} to {action.high:g}"
        raise ModelError(f"{given}; its second value must be the larger one")
    Ramped(system)  # refuses what cannot run up
    _check_bounds(system, system.structure.pace, action.low, action.high)
    lasts = action.seconds * _second(system)
    speeds = {"up": (action.low, action.high), "down": (action.high, action.low)}
    course = speeds.get(action.way, (action.low, action.high, action.low))
    times = tuple(lasts * number for number in range(len(course)))
    periods = 0.5 * (action.low + action.high) * system.structure.frequency / PERIOD * times[-1]
    samples = 2 ** int(math.log2(max(_TOTAL / max(periods, 1.0), _FEWEST)))
    return RunUpStudy(times=times, speeds=course, samples=min(samples, _SAMPLES))


def _second(system: System) -> float:
    return second_of(system, None)


def _from_orbit(
    kind: Callable[..., BranchOptions], orbit: Orbit, origin: Study, *where: str | float, **options: Any
) -> BranchOptions:
    """Return the options of a kind of study that starts from an orbit, along a parameter between two values."""
    start = {"period": orbit.period, "start": tuple(orbit.state.tolist()), "method": method_of(orbit, origin)}
    return kind(*where, shown_measure(orbit.system, origin.options), **(start | options))


def method_of(orbit: Orbit, origin: Study) -> Method:
    """Return the method by which an orbit of a study was found."""
    options = origin.options
    found = options.method if isinstance(options, BranchOptions) else None
    return found if found is not None and found.name == orbit.found_by else orbit.method()


_PLANS: dict[type[Action], Callable[[Any, Exploration], _Planned]] = {
    Walk: _walk,
    Switch: _switch,
    Search: _search,
    FollowLocus: _locus,
    Settle: _settle,
    RunUp: _run_up,
}

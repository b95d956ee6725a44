"""From an action to the task that answers it: which study of which system, and what the result is called."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Protocol

from gapwalk.attractors.settled import Settled
from gapwalk.bifurcation.branch import Branch, SpecialPoint
from gapwalk.continuation.parameter_range import check_range
from gapwalk.errors import ModelError
from gapwalk.explorer.action import Action, Compute, FollowLocus, Place, Search, Settle, Switch, Walk
from gapwalk.explorer.follow_ups import LocusFollowUp, SearchFollowUp, SwitchFollowUp
from gapwalk.explorer.page_result import Line
from gapwalk.explorer.task import Task
from gapwalk.model.system import System
from gapwalk.orbit.method import Method, chosen
from gapwalk.orbit.orbit import Orbit
from gapwalk.plot.words import pace_words, parameter_symbol
from gapwalk.studies.file import Study
from gapwalk.studies.map import KINDS
from gapwalk.studies.options import (
    BranchOptions,
    DiagramStudyOptions,
    MapStudyOptions,
    ResponseOptions,
    SecondParameter,
)
from gapwalk.studies.settle.study_options import SettleStudyOptions


class Shown(Protocol):
    """What a plan asks of what is on the page."""

    def motion(self, place: Place) -> Orbit | Settled:
        """The motion at a place."""
        ...

    def special(self, place: Place) -> tuple[Line, SpecialPoint]:
        """The special point at a place, and its branch."""
        ...

    def branches(self, key: str) -> tuple[Branch, ...]:
        """The branches of a result."""
        ...

    def study(self, name: str, values: Mapping[str, float]) -> Study:
        """A study of the file that was opened, with other values."""
        ...

    def base(self) -> Study:
        """The first study of the file that was opened."""
        ...

    def origin(self, place: Place) -> Study:
        """The study of the result at a place."""
        ...


def plan(action: Action, shown: Shown) -> tuple[str, Task]:
    """The title of what an action asks for, and the task without its output.

    Raises
    ------
    ModelError
        If it makes no sense.
    """
    match action:
        case Compute():
            study = shown.study(action.study, action.values)
            title = f"{study.options.kind}{f' {study.name}' if study.name else ''}{_changed(action.values)}"
            return title, Task(study, Path())
        case Walk():
            return _walk(action, shown)
        case Switch():
            return _switch(action, shown)
        case Search():
            return _search(action, shown)
        case FollowLocus():
            return _locus(action, shown)
        case Settle():
            return _settle(action, shown)


def _changed(values: Mapping[str, float]) -> str:
    """The first of the values that are not those of the file, for a title."""
    shown = [f"{name} = {value:.6g}" for name, value in list(values.items())[:3]]
    more = f" and {len(values) - 3} more" if len(values) > 3 else ""
    return f", {', '.join(shown)}{more}" if shown else ""


def known_branches(action: Search, shown: Shown, system: System) -> list[tuple[str, int]]:
    """The branches that a search of a system need not find: those of its results along its parameter, of that system.

    Each by the key of its result and its number there.
    """
    return [
        (key, number)
        for key in action.known
        for number, branch in enumerate(shown.branches(key))
        if branch.parameter == action.parameter and _is_same_system(branch, system)
    ]


def search_system(action: Search, shown: Shown) -> System:
    """The system that is searched."""
    return shown.base().system if action.start is None else shown.motion(action.start).system


def _is_same_system(branch: Branch, system: System) -> bool:
    """Whether a branch belongs to a system, whatever its value of the parameter."""
    own = branch.points[0].orbit.system
    same = system.at({branch.parameter: own[branch.parameter]})
    return own.structure == same.structure and bool((own.values == same.values).all())


def word_of(action: Action) -> str:
    """The word in the name of its result file."""
    return action.do


def orbit_at(place: Place, shown: Shown) -> Orbit:
    """The orbit at a place; a ModelError if the motion there is not periodic."""
    motion = shown.motion(place)
    orbit = motion if isinstance(motion, Orbit) else motion.orbit
    if orbit is None:
        raise ModelError("this motion is not periodic, so there is no branch to walk; choose a point of a branch")
    return orbit


def _walk(action: Walk, shown: Shown) -> tuple[str, Task]:
    orbit, origin = orbit_at(action.start, shown), shown.origin(action.start)
    begin = orbit.system[action.parameter]
    check_range(begin, action.to)
    orbit.system.at({action.parameter: action.to})
    options = ResponseOptions(
        action.parameter,
        begin,
        action.to,
        _measure(origin, orbit.system),
        orbit.period,
        tuple(orbit.state.tolist()),
        method=method_of(orbit, origin),
    )
    symbol = parameter_symbol(action.parameter)
    title = f"period {orbit.period}, {symbol} from {begin:.6g} to {action.to:.6g}"
    return title, Task(_study_of(orbit.system, options, title, origin), Path())


def _switch(action: Switch, shown: Shown) -> tuple[str, Task]:
    line, special = shown.special(action.start)
    parameter, orbit, origin = line.parameter, special.orbit, shown.origin(action.start)
    if not special.kind.ways:
        raise ModelError(
            f"no other branch of periodic motions leaves a {special.kind.value}; choose a flip (PD) or a branch point "
            "(BP)"
        )
    check_range(special.value, (action.low, action.high))
    for bound in (action.low, action.high):
        orbit.system.at({parameter: bound})
    options = DiagramStudyOptions(
        parameter,
        action.low,
        action.high,
        _measure(origin, orbit.system),
        orbit.period * special.kind.times,
        tuple(orbit.state.tolist()),
        method=method_of(orbit, origin),
    )
    title = f"from the {special.kind.value} of {line.name} at {parameter_symbol(parameter)} = {special.value:.6g}"
    return title, Task(_study_of(orbit.system, options, title, origin), Path(), SwitchFollowUp(special))


def _search(action: Search, shown: Shown) -> tuple[str, Task]:
    system, parameter = search_system(action, shown), action.parameter
    for bound in (action.low, action.high):
        system.at({parameter: bound})
    if not action.low < action.high:
        raise ModelError(f"the range of {parameter} is from {action.low:g} to {action.high:g}; it must go up")
    known = tuple(shown.branches(key)[number] for key, number in known_branches(action, shown, system))
    origin = shown.base() if action.start is None else shown.origin(action.start)
    options = _others_options(action, system, origin)
    title = f"others, {parameter_symbol(parameter)} from {action.low:.6g} to {action.high:.6g}"
    return title, Task(_study_of(system, options, title, origin), Path(), SearchFollowUp(known))


def _others_options(action: Search, system: System, origin: Study) -> DiagramStudyOptions:
    """As the diagram searches that it starts from, if it is one."""
    own, measure = origin.options, _measure(origin, system)
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


def _locus(action: FollowLocus, shown: Shown) -> tuple[str, Task]:
    line, special = shown.special(action.start)
    first, second, system = line.parameter, action.second, special.orbit.system
    origin = shown.origin(action.start)
    if special.kind not in KINDS:
        raise ModelError(f"a {special.kind.value} has no locus; choose a fold, a flip, Neimark-Sacker or grazing point")
    if first == second:
        raise ModelError(f"choose a second parameter other than {first}: the plane of a locus has two")
    second_low, second_high = sorted((action.second_low, action.second_high))
    for name, low, high in ((first, action.low, action.high), (second, second_low, second_high)):
        for bound in (low, high):
            system.at({name: bound})
        if not low <= system[name] <= high or low == high:
            raise ModelError(f"the range of {name} is from {low:g} to {high:g}; it must hold {system[name]:.8g}")
    options = MapStudyOptions(
        first,
        action.low,
        action.high,
        _measure(origin, system),
        special.orbit.period,
        tuple(special.orbit.state.tolist()),
        method=locus_method(special.orbit, origin),
        second=SecondParameter(second, second_low, second_high),
        sections=(system[second],),
        kinds=(special.kind,),
    )
    plane = f"{parameter_symbol(first)} and {parameter_symbol(second)}"
    title = f"locus of the {special.kind.value} of {line.name} at {special.value:.6g}, in {plane}"
    return title, Task(_study_of(system, options, title, origin), Path(), LocusFollowUp(special))


def locus_method(orbit: Orbit, origin: Study) -> Method:
    """How a locus is followed from an orbit: as the orbit was found, but for shooting in one segment."""
    return method_of(orbit, origin).for_loci()


def _settle(action: Settle, shown: Shown) -> tuple[str, Task]:
    if action.start is None:
        origin = shown.base()
        system, start = origin.system, "rest"
    else:
        motion, origin = shown.motion(action.start), shown.origin(action.start)
        system, start = motion.system, tuple(motion.state.tolist())
    system = system.at(dict(action.values))
    options = SettleStudyOptions(system.coordinates[0], start)
    title = f"settled at {pace_words(system)}"
    return title, Task(_study_of(system, options, title, origin), Path())


def method_of(orbit: Orbit, origin: Study) -> Method:
    """How to go on from an orbit of a study: as it was found."""
    options = origin.options
    found = options.method if isinstance(options, BranchOptions) else None
    return found if found is not None and found.name == orbit.found_by else orbit.method()


def _measure(origin: Study, system: System) -> str:
    options = origin.options
    measure = options.measure if isinstance(options, BranchOptions) else ""
    return measure or f"half.{system.coordinates[0]}"


def _study_of(system: System, options, title: str, origin: Study) -> Study:
    whole = f"{origin.title.partition(': ')[0]}: {title}" if origin.title else title
    return Study(system, options, whole, origin.text, reduced=origin.reduced)

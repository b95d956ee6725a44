"""From an action to the task that answers it: which study of which system, and what the result is called."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Protocol

from gapwalk.attractor.settled import Settled
from gapwalk.continuation.branch import Kind, SpecialPoint
from gapwalk.continuation.walk import check_range
from gapwalk.errors import ModelError
from gapwalk.explorer.action import Action, Compute, Place, Settle, Switch, Walk
from gapwalk.explorer.entry import Line
from gapwalk.explorer.task import Task
from gapwalk.model.system import System
from gapwalk.orbit.balance import BalancedOrbit
from gapwalk.orbit.balance.options import Balance
from gapwalk.orbit.orbit import Orbit
from gapwalk.orbit.shooting import Shooting
from gapwalk.plot.words import parameter_symbol
from gapwalk.study.file import Study
from gapwalk.study.options import BranchOptions, DiagramStudyOptions, ResponseOptions
from gapwalk.study.settle.study_options import SettleStudyOptions


class Shown(Protocol):
    """What a plan asks of what is on the page."""

    def motion(self, place: Place) -> Orbit | Settled:
        """The motion at a place."""
        ...

    def special(self, place: Place) -> tuple[Line, SpecialPoint]:
        """The special point at a place, and its branch."""
        ...

    def study(self, name: str, values: Mapping[str, float]) -> Study:
        """A study of the file that was opened, with other values."""
        ...

    def base(self) -> Study:
        """The first study of the file that was opened."""
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
            title = f"{study.options.kind}{f' {study.name}' if study.name else ''}"
            return title, Task(study, Path())
        case Walk():
            return _walk(action, shown)
        case Switch():
            return _switch(action, shown)
        case Settle():
            return _settle(action, shown)


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
    orbit = orbit_at(action.start, shown)
    begin = orbit.system[action.parameter]
    check_range(begin, action.to)
    orbit.system.at({action.parameter: action.to})
    options = ResponseOptions(
        action.parameter,
        begin,
        action.to,
        _measure(shown, orbit.system),
        orbit.period,
        tuple(orbit.state.tolist()),
        method=method_of(orbit, shown),
    )
    symbol = parameter_symbol(action.parameter)
    title = f"period {orbit.period}, {symbol} from {begin:.6g} to {action.to:.6g}"
    return title, Task(_study_of(orbit.system, options, title, shown), Path())


def _switch(action: Switch, shown: Shown) -> tuple[str, Task]:
    line, special = shown.special(action.start)
    parameter, orbit = line.parameter, special.orbit
    if special.kind not in (Kind.FLIP, Kind.BRANCH_POINT):
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
        _measure(shown, orbit.system),
        orbit.period * (2 if special.kind is Kind.FLIP else 1),
        tuple(orbit.state.tolist()),
        method=method_of(orbit, shown),
    )
    title = f"from the {special.kind.value} of {line.name} at {parameter_symbol(parameter)} = {special.value:.6g}"
    return title, Task(_study_of(orbit.system, options, title, shown), Path(), special)


def _settle(action: Settle, shown: Shown) -> tuple[str, Task]:
    system, start = shown.base().system, "rest"
    if action.start is not None:
        motion = shown.motion(action.start)
        system, start = motion.system, tuple(motion.state.tolist())
    system = system.at(dict(action.values))
    options = SettleStudyOptions(system.coordinates[0], start)
    title = f"settled at {parameter_symbol('frequency')} = {system.frequency:.6g}"
    return title, Task(_study_of(system, options, title, shown), Path())


def method_of(orbit: Orbit, shown: Shown) -> Shooting | Balance:
    """How to go on from an orbit: as it was found."""
    options = shown.base().options
    if isinstance(orbit, BalancedOrbit):
        return options.method if isinstance(options, BranchOptions) and options.balanced else Balance()
    return options.method if isinstance(options, BranchOptions) and not options.balanced else Shooting()


def _measure(shown: Shown, system: System) -> str:
    options = shown.base().options
    measure = options.measure if isinstance(options, BranchOptions) else ""
    return measure or f"half.{system.coordinates[0]}"


def _study_of(system: System, options, title: str, shown: Shown) -> Study:
    base = shown.base()
    return Study(system, options, f"{base.title}: {title}" if base.title else title, base.text, reduced=base.reduced)

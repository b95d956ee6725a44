"""Self-excitation over a range of a parameter: all equilibria, and the periodic motions from their Hopf points."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gapwalk.bifurcation.branch import Branch
from gapwalk.bifurcation.special_point import SpecialPoint
from gapwalk.bifurcation.special_point_kind import Kind
from gapwalk.continuation.step_size import WalkOptions
from gapwalk.continuation.walk import EndReason
from gapwalk.errors import ConvergenceError, NumericalError
from gapwalk.flow.flow import PERIOD
from gapwalk.free.cycle_walk import follow_self_excited
from gapwalk.free.rest_record import RestEvent, Rests
from gapwalk.free.rest_walk import follow_rest
from gapwalk.free.undriven import without_excitation
from gapwalk.model.equilibria import find_equilibria
from gapwalk.model.system import System, check_system
from gapwalk.notebook import Shown
from gapwalk.summary import Rows, SummaryParts, remarks, row_of, rows_of, summarizes

_SAME = 1e-6  # relative difference of positions, or of frequencies, within which two are the same
_NEAR = 0.02  # share of the range within which a motion that shrinks to an equilibrium ends at a Hopf point


@dataclass(frozen=True, eq=False)
class SelfExcited(Shown):
    """Equilibria over a parameter, and the periodic motions without excitation that begin at their Hopf points.

    Examples
    --------
    >>> found = gw.free.SelfExcited("damper.mu", (-0.5, 1.0), (rests,), (cycle,))
    >>> len(found.hopf_points), found.complete
    (1, True)
    """

    parameter: str  #: Name of the parameter.
    within: tuple[float, float]  #: Its range.
    rests: tuple[Rests, ...]  #: The equilibria.
    #: Branches of periodic motions, from Hopf points and their centres; the frequency of each motion is that of its
    #: system.
    cycles: tuple[Branch, ...] = ()
    failures: tuple[str, ...] = ()  #: What was not found, with the reasons, in sentences.
    complete: bool = True  #: True if all were followed.

    @property
    def system(self) -> System:
        """The system without excitation."""
        return self.rests[0].system

    @property
    def hopf_points(self) -> tuple[RestEvent, ...]:
        """The Hopf points of all equilibria."""
        return tuple(event for line in self.rests for event in line.hopf_points)

    @property
    def beginnings(self) -> tuple[RestEvent | SpecialPoint, ...]:
        """Where branches of motions begin: the Hopf points, then branch points on families at one value of it."""
        centres = [cycle for cycle in self.cycles if cycle.ends[-1].reason is EndReason.CENTRE]
        points = [each for cycle in centres for each in cycle.special_points if each.kind is Kind.BRANCH_POINT]
        return (*self.hopf_points, *points)

    @property
    def notes(self) -> tuple[str, ...]:
        """Remarks: where small motions begin to grow although there is no Hopf point."""
        found = []
        for line in self.rests:
            for event in line.events:
                if event.contact and event.after > event.before + 1:
                    found.append(
                        f"at {self.parameter} = {event.value:.6g} {event.words}, and small motions grow from there on "
                        "at once: find the motion on which they settle with gw.free.find_self_excited"
                    )
        return tuple(found)

    @summarizes
    def summary(self, *, notes: bool = True) -> SummaryParts:
        """Return equilibria and motions in words.

        Parameters
        ----------
        notes
            True to include notes and failures.
        """
        for line in self.rests:
            yield from line.summary()
        for number, cycle in enumerate(self.cycles, start=1):
            frequencies = [point.orbit.system.frequency for point in cycle.points]
            yield f"motions {number}, frequency {frequencies[0]:.6g} to {frequencies[-1]:.6g}:"
            yield from cycle.summary()
        if notes:
            yield from remarks(self.notes, self.failures)

    def tables(self) -> Mapping[str, Callable[[], Rows]]:
        """Return the tables of motions, their special points, equilibria and their events, with their numbers."""
        return {
            "motions": lambda: rows_of(self._motions()),
            "special": lambda: rows_of(self._rows(self.cycles, lambda cycle: cycle.special_points)),
            "equilibria": lambda: rows_of(self._equilibria()),
            "events": lambda: rows_of(self._rows(self.rests, lambda line: line.events)),
        }

    def _motions(self) -> Iterator[dict[str, Any]]:
        for number, cycle in enumerate(self.cycles, start=1):
            for point in cycle.points:
                system = point.orbit.system
                own: dict[str, Any] = {
                    "frequency": system[system.structure.pace],
                    "period": PERIOD * point.orbit.period / system.frequency,
                }
                own |= {f"half.{name}": point.measure(f"half.{name}") for name in system.coordinates}
                yield {"branch": number, **row_of(point), **own}

    def _equilibria(self) -> Iterator[dict[str, Any]]:
        for number, line in enumerate(self.rests, start=1):
            for point in line.points:
                places = dict(zip(line.system.coordinates, point.position.tolist(), strict=True))
                yield {"branch": number, **row_of(point), **places}

    @staticmethod
    def _rows(lines: Sequence[Any], records: Callable[[Any], Sequence[Any]]) -> Iterator[dict[str, Any]]:
        for number, line in enumerate(lines, start=1):
            yield from ({"branch": number, **row_of(each)} for each in records(line))

    def __repr__(self) -> str:
        return (
            f"SelfExcited({self.parameter}, {len(self.rests)} branches of equilibria, {len(self.hopf_points)} Hopf "
            f"points, {len(self.cycles)} branches of motions)"
        )


def self_excited(
    system: System,
    parameter: str,
    to: float | tuple[float, float],
    *,
    start: Sequence[float] | NDArray[np.float64] | None = None,
    walk: WalkOptions | None = None,
    report: Callable[[Any], None] | None = None,
) -> SelfExcited:
    """Follow the equilibria of a system along a parameter, and the self-excited motions from their Hopf points.

    Parameters
    ----------
    system
        The system; its excitation is left out.
    parameter
        Name of the parameter.
    to
        The range, as two values that include that of the system; or its other end.
    start
        Positions near an equilibrium, shape (n,); by default all that `find_equilibria` finds.
    walk
        Options of the walks.
    report
        Called with each equilibrium and each point of a branch of motions.

    Returns
    -------
    SelfExcited
        Equilibria and motions. What could not be followed is in its `failures`.

    Raises
    ------
    ModelError
        For friction on a base at rest, rigid stops, or the frequency as parameter.
    ConvergenceError
        If there is no equilibrium at the start.

    Examples
    --------
    >>> import gapwalk as gw
    >>> damper = gw.force("damper", {"x": 1.0}, "(x*x - mu)*v", mu=-0.5)
    >>> found = gw.free.self_excited(gw.System(["x"], [1.0], contacts=[damper]), "damper.mu", 1.0)
    >>> found
    SelfExcited(damper.mu, 1 branches of equilibria, 1 Hopf points, 1 branches of motions)
    """
    check_system(system, "self_excited")
    within = range_of(system, parameter, to)
    rests = list[Rests]()
    for positions in starts(system) if start is None else [np.asarray(start, dtype=float)]:
        if not is_known(rests, system[parameter], positions):
            rests.append(follow_rest(system, parameter, within, start=positions, walk=walk, report=report))
    found = SelfExcited(parameter, within, tuple(rests))
    done = 0
    while done < len(found.beginnings):
        found, done = with_cycle(found, found.beginnings[done], walk, report), done + 1
    return found


def range_of(system: System, parameter: str, to: float | tuple[float, float]) -> tuple[float, float]:
    """Return the range of a parameter from the value of a system to another one, or between two, in order."""
    low, high = sorted(to if isinstance(to, tuple) else (system[parameter], to))
    return float(low), float(high)


def starts(system: System) -> list[NDArray[np.float64]]:
    """Return the positions of all equilibria that are found; raise a ConvergenceError if there are none."""
    found = [each.position for each in find_equilibria(without_excitation(system)).equilibria]
    if not found:
        raise ConvergenceError("the system has no equilibrium that was found; give positions near one, start = [...]")
    return found


def is_known(rests: Sequence[Rests], value: float, positions: NDArray[np.float64]) -> bool:
    """Return True if an equilibrium at a value of the parameter lies on a known branch."""
    for line in rests:
        for first, second in zip(line.points[:-1], line.points[1:], strict=True):
            low, high = sorted((first.value, second.value))
            if not low <= value <= high:
                continue
            share = (value - first.value) / (second.value - first.value or 1.0)
            off = np.abs(first.position + share * (second.position - first.position) - positions).max()
            apart = np.abs(second.position - first.position).max()
            if off <= 0.1 * apart + _SAME * max(1e-300, np.abs(positions).max()):
                return True
    return False


def is_reached(found: SelfExcited, hopf: RestEvent) -> bool:
    """Return True if a branch of motions has come from another Hopf point to this one, and ended there."""
    low, high = found.within
    for cycle in found.cycles:
        last = cycle.points[-1]
        if cycle.ends[-1].reason is not EndReason.AT_REST or abs(last.value - hopf.value) > _NEAR * (high - low):
            continue
        if abs(last.orbit.system.frequency / hopf.frequency - 1.0) < _NEAR:
            return True
    return False


def with_cycle(
    found: SelfExcited,
    start: RestEvent | SpecialPoint,
    walk: WalkOptions | None = None,
    report: Callable[[Any], None] | None = None,
) -> SelfExcited:
    """Return what was found with the branch of motions from a beginning, or with the reason why there is none."""
    if isinstance(start, RestEvent) and is_reached(found, start):
        return found
    told = None if report is None else lambda point, special: report(point)
    try:
        cycle = follow_self_excited(start, found.system, found.parameter, found.within, walk=walk, report=told)
    except NumericalError as error:
        name = "Hopf point" if isinstance(start, RestEvent) else start.kind_words
        return replace(found, failures=(*found.failures, f"from the {name} at {start.value:.6g}: {error}"))
    failures = [f"motions {len(found.cycles) + 1}: {end}" for end in cycle.ends if end.reason.is_failure]
    return replace(found, cycles=(*found.cycles, cycle), failures=(*found.failures, *failures))

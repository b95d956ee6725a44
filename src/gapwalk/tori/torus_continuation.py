"""Continuation of tori along a parameter, by pseudo-arclength in the curve, its rotation number and the parameter.

Method: docs/numerics/tori.md
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from gapwalk.bifurcation.special_point import SpecialPoint
from gapwalk.continuation.corrector import check_range
from gapwalk.continuation.curve import joined
from gapwalk.continuation.curve_points import Tracing
from gapwalk.continuation.walk import WalkOptions
from gapwalk.errors import ModelError
from gapwalk.model.system import System
from gapwalk.notebook import shows_progress
from gapwalk.tori.torus import Torus
from gapwalk.tori.torus_equation import TorusOptions
from gapwalk.tori.torus_family import TorusEvent, TorusFamily, TorusPoint
from gapwalk.tori.torus_start import Second, TorusStart, starts_at
from gapwalk.tori.torus_tracer import Step, TorusTracer

STEPS = WalkOptions(initial_step=0.01, smallest_step=1e-5, largest_step=0.05, max_points=1000)
"""Default options of the steps: a motion that changes by its own size, or all of the range, counts as 1."""

TorusReport = Callable[[TorusPoint, list[TorusEvent]], None]
"""Function called with each new torus and the events before it."""


@shows_progress(lambda count, point, events: f"{count} tori, at {point.value:.6g}")
def follow_tori(
    start: Torus | SpecialPoint | TorusEvent,
    parameter: str,
    to: float | tuple[float, float],
    *,
    second: tuple[str, tuple[float, float]] | None = None,
    walk: WalkOptions | None = None,
    options: TorusOptions | None = None,
    report: TorusReport | None = None,
) -> TorusFamily:
    """Follow a family of tori along a parameter, stable or unstable, from where it begins or from one of them.

    Along it, folds, changes of stability and resonances are located; at resonances the locked periodic motions are
    looked for. The rotation number varies freely, so that narrow resonances are stepped over; or it is kept, and a
    second parameter varies with the first one.

    Parameters
    ----------
    start
        A Neimark-Sacker point, at which tori begin; a torus, from `gw.tori.find_torus`; or a torus doubling among the
        events of a family, at which tori of twice as many curves begin.
    parameter
        Name of the parameter, such as ``"frequency"``.
    to
        The value at which to stop; or two values, between which a family is followed, from a torus in both directions.
    second
        Name and range of a second parameter that varies so that the rotation number of the first torus stays.
    walk
        Options of the steps, in units of the size of the motion and of the range.
    options
        Accuracy, and number of samples of a curve.
    report
        Called with each new torus and the events before it.

    Returns
    -------
    TorusFamily
        The tori, events and both ends, in one direction.

    Raises
    ------
    ModelError
        For a start at which no tori begin, a range that does not contain it, a system with friction or rigid stops, or
        a free motion.
    ConvergenceError
        If no torus is found next to a Neimark-Sacker point; the message says whether it is near a strong resonance.
    Interrupted
        After Ctrl-C; its `found` is the family so far.

    Examples
    --------
    >>> import gapwalk as gw
    >>> torus = gw.tori.find_torus(gw.settle(gw.paper.case("13"), frequency=0.672))
    >>> family = gw.tori.follow_tori(torus, "frequency", (0.671, 0.673))
    >>> family.parameter
    'frequency'
    """
    options, walk = options or TorusOptions(), walk or STEPS
    system = _system_of(start)
    if parameter not in system.structure.names:
        system.structure.place(parameter)  # raises the error that names near parameters
    within = check_range(system[parameter], to).along(parameter, system)
    other = None if second is None else _second(second, parameter, system)
    beginnings = starts_at(start, parameter, within, options, walk, isinstance(to, tuple), other)

    def record(tracing: Tracing[TorusStart, Any, Step]) -> TorusFamily:
        name = beginnings[0].second.name if beginnings[0].second else ""
        turned = joined(tracing, beginnings[0].end, lambda point: replace(point, arclength=-point.arclength), _turned)
        return TorusFamily(parameter, *turned, name)

    return Tracing(beginnings, lambda start, _: TorusTracer(start, walk, options)).to_end(record, report)


def _system_of(start: Torus | SpecialPoint | TorusEvent) -> System:
    if isinstance(start, SpecialPoint):
        return start.orbit.system
    if isinstance(start, TorusEvent):
        if start.torus is None:
            raise ModelError(f"no tori begin at an event of the kind {start.kind.value!r}; they do at torus doublings")
        return start.torus.system
    return start.system


def _second(given: tuple[str, tuple[float, float]], parameter: str, system: System) -> Second:
    name, to = given
    system.structure.place(name)
    if name == parameter:
        raise ModelError(f"the second parameter is {name!r}, which is the first one; name another")
    return Second(name, check_range(system[name], to).along(name, system))


def _turned(event: TorusEvent) -> TorusEvent:
    return replace(event, before=event.after, after=event.before)

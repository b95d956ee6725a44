"""Self-excited motions along a parameter: equilibria, their Hopf points, and the periodic motions that begin there.

Method: docs/numerics/self-excited.md
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import cast

from gapwalk.bifurcation.branch import Branch
from gapwalk.bifurcation.branch_start import BranchStart, directions, start_branch, switch
from gapwalk.bifurcation.branch_tracer import BranchTracer
from gapwalk.bifurcation.follow import join
from gapwalk.bifurcation.special_point import SpecialPoint
from gapwalk.continuation.both_directions import Tracing
from gapwalk.continuation.point_on_branch import BranchPoint
from gapwalk.continuation.step_size import WalkOptions
from gapwalk.continuation.walk import End, EndReason
from gapwalk.continuation.walk_scales import check_range
from gapwalk.errors import Interrupted, ModelError, NumericalError
from gapwalk.flow.forces import accelerations
from gapwalk.free.cycle_start import at_hopf
from gapwalk.free.free_shooting import FreeOrbit, FreeShooting, check_orbit
from gapwalk.free.rest_record import RestEvent, RestEventKind
from gapwalk.free.undriven import without_excitation
from gapwalk.model.coefficients import coefficients_of, layout_of
from gapwalk.model.system import System
from gapwalk.notebook import shows_progress

_OWN = 1e-3  # share of the range from which the size of a value of the parameter is a unit of it
_FEW, _MANY = 5, 200  # motions at one value of the parameter after which it is known to stay, and the walk ends
_ONE = 1e-10  # change of the parameter over them, as a share of the range, that is none but for rounding
_SMALL = 0.2  # amplitude, as a share of the largest one of a branch, below which a turned motion has shrunk to a rest


@shows_progress(lambda count, point, special: f"{count} motions, at {point.value:.6g}")
def follow_self_excited(
    start: RestEvent | FreeOrbit | SpecialPoint,
    system: System,
    parameter: str,
    to: float | tuple[float, float],
    *,
    walk: WalkOptions | None = None,
    report: Callable[[BranchPoint, list[SpecialPoint]], None] | None = None,
) -> Branch:
    """Follow periodic motions without excitation along a parameter, from a Hopf point or from one of them.

    Their frequency is an unknown. Amplitude, stability and special points are those of any branch; a contact that is
    first touched is a grazing point.

    Parameters
    ----------
    start
        A Hopf point of equilibria, from `follow_rest`; a motion, from `find_self_excited`; or a flip or branch point of
        such motions, for the branch that begins there.
    system
        The system; its excitation is left out.
    parameter
        Name of the parameter.
    to
        The range, as two values; from a motion also the value at which to stop.
    walk
        Options of the walk.
    report
        Called with each new point and the special points before it.

    Returns
    -------
    Branch
        Its points, special points and ends. It ends where the motion shrinks to an equilibrium, too; and after 200
        motions if all exist at one value of the parameter, as about a centre. Other motions begin at its branch points.

    Raises
    ------
    ModelError
        For a start of another kind, or the frequency as parameter.
    NumericalError
        If the walk cannot begin.
    Interrupted
        After Ctrl-C; its `found` is the branch so far.

    Examples
    --------
    >>> import gapwalk as gw
    >>> damper = gw.force("damper", {"x": 1.0}, "(x*x - mu)*v", mu=-0.5)
    >>> oscillator = gw.System(["x"], [1.0], contacts=[damper])
    >>> hopf = gw.free.follow_rest(oscillator, "damper.mu", 0.5).hopf_points[0]
    >>> line = gw.free.follow_self_excited(hopf, oscillator, "damper.mu", (-1.0, 1.0))
    >>> round(6.283185307179586 / line.points[-1].orbit.system.frequency, 9)  # the period at mu = 1
    6.663286859
    """
    beginnings = _beginnings(start, without_excitation(system), parameter, to)
    tracing: Tracing = Tracing(beginnings, lambda beginning, state: BranchTracer(beginning, walk, state))
    try:
        for point, special in tracing:
            tracer = tracing.traces[-1]
            if _has_turned(tracer, tracing.steps[-1]):
                _end_at_rest(tracer, tracing.steps[-1])
                continue
            if len(tracing.steps[-1]) in (_FEW, _MANY) and _is_level(tracer, tracing.steps[-1]):
                tracing.steps[-1][:] = [(each, [s for s in had if not s.turns]) for each, had in tracing.steps[-1]]
                tracer.stay_level()
                if len(tracing.steps[-1]) == _MANY:
                    tracer.walk.finish(point, End(EndReason.CENTRE, point.value))
            if tracer.is_level:  # how far its points are from the one value is an error of theirs
                special[:] = [
                    replace(s, uncertainty=s.uncertainty + abs(s.value - tracer.first.value)) for s in special
                ]
            if report is not None:
                report(point, special)
    except KeyboardInterrupt:
        if not tracing.traces:
            raise
        raise Interrupted(join(tracing.traces, tracing.steps)) from None
    return join(tracing.traces, tracing.steps)


def _beginnings(start: object, system: System, parameter: str, to: float | tuple[float, float]) -> list[BranchStart]:
    if isinstance(start, RestEvent):
        if start.kind is not RestEventKind.HOPF:
            raise ModelError(f"periodic motions begin at a Hopf point, and this is one where {start.words}")
        if isinstance(to, int | float):
            raise ModelError(
                f"to is {to}; motions from a Hopf point may exist on both sides of it: write a range, such as "
                f"to = ({min(to, start.value):g}, {max(to, start.value):g})"
            )
        within = check_range(start.value, to).along(parameter, system)
        own = abs(start.value)  # where it is small, it is no unit of the parameter
        within = replace(within, natural=own if own > _OWN * within.width else within.width)
        return [at_hopf(system, parameter, start, within)]
    orbit = start.orbit if isinstance(start, SpecialPoint) else start
    check_orbit(orbit)
    assert isinstance(orbit, FreeOrbit)
    method, value = FreeShooting(orbit.coordinate), orbit.system[parameter]
    if isinstance(start, SpecialPoint):
        within = check_range(value, to)
        beginnings = switch(start, parameter, (within.low, within.high), method)
        if not beginnings:
            raise NumericalError("no branch begins at this point between these values; choose a wider range")
        return beginnings
    return [start_branch(orbit, parameter, to, way, method) for way in directions(value, to)]


def _has_turned(tracer: BranchTracer, steps: Sequence[tuple[BranchPoint, list[SpecialPoint]]]) -> bool:
    """Return True if the coordinate at rest at the start of the period went from its largest to its smallest value.

    Then the motion has shrunk to an equilibrium in the last step, and grows again with the opposite phase.
    """
    last, point = (steps[-2][0] if len(steps) > 1 else tracer.first), steps[-1][0]
    if tracer.beginning.singular and last is tracer.first:
        return False
    if bend(_cycle(last)) * bend(_cycle(point)) >= 0.0:
        return False
    sizes = [swing(_cycle(each)) for each, _ in steps]
    return sizes[-1] < _SMALL * max(sizes) or len(sizes) < 2


def _is_level(tracer: BranchTracer, steps: Sequence[tuple[BranchPoint, list[SpecialPoint]]]) -> bool:
    """Return True if all motions since a Hopf point exist at one value of the parameter, as about a centre."""
    values = [tracer.first.value, *(each.value for each, _ in steps)]
    return tracer.beginning.singular and max(values) - min(values) <= _ONE * tracer.beginning.within.width


def _end_at_rest(tracer: BranchTracer, steps: list[tuple[BranchPoint, list[SpecialPoint]]]) -> None:
    """End a branch before its last step, in which the motion has shrunk to an equilibrium."""
    turned, _ = steps.pop()
    last = steps[-1][0] if steps else tracer.first
    # amplitudes with their signs pass 0 linearly, and the parameter has its vertex there
    sizes = swing(_cycle(last)), swing(_cycle(turned))
    change = sizes[1] ** 2 - sizes[0] ** 2
    value = (last.value * sizes[1] ** 2 - turned.value * sizes[0] ** 2) / change if change else last.value
    name = tracer.beginning.equation.parameter
    tracer.walk.finish(last, End(EndReason.AT_REST, last.value, f"near {name} = {value:.6g}"))


def _cycle(point: BranchPoint) -> FreeOrbit:
    return cast(FreeOrbit, point.orbit)


def bend(orbit: FreeOrbit) -> float:
    """Return the acceleration at theta = 0 of the coordinate that is at rest there."""
    n, layout = orbit.system.size, layout_of(orbit.system.structure)
    found = accelerations(layout, coefficients_of(orbit.system), 0.0, orbit.state[:n], orbit.state[n : 2 * n])
    return float(found[orbit.system.coordinates.index(orbit.coordinate)])


def swing(orbit: FreeOrbit) -> float:
    """Return half the peak to peak of the coordinate that is at rest at theta = 0."""
    place = orbit.system.coordinates.index(orbit.coordinate)
    return 0.5 * float(orbit.extremes[place, 0] - orbit.extremes[place, 1])

"""Where a locus can begin: a special point in the plane of two parameters, heading one way."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from gapwalk.bifurcation.grazing import describe_switch
from gapwalk.bifurcation.locus.curve import onto_curve
from gapwalk.bifurcation.locus.equation import MultiplierEquation
from gapwalk.bifurcation.locus.plane import OrbitPlane
from gapwalk.bifurcation.locus.touch import MARGIN, TouchEquation
from gapwalk.continuation.branch import Kind, SpecialPoint
from gapwalk.continuation.corrector import Corrector
from gapwalk.continuation.point import BranchPoint
from gapwalk.continuation.walk import Range, powers_of_two, state_scales
from gapwalk.errors import ConvergenceError, ModelError
from gapwalk.motion.flow import PERIOD
from gapwalk.motion.motion import switch_names
from gapwalk.orbit.equation import Method
from gapwalk.orbit.shooting import Shooting

Ranges = tuple[tuple[float, float], tuple[float, float]]
"""The ranges of both parameters."""

_FAR = 1e-3  # scaled distance from the special point beyond which the corrected start is another one


@dataclass(frozen=True)
class LocusDeparture:
    """A point and a direction from which a locus can be walked.

    Attributes
    ----------
    kind
        What happens on the locus.
    corrector
        Corrects onto the locus; it holds the equation and the scales.
    first
        The point; its tangent gives the direction.
    within
        Ranges of both parameters.
    contact
        On a grazing locus the contact, stage and side that grazes; otherwise empty.
    """

    kind: Kind
    corrector: Corrector
    first: BranchPoint
    within: tuple[Range, Range]
    contact: str = ""

    @property
    def equation(self) -> MultiplierEquation | TouchEquation:
        """The equation whose solutions form the locus."""
        equation = self.corrector.equation
        assert isinstance(equation, MultiplierEquation | TouchEquation)
        return equation

    @property
    def plane(self) -> OrbitPlane:
        """The orbits among which the locus lies."""
        return self.equation.plane


def depart_locus(
    special: SpecialPoint, first: str, second: str, to: Ranges, method: Method | None = None
) -> list[LocusDeparture]:
    """Leave a special point along its locus, in both directions: towards smaller `first`, then towards larger.

    Raises
    ------
    ModelError
        If its kind has no locus, or for parameters or ranges that make no sense.
    ConvergenceError
        If the point is none, to the tolerance of the method.
    """
    shooting = _shooting(method)
    within = _checked(special, first, second, to)
    plane = OrbitPlane(special.orbit.system, (first, second), special.orbit.period)
    if special.kind is Kind.GRAZING:
        corrector, start = _touch_corrector(plane, special, within, shooting)
    else:
        corrector, start = _multiplier_corrector(plane, special, within, shooting)
    correction, tangent = onto_curve(corrector, start)
    if correction is None or correction.distance > _FAR:
        raise ConvergenceError(f"the start is no {special.kind.value} at {_place(special, (first, second))}")
    held = corrector.at_value(correction.x, special.orbit.system[second])
    if held is not None and held.distance <= _FAR:  # the same point, with the second parameter exact: it may be a bound
        correction = held
    if tangent[-2] < 0.0 or (tangent[-2] == 0.0 and tangent[-1] < 0.0):
        tangent = -tangent
    there = corrector.point(correction, tangent, 0.0)
    back = replace(there, tangent=-there.tangent, determinant=-there.determinant, memo={})
    return [LocusDeparture(special.kind, corrector, point, within, special.contact) for point in (back, there)]


def _shooting(method: Method | None) -> Shooting:
    """The way to pose a locus: by shooting in one segment."""
    if method is None:
        return Shooting()
    if not isinstance(method, Shooting):
        raise ModelError(
            f"the method is {method.name}, but loci are followed by shooting: round the corners that they have where a "
            "contact grazes, only exact motions show the way; leave method out (the point to start from may have been "
            "found by harmonic balance)"
        )
    if method.segments > 1:
        raise ModelError(f"segments is {method.segments}; a locus is followed with one, write Shooting(segments=1)")
    return method


def _touch_corrector(plane: OrbitPlane, special: SpecialPoint, within: tuple[Range, Range], shooting: Shooting):
    """The corrector onto the locus of a grazing point, and the start in its variables."""
    switch = next(
        k for k in range(len(switch_names(plane.system))) if describe_switch(special.orbit, k) == special.contact
    )
    states = state_scales(special.orbit)
    margin = MARGIN * float(states[0])
    tolerance = min(shooting.tolerance, 0.1 * margin)
    equation = TouchEquation(plane, switch, 0.0, tolerance)
    value = special.orbit.system[plane.names[1]]
    unknowns = equation.unknowns(special.orbit)
    equation = replace(equation, depth=-margin if equation.is_highest(unknowns, value) else margin)
    scales = _scales(states, [PERIOD], within)
    return Corrector(equation, scales), np.append(unknowns, value) / scales


def _multiplier_corrector(plane: OrbitPlane, special: SpecialPoint, within: tuple[Range, Range], shooting: Shooting):
    states = state_scales(special.orbit)
    equation = MultiplierEquation(plane, special.kind, powers_of_two(states), shooting.tolerance)
    scales = _scales(states, [], within)
    start = np.append(equation.unknowns(special.orbit), special.orbit.system[plane.names[1]])
    return Corrector(equation, scales), start / scales


def _scales(states: NDArray[np.float64], others: Sequence[float], within: tuple[Range, Range]) -> NDArray[np.float64]:
    widths = [each.high - each.low for each in within]
    return powers_of_two(np.concatenate((states, others, widths)))


def _checked(special: SpecialPoint, first: str, second: str, to: Ranges) -> tuple[Range, Range]:
    """The ranges, if the request makes sense."""
    system = special.orbit.system
    if special.kind is Kind.BRANCH_POINT:
        raise ModelError(
            "a branch point has no locus in two parameters: it exists by a symmetry, and vanishes or persists with it; "
            "follow a fold, a flip, a neimark-sacker or a grazing point"
        )
    places = [system.structure.place(name) for name in (first, second)]
    if places[0] == places[1]:
        raise ModelError(f"both parameters are {first!r}; a locus is a curve in the plane of two different ones")
    try:
        pairs = [(float(low), float(high)) for low, high in to]
    except (TypeError, ValueError):
        pairs = []
    if len(pairs) != 2:
        raise ModelError(f"to is {to!r}; write a range for each parameter, such as ((0.2, 0.9), (0.0, 0.5))")
    ranges = []
    for name, (low, high) in zip((first, second), pairs, strict=True):
        if not low < high:
            raise ModelError(
                f"the range of {name} is ({low:.10g}, {high:.10g}); its first value must be the smaller one"
            )
        if not low <= system[name] <= high:
            raise ModelError(
                f"the locus starts at {name} = {system[name]:.10g}, outside the range from {low:.10g} to {high:.10g}"
            )
        ranges.append(Range(low, high))
    for corner in product(*pairs):
        system.at(dict(zip((first, second), corner, strict=True)))
    return ranges[0], ranges[1]


def _place(special: SpecialPoint, names: tuple[str, str]) -> str:
    return ", ".join(f"{name} = {special.orbit.system[name]:.10g}" for name in names)

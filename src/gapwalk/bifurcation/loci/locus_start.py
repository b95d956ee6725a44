"""Beginning of a locus: a special point in the plane of two parameters, and a direction."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import singledispatch
from itertools import product
from typing import cast

import numpy as np
from numpy.typing import NDArray

from gapwalk.bifurcation.kinds.sliding import Sliding
from gapwalk.bifurcation.loci.locus_equations import (
    MARGIN,
    GrazingEquation,
    LocusEquation,
    MultiplierEquation,
    onto_curve,
)
from gapwalk.bifurcation.loci.orbit_plane import OrbitPlane, ShotPlane
from gapwalk.bifurcation.loci.sliding_equation import SlidingEquation, posed
from gapwalk.bifurcation.special_point import SpecialPoint, describe_switch
from gapwalk.bifurcation.special_point_kind import Kind
from gapwalk.continuation.corrector import Corrector
from gapwalk.continuation.point_on_branch import BranchPoint
from gapwalk.continuation.walk_scales import Range, powers_of_two
from gapwalk.errors import ConvergenceError, ModelError
from gapwalk.flow.flow import PERIOD
from gapwalk.flow.motion import switch_names
from gapwalk.orbit.harmonic_balance import Balance
from gapwalk.orbit.method import Method, chosen
from gapwalk.orbit.orbit import Orbit
from gapwalk.orbit.shooting import Shooting

AnyEquation = MultiplierEquation | GrazingEquation | SlidingEquation
"""Equation of a locus, which belongs to the kind of its special point."""

Ranges = tuple[tuple[float, float], tuple[float, float]]
"""Ranges of both parameters."""

_FAR = 1e-3  # scaled distance from the special point beyond which the corrected start is another point
_LITTLE = 0.01  # share of the allowed error below which more harmonics would not help
_COARSE = 1e-2  # largest scaled distance if the two are resolved with different numbers of harmonics


@dataclass(frozen=True)
class LocusStart:
    """Point and direction from which a locus can be walked."""

    kind: Kind  #: Kind of the locus.
    corrector: Corrector  #: Corrector for the locus; it holds the equation and the scales.
    first: BranchPoint  #: The point; its tangent gives the direction.
    within: tuple[Range, Range]  #: Ranges of both parameters.
    contact: str = ""  #: On a grazing locus the contact, stage and side that grazes; otherwise empty.

    @property
    def equation(self) -> MultiplierEquation | GrazingEquation:
        """Equation whose solutions form the locus."""
        return cast("MultiplierEquation | GrazingEquation", self.corrector.equation)

    @property
    def plane(self) -> OrbitPlane:
        """Plane of two parameters, with its orbits, in which the locus is followed."""
        return self.equation.plane


def start_locus(
    special: SpecialPoint, first: str, second: str, to: Ranges, method: Method | None = None
) -> list[LocusStart]:
    """Begin the locus of a special point in both directions: towards smaller `first`, then towards larger."""
    within = _checked(special, first, second, to)
    corrector, there = _started(plane_of(chosen(method), special.orbit, (first, second)), special, within)
    back = replace(there, tangent=-there.tangent, determinant=-there.determinant, memo={})
    return [LocusStart(special.kind, corrector, point, within, special.contact) for point in (back, there)]


def refined(beginning: LocusStart) -> LocusStart | None:
    """Return the beginning with the next finer resolution of its orbits; None if there is none."""
    equation, scales = beginning.equation, beginning.corrector.scales
    plane = equation.plane.finer()
    if plane is None:
        return None
    # a finer resolution adds unknowns of the same kind
    size = len(plane.unknowns(beginning.first.orbit))
    scales = np.concatenate((np.full(size, scales[0]), scales[-1 - equation.others :]))
    corrector = Corrector(equation.on(plane, scales), scales)
    first = lift(beginning.first, corrector)
    return None if first is None else replace(beginning, corrector=corrector, first=first)


def lift(point: BranchPoint, corrector: Corrector) -> BranchPoint | None:
    """Return a point of a locus, posed by a finer equation of the same locus; None if Newton's method fails."""
    equation = cast("LocusEquation", corrector.equation)
    x = np.append(equation.unknowns(point.orbit), point.value) / corrector.scales
    if isinstance(equation, GrazingEquation):
        x[-3] = point.x[-3]  # the orbit itself does not determine which turning point grazes
    correction, tangent = onto_curve(corrector, x)
    if correction is None or correction.distance > _COARSE:
        return None
    # the angle at which a contact touches, if any, and both parameters
    others = slice(-1 - equation.others, None)
    way = float(tangent[others] @ point.tangent[others])
    return corrector.point(correction, tangent if way > 0.0 else -tangent, point.arclength)


def _started(plane: OrbitPlane, special: SpecialPoint, within: tuple[Range, Range]) -> tuple[Corrector, BranchPoint]:
    """Return the corrector for the locus of a special point, refined as necessary, and its first point."""
    names, value = plane.names, special.orbit.system[plane.names[1]]
    corrector, start = _posed(plane, special, within)
    equation, x, finer = corrector.equation, start * corrector.scales, plane.finer()
    orbit = equation.orbit(x[:-1], float(x[-1]), equation.evaluate(x[:-1], float(x[-1])))
    inaccuracy = plane.inaccuracy(orbit)
    if inaccuracy and finer is not None:
        return _started(finer, special, within)
    correction, tangent = onto_curve(corrector, start)
    if correction is None or correction.distance > (_FAR if isinstance(plane, ShotPlane) else _COARSE):
        if finer is not None and plane.inaccuracy(orbit, _LITTLE):
            return _started(finer, special, within)
        place = ", ".join(f"{name} = {special.orbit.system[name]:.10g}" for name in names)
        raise ConvergenceError(inaccuracy or f"the start is not a {special.kind.value} at {place}")
    held = corrector.at_value(correction.x, value)
    if held is not None and held.distance <= _FAR:  # the same point at the exact second parameter: it may be a limit
        correction = held
    if tangent[-2] < 0.0 or (tangent[-2] == 0.0 and tangent[-1] < 0.0):
        tangent = -tangent
    there = corrector.point(correction, tangent, 0.0)
    inaccuracy = plane.inaccuracy(there.orbit)
    if not inaccuracy:
        return corrector, there
    if finer is None:
        raise ConvergenceError(inaccuracy)
    return _started(finer, special, within)


@singledispatch
def plane_of(method: Method, orbit: Orbit, names: tuple[str, str]) -> OrbitPlane:
    """Return the plane of orbits of two parameters that contains an orbit, with the discretisation of a method."""
    raise ModelError(f"no locus is followed by the method {method.name}; write Shooting() or Balance()")


@plane_of.register(Shooting)
def _shot(method: Shooting, orbit: Orbit, names: tuple[str, str]) -> OrbitPlane:
    if method.segments > 1:
        raise ModelError(f"segments is {method.segments}; a locus is followed with one, write Shooting(segments=1)")
    return ShotPlane(orbit.system, names, orbit.period, method)


@plane_of.register(Balance)
def _balanced(method: Balance, orbit: Orbit, names: tuple[str, str]) -> OrbitPlane:
    from gapwalk.bifurcation.loci.balanced_plane import BalancedPlane  # loads numba, which takes time

    harmonics = method.pose(orbit.system, None, orbit.period).harmonics
    if method.harmonics is None:
        harmonics = max(harmonics, orbit.harmonics)
    return BalancedPlane(orbit.system, names, orbit.period, method, harmonics)


def _posed(
    plane: OrbitPlane, special: SpecialPoint, within: tuple[Range, Range]
) -> tuple[Corrector, NDArray[np.float64]]:
    """Return the corrector for the locus of a special point, and the start in its variables."""
    equation, unknowns, scales = equation_of(plane, special, [each.width for each in within])
    return Corrector(equation, scales), np.append(unknowns, special.orbit.system[plane.names[1]]) / scales


def equation_of(
    plane: OrbitPlane, special: SpecialPoint, widths: Sequence[float]
) -> tuple[AnyEquation, NDArray[np.float64], NDArray[np.float64]]:
    """Return the equation of the locus of a special point, its unknowns there, and the scales of all variables."""
    if special.multiplicity > 1:
        raise ConvergenceError(
            f"{special.multiplicity} multipliers become critical at once at the {special.kind_words} at "
            f"{special.value:.10g}, and part where the equal parts become unequal, so that it has no gradient and no "
            "locus; make the parts a little unequal"
        )
    orbit, units = special.orbit, plane.scales(special.orbit)
    equation: AnyEquation
    if isinstance(special.kind, Sliding):
        if not isinstance(plane, ShotPlane):
            raise ModelError(f"the locus of a {special.kind} is followed by shooting; write method=Shooting()")
        equation = posed(plane, special.kind, orbit, special.contact, float(units[0]), plane.tolerance)
        scales = powers_of_two(np.concatenate((units, [PERIOD], widths)))
        unknowns = equation.unknowns(orbit)
    elif special.kind is not Kind.GRAZING:
        scales = powers_of_two(np.append(units, widths))
        equation = MultiplierEquation(plane, special.kind, scales, plane.tolerance)
        unknowns = equation.unknowns(orbit)
    else:
        scales = powers_of_two(np.concatenate((units, [PERIOD], widths)))
        switches = range(len(switch_names(plane.system)))
        switch = next(k for k in switches if describe_switch(orbit, k) == special.contact)
        margin, others = MARGIN * float(units[0]), [orbit.system[name] for name in plane.names[1:]]
        equation = GrazingEquation(plane, switch, 0.0, min(plane.tolerance, 0.1 * margin))
        unknowns = equation.unknowns(orbit)
        equation = replace(equation, depth=-margin if equation.is_highest(unknowns, *others) else margin)
    return equation, unknowns, scales


def _checked(special: SpecialPoint, first: str, second: str, to: Ranges) -> tuple[Range, Range]:
    """Return the ranges; raise a ModelError if the request is invalid."""
    system = special.orbit.system
    if special.kind.no_locus:
        raise ModelError(special.kind.no_locus)
    if special.orbit.own_method is not None:
        raise ModelError(
            "this motion has no excitation, and its frequency is an unknown; loci of such motions are not followed. "
            "Follow the motions for several values of the second parameter instead"
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
        ranges.append(replace(Range(low, high).along(name, system), is_relative=False))
    for corner in product(*pairs):
        system.at(dict(zip((first, second), corner, strict=True)))
    return ranges[0], ranges[1]

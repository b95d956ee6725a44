"""Equation of the loci of points of sliding: a periodic orbit at an instant of which friction is about to change."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from gapwalk.bifurcation.friction_margins import Change, margin, modes_around
from gapwalk.bifurcation.friction_margins import instant_of as instant_in
from gapwalk.bifurcation.kinds.sliding import Sliding
from gapwalk.bifurcation.loci.locus_equations import LocusEquation
from gapwalk.bifurcation.loci.orbit_plane import Place, ShotPlane
from gapwalk.bifurcation.special_point_kind import Kind
from gapwalk.errors import ConvergenceError
from gapwalk.flow.dry_motion import DryModes, modes_along
from gapwalk.flow.flow import PERIOD
from gapwalk.flow.friction_gauge import FrictionGauge
from gapwalk.model.coefficients import coefficients_of, layout_of
from gapwalk.orbit.friction_phases import Margin
from gapwalk.orbit.orbit import Orbit

_STEP = 1e-150  # of the complex step
_ASIDE = 1e-6  # step of central differences, as a share of the unknowns
_LEAD = 0.3  # largest angle before the instant, in radians, from which on friction keeps its mode
_REFINEMENTS, _FARTHEST = 4, 0.05  # of the angle of the start, and the largest change in each
_AT = 1e-3  # radians within which the beginning of a phase is the instant itself
_MARGIN = 1e-11  # distance from the change, on the side without the phase; as for grazing

Array = NDArray[np.float64]


class Instant(NamedTuple):
    """Instant of a point of sliding, by the quantity that vanishes there."""

    what: str  #: ``stop``, ``rate`` or ``reserve``, as in `gapwalk.orbit.friction_phases.Margin`.
    contact: int  #: Number of the contact.
    side: int  #: The direction of slip concerned.


@dataclass(frozen=True, eq=False)
class SlidingEquation(LocusEquation):
    """Equation of an orbit with two conditions at an angle ``theta*``.

    Where slip ends (crossing- and switching-sliding), the slip rate and the reserve of the force are zero. Within slip
    (grazing-sliding), the slip rate and its derivative are. Within stick (adding-sliding and the onset of slip), the
    reserve and its derivative are. Shortly before ``theta*`` the friction keeps its mode, so all are smooth.

    The unknowns are those of the orbit, ``theta*`` and the first parameter; the second parameter is followed.
    """

    others: ClassVar[int] = 2

    instant: Instant  #: What vanishes.
    #: Angle before the instant, in radians, from which on the friction keeps its mode: all the period at an onset of
    #: slip, where the position that it keeps is the same all along the locus.
    lead: float
    units: tuple[float, float]  #: Scales of the two conditions.
    tolerance: float  #: Largest residual, relative to the size of the unknowns.

    def place(self, unknowns: Array, *others: float) -> Place:
        """Evaluate the equations of the orbit; see `OrbitPlane.place`."""
        keeps = self.instant.contact if self.lead >= PERIOD * self.period else None
        plane = cast("ShotPlane", self.plane)
        return plane.place(unknowns[: -self.others], float(unknowns[-1]), *others, keeps=keeps)

    def linearised(self, unknowns: Array, *others: float) -> tuple[Array, Array, Place]:
        """See `LocusEquation.linearised`."""
        place, size = self.place(unknowns, *others), len(unknowns) - 2
        jacobian = np.zeros((size + 2, size + 2 + len(others)))
        jacobian[:size, :size], jacobian[:size, size + 1 :] = place.jacobian[:, :size], place.jacobian[:, size:]
        found, jacobian[size:] = self._conditions(place, float(unknowns[-2]))
        residual = np.concatenate((place.residual, found / self.units))
        jacobian[size:] /= np.array(self.units)[:, None]
        if self.instant.what != "stop":
            residual[size] -= _MARGIN
        return residual, jacobian, place

    def _conditions(self, place: Place, theta: float) -> tuple[Array, Array]:
        """Return both conditions, and their derivatives by unknowns, angle and parameters."""
        plane, (what, contact, side) = cast("ShotPlane", self.plane), self.instant
        structure, size = plane.system.structure, len(place.unknowns)
        full = PERIOD * self.period
        angle = theta % full
        lead = min(self.lead, angle) if self.lead >= full else self.lead
        angle += full * (angle < 2.0 * lead and self.lead < full)
        there, by_all, arc = plane.reached(place, contact, angle - lead, angle)
        gauge = FrictionGauge(layout_of(structure), contact)
        modes = modes_along(structure, np.array([angle - lead]), arc.slips, arc.holds, before=True).at(0)
        slips, sticks = gauge.slipping(modes, side), gauge.sticking(modes)
        pairs: dict[str, list[tuple[Callable[..., Any], DryModes, int]]] = {
            "stop": [(gauge.rate, slips, side), (gauge.reserve, sticks, -side)],
            "rate": [(gauge.rate, slips, side), (gauge.acceleration, slips, side)],
            "reserve": [(gauge.reserve, sticks, side), (_changing(gauge), sticks, side)],
        }
        own = slips if what != "reserve" else sticks
        values, derivatives = np.empty(2), np.empty((2, size + 1 + len(plane.names)))
        rates = gauge.motion(place.coefficients, angle, there, own)
        for row, (function, modes_of, towards) in enumerate(pairs[what]):

            def at(y: NDArray, coefficients: NDArray, t: Any, use: Any = (function, modes_of, towards)) -> Any:
                return use[0](coefficients, t, y, use[1], use[2])

            by_state, by_angle, by_slopes = _derivatives(
                at, there, place.coefficients, angle, place.slopes, rates, smooth=row == 0 or what != "reserve"
            )
            values[row] = float(np.real(at(there, place.coefficients, angle)))
            derivatives[row, :size] = by_state @ by_all[:, :size]
            derivatives[row, size] = by_angle
            derivatives[row, size + 1 :] = by_state @ by_all[:, size:] + by_slopes
        return values, derivatives

    def unknowns(self, orbit: Orbit) -> Array:
        """Return the unknowns of an orbit, with the angle of the margin that is nearest to zero."""
        theta, values = nearest_margin(orbit, self.instant).theta, [orbit.system[name] for name in self.plane.names]
        if self.instant.what != "stop":
            place = self.plane.place(self.plane.unknowns(orbit), *values)
            for _ in range(_REFINEMENTS):
                found, derivatives = self._conditions(place, theta)
                shift = -found[1] / derivatives[1, len(place.unknowns)]
                theta += max(-_FARTHEST, min(_FARTHEST, float(shift)))
        return np.concatenate((self.plane.unknowns(orbit), [theta, orbit.system[self.plane.names[0]]]))


def nearest_margin(orbit: Orbit, instant: Instant) -> Margin:
    """Return the margin of an orbit that is nearest to zero, of those that vanish at such an instant.

    On one side of a point of sliding the margin is that of the phase that vanishes there; the orbit at the point itself
    may have that phase, very short.
    """
    what, contact, side = instant
    alike = [each for each in orbit.margins if (each.what, each.contact, each.side) == instant_of(instant)]
    phases = orbit.friction.get(contact, [])
    within = {"rate": (side, 0, side), "reserve": (0, side, 0)}.get(what)
    own = [phase for phase, around in zip(phases, modes_around(phases), strict=True) if around == within]
    if own and within is not None:
        shortest = min(own, key=lambda phase: phase.length)
        theta, value = margin(orbit, Change(contact, *within, shortest.start, False), shortest.start)
        alike.append(Margin(contact, what, side, theta, value, _range(orbit, instant, theta)))
    if not alike:
        raise ConvergenceError("no friction of this motion is near such a point")
    return min(alike, key=lambda each: abs(each.value) / each.range)


def _range(orbit: Orbit, instant: Instant, theta: float) -> float:
    """Return the size of the quantity that vanishes at an instant: of rates that of the motion, of forces the bound."""
    if instant.what == "rate":
        return float(np.abs(orbit.extremes).max()) * float(orbit.system.frequency)
    now, gauge = instant_in(orbit, theta), FrictionGauge(layout_of(orbit.system.structure), instant.contact)
    bound, _ = gauge.bound_and_force(coefficients_of(orbit.system), now.theta, now.state, gauge.sticking(now.modes))
    return float(bound)


def instant_of(instant: Instant) -> tuple[str, int, int]:
    """Return an instant as a plain tuple."""
    return instant.what, instant.contact, instant.side


def posed(plane: ShotPlane, kind: Sliding, orbit: Orbit, contact: str, length: float, tolerance: float):
    """Return the equation of the locus of a point of sliding, which names its contact and its side."""
    name, _, sign = contact.rpartition(" ")
    names = [each.name for each in orbit.system.structure.contacts]
    instant = Instant(kind.what, names.index(name), 1 if sign == "+" else -1)
    near = nearest_margin(orbit, instant)
    time = float(orbit.system.frequency)
    units = {
        "stop": (time, near.range / length),
        "rate": (time, time**2),
        "reserve": (near.range / length, near.range * time / length),
    }
    full = PERIOD * orbit.period
    passed = [(near.theta - phase.start) % full for phase in orbit.friction[instant.contact]]
    lead = min([_LEAD, *(0.5 * each for each in passed if each > _AT)]) if kind is not Kind.SLIP_ONSET else full
    return SlidingEquation(plane, instant, lead, units[kind.what], min(tolerance, 0.1 * _MARGIN * length))


def _changing(gauge: FrictionGauge) -> Callable[..., Any]:
    def changing(coefficients: NDArray, theta: Any, y: NDArray, modes: DryModes, side: int) -> float:
        return gauge.change(gauge.reserve, coefficients, theta, y, modes, side)

    return changing


def _derivatives(
    function: Callable[..., Any],
    y: Array,
    coefficients: Array,
    theta: float,
    slopes: Array,
    rates: Array,
    *,
    smooth: bool,
) -> tuple[Array, float, Array]:
    """Return the derivatives of a function of one instant by the state, along the motion over theta, and by slopes."""
    size = len(y)
    ways = [(row, 0.0 * coefficients, 0.0) for row in np.eye(size)]
    ways.append((rates * float(coefficients[0]), 0.0 * coefficients, 1.0))
    ways += [(0.0 * y, slope, 0.0) for slope in slopes]
    found = []
    for dy, dc, dt in ways:
        if smooth:
            step = 1j * _STEP
            found.append(complex(function(y + step * dy, coefficients + step * dc, theta + step * dt)).imag / _STEP)
        else:
            moved = max(float(np.abs(dy).max()), float(np.abs(dc).max(initial=0.0)), abs(dt)) or 1.0
            step = _ASIDE / moved
            ends = [function(y + s * dy, coefficients + s * dc, theta + s * dt) for s in (step, -step)]
            found.append(float(ends[0] - ends[1]) / (2.0 * step))
    return np.array(found[:size]), found[size], np.array(found[size + 1 :])

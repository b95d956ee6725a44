"""Planetary sets and differentials: the meshes of sun, planets and ring as links of more than two ends.

With ``a = z_p / z_s``, ``b = z_r / z_s``, all angles in the same sense, the deflections are, as angles of the sun,

    sun and planet:   (sun - centre) + a (planet - centre) - (1 + a) tan(alpha) radial
    planet and ring:  b (ring - centre) - a (planet - centre) + (b - a) tan(alpha) radial

`centre` is the angle of a planet's centre about the axis of the set: that of the carrier, unless the planets have
bearings; `radial` is its radial displacement over the radius of its circle, and `alpha` the pressure angle. Their sum
is that of a set without planets' inertia, and of a differential: ``sun + b ring - (1 + b) carrier``.

Method: docs/numerics/notes/models.md; Lin and Parker (1999), Journal of Vibration and Acoustics 121, 316-321.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any, Self

from gapwalk.model.bounds import Counted, NotNegative, Positive, field_problems, has
from gapwalk.model.drivetrain.train_parts import GROUND, Change, Inertia, Link, Shaft, converted

_MEMBERS = ("sun", "ring", "carrier")
QUANTITIES = (
    "planet_inertia", "stiffness", "damping", "clearance", "ring_stiffness", "ring_damping", "ring_clearance",
    "orbit_inertia", "bearing_stiffness", "bearing_damping", "impact_damping",
)  # fmt: skip
"""The numbers of a set with a unit; the last part of each name is its kind."""


@dataclass(frozen=True)
class Planet(Inertia):
    """A planet, or how its centre moves in its bearing: an inertia that a planetary set makes."""


@dataclass(frozen=True, init=False)
class Mesh(Link):
    """A mesh of a planetary set, or the set as a whole: a link of more than two ends."""

    weights: Mapping[str, Fraction]  #: Those of the angles in its deflection: see `Link.row`.
    counted: tuple[str, int]  #: The member whose teeth are counted, and their number.
    carrier: str  #: The member against which they pass.
    _toothed = True

    def __init__(
        self, name: str, row: Mapping[str, Fraction], counted: tuple[str, int], carrier: str, **springs: Any
    ) -> None:
        ends = [end for end in row if end != GROUND]
        super().__init__(name, (ends[0], [*ends, GROUND][1]), **springs)
        for what, value in (("weights", row), ("counted", counted), ("carrier", carrier)):
            object.__setattr__(self, what, value)


@dataclass(frozen=True)
class Planetary:
    """A planetary set, or a differential.

    Its members are inertias of the train. Stiffness, damping and clearance are those of the meshes of all planets
    together, referred to the angle of the sun: teeth of k N/m on its base circle of radius r give k r^2 times the
    number of planets.

    Raises
    ------
    ModelError
        If the train cannot have such a set.

    Examples
    --------
    >>> gears = gw.train.Planetary("set", sun="motor", ring="ground", carrier="output", teeth=(30, 20, 70))
    >>> float(gears.basic_ratio)
    2.3333333333333335
    """

    name: str  #: Its meshes are called ``name_sun`` and ``name_ring``, or ``name`` without planets.
    #: sun, ring, carrier: Inertias, or ``"ground"``; None for a member that is absent.
    sun: str | None = None
    ring: str | None = None
    carrier: str | None = None
    teeth: Sequence[int] | None = None  #: Numbers of teeth of sun, planet and ring.
    #: In place of the teeth: the speed of the sun over that of the ring while the carrier is at rest, with the sign
    #: reversed; 1 for a differential.
    ratio: float | None = None
    planets: Counted = 3  #: Number of planets.
    #: Inertia of one planet about its axis; the masses of the planets belong to the inertia of the carrier. None for
    #: planets without inertia, whose meshes with sun and ring then are two springs in series.
    planet_inertia: Positive | None = None
    lumped: bool = True  #: True if all planets move alike, as one inertia of their sum.
    stiffness: Positive | None = None  #: Stiffness of the meshes of sun and planets; None: rigid.
    damping: NotNegative = 0.0  #: Damping of these meshes.
    clearance: NotNegative | None = None  #: Half the backlash of each of these meshes.
    #: ring_stiffness, ring_damping, ring_clearance: Stiffness, damping and clearance of the meshes of planets and ring,
    #: as angles of the sun, too; by default as at the sun.
    ring_stiffness: Positive | None = None
    ring_damping: NotNegative | None = None
    ring_clearance: NotNegative | None = None
    impact_damping: NotNegative | None = None  #: Hunt and Crossley's coefficient of all meshes.
    #: Moment of inertia of one planet's mass about the axis of the set, where the planets' bearings are elastic.
    orbit_inertia: Positive | None = None
    #: bearing_stiffness, bearing_damping: Stiffness and damping of all planets' bearings together, along the circle of
    #: their centres and radially, as torque over the carrier's angle: bearings of k N/m on a circle of radius r have k
    #: r^2 each.
    bearing_stiffness: Positive | None = None
    bearing_damping: NotNegative = 0.0
    pressure_angle: float = 20.0  #: In degrees; it matters only with elastic bearings.

    def __post_init__(self) -> None:
        if isinstance(self.teeth, list):
            object.__setattr__(self, "teeth", tuple(self.teeth))

    @property
    def basic_ratio(self) -> Fraction:
        """Teeth of the ring over those of the sun."""
        if self.teeth is not None:
            return Fraction(self.teeth[2], self.teeth[0])
        ratio = Fraction(self.ratio or 1.0)
        near = ratio.limit_denominator(1000)
        return near if abs(near - ratio) <= abs(ratio) / 10**9 else ratio

    @property
    def has_planets(self) -> bool:
        """True if its planets have inertias of their own."""
        return self.planet_inertia is not None

    @property
    def is_elastic(self) -> bool:
        """True if any of its meshes has a stiffness."""
        return any(each is not None for each in (self.stiffness, self.ring_stiffness))

    @property
    def places(self) -> list[str]:
        """The endings of the names of its planets: their numbers, or one empty text where all planets are lumped."""
        return [""] if self.lumped or not self.is_elastic else [str(each + 1) for each in range(self.planets)]

    @property
    def angles(self) -> list[float]:
        """Angles of all planets on the carrier, as evenly spaced as the teeth allow, in radians."""
        slots = sum(self.teeth[::2]) if self.teeth else self.planets
        return [2.0 * math.pi * round(each * slots / self.planets) / slots for each in range(self.planets)]

    @property
    def inertias(self) -> tuple[Planet, ...]:
        """The inertias of its planets, and of the motion of their centres if the bearings are elastic."""
        if not self.has_planets:
            return ()
        count = self.planets / len(self.places)
        found = []
        for place in self.places:
            found.append(Planet(f"{self.name}_planet{place}", _times(self.planet_inertia, count)))
            if self.orbit_inertia is not None:
                size = _times(self.orbit_inertia, count)
                found += [Planet(f"{self.name}_{what}{place}", size) for what in ("orbit", "radial")]
        return tuple(found)

    @property
    def links(self) -> tuple[Link, ...]:
        """Its meshes, and the bearings of its planets."""
        shares = 1.0 / len(self.places)
        more = {"impact_damping": self.impact_damping}
        at_sun: dict[str, Any] = {"stiffness": _times(self.stiffness, shares), "clearance": self.clearance}
        at_sun |= {"damping": self.damping * shares} | more
        b = self.basic_ratio
        member = {each: getattr(self, each) or GROUND for each in _MEMBERS}
        counted = (member["sun"], self.teeth[0]) if self.teeth else ("", 0)
        if self.sun is None and self.teeth:
            counted = member["ring"], self.teeth[2]
        if not self.has_planets:
            row = {member["sun"]: Fraction(1), member["ring"]: b, member["carrier"]: -1 - b}
            return (Mesh(self.name, row, counted, member["carrier"], **at_sun),)
        assert self.teeth is not None  # checked by `problems`
        a = Fraction(self.teeth[1], self.teeth[0])
        own = {"stiffness": _times(self.ring_stiffness, shares), "damping": _times(self.ring_damping, shares)}
        own |= {"clearance": self.ring_clearance}
        at_ring = at_sun | {name: value for name, value in own.items() if value is not None}
        lean = Fraction(math.tan(math.radians(self.pressure_angle)))
        found: list[Link] = []
        for place in self.places:
            planet, centre, radial = f"{self.name}_planet{place}", member["carrier"], None
            if self.orbit_inertia is not None:
                centre, radial = f"{self.name}_orbit{place}", f"{self.name}_radial{place}"
                held = _times(self.bearing_stiffness, shares)
                bearing = {"stiffness": held, "damping": self.bearing_damping * shares}
                found.append(Shaft(f"{self.name}_bearing{place}", (centre, member["carrier"]), **bearing))
                found.append(Shaft(f"{self.name}_radial_bearing{place}", (radial, GROUND), **bearing))
            for what, own, springs, sign in (("sun", Fraction(1), at_sun, 1), ("ring", b, at_ring, -1)):
                if getattr(self, what) is None:
                    continue
                row = {member[what]: own, planet: sign * a, centre: -own - sign * a}
                if radial:
                    row[radial] = -sign * (own + sign * a) * lean
                found.append(Mesh(f"{self.name}_{what}{place}", row, counted, member["carrier"], **springs))
        return tuple(found)

    def _converted(self, change: Change) -> Self:
        """Return it with other values of its quantities."""
        return replace(self, **converted(self, change, QUANTITIES))

    def problems(self, inertias: Sequence[str]) -> Iterator[str]:
        """List its errors, one sentence each, to follow its name."""
        members = {each: getattr(self, each) for each in _MEMBERS if getattr(self, each) is not None}
        for what, name in members.items():
            if name not in inertias and name != GROUND:
                yield f'has {what} = {name!r}, which is no inertia; write the name of one, or "ground"'
        named = [name for name in members.values() if name != GROUND]
        if len({*named}) < len(named):
            yield "has one inertia as two of its members; join them by a rigid [[gear]] with ratio = 1 instead"
        if not named:
            yield 'has no member that turns; write sun = "...", ring = "..." and carrier = "..."'
        yield from self._teeth_problems()
        whole = {"sun", "ring"} <= {*members}
        if not whole and not self.has_planets:
            missing = "sun" if "sun" not in members else "ring"
            yield f'has no {missing}; write {missing} = "...", or planet_inertia = ... for planets that roll without it'
        yield from field_problems(self)
        if self.has_planets and self.teeth is None:
            yield "has planet_inertia, but no numbers of teeth; write teeth = [30, 20, 70]: sun, planet, ring"
        alone = [
            what for what in QUANTITIES if what.startswith(("ring_", "orbit_", "bearing_")) and getattr(self, what)
        ]
        for what in () if self.has_planets else alone:
            yield f"has {what}, but its planets have no inertia; write planet_inertia = ..., or leave {what} out"
        if not self.is_elastic and (self.damping or self.clearance is not None or self.ring_damping):
            yield "has damping or a clearance, but no stiffness, so it is rigid; write stiffness = ..."
        if (self.orbit_inertia is None) is not (self.bearing_stiffness is None):
            yield "has only one of orbit_inertia and bearing_stiffness; write both for planets in elastic bearings"
        if not self.lumped and not (self.has_planets and self.is_elastic):
            yield "has lumped = false, but no planets that could move apart; write planet_inertia and stiffness"
        if not 0.0 <= self.pressure_angle < 90.0:
            yield f"has pressure_angle = {self.pressure_angle!r}; it is in degrees, as in pressure_angle = 20"

    def _teeth_problems(self) -> Iterator[str]:
        if (self.teeth is None) is (self.ratio is None):
            yield (
                "has both teeth and ratio; leave one of the two out"
                if self.teeth is not None
                else "has no teeth; write teeth = [30, 20, 70]: sun, planet, ring. Or ratio = 1 for a differential"
            )
        elif self.teeth is None:
            if not has(Positive, self.ratio):
                yield (
                    f"has ratio = {self.ratio!r}; it is the number of teeth of the ring over that of the sun, > 0, and "
                    "1 for a differential"
                )
        elif len(self.teeth) != 3 or not all(has(Counted, each) for each in self.teeth):
            yield f"has teeth = {[*self.teeth]!r}; write those of sun, planet and ring, as in [30, 20, 70]"
        else:
            sun, planet, ring = self.teeth
            if ring != sun + 2 * planet:
                yield (
                    f"has teeth = [{sun}, {planet}, {ring}], but a ring round planets of {planet} teeth on a sun of "
                    f"{sun} has {sun + 2 * planet}; write teeth = [{sun}, {planet}, {sun + 2 * planet}]"
                )


def _times(value: float | None, factor: float) -> float | None:
    return None if value is None else value * factor

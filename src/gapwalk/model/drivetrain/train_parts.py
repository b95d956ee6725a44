"""The parts of a drive train: inertias, shafts, and gear meshes, each with its numbers.

A number may also be a text with a unit, which `Train` reads: ``Inertia("hub", "0.005 kg m^2")``.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from copy import copy
from dataclasses import KW_ONLY, dataclass, field, fields, replace
from fractions import Fraction
from typing import Any, ClassVar, Self

from gapwalk.errors import ModelError
from gapwalk.model.bounds import Finite, has
from gapwalk.model.contact import OF_FRICTION, RIGID, Contact, ContactParts, Side, Stage, side_of
from gapwalk.model.contact import friction as make_friction
from gapwalk.model.laws import FRICTION, HYSTERESIS, STIFFNESS, Expression, Law, Rigid, law_with
from gapwalk.model.laws.formula import GROUP_SCALE, MEAN_SLIP, MEAN_SPEED, PACE, Formula, formula_of
from gapwalk.model.loads import Line, Load
from gapwalk.model.registry import Parameter
from gapwalk.model.units import QuantityKind

GROUND = "ground"
"""The name of the ground, which does not move; a shaft may end there."""

Change = Callable[[str, Any], Any]
"""A function that returns another value for a quantity, from its name and its value."""

_LARGEST_PART = 500  # of a ratio that is taken for a fraction without the numbers of teeth
_EXACT = 1e-9  # relative error of a ratio that is meant to be a fraction
_ROUNDED = 1e-4  # relative error of a ratio that is given beside numbers of teeth
OF_LINKS = ("stiffness", "damping", "clearance", "cubic", "centre")
"""The quantities of a link without those of its law and its stages."""
_OF_STAGES = ("clearance", "stiffness", "cubic", "centre")


@dataclass(frozen=True)
class Inertia:
    """A rigid body that turns (or, in a chain of masses, moves).

    Examples
    --------
    >>> gw.train.Inertia("flywheel", "0.14 kg m^2").inertia
    '0.14 kg m^2'
    """

    name: str  #: Its parameter is called ``name.inertia``.
    #: Moment of inertia, > 0, in kg m^2 or any consistent unit. None if its motion is prescribed: loads vary its angle,
    #: as in ``gw.Harmonic("0.1 deg", varies="flywheel.angle")``.
    inertia: float | None = None
    #: Radius, such as ``"35 mm"``, at which its signal ``name.acceleration`` is given in m/s^2; None to give it in
    #: rad/s^2. It is no parameter, because no motion depends on it.
    radius: float | None = None

    def _converted(self, change: Change) -> Self:
        """Return it with other values of its quantities."""
        return replace(self, **converted(self, change, ("inertia", "radius")))


def converted(part: Any, change: Change, names: Iterable[str]) -> dict[str, Any]:
    """Return the quantities of a part that are given, with other values; nothing is zero in any unit."""
    given = {what: getattr(part, what) for what in names}
    return {what: change(f"{part.name}.{what}", value) for what, value in given.items() if value}


@dataclass(frozen=True, init=False)
class Link:
    """A connection of two inertias: springs with and without clearances, and a damper, all of them optional."""

    name: str  #: Prefix of its parameters' names, as in ``clutch.stiffness``, and name of its deflection.
    between: tuple[str, str]  #: The two inertias.
    _: KW_ONLY
    #: Stiffness of the spring, > 0; or ``"rigid"``, beyond a clearance, for a rigid stop with the number `restitution`.
    #: None if there are only stages, or no springs at all: a shaft with damping alone is a drag, as that of a bearing,
    #: or of a fluid coupling. Where nothing else holds its two inertias together, the angle between them is free and
    #: left out: see `Train`.
    stiffness: float | None = None
    damping: float = 0.0  #: Coefficient of the damper, >= 0; it acts always, also within a gap.
    clearance: float | None = None  #: Half the backlash of that spring, as an angle, if there is any.
    #: Further springs, from the inside out; names are made up for those that have none. Each may have the number
    #: `hysteresis`; the last one may be a rigid stop, with the stiffness ``"rigid"`` and the number `restitution`.
    stages: tuple[Stage, ...] = ()
    #: Coefficient of the cubic term of the spring beyond the clearance; there is none without a clearance.
    cubic: float = 0.0
    #: The force law of the contact of the springs that have a clearance, or its name; by default the first that has the
    #: parameters which are given.
    law: Law | str | None = None
    #: Parameters of any law by name; they may also be given as arguments.
    numbers: Mapping[str, float] = field(default_factory=dict, hash=False)
    #: The side on which that spring acts beyond its clearance, ``"positive"`` (of the first inertia ahead of the
    #: second), ``"negative"`` or ``"both"``: one side alone is a freewheel.
    side: Side = Side.BOTH
    #: The middle of the gap, at most as far from 0 as the clearance. Then each side has parameters of its own, as in
    #: ``mesh.positive.clearance``.
    centre: float = 0.0
    _toothed: ClassVar[bool] = False
    """True if it is rigid without springs."""

    def __init__(
        self,
        name: str,
        between: tuple[str, str],
        *,
        stiffness: float | None = None,
        damping: float = 0.0,
        clearance: float | None = None,
        stages: Sequence[Stage] = (),
        cubic: float = 0.0,
        law: Law | str | None = None,
        numbers: Mapping[str, float] | None = None,
        side: Side | str = Side.BOTH,
        centre: float = 0.0,
        **more: float | None,
    ) -> None:
        given = {**(numbers or {}), **{what: value for what, value in more.items() if value is not None}}
        rigid = law in (RIGID, Rigid()) or (law is None and "restitution" in given)
        spring: Any = RIGID if rigid and stiffness is None and clearance is not None else stiffness
        parts = (name, between, spring, damping, clearance, tuple(stages), cubic, law, given, side_of(side), centre)
        for each, value in zip(fields(Link), parts, strict=True):
            object.__setattr__(self, each.name, value)

    @property
    def row(self) -> Mapping[str, Fraction] | None:
        """The weights of all angles in its deflection, by inertia, if it has more than two ends."""
        return vars(self).get("weights")

    @property
    def acts_always(self) -> bool:
        """True if its spring has no clearance."""
        return self.stiffness is not None and self.clearance is None

    @property
    def is_rigid(self) -> bool:
        """True if it connects its inertias rigidly."""
        return self._toothed and not self.has_springs

    @property
    def is_drag(self) -> bool:
        """True for a damper without any spring."""
        return not (self.is_rigid or self.has_springs)

    @property
    def has_springs(self) -> bool:
        """True if any of its springs is elastic."""
        return self.stiffness is not None or bool(self.stages)

    @property
    def only_follows(self) -> bool:
        """True if it joins nothing: a torque that depends on the rate of its deflection alone."""
        return False

    def contacts(self, gapless: bool = False, angle: float = 1.0, slips: Slips | None = None) -> tuple[Contact, ...]:
        """Return its springs with clearances, the friction beside them, and its rigid stop, as contacts.

        `slips` says how its ends slip on each other beside their deflection; by default they do not.
        """
        alone = len(self.stages) + (self.stiffness is not None) == 1  # then its parameters need no name of a stage
        stages = []
        if self.stiffness is not None and (self.clearance is not None or gapless):
            own = Stage(self.clearance or 0.0, self.stiffness, self.cubic, self.side, "" if alone else "stage1")
            stages.append(replace(own, centre=self.centre))
        for number, stage in enumerate(self.stages, start=1 if self.stiffness is None else 2):
            stages.append(replace(stage, name=stage.name or ("" if alone else f"stage{number}")))
        numbers = dict(self.numbers)
        if len(stages) == 1 and self.clearance is not None and HYSTERESIS.name in numbers:
            own = {**stages[0].numbers, HYSTERESIS.name: numbers.pop(HYSTERESIS.name)}
            stages = [replace(stages[0], numbers=own)]
        always = self.acts_always and not gapless
        return ContactParts(self.name, {self.name: 1.0}, stages, None, self.law, numbers, always).contacts()

    def _converted(self, change: Change) -> Self:
        """Return it with other values of its quantities, in the order in which they choose the units of a train."""

        def but_rigid(name: str, value: Any) -> Any:
            return value if value == RIGID else change(name, value)

        def numbers(prefix: str, given: Mapping[str, Any]) -> dict[str, Any]:
            return {what: but_rigid(f"{prefix}.{what}", value) for what, value in given.items()}

        found, stages = copy(self), []
        values = converted(self, but_rigid, OF_LINKS)
        for number, stage in enumerate(self.stages):
            prefix = f"{self.name}.{stage.name or f'stage[{number}]'}"
            own = numbers(prefix, {what: getattr(stage, what) for what in _OF_STAGES})
            stages.append(replace(stage, **own, numbers=numbers(prefix, stage.numbers)))
        values |= {"stages": tuple(stages), "numbers": numbers(self.name, self.numbers)}
        for what, value in values.items():
            object.__setattr__(found, what, value)
        return found

    def problems(self) -> Iterator[str]:
        """List the errors of its numbers, one sentence each, to follow its name."""
        if self.stiffness is None and self.clearance is not None:
            yield 'has a clearance, but no stiffness beyond it; write stiffness = ..., or stiffness = "rigid"'
        if self.stiffness == RIGID and self.clearance is None:
            yield 'has the stiffness "rigid", but no clearance; write the clearance of the rigid stop, or leave it out'
        for what in ("side", "centre"):
            if getattr(self, what) not in (Side.BOTH, 0.0) and self.clearance is None:
                yield f"has a {what}, but no clearance; write the clearance of the gap, as in clearance = 0.0"
        if any(name in self.numbers for name in OF_FRICTION) and not self.has_springs:
            yield "has hysteresis, but no spring; write friction alone as a part of its own, as a [[friction]]"
        if self.cubic and self.clearance is None:
            yield "has a cubic term, but no clearance; put it into a stage with clearance = 0.0"
        own = [name for name in self.numbers if name not in OF_FRICTION]
        if self.law is None:
            try:
                law_with(own)
            except ModelError as error:
                yield f"has {' and '.join(own)}; {error}: leave one of the two out"
                return
        for what in ("law", *own):
            free = self.clearance is None and not self.stages and self.stiffness != RIGID
            if free and (what != "law" or self.law is not None):
                yield f"has {what}, but no clearance; write damping = ... for a damper that acts always"
        try:
            self.contacts()
        except ModelError as error:
            yield f"is refused: {str(error).removeprefix(f'contact {self.name!r}: ')}"


@dataclass(frozen=True, init=False)
class Shaft(Link):
    """A spring with a damper between two inertias, or between one and the ground, with or without clearance.

    Its twist is the angle of the first inertia less that of the second. Without a clearance the spring acts always;
    with one it acts beyond it (a spline, say). Stages act in addition, each beyond its own clearance (a clutch). The
    second of its inertias may be ``"ground"``. Parameters are those of `Link`.

    Examples
    --------
    >>> shaft = gw.train.Shaft("clutch", ("engine", "gear"), stiffness="1500 N m/rad", damping="2 N m s/rad")
    >>> shaft.acts_always
    True
    """

    def problems(self) -> Iterator[str]:
        """List the errors of its numbers, one sentence each, to follow its name."""
        if not self.has_springs and self.clearance is None and not self.damping:
            yield (
                "has no stiffness; write stiffness = ..., or stages with a clearance and a stiffness each, or "
                "damping = ... for a drag"
            )
        yield from super().problems()


@dataclass(frozen=True, init=False)
class Gear(Link):
    """A gear mesh (or belt, or chain drive) between two inertias: rigid, or with the stiffness of its teeth.

    All angles are counted such that they grow together as the train turns. The deflection of the mesh is the angle of
    the first inertia less `ratio` times that of the second, so its stiffness, damping and clearance refer to the angle
    of the first inertia: teeth of k N/m with j m of backlash on a base circle of radius r m have the stiffness k r^2
    and the clearance j / (2 r). The other parameters are those of `Link`.

    Parameters
    ----------
    stiffness
        None for a rigid mesh, which makes one body of its two inertias.

    Examples
    --------
    >>> gear = gw.train.Gear("mesh", ("gear", "box"), ratio=2, teeth=20, stiffness="1e5 N m/rad", clearance="0.1 deg")
    >>> gear.exact_ratio, gear.first_teeth, gear.is_rigid
    (Fraction(2, 1), 20, False)
    """

    ratio: float  #: Speed of the first inertia divided by that of the second, not zero.
    #: Number of teeth of the first gear, or numbers of both gears. If one number is given, the second gear has `ratio`
    #: times as many teeth. With teeth, loads may have orders per tooth: see `Counted`.
    teeth: int | tuple[int, int] | None
    _toothed = True

    def __init__(
        self,
        name: str,
        between: tuple[str, str],
        ratio: float | None = None,
        *,
        teeth: int | Sequence[int] | None = None,
        **springs: Any,
    ) -> None:
        super().__init__(name, between, **springs)
        pair = tuple(teeth) if isinstance(teeth, Sequence) else teeth
        if ratio is None and isinstance(pair, tuple) and len(pair) == 2 and pair[0]:
            ratio = pair[1] / pair[0]
        object.__setattr__(self, "ratio", ratio)
        object.__setattr__(self, "teeth", pair)

    @property
    def exact_ratio(self) -> Fraction | None:
        """The ratio as a fraction: of the numbers of teeth, or of small numbers; None if it is none."""
        if self.teeth is None:
            found = Fraction(self.ratio).limit_denominator(_LARGEST_PART)
            return found if abs(found - self.ratio) <= _EXACT * abs(self.ratio) else None
        first, second = self.teeth if isinstance(self.teeth, tuple) else (self.teeth, 0)
        return Fraction(second or round(abs(self.ratio) * first), first) * (1 if self.ratio > 0 else -1)

    @property
    def first_teeth(self) -> int | None:
        """The number of teeth of the first gear, if it is known."""
        return self.teeth[0] if isinstance(self.teeth, tuple) else self.teeth

    def problems(self) -> Iterator[str]:
        """List the errors of its numbers, one sentence each, to follow its name."""
        if self.is_rigid and self.damping:
            yield "has damping, but no stiffness, so it is rigid; leave damping out, or write stiffness = ..."
        yield from self._teeth_problems()
        if GROUND in self.between:
            yield "ends at the ground, but a gear joins two inertias; write a shaft instead"
        yield from super().problems()

    def _teeth_problems(self) -> Iterator[str]:
        pair: list[Any] = [*self.teeth] if isinstance(self.teeth, tuple) else [self.teeth]
        if self.teeth is None or not isinstance(self.ratio, int | float) or not 0 < abs(self.ratio) < math.inf:
            return
        if len(pair) > 2 or not all(isinstance(each, int) and not isinstance(each, bool) and each > 0 for each in pair):
            yield f"has teeth = {self.teeth!r}; write the number of teeth of the first gear, or of both, as in [27, 41]"
            return
        second = abs(self.ratio) * (pair[0] or 0)
        whole = pair[1] if pair[1:] else max(round(second), 1)
        if abs(second - whole) > (_ROUNDED if pair[1:] else _EXACT * 1e3) * second:
            yield (
                f"has {pair[0]} teeth and the ratio {self.ratio:.10g}, so its second gear would have {second:.8g}; "
                f"write the numbers of both, as in teeth = [{pair[0]}, {whole}], and leave the ratio out"
            )


# Loads that a train makes of those that it is given: displacements of its links, and reactions to their means.
# See "Drive trains" in docs/numerics/notes/models.md.

_DAMPING = Parameter("damping", QuantityKind.DAMPING, "it is the damper that acts always", 0.0, 0.0)


@dataclass(frozen=True)
class _Made:
    """A load that a train makes of one of some kind."""

    kind: type[Load]  #: The kind of load of which it is made.

    has_levels, is_periodic = False, True
    frequencies = ()
    note = ""

    @property
    def key(self) -> str:
        """The table of the load of which it is made."""
        return self.kind.key

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """The parameters of that load."""
        return self.kind.parameters

    def unscaled(self, order: int, frequency: Any, numbers: Mapping[str, Any]) -> Iterable[Line]:
        """Give no lines: they are neither of a displacement nor constant."""
        return ()

    def tables(self, constants: Mapping[str, Any]) -> Iterator[tuple[tuple[float, ...], str]]:
        """Iterate over the tables of that load."""
        return self.kind.tables(constants)

    def notes(self, constants: Mapping[str, Any]) -> str:
        """Return its own note: that load has described itself."""
        return self.note


@dataclass(frozen=True)
class Displacing(_Made):
    """A load by which a displacement acts on a linear link."""

    words = "a displacement of a shaft or gear"

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Parameters of the displacement, then stiffness and damping of the link."""
        return (*self.kind.parameters, STIFFNESS, _DAMPING)

    def lines(self, order: int, frequency: Any, numbers: Mapping[str, Any]) -> Iterable[Line]:
        """Give the torque ``k u + c u'``; see `Load.lines`."""
        stiffness, damping = numbers["stiffness"], numbers["damping"]
        for each in self.kind.lines(order, frequency, numbers):
            rate = damping * (each.order * frequency)
            yield Line(
                each.order, stiffness * each.cosine + rate * each.sine, stiffness * each.sine - rate * each.cosine
            )


@dataclass(frozen=True)
class MeanOf(_Made):
    """A load that is the constant part of another one, as the reaction balances it."""

    words = note = "the reaction to the mean of a load"
    is_periodic = False

    def lines(self, order: int, frequency: Any, numbers: Mapping[str, Any]) -> Iterable[Line]:
        """Give the constant lines of the load; see `Load.lines`."""
        return (line for line in self.kind.lines(order, frequency, numbers) if not line.order)


# Torques between two inertias that are no springs: by a formula, and dry friction.

_OF_FORCES = {*OF_LINKS[:4], "name", "between", "law", "numbers", "stages", "teeth", "ratio"}  # no names of parameters
_NOTHING = (None, 0.0, (), {})  # values of a link that has no springs
_OF_GAPS = {"side": Side.BOTH, "centre": 0.0}  # values of one that has no gap; formulas may have such parameters


def _own(more: Mapping[str, Any]) -> dict[str, Any]:
    """Return what is said of a part without springs but what all links have."""
    return {name: value for name, value in more.items() if name not in _OF_FORCES and _OF_GAPS.get(name) != value}


@dataclass(frozen=True, init=False)
class Springless(Link):
    """A torque between two inertias that is no spring."""

    @property
    def is_drag(self) -> bool:
        """True: it has no spring that acts always."""
        return True

    @property
    def only_follows(self) -> bool:
        """True if it joins nothing."""
        return self.is_drag

    @property
    def has_springs(self) -> bool:
        """True if its torque depends on the deflection; that of a Jenkins element slips."""
        return not self.is_drag

    def _number_problems(self, known: Collection[str], others: str) -> Iterator[str]:
        """List what is wrong with its numbers, of which only some are known."""
        for name, value in self.numbers.items():
            if name not in known:
                yield f"has {name}, which is {others.format(', '.join(known))}"
            elif not has(Finite, value):
                yield f"has {name} = {value!r}; it must be a finite number"


@dataclass(frozen=True, init=False)
class Force(Springless):
    """A torque by a formula between two inertias, or between one and the ground.

    Parameters
    ----------
    name
        Prefix of its parameters' names.
    between
        The two inertias. Its deflection is the angle of the first less that of the second.
    law
        The formula, as for `gapwalk.force`: ``x`` is the deflection, in rad, and ``v`` its rate, in rad/s; the torque
        is in N m. In a train without units they are in the units of the train.
    numbers
        The parameters by name; they may also be given as arguments. In a train with units they may be texts, such as
        ``"0.01 N m s/rad"``.

    Examples
    --------
    >>> gw.train.Force("seal", ("hub", "box"), "c*v*abs(v)", c="0.001 N m s^2/rad^2").numbers
    {'c': '0.001 N m s^2/rad^2'}
    """

    def __init__(
        self,
        name: str,
        between: tuple[str, str],
        law: str,
        *,
        numbers: Mapping[str, float | str] | None = None,
        **more: float | str,
    ) -> None:
        given: Any = {**(numbers or {}), **_own(more)}
        super().__init__(name, between, law=law, numbers=given)

    @property
    def is_drag(self) -> bool:
        """True if its formula does not depend on the deflection."""
        return "x" not in self.formula.variables

    @property
    def formula(self) -> Formula:
        """The formula as it was written."""
        return formula_of(str(self.law), ("x", "x'", "v"))

    def contacts(self, gapless: bool = False, angle: float = 1.0, slips: Slips | None = None) -> tuple[Contact, ...]:
        """Return this part as a contact; see `Link.contacts`. The formula has angles in rad."""
        slips = slips or Slips()
        speeds = {name: f"({slips.rate(f'{_SPEED}{k}')} + {MEAN_SPEED}{k})" for k, name in enumerate(self.speeds)}
        if self.between[1] == GROUND:
            speeds.setdefault("w2", "0.0")
        text = of_turning(self.formula.text, slips, self.numbers, speeds)
        return (formula_contact(self.name, scaled(text, angle, angle), self.numbers),)

    @property
    def speeds(self) -> dict[str, str]:
        """The inertias whose absolute speeds occur in its formula, by the names of these speeds in the formula."""
        ends = {name: end for name, end in zip(("w1", "w2"), self.between, strict=False) if end != GROUND}
        return {name: ends[name] for name in self.formula.parameters if name in ends and name not in self.numbers}

    @property
    def needs_speed(self) -> bool:
        """True if the mean speed of the train occurs in its formula."""
        return any(name in COMPUTED and name not in self.numbers for name in self.formula.parameters)

    def problems(self) -> Iterator[str]:
        """List the errors of its formula and its numbers, one sentence each, to follow its name."""
        try:
            known = [name for name in self.formula.parameters if name not in COMPUTED or name in self.numbers]
        except ModelError as error:
            yield f"has no formula as its law: {str(error).splitlines()[0]}"
            return
        for name in known:
            if name in _OF_FORCES:
                yield f"has a parameter {name!r}, which means something else in a shaft; rename it in the formula"
            elif name not in self.numbers:
                yield f"has no {name}, which its formula needs; write {name} = ..."
        yield from self._number_problems(known, "no parameter of its formula; its parameters are {}")


@dataclass(frozen=True, init=False)
class Friction(Springless):
    """Dry friction between two inertias, or between one and the ground.

    Parameters
    ----------
    name
        Prefix of its parameters' names.
    between
        The two inertias. Its deflection is the angle of the first less `ratio` times that of the second.
    limit
        The torque in slip, >= 0.
    coefficient, normal
        Instead of the limit: the coefficient of friction, and the shaft or gear whose springs with a clearance press.
    stiffness
        Stiffness of a spring in series (a Jenkins element); without it friction sticks rigidly.
    static
        Torque at which slip begins, divided by the torque in slip, >= 1; for friction that sticks rigidly.
    speed
        Constant rate of the base: the slip rate is the rate of the deflection minus this rate.
    numbers
        The numbers above by name.

    Examples
    --------
    >>> gw.train.Friction("seal", ("hub", "ground"), "2 N m").numbers
    {'limit': '2 N m'}
    """

    normal: str
    ratio: float | None  #: As that of a `Gear`; by default 1.

    def __init__(
        self,
        name: str,
        between: tuple[str, str],
        limit: float | str | None = None,
        *,
        coefficient: float | None = None,
        normal: str = "",
        stiffness: float | str | None = None,
        static: float | None = None,
        speed: float | str | None = None,
        ratio: float | None = None,
        numbers: Mapping[str, float | str] | None = None,
        **others: Any,
    ) -> None:
        own: dict[str, Any] = {"limit": limit, "coefficient": coefficient, "stiffness": stiffness}
        own |= {"static": static, "speed": speed}
        given: Any = {**(numbers or {}), **{what: value for what, value in own.items() if value is not None}}
        super().__init__(name, between, numbers=given)
        wrong = [what for what, value in others.items() if what in _own(others) or value not in (*_NOTHING, Side.BOTH)]
        if wrong:
            known = ", ".join((*FRICTION, "normal", "ratio"))
            raise ModelError(f"friction {name!r} has {wrong[0]}, which is none of its numbers; they are {known}")
        object.__setattr__(self, "normal", normal)
        object.__setattr__(self, "ratio", ratio)

    def contacts(self, gapless: bool = False, angle: float = 1.0, slips: Slips | None = None) -> tuple[Contact, ...]:
        """Return this part as a contact; see `Link.contacts`."""
        numbers: Any = self.numbers
        return (make_friction(self.name, {self.name: 1.0}, normal=self.normal, **numbers),)

    def problems(self) -> Iterator[str]:
        """List the errors of its numbers, one sentence each, to follow its name."""
        if wrong := [*self._number_problems(self.numbers, "")]:
            yield wrong[0]
            return
        try:
            self.contacts()
        except ModelError as error:
            reason, own = str(error).removeprefix(f"contact {self.name!r}: "), f"friction {self.name!r} "
            yield reason.removeprefix(own) if reason.startswith(own) else f"is refused: {reason}"


@dataclass(frozen=True, init=False)
class Drag(Springless):
    """Drag of a bearing, a seal or oil: a torque by the speed at which two parts slip on each other.

    The parts turn at different speeds, or the second is the ground (the casing). With the slip ``s``, the speed of the
    first less that of the second, the torque is ``linear * s + quadratic * s * |s|`` plus a constant torque against the
    slip; see docs/numerics/notes/models.md.

    Parameters
    ----------
    name
        Prefix of its parameters' names.
    between
        The two inertias, or one and ``"ground"``.
    linear
        Torque over slip.
    quadratic
        Torque over the square of the slip.
    constant
        Torque of dry friction while it slips. It acts against the mean slip; where the slip reverses, write a
        `Friction`.
    breakaway, stribeck, exponent
        Stribeck's curve: the torque of dry friction is
        ``constant + (breakaway - constant) * exp(-|s / stribeck|**exponent)``. The exponent is 1 or 2, 2 by default.
    law
        In place of all of these: a formula of the slip ``s``, which may contain ``W`` as in a `Force`.
    group
        Name of a group of drags, all multiplied by one parameter ``<group>.drag``, such as a factor of the viscosity,
        which depends on the temperature.
    numbers
        The numbers above, or those of the formula, by name; they may also be given as arguments.

    Examples
    --------
    >>> gw.train.Drag("churning", ("gear", "ground"), linear="0.018 N m s/rad").numbers
    {'linear': '0.018 N m s/rad'}
    """

    group: str
    exponent: int

    def __init__(
        self,
        name: str,
        between: tuple[str, str],
        *,
        law: str | None = None,
        group: str = "",
        exponent: int = 2,
        numbers: Mapping[str, float | str] | None = None,
        **more: float | str | None,
    ) -> None:
        given: Any = {**(numbers or {}), **{what: value for what, value in _own(more).items() if value is not None}}
        super().__init__(name, between, law=law or None, numbers=given)
        object.__setattr__(self, "group", group)
        object.__setattr__(self, "exponent", exponent)

    @property
    def only_follows(self) -> bool:
        """True unless its torque has a linear part only: such a drag joins nothing."""
        return self.numbers.keys() != {"linear"} or self.law is not None

    @property
    def own(self) -> tuple[str, ...]:
        """Names of its numbers that no contact has: those of the linear and the constant part of its torque."""
        if self.law is not None:
            return ()
        wanted = ("linear",) if "breakaway" in self.numbers else ("linear", "constant")
        return tuple(name for name in wanted if name in self.numbers)

    def contacts(self, gapless: bool = False, angle: float = 1.0, slips: Slips | None = None) -> tuple[Contact, ...]:
        """Return its torque, except the parts in `own`, as a contact; see `Link.contacts`."""
        slips = slips or Slips()
        text = self.formula_text(angle, slips.way)
        if not text:
            return ()
        if self.group:
            text = f"{GROUP_SCALE}*({text})"
        return (formula_contact(self.name, of_turning(text, slips, self.numbers, {}), self.numbers),)

    def formula_text(self, angle: float, way: int | None) -> str:
        """Return the formula of its contact, of the slip s; empty if it has none."""
        if self.law is not None:
            return scaled(str(self.law), angle, angle, slip=angle)
        parts, sign = [], "-" if way == -1 else ""
        if "quadratic" in self.numbers:
            rate = "s" if angle == 1.0 else f"({angle!r}*s)"
            parts.append(f"{sign}quadratic*{rate}**2" if way else f"quadratic*{rate}*abs({rate})")
        if "breakaway" in self.numbers and way:
            share = f"exp(-({sign}s/stribeck)**{self.exponent})"
            falling = "constant + (breakaway - constant)" if "constant" in self.numbers else "breakaway"
            parts.append(f"{sign}({falling}*{share})")
        return " + ".join(parts)

    def problems(self) -> Iterator[str]:
        """List the errors of its numbers, one sentence each, to follow its name."""
        if self.law is not None:
            yield from Force(self.name, self.between, str(self.law), numbers=self.numbers).problems()
            return
        known = [each.name for each in OF_DRAGS]
        yield from self._number_problems(known, "none of its numbers; they are {}, or those of its law")
        if not {"linear", "quadratic", "constant", "breakaway"} & self.numbers.keys():
            yield 'has no torque; write linear = ..., quadratic = ..., constant = ..., or law = "a*s + b*s**3"'
        if ("breakaway" in self.numbers) is not ("stribeck" in self.numbers):
            yield "has only one of breakaway and stribeck; write both: the torque at rest, and the slip where it falls"
        if self.exponent not in (1, 2):
            yield f"has exponent = {self.exponent!r}; it is 1 or 2"
        if not isinstance(self.group, str) or (self.group and not self.group.isidentifier()):
            yield f"has group = {self.group!r}; write a word of letters, digits and underscores"


OF_DRAGS = (
    Parameter("linear", QuantityKind.DAMPING, "it is the torque of drag over the slip", None, 0.0),
    Parameter("quadratic", None, "it is the torque of drag over the square of the slip", None, 0.0, -2, 1),
    Parameter("constant", QuantityKind.TORQUE, "it is the torque of drag while it slips", None, 0.0),
    Parameter("breakaway", QuantityKind.TORQUE, "it is the torque of drag at rest", None, 0.0),
    Parameter("stribeck", QuantityKind.RATE, "it is the slip at which the torque of drag falls", None, 0.0),
)
"""The numbers of a drag that is no formula."""
NOT_NEGATIVE = tuple(each.name for each in OF_DRAGS if each.name != "stribeck")
"""The numbers of a drag that may be 0, but not less."""

_SPEED = "speed_"  # and a number: the name in a formula of the angle of an inertia whose speed occurs in it
COMPUTED = ("W", "s", "w1", "w2")
"""Names in a formula of a train for the mean speed of its reference, the slip, and the speeds of its two ends."""


@dataclass(frozen=True)
class Slips:
    """How the ends of a link slip on each other beside their deflection."""

    way: int | None = None  #: The sign of its mean slip; None if its ends turn at the same mean speed.
    #: True if a drag alone joins two parts of the train, whose rates then contain leaks.
    leaks: bool = False

    def rate(self, argument: str) -> str:
        """Return the formula of the rate of an argument of a formula."""
        return f"{argument}' + {argument}{LEAK}" if self.leaks else f"{argument}'"

    @property
    def slip(self) -> str:
        """The formula of the slip."""
        found = self.rate("x") if self.way is None else f"{self.rate('x')} + {MEAN_SLIP}"
        return f"({found})" if "+" in found else found


LEAK = "_leak"
"""The end of the name of an argument that is the leak of another one: see `gapwalk.model.drivetrain.train_assembly`."""


def speed_number(argument: str) -> int | None:
    """Return the number of the inertia of whose angle an argument of a formula is the name; None for the slip."""
    return int(argument.removeprefix(_SPEED).removesuffix(LEAK)) if argument.startswith(_SPEED) else None


def acts_along_its_slip(law: Law) -> bool:
    """Return True if the first deflection of a law is the one along which it acts."""
    return not law.arguments[0].startswith(_SPEED) and not law.arguments[0].endswith(LEAK)


def formula_contact(name: str, text: str, numbers: Mapping[str, Any]) -> Contact:
    """Make the contact of a formula, with the arguments that occur in it."""
    text = re.sub(r"\bv\b", "x'", text)
    names = dict.fromkeys(each.removesuffix("'") for each in re.findall(_WORD, text))
    arguments = sorted(each for each in names if re.fullmatch(rf"(x|{_SPEED}\d+)({LEAK})?", each))
    arguments.sort(key=lambda each: each[0] != "x")  # along the first of them it acts, if that is its slip
    law = Expression(text, tuple(arguments) or ("x",))
    given = {each.name: numbers.get(each.name, 1.0) for each in law.parameters}
    vectors: Any = {each: {name: 1.0} for each in law.arguments}
    return Contact(name, vectors if arguments[1:] else {name: 1.0}, (), None, law, given)


_WORD = r"[^\W\d]\w*'?"


def of_turning(text: str, slips: Slips, numbers: Mapping[str, Any], speeds: Mapping[str, str]) -> str:
    """Write a formula of slips and speeds as one of the rates of the equations of motion, which lack the means."""
    slip = slips.slip
    known = {name: value for name, value in {"s": slip, "W": PACE, **speeds}.items() if name not in numbers}
    known |= {"v": slip, "x'": slip}
    return re.sub(_WORD, lambda match: known.get(match[0], match[0]), text)


def scaled(text: str, angle: float, rate: float, torque: float = 1.0, slip: float | None = None) -> str:
    """Write a formula of a deflection and its rate for other units: in place of x, ``angle * x``, and so on."""
    sizes = {"x": angle, "x'": rate, "v": rate, PACE: rate, MEAN_SLIP: rate}
    sizes |= {} if slip is None else {"s": slip}

    def instead(match: re.Match[str]) -> str:
        word = match[0]
        of_speed = re.fullmatch(rf"{_SPEED}\d+'|{MEAN_SPEED}\d+|\w+{LEAK}", word)
        size = rate if of_speed else sizes.get(word, 1.0)
        return word if size == 1.0 else f"({size!r}*{word})"

    found = re.sub(_WORD, instead, text)
    return found if torque == 1.0 else f"({found})*{1.0 / torque!r}"

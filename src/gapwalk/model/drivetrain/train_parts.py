"""The parts of a drive train: inertias, shafts, and gear meshes, each with its numbers.

A number may also be a text with a unit, which `Train` reads: ``Inertia("hub", "0.005 kg m^2")``.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, field, fields, replace
from fractions import Fraction
from typing import Any, Self

from gapwalk.errors import ModelError
from gapwalk.model.contact import OF_FRICTION, RIGID, Contact, ContactParts, Stage
from gapwalk.model.contact import friction as make_friction
from gapwalk.model.laws import FRICTION, HYSTERESIS, STIFFNESS, Expression, Law, Rigid, law_with
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
OF_LINKS = ("stiffness", "damping", "clearance", "cubic")
"""The quantities of a link without those of its law and its stages."""
_OF_STAGES = ("clearance", "stiffness", "cubic")


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

    def _converted(self, change: Change) -> Inertia:
        """Return it with another value of its quantity."""
        if self.inertia is None:
            return self
        return replace(self, inertia=change(f"{self.name}.inertia", self.inertia))


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
        **more: float | None,
    ) -> None:
        given = {**(numbers or {}), **{what: value for what, value in more.items() if value is not None}}
        rigid = law in (RIGID, Rigid()) or (law is None and "restitution" in given)
        spring: Any = RIGID if rigid and stiffness is None and clearance is not None else stiffness
        parts = (name, between, spring, damping, clearance, tuple(stages), cubic, law, given)
        for each, value in zip(fields(Link), parts, strict=True):
            object.__setattr__(self, each.name, value)

    @property
    def acts_always(self) -> bool:
        """True if its spring has no clearance."""
        return self.stiffness is not None and self.clearance is None

    @property
    def is_rigid(self) -> bool:
        """True if it connects its two inertias rigidly."""
        return False

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

    def contacts(self, gapless: bool = False, angle: float = 1.0) -> tuple[Contact, ...]:
        """Return its springs with clearances, the friction beside them, and its rigid stop, as contacts."""
        alone = len(self.stages) + (self.stiffness is not None) == 1  # then its parameters need no name of a stage
        stages = []
        if self.stiffness is not None and (self.clearance is not None or gapless):
            stages.append(Stage(self.clearance or 0.0, self.stiffness, self.cubic, name="" if alone else "stage1"))
        for number, stage in enumerate(self.stages, start=1 if self.stiffness is None else 2):
            stages.append(replace(stage, name=stage.name or ("" if alone else f"stage{number}")))
        numbers = dict(self.numbers)
        if len(stages) == 1 and self.clearance is not None and HYSTERESIS.name in numbers:
            own = stages[0].numbers | {HYSTERESIS.name: numbers.pop(HYSTERESIS.name)}
            stages = [replace(stages[0], numbers=own)]
        always = self.acts_always and not gapless
        return ContactParts(self.name, {self.name: 1.0}, stages, None, self.law, numbers, always).contacts()

    def _converted(self, change: Change) -> Self:
        """Return it with other values of its quantities, in the order in which they choose the units of a train."""

        def changed(prefix: str, values: Mapping[str, Any]) -> dict[str, Any]:
            return {
                what: value if value == RIGID else change(f"{prefix}.{what}", value) for what, value in values.items()
            }

        values = changed(self.name, {what: getattr(self, what) for what in OF_LINKS})
        stages = []
        for number, stage in enumerate(self.stages):
            prefix = f"{self.name}.{stage.name or f'stage[{number}]'}"
            own = changed(prefix, {what: getattr(stage, what) for what in _OF_STAGES})
            stages.append(replace(stage, **own, numbers=changed(prefix, stage.numbers)))
        return replace(self, **values, stages=tuple(stages), numbers=changed(self.name, self.numbers))

    def problems(self) -> Iterator[str]:
        """List the errors of its numbers, one sentence each, without its name."""
        if self.stiffness is None and self.clearance is not None:
            yield 'has a clearance, but no stiffness beyond it; write stiffness = ..., or stiffness = "rigid"'
        if self.stiffness == RIGID and self.clearance is None:
            yield 'has the stiffness "rigid", but no clearance; write the clearance of the rigid stop, or leave it out'
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


def links_of(train: Any) -> tuple[Link, ...]:
    """Return the shafts, then the gears, then the forces and the friction of a train."""
    return (*train.shafts, *train.gears, *train.forces, *train.frictions)


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
        """List the errors of its numbers, one sentence each, without its name."""
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
    the first inertia less `ratio` times that of the second, so its stiffness, damping and clearance are those that are
    felt at the first: teeth of k N/m with j m of backlash on a base circle of radius r m have the stiffness k r^2 and
    the clearance j / (2 r). The other parameters are those of `Link`.

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
    #: Number of teeth of the first gear, or of both; of the second there are `ratio` times as many. Loads may then
    #: count their orders per tooth: see `Counted`.
    teeth: int | tuple[int, int] | None

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

    @property
    def is_rigid(self) -> bool:
        """True if it connects its two inertias rigidly."""
        return not self.has_springs

    def problems(self) -> Iterator[str]:
        """List the errors of its numbers, one sentence each, without its name."""
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
            yield f"has teeth = {self.teeth!r}; write the number of the first gear, or both, as in [27, 41]"
            return
        second = abs(self.ratio) * (pair[0] or 0)
        whole = pair[1] if pair[1:] else max(round(second), 1)
        if abs(second - whole) > (_ROUNDED if pair[1:] else _EXACT * 1e3) * second:
            yield (
                f"has {pair[0]} teeth and the ratio {self.ratio:.10g}, so its second gear would have {second:.8g}; "
                f"write the numbers of both, as in teeth = [{pair[0]}, {whole}], and leave the ratio out"
            )


# Loads that a train makes of those that it is given: displacements of its links, and reactions to their means.
#
# A displacement ``u`` over the angle of the excitation (a transmission error, an inertia whose motion is prescribed)
# is added to the deflection ``x`` of a link. Where springs have clearances, it enters their deflection
# (`gapwalk.model.structure.Variation`). The torque of a spring that acts always and of a damper is linear, ``k (x + u)
# + c (x' + u')``, so ``-(k u + c u')`` is a load along the link, like any other to every backend.
#
# The mean of a measured torque, or of one that depends on the speed, would accelerate a free train for ever, as a mean
# torque would: the reaction balances it, at every speed. The periodic part shakes the train as a whole, reaction or
# not.

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
                each.order,
                stiffness * each.cosine + rate * each.sine,
                stiffness * each.sine - rate * each.cosine,
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

_OF_FORCES = {*OF_LINKS, "name", "between", "law", "numbers", "stages", "teeth", "ratio"}  # no names of parameters
_NOTHING = (None, 0.0, (), {})  # values of a link that has no springs


@dataclass(frozen=True, init=False)
class Force(Link):
    """A torque by a formula between two inertias, or between one and the ground.

    Parameters
    ----------
    name
        Prefix of its parameters' names.
    between
        The two inertias. Its deflection is the angle of the first less that of the second.
    law
        The formula, as for `gapwalk.force`: ``x`` is the deflection, in rad, and ``v`` its rate, in rad/s; the torque
        is in N m. In a train without units they are in its own.
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
        given: Any = {**(numbers or {}), **{name: value for name, value in more.items() if name not in _OF_FORCES}}
        super().__init__(name, between, law=law, numbers=given)

    @property
    def is_drag(self) -> bool:
        """True if its formula does not depend on the deflection."""
        return "x" not in self.formula.formula.variables

    @property
    def only_follows(self) -> bool:
        """True if its formula does not depend on the deflection."""
        return self.is_drag

    @property
    def has_springs(self) -> bool:
        """True if its formula depends on the deflection."""
        return not self.is_drag

    @property
    def formula(self) -> Expression:
        """The formula as it was written."""
        return Expression(str(self.law))

    def contacts(self, gapless: bool = False, angle: float = 1.0) -> tuple[Contact, ...]:
        """Return it as a contact; see `Link.contacts`. The formula is one of rad."""
        law = Expression(scaled(self.formula.text, angle, angle), ("x",))
        numbers = {each.name: self.numbers[each.name] for each in law.parameters if each.name in self.numbers}
        return (Contact(self.name, {self.name: 1.0}, (), None, law, numbers),)

    def _converted(self, change: Change) -> Self:
        """Return it with other values of its parameters."""
        numbers = {name: change(f"{self.name}.{name}", value) for name, value in self.numbers.items()}
        return type(self)(self.name, self.between, str(self.law), numbers=numbers)

    def problems(self) -> Iterator[str]:
        """List the errors of its formula and its numbers, one sentence each, without its name."""
        try:
            known = [each.name for each in self.formula.parameters]
        except ModelError as error:
            yield f"has no formula as its law: {str(error).splitlines()[0]}"
            return
        for name in known:
            if name in _OF_FORCES:
                yield f"has a parameter {name!r}, which means something else in a shaft; rename it in the formula"
            elif name not in self.numbers:
                yield f"has no {name}, which its formula needs; write {name} = ..."
        for name, value in self.numbers.items():
            if name not in known:
                yield f"has {name}, which is no parameter of its formula; its parameters are {', '.join(known)}"
            elif isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
                yield f"has {name} = {value!r}; it must be a finite number"


@dataclass(frozen=True, init=False)
class Friction(Link):
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
        Instead of the limit: a coefficient, and the name of the shaft or gear whose springs beyond a clearance press.
    stiffness
        Stiffness of a spring in series (a Jenkins element); without it friction sticks rigidly.
    static
        Torque at which slip begins over that in slip, >= 1; for friction that sticks rigidly.
    speed
        Constant rate of the base: the slip rate is that of the deflection less this one.
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
        wrong = [what for what, value in others.items() if what not in _OF_FORCES or value not in _NOTHING]
        if wrong:
            known = ", ".join((*FRICTION, "normal", "ratio"))
            raise ModelError(f"friction {name!r} has {wrong[0]}, which is none of its numbers; they are {known}")
        object.__setattr__(self, "normal", normal)
        object.__setattr__(self, "ratio", ratio)

    @property
    def is_drag(self) -> bool:
        """True: it has no spring that acts always."""
        return True

    @property
    def only_follows(self) -> bool:
        """True: it joins nothing, because it may slip."""
        return True

    @property
    def has_springs(self) -> bool:
        """False: that of a Jenkins element slips."""
        return False

    def contacts(self, gapless: bool = False, angle: float = 1.0) -> tuple[Contact, ...]:
        """Return it as a contact; see `Link.contacts`."""
        numbers: Any = self.numbers
        return (make_friction(self.name, {self.name: 1.0}, normal=self.normal, **numbers),)

    def _converted(self, change: Change) -> Self:
        """Return it with other values of its quantities."""
        numbers = {name: change(f"{self.name}.{name}", value) for name, value in self.numbers.items()}
        return type(self)(self.name, self.between, normal=self.normal, ratio=self.ratio, numbers=numbers)

    def problems(self) -> Iterator[str]:
        """List the errors of its numbers, one sentence each, without its name."""
        for name, value in self.numbers.items():
            if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
                yield f"has {name} = {value!r}; it must be a finite number"
                return
        try:
            self.contacts()
        except ModelError as error:
            reason, own = str(error).removeprefix(f"contact {self.name!r}: "), f"friction {self.name!r} "
            yield reason.removeprefix(own) if reason.startswith(own) else f"is refused: {reason}"


def scaled(text: str, angle: float, rate: float, torque: float = 1.0) -> str:
    """Write a formula of a deflection and its rate for other units: in place of x, ``angle * x``, and so on."""
    sizes = {"x": angle, "x'": rate, "v": rate}

    def instead(match: re.Match[str]) -> str:
        size = sizes.get(match[0], 1.0)
        return match[0] if size == 1.0 else f"({size!r}*{match[0]})"

    found = re.sub(r"[^\W\d]\w*'?", instead, text)
    return found if torque == 1.0 else f"({found})*{1.0 / torque!r}"

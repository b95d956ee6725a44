"""Contacts: forces between bodies beyond clearances, by a force law."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from enum import StrEnum
from itertools import accumulate, pairwise
from typing import Any

from gapwalk.errors import ModelError, UnfitError
from gapwalk.model.laws import (
    HYSTERESIS,
    LAWS,
    Coulomb,
    Expression,
    Hysteretic,
    Jenkins,
    Law,
    Rigid,
    StageShape,
    Term,
    closed_form_of,
    law_of,
    law_with,
)
from gapwalk.model.laws.formula import is_computed
from gapwalk.model.problems import WITHIN
from gapwalk.model.registry import Parameter

RIGID = "rigid"
"""The stiffness, in a model file or a drive train, of a stage that is a rigid stop."""


class Side(StrEnum):
    """The side of the gap on which a stage acts, by the sign of the deflection.

    Examples
    --------
    >>> gw.stop("wall", {"x": 1.0}, 0.5, 20.0, side=gw.Side.NEGATIVE).stages[0].side
    <Side.NEGATIVE: 'negative'>
    """

    BOTH = "both"
    POSITIVE = "positive"
    NEGATIVE = "negative"

    @property
    def signs(self) -> tuple[int, ...]:
        """The signs of the deflection on which the stage acts: +1, -1, or both."""
        return {"both": (1, -1), "positive": (1,), "negative": (-1,)}[self.value]


def side_of(side: Side | str) -> Side:
    """Return a side by its name."""
    try:
        return Side(side)
    except ValueError:
        raise ModelError(f"side is {side!r}; write {', '.join(repr(each.value) for each in Side)}") from None


@dataclass(frozen=True, slots=True)
class Stage:
    """One spring of a contact: it acts beyond its clearance, in addition to the stages with smaller clearances.

    Its force is ``stiffness * xi + cubic * xi**3`` with ``xi = x - clearance`` for a deflection
    ``x > clearance``, ``xi = x + clearance`` for ``x < -clearance``, and zero between.

    Examples
    --------
    >>> clutch = gw.Contact("clutch", {"x": 1.0}, [gw.Stage(0.2, 5.0, name="soft"), gw.Stage(1.0, 20.0, name="hard")])
    >>> [stage.clearance for stage in clutch.stages]
    [0.2, 1.0]
    """

    clearance: float  #: Half-width of the gap, >= 0, in units of the deflection.
    stiffness: float = 1.0  #: Slope that this spring adds to the force.
    cubic: float = 0.0  #: Coefficient of its cubic term.
    side: Side = Side.BOTH  #: The side on which it acts: ``"both"``, ``"positive"`` or ``"negative"``.
    #: The parameters of a stage with a name are called ``contact.name.clearance`` instead of ``contact.clearance``.
    #: Only a single stage may be without a name.
    name: str = ""
    #: Further parameters of the stage by name: those of the contact's force law, and `hysteresis`, the limit of the dry
    #: friction that acts while the stage is closed (see `friction`).
    numbers: Mapping[str, float] = field(default_factory=dict, hash=False)
    #: The middle of the gap, at most as far from 0 as the clearance. If it is not 0, each side has a stage of its own,
    #: with ``positive`` or ``negative`` in the names of its parameters.
    centre: float = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "side", side_of(self.side))

    def number(self, parameter: Parameter) -> float | None:
        """Return the value of one of its parameters; None if it has no such parameter."""
        if parameter.name in ("clearance", "stiffness", "cubic"):
            return getattr(self, parameter.name)
        return self.numbers.get(parameter.name, parameter.default)

    @property
    def sides(self) -> tuple[Stage, ...]:
        """The stage itself; if the centre of its gap is not 0, one stage for each side."""
        if not self.centre:
            return (self,)
        found = []
        for side in (each for each in (Side.POSITIVE, Side.NEGATIVE) if each.signs[0] in self.side.signs):
            clearance = self.clearance + side.signs[0] * self.centre
            clearance = 0.0 if abs(clearance) < _ROUNDED * self.clearance else clearance
            name = self.name if self.side is not Side.BOTH else f"{self.name}_{side}".removeprefix("_")
            found.append(replace(self, clearance=clearance, side=side, name=name, centre=0.0))
        return tuple(found)


_ROUNDED = 1e-12  # of a clearance


@dataclass(frozen=True, init=False)
class Contact:
    """A force ``f(x, x')`` that depends on one deflection ``x = e @ q`` and acts along one direction ``d``.

    Raises
    ------
    ModelError
        If its numbers are not allowed.

    Examples
    --------
    >>> gw.Contact("stop", {"x": 1.0}, [gw.Stage(1.0, 20.0)], law="hunt-crossley", impact_damping=0.1).numbers
    {'impact_damping': 0.1}
    """

    name: str  #: Prefix of its parameters' names.
    #: The vector ``e`` by coordinate name, for example ``{"q1": 1, "q2": -1}``.
    deflection: Mapping[str, float] = field(hash=False)
    stages: tuple[Stage, ...]  #: Springs in parallel, in the order of growing clearance on each side.
    #: The vector ``d`` by coordinate name, on the left-hand side of the equations of motion. By default it equals
    #: ``deflection``, as for any contact that obeys action and reaction.
    force: Mapping[str, float] | None = field(default=None, hash=False)
    #: The force law, or its name: ``"elastic"``, ``"viscous"``, ``"hunt-crossley"``, ``"hunt-crossley-as-printed"``, or
    #: that of a registered law.
    law: Law = field(default_factory=lambda: law_of("elastic"))
    #: Parameters of the law by name; they may also be given as arguments.
    numbers: Mapping[str, float] = field(default_factory=dict, hash=False)
    #: Parameters with the value of one of another contact: both names, as in ``{"belt_load.speed": "belt.speed"}``.
    shares: Mapping[str, str] = field(default_factory=dict, hash=False)

    def __init__(
        self,
        name: str,
        deflection: Mapping[str, float],
        stages: Sequence[Stage],
        force: Mapping[str, float] | None = None,
        law: Law | str = "elastic",
        numbers: Mapping[str, float] | None = None,
        shares: Mapping[str, str] | None = None,
        **more: float,
    ) -> None:
        if numbers is not None and not isinstance(numbers, Mapping):
            raise ModelError(
                f"contact {name!r}: numbers is {numbers!r}; write the parameters of its law by name, as in "
                '{"impact_damping": 0.1}'
            )
        known, given = law_of(law), {**(numbers or {}), **more}
        stages = [side for stage in stages for side in stage.sides]
        if any(HYSTERESIS.name in stage.numbers for stage in stages) and known in LAWS.values() and not known.rebounds:
            known = Hysteretic(known.name)
        own = {each.name: given.get(each.name, each.default) for each in known.parameters}
        parts = (name, deflection, tuple(stages), force, known, own, dict(shares or {}))
        for each, value in zip(fields(self), parts, strict=True):
            object.__setattr__(self, each.name, value)
        problems = [*_stage_problems(self), *_number_problems(self, given)]
        if problems:
            raise ModelError(f"contact {self.name!r}: " + "; ".join(problems))

    @property
    def vectors(self) -> list[Mapping[str, float]]:
        """The vectors of its deflections, in the order of the arguments of its law."""
        if not any(isinstance(each, Mapping) for each in self.deflection.values()):
            return [self.deflection]
        return [self.deflection[each] for each in self.law.arguments]  # type: ignore

    def values(self) -> Iterator[float]:
        """Iterate over the values of its parameters: of its stages, then of the contact as a whole."""
        for stage in self.stages:
            for parameter in self.law.stage_parameters:
                value = stage.number(parameter)
                assert value is not None  # checked on construction
                yield value
        yield from self.numbers.values()


def force(
    name: str,
    deflection: Mapping[str, float] | Mapping[str, Mapping[str, float]],
    law: str,
    *,
    acts_on: Mapping[str, float] | None = None,
    numbers: Mapping[str, float] | None = None,
    **more: float,
) -> Contact:
    """Make a force by a formula of one or several deflections.

    Parameters
    ----------
    name
        Prefix of its parameters' names.
    deflection
        The deflection by coordinate name, for example ``{"q1": 1, "q2": -1}``; in the formula it is ``x``, and its rate
        ``v``. Or several deflections by their names in the formula, ``{"r": {"q1": 1}, "s": {"q2": 1}}``, with the
        rates ``r'``, ``s'``.
    law
        The formula, with ``+ - * / **``, parentheses, ``sin cos exp log sqrt tanh abs min max`` and ``pi``; see
        `gapwalk.model.laws.formula`. All other names are parameters, and ``W``, if no value is given for it, is the
        angular frequency of the excitation (the speed of a rotor).
    acts_on
        The vector along which it acts, on the left-hand side of the equations of motion like a spring; by default its
        deflection. Required if there are several deflections.
    numbers
        The parameters by name; they may also be given as arguments.
    **more
        Further parameters by name, as `numbers`.

    Returns
    -------
    Contact
        The force.

    Raises
    ------
    FormulaError
        If the law is no formula; the message points to the column.
    ModelError
        If a parameter is missing, or a number is not allowed.

    Examples
    --------
    >>> gw.force("drag", {"x": 1.0}, "c*v*abs(v)", c=0.2).numbers
    {'c': 0.2}
    """
    several = bool(deflection) and all(isinstance(each, Mapping) for each in deflection.values())
    names = tuple(deflection) if several else ("x",)
    if several and acts_on is None and len(names) > 1:
        raise ModelError(
            f"force {name!r} has {len(names)} deflections, so it must be said where it acts; write acts_on, as in "
            '{"q1": 1.0}'
        )
    formula = Expression(law, names)
    if "W" not in {*names, *(numbers or {}), *more}:  # then it is the frequency
        formula = formula.with_frequency("W")
    return Contact(name, deflection, (), acts_on, formula, numbers, **more)  # type: ignore


formula_force = force  # friction has a keyword with the name of the function


def friction(
    name: str,
    deflection: Mapping[str, float],
    limit: float | str | None = None,
    *,
    numbers: Mapping[str, float] | None = None,
    coefficient: float | None = None,
    normal: str = "",
    stages_of: str = "",
    stiffness: float | None = None,
    static: float | None = None,
    speed: float | None = None,
    force: Mapping[str, float] | None = None,
) -> Any:
    """Make dry friction on a deflection: rigid (Coulomb), or in series with a spring (a Jenkins element).

    Parameters
    ----------
    name
        Prefix of its parameters' names.
    deflection
        The deflection by coordinate name; friction acts against its rate.
    limit
        The force in slip, >= 0; or a formula of it, of the slip rate ``v`` and the deflection ``x``, as in ``"mu*(n0 +
        k*x)/(1 + d*abs(v))"``. A motion on which the limit becomes negative is refused: write ``max(..., 0)``.
    numbers
        The parameters of the formula by name.
    coefficient, normal
        Instead of the limit: the coefficient of friction, and the name of the contact whose force presses.
    stages_of
        Name of a contact; each of its closed stages adds its `hysteresis` to `limit`, which is then 0 by default.
    stiffness
        Stiffness of the spring in series; without it friction sticks rigidly.
    static
        Force at which slip begins, divided by the force in slip, >= 1; for friction that sticks rigidly.
    speed
        Constant rate of the base, as of a belt: the slip rate is the rate of the deflection minus this speed.
    force
        The vector along which it acts, on the left-hand side of the equations of motion; by default its deflection.

    Returns
    -------
    Contact
        The friction. With a formula these are two contacts, which form one entry of a system's contacts; the second,
        ``<name>_load``, has the parameters of the formula, and exerts no force.

    Raises
    ------
    ModelError
        If its numbers are not allowed, or the limit is given twice or not at all.

    Examples
    --------
    >>> gw.friction("brake", {"x": 1.0}, 0.3, static=1.2).numbers
    {'limit': 0.3, 'static': 1.2, 'speed': 0.0}
    """
    if isinstance(limit, str):
        text = limit if speed is None else re.sub(r"\bv\b", "(v - speed)", limit)
        moving = {} if speed is None or text == limit else {"speed": speed}
        load = formula_force(f"{name}_load", deflection, text, acts_on={}, numbers={**(numbers or {}), **moving})
        load = replace(load, shares={f"{load.name}.{each}": f"{name}.{each}" for each in moving})
        more = {"static": static, "speed": speed, "force": force, "coefficient": coefficient or 1.0}
        return friction(name, deflection, normal=load.name, **more), load
    ways = (limit is not None and not stages_of, coefficient is not None, bool(stages_of))
    if sum(ways) != 1 or bool(normal) is (coefficient is None):
        given = {"limit": limit, "coefficient": coefficient, "normal": normal, "stages_of": stages_of}
        words = ", ".join(f"{each}={value!r}" for each, value in given.items() if value not in (None, ""))
        raise ModelError(
            f"friction {name!r} has {words or 'no limit'}; give a limit; or a coefficient with the contact that "
            'presses, as in coefficient=0.3, normal="stop"; or stages_of="clutch", whose stages have a hysteresis'
        )
    kind = Coulomb if stiffness is None else Jenkins
    law = kind("normal", normal) if normal else kind("stages", stages_of) if stages_of else kind()
    if stages_of and limit is None:
        limit = 0.0
    given = {"limit": limit, "coefficient": coefficient, "stiffness": stiffness, "static": static, "speed": speed}
    return Contact(
        name, deflection, (), force, law, {each: value for each, value in given.items() if value is not None}
    )


def backlash(
    name: str,
    deflection: Mapping[str, float],
    clearance: float,
    stiffness: float = 1.0,
    *,
    force: Mapping[str, float] | None = None,
    impact_damping: float = 0.0,
) -> Contact:
    """Make a symmetric gap of half-width `clearance` with one spring on either side (gear or clutch backlash).

    Parameters
    ----------
    name
        Prefix of its parameters' names.
    deflection
        The deflection by coordinate name, for example ``{"q1": 1, "q2": -1}``.
    clearance
        Half of the total backlash, >= 0, in units of the deflection.
    stiffness
        Stiffness of the spring on either side.
    force
        The vector along which it acts; by default its deflection.
    impact_damping
        Hunt and Crossley's coefficient, in 1/velocity; 0 for an elastic contact.

    Returns
    -------
    Contact
        The contact, with one stage on both sides.

    Raises
    ------
    ModelError
        If its numbers are not allowed.

    Notes
    -----
    The impact damping is that of Hunt and Crossley (1975), Journal of Applied Mechanics 42, 440-445.

    Examples
    --------
    >>> import gapwalk as gw
    >>> gw.backlash("teeth", {"x": 1.0}, 0.5, 20.0).name
    'teeth'
    """
    return stop(name, deflection, clearance, stiffness, side=Side.BOTH, force=force, impact_damping=impact_damping)


def stop(
    name: str,
    deflection: Mapping[str, float],
    clearance: float,
    stiffness: float,
    *,
    side: Side | str = Side.POSITIVE,
    force: Mapping[str, float] | None = None,
    impact_damping: float = 0.0,
) -> Contact:
    """Make a stop on one side, with one spring: it acts beyond `clearance`, on one sign of the deflection.

    Parameters
    ----------
    name
        Prefix of its parameters' names.
    deflection
        The deflection by coordinate name, for example ``{"q1": 1, "q2": -1}``.
    clearance
        Distance of the stop from zero deflection, >= 0, in units of the deflection.
    stiffness
        Stiffness of its spring.
    side
        ``"positive"`` or ``"negative"``: the sign of the deflections at which the stop acts.
    force
        The vector along which it acts; by default its deflection.
    impact_damping
        Hunt and Crossley's coefficient, in 1/velocity; 0 for an elastic contact.

    Returns
    -------
    Contact
        The contact, with one stage on one side.

    Raises
    ------
    ModelError
        If its numbers are not allowed.

    Notes
    -----
    The impact damping is that of Hunt and Crossley (1975), Journal of Applied Mechanics 42, 440-445.

    Examples
    --------
    >>> import gapwalk as gw
    >>> gw.stop("wall", {"x": 1.0}, 0.5, 20.0, side="negative").name
    'wall'
    """
    stages = (Stage(clearance, stiffness, side=side_of(side)),)
    if not impact_damping:
        return Contact(name, deflection, stages, force)
    return Contact(name, deflection, stages, force, "hunt-crossley", impact_damping=impact_damping)


def rigid_stop(
    name: str,
    deflection: Mapping[str, float],
    clearance: float,
    restitution: float,
    *,
    side: Side | str = Side.POSITIVE,
    force: Mapping[str, float] | None = None,
) -> Contact:
    """Make a rigid stop: where the deflection reaches the clearance, its rate is reversed.

    Parameters
    ----------
    name
        Prefix of its parameters' names.
    deflection
        The deflection by coordinate name.
    clearance
        Distance of the stop from zero deflection, >= 0.
    restitution
        Rate after an impact, divided by the rate before it: from 0 (no rebound) to 1 (no loss of energy).
    side
        ``"positive"``, ``"negative"``, or ``"both"`` for a gap between two rigid sides.
    force
        The vector along which the impulse acts; by default its deflection.

    Returns
    -------
    Contact
        The stop.

    Raises
    ------
    ModelError
        If its numbers are not allowed.

    Examples
    --------
    >>> gw.rigid_stop("wall", {"x": 1.0}, 1.0, 0.8).numbers
    {'restitution': 0.8}
    """
    return Contact(name, deflection, (Stage(clearance, side=side_of(side)),), force, "rigid", restitution=restitution)


def _stage_problems(contact: Contact):
    if contact.stages and not contact.law.stage_parameters:
        yield f"it has stages, but the law {contact.law.name!r} has none"
    elif not contact.stages and contact.law.stage_parameters:
        yield "it has no stage; give it at least one, with a clearance and a stiffness"
    if len(contact.stages) > 1:
        names = [stage.name for stage in contact.stages]
        if "" in names or len(set(names)) != len(names):
            yield f"its {len(names)} stages need names that differ, but they are {names}"
        for name in names:
            if name and (not name.isidentifier() or name in ("deflection", "force")):
                yield f"stage name {name!r}: write another word of letters, digits and underscores"
    for stage in contact.stages:
        if stage.stiffness == RIGID:
            yield f"the stiffness of a stage is {RIGID!r}; write the rigid stop as a contact of its own, by rigid_stop"
        if not stage.clearance >= 0:
            yield f"clearance is {stage.clearance}; it must be a number >= 0: {WITHIN}"
    yield from (f"stages {each}" for each in order_problems((each.side, each.clearance) for each in contact.stages))
    for sign in (1, -1):
        own = [stage for stage in contact.stages if sign in stage.side.signs and stage.stiffness != RIGID]
        slopes = accumulate(stage.stiffness for stage in own)
        for slope in slopes if contact.law.is_damped else ():
            if slope < 0:
                yield f"the slope of the force falls to {slope}; a damped contact needs slopes >= 0"


def order_problems(stages: Iterable[tuple[Side, float]]) -> Iterator[str]:
    """List each clearance that does not exceed that of the stage inside it, from the sides and clearances."""
    known = [(side, clearance) for side, clearance in stages if clearance >= 0]
    for sign, word in ((1, "positive"), (-1, "negative")):
        for inner, outer in pairwise(clearance for side, clearance in known if sign in side.signs):
            if outer <= inner:
                yield (
                    f"out of order on the {word} side: clearance {outer} follows {inner}; list the stages from the "
                    "inside out"
                )


def _number_problems(contact: Contact, given: Mapping[str, float]) -> Iterator[str]:
    law, own = contact.law, {each.name for each in contact.law.parameters}
    for name, value in given.items():
        if name not in own and value:
            try:
                hint = f'write law = "{law_with([name]).name}"'
            except ModelError:
                hint = f"its parameters are {', '.join(sorted(own)) or 'those of its stages'}"
            yield f"{name} is {value}, but the law is {law.name!r}; {hint}"
    for name, value in contact.numbers.items():
        if value is None and not is_computed(name):
            yield f"{name} is missing; the law {law.name!r} needs it"
    if all(value is not None for value in contact.numbers.values()):
        yield from law.problems(contact.numbers)
    for stage in contact.stages:
        known = {each.name for each in law.stage_parameters}
        for name in set(stage.numbers) - known:
            yield f"a stage has {name}, which the law {law.name!r} has not; its stages have {', '.join(sorted(known))}"
        for parameter in law.stage_parameters:
            if stage.number(parameter) is None:
                yield f"{parameter.name} of a stage is missing; {parameter.words}"


# Contacts without their numbers.


@dataclass(frozen=True, slots=True)
class StageForm:
    """A stage without its numbers: its name within the contact, and its side."""

    name: str
    side: Side


@dataclass(frozen=True, slots=True)
class ContactForm:
    """A contact without its numbers. A reciprocal one acts along its own deflection."""

    name: str
    stages: tuple[StageForm, ...]
    law: Law
    reciprocal: bool

    @classmethod
    def of(cls, contact: Contact, *, reciprocal: bool | None = None) -> ContactForm:
        """Make the form of a contact; a link of a drive train is always reciprocal."""
        stages = tuple(StageForm(stage.name, stage.side) for stage in contact.stages)
        return cls(contact.name, stages, contact.law, contact.force is None if reciprocal is None else reciprocal)

    @property
    def vectors(self) -> tuple[str, ...]:
        """Names of the vectors of its deflections."""
        return tuple(f"{self.name}.{each}" for each in self.deflections)

    @property
    def deflections(self) -> tuple[str, ...]:
        """Names of its deflections among its numbers: a single one is ``deflection``."""
        return self.law.arguments if self.law.arguments[1:] else ("deflection",)

    @property
    def push(self) -> str:
        """Name of the vector along which it acts."""
        return self.vectors[0] if self.reciprocal else f"{self.name}.force"

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of the parameters of its law: of its stages, then of the contact as a whole."""
        groups = [(self.stage_prefix(stage), self.law.stage_parameters) for stage in self.stages]
        groups.append((self.name, self.law.parameters))
        return tuple(f"{prefix}.{each.name}" for prefix, parameters in groups for each in parameters)

    @property
    def sides(self) -> list[tuple[StageForm, int]]:
        """Each stage with each side on which it acts, in the order of the switches."""
        return [(stage, sign) for stage in self.stages for sign in stage.side.signs]

    @property
    def shapes(self) -> tuple[StageShape, ...]:
        """The side of each switch, and whether its stage is the first there."""
        signs = [sign for _, sign in self.sides]
        return tuple(StageShape(sign, sign not in signs[:place]) for place, sign in enumerate(signs))

    @property
    def has_closed_form(self) -> bool:
        """True if the force is a sum of products."""
        return not self.law.rebounds and closed_form_of(self.law, self.shapes) is not None

    def closed_form(self, backend: str) -> tuple[Term, ...]:
        """Return the force as a sum of products."""
        terms = closed_form_of(self.law, self.shapes)
        if terms is None or not self.has_closed_form:
            reason = "reverses the rate at an impact" if self.law.rebounds else "is not a polynomial of the penetration"
            raise UnfitError(f"{backend} cannot include {self.name!r}: its force law {self.law.name!r} {reason}")
        return terms

    def stage_prefix(self, stage: StageForm) -> str:
        """Return the prefix of the names of a stage's parameters."""
        return f"{self.name}.{stage.name}" if stage.name else self.name


# The contacts that one table of a model file, or one link of a drive train, stands for.
#
# Springs with clearances are one contact. Dry friction beside them is another one, ``<name>_friction``, and a rigid
# stop beyond them a third, ``<name>_stop``: each has a law of its own, and all have one deflection.

SPRING_OF_FRICTION = "hysteresis_stiffness"
"""The number of a contact by which its hysteresis is that of Jenkins elements."""

OF_FRICTION = (HYSTERESIS.name, SPRING_OF_FRICTION)
"""Numbers of a table or a link that are those of the friction beside its springs."""

_BOUNCE = "restitution"


def friction_name(name: str) -> str:
    """Return the name of the friction beside the springs of a contact."""
    return f"{name}_friction"


def stop_name(name: str) -> str:
    """Return the name of the rigid stop beyond the springs of a contact."""
    return f"{name}_stop"


@dataclass(frozen=True)
class ContactParts:
    """The springs, the friction and the rigid stop of one table or link."""

    name: str  #: Name of the table or link.
    #: deflection, force: See `Contact`.
    deflection: Mapping[str, float]
    #: Its stages from the inside out. A rigid one has the stiffness `RIGID`, and the number `restitution`; any other
    #: may have the number `hysteresis`.
    stages: Sequence[Stage]
    force: Mapping[str, float] | None = None
    law: Law | str | None = None  #: The law of the springs, or its name; by default the first that has the numbers.
    #: The numbers of the law; `hysteresis`, the limit of friction that always acts; and `hysteresis_stiffness`.
    numbers: Mapping[str, Any] | None = None
    has_spring: bool = False  #: True if a spring that acts always is beside them, which is no contact.

    def contacts(self) -> tuple[Contact, ...]:
        """Make the contacts: springs, friction, rigid stop."""
        if problems := [*self._problems()]:
            raise ModelError("; ".join(problems))
        found = [self._springs(), self._friction(), self._stop()]
        return tuple(each for each in found if each is not None)

    @property
    def _own(self) -> dict[str, Any]:
        """The numbers of the law of the springs."""
        apart = (*OF_FRICTION, _BOUNCE) if self._rigid else OF_FRICTION
        return {name: value for name, value in (self.numbers or {}).items() if name not in apart}

    @property
    def _soft(self) -> tuple[Stage, ...]:
        return tuple(stage for stage in self.stages if stage not in self._rigid)

    @property
    def _rigid(self) -> tuple[Stage, ...]:
        whole = self.law is not None and isinstance(law_of(self.law), Rigid)
        return tuple(stage for stage in self.stages if whole or stage.stiffness == RIGID)

    @property
    def _friction_numbers(self) -> dict[str, Any]:
        return {name: value for name, value in (self.numbers or {}).items() if name in OF_FRICTION}

    @property
    def _by_stages(self) -> bool:
        """True if a stage has hysteresis."""
        return any(HYSTERESIS.name in stage.numbers for stage in self._soft)

    def _springs(self) -> Contact | None:
        if not self._soft:
            return None
        law = law_with(self._own) if self.law is None else law_of(self.law)
        return Contact(self.name, self.deflection, self._soft, self.force, law, self._own)

    def _friction(self) -> Contact | None:
        given = self._friction_numbers
        if not given and not self._by_stages:
            return None
        host = self.name if self._by_stages else ""
        limit, stiffness = given.get(HYSTERESIS.name, 0.0), given.get(SPRING_OF_FRICTION)
        name = friction_name(self.name)
        return friction(name, self.deflection, limit, stages_of=host, stiffness=stiffness, force=self.force)

    def _stop(self) -> Contact | None:
        if not self._rigid:
            return None
        alone = not (self._soft or self.has_spring)
        bounces: set[Any] = {stage.numbers.get(_BOUNCE, (self.numbers or {}).get(_BOUNCE)) for stage in self._rigid}
        stages = [replace(stage, stiffness=1.0, numbers={}) for stage in self._rigid]
        if len(stages) == 1 and not alone:
            stages = [replace(stages[0], name="")]
        name = self.name if alone else stop_name(self.name)
        (bounce,) = bounces
        return Contact(
            name, self.deflection, stages, self.force, RIGID, {**(self._own if alone else {}), _BOUNCE: bounce}
        )

    def _problems(self) -> Iterator[str]:
        given, rigid = self._friction_numbers, self._rigid
        if SPRING_OF_FRICTION in given and HYSTERESIS.name not in given and not self._by_stages:
            yield f"{SPRING_OF_FRICTION} is given without hysteresis; write hysteresis = ..., the limit of the friction"
        for name, value in [*given.items(), *((HYSTERESIS.name, each.numbers.get(HYSTERESIS.name)) for each in rigid)]:
            if name == HYSTERESIS.name and isinstance(value, int | float) and value < 0.0:
                yield f"hysteresis is {value:g}; it must be >= 0: friction only takes energy"
        if any(HYSTERESIS.name in stage.numbers for stage in rigid):
            yield "a rigid stage has hysteresis; its impacts lose energy by the restitution: leave hysteresis out"
        law, whole = None if self.law is None else law_of(self.law), (self.numbers or {}).get(_BOUNCE)
        if rigid and not self._soft and not (law is None or isinstance(law, Rigid)):
            yield f'law is {law.name!r}, but the stiffness is "rigid"; leave law out'
        for stage in rigid:
            if stage.stiffness not in (RIGID, Stage(0.0).stiffness):
                yield f'stiffness is {stage.stiffness}, but the law is "rigid"; leave one of the two out'
        if self._soft and whole is not None and law is None:
            where = "move restitution to the stage that is rigid" if rigid else 'write stiffness = "rigid" beside it'
            yield f"restitution is {whole}, but a stage has a stiffness; {where}, or leave it out"
        bounces: set[Any] = {stage.numbers.get(_BOUNCE, whole) for stage in rigid}
        if rigid and None in bounces:
            yield 'restitution is missing beside the stiffness "rigid"; write restitution = 0.8, say'
        elif len(bounces) > 1:
            shown = " and ".join(f"{each:g}" for each in sorted(bounces))
            yield f"its rigid stages have the restitutions {shown}; write two contacts, one for each side"
        for sign, word in ((1, "positive"), (-1, "negative")):
            side = [stage for stage in self.stages if sign in stage.side.signs]
            for place, stage in enumerate(side[:-1]):
                if stage.stiffness == RIGID:
                    yield (
                        f"the stage beyond the rigid one on the {word} side is never reached "
                        f"(clearance {side[place + 1].clearance:g} beyond {stage.clearance:g}); leave it out"
                    )

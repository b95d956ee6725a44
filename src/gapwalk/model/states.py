"""States without inertia: coordinates ``z`` whose equations are of first order, ``z' = f(z, x, v)``.

A state is computed from a coordinate ``y`` that follows it with a lag, ``z = y + g y'``. So an equation of z of first
order is one of y of second order, exactly: ``c z' + k z = f`` becomes ``g c y'' + (c + g k) y' + k y = f``. The lag is
the inverse of the frequency at which a system is made.

Method: docs/numerics/notes/models.md
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Annotated, Any

from annotated_types import Ge, Le

from gapwalk.errors import ModelError
from gapwalk.model.bounds import Finite, check
from gapwalk.model.contact import Contact, ContactForm
from gapwalk.model.laws import Expression
from gapwalk.model.laws.formula import PACE, STATE_LAG, FormulaError, formula_of
from gapwalk.model.problems import did_you_mean
from gapwalk.model.registry import Parameter, Registry
from gapwalk.model.units import QuantityKind

LAG = "_lag"
"""The end of the name of the coordinate that carries a state."""
FAST = "_fast"
"""The end of the name, in a formula, of the part of a deflection that has no inertia."""
RATE = "_rate"
"""The end of the name of the contact that is the rate of a state, beside the one that is its force."""


@dataclass(frozen=True, init=False)
class State:
    """A state without inertia: ``z' = rate``, and a force that depends on it.

    Raises
    ------
    ModelError
        If a formula is none, or a number is missing or not allowed.

    Examples
    --------
    >>> gw.State("rubber", "(x - z)*k/c", {"x": 1.0}, force="k*(x - z)", k=2.0, c=0.5).numbers
    {'k': 2.0, 'c': 0.5}
    """

    name: str  #: Its name in formulas of other forces and states, and prefix of its parameters' names.
    #: The formula of its rate: ``z`` is the state, ``x`` the deflection and ``v`` its rate; see `gapwalk.force`.
    rate: str
    #: The deflection by coordinate name, or several of them by their names in the formulas. Without one, the formulas
    #: name coordinates: ``"(q1 - z)*k/c"``.
    deflection: Mapping[str, Any] | None = field(default=None, hash=False)
    force: str = ""  #: The formula of its force; without one, it has none, but formulas of other forces may name it.
    #: The vector along which the force acts, on the left-hand side of the equations; by default the deflection.
    acts_on: Mapping[str, float] | None = field(default=None, hash=False)
    numbers: Mapping[str, float] = field(default_factory=dict, hash=False)  #: The parameters of both formulas by name.

    def __init__(
        self,
        name: str,
        rate: str,
        deflection: Mapping[str, Any] | None = None,
        *,
        force: str = "",
        acts_on: Mapping[str, float] | None = None,
        numbers: Mapping[str, float] | None = None,
        **more: float,
    ) -> None:
        given = {**(numbers or {}), **more}
        for each, value in zip(fields(self), (name, rate, deflection, force, acts_on, given), strict=True):
            object.__setattr__(self, each.name, value)
        for what, text in (("rate", rate), ("force", force)):
            try:
                if text or what == "rate":
                    formula_of(text, ["x", "x'", "v", "z", "z'"])
            except FormulaError as error:
                raise ModelError(f"state {name!r}: {what} is {text!r}, column {error.column}: {error.reason}") from None
        for number, value in given.items():
            check(f"state {name!r}: {number}", value, Finite)
        if acts_on is not None and not force:
            raise ModelError(f'state {name!r} acts on {acts_on}, but has no force; write force = "k*(x - z)", say')

    @classmethod
    def of(cls, kind: str, name: str, deflection: Mapping[str, float], **numbers: Any) -> State:
        """Make a state of a known kind, whose formulas are built in.

        Parameters
        ----------
        kind
            ``"maxwell"``: a spring in series with a damper, with the numbers `stiffness` and `damping`; z is the
            deflection of the damper. ``"bouc_wen"``: hysteresis (Wen 1976, Journal of the Engineering Mechanics
            Division 102, 249-263), ``z' = A v - beta |v| |z|^(n-1) z - gamma v |z|^n`` with the force
            ``stiffness (share x + (1 - share) z)``.
        name
            Its name.
        deflection
            The deflection by coordinate name; the force acts along the same vector.
        **numbers
            Its numbers.

        Returns
        -------
        State
            The state.

        Raises
        ------
        ModelError
            If a number is missing or not allowed.

        Examples
        --------
        >>> gw.State.of("maxwell", "rubber", {"x": 1.0}, stiffness=2.0, damping=0.5).force
        'stiffness*(x - z)'
        """
        known = STATE_KINDS.named(kind)
        whole = {each: numbers.pop(each, default) for each, default in known.whole.items()}
        for each, value in whole.items():
            check(f"{kind} {name!r}: {each}", value, Annotated[int, Ge(1), Le(_MOST)])
        n = whole.get("n", 1)
        power = "z" if n == 1 else f"z**{n}" if n % 2 else "abs(z)*z" if n == 2 else f"abs(z)*z**{n - 1}"
        texts = {"power": power, "even": f"abs(z)**{n}" if n % 2 else f"z**{n}"}
        given = {each.name: numbers.pop(each.name, each.default) for each in known.parameters}
        for each in known.parameters:
            if given[each.name] is None:
                raise ModelError(f"{kind} {name!r} has no {each.name}; {each.words}: write {each.name} = 1.0")
        if numbers:
            hint = did_you_mean(next(iter(numbers)), [*given, *whole], "its numbers are")
            raise ModelError(f"{kind} {name!r} has {next(iter(numbers))}, which is none of its numbers; {hint}")
        return cls(name, known.rate.format(**texts), deflection, force=known.force, numbers=given)

    def contacts(self, coordinates: Sequence[str]) -> list[Contact]:
        """Return its force, if it has one, and its rate, as forces by formulas of coordinates and states."""
        moves = self.deflection or {}
        several = all(isinstance(each, Mapping) for each in moves.values())
        known = dict(moves) if several else {"x": moves}
        if self.deflection is None:
            known = {each: {each: 1.0} for each in coordinates}
        own = {} if "z" in {*known, *coordinates, *self.numbers} else {"z": {self.name: 1.0}}
        vectors = {each: {each: 1.0} for each in coordinates if each not in self.numbers} | own | known
        force = [self._contact(self.name, self.force, vectors, self._direction(known))] if self.force else []
        text = f"-({self.rate}) - {self.name}/{STATE_LAG}"  # the second part is in the matrices too: they are regular
        rate = self._contact(f"{self.name}{RATE}" if force else self.name, text, vectors, {self.name: 1.0})
        wanted = {each.name for contact in (*force, rate) for each in contact.law.parameters}
        for name in self.numbers:
            if name not in wanted:
                hint = did_you_mean(name, sorted(wanted), "its numbers are") if wanted else "its formulas have none"
                raise ModelError(f"state {self.name!r} has {name}, which is none of its numbers; {hint}")
        return [*force, replace(rate, shares=dict(_shared(force[0], rate)))] if force else [rate]

    def _direction(self, known: Mapping[str, Any]) -> Mapping[str, float]:
        """Return where its force acts."""
        if self.acts_on is not None:
            return self.acts_on
        if self.deflection is None or len(known) > 1:
            raise ModelError(
                f"state {self.name!r} has a force, but no single deflection; write where it acts, as in "
                "acts_on = { q1 = 1.0 }"
            )
        return next(iter(known.values()))

    def _contact(self, name: str, text: str, vectors: Mapping[str, Any], direction: Mapping[str, float]) -> Contact:
        if "v" not in {*vectors, *self.numbers} and "x" in vectors:
            text = _with(text, {"v": "x'"})
        used = formula_of(text, [*vectors, *(f"{each}'" for each in vectors)]).variables
        if any(f"{each}'" in used for each in ("z", self.name) if vectors.get(each) == {self.name: 1.0}):
            raise ModelError(f"state {self.name!r}: a formula contains its own rate; write that rate's formula")
        arguments = [each for each in vectors if {each, f"{each}'"} & {*used}]
        if not arguments:
            raise ModelError(
                f"state {self.name!r}: the formula {text!r} has neither the state z nor a deflection; write "
                f'rate = "(x - z)/T" with deflection = {{ q1 = 1.0 }}, say'
            )
        law = Expression(text, tuple(arguments))
        if "W" not in self.numbers:  # then it is the frequency
            law = law.with_frequency("W")
        for each in law.parameters:
            if each.name not in self.numbers and each.name not in _COMPUTED:
                raise ModelError(f"state {self.name!r}: {each.name} is missing; write {each.name} = 1.0")
        given = {each.name: self.numbers.get(each.name) for each in law.parameters}
        moves = {each: vectors[each] for each in arguments}
        return Contact(name, moves if len(moves) > 1 else next(iter(moves.values())), (), direction, law, given)  # type: ignore


# States that have a name of their own: springs in series with dampers, and hysteresis.


@dataclass(frozen=True)
class StateKind:
    """A state with known formulas: a table ``[[maxwell]]`` of model files, and the word of `State.of`."""

    name: str  #: Its name.
    words: str  #: Description, in a few words.
    parameters: tuple[Parameter, ...]  #: Its numbers.
    rate: str  #: The formula of its rate.
    force: str  #: The formula of its force.
    #: Whole numbers in its formulas: their defaults.
    whole: Mapping[str, int] = field(default_factory=dict, hash=False)


STATE_KINDS: Registry[StateKind] = Registry("kind of state", "kinds of states")
"""All kinds of states that have formulas of their own."""

for _kind in (
    StateKind(
        "maxwell",
        "a spring in series with a damper",
        (
            Parameter("stiffness", QuantityKind.STIFFNESS, "it is the spring of a spring in series with a damper"),
            Parameter("damping", QuantityKind.DAMPING, "it is the damper in series with that spring"),
        ),
        "(x - z)*stiffness/damping",
        "stiffness*(x - z)",
    ),
    StateKind(
        "bouc_wen",
        "the hysteresis of Bouc and Wen",
        (
            Parameter("stiffness", QuantityKind.STIFFNESS, "it belongs to the elastic and the hysteretic part"),
            Parameter("share", None, "it is the elastic share of the stiffness, from 0 to 1"),
            Parameter("A", None, "it is the slope of z over x at rest", 1.0),
            Parameter("beta", None, "it is the factor of |x'| |z|^(n-1) z", None, angle=-1),
            Parameter("gamma", None, "it is the factor of x' |z|^n", None, angle=-1),
        ),
        "A*v - beta*abs(v)*{power} - gamma*v*{even}",
        "stiffness*(share*x + (1 - share)*z)",
        {"n": 1},
    ),
):
    STATE_KINDS.add(_kind.name, _kind)


_MOST = 8  # of the exponent of a hysteresis

# How a state becomes forces by formulas of the coordinates that carry states.

_COMPUTED = (PACE, STATE_LAG)
_WORD = r"(?<![\w.])[^\W\d]\w*'?"


def _with(text: str, instead: Mapping[str, str]) -> str:
    """Return a formula with other names, or parts, in place of some names."""
    return re.sub(_WORD, lambda match: instead.get(match[0], match[0]), text)


def lagged(contact: Contact, massless: Collection[str]) -> tuple[Contact, list[tuple[str, str]]]:
    """Return a contact as one of the coordinates that carry states, and the copies that it makes of its own vectors.

    A deflection ``x`` of such coordinates becomes ``(x + state_lag*x_fast')``, with the part x_fast of x that has no
    inertia.
    """
    names = contact.law.arguments
    vectors = dict(zip(names, contact.vectors, strict=True))
    own = {each: {n: x for n, x in vector.items() if n in massless and x} for each, vector in vectors.items()}
    slow = {each: vector for each, vector in own.items() if vector}
    if not slow:
        return contact, []
    where = " and ".join(dict.fromkeys(name for vector in slow.values() for name in vector))
    if not isinstance(contact.law, Expression):
        raise ModelError(
            f"mass gives {where} no inertia, but {contact.name} deflects with it; write a force by a formula in its "
            'place, as in law = "k*max(x - g, 0)", or give the coordinate an inertia'
        )
    text = contact.law.text
    if names == ("x",):
        text = _with(text, {"v": "x'"})
    if any(f"{each}'" in re.findall(_WORD, text) for each in slow):
        raise ModelError(
            f"{contact.name} depends on the rate of {where}, which has no inertia; only the matrix damping may act on "
            "that rate: leave it out of the formula"
        )
    text = _with(text, {each: f"({each} + {STATE_LAG}*{each}{FAST}')" for each in slow})
    law = Expression(text, (*names, *(f"{each}{FAST}" for each in slow)))
    moves: Any = vectors | {f"{each}{FAST}": vector for each, vector in slow.items()}
    numbers: Any = {each.name: contact.numbers.get(each.name) for each in law.parameters}
    made = Contact(contact.name, moves, (), contact.force or contact.vectors[0], law, numbers)
    forms = dict(zip(names, ContactForm.of(contact).vectors, strict=True))
    copies = [(f"{contact.name}.{each}", vector) for each, vector in forms.items()]
    copies += [(f"{contact.name}.{each}{FAST}", forms[each]) for each in slow]
    return made, copies + [(f"{contact.name}.force", forms[names[0]])] * (contact.force is None)


def _shared(force: Contact, rate: Contact) -> Iterator[tuple[str, str]]:
    """Iterate over the numbers of the rate of a state that are those of the state: by both of their names."""
    vectors = dict(zip(force.law.arguments, ContactForm.of(force).vectors, strict=True))
    for each, name in zip(rate.law.arguments, ContactForm.of(rate).vectors, strict=True):
        yield name, vectors.get(each, f"{force.name}.{each}")
    for each in rate.law.parameters:
        if each.name not in _COMPUTED:
            yield f"{rate.name}.{each.name}", f"{force.name}.{each.name}"


def carried(
    massless: Collection[str], contacts: Sequence[Contact], loads: Sequence[Any], copies: Mapping[str, str]
) -> tuple[list[Contact], list[Any], dict[str, str]]:
    """Return contacts, loads and copies of numbers, as the coordinates that carry states without inertia have them."""
    if not massless:
        return [*contacts], [*loads], dict(copies)
    pairs = [lagged(contact, massless) for contact in contacts]
    found = dict(copies) | {name: copies.get(own, own) for _, each in pairs for name, own in each}
    forms = [ContactForm.of(contact) for contact, _ in pairs]
    known = {name for form in forms for name in (*form.vectors, form.push, *form.parameters)}
    found = {name: own for name, own in found.items() if name in known and name != own}
    return [contact for contact, _ in pairs], [_varying(load, found, known) for load in loads], found


def _varying(load: Any, copies: Mapping[str, str], known: Collection[str]) -> Any:
    """Return a load that varies all numbers of the equations, whose names are known, that are one of the system."""
    varies: dict[str, float] = {}
    for name, factor in load.varies.items():
        same = [each for each, own in copies.items() if own == name and not each.endswith((FAST, ".force"))]
        for each in [*same, *([name] if name in known or not same else [])]:
            varies[each] = factor
    return load if varies == dict(load.varies) else replace(load, varies=varies)

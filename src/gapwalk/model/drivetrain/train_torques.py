"""Torques between two inertias that are no springs: by a formula, and dry friction."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Self

from gapwalk.errors import ModelError
from gapwalk.model.contact import Contact
from gapwalk.model.contact import friction as make_friction
from gapwalk.model.drivetrain.train_parts import OF_LINKS, Change, Link
from gapwalk.model.laws import FRICTION, Expression

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

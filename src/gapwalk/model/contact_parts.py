"""The contacts that one table of a model file, or one link of a drive train, stands for.

Springs with clearances are one contact. Dry friction beside them is another one, ``<name>_friction``, and a rigid stop
beyond them a third, ``<name>_stop``: each has a law of its own, and all have one deflection.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from gapwalk.errors import ModelError
from gapwalk.model.contact import RIGID, Contact, Stage, friction
from gapwalk.model.laws import HYSTERESIS, Law, Rigid, law_of, law_with

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

"""Bodies of a machine and the elements between them, as they are read from a model, without places on a drawing."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import zip_longest

from gapwalk.flow.motion import force_of
from gapwalk.model.loads import Harmonic
from gapwalk.model.structure import ContactForm, StageForm
from gapwalk.model.system import System

BASE = -1
"""The number of the base, which does not move."""

STAGES = ("2nd stage", "3rd stage", "4th stage")
"""Names of the stages of a contact after the first one."""

_PAIRS = 3  # of stages that are drawn one by one


@dataclass(frozen=True)
class Push:
    """A load on a body."""

    name: str  #: Its name.
    #: 1 if it pushes along the displacement of the body, to the right in a drawing; -1 if against it. For a harmonic
    #: load this is its direction at its maximum.
    way: int

    @classmethod
    def of(cls, name: str, amount: float) -> Push:
        """Return the push of a load by some amount along the displacement of a body."""
        return cls(name, 1 if amount > 0.0 else -1)

    @property
    def label(self) -> str:
        """Its name; or, if the file gives a harmonic load none, its order: ``order 2``."""
        order = self.name.removeprefix(Harmonic.key).replace("_", ".")
        return f"order {order}" if order[:1].isdigit() and self.name.startswith(Harmonic.key) else self.name


@dataclass(frozen=True)
class Body:
    """A body that moves, or a place at which a contact acts."""

    name: str  #: Its name, or the combination of coordinates by which it moves.
    #: Its displacement by the coordinates, as (number, factor). In a train it is divided by the speed at which the
    #: inertia turns with the first one, so that a link without deflection keeps its length.
    row: tuple[tuple[int, float], ...]
    mass: float = 0.0  #: Its mass or inertia; 0 if it is only a place.
    signal: str = ""  #: Signal that says how it moves; empty if there is none.
    pushes: tuple[Push, ...] = ()  #: The loads on it.

    @property
    def loads(self) -> tuple[str, ...]:
        """Names of the loads on it."""
        return tuple(push.name for push in self.pushes)


@dataclass(frozen=True)
class Element:
    """One element between two bodies."""

    #: ``"spring"``, ``"damper"``, ``"gap"``, ``"friction"``, ``"slider"`` (friction in series with a spring),
    #: ``"formula"``, ``"gear"`` (rigid), or ``"coupling"``, which is an entry of a matrix that is no spring.
    kind: str
    name: str  #: Its name or its value; empty for none.
    words: str  #: Description, for readers who do not see the drawing.
    #: contact, signal: Name of its contact, and of the signal that is its force; empty for none.
    contact: str = ""
    signal: str = ""
    #: Clearances on the negative and the positive side of the deflection; None where it has no stop.
    edges: tuple[float | None, float | None] = (None, None)
    detail: str = ""  #: The clearances, or the limit, with their unit.
    is_rigid: bool = False  #: True for a rigid stop.
    is_curved: bool = False  #: True for a spring whose force is no straight line.


@dataclass(frozen=True)
class Link:
    """The elements between two bodies."""

    ends: tuple[int, int]  #: Numbers of the two bodies; `BASE` for the base, as the second one.
    sign: int  #: Sign of the deflection of its contacts while the first end moves ahead of the second.
    elements: tuple[Element, ...]  #: The elements, in parallel.


@dataclass(frozen=True)
class Machine:
    """Bodies and the links between them."""

    #: bodies, links: What there is.
    bodies: tuple[Body, ...]
    links: tuple[Link, ...]
    notes: tuple[str, ...] = ()  #: Sentences on what is drawn in another way than it is in the model.
    turns: bool = False  #: True if displacements are angles.


def elements_of(system: System, form: ContactForm, name: str = "") -> Iterator[Element]:
    """Give the elements of a contact: its stages in pairs of both sides, or friction, or a formula."""
    law, signal = form.law, force_of(form)
    index = system.structure.contacts.index(form)
    varies = "(θ)" if any(each.contact == index for each in system.structure.variations) else ""
    name = (name or form.name) + varies
    varying = ", varies over the angle" * bool(varies)
    if law.is_dry:
        kind, what = ("slider", "friction in series with a spring") if law.has_memory else ("friction", "dry friction")
        detail = _friction_detail(system, form)
        words = f"{form.name}: {what}{f', {detail}' if detail else ''}{varying}"
        yield Element(kind, name, words, form.name, signal, detail=detail)
    elif not form.stages:
        yield Element("formula", name, f"{form.name}: force by a formula{varying}", form.name, signal)
    else:
        yield from _stages(system, form, name, signal, varying)


def _friction_detail(system: System, form: ContactForm) -> str:
    limit, speed = f"{form.name}.limit", f"{form.name}.speed"
    if speed in system.parameters and system[speed]:
        return f"moves at {_number(system, speed)}"
    if form.law.host:
        return f"by {form.law.host}"
    return f"limit {_number(system, limit)}" if limit in system.parameters else ""


def _stages(system: System, form: ContactForm, name: str, signal: str, varying: str) -> Iterator[Element]:
    sides: dict[int, list[tuple[float, StageForm]]] = {-1: [], 1: []}
    for stage, sign in form.sides:
        sides[sign].append((system[f"{form.stage_prefix(stage)}.clearance"], stage))
    for each in sides.values():
        each.sort(key=lambda found: found[0])
    low, high = sides[-1], sides[1]
    pairs = [*zip_longest(low, high)]
    what, rigid = ("rigid stop", True) if form.law.rebounds else ("spring", False)
    if len(pairs) > _PAIRS:
        words = f"{form.name}: spring by a curve of {len(form.stages)} stages{varying}"
        yield Element("spring", name, words, form.name, signal, detail=f"{len(form.stages)} stages", is_curved=True)
        return
    for number, (left, right) in enumerate(pairs):
        edges = (left[0] if left else None, right[0] if right else None)
        stage = (right or left)[1].name  # type: ignore[index]
        own = STAGES[number - 1] if number else name
        whole = f"{form.name}{f', {stage}' if stage and number else ''}"
        if edges == (0.0, 0.0) and not rigid:
            cubic = f"{form.stage_prefix((right or left)[1])}.cubic"  # type: ignore[index]
            words, is_curved = f"{whole}: spring that never opens{varying}", bool(system.parameters.get(cubic))
            yield Element("spring", own, words, form.name, signal, is_curved=is_curved)
            continue
        detail = _edge_words(system, form, left, right) if any(edges) else "no gap"
        words = f"{whole}: {what} {f'with a gap of {detail}' if any(edges) else 'without a gap'}{varying}"
        yield Element("gap", own, words, form.name, signal, edges, detail, rigid)


def _edge_words(
    system: System, form: ContactForm, left: tuple[float, StageForm] | None, right: tuple[float, StageForm] | None
) -> str:
    parts = [each and f"{form.stage_prefix(each[1])}.clearance" for each in (left, right)]
    unit = system.units.parameter(next(filter(None, parts))) if system.units else ""
    low, high = left and f"{left[0]:.3g}", right and f"{right[0]:.3g}"
    text = f"±{high}" if low == high else " / ".join(filter(None, (high and f"+{high}", low and f"−{low}")))
    return f"{text} {unit}".strip()


def _number(system: System, name: str) -> str:
    unit = system.units.parameter(name) if system.units else ""
    return f"{system[name]:.3g} {unit}".strip()


def combination(terms: tuple[tuple[str, float], ...]) -> str:
    """Write a combination of coordinates: ``q1 − 2 q2``."""
    text = ""
    for name, factor in terms:
        size = "" if abs(factor) == 1.0 else f"{abs(factor):.3g} "
        sign = "−" if factor < 0.0 else "+"
        text += f" {sign} {size}{name}" if text else f"{'−' if factor < 0.0 else ''}{size}{name}"
    return text

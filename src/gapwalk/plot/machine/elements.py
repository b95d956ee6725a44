"""Bodies of a machine and the elements between them, as they are read from a model, without places on a drawing."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from html import escape
from itertools import zip_longest
from typing import TYPE_CHECKING, Any

from gapwalk.flow.motion import force_of
from gapwalk.meanings import color_of
from gapwalk.model.contact import ContactForm, StageForm
from gapwalk.model.loads import Harmonic
from gapwalk.model.system import System

if TYPE_CHECKING:
    from matplotlib.axes import Axes


# The drawing of a machine as one description, which SVG, matplotlib and the page of the explorer draw alike.
#
# A point of the drawing moves along with bodies: its place at an instant is ``x + sum of share * displacement`` of its
# movers, in pixels. So a spring between two bodies stretches, and the tongue in a gap stays at its stop while the
# spring behind it is compressed. Whoever draws the scene needs only lines, circles and texts.


@dataclass(frozen=True, slots=True)
class Point:
    """A point that moves: its place at rest, and the number and share of each of its movers."""

    x: float
    y: float
    moves: tuple[tuple[int, float], ...] = ()


@dataclass(frozen=True, slots=True)
class Shape:
    """A shape of the drawing."""

    kind: str  #: ``"line"``, ``"area"`` (closed), ``"circle"`` or ``"text"``.
    look: str  #: Names of its style, separated by spaces.
    points: tuple[Point, ...]  #: Its points; the centre of a circle, the place of a text.
    #: text, anchor: The text, and where its place is in it: ``"start"``, ``"middle"`` or ``"end"``.
    text: str = ""
    anchor: str = "middle"
    radius: float = 0.0  #: Radius of a circle.
    part: int = -1  #: Number of the part to which it belongs; -1 for none.


@dataclass(frozen=True, slots=True)
class Part:
    """A part that can be chosen: a body or an element."""

    kind: str  #: ``"body"``, or the kind of the element.
    #: name, words: Its name, and its description.
    name: str
    words: str
    #: contact, signal: Name of its contact, and of the signal that says most of it; empty for none.
    contact: str
    signal: str
    box: tuple[float, float, float, float]  #: Left, upper, right and lower edge of what it covers at rest.


@dataclass(frozen=True, slots=True)
class Mover:
    """A displacement on which points depend: that of a body, or of a contact within its gap."""

    #: ``"body"``; ``"gap"``, the deflection as far as the gap allows; or ``"slider"``, the slider of friction that
    #: sticks by a spring.
    kind: str
    row: tuple[tuple[int, float], ...] = ()  #: The displacement of a body by the coordinates, as (number, factor).
    contact: str = ""  #: Name of the contact.
    sign: int = 1  #: Direction on the drawing of a positive deflection, 1 or -1, while the left end is at rest.
    #: low, high: Clearances on the negative and positive side; None where there is no stop.
    low: float | None = None
    high: float | None = None
    #: low_width, high_width: Their widths on the drawing.
    low_width: float = 0.0
    high_width: float = 0.0


@dataclass(frozen=True, slots=True)
class Scene:
    """The drawing of a machine at rest, and how it moves."""

    #: width, height: Size in pixels.
    width: float
    height: float
    words: str  #: Description, for readers who do not see it.
    #: movers, parts, shapes: What moves, what can be chosen, and what is drawn.
    movers: tuple[Mover, ...]
    parts: tuple[Part, ...]
    shapes: tuple[Shape, ...]
    notes: tuple[str, ...] = ()  #: Sentences on what is drawn in another way than it is in the model.

    def to_dict(self) -> dict[str, Any]:
        """Return the scene as plain values, short enough for a page: points are lists of x, y and their movers."""
        return {
            "width": self.width,
            "height": round(self.height, 1),
            "words": self.words,
            "notes": list(self.notes),
            "movers": [
                {
                    "kind": each.kind,
                    "contact": each.contact,
                    "sign": each.sign,
                    "stops": [each.low, each.high],
                    "widths": [round(each.low_width, 2), round(each.high_width, 2)],
                }
                for each in self.movers
            ],
            "parts": [
                {
                    "kind": each.kind,
                    "name": each.name,
                    "words": each.words,
                    "contact": each.contact,
                    "signal": each.signal,
                    "box": [round(edge, 1) for edge in each.box],
                }
                for each in self.parts
            ],
            "shapes": [_plain(shape) for shape in self.shapes],
        }


def _plain(shape: Shape) -> dict[str, Any]:
    places = [
        [round(p.x, 1), round(p.y, 1), [[mover, round(share, 4)] for mover, share in p.moves if share]]
        for p in shape.points
    ]
    found: dict[str, Any] = {"kind": shape.kind, "look": shape.look, "points": places, "part": shape.part}
    if shape.kind == "text":
        found |= {"text": shape.text, "anchor": shape.anchor}
    if shape.kind == "circle":
        found["radius"] = shape.radius
    return found


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
    name = name or form.name
    name += varies * (not name.endswith("(θ)"))  # a link that is displaced as well has it already
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
        sides[sign].append((system.equations[f"{form.stage_prefix(stage)}.clearance"], stage))
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
        detail = _edge_words(system, left, right) if any(edges) else "no gap"
        words = f"{whole}: {what} {f'with a gap of {detail}' if any(edges) else 'without a gap'}{varying}"
        yield Element("gap", own, words, form.name, signal, edges, detail, rigid)


def _edge_words(system: System, left: tuple[float, StageForm] | None, right: tuple[float, StageForm] | None) -> str:
    unit = system.units.state("") if system.units else ""
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


# The symbols of elements between two ends on a drawing: springs, dampers, gaps, friction, formulas, gears.

LETTER = 10.5
"""Height of letters, in pixels."""

LEAD = 9.0  # pixels between an end and the symbol
HEIGHT = 18.0
"""Height of a symbol, in pixels."""

_WIDEST, _NARROWEST = 12.0, 5.0  # gap on a drawing, in pixels
_PLATE = 30.0  # length of a plate of friction

Moves = tuple[tuple[int, float], ...]


@dataclass
class Pen:
    """A drawing in the making: shapes, parts and movers so far."""

    largest: float  #: The largest clearance of the machine, which has the widest gap.
    shapes: list[Shape] = field(default_factory=list)
    parts: list[Part] = field(default_factory=list)
    movers: list[Mover] = field(default_factory=list)
    part: int = -1

    def line(self, look: str, *points: Point) -> None:
        """Draw a line through points."""
        self.shapes.append(Shape("line", look, points, part=self.part))

    def area(self, look: str, *points: Point) -> None:
        """Draw a closed shape."""
        self.shapes.append(Shape("area", look, points, part=self.part))

    def box(self, look: str, x0: float, y0: float, x1: float, y1: float, moves: Moves = ()) -> None:
        """Draw a rectangle."""
        self.area(look, *(Point(x, y, moves) for x, y in ((x0, y0), (x1, y0), (x1, y1), (x0, y1))))

    def circle(self, look: str, point: Point, radius: float) -> None:
        """Draw a circle."""
        self.shapes.append(Shape("circle", look, (point,), radius=radius, part=self.part))

    def text(self, look: str, x: float, y: float, text: str, anchor: str = "middle", moves: Moves = ()) -> None:
        """Write a text, whose letters stand on `y`."""
        self.shapes.append(Shape("text", look, (Point(x, y, moves),), text, anchor, part=self.part))

    def mover(self, mover: Mover) -> int:
        """Add something that moves, and return its number."""
        self.movers.append(mover)
        return len(self.movers) - 1

    def width_of(self, clearance: float | None) -> float:
        """Return the width of a gap, to scale with the others where it can be seen."""
        if clearance is None:
            return 0.0
        return 0.0 if not clearance else min(_WIDEST, max(_NARROWEST, _WIDEST * clearance / self.largest))


@dataclass(frozen=True)
class Span:
    """The room of an element: its left and right end, the bodies there, its height, and the sign of its deflection."""

    x0: float
    x1: float
    y: float
    left: int
    right: int
    sign: int

    def at(self, x: float, dy: float = 0.0) -> Point:
        """Return a point that stretches with the distance of both ends."""
        share = (x - self.x0) / (self.x1 - self.x0)
        return Point(x, self.y + dy, _moves((self.left, 1.0 - share), (self.right, share)))

    def on_left(self, x: float, dy: float = 0.0) -> Point:
        """Return a point that moves with the left end."""
        return Point(x, self.y + dy, _moves((self.left, 1.0)))

    def on_right(self, x: float, dy: float = 0.0) -> Point:
        """Return a point that moves with the right end."""
        return Point(x, self.y + dy, _moves((self.right, 1.0)))

    def within(self, mover: int, x: float, dy: float = 0.0) -> Point:
        """Return a point that moves with the left end and within a gap."""
        return Point(x, self.y + dy, (*_moves((self.left, 1.0)), (mover, 1.0)))

    def behind(self, mover: int, x: float, start: float, dy: float = 0.0) -> Point:
        """Return a point between one within a gap, whose place is `start`, and the right end."""
        share = (x - start) / (self.x1 - start)
        return Point(x, self.y + dy, (*_moves((self.left, 1.0 - share), (self.right, share)), (mover, 1.0 - share)))


def _moves(*pairs: tuple[int, float]) -> Moves:
    return tuple((mover, share) for mover, share in pairs if mover != BASE and share)


def height_of(element: Element) -> float:
    """Return the height of an element with its texts."""
    return 13.0 * bool(element.name) + HEIGHT + 14.0 * bool(element.contact) + 3.0


def draw_element(pen: Pen, element: Element, span: Span) -> None:
    """Draw the symbol of an element in its room."""
    _GLYPHS[element.kind](pen, element, span)


def _zigzag(at: Callable[[float, float], Point], x0: float, x1: float) -> list[Point]:
    step = (x1 - x0) / 8
    inner = [at(x0 + step * (k + 0.5), -6.0 if k % 2 else 6.0) for k in range(8)]
    return [at(x0, 0.0), *inner, at(x1, 0.0)]


def _spring(pen: Pen, element: Element, span: Span) -> None:
    coils = _zigzag(span.at, span.x0 + LEAD, span.x1 - LEAD)
    pen.line("stroke", span.at(span.x0), *coils, span.at(span.x1))
    if element.is_curved:  # an arrow through it: its stiffness changes
        middle = 0.5 * (span.x0 + span.x1)
        pen.line("thin", span.at(middle - 14, 9), span.at(middle + 14, -9))
        pen.area("ink", span.at(middle + 16, -10), span.at(middle + 9, -8.5), span.at(middle + 13, -4.5))


def _damper(pen: Pen, element: Element, span: Span) -> None:
    middle = 0.5 * (span.x0 + span.x1)
    pen.line("stroke", span.on_left(span.x0), span.on_left(middle - 12))
    cup = ((middle + 12, -6), (middle - 12, -6), (middle - 12, 6), (middle + 12, 6))
    pen.line("stroke", *(span.on_left(x, dy) for x, dy in cup))
    pen.line("stroke", span.on_right(middle + 2, -4), span.on_right(middle + 2, 4))
    pen.line("stroke", span.on_right(middle + 2), span.on_right(span.x1))


def _gap(pen: Pen, element: Element, span: Span) -> None:
    """Draw a fork on the left end, a tongue in its gap, and behind it the spring of the contact."""
    low, high = element.edges
    # while the left end moves ahead, its own stop comes nearer: that of a deflection with the sign of the span
    near, far = (high, low) if span.sign > 0 else (low, high)
    names = ("high", "low") if span.sign > 0 else ("low", "high")
    wide, wide_far = pen.width_of(near), pen.width_of(far)
    widths = (wide_far, wide) if span.sign > 0 else (wide, wide_far)
    number = pen.mover(Mover("gap", (), element.contact, -span.sign, low, high, *widths))
    start = span.x0 + LEAD + 2.0
    tongue = start + 2.0 + (wide if near is not None else 10.0)
    end = tongue + wide_far + 2.0
    if near is not None:
        left, right = (span.on_left(start, dy) for dy in (-8, 8))
        pen.area("room", left, span.within(number, tongue, -8), span.within(number, tongue, 8), right)
    if far is not None:
        right = span.on_left(end, 8), span.on_left(end, -8)
        pen.area("room", span.within(number, tongue, -8), right[1], right[0], span.within(number, tongue, 8))
        rim = [span.on_left(end, -4), span.on_left(end, -9), span.on_left(start, -9)]
        pen.line("stroke", *rim, span.on_left(start, 9), span.on_left(end, 9), span.on_left(end, 4))
        for dy in (-9.0, 4.0):
            pen.line(f"stop {names[1]}", span.on_left(end, dy), span.on_left(end, dy + 5.0))
    pen.line("stroke", span.on_left(span.x0), span.on_left(start))
    if near is not None:
        pen.line(f"stop {names[0]}", span.on_left(start, -9), span.on_left(start, 9))
    pen.line("tongue", span.within(number, tongue, -6), span.within(number, tongue, 6))
    # the rod reaches out of the fork also when the tongue is at the near stop
    spring = tongue + (wide_far + wide + 7.0 if far is not None else 6.0)
    pen.line("stroke", span.within(number, tongue), span.within(number, spring))

    def behind(x: float, dy: float) -> Point:
        return span.behind(number, x, spring, dy)

    if element.is_rigid:
        pen.line("stroke", behind(spring, 0.0), behind(span.x1, 0.0))
        pen.area(
            "rigid",
            *(behind(x, dy) for x, dy in ((spring + 5, -5), (span.x1 - 8, -5), (span.x1 - 8, 5), (spring + 5, 5))),
        )
    else:
        pen.line("stroke", *_zigzag(behind, spring, span.x1 - 5.0), behind(span.x1, 0.0))


def _friction(pen: Pen, element: Element, span: Span) -> None:
    """Draw two plates that rub."""
    middle, half = 0.5 * (span.x0 + span.x1), 0.5 * _PLATE
    pen.line("stroke", span.on_left(span.x0), span.on_left(span.x0 + 6), span.on_left(span.x0 + 6, 4))
    pen.line("stroke", span.on_left(span.x0 + 6, 4), span.on_left(middle + half, 4))
    _teeth(pen, span, middle - half, middle + half)
    pen.box("rub", middle - half + 4, span.y - 7, middle + half - 4, span.y + 1, span.on_right(0.0).moves)
    pen.line("stroke", span.on_right(middle + half - 4, -3), span.on_right(span.x1, -3))


def _teeth(pen: Pen, span: Span, x0: float, x1: float) -> None:
    """Hatch below the rough plate."""
    for k in range(int((x1 - x0) // 5)):
        x = x0 + 3 + 5 * k
        pen.line("hatch", span.on_left(x, 4), span.on_left(x - 3, 9))


def _slider(pen: Pen, element: Element, span: Span) -> None:
    """Draw friction in series with a spring."""
    number = pen.mover(Mover("slider", (), element.contact, -span.sign))
    start = span.x0 + LEAD
    pen.line("stroke", span.on_left(span.x0), span.on_left(span.x0 + 5), span.on_left(span.x0 + 5, 4))
    pen.line("stroke", span.on_left(span.x0 + 5, 4), span.on_left(start + _PLATE, 4))
    _teeth(pen, span, start, start + _PLATE)
    left, right = start + 5.0, start + _PLATE - 7.0
    corners = ((left, -7), (right, -7), (right, 1), (left, 1))
    pen.area("rub", *(span.within(number, x, dy) for x, dy in corners))

    def behind(x: float, dy: float) -> Point:
        return span.behind(number, x, right, dy - 3.0)

    pen.line("stroke", behind(right, 0.0), *_zigzag(behind, right + 5.0, span.x1 - 6.0), behind(span.x1, 0.0))


def _formula(pen: Pen, element: Element, span: Span) -> None:
    middle = 0.5 * (span.x0 + span.x1)
    pen.line("stroke", span.at(span.x0), span.at(span.x1))
    moves = span.at(middle).moves
    pen.box("paper", middle - 16, span.y - 9, middle + 16, span.y + 9, moves)
    pen.text("symbol", middle, span.y + 4, "f(x)", moves=moves)


def _gear(pen: Pen, element: Element, span: Span) -> None:
    middle = 0.5 * (span.x0 + span.x1)
    pen.line("stroke", span.at(span.x0), span.at(span.x1))
    for x0, x1 in ((middle - 8, middle), (middle, middle + 8)):
        pen.box("body", x0, span.y - 9, x1, span.y + 9, span.at(middle).moves)
    for dy in (-6, -2, 2, 6):
        pen.line("thin", span.at(middle - 3, dy), span.at(middle + 3, dy))


def _coupling(pen: Pen, element: Element, span: Span) -> None:
    pen.line("dashed", span.at(span.x0), span.at(span.x1))


_GLYPHS: dict[str, Callable[[Pen, Element, Span], None]] = {
    "spring": _spring,
    "damper": _damper,
    "gap": _gap,
    "friction": _friction,
    "slider": _slider,
    "formula": _formula,
    "gear": _gear,
    "coupling": _coupling,
}

_WIDE, _NARROW = set("mwMW@%—…"), set("iljtfrI.,:;|!'()[] /")


def length_of(text: str) -> float:
    """Estimate the length of a text in the letters of a drawing, in pixels; rather too long than too short."""
    widths = (9.6 if c in _WIDE else 3.9 if c in _NARROW else 7.6 if c.isupper() else 6.4 for c in text)
    return sum(widths)


def fitted(text: str, room: float) -> str:
    """Cut a text where its room ends."""
    if length_of(text) <= room:
        return text
    while text and length_of(text + "…") > room:
        text = text[:-1].rstrip(" ,")
    return text + "…" if text else ""


# The drawing of a machine on white paper: as an SVG file, and in axes of matplotlib.

INK, STEEL = "#1a1a1a", "#e8edf2"
LOAD, GREY, ROOM, RUB = (color_of(name) for name in ("third", "stop", "tint-one", "tint-goal"))

LOOKS: dict[str, dict[str, str | float]] = {
    "stroke": {"stroke": INK, "width": 1.4},
    "thin": {"stroke": INK, "width": 0.9},
    "hatch": {"stroke": GREY, "width": 0.9},
    "wall": {"stroke": INK, "width": 2.0},
    "dashed": {"stroke": GREY, "width": 1.3, "dashes": "4 3"},
    "stop": {"stroke": GREY, "width": 2.8},
    "tongue": {"stroke": INK, "width": 2.6},
    "room": {"fill": ROOM},
    "rigid": {"stroke": INK, "width": 1.2, "fill": GREY},
    "rub": {"stroke": INK, "width": 1.2, "fill": RUB},
    "paper": {"stroke": INK, "width": 1.2, "fill": "white"},
    "ink": {"fill": INK},
    "body": {"stroke": INK, "width": 1.5, "fill": STEEL},
    "stub": {"stroke": GREY, "width": 1.2, "fill": "white", "dashes": "3 2"},
    "load": {"stroke": LOAD, "width": 1.6},
    "load-head": {"fill": LOAD},
    "load-name": {"fill": LOAD},
    "name": {"fill": INK},
    "state": {"fill": GREY},
    "symbol": {"fill": INK},
    "note": {"fill": GREY},
}
"""Colours, widths of lines in pixels, and dashes of each style, on white paper."""


def svg_of(scene: Scene) -> str:
    """Return the text of an SVG file with a drawing, on white paper."""
    size = f'width="{scene.width:g}" height="{scene.height:g}" viewBox="0 0 {scene.width:g} {scene.height:g}"'
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" {size} font-family="sans-serif" font-size="{LETTER:g}" role="img">',
        f"<title>{escape(scene.words)}</title>",
        f'<rect width="{scene.width:g}" height="{scene.height:g}" rx="6" fill="white"/>',
    ]
    part: int | None = None
    for shape in scene.shapes:
        if shape.part != part:
            lines += ["</g>"] * (part is not None)
            words = scene.parts[shape.part].words if shape.part >= 0 else ""
            lines.append("<g>" + f"<title>{escape(words)}</title>" * bool(words))
            part = shape.part
        lines.append(_element(shape))
    return "\n".join([*lines, *["</g>"] * (part is not None), "</svg>", ""])


def _element(shape: Shape) -> str:
    look = LOOKS[shape.look.split()[0]]
    if shape.kind == "text":
        (point,) = shape.points
        place = f'x="{_short(point.x)}" y="{_short(point.y)}" text-anchor="{shape.anchor}" fill="{look["fill"]}"'
        return f"<text {place}>{escape(shape.text)}</text>"
    style = f'fill="{look.get("fill", "none")}"'
    if "stroke" in look:
        style += f' stroke="{look["stroke"]}" stroke-width="{look["width"]}" stroke-linejoin="round"'
    if "dashes" in look:
        style += f' stroke-dasharray="{look["dashes"]}"'
    if shape.kind == "circle":
        (point,) = shape.points
        return f'<circle cx="{_short(point.x)}" cy="{_short(point.y)}" r="{shape.radius:g}" {style}/>'
    tag = "polygon" if shape.kind == "area" else "polyline"
    return f'<{tag} points="{" ".join(map(_pair, shape.points))}" {style}/>'


def _pair(point: Point) -> str:
    return f"{_short(point.x)},{_short(point.y)}"


def _short(value: float) -> str:
    return f"{value:.1f}".removesuffix(".0")


def draw_scene(ax: Axes, scene: Scene, width: float, scale: float) -> None:
    """Draw a machine in axes, without their frame."""
    ax.set_axis_off()
    ax.set_aspect("equal", anchor="W")
    ax.set_xlim(0.0, width)
    ax.set_ylim(scene.height, 0.0)
    for order, shape in enumerate(scene.shapes):
        _draw_shape(ax, shape, scale, 2.0 + 1e-4 * order)


def _draw_shape(ax: Axes, shape: Shape, scale: float, zorder: float) -> None:
    from matplotlib.patches import Circle, Polygon

    look, places = LOOKS[shape.look.split()[0]], [(point.x, point.y) for point in shape.points]
    if shape.kind == "text":
        (x, y), align = places[0], {"start": "left", "middle": "center"}[shape.anchor]
        text = shape.text.replace("$", r"\$")
        ax.text(x, y, text, ha=align, va="baseline", size=LETTER * scale, color=look["fill"], zorder=zorder)
        return
    line: dict[str, Any] = {"linewidth": float(look.get("width", 0.0)) * scale, "zorder": zorder}
    if "dashes" in look:
        line["linestyle"] = (0, tuple(map(float, str(look["dashes"]).split())))
    if shape.kind == "line":
        ax.plot(*zip(*places, strict=True), color=look["stroke"], solid_joinstyle="round", **line)
        return
    line |= {"facecolor": look.get("fill", "none"), "edgecolor": look.get("stroke", "none")}
    circle = shape.kind == "circle"
    ax.add_patch(Circle(places[0], shape.radius, **line) if circle else Polygon(places, closed=True, **line))

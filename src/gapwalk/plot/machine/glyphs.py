"""The symbols of elements between two ends on a drawing: springs, dampers, gaps, friction, formulas, gears."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from gapwalk.plot.machine.elements import BASE, Element
from gapwalk.plot.machine.scene import Mover, Part, Point, Shape

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

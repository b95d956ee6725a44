"""The drawing of a machine as one description, which SVG, matplotlib and the page of the explorer draw alike.

A point of the drawing moves along with bodies: its place at an instant is ``x + sum of share * displacement`` of its
movers, in pixels. So a spring between two bodies stretches, and the tongue in a gap stays at its stop while the spring
behind it is compressed. Whoever draws the scene needs only lines, circles and texts.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any


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

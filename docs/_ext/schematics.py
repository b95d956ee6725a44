"""Drawings of the geometry behind some systems in the gallery: ``python -m docs._ext.schematics``.

A model does not know that its coordinate is the angle of a pendulum, or a direction of a rotor. What a model does know
is drawn from it (`docs._ext.machines`). The files are small SVG in docs/pictures, on white paper, so that they can be
read on a dark page too.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

INK, PETROL, WINE, GREY, STEEL = "#1a1a1a", "#17627d", "#882255", "#6f6f6f", "#e8edf2"
FOLDER = Path(__file__).parent.parent / "pictures"


class Sketch:
    """A drawing of parts: masses, springs, dampers, walls, gaps, gears and arrows; lengths in pixels, y downwards.

    Parameters
    ----------
    width, height
        Size of the paper.
    words
        Description for people who cannot see it.
    """

    def __init__(self, width: float, height: float, words: str) -> None:
        self.width, self.height, self.words, self.parts = width, height, words, []

    def add(self, tag: str, **options: object) -> None:
        """Add an element of SVG; underscores in names become hyphens."""
        given = " ".join(f'{name.replace("_", "-")}="{_short(value)}"' for name, value in options.items())
        self.parts.append(f"<{tag} {given}/>")

    def line(self, *points: tuple[float, float], color: str = INK, width: float = 1.6, dashes: str = "") -> None:
        """Draw a line through points."""
        path = " ".join(f"{_short(x)},{_short(y)}" for x, y in points)
        more = {"stroke_dasharray": dashes} if dashes else {}
        self.add(
            "polyline", points=path, fill="none", stroke=color, stroke_width=width, stroke_linejoin="round", **more
        )

    def text(
        self, x: float, y: float, words: str, *, color: str = INK, anchor: str = "middle", math: bool = False
    ) -> None:
        """Write words, or a symbol in italics: ``k_1`` has a subscript."""
        style = ' font-family="serif" font-style="italic" font-size="17"' if math else ' font-size="14"'
        base, _, index = words.partition("_") if math else (words, "", "")
        sub = f'<tspan dy="4" font-size="12">{index}</tspan>' if index else ""
        place = f'x="{_short(x)}" y="{_short(y)}" text-anchor="{anchor}" fill="{color}"'
        self.parts.append(f"<text {place}{style}>{base}{sub}</text>")

    def box(self, x: float, y: float, width: float, height: float) -> None:
        """Draw a body as a box about a point."""
        shape = {"x": x - width / 2, "y": y - height / 2, "width": width, "height": height, "rx": 3}
        self.add("rect", **shape, fill=STEEL, stroke=INK, stroke_width=1.6)

    def disc(self, x: float, y: float, r: float, fill: str = STEEL, color: str = INK, width: float = 1.6) -> None:
        """Draw a disc."""
        self.add("circle", cx=x, cy=y, r=r, fill=fill, stroke=color, stroke_width=width)

    def wall(self, *points: tuple[float, float], side: int = 1) -> None:
        """Draw a fixed surface along points, hatched on its left (1) or right (-1) side."""
        for (x0, y0), (x1, y1) in pairwise(points):
            length = math.hypot(x1 - x0, y1 - y0)
            u, v = (x1 - x0) / length, (y1 - y0) / length
            for step in range(max(1, int(length // 8))):
                x, y = x0 + u * (8 * step + 5), y0 + v * (8 * step + 5)
                self.line((x, y), (x - 6 * u + side * 7 * v, y - 6 * v - side * 7 * u), color=GREY, width=1)
        self.line(*points, width=2)

    def spring(self, x0: float, y0: float, x1: float, y1: float, coils: int = 4, color: str = INK) -> None:
        """Draw a spring between two points."""
        length = math.hypot(x1 - x0, y1 - y0)
        u, v = (x1 - x0) / length, (y1 - y0) / length
        lead = 0.18 * length
        places = [(0.0, 0.0), (lead, 0.0)]
        step = (length - 2 * lead) / (2 * coils)
        places += [(lead + step * (k + 0.5), 7.0 if k % 2 else -7.0) for k in range(2 * coils)]
        places += [(length - lead, 0.0), (length, 0.0)]
        self.line(*((x0 + a * u - b * v, y0 + a * v + b * u) for a, b in places), color=color)

    def damper(self, x0: float, y0: float, x1: float, y1: float) -> None:
        """Draw a damper between two points."""
        length = math.hypot(x1 - x0, y1 - y0)
        u, v = (x1 - x0) / length, (y1 - y0) / length

        def at(a: float, b: float) -> tuple[float, float]:
            return x0 + a * length * u - b * v, y0 + a * length * v + b * u

        self.line(at(0, 0), at(0.35, 0))
        self.line(at(0.65, -7), at(0.35, -7), at(0.35, 7), at(0.65, 7))
        self.line(at(0.55, -5), at(0.55, 5))
        self.line(at(0.55, 0), at(1, 0))

    def arrow(self, x0: float, y0: float, x1: float, y1: float, color: str = PETROL, *, both: bool = False) -> None:
        """Draw an arrow, with two heads for a dimension."""
        self.line((x0, y0), (x1, y1), color=color, width=1.5)
        for (ax, ay), (bx, by) in [((x0, y0), (x1, y1)), ((x1, y1), (x0, y0))][: 1 + both]:
            length = math.hypot(bx - ax, by - ay)
            u, v = (bx - ax) / length, (by - ay) / length
            tips = [(bx - 8 * u + s * 3.5 * v, by - 8 * v - s * 3.5 * u) for s in (1, -1)]
            path = " ".join(f"{_short(x)},{_short(y)}" for x, y in [(bx, by), *tips])
            self.add("polygon", points=path, fill=color)

    def arc(
        self, x: float, y: float, r: float, start: float, stop: float, color: str = PETROL, *, head: bool = True
    ) -> None:
        """Draw an arc of a circle between two angles in degrees, counterclockwise from the right."""
        angles = [math.radians(start + (stop - start) * k / 40) for k in range(41)]
        points = [(x + r * math.cos(a), y - r * math.sin(a)) for a in angles]
        self.line(*points, color=color, width=1.5)
        if head:
            self.arrow(*points[-3], *points[-1], color=color)

    def gear(self, x: float, y: float, r: float, teeth: int, turn: float = 0.0) -> None:
        """Draw a gear: its pitch circle has the radius `r`."""
        depth, points = 0.42 * math.pi * r / teeth, []
        for tooth in range(teeth):
            for share, height in ((-0.32, -depth), (-0.15, depth), (0.15, depth), (0.32, -depth)):
                a = 2 * math.pi * (tooth + share + turn) / teeth
                points.append(f"{_short(x + (r + height) * math.cos(a))},{_short(y - (r + height) * math.sin(a))}")
        self.add("polygon", points=" ".join(points), fill=STEEL, stroke=INK, stroke_width=1.6, stroke_linejoin="round")
        self.disc(x, y, 5, fill="white")

    def svg(self) -> str:
        """Return the text of the file."""
        size = f'width="{self.width:g}" height="{self.height:g}" viewBox="0 0 {self.width:g} {self.height:g}"'
        head = f'<svg xmlns="http://www.w3.org/2000/svg" {size} font-family="sans-serif" role="img">'
        paper = f'<rect width="{self.width:g}" height="{self.height:g}" rx="6" fill="white"/>'
        return "\n".join([head, f"<title>{self.words}</title>", paper, *self.parts, "</svg>", ""])


def _short(value: object) -> object:
    return f"{value:.1f}".removesuffix(".0") if isinstance(value, float) else value


def bearing() -> Sketch:
    """Draw a rotor in a ball bearing."""
    s = Sketch(580, 270, "A rotor with an unbalance in a ball bearing with clearance")
    x, y = 170, 135
    s.disc(x, y, 118, fill="#f4f4f4", color=GREY)
    s.disc(x, y, 96, fill="white")
    for angle in range(0, 360, 45):
        a = math.radians(angle)
        main = angle in (90, 270)
        s.disc(
            x + 77 * math.cos(a),
            y - 77 * math.sin(a),
            17,
            fill="#cfe3f1" if main else "white",
            color=INK if main else GREY,
        )
    s.disc(x, y, 58)
    s.disc(x, y, 2.5, fill=INK)
    s.disc(x + 28, y - 22, 6, fill=WINE, color=WINE)
    s.arc(x, y, 45, 45, 120)
    s.text(x - 20, y - 22, "Ω", math=True)
    s.arrow(x - 24, y, x - 24, y + 42, color=INK)
    s.text(x - 38, y + 26, "y", math=True)
    s.text(320, 52, "upper ball: acts for −y &gt; g", anchor="start")
    s.line((188, 58), (312, 48), color=GREY, width=1)
    s.text(320, 96, "unbalance: its force grows with Ω²", anchor="start")
    s.line((206, 112), (312, 92), color=GREY, width=1)
    s.text(320, 140, "weight", anchor="start")
    s.arrow(x + 20, y + 8, x + 20, y + 48)
    s.line((x + 26, y + 26), (312, 136), color=GREY, width=1)
    s.text(320, 216, "lower ball: acts for y &gt; g", anchor="start")
    s.line((188, 212), (312, 212), color=GREY, width=1)
    return s


def mesh() -> Sketch:
    """Draw a pair of gears, and the model of their mesh."""
    s = Sketch(620, 230, "A pair of gears, and the spring, damper, gap and transmission error of their mesh")
    s.gear(92, 125, 62, 18)
    s.gear(92 + 62 * 31 / 18, 125, 62 * 13 / 18, 13)
    s.arc(92, 125, 30, 150, 30)
    s.arc(198, 125, 20, 30, 150)
    s.arrow(255, 125, 300, 125, color=GREY)
    s.box(345, 125, 36, 90)
    s.wall((590, 70), (590, 180), side=1)
    s.line((363, 95), (405, 95))
    s.line((405, 80), (405, 110), width=2.4)
    s.line((383, 86), (383, 68), (427, 68), (427, 122), (383, 122), (383, 104))
    s.arrow(405, 58, 427, 58, both=True)
    s.text(416, 48, "b", math=True, color=PETROL)
    s.arrow(383, 58, 405, 58, both=True)
    s.text(394, 48, "b", math=True, color=PETROL)
    s.line((427, 95), (450, 95))
    s.line((450, 85), (450, 105), color=WINE, width=2)
    s.text(462, 80, "e(θ)", math=True, color=WINE)
    s.arrow(455, 112, 478, 112, color=WINE)
    s.spring(450, 95, 590, 95)
    s.text(535, 78, "k(θ)", math=True)
    s.damper(363, 158, 590, 158)
    s.text(478, 185, "c", math=True)
    s.arrow(327, 190, 372, 190)
    s.text(350, 212, "x", math=True)
    s.arrow(290, 100, 325, 100)
    s.text(302, 90, "F", math=True, color=PETROL)
    return s


def rub() -> Sketch:
    """Draw a rotor next to a stator."""
    s = Sketch(480, 250, "A rotor with an unbalance on two springs, next to a stop")
    x, y = 250, 130
    s.wall((110, 95), (110, 165), side=-1)
    s.spring(110, 130, 195, 130)
    s.text(152, 112, "k_x", math=True)
    s.wall((215, 30), (285, 30), side=1)
    s.spring(x, 30, x, 75, coils=3)
    s.text(x - 24, 58, "k_y", math=True)
    s.disc(x, y, 55)
    s.disc(x, y, 2.5, fill=INK)
    s.disc(x - 24, y - 24, 6, fill=WINE, color=WINE)
    s.arc(x, y, 42, 0, 70)
    s.text(x + 14, y - 12, "Ω", math=True)
    a = math.radians(60)
    ux, uy = math.cos(a), math.sin(a)
    far = 55 + 26
    cx, cy = x + far * ux, y + far * uy
    s.wall((cx + 38 * uy, cy - 38 * ux), (cx - 38 * uy, cy + 38 * ux), side=1)
    s.arrow(x + 55 * ux, y + 55 * uy, cx, cy, both=True)
    s.line((cx, cy - 12), (352, 172), color=GREY, width=1)
    s.text(358, 176, "gap", color=PETROL, anchor="start")
    s.line((x, y), (x, y + 52), color=GREY, width=1, dashes="4 3")
    s.line((x, y), (x + 52 * ux, y + 52 * uy), color=GREY, width=1, dashes="4 3")
    s.arc(x, y, 30, 270, 300, color=GREY, head=False)
    s.text(x + 15, y + 48, "30°", color=GREY)
    s.arrow(x + 95, y - 70, x + 140, y - 70, color=INK)
    s.text(x + 150, y - 65, "x", math=True)
    s.arrow(x + 95, y - 70, x + 95, y - 25, color=INK)
    s.text(x + 95, y - 8, "y", math=True)
    s.arrow(150, 175, 150, 225)
    s.text(140, 205, "weight", anchor="end")
    s.text(336, 214, "stator", anchor="start")
    return s


def pendulum() -> Sketch:
    """Draw a pendulum on a moving pivot, between stops."""
    s = Sketch(420, 280, "A pendulum whose pivot moves up and down, between two stops")
    x, y = 210, 60
    s.wall((x - 40, 20), (x - 40, 100), side=-1)
    s.wall((x + 40, 100), (x + 40, 20), side=-1)
    s.box(x, y, 70, 22)
    s.arrow(x + 62, y + 26, x + 62, y - 26, both=True)
    s.text(x + 72, y + 5, "u(θ)", math=True, color=PETROL, anchor="start")
    a = math.radians(24)
    bx, by = x + 165 * math.sin(a), y + 165 * math.cos(a)
    s.line((x, y), (bx, by), width=2.4)
    s.disc(x, y, 5, fill="white")
    s.disc(bx, by, 15)
    s.line((x, y + 11), (x, 262), color=GREY, width=1, dashes="4 3")
    s.arc(x, y, 118, 270, 292)
    s.text(x + 26, y + 138, "x", math=True, color=PETROL)
    for sign in (1, -1):
        b = math.radians(48)
        px, py = x + sign * 165 * math.sin(b), y + 165 * math.cos(b)
        u, v = sign * math.sin(b), math.cos(b)
        ends = (px - 26 * u, py - 26 * v), (px + 26 * u, py + 26 * v)
        s.wall(*ends, side=sign)
    s.text(x + 160, y + 152, "stop", anchor="start")
    s.text(x - 160, y + 152, "stop", anchor="end")
    return s


def clearance() -> Sketch:
    """Draw a tooth between two flanks, with half the backlash on each side."""
    s = Sketch(
        520, 250, "A tooth in the middle between two flanks: the clearance b on each side, the backlash 2b in all"
    )
    s.wall((110, 190), (110, 50), side=1)
    s.wall((410, 50), (410, 190), side=1)
    s.box(260, 120, 90, 110)
    s.line((260, 40), (260, 200), color=GREY, width=1, dashes="5 4")
    s.arrow(260, 30, 320, 30)
    s.text(332, 35, "x", math=True, color=PETROL)
    for x0, x1 in ((110, 215), (305, 410)):
        s.arrow(x0, 120, x1, 120, color=WINE, both=True)
        s.text((x0 + x1) / 2, 108, "b", math=True, color=WINE)
    s.text(162, 145, "clearance", color=WINE)
    s.text(357, 145, "clearance", color=WINE)
    s.text(260, 222, "total backlash, left and right of the tooth together: 2b", color=INK)
    return s


def architecture() -> Sketch:
    """Draw the packages of the code in layers: each imports those below it only."""
    layers = (
        ("cli   explorer   plot", "what a user sees"),
        ("studies   results   parallel", "whole jobs, kept and resumed"),
        ("answers   measurement   attractors   reduction   verification", "what is made of branches"),
        ("bifurcation", "where a branch changes, two parameters, diagrams"),
        ("continuation", "one branch"),
        ("orbit", "one periodic motion: shooting, harmonic balance"),
        ("ensemble   flow", "many motions; one motion, exactly"),
        ("model", "what vibrates: contacts, loads, drive trains, files"),
    )
    s = Sketch(
        720, 44 * len(layers) + 24, "The packages in layers, from the model at the bottom to the commands at the top"
    )
    for number, (names, words) in enumerate(layers):
        y = 34 + 44 * number
        s.add("rect", x=12, y=y - 18, width=696, height=36, rx=5, fill=STEEL, stroke=GREY, stroke_width=1)
        s.text(24, y + 5, names.replace("   ", " · "), anchor="start", color=PETROL)
        s.text(696, y + 5, words, anchor="end")
    return s


DRAWINGS: dict[str, Callable[[], Sketch]] = {
    "bearing": bearing,
    "mesh": mesh,
    "rub": rub,
    "pendulum": pendulum,
    "clearance": clearance,
    "architecture": architecture,
}
"""The drawings by the name of their page."""


def main() -> None:
    """Write all drawings."""
    for name, make in DRAWINGS.items():
        (FOLDER / f"schematic-{name}.svg").write_text(make().svg(), encoding="utf-8")


if __name__ == "__main__":
    main()

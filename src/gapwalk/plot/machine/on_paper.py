"""The drawing of a machine on white paper: as an SVG file, and in axes of matplotlib."""

from __future__ import annotations

from html import escape
from typing import TYPE_CHECKING, Any

from gapwalk.plot.machine.glyphs import LETTER
from gapwalk.plot.machine.scene import Point, Scene, Shape

if TYPE_CHECKING:  # an SVG file needs no matplotlib
    from matplotlib.axes import Axes

INK, BLUE, GREY, STEEL, ROOM = "#1a1a1a", "#0072B2", "#6f6f6f", "#e8edf2", "#fde7d3"

LOOKS: dict[str, dict[str, str | float]] = {
    "stroke": {"stroke": INK, "width": 1.4},
    "thin": {"stroke": INK, "width": 0.9},
    "hatch": {"stroke": GREY, "width": 0.9},
    "wall": {"stroke": INK, "width": 2.0},
    "dashed": {"stroke": GREY, "width": 1.3, "dashes": "4 3"},
    "stop": {"stroke": "#D55E00", "width": 2.8},
    "tongue": {"stroke": INK, "width": 2.6},
    "room": {"fill": ROOM},
    "rigid": {"stroke": INK, "width": 1.2, "fill": GREY},
    "rub": {"stroke": INK, "width": 1.2, "fill": "#f3c55b"},
    "paper": {"stroke": INK, "width": 1.2, "fill": "white"},
    "ink": {"fill": INK},
    "body": {"stroke": INK, "width": 1.5, "fill": STEEL},
    "stub": {"stroke": GREY, "width": 1.2, "fill": "white", "dashes": "3 2"},
    "load": {"stroke": BLUE, "width": 1.6},
    "load-head": {"fill": BLUE},
    "load-name": {"fill": BLUE},
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

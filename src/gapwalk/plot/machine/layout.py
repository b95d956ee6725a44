"""The layout of a machine on a drawing of some width: bodies, elements between them, and texts that keep apart."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise, zip_longest

from gapwalk.model.drivetrain.train_assembly import TrainAssembly
from gapwalk.model.system import System
from gapwalk.plot.machine.elements import BASE, Element, Machine, Push
from gapwalk.plot.machine.glyphs import HEIGHT, LETTER, Moves, Pen, Span, draw_element, fitted, height_of, length_of
from gapwalk.plot.machine.of_matrices import machine_of_matrices
from gapwalk.plot.machine.of_train import machine_of_train
from gapwalk.plot.machine.rows import BODY, STUB, WALL, Node, Row, Slot, rows_of
from gapwalk.plot.machine.scene import Mover, Part, Point, Scene, Shape

NARROW, WIDE = 330.0, 660.0
"""Widths of a drawing, in pixels: of a panel of the explorer, and of a page."""

_SLOT = 58.0, 94.0  # least and largest width between two bodies
_WALL, _STUB, _PLACE = 10.0, 12.0, 34.0  # widths
_BODY = 26.0, 38.0  # least and largest width of a body, the latter of the heaviest
_MARGIN, _APART = 8.0, 22.0  # round the drawing, and between two rows side by side
_LEAST = 40.0  # height of a body
_NAMES, _LOADS = 17.0, 24.0  # heights of the band of names below a row, and of that of loads above it
_LOCAL = 22.0  # from the left end of a slot to a wall within it

_Pair = tuple[float, float]


@dataclass(frozen=True)
class _Piece:
    """A row, or what of it fits into the width, at its place from the left."""

    row: Row
    widths: tuple[float, ...]
    x: float = 0.0

    @property
    def width(self) -> float:
        return sum(self.widths) + sum(map(_slot_width, self.row.slots))


def machine_of(system: System) -> Machine:
    """Return the bodies and elements of a system: of its train, or of its matrices."""
    assembly = system.structure.assembly
    if isinstance(assembly, TrainAssembly):
        return machine_of_train(system, assembly)
    return machine_of_matrices(system.equations)


def scene_of(system: System, width: float = WIDE) -> Scene:
    """Return the drawing of the machine of a system."""
    machine = machine_of(system)
    edges = [edge for link in machine.links for each in link.elements for edge in each.edges if edge]
    pen = Pen(max(edges, default=1.0))
    for body in machine.bodies:
        pen.mover(Mover("body", body.row))
    heaviest = max((body.mass for body in machine.bodies), default=0.0)
    wide = [_width(body.mass, heaviest) for body in machine.bodies]
    top = _MARGIN
    for line in _lines(rows_of(machine), wide, width - 2.0 * _MARGIN):
        top = _draw_line(pen, machine, line, top, width - _MARGIN)
    for note in machine.notes:
        for text in _wrapped(note, width - 2.0 * _MARGIN):
            top += LETTER + 3.0
            pen.part = -1
            pen.text("note", _MARGIN, top, text, "start")
    drawn = tuple(pen.movers), tuple(pen.parts), tuple(pen.shapes)
    right = min(width, _right(pen.shapes) + _MARGIN)
    return Scene(right, top + _MARGIN, _words(machine), *drawn, machine.notes)


def _right(shapes: Sequence[Shape]) -> float:
    """Return where a drawing ends on the right."""
    texts = (each.points[0].x + length_of(each.text) * (0.5 + 0.5 * (each.anchor == "start")) for each in shapes)
    return max((*texts, *(point.x for each in shapes for point in each.points)), default=0.0)


def _width(mass: float, heaviest: float) -> float:
    if not mass:
        return _PLACE
    return _BODY[0] + (_BODY[1] - _BODY[0]) * (mass / heaviest) ** (1.0 / 3.0)


def _words(machine: Machine) -> str:
    bodies = [body.name for body in machine.bodies if body.mass]
    links = [each.name for link in machine.links for each in link.elements if each.contact and each.name]
    return f"Machine: {', '.join(bodies) or 'contacts'}" + (f"; contacts {', '.join(links)}" if links else "")


def _wrapped(text: str, room: float) -> list[str]:
    lines, line = [], ""
    for word in text.split():
        if line and length_of(f"{line} {word}") > room:
            lines.append(line)
            line = word
        else:
            line = f"{line} {word}".strip()
    return [*lines, line]


def _lines(rows: Sequence[Row], wide: Sequence[float], width: float) -> list[list[_Piece]]:
    """Break rows that are too long, and put short ones side by side."""
    lines: list[list[_Piece]] = []
    left = 0.0
    for row in rows:
        for piece in _broken(row, wide, width):
            if lines and left + _APART + piece.width <= width:
                piece = _Piece(piece.row, piece.widths, left + _APART)
                lines[-1].append(piece)
            else:
                lines.append([piece])
            left = piece.x + piece.width
    return lines


def _broken(row: Row, wide: Sequence[float], width: float) -> list[_Piece]:
    pieces: list[_Piece] = []
    nodes, slots = [row.nodes[0]], list[Slot]()
    total = _node_width(row.nodes[0], wide)
    for slot, node in zip(row.slots, row.nodes[1:], strict=True):
        more = _slot_width(slot) + _node_width(node, wide)
        if slots and total + more > width and nodes[-1].kind == BODY:
            pieces.append(_piece(nodes, slots, wide))
            nodes, slots, total = [Node(STUB, nodes[-1].body)], [], _STUB
        nodes.append(node)
        slots.append(slot)
        total += more
    return [*pieces, _piece(nodes, slots, wide)]


def _piece(nodes: Sequence[Node], slots: Sequence[Slot], wide: Sequence[float]) -> _Piece:
    return _Piece(Row(tuple(nodes), tuple(slots)), tuple(_node_width(node, wide) for node in nodes))


def _node_width(node: Node, wide: Sequence[float]) -> float:
    return {WALL: _WALL, STUB: _STUB}.get(node.kind) or wide[node.body]


def _draw_line(pen: Pen, machine: Machine, line: Sequence[_Piece], top: float, right: float) -> float:
    """Draw pieces side by side, and return where the next line begins."""
    loaded = any(node.kind == BODY and machine.bodies[node.body].loads for piece in line for node in piece.row.nodes)
    top += _LOADS if loaded else 4.0
    slots = [slot for piece in line for slot in piece.row.slots]
    height = max([_LEAST, *(_slot_height(slot) + 6.0 for slot in slots)])
    for place, piece in enumerate(line):
        end = _MARGIN + line[place + 1].x - 4.0 if place + 1 < len(line) else right + 4.0
        _draw_piece(pen, machine, piece, top, height, end)
    return top + height + _NAMES


def _slot_width(slot: Slot) -> float:
    elements = [each for link in (*slot.links, *slot.to_base) for each in link.elements]
    room = max([_SLOT[0], *(length_of(each.name) + 16.0 for each in elements)])
    if any(each.contact for each in elements):
        room = _SLOT[1]
    return min(_SLOT[1], room) + _LOCAL * bool(slot.to_base)


def _slot_height(slot: Slot) -> float:
    return sum(height_of(each) for link in (*slot.links, *slot.to_base) for each in link.elements)


def _draw_piece(pen: Pen, machine: Machine, piece: _Piece, top: float, height: float, end: float) -> None:
    x = _MARGIN + piece.x
    places = []
    for width, slot in zip_longest(piece.widths, piece.row.slots):
        places.append((x, x + width))
        x += width + (_slot_width(slot) if slot else 0.0)
    for slot, (_, x0), (x1, _), before, after in zip(
        piece.row.slots, places, places[1:], piece.row.nodes, piece.row.nodes[1:], strict=False
    ):
        y = top + 3.0 + 0.5 * (height - 6.0 - _slot_height(slot))
        for link in slot.links:
            for element in link.elements:
                _draw_one(pen, element, Span(x0, x1, y, before.body, after.body, link.sign))
                y += height_of(element)
        for link in slot.to_base:
            start = y
            for element in link.elements:
                _draw_one(pen, element, Span(x0 + _LOCAL, x1, y, BASE, after.body, -link.sign))
                y += height_of(element)
            pen.part = -1
            _wall(pen, x0 + _LOCAL, start + 3.0, y - 1.0, left=True)
    _draw_nodes(pen, machine, piece, places, top, height, end)


def _draw_one(pen: Pen, element: Element, span: Span) -> None:
    """Draw an element with its texts, from the top of its room, which is the `y` of the span."""
    top, name = span.y, 13.0 * bool(element.name)
    box = (span.x0 + 1.0, top, span.x1 - 1.0, top + height_of(element))
    pen.parts.append(
        Part(element.kind, element.name or element.kind, element.words, element.contact, element.signal, box)
    )
    pen.part = len(pen.parts) - 1
    room, middle = span.x1 - span.x0 - 14.0, 0.5 * (span.x0 + span.x1)
    if element.name:
        pen.text("name", middle, top + 10.0, fitted(element.name, room))
    draw_element(
        pen, element, Span(span.x0, span.x1, top + name + 0.5 * HEIGHT + 1.0, span.left, span.right, span.sign)
    )
    if element.contact:
        pen.text("state", middle, top + name + HEIGHT + 12.0, fitted(element.detail, room))


def _wall(pen: Pen, x: float, y0: float, y1: float, *, left: bool) -> None:
    """Draw a wall whose face is at x, hatched on its left or right side."""
    side = -1.0 if left else 1.0
    for k in range(int((y1 - y0) // 7)):
        y = y0 + 3.0 + 7.0 * k
        pen.line("hatch", Point(x, y), Point(x + 6.0 * side, y + 6.0))
    pen.line("wall", Point(x, y0), Point(x, y1))


def _draw_nodes(
    pen: Pen,
    machine: Machine,
    piece: _Piece,
    places: Sequence[tuple[float, float]],
    top: float,
    height: float,
    end: float,
) -> None:
    nodes, whole = piece.row.nodes, (_MARGIN + piece.x - 2.0, end)
    names = _rooms({k: places[k] for k, node in enumerate(nodes) if node.kind != WALL}, whole)
    loaded = (k for k, node in enumerate(nodes) if node.kind == BODY and machine.bodies[node.body].loads)
    loads = _rooms({k: places[k] for k in loaded}, whole)
    for place, node in enumerate(nodes):
        if node.kind != WALL:
            _draw_body(pen, machine, node, places[place], (top, height), names[place])
        if place in loads:
            _draw_loads(pen, machine.bodies[node.body].pushes, node.body, places[place], top, loads[place])
    pen.part = -1
    for place, node in enumerate(piece.row.nodes):
        if node.kind == WALL:
            x0, x1 = places[place]
            _wall(pen, x1 if not place else x0, top, top + height, left=not place)


def _rooms(places: dict[int, _Pair], whole: _Pair) -> dict[int, _Pair]:
    """Share a row among texts below or above some of its places: each has the room half way to the next."""
    centres = [0.5 * sum(place) for place in places.values()]
    edges = [whole[0], *(0.5 * (a + b) for a, b in pairwise(centres)), whole[1]]
    return {k: (low + 2.0, high - 2.0) for k, (low, high) in zip(places, pairwise(edges), strict=False)}


def _draw_body(
    pen: Pen,
    machine: Machine,
    node: Node,
    across: tuple[float, float],
    down: tuple[float, float],
    room: tuple[float, float],
) -> None:
    body, (x0, x1), (top, height) = machine.bodies[node.body], across, down
    moves: Moves = ((node.body, 1.0),)
    middle, bottom = 0.5 * (x0 + x1), top + height
    stub = node.kind == STUB
    words = f"{body.name}, goes on here" if stub else body.name
    if body.loads and not stub:
        words += f"; loads: {', '.join(body.loads)}"
    pen.parts.append(Part("body", body.name, words, "", body.signal, (x0, top, x1, bottom + 14.0)))
    pen.part = len(pen.parts) - 1
    if stub:
        pen.box("stub", x0, top, x1, bottom, moves)
    elif not body.mass:
        pen.line("stroke", Point(x1, top + 4.0, moves), Point(x1, bottom - 4.0, moves))
        pen.circle("body", Point(x1 - 6.0, 0.5 * (top + bottom), moves), 6.0)
    else:
        pen.box("body", x0, top, x1, bottom, moves)
        if machine.turns:  # a disc seen from its edge
            for x in (x0 + 5.0, x1 - 5.0):
                pen.line("thin", Point(x, top + 1.0, moves), Point(x, bottom - 1.0, moves))
    _beside(pen, "name", body.name, middle, bottom + 12.0, room)


def _draw_loads(pen: Pen, pushes: Sequence[Push], body: int, across: _Pair, top: float, room: _Pair) -> None:
    """Draw the arrow of loads above a body, with their names, or the first of them and how many more there are.

    Loads in both directions have an arrow with two heads.
    """
    x, y, moves = 0.5 * sum(across), top - 6.0, ((body, 1.0),)
    ways, names = {push.way for push in pushes}, [push.label for push in pushes]
    left, right = (9.0 if way in ways else 15.0 for way in (-1, 1))
    pen.line("load", Point(x - left, y, moves), Point(x + right, y, moves))
    for way in sorted(ways):
        head = ((16.0, 0.0), (8.0, -3.5), (8.0, 3.5))
        pen.area("load-head", *(Point(x + way * dx, y + dy, moves) for dx, dy in head))
    text, wide = ", ".join(names), room[1] - room[0]
    if length_of(text) > wide and names[1:]:
        more = f" +{len(names) - 1}"
        text = fitted(names[0], wide - length_of(more)) + more
    _beside(pen, "load-name", text, x, top - 13.0, room)


def _beside(pen: Pen, look: str, text: str, x: float, y: float, room: _Pair) -> None:
    """Write a text as near to a place as its room allows."""
    text = fitted(text, room[1] - room[0])
    half = 0.5 * length_of(text)
    pen.text(look, max(room[0] + half, min(x, room[1] - half)), y, text)

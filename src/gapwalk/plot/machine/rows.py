"""The order of bodies on a drawing: rows of bodies along the longest chain, then branches and loops.

Each connection has one place. A row that goes on below, a branch, and a loop begin with a stub: the edge of a body that
is drawn elsewhere.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass, replace
from itertools import pairwise

from gapwalk.plot.machine.elements import BASE, Link, Machine

WALL, BODY, STUB = "wall", "body", "stub"


@dataclass(frozen=True)
class Node:
    """The base, a body, or a stub of a body that is drawn elsewhere."""

    kind: str
    body: int = BASE


@dataclass(frozen=True)
class Slot:
    """The room between two nodes: links that fill it, and links of the right node to the base."""

    links: tuple[Link, ...] = ()
    to_base: tuple[Link, ...] = ()


@dataclass(frozen=True)
class Row:
    """Nodes from left to right, and the slots between them."""

    nodes: tuple[Node, ...]
    slots: tuple[Slot, ...] = ()


def rows_of(machine: Machine) -> list[Row]:
    """Return the rows of a machine, as long as they come out."""
    pairs: dict[frozenset[int], list[Link]] = {}
    held: dict[int, list[Link]] = {}
    for link in machine.links:
        if link.ends[1] == BASE:
            held.setdefault(link.ends[0], []).append(link)
        else:
            pairs.setdefault(frozenset(link.ends), []).append(link)
    near: dict[int, list[int]] = {number: [] for number in range(len(machine.bodies))}
    for pair in pairs:
        first, second = sorted(pair)
        near[first].append(second)
        near[second].append(first)
    whole = any(near.values()) or not machine.links  # bodies without links are drawn too
    rows, seen = [], set[int]()
    for start, others in near.items():
        if start in seen or not (others or start in held or whole):
            continue
        path = _longest(near, start, held)
        rows.append(_row([Node(BODY, each) for each in path], pairs, held))
        seen |= {*path}
        waiting = deque(path)
        while waiting:
            node = waiting.popleft()
            while following := _branch(near, node, seen):
                rows.append(_row([Node(STUB, node), *(Node(BODY, each) for each in following)], pairs, held))
                seen |= {*following}
                waiting.extend(following)
    # what is left of the pairs closes loops
    for pair in list(pairs):
        first, second = sorted(pair)
        rows.append(_row([Node(STUB, first), Node(STUB, second)], pairs, held))
    return rows


def _longest(near: dict[int, list[int]], start: int, held: dict[int, list[Link]]) -> list[int]:
    """Return the longest of the shortest ways through the bodies connected with one."""
    first = _ways(near, start)[-1][-1]
    path = max(_ways(near, first), key=len)
    if (path[-1] in held, -path[-1]) > (path[0] in held, -path[0]):
        path.reverse()
    return path


def _ways(near: dict[int, list[int]], start: int) -> list[list[int]]:
    """Return the shortest way to each connected body, the nearest ones first."""
    ways, waiting = {start: [start]}, deque([start])
    while waiting:
        node = waiting.popleft()
        for other in near[node]:
            if other not in ways:
                ways[other] = [*ways[node], other]
                waiting.append(other)
    return list(ways.values())


def _branch(near: dict[int, list[int]], node: int, seen: set[int]) -> list[int]:
    """Return bodies not drawn yet, one after the other, beginning beside a body that is."""
    found: list[int] = []
    while following := [each for each in near[node] if each not in seen and each not in found]:
        node = following[0]
        found.append(node)
    return found


def _row(nodes: list[Node], pairs: dict[frozenset[int], list[Link]], held: dict[int, list[Link]]) -> Row:
    """Make a row; it takes the links that it draws."""
    slots = [
        Slot(tuple(_along(link, before.body) for link in pairs.pop(frozenset((before.body, after.body)), [])))
        for before, after in pairwise(nodes)
    ]
    last = len(nodes) - 1
    whole, left, right = [*nodes], (), ()
    for place, node in enumerate(nodes):
        links = tuple(held.pop(node.body, ())) if node.kind == BODY else ()
        if not links:
            continue
        if not place:
            left, right = _sides(links) if not last else (links, ())
        elif place < last:
            slots[place - 1] = replace(slots[place - 1], to_base=links)
        else:
            right = links
    if right:
        whole, slots = [*whole, Node(WALL)], [*slots, Slot(right)]
    if left:
        turned = tuple(Link((BASE, link.ends[0]), -link.sign, link.elements) for link in left)
        whole, slots = [Node(WALL), *whole], [Slot(turned), *slots]
    return Row(tuple(whole), tuple(slots))


def _sides(links: Iterable[Link]) -> tuple[tuple[Link, ...], tuple[Link, ...]]:
    """Put contacts of a body without neighbours on its right, and its springs on its left."""
    left, right = [], []
    for link in links:
        own = tuple(each for each in link.elements if not each.contact)
        others = tuple(each for each in link.elements if each.contact)
        if own:
            left.append(Link(link.ends, link.sign, own))
        if others:
            right.append(Link(link.ends, link.sign, others))
    return tuple(left), tuple(right)


def _along(link: Link, first: int) -> Link:
    """Turn a link so that it begins at a body."""
    return link if link.ends[0] == first else Link((link.ends[1], link.ends[0]), -link.sign, link.elements)

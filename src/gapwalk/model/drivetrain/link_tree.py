"""The connections of the parts of a train: a tree of links that reaches all of them, and the links that close loops."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Edge:
    """A link as the tree sees it: its two ends as numbers (the ground has one of its own), and what it does.

    A rigid one holds its ends together, a drag damps their relative motion and holds nothing.
    """

    ends: tuple[int, int]
    rigid: bool
    drag: bool = False


@dataclass(frozen=True, slots=True)
class Step:
    """One step of the way through the tree: over which link, from which end to which."""

    link: int
    parent: int
    child: int


@dataclass(frozen=True, slots=True)
class Tree:
    """The way from a root to all that is connected to it.

    Parameters
    ----------
    root
        The ground where there is one, or else the first inertia.
    steps
        In an order in which each begins where another has ended.
    chords
        The links that are not in the tree: each closes a loop.
    looped
        The links on loops that do not lead through the ground: on each, the ratios must multiply to one.
    """

    root: int
    steps: tuple[Step, ...]
    chords: tuple[int, ...]
    looped: frozenset[int]


def tree_of(edges: Sequence[Edge], ground: int) -> Tree:
    """The tree; rigid links are in it wherever they can, and links to the ground only where nothing else will do.

    Drags close loops: they are in the tree only where nothing else holds what they join.
    """
    chosen = _spanning(edges, ground)
    root = ground if any(ground in edge.ends and not edge.drag for edge in edges) else 0
    steps = _walk(edges, chosen, root)
    chords = tuple(number for number in range(len(edges)) if number not in chosen)
    parents = {step.child: step for step in steps}
    loops = [_loop(edges, parents, chord) for chord in chords]
    inner = [loop for loop in loops if not any(ground in edges[link].ends for link in loop)]
    return Tree(root, steps, chords, frozenset(link for loop in inner for link in loop))


def _spanning(edges: Sequence[Edge], ground: int) -> set[int]:
    """The links of the tree (Kruskal)."""
    leaders: dict[int, int] = {}

    def leader(node: int) -> int:
        while (above := leaders.get(node, node)) != node:
            leaders[node] = leaders.get(above, above)
            node = above
        return node

    chosen = set()
    for number in sorted(range(len(edges)), key=lambda k: (edges[k].drag, ground in edges[k].ends, not edges[k].rigid)):
        first, second = map(leader, edges[number].ends)
        if first != second:
            leaders[first] = second
            chosen.add(number)
    return chosen


def _walk(edges: Sequence[Edge], chosen: set[int], root: int) -> tuple[Step, ...]:
    beside: dict[int, list[int]] = {}
    for number in sorted(chosen):
        for end in edges[number].ends:
            beside.setdefault(end, []).append(number)
    steps, seen, waiting = [], {root}, deque([root])
    while waiting:
        node = waiting.popleft()
        for number in beside.get(node, ()):
            first, second = edges[number].ends
            other = second if node == first else first
            if other not in seen:
                seen.add(other)
                waiting.append(other)
                steps.append(Step(number, node, other))
    return tuple(steps)


def _loop(edges: Sequence[Edge], parents: dict[int, Step], chord: int) -> set[int]:
    """The links of the loop that a chord closes."""
    found = {chord}
    for end in edges[chord].ends:  # what both ways to the root share is not on the loop
        way, node = set(), end
        while node in parents:
            way.add(parents[node].link)
            node = parents[node].parent
        found ^= way
    return found

"""Links without their numbers, and the tree of them that reaches all inertias of a train."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

from gapwalk.model.contact import ContactForm
from gapwalk.model.laws import Expression


@dataclass(frozen=True, slots=True)
class LinkForm:
    """A shaft or gear without its numbers."""

    name: str  #: Its name.
    ends: tuple[int, int]  #: Its ends by number; the ground follows the last inertia.
    geared: bool  #: True if it has a ratio.
    fixed: float | None  #: The ratio where it is no parameter: on a closed loop it follows from the others.
    rigid: bool  #: True if it has no springs.
    always: bool  #: True if it has a spring that acts always.
    #: Its contacts: springs with clearances, the friction beside them, a rigid stop; or its formula, or its friction.
    parts: tuple[ContactForm, ...]
    #: Names of its numbers beside those of its contacts, if it is a drag written as such.
    own: tuple[str, ...] | None = None
    #: True if its ends turn at different mean speeds, and it slips on all the time.
    turns: bool = False
    way: int = 0  #: The sign of its mean slip, 0 without any: that of its constant torque.
    rest: float = 0.0  #: The mean speed of its end at the ground over that of the reference: 0 unless it is prescribed.
    speeds: tuple[int, ...] = ()  #: The inertias whose absolute speeds its formula has beside its own slip.
    group: str = ""  #: The name of the group of drags by whose number its torque is multiplied.
    row: tuple[tuple[int, float], ...] = ()  #: Inertias and the weights of their angles, if it has more than two ends.

    @property
    def contact(self) -> ContactForm | None:
        """Its springs with clearances or its rigid stop, or its formula, or its friction; None if it acts always."""
        first = self.parts[0] if self.parts else None
        return None if first is None or first.name != self.name else first

    @property
    def beside(self) -> tuple[ContactForm, ...]:
        """The contacts beside that one."""
        return self.parts[1:] if self.contact else self.parts

    @property
    def drag(self) -> bool:
        """True for a damper without any spring."""
        return not (self.rigid or self.always or self.contact)

    @property
    def by_formula(self) -> bool:
        """True if its torque is a formula or friction, so that it has no damper."""
        return self.own is None and self.contact is not None and not self.contact.law.stage_parameters

    @property
    def dry(self) -> bool:
        """True for friction alone: it joins nothing."""
        return self.contact is not None and self.contact.law.is_dry

    @property
    def loose(self) -> bool:
        """True for friction, and a formula that does not depend on its deflection."""
        law = self.contact.law if self.contact else None
        return self.dry or (isinstance(law, Expression) and "x" not in law.formula.variables)

    @property
    def slides(self) -> bool:
        """True for what may join two parts that slip on each other all the time: a damper, or a formula of the slip."""
        return self.drag or (self.loose and not self.dry)

    @property
    def own_numbers(self) -> tuple[str, ...]:
        """Names of its numbers, without those of its contact."""
        if self.own is not None:
            return self.own
        has = {"ratio": self.geared and self.fixed is None, "stiffness": self.always}
        has["damping"] = not self.rigid and not self.by_formula
        return tuple(what for what, value in has.items() if value)


@dataclass(frozen=True, slots=True)
class Step:
    """One step through the tree: the link, and its two ends in the direction of the step."""

    link: int
    parent: int
    child: int


@dataclass(frozen=True, slots=True)
class Tree:
    """The steps from a root to all inertias that are connected to it."""

    root: int  #: The ground if there is one, otherwise the first inertia.
    steps: tuple[Step, ...]  #: In an order in which each begins where another has ended.
    chords: tuple[int, ...]  #: The links that are not in the tree: each closes a loop.
    #: The links on loops that do not lead through the ground: on each, the ratios must multiply to one.
    looped: frozenset[int]


def tree_of(links: Sequence[LinkForm], ground: int) -> Tree:
    """Build the tree: rigid links first, links to the ground and drags only where no other connects their inertias."""
    root = ground if any(ground in link.ends and not (link.drag or link.loose) for link in links) else 0
    chosen = _spanning(links, ground, free=root != ground)
    steps = _walk(links, chosen, root)
    chords = tuple(number for number in range(len(links)) if number not in chosen)
    parents = {step.child: step for step in steps}
    loops = [_loop(links, parents, chord) for chord in chords if not links[chord].turns]
    inner = [loop for loop in loops if not any(ground in links[number].ends for number in loop)]
    return Tree(root, steps, chords, frozenset(link for loop in inner for link in loop))


def _spanning(links: Sequence[LinkForm], ground: int, *, free: bool) -> set[int]:
    """Choose the links of the tree, in order of preference (Kruskal)."""
    leaders: dict[int, int] = {}

    def leader(node: int) -> int:
        while (above := leaders.get(node, node)) != node:
            leaders[node] = leaders.get(above, above)
            node = above
        return node

    chosen = set()

    def order(number: int) -> tuple[bool, ...]:
        link = links[number]
        return link.loose, link.drag, ground in link.ends, not link.rigid

    for number in sorted(range(len(links)), key=order):
        first, second = map(leader, links[number].ends)
        if first != second and not links[number].dry and not (free and ground in links[number].ends):
            leaders[first] = second
            chosen.add(number)
    return chosen


def _walk(links: Sequence[LinkForm], chosen: set[int], root: int) -> tuple[Step, ...]:
    links_at: dict[int, list[int]] = {}
    for number in sorted(chosen):
        for end in links[number].ends:
            links_at.setdefault(end, []).append(number)
    steps, seen, waiting = [], {root}, deque([root])
    while waiting:
        node = waiting.popleft()
        for number in links_at.get(node, ()):
            first, second = links[number].ends
            other = second if node == first else first
            if other not in seen:
                seen.add(other)
                waiting.append(other)
                steps.append(Step(number, node, other))
    return tuple(steps)


def _loop(links: Sequence[LinkForm], parents: dict[int, Step], chord: int) -> set[int]:
    """Find the links of the loop that a chord closes."""
    found = {chord}
    for end in links[chord].ends:  # what both ways to the root share is not on the loop
        way, node = set(), end
        while node in parents:
            way.add(parents[node].link)
            node = parents[node].parent
        found ^= way
    return found

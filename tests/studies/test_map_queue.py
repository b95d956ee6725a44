"""The pieces of a map in progress: each locus is followed once, and all is found in the same order."""

import random
from dataclasses import dataclass, field
from itertools import chain
from types import SimpleNamespace
from typing import Any

import pytest

from gapwalk.parallel.workers import Outcome
from gapwalk.studies import map_study as map_queue
from gapwalk.studies.map_study import MapQueue


@dataclass(frozen=True)
class Curve:
    """A locus, which some special points lie on."""

    name: str
    points: frozenset[str]


@dataclass
class Plane:
    """Special points on sections, each on a curve; a curve without points cannot be followed."""

    sections: list[list[SimpleNamespace]]
    curves: dict[str, Curve | str]
    followed: list[str] = field(default_factory=list)
    found: list[object] = field(default_factory=list)

    def draw(self, at_a_time: int, choose) -> list[object]:
        """Find everything, with some pieces in progress, of which `choose` says which is done next."""
        queue = queue_of(range(len(self.sections)))
        running: list[int] = []
        begun, self.followed, self.found = 0, [], []
        while True:
            while len(running) < at_a_time and begun < len(queue):
                running.append(begun)
                begun += 1
                is_section, item = queue[begun - 1]
                if not is_section:
                    self.followed.append(item.name)
            if not running:
                return self.found
            number = running.pop(choose(len(running)))
            is_section, item = queue[number]
            queue.take(number, Outcome(item if is_section else self.curves[item.name]))
            for section in queue.sections():
                queue.add(section, float(section), self.sections[section])
                self.found.append(section)
            self.found += [(tried, curve) for tried, curve in queue.loci()]


def queue_of(sections: Any, loci: Any = (), tried: int = 0) -> Any:
    """Return a queue that takes numbers for the systems of sections."""
    return MapQueue(list(sections), 1.0, loci, tried)


def point(name: str, family: str) -> SimpleNamespace:
    return SimpleNamespace(name=name, kind=family, orbit=SimpleNamespace(period=1), contact="")


def plane_of(*sections: str) -> Plane:
    """Sections such as "a1 b1 a2": points of the families a and b, on the curves a1, b1 and a2; x1 has none."""
    names = [[f"{word}-{k}.{n}" for n, word in enumerate(words.split())] for k, words in enumerate(sections)]
    on: dict[str, list[str]] = {}
    for name in chain(*names):
        on.setdefault(name.partition("-")[0], []).append(name)
    curves: dict[str, Curve | str] = {}
    for curve, points in on.items():
        for name in points:
            curves[name] = f"no curve at {name}" if curve[0] == "x" else Curve(curve, frozenset(points))
    return Plane([[point(name, name[0]) for name in row] for row in names], curves)


@pytest.fixture(autouse=True)
def _lie_on_curves(monkeypatch) -> None:
    monkeypatch.setattr(map_queue, "lies_on_locus", lambda locus, special, value, width: special.name in locus.points)


PLANES = [
    plane_of("a1 b1 a2", "a1 c1 b1 a2 x1 x1", "c1 c1 a1 a3 b2"),
    plane_of("", "a1 a1 b1 x1", "b1 b2 b2 x1 a1"),
    plane_of("a1 a2 a3 b1", "a1 a2 a3 b1"),
]


@pytest.mark.parametrize("plane", PLANES)
def test_what_is_found_does_not_depend_on_what_is_in_progress(plane) -> None:
    alone = plane.draw(1, lambda count: 0)
    needed = sorted(plane.followed)
    assert alone[: len(plane.sections)] == list(range(len(plane.sections)))
    for seed in range(40):
        chance = random.Random(seed)
        many = plane.draw(1 + seed % 4, chance.randrange)
        sections, loci = ([each for each in many if isinstance(each, int) is kind] for kind in (True, False))
        assert (sections, loci) == (alone[: len(sections)], alone[len(sections) :])
        assert set(needed) <= set(plane.followed)
        assert len(plane.followed) == len(set(plane.followed))


def test_no_locus_is_followed_twice_while_there_are_others() -> None:
    """Of the points of one family on two sections, those of the second lie on the loci of the first."""
    plane = plane_of("a1 a2 b1", "a1 a2 b1 b1", "a1 a2 b1")
    for newest_first in (False, True):
        plane.draw(2, lambda count: count - 1 if newest_first else 0)  # noqa: B023  (called at once)
        assert sorted(name.partition("-")[0] for name in plane.followed) == ["a1", "a2", "b1"]


def test_a_single_family_on_a_section_is_followed_by_all() -> None:
    plane = plane_of("a1 a2 a3 a4")
    queue = queue_of([0])
    queue.take(0, Outcome(queue[0][1]))
    assert list(queue.sections()) == [0]
    queue.add(0, 0.0, plane.sections[0])
    assert len(queue) == 5
    assert [queue[number][1].name for number in (1, 2, 3)] == ["a1-0.0", "a2-0.1", "a3-0.2"]


def test_loci_begin_while_a_section_is_still_walked() -> None:
    plane = plane_of("a1", "b1")
    queue = queue_of([0, 1])
    assert [queue[number] for number in (0, 1)] == [(True, 0), (True, 1)]
    queue.take(0, Outcome(0))
    for section in queue.sections():
        queue.add(section, 0.0, plane.sections[section])
    assert queue[2] == (False, plane.sections[0][0])
    assert len(queue) == 3


def test_a_resumed_map_follows_what_is_left() -> None:
    plane = plane_of("a1 a2 x1 b1", "a2 b1")
    known = [plane.curves["a1-0.0"], plane.curves["a2-0.1"]]
    queue = queue_of([], known, 2)
    for number, section in enumerate(plane.sections):
        queue.add(number, 0.0, section)
    assert list(queue.loci()) == []
    for number in (0, 1):
        queue.take(number, Outcome(plane.curves[queue[number][1].name]))
    assert list(queue.loci()) == [(3, "no curve at x1-0.2"), (4, plane.curves["b1-0.3"])]
    assert len(queue) == 2

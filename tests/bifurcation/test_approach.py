"""What is noted at a point is noted when it is whole: several threads may ask for it."""

from types import SimpleNamespace
from typing import Any

from gapwalk.bifurcation.loci.follow_locus import turnings


def test_turnings_are_noted_when_they_are_whole() -> None:
    point: Any = SimpleNamespace(memo={})
    noted = []

    def depths():
        noted.append("turnings" in point.memo)
        yield [0.5, 2.0], [0.25, -1.0]
        noted.append("turnings" in point.memo)

    point.orbit = SimpleNamespace(turning_depths=depths())
    found = turnings(point)
    assert [each.theta for each in found] == [0.5, 2.0]
    assert noted == [False, False]
    assert turnings(point) is found

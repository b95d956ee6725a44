"""Order of the work on a family: members first, then gaps between members that are known, by whoever is free."""

from types import SimpleNamespace
from typing import Any, cast

from gapwalk.studies import branch_family as family_joining
from gapwalk.studies.branch_family import FamilyWork, Member

EMPTY = 2  # the member without branches


class TwoAtATime:
    """Workers that have two pieces in progress, of which the one that began last is done first."""

    def __init__(self) -> None:
        self.begun: list[object] = []

    def each(self, function, pieces, in_order):
        assert not in_order
        running: list[int] = []
        while True:
            while len(running) < 2 and len(self.begun) < len(pieces):
                running.append(len(self.begun))
                piece = pieces[len(self.begun)]
                self.begun.append(piece if isinstance(piece, int) else tuple(member.number for member in piece))
            if not running:
                return
            index = running.pop()
            yield index, function(pieces[index])


def test_gaps_are_joined_while_members_are_walked(monkeypatch) -> None:
    def walk(system, asked, number: int) -> Member:
        return Member(number, float(number), cast("Any", () if number == EMPTY else (object(),)))

    monkeypatch.setattr(family_joining, "_walk_member", walk)
    monkeypatch.setattr(family_joining, "_join", lambda asked, members: ())
    over = SimpleNamespace(axis=(0.0, 1.0, 2.0, 3.0, 4.0))
    asked: Any = SimpleNamespace(parameter="frequency", ends=(1.0, 2.0), over=over)
    workers: Any = TwoAtATime()
    work = FamilyWork(cast("Any", None), asked)
    assert len([*work.parts(workers)]) == 8
    assert workers.begun == [0, 1, 2, 3, 4, (1, 3), (3, 4), (0, 1)]  # the first member is the last that is done
    assert work.complete
    assert sorted(work.connections) == [0, 1, 3]

"""Pieces of work that make others of their family superfluous: accepted in order, and begun in another one."""

import random
from collections.abc import Callable

import pytest

from gapwalk.parallel.families import _FamilyQueue, do_by_families
from gapwalk.parallel.workers import local_workers
from tests.studies.pieces import slow_double

ENDS = {0: {1}, 2: {3}, 4: {6}, 5: set(), 7: {8, 9}}  # what each of the pieces makes superfluous
FAMILIES = "aaaabbbccc"


class Job:
    """Ten pieces, some of them in progress, of which `choose` says which is done next."""

    def __init__(self, at_a_time: int, choose: Callable[[int], int]) -> None:
        self.begun: list[int] = []
        self.accepted: list[int] = []
        queue = _FamilyQueue(range(10), FAMILIES, self.is_needed)
        running: list[int] = []
        while True:
            while len(running) < at_a_time and len(self.begun) < len(queue):
                running.append(len(self.begun))
                self.begun.append(queue[len(self.begun)])
            if not running:
                break
            queue.take(running.pop(choose(len(running))), None)
            for index, _ in queue.in_turn():
                self.accepted.append(index)

    def is_needed(self, index: int) -> bool:
        return not any(index in ENDS.get(done, ()) for done in self.accepted)


def test_one_after_the_other_all_is_done_in_order() -> None:
    job = Job(1, lambda count: 0)
    assert job.begun == job.accepted == [0, 2, 4, 5, 7]


@pytest.mark.parametrize("seed", range(20))
def test_what_is_accepted_does_not_depend_on_what_is_in_progress(seed) -> None:
    job = Job(1 + seed % 5, random.Random(seed).randrange)
    assert job.accepted == [0, 2, 4, 5, 7]
    assert len(set(job.begun)) == len(job.begun)


def test_pieces_in_progress_are_of_different_families() -> None:
    """In order, two at a time, every second piece would be superfluous when it is done."""
    job = Job(2, lambda count: 0)
    assert job.begun[:2] == [0, 4]
    assert len(job.begun) <= 6


def test_in_a_single_family_neighbours_are_left_for_later() -> None:
    queue = _FamilyQueue(range(6), "aaaaaa", lambda index: True)
    assert [queue[number] for number in range(6)] == [0, 2, 4, 1, 3, 5]
    assert len(queue) == 6
    with pytest.raises(IndexError):
        queue[6]


@pytest.mark.parametrize("count", [1, 2])
def test_processes_yield_the_same_in_the_same_order(count) -> None:
    accepted: list[int] = []

    def is_needed(index: int) -> bool:
        return not (index % 2 and index - 1 in accepted)

    found = []
    with local_workers(count) as workers:
        for index, result in do_by_families(slow_double, [0, 1, 2, 3], "abab", is_needed, workers):
            accepted.append(index)
            found.append((index, result))
    assert found == [(0, 0), (2, 4)]

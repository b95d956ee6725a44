"""Pieces of work that make others of their group superfluous: accepted in order, and begun in another one."""

import random
from collections.abc import Callable

import pytest

from gapwalk.parallel.workers import Outcome, _GroupQueue, do_by_groups, local_workers
from tests.studies.pieces import die_at_three, fail_at_three, slow_double

ENDS = {0: {1}, 2: {3}, 4: {6}, 5: set(), 7: {8, 9}}  # what each of the pieces makes superfluous
GROUPS = "aaaabbbccc"


class Job:
    """Ten pieces, some of them in progress, of which `choose` says which is done next."""

    def __init__(self, at_a_time: int, choose: Callable[[int], int]) -> None:
        self.begun: list[int] = []
        self.accepted: list[int] = []
        queue = _GroupQueue(range(10), GROUPS, self.is_needed)
        running: list[int] = []
        while True:
            while len(running) < at_a_time and len(self.begun) < len(queue):
                running.append(len(self.begun))
                self.begun.append(queue[len(self.begun)])
            if not running:
                break
            queue.take(running.pop(choose(len(running))), Outcome(None))
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


def test_pieces_in_progress_are_of_different_groups() -> None:
    """In order, two at a time, every second piece would be superfluous when it is done."""
    job = Job(2, lambda count: 0)
    assert job.begun[:2] == [0, 4]
    assert len(job.begun) <= 6


def test_in_a_single_group_neighbours_are_left_for_later() -> None:
    queue = _GroupQueue(range(6), "aaaaaa", lambda index: True)
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
        for index, result in do_by_groups(slow_double, [0, 1, 2, 3], "abab", is_needed, workers):
            accepted.append(index)
            found.append((index, result))
    assert found == [(0, 0), (2, 4)]


@pytest.mark.parametrize("count", [1, 2])
@pytest.mark.parametrize("function", [fail_at_three, die_at_three])
def test_a_superfluous_piece_may_fail(count, function) -> None:
    if count == 1 and function is die_at_three:
        return  # it would end this process
    accepted: list[int] = []
    with local_workers(count) as workers:
        for index, _ in do_by_groups(function, [1, 3, 5], "abc", lambda index: index != 1 or not accepted, workers):
            accepted.append(index)
    assert accepted == [0, 2]


@pytest.mark.parametrize("count", [1, 2])
def test_a_piece_that_is_needed_raises_in_its_turn(count) -> None:
    with local_workers(count) as workers:
        found = do_by_groups(fail_at_three, [1, 3, 5], "abc", lambda index: True, workers)
        assert next(found) == (0, 1)
        with pytest.raises(ZeroDivisionError, match="three"):
            next(found)


def test_each_piece_is_asked_for_a_few_times_only() -> None:
    asked: list[int] = []

    def is_needed(index: int) -> bool:
        asked.append(index)
        return True

    with local_workers(1) as workers:
        list(do_by_groups(abs, range(400), "abcd" * 100, is_needed, workers))
    assert len(asked) <= 5 * 400

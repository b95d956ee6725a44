"""Chunks: the same results however they are cut and whoever does them, in pieces that are worth sending away."""

import signal
from types import SimpleNamespace

import numpy as np
import pytest

from gapwalk.errors import ModelError, WorkError
from gapwalk.parallel import work_chunks as chunks
from gapwalk.parallel.work_chunks import Pace, do_in_chunks, do_in_stages
from gapwalk.parallel.workers import Workers, local_workers
from tests.studies.pieces import die


def draw(items, seeds) -> list[tuple[int, float]]:
    """Each item with a random number."""
    return [(item, np.random.default_rng(seed).random()) for item, seed in zip(items, seeds, strict=True)]


def die_at_forty(items, seeds) -> list[int]:
    if 40 in items:
        die()
    return list(items)


EXPECTED = {  # straight from NumPy
    number: (100 + number, np.random.default_rng(child).random())
    for number, child in enumerate(np.random.SeedSequence(7).spawn(50))
}


@pytest.mark.parametrize("size", [None, 1, 7, 50, 1000])
def test_results_do_not_depend_on_the_chunks(size) -> None:
    found = do_in_chunks(draw, range(100, 150), Workers(), seed=7, size=size)
    assert found == EXPECTED
    assert list(found) == list(range(50))


def test_results_do_not_depend_on_who_does_them() -> None:
    with local_workers(2) as workers:
        assert do_in_chunks(draw, range(100, 150), workers, seed=7, size=4) == EXPECTED


def test_what_is_known_is_not_done_again() -> None:
    kept = {}
    known = {number: EXPECTED[number] for number in (0, 1, 5, 20, 21, 49)}
    found = do_in_chunks(draw, range(100, 150), Workers(), seed=7, size=6, known=known, keep=kept.__setitem__)
    assert found == EXPECTED
    assert kept == {first: [EXPECTED[number] for number in range(first, stop)] for first, stop in SPANS}


SPANS = [(2, 5), (6, 12), (12, 18), (18, 20), (22, 28), (28, 34), (34, 40), (40, 46), (46, 49)]


def test_chunks_grow_until_they_are_worth_it(monkeypatch) -> None:
    now, sizes, paces = 0.0, [], []

    def work(items, seeds) -> list[int]:
        nonlocal now
        now += len(items) / 1024 + (2.0 if 0 in items else 0.0)  # the first one waits for the compiler
        return list(items)

    monkeypatch.setattr(chunks, "time", SimpleNamespace(perf_counter=lambda: now, monotonic=lambda: now))
    found = do_in_chunks(
        work, range(4000), Workers(), keep=lambda first, results: sizes.append(len(results)), report=paces.append
    )
    assert list(found.values()) == list(range(4000))
    assert sizes[:8] == [1, 1, 1, 16, 16, 256, 256, 512]  # the last one is half a second of work
    assert all(103 <= size <= 512 for size in sizes[5:-1])
    assert sizes[-2] < 400  # towards the end they are smaller, so that all workers end at the same time
    assert [pace.done for pace in paces] == np.cumsum(sizes).tolist()
    assert paces[-1].rate == pytest.approx(4000 / (2.0 + 4000 / 1024))
    assert paces[-1].left == 0.0


@pytest.mark.parametrize("count", [1, 2])
def test_ctrl_c_keeps_what_there_is(count) -> None:
    paces = []

    def report(pace: Pace) -> None:
        paces.append(pace)
        if len(paces) == 3:
            signal.raise_signal(signal.SIGINT)

    with local_workers(count) as workers:
        some = do_in_chunks(draw, range(100, 150), workers, seed=7, size=5, report=report)
        assert len(some) == 15
        assert do_in_chunks(draw, range(100, 150), workers, seed=7, size=5, known=some) == EXPECTED


def test_a_chunk_that_kills_its_process_costs_no_other_one() -> None:
    kept = {}
    with local_workers(2) as workers, pytest.raises(WorkError) as caught:
        do_in_chunks(die_at_forty, range(60), workers, size=6, keep=kept.__setitem__)
    assert sorted(number for numbers in kept.values() for number in numbers) == [*range(36), *range(42, 60)]
    assert caught.value.pieces == (6,)


def test_nothing_to_do() -> None:
    assert do_in_chunks(draw, [], Workers()) == {}
    assert do_in_chunks(draw, range(3), Workers(), known=dict.fromkeys(range(3), (0, 0.0))) == dict.fromkeys(
        range(3), (0, 0.0)
    )


def test_what_makes_no_sense() -> None:
    with pytest.raises(ModelError, match="size is 0"):
        do_in_chunks(draw, [1], Workers(), size=0)
    with pytest.raises(ValueError, match="2 items have 1 results"):
        do_in_chunks(lambda items, seeds: items[:1], [1, 2], Workers(), size=2)


def halves(number: int) -> list[int]:
    """The item itself, and what is left of it: as many pieces as its last digit says."""
    return [number, *range(number % 10)]


def square(piece: int) -> int:
    return piece * piece


def left_of(item: int, found: list[int]) -> list[int]:
    assert found[0] == item
    return found[1:]


@pytest.mark.parametrize("count", [1, 2])
def test_what_items_leave_is_done_in_pieces(count: int) -> None:
    items = [30, 42, 51, 65]
    with local_workers(count) as workers:
        found = sorted(do_in_stages(halves, items, left_of, square, workers))
    assert found == [(k, [n, *range(n % 10)], [j * j for j in range(n % 10)]) for k, n in enumerate(items)]


def test_what_an_item_leaves_is_done_before_the_next_item_begins() -> None:
    order = []

    def first(item: int) -> int:
        order.append(("first", item))
        return item

    def second(piece: int) -> int:
        order.append(("second", piece))
        return piece

    ends = [index for index, _, _ in do_in_stages(first, [3, 0, 2], lambda item, _: range(item), second, Workers())]
    assert ends == [0, 1, 2]
    assert order == [
        ("first", 3),
        *(("second", k) for k in range(3)),
        ("first", 0),
        ("first", 2),
        *(("second", k) for k in range(2)),
    ]


def test_a_piece_that_kills_its_process_is_named_in_stages() -> None:
    with local_workers(2) as workers, pytest.raises(WorkError, match="died over piece"):
        list(do_in_stages(halves, [2, 1], left_of, die, workers))

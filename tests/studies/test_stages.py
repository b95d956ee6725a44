"""Work in stages: what an item leaves is done in pieces, by whoever is free."""

import pytest

from gapwalk.errors import WorkError
from gapwalk.parallel.workers import Workers, do_in_stages, local_workers
from tests.studies.pieces import die


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

"""Cases of a broad test that are left to the campaign are named beside the test."""

from pathlib import Path
from typing import Any

import pytest

from tests.tiers import keeps, leave_to_campaign, leaves


class Item:
    """A case of a test, as far as its marks are asked for."""

    path = Path("test_x.py")

    def __init__(self, name: str, *marks: pytest.MarkDecorator) -> None:
        self.name, self.marks = name, [each.mark for each in marks]

    def iter_markers(self, name: str) -> list[pytest.Mark]:
        return [each for each in self.marks if each.name == name]

    def add_marker(self, mark: pytest.MarkDecorator) -> None:
        self.marks.append(mark.mark)


def slow(mark: pytest.MarkDecorator, **how: bool) -> list[str]:
    items: list[Any] = [Item("test_all[a]", mark), Item("test_all[b-1]", mark), Item("test_one")]
    leave_to_campaign(items, **{"whole": True, **how})
    return [each.name for each in items if each.iter_markers("slow")]


def test_cases_are_kept_or_left() -> None:
    assert slow(keeps("a")) == ["test_all[b-1]"]
    assert slow(leaves("a")) == ["test_all[a]"]


@pytest.mark.parametrize("mark", [keeps("a", "c"), leaves("a", "c")])
def test_a_case_that_is_not_there_is_refused(mark: pytest.MarkDecorator) -> None:
    with pytest.raises(pytest.UsageError, match=r"cases that are not there.*test_x\.py::test_all.*'c'"):
        slow(mark)
    assert slow(mark, whole=False)

"""Cases of a broad test that are left to the campaign are named beside the test."""

from typing import Any

import pytest

from tests import tiers
from tests.tiers import TESTS, keeps, leave_to_campaign


class Item:
    """A case of a test, as far as its marks are asked for."""

    path = TESTS / "test_x.py"

    def __init__(self, name: str, *marks: pytest.MarkDecorator) -> None:
        self.name, self.marks = name, [each.mark for each in marks]

    def iter_markers(self, name: str) -> list[pytest.Mark]:
        return [each for each in self.marks if each.name == name]

    def add_marker(self, mark: pytest.MarkDecorator) -> None:
        self.marks.append(mark.mark)


def slow(*marks: pytest.MarkDecorator, **how: bool) -> list[str]:
    items: list[Any] = [Item("test_all[a]", *marks), Item("test_all[b-1]", *marks), Item("test_one")]
    leave_to_campaign(items, **{"whole": True, **how})
    return [each.name for each in items if each.iter_markers("slow")]


@pytest.fixture(params=[["test_all[a]"], ["test_all[a]", "test_one"], ["test_all[a]", "test_all[c]"]])
def listed(request, monkeypatch) -> list[str]:
    """The names in the list of twins."""
    monkeypatch.setattr(tiers, "twins", lambda: [f"test_x.py::{name}" for name in request.param])
    return request.param


def test_the_list_names_files_that_are_there() -> None:
    assert all((TESTS / each.partition("::")[0]).exists() for each in tiers.twins())


def test_cases_are_kept_or_left(listed) -> None:
    assert slow(keeps("a"), whole=False)[:2] == ["test_all[a]", "test_all[b-1]"]
    assert slow(whole=False) == [name for name in listed if name != "test_all[c]"]


def test_a_case_that_is_not_there_is_refused(listed) -> None:
    if "test_all[c]" in listed:
        with pytest.raises(pytest.UsageError, match=r"cases that are not there.*test_x\.py::.*'test_all\[c\]'"):
            slow()
    with pytest.raises(pytest.UsageError, match=r"cases that are not there.*test_x\.py::test_all.*'c'"):
        slow(keeps("a", "c"))
    assert slow(keeps("a", "c"), whole=False)

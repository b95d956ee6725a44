"""The lines of the table of comparisons hold, and the page has them."""

import pytest

from tests.trust.compared import LINES, OWN, PAGE


@pytest.mark.parametrize("line", OWN, ids=[line.source for line in OWN])
def test_a_line_holds(line) -> None:
    """Those that test_published_cases.py does not compute."""
    assert line.difference(line.compute()) <= line.bound


@pytest.mark.parametrize("line", LINES, ids=[line.what for line in LINES])
def test_a_line_is_on_the_page_with_a_difference_that_is_allowed(line) -> None:
    row = next(row for row in PAGE.read_text(encoding="utf-8").splitlines() if row.startswith(f"| {line.what} |"))
    assert f"| {line.source} | {line.shown} |" in row
    assert row.endswith(f"| {line.bound:.0e} |")
    assert float(row.split("|")[-3]) <= line.bound

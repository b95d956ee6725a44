"""The lines of the table of comparisons hold, and the page has them."""

import pytest

from tests.trust.compared import LINES, PAGE


@pytest.mark.parametrize("line", LINES, ids=[line.source for line in LINES])
def test_a_line_holds_and_is_on_the_page(line) -> None:
    assert line.difference <= line.bound
    row = next(row for row in PAGE.read_text(encoding="utf-8").splitlines() if row.startswith(f"| {line.what} |"))
    assert f"| {line.source} | {line.reference:.12g} |" in row
    assert row.endswith(f"| {line.bound:.0e} |")

"""Each page of the numerical methods says first which question it answers, and somewhere why it is done this way."""

import re
from pathlib import Path

import pytest

FOLDER = Path(__file__).parents[2] / "docs" / "numerics"
PAGES = sorted(path.stem for path in FOLDER.glob("*.md") if path.stem != "index")


@pytest.mark.parametrize("name", PAGES)
def test_a_page_begins_with_what_the_reader_gets(name) -> None:
    title, opening, *rest = (FOLDER / f"{name}.md").read_text(encoding="utf-8").split("\n\n")
    assert title.startswith("# ")
    assert re.search(r"\?|\bThis page\b", opening), f"{name}.md begins with {opening!r}, not with a question"
    assert any(part.startswith("## Why this way") for part in rest), f"{name}.md does not say why"

"""Pages of numerical methods are few, begin with what they are for, and lead on; the code names notes that exist."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "docs" / "numerics"
PAGES = sorted(FOLDER.glob("*.md"))
NOTES = sorted((FOLDER / "notes").glob("*.md"))
MOST = 12
LINK = re.compile(r"\]\(([^)#]+\.md)")


def test_there_are_few_pages_for_users() -> None:
    assert 0 < len(PAGES) <= MOST


@pytest.mark.parametrize("page", [*PAGES, *NOTES], ids=lambda page: f"{page.parent.name}/{page.stem}")
def test_a_page_begins_with_what_it_is_for(page: Path) -> None:
    title, opening, *_ = page.read_text(encoding="utf-8").split("\n\n")
    assert title.startswith("# ")
    assert re.search(r"\?|\b(This page|These pages)\b", opening), f"{page.name} begins with {opening!r}"


@pytest.mark.parametrize("page", [*PAGES, *NOTES], ids=lambda page: f"{page.parent.name}/{page.stem}")
def test_a_page_leads_on(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    leads = [(page.parent / link).resolve() for link in LINK.findall(text)]
    assert all(link.exists() for link in leads)
    if "## Limits" not in text and page in PAGES and page.stem != "index" and "**Limits.**" not in text:
        assert "## Why this way" in text, f"{page.name} says neither what it leaves out nor why"
    assert leads or page.parent != FOLDER, f"{page.name} is a dead end"


def test_the_code_names_notes_that_exist() -> None:
    named = {
        name
        for file in (ROOT / "src").rglob("*.py")
        for name in re.findall(r"docs/numerics/[\w/-]+\.md", file.read_text(encoding="utf-8"))
    }
    assert len(named) > 5
    assert not [name for name in sorted(named) if not (ROOT / name).exists()]

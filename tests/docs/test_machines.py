"""The machines in the gallery are those that their models draw, one on each page, and each page has a card."""

import pytest

from docs._ext.machines import GALLERY, PAGES, drawing, file_of
from docs._ext.responses import picture_of

INDEX = (GALLERY / "index.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("page", PAGES)
def test_a_machine_is_up_to_date_and_shown_on_its_page(page) -> None:
    file = file_of(page)
    assert file.read_text(encoding="utf-8") == drawing(page), "make it again: python -m docs._ext.machines"
    assert f"pictures/{file.name})" in (GALLERY / f"{page}.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("page", PAGES)
def test_a_card_shows_the_machine_and_a_result(page) -> None:
    for picture in (file_of(page), picture_of(page)):
        assert f"(../pictures/{picture.name})]({page}.md)" in INDEX
        assert picture.is_file(), f"make it: python -m docs._ext.responses {page}"

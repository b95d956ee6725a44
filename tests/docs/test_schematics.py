"""The schematic drawings in the documentation are those that their program makes."""

import pytest

from docs._ext.schematics import DRAWINGS, FOLDER


@pytest.mark.parametrize("name", DRAWINGS)
def test_a_drawing_is_up_to_date_and_shown_on_its_page(name):
    file = FOLDER / f"schematic-{name}.svg"
    assert file.read_text(encoding="utf-8") == DRAWINGS[name]().svg(), "make it again: python -m docs._ext.schematics"
    assert any(file.name in page.read_text(encoding="utf-8") for page in FOLDER.parent.rglob("*.md"))

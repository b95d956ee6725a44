"""The pictures of the explorer show each of its panels, and each of them stands on a page."""

import re
from pathlib import Path

import pytest
from PIL import Image

import gapwalk.explorer
from docs._ext.screenshots import PICTURES, SHOTS
from tests.docs.test_pages import DOCS

PAGE = Path(gapwalk.explorer.__file__).parent / "page" / "index.html"
HEADING = re.compile(r"<(?:figcaption|summary)>(?P<panel>[^<]+)</|<dialog[^>]*>\s*<h2>(?P<dialog>[^<]+)</")
LARGEST = 150_000  # bytes


def test_each_panel_is_named_on_the_page_of_the_explorer() -> None:
    panels = {match["panel"] or match["dialog"] for match in HEADING.finditer(PAGE.read_text(encoding="utf-8"))}
    assert {"Compute", "Time history", "Keys"} <= panels
    text = " ".join((DOCS / "howto" / "explorer.md").read_text(encoding="utf-8").lower().split())
    assert not sorted(panel for panel in panels if panel.lower() not in text)
    assert not sorted({shot.panel for shot in SHOTS} - panels - {"", "Diagram"}), "the page has no such panels any more"


@pytest.mark.parametrize("shot", SHOTS, ids=[shot.name for shot in SHOTS])
def test_a_picture_is_there_is_small_and_is_not_empty(shot) -> None:
    path = PICTURES / shot.file
    assert path.stat().st_size < LARGEST
    with Image.open(path) as picture:
        assert min(picture.size) > 100
        assert len(picture.convert("RGB").getcolors(1 << 24)) > 8


def test_the_pictures_stand_on_the_page_of_the_explorer() -> None:
    text = (DOCS / "howto" / "explorer.md").read_text(encoding="utf-8")
    there = {path.name for path in PICTURES.glob("explorer-*.png")}
    assert there == {shot.file for shot in SHOTS}
    assert not sorted(name for name in there if f"pictures/{name})" not in text)

"""Every picture and every quoted answer of the documentation stands in one list, with the command that makes it."""

import re
from fnmatch import fnmatch
from pathlib import Path

import pytest

from docs._ext.made import FAMILIES, MADE, PICTURES, QUOTES, ROOT, TOLERANCE, Quote, difference, problems, quotes_of
from docs._ext.meanings import PAGE, whole
from docs._ext.screenshots import SHOTS
from tests.docs.commands import parse_command

PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
TEXTS = {page.relative_to(ROOT).as_posix(): page.read_text(encoding="utf-8") for page in PAGES}


def test_each_picture_is_in_the_list_and_on_a_page() -> None:
    there = {path.name for path in PICTURES.iterdir()}
    listed = {name for name in there if any(fnmatch(name, pattern) for pattern in FAMILIES)} | MADE.keys()
    assert there == listed
    assert {name for name in there if name.startswith("explorer-")} == {shot.file for shot in SHOTS}
    shown = {name for text in TEXTS.values() for name in re.findall(r"pictures/([\w-]+\.\w+)\b", text)}
    assert there <= shown


@pytest.mark.parametrize("name", MADE)
def test_its_command_exists(name: str) -> None:
    words = MADE[name].split()
    if words[0] == "gapwalk":
        parse_command(words)
    else:
        assert (ROOT / f"{words[2].replace('.', '/')}.py").exists()


def test_each_quote_is_in_the_list() -> None:
    quoting = {page for page, text in TEXTS.items() if re.search(r"^> ", text, re.M)}
    assert quoting == QUOTES.keys()
    for page, words in QUOTES.items():
        assert {each.words for each in quotes_of(page)} <= {*words}
        assert all(each.text for each in quotes_of(page))


def test_the_table_of_meanings_is_that_of_the_code() -> None:
    text = PAGE.read_text(encoding="utf-8")
    assert whole(text) == text, "make it again: python -m docs._ext.meanings"
    assert text.count("border: 1px") > 40


def test_another_number_is_another_answer() -> None:
    said = "mesh rattles from 898.377 to 1001.53 rpm;\nworst at 942.977 rpm"
    assert Quote("", "", "mesh rattles from 898.377 to 1001.53 rpm; worst at 942.977 rpm").is_in(said)
    assert not Quote("", "", "mesh rattles from 898.378 to 1001.53 rpm").is_in(said)
    assert Quote("", "", "| from | 898.38 | `clutch2.x` | 1,001.5 |", is_row=True).is_in(said)
    assert not Quote("", "", "| from | 898.37 |", is_row=True).is_in(said)


def test_another_picture_differs(tmp_path: Path) -> None:
    from PIL import Image, ImageDraw

    whole = Image.open(PICTURES / "clutch.png").convert("RGB")
    assert difference(PICTURES / "clutch.png", PICTURES / "clutch.png") == 0.0
    ImageDraw.Draw(whole).line([(400, 300), (900, 300)], fill="red", width=12)
    whole.save(tmp_path / "line.png")
    assert difference(PICTURES / "clutch.png", tmp_path / "line.png") > TOLERANCE
    whole.resize((800, 480)).save(tmp_path / "small.png")
    assert difference(PICTURES / "clutch.png", tmp_path / "small.png") > 1.0


@pytest.mark.slow
@pytest.mark.parametrize("name", [*(name for name in MADE if name != "kept.png"), *QUOTES])
def test_it_is_what_its_command_makes(name: str) -> None:
    assert problems(name) == []

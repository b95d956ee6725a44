"""The generated reference has every key, each with words, a type and an example; and every command."""

import tomllib
from collections.abc import Iterator

import pytest

from docs._ext.file_reference import all_keys, command_page, docstring_words, page, pictures_page
from gapwalk.cli.commands import app
from gapwalk.studies.study_kind import kind_of, kinds
from gapwalk.studies.study_schema import all_keys as keys_of_studies

KEY_PAGES = all_keys()
ROWS = [key for keys in KEY_PAGES.values() for key in keys]
KINDS, KEYS = kinds(), keys_of_studies()  # now: other tests add kinds of their own later


def test_every_key_of_every_kind_of_study_is_there() -> None:
    assert {key.name for key in ROWS} >= KEYS
    assert {key.table for key in ROWS} >= {*KINDS, "", "contact", "contact.stage", "gear", "harmonic", "reduction"}
    assert len(ROWS) > 500


@pytest.mark.parametrize("name", KEY_PAGES)
def test_a_key_has_words_a_type_and_an_example(name: str) -> None:
    keys = KEY_PAGES[name]
    assert not [f"{key.table}.{key.name}" for key in keys if not (key.words and key.example and key.type)]
    assert not [
        f"{key.table}.{key.name}: {key.type}" for key in keys if "typing" in key.type or "Annotated" in key.type
    ]


@pytest.mark.parametrize("name", KEY_PAGES)
def test_examples_can_be_read(name: str) -> None:
    for key in KEY_PAGES[name]:
        if key.example != "below":
            tomllib.loads(key.example.strip("`"))  # the text is part of the error


def test_defaults_and_bounds_are_those_of_the_records() -> None:
    by_name = {(key.table, key.name): key for key in ROWS}
    assert by_name["response.walk", "largest_step"].default == "`0.01`"
    assert by_name["response.walk", "largest_step"].bound == "> 0"
    assert by_name["contact", "clearance"].bound == ">= 0"
    assert by_name["gear", "clearance"].unit == "deg"
    assert "begin" in docstring_words(kind_of("response"))


def test_a_key_of_several_kinds_is_described_once() -> None:
    text = page("study-file", KEY_PAGES["study-file"])
    assert text.count("| `largest_step` |") == 1
    assert text.count("| `segments` |") == 1
    shared, *own = text.split("\n## kind = ")
    assert "| `max_branches` |" not in shared
    assert [each.split('"')[1] for each in own if each.split('"')[1] in KINDS] == list(KINDS)  # others may have toys
    for key in KEY_PAGES["study-file"]:
        assert f"`{key.name}`" in text


@pytest.mark.slow
def test_a_drive_train_does_not_repeat_the_keys_of_a_model_file() -> None:
    model, train = ({*_rows(page(name, KEY_PAGES[name]))} for name in ("model-file", "train-file"))
    assert len(model) > 100
    assert len(train) > 100
    assert not model & train


def _rows(text: str) -> Iterator[tuple[str, str]]:
    """Yield the rows of keys of a page, each with the table in which it stands."""
    for part in text.split("\n## ")[1:]:
        title, *lines = part.splitlines()
        yield from ((title, line) for line in lines if line.startswith("| `"))


def test_pictures_of_all_records_have_their_options() -> None:
    text = pictures_page()
    assert "| `Branch` | `measure='half'`" in text
    assert all(f"| `{name}` |" in text for name in ("Diagram", "Map", "Orbit", "RattleBands", "Torus"))


def test_every_command_is_there() -> None:
    text = command_page()
    names = [name for name in app if not name.startswith("-")]
    assert len(names) >= 11
    assert all(f"## gapwalk {name}\n" in text for name in names)
    assert all(f"| {code} |" in text for code in (0, 1, 2, 3, 4, 5, 130, 143))
    assert "`XDG_CACHE_HOME`" in text

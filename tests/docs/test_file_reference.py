"""The generated reference has every key, each with words, a type and an example; and every command."""

import tomllib

import pytest

from docs._ext.file_reference import Key, all_keys, command_page, docstring_words
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


@pytest.mark.parametrize("key", ROWS, ids=lambda key: f"{key.table}.{key.name}")
def test_an_example_can_be_read(key: Key) -> None:
    if key.example != "below":
        tomllib.loads(key.example.strip("`"))


def test_defaults_and_bounds_are_those_of_the_records() -> None:
    by_name = {(key.table, key.name): key for key in ROWS}
    assert by_name["response.walk", "largest_step"].default == "`0.01`"
    assert by_name["response.walk", "largest_step"].bound == "> 0"
    assert by_name["contact", "clearance"].bound == ">= 0"
    assert by_name["gear", "clearance"].unit == "deg"
    assert "begin" in docstring_words(kind_of("response"))


def test_every_command_is_there() -> None:
    text = command_page()
    names = [name for name in app if not name.startswith("-")]
    assert len(names) >= 11
    assert all(f"## gapwalk {name}\n" in text for name in names)
    assert all(f"| {code} |" in text for code in (0, 1, 2, 3, 4, 5, 130, 143))
    assert "`XDG_CACHE_HOME`" in text

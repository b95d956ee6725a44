"""The public names are few; the types that they return or hold are described where they are used."""

import pytest

import gapwalk as gw
from docs._ext.held_types import held_types, records_page
from gapwalk.field_docs import field_words
from tests.release.names import public_things

MOST = 85


def test_there_are_few_public_names() -> None:
    assert len(gw.__all__) < MOST  # and __version__


def test_the_fields_of_every_returned_type_are_described() -> None:
    held = {kind for thing in public_things().values() for kind in held_types(thing)}
    assert len(held) > 50
    for kind in held:
        silent = [name for name in getattr(kind, "__dataclass_fields__", {}) if name not in field_words(kind)]
        assert all(name.startswith("_") for name in silent), f"describe {silent} of {kind.__qualname__} behind them"


def test_what_a_function_returns_is_described_on_the_page_of_records() -> None:
    assert gw.basin_shares.__annotations__["return"] == "BasinShares"
    text = records_page()
    assert text.count(".. py:class:: BasinShares\n") == 1
    assert "\n   ``starts``\n       Number of starts that lead to it.\n" in text[text.index(".. py:class:: Share\n") :]


def test_a_name_of_a_namespace_is_said_to_be_there() -> None:
    with pytest.raises(AttributeError, match=r"module 'gapwalk' has no attribute 'Train'; write gapwalk\.train\.Train"):
        gw.Train  # noqa: B018  # pyright: ignore[reportAttributeAccessIssue]
    with pytest.raises(AttributeError, match=r"no attribute 'Trains'$"):
        gw.Trains  # noqa: B018  # pyright: ignore[reportAttributeAccessIssue]

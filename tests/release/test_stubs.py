"""The functions of studies: their stub is that of their declarations, and no field hides a method."""

from dataclasses import fields

import pytest

from gapwalk.studies.functions import FUNCTIONS, keywords_of
from gapwalk.studies.study_kind import StudyKind, kind_of, kinds
from tests.release.stubs import STUB, text


def test_the_stub_is_that_of_the_declarations() -> None:
    assert STUB.read_text(encoding="utf-8") == text(), "write it again: python -m tests.release.stubs"


@pytest.mark.parametrize("name", kinds())
def test_no_field_of_a_study_has_the_name_of_a_method(name: str) -> None:
    methods = {name for name in dir(StudyKind) if not name.startswith("_")}
    assert methods.isdisjoint(field.name for field in fields(kind_of(name)))


@pytest.mark.parametrize("name", FUNCTIONS)
def test_no_two_keywords_of_a_function_have_one_name(name: str) -> None:
    names = [each.name for each in keywords_of(kind_of(FUNCTIONS[name]))]
    assert len(set(names)) == len(names)

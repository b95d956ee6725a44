"""Every public name is described: parameters, returned values, errors, attributes; its example prints what it says."""

import doctest

import matplotlib.pyplot as plt
import pytest

from docs._ext.docstrings import own_text
from tests.docs.docstrings import Thing, missing, namespace, shared, things

ALL = list(things())
FLAGS = doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS


@pytest.mark.parametrize("thing", ALL, ids=lambda thing: thing.name)
def test_a_docstring_describes_everything(thing: Thing) -> None:
    assert not list(missing(thing)), f"{thing.name} needs sections in its docstring, in the form of numpydoc"


@pytest.mark.parametrize("thing", [each for each in ALL if each.owner is None], ids=lambda thing: thing.name)
def test_an_example_prints_what_it_says(thing: Thing, tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    example = doctest.DocTestParser().get_doctest(
        own_text(thing.value), namespace(thing.sections["Examples"]), thing.name, None, 0
    )
    try:
        assert not doctest.DocTestRunner(optionflags=FLAGS).run(example).failed
    finally:
        plt.close("all")


def test_a_missing_section_is_noticed() -> None:
    def told(value: float) -> float:
        """Return the value."""
        if value < 0.0:
            raise ValueError("it is negative")
        return value

    assert list(missing(Thing("told", told))) == ["Examples", "Returns", "Raises", "an entry for value"]


def test_an_example_uses_the_names_of_the_page() -> None:
    assert namespace(">>> branch.values")["branch"] is shared("branch")

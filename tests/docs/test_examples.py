"""The examples of the functions with which scripts begin run, and print what they say."""

import doctest

import pytest

import gapwalk as gw

# each of them must have an example
FIRST = ("backlash", "stop", "find_orbit", "follow", "settle")


@pytest.mark.parametrize("name", FIRST)
def test_an_example_prints_what_it_says(name) -> None:
    found = doctest.DocTestFinder(recurse=False).find(getattr(gw, name), name, globs={})
    examples = [each for each in found if each.examples]
    assert examples, f"gw.{name} has no example"
    for each in examples:
        assert not doctest.DocTestRunner().run(each).failed

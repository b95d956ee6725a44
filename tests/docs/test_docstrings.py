"""Every public name is described: parameters, returned values, errors, attributes; its example prints what it says."""

import doctest

import matplotlib.pyplot as plt
import pytest

import gapwalk as gw
from docs._ext.docstrings import complete, own_text
from docs._ext.printed_examples import names_in, printed
from gapwalk.model.registry import extensions
from tests.docs.docstrings import Thing, missing, namespace, shared, things
from tests.tiers import some_of

ALL = list(things())
NAMES = {thing.name: thing for thing in ALL if thing.owner is None}
RUN_NOW = ("System", "Stage", "find_orbit", "follow", "verify", "train.Train", "analysis.energy", "ask.SpeedCourse")
FLAGS = doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS


def test_docstrings_describe_everything() -> None:
    silent = {thing.name: found for thing in ALL if (found := list(missing(thing)))}
    assert not silent, "these need sections in their docstrings, in the form of numpydoc"


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


def test_examples_take_nothing_from_elsewhere() -> None:
    for thing in ALL:
        if thing.owner is None:
            code = code_on_the_page(thing)
            assert code.startswith("import "), thing.name
            defines, uses = names_in(code)
            assert not uses - defines, f"the example of {thing.name} uses what its page does not define"


@pytest.mark.parametrize("name", some_of(NAMES, *RUN_NOW))
def test_an_example_runs_as_it_is_printed(name: str, tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    # other processes would import the module of the kinds that an example registers, and there is no such file
    monkeypatch.setattr("gapwalk.model.registry._extensions", extensions())
    try:
        exec(code_on_the_page(NAMES[name]), {"__name__": "copied"})
    finally:
        plt.close("all")


def code_on_the_page(thing: Thing) -> str:
    """Return the code of the example of a public name as its page prints it."""
    lines: list[str] = own_text(thing.value).splitlines()
    what = "class" if isinstance(thing.value, type) else "function"
    complete(None, what, f"gapwalk.{thing.name}", thing.value, None, lines)  # type: ignore[arg-type]
    start = lines.index(".. code-block:: python") + 2
    code = [line[4:] for line in lines[start:] if line.startswith("    ") or not line.strip()]
    return "\n".join(code)


def test_outputs_are_comments_and_shared_systems_are_defined() -> None:
    code = printed(">>> fold.kind.value\n'fold'\n")
    assert code.startswith("import gapwalk as gw\n\nsystem = gw.System(")
    assert code.endswith("fold.kind.value\n# 'fold'\n")


def test_a_parameter_has_its_type_and_what_is_returned_is_a_link() -> None:
    lines = own_text(gw.find_orbit).splitlines()
    complete(None, "function", "gapwalk.find_orbit", gw.find_orbit, None, lines)  # type: ignore[arg-type]
    assert "system : System" in lines
    assert "start : str or Sequence[float] or array or Orbit" in lines
    assert "`Orbit`" in lines


def test_a_missing_section_is_noticed() -> None:
    def told(value: float) -> float:
        """Return the value."""
        if value < 0.0:
            raise ValueError("it is negative")
        return value

    assert list(missing(Thing("told", told))) == ["Examples", "Returns", "Raises", "an entry for value"]


def test_an_example_uses_the_names_of_the_page() -> None:
    assert namespace(">>> branch.values")["branch"] is shared("branch")

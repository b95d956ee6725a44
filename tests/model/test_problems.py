"""Problems are one line each, whatever stands in the file."""

import pickle

import pytest

from gapwalk.errors import ModelError
from gapwalk.model.problems import ModelFileError, Problem, did_you_mean, dotted, given, near_names


def test_a_problem_is_one_line() -> None:
    assert str(Problem("is -1; it must be >= 0", "c[0].clearance", 12, "m.toml")) == (
        "m.toml:12: c[0].clearance is -1; it must be >= 0"
    )
    assert str(Problem("is missing", "frequency", file="m.toml")) == "m.toml: frequency is missing"
    assert str(Problem("is missing", "frequency")) == "frequency is missing"
    assert str(Problem("a\nb\x1b[31m", "c")) == r"c a\nb\x1b[31m"


def test_an_error_lists_its_problems_and_can_be_pickled() -> None:
    problems = [Problem("is missing", "a"), Problem("is 3", "b", 2)]
    error = pickle.loads(pickle.dumps(ModelFileError(problems)))
    assert isinstance(error, ModelError)
    assert isinstance(error, ValueError)
    assert error.problems == tuple(problems)
    assert str(error) == "a is missing\nline 2: b is 3"


def test_a_flood_of_problems_is_cut_short() -> None:
    error = ModelFileError(Problem("is wrong", f"a[{i}]") for i in range(1000))
    assert len(error.problems) == 1000
    assert str(error).splitlines()[-1] == "... and 800 more"


def test_paths_are_written_as_in_toml() -> None:
    assert dotted(("contact", 0, "stage", 1, "clearance")) == "contact[0].stage[1].clearance"
    assert dotted(("a b", "", "c\n")) == '"a b"."".' + r'"c\n"'


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (1.5, "1.5"),
        (True, "true"),
        ("a\nb", r'"a\nb"'),
        ({"a": 1}, "a table"),
        ([1, "b", [2]], '[1, "b", [...]]'),
        pytest.param(10**5000, "an enormous number", id="enormous"),
        ("x" * 1000, '"' + "x" * 56 + "..."),
    ],
)
def test_values_are_given_back_in_short(value, text: str) -> None:
    assert given(value) == text


@pytest.mark.parametrize(
    ("word", "known", "near"),
    [
        ("clearence", ["clearance", "stiffness"], ["clearance"]),
        ("balance", ["shooting", "harmonic-balance"], ["harmonic-balance"]),  # a part of it
        ("acceleration", ["time", "accel"], ["accel"]),  # each may be the beginning of the other
        ("clear", ["clearance", "stiffness"], ["clearance"]),
        ("mean.q2", ["frequency", "mean.q3", "mass.q1.q1"], ["mean.q3"]),  # another number
        ("q33", ["q1", "q3"], ["q3"]),
        ("stage3", ["q1", "stage2.force"], ["stage2.force"]),
        ("stgae2", ["q1", "stage2.force"], ["stage2.force"]),
        ("friction", ["deflection", "stiffness"], []),
        ("stop.friction", ["stop.deflection.x", "stop.stiffness"], []),
        ("y", ["x", "z"], []),
        ("30", ["20a", "27"], []),
        ("xyz", ["clearance", "stiffness"], []),
    ],
)
def test_names_that_may_have_been_meant_are_offered(word, known, near) -> None:
    assert near_names(word, known) == near


def test_all_names_are_told_where_none_is_near() -> None:
    assert did_you_mean("clearence", ["clearance", "stiffness"]) == "did you mean clearance?"
    assert did_you_mean("xyz", ["clearance", "stiffness"]) == "they are clearance, stiffness"

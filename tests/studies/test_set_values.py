"""Changes from outside of the file: how they are written, and where they go."""

import pytest

from gapwalk.errors import ModelError
from gapwalk.model import ModelFileError
from gapwalk.model.model_source import parse_source
from gapwalk.studies.set_values import parse_change
from gapwalk.studies.study_file import Study, check_study

TEXT = """\
coordinates = ["x"]
stiffness = [1]
damping = [0.1]
frequency = 2

[[contact]]
name = "stop"
deflection = { x = 1 }
[[contact.stage]]
clearance = 1
stiffness = 2
[[contact.stage]]
clearance = 2
stiffness = 3

[study]
kind = "response"
parameter = "stop.stage1.stiffness"
to = 5
"""


def change(changes) -> Study:
    return check_study(parse_source(TEXT, "m.toml"), changes)


@pytest.mark.parametrize(
    ("text", "change"),
    [
        ("stop.clearance=0.5", ("stop.clearance", 0.5)),
        (" study.period = 2 ", ("study.period", 2)),
        ("study.parameter=frequency", ("study.parameter", "frequency")),
        ('study.parameter="frequency"', ("study.parameter", "frequency")),
        ("study.start=[0.0, 1]", ("study.start", [0.0, 1])),
        ("a=b=c", ("a", "b=c")),
        ("a=.5", ("a", 0.5)),
        ("a=-5.e1", ("a", -50.0)),
        ("a=1\nb=2", ("a", "1\nb=2")),
    ],
)
def test_a_change_is_name_and_value(text: str, change: tuple[str, object]) -> None:
    name, value = parse_change(text)
    assert (name, value, type(value)) == (*change, type(change[1]))


@pytest.mark.parametrize("text", ["", "=", "a", "a=", "=1", " = 1"])
def test_half_a_change_is_refused(text: str) -> None:
    with pytest.raises(ModelError, match="not of the form name=value"):
        parse_change(text)


def test_changes_reach_system_and_study() -> None:
    changes = {"stop.stage2.clearance": 4, "frequency": 3, "study.to": 9, "study.walk.max_points": 7}
    study = change(changes)
    assert (study.system["stop.stage2.clearance"], study.system.frequency) == (4.0, 3.0)
    assert (study.options.end, study.options.walk.max_points) == (9.0, 7)
    assert study.changes == tuple(changes.items())
    assert change({}).system.at({"stop.stage2.clearance": 4, "frequency": 3}) == study.system


def test_a_walk_begins_at_the_changed_value() -> None:
    assert change({"stop.stage1.stiffness": 3}).options.begin == 3.0


def test_changes_are_made_together() -> None:
    study = change({"stop.stage1.clearance": 3, "stop.stage2.clearance": 4})
    assert study.system["stop.stage1.clearance"] == 3.0


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"stop.stage1.clearence": 1}, "there is no parameter 'stop.stage1.clearence'; did you mean"),
        ({"stop.stage1.clearance": 3}, "stop.stage2.clearance is 2.0; it must exceed that of the stage inside it"),
        ({"stop.stage1.clearance": "wide"}, "stop.stage1.clearance is 'wide'; it must be a number"),
        ({"frequency": -1}, "m.toml: frequency is -1; it must be > 0"),
        ({"study.too": 3}, "m.toml: study.too is not a key here; did you mean to?"),
        ({"study.to": "3"}, 'm.toml: study.to is "3"; it must be a number, without quotes'),
        ({"study.kind.x": 3}, "study.kind is no table"),
        ({"study": 3}, "there is no parameter 'study'"),
        ({"study.from": 1, "stop.stage1.stiffness": 3}, "cannot be set: the study walks it"),
    ],
)
def test_a_wrong_change_is_refused(changes, message: str) -> None:
    with pytest.raises(ModelFileError) as error:
        change(changes)
    (problem,) = error.value.problems
    assert message in str(problem)


def test_all_wrong_changes_are_said() -> None:
    with pytest.raises(ModelFileError) as error:
        change({"a": 1, "b": 2, "study.c": 3, "study.d": 4})
    assert len(error.value.problems) == 4

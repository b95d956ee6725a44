"""Studies in model files: what they ask for, and what is said of those that are wrong."""

import io
import pickle
import subprocess
import sys
from dataclasses import fields
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import gapwalk as gw
from gapwalk.continuation.walk import WalkOptions
from gapwalk.errors import ModelError
from gapwalk.model import ModelFileError
from gapwalk.model.model_source import parse_source
from gapwalk.orbit.shooting import Shooting
from gapwalk.studies import study_schema as derived_schema
from gapwalk.studies.diagram_study import DiagramOptions, DiagramStudyOptions
from gapwalk.studies.response_study import ResponseOptions
from gapwalk.studies.study_file import Study, check_studies, check_study, read_studies, read_study
from gapwalk.studies.study_kind import kind_of, kinds
from gapwalk.studies.study_schema import Start, all_keys, keys_of
from tests.models import read_system
from tests.tiers import examples

GOOD = """\
title = "Two stages"
coordinates = ["q1", "q3"]
stiffness = [[0.1, -0.6], [-0.06, 1.1]]
damping = [0.04, 0.06]
mean = { q1 = 0.25, q3 = 0.5 }
frequency = 0.5

[[contact]]
name = "stage2"
deflection = { q1 = 1.0 }
clearance = 1.0
stiffness = 1.0
impact_damping = 0.05

[[harmonic]]
amplitude = 0.25
acts_on = { q1 = 1.0 }

[study]
kind = "response"
parameter = "frequency"
from = 2.0
to = 0.15
period = 2
start = [0.1, 0.2, 0.3, 0.4]
measure = "max.q3"

[study.walk]
initial_step = 0.01
max_points = 500

[study.shooting]
segments = 4
"""
LINES = GOOD.splitlines()


def study_of(text: str, changes=None) -> Study:
    return check_study(parse_source(text, "m.toml"), changes)


def problems_of(text: str, changes=None):
    with pytest.raises(ModelFileError) as error:
        study_of(text, changes)
    return error.value.problems


def test_a_file_becomes_the_study_it_describes(tmp_path: Path) -> None:
    path = tmp_path / "m.toml"
    path.write_text(GOOD, encoding="utf-8")
    study = read_study(path)
    assert study.options == ResponseOptions(
        parameter="frequency",
        begin=2.0,
        end=0.15,
        measure="max.q3",
        period=2,
        start=(0.1, 0.2, 0.3, 0.4),
        walk=WalkOptions(initial_step=0.01, max_points=500),
        method=Shooting(segments=4),
    )
    assert study.system == read_system(path).at(frequency=2.0)
    assert (study.title, study.text, study.changes) == ("Two stages", GOOD, ())
    assert pickle.loads(pickle.dumps(study)) == study


def test_what_is_not_given_has_the_defaults_of_the_options() -> None:
    text = GOOD[: GOOD.index("period = 2")]
    study = study_of(text)
    assert study.options == ResponseOptions("frequency", 2.0, 0.15, "half.q1")
    assert (study.options.period, study.options.start) == (1, Start.SETTLE)
    assert study_of(text + 'start = "rest"').options.start is Start.REST


def test_the_frequency_may_be_given_by_the_study_alone() -> None:
    assert study_of(GOOD.replace("frequency = 0.5", "")).system.frequency == 2.0


def test_a_walk_begins_where_the_file_stands_unless_told() -> None:
    study = study_of(GOOD.replace("from = 2.0\n", ""))
    assert (study.options.begin, study.system.frequency) == (0.5, 0.5)
    text = GOOD.replace('parameter = "frequency"\nfrom = 2.0', 'parameter = "stage2.clearance"')
    study = study_of(text)
    assert (study.options.begin, study.options.end, study.system.frequency) == (1.0, 0.15, 0.5)


def test_any_parameter_can_be_walked() -> None:
    text = GOOD.replace('"frequency"', '"harmonic1.amplitude"').replace("from = 2.0", "from = -1")
    study = study_of(text)
    assert (study.system["harmonic1.amplitude"], study.options.begin) == (-1.0, -1.0)


# What is written in place of what; the line, the path, and parts of the message of the one problem that it makes.
# More is in tests/data/bad_input.toml.
BAD = [
    ('kind = "response"', 'kind = "respons"', 20, "study.kind", ['is "respons"', "did you mean response?"]),
    ('parameter = "frequency"', "", 19, "study.parameter", ["is missing", 'parameter = "frequency"']),
    ('= "frequency"', '= "stage2.clearence"', 21, "study.parameter", ["no parameter", "'stage2.clearance'"]),
    ("to = 0.15", "to = 2", 23, "study.to", ["is 2, where the walk begins"]),
    ("to = 0.15", "to = 0", 23, "study.to", ["is not allowed: frequency is 0.0; it must be > 0"]),
    ("from = 2.0", "from = -2.0", 22, "study.from", ["frequency is -2.0; it must be > 0"]),
    ("from = 2.0", 'from = "2.0"', 22, "study.from", ["a number, without quotes"]),
    ("from = 2.0\nto = 0.15", "to = 0.5", 22, "study.to", ["is 0.5, where the walk begins"]),
    ('"frequency"\nfrom = 2.0\nto = 0.15', '"stage2.clearance"\nto = -1', 22, "study.to", ["stage2.clearance is -1.0"]),
    ('"frequency"\nfrom = 2.0\nto = 0.15', '"mass.q1.q1"\nto = 0', 22, "study.to", ["mass is singular"]),
    ("from = 2.0", "form = 2.0", 22, "study.form", ["did you mean from"]),
    ("from = 2.0", "begin = 2.0", 22, "study.begin", ["is not a key here"]),
    ("period = 2", "period = 2.0", 24, "study.period", ["is 2.0; it must be an integer"]),
    ("period = 2", 'verify = "true"', 24, "study.verify", ['is "true"; it must be true or false, without quotes']),
    ("period = 2", "verify = 1", 24, "study.verify", ["is 1; it must be true or false"]),
    ("start = [0.1, 0.2, 0.3, 0.4]", "start = [0.1, 0.2]", 25, "study.start", ["2 numbers; it must have 4"]),
    ("start = [0.1, 0.2, 0.3, 0.4]", 'start = [0, 0, 0, "0"]', 25, "study.start[3]", ['is "0"; it must be a number']),
    ("start = [0.1, 0.2, 0.3, 0.4]", 'start = "settel"', 25, "study.start", ["did you mean settle?"]),
    ("start = [0.1, 0.2, 0.3, 0.4]", "start = 3", 25, "study.start", ["is 3", '"rest", "settle", "linear", or']),
    ('"max.q3"', '"peak.q3"', 26, "study.measure", ['is "peak.q3"; it must be one of max, min, half, mean, rms']),
    ('"max.q3"', '"max"', 26, "study.measure", ["a dot and a signal"]),
    ('"max.q3"', '"max.q2"', 26, "study.measure", ["there is no signal q2", "q1"]),
    ("segments = 4", "segments = 4.0", 33, "study.shooting.segments", ["it must be an integer"]),
    ("segments = 4", "tolerance = 1.0", 33, "study.shooting.tolerance", ["is 1.0; it must be <= 0.001"]),
    ("segments = 4", "tolerance = -1e-9", 33, "study.shooting.tolerance", ["is -1e-09; it must be >= 1e-14"]),
    ("initial_step = 0.01", "initial_stepp = 0.01", 29, "study.walk.initial_stepp", ["did you mean initial_step"]),
    ("initial_step = 0.01", "initial_step = 0", 29, "study.walk.initial_step", ["is 0; it must be > 0"]),
    ("max_points = 500", "max_points = 1", 30, "study.walk.max_points", ["is 1; it must be >= 2"]),
    ('measure = "max.q3"', "segments = 3", 26, "study.segments", ["it belongs in shooting"]),
    ("frequency = 0.5", "frequency = 0.5\nstudy2 = 3", 7, "study2", ["did you mean study?"]),
]  # fmt: skip


@pytest.mark.parametrize(("old", "new", "line", "path", "fragments"), BAD, ids=lambda value: str(value)[:40])
def test_a_wrong_study_has_one_problem(old: str, new: str, line: int, path: str, fragments: list[str]) -> None:
    assert old in GOOD
    (problem,) = problems_of(GOOD.replace(old, new, 1))
    assert (problem.path, problem.line, problem.file) == (path, line, "m.toml")
    for fragment in fragments:
        assert fragment in problem.message


def test_a_missing_study_is_said() -> None:
    (problem,) = problems_of(GOOD[: GOOD.index("[study]")])
    assert (problem.path, problem.line) == ("study", None)
    assert 'add [study] with kind = "response"' in problem.message


def test_a_model_is_read_without_its_studies(tmp_path) -> None:
    file = tmp_path / "model.toml"
    file.write_text(GOOD.replace('kind = "response"', 'kind = "unknown"'))
    system = gw.read_model(file, {"frequency": 0.7})
    assert system == read_study(io.StringIO(GOOD)).system.at(frequency=0.7)
    with pytest.raises(ModelFileError, match="no_such_name"):
        gw.read_model(file, {"no_such_name": 1.0})


def test_a_file_is_run_by_its_name_and_the_name_of_its_study(tmp_path) -> None:
    file = tmp_path / "model.toml"
    file.write_text(GOOD.replace("period = 2\n", "").replace("max_points = 500", "max_points = 3"))
    assert gw.run(file).study == read_study(file)
    with pytest.raises(ModelError, match="has one study, which has no name"):
        gw.run(file, study="other")


def test_walking_another_parameter_needs_a_frequency() -> None:
    text = GOOD.replace("frequency = 0.5", "").replace('parameter = "frequency"', 'parameter = "mean.q1"')
    (problem,) = problems_of(text)
    assert (problem.path, problem.line) == ("frequency", None)
    assert "the study walks mean.q1" in problem.message
    text = GOOD.replace("frequency = 0.5", "").replace("from = 2.0", "")
    (problem,) = problems_of(text)
    assert problem.path == "study.from"
    assert "the file gives no frequency" in problem.message


def test_system_and_study_are_judged_together() -> None:
    text = (
        GOOD.replace("damping = [0.04, 0.06]", "damping = [0.04]\ncolour = 3")
        .replace('"frequency"', '"stage2.clearence"')
        .replace("period = 2", "period = 0")
        .replace("segments = 4", "segments = 0")
    )
    found = [(problem.line, problem.path) for problem in problems_of(text, {"stage2.cubik": 3})]
    assert found == [
        (None, ""),  # the change
        (4, "damping"),
        (5, "colour"),
        (22, "study.parameter"),
        (25, "study.period"),
        (34, "study.shooting.segments"),
    ]


def test_a_frequency_is_judged_even_where_the_system_is_lost() -> None:
    text = GOOD.replace("deflection = { q1 = 1.0 }", "").replace("to = 0.15", "to = -1")
    assert [problem.path for problem in problems_of(text)] == ["contact[0].deflection", "study.to"]


DIAGRAM = GOOD.replace('kind = "response"', 'kind = "diagram"')
SYSTEM = GOOD[: GOOD.index("[study]")]
SEVERAL = (
    SYSTEM
    + """
[[study]]
name = "light"
kind = "response"
parameter = "frequency"
from = 2.0
to = 0.15

[[study]]
name = "strong"
title = "A strong load"
kind = "diagram"
parameter = "harmonic1.amplitude"
to = 1.0
set = { "harmonic1.amplitude" = 0.02, stage2.clearance = 0.9, frequency = 0.35 }
max_period = 4
"""
)


def several(text: str = SEVERAL, changes=None) -> tuple[Study, ...]:
    return check_studies(parse_source(text, "m.toml"), changes)


def test_a_diagram_is_a_kind_of_study() -> None:
    study = study_of(DIAGRAM)
    response = study_of(GOOD).options
    assert study.options == DiagramStudyOptions(
        *(getattr(response, field.name) for field in fields(response)), max_period=8, max_branches=200
    )
    limits = study_of(DIAGRAM.replace("period = 2", "period = 1\nmax_period = 4\nmax_branches = 9\nworkers = 1"))
    assert limits.options.limits == DiagramOptions(4, 9, 1)
    assert limits.options.period == 1


def test_names_are_checked_against_the_keys_of_all_kinds_without_loading_them() -> None:
    package = [name for name in kinds() if kind_of(name).__module__.startswith("gapwalk.")]
    assert frozenset().union(*map(keys_of, package)) == frozenset(derived_schema._KEYS.split())
    assert frozenset(derived_schema._KEYS.split()) <= all_keys()
    script = (
        "import sys\n"
        "from gapwalk.model.model_source import parse_source\n"
        "from gapwalk.studies.study_file import check_study\n"
        "print(check_study(parse_source(sys.argv[1], 'm.toml')).name)\n"
        "print('gapwalk.studies.tori_study' in sys.modules)\n"
    )
    text = GOOD.replace("[study]", '[study]\nname = "light"')
    done = subprocess.run([sys.executable, "-c", script, text], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["light", "False"]


@pytest.mark.parametrize(
    ("text", "path", "message"),
    [
        ("max_period = 0", "study.max_period", "is 0; it must be >= 1"),
        ("max_branches = 1.5", "study.max_branches", "is 1.5; it must be an integer"),
        ('workers = "all"', "study.workers", 'is "all"; it must be an integer'),
        ("max_periods = 4", "study.max_periods", "did you mean max_period"),
        ('name = "the second"', "study.name", "write letters, digits, - and _, as in light-load"),
        ('name = "walk"', "study.name", "which is a key of studies; choose another name"),
        ("name = 3", "study.name", "is 3; it must be a text in quotes"),
        ("set = 3", "study.set", 'is 3; it must be a table, such as { "harmonic1.amplitude" = 0.5 }'),
        ('set = { "stage2.clearence" = 1 }', 'study.set."stage2.clearence"', "did you mean 'stage2.clearance'"),
        ("set = { stage2.clearance = -1 }", "study.set.stage2.clearance", "is -1.0; it must be >= 0"),
        ('set = { mean.q1 = "1" }', "study.set.mean.q1", "is '1'; it must be a number"),
        ("set = { frequency = 3 }", "study.set.frequency", "cannot be set here: the study walks this parameter"),
        (
            "set = { mass.q1.q1 = 0, mass.q3.q3 = 0 }",
            "study.set.mass.q1.q1",
            "is refused: mass is singular",
        ),
    ],
)
def test_a_wrong_diagram_has_one_problem(text: str, path: str, message: str) -> None:
    (problem,) = problems_of(DIAGRAM.replace("period = 2", text))
    assert (problem.path, problem.line) == (path, 24)
    assert message in problem.message


def test_what_only_a_diagram_has_is_refused_elsewhere() -> None:
    (problem,) = problems_of(GOOD.replace("period = 2", "max_period = 2"))
    assert (problem.path, problem.line) == ("study.max_period", 24)
    assert "is not a key here" in problem.message


def test_a_file_has_several_studies_of_changed_systems(tmp_path: Path) -> None:
    path = tmp_path / "m.toml"
    path.write_text(SEVERAL, encoding="utf-8")
    light, strong = read_studies(path)
    assert (light.name, strong.name) == ("light", "strong")
    assert (light.title, strong.title) == ("Two stages: light", "A strong load")
    assert light.system == read_system(path).at(frequency=2.0)
    changes = {"harmonic1.amplitude": 0.02, "stage2.clearance": 0.9, "frequency": 0.35}
    assert strong.system == read_system(path).at(changes)
    assert (strong.options.begin, strong.options.end, strong.options.max_period) == (0.02, 1.0, 4)
    assert read_study(path, name="strong") == strong
    with pytest.raises(ModelError, match="has 2 studies, so give the name of one: light, strong"):
        read_study(path)
    with pytest.raises(ModelError, match=r"has no study 'stong'; did you mean strong\?"):
        read_study(path, name="stong")
    path.write_text(GOOD, encoding="utf-8")
    with pytest.raises(ModelError, match="which has no name; leave the name 'strong' out"):
        read_study(path, name="strong")


def test_one_study_may_have_a_name_and_changes_too() -> None:
    study = study_of(GOOD.replace("period = 2", 'name = "a"\nset.stage2.clearance = 0.5'))
    assert (study.name, study.title, study.system["stage2.clearance"]) == ("a", "Two stages: a", 0.5)


def test_changes_from_outside_have_the_last_word() -> None:
    light, strong = several(changes={"stage2.clearance": 0.7, "frequency": 0.3, "study.strong.to": 0.8})
    assert light.system["stage2.clearance"] == strong.system["stage2.clearance"] == 0.7
    assert strong.system.frequency == 0.3
    assert (light.options.end, strong.options.end) == (0.15, 0.8)
    light, strong = several(changes={"study.to": 0.9, "study.period": 2, "study.light.walk.max_points": 7})
    assert (light.options.end, strong.options.end) == (0.9, 0.9)
    assert (light.options.period, strong.options.period) == (2, 2)
    assert (light.options.walk.max_points, strong.options.walk.max_points) == (7, WalkOptions().max_points)


def problems_of_several(old: str, new: str, changes=None):
    assert old in SEVERAL
    with pytest.raises(ModelFileError) as error:
        several(SEVERAL.replace(old, new), changes)
    return [(problem.path, problem.line, problem.message) for problem in error.value.problems]


def test_what_is_wrong_with_several_studies() -> None:
    ((path, line, message),) = problems_of_several('name = "strong"\n', "")
    assert (path, line) == ("study[1].name", 27)
    assert "is missing; it names the file of the result" in message
    ((path, line, message),) = problems_of_several('"strong"', '"Light"')
    assert (path, line) == ("study[1].name", 28)
    assert "is taken already" in message
    ((path, line, _),) = problems_of_several('kind = "diagram"', 'kind = "diagramm"')
    assert (path, line) == ("study[1].kind", 30)
    found = problems_of_several("to = 1.0", "to = 0.02")
    assert [(path, line) for path, line, _ in found] == [("study[1].to", 32)]
    found = problems_of_several("stage2.clearance = 0.9", "stage3.clearance = 0.9", {"stage4": 3, "study.x": 4})
    assert [path for path, _, _ in found] == ["", "study[0].x", "study[1].x", "study[1].set.stage3.clearance"]


def test_a_frequency_may_come_from_the_study() -> None:
    text = SEVERAL.replace("frequency = 0.5\n", "")
    assert several(text)[1].system.frequency == 0.35
    with pytest.raises(ModelFileError) as error:
        several(text.replace(", frequency = 0.35", ""))
    (problem,) = error.value.problems
    assert (problem.path, problem.line) == ("frequency", None)


@pytest.mark.parametrize("study", ["study = []", "study = [1]", 'study = "x"'])
def test_a_study_is_a_table_or_several(study: str) -> None:
    (problem,) = problems_of(study + "\n" + SYSTEM)
    assert (problem.path, problem.line) == ("study", 1)
    assert "it must be a table [study], or several tables [[study]]" in problem.message


PLANE = """
[study.search]
values = [0.2, 0.9]
starts = 16
newton_periods = [1, 2]
box = [1.0, 1.0, 2.0, 2.0]

[[study]]
name = "plane"
kind = "map"
parameter = "frequency"
from = 2.0
to = 0.15
second = { parameter = "mean.q1", from = 0.1, to = 0.5 }
sections = [0.2, 0.3]
kinds = ["fold", "grazing"]
search = { values = 3, seed = 1 }
"""

ODD = ["", "0", "-1", "1e308", "nan", "true", '"x"', '"q1"', "[]", "{}", "1.5", "2020-01-01", "[1, 2, 3, 4]", "=",
       '"mass.q1.q1"', '"max.q1"', '"rest"', '"\\u0000"']  # fmt: skip


@st.composite
def mutations(draw) -> str:
    lines = list(draw(st.sampled_from([LINES, SEVERAL.splitlines(), (SEVERAL + PLANE).splitlines()])))
    for _ in range(draw(st.integers(1, 3))):
        place = draw(st.integers(0, len(lines) - 1))
        key = lines[place].partition("=")[0]
        lines[place] = draw(
            st.sampled_from(["", f"{key}= {draw(st.sampled_from(ODD))}", "[study]", "[[study]]", "walk = 3"])
        )
    return "\n".join(lines)


CHANGES = st.dictionaries(
    st.sampled_from(
        [
            "frequency",
            "stage2.clearance",
            "study.to",
            "study.walk.max_points",
            "study",
            "x",
            "study.kind.x",
            "study.light.to",
            "study.set",
            "study.second",
            "study.second.from",
            "study.plane.sections",
            "study.search.values",
            "mean.q1",
        ]
    ),
    st.sampled_from([1, 0.5, -1.0, "x", True, [1, 2], float("nan"), 10**400, None]),
    max_size=2,
)


@settings(max_examples=examples(60))
@given(mutations(), CHANGES)
def test_no_file_raises_anything_but_a_model_error(text: str, changes) -> None:
    try:
        studies = several(text, changes)
    except ModelError:
        return
    for study in studies:
        assert study.options.begin == study.system[study.options.parameter]

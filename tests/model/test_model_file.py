"""Model files: what they say, and what is said of those that are wrong."""

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gapwalk.errors import ModelError
from gapwalk.model import Contact, Harmonic, ModelFileError, Side, Stage, System
from gapwalk.model.model_file import check_model
from gapwalk.model.model_source import parse_source
from tests.models import read_system
from tests.tiers import examples

GOOD = """\
title = "Two stages"
coordinates = ["q1", "q3"]
mass = [[2, 0.1], [0.1, 1]]
stiffness = [[0.1, -0.6], [-0.06, 1.1]]
damping = [[0.04, -0.04], [-0.04, 0.06]]
mean = { q1 = 0.25, q3 = 0.5 }
frequency = 0.5

[[contact]]
name = "clutch"
deflection = { q1 = 1.0 }
force = { q1 = 0.9, q3 = -0.54 }
clearance = 1.0
stiffness = 1.0
cubic = 0.0
side = "both"
impact_damping = 0.05

[[contact]]
name = "shaft"
deflection = { q1 = -1, q3 = 1 }
law = "viscous"
viscous_damping = 0.1
[[contact.stage]]
clearance = 1.0
stiffness = 2.0
[[contact.stage]]
name = "hard"
clearance = 2.0
stiffness = 3.0
cubic = 4.0
side = "negative"

[[harmonic]]
order = 1
amplitude = 0.25
acts_on = { q1 = 1.0 }

[[harmonic]]
order = 2
amplitude = 0.1
phase = "120 deg"
acts_on = { q1 = 1.0, q3 = 0.5 }
name = "second"
"""
LINES = GOOD.splitlines()


def problems_of(text: str):
    source = parse_source(text, "m.toml")
    model, problems = check_model(source)
    assert (model is None) == bool(problems)
    return problems


def read_text(tmp_path: Path, text: str) -> System:
    path = tmp_path / "m.toml"
    path.write_text(text, encoding="utf-8")
    return read_system(path)


def test_a_file_becomes_the_system_it_describes(tmp_path: Path) -> None:
    stages = (Stage(1.0, 2.0, name="stage1"), Stage(2.0, 3.0, 4.0, Side.NEGATIVE, "hard"))
    assert read_text(tmp_path, GOOD) == System(
        ["q1", "q3"],
        stiffness=[[0.1, -0.6], [-0.06, 1.1]],
        damping=[[0.04, -0.04], [-0.04, 0.06]],
        mass=[[2, 0.1], [0.1, 1]],
        contacts=[
            Contact(
                "clutch", {"q1": 1}, (Stage(1.0),), {"q1": 0.9, "q3": -0.54}, "hunt-crossley", {"impact_damping": 0.05}
            ),
            Contact("shaft", {"q1": -1, "q3": 1}, stages, law="viscous", viscous_damping=0.1),
        ],
        mean={"q1": 0.25, "q3": 0.5},
        harmonics=[Harmonic(0.25, {"q1": 1}), Harmonic(0.1, {"q1": 1, "q3": 0.5}, 2, math.radians(120), "second")],
        frequency=0.5,
    )


def test_little_needs_to_be_said(tmp_path: Path) -> None:
    system = read_text(tmp_path, 'coordinates = ["x"]\nstiffness = [[4]]\nfrequency = 2')
    assert system == System(["x"], [[4.0]], frequency=2.0)


def test_a_list_of_numbers_is_a_diagonal(tmp_path: Path) -> None:
    text = 'coordinates = ["x", "y"]\nstiffness = [4, 5]\nmass = [2, 3]\ndamping = [0.1, 0.2]\nfrequency = 1'
    system = read_text(tmp_path, text)
    for which, diagonal in (("mass", [2, 3]), ("damping", [0.1, 0.2]), ("stiffness", [4, 5])):
        np.testing.assert_array_equal(system.matrix(which), np.diag(diagonal))


@pytest.mark.parametrize(
    ("lines", "law", "parameter"),
    [
        ("", "elastic", None),
        ("impact_damping = 0.0", "hunt-crossley", "gap.impact_damping"),
        ("viscous_damping = 0.2", "viscous", "gap.viscous_damping"),
        ('law = "elastic"', "elastic", None),
        ('law = "hunt-crossley-as-printed"\nimpact_damping = 0.3', "hunt-crossley-as-printed", "gap.impact_damping"),
    ],
)
def test_the_law_follows_from_the_coefficient(tmp_path: Path, lines: str, law: str, parameter) -> None:
    contact = f'[[contact]]\nname = "gap"\ndeflection = {{ x = 1 }}\nclearance = 1\nstiffness = 2\n{lines}\n'
    system = read_text(tmp_path, f'coordinates = ["x"]\nstiffness = [1]\nfrequency = 1\n{contact}')
    assert system.structure.contacts[0].law.name == law
    damping = [name for name in system.structure.names if name.endswith(("impact_damping", "viscous_damping"))]
    assert damping == ([parameter] if parameter else [])


@pytest.mark.parametrize(
    ("written", "radians"),
    [
        ("1.5", 1.5), ("2", 2.0), ('"120 deg"', math.radians(120)), ('"-90deg"', -math.pi / 2),
        ('"+1.5e1 °"', math.radians(15)), ('".5 rad"', 0.5), ('" 3. rad "', 3.0),
    ],
)  # fmt: skip
def test_a_phase_may_be_in_degrees(tmp_path: Path, written: str, radians: float) -> None:
    system = read_text(tmp_path, GOOD.replace('"120 deg"', written))
    assert system["second.phase"] == pytest.approx(radians, rel=1e-15)


def test_one_stage_in_long_form_is_as_in_short_form(tmp_path: Path) -> None:
    short = 'clearance = 1.0\nstiffness = 1.0\ncubic = 0.0\nside = "both"\nimpact_damping = 0.05\n'
    long = "impact_damping = 0.05\n[[contact.stage]]\nclearance = 1.0\nstiffness = 1.0\n"
    assert short in GOOD
    assert read_text(tmp_path, GOOD.replace(short, long)) == read_text(tmp_path, GOOD)


# What is written in place of what; the line, the path, and parts of the message of the one problem that it makes.
BAD = [
    # Names of keys
    ("damping = [[", "dampng = [[", 5, "dampng", ["is not a key here", "did you mean damping?"]),
    ("cubic = 0.0", "cubik = 0.0", 15, "contact[0].cubik", ["did you mean cubic?"]),
    ("cubic = 4.0", "colour = 4.0", 31, "contact[1].stage[1].colour", ["the keys are name, clearance,"]),
    ("phase =", "fase =", 42, "harmonic[1].fase", ["did you mean phase?"]),
    ("cubic = 0.0", "frequency = 2.0", 15, "contact[0].frequency", ["belongs to the top of the file"]),
    ("cubic = 4.0", "mean = { q1 = 1 }", 31, "contact[1].stage[1].mean", ["belongs to the top of the file"]),
    ("frequency = 0.5", "clearance = 0.5", 7, "clearance", ["it belongs in contact"]),
    # Missing keys
    ("coordinates = [", "# [", None, "coordinates", ["is missing", '["q1", "q3"]']),
    ("stiffness = [[", "# [[", None, "stiffness", ["is missing", "the matrix K"]),
    ('name = "clutch"', "", 9, "contact[0].name", ["is missing"]),
    ("deflection = { q1 = 1.0 }", "", 9, "contact[0].deflection", ["is missing"]),
    ("clearance = 1.0", "", 9, "contact[0].clearance", ["is missing", "half the width of the gap"]),
    ("stiffness = 1.0", "", 9, "contact[0].stiffness", ["is missing", "slope"]),
    ("stiffness = 2.0", "", 24, "contact[1].stage[0].stiffness", ["is missing", "slope"]),
    ("amplitude = 0.1", "", 39, "harmonic[1].amplitude", ["is missing"]),
    ("acts_on = { q1 = 1.0 }", "", 34, "harmonic[0].acts_on", ["is missing"]),
    ("viscous_damping = 0.1", "", 19, "contact[1].viscous_damping", ['is missing; the law "viscous" needs it']),
    # Types: nothing is turned into a number in silence
    ("clearance = 1.0", 'clearance = "1.0"', 13, "contact[0].clearance", ['is "1.0"', "a number, without quotes"]),
    ("clearance = 1.0", 'clearance = "one"', 13, "contact[0].clearance", ['is "one"; it must be a number']),
    ("clearance = 1.0", "clearance = true", 13, "contact[0].clearance", ["is true; it must be a number"]),
    ("clearance = 1.0", "clearance = [1]", 13, "contact[0].clearance", ["is [1]; it must be a number"]),
    ("clearance = 1.0", "clearance = 2020-01-01", 13, "contact[0].clearance", ["the date or time 2020-01-01"]),
    ("frequency = 0.5", "frequency = false", 7, "frequency", ["is false; it must be a number"]),
    ("-0.06, 1.1", '-0.06, "1.1"', 4, "stiffness[1][1]", ['is "1.1"; it must be a number, without quotes']),
    ("-0.06, 1.1", "-0.06, true", 4, "stiffness[1][1]", ["is true; it must be a number"]),
    ('title = "Two stages"', "title = 2", 1, "title", ["is 2; it must be a text in quotes"]),
    ('["q1", "q3"]', '"q1"', 2, "coordinates", ['is "q1"; it must be a list']),
    ('["q1", "q3"]', '["q1", 3]', 2, "coordinates[1]", ["is 3; it must be a text in quotes"]),
    ("mean = { q1 = 0.25, q3 = 0.5 }", "mean = [0.25, 0.5]", 6, "mean", ["is [0.25, 0.5]; it must be a table"]),
    ('name = "second"', "name = 2", 44, "harmonic[1].name", ["is 2; it must be a text in quotes"]),
    ('side = "both"', "side = 1", 16, "contact[0].side", ['is 1; it must be one of "both", "positive", "negative"']),
    # Numbers that are none
    ("clearance = 1.0", "clearance = nan", 13, "contact[0].clearance", ["is nan; it must be a finite number"]),
    ("-0.06, 1.1", "-0.06, inf", 4, "stiffness[1][1]", ["is inf; it must be a finite number"]),
    ("amplitude = 0.25", "amplitude = -inf", 36, "harmonic[0].amplitude", ["is -inf; it must be a finite number"]),
    ('"120 deg"', "nan", 42, "harmonic[1].phase", ["is nan; it must be a finite number"]),
    ('"120 deg"', '"1e999 deg"', 42, "harmonic[1].phase", ["must be a finite number"]),
    ("cubic = 0.0", f"cubic = {10**400}", 15, "contact[0].cubic", ["must be a number"]),
    # Values that are not allowed
    ("clearance = 1.0", "clearance = -1.0", 13, "contact[0].clearance", ["is -1.0; it must be >= 0"]),
    ("clearance = 2.0", "clearance = -2", 29, "contact[1].stage[1].clearance", ["is -2; it must be >= 0"]),
    ("frequency = 0.5", "frequency = 0", 7, "frequency", ["is 0; it must be > 0"]),
    ("frequency = 0.5", "frequency = -0.5", 7, "frequency", ["is -0.5; it must be > 0"]),
    ("impact_damping = 0.05", "impact_damping = -1", 17, "contact[0].impact_damping", ["it must be >= 0"]),
    ('side = "both"', 'side = "postive"', 16, "contact[0].side", ["did you mean positive?"]),
    ('"viscous"', '"hunt-crosley"', 22, "contact[1].law", ['is "hunt-crosley"', "did you mean hunt-crossley"]),
    ('"120 deg"', '"120 degrees"', 42, "harmonic[1].phase", ['a text such as "120 deg"']),
    ("clearance = 2.0", "clearance = 0.5", 24, "contact[1].stage", ["is out of order on the negative side"]),
    ("clearance = 2.0", "clearance = 1.0", 24, "contact[1].stage", ["is out of order"]),
    ('name = "hard"', 'name = "stage1"', 19, "contact[1]", ["need names that differ"]),
    ("stiffness = 3.0", "stiffness = -3.0", 19, "contact[1]", ["the slope of the force falls to -1.0"]),
    ("order = 2", "order = 1.5", 40, "harmonic[1].order", ["is 1.5", "not periodic", "orders 2 and 3"]),
    ("order = 2", "order = 0", 40, "harmonic[1].order", ["is 0", "belongs in `mean`"]),
    ("order = 2", 'order = "2"', 40, "harmonic[1].order", ["it must be an integer >= 1"]),
    ("order = 2", "order = true", 40, "harmonic[1].order", ["it must be an integer >= 1"]),
    # Shapes
    ("[-0.06, 1.1]]", "[-0.06]]", 4, "stiffness", ["has rows of length 2, 1; it must be 2 x 2"]),
    ("[-0.06, 1.1]]", "[-0.06, 1.1], [0, 0]]", 4, "stiffness", ["has rows of length 2, 2, 2"]),
    ("[[0.04, -0.04], [-0.04, 0.06]]", "[[]]", 5, "damping", ["has rows of length 0"]),
    ("[[0.04, -0.04], [-0.04, 0.06]]", "[]", 5, "damping", ["is empty; it must be 2 x 2"]),
    ("[[0.04, -0.04], [-0.04, 0.06]]", "0.1", 5, "damping", ["is 0.1; it must be a list"]),
    ("[[0.04, -0.04], [-0.04, 0.06]]", "[[0.04, -0.04], 3]", 5, "damping[1]", ["is 3; it must be a list"]),
    ("[[2, 0.1], [0.1, 1]]", "[1, 2, 3]", 3, "mass", ["is a diagonal of 3 numbers; it must have 2"]),
    ("[[2, 0.1], [0.1, 1]]", '[1, "2"]', 3, "mass[1]", ['is "2"; it must be a number']),
    ("[[2, 0.1], [0.1, 1]]", "[[1, 2], [2, 4]]", 3, "mass", ["is singular", "every coordinate needs an inertia"]),
    ("[[2, 0.1], [0.1, 1]]", "[0, 1]", 3, "mass", ["gives q1 no inertia", "clutch deflects with it"]),
    # Names of things
    ('["q1", "q3"]', "[]", 2, "coordinates", ["it must be a list of 1 or more"]),
    ('["q1", "q3"]', '["q1", "q3", "q3"]', 2, "coordinates", ['has "q3" twice']),
    ("q3 = 0.5 }\nfreq", "q4 = 0.5 }\nfreq", 6, "mean.q4", ["names no coordinate; did you mean q1 or q3?"]),
    ("{ q1 = 1.0 }\nforce", "{ x = 1.0 }\nforce", 11, "contact[0].deflection.x", ["names no coordinate"]),
    ("q3 = -0.54", "q33 = -0.54", 12, "contact[0].force.q33", ["did you mean q3?"]),
    ("q3 = 0.5 }\nname", '"" = 0.5 }\nname', 43, 'harmonic[1].acts_on.""', ["names no coordinate"]),
    ("{ q1 = 1.0 }\nforce", "{}\nforce", 11, "contact[0].deflection", ["is zero; name at least one coordinate"]),
    ("{ q1 = 1.0, q3 = 0.5 }", "{ q1 = 0 }", 43, "harmonic[1].acts_on", ["is zero"]),
    ('name = "shaft"', 'name = "clutch"', 20, "contact[1].name", ['is "clutch", which is taken already']),
    ('name = "second"', 'name = "clutch"', 44, "harmonic[1].name", ['is "clutch", which is taken already']),
    ('name = "shaft"', 'name = "mean"', 20, "contact[1].name", ["taken already"]),
    ('name = "shaft"', 'name = "study"', 20, "contact[1].name", ["taken already"]),
    ('name = "shaft"', 'name = "a.b"', 20, "contact[1].name", ['is "a.b"; write a word']),
    # Things that exclude each other
    ("name = \"shaft\"", 'name = "shaft"\nclearance = 1', 21, "contact[1].clearance", ["together with tables"]),
    ("name = \"shaft\"", 'name = "shaft"\nside = "both"', 21, "contact[1].side", ["together with tables"]),
    ("impact_damping = 0.05", 'impact_damping = 1\nlaw = "elastic"', 17, "contact[0].impact_damping", ['"elastic"']),
    ('law = "viscous"', "impact_damping = 1", 23, "contact[1].viscous_damping", ["one of the two"]),
    # Forms of tables
    ("[[contact]]\nname = \"clutch\"", "[other]\n[[contact]]\nname = \"clutch\"", 9, "other", ["is not a key here"]),
]  # fmt: skip


@pytest.mark.parametrize(("old", "new", "line", "path", "fragments"), BAD, ids=lambda value: str(value)[:40])
def test_a_wrong_file_has_one_problem(old: str, new: str, line: int | None, path: str, fragments: list[str]) -> None:
    assert old in GOOD
    (problem,) = problems_of(GOOD.replace(old, new, 1))
    assert (problem.path, problem.line, problem.file) == (path, line, "m.toml")
    for fragment in fragments:
        assert fragment in problem.message
    assert len(str(problem).splitlines()) == 1


def test_the_good_file_is_good() -> None:
    assert problems_of(GOOD) == []
    assert len(BAD) >= 50


WRONG = """\
title = 3
coordinates = ["q1", "q3"]
mass = [[1, 0], [0, 0]]
stiffness = [[0.1, -0.6], [-0.06]]
dampng = [[0.04, -0.04], [-0.04, 0.06]]
mean = { q1 = "0.25", q4 = 0.25 }
frequency = 0

[[contact]]
name = "stage2"
deflection = { q1 = 1.0, x = nan }
force = 3
clearence = 1.0
stiffness = 1.0
law = "elastic"
impact_damping = 0.05
frequency = 3

[[contact]]
name = "stage2"
deflection = { q1 = 0 }
colour = 3
[[contact.stage]]
clearance = -1
stiffness = 1

[[contact]]
name = "third"
deflection = { q1 = 1 }
colour = 3
[[contact.stage]]
clearance = 2
stiffness = 1
[[contact.stage]]
clearance = 1
stiffness = 1

[[harmonic]]
order = 1.5
amplitude = inf
acts_on = { q1 = 1.0 }

[[harmonic]]
amplitude = 1
acts_on = { q1 = 1.0 }

[[harmonic]]
amplitude = 1
acts_on = { q1 = 1.0 }
"""


def test_everything_that_is_wrong_is_said_at_once(tmp_path: Path) -> None:
    with pytest.raises(ModelFileError) as error:
        read_text(tmp_path, WRONG)
    found = [(problem.line, problem.path) for problem in error.value.problems]
    assert found == [
        (1, "title"),
        (3, "mass"),
        (4, "stiffness"),
        (5, "dampng"),
        (6, "mean.q1"),
        (6, "mean.q4"),
        (7, "frequency"),
        (9, "contact[0].clearance"),
        (11, "contact[0].deflection.x"),
        (11, "contact[0].deflection.x"),
        (12, "contact[0].force"),
        (13, "contact[0].clearence"),
        (16, "contact[0].impact_damping"),
        (17, "contact[0].frequency"),
        (20, "contact[1].name"),
        (21, "contact[1].deflection"),
        (22, "contact[1].colour"),
        (24, "contact[1].stage[0].clearance"),
        (30, "contact[2].colour"),
        (31, "contact[2].stage"),  # they are out of order, which is seen although the contact has an unknown key
        (39, "harmonic[0].order"),
        (40, "harmonic[0].amplitude"),
        (47, "harmonic[2].name"),
    ]
    lines = str(error.value).splitlines()
    assert len(lines) == len(found)
    assert all(line.startswith(str(tmp_path / "m.toml")) for line in lines)


def test_a_system_by_itself_needs_a_frequency(tmp_path: Path) -> None:
    with pytest.raises(ModelFileError, match="frequency is missing"):
        read_text(tmp_path, GOOD.replace("frequency = 0.5", ""))


def test_a_name_of_a_coordinate_is_a_word() -> None:
    problems = problems_of('coordinates = ["x", "y", "q 4", ""]\nstiffness = [1, 2, 3, 4]')
    assert [problem.path for problem in problems] == ["coordinates[2]", "coordinates[3]"]
    assert 'is "q 4"; write a word' in problems[0].message


def test_a_study_is_not_looked_at(tmp_path: Path) -> None:
    system = read_text(tmp_path, GOOD + '[study]\nkind = "unheard of"\n')
    assert system == read_text(tmp_path, GOOD)
    (problem,) = problems_of(GOOD.replace("frequency = 0.5", "frequency = 0.5\nstudy = 3"))
    assert problem.path == "study"


def test_one_table_is_no_list_of_tables() -> None:
    (problem,) = problems_of('coordinates = ["x"]\nstiffness = [1]\n[harmonic]\namplitude = 1\nacts_on = { x = 1 }')
    assert (problem.line, problem.path) == (3, "harmonic")
    assert "write [[harmonic]] with two brackets" in problem.message


def test_too_many_coordinates_are_refused_before_their_matrices_are_made() -> None:
    names = ", ".join(f'"x{i}"' for i in range(20_000))
    numbers = ", ".join(["1"] * 20_000)
    (problem,) = problems_of(f"coordinates = [{names}]\nstiffness = [{numbers}]\nmass = [{numbers}]")
    assert (problem.path, problem.line) == ("coordinates", 1)
    assert "1000 or fewer" in problem.message


ODD = [
    "", "0", "-1", "1e308", "1e-320", "nan", "-inf", "true", '"x"', '"q1"', "[]", "[[]]", "{}", "{ q1 = 1 }", "1.5",
    f"0x{'f' * 5000}",
    "2020-01-01", "[[1, 2], [3, 4]]", "[1, 2]", '"\\u0000"', "12:00:00", "{ a = { b = [1] } }", "=", "'''",
]  # fmt: skip


@st.composite
def mutations(draw) -> str:
    """The good file after a few slips of the keyboard or of the mind."""
    lines = list(LINES)
    for _ in range(draw(st.integers(1, 4))):
        place = draw(st.integers(0, len(lines) - 1))
        line = lines[place]
        match draw(st.sampled_from(["drop", "double", "move", "value", "key", "type"])):
            case "drop":
                lines[place] = ""
            case "double":
                lines.insert(place, line)
            case "move":
                lines[place] = ""
                lines.insert(draw(st.integers(0, len(lines))), line)
            case "value" if "=" in line:
                lines[place] = line.partition("=")[0] + "= " + draw(st.sampled_from(ODD))
            case "key" if "=" in line:
                key = draw(
                    st.sampled_from(["name", "stage", "stiffness", "a.b", '"\\u0000"', "frequency", "clearance"])
                )
                lines[place] = f"{key} ={line.partition('=')[2]}"
            case _:
                at = draw(st.integers(0, len(line)))
                lines[place] = line[:at] + draw(st.text(max_size=3)) + line[at + draw(st.integers(0, 2)) :]
    return "\n".join(lines)


@settings(deadline=None, max_examples=examples(60))
@given(mutations())
def test_no_file_raises_anything_but_a_model_error(text: str) -> None:
    try:
        source = parse_source(text, "m.toml")
    except ModelError:
        return
    model, problems = check_model(source)
    assert (model is None) == bool(problems)
    for problem in problems:
        assert len(str(problem).splitlines()) == 1
    if model:
        assert isinstance(model.system, System)

"""What is easily written by mistake, in Python or in a model file: a sentence tells what to write."""

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.errors import GapwalkError, ModelError
from gapwalk.model.problems import did_you_mean, near_names
from tests import models
from tests.systems import clutch, linear

MODEL = models.STOP + models.response(0.9)


@pytest.fixture(scope="module")
def orbit():
    return gw.find_orbit(linear())


@pytest.fixture(scope="module")
def branch(orbit):
    return gw.follow(orbit, "frequency", 0.82)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda orbit: gw.find_orbit("x.toml"), r"not 'x.toml'; read the file first: gw.read_model\('x.toml'\)"),
        (gw.find_orbit, r"find_orbit takes a System, not Orbit\(.*\); write its .system"),
        (lambda orbit: gw.settle("x.toml"), "settle takes a System"),
        (lambda orbit: gw.classify(3), r"settle takes a System, not 3; make one with gw.System"),
        (lambda orbit: gw.find_orbit(orbit.system, method="hb"), r"method is 'hb'; write method=gw.Balance\(\)"),
        (lambda orbit: gw.follow(orbit, "frequency", 1.0, method="hb"), r"method is 'hb'; write method=gw.Balance\(\)"),
        (lambda orbit: gw.follow(orbit.system, "frequency", 1.0), r"find an orbit first: gw.find_orbit\(system\)"),
        (gw.run, r"run takes a study or a model file, not Orbit\(.*\); write gw.run\(\"model.toml\"\)"),
    ],
)
def test_another_kind_of_value_is_named_with_the_line_to_write(orbit, call, words) -> None:
    with pytest.raises(ModelError, match=words):
        call(orbit)


def test_a_picture_of_no_coordinate_speaks_of_what_was_written(branch) -> None:
    with pytest.raises(ModelError, match=r"there is no measure 'q7'; write one of .* such as half.a"):
        branch.plot("q7")
    with pytest.raises(ModelError, match=r"there is no measure 'hlaf.b'; did you mean half.b"):
        branch.plot("hlaf.b")


def test_short_names_of_measures_are_those_of_pictures(orbit) -> None:
    assert [orbit.measure(each) for each in ("a", "rms", "h1")] == [
        orbit.measure(each) for each in ("half.a", "rms.a", "h1.a")
    ]


def test_a_list_of_numbers_is_a_diagonal_as_in_a_file() -> None:
    system = gw.System(["x", "y"], [1.0, 2.0], [0.1, 0.2], [1.0, 0.05])
    whole = gw.System(["x", "y"], np.diag([1.0, 2.0]), np.diag([0.1, 0.2]), np.diag([1.0, 0.05]))
    assert system == whole
    with pytest.raises(ModelError, match=r"mass has shape \(3,\); it must be \(2, 2\), .* or \(2,\), its diagonal"):
        gw.System(["x", "y"], [1.0, 2.0], mass=[1.0, 2.0, 3.0])


@pytest.mark.parametrize(
    ("word", "known", "near"),
    [
        ("friction", ["deflection", "stiffness", "clearance"], []),
        ("clearence", ["clearance", "stiffness"], ["clearance"]),
        ("stifness", ["clearance", "stiffness"], ["stiffness"]),
        ("Frequency", ["frequency"], ["frequency"]),
        ("freq", ["frequency"], ["frequency"]),
        ("setpoint", ["settle", "step"], []),
        ("hbu", ["engine", "hub"], ["hub"]),
        ("mesh", ["mash", "mesh.force", "mesh.torque"], ["mesh.force", "mesh.torque", "mash"]),
        ("mass", ["mean"], []),
        ("", ["x"], []),
    ],
)
def test_only_near_spellings_are_offered(word, known, near) -> None:
    assert sorted(near_names(word, known)) == sorted(near)


def test_not_all_of_very_many_names_are_told() -> None:
    told = did_you_mean("nothing", [f"q{number}" for number in range(900)])
    assert told.endswith("q38, q39, ... (900 in all)")


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("clearance = 1.0", "clearance = -1.0", 'contact "stop".clearance is -1.0; it must be >= 0'),
        (
            "clearance = 1.0",
            "clearance = 1.0\nfriction = 0.2",
            '"stop".friction is not a key here; write hysteresis = ..., the limit of friction',
        ),
        ("clearance = 1.0", 'clearance = "1 mm"', "a number without a unit, in consistent units"),
        ("clearance = 1.0", 'clearance = "0,5"', "it has a point, not a comma: 0.5"),
        ("clearance = 1.0", "clearance = 0,5", "a number has a point, not a comma, as in 0.5"),
        ("[study]", "[study]\n[study]", "[study] is here a second time; if there are several, write [[study]]"),
    ],
)
def test_a_slip_in_a_model_file_is_told(tmp_path, old, new, words) -> None:
    assert old in MODEL
    file = tmp_path / "model.toml"
    file.write_text(MODEL.replace(old, new), encoding="utf-8")
    with pytest.raises(ModelError) as told:
        gw.read_study(file)
    assert words in str(told.value)
    assert "deflection?" not in str(told.value)


def test_a_table_in_the_place_of_a_list_of_numbers(tmp_path) -> None:
    file = tmp_path / "model.toml"
    file.write_text('coordinates = ["x"]\nstiffness = { x = 1 }\n', encoding="utf-8")
    with pytest.raises(ModelError, match=r"stiffness is a table; it must be a list, as in stiffness = \[1.0\]"):
        gw.read_study(file)


def test_a_result_and_a_model_are_told_apart(tmp_path) -> None:
    model, result = tmp_path / "model.toml", tmp_path / "result.gapwalk"
    model.write_text(MODEL, encoding="utf-8")
    gw.run(gw.read_study(model), result)
    with pytest.raises(ModelError, match="this is a result, not a model file; `gapwalk show`"):
        gw.read_study(result)
    with pytest.raises(GapwalkError, match="a model file; compute a result first: gapwalk run"):
        gw.open_result(model)


def test_a_special_point_is_printed_with_its_error_and_nature() -> None:
    branch = gw.follow(gw.find_orbit(clutch(frequency=1.5)), "frequency", 1.3)
    (flip,) = branch.special(gw.Kind.FLIP)
    text = f"{flip.kind.value} at {flip.value:.10g} +- {flip.uncertainty:.0e}, {flip.change}, {flip.nature}"
    assert repr(flip) == f"SpecialPoint({text})"
    assert flip.nature in repr(flip)
    assert repr(branch.special(gw.Kind.GRAZING)[0]).endswith(", stage2 +)")

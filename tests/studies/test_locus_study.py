"""The study ``kind = "locus"``: special points of one branch in the plane of two parameters, stored, resumed, shown."""

import csv
import json
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.cli import main
from gapwalk.cli import progress as lines
from gapwalk.errors import ModelError
from gapwalk.model.model_source import parse_source
from gapwalk.model.problems import ModelFileError
from gapwalk.studies.bifurcation_map import Map, Which
from gapwalk.studies.locus_study import LocusStudyOptions
from gapwalk.studies.study_file import check_study, without_units
from gapwalk.studies.study_kind import StudyKind
from tests.results.again import again

SYSTEM = """\
coordinates = ["x"]
stiffness = [[1.0]]
damping = [[0.1]]

[[contact]]
name = "stop"
deflection = { x = 1.0 }
side = "positive"
clearance = 1.0
stiffness = 20.0
impact_damping = 0.1

[[harmonic]]
amplitude = 0.3
acts_on = { x = 1.0 }

"""
STUDY = """\
[study]
kind = "locus"
of = "grazing"
parameter = "frequency"
from = 2.0
to = 0.6
second = { parameter = "harmonic1.amplitude", from = 0.09, to = 0.6 }
"""


def study_of(text: str = STUDY, changes=None) -> gw.Study:
    return check_study(parse_source(SYSTEM + text), changes)


def options_in(text: str = STUDY, changes=None) -> LocusStudyOptions:
    options = study_of(text, changes).options
    assert isinstance(options, LocusStudyOptions)
    return options


def map_of(result: gw.Result) -> Map:
    assert result.map is not None
    return result.map


@pytest.fixture(scope="module")
def written(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("locus") / "x.gapwalk"
    gw.run(study_of(), path)
    return path


def test_the_locus_of_first_contact_is_that_of_the_linear_response(written) -> None:
    """A motion that grazes never enters the stop: it is x = 1 at its height, which has a closed form."""
    chart = map_of(gw.open_result(written))
    assert chart.complete
    assert not chart.failures
    (locus,) = chart.loci  # both grazing points of the branch lie on it
    assert len(chart.branches[0].special("grazing")) == 2
    frequency, amplitude = locus.values.T
    expected = np.hypot(1.0 - frequency**2, 0.1 * frequency)
    np.testing.assert_allclose(amplitude, expected, rtol=1e-9)
    assert sorted(end.reason.name for end in locus.ends) == ["RANGE", "RANGE"]
    assert amplitude.max() == pytest.approx(0.6)
    assert amplitude.min() == pytest.approx(np.sqrt(0.1**2 - 0.1**4 / 4), rel=1e-3)


def test_it_is_the_locus_that_the_function_follows(written) -> None:
    result = gw.open_result(written)
    special = result.branches[0].special("grazing")[0]
    expected = gw.follow_locus(special, "frequency", "harmonic1.amplitude", ((0.6, 2.0), (0.09, 0.6)))
    assert np.array_equal(map_of(result).loci[0].values, expected.values)


def test_one_special_point_is_chosen_by_where_it_lies() -> None:
    near = [map_of(gw.run(study_of(f"{STUDY}near = {value}\n"))).loci for value in (0.9, 1.1)]
    branch = gw.run(study_of()).branches[0]
    for loci, special in zip(near, sorted(branch.special("grazing"), key=lambda each: each.value), strict=True):
        (locus,) = loci
        assert np.abs(locus.values[:, 0] - special.value).min() < 1e-9
    assert [str(end) for end in near[0][0].ends] != []


def test_points_are_chosen_by_kind_contact_and_place() -> None:
    branch = gw.run(study_of()).branches[0]
    specials = branch.special_points
    assert Which(gw.Kind.GRAZING, contact="stop").of(specials) == [s for s in specials if s.kind == "grazing"]
    assert Which(gw.Kind.GRAZING, contact="stop +").of(specials) == Which(gw.Kind.GRAZING).of(specials)
    assert Which(gw.Kind.GRAZING, contact="st").of(specials) == []
    assert Which(gw.Kind.FOLD, near=5.0).of(specials) == [max(branch.special("fold"), key=lambda s: s.value)]


def test_nothing_to_follow_is_a_failure_that_says_what_there_is(tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    Path("x.toml").write_text(SYSTEM + STUDY.replace("grazing", "neimark-sacker"))
    assert main(["run", "x.toml", "--quiet"]) == 3
    assert "the branch has no neimark-sacker; it has grazing of stop + at 1." in capsys.readouterr().err
    assert not map_of(gw.open_result("x.gapwalk")).loci


def test_it_is_verified_and_shown_and_exported(written, tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    assert gw.verify(gw.open_result(written)).ok
    assert main(["show", str(written), "--points"]) == 0
    text = capsys.readouterr().out
    assert "1 locus, 1 of grazing" in text
    assert "grazing-1  period 1 of stop +" in text
    assert main(["export", str(written), "--output", "x.csv"]) == 0
    (row, *_) = csv.DictReader(Path("x.csv").read_text(encoding="utf-8").splitlines())
    assert (row["locus"], row["kind"], row["contact"]) == ("grazing-1", "grazing", "stop +")
    capsys.readouterr()
    assert main(["show", str(written), "--json"]) == 0
    assert [locus["name"] for locus in json.loads(capsys.readouterr().out)["loci"]] == ["grazing-1"]


def test_the_branch_is_walked_at_the_models_own_value_or_at_another() -> None:
    assert options_in().sections == (0.3,)
    other = STUDY.replace("to = 0.6 }", "to = 0.6, at = 0.5 }")
    assert options_in(other).sections == (0.5,)
    assert study_of(other).system["harmonic1.amplitude"] == 0.5
    assert options_in(changes={"study.second.at": 0.4}).sections == (0.4,)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('of = "grazing"\n', "", 'write which special points are followed, as in of = "grazing"'),
        ('"grazing"', '"grasing"', 'is "grasing"; it must be one of .*; did you mean grazing'),
        ('"grazing"', '"branch-point"', 'is "branch-point"; it must be one of'),
        (
            '"grazing"\n',
            '"fold"\ncontact = "stop"\n',
            'contact selects among grazing points; leave it out for of = "fold"',
        ),
        ('"grazing"\n', '"grazing"\ncontact = "stip"\n', 'is "stip", which is no contact; did you mean stop'),
        ("from = 0.09,", "from = 0.4,", "harmonic1.amplitude = 0.3, outside the range from 0.4 to 0.6; write a value"),
        ("to = 0.6 }", "to = 0.6, at = 0.7 }", "at has 0.7, outside the range from 0.09 to 0.6"),
        ("to = 0.6\n", "to = 0.6\nsections = 3\n", "sections"),
    ],
)
def test_what_cannot_be_asked_is_said(old, new, message) -> None:
    with pytest.raises(ModelFileError, match=message):
        study_of(STUDY.replace(old, new))


def test_a_change_of_the_second_parameter_has_a_key_of_its_own() -> None:
    with pytest.raises((ModelError, ModelFileError), match=r"set study\.second\.at instead"):
        study_of(changes={"harmonic1.amplitude": 0.4})


def test_options_survive_the_file() -> None:
    options = study_of(f'{STUDY}near = 1.1\ncontact = "stop +"\n').options
    assert again(options, StudyKind) == options
    assert options.plan == (
        "locus of grazing of stop + nearest to 1.1 over frequency from 2 to 0.6 and harmonic1.amplitude from 0.09 to "
        "0.6, picked up at harmonic1.amplitude = 0.3, period 1"
    )


def test_options_make_sense_in_python_too() -> None:
    second = gw.studies.ParameterRange("harmonic1.amplitude", 0.09, 0.6)
    given = {"parameter": "frequency", "begin": 2.0, "end": 0.6, "measure": "half.x", "second": second}
    with pytest.raises(ModelError, match="one kind, as in sections="):
        LocusStudyOptions(**given, sections=(0.3, 0.4), kinds=(gw.Kind.FOLD,))
    with pytest.raises(ModelError, match="a branch point has no locus in two parameters: it exists by a symmetry"):
        LocusStudyOptions(**given, sections=(0.3,), kinds=(gw.Kind.BRANCH_POINT,))
    with pytest.raises(ModelError, match="contact is for grazing points"):
        LocusStudyOptions(**given, sections=(0.3,), kinds=(gw.Kind.FOLD,), contact="stop")


def test_the_place_of_the_point_has_the_unit_of_its_parameter(tmp_path) -> None:
    example = Path(__file__).parents[2] / "examples" / "drivetrain.toml"
    text = example.read_text(encoding="utf-8").partition("[[study]]")[0]
    table = """\
[study]
kind = "locus"
of = "grazing"
near = "1500 rpm"
parameter = "speed"
from = "2000 rpm"
to = "1000 rpm"
second = { parameter = "mean.flywheel", from = "10 N m", to = "400 N m" }
"""
    study = check_study(parse_source(text + table))
    options, plain = study.options, without_units(study).options
    assert isinstance(options, LocusStudyOptions)
    assert isinstance(plain, LocusStudyOptions)
    assert isinstance(plain.sections, tuple)
    assert options.near == pytest.approx(0.75 * options.begin)
    assert plain.near == pytest.approx(0.75 * plain.begin)
    assert plain.second.begin < plain.sections[0] < plain.second.end


def test_a_log_has_a_line_now_and_then(monkeypatch, capsys) -> None:
    monkeypatch.setattr(lines, "_FIRST", 0.05)
    monkeypatch.setattr(lines, "_AGAIN", 0.1)
    assert not sys.stderr.isatty()
    with lines.progress_of(study_of().options, "mine") as progress:
        time.sleep(0.3)
        progress.update("mine", "sections 1 of 1  loci 0")
        time.sleep(0.3)
    found = capsys.readouterr().err.splitlines()
    assert found[0] == "mine first section  0 s"
    assert found[-1] == "mine  sections 1 of 1  loci 0  1 s"
    assert 3 <= len(found) <= 7
    time.sleep(0.2)
    assert not capsys.readouterr().err
    with lines.progress_of(study_of().options, "mine", show=False):
        time.sleep(0.2)
    assert not capsys.readouterr().err


def test_a_long_part_shows_its_share() -> None:
    reached = lines._Reached(lines.ProgressLine("rattle", str, total=1.0, show=False), plan="3 rounds")
    reached.begin(lines.Pace(1, 4, 1), lambda: 0.5)
    reached._begun -= 10.0
    assert str(reached).startswith("1 of 4  38 %  about ")
    reached.note(lines.Pace(4, 4, 1))
    assert str(reached) == "4 of 4  100 %  the result is put together and checked: 50 %"

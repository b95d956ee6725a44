"""Drive trains in model files: what they say, and what is said of those that are wrong."""

from pathlib import Path

import pytest

import gapwalk as gw
from gapwalk.model import ModelFileError
from gapwalk.model.model_file import check_model
from gapwalk.model.model_source import parse_source
from gapwalk.studies.study_file import check_studies
from tests.models import read_system

EXAMPLE = Path(__file__).parents[3] / "examples" / "train.toml"

GOOD = """\
title = "Three bodies"
frequency = 2.0
mean = { engine = 3.0 }
reaction = "load"

[[inertia]]
name = "engine"
inertia = 0.2
[[inertia]]
name = "hub"
inertia = 0.05
[[inertia]]
name = "load"
inertia = 4.0

[[shaft]]
name = "clutch"
between = ["engine", "hub"]
stiffness = 10
damping = 0.1
viscous_damping = 0.2
[[shaft.stage]]
clearance = 0.1
stiffness = 30.0
side = "positive"
[[shaft.stage]]
name = "stop"
clearance = 0.3
stiffness = 90.0

[[gear]]
name = "pair"
between = ["hub", "load"]
ratio = 2.5
stiffness = 70.0
clearance = 0.01
cubic = 5.0
impact_damping = 0.4

[[harmonic]]
amplitude = 0.7
acts_on = { engine = 1.0 }
"""
LINES = GOOD.splitlines()


def problems_of(text: str):
    model, problems = check_model(parse_source(text, "m.toml"))
    assert (model is None) == bool(problems)
    return problems


def test_mistakes_of_each_kind_are_named_at_once() -> None:
    wrong = GOOD.replace("damping = 0.1", "dampng = 0.1").replace('["hub", "load"]', '["hubb", "load"]')
    wrong = wrong.replace("acts_on = { engine", "acts_on = { engin").replace("clearance = 0.01", "clearence = 0.01")
    found = [(each.line, each.message) for each in problems_of(wrong)]
    line = {text: number for number, text in enumerate(wrong.splitlines(), start=1)}
    assert sorted(found) == [
        (line["dampng = 0.1"], "is not a key here; did you mean damping?"),
        (line["[[gear]]"], "joins 'hubb', which is no inertia; did you mean hub?"),
        (line["clearence = 0.01"], "is not a key here; did you mean clearance?"),
        (line["acts_on = { engin = 1.0 }"], "names no inertia; did you mean engine?"),
    ]


def test_a_study_beside_a_wrong_key_is_checked_with_the_names_of_the_train() -> None:
    study = '[study]\nkind = "response"\nparameter = "{}"\nto = {}\n'
    wrong = GOOD.replace("clearance = 0.01", "clearence = 0.01") + study.format("pair.stifness", 1.0)
    with pytest.raises(ModelFileError) as refused:
        check_studies(parse_source(wrong, "m.toml"))
    assert "clearence" in str(refused.value)
    assert "did you mean 'pair.stiffness'?" in str(refused.value)
    wrong = GOOD.replace('["hub", "load"]', '["hubb", "load"]') + study.format("sped", '"700 rpm"')
    with pytest.raises(ModelFileError) as refused:
        check_studies(parse_source(wrong, "m.toml"))
    assert "without a unit" not in str(refused.value)  # whether it has units is not known
    assert "'hubb', which is no inertia" in str(refused.value)


def test_a_file_becomes_the_train_it_describes(tmp_path: Path) -> None:
    path = tmp_path / "m.toml"
    path.write_text(GOOD, encoding="utf-8")
    stages = (gw.Stage(0.1, 30.0, side=gw.Side.POSITIVE), gw.Stage(0.3, 90.0, name="stop"))
    train = gw.train.Train(
        [gw.train.Inertia("engine", 0.2), gw.train.Inertia("hub", 0.05), gw.train.Inertia("load", 4.0)],
        [gw.train.Shaft("clutch", ("engine", "hub"), stiffness=10.0, damping=0.1, stages=stages, viscous_damping=0.2)],
        [gw.train.Gear("pair", ("hub", "load"), 2.5, stiffness=70.0, clearance=0.01, cubic=5.0, impact_damping=0.4)],
        mean={"engine": 3.0},
        harmonics=[gw.Harmonic(0.7, {"engine": 1.0})],
        frequency=2.0,
        reaction="load",
    )
    assert read_system(path) == train.system()
    assert [*train.system().structure.names] == [
        "frequency", "engine.inertia", "hub.inertia", "load.inertia", "mean.engine", "mean.hub",
        "clutch.stiffness", "clutch.damping",
        "clutch.stage2.clearance", "clutch.stage2.stiffness", "clutch.stage2.cubic",
        "clutch.stop.clearance", "clutch.stop.stiffness", "clutch.stop.cubic", "clutch.viscous_damping",
        "pair.ratio", "pair.damping", "pair.clearance", "pair.stiffness", "pair.cubic", "pair.impact_damping",
        "harmonic1.amplitude", "harmonic1.phase", "harmonic1.acts_on.engine",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("line", "instead", "complaint"),
    [
        ('between = ["engine", "hub"]', 'between = ["engine", "hbu"]',
         'm.toml:16: shaft "clutch" joins \'hbu\', which is no inertia; did you mean hub?'),
        ('between = ["engine", "hub"]', 'between = ["engine"]', "it must be a list of 2 or more"),
        ('between = ["engine", "hub"]', 'between = ["hub", "hub"]', 'shaft "clutch".between joins "hub" to itself'),
        ('between = ["hub", "load"]', 'between = ["hub", "engine"]', 'inertia "load" is not connected to engine'),
        ("inertia = 0.05", "inertia = 0", 'm.toml:11: inertia "hub".inertia is 0; it must be > 0'),
        ("inertia = 0.05", 'inertia = "0.05"', 'inertia "hub".inertia is "0.05"; it must be a number, without quotes'),
        ("inertia = 0.05", "inertia = 0.05\nmass = 1", 'm.toml:12: inertia "hub".mass is not a key here'),
        ("ratio = 2.5", "ratio = 0.0", 'm.toml:34: gear "pair".ratio is 0; it must be the speed of the first'),
        ("ratio = 2.5", "", 'gear "pair".ratio is missing; it is the speed of the first inertia divided by that of'),
        ('name = "pair"', 'name = "clutch"', 'm.toml:31: gear "clutch" has the name clutch of another part'),
        ("ratio = 2.5", 'ratio = 2.5\ndamping = "viscous"', 'write law = "viscous" and viscous_damping = ...'),
        ("ratio = 2.5", 'ratio = 2.5\ndamping = "visco"', 'write law, which must be one of "elastic", "viscous"'),
        ("stiffness = 70.0", "", 'gear "pair" has a clearance, but no stiffness beyond it; write stiffness = ...'),
        ("clearance = 0.1", "clearance = 0.5", 'shaft "clutch".stage is out of order on the positive side'),
        ("mean = { engine = 3.0 }", "mean = { motor = 3.0 }", "mean.motor names no inertia; they are engine, hub"),
        ("acts_on = { engine = 1.0 }", "acts_on = { q = 1.0 }", "acts_on.q names no inertia"),
        ('reaction = "load"', 'reaction = "road"', "m.toml:4: reaction is 'road', which is no inertia"),
        ("frequency = 2.0", "coordinates = []", "m.toml:2: coordinates is not a key here"),
        ("frequency = 2.0", "stiffness = [[1]]", "stiffness is not a key here; it belongs in shaft"),
    ],
)  # fmt: skip
def test_a_mistake_is_told_with_its_line(line: str, instead: str, complaint: str) -> None:
    assert line in LINES
    (problem,) = problems_of(GOOD.replace(line, instead, 1))
    assert complaint in str(problem)


def test_several_mistakes_are_told_at_once() -> None:
    text = GOOD.replace("stiffness = 70.0", "").replace('["engine", "hub"]', '["engine", "hbu"]')
    assert len(problems_of(text)) == 2


def test_without_an_inertia_there_is_no_train() -> None:
    (problem,) = problems_of('[[shaft]]\nname = "s"\nbetween = ["a", "b"]\nstiffness = 1.0')
    assert "inertia is missing; write a table [[inertia]] for each body" in str(problem)


def test_parts_can_be_set_walked_and_refused_by_name() -> None:
    changes = {"third.clearance": 0.003, "final.ratio": 3.9, "study.load.to": 5.0}
    drive, load = gw.studies.read_studies(EXAMPLE, changes)
    assert (drive.system["third.clearance"], load.system["final.ratio"]) == (0.003, 3.9)
    assert load.system["mean.engine"] == 30.0
    with pytest.raises(ModelFileError, match=r"no parameter 'third\.clearence'; did you mean 'third\.clearance'"):
        gw.studies.read_studies(EXAMPLE, {"third.clearence": 0.003})


@pytest.mark.slow
def test_the_walk_of_the_example_over_its_load_finds_both_flips(tmp_path: Path) -> None:
    study = gw.read_study(EXAMPLE, {"study.load.from": 9.5, "study.load.to": 7.0}, "load")
    result = gw.run(study, tmp_path / "train.gapwalk")
    values = [each.value for each in result.branches[0].special(gw.Kind.FLIP)]
    assert values == pytest.approx([8.305434714, 7.868696128], abs=1e-8)
    back = gw.open_result(tmp_path / "train.gapwalk")
    assert back.system == result.system
    for value in values:  # a flip has a multiplier of -1, also when its orbit is found anew
        at = back.branches[0].special(gw.Kind.FLIP)[0].point.orbit
        assert min(abs(at.multipliers + 1)) < 1e-6
        assert value


LOADED = (
    GOOD.replace("frequency = 2.0\n", 'speed = "1200 rpm"\nreference = "hub"\n')
    .replace("engine = 3.0", 'engine = "3 N m"')
    .replace("inertia = 0.2", 'inertia = "0.2 kg m^2"')
    .replace("inertia = 0.05", 'inertia = "0.05 kg m^2"')
    .replace("inertia = 4.0", 'inertia = "4 kg m^2"')
    .replace("stiffness = 10\ndamping = 0.1\nviscous_damping = 0.2\n", 'stiffness = "10 N m/deg"\n')
    .replace("clearance = 0.1\nstiffness = 30.0", 'clearance = "5 deg"\nstiffness = "30 N m/rad"')
    .replace("clearance = 0.3\nstiffness = 90.0", 'clearance = "9 deg"\nstiffness = "90 N m/rad"')
    .replace("ratio = 2.5\nstiffness = 70.0\nclearance = 0.01\ncubic = 5.0\nimpact_damping = 0.4",
             'teeth = [20, 50]\nstiffness = "70 N m/rad"\nclearance = "1 deg"')
    .replace("amplitude = 0.7\nacts_on = { engine = 1.0 }",
             'order = 0.5\namplitude = "7 N m"\nacts_on = { engine = 1.0 }\ngrowth = 2\nat = "900 rpm"')
    + """
[[harmonic]]
varies = "pair.stiffness"
mesh = "pair"
amplitude = 0.2
[[harmonic]]
varies = "pair.deflection"
mesh = "pair"
amplitude = "0.01 deg"
[[rectangle]]
varies = "clutch.stop.stiffness"
share = 0.3
amplitude = 0.1
turns_of = "load"
order = 5
[[force]]
name = "oil"
between = ["engine", "hub"]
law = "2*c*v + d*v*abs(v)"
c = "0.01 N m s/rad"
d = 0.002
"""
)  # fmt: skip


def test_loads_and_formulas_of_a_file_are_those_of_the_train() -> None:
    model, problems = check_model(parse_source(LOADED, "m.toml"))
    assert not problems
    assert model is not None
    stages = (gw.Stage("5 deg", "30 N m/rad", side=gw.Side.POSITIVE), gw.Stage("9 deg", "90 N m/rad", name="stop"))
    train = gw.train.Train(
        [gw.train.Inertia("engine", "0.2 kg m^2"), gw.train.Inertia("hub", "0.05 kg m^2"),
         gw.train.Inertia("load", "4 kg m^2")],
        [gw.train.Shaft("clutch", ("engine", "hub"), stiffness="10 N m/deg", stages=stages)],
        [gw.train.Gear("pair", ("hub", "load"), teeth=(20, 50), stiffness="70 N m/rad", clearance="1 deg")],
        mean={"engine": "3 N m"},
        harmonics=[
            gw.train.Counted(
                gw.Harmonic("7 N m", {"engine": 1.0}, name="harmonic0_5", growth=2, at="900 rpm"), order=0.5
            ),
            gw.train.Counted(gw.Harmonic(0.2, varies="pair.stiffness", name="harmonic1"), mesh="pair"),
            gw.train.Counted(
                gw.Harmonic("0.01 deg", varies="pair.deflection", name="pair_deflection_harmonic1"), mesh="pair"
            ),
            gw.train.Counted(
                gw.loads.Rectangle(0.1, "clutch.stop.stiffness", order=5, share=0.3), turns_of="load"
            ),
        ],
        forces=[gw.train.Force("oil", ("engine", "hub"), "2*c*v + d*v*abs(v)", c="0.01 N m s/rad", d=0.002)],
        reaction="load",
        reference="hub",
        speed="1200 rpm",
    )  # fmt: skip
    assert model.system == train.system()
    assert model.system.turns == 0.5


@pytest.mark.parametrize(
    ("line", "instead", "complaint"),
    [
        ('mesh = "pair"', 'mesh = "par"', "m.toml:46: harmonic[1].mesh is 'par', which is no gear; did you mean pair?"),
        ("teeth = [20, 50]", "ratio = 2.5", "counts its order per tooth of pair, which has no teeth"),
        ("teeth = [20, 50]", "teeth = 20", 'gear "pair".ratio is missing; it is the speed of the first'),
        ("teeth = [20, 50]", "teeth = [20, 50]\nratio = 2.4",
         'gear "pair" has 20 teeth and the ratio 2.4, so its second gear would have 48; write the numbers of both'),
        ("amplitude = 0.2", 'amplitude = "0.2 N m"',
         'it is a fraction of what varies, so write it without a unit'),
        ('amplitude = "0.01 deg"', "amplitude = 0.01", "amplitude is 0.01, a number without a unit; write an angle"),
        ('at = "900 rpm"', "at = 900", "at is 900, a number without a unit; write a frequency or speed such as"),
        ('varies = "pair.stiffness"', 'varies = "pear.stiffness"',
         "m.toml:45: harmonic[1].varies is 'pear.stiffness', but there is no shaft or gear 'pear'; they are clutch"),
        ('varies = "pair.stiffness"', 'varies = "pair.damping"', "but a damper that acts always does not vary"),
        ('law = "2*c*v + d*v*abs(v)"', 'law = "2*c*v + d*v*abs(v"', 'force "oil" has no formula as its law'),
        ("d = 0.002", "e = 0.002", 'force "oil" has no d, which its formula needs'),
        ('c = "0.01 N m s/rad"', 'c = "0.01 kg"', 'm.toml:62: force "oil".c is "0.01 kg": kg is not made of an angle'),
        ("order = 5", "order = 5.1234567", "which is no fraction of small numbers"),
        ("inertia = \"0.05 kg m^2\"", "", 'inertia "hub" has no inertia; write inertia = ...'),
        ('reference = "hub"', 'reference = "hup"', "reference is 'hup', which is no inertia; did you mean hub?"),
    ],
)  # fmt: skip
def test_a_mistake_of_loads_is_told(line: str, instead: str, complaint: str) -> None:
    assert line in LOADED
    problems = problems_of(LOADED.replace(line, instead, 1))
    assert any(complaint in str(problem) for problem in problems), [*map(str, problems)]
    assert len(problems) < 3

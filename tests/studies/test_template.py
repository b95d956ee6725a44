"""The model file to begin with, and the examples: complete, valid, and what they say they are."""

import dataclasses
import itertools
from pathlib import Path

import pytest

from gapwalk.bifurcation.isolated import SearchOptions
from gapwalk.errors import ModelError
from gapwalk.model.model_source import parse_source
from gapwalk.orbit import Shooting, find_orbit
from gapwalk.orbit.harmonic_balance import Balance
from gapwalk.paper import case
from gapwalk.studies.diagram_study import DiagramOptions
from gapwalk.studies.family_study import FamilyStudy
from gapwalk.studies.locus_study import LocusStudyOptions
from gapwalk.studies.machine_templates import template, write_template
from gapwalk.studies.map_study import MapStudyOptions
from gapwalk.studies.options import BranchOptions
from gapwalk.studies.study_file import check_study, read_studies, read_study

EXAMPLES = Path(__file__).parents[2] / "examples"
FILES = sorted(path.name for path in EXAMPLES.glob("*.toml"))


def test_the_template_is_the_clutch_of_figure_13(tmp_path: Path) -> None:
    path = tmp_path / "new.toml"
    write_template(path)
    study = read_study(path)
    assert study.text == template()
    assert study.system == case("13").at(frequency=2.0)
    assert (study.options.begin, study.options.end) == (2.0, 0.15)


def test_the_clutch_example_is_figure_13_too() -> None:
    study = read_study(EXAMPLES / "clutch.toml")
    assert study.system == case("13").at(frequency=2.0)
    assert study.options == check_study(parse_source(template())).options


def test_what_the_comments_of_the_template_offer_is_right() -> None:
    text = template()
    stages = text[text.index("# [[contact.stage]]") : text.index("# ---- The excitation")]
    bare = "".join(line.removeprefix("#").removeprefix(" ") + "\n" for line in stages.splitlines())
    lines = text.replace(stages, bare).splitlines()
    short = ("clearance = 1.0  ", "stiffness = 1.0  ", "cubic = ", "side = ")
    long = "\n".join(line for line in lines if not line.startswith(short)) + "\n"
    long = long.replace("# frequency = 2.0", "frequency = 2.0")
    system = check_study(parse_source(long)).system
    assert [name for name in system.structure.names if name.endswith("clearance")] == [
        "stage2.stage1.clearance",
        "stage2.stage2.clearance",
    ]
    more = text[text.index("# max_period") :].splitlines()
    lines = [line.removeprefix("# ") for line in more if " = " in line and line != '# name = "tight"']
    bare = text.replace('kind = "response"', "\n".join(['kind = "diagram"', *lines]))
    study = check_study(parse_source(bare))
    assert study.options.limits == DiagramOptions(8, 200, 2, 40, SearchOptions(starts=64))
    assert (study.system["stage2.clearance"], study.system["harmonic1.amplitude"]) == (0.5, 0.3)
    for parameter in ("stage2.clearance", "mean.q1", "harmonic1.amplitude", "stiffness.q1.q3"):
        assert f'"{parameter}"' in text
        assert case("13").structure.place(parameter)


def test_what_the_comments_of_the_template_offer_of_maps_is_right() -> None:
    text = template()
    offered = text[text.index("# second = ") : text.index('# A study kind = "locus"')]
    # a list goes on in a line that is indented
    lines = [line.removeprefix("# ") for line in offered.splitlines() if " = " in line or line.startswith("#  ")]
    study = check_study(parse_source(text.replace('kind = "response"', "\n".join(['kind = "map"', *lines]))))
    assert isinstance(study.options, MapStudyOptions)
    assert (study.options.sections, study.options.max_period, study.options.search_values) == (5, 2, 0)
    assert study.options.second.parameter == "mean.q1"


def test_what_the_comments_of_the_template_offer_of_loci_is_right() -> None:
    text = template()
    offered = text[text.index("# of = ") : text.index('# A study kind = "family"')]
    lines = [line.removeprefix("# ") for line in offered.splitlines() if " = " in line]
    lines.append(next(line.removeprefix("# ") for line in text.splitlines() if line.startswith("# second = ")))
    study = check_study(parse_source(text.replace('kind = "response"', "\n".join(['kind = "locus"', *lines]))))
    assert isinstance(study.options, LocusStudyOptions)
    assert (study.options.which.words, study.options.sections) == ("grazing of stage2 nearest to 1.2", (0.25,))


def test_the_example_of_loci_is_of_figure_13() -> None:
    for study in read_studies(EXAMPLES / "locus.toml"):
        assert study.system == case("13").at(frequency=study.system.frequency)


def test_what_the_comments_of_the_template_offer_of_families_is_right() -> None:
    text = template()
    offered = text[text.index("# over = ") : text.index('# A study kind = "diagram"')]
    lines = [line.removeprefix("# ") for line in offered.splitlines() if " = " in line]
    study = check_study(parse_source(text.replace('kind = "response"', "\n".join(['kind = "family"', *lines]))))
    assert isinstance(study.options, FamilyStudy)
    assert (study.options.max_period, study.options.exact) == (None, True)
    assert (study.options.over.name, len(study.options.over.axis)) == ("load", 3)


def test_the_example_of_families_goes_from_figure_13_to_14_and_over_the_stiffness_ratio() -> None:
    load, stages = read_studies(EXAMPLES / "family.toml")
    for figure, number in (("13", 0), ("14", -1)):
        changes = load.options.over.at(number)
        assert load.system.at({**changes, "frequency": case(figure).frequency}) == case(figure)
    for figure, number in (("13", 0), ("23a", -1)):
        kappa = stages.system.at(stages.options.over.at(number))
        for name in stages.options.over.names:
            assert kappa[name] == pytest.approx(case(figure)[name], abs=1e-15)


@pytest.mark.parametrize("kind", ["settle", "sweep", "basins", "regimes"])
def test_what_the_comments_of_the_template_offer_of_other_kinds_is_right(kind) -> None:
    text = template()
    system, _, _ = text.partition("[study]")
    system = system.replace("# frequency = 2.0", "frequency = 2.0")
    lines = [line.removeprefix("# ") for line in text[text.index(f'# kind = "{kind}"') :].splitlines()]
    offered = [*itertools.takewhile(lambda line: " = " in line, lines)]
    if kind == "regimes":  # it says where the others stand
        offered += ['parameter = "frequency"', "from = 0.5", "to = 1.5", "resolution = 128"]
        offered += [next(line.removeprefix("# ") for line in text.splitlines() if line.startswith("# second = "))]
    found = check_study(parse_source("\n".join([system, "[study]", *offered])))
    assert found.options.kind == kind
    defaults = {field.name: field.default for field in dataclasses.fields(found.options)}
    for name in ("start", "phase", "steps", "ways", "resolution", "carry"):  # the comments show the defaults
        assert getattr(found.options, name, None) == defaults.get(name)


def test_the_islands_of_the_example_are_those_of_figures_27_and_28() -> None:
    load, islands = read_studies(EXAMPLES / "map.toml")
    for figure, value in zip(("27", "28"), islands.options.sections, strict=True):
        assert islands.system.at(dict(case(figure).parameters)) == case(figure)
        changed = {"frequency": value, "harmonic1.amplitude": case(figure)["harmonic1.amplitude"]}
        assert islands.system.at(changed) == case(figure)
    assert load.system.at({"mean.q1": 0.25, "frequency": 1.9}).parameters.items() >= case("13").parameters.items()


def test_the_example_of_harmonic_balance_is_figure_9b_by_both_methods() -> None:
    shot, balanced = read_studies(EXAMPLES / "balance.toml")
    assert shot.system == balanced.system == case("9b").at(frequency=2.0)
    assert (shot.options.method, balanced.options.method) == (Shooting(), Balance(error=1e-3))
    assert shot.options == dataclasses.replace(balanced.options, method=Shooting())


def test_what_the_comments_of_the_template_offer_of_harmonic_balance_is_right() -> None:
    text = template()
    offered = text[text.index("# [study.balance]") : text.index("# ---- More")]
    bare = "".join(line.removeprefix("# ") + "\n" for line in offered.splitlines())
    text = text.replace(offered, bare).replace("period = 1 ", 'method = "harmonic-balance"\nperiod = 1 ')
    assert check_study(parse_source(text)).options.method == Balance(harmonics=20)


def test_a_file_that_is_there_is_kept(tmp_path: Path) -> None:
    path = tmp_path / "model.toml"
    path.write_text("mine")
    with pytest.raises(ModelError, match=r"model\.toml exists already"):
        write_template(path)
    assert path.read_text() == "mine"
    write_template(path, overwrite=True)
    assert path.read_text(encoding="utf-8") == template()


def test_where_no_file_can_be_a_reason_is_given(tmp_path: Path) -> None:
    with pytest.raises(ModelError, match="cannot be written: No such file or directory"):
        write_template(tmp_path / "none" / "model.toml")
    with pytest.raises(ModelError, match="is a folder; name a file in it"):
        write_template(tmp_path, overwrite=True)


@pytest.mark.parametrize("name", FILES)
def test_an_example_can_be_started(name: str) -> None:
    for study in read_studies(EXAMPLES / name):
        assert study.title
        if not isinstance(study.options, BranchOptions):
            assert study.options.plan.startswith(study.options.kind)
            continue
        orbit = find_orbit(study.system, study.options.period, study.options.start)
        if study.system.structure.driving:  # a motion that only a variation excites may begin at rest
            assert orbit.measure(study.options.measure) > 0


def test_the_diagrams_are_those_of_the_paper() -> None:
    thirteen, fifteen, twenty_nine = read_studies(EXAMPLES / "diagram.toml")
    for study, name in ((thirteen, "13"), (fifteen, "15")):
        ours, paper = study.system.parameters, case(name).at(frequency=1.9).parameters
        assert {key: ours[key] for key in paper} == dict(paper)
        assert ours["harmonic2.amplitude"] == 0.0
    assert twenty_nine.system == case("29").at({"harmonic1.amplitude": 0.02})


def test_there_are_examples() -> None:
    names = {
        "balance",
        "basins",
        "belt",
        "clutch",
        "damper",
        "den_hartog",
        "diagram",
        "drivetrain",
        "gear",
        "hysteresis",
        "impact_damper",
        "map",
        "rattle",
        "regimes",
        "rigid",
        "rod",
        "settle",
        "stop",
        "sweep",
        "train",
    }
    assert set(FILES) >= {f"{name}.toml" for name in names}

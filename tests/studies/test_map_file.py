"""Maps and searches in model files: what they ask for, and what is said of those that are wrong."""

import pytest

import gapwalk as gw
from gapwalk.model import ModelFileError
from gapwalk.model.model_source import parse_source
from gapwalk.studies.map_study import MapStudyOptions
from gapwalk.studies.study_file import Study, check_study
from gapwalk.studies.study_kind import StudyKind
from tests.results.again import again

SYSTEM = """\
title = "A clutch"
coordinates = ["q1", "q3"]
stiffness = [[0.1, -0.6], [-0.06, 1.1]]
mean = { q1 = 0.25, q3 = 0.25 }

[[contact]]
name = "stage2"
deflection = { q1 = 1.0 }
clearance = 1.0
stiffness = 1.0

[[harmonic]]
amplitude = 0.25
acts_on = { q1 = 1.0 }

"""
MAP = (
    SYSTEM
    + """\
[study]
kind = "map"
parameter = "mean.q1"
from = 0.5
to = 0.1
second = { parameter = "frequency", from = 0.9, to = 0.4 }
sections = [0.5, 0.6]
max_period = 1
kinds = ["flip", "fold", "flip"]
workers = 3
"""
)
SEARCH = """\
[study.search]
values = [0.2, 0.3]
starts = 5
newton_periods = [1, 3]
box = [2.0, 2.0, 1.0, 1.0]
seed = 7
"""
DIAGRAM = SYSTEM + '[study]\nkind = "diagram"\nparameter = "frequency"\nfrom = 0.1\nto = 0.4\n'


def study_of(text: str, changes=None) -> Study:
    return check_study(parse_source(text, "m.toml"), changes)


def problems_of(text: str, changes=None):
    with pytest.raises(ModelFileError) as error:
        study_of(text, changes)
    return [(problem.path, problem.message) for problem in error.value.problems]


def test_a_map_has_all_that_its_file_says() -> None:
    options = study_of(MAP).options
    assert isinstance(options, MapStudyOptions)
    assert options.second == gw.studies.ParameterRange("frequency", 0.9, 0.4)
    assert options.within == ((0.1, 0.5), (0.4, 0.9))
    given = options.sections, options.max_period, options.kinds, options.workers
    assert given == ((0.5, 0.6), 1, (gw.Kind.FLIP, gw.Kind.FOLD), 3)
    system = study_of(MAP).system
    assert (system["mean.q1"], system.frequency) == (0.5, 0.9)  # neither has to stand elsewhere in the file


def test_what_a_map_does_not_say_has_the_defaults_of_its_options() -> None:
    head, _, _ = MAP.partition("sections")
    plain = study_of(head).options
    assert (plain.sections, plain.max_period, plain.search_values) == (5, 2, 0)
    searched = study_of(MAP + "[study.search]\nvalues = 4\n").options
    assert (searched.search_values, searched.search) == (4, gw.SearchOptions())


def test_a_search_has_all_that_its_file_says() -> None:
    search = gw.SearchOptions(starts=5, newton_periods=(1, 3), box=(2.0, 2.0, 1.0, 1.0), seed=7)
    for text in (DIAGRAM, MAP):
        limits = study_of(text + SEARCH).options
        assert (limits.search_values, limits.search) == ((0.2, 0.3), search)
    assert study_of(DIAGRAM).options.search_values == 0


@pytest.mark.parametrize("text", [MAP, MAP + SEARCH, DIAGRAM, DIAGRAM + SEARCH, DIAGRAM + "search = { values = 3 }\n"])
def test_options_survive_json(text) -> None:
    options = study_of(text).options
    same = again(options, StudyKind)
    assert same == options
    assert same.workers == options.workers
    assert hash(same) == hash(options)  # tuples, no lists


@pytest.mark.parametrize(
    ("old", "new", "path", "message"),
    [
        ('"frequency", from', '"mean.q1", from', "study.second", 'has the parameter "mean.q1", which is the first one'),
        ('"frequency", from', '"frequenzy", from', "study.second.parameter", "did you mean 'frequency'"),
        (", to = 0.4", "", "study.second.to", "is missing; write where its range ends"),
        ("to = 0.4", "to = 0.9", "study.second.to", "is 0.9, where the range begins; make it wider"),
        ("to = 0.4", "to = -0.4", "study.second.to", "is not allowed: frequency is -0.4; it must be > 0"),
        ("to = 0.4", "to = 0.4, by = 3", "study.second.by", "is not a key here; the keys are parameter, from, to"),
        ("[0.5, 0.6]", "[0.5, 0.95]", "study.sections", "has 0.95, outside the range from 0.4 to 0.9"),
        ("[0.5, 0.6]", "[0.5, 0.5]", "study.sections", "list each value only once"),
        ("[0.5, 0.6]", "[]", "study.sections", "it must be a list of 1 or more"),
        ("[0.5, 0.6]", "0", "study.sections", "is 0; it must be >= 1"),
        ("[0.5, 0.6]", '"many"', "study.sections", 'is "many"; it must be an integer'),
        ('"fold", ', '"folds", ', "study.kinds[1]", "did you mean fold?"),
        ('"fold", ', '"branch-point", ', "study.kinds[1]", 'one of "fold", "flip", "neimark-sacker", "grazing"'),
        ("workers = 3", "workers = 0", "study.workers", "is 0; it must be >= 1"),
        ("workers = 3", "max_branches = 3", "study.max_branches", "is not a key here"),
        ("workers = 3", "shooting.segments = 3", "study.shooting.segments", "a locus is followed with one"),
        (
            "workers = 3",
            "set = { frequency = 3 }",
            "study.set.frequency",
            "cannot be set here: the study walks this parameter",
        ),
        ("workers = 3", "search = { starts = 3 }", "study.search.values", "write at how many values of the parameter"),
        ("workers = 3", "search.values = [0.6]", "study.search.values", "has 0.6, outside the range from 0.1 to 0.5"),
    ],
)
def test_a_wrong_map_has_one_problem(old, new, path, message) -> None:
    assert old in MAP
    ((found, text),) = problems_of("frequency = 0.5\n" + MAP.replace(old, new, 1))
    assert found == path
    assert message in text


@pytest.mark.parametrize(
    ("line", "path", "message"),
    [
        ("values = [0.2, 0.5]", "study.search.values", "has 0.5, outside the range from 0.1 to 0.4"),
        ("values = 0", "study.search.values", "is 0; it must be >= 1"),
        ("values = []", "study.search.values", "it must be a list of 1 or more"),
        ("values = [0.2, true]", "study.search.values[1]", "is true; it must be a number"),
        ("values = 2\nbox = [1.0]", "study.search.box", "is a list of 1 numbers; it must have 4"),
        ("values = 2\nbox = [1.0, 0, 1, 1]", "study.search.box[1]", "is 0; it must be > 0"),
        ("values = 2\nnewton_periods = [0]", "study.search.newton_periods[0]", "is 0; it must be >= 1"),
        ("values = 2\npatience = 3", "study.search.patience", "is 3; it must be >= 16"),
        ("values = 2\nspread = -1", "study.search.spread", "is -1; it must be > 0"),
        ("values = 2\nseed = -1", "study.search.seed", "is -1; it must be >= 0"),
        ("values = 2\nstart = 9", "study.search.start", "start belongs to the study, above the first of its tables"),
        ("values = 2\nstart_s = 9", "study.search.start_s", "did you mean starts"),
        ("starts = 9", "study.search.values", "is missing; write at how many values of the parameter to search"),
    ],
)
def test_a_wrong_search_has_one_problem(line, path, message) -> None:
    ((found, text),) = problems_of(f"{DIAGRAM}[study.search]\n{line}\n")
    assert found == path
    assert message in text


def test_everything_wrong_is_told_at_once() -> None:
    text = MAP.replace("to = 0.4", "to = 0.9").replace("workers = 3", "workers = 0\nsearch = { values = 2, block = 0 }")
    assert [path for path, _ in problems_of(text)] == ["study.second.to", "study.workers", "study.search.block"]


def test_both_parameters_are_changed_by_the_keys_of_the_study() -> None:
    study = study_of(MAP, {"study.second.from": 0.8, "study.from": 0.4, "stage2.clearance": 0.5})
    assert (study.options.second.begin, study.options.begin, study.system["stage2.clearance"]) == (0.8, 0.4, 0.5)
    for name, key in (("mean.q1", "study.from"), ("frequency", "study.second.from")):
        ((_, text),) = problems_of(MAP, {name: 0.3})
        assert text == f"{name} cannot be set: the study walks it from {key} on; set {key} instead"


def test_a_frequency_that_no_parameter_gives_is_asked_for() -> None:
    text = MAP.replace('"frequency", from = 0.9, to = 0.4', '"stage2.clearance", from = 0.9, to = 0.4')
    ((path, message),) = problems_of(text)
    assert path == "frequency"
    assert "the study walks mean.q1 and stage2.clearance: write it at the top of the file, as in frequency" in message

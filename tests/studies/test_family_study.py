"""Families as studies: their files, what is stored of them, and that a stopped or killed one goes on."""

import json
from dataclasses import replace

import pytest

import gapwalk as gw
from gapwalk.errors import StoreError
from gapwalk.model import ModelFileError
from gapwalk.model.model_source import parse_source
from gapwalk.studies.branch_family import Family
from gapwalk.studies.export import export_csv
from gapwalk.studies.family_study import FamilyStudy
from gapwalk.studies.study_file import check_study
from gapwalk.studies.study_kind import StudyKind
from tests.computed import opened
from tests.interruption import until_ctrl_c
from tests.results.again import again
from tests.studies.families import MODEL, family_file, second_resonance, study_of
from tests.studies.killing import killed_after
from tests.studies.same import assert_same_branch
from tests.systems import clutch

LOADS = {"mean.q3": (0.25, 0.35, 0.5)}
OVER = 'over = { "mean.q3" = [0.25, 0.35, 0.5] }'


def problems_of(text: str, changes=None):
    with pytest.raises(ModelFileError) as error:
        check_study(parse_source(text, "m.toml"), changes)
    return [(problem.path, problem.message) for problem in error.value.problems]


def assert_same_family(one: Family, other: Family) -> None:
    assert one.point_paths == other.point_paths
    assert one.connections == other.connections
    assert [member.value for member in one.members] == [member.value for member in other.members]
    for a, b in zip(one.branches, other.branches, strict=True):
        assert_same_branch(a, b)


@pytest.fixture(scope="module")
def result() -> gw.Result:
    return opened(family_file())


def test_a_study_finds_what_the_function_finds(result) -> None:
    assert (result.complete, result.failures, result.branches) == (True, (), ())
    assert result.finding is not None
    assert_same_family(result.finding.record, second_resonance())
    assert "Family(frequency over mean.q3: 3 members" in repr(result)


@pytest.mark.slow
def test_a_killed_study_goes_on_to_the_same_result(tmp_path) -> None:
    path = tmp_path / "r.gapwalk"
    code = f"from tests.studies.families import main\nmain({str(path)!r})"
    assert killed_after(2, code, 0.1)[:2] == ["1 5", "2 5"]
    assert not gw.open_result(path).complete
    assert killed_after(2, code, 0.1)[-1] != "complete"
    result = gw.run(study_of(), path, resume=True)
    assert result.complete
    assert result.finding is not None
    assert_same_family(result.finding.record, second_resonance())


@pytest.mark.slow
def test_a_result_belongs_to_its_study(tmp_path) -> None:
    path = tmp_path / "r.gapwalk"

    def stop(part, pace) -> None:
        raise KeyboardInterrupt

    stopped = until_ctrl_c(gw.run, study_of(), path, report=stop)
    assert not stopped.complete
    assert stopped.finding is not None
    assert stopped.finding.stored == "1 of 3 members are stored, joined at 0 places"
    other = study_of(MODEL.replace("0.35, ", "0.4, "))
    with pytest.raises(StoreError, match=r"over\.moved is"):
        gw.run(other, path, resume=True)
    more_workers = replace(study_of(), options=replace(study_of().options, workers=2))
    assert gw.run(more_workers, path, resume=True).complete


def test_tables_and_document_tell_the_same(result, tmp_path) -> None:
    finding = result.finding
    assert finding is not None
    header, *rows = finding.tables()["special-points"]()
    assert len(set(header)) == len(header)
    assert header[:8] == [
        "point_path",
        "kind",
        "contact",
        "period",
        "parameter mean.q3",
        "branch",
        "frequency",
        "uncertainty",
    ]
    assert len(rows) == 12
    point_paths = finding.document(False)["point_paths"]
    assert [len(point_path["special_points"]) for point_path in point_paths] == [3, 3, 3, 3]
    flat = [special["parameter"] for point_path in point_paths for special in point_path["special_points"]]
    assert flat == [row[6] for row in rows]
    json.dumps(finding.document(True), allow_nan=False)
    export_csv(result, {name: tmp_path / f"{name}.csv" for name in finding.tables()})
    points = (tmp_path / "points.csv").read_text().splitlines()
    assert len(points) == 1 + sum(len(branch.points) for branch in finding.record.branches)
    header, *rows = finding.tables()["connections"]()
    assert rows == []  # all just go on


def test_all_keys_are_read() -> None:
    text = MODEL.replace(OVER, "max_period = 2\nkinds = ['flip', 'fold', 'flip']\nexact = false\n" + OVER)
    options = study_of(text).options
    assert isinstance(options, FamilyStudy)
    given = options.max_period, options.kinds, options.exact, options.workers
    assert given == (2, (gw.Kind.FLIP, gw.Kind.FOLD), False, 1)
    same = again(options, StudyKind)
    assert same == options
    assert hash(same) == hash(options)
    assert options.plan == (
        "family over frequency from 1.4 to 1.1 at 3 values of mean.q3 from 0.25 to 0.5, period 1, to period 2, showing "
        "half.q1"
    )


def test_names_that_move_together_may_be_written_with_or_without_quotes() -> None:
    over = '[study.over]\n"mean.q3" = [0.25, 0.5]\nstage2.force.q1 = [0.9, 0.8]\n'
    text = MODEL.replace(OVER, 'called = "load"\nvalues = [1, 2]').replace("workers = 1\n", "workers = 1\n" + over)
    options = study_of(text).options
    moved = (("mean.q3", (0.25, 0.5)), ("stage2.force.q1", (0.9, 0.8)))
    assert options.over == gw.studies.MemberParameter(moved, "load", (1.0, 2.0))
    system = study_of(text).system
    assert (system["mean.q3"], system["stage2.force.q1"], system.frequency) == (0.25, 0.9, 1.4)


@pytest.mark.parametrize(
    ("new", "path", "message"),
    [
        ("", "study.over", "is missing; write what differs from member to member, as in over = {"),
        ('over = { "mean.q9" = [1, 2] }', "study.over", "names 'mean.q9', but there is no parameter"),
        ('over = { "mean.q3" = 0.3 }', 'study.over."mean.q3"', "is 0.3; it must be a list"),
        ('over = { "mean.q3" = [0.3, "x"] }', 'study.over."mean.q3"[1]', 'is "x"; it must be a number'),
        ('over = { "mean.q3" = [0.3] }', "study.over", "a family needs at least two"),
        ('over = { "mean.q3" = [0.3, 0.2, 0.3] }', "study.over", "they must rise, or fall"),
        ('over = { "mean.q3" = [0.3, 0.4], "mean.q1" = [1] }', "study.over", "each member needs one of each"),
        ("over = { frequency = [0.3, 0.4] }", "study.over", "has frequency, along which each member is walked"),
        ("over = { stage2.clearance = [0.3, -1] }", "study.over", "is refused at stage2.clearance = -1"),
        ('called = "Kb"\nover = { "mean.q3" = [0.3, 0.4] }', "study.over", "called and values belong together"),
        (OVER + "\nkinds = ['folds']", "study.kinds[0]", "did you mean fold?"),
        (OVER + "\nmax_period = 0", "study.max_period", "is 0; it must be >= 1"),
        (OVER + '\nset = { "mean.q3" = 0.3 }', 'study.set."mean.q3"', "it has a value for each member in over"),
        (OVER + "\nsections = 5", "study.sections", "is not a key here"),
    ],
)
def test_a_wrong_family_has_one_problem(new, path, message) -> None:
    ((found, text),) = problems_of(MODEL.replace(OVER, new))
    assert found == path
    assert message in text


def test_what_the_family_varies_is_not_set_from_outside() -> None:
    ((_, text),) = problems_of(MODEL, {"mean.q3": 0.4})
    assert text == "mean.q3 cannot be set: study.over gives it a value for each member; change those in the file"
    study = check_study(parse_source(MODEL), {"mean.q1": 0.3, "study.over": {"mean.q3": [0.2, 0.3]}})
    assert study.system["mean.q1"] == 0.3
    assert study.options.over.axis == (0.2, 0.3)


def test_a_family_over_the_frequency_needs_none_in_the_file() -> None:
    text = MODEL.replace('"frequency"', '"harmonic1.amplitude"').replace(OVER, "over = { frequency = [1.2, 1.3] }")
    study = study_of(text.replace("from = 1.4", "from = 0.1").replace("to = 1.1", "to = 0.3"))
    assert study.system.frequency == 1.2


@pytest.mark.slow
def test_members_on_which_nothing_happens_are_read_again(tmp_path) -> None:
    text = MODEL.replace("to = 1.1", "to = 1.39")
    result = gw.run(study_of(text), tmp_path / "r.gapwalk")
    assert result.finding is not None
    assert [len(branch.special_points) for branch in result.finding.record.branches] == [0, 0, 0]
    expected = gw.family(clutch(), "frequency", (1.4, 1.39), LOADS, workers=1)
    for found in (result, gw.open_result(tmp_path / "r.gapwalk")):
        assert found.finding is not None
        assert_same_family(found.finding.record, expected)
    assert gw.verify(tmp_path / "r.gapwalk").ok


def test_no_member_at_all_is_a_failure_and_no_picture(tmp_path) -> None:
    text = MODEL.replace("stiffness = [[0.1", "stiffness = [[-1e6")
    assert text != MODEL
    result = gw.run(study_of(text), tmp_path / "r.gapwalk")
    assert result.complete
    assert len(result.failures) == 3
    assert result.finding is not None
    assert not result.finding.can_be_drawn

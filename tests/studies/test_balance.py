"""Harmonic balance in studies: read, walked, stored and resumed as shooting is, and told apart from it."""

import csv
import os
import random
import signal
from dataclasses import replace

import pytest

import gapwalk as gw
from gapwalk.continuation import EndReason
from gapwalk.errors import NumericalError, StoreError
from gapwalk.model.model_source import parse_source
from gapwalk.model.problems import ModelFileError
from gapwalk.orbit.harmonic_balance import BalancedOrbit
from gapwalk.results.codec import plain
from gapwalk.studies import response_study as response
from gapwalk.studies.export import table_of
from gapwalk.studies.response_study import ResponseOptions
from gapwalk.studies.result import result_document
from gapwalk.studies.study_file import check_study
from gapwalk.studies.study_kind import StudyKind
from tests.interruption import until_ctrl_c
from tests.results.again import again
from tests.results.tampering import change_sealed
from tests.studies.balances import balanced, growing_study
from tests.studies.diagrams import clutch_diagram, clutch_loop, islands, islands_file
from tests.studies.killing import killed_after
from tests.studies.same import assert_same_result
from tests.studies.studies import stop_study
from tests.tiers import some_of

FILE = """
coordinates = ["x"]
stiffness = [1.0]
damping = [0.05]

[[contact]]
name = "stop"
deflection = { x = 1.0 }
clearance = 1.0
stiffness = 20.0

[[harmonic]]
amplitude = 0.2
acts_on = { x = 1.0 }
order = 3

[study]
kind = "response"
parameter = "frequency"
from = 0.7
to = 1.9
method = "harmonic-balance"
balance = { harmonics = 12, error = 1e-3, stability = "hill" }
"""


@pytest.fixture(scope="module")
def growing() -> gw.Result:
    return gw.run(growing_study())


def test_the_method_and_its_options_are_read() -> None:
    assert check_study(parse_source(FILE)).options.method == gw.Balance(12, 1e-3, "hill")
    bare = FILE.replace('balance = { harmonics = 12, error = 1e-3, stability = "hill" }', "")
    assert check_study(parse_source(bare)).options.method == gw.Balance()
    assert check_study(parse_source(bare.replace("harmonic-balance", "shooting"))).options.method == gw.Shooting()


def test_one_word_changes_the_method() -> None:
    text = FILE + "shooting = { segments = 2 }\n"
    assert check_study(parse_source(text)).options.method == gw.Balance(12, 1e-3, "hill")
    changed = check_study(parse_source(text), {"study.method": "shooting"})
    assert changed.options.method == gw.Shooting(segments=2)


@pytest.mark.parametrize(
    ("old", "new", "path", "message"),
    [
        ('"harmonic-balance"', '"balance"', "study.method", "did you mean harmonic-balance?"),
        ("harmonics = 12", "harmonics = 2", "study.balance.harmonics", "is 2, but the excitation has order 3"),
        ("harmonics = 12", "harmonics = 0", "study.balance.harmonics", "is 0; it must be >= 1"),
        ("harmonics = 12", "harmonix = 12", "study.balance.harmonix", "did you mean"),
        ("error = 1e-3", "error = 3.0", "study.balance.error", "is 3.0; it must be <= 1"),
        ('"hill"', '"floquet"', "study.balance.stability", 'it must be one of "variational", "hill"'),
    ],
)
def test_what_is_wrong_with_the_method_is_told(old, new, path, message) -> None:
    with pytest.raises(ModelFileError) as caught:
        check_study(parse_source(FILE.replace(old, new)))
    (problem,) = caught.value.problems
    assert problem.path.startswith(path)
    assert message in problem.message


def test_a_system_without_contacts_is_refused_before_it_runs() -> None:
    text = FILE[: FILE.index("[[contact]]")] + FILE[FILE.index("[[harmonic]]") :]
    with pytest.raises(ModelFileError, match=r'there is no contact; write "shooting"'):
        check_study(parse_source(text))


def test_options_survive_the_file() -> None:
    options = growing_study().options
    assert again(options, StudyKind) == options
    assert again(stop_study().options, StudyKind) == stop_study().options


def test_a_balanced_response_is_that_of_shooting_to_the_truncation(growing) -> None:
    comparison = gw.studies.compare_results(gw.run(stop_study(end=1.3)), growing)
    assert comparison.within(1e-3)
    assert comparison.largest_shift < 1e-5
    assert comparison.pairs[0].shifts


def test_what_is_loaded_is_what_was_walked(growing, tmp_path) -> None:
    path = tmp_path / "result.gapwalk"
    assert_same_result(gw.run(growing_study(), path), growing)
    loaded = gw.open_result(path)
    assert_same_result(loaded, growing)
    harmonics = [point.orbit.harmonics for point in loaded.branches[0].points]
    assert len(set(harmonics)) > 2
    assert harmonics == sorted(harmonics)
    point = loaded.branches[0].points[-1]
    assert point.orbit.motion().q == pytest.approx(growing.branches[0].points[-1].orbit.motion().q, abs=0.0)


@pytest.mark.slow
def test_it_is_resumed_wherever_the_number_of_harmonics_has_grown(growing, tmp_path, monkeypatch) -> None:
    """The walk goes on from two points, one of which may be from before the refinement."""
    monkeypatch.setattr(response, "_SECONDS", 0.0)
    sizes = [len(point.x) for point in growing.branches[0].points]
    grown = [index for index in range(1, len(sizes)) if sizes[index] > sizes[index - 1]]
    assert len(grown) > 1
    for stop in sorted({*grown, *(index + 1 for index in grown)}):
        path = tmp_path / f"{stop}.gapwalk"
        count = 0

        def report(point, special_points, stop=stop) -> None:
            nonlocal count
            count += 1
            if count == stop:
                os.kill(os.getpid(), signal.SIGINT)

        part = until_ctrl_c(gw.run, growing_study(), path, report=report)
        assert part.branches[0].ends[-1].reason is EndReason.INTERRUPTED
        assert_same_result(gw.run(growing_study(), path, resume=True), growing)


@pytest.mark.slow
def test_a_run_that_is_killed_comes_to_the_same_result(growing, tmp_path) -> None:
    path, reported, kills = tmp_path / "result.gapwalk", 0, 0
    random.seed(5)
    while True:
        code = f"from tests.studies.balances import main; main({str(path)!r})"
        lines = killed_after(reported + random.randint(2, 60), code, longest_wait=0.01)
        if "complete" in lines:
            break
        kills += 1
        known = len(gw.open_result(path).branches[0].points)
        reported = max((int(line) for line in lines), default=0)
        assert known > reported
    assert kills >= 1
    assert_same_result(gw.open_result(path), growing)


def test_tables_and_json_tell_harmonics_and_truncation(growing) -> None:
    for text, points in (
        (table_of(growing, "points"), [point.orbit for point in growing.branches[0].points]),
        (table_of(growing, "special-points"), [special.orbit for special in growing.branches[0].special_points]),
    ):
        rows = list(csv.DictReader(text.splitlines()))
        assert [int(row["harmonics"]) for row in rows] == [orbit.harmonics for orbit in points]
        assert [float(row["truncation"]) for row in rows] == [orbit.truncation for orbit in points]
    document = result_document(growing)
    assert document["method"] == {"name": "harmonic-balance", **plain(growing.options)["method"]}
    assert document["branches"][0]["points"][-1]["harmonics"] == growing.branches[0].points[-1].orbit.harmonics
    shot = result_document(gw.run(stop_study(end=0.72)))
    assert shot["method"]["name"] == "shooting"
    assert "harmonics" not in shot["branches"][0]["points"][0]
    assert "harmonics" not in table_of(gw.run(stop_study(end=0.72)), "points")


def test_a_stop_too_stiff_for_the_harmonics_ends_with_what_to_change(tmp_path) -> None:
    path = tmp_path / "result.gapwalk"
    stiff = balanced(stop_study(**{"stop.stiffness": 1e3}), gw.Balance(15, error=1e-3))
    result = gw.run(stiff, path)
    end = result.branches[0].ends[-1]
    assert end.reason is EndReason.COARSE
    assert "take harmonics = 30 or more, or leave harmonics out" in str(end)
    assert result.failures == (str(end),)
    assert all(point.orbit.truncation <= 1e-3 for point in result.branches[0].points)
    assert_same_result(gw.open_result(path), result)
    exact = gw.run(stop_study(**{"stop.stiffness": 1e3}, end=result.branches[0].values[-1]))
    comparison = gw.studies.compare_results(exact, result)
    assert comparison.within(1e-2)  # beside a hard contact small errors of the force grow: 9e-3 of this short range
    assert comparison.largest_shift < 1e-6


def test_a_stop_too_stiff_for_harmonics_is_named() -> None:
    """Beside its grazing point this branch turns by a right angle within less than the smallest step."""
    study = stop_study(**{"stop.stiffness": 1e6})
    (end,) = (
        gw.run(replace(study, options=replace(study.options, method=gw.Balance(15, error=1e-3)))).branches[0].ends[1:]
    )
    assert end.reason is EndReason.STEP
    assert "stop + grazes, and the branch turns there too sharply to be followed: begin beyond it, or with a" in str(
        end
    )


def test_a_start_that_needs_more_harmonics_is_refused() -> None:
    study = balanced(stop_study(), gw.Balance(4, error=1e-6))
    inside = replace(study, system=study.system.at(frequency=1.0), options=replace(study.options, begin=1.0))
    with pytest.raises(NumericalError, match=r"beyond H = 4 amount to .* take harmonics = 8 or more"):
        gw.run(inside)


@pytest.fixture(scope="module")
def shot_diagram() -> gw.Result:
    return clutch_loop()


@pytest.mark.slow
def test_a_diagram_has_the_same_tree_by_both_methods(shot_diagram) -> None:
    result = gw.run(balanced(clutch_diagram(), gw.Balance(20, error=1e-2)))
    assert [(member.name, member.begins, member.joins) for member in result.diagram.members] == [
        (member.name, member.begins, member.joins) for member in shot_diagram.diagram.members
    ]
    assert result.failures == ()
    comparison = gw.studies.compare_results(shot_diagram, result)
    assert [pair.names for pair in comparison.pairs] == [(name, name) for name in shot_diagram.names]
    assert comparison.within(1e-3)
    assert comparison.largest_shift < 1e-4


@pytest.mark.slow
def test_the_smallest_loop_is_found_with_few_harmonics(shot_diagram) -> None:
    """Two flips 2.6e-4 apart: their multipliers and the truncated equation have them at places 1e-5 apart."""
    result = gw.run(balanced(clutch_diagram(), gw.Balance(error=1e-3)))
    assert result.names == shot_diagram.names
    loop = result.diagram["P4-1"]
    assert loop.begins.parent == loop.joins.parent == "P2-1"
    assert max(point.orbit.harmonics for branch in result.branches for point in branch.points) <= 15


@pytest.mark.slow
def test_a_diagram_that_is_interrupted_comes_to_the_same_result(tmp_path) -> None:
    study, path = balanced(clutch_diagram(), gw.Balance(error=1e-3)), tmp_path / "loop.gapwalk"

    def report(diagram, member) -> None:
        if member.name == "P2-1":
            raise KeyboardInterrupt

    assert not until_ctrl_c(gw.run, study, path, report=report).complete
    assert_same_result(gw.run(study, path, resume=True), gw.run(study))
    assert all(isinstance(point.orbit, BalancedOrbit) for b in gw.open_result(path).branches for point in b.points)


@pytest.fixture
def shot(tmp_path) -> gw.Result:
    """The islands by shooting."""
    path = tmp_path / "shot.gapwalk"
    path.write_bytes(islands_file())
    return gw.open_result(path)


@pytest.mark.slow
def test_a_search_leads_to_balanced_branches_each_of_them_once(tmp_path, shot) -> None:
    study, path = balanced(islands(), gw.Balance(error=3e-3)), tmp_path / "islands.gapwalk"
    result = gw.run(study, path)
    assert sorted(member.period for member in result.diagram.members) == sorted(
        member.period for member in shot.diagram.members
    )
    assert [(found.value, found.orbit.period, found.is_new) for found in result.diagram.search.found] == [
        (found.value, found.orbit.period, found.is_new) for found in shot.diagram.search.found
    ]
    assert_same_result(gw.open_result(path), result)


@pytest.mark.slow
@pytest.mark.parametrize("figure", some_of(["9a", "9b"], "9a"))
def test_figure_9_is_the_same_by_both_methods(figure) -> None:
    """What the paper validates its method with: the whole range, all special points."""
    system = gw.paper.case(figure, slope="reduced").at(frequency=2.0)
    options = ResponseOptions("frequency", 2.0, 0.15, "half.q1")
    shot = gw.run(gw.Study(system, options))
    comparison = gw.studies.compare_results(
        shot, gw.run(gw.Study(system, replace(options, method=gw.Balance(error=1e-3))))
    )
    (pair,) = comparison.pairs
    assert len(pair.shifts) == len(shot.branches[0].special_points) > 10
    assert comparison.within(1e-3)
    assert comparison.largest_shift < 5e-5


def test_loci_by_shooting_may_begin_at_a_balanced_point() -> None:
    branch = gw.run(balanced(stop_study(), gw.Balance(20, error=1e-2))).branches[0]
    fold = branch.special(gw.Kind.FOLD)[0]
    ranges = ((0.7, 1.9), (0.9, 1.1))
    locus = gw.follow_locus(fold, "frequency", "stop.clearance", ranges)
    exact = gw.run(stop_study()).branches[0].special(gw.Kind.FOLD)[0]
    same = gw.follow_locus(exact, "frequency", "stop.clearance", ranges)
    assert locus.points[0].values == pytest.approx(same.points[0].values, abs=1e-8)


def test_a_map_is_balanced_by_one_word() -> None:
    second = 'second = { parameter = "mean.x", from = 0, to = 0.1 }\n'
    study = check_study(parse_source(FILE.replace('"response"', '"map"') + second))
    assert study.options.kind == "map"
    assert study.options.method == gw.Balance(12, 1e-3, "hill")


def test_a_damaged_balanced_result_is_named(growing, tmp_path) -> None:
    path = tmp_path / "result.gapwalk"
    gw.run(growing_study(), path)
    content, lines = path.read_bytes(), growing.branches[0].points[0].orbit.series.lines.shape[1]
    right = f"[1,1,{lines}]"  # the shape of the lines of the first orbit
    for wrong in (f"[1,1,{lines - 1}]", f"[1,1,{lines + 1}]", "[1,1,0]", "[1,1,0.5]", "[1,1,1e300]", "[1,1]"):
        path.write_bytes(content)
        change_sealed(path, f"UPDATE part SET head = replace(head, '{right}', '{wrong}') WHERE name = 'start'")
        assert path.read_bytes() != content
        with pytest.raises(StoreError, match=r"result\.gapwalk is damaged: "):
            gw.open_result(path)
    path.write_bytes(content)
    assert_same_result(gw.open_result(path), growing)


def test_a_study_of_many_unknowns_takes_shooting_and_says_so(tmp_path) -> None:
    many = FILE.replace("to = 1.9", "to = 0.71").replace("harmonics = 12", "harmonics = 400")
    shot, balanced = (check_study(parse_source(many.replace("400", text))) for text in ("400", "400, only = true"))
    assert shot.walked.method.suited_to(shot.system) == gw.Shooting()
    assert balanced.walked.method.suited_to(balanced.system) is balanced.walked.method
    gw.run(shot, tmp_path / "many.gapwalk")
    result = gw.open_result(tmp_path / "many.gapwalk")
    assert all(point.orbit.is_exact for point in result.branches[0].points)
    said = [line for line in result.summary() if "by shooting, in place of harmonic balance" in line]
    assert len(said) == 1
    assert "only = true" in said[0]

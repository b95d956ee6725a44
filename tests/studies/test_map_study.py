"""Maps as studies: stored section by section and locus by locus, the same however often they are interrupted."""

import random
import signal
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.bifurcation.loci import LocusEndReason
from gapwalk.errors import Interrupted, ModelError, NumericalError, StoreError
from gapwalk.results.result_file import ResultFile
from gapwalk.studies import map_study as charting
from tests.interruption import until_ctrl_c
from tests.results.tampering import change_sealed
from tests.studies.killing import killed_after
from tests.studies.maps import clutch_map, resonance
from tests.studies.same import assert_same_branch, assert_same_map, assert_same_result

pytestmark = pytest.mark.usefixtures("kept_processes")


@pytest.fixture
def path(tmp_path) -> Path:
    return tmp_path / "resonance.gapwalk"


@pytest.fixture(scope="module")
def undisturbed() -> gw.Result:
    return resonance()


def test_a_study_is_the_map_of_its_system(undisturbed) -> None:
    study = clutch_map()
    plane = {"frequency": (1.1, 1.4), "mean.q1": (0.2, 0.3)}
    found = gw.bifurcation_map(study.system, plane, sections=2, max_period=1, workers=1)
    assert undisturbed.complete
    assert_same_map(found, undisturbed.map)
    assert undisturbed.map.names == ("flip-1", "fold-1", "flip-2", "grazing-1", "grazing-2")
    assert undisturbed.map["flip-2"] is undisturbed.map.loci[2]
    assert undisturbed.names == ("S1-P1-1", "S2-P1-1")
    assert undisturbed.branches == undisturbed.map.branches
    with pytest.raises(KeyError, match="no locus flip-3; there are flip-1, fold-1"):
        undisturbed.map["flip-3"]


def test_loci_pass_through_the_special_points_of_another_section(undisturbed) -> None:
    """A branch at a load on which no section lies: its flips and grazing points are those of the map there."""
    load = 0.2618
    system = clutch_map().system.at({"mean.q1": load})
    branch = gw.follow(gw.find_orbit(system), "frequency", to=1.1)
    for kind in ("flip", "grazing"):
        crossings = np.concatenate([crossing(locus, load) for locus in undisturbed.map.of_kind(kind)])
        values = [special.value for special in branch.special(kind)]
        assert len(values) == 2
        assert sorted(crossings) == pytest.approx(sorted(values), abs=2e-5)  # the error of straight interpolation


def crossing(locus, load: float) -> np.ndarray:
    a, b = locus.values[:-1], locus.values[1:]
    hit = (a[:, 1] - load) * (b[:, 1] - load) < 0
    share = (load - a[hit, 1]) / (b[hit, 1] - a[hit, 1])
    return a[hit, 0] + share * (b[hit, 0] - a[hit, 0])


@pytest.mark.slow
def test_what_was_reported_is_in_the_file(path) -> None:
    def report(chart, addition) -> None:
        stored = gw.open_result(path).map
        assert not stored.complete
        assert stored.tried == chart.tried
        if chart.loci:
            assert len(stored.loci) == len(chart.loci)
            assert np.array_equal(stored.loci[-1].values, addition.values)
        else:
            assert_same_branch(stored.sections[-1].branches[0], addition.branches[0])

    gw.run(clutch_map(), path, report=report)


def test_the_number_of_workers_changes_nothing(path, undisturbed) -> None:
    assert_same_result(gw.run(clutch_map(workers=2), path), undisturbed)
    assert_same_result(gw.run(clutch_map(workers=1), path, resume=True), undisturbed)


@pytest.mark.parametrize("count", [1, 4])
def test_ctrl_c_just_before_a_part_is_written_keeps_it(path, count, monkeypatch, undisturbed) -> None:
    write, calls = ResultFile.write, []

    def interrupted(file, *entries) -> None:
        calls.append(entries)
        if len(calls) == count:
            monkeypatch.undo()
            signal.raise_signal(signal.SIGINT)
        write(file, *entries)

    monkeypatch.setattr(ResultFile, "write", interrupted)
    stopped = until_ctrl_c(gw.run, clutch_map(), path)
    assert len(stopped.map.sections) + len(stopped.map.loci) == count
    assert_same_result(stopped, gw.open_result(path))
    reported = []
    resumed = gw.run(clutch_map(), path, resume=True, report=lambda _, new: reported.append(type(new).__name__))
    assert_same_result(resumed, undisturbed)
    assert reported == ["MapSection"] * 2 + ["Locus"] * 5


@pytest.mark.slow
def test_ctrl_c_in_a_section_leaves_out_that_section(path, monkeypatch, undisturbed) -> None:
    """The branches of half a section would begin other loci than those of the whole."""
    diagram, calls = charting.diagram_from, []

    def interrupted(*arguments, **options):
        calls.append(arguments)
        found = diagram(*arguments, **options)
        if len(calls) == 2:
            raise Interrupted(found)
        return found

    with monkeypatch.context() as patch:
        patch.setattr(charting, "diagram_from", interrupted)
        stopped = until_ctrl_c(gw.run, clutch_map(), path)
    assert [section.value for section in stopped.map.sections] == [0.2]
    assert not stopped.map.loci
    assert_same_result(gw.run(clutch_map(), path, resume=True), undisturbed)


def test_ctrl_c_before_the_first_section_leaves_nothing(path, monkeypatch) -> None:
    def interrupt(*_) -> None:
        signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr(charting, "_follow_section", interrupt)
    with pytest.raises(KeyboardInterrupt):
        gw.run(clutch_map(), path)
    assert not list(path.parent.iterdir())


@pytest.mark.slow
@pytest.mark.parametrize(("workers", "aims"), [(1, [2, 5]), (2, [4])])
def test_a_run_that_is_killed_at_any_moment_loses_nothing_it_reported(path, workers, aims, undisturbed) -> None:
    random.seed(27 + workers)
    for aim in [*aims, 100]:
        code = f"from tests.studies.maps import main; main({str(path)!r}, '{workers}')"
        lines = killed_after(aim, code, longest_wait=0.2)
        stored = gw.open_result(path).map
        reported = [tuple(map(int, line.split())) for line in lines if line != "complete"]
        assert (len(stored.sections), len(stored.loci)) >= reported[-1]
    assert lines[-1] == "complete"
    assert_same_result(replace(gw.open_result(path), study=undisturbed.study), undisturbed)


@pytest.mark.slow
def test_what_cannot_be_followed_is_a_failure(path, monkeypatch, undisturbed) -> None:
    follow = charting.follow_locus

    def fail(special, *arguments, **options):
        if special.kind == "fold":
            raise NumericalError("no way")
        return follow(special, *arguments, **options)

    monkeypatch.setattr(charting, "follow_locus", fail)

    def report(chart, addition) -> None:
        if len(chart.loci) == 2:  # beyond the folds
            signal.raise_signal(signal.SIGINT)

    assert len(until_ctrl_c(gw.run, clutch_map(), path, report=report).failures) == 2
    result = gw.run(clutch_map(), path, resume=True)
    assert result.complete
    assert [locus.kind for locus in result.map.loci] == ["flip", "flip", "grazing", "grazing"]
    assert len(result.failures) == 2  # each once, though it was resumed
    assert all("fold at frequency = 1.21" in text for text in result.failures)
    assert all(text.endswith("could not be followed: no way") for text in result.failures)
    assert_same_result(result, gw.open_result(path))


@pytest.mark.slow
def test_a_section_without_a_first_orbit_is_a_failure(monkeypatch) -> None:
    find = charting.find_orbit

    def fail(system, *arguments, **options):
        if system["mean.q1"] < 0.25:
            raise NumericalError("nothing there")
        return find(system, *arguments, **options)

    monkeypatch.setattr(charting, "find_orbit", fail)
    result = gw.run(clutch_map())
    assert result.complete
    assert [len(section.branches) for section in result.map.sections] == [0, 1]
    assert result.failures == ("at mean.q1 = 0.2 no branch could be followed: nothing there",)
    assert result.map.loci
    monkeypatch.setattr(charting, "find_orbit", lambda *_, **__: fail({"mean.q1": 0.0}))
    with pytest.raises(NumericalError, match="nothing there"):
        gw.run(clutch_map())


def test_a_locus_at_whose_end_the_numerics_gave_up_is_a_failure(undisturbed) -> None:
    loci = list(undisturbed.map.loci)
    gave_up = replace(loci[1].ends[1], reason=LocusEndReason.STEP)
    loci[1] = replace(loci[1], ends=(loci[1].ends[0], gave_up))
    result = replace(undisturbed, map=replace(undisturbed.map, loci=tuple(loci)))
    assert result.failures == (f"fold-1: {gave_up}",)
    assert undisturbed.failures == ()


def test_a_special_point_just_beyond_the_edge_begins_no_locus(monkeypatch, undisturbed) -> None:
    follow = charting._follow_section

    def bulging(*cut):
        (branch,), notes, failures = follow(*cut)
        first, *others = branch.special_points
        beyond = replace(first, point=replace(first.point, value=1.4 + 1e-9))
        crossing = replace(first, kind=gw.Kind.BRANCH_POINT)
        return (replace(branch, special_points=(beyond, crossing, *others)),), notes, failures

    first = undisturbed.branches[0].special_points[0]
    assert (first.kind, undisturbed.map.names[0]) == (gw.Kind.FLIP, "flip-1")
    monkeypatch.setattr(charting, "_follow_section", bulging)
    result = gw.run(clutch_map(sections=(0.2,)))
    assert result.complete
    assert not result.failures
    assert "flip-2" not in result.map.names
    assert result.map.notes == ("no loci of the kind branch-point: the sections list these points",)


@pytest.mark.slow
def test_sections_may_stand_anywhere_and_be_searched(undisturbed) -> None:
    search = gw.SearchOptions(starts=2, newton_starts=0, patience=64)
    result = gw.run(clutch_map(sections=(0.27, 0.21), kinds=(gw.Kind.FLIP,), search_values=(1.3,), search=search))
    assert [section.value for section in result.map.sections] == [0.27, 0.21]
    assert {locus.kind for locus in result.map.loci} == {gw.Kind.FLIP}
    assert any(note.startswith("at mean.q1 = 0.27: 2 starts at frequency = 1.3") for note in result.map.notes)
    for one, other in zip(result.map.loci, undisturbed.map.of_kind("flip"), strict=True):
        ends, expected = (np.sort(each.values[[0, -1]], axis=0) for each in (one, other))
        assert ends == pytest.approx(expected, abs=1e-9)


@pytest.fixture(scope="module")
def flips(tmp_path_factory) -> bytes:
    """The file of the map with its flips only."""
    path = tmp_path_factory.mktemp("flips") / "x.gapwalk"
    gw.run(clutch_map(kinds=(gw.Kind.FLIP,)), path)
    return path.read_bytes()


@pytest.mark.slow
def test_a_result_of_another_plane_is_not_resumed(path, flips) -> None:
    path.write_bytes(flips)
    with pytest.raises(StoreError, match="kinds is"):
        gw.run(clutch_map(), path, resume=True)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ("DELETE FROM part WHERE name = 'locus' AND number = 1", "a section or a locus is missing"),
        ("DELETE FROM part WHERE name = 'section' AND number = 1", "a section or a locus is missing"),
        ("UPDATE part SET arrays = zeroblob(8) WHERE name = 'locus'", "its bytes are missing"),
        ("UPDATE part SET head = replace(head, '\"ends\":[', '\"ends\":[0,') WHERE name = 'locus'", "Locus.ends"),
        (
            "UPDATE part SET head = replace(head, '\"period\":1,', '\"period\":3,') WHERE name = 'locus'",
            "another period",
        ),
        ("UPDATE part SET name = 'loci' WHERE name = 'locus'", "a section or a locus is missing"),
        ("UPDATE part SET head = replace(head, '\"frequency\"', '\"mean.x\"') WHERE name = 'map'", "does not belong"),
    ],
)
def test_a_damaged_file_is_named(path, change, message, flips) -> None:
    path.write_bytes(flips)
    change_sealed(path, change)
    with pytest.raises(StoreError, match=rf"resonance\.gapwalk is damaged: .*{message}"):
        gw.open_result(path)


def test_bad_requests_are_refused() -> None:
    with pytest.raises(ModelError, match=r"a section is requested at 0\.7, outside the range from 0\.2 to 0\.3"):
        gw.run(clutch_map(sections=(0.7,)))
    with pytest.raises(ModelError, match="list each value only once"):
        clutch_map(sections=(0.2, 0.2))
    with pytest.raises(ModelError, match="an integer from 1 to 100,000, or values of the second parameter"):
        clutch_map(sections=())

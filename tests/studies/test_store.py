"""Result files: nothing lost whatever happens to the run, equal bit for bit, and clear words for what is wrong."""

import itertools
import os
import random
import signal
import sqlite3
from pathlib import Path

import pytest

import gapwalk as gw
from gapwalk.continuation import EndReason
from gapwalk.errors import ModelError, StoreError
from gapwalk.flow import Flow
from gapwalk.results.result_file import APPLICATION, SCHEMA, lock, reading
from gapwalk.studies import response_study as response
from gapwalk.studies.response_study import ResponseOptions
from tests.interruption import until_ctrl_c
from tests.results.tampering import change, change_sealed
from tests.studies.killing import killed_after
from tests.studies.same import assert_same_branch, assert_same_orbit, assert_same_point, assert_same_result
from tests.studies.studies import long_result, long_study, stop_study
from tests.tiers import in_campaign, keeps


@pytest.fixture
def path(tmp_path) -> Path:
    return tmp_path / "stop.gapwalk"


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory) -> tuple[gw.Result, bytes]:
    """The result that nothing interrupts, and its file."""
    path = tmp_path_factory.mktemp("undisturbed") / "stop.gapwalk"
    return gw.run(stop_study(), path), path.read_bytes()


@pytest.fixture
def written(path, undisturbed) -> Path:
    path.write_bytes(undisturbed[1])
    return path


@pytest.fixture
def at_once(monkeypatch) -> None:
    """Write every point by itself."""
    monkeypatch.setattr(response, "_SECONDS", 0.0)


def test_what_is_loaded_is_what_was_found(path) -> None:
    study = stop_study()
    returned = gw.run(study, path)
    orbit = gw.find_orbit(study.system)
    followed = gw.follow(orbit, "frequency", to=study.options.end, walk=study.options.walk)
    loaded = gw.open_result(path)
    assert loaded.complete
    assert loaded.title == "A stop"
    assert set(loaded.versions) == {"gapwalk", "llvmlite", "numba", "numpy", "python"}
    assert_same_result(returned, loaded)
    assert_same_branch(followed, loaded.branches[0])
    with reading(path) as parts:
        parts.base = study.system
        assert_same_orbit(orbit, parts.one(response.START))
    assert {special.kind for special in loaded.branches[0].special_points} == {gw.Kind.FOLD, gw.Kind.GRAZING}


def test_a_system_of_all_kinds_of_parts_survives(path) -> None:
    contacts = [
        gw.Contact(
            "gear",
            {"a": 1.0, "b": -1.0},
            (gw.Stage(0.1, 1.0, name="soft"), gw.Stage(0.3, 4.0, 0.5, gw.Side.NEGATIVE, "hard")),
            {"a": 0.3, "b": -0.7},
        ),
        gw.Contact("end", {"b": 1.0}, (gw.Stage(5.0, 3.0),), None, "viscous", {"viscous_damping": 0.2}),
    ]
    system = gw.System(
        ["a", "b"],
        [[1.0, -0.1], [-0.1, 2.0 / 3.0]],
        [[0.3, 0.0], [0.0, 0.1]],
        [[1.0, 0.1], [0.1, 2.0]],
        contacts,
        {"b": -0.05},
        [gw.Harmonic(0.1, {"a": 1.0}), gw.Harmonic(0.02, {"b": 1.0}, 3, 0.4, "third")],
        0.8,
    )
    start = (0.1, 0.0, 0.0, 1e-3)
    options = ResponseOptions(
        "gear.soft.clearance", 0.1, 0.2, "max.b", 1, start, gw.WalkOptions(max_points=5), gw.Shooting(segments=2)
    )
    study = gw.Study(system, options, "ü \x1b[31m", "", (("study.to", 0.2), ("study.start", [0.1, 0.0, 0.0, 1e-3])))
    result = gw.run(study, path)
    assert_same_result(result, gw.open_result(path))
    assert gw.open_result(path).branches[0].ends[-1].detail == "max_points = 5"


def test_a_picture_of_a_loaded_result_needs_no_integration(written) -> None:
    branch = gw.open_result(written).branches[0]
    before = Flow.calls
    branch.measure("half.x")
    branch.measure("rms.x")
    assert Flow.calls == before


def test_one_file_remains(written) -> None:
    assert os.listdir(written.parent) == [written.name]
    with sqlite3.connect(written) as connection:
        assert connection.execute("PRAGMA journal_mode").fetchone() == ("delete",)
        assert connection.execute("PRAGMA integrity_check").fetchone() == ("ok",)
        assert connection.execute("PRAGMA application_id").fetchone() == (APPLICATION,)
    connection.close()


@pytest.mark.usefixtures("at_once")
def test_what_was_reported_is_in_the_file_even_while_it_is_written(path) -> None:
    reported = 0
    seen = []

    def report(point, special_points) -> None:
        nonlocal reported
        reported += 1
        if reported % 20 == 0:
            branch = gw.open_result(path).branches[0]
            seen.append(len(branch.points) >= reported)
            assert_same_point(branch.points[reported - 1], point)

    gw.run(stop_study(), path, report=report)
    assert seen
    assert all(seen)


@keeps("1", "90")
@pytest.mark.usefixtures("at_once")
@pytest.mark.parametrize("after", [1, 2, 3, 50, 90, 91])
def test_an_interrupted_run_goes_on_as_if_never_stopped(path, after, undisturbed) -> None:
    study, count = stop_study(), 0

    def report(point, special_points) -> None:
        nonlocal count
        count += 1
        if count == after:
            signal.raise_signal(signal.SIGINT)

    stopped = until_ctrl_c(gw.run, study, path, report=report)
    assert not stopped.complete
    assert stopped.branches[0].ends[-1].reason is EndReason.INTERRUPTED
    assert len(stopped.branches[0].points) <= after + 2
    assert_same_result(stopped, gw.open_result(path))
    assert os.listdir(path.parent) == [path.name]
    reported = []
    resumed = gw.run(study, path, resume=True, report=lambda point, special_points: reported.append(point.value))
    assert_same_result(resumed, undisturbed[0])
    assert_same_result(resumed, gw.open_result(path))
    assert reported == resumed.branches[0].values.tolist()


@pytest.mark.usefixtures("at_once")
def test_a_walk_whose_variables_would_be_scaled_otherwise_today_does_not_go_on(path, monkeypatch) -> None:
    with monkeypatch.context() as earlier:
        earlier.setattr("gapwalk.continuation.corrector._CLEARANCES", 3.0)
        stop = iter([signal.SIGINT])
        until_ctrl_c(gw.run, stop_study(), path, report=lambda *_: [signal.raise_signal(each) for each in stop])
    content = path.read_bytes()
    with pytest.raises(StoreError, match="with other scales of variables"):
        gw.run(stop_study(), path, resume=True)
    assert path.read_bytes() == content


@pytest.mark.parametrize("kills", [1, in_campaign(3)])
def test_a_run_that_is_killed_at_any_moment_loses_nothing_it_reported(path, kills) -> None:
    """Killed in each of the first three quarters of its reports: it waits at the end of a quarter for a late kill."""
    random.seed(1995)
    whole, known = long_result().branches[0], 0
    count = len(whole.points)  # of reports
    program = f"from tests.studies.studies import main; main({str(path)!r}"
    for begin, end in itertools.pairwise(count * quarter // 4 for quarter in range(kills + 1)):
        lines = killed_after(random.randint(begin + 1, end), f"{program}, wait_at={end})", longest_wait=0.04)
        reported = int(lines[-1])
        assert reported <= end
        result = gw.open_result(path)
        points = result.branches[0].points
        assert not result.complete
        assert len(points) >= reported
        for a, b in zip(points[known:], whole.points[known:], strict=False):
            assert_same_point(a, b)
        known = len(points) - 1
    assert gw.run(long_study(), path, resume=True).complete
    assert_same_result(gw.open_result(path), long_result())
    assert os.listdir(path.parent) == [path.name]


@pytest.mark.usefixtures("at_once")
def test_an_exception_in_the_callers_report_leaves_a_result_to_resume(path, undisturbed) -> None:
    def report(point, special_points) -> None:
        raise RuntimeError("the screen is gone")

    with pytest.raises(RuntimeError, match="screen"):
        gw.run(stop_study(), path, report=report)
    assert not gw.open_result(path).complete
    assert_same_result(gw.run(stop_study(), path, resume=True), undisturbed[0])


def test_resume_begins_where_there_is_nothing_yet(path) -> None:
    assert gw.run(stop_study(), path, resume=True).complete


def test_an_existing_result_is_kept_unless_told_otherwise(written) -> None:
    content = written.read_bytes()
    with pytest.raises(StoreError, match=r"exists already; continue it \(--resume\), overwrite it \(--force\)"):
        gw.run(stop_study(end=1.8), written)
    with pytest.raises(StoreError, match="not both"):
        gw.run(stop_study(), written, resume=True, force=True)
    assert written.read_bytes() == content
    gw.run(stop_study(end=1.8), written, force=True)
    assert gw.open_result(written).branches[0].points[-1].value == 1.8


def test_a_new_run_that_finds_no_start_keeps_the_old_result(written) -> None:
    content = written.read_bytes()
    with pytest.raises(gw.errors.NumericalError):
        gw.run(stop_study(**{"stiffness.x.x": -1e3}), written, force=True)
    assert written.read_bytes() == content


def test_force_spares_what_is_no_result(tmp_path) -> None:
    model = tmp_path / "model.toml"
    model.write_text("title = 'precious'\n" * 20)
    with pytest.raises(StoreError, match="not overwritten"):
        gw.run(stop_study(), model, force=True)
    assert "precious" in model.read_text()


@pytest.mark.parametrize(
    ("study", "message"),
    [
        (stop_study(end=1.8), "end is 1.8, and was 1.9"),
        (stop_study(**{"stop.clearance": 1.5}), "stop.clearance is 1.5, and was 1"),
        (gw.Study(gw.System(["y"], [[1.0]]), stop_study().options), "other parts"),
    ],
)
def test_a_different_study_is_not_resumed(written, study, message) -> None:
    with pytest.raises(StoreError, match=message):
        gw.run(study, written, resume=True)


def test_two_runs_do_not_write_one_file(path) -> None:
    with lock(path), pytest.raises(StoreError, match="being written by another run"):
        gw.run(stop_study(), path)
    assert not path.exists()
    gw.run(stop_study(), path)


def test_a_killed_run_that_left_its_lock_is_no_obstacle(path) -> None:
    Path(f"{path}-lock").touch()
    gw.run(stop_study(), path)
    assert os.listdir(path.parent) == [path.name]


@pytest.mark.parametrize("text", ["", "x", "title = 'a model'\n" * 100])
def test_what_is_no_result_is_called_so(path, text) -> None:
    path.write_text(text)
    with pytest.raises(StoreError, match=r"stop.gapwalk is not a result file of gapwalk"):
        gw.open_result(path)


def test_another_database_is_no_result(path) -> None:
    connection = sqlite3.connect(path)
    connection.execute("CREATE TABLE result (x)")
    connection.commit()
    connection.close()
    with pytest.raises(StoreError, match="not a result file"):
        gw.open_result(path)


def test_a_file_that_is_not_there(tmp_path) -> None:
    with pytest.raises(StoreError, match="there is no file"):
        gw.open_result(tmp_path / "nothing.gapwalk")
    with pytest.raises(StoreError, match="is a folder"):
        gw.open_result(tmp_path)
    with pytest.raises(StoreError, match="there is no folder"):
        gw.run(stop_study(), tmp_path / "nowhere" / "x.gapwalk")
    with pytest.raises(ModelError, match="is a folder"):
        gw.run(stop_study(), tmp_path)


def test_a_folder_that_cannot_be_written(written) -> None:
    folder = written.parent
    folder.chmod(0o500)
    if os.access(folder, os.W_OK):
        folder.chmod(0o700)
        pytest.skip("this user may write everywhere")
    try:
        assert gw.open_result(written).complete
        with pytest.raises(StoreError, match="folder cannot be written"):
            gw.run(stop_study(), folder / "other.gapwalk")
    finally:
        folder.chmod(0o700)


def test_a_result_from_the_future(written) -> None:
    change(written, f"PRAGMA user_version = {SCHEMA + 1}")
    with pytest.raises(StoreError, match="written by a newer gapwalk"):
        gw.open_result(written)


@pytest.mark.parametrize("share", [0.02, 0.3, 0.6, 0.8])
def test_a_file_cut_short(written, share) -> None:
    content = written.read_bytes()
    written.write_bytes(content[: int(share * len(content))])
    with pytest.raises(StoreError, match="damaged"):
        gw.open_result(written)


def part(name: str, number: int = 0) -> str:
    return f"WHERE name = '{name}' AND number = {number}"


DAMAGES = [
    "DELETE FROM part WHERE name = 'moment'",
    f"DELETE FROM part {part('moment')}",
    "DELETE FROM part WHERE name = 'request'",
    "DELETE FROM part WHERE name = 'versions'",
    f"UPDATE part SET head = '[1, 2' {part('request')}",
    "UPDATE part SET head = 'null' WHERE name <> 'seal'",
    f"UPDATE part SET head = replace(head, '\"begin\":0.7', '\"begin\":1e999') {part('request')}",
    f'UPDATE part SET head = replace(head, \'"items":"x"\', \'"items":""\') {part("request")}',
    f'UPDATE part SET head = replace(head, \'"items":"x"\', \'"items":5\') {part("request")}',
    f'UPDATE part SET head = replace(head, \'"period":1\', \'"period":"1"\') {part("request")}',
    f"UPDATE part SET head = replace(head, '\"period\":1', '\"period\":true') {part('request')}",
    f"UPDATE part SET head = replace(head, '\"verify\":false', '\"verify\":0') {part('request')}",
    f"UPDATE part SET head = replace(head, '\"title\"', '\"tilte\"') {part('request')}",
    f'UPDATE part SET head = replace(head, \'"parameter":"frequency"\', \'"parameter":"mass.x.x"\') {part("request")}',
    f"UPDATE part SET arrays = zeroblob(80) {part('moment')}",
    f"UPDATE part SET arrays = CAST(arrays || x'00' AS BLOB) {part('moment')}",
    "UPDATE part SET number = number + 1000 WHERE name = 'moment'",
    "UPDATE part SET head = replace(head, 'fold', 'surprise') WHERE name = 'moment'",
    f"UPDATE part SET head = replace(head, '[1,2]', '[1,2000000000000]') {part('start')}",
    f"UPDATE part SET head = replace(head, '\"count\":', '\"count\":1000000000000') {part('moment')}",
    f"UPDATE part SET head = replace(head, '\"count\":', '\"count\":-1') {part('moment')}",
    "UPDATE part SET head = replace(head, 'RANGE', '?') WHERE name = 'moment'",
    "UPDATE part SET head = replace(head, '\"ends\":', '\"end\":') WHERE name = 'moment'",
]


@keeps(
    "statement6",
    "UPDATE part SET arrays = 'text' WHERE name = 'moment'",
    "DROP TABLE part",
    "CREATE TRIGGER evil AFTER UPDATE ON part BEGIN DELETE FROM part; END",
    "CREATE TABLE more (x)",
)
@pytest.mark.parametrize(
    "statement",
    [
        *DAMAGES,
        "UPDATE part SET checksum = '' WHERE name = 'moment'",
        "UPDATE part SET arrays = 'text' WHERE name = 'moment'",
        "DROP TABLE part",
        "CREATE TRIGGER evil AFTER UPDATE ON part BEGIN DELETE FROM part; END",
        "CREATE TABLE more (x)",
    ],
)
def test_a_damaged_result_is_called_so(written, statement) -> None:
    assert change(written, statement)
    with pytest.raises(StoreError, match="damaged"):
        gw.open_result(written)


@pytest.mark.parametrize("statement", DAMAGES)
def test_what_a_faulty_program_wrote_is_called_damaged_too(written, statement) -> None:
    """Its checksums hold: it is refused by what reads it."""
    change_sealed(written, statement)
    with pytest.raises(StoreError, match="damaged") as error:
        gw.open_result(written)
    assert "checksum" not in str(error.value)


def test_a_result_of_an_older_format_is_refused_in_a_sentence(written) -> None:
    change(written, "PRAGMA user_version = 3")
    content = written.read_bytes()
    for call in (lambda: gw.open_result(written), lambda: gw.run(stop_study(), written, resume=True)):
        with pytest.raises(StoreError, match=r"by an older gapwalk \(its schema is 3; .* compute the result again"):
            call()
    assert written.read_bytes() == content
    assert gw.run(stop_study(), written, force=True).complete


def test_whatever_bytes_are_wrong_there_is_a_clear_error_or_none(written) -> None:
    """Only bytes that mean nothing, such as free space, may go unnoticed."""
    random.seed(13)
    content = written.read_bytes()
    for _ in range(150):
        damaged = bytearray(content)
        for _ in range(random.choice((1, 20))):
            damaged[random.randrange(len(damaged))] ^= 1 << random.randrange(8)
        written.write_bytes(damaged)
        try:
            gw.open_result(written)
        except StoreError as error:
            message = str(error)
        else:
            message = written.name
        assert written.name in message


@pytest.mark.usefixtures("at_once")
def test_versions_that_differ_are_all_told(path, monkeypatch) -> None:
    def report(point, special_points) -> None:
        raise RuntimeError

    monkeypatch.setattr("gapwalk.results.result_file.__version__", "0.0.1")
    with pytest.raises(RuntimeError):
        gw.run(stop_study(), path, report=report)
    monkeypatch.setattr("gapwalk.results.result_file.__version__", "0.0.2")
    gw.run(stop_study(), path, resume=True)
    assert gw.open_result(path).versions["gapwalk"] == "0.0.1, 0.0.2"

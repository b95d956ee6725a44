"""The file format: what was reported is safe, what is damaged or strange is called so."""

import gc
import os
import signal
import sqlite3
import sys
from collections.abc import Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from typing import ClassVar

import pytest

import gapwalk as gw
from gapwalk.errors import StoreError
from gapwalk.results.result_file import SCHEMA, Part, Parts, ResultFile, lock, reading
from gapwalk.studies import study_kind as study_registry
from gapwalk.studies.result import REQUEST, VERSIONS, Call, NoFile, claimed, request_file
from gapwalk.studies.study_kind import StudyKind, Work
from tests.results.tampering import change, change_sealed
from tests.systems import clutch
from tests.tiers import in_campaign

NUMBERS = Part("numbers", tuple[float, ...], numbered=True)
STATE = Part("state", Mapping[str, int])


@dataclass(frozen=True)
class Sums(StudyKind):
    """Asks for the sum of all parts."""

    kind: ClassVar[str] = "sums"

    values: tuple[float, ...] = (1.0, 0.1)
    walk: gw.WalkOptions | None = None
    workers: int = field(default=1, compare=False)

    def work(self, system: gw.System) -> "Sum":
        return Sum()


class Sum(Work):
    """The sum of the parts of a file."""

    complete, record = True, 0.0

    def take(self, known: Parts) -> None:
        self.record = sum(sum(values) for _, values in known.all(NUMBERS))

    def parts(self, workers):
        yield from ()


@pytest.fixture(autouse=True)
def known_request(monkeypatch) -> None:
    monkeypatch.setitem(study_registry._KINDS, "sums", Sums)


def call(system: gw.System, *values, **more) -> Call:
    """A call whose result is the sum of its parts."""
    return Call(system, Sums(*values, **more))


@contextmanager
def call_file(request: Call, output):
    """The file of a call, open for writing."""
    with claimed(request, output) as before, request_file(request, output, before) as file:
        yield file


@pytest.fixture
def path(tmp_path):
    return tmp_path / "job"


CALL = call(clutch())


def test_what_is_written_is_read_while_it_is_written_and_later(path) -> None:
    with call_file(CALL, path) as file:
        assert not file.is_begun
        file.write(NUMBERS.entry((3.0, 0.1), 3), STATE.entry({"count": 1}))
        file.write(NUMBERS.entry((), 1), STATE.entry({"count": 2}))
        assert list(file.known(NUMBERS)) == [(1, ()), (3, (3.0, 0.1))]
        assert gw.open_result(path) == 3.1
    with reading(path) as parts:
        assert parts.one(VERSIONS).keys() == {"gapwalk", "llvmlite", "numba", "numpy", "python"}
        assert parts.one(REQUEST) == CALL
        assert parts.one(STATE) == {"count": 2}
    with call_file(CALL, path) as file:
        assert list(file.known(NUMBERS)) == [(1, ()), (3, (3.0, 0.1))]
        file.write(NUMBERS.entry((2.0,), 2))
    with reading(path) as parts:
        assert [number for number, _ in parts.all(NUMBERS)] == [1, 2, 3]
    assert os.listdir(path.parent) == ["job"]


def test_a_job_that_keeps_nothing() -> None:
    with call_file(CALL, None) as file:
        assert isinstance(file, NoFile)
        file.write(NUMBERS.entry((1.0,), 0))
        assert list(file.known(NUMBERS)) == []


def test_versions_are_added_up(path, monkeypatch) -> None:
    for version in ("0.0.1", "0.0.2"):
        monkeypatch.setattr("gapwalk.results.result_file.__version__", version)
        with call_file(CALL, path) as file:
            file.write(NUMBERS.entry((1.0,), int(version[-1])))
    with reading(path) as parts:
        assert parts.one(VERSIONS)["gapwalk"] == "0.0.1, 0.0.2"


@pytest.mark.parametrize(
    ("other", "difference"),
    [
        (call(clutch(), (1.0,)), r"values is \(1\.0,\), and was \(1\.0, 0\.1\)"),
        (call(clutch(), walk=gw.WalkOptions()), "walk is WalkOptions, and was NoneType"),
        (call(clutch().at({"stage2.clearance": 0.5})), r"stage2\.clearance is 0\.5, and was "),
        (call(gw.System(["x"], [[1.0]])), "the system is made of other parts"),
    ],
)
def test_another_job_is_refused_with_its_differences(path, other, difference) -> None:
    with call_file(CALL, path) as file:
        file.write(NUMBERS.entry((1.0,), 0))
    content = path.read_bytes()
    with pytest.raises(StoreError, match=difference), call_file(other, path):
        pass
    assert path.read_bytes() == content
    with call_file(call(clutch(), workers=7), path):  # the lock was given back, and workers change nothing
        pass


def test_only_one_run_writes(path) -> None:
    with lock(path), pytest.raises(StoreError, match="being written by another run"), call_file(CALL, path):
        pass


def test_a_number_is_written_once(path) -> None:
    with call_file(CALL, path) as file:
        file.write(NUMBERS.entry((1.0,), 1))
        with pytest.raises(StoreError):
            file.write(NUMBERS.entry((2.0,), 1))
        file.write(STATE.entry({"x": 1}))
        assert list(file.known(NUMBERS)) == [(1, (1.0,))]
    assert gw.open_result(path) == 1.0


def test_parts_that_are_written_together_are_there_together(path) -> None:
    with call_file(CALL, path) as file:
        file.write(NUMBERS.entry((1.0,), 1))
        with pytest.raises(StoreError):
            file.write(NUMBERS.entry((2.0,), 2), NUMBERS.entry((3.0,), 1))
        assert list(file.known(NUMBERS)) == [(1, (1.0,))]


def test_strange_files(path, tmp_path) -> None:
    with pytest.raises(StoreError, match="there is no file"):
        gw.open_result(path)
    with pytest.raises(StoreError, match="there is no folder"), call_file(CALL, tmp_path / "nowhere" / "job"):
        pass
    path.write_text("some text that is long enough to be no database at all" * 20)
    content = path.read_bytes()
    with pytest.raises(StoreError, match="is not a result file"), call_file(CALL, path):
        pass
    assert path.read_bytes() == content
    path.unlink()
    change(path, "CREATE TABLE notes (text TEXT)")
    for use in (lambda: call_file(CALL, path).__enter__(), lambda: gw.open_result(path)):
        with pytest.raises(StoreError, match="is not a result file of gapwalk"):
            use()
    path.write_bytes(b"")
    with call_file(CALL, path) as file:  # an empty file is no loss
        file.write(NUMBERS.entry((1.0,), 1))
    assert gw.open_result(path) == 1.0


@pytest.mark.parametrize("schema", [SCHEMA - 1, SCHEMA + 1])
def test_a_file_of_another_version_is_refused(path, schema) -> None:
    with call_file(CALL, path) as file:
        file.write(NUMBERS.entry((1.0,), 1))
    change(path, f"PRAGMA user_version = {schema}")
    content = path.read_bytes()
    words = "by an older gapwalk" if schema < SCHEMA else "by a newer gapwalk"
    for use in (lambda: call_file(CALL, path).__enter__(), lambda: gw.open_result(path)):
        with pytest.raises(StoreError, match=f"was written {words}"):
            use()
    assert path.read_bytes() == content


def test_content_that_a_newer_gapwalk_wrote_is_not_called_damaged(path, monkeypatch) -> None:
    monkeypatch.setattr("gapwalk.results.result_file.__version__", "99.0.0")
    with call_file(CALL, path) as file:
        file.write(NUMBERS.entry((1.0,), 1))
    monkeypatch.undo()
    change_sealed(path, "UPDATE part SET head = replace(head, 'values', 'values2') WHERE name = 'request'")
    with pytest.raises(StoreError, match=r"was written by gapwalk 99\.0\.0, and has contents that .* update gapwalk"):
        gw.open_result(path)


def test_a_killed_writer_leaves_what_it_had_written(path, tmp_path) -> None:
    with call_file(CALL, path) as file:
        for number in range(5):
            file.write(NUMBERS.entry((1.0,), number))
            copy = tmp_path / str(number)
            for side in ("", "-wal"):  # as they lie there when the writer dies
                (tmp_path / f"{number}{side}").write_bytes((tmp_path / f"job{side}").read_bytes())
            assert gw.open_result(copy) == number + 1.0


class CtrlC:
    """Ctrl-C at a line of the code that writes files, counted from the first one that is run; 0 for none."""

    def __init__(self, at: int) -> None:
        self.at, self.lines = at, 0

    def __enter__(self):
        sys.settrace(self._trace)
        return self

    def __exit__(self, *_: object) -> None:
        sys.settrace(None)

    def _trace(self, frame, event, argument):
        if not frame.f_code.co_filename.endswith((os.sep + "files.py", os.path.join("results", "result_file.py"))):
            return None
        if event == "line":
            self.lines += 1
            if self.lines == self.at:
                signal.raise_signal(signal.SIGINT)
        return self._trace


def write_three(path, safe: list[int]) -> None:
    """Write three numbers, one by one; after Ctrl-C, what is known by then."""
    with call_file(CALL, path) as file:
        try:
            for number in range(file.count(NUMBERS), 3):
                file.write(NUMBERS.entry((1.0,), number))
                safe.append(number)
        except KeyboardInterrupt:
            file.write(STATE.entry({"stopped": file.count(NUMBERS)}))


@pytest.mark.parametrize("apart", [in_campaign(5), 17])
def test_ctrl_c_at_any_line_of_the_writer_loses_nothing(tmp_path, request, apart) -> None:
    with CtrlC(0) as undisturbed:
        write_three(tmp_path / "undisturbed", [])
    assert undisturbed.lines > 200
    gc.freeze()  # so that a collection looks at the objects of the loop alone
    request.addfinalizer(gc.unfreeze)
    for at in range(1, undisturbed.lines + 1, apart):
        path, safe = tmp_path / str(at), []
        with suppress(KeyboardInterrupt), CtrlC(at):
            write_three(path, safe)
        assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
        assert not safe or gw.open_result(path) >= len(safe)
        gc.collect()  # Ctrl-C in the first line of `close` leaves that to the end of the object
        write_three(path, safe)
        assert gw.open_result(path) == 3.0
        assert {name for name in os.listdir(tmp_path) if name.startswith(f"{at}-")} <= {f"{at}-lock"}


def test_a_part_is_named_where_it_is_damaged(path) -> None:
    with call_file(CALL, path) as file:
        file.write(NUMBERS.entry(tuple(range(20)), 7))
    for statement, message in (
        ("UPDATE part SET arrays = zeroblob(8) WHERE name = 'numbers'", "its part numbers 7: .* bytes are missing"),
        ("UPDATE part SET head = '7' WHERE name = 'numbers'", "its part numbers 7: there is an integer where a table"),
        ("DELETE FROM part WHERE name = 'versions'", "its part versions is missing"),
    ):
        content = path.read_bytes()
        change_sealed(path, statement)
        with pytest.raises(StoreError, match=message):
            gw.open_result(path)
        path.write_bytes(content)


def test_a_file_may_hold_its_request_alone(path) -> None:
    with ResultFile(path, REQUEST.entry(CALL), exists=False) as file:
        file.write()
    with reading(path) as parts:
        assert parts.one(REQUEST) == CALL
    with sqlite3.connect(path) as connection:
        assert connection.execute("SELECT count(*) FROM part").fetchone() == (2,)  # the request and the seal
    connection.close()

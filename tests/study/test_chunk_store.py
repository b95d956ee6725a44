"""The chunk store: what was reported is safe, what is damaged or strange is called so."""

import sqlite3

import pytest

from gapwalk.errors import StoreError
from gapwalk.study.store.chunk_store import ChunkStore, read_chunks

JOB = {"kind": "test", "values": [1.0, 0.1], "parts": {"a": 1, "b": None}}


@pytest.fixture
def path(tmp_path):
    return tmp_path / "job"


def change(path, statement: str) -> None:
    connection = sqlite3.connect(path, isolation_level=None)
    connection.execute(statement)
    connection.close()


def test_what_is_written_is_read_while_it_is_written_and_later(path) -> None:
    with ChunkStore(path, JOB) as store:
        store.add(3, b"three")
        store.add(1, b"")
        assert list(store.known()) == [(1, b""), (3, b"three")]
        about, chunks = read_chunks(path)
        assert chunks == {1: b"", 3: b"three"}
    assert about.pop("versions").keys() == {"gapwalk", "heyoka", "numpy", "python"}
    assert about == JOB
    with ChunkStore(path, JOB) as store:
        assert list(store.known()) == [(1, b""), (3, b"three")]
        store.add(2, b"two")
    assert list(read_chunks(path)[1]) == [1, 2, 3]
    assert [each.name for each in path.parent.iterdir()] == ["job"]


def test_versions_are_added_up(path) -> None:
    with ChunkStore(path, JOB):
        pass
    now = read_chunks(path)[0]["versions"]["gapwalk"]
    change(path, """UPDATE job SET value = '{"gapwalk": "0.0.1"}' WHERE key = 'versions'""")
    with ChunkStore(path, JOB):
        pass
    assert read_chunks(path)[0]["versions"]["gapwalk"] == f"0.0.1, {now}"


def test_another_job_is_refused_with_its_differences(path) -> None:
    with ChunkStore(path, JOB):
        pass
    for other, difference in [
        (JOB | {"kind": "other"}, "kind is 'other', and was 'test'"),
        (JOB | {"parts": {"a": 1, "b": 2}}, "parts.b is 2, and was None"),
        (JOB | {"more": 5}, "more is 5, and was None"),
        (JOB | {"values": [1.0]}, r"values is \[1.0\], and was \[1.0, 0.1\]"),
    ]:
        with pytest.raises(StoreError, match=difference):
            ChunkStore(path, other)
    with ChunkStore(path, JOB):  # the lock was given back each time
        pass


def test_only_one_run_writes(path) -> None:
    with ChunkStore(path, JOB), pytest.raises(StoreError, match="being written by another run"):
        ChunkStore(path, JOB)


def test_a_number_is_written_once(path) -> None:
    with ChunkStore(path, JOB) as store:
        store.add(1, b"one")
        with pytest.raises(StoreError):
            store.add(1, b"two")
        assert list(store.known()) == [(1, b"one")]


def test_strange_and_damaged_files(path, tmp_path) -> None:
    with pytest.raises(StoreError, match="there is no file"):
        read_chunks(path)
    with pytest.raises(StoreError, match="there is no folder"):
        ChunkStore(tmp_path / "nowhere" / "job", JOB)
    path.write_text("some text that is long enough to be no database at all" * 20)
    with pytest.raises(StoreError, match="is no result file"):
        ChunkStore(path, JOB)
    path.unlink()
    change(path, "CREATE TABLE notes (text TEXT)")
    for use in (lambda: ChunkStore(path, JOB), lambda: read_chunks(path)):
        with pytest.raises(StoreError, match="does not hold the results of a job"):
            use()


@pytest.mark.parametrize(
    ("statement", "message"),
    [
        ("UPDATE chunk SET data = x'00'", "the checksum of part 7 is wrong"),
        ("UPDATE chunk SET data = 'text'", "its table chunk has a text in the column data, where bytes should be"),
        ("UPDATE job SET value = '{' WHERE key = 'kind'", "is damaged"),
        ("DELETE FROM job WHERE key = 'versions'", "is damaged"),
        ("CREATE TRIGGER t AFTER INSERT ON chunk BEGIN DELETE FROM chunk; END", "its tables are not those of gapwalk"),
    ],
)
def test_damage_is_told(path, statement, message) -> None:
    with ChunkStore(path, JOB) as store:
        store.add(7, b"seven")
    change(path, statement)
    with pytest.raises(StoreError, match=message):
        read_chunks(path)

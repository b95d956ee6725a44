"""The seal of a result file: whatever something else than gapwalk changes in it is found; kills and resumes keep it."""

from __future__ import annotations

import json
import shutil
import sqlite3
from contextlib import closing, suppress
from pathlib import Path

import pytest

import gapwalk as gw
from gapwalk.cli import main
from gapwalk.errors import StoreError
from gapwalk.results import result_file as file
from gapwalk.results.result_file import seal_fault, write_more
from gapwalk.studies import response_study
from gapwalk.studies.diagram_study import DiagramStudyOptions
from gapwalk.studies.result import VERIFICATION
from gapwalk.verification import Check
from tests.results.tampering import change_sealed, tamper
from tests.studies.same import assert_same_result
from tests.studies.studies import stop_study
from tests.systems import clutch


@pytest.fixture(scope="module")
def response(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("seal") / "stop.gapwalk"
    gw.run(stop_study(largest_step=0.1), path)
    return path


@pytest.fixture(scope="module")
def diagram(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("seal") / "clutch.gapwalk"
    options = DiagramStudyOptions("frequency", 0.85, 0.7, "half.q1", max_period=2, workers=1)
    gw.run(gw.Study(clutch(frequency=0.85), options, "A clutch", "title = 'A clutch'\n"), path)
    return path


def replaced(part: str, old: str, new: str) -> str:
    return f"UPDATE part SET head = replace(head, '{old}', '{new}') WHERE name = '{part}'"


TAMPERINGS = {
    "title": replaced("request", "A clutch", "Another"),
    "range": replaced("request", '"end":0.7', '"end":0.71'),
    "parameter": "UPDATE part SET arrays = zeroblob(length(arrays)) WHERE name = 'request'",
    "versions": replaced("versions", "0.1", "0.2"),
    "complete": replaced("diagram", "true", "false"),
    "nature": replaced("branch", "supercritical", "subcritical"),
    "special point": replaced("branch", "flip", "fold"),
    "numbers": "UPDATE part SET arrays = zeroblob(length(arrays)) WHERE name = 'branch' AND number = 0",
    "leaf": "DELETE FROM part WHERE name = 'branch' AND number = 1",
    "ends": replaced("branch", "RANGE", "STEP"),
    "origin": replaced("branch", "P1-1", "P1-2"),
    "branch twice": "INSERT INTO part SELECT name, 2, head, arrays, checksum FROM part WHERE name = 'branch' AND "
    "number = 1",
    "exchanged": "UPDATE part SET number = 2 - number WHERE name = 'branch'",
    "checksum": "UPDATE part SET checksum = '0' WHERE name = 'request'",
    "seal": "DELETE FROM part WHERE name = 'seal'",
    "no seal": "UPDATE part SET head = '0' WHERE name = 'seal'",
}


@pytest.mark.parametrize("statement", TAMPERINGS.values(), ids=TAMPERINGS.keys())
def test_a_change_by_something_else_than_gapwalk_is_found(diagram, tmp_path, statement) -> None:
    path = tmp_path / "changed.gapwalk"
    shutil.copy(diagram, path)
    assert gw.open_result(path).complete
    tamper(path, statement)
    with pytest.raises(StoreError, match=r"changed\.gapwalk is damaged: .*checksum"):
        gw.open_result(path)
    assert seal_fault(path)


def test_a_part_with_a_right_checksum_of_its_own_is_sealed_too(diagram, tmp_path) -> None:
    """One branch in the place of another, with its checksum."""
    path, other = tmp_path / "changed.gapwalk", tmp_path / "other.gapwalk"
    for each in (path, other):
        shutil.copy(diagram, each)
    change_sealed(other, replaced("request", "A clutch", "Another"))
    with closing(sqlite3.connect(other)) as connection:
        row = connection.execute("SELECT head, checksum FROM part WHERE name = 'request'").fetchone()
    tamper(path, "UPDATE part SET head = ?, checksum = ? WHERE name = 'request'", *row)
    assert "taken away, added or exchanged" in seal_fault(path)


@pytest.mark.slow
def test_verification_continues_where_only_the_seal_is_broken(response, tmp_path, capsys) -> None:
    path = tmp_path / "changed.gapwalk"
    shutil.copy(response, path)
    assert gw.verify(path).ok
    tamper(path, replaced("request", "A stop", "Another"))
    found = gw.verify(path)
    (breach,) = found.breaches
    assert breach.check is Check.SEAL
    assert "of its part 'request' 0" in str(breach)
    assert found.worst("closure").passes
    assert main(["verify", str(path)]) == 5
    assert "seal: the file, its parts (the checksum of its part" in capsys.readouterr().out
    assert main(["verify", str(path), "--json"]) == 5
    assert json.loads(capsys.readouterr().out)["breaches"][0]["parameter"] is None


@pytest.fixture
def at_once(monkeypatch) -> None:
    monkeypatch.setattr(response_study, "_SECONDS", 0.0)


@pytest.mark.slow
@pytest.mark.usefixtures("at_once")
def test_a_killed_run_leaves_a_seal_that_holds(tmp_path) -> None:
    path, count = tmp_path / "stop.gapwalk", 0

    def report(point, special_points) -> None:
        nonlocal count
        count += 1
        if count in (2, 8, 41):
            for side in ("", "-wal"):  # as they lie there when the writer dies
                shutil.copy(f"{path}{side}", f"{tmp_path / str(count)}{side}")

    whole = gw.run(stop_study(), path, report=report)
    for number in (2, 8, 41):
        killed = tmp_path / str(number)
        assert not seal_fault(killed)
        assert not gw.open_result(killed).complete
        changed = tmp_path / f"{number}-changed"
        for side in ("", "-wal"):
            shutil.copy(f"{killed}{side}", f"{changed}{side}")
        tamper(changed, replaced("moment", '"step":', '"step":1'))
        with pytest.raises(StoreError, match="the checksum of its part 'moment'"):
            gw.run(stop_study(), changed, resume=True)
        assert_same_result(gw.run(stop_study(), killed, resume=True), whole)
        assert not seal_fault(killed)


def test_a_write_that_fails_leaves_the_seal_of_what_was_there(response, tmp_path, monkeypatch) -> None:
    path = tmp_path / "stop.gapwalk"
    shutil.copy(response, path)
    result = gw.open_result(path)
    found = gw.verify(result)
    insert = file._insert

    def fail(*arguments) -> None:
        insert(*arguments)
        raise RuntimeError

    with monkeypatch.context() as patch:
        patch.setattr(file, "_insert", fail)
        with suppress(RuntimeError):
            write_more(path, result.system, VERIFICATION.entry(found))
    assert not seal_fault(path)
    assert gw.open_result(path).verification is None
    for _ in range(2):  # a part of which there is one is replaced
        write_more(path, result.system, VERIFICATION.entry(found))
        assert not seal_fault(path)
    assert gw.open_result(path).verification == found


@pytest.mark.parametrize(
    ("column", "value", "words"),
    [
        ("head", b"bytes", "bytes in the column head, where a text should be"),
        ("head", None, ""),
        ("arrays", "text", "a text in the column arrays, where bytes should be"),
        ("number", "text", "a text in the column number, where an integer should be"),
        ("checksum", b"0", "bytes in the column checksum, where a text should be"),
        ("name", b"moment", "bytes in the column name, where a text should be"),
    ],
)
def test_values_of_wrong_types_are_refused_in_a_sentence(response, tmp_path, column, value, words) -> None:
    path = tmp_path / "changed.gapwalk"
    shutil.copy(response, path)
    try:
        tamper(path, f"UPDATE part SET {column} = ? WHERE name = 'moment' AND number = 0", value)
    except sqlite3.IntegrityError:  # SQLite itself minds
        assert value is None
        return
    with pytest.raises(StoreError, match=rf"changed\.gapwalk is damaged: its part .* has {words}"):
        gw.open_result(path)
    assert main(["show", str(path)]) == 2

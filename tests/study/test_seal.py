"""The seal of a result file: whatever something else than gapwalk changes in it is found; kills and resumes keep it."""

from __future__ import annotations

import json
import lzma
import shutil
import sqlite3
from contextlib import closing, suppress
from pathlib import Path

import pytest

import gapwalk as gw
from gapwalk.cli import main
from gapwalk.errors import StoreError
from gapwalk.study.store import walk_store
from gapwalk.study.store.database import checksum, close_whole, open_to_write, seal_of, transaction
from tests.study.same import assert_same_result
from tests.study.studies import stop_study
from tests.study.tampering import change_sealed, tamper
from tests.systems import clutch

OLDER = Path(__file__).parents[1] / "data" / "older"


@pytest.fixture(scope="module")
def response(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("seal") / "stop.gapwalk"
    gw.run(stop_study(largest_step=0.1), path)
    return path


@pytest.fixture(scope="module")
def diagram(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("seal") / "clutch.gapwalk"
    options = gw.DiagramStudyOptions("frequency", 0.85, 0.7, "half.q1", max_period=2, workers=1)
    gw.run(gw.Study(clutch(frequency=0.85), options, "A clutch", "title = 'A clutch'\n"), path)
    return path


TAMPERINGS = {
    "title": "UPDATE result SET value = '\"Another\"' WHERE key = 'title'",
    "model text": "UPDATE result SET value = '\"title = 1\"' WHERE key = 'text'",
    "range": "UPDATE result SET value = replace(value, '\"end\": 0.7', '\"end\": 0.71') WHERE key = 'study'",
    "parameter": "UPDATE result SET value = replace(value, '0.05', '0.050001') WHERE key = 'system'",
    "versions": "UPDATE result SET value = replace(value, '0.1', '0.2') WHERE key = 'versions'",
    "complete": "UPDATE result SET value = replace(value, 'true', 'false') WHERE key = 'diagram'",
    "nature": "UPDATE special_point SET nature = 'subcritical' WHERE nature = 'supercritical'",
    "amplitude": "UPDATE special_point SET judged = judged * 2 WHERE judged > 0",
    "small uncertainty": "UPDATE special_point SET uncertainty = 1e-18",
    "large uncertainty": "UPDATE special_point SET uncertainty = 0.5 WHERE number = 1",
    "special point": "DELETE FROM special_point WHERE branch = 1 AND number = 0",
    "leaf": "DELETE FROM branch WHERE id = 2",
    "points of a branch": "DELETE FROM points WHERE branch = 2",
    "ends": "UPDATE branch SET ends = replace(ends, 'RANGE', 'STEP') WHERE id = 1",
    "origin": "UPDATE branch SET begins = NULL WHERE id = 2",
    "branch twice": "INSERT INTO branch SELECT 3, 'P2-2', parameter, period, unknowns, start, start_events, begins, "
    "joins, state, ends FROM branch WHERE id = 2",
    "seal": "DELETE FROM result WHERE key = 'seal'",
    "no seal": "UPDATE result SET value = '0' WHERE key = 'seal'",
}


@pytest.mark.parametrize("statement", TAMPERINGS.values(), ids=TAMPERINGS.keys())
def test_a_change_by_something_else_than_gapwalk_is_found(diagram, tmp_path, statement) -> None:
    path = tmp_path / "changed.gapwalk"
    shutil.copy(diagram, path)
    assert gw.load(path).complete
    tamper(path, statement)
    with pytest.raises(StoreError, match=r"changed\.gapwalk is damaged: it.* checksum"):
        gw.load(path)
    assert seal_of(path)[1]


def test_verification_goes_on_where_only_the_seal_is_broken(response, tmp_path, capsys) -> None:
    path = tmp_path / "changed.gapwalk"
    shutil.copy(response, path)
    assert gw.verify(path).ok
    tamper(path, "UPDATE result SET value = '\"Another\"' WHERE key = 'title'")
    found = gw.verify(path)
    (breach,) = found.breaches
    assert breach.check is gw.Check.SEAL
    assert "in the table result" in str(breach)
    assert found.worst("closure").passes
    assert main(["verify", str(path)]) == 5
    assert "seal: the file, its tables (its checksum does not hold" in capsys.readouterr().out
    assert main(["verify", str(path), "--json"]) == 5
    assert json.loads(capsys.readouterr().out)["breaches"][0]["parameter"] is None


def test_points_with_a_right_checksum_of_their_own_are_sealed_too(response, tmp_path) -> None:
    """The last half of a branch cut off, its row and all."""
    path = tmp_path / "changed.gapwalk"
    shutil.copy(response, path)
    connection = sqlite3.connect(path)
    count, data, events = connection.execute("SELECT count, data, events FROM points WHERE first = 0").fetchone()
    connection.close()
    half = (count // 2) * (len(data) // count)
    tamper(
        path,
        "UPDATE points SET count = ?, data = ?, checksum = ? WHERE first = 0",
        count // 2,
        data[:half],
        checksum((data[:half], events)),
    )
    assert "in the table points" in seal_of(path)[1]


@pytest.fixture
def at_once(monkeypatch) -> None:
    monkeypatch.setattr(walk_store, "_SECONDS", 0.0)


@pytest.mark.usefixtures("at_once")
def test_a_killed_run_leaves_a_seal_that_holds(tmp_path) -> None:
    path, count = tmp_path / "stop.gapwalk", 0

    def report(point, special_points) -> None:
        nonlocal count
        count += 1
        if count in (1, 7, 40):
            for side in ("", "-wal"):  # as they lie there when the writer dies
                shutil.copy(f"{path}{side}", f"{tmp_path / str(count)}{side}")

    whole = gw.run(stop_study(), path, report=report)
    for number in (1, 7, 40):
        killed = tmp_path / str(number)
        assert seal_of(killed) == (True, "")
        assert not gw.load(killed).complete
        changed = tmp_path / f"{number}-changed"
        for side in ("", "-wal"):
            shutil.copy(f"{killed}{side}", f"{changed}{side}")
        tamper(changed, "UPDATE branch SET state = replace(state, '\"step\": ', '\"step\": 1')")
        with pytest.raises(StoreError, match="in the table branch"):
            gw.run(stop_study(), changed, resume=True)
        assert_same_result(gw.run(stop_study(), killed, resume=True), whole)
        assert seal_of(killed) == (True, "")


def test_a_write_that_fails_leaves_the_seal_of_what_was_there(response, tmp_path) -> None:
    path = tmp_path / "stop.gapwalk"
    shutil.copy(response, path)
    connection = open_to_write(path)
    with suppress(RuntimeError), transaction(path, connection):
        connection.execute("DELETE FROM points")
        raise RuntimeError
    with transaction(path, connection):
        connection.execute("INSERT OR REPLACE INTO result VALUES ('name', '\"x\"')")
        connection.execute("UPDATE special_point SET judged = -0.0")
    close_whole(path, connection)
    assert seal_of(path) == (True, "")


@pytest.mark.parametrize("name", ["2-response", "2-half"])
def test_a_file_from_before_seals_opens_and_gets_one_when_it_is_written(tmp_path, name) -> None:
    path = tmp_path / f"{name}.gapwalk"
    path.write_bytes(lzma.decompress((OLDER / f"{name}.xz").read_bytes()))
    assert seal_of(path) == (False, "")
    before = gw.load(path)
    assert any("made no checksum" in note for note in gw.verify(path).notes)
    close_whole(path, open_to_write(path))
    assert seal_of(path) == (True, "")
    assert_same_result(gw.load(path), before)
    assert gw.verify(path).ok


TYPES = {"TEXT": b"bytes", "BLOB": "text", "REAL": "text", "INTEGER": 3.5}  # something else for each declared type
COLUMNS = [
    *[("branch", name) for name in ("name", "parameter", "period", "unknowns", "start", "begins", "state", "ends")],
    *[("points", name) for name in ("branch", "count", "data", "events", "checksum")],
    *[("special_point", name) for name in ("kind", "value", "uncertainty", "contact", "nature", "judged", "before")],
]


@pytest.mark.parametrize(("table", "column"), COLUMNS)
def test_values_of_wrong_types_are_refused_in_a_sentence(response, tmp_path, table, column) -> None:
    """Text for a number, bytes for a text, though the seal holds."""
    path = tmp_path / "changed.gapwalk"
    shutil.copy(response, path)
    with closing(sqlite3.connect(path)) as connection:
        declared = dict(connection.execute("SELECT name, type FROM pragma_table_info(?)", (table,)))[column]
    change_sealed(path, f"UPDATE {table} SET {column} = ?", TYPES[declared])
    with pytest.raises(
        StoreError, match=rf"changed\.gapwalk is damaged: its table {table} has .* column {column}, where"
    ):
        gw.load(path)
    assert main(["show", str(path)]) == 2

"""Results of older gapwalks open and go on; those of newer ones are refused.

The files in tests/data/older were written by the commits that wrote such files, compressed: 1a by 5f23d35 (responses
only), 1b by c30c5c1 (natures of special points), 1c by 932cd1e (diagrams), 1e by 89ad9f3 (maps, jobs over cells), 1f by
fb87be4 (the last before families); 2 by 969a9b8 (the last before seals); 3 by f8e1db3 (the first with the scales of
today); 0 is a chunk store of 89ad9f3.
"""

import hashlib
import lzma
import os
import shutil
import sqlite3
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.continuation.walk import EndReason
from gapwalk.errors import StoreError
from gapwalk.study.store import chunk_store, layout, stored
from gapwalk.study.store.database import close_whole, open_to_write
from gapwalk.study.store.trust import tables
from tests.study.jobs import study_of
from tests.study.same import assert_same_point
from tests.study.studies import stop_study
from tests.study.sweeps import FOLDS, options

OLDER = Path(__file__).parents[1] / "data" / "older"


@pytest.fixture
def unpacked(tmp_path) -> Callable[[str], Path]:
    def unpack(name: str) -> Path:
        path = tmp_path / f"{name}.gapwalk"
        path.write_bytes(lzma.decompress((OLDER / f"{name}.xz").read_bytes()))
        return path

    return unpack


@pytest.fixture(scope="module")
def today() -> gw.Result:
    return gw.run(stop_study(largest_step=0.1))


@pytest.mark.parametrize("name", ["1a-response", "1b-response", "2-response"])
def test_a_response_of_an_older_gapwalk_is_what_it_is_today(unpacked, today, name) -> None:
    path = unpacked(name)
    content = path.read_bytes()
    result = gw.load(path)
    assert path.read_bytes() == content  # who only looks changes nothing
    assert result.complete
    (old,), (new,) = result.branches, today.branches
    assert [end.reason for end in old.ends] == [end.reason for end in new.ends]
    assert [each.kind for each in old.special_points] == [each.kind for each in new.special_points]
    np.testing.assert_allclose(
        [each.value for each in old.special_points], [each.value for each in new.special_points], rtol=1e-10
    )
    natures = [each.nature for each in old.special_points]
    assert natures == ["" if name.startswith("1a") else each.nature for each in new.special_points]
    assert (old.ends[0].value, old.ends[1].value) == pytest.approx((0.7, 1.9))


def test_a_walk_of_an_older_gapwalk_goes_on(unpacked, today) -> None:
    path = unpacked("3-half")
    before = gw.load(path)
    assert not before.complete
    assert before.branches[0].ends[-1].reason is EndReason.INTERRUPTED
    result = gw.run(stop_study(largest_step=0.1), path, resume=True)
    assert result.complete
    for old, new in zip(before.branches[0].points, result.branches[0].points, strict=False):
        assert_same_point(old, new)
    special_points = gw.load(path).branches[0].special_points
    np.testing.assert_allclose(
        [each.value for each in special_points],
        [each.value for each in today.branches[0].special_points],
        rtol=1e-10,
    )
    with sqlite3.connect(path) as connection:
        assert connection.execute("PRAGMA user_version").fetchone() == (layout.SCHEMA,)
    connection.close()
    assert os.listdir(path.parent) == [path.name]


@pytest.mark.parametrize(
    ("name", "count"), [("1a-half", 10), ("1b-half", 10), ("1c-half", 11), ("1e-half", 13), ("2-half", 11)]
)
def test_a_walk_in_variables_that_were_scaled_otherwise_does_not_go_on(unpacked, name, count) -> None:
    path = unpacked(name)
    content = path.read_bytes()
    with pytest.raises(
        StoreError, match=rf"first {count} points of a walk by an older gapwalk, .* \(--output\), or over"
    ):
        gw.run(stop_study(largest_step=0.1), path, resume=True)
    assert path.read_bytes() == content
    branch = gw.load(path).branches[0]
    assert len(branch.points) == count
    assert branch.ends[-1].reason is EndReason.INTERRUPTED


def test_a_file_is_made_new_in_one_transaction(unpacked, monkeypatch) -> None:
    path = unpacked("1a-response")

    def fail(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("gapwalk.study.store.older.json.dumps", fail)  # in the midst of the second step
    with pytest.raises(KeyboardInterrupt):
        open_to_write(path)
    monkeypatch.undo()
    before = len(gw.load(path).branches[0].points)
    close_whole(path, open_to_write(path))
    assert len(gw.load(path).branches[0].points) == before
    with sqlite3.connect(path) as connection:
        assert connection.execute("PRAGMA user_version").fetchone() == (layout.SCHEMA,)
    connection.close()


@pytest.mark.parametrize("name", ["1c-diagram", "1e-map", "1f-settle", "1f-regimes", "1f-sweep"])
def test_other_kinds_of_older_gapwalks_open(unpacked, name) -> None:
    result = gw.load(unpacked(name))
    assert result.complete
    assert result.study.options.kind == name[3:]


@pytest.mark.parametrize("name", ["1f-settle", "1f-regimes", "1f-sweep"])
def test_a_complete_job_of_an_older_gapwalk_is_not_done_again(unpacked, name, monkeypatch) -> None:
    monkeypatch.setattr("gapwalk.motion.mass.flow.MassFlow.run", None)
    assert gw.run(study_of(name[3:]), unpacked(name), resume=True).complete


def test_a_sweep_in_a_file_of_its_own_opens_and_is_complete(unpacked) -> None:
    path = unpacked("0-sweep-chunks")
    old = gw.load_sweep(path)
    assert old.complete
    again = gw.sweep(*FOLDS, options=options(), output=path)
    for found in (again, gw.load_sweep(path)):
        np.testing.assert_array_equal(found.sections, old.sections)


def test_a_damaged_older_file_is_called_so(unpacked) -> None:
    path = unpacked("1a-response")
    connection = sqlite3.connect(path)
    connection.execute("UPDATE branch SET end = '{\"reason\": 1'")
    connection.commit()
    connection.close()
    with pytest.raises(StoreError, match="is damaged"):
        gw.load(path)


def test_a_chunk_store_from_the_future_is_refused(unpacked) -> None:
    path = unpacked("0-sweep-chunks")
    connection = sqlite3.connect(path, isolation_level=None)
    connection.execute(f"PRAGMA user_version = {chunk_store.SCHEMA + 1}")
    connection.close()
    content = path.read_bytes()
    for ask in (lambda: gw.load_sweep(path), lambda: gw.sweep(*FOLDS, options=options(), output=path)):
        with pytest.raises(StoreError, match="written by a newer gapwalk"):
            ask()
    assert path.read_bytes() == content


def test_content_that_a_newer_gapwalk_wrote_is_not_called_damaged(unpacked) -> None:
    """The same tables, and in them a kind of study that is not known yet."""
    path = unpacked("1f-settle")
    connection = sqlite3.connect(path, isolation_level=None)
    connection.execute("UPDATE result SET value = replace(value, '\"settle\"', '\"dream\"') WHERE key = 'study'")
    connection.execute("UPDATE result SET value = '{\"gapwalk\": \"0.1.0, 7.0.1\"}' WHERE key = 'versions'")
    connection.close()
    with pytest.raises(StoreError, match=r"was written by gapwalk 7\.0\.1, .* update gapwalk"):
        gw.load(path)


def test_a_change_of_the_tables_has_a_new_schema() -> None:
    """Who changes a table raises its schema, adds a step to `older.py`, and writes the new figures here."""
    texts = sorted(
        tables([*layout.TABLES, *(text for extra in layout.EXTRA_TABLES.values() for text in extra)]),
    )
    assert (layout.SCHEMA, _figure(texts)) == (3, "920ea1e98ae8")
    assert (chunk_store.SCHEMA, _figure(sorted(tables(chunk_store.TABLES)))) == (1, "b2786a323f23")


def test_a_copy_is_opened_where_nothing_can_be_written(unpacked, tmp_path) -> None:
    path = shutil.copy(unpacked("1a-response"), tmp_path / "read-only.gapwalk")
    os.chmod(path, 0o400)
    assert stored.load(path).complete


def _figure(texts: list[str]) -> str:
    return hashlib.sha256("\n".join(texts).encode()).hexdigest()[:12]

"""Tables and documents of results: all digits, every point, and files that are whole or not there."""

import csv
import json
import os

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.errors import StoreError
from gapwalk.studies.export import export_csv, write_whole
from gapwalk.studies.result import result_document
from tests.studies.studies import stop_study


@pytest.fixture(scope="module")
def result() -> gw.Result:
    return gw.run(stop_study())


def test_the_table_of_points_reads_back_as_the_same_numbers(result, tmp_path) -> None:
    export_csv(result, {"points": tmp_path / "points.csv", "special-points": tmp_path / "special.csv"})
    rows = list(csv.DictReader((tmp_path / "points.csv").read_text(encoding="utf-8").splitlines()))
    (branch,) = result.branches
    assert [float(row["frequency"]) for row in rows] == branch.values.tolist()
    for name in ("half.x", "max.x", "min.x", "mean.x", "rms.x"):
        assert [float(row[name]) for row in rows] == branch.measure(name).tolist()
    assert [row["stable"] for row in rows] == [str(point.stable).lower() for point in branch.points]
    for row, point in zip(rows, branch.points, strict=True):
        assert [float(row["x(0)"]), float(row["x'(0)"])] == point.orbit.state.tolist()
        multipliers = [
            float(row[f"modulus.multiplier{i}"]) * np.exp(1j * float(row[f"argument.multiplier{i}"])) for i in (1, 2)
        ]
        np.testing.assert_allclose(multipliers, point.orbit.multipliers, rtol=1e-14)


def test_the_table_of_special_points(result, tmp_path) -> None:
    export_csv(result, {"points": tmp_path / "points.csv", "special-points": tmp_path / "special.csv"})
    rows = list(csv.DictReader((tmp_path / "special.csv").read_text(encoding="utf-8").splitlines()))
    special_points = result.branches[0].special_points
    assert [row["kind"] for row in rows] == [special.kind.value for special in special_points]
    assert [float(row["frequency"]) for row in rows] == [special.value for special in special_points]
    assert {row["contact"] for row in rows if row["kind"] == "grazing"} == {"stop +"}
    assert {row["re.multiplier"] for row in rows if row["kind"] == "grazing"} == {""}
    assert all(abs(float(row["re.multiplier"]) - 1) < 1e-6 for row in rows if row["kind"] == "fold")


def test_the_document_is_strict_json_with_everything_in_it(result) -> None:
    document = json.loads(json.dumps(result_document(result), allow_nan=False))
    (branch,) = result.branches
    assert document["complete"] is True
    assert [point["parameter"] for point in document["branches"][0]["points"]] == branch.values.tolist()
    assert set(document["branches"][0]["points"][0]["measures"]) == {"max.x", "min.x", "half.x", "mean.x", "rms.x"}
    assert [end["reason"] for end in document["branches"][0]["ends"]] == ["start", "range"]
    for special, written in zip(branch.special_points, document["special_points"], strict=True):
        assert (written["kind"], written["parameter"], written["branch"], written["period"]) == (
            special.kind.value,
            special.value,
            document["branches"][0]["id"],
            1,
        )
        assert written["measures"]["half.x"] == special.point.measure("half.x")


def test_a_file_is_written_whole_or_not_at_all(tmp_path, monkeypatch) -> None:
    path = tmp_path / "a.csv"
    write_whole(path, b"old")
    assert os.listdir(tmp_path) == ["a.csv"]

    def fail(*_: object) -> None:
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(os, "replace", fail)
        with pytest.raises(StoreError, match="No space left"):
            write_whole(path, b"new")
    assert path.read_bytes() == b"old"
    assert os.listdir(tmp_path) == ["a.csv"]
    write_whole(path, b"new")
    assert path.read_bytes() == b"new"
    with pytest.raises(StoreError, match="there is no folder"):
        write_whole(tmp_path / "nowhere" / "a.csv", b"")


def test_all_tables_are_saved_by_their_names(result, tmp_path) -> None:
    written = gw.save_tables(result, tmp_path / "stop")
    assert [path.name for path in written] == ["stop-points.csv", "stop-special-points.csv"]
    rows = written[0].read_text(encoding="utf-8").splitlines()
    assert len(rows) == 1 + sum(len(branch.points) for branch in result.branches)


def test_a_result_is_plain_json(result) -> None:
    document = json.loads(json.dumps(result.to_dict(), allow_nan=False))
    assert [len(branch["points"]) for branch in document["branches"]] == [len(each.points) for each in result.branches]
    assert "points" not in result.to_dict(points=False)["branches"][0]
    assert not any(branch.closed for branch in result.branches)

"""The page of outputs names every column and every field that a run writes."""

import csv
import json
import re
import shutil
from pathlib import Path

import pytest

from gapwalk.cli import main

DOCS = Path(__file__).parents[2] / "docs"
TEXT = (DOCS / "reference" / "outputs.md").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """A folder with the files of a short run over a fold."""
    place = tmp_path_factory.mktemp("outputs")
    shutil.copy(DOCS / "tutorial" / "stop.toml", place)
    assert main(["run", str(place / "stop.toml"), "--quiet", "--set", "study.from=1.3", "--set", "study.to=1.42"]) == 0
    return place


@pytest.mark.parametrize("table", ["points", "special-points"])
def test_every_column_is_explained(folder: Path, table: str) -> None:
    with (folder / f"stop-{table}.csv").open(encoding="utf-8", newline="") as file:
        columns = next(csv.reader(file))
    known = set(re.findall(r"`([^`]+)`", TEXT))
    general = {re.sub(r"multiplier\d", "multiplierN", re.sub(r"\bx\b", "Q", name)) for name in columns}
    assert {name.replace("frequency", "P") for name in general} <= known


def test_every_field_is_explained(folder: Path, capsys) -> None:
    assert main(["show", str(folder / "stop.gapwalk"), "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    known = set(re.findall(r"`([^`]+)`", TEXT))
    assert set(document) <= known
    assert {name for branch in document["branches"] for name in branch} <= known
    assert {name for point in document["special_points"] for name in point} <= known

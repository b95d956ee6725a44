"""``gapwalk`` with families: run, show, export, JSON, stopped and resumed."""

import csv
import json
import os
from pathlib import Path

import pytest

import gapwalk as gw
from gapwalk.cli import main
from gapwalk.cli.progress import ProgressLine
from tests.studies.families import MODEL

TABLES = ["x-special-points.csv", "x-connections.csv", "x-points.csv"]
MEETING = MODEL.replace("to = 1.1", "to = 1.15").replace('"mean.q3" = [0.25, 0.35, 0.5]', '"mean.q1" = [0.43, 0.44]')
"""Two flips meet between its members."""


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("x.toml").write_text(MODEL)


def test_a_family_is_checked_run_shown_and_exported(capsys) -> None:
    assert main(["check", "x.toml"]) == 0
    assert "study: family over frequency from 1.4 to 1.1 at 3 values of mean.q3" in capsys.readouterr().out
    assert main(["run", "x.toml", "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert (document["kind"], document["complete"], document["failures"]) == ("family", True, [])
    assert document["over"]["values"] == [0.25, 0.35, 0.5]
    assert document["files"] == ["x.gapwalk", "x.png", "x.svg", *TABLES]
    assert set(os.listdir()) == {"x.toml", *document["files"]}
    assert main(["show", "x.gapwalk"]) == 0
    text = capsys.readouterr().out
    for told in ("x.gapwalk: complete", "mean.q3 = 0.35: P1-1 with", "flip-2", "exactly", "1.331838029"):
        assert told in text
    assert main(["show", "x.gapwalk", "--json"]) == 0
    assert "points" not in json.loads(capsys.readouterr().out)["members"][0]["branches"][0]
    before = {name: Path(name).read_bytes() for name in TABLES}
    assert main(["export", "x.gapwalk"]) == 0
    assert before == {name: Path(name).read_bytes() for name in TABLES}
    assert main(["export", "x.gapwalk", "--output", "mine.svg", "--measure", "max.q3"]) == 0
    assert "Clutch" in Path("mine.svg").read_text(encoding="utf-8")
    capsys.readouterr()
    assert main(["export", "x.gapwalk", "--output", "mine.svg", "--measure", "max.q9"]) == 2
    assert "q9" in capsys.readouterr().err
    rows = list(csv.DictReader(Path(TABLES[0]).read_text(encoding="utf-8").splitlines()))
    assert [row["joined"] for row in rows[:3]] == ["", "joined", "joined"]


@pytest.mark.slow
def test_it_is_told_where_two_special_points_meet(capsys) -> None:
    Path("x.toml").write_text(MEETING)
    assert main(["run", "x.toml"]) == 0
    text = capsys.readouterr().out
    assert "flip-1 after: meets another one at (1.2936622, 0.43697" in text
    rows = list(csv.DictReader(Path(TABLES[1]).read_text(encoding="utf-8").splitlines()))
    assert [(row["point_path"], row["fate"], row["with"]) for row in rows] == [
        ("flip-1", "met", "flip-2"),
        ("flip-2", "met", "flip-1"),
    ]


@pytest.mark.slow
def test_ctrl_c_says_what_is_stored_and_how_to_go_on(monkeypatch, capsys) -> None:
    with monkeypatch.context() as patch:

        def stop(*_: object) -> None:
            raise KeyboardInterrupt

        patch.setattr(ProgressLine, "__call__", stop)
        assert main(["run", "x.toml"]) == 130
    captured = capsys.readouterr()
    assert "interrupted; 1 of 3 members are stored, joined at 0 places" in captured.err
    assert "gapwalk run x.toml --output x.gapwalk --resume" in captured.err
    assert main(["show", "x.gapwalk"]) == 0
    assert "not complete: `gapwalk run` with --resume continues it" in capsys.readouterr().out
    assert main(["export", "x.gapwalk", "--format", "png"]) == 0  # there is a picture of what there is
    assert main(["run", "x.toml", "--resume", "--quiet"]) == 0
    assert gw.open_result("x.gapwalk").complete


def test_a_member_that_fails_is_told_and_is_3(capsys) -> None:
    lists = '"damping.q1.q1" = [0.04, 0.04, 0.05], "stiffness.q1.q1" = [0.1, -1e6, 0.1]'
    over = f'over = {{ {lists} }}\ncalled = "case"\nvalues = [1, 2, 3]'
    Path("x.toml").write_text(MODEL.replace('over = { "mean.q3" = [0.25, 0.35, 0.5] }', over))
    assert main(["run", "x.toml"]) == 3
    captured = capsys.readouterr()
    assert "gapwalk: case = 2: no branch could be walked" in captured.err
    assert "case = 2: no branch" in captured.out
    assert Path("x.png").exists()

"""``gapwalk`` with diagrams, and with several studies in one file."""

import csv
import json
import os
import shutil
import signal
from contextlib import suppress
from itertools import pairwise
from pathlib import Path

import pytest

import gapwalk as gw
from gapwalk.cli import main, progress
from gapwalk.cli.progress import progress_of
from gapwalk.errors import StoreError
from tests.interruption import until_ctrl_c
from tests.models import CLUTCH
from tests.studies.diagrams import clutch_diagram, islands_file
from tests.studies.same import assert_same_result
from tests.waiting import until

MODEL = f"""
{CLUTCH}
[[study]]
name = "curve"
kind = "response"
parameter = "frequency"
from = 0.85
to = 0.75

[[study]]
name = "loop"
kind = "diagram"
parameter = "frequency"
from = 0.85
to = 0.6
max_period = 4
workers = 1
set = {{ stage2.impact_damping = 0.051 }}
"""
ENDINGS = (".gapwalk", ".png", ".svg", "-points.csv", "-special-points.csv")


@pytest.fixture
def clutch(tmp_path, monkeypatch) -> Path:
    """The model file, in the folder in which the test then runs."""
    monkeypatch.chdir(tmp_path)
    path = Path("clutch.toml")
    path.write_text(MODEL)
    return path


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory) -> Path:
    """The result of the study of the loop, run once."""
    folder = tmp_path_factory.mktemp("undisturbed")
    (folder / "clutch.toml").write_text(MODEL)
    gw.run(gw.read_study(folder / "clutch.toml", name="loop"), folder / "x.gapwalk")
    return folder / "x.gapwalk"


def files_of(*names: str) -> set[str]:
    return {f"{name}{ending}" for name in names for ending in ENDINGS}


def test_all_studies_of_a_file_are_run(clutch, capsys, monkeypatch) -> None:
    monkeypatch.setattr(progress, "_FIRST", 1e6)  # a slow machine tells how far it is
    assert main(["run", str(clutch), "--set", "study.loop.max_period=2"]) == 0
    captured = capsys.readouterr()
    assert captured.err == ""
    for words in (
        "Clutch: curve",
        "Clutch: loop",
        "2 branches, 1 of period 1, 1 of period 2",
        "└── P2-1",
        "a flip of P1-1",
        "0.6: the end of the range was reached",
        "leads to",
        "written: clutch-loop.gapwalk, clutch-loop.png",
    ):
        assert words in captured.out
    assert set(os.listdir()) == {"clutch.toml"} | files_of("clutch-curve", "clutch-loop")
    loop, curve = gw.open_result("clutch-loop.gapwalk"), gw.open_result("clutch-curve.gapwalk")
    assert (loop.study.name, loop.system["stage2.impact_damping"]) == ("loop", 0.051)
    assert (curve.study.name, curve.system["stage2.impact_damping"]) == ("curve", 0.05)
    assert loop.names == ("P1-1", "P2-1")


@pytest.mark.slow
def test_what_is_complete_is_not_computed_again_and_nothing_is_lost(clutch, undisturbed, capsys) -> None:
    shutil.copy(undisturbed, "clutch-loop.gapwalk")
    content = Path("clutch-loop.gapwalk").read_bytes()
    assert main(["run", str(clutch)]) == 2
    assert "clutch-loop.gapwalk exists already" in capsys.readouterr().err
    assert not Path("clutch-curve.gapwalk").exists()  # said before anything was computed
    assert main(["run", str(clutch), "--resume", "--json"]) == 0
    curve, loop = json.loads(capsys.readouterr().out)
    assert (curve["name"], curve["kind"], loop["name"], loop["kind"]) == ("curve", "response", "loop", "diagram")
    assert Path("clutch-loop.gapwalk").read_bytes() == content
    assert main(["run", str(clutch), "--study", "loop", "--resume", "--set", "stage2.clearance=0.9"]) == 2
    assert "stage2.clearance is 0.9, and was 1.0" in capsys.readouterr().err


@pytest.mark.slow
def test_one_study_may_have_a_name_of_its_own_for_the_result(clutch, capsys) -> None:
    few = ["--set", "study.loop.max_period=1", "--quiet"]
    assert main(["run", str(clutch), "--study", "loop", "--output", "x.gapwalk", *few]) == 0
    assert set(os.listdir()) == {"clutch.toml"} | files_of("x")
    assert main(["run", str(clutch), "--output", "y.gapwalk", *few]) == 0
    assert {"y-loop.gapwalk", "y-curve.gapwalk"} <= set(os.listdir())
    assert gw.open_result("y-loop.gapwalk").names == ("P1-1",)
    assert capsys.readouterr().out == ""


@pytest.mark.slow
def test_one_study_that_fails_does_not_stop_the_others(clutch, capsys) -> None:
    words = ["--set", "study.curve.start=[1e9, 0, 0, 0]", "--set", "study.loop.max_period=1"]
    assert main(["run", str(clutch), *words, "--json"]) == 3
    captured = capsys.readouterr()
    curve, loop = json.loads(captured.out)
    assert curve["error"]["type"] in ("ConvergenceError", "FlowError")
    assert "gapwalk: curve: " in captured.err
    assert loop["complete"] is True
    assert set(os.listdir()) == {"clutch.toml"} | files_of("clutch-loop")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--study", "lop"], "has no study 'lop'; did you mean loop?"),
        (["lop"], "has no study 'lop'; did you mean loop?"),
        (["loop", "--output", "x.png"], "x.png is not a name for a result"),
        (["--study", "loop", "--output", "x.png"], "x.png is not a name for a result"),
        (["--set", "study.loop.max_period=0"], 'study "loop".max_period is 0; it must be >= 1'),
        (["--set", "study.max_period=4"], 'study "curve".max_period is not a key here'),
    ],
)
def test_bad_input_is_2(clutch, words, message, capsys) -> None:
    assert main(["run", str(clutch), *words]) == 2
    assert message in capsys.readouterr().err
    assert os.listdir() == ["clutch.toml"]


def test_check_names_all_studies(clutch, capsys) -> None:
    assert main(["check", str(clutch)]) == 0
    text = capsys.readouterr().out
    assert "study curve: response over frequency from 0.85 to 0.75" in text
    assert "study loop: diagram over frequency from 0.85 to 0.6, period 1, showing half.q1, to period 4" in text
    assert main(["check", str(clutch), "--json"]) == 0
    assert [document["study"]["kind"] for document in json.loads(capsys.readouterr().out)] == ["response", "diagram"]


@pytest.fixture
def loop(clutch, undisturbed) -> str:
    shutil.copy(undisturbed, "x.gapwalk")
    return "x.gapwalk"


def test_show_has_the_tree_and_on_request_the_special_points(loop, capsys, monkeypatch) -> None:
    monkeypatch.setenv("COLUMNS", "1000")
    assert main(["show", loop]) == 0
    text = capsys.readouterr().out
    assert "x.gapwalk: complete" in text
    assert "└── P2-1" in text
    assert "multiplier" not in text
    assert main(["show", loop, "--points"]) == 0
    text = capsys.readouterr().out
    result = gw.open_result(loop)
    for branch in result.branches:
        assert all(f"{special.value:#.10g}" in text for special in branch.special_points)
    flip = result.branches[0].special("flip")[0]
    table = text[text.index("branch   kind") :].splitlines()
    (row,) = [line for line in table if f"{flip.value:#.10g}" in line]
    assert row.split()[0] == "flip"
    assert "0 → 1" in row
    assert row.rstrip().endswith("P2-1")


def test_show_tells_what_a_search_has_found(tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    Path("x.gapwalk").write_bytes(islands_file())
    assert main(["show", "x.gapwalk"]) == 0
    text = " ".join(capsys.readouterr().out.replace("│", "").split())  # as one line
    places = [text.index(f"── {name} ") for name in ("P3-1", "P1-1", "P2-1", "P3-2")]
    parts = [text[a:b] for a, b in pairwise([*places, len(text)])]
    assert ["found by the search; " in part for part in parts] == [False, True, False, True]
    assert "note: 24 starts at 2 values of frequency, 0.351 to 0.445" in text


def test_documents_and_tables_name_the_branches(loop, capsys) -> None:
    capsys.readouterr()
    assert main(["show", loop, "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    names = ["P1-1", "P2-1", "P4-1"]
    assert [branch["name"] for branch in document["branches"]] == names
    assert "points" not in document["branches"][0]
    second = document["branches"][1]
    flips = [place for place, special in enumerate(document["special_points"]) if special["leads_to"] == ["P2-1"]]
    assert [second[end] for end in ("begins", "joins")] == [
        {"branch": "P1-1", "special_point": place} for place in flips
    ]
    assert document["branches"][0]["begins"] is None
    assert document["notes"] == []
    assert document["cascades"] == [
        {"branches": list(each.members), "values": list(each.values), "ratios": list(each.ratios)}
        for each in gw.open_result(loop).diagram.cascades
    ]
    assert main(["export", loop]) == 0
    rows = list(csv.DictReader(Path("x-points.csv").read_text().splitlines()))
    assert list(dict.fromkeys(row["name"] for row in rows)) == names
    assert list(dict.fromkeys(row["period"] for row in rows)) == ["1", "2", "4"]
    rows = list(csv.DictReader(Path("x-special-points.csv").read_text().splitlines()))
    assert [row["leads.to"] for row in rows if row["leads.to"]] == ["P2-1", "P2-1", "P4-1", "P4-1"]


def test_a_picture_can_be_exported(loop) -> None:
    assert main(["export", loop, "--output", "y.svg", "--measure", "max.q3"]) == 0
    text = Path("y.svg").read_text()
    assert "maximum of q3" in text
    assert "period 4" in text


@pytest.mark.slow
def test_ctrl_c_then_resume_equals_an_undisturbed_run(clutch, command, undisturbed, capsys) -> None:
    program = command("run", str(clutch), "--output", "a.gapwalk")
    until(lambda: has_branches("a-loop.gapwalk"), "a branch is stored")
    program.send_signal(signal.SIGINT)
    out, err = program.communicate()
    stopped = gw.open_result("a-loop.gapwalk")
    if not stopped.complete:  # else it was too late
        assert program.returncode == 130, (out, err)
        assert f"interrupted; all {len(stopped.branches)} branches up to {stopped.names[-1]} are stored" in err
        assert "gapwalk run clutch.toml --output a.gapwalk --resume" in err
        assert not Path("a-loop.png").exists()
    assert gw.open_result("a-curve.gapwalk").complete
    assert main(["run", str(clutch), "--output", "a.gapwalk", "--resume", "--quiet"]) == 0
    assert_same_result(gw.open_result("a-loop.gapwalk"), gw.open_result(undisturbed))
    assert main(["show", "a-loop.gapwalk"]) == 0
    assert "complete" in capsys.readouterr().out


def test_an_incomplete_diagram_says_so(clutch, capsys) -> None:
    study = gw.read_study(clutch, name="loop")

    def report(diagram, member) -> None:
        signal.raise_signal(signal.SIGINT)

    until_ctrl_c(gw.run, study, "a.gapwalk", report=report)
    assert main(["show", "a.gapwalk"]) == 0
    assert "not complete" in capsys.readouterr().out
    assert main(["run", str(clutch), "--study", "loop", "--output", "a.gapwalk", "--resume", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["complete"] is True


@pytest.mark.slow
def test_the_line_of_progress_counts(clutch, monkeypatch) -> None:
    shown = []
    progress = progress_of(clutch_diagram().options, "loop", show=False)
    monkeypatch.setattr(progress, "update", lambda *texts: shown.append(texts))
    result = gw.run(gw.read_study(clutch, name="loop"), report=progress)
    points = sum(len(branch.points) for branch in result.branches)
    assert shown[-1] == ("loop", f"branches 3  points {points}  special {count_of(result)}  last P4-1")


def count_of(result: gw.Result) -> int:
    return sum(special.kind is not gw.Kind.GRAZING for branch in result.branches for special in branch.special_points)


def has_branches(path: str) -> bool:
    with suppress(StoreError):
        return bool(gw.open_result(path).branches)
    return False

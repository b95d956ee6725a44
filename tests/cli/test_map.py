"""``gapwalk`` with maps: run, check, show, export, stopped and resumed; and failures that are told."""

import csv
import json
import os
import shutil
import signal
from contextlib import suppress
from pathlib import Path

import pytest

import gapwalk as gw
from gapwalk.cli import main
from gapwalk.cli.progress import progress_of
from gapwalk.errors import NumericalError, StoreError
from gapwalk.studies import diagram_study as growing
from gapwalk.studies import map_study as charting
from tests.cli.test_diagram import MODEL as SEVERAL
from tests.studies.same import assert_same_result
from tests.waiting import until

MODEL = (
    SEVERAL.partition("[[study]]")[0]
    + """\
[study]
kind = "map"
parameter = "frequency"
from = 1.4
to = 1.1
second = { parameter = "mean.q1", from = 0.2, to = 0.3 }
sections = 2
max_period = 1
workers = 1
"""
)
ENDINGS = (".gapwalk", ".png", ".svg", "-points.csv", "-special-points.csv", "-sections.csv")
NAMES = ["flip-1", "fold-1", "flip-2", "grazing-1", "grazing-2"]


@pytest.fixture
def clutch(tmp_path, monkeypatch) -> Path:
    """The model file, in the folder in which the test then runs."""
    monkeypatch.chdir(tmp_path)
    path = Path("clutch.toml")
    path.write_text(MODEL)
    return path


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory) -> tuple[gw.Result, Path]:
    """The map, charted once, and its file."""
    folder = tmp_path_factory.mktemp("undisturbed")
    (folder / "clutch.toml").write_text(MODEL)
    return gw.run(gw.read_study(folder / "clutch.toml"), folder / "x.gapwalk"), folder / "x.gapwalk"


@pytest.fixture
def result(clutch, undisturbed) -> gw.Result:
    """The map, with its file in the folder in which the test runs."""
    shutil.copy(undisturbed[1], "x.gapwalk")
    return undisturbed[0]


def test_a_map_is_run_and_told(clutch, capsys) -> None:
    assert main(["run", str(clutch)]) == 0
    assert set(os.listdir()) == {"clutch.toml"} | {f"clutch{ending}" for ending in ENDINGS}
    text = capsys.readouterr().out
    assert "Ω from 1.1 to 1.4, mean.q1 from 0.2 to 0.3: 5 loci, 1 of fold, 2 of flip, 2 of grazing" in text
    count = sum(len(branch.special_points) for branch in gw.open_result("clutch.gapwalk").branches)
    assert f"started from {count} special points of 2 branches, on sections at mean.q1 = 0.2, 0.3" in text
    assert "written: clutch.gapwalk, clutch.png, clutch.svg, clutch-points.csv, clutch-special-points.csv, " in text
    content = Path("clutch.gapwalk").read_bytes()
    assert main(["run", str(clutch)]) == 2
    assert main(["run", str(clutch), "--resume", "--quiet"]) == 0
    assert Path("clutch.gapwalk").read_bytes() == content
    capsys.readouterr()
    assert main(["run", str(clutch), "--resume", "--set", "study.second.to=0.25"]) == 2
    assert "second.end is 0.25, and was 0.3" in capsys.readouterr().err


def test_sections_and_kinds_are_chosen_in_the_command(clutch) -> None:
    assert main(["run", str(clutch), "--set", "study.sections=[0.2]", "--set", 'study.kinds=["flip"]']) == 0
    assert gw.open_result("clutch.gapwalk").map.names == ("flip-1", "flip-2")


def test_check_tells_the_plane(clutch, capsys) -> None:
    assert main(["check", str(clutch)]) == 0
    text = "study: map over frequency from 1.4 to 1.1 and mean.q1 from 0.2 to 0.3, period 1, to period 1"
    assert text in capsys.readouterr().out
    assert main(["check", str(clutch), "--json"]) == 0
    study = json.loads(capsys.readouterr().out)["study"]
    assert study["second"] == {"parameter": "mean.q1", "begin": 0.2, "end": 0.3}
    assert main(["check", str(clutch), "--set", "study.second.to=0.2", "--set", "study.workers=0"]) == 2
    err = capsys.readouterr().err
    assert "study.second.to is 0.2, where the range begins" in err
    assert "study.workers is 0" in err


@pytest.mark.slow
def test_show_has_ends_with_their_reasons_and_on_request_the_points(result, capsys) -> None:
    assert main(["show", "x.gapwalk"]) == 0
    text = capsys.readouterr().out
    assert "x.gapwalk: complete" in text
    for name, locus in zip(NAMES, result.map.loci, strict=True):
        (line,) = [each for each in text.splitlines() if each.startswith(f"  {name} ")]
        assert f"{len(locus.points)} points" in line
        assert f"({locus.ends[1].values[0]:.8g}, {locus.ends[1].values[1]:.8g}): {locus.ends[1].reason.value}" in text
    assert "half.q1" not in text
    assert main(["show", "x.gapwalk", "--points"]) == 0
    text = capsys.readouterr().out
    cusp = result.map["fold-1"].codim2("cusp")[0]
    (row,) = [line for line in text.splitlines() if line.split()[:2] == ["fold-1", "cusp"]]
    assert all(f"{value:#.10g}" in row for value in cusp.values)


def test_documents_and_tables_hold_the_loci(result, capsys) -> None:
    capsys.readouterr()
    assert main(["show", "x.gapwalk", "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["kind"] == "map"
    assert document["plane"] == [
        {"parameter": "frequency", "from": 1.1, "to": 1.4},
        {"parameter": "mean.q1", "from": 0.2, "to": 0.3},
    ]
    assert document["sections"] == [0.2, 0.3]
    assert [branch["section"] for branch in document["branches"]] == [0.2, 0.3]
    assert [branch["name"] for branch in document["branches"]] == ["S1-P1-1", "S2-P1-1"]
    assert [locus["name"] for locus in document["loci"]] == NAMES
    assert "points" not in document["loci"][0]
    for written, locus in zip(document["loci"], result.map.loci, strict=True):
        assert [point["kind"] for point in written["codim2_points"]] == [each.kind for each in locus.codim2_points]
        assert [end["parameters"] for end in written["ends"]] == [list(end.values) for end in locus.ends]
        assert {end["reason"] for end in written["ends"]} <= {"start", "range"}
    assert document["failures"] == document["notes"] == []
    assert main(["export", "x.gapwalk"]) == 0
    rows = list(csv.DictReader(Path("x-points.csv").read_text().splitlines()))
    assert list(dict.fromkeys(row["locus"] for row in rows)) == NAMES
    points = [point for locus in result.map.loci for point in locus.points]
    for row, point in zip(rows, points, strict=True):
        # the load has another heading than the mean of q1
        assert (float(row["frequency"]), float(row["parameter mean.q1"])) == point.values
        assert float(row["mean.q1"]) == point.measure("mean.q1")
        assert float(row["angle"]) == point.angle
        assert row["period"] == "1"
    rows = list(csv.DictReader(Path("x-special-points.csv").read_text().splitlines()))
    assert [row["point"] for row in rows if row["locus"] == "fold-1"] == ["begins", "cusp", "ends"]
    assert {row["reason"] for row in rows if row["point"] == "ends"} == {"the edge of the range was reached"}
    assert {row["contact"] for row in rows if row["kind"] == "grazing"} == {"stage2 +"}
    rows = list(csv.DictReader(Path("x-sections.csv").read_text().splitlines()))
    assert [row["parameter mean.q1"] for row in rows] == ["0.2"] * len(result.branches[0].points) + ["0.3"] * len(
        result.branches[1].points
    )


def test_a_picture_can_be_exported(result, capsys) -> None:
    assert main(["export", "x.gapwalk", "--output", "y.svg"]) == 0
    text = Path("y.svg").read_text()
    assert "mean load on q1" in text
    assert "cusp (CP)" in text
    assert main(["export", "x.gapwalk", "--output", "y.svg", "--measure", "max.q1"]) == 2
    assert "no measure; leave it out" in capsys.readouterr().err


@pytest.mark.slow
def test_ctrl_c_then_resume_equals_an_undisturbed_run(clutch, command, undisturbed) -> None:
    program = command("run", str(clutch), "--output", "a.gapwalk")
    until(lambda: has_sections("a.gapwalk"), "a section is stored")
    program.send_signal(signal.SIGINT)
    out, err = program.communicate()
    stopped = gw.open_result("a.gapwalk")
    if not stopped.complete:  # else it was too late
        assert program.returncode == 130, (out, err)
        assert f"all {len(stopped.map.loci)} loci and {len(stopped.map.sections)} sections are stored" in err
        assert "gapwalk run clutch.toml --output a.gapwalk --resume" in err
        assert not Path("a.png").exists()
    assert main(["run", str(clutch), "--output", "a.gapwalk", "--resume", "--quiet"]) == 0
    assert_same_result(gw.open_result("a.gapwalk"), undisturbed[0])


@pytest.mark.slow
def test_a_locus_that_cannot_be_followed_is_told_and_is_3(clutch, monkeypatch, capsys) -> None:
    follow = charting.follow_locus

    def fail(special, *arguments, **options):
        if special.kind == "fold":
            raise NumericalError("no way")
        return follow(special, *arguments, **options)

    monkeypatch.setattr(charting, "follow_locus", fail)
    assert main(["run", str(clutch), "--set", 'study.kinds=["fold", "grazing"]']) == 3
    captured = capsys.readouterr()
    assert captured.out.count("could not be followed: no way") == 2
    assert captured.err.count("gapwalk: the locus of the fold at frequency = 1.2159") == 2
    assert Path("clutch.png").exists()
    assert main(["show", "clutch.gapwalk"]) == 0
    assert capsys.readouterr().out.count("failed: the locus of the fold") == 2


@pytest.mark.slow
def test_a_branch_that_cannot_be_walked_is_told_and_is_3(tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    Path("clutch.toml").write_text(SEVERAL)
    switch = growing.switch

    def fail(special, *arguments):
        if special.orbit.period == 2:
            raise NumericalError("no way")
        return switch(special, *arguments)

    monkeypatch.setattr(growing, "switch", fail)
    assert main(["run", "clutch.toml", "--study", "loop"]) == 3
    captured = capsys.readouterr()
    assert captured.err.count("could not be walked: no way") == 2
    assert captured.out.count("failed: the branch that leaves") == 2
    assert "note:" not in captured.out
    assert main(["show", "clutch-loop.gapwalk", "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert len(document["failures"]) == 2
    assert document["notes"] == []


def test_the_coverage_of_a_search_is_shown_and_exported(tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    search = "[study.search]\nvalues = [0.7]\nstarts = 3\nnewton_starts = 1\nnewton_periods = [1]\n"
    Path("clutch.toml").write_text(SEVERAL + search)
    assert (
        main(["run", "clutch.toml", "--study", "loop", "--output", "x.gapwalk", "--set", "study.loop.max_period=1"])
        == 0
    )
    text = capsys.readouterr().out
    assert "note: 3 starts at frequency = 0.7: 3 settled on 1 periodic motion." in text
    assert "x-search.csv" in text
    (row,) = csv.DictReader(Path("x-search.csv").read_text().splitlines())
    assert (row["value"], row["starts"], row["settled"]) == ("0.7", "3", "3")
    assert main(["show", "x.gapwalk", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["search"]["values"][0]["starts"] == 3


@pytest.mark.slow
def test_the_line_of_progress_counts(clutch, monkeypatch) -> None:
    shown = []
    study = gw.read_study(clutch)
    progress = progress_of(study.options, "resonance", show=False)
    monkeypatch.setattr(progress, "update", lambda *texts: shown.append(texts))
    result = gw.run(study, report=progress)
    assert shown[0] == ("resonance", "sections 1 of 2  loci 0  points 0")
    points = sum(len(locus.points) for locus in result.map.loci)
    assert shown[-1] == ("resonance", f"sections 2 of 2  loci 5  points {points}  last grazing-2")


def has_sections(path: str) -> bool:
    with suppress(StoreError):
        return bool(gw.open_result(path).map.sections)
    return False

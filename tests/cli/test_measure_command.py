"""``gapwalk measure``: the synthetic example, its products, its exit codes, and what is wrong with files."""

import csv
import json
import os
import runpy
import shutil
import sys
from pathlib import Path

import pytest

from gapwalk.cli import main
from gapwalk.errors import ModelError
from gapwalk.model.problems import ModelFileError
from gapwalk.studies.measurement_fit import read_measured_model
from gapwalk.studies.study_file import read_study

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
TRUE = {"stage2.impact_damping": 0.1, "mean.q1": 0.05, "stage2.clearance": 1.0, "phase": 1.234}
FILES = ["rattle-measured.png", "rattle-measured.svg"]


@pytest.fixture
def files(tmp_path, monkeypatch) -> Path:
    """The example's model and record, in the folder in which the test then runs."""
    for name in ("rattle.toml", "rattle.csv"):
        shutil.copy(EXAMPLES / name, tmp_path)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_the_fit_recovers_what_the_synthetic_record_was_made_with(files, capsys) -> None:
    assert main(["measure", "rattle.toml", "rattle.csv", "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    parameters = {each["name"]: each for each in document["fit"]["parameters"]}
    assert set(parameters) == set(TRUE)
    for name, value in TRUE.items():
        found = parameters[name]
        assert abs(found["value"] - value) < 3.0 * found["error"] < 0.2 * max(value, 0.05), name
        assert abs(found["start"] - value) > 3.0 * found["error"] or name == "phase"
    assert document["agreement"]["rms"] == pytest.approx(0.03, rel=0.05)
    assert document["fit"]["before"]["rms"] > 0.09
    assert document["frequency"] == pytest.approx(0.35, rel=1e-6)  # from the speed
    assert (document["record"]["periods"], document["orbit"]["pattern"]) == (10, "1+/1-")
    assert (document["notes"], document["failures"]) == ([], [])
    tables = [f"rattle-measured-{name}.csv" for name in ("parameters", "history", "lines")]
    assert document["files"] == FILES + tables
    assert set(os.listdir()) == {"rattle.toml", "rattle.csv", *document["files"]}
    history = list(csv.DictReader(Path(tables[1]).read_text(encoding="utf-8").splitlines()))
    assert len(history) == document["record"]["samples"] == 1122
    lines = list(csv.DictReader(Path(tables[2]).read_text(encoding="utf-8").splitlines()))
    assert [float(line["order"]) for line in lines] == list(range(1, 21))
    assert "record (rattle.csv)" in Path("rattle-measured.svg").read_text(encoding="utf-8")


def test_the_committed_record_is_what_its_script_makes(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(sys, "argv", ["rattle_record.py", str(tmp_path / "again.csv")])
    runpy.run_path(str(EXAMPLES / "rattle_record.py"))
    paths = (tmp_path / "again.csv", EXAMPLES / "rattle.csv")
    again, kept = (path.read_text(encoding="utf-8").splitlines() for path in paths)
    assert kept[0].startswith("# SYNTHETIC RECORD, NOT A MEASUREMENT")
    assert again[:4] == kept[:4]
    numbers = [[[float(x) for x in row.split(",")] for row in rows[4:]] for rows in (again, kept)]
    assert len(numbers[0]) == len(numbers[1])
    for ours, theirs in zip(*numbers, strict=True):
        assert ours == pytest.approx(theirs, abs=0.011)  # one unit of the last digit


def test_without_a_fit_the_two_are_only_compared(files, capsys) -> None:
    assert (
        main(
            [
                "measure",
                "rattle.toml",
                "rattle.csv",
                "--set",
                "measurement.fit=[]",
                "--set",
                "mean.q1=0.05",
                "--set",
                "measurement.bounds={}",
                "--output",
                "mine.svg",
            ]
        )
        == 0
    )
    text = capsys.readouterr().out
    assert "rattle.csv: 1122 samples, 10 periods, as q1''" in text
    assert "standard error" not in text
    assert " 3 Ω" in text
    assert set(os.listdir()) >= {"mine.png", "mine.svg", "mine-history.csv", "mine-lines.csv"}
    assert not Path("mine-parameters.csv").exists()


def test_what_is_fitted_can_be_named_on_the_command_line(files, capsys) -> None:
    assert main(["measure", "rattle.toml", "rattle.csv", "--fit", "mean.q1", "--fit", "stage2.clearance"]) == 0
    text = capsys.readouterr().out
    for told in (
        "before the fit: rms error",
        "mean.q1",
        "stage2.clearance",
        "after the fit: rms error",
        "note: ",
    ):
        assert told in text
    rows = list(csv.DictReader(Path("rattle-measured-parameters.csv").read_text(encoding="utf-8").splitlines()))
    assert [row["name"] for row in rows] == ["mean.q1", "stage2.clearance", "phase"]


def test_what_the_record_does_not_determine_is_a_failure(files, capsys) -> None:
    words = ["measure", "rattle.toml", "rattle.csv", "--json", "--fit", "harmonic1.phase", "--fit", "mean.q1"]
    assert main(words) == 3
    captured = capsys.readouterr()
    document = json.loads(captured.out)
    assert "does not determine harmonic1.phase and phase" in captured.err
    assert document["failures"]
    assert document["fit"]["parameters"][0]["error"] is None


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["none.toml", "rattle.csv"], "none.toml: there is no such file"),
        (["rattle.toml", "none.csv"], "none.csv: it cannot be read: No such file"),
        (["rattle.toml", "rattle.toml"], "there is no column 'time' for time"),
        (
            ["rattle.toml", "rattle.csv", "--fit", "mean.q2"],
            "there is no parameter 'mean.q2'; did you mean 'mean.q1' or 'mean.q3'",
        ),
        (["rattle.toml", "rattle.csv", "--set", "measurement.order=30"], "at least 8 are needed"),
        (
            ["rattle.toml", "rattle.csv", "--set", "measurement.time_scale=1"],
            "forcing periods, but the motion repeats after 1",
        ),
        (["rattle.toml", "rattle.csv", "--output", "rattle.csv"], "rattle.csv is not a name for a picture"),
        (["rattle.toml", "rattle.csv", "--set", "stage2.gap=1"], "there is no parameter 'stage2.gap'"),
    ],
)
def test_bad_input_is_told_and_nothing_is_written(files, capsys, words, told) -> None:
    assert main(["measure", *words]) == 2
    assert told in capsys.readouterr().err
    assert set(os.listdir()) == {"rattle.toml", "rattle.csv"}


def test_all_mistakes_of_the_table_are_told_with_their_lines(files) -> None:
    text = Path("rattle.toml").read_text(encoding="utf-8")
    begin, end = text.index("[measurement]"), text.index("[study]")
    table = """[measurement]
signal = { "q2''" = 1.0 }
columns = { accelaration = "a" }
time_scale = -1
scale = 0.0
order = "two"
fit = ["mean.q2"]
bounds = { stage2.clearance = [0.5], mean = { q9 = [0, 1] } }
start = "rst"
sgnal = "q1"
"""
    first = text[:begin].count("\n") + 1
    Path("rattle.toml").write_text(text[:begin] + table + text[end:], encoding="utf-8")
    for read in (read_measured_model, read_study):  # `check` and `run` look at it too
        with pytest.raises(ModelFileError) as error:
            read("rattle.toml")
        told = {problem.line - first: str(problem) for problem in error.value.problems if problem.line}
        assert sorted(told) == [1, 2, 3, 4, 5, 6, 7, 8, 9]
        assert "there is no signal \"q2''\"; did you mean" in told[1]
        assert 'names "accelaration", which no record has; did you mean acceleration' in told[2]
        assert "must be > 0" in told[3]
        assert "it is the factor from the record's units" in told[4]
        assert "without quotes" in told[5] or "must be a number" in told[5]
        assert "mean.q2" in told[6]
        assert "it must be a list of two numbers, as in [0.5, 2.0]" in told[7]
        assert "did you mean rest" in told[8]
        assert "signal" in told[9]


def test_a_file_without_the_table_says_what_to_add(files) -> None:
    text = Path("rattle.toml").read_text(encoding="utf-8")
    Path("rattle.toml").write_text(text[: text.index("[measurement]")], encoding="utf-8")
    with pytest.raises(ModelFileError, match=r"measurement is missing; add \[measurement\] with signal = \"q1''\""):
        read_measured_model("rattle.toml")


def test_a_reduction_is_not_passed_over_in_silence(files) -> None:
    with open("rattle.toml", "a", encoding="utf-8") as file:
        file.write('[reduction]\nkeep = ["q1"]\n')
    with pytest.raises(ModelFileError, match="reduction is for studies; a record is compared with the full system"):
        read_measured_model("rattle.toml")


def test_without_speed_the_model_gives_the_frequency(files, capsys) -> None:
    text = Path("rattle.csv").read_text(encoding="utf-8").replace("acceleration,speed", "acceleration,n")
    Path("rattle.csv").write_text(text, encoding="utf-8")
    assert main(["measure", "rattle.toml", "rattle.csv", "--json", "--fit", "mean.q1", "--fit", "frequency"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["fit"]["parameters"][1]["value"] == pytest.approx(0.35, abs=2e-4)
    model = Path("rattle.toml").read_text(encoding="utf-8")
    Path("rattle.toml").write_text(model.replace("frequency = 0.35", "# "), encoding="utf-8")
    assert main(["measure", "rattle.toml", "rattle.csv"]) == 2
    assert "frequency is missing in the model, and the record has no speed" in capsys.readouterr().err


def test_a_measured_model_needs_a_number_for_each_change(files) -> None:
    with pytest.raises(ModelError, match=r"stage2\.clearance is 'x'; it must be a number"):
        read_measured_model("rattle.toml", {"stage2.clearance": "x"})

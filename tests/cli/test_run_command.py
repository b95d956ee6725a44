"""``gapwalk run``: what it writes and prints, how it ends, and that an interruption costs nothing."""

import json
import os
import signal
from contextlib import suppress
from pathlib import Path

import pytest

import gapwalk as gw
from gapwalk.cli import main, progress
from gapwalk.errors import StoreError
from gapwalk.studies.set_values import parse_changes
from tests.cli.conftest import MODEL
from tests.studies.same import assert_same_result
from tests.waiting import until

# So many points that there is time to interrupt the walk.
SLOWLY = ("--set", "study.walk.initial_step=0.001", "--set", "study.walk.largest_step=0.001")


def test_a_run_writes_result_picture_and_tables(model, capsys, monkeypatch) -> None:
    monkeypatch.setattr(progress, "_FIRST", 1e6)  # a slow machine tells how far it is
    assert main(["run", str(model), "--set", "stop.clearance=0.9"]) == 0
    captured = capsys.readouterr()
    for words in (
        "A stop",
        "2 fold",
        "the end of the range was reached",
        "unstable(1) -> stable",
        "stop +",
        "+1.000000",
    ):
        assert words in captured.out
    assert captured.err == ""
    assert {path.name for path in Path().iterdir()} == {
        "stop.toml",
        "stop.gapwalk",
        "stop.png",
        "stop.svg",
        "stop-points.csv",
        "stop-special-points.csv",
    }
    result = gw.open_result("stop.gapwalk")
    assert result.system["stop.clearance"] == 0.9
    assert result.study.text == model.read_text()
    assert result.study.changes == (("stop.clearance", 0.9),)
    fold = result.branches[0].special("fold")[0]
    assert f"{fold.value:#.10g}" in captured.out


def test_json_is_one_document_and_nothing_else(model, capsys) -> None:
    assert main(["run", str(model), "--json", "--output", "a.gapwalk"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["complete"] is True
    assert document["files"] == ["a.gapwalk", "a.png", "a.svg", "a-points.csv", "a-special-points.csv"]
    assert len(document["branches"][0]["points"]) == document["branches"][0]["count"]
    assert main(["run", str(model), "--json", "--output", "a.gapwalk"]) == 2
    assert "exists already" in json.loads(capsys.readouterr().out)["error"]["message"]


@pytest.mark.slow
def test_quiet_says_nothing(model, capsys) -> None:
    assert main(["run", str(model), "--quiet"]) == 0
    assert main(["run", str(model), "--quiet", "--force"]) == 0
    captured = capsys.readouterr()
    assert captured.out == captured.err == ""


def test_pictures_and_tables_of_an_earlier_result_do_not_stay_beside_a_stopped_one(model, capsys, monkeypatch) -> None:
    for name in ("stop.png", "stop.svg", "stop-points.csv", "stop-other-points.csv"):  # the last is of another study
        Path(name).write_text("of an earlier run")
    monkeypatch.setattr("gapwalk.cli.run_command.exit_code", lambda result: 130)  # as after Ctrl-C
    assert main(["run", str(model)]) == 130
    assert (
        "removed, because they were of an earlier result: stop.png, stop.svg, stop-points.csv"
        in capsys.readouterr().err
    )
    assert sorted(os.listdir()) == ["stop-other-points.csv", "stop.gapwalk", "stop.toml"]


def test_a_walk_that_gives_up_is_3(model, capsys) -> None:
    words = ["--set", "study.walk.smallest_step=0.01", "--set", "study.walk.initial_step=0.01"]
    assert main(["run", str(model), *words, "--set", "study.walk.largest_turn=0.01"]) == 3
    captured = capsys.readouterr()
    assert "the step became smaller than the smallest allowed" in captured.err
    assert Path("stop.png").is_file()


def test_a_start_that_is_not_found_is_3(model, capsys) -> None:
    assert main(["run", str(model), "--set", "stiffness.x.x=-1000"]) == 3
    assert capsys.readouterr().err.startswith("gapwalk: ")
    assert not Path("stop.gapwalk").exists()


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory) -> gw.Result:
    """What a slow run comes to where nothing interrupts it."""
    path = tmp_path_factory.mktemp("undisturbed") / "stop.toml"
    path.write_text(MODEL)
    return gw.run(gw.read_study(path, parse_changes(SLOWLY[1::2])))


@pytest.mark.slow
def test_ctrl_c_then_resume_equals_an_undisturbed_run(model, command, undisturbed) -> None:
    first = command("run", str(model), *SLOWLY, "--output", "a.gapwalk", "--json")
    until(lambda: points_in("a.gapwalk") >= 60, "60 points are stored")
    first.send_signal(signal.SIGINT)
    out, err = first.communicate()
    assert first.returncode == 130, (out, err)
    assert json.loads(out)["complete"] is False  # still one document
    assert "interrupted at Ω = " in err
    assert f"gapwalk run stop.toml --output a.gapwalk --resume {' '.join(SLOWLY)}" in err
    stopped = gw.open_result("a.gapwalk")
    assert not stopped.complete
    assert sorted(os.listdir()) == ["a.gapwalk", "stop.toml"]
    resume_and_compare(model, stopped, undisturbed)


@pytest.mark.slow  # make test kills a run in tests/studies/test_store.py
def test_kill_then_resume_equals_an_undisturbed_run(model, command, undisturbed) -> None:
    first = command("run", str(model), *SLOWLY, "--output", "a.gapwalk")
    until(lambda: points_in("a.gapwalk") >= 60, "60 points are stored")
    first.kill()
    first.communicate()
    resume_and_compare(model, gw.open_result("a.gapwalk"), undisturbed)


def test_a_different_study_is_not_resumed(model, capsys) -> None:
    assert main(["run", str(model), "--quiet"]) == 0
    assert main(["run", str(model), "--resume", "--set", "stop.clearance=0.9"]) == 2
    assert "stop.clearance is 0.9, and was 1.0" in capsys.readouterr().err


def points_in(path: str) -> int:
    with suppress(StoreError):
        return len(gw.open_result(path).branches[0].points)
    return 0


def resume_and_compare(model: Path, stopped: gw.Result, undisturbed: gw.Result) -> None:
    assert main(["run", str(model), *SLOWLY, "--output", "a.gapwalk", "--resume", "--quiet"]) == 0
    resumed = gw.open_result("a.gapwalk")
    assert 60 <= len(stopped.branches[0].points) < len(undisturbed.branches[0].points)
    assert_same_result(resumed, undisturbed)


@pytest.mark.slow
def test_the_result_of_another_text_gets_a_number_and_that_of_the_same_is_kept(model, capsys) -> None:
    assert main(["run", str(model), "--quiet"]) == 0
    assert main(["run", str(model), "--quiet"]) == 2
    assert "exists already" in capsys.readouterr().err
    before = Path("stop.gapwalk").read_bytes()
    model.write_text(MODEL.replace("to = 1.9", "to = 0.9"))
    assert main(["run", str(model), "-j"]) == 0
    assert "stop.gapwalk was the result of another model text; it is now stop-1.gapwalk" in capsys.readouterr().err
    assert Path("stop-1.gapwalk").read_bytes() == before
    assert all(Path(f"stop-1{end}").is_file() for end in (".png", ".svg", "-points.csv", "-special-points.csv"))
    model.write_text(MODEL)
    assert main(["run", str(model), "-o", "stop.gapwalk", "--quiet"]) == 2  # a name that was asked for stays
    assert main(["run", str(model), "-f", "--quiet"]) == 0
    assert not Path("stop-2.gapwalk").exists()

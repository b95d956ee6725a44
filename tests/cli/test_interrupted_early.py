"""A run that Ctrl-C ends before its first part is complete says that nothing is stored."""

import importlib
import signal
import sys
from contextlib import nullcontext
from pathlib import Path

import pytest

from gapwalk import cli
from gapwalk.cli import main, run_command
from gapwalk.errors import WorkError
from tests import models
from tests.tiers import keeps
from tests.waiting import until

EXAMPLE = Path(__file__).parents[2] / "examples" / "idle.toml"


@pytest.mark.parametrize(("words", "told"), [(["--study", "rattle"], "gapwalk: "), ([], "gapwalk: rattle: ")])
def test_a_run_that_ends_before_its_first_part_says_that_nothing_is_stored(words, told, tmp_path, monkeypatch, capsys):
    model = tmp_path / "idle.toml"
    model.write_text(EXAMPLE.read_text())

    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(run_command, "_run_study", interrupted)
    assert main(["run", str(model), *words]) == 130
    error = capsys.readouterr().err
    assert f"{told}interrupted: no part was complete, so nothing is stored" in error
    assert list(tmp_path.iterdir()) == [model]


def test_an_earlier_result_that_stays_is_not_to_be_resumed(tmp_path, monkeypatch, capsys):
    """With --force, a file is begun anew with the first part; until then it holds the earlier result."""
    model, file = tmp_path / "stop.toml", tmp_path / "stop.gapwalk"
    model.write_text(models.STOP + models.response(0.9))
    assert main(["run", str(model), "--quiet"]) == 0
    content = file.read_bytes()

    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(run_command, "_run_study", interrupted)
    assert main(["run", str(model), "--force"]) == 130
    error = capsys.readouterr().err
    assert f"no part was complete, so nothing is stored; {file} is unchanged" in error
    assert "--resume" not in error
    assert file.read_bytes() == content


@pytest.mark.slow
def test_what_is_stored_is_to_be_resumed(tmp_path, monkeypatch, capsys):
    model, file = tmp_path / "stop.toml", tmp_path / "stop.gapwalk"
    model.write_text(models.STOP + models.response(0.9))
    assert main(["run", str(model), "--quiet"]) == 0
    whole = run_command._run_study

    def interrupted(*given: object, **how: object) -> None:
        whole(*given, **how)
        raise KeyboardInterrupt

    monkeypatch.setattr(run_command, "_run_study", interrupted)
    assert main(["run", str(model), "--force"]) == 130
    assert f"--output {file} --resume" in capsys.readouterr().err


@keeps("error0-130")
@pytest.mark.parametrize(("error", "code"), [(KeyboardInterrupt(), 130), (WorkError("all workers have gone"), 3)])
def test_the_command_to_resume_names_the_scheduler(error, code, tmp_path, monkeypatch, capsys):
    """Without it, the rest of the work would be done on this machine."""
    model = tmp_path / "stop.toml"
    model.write_text(models.STOP + models.response(0.9))
    whole = run_command._run_study

    def interrupted(*given: object, **how: object) -> None:
        whole(*given, **how)
        raise error

    monkeypatch.setattr(run_command, "_run_study", interrupted)
    monkeypatch.setattr(run_command, "on_cluster", nullcontext)
    assert main(["run", str(model), "--scheduler", "tcp://node7:8786"]) == code
    (line,) = [each for each in capsys.readouterr().err.splitlines() if "--resume" in each]
    assert line.split()[:2] == ["gapwalk", "run"]
    assert "--resume --scheduler tcp://node7:8786" in line


def test_ctrl_c_lets_an_import_end_first(tmp_path, monkeypatch):
    """Libraries are left half loaded otherwise, and LLVM then frees its memory twice."""
    (tmp_path / "begun.py").write_text("import signal\nsignal.raise_signal(signal.SIGINT)\nis_whole = True\n")
    monkeypatch.syspath_prepend(tmp_path)
    before = {each: signal.getsignal(each) for each in (signal.SIGINT, signal.SIGTERM)}
    signal.signal(signal.SIGINT, signal.default_int_handler)
    cli._end_like_ctrl_c()
    try:
        with pytest.raises(KeyboardInterrupt):
            until(lambda: not importlib.import_module("begun"), "Ctrl-C")
    finally:
        for each, handler in before.items():
            signal.signal(each, handler)
    assert sys.modules.pop("begun").is_whole

"""A run that Ctrl-C ends before its first part is complete says that nothing is stored."""

from pathlib import Path

import pytest

from gapwalk.cli import main, run_command

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

import pytest

from gapwalk.cli import main


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["missing.toml"], "no file missing.toml"),
        (["bad.toml"], "bad.toml"),
        (["--port", "99999"], "between 0"),
        (["--host", "203.0.113.1"], "cannot listen"),
    ],
)
def test_what_cannot_be_explored_is_told_in_a_sentence(words, sentence, tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "bad.toml").write_text("coordinates = 3\n")
    assert main(["explore", *words, "--no-browser"]) == 2
    assert sentence in capsys.readouterr().err

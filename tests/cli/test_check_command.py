"""``gapwalk check``: the model of a file apart from its studies, all errors at once, and what a run can still do."""

import re
from pathlib import Path

import pytest

from gapwalk.cli import main
from tests.tiers import keeps

MODEL = """
title = "Two masses"
coordinates = ["a", "b"]
stiffness = [[2.0, -1.0], [-1.0, 1.0]]
damping = [[0.1, 0.0], [0.0, 0.1]]
frequency = 0.8
[[contact]]
name = "stop"
deflection = { a = 1.0, b = -1.0 }
clearance = 1.0
stiffness = 20.0
[[contact]]
name = "wall"
deflection = { b = 1.0 }
clearance = 2.0
law = "rigid"
restitution = 0.7
side = "positive"
[[harmonic]]
amplitude = 0.5
acts_on = { a = -1.0 }
"""
WIDE = """
[[study]]
name = "wide"
kind = "response"
parameter = "stop.clearance"
from = 2.5
to = 2.4
"""
OTHER = """
[[study]]
name = "other"
kind = "rattle"
parameter = "frequency"
from = 0.5
to = 1.5
gaps = ["stop"]
"""


@pytest.fixture
def said(tmp_path, monkeypatch, capsys):
    """Return a function that writes a model file, runs a command on it, and returns its exit code and its lines."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "1000")

    def call(text: str, *words: str) -> tuple[int, list[str]]:
        Path("m.toml").write_text(text, encoding="utf-8")
        code = main([words[0], "m.toml", *words[1:]])
        out, err = capsys.readouterr()
        return code, (out + err).splitlines()

    return call


def test_the_picture_is_of_the_model_and_not_of_its_first_study(said, monkeypatch) -> None:
    drawn = []
    monkeypatch.setattr("gapwalk.cli.file_commands.draw_model", lambda *given: drawn.append(given))
    assert said(MODEL + WIDE + OTHER, "check", "--picture", "m.png")[0] == 0
    assert said(MODEL + WIDE + OTHER, "check", "--picture", "m.png", "--set", "wall.clearance=3")[0] == 0
    for (system, _, _, title), wall in zip(drawn, (2.0, 3.0), strict=True):
        assert (system["stop.clearance"], system["wall.clearance"], title) == (1.0, wall, "Two masses")


def test_the_first_line_is_the_title_with_several_studies_too(said) -> None:
    code, lines = said(MODEL + WIDE + OTHER, "check")
    assert (code, lines[0]) == (0, "Two masses")
    code, lines = said((MODEL + WIDE + OTHER).replace('title = "Two masses"', ""), "check")
    assert (code, lines[0]) == (0, "m.toml")


def test_all_errors_are_said_at_once(said) -> None:
    """Errors of the model, unknown names in each study, and what a study refuses, in one pass."""
    text = (MODEL + WIDE + OTHER).replace("clearance = 1.0", "clearance = -1.0").replace('"positive"', '"positve"')
    text = text.replace('"stop.clearance"', '"stop.clearence"').replace('gaps = ["stop"]', 'gaps = ["stp"]')
    code, lines = said(text.replace('law = "rigid"', 'law = "rigit"'), "check")
    wrong = (".clearance is -1", 'side is "positve"', "'stop.clearence'", "'stp', which is no contact", '"rigit"')
    assert (code, len(lines)) == (2, len(wrong))
    assert all(any(part in line for line in lines) for part in wrong)


def test_an_error_of_one_study_hides_none_of_the_next(said) -> None:
    later = OTHER.replace('"frequency"', '"frequncy"').replace("other", "later")
    wide, other = WIDE.replace("to = 2.4", "to = 2.5"), OTHER.replace('"stop"]', '"stp"]')
    code, lines = said(MODEL + wide + other + later, "check")
    assert (code, len(lines)) == (2, 3)


def test_a_study_without_errors_runs_beside_one_that_has_some(said) -> None:
    text = MODEL + WIDE + OTHER.replace('["stop"]', '["stp"]')
    code, lines = said(text, "run")
    assert code == 2
    assert "'stp'" in lines[0]
    assert not list(Path().glob("*.gapwalk"))
    code, _ = said(text, "run", "--study", "wide", "--quiet")
    assert code == 0
    assert [path.name for path in Path().glob("*.gapwalk")] == ["m-wide.gapwalk"]
    code, lines = said(text, "run", "--study", "wid")
    assert (code, lines) == (2, ["gapwalk: m.toml has no study 'wid'; did you mean wide?"])


def test_what_the_work_of_a_study_refuses_is_said_before_any_is_done(said) -> None:
    tori = OTHER.replace("rattle", "tori").replace('gaps = ["stop"]', "")
    for command in ("check", "run"):
        code, lines = said(MODEL + WIDE + tori, command)
        assert code == 2
        assert lines[0].startswith("gapwalk: study other: ")
    assert not list(Path().glob("*.gapwalk"))


@keeps(
    'side = "positive"-half.b-',
    'side = "positive"-min.b-',
    'side = "positive"-max.a-',
    'side = "positive"-max.b-max.b is the clearance of wall wherever it is struck, .* "half.b"',
)
@pytest.mark.parametrize(
    ("side", "measure", "says"),
    [
        ('side = "positive"', "max.b", 'max.b is the clearance of wall wherever it is struck, .* "half.b"'),
        ('side = "negative"', "min.b", 'min.b is the clearance of wall wherever it is struck, .* "half.b"'),
        ('side = "both"', "half.b", 'half.b is the clearance of wall wherever it is struck, .* "rms.b"'),
        ('side = "positive"', "half.b", ""),
        ('side = "positive"', "min.b", ""),
        ('side = "positive"', "max.a", ""),
    ],
)
def test_a_measure_that_a_rigid_stop_holds_is_told(said, side, measure, says) -> None:
    text = MODEL.replace('side = "positive"', side) + WIDE + f'measure = "{measure}"\n'
    code, lines = said(text, "check")
    assert code == 0
    warnings = [line for line in lines if line.startswith("warning: ")]
    assert len(warnings) == bool(says)
    assert all(re.search(says, line) for line in warnings)
    if says:
        code, lines = said(text, "run")
        assert any(re.search(says, line) for line in [" ".join(lines)])


def test_a_missing_frequency_says_which_study_needs_it_and_what_to_write(said) -> None:
    code, lines = said((MODEL + WIDE).replace("frequency = 0.8", ""), "check")
    assert (code, len(lines)) == (2, 1)
    assert 'frequency is missing; study "wide" walks stop.clearance: write it at the top' in lines[0]
    assert "set = { frequency = 1.0 }" in lines[0]
    code, _ = said((MODEL + WIDE).replace("frequency = 0.8", "") + "set = { frequency = 1.0 }\n", "check")
    assert code == 0


def test_a_mistyped_frequency_is_not_missing_too(said) -> None:
    code, lines = said((MODEL + WIDE).replace("frequency = 0.8", "frequncy = 0.8"), "check")
    assert (code, len(lines)) == (2, 1)
    assert "frequncy is not a key here; did you mean frequency?" in lines[0]


def test_a_model_without_a_study_is_checked_alone(tmp_path: Path, capsys) -> None:
    file = tmp_path / "model.toml"
    file.write_text(MODEL)
    assert main(["check", str(file), "--set", "stop.clearance=0.5", "--picture", str(tmp_path / "forces.svg")]) == 0
    out = capsys.readouterr().out
    assert "contacts: stop" in out
    assert "no study: `gapwalk modes` shows its modes" in out
    assert (tmp_path / "forces.svg").stat().st_size > 1000
    assert main(["check", str(file), "--json"]) == 0
    assert '"system"' in capsys.readouterr().out
    file.write_text(MODEL.replace("clearance = 2.0", "clearance = nan"))
    assert main(["check", str(file)]) == 2

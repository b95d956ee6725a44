"""The machines of `gapwalk new NAME`: short, checked, and answered."""

import io

import pytest

import gapwalk as gw
from gapwalk.cli import main
from gapwalk.studies.machine_templates import machine_text, machines


@pytest.mark.parametrize("name", machines())
def test_a_machine_is_short_and_has_a_motion(name: str, tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["new", name]) == 0
    assert f"wrote {name}.toml" in capsys.readouterr().out
    text = (tmp_path / f"{name}.toml").read_text(encoding="utf-8")
    assert text == machine_text(name)
    assert len(text.splitlines()) <= 40
    assert main(["check", f"{name}.toml"]) == 0
    assert gw.find_orbit(gw.read_model(tmp_path / f"{name}.toml")).residual < 1e-6


LONG = {
    "neutral-rattle": ('from = "700 rpm"', 'from = "1250 rpm"\nsearch = 0\nstarts = 0'),
    "rigid-teeth": ("steps = 36", "steps = 3"),
}


@pytest.mark.parametrize(
    ("name", "short"),
    [*((name, True) for name in machines()), *(pytest.param(name, False, marks=pytest.mark.slow) for name in LONG)],
)
def test_the_study_of_a_machine_answers(name: str, short: bool, tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    text = machine_text(name).replace(*LONG[name]) if short and name in LONG else machine_text(name)
    text = text.replace("steps = 50", "steps = 3") if short else text
    (tmp_path / "own.toml").write_text(text, encoding="utf-8")
    assert main(["run", "own.toml"]) == 0
    assert "failed" not in capsys.readouterr().out
    assert (tmp_path / "own.gapwalk").exists()


def test_a_mesh_that_varies_and_is_displaced_has_one_mark() -> None:
    drawn = gw.plot.machine_svg(gw.read_model(io.StringIO(machine_text("gear-pair"))))
    assert "mesh(θ)" in drawn
    assert "(θ)(θ)" not in drawn


def test_machines_are_listed_and_a_wrong_name_is_told(tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["new"]) == 0
    listed = capsys.readouterr().out
    assert "gapwalk new NAME" in listed
    assert all(f"\n{name} " in listed for name in machines())
    assert main(["new", "rotr"]) != 0
    assert "gapwalk new rotr.toml); did you mean rotor?" in " ".join(capsys.readouterr().err.split())

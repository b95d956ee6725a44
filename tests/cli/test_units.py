"""The command line with a model file in units: rpm, deg and N m, or non-dimensional if that is asked for."""

import json
import math
from pathlib import Path

import pytest

import gapwalk as gw
from gapwalk.cli import main

EXAMPLE = Path(__file__).parents[2] / "examples" / "drivetrain.toml"
SHORT = ["--study", "speed", "--set", "study.speed.to=2900 rpm"]


def test_check_says_in_which_units_it_counts(capsys) -> None:
    assert main(["check", str(EXAMPLE)]) == 0
    text = capsys.readouterr().out
    assert "excitation: firing of order 2" in text
    assert "units: speed in rpm, torque in N m, inertia in kg m^2, stiffness in N m/deg" in text


def test_modes_are_told_in_hertz_and_in_rpm(capsys) -> None:
    """By hand: two combustions a turn meet a mode of f Hz at 30 f rpm."""
    assert main(["modes", str(EXAMPLE)]) == 0
    text = capsys.readouterr().out
    assert "speed [rpm], order 2" in text
    assert "static equilibrium with clutch closed+ (stage2): clutch 3.568 deg (force 11.08 N m)" in text
    system = gw.read_study(EXAMPLE, name="speed").system
    for rate in gw.find_modes(system, gw.find_equilibria(system).equilibria[0]).frequencies:
        assert f" {rate / (2 * math.pi):.6g} " in text
        assert f" {30 * rate / (2 * math.pi):.6g} " in text
    assert main(["modes", str(EXAMPLE), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    rates = [mode["frequency"] for mode in found["closed"]]
    assert found["resonances"]["speed [rpm], order 2"] == pytest.approx([15 * rate / math.pi for rate in rates])


@pytest.mark.slow
def test_a_run_is_shown_in_units_and_without(tmp_path, capsys) -> None:
    file, plain = tmp_path / "drive.gapwalk", tmp_path / "plain.gapwalk"
    assert main(["run", str(EXAMPLE), *SHORT, "--output", str(file)]) == 0
    text = capsys.readouterr().out
    assert "motions over speed [rpm] from 3000 to 2900" in text
    assert main(["run", str(EXAMPLE), *SHORT, "--units", "none", "--output", str(plain)]) == 0
    assert "motions over Ω from" in capsys.readouterr().out
    assert main(["show", str(plain)]) == 0
    assert "changed: units = none: 1 means an angle of 3 deg" in capsys.readouterr().out
    physical, other = gw.open_result(file), gw.open_result(plain)
    scales = gw.train.nondimensional(physical.system).scales
    first, same = (result.branches[0].points[0] for result in (physical, other))
    assert first.measure("half.clutch") / 3.0 == pytest.approx(same.measure("half.clutch"), rel=1e-10)
    assert same.value * scales.frequency == pytest.approx(100 * math.pi * 2, rel=1e-13)
    assert main(["run", str(EXAMPLE.with_name("clutch.toml")), "--units", "none", "--output", str(plain)]) == 2
    assert "has no units" in capsys.readouterr().err


def test_what_is_wrong_with_units_is_told_with_its_line(tmp_path, capsys) -> None:
    file, text = tmp_path / "wrong.toml", EXAMPLE.read_text(encoding="utf-8")
    for right, wrong in (
        ('inertia = "0.14 kg m^2"', "inertia = 0.14"),
        ('clearance = "3 deg"', 'clearance = "3"'),
        ('stiffness = "19.5 N m/deg"', 'stiffness = "19.5 N m"'),
        ('speed = "1500 rpm" ', 'speed = "1500 U/min" '),
        ('amplitude = "100 N m"', 'amplitude = "100 J"'),
        ('name = "vehicle" ', 'naem = "vehicle" '),
    ):
        assert text.count(right) == 1
        text = text.replace(right, wrong)
    file.write_text(text, encoding="utf-8")
    assert main(["check", str(file)]) == 2
    lines = [line for line in capsys.readouterr().err.splitlines() if ": " in line]
    for words in (
        'inertia "flywheel".inertia is 0.14, a number without a unit; write an inertia such as "0.14 kg m^2"',
        'shaft "clutch".stage[0].clearance is "3", without a unit; write an angle such as "3 deg"',
        'shaft "clutch".stage[0].stiffness is "19.5 N m": N m is the unit of a torque; a stiffness is expected',
        'speed is "1500 U/min": write rpm',
        'harmonic "firing".amplitude is "100 J": J is the unit of an energy; write a torque in N m',
        "inertia[3].naem is not a key here",
    ):
        (line,) = [line for line in lines if words in line]
        number = int(line.split("wrong.toml:")[1].split(":")[0])
        assert words.split(" is ")[0].split(".")[-1].split("[")[0] in text.splitlines()[number - 1]


@pytest.mark.parametrize("wrong", ["frequency", "sped"])
def test_of_a_wrong_parameter_nothing_is_said_but_its_name(tmp_path, capsys, wrong: str) -> None:
    """The unit of its values depends on it."""
    file = tmp_path / "m.toml"
    text = EXAMPLE.read_text(encoding="utf-8").replace('parameter = "speed"', f'parameter = "{wrong}"')
    file.write_text(text, encoding="utf-8")
    assert main(["check", str(file)]) == 2
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert line.endswith(f"there is no parameter {wrong!r}; did you mean 'speed'?")


def test_units_stand_alone_and_are_asked_for_where_there_is_a_pace(tmp_path, capsys) -> None:
    text = EXAMPLE.read_text(encoding="utf-8")
    file = tmp_path / "m.toml"
    for changed, words in (
        (text.replace('speed = "1500 rpm" ', "# "), "the excitation has neither speed nor frequency"),
        (text.replace('speed = "1500 rpm" ', "speed = 1500 # "), "speed is 1500, a number without a unit"),
        (text.replace('speed = "1500 rpm" ', 'frequency = "50 Hz" # '), "there is no parameter 'speed'"),
    ):
        file.write_text(changed, encoding="utf-8")
        assert main(["check", str(file)]) == 2
        assert words in capsys.readouterr().err

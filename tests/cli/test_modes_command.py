"""``gapwalk modes``: rest and natural vibrations in words, in JSON, and as a picture."""

import io
import json
import os
import re
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

import gapwalk as gw
from gapwalk import Harmonic
from gapwalk.cli import main, modes_command
from gapwalk.cli.output import show
from gapwalk.model.contact import force
from gapwalk.model.model_file import Model
from gapwalk.summary import Table

EXAMPLES = Path(__file__).parents[2] / "examples"
TRAIN = str(EXAMPLES / "train.toml")


def test_it_shows_rest_and_modes_of_a_train(capsys) -> None:
    assert main(["modes", TRAIN]) == 0
    text = capsys.readouterr().out
    assert "6 inertias, 3 shafts, 2 gears; free to rotate as a whole" in text
    assert "static equilibrium with clutch closed+ (stage2), third closed+, final closed+" in text
    system = gw.read_study(TRAIN, name="drive").system
    for frequency in gw.find_modes(system, gw.find_equilibria(system).equilibria[0]).frequencies:
        assert f" {frequency:.6g} " in text
    assert text.count("Natural vibrations") == 1  # at rest all is closed


def test_open_clearances_have_their_own_table(capsys) -> None:
    assert main(["modes", TRAIN, "--set", "mean.engine=3"]) == 0
    text = capsys.readouterr().out
    assert "static equilibrium with clutch open, third closed+, final closed+" in text
    assert "with the first stage of every contact closed" in text


def test_json_has_all_of_it(capsys) -> None:
    assert main(["modes", TRAIN, "--set", "mean.engine=0", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["inertias"][0] == "engine"
    (rest,) = found["rest"]
    assert [contact["open"] for contact in rest["contacts"]] == [True, True, True]
    assert rest["loose"] == 2
    assert [mode["frequency"] for mode in rest["modes"]][:2] == [0.0, 0.0]
    closed = gw.find_modes(gw.read_study(TRAIN, name="drive").system)
    assert [mode["frequency"] for mode in found["closed"]] == pytest.approx(closed.frequencies.tolist())
    assert found["closed"][0]["angles"]["engine"] == 1.0


@pytest.mark.parametrize("name", ["train", "drivetrain", "clutch", "gear", "stop"])
@pytest.mark.parametrize("form", ["png", "svg"])
def test_modes_are_drawn(name: str, form: str, tmp_path, capsys) -> None:
    picture = tmp_path / f"modes.{form}"
    assert main(["modes", str(EXAMPLES / f"{name}.toml"), "--picture", str(picture)]) == 0
    assert picture.stat().st_size > 5000
    assert f"written: {picture}" in capsys.readouterr().out


def test_many_inertias_are_told_by_the_largest(tmp_path, capsys) -> None:
    parts = [f'[[inertia]]\nname = "d{i}"\ninertia = 1.0' for i in range(42)]
    parts += [f'[[shaft]]\nname = "s{i}"\nbetween = ["d{i}", "d{i + 1}"]\nstiffness = 1.0' for i in range(41)]
    path = tmp_path / "chain.toml"
    path.write_text("mean = { d0 = 42.0 }\n" + "\n".join(parts), encoding="utf-8")
    assert main(["modes", str(path)]) == 0
    text = capsys.readouterr().out
    assert "d0 by 1; reaction" in text
    assert "moves most" in text
    assert "d0:+1.000" in text
    assert "... and 11 more, up to W = 1.9986" in text


def test_bad_input_is_told(tmp_path, capsys) -> None:
    assert main(["modes", TRAIN, "--set", "third.clearence=1"]) == 2
    assert "did you mean 'third.clearance'" in capsys.readouterr().err
    assert main(["modes", TRAIN, "--picture", "modes.jpg"]) == 2
    assert "give it the ending .png, .svg or .pdf" in capsys.readouterr().err
    path = tmp_path / "bad.toml"
    path.write_text("inertia = 3")
    assert main(["modes", str(path)]) == 2
    assert "bad.toml" in capsys.readouterr().err


def test_check_says_what_a_train_is_made_of(capsys) -> None:
    assert main(["check", TRAIN]) == 0
    assert "6 inertias, 3 shafts, 2 gears" in capsys.readouterr().out


def test_a_table_in_a_file_is_100_columns_wide_or_as_wide_as_is_asked_for(capsys, monkeypatch) -> None:
    table = Table(["a wide column"] * 12, [[f"value {number:09.3f}" for number in range(12)]])
    monkeypatch.delenv("COLUMNS", raising=False)
    monkeypatch.setattr("sys.stderr", io.StringIO())  # no terminal, wherever the tests run
    show([table])
    text = capsys.readouterr().out
    assert max(map(len, text.splitlines())) <= 100
    assert re.findall(r"\d+\.\d+", text) == [f"{number:09.3f}" for number in range(12)]
    monkeypatch.setenv("COLUMNS", "1000")
    show([table])
    (row,) = [line for line in capsys.readouterr().out.splitlines() if "value" in line]
    assert row.count("value") == 12
    assert len(row) > 120


def test_all_rests_of_a_double_well_are_listed(monkeypatch, capsys) -> None:
    spring = force("spring", {"x": 1.0}, "k*x + b*x**3", k=-1.0, b=1.0)
    loads = [Harmonic(0.1, {"x": 1.0}), Harmonic(0.2, varies={"spring.k": 1.0}, order=2, name="parametric")]
    system = gw.System(["x"], [[0.0]], [[0.1]], contacts=[spring], harmonics=loads)
    monkeypatch.setattr(modes_command, "check_system", lambda source, changes: (Model(system, "double well"), system))
    assert main(["modes", TRAIN]) == 0
    text = capsys.readouterr().out
    for words in ("spring at -1", "spring at 1", "spring at 0, unstable"):
        assert f"static equilibrium with {words}: " in text
        assert f"Natural vibrations about the static equilibrium ({words}):" in text
    assert "what varies over the angle is left out: spring.k at the mean value" in text
    assert "there may be more" not in text
    assert text.count("1.41421") == 2
    assert main(["modes", TRAIN, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert [(each["position"]["x"], each["stable"]) for each in found["rest"]] == [
        (-1.0, True),
        (1.0, True),
        (0.0, False),
    ]


def test_a_formula_without_a_value_at_zero_has_modes_about_its_rest(monkeypatch, capsys) -> None:
    spring = force("spring", {"x": 1.0}, "k*log(x)", k=2.0)
    system = gw.System(["x"], [[0.0]], [[0.1]], contacts=[spring], mean={"x": 1.0})
    monkeypatch.setattr(modes_command, "check_system", lambda source, changes: (Model(system, "logarithm"), system))
    assert main(["modes", TRAIN]) == 0
    text = capsys.readouterr().out
    assert "static equilibrium with spring at 1.649" in text
    assert "there may be more static equilibria" in text
    assert "the force 'spring' has no finite value and slope at zero deflection" in text
    assert f"{(2.0 / np.exp(0.5)) ** 0.5:.6g}" in text
    assert main(["modes", TRAIN, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["closed"] is None


def test_a_terminal_of_eighty_columns_breaks_no_entry_of_a_mode(capsys) -> None:
    pty, termios = pytest.importorskip("pty"), pytest.importorskip("termios")  # there are none on Windows
    source, sink = pty.openpty()
    termios.tcsetwinsize(sink, (40, 80))
    train = Path(__file__).parents[1] / "data" / "train_a.toml"
    environment = {name: value for name, value in os.environ.items() if name not in ("COLUMNS", "LINES")}
    command = [sys.executable, "-m", "gapwalk", "modes", str(train)]
    text = b""
    with subprocess.Popen(command, stdout=sink, env={**environment, "TERM": "dumb"}) as modes:
        os.close(sink)
        with suppress(OSError):  # at its end
            while piece := os.read(source, 1 << 16):
                text += piece
    os.close(source)
    assert modes.returncode == 0
    lines = text.decode().replace("\r", "").splitlines()
    assert max(map(len, lines)) <= 80
    assert main(["modes", str(train)]) == 0
    wide = capsys.readouterr().out.split()
    pairs = [word for word in wide if re.fullmatch(r"\w+:[+-][01]\.\d{3},?", word)]
    assert len(pairs) > 26
    assert [word for line in lines for word in line.split() if word in pairs] == pairs  # each name beside its number
    assert "left out at 80 columns: speed [rpm], order 4; speed [rpm], order 6" in "\n".join(lines)

"""A run-up that a page asks for: its sound is the exact signal, its maps have the orders, and a record lies over it."""

import io
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.io import wavfile

from gapwalk.answers.run_up import RunUp
from gapwalk.attractors.spectrum import SECOND
from tests.explorer.conftest import STOP, about

TRAIN = """\
title = "A shaft between two inertias, with a loose stop"
speed = "600 rpm"

[[inertia]]
name = "motor"
inertia = "1 kg m^2"

[[inertia]]
name = "brake"
inertia = "2 kg m^2"

[[shaft]]
name = "shaft"
between = ["motor", "brake"]
stiffness = "20000 N m/rad"
damping = "5 N m s/rad"

[[shaft.stage]]
side = "both"
clearance = "0.4 deg"
stiffness = "40000 N m/rad"

[[harmonic]]
order = 2
amplitude = "30 N m"
acts_on = { motor = 1.0 }

[study]
kind = "response"
parameter = "speed"
from = "500 rpm"
to = "700 rpm"
"""


@pytest.fixture
def train(session, request) -> str:
    """The name of a model file with units in the workspace, a new one for each test."""
    name = f"{request.node.name.partition('[')[0]}_train.toml"
    (session.workspace.root / name).write_text(TRAIN, encoding="utf-8")
    return name


def run_of(session, file: str, found: dict) -> RunUp:
    return session.exploration(file).entry(found["key"]).result.finding.record


def heard(client, file: str, found: dict, **more: str) -> dict:
    answer = client.get("/api/heard", params={"file": file, "result": found["key"], **more})
    assert answer.status_code == 200, answer.text
    return answer.json()


def test_a_run_up_goes_up_and_down_in_the_seconds_that_were_asked_for(client, do, session, train) -> None:
    found = do(train, do="runup", low=600.0, high=1100.0, seconds=1.5)
    assert found["title"] == "run-up, speed 600 to 1100 rpm and back in 3 s"
    assert found["answer"]["axes"] == ["speed", "half.shaft"]
    run = run_of(session, train, found)
    assert run.time[-1] == pytest.approx(3.0, rel=1e-12)
    assert run.speed.max() == pytest.approx(1100.0)
    assert run.speed[[0, -1]] == pytest.approx(600.0)
    shown = client.get("/api/answer", params={"file": train, "result": found["key"]}).json()
    assert shown["heard"]["seconds"] == [0.0, 1.5, 3.0]
    assert shown["heard"]["speeds"] == [600.0, 1100.0, 600.0]
    assert shown["heard"]["pitch"] == pytest.approx(2.0 / 60.0)  # second order: hertz at 1 rpm
    ways = {layer["look"]: layer for layer in shown["layers"] if layer["axes"] == ["speed", "half.shaft"]}
    assert set(ways) == {"rising", "falling"}
    down = do(train, do="runup", low=600.0, high=1100.0, seconds=1.0, way="down", values={"shaft.damping": 6.0})
    assert down["title"] == "run-up, speed 1100 to 600 rpm in 1 s, shaft.damping = 6 N m s/rad"
    assert run_of(session, train, down).course.speed.tolist() == [1100.0, 600.0]


def test_the_sound_is_the_exact_signal_of_the_run_up(client, do, session, train) -> None:
    found = do(train, do="runup", low=600.0, high=1100.0, seconds=0.5, way="up")
    run, place = run_of(session, train, found), {"file": train, "result": found["key"], "signal": "shaft.force"}
    answer = client.get("/api/sound", params=place)
    rate, values = int(answer.headers["x-rate"]), np.frombuffer(answer.content, "<f4")
    assert (rate, len(values)) == (48_000, 24_000)
    exact = run.at(np.arange(24_000) / 48_000).signal("shaft.force")
    assert np.abs(exact).max() > 5.0  # it hits
    assert np.abs(values - exact).max() <= 1e-6 * np.abs(exact).max()
    wav = client.get("/api/wav", params={**place, "scale": "500"})
    assert wav.headers["content-type"] == "audio/wav"
    read_rate, read = wavfile.read(io.BytesIO(wav.content))
    assert read_rate == 48_000
    np.testing.assert_allclose(read / 2.0**31 * 500.0, exact - exact.mean(), atol=1e-3)
    refused = client.get("/api/wav", params={**place, "scale": "1"})
    assert refused.status_code == 400
    assert "above the full scale of 1" in refused.json()["error"]
    assert "no signal" in client.get("/api/sound", params={**place, "signal": "nothing"}).json()["error"]


def test_the_map_is_loudest_at_the_order_of_the_load(client, do, train) -> None:
    found = do(train, do="runup", low=600.0, high=1100.0, seconds=2.0)
    shown = heard(client, train, found, signal="shaft.torque")
    assert [each["text"] for each in shown["maps"]] == ["rising speed", "falling speed"]
    assert shown["unit"] == "N m"
    for each in shown["maps"]:
        levels = np.array([list(bytes.fromhex(row)) for row in each["cells"]])
        assert levels.shape == (len(each["x"]), len(each["orders"]))
        best = np.array(each["orders"])[np.argmax(levels, axis=1)]
        assert best == pytest.approx(2.0)
    assert max(max(bytes.fromhex(row)) for each in shown["maps"] for row in each["cells"]) == 255
    assert shown["tracks"][0]["title"] == "order 2 of shaft.torque [N m]"


def test_a_measured_record_lies_over_the_run_up(client, do, session, train) -> None:
    """A record of the run-up itself, in other units: its line lies on that of the run-up."""
    found = do(train, do="runup", low=600.0, high=1100.0, seconds=2.0)
    run, root = run_of(session, train, found), session.workspace.root
    time = np.arange(0.0, 4.0, 1.0 / 4_000.0)
    at = run.at(time)
    rows = zip(time, at.speed, at.signal("shaft.torque") / 1000.0, strict=True)
    text = "time (s), speed (rpm), torque (kN m)\n" + "".join(f"{a},{b},{c}\n" for a, b, c in rows)
    (root / "measured.csv").write_text(text, encoding="utf-8")
    (root / "other.csv").write_text("angle (deg), torque (N m)\n1,2\n", encoding="utf-8")
    assert client.get("/api/records", params={"file": train}).json() == {"records": ["measured.csv"]}
    shown = heard(client, train, found, signal="shaft.torque", record="measured.csv")
    assert [each["measured"] for each in shown["maps"]] == ["", "", "measured.csv", "measured.csv"]
    lines = {each["text"]: each for each in shown["tracks"][0]["series"]}
    own, record = lines["rising speed"], lines["measured.csv, rising speed"]
    assert record["look"] == "measured"
    near = np.interp(own["x"], record["x"], record["y"])
    inside = slice(2, -2)
    assert np.abs(near / np.array(own["y"]) - 1.0)[inside].max() < 0.02
    place = {"file": train, "result": found["key"], "signal": "shaft.torque"}
    for name, words in (("../x.csv", "outside"), ("other.csv", "no column"), (train, "not a file of measured data")):
        refused = client.get("/api/heard", params={**place, "record": name})
        assert refused.status_code == 400
        assert words in refused.json()["error"]


def test_without_units_a_second_is_that_in_which_frequency_1_is_90_hertz(client, do, session, model) -> None:
    found = do(model, do="runup", low=0.6, high=1.2, seconds=0.2, way="up")
    run = run_of(session, model, found)
    assert run.time[-1] == pytest.approx(0.2 * SECOND)
    shown = client.get("/api/answer", params={"file": model, "result": found["key"]}).json()
    assert shown["heard"]["pitch"] == pytest.approx(90.0)
    assert shown["heard"]["seconds"] == pytest.approx([0.0, 0.2])
    assert len(client.get("/api/sound", params={"file": model, "result": found["key"], "signal": "x''"}).content) == (
        4 * round(0.2 * 48_000)
    )


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        ({"low": 1.2, "high": 0.6}, "the range of frequency is from 1.2 to 0.6"),
        ({"low": 0.0, "high": 0.6}, "low"),
        ({"low": 0.5, "high": 0.6, "seconds": 1000.0}, "seconds"),
        ({"low": 0.5, "high": 0.6, "way": "sideways"}, "way"),
    ],
)
def test_what_is_no_run_up_is_refused(client, model, asked, words) -> None:
    answer = client.post("/api/act", json={"file": model, "do": "runup", **asked})
    assert answer.status_code == 400
    assert words in answer.json()["error"]


def test_a_response_is_no_run_up(client, do, model) -> None:
    found = do(model, do="compute")
    answer = client.get("/api/sound", params={"file": model, "result": found["key"], "signal": "x"})
    assert "is no run-up" in answer.json()["error"]


@pytest.mark.slow
def test_the_script_of_a_run_up_gives_the_same_states(client, do, session, model) -> None:
    found = do(model, do="runup", low=0.6, high=1.2, seconds=0.1, values={"stop.clearance": 0.9})
    script = client.get("/api/export/script", params={"file": model, "result": found["key"]}).text
    path: Path = session.workspace.root / "run_up_again.py"
    path.write_text(f"{script}\nimport numpy as np\nnp.save('run_up_again.npy', run_ups01[0].states)\n")
    run = subprocess.run([sys.executable, path.name], cwd=path.parent, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr + script
    np.testing.assert_array_equal(np.load(path.with_name("run_up_again.npy")), run_of(session, model, found).states)


def test_the_view_of_a_short_run_up_says_why_it_has_no_map(client, do, session, model) -> None:
    assert STOP.startswith("title")
    found = do(model, do="runup", low=0.6, high=0.7, seconds=0.02, way="up")
    shown = heard(client, model, found, signal="x''")
    assert shown["maps"] == []
    assert "shorter than two forcing periods" in shown["why"]
    assert isinstance(session.exploration(model).entry(found["key"]).answer.record, RunUp)
    assert [each["key"] for each in about(client, model)["results"]] == [found["key"]]

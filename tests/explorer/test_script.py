import runpy
import subprocess
import sys
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from tests.explorer.conftest import CLUTCH, STOP
from tests.studies.same import assert_same_branch


@pytest.fixture
def clutch(session) -> str:
    name = "clutch_script.toml"
    (session.workspace.root / name).write_text(CLUTCH.read_text(encoding="utf-8"), encoding="utf-8")
    return name


@pytest.fixture
def run(session, monkeypatch) -> Callable[[str], dict[str, Any]]:
    """Runs a script in the workspace and returns its names."""

    def names_of(script: str) -> dict[str, Any]:
        monkeypatch.chdir(session.workspace.root)
        path = session.workspace.root / "script.py"
        path.write_text(script)
        return runpy.run_path(path.name)

    return names_of


@pytest.mark.slow
def test_the_script_gives_the_same_points(client, do, run, session, clutch) -> None:
    first = do(clutch, do="compute", values={"harmonic1.amplitude": 0.24})
    query = {"file": clutch, "result": first["key"], "branch": 0, "x": "frequency", "y": "half.q1"}
    special = client.get("/api/curve", params=query).json()["special"]
    number = [each["kind"] for each in special].index("flip")
    low, high = first["branches"][0]["range"]
    start = {"result": first["key"], "branch": 0, "special": number}
    child = do(clutch, do="switch", start=start, low=low, high=high)
    walked = do(clutch, do="walk", start={"result": child["key"], "point": 4}, parameter="stage2.clearance", to=0.98)
    assert walked["state"] == "done"
    script = client.get("/api/export/script", params={"file": clutch, "result": walked["key"]}).text
    (branch,) = session.exploration(clutch).entry(walked["key"]).result.branches
    assert_same_branch(run(script)["branch"], branch)


@pytest.mark.slow
def test_a_script_settles_too(client, do, session, model) -> None:
    settled = do(model, do="settle", values={"frequency": 0.6})
    script = client.get("/api/export/script", params={"file": model, "result": settled["key"]}).text
    path = session.workspace.root / "settle.py"
    path.write_text(script)
    run = subprocess.run([sys.executable, path.name], cwd=path.parent, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr
    assert "Settled(period 1, settled" in run.stdout


@pytest.mark.slow
def test_a_script_goes_on_from_a_motion_without_period(client, do, run, session, model) -> None:
    undamped = STOP.replace("damping = [0.05]", "damping = [0.0]").replace("clearance = 1.0", "clearance = 9.0")
    (session.workspace.root / model).write_text(undamped, encoding="utf-8")  # its free vibration never ends
    first = do(model, do="settle", values={"frequency": 0.6})
    entry = session.exploration(model).entry(first["key"])
    assert entry.settled().orbit is None
    second = do(model, do="settle", start={"result": first["key"]}, values={"stop.clearance": 0.2})
    script = client.get("/api/export/script", params={"file": model, "result": second["key"]}).text
    names = run(script)
    states = [session.exploration(model).entry(each["key"]).settled().state for each in (first, second)]
    np.testing.assert_allclose([names[name].state for name in ("settled01", "settled02")], states, rtol=1e-12)


@pytest.mark.slow
def test_a_script_repeats_the_model_that_it_was_after_the_file_was_edited(client, do, run, session, clutch) -> None:
    file = session.workspace.root / clutch
    first = do(clutch, do="compute", values={"stage2.clearance": 0.5, "mean.q1": 0.3})
    assert "stage2.clearance = 0.5" in first["title"]
    file.write_text(CLUTCH.read_text(encoding="utf-8").replace("0.25", "0.26"), encoding="utf-8")
    script = client.get("/api/export/script", params={"file": clutch, "result": first["key"]}).text
    (branch,) = session.exploration(clutch).entry(first["key"]).result.branches
    assert branch.points[0].orbit.system["stage2.clearance"] == 0.5
    assert_same_branch(run(script)["branch"], branch)


def test_a_script_of_a_model_with_matrices_beside_it_takes_it_from_the_result(client, do, run, session) -> None:
    matrix = session.workspace.root / "k.mtx"
    matrix.write_text("%%MatrixMarket matrix array real general\n1 1\n1.0\n")
    (session.workspace.root / "beside.toml").write_text(STOP.replace("stiffness = [1.0]", 'stiffness = "k.mtx"'))
    first = do("beside.toml", do="compute")
    matrix.write_text("%%MatrixMarket matrix array real general\n1 1\n1.5\n")
    script = client.get("/api/export/script", params={"file": "beside.toml", "result": first["key"]}).text
    (branch,) = session.exploration("beside.toml").entry(first["key"]).result.branches
    assert_same_branch(run(script)["branch"], branch)

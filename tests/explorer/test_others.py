"""Search for others, loci, and switches at branch points: jobs like the others, from the request to the script."""

import subprocess
import sys
import time

import numpy as np
import pytest
from starlette.testclient import TestClient

import gapwalk as gw
from gapwalk.explorer.motion_panels import labels
from gapwalk.explorer.opened_file import Exploration
from gapwalk.explorer.web_app import application
from tests.explorer.conftest import CLUTCH, ORIGIN, STOP, wait
from tests.explorer.test_web_app import amplitude, unpacked

SYMMETRIC = """
title = "A gap on both sides"
coordinates = ["x"]
stiffness = [0.2]
damping = [0.08]
frequency = 2.5

[[contact]]
name = "gap"
deflection = { x = 1.0 }
clearance = 0.5
stiffness = 4.0

[[harmonic]]
amplitude = 1.0
acts_on = { x = 1.0 }

[study]
kind = "response"
parameter = "frequency"
from = 2.5
to = 0.8
measure = "half.x"
"""


@pytest.fixture
def clutch(session, request) -> str:
    name = f"{request.node.name.partition('[')[0]}_clutch.toml"
    (session.workspace.root / name).write_text(CLUTCH.read_text(encoding="utf-8"), encoding="utf-8")
    return name


def result_file(session, file: str, key: str):
    return session.workspace.exploration(session.workspace.path(file)) / f"{key}.gapwalk"


def repeated(client, session, file: str, key: str, name: str) -> np.ndarray:
    """The states of the last result of its script, run by itself."""
    script = client.get("/api/export/script", params={"file": file, "result": key}).text
    path = session.workspace.root / f"repeat_{file}_{key}.py"
    states = path.with_suffix(".npy")
    save = f"import numpy as np\nnp.save({states.name!r}, [p.orbit.state for each in {name} for p in each.points])\n"
    path.write_text(f"{script}\n{save}", encoding="utf-8")
    run = subprocess.run([sys.executable, path.name], cwd=path.parent, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr + script
    return np.load(states)


def test_a_search_finds_what_is_not_known_and_nothing_that_is(client, do, session, model) -> None:
    quick = STOP.replace('kind = "response"', 'kind = "diagram"\nworkers = 1\nmax_period = 1')
    quick += "\n[study.search]\nvalues = 1\nstarts = 4\nnewton_starts = 0\n"
    (session.workspace.root / model).write_text(quick, encoding="utf-8")
    first = do(model, do="compute", values={"stop.clearance": 9.0})
    action = {"do": "search", "start": {"result": first["key"], "point": 0}, "parameter": "frequency", "count": 1}
    within = {"low": 0.7, "high": 0.9}
    found = do(model, **action, **within)  # of no known branch: it meets the only motion there is
    assert found["state"] == "done"
    assert found["message"].startswith("1 new branch. 4 starts")
    query = {"file": model, "result": found["key"], "x": "frequency", "y": "half.x"}
    curve = client.get("/api/curve", params=query).json()
    x, y = unpacked(curve, "x"), unpacked(curve, "y")
    assert (x.min(), x.max()) == (0.7, 0.9)
    np.testing.assert_allclose(y, [amplitude(each) for each in x], rtol=1e-9)
    again = do(model, **action, **within, known=[first["key"]])
    assert (again["state"], again["branches"]) == ("done", [])
    assert again["message"].startswith("Nothing new was found.")
    assert found["saves"] == ["table", "script", "model", "result"]
    assert again["saves"] == ["script", "result"]  # there is no point to put into a table, or to walk from
    stored = gw.open_result(result_file(session, model, again["key"]))
    assert stored.complete
    assert stored.diagram is not None
    assert [each.branch for each in stored.diagram.search.found] == [0]
    # what was found is there when the file is opened again, and comes out of the script bit for bit
    exploration = Exploration(session.workspace, model)
    assert [len(exploration.entry(each["key"]).lines()) for each in (found, again)] == [1, 0]
    (branch,) = exploration.entry(found["key"]).result.branches
    states = repeated(client, session, model, found["key"], found["key"].replace("-search", "").join(["branches", ""]))
    np.testing.assert_array_equal(states, [point.orbit.state for point in branch.points])


@pytest.fixture(scope="module")
def hard(session) -> tuple[str, str]:
    """A file whose response leans over, and the key of that response, which is computed once."""
    (session.workspace.root / "hard.toml").write_text(STOP.replace("to = 0.9", "to = 1.4"), encoding="utf-8")
    client = TestClient(application(session), base_url=ORIGIN)
    key = client.post("/api/act", json={"file": "hard.toml", "do": "compute"}).json()["key"]
    assert wait(client, "hard.toml", key)["state"] == "done"
    return "hard.toml", key


def folds(client, query) -> list[float]:
    """The frequencies of the folds of a response, in ascending order."""
    special = client.get("/api/curve", params=query).json()["special"]
    return sorted(each["value"] for each in special if each["kind"] == "fold")


@pytest.mark.slow
def test_a_locus_is_followed_shown_and_repeated(client, do, session, hard) -> None:
    file, first = hard
    query = {"file": file, "result": first, "x": "frequency", "y": "half.x"}
    special = client.get("/api/curve", params=query).json()["special"]
    number = [each["kind"] for each in special].index("fold")
    second = "harmonic1.amplitude"
    action = {"start": {"result": first, "special": number}, "low": 0.7, "high": 1.4, "second": second}
    found = do(file, do="locus", **action, second_low=0.04, second_high=0.21)
    assert found["state"] == "done"
    assert [(each["kind"], each["second"]) for each in found["branches"]] == [("fold", second)]
    plane = {"file": file, "result": found["key"], "x": "frequency", "y": second}
    curve = client.get("/api/curve", params=plane).json()
    x, y = unpacked(curve, "x"), unpacked(curve, "y")
    assert y[[0, -1]] == pytest.approx(0.21, abs=1e-9)  # both sides of the cusp
    assert {labels()[label] for label in unpacked(curve, "label", "u1")} == {"fold"}
    # both folds of a response that is computed at another amplitude lie on it
    other = do(file, do="compute", values={second: 0.1})
    cusp, sides = int(np.argmin(y)), []
    for side in (slice(None, cusp + 1), slice(cusp, None)):
        order = np.argsort(y[side])
        sides.append(np.interp(0.1, y[side][order], x[side][order]))
    np.testing.assert_allclose(sorted(sides), folds(client, {**query, "result": other["key"]}), atol=5e-4)
    # its points show their motions, and walks lead on from them
    place = {"file": file, "result": found["key"], "branch": 0, "point": 2, "signal": "x", "tab": "a"}
    motion = client.get("/api/motion", params=place).json()
    assert max(re for re, im in motion["multipliers"] if not im) == pytest.approx(1.0, abs=1e-6)
    assert [each["kind"] for each in curve["special"]] == ["codim2 cusp"]
    states = repeated(client, session, file, found["key"], found["key"].replace("-locus", "").join(["loci", ""]))
    (locus,) = gw.open_result(result_file(session, file, found["key"])).map.loci
    np.testing.assert_array_equal(states, [point.orbit.state for point in locus.points])


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"second": "frequency"}, "second parameter other than"),
        ({"second_low": 0.3}, "it must contain the value of the point, 0.2"),
        ({"second": "nothing"}, "no parameter"),
        ({"start": {"special": 99}}, "the chosen special point is not in"),
    ],
)
def test_a_locus_that_makes_no_sense_is_refused(client, hard, change, words) -> None:
    file, first = hard
    start = {"result": first, "special": 0}
    action = {"low": 0.7, "high": 1.4, "second": "harmonic1.amplitude", "second_low": 0.1, "second_high": 0.4}
    action |= {"start": start} | change
    action["start"] = start | change.get("start", {})
    answer = client.post("/api/act", json={"file": file, "do": "locus", **action})
    assert answer.status_code == 400
    assert words in answer.json()["error"]


def test_the_branches_that_cross_at_a_branch_point_are_mirror_images(client, do, session) -> None:
    name = "symmetric.toml"
    (session.workspace.root / name).write_text(SYMMETRIC, encoding="utf-8")
    first = do(name, do="compute")
    query = {"file": name, "result": first["key"], "x": "frequency", "y": "measure:mean.x"}
    special = client.get("/api/curve", params=query).json()["special"]
    number = [each["kind"] for each in special].index("branch-point")
    start = {"result": first["key"], "special": number}
    crossing = do(name, do="switch", start=start, low=0.8, high=2.5)
    assert (crossing["state"], crossing["branches"][0]["period"]) == ("done", 1)
    curve = client.get("/api/curve", params={**query, "result": crossing["key"]}).json()
    x, y = unpacked(curve, "x"), unpacked(curve, "y")
    # the mean of a symmetric motion is zero; those that have lost the symmetry come in pairs
    middle = int(np.argmin(abs(y)))
    assert y[middle] == pytest.approx(0.0, abs=1e-6)
    assert y.min() == pytest.approx(-y.max(), rel=1e-2)
    assert abs(y).max() > 0.01
    assert x[middle] == pytest.approx(special[number]["value"], abs=1e-6)
    locus = {"file": name, "do": "locus", "start": start, "low": 0.8, "high": 2.5, "second": "gap.stiffness"}
    refused = client.post("/api/act", json={**locus, "second_low": 3.0, "second_high": 5.0})
    assert "has no locus" in refused.json()["error"]


def test_a_stopped_switch_keeps_what_it_found_and_goes_on_to_the_same_end(client, do, session, clutch) -> None:
    first = do(clutch, do="compute")
    query = {"file": clutch, "result": first["key"], "x": "frequency", "y": "half.q1"}
    special = client.get("/api/curve", params=query).json()["special"]
    number = [each["kind"] for each in special].index("flip")
    action = {"file": clutch, "do": "switch", "start": {"result": first["key"], "special": number}}
    key = client.post("/api/act", json={**action, "low": 0.15, "high": 2.0}).json()["key"]
    entry = session.exploration(clutch).entry(key)
    while not entry.live.steps and not entry.state.is_over:
        time.sleep(0.002)
    client.post("/api/job/stop", json={"file": clutch, "result": key})
    stopped = wait(client, clutch, key)
    assert stopped["state"] == "stopped"
    assert stopped["can_resume"]
    if stopped["branches"]:  # it may have been stopped before its first step was stored
        assert not gw.open_result(result_file(session, clutch, key)).complete
    assert client.post("/api/job/resume", json={"file": clutch, "result": key}).status_code == 200
    resumed = wait(client, clutch, key)
    assert (resumed["state"], resumed["can_resume"]) == ("done", False)
    whole = do(clutch, **{name: value for name, value in action.items() if name != "file"}, low=0.15, high=2.0)
    (one,), (other,) = (gw.open_result(result_file(session, clutch, each)).branches for each in (key, whole["key"]))
    np.testing.assert_array_equal([p.orbit.state for p in one.points], [p.orbit.state for p in other.points])

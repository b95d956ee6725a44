import os
import shutil
import signal
import sqlite3
import subprocess
import sys
import time
from pathlib import Path

import pytest

import gapwalk as gw
from gapwalk.answers.least_change import Route
from gapwalk.explorer.progress_stream import News, Progress
from gapwalk.parallel.workers import Pace
from tests.explorer.conftest import STOP, result_of, wait
from tests.waiting import until

EXAMPLES = Path(__file__).parents[2] / "examples"
# steps so small that the walk lasts until it is stopped
LONG = STOP + "\n[study.walk]\ninitial_step = 1e-5\nlargest_step = 1e-5\nmax_points = 1000000\n"


@pytest.fixture
def long(session, model) -> str:
    (session.workspace.root / model).write_text(LONG, encoding="utf-8")
    return model


def begin(client, file: str) -> str:
    return client.post("/api/act", json={"file": file, "do": "compute"}).json()["key"]


def job(client, word: str, file: str, key: str):
    return client.post(f"/api/job/{word}", json={"file": file, "result": key})


def points(client, file: str, key: str) -> int:
    branches = result_of(client, file, key)["branches"]
    return branches[0]["points"] if branches else 0


def growing(client, file: str, key: str, more_than: int = 0) -> int:
    return until(lambda: (count := points(client, file, key)) > more_than and count, "the branch grows")


def test_a_job_grows_is_held_goes_on_and_is_stopped(client, session, long) -> None:
    key = begin(client, long)
    growing(client, long, key)
    assert job(client, "pause", long, key).json()["state"] == "paused"
    time.sleep(0.4)
    held = points(client, long, key)
    time.sleep(0.6)
    assert points(client, long, key) == held
    assert job(client, "pause", long, key).status_code == 400
    job(client, "continue", long, key)
    growing(client, long, key, held)
    job(client, "stop", long, key)
    found = wait(client, long, key)
    assert (found["state"], found["can_resume"]) == ("stopped", True)
    # all that it had found is in the file, and it goes on from there
    (path,) = session.workspace.exploration(session.workspace.path(long)).glob("*.gapwalk")
    (branch,) = gw.open_result(path).branches
    assert len(branch.points) == found["branches"][0]["points"] > held
    assert job(client, "resume", long, key).status_code == 200
    growing(client, long, key, len(branch.points))
    job(client, "stop", long, key)
    assert wait(client, long, key)["branches"][0]["points"] > len(branch.points)


def test_a_waiting_job_can_be_stopped_before_it_begins(client, long) -> None:
    first, second = begin(client, long), begin(client, long)
    growing(client, long, first)
    job(client, "stop", long, second)
    assert result_of(client, long, second)["state"] == "stopped"
    job(client, "stop", long, first)
    wait(client, long, first)
    assert result_of(client, long, second)["branches"] == []


@pytest.mark.slow
def test_the_death_of_the_process_costs_one_job(client, session, long) -> None:
    key = begin(client, long)
    growing(client, long, key)
    os.kill(session.jobs._engine._process.pid, signal.SIGKILL)
    found = wait(client, long, key)
    assert found["state"] == "failed"
    assert "has died" in found["message"]
    assert found["branches"][0]["points"] > 0  # what was stored
    again = begin(client, long)  # in a new process
    growing(client, long, again)
    job(client, "stop", long, again)
    assert wait(client, long, again)["state"] == "stopped"


def test_a_job_that_was_killed_after_its_last_point_leaves_one_file(client, session, model) -> None:
    key = begin(client, model)
    count = wait(client, model, key)["branches"][0]["points"]
    path = session.workspace.exploration(session.workspace.path(model)) / f"{key}.gapwalk"
    (session.workspace.root / "again.toml").write_text(STOP, encoding="utf-8")
    again = session.workspace.exploration(session.workspace.root / "again.toml") / path.name
    again.parent.mkdir()
    shutil.copy(path.with_suffix(".json"), again.parent)
    connection = sqlite3.connect(path, isolation_level=None)
    connection.execute("PRAGMA journal_mode = WAL")
    connection.execute("UPDATE part SET head = head")
    for side in ("", "-wal"):  # as they lie there when the writer dies
        shutil.copy(f"{path}{side}", f"{again}{side}")
    connection.close()
    assert result_of(client, "again.toml", key)["branches"][0]["points"] == count
    assert sorted(file.name for file in again.parent.iterdir()) == [again.name, f"{key}.json"]


def test_points_of_an_unfinished_branch_lead_nowhere(client, long) -> None:
    key = begin(client, long)
    growing(client, long, key)
    action = {"do": "walk", "start": {"result": key, "point": 0}, "parameter": "frequency", "to": 0.6}
    answer = client.post("/api/act", json={"file": long, **action})
    assert answer.status_code == 400
    assert "still being computed" in answer.json()["error"]
    job(client, "stop", long, key)
    wait(client, long, key)


def test_progress_is_told_four_times_a_second_at_most(client, session, long) -> None:
    key = begin(client, long)
    growing(client, long, key)
    entry = session.exploration(long).entry(key)
    before, began = entry.version, time.monotonic()
    until(lambda: entry.version - before >= 5, "five reports")
    reports, seconds = entry.version - before, time.monotonic() - began
    job(client, "stop", long, key)
    wait(client, long, key)
    assert reports <= 4 * seconds + 1


def test_the_process_that_computes_starts_before_the_server_is_loaded() -> None:
    """It began to load its modules when the server had loaded its own: a second later."""
    script = (
        "import sys\n"
        "from gapwalk.explorer.engine import Engine\n"
        "with Engine():\n"
        "    print({'numpy', 'llvmlite', 'starlette', 'pydantic'} & {*sys.modules})\n"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout == "set()\n"


def test_a_design_says_what_it_does_and_the_best_so_far() -> None:
    told: list[Progress] = []
    study = gw.read_study(EXAMPLES / "idle.toml", name="quiet")
    news, shares = News(told.append, study.options), iter((0.25, 0.25, 0.5))
    news.begin(Pace(0, 4), lambda: next(shares, 0.5))
    until(lambda: any(each.share == 0.125 for each in told), "half of a part is done")
    for done, route in enumerate((Route((), 0, (), 0.3, 0.1, 3, "mesh"), Route((), 1, (), 0.4, 0.0, 3)), start=1):
        news(route, Pace(done, 4))
    news.close()
    assert told[0].words == "search 1"
    assert told[-1].words == "search 3; best so far: norm of the relative changes 0.4"
    assert [told[-1].done, told[-1].share] == [2, 0.5]


def test_a_job_says_how_many_parts_it_has_before_the_first_is_done() -> None:
    told: list[Progress] = []
    News(told.append).begin(Pace(0, 3), float)
    assert [(each.done, each.total) for each in told] == [(0, 3)]

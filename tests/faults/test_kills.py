"""The campaign of kills: long jobs are killed at random moments, and come to the result of an undisturbed one.

50 kills of each kind, or as many as GAPWALK_KILLS says: ``make campaign``.
"""

import os
import random
import signal
import sqlite3
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from contextlib import closing
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.results.result_file import lock
from gapwalk.studies.sweep_study import Sweep
from tests.studies import diagrams, jobs, studies, sweeps
from tests.studies.same import assert_same_branch, assert_same_result

pytestmark = pytest.mark.slow
ROOT = Path(__file__).resolve().parents[2]
KILLS = int(os.environ.get("GAPWALK_KILLS", "50"))


class Job(NamedTuple):
    """A program that writes a line for all that is safe, how much a file then holds, and what is to come out."""

    code: str
    stored: Callable[[Path], int]
    assert_whole: Callable[[Path], None]


def _points(path: Path) -> int:
    return len(gw.open_result(path).branches[0].points) - 1


def parts_of(path: Path) -> Mapping[tuple[str, int], tuple[str, bytes]]:
    with closing(sqlite3.connect(path)) as connection:
        rows = connection.execute("SELECT name, number, head, arrays FROM part WHERE name NOT IN ('versions', 'seal')")
        return {row[:2]: row[2:] for row in rows}


def _last_result(folder: Path) -> Path:
    """Of an exploration: a job that was killed before it had a result has left its number only."""
    results = folder / "model.explorer"
    found = sorted(results.glob("*.gapwalk"))
    return found[-1] if found else results / "none"


def _same_as(study: gw.Study) -> Callable[[Path], None]:
    undisturbed = cache(lambda: gw.run(study))

    def check(path: Path) -> None:
        assert_same_result(gw.open_result(path), undisturbed())

    return check


def _same_as_the_model(path: Path) -> None:
    """The explorer has a text of its own for the study, and the same branch."""
    expected = gw.run(gw.read_study(path.parents[1] / "model.toml"))
    assert_same_branch(gw.open_result(path).branches[0], expected.branches[0])


def _same_finding(kind: str) -> Callable[[Path], None]:
    @cache
    def undisturbed(again: Path) -> Mapping[tuple[str, int], tuple[str, bytes]]:
        jobs_alone = f"from tests.studies.jobs import main; main({kind!r}, {str(again)!r})"
        subprocess.run([sys.executable, "-c", jobs_alone], cwd=ROOT, env=environment(), check=True)
        return parts_of(again)

    def check(path: Path) -> None:
        assert parts_of(path) == undisturbed(path.parents[1] / "undisturbed.gapwalk")  # byte for byte

    return check


def _same_sweep(path: Path) -> None:
    found = gw.open_result(path)
    assert found.complete
    np.testing.assert_array_equal(found.sections, _undisturbed_sweep().sections)


@cache
def _undisturbed_sweep() -> Sweep:
    return gw.sweep(*sweeps.FOLDS, **sweeps.options(workers=2))


JOBS = {
    "walk": Job("from tests.studies.studies import main; main({path!r})", _points, _same_as(studies.long_study())),
    "diagram": Job(
        "from tests.studies.diagrams import main; main({path!r}, '2')",
        lambda path: len(gw.open_result(path).branches),
        _same_as(diagrams.many_branches()),
    ),
    "sweep": Job(
        "from tests.studies.sweeps import main; main({path!r})",
        lambda path: int((~np.isnan(gw.open_result(path).sections)).any(axis=(2, 3)).sum()) and 1,
        _same_sweep,
    ),
    **{
        kind: Job(
            f"from tests.studies.jobs import main; main({kind!r}, {{path!r}})",
            lambda path: len(parts_of(path)) - 1,  # the request is no part of the work
            _same_finding(kind),
        )
        for kind in ("basins", "regimes")
    },
    "explorer": Job("from tests.faults.exploring import main; main({path!r})", _points, _same_as_the_model),
}


@pytest.mark.parametrize("kind", JOBS)
def test_no_kill_loses_anything(tmp_path, kind, monkeypatch) -> None:
    random.seed(1995)
    for module, name, value in jobs.SMALL:  # as the programs have it
        monkeypatch.setattr(module, name, value)
    job, kills, rounds = JOBS[kind], 0, 0
    while kills < KILLS:
        folder = tmp_path / str(rounds)
        folder.mkdir()
        path, complete = folder / "job.gapwalk", False
        if kind == "explorer":
            path = folder / "model.explorer" / "none"
        while not complete:
            lines, was_killed = _run_and_kill(job.code.format(path=str(path)), kills < KILLS)
            kills += was_killed
            complete = "complete" in lines
            path = _last_result(folder) if kind == "explorer" else path
            assert_nothing_is_left(path)
            if kind in ("walk", "explorer") and path.exists():
                reported = max((int(line) for line in lines if line.isdigit()), default=0)
                assert job.stored(path) >= reported
            elif lines and path.exists():
                assert job.stored(path) >= len(set(lines)) - complete or kind == "sweep"
        job.assert_whole(path)
        assert path.name in os.listdir(path.parent)
        assert not [name for name in os.listdir(path.parent) if name.endswith(("-wal", "-shm", "-lock", "-new"))]
        rounds += 1
    print(f"{kind}: {kills} kills, {rounds} times to the end")


def environment() -> dict[str, str]:
    return {**os.environ, "PYTHONPATH": f"{ROOT / 'src'}{os.pathsep}{ROOT}", "MPLBACKEND": "Agg"}


def _run_and_kill(code: str, may_kill: bool) -> tuple[list[str], bool]:
    """The lines of a program that is killed at a random moment, if it is not at its end before."""
    program = subprocess.Popen(
        [sys.executable, "-c", code],
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        cwd=ROOT,
        env=environment(),
        start_new_session=True,
    )
    assert program.stdout is not None
    lines, was_killed = [], False
    aim = random.choice((0, 1, 1, 2, 3, 5, 50, 300))  # lines; at 0 it is killed before the first
    if may_kill and aim == 0:
        time.sleep(random.uniform(0.0, 4.0))
        was_killed = program.poll() is None
        program.kill()
    for line in program.stdout:
        lines.append(line.strip())
        if may_kill and not was_killed and len(lines) >= aim:
            time.sleep(random.choice((0.0, random.uniform(0.0, 0.3))))
            was_killed = program.poll() is None
            program.kill()
    program.stdout.close()
    assert program.wait() == (-signal.SIGKILL if was_killed else 0)
    assert_group_ends(program.pid)
    return lines, was_killed


def assert_group_ends(group: int) -> None:
    """No worker outlives the program that it worked for."""
    for _ in range(600):
        try:
            os.killpg(group, 0)
        except ProcessLookupError:
            return
        time.sleep(0.05)
    raise AssertionError("processes are left over")


def assert_nothing_is_left(path: Path) -> None:
    """Nobody holds the file."""
    if path.parent.is_dir():
        with lock(path):
            pass

"""Workers: pieces in order, none that is superfluous, and no process that outlives its master."""

import os
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import pytest

from gapwalk.errors import NumericalError
from gapwalk.study.workers import workers

ROOT = Path(__file__).resolve().parents[2]


def slow_double(number: int) -> int:
    time.sleep(0.2 if number % 2 == 0 else 0.0)  # the first ones are done last
    return 2 * number


def die(_: int) -> None:
    os.kill(os.getpid(), signal.SIGKILL)


@pytest.mark.parametrize("count", [1, 2])
def test_results_come_in_order_and_superfluous_pieces_are_left_out(count) -> None:
    accepted = []

    def is_needed(index: int) -> bool:
        return index != 3 or 2 not in accepted

    with workers(count) as hands:
        hands.run(slow_double, [0, 1, 2, 3], lambda index, result: accepted.append(result), is_needed)
    assert accepted == [0, 2, 4]


def test_a_process_that_dies_is_told() -> None:
    with workers(2) as hands, pytest.raises(NumericalError, match="a worker process died"):
        hands.run(die, [1], lambda *_: None)


SCRIPT = """
import os
from gapwalk.study.workers import workers

def ready(index, result):
    print(index, flush=True)

print("master", os.getpid(), flush=True)  # no guard: the processes must not run this script
with workers(2) as hands:
    hands.run({work}, [{pieces}], ready)
print("done", flush=True)
"""


def start(tmp_path, work: str, pieces: str) -> subprocess.Popen:
    script = tmp_path / "script.py"
    script.write_text(SCRIPT.format(work=work, pieces=pieces))
    environment = {**os.environ, "PYTHONPATH": f"{ROOT / 'src'}{os.pathsep}{ROOT}"}
    return subprocess.Popen(
        [sys.executable, str(script)], stdout=-1, stderr=-1, text=True, env=environment, start_new_session=True
    )


def children(pid: int) -> list[int]:
    """The worker processes of a process."""
    found = []
    for status in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):
            parent = status.read_text().rpartition(")")[2].split()[1]
            if parent == str(pid) and b"spawn_main" in (status.parent / "cmdline").read_bytes():
                found.append(int(status.parent.name))
    return found


def test_a_script_needs_no_guard(tmp_path) -> None:
    program = start(tmp_path, "abs", "-1, -2")
    out, err = program.communicate(timeout=60)
    assert err == ""
    assert out.splitlines() == [f"master {program.pid}", "0", "1", "done"]


@pytest.mark.parametrize("how", ["ctrl-c", "kill"])
def test_no_process_outlives_its_master(tmp_path, how) -> None:
    program = start(tmp_path, "__import__('time').sleep", "0, 0, 60, 60")
    assert program.stdout is not None
    while program.stdout.readline() != "1\n":
        pass
    pids = children(program.pid)
    if how == "ctrl-c":
        os.killpg(program.pid, signal.SIGINT)  # as a terminal does
    else:
        program.kill()
    _, err = program.communicate(timeout=20)
    deadline = time.monotonic() + 10
    while any(os.path.exists(f"/proc/{pid}") for pid in pids) and time.monotonic() < deadline:
        time.sleep(0.02)
    assert len(pids) == 2
    assert not [pid for pid in pids if os.path.exists(f"/proc/{pid}")]
    if how == "ctrl-c":
        assert err.count("Traceback") == 1  # that of the master alone

"""Nothing is left of a server that is killed: neither its engine, running or held, nor the engine's own workers."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from tests.explorer.conftest import STOP
from tests.tiers import keeps
from tests.waiting import until

SERVER = """
import sys, time
from pathlib import Path
from gapwalk.explorer.server_state import Session

session = Session(Path(sys.argv[1]))
entry = session.act("long.toml", {"do": "compute"})
while not entry.live.steps:
    time.sleep(0.05)
if sys.argv[2] == "held":
    session.jobs.pause(entry)
    time.sleep(0.5)
count = len(entry.live.steps)
time.sleep(0.7)
print(session.jobs._engine._process.pid, len(entry.live.steps) - count, flush=True)
time.sleep(3600)
"""


def is_alive(pid: int) -> bool:
    """Whether a process is there, and no mere entry that nobody has asked for yet."""
    try:
        return Path(f"/proc/{pid}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


@keeps("held")
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="processes are looked up in /proc")
@pytest.mark.parametrize("way", ["running", "held"])
def test_the_engine_of_a_killed_server_ends(tmp_path, way) -> None:
    long = STOP + "\n[study.walk]\ninitial_step = 1e-5\nlargest_step = 1e-5\nmax_points = 1000000\n"
    (tmp_path / "long.toml").write_text(long, encoding="utf-8")
    command = [sys.executable, "-c", SERVER, str(tmp_path), way]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as server:
        assert server.stdout is not None
        engine, grown = (int(word) for word in server.stdout.readline().split())
        assert (grown == 0) == (way == "held")
        assert is_alive(engine)
        os.kill(server.pid, signal.SIGKILL)
        server.wait()
        until(lambda: not is_alive(engine), "the engine ends")

"""Waiting for what another process or thread does; how long it may take says nothing, as the machine may be busy."""

import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import TypeVar

T = TypeVar("T")

PATIENCE = 600.0  # seconds after which something is broken, on any machine and under any load


def until(look: Callable[[], T], what: str) -> T:
    """What a function returns, as soon as that is true."""
    end = time.monotonic() + PATIENCE
    while not (found := look()):
        assert time.monotonic() < end, f"waited for {PATIENCE:g} s: {what}"
        time.sleep(0.01)
    return found


def children(pid: int) -> list[int]:
    """The worker processes of a process: those of its server of processes."""
    workers = {}
    for status in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):
            parent = int(status.read_text().rpartition(")")[2].split()[1])
            if b"multiprocessing.forkserver" in (status.parent / "cmdline").read_bytes():
                workers[int(status.parent.name)] = parent
    servers = {server for server, parent in workers.items() if parent == pid}
    return [worker for worker, parent in workers.items() if parent in servers]


def ticks(pid: int) -> int:
    """Processor time that a process has used, in hundredths of a second; 0 if there is none."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()
    except OSError:
        return 0
    return int(fields[11]) + int(fields[12])

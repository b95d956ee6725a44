"""Time until the command line responds: the help, the check of a file, and the first point of a walk."""

from __future__ import annotations

import json
import os
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import urllib.request
from pathlib import Path
from typing import Any

from benchmarks.effort import Effort
from benchmarks.row import Row, Target

GROUP = "Start of a new process"
_MODEL = Path(__file__).resolve().parents[1] / "examples" / "clutch.toml"
_MOST = 5  # processes for each line
_POLL = 0.02  # seconds between two looks at what the explorer has

# what a first point loaded before, and does not need
_SLOW_IMPORTS = "import scipy.optimize, gapwalk.studies.verify\n"

# stops as soon as the first point is in the file, and would be on the screen
_FIRST_POINT = """\
import os, sys
from gapwalk.cli import main, progress
progress.ProgressLine.__call__ = lambda *_: os._exit(0)
main(["run", sys.argv[1], "--output", sys.argv[2], "--force", "--quiet"])
sys.exit("there was no point")
"""


def rows(effort: Effort) -> list[Row]:
    """Measure all lines; compiled modules and flows are on disk from the first process on."""
    repeats = min(effort.repeats, _MOST)
    with tempfile.TemporaryDirectory() as folder:
        output = str(Path(folder) / "clutch.gapwalk")
        run = ["run", str(_MODEL), "--output", output, "--force", "--quiet"]
        first = [str(_MODEL), output]
        return [
            Row(GROUP, "gapwalk --help", least(["-m", "gapwalk", "--help"], repeats), targets=(Target(0.15),)),
            Row(GROUP, "gapwalk check, figure 13", least(["-m", "gapwalk", "check", str(_MODEL)], repeats)),
            Row(
                GROUP,
                "gapwalk run, figure 13: first point",
                least(["-c", _FIRST_POINT, *first], repeats),
                least(["-c", _SLOW_IMPORTS + _FIRST_POINT, *first], repeats),
                "slow imports",
                (Target(0.8),),
                note="The baseline loads what is not needed before: SciPy's optimize, verification",
            ),
            Row(GROUP, "gapwalk run, figure 13: all, with pictures", least(["-m", "gapwalk", *run], repeats)),
            explored(repeats),
        ]


def explored(repeats: int) -> Row:
    """Measure from the command to the first point of a branch that the server tells of; no browser is started.

    Two processes start side by side, the server and the one that computes, so on an idle machine the wall time is less
    than their CPU time.
    """
    times = [_explored_once() for _ in range(repeats + 1)][1:]
    used, wall = min(times)[0], min(wall for _, wall in times)
    note = f"{wall:.3g} s of wall time, of which 2 s are allowed on an idle machine; without the browser's own start"
    return Row(GROUP, "gapwalk explore, figure 13: first point", used, counts={"wall": round(wall, 2)}, note=note)


def _explored_once() -> tuple[float, float]:
    """Return CPU and wall seconds until the explorer of a copy of the model has a point."""
    with tempfile.TemporaryDirectory() as folder:
        model = Path(shutil.copy(_MODEL, folder))
        used, begun = _children(), time.perf_counter()
        command = [sys.executable, "-m", "gapwalk", "explore", str(model), "--no-browser"]
        environment = {**os.environ, "PYTHONDONTWRITEBYTECODE": ""}
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment) as server:
            assert server.stdout is not None
            server.stdout.readline()
            address = server.stdout.readline().strip()
            _ask(address + "api/act", {"file": model.name, "do": "compute"})
            while not any(
                branch["points"]
                for found in _ask(f"{address}api/about?file={model.name}")["results"]
                for branch in found["branches"]
            ):
                time.sleep(_POLL)
            wall = time.perf_counter() - begun
            server.send_signal(signal.SIGINT)
    return _children() - used, wall


def _ask(address: str, content: dict[str, str] | None = None) -> Any:
    """Return the answer of the explorer's server, as the page gets it."""
    data = None if content is None else json.dumps(content).encode()
    asked = urllib.request.Request(address, data, {"content-type": "application/json"})
    with urllib.request.urlopen(asked, timeout=60.0) as answer:
        return json.load(answer)


def least(words: list[str], repeats: int) -> float:
    """Return the CPU seconds of a Python process with these arguments and of its children; the least of several."""
    return min([once(words) for _ in range(repeats + 1)][1:])  # one more, that compiles


def once(words: list[str], **variables: str) -> float:
    """Return the CPU seconds of one Python process with these arguments and variables, and of its children."""
    environment = {**os.environ, "PYTHONDONTWRITEBYTECODE": "", **variables}
    before = _children()
    subprocess.run([sys.executable, *words], env=environment, check=True, stdout=subprocess.DEVNULL)
    return _children() - before


def _children() -> float:
    # in microseconds, where `os.times` counts ticks of ten milliseconds
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime

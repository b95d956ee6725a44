"""Time until the command line responds: the help, the check of a file, and the first point of a walk."""

from __future__ import annotations

import os
import resource
import subprocess
import sys
import tempfile
from pathlib import Path

from benchmarks.effort import Effort
from benchmarks.row import Row, Target

GROUP = "Start of a new process"
_MODEL = Path(__file__).resolve().parents[1] / "examples" / "clutch.toml"
_MOST = 5  # processes for each line

# what a first point loaded before, and does not need
_SLOW_IMPORTS = "import scipy.optimize, numpy.testing, numpy.f2py, gapwalk.studies.verify\n"

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
                note="The baseline loads what is not needed before: SciPy's optimize, NumPy's tests, verification",
            ),
            Row(GROUP, "gapwalk run, figure 13: all, with pictures", least(["-m", "gapwalk", *run], repeats)),
        ]


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

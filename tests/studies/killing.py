"""Programs of the tests that are killed while they work."""

from __future__ import annotations

import os
import random
import subprocess
import sys
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def killed_after(count: int, code: str, longest_wait: float = 0.0) -> list[str]:
    """The lines that a program of Python prints, which is killed a moment after the one of that number, if it comes."""
    program = subprocess.Popen(
        [sys.executable, "-c", code],
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,  # what multiprocessing leaves behind is told there
        text=True,
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": f"{ROOT / 'src'}{os.pathsep}{ROOT}"},
    )
    assert program.stdout is not None
    lines = []
    for line in program.stdout:
        lines.append(line.strip())
        if len(lines) == count:
            time.sleep(random.uniform(0.0, longest_wait))  # so that it dies at any place, not just after a report
            program.kill()
            break
    lines += [line.strip() for line in program.stdout]
    program.stdout.close()
    program.wait()
    return lines

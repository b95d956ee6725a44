"""A model file that is walked in a moment, and the command to walk it with."""

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

MODEL = """
title = "A stop"
coordinates = ["x"]
stiffness = [1.0]
damping = [0.05]
frequency = 0.7

[[contact]]
name = "stop"
deflection = { x = 1.0 }
clearance = 1.0
stiffness = 20.0
side = "positive"
impact_damping = 0.1

[[harmonic]]
amplitude = 0.2
acts_on = { x = 1.0 }

[study]
kind = "response"
parameter = "frequency"
from = 0.7
to = 1.9
measure = "half.x"
"""


@pytest.fixture
def model(tmp_path, monkeypatch) -> Path:
    """The model file, in the folder in which the test then runs."""
    monkeypatch.chdir(tmp_path)
    path = Path("stop.toml")
    path.write_text(MODEL)
    return path


@pytest.fixture
def command(tmp_path) -> Callable[..., subprocess.Popen]:
    """Starts ``gapwalk`` as a program of its own."""

    def start(*words: str) -> subprocess.Popen:
        return subprocess.Popen(
            [sys.executable, "-m", "gapwalk", *words],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            cwd=tmp_path,
            env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path), "MPLBACKEND": "Agg"},
        )

    return start

"""A model file that is walked in a moment, and the command to walk it with."""

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from tests import models

MODEL = models.STOP + models.response(1.9)


@pytest.fixture(autouse=True)
def wide(monkeypatch) -> None:
    """Text that is not folded, unless a test asks for a width."""
    monkeypatch.setenv("COLUMNS", "1000")


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

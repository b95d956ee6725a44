"""The examples of basins and regime maps, in a few cells."""

import runpy
import sys
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"


@pytest.mark.parametrize(("name", "cells", "words"), [("basins", 8, "of all starts"), ("regimes", 3, "3 x 3 cells")])
def test_an_example_draws_its_picture(name, cells, words, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", [name, str(cells)])
    monkeypatch.setattr("gapwalk.parallel.workers.local_cores", lambda: 1)
    runpy.run_path(str(EXAMPLES / f"{name}.py"), run_name="__main__")
    assert words in capsys.readouterr().out
    assert (tmp_path / f"{name}.png").stat().st_size > 10_000

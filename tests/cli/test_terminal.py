"""Results of all kinds in a pseudo-terminal of 80, 100 and 120 columns: no digit is cut, and JSON stays JSON."""

import io
import json
import os
import re
import sys
import threading
from collections import Counter
from pathlib import Path

import pytest
from rich.console import Console

import gapwalk as gw
from gapwalk.cli import main, progress
from gapwalk.model.model_source import parse_source
from gapwalk.studies.study_file import check_study
from gapwalk.studies.study_kind import kind_of, kinds
from tests import models
from tests.studies import diagrams, families, jobs, maps
from tests.studies.test_locus_study import study_of as locus

pty = pytest.importorskip("pty")  # there is none on Windows
_NUMBER = re.compile(r"(?<![\w.])[-+]?\d[\d,]*\.\d+(?:e[-+]\d+)?(?![\w.])")
BRANCHES = {
    "response": lambda path: gw.run(check_study(parse_source(models.STOP + models.response(1.9))), path),
    "diagram": lambda path: path.write_bytes(diagrams.islands_file()),
    "map": lambda path: path.write_bytes(maps.map_file()),
    "locus": lambda path: gw.run(locus(), path),
    "family": lambda path: path.write_bytes(families.family_file()),
}


def test_all_kinds_are_shown() -> None:
    assert {*BRANCHES, *jobs.MODELS} == {name for name in kinds() if kind_of(name).__module__.startswith("gapwalk.")}


def in_terminal(words: list[str], width: int, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Return the lines that a command prints on a terminal of some width, without its colours."""
    source, sink = pty.openpty()
    monkeypatch.setenv("COLUMNS", str(width))
    monkeypatch.setenv("TERM", "xterm")
    parts: list[bytes] = []

    def read() -> None:
        while b"\x04end" not in b"".join(parts[-2:]):
            parts.append(os.read(source, 65536))

    reader = threading.Thread(target=read)
    reader.start()
    with os.fdopen(sink, "w", encoding="utf-8") as screen:
        monkeypatch.setattr(sys, "stdout", screen)
        code = main(words)
        print("\x04end", file=screen, flush=True)
        reader.join()
        monkeypatch.undo()
    os.close(source)
    assert code == 0
    text = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", b"".join(parts).decode()).partition("\x04")[0]
    return [line.rstrip() for line in text.splitlines()]


@pytest.mark.parametrize("kind", [*BRANCHES, *jobs.MODELS])
def test_no_digit_of_a_result_is_cut(kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "x.gapwalk"
    BRANCHES.get(kind, lambda path: path.write_bytes(jobs.result_file(kind)))(path)
    whole = _NUMBER.findall("\n".join(in_terminal(["show", str(path), "--points"], 2000, monkeypatch)))
    assert whole
    for width in (80, 100, 120):
        lines = in_terminal(["show", str(path), "--points"], width, monkeypatch)
        text = "\n".join(lines)
        assert max(len(line) for line in lines if str(path) not in line) <= width
        assert "…" not in text
        shown, rest = Counter(_NUMBER.findall(text)), Counter(whole)
        assert shown <= rest if "left out at" in text else shown == rest  # whole columns, which are named
    document = json.loads("\n".join(in_terminal(["show", str(path), "--json"], 80, monkeypatch)))
    assert (document["kind"], document["complete"]) == (kind, True)


@pytest.mark.parametrize("width", [60, 80, 120])
def test_progress_cuts_neither_its_name_nor_its_time(width: int, monkeypatch: pytest.MonkeyPatch) -> None:
    page = io.StringIO()
    screen = Console(file=page, force_terminal=True, width=width, color_system=None)
    monkeypatch.setattr(progress, "console", lambda **_: screen)
    line = progress.ProgressLine("drag", lambda *words: words, total=1.0)
    reached = "threshold of mean.gear from -1 to -8 at which mesh ceases to rattle over speed from 700 to 1100"
    line.update("drag", reached, 0.4)
    screen.print(line._progress.get_renderable())
    words = page.getvalue().split()
    assert {"drag", "0:00:00", *reached.split()} <= set(words)

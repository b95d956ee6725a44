"""The history of measurements, one line of JSON for each run, and the changes since the last run on such a machine."""

from __future__ import annotations

import json
import os
import platform
import subprocess
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path

from benchmarks.row import Row

FILE = Path(__file__).with_name("history.jsonl")

SLOWER = 0.8
"""A line that reaches less than this share of its last speed is reported as a regression. The ratio to a baseline in
the same run is compared; its noise on shared machines is smaller than that."""


@dataclass(frozen=True)
class Figure:
    """The stored figures of a row: CPU seconds, and the ratio to its baseline, if it has one."""

    seconds: float
    ratio: float | None

    def speed_since(self, earlier: Figure) -> float:
        """How many times as fast as earlier; by the ratio to the baseline, which other work on the machine leaves."""
        if self.ratio is not None and earlier.ratio is not None:
            return self.ratio / earlier.ratio
        return earlier.seconds / self.seconds


@dataclass(frozen=True)
class Entry:
    """One run: its date, commit (with a + if files had changed), machine, effort, and figures."""

    date: str
    commit: str
    machine: str
    effort: str
    figures: Mapping[str, Figure]

    def change(self, row: Row, since: Entry | None) -> float | None:
        """Return how many times as fast a row of this run is as in an earlier run; None if that run has no such row."""
        name = name_of(row)
        if since is None or name not in since.figures:
            return None
        return self.figures[name].speed_since(since.figures[name])


def name_of(row: Row) -> str:
    """Return the name of a row in the history."""
    return f"{row.group}: {row.what}"


def entry_of(rows: Sequence[Row], effort: str) -> Entry:
    """Return the entry of this run."""
    figures = {name_of(row): Figure(row.seconds, row.ratio) for row in rows}
    return Entry(f"{datetime.now(UTC):%Y-%m-%d}", _commit(), machine(), effort, figures)


def machine() -> str:
    """Describe the kind of this machine in general terms."""
    version = ".".join(platform.python_version_tuple()[:2])
    return f"{platform.system()} {platform.machine()}, {os.cpu_count()} cores, Python {version}"


def read(file: Path = FILE) -> list[Entry]:
    """Return all entries, the oldest first."""
    if not file.exists():
        return []
    return [_entry(json.loads(line)) for line in file.read_text(encoding="utf-8").splitlines() if line]


def last_like(entry: Entry, entries: Sequence[Entry]) -> Entry | None:
    """Return the last entry of the same kind of machine and the same effort."""
    alike = [each for each in entries if (each.machine, each.effort) == (entry.machine, entry.effort)]
    return alike[-1] if alike else None


def append(entry: Entry, file: Path = FILE) -> None:
    """Add a run to the history."""
    with file.open("a", encoding="utf-8") as stream:
        stream.write(json.dumps(asdict(entry)) + "\n")


def regressions(entry: Entry, rows: Sequence[Row], since: Entry | None) -> list[str]:
    """Return a sentence for each row that is clearly slower than in an earlier run."""
    told = []
    for row in rows:
        change = entry.change(row, since)
        if since is not None and change is not None and change < SLOWER:
            told.append(f"slower: {name_of(row)} has {change:.0%} of its speed on {since.date} ({since.commit})")
    return told


def _entry(plain: dict) -> Entry:
    figures = {name: Figure(**figure) for name, figure in plain.pop("figures").items()}
    return Entry(**plain, figures=figures)


def _commit() -> str:
    """Return the measured commit; "unknown" outside of a clone."""
    words = ["git", "describe", "--always", "--abbrev=10", "--exclude=*", "--dirty=+"]
    try:
        done = subprocess.run(words, cwd=FILE.parent, capture_output=True, text=True, check=True)
    except (OSError, subprocess.CalledProcessError):
        return "unknown"
    return done.stdout.strip()

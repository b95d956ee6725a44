"""Compares walks of one system after another: a line of JSON for each in a log, which goes on where it was stopped."""

from __future__ import annotations

import argparse
import json
import os
from collections.abc import Callable, Iterable
from dataclasses import asdict
from pathlib import Path
from typing import Any, Protocol

from gapwalk.errors import GapwalkError


class Compared(Protocol):
    """Outcome of one comparison: a dataclass that can be made with a name and a note alone."""

    __dataclass_fields__: Any

    @property
    def agrees(self) -> bool:
        """True if the walks found the same."""
        ...


def arguments(folder: str, about: str | None) -> argparse.ArgumentParser:
    """Return a parser of the command line of a campaign: the log, and which random systems."""
    parser = argparse.ArgumentParser(prog=f"python -m tests.{folder}", description=about)
    parser.add_argument("log", type=Path, help="one line of JSON for each comparison; what it holds is not done again")
    parser.add_argument("--systems", type=int, default=200, metavar="N", help="random systems (default: 200)")
    parser.add_argument("--first", type=int, default=0, metavar="SEED", help="seed of the first of them")
    return parser


def random_names(options: argparse.Namespace) -> list[str]:
    """``random 0``, ``random 1`` and so on, as many as were asked for."""
    return [f"random {seed}" for seed in range(options.first, options.first + options.systems)]


def compare_all(
    log: Path, names: Iterable[str], compare: Callable[[str], Compared], kind: Callable[..., Compared]
) -> int:
    """Compare what the log does not hold yet; 1 if any walks differ, of those in the log too, otherwise 0."""
    lines = log.read_text(encoding="utf-8").splitlines() if log.exists() else []
    done = {line["name"]: kind(**line) for line in map(json.loads, lines)}
    for name in names:
        if name in done:
            continue
        start = sum(os.times()[:4])  # of this process and of those it has ended
        try:
            done[name] = compare(name)
        except GapwalkError as error:
            done[name] = kind(name, note=f"{type(error).__name__}: {error}")
        with log.open("a", encoding="utf-8") as file:
            file.write(json.dumps(asdict(done[name])) + "\n")
        print(f"{name:12} {sum(os.times()[:4]) - start:6.1f} s  {done[name]}", flush=True)
    differ = [name for name, comparison in done.items() if not comparison.agrees]
    print(f"{len(done)} compared, {len(differ)} differ{''.join(f', {name}' for name in differ)}", flush=True)
    return int(bool(differ))

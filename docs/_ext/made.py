"""The pictures and the quoted answers of these pages, each with the command that makes it, in one list.

    python -m docs._ext.made [--check] [PICTURE OR PAGE ...]

makes pictures again (all, or those that are named), and says which quotes are not what their command answers. With
``--check`` it writes no picture, but compares, and exits with 1 if something differs. Results are kept in out/made;
what is missing of them, as after Ctrl-C, is computed.
"""

from __future__ import annotations

import contextlib
import io
import os
import re
import shlex
import shutil
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from unittest.mock import patch

from gapwalk.cli import main

ROOT = Path(__file__).parents[2]
PICTURES = ROOT / "docs" / "pictures"
KEPT = ROOT / "out" / "made"

_STUDIES = {
    "clutch.png": "examples/clutch.toml",
    "diagram.png": "examples/diagram.toml --study fig15",
    "map.png": "examples/map.toml --study load",
    "family.png": "examples/family.toml --study load",
    "sweep.png": "examples/sweep.toml",
    "regimes.png": "examples/regimes.toml",
    "idle-rattle.png": "examples/idle.toml --study rattle",
    "idle-drag.png": "examples/idle.toml --study drag",
    "idle-quiet.png": "examples/idle.toml --study quiet",
    "idle-tolerance.png": "examples/idle.toml --study scatter",
    "idle-run-ups.png": "examples/idle.toml --study run-ups",
    "idle-friction.png": "examples/idle_friction.toml",
    "gearbox-rattle.png": "docs/tutorial/gearbox.toml --study rattle",
    "gearbox-drag.png": "docs/tutorial/gearbox.toml --study drag",
    "gearbox-damping.png": "docs/tutorial/gearbox.toml --study damping",
    "start-slow.png": "examples/engine_start.toml --study slow",
    "start-fast.png": "examples/engine_start.toml --study fast",
    "start-many.png": "examples/engine_start.toml --study many",
}
MADE = {name: f"gapwalk run {words}" for name, words in _STUDIES.items()} | {
    "rattle.png": "gapwalk measure examples/rattle.toml examples/rattle.csv",
    "modes.png": "gapwalk modes examples/train.toml",
    "kept.png": "python -m tests.explorer.picture docs/pictures/kept.png",
}
"""The command behind each picture; the last ones, of whole families of files, are those of `FAMILIES`."""

FAMILIES = {
    "explorer-*.png": "python -m docs._ext.screenshots",
    "machine-*.svg": "python -m docs._ext.machines",
    "response-*.png": "python -m docs._ext.responses",
    "schematic-*.svg": "python -m docs._ext.schematics",
}
"""Pictures that another maker writes and another test compares."""

QUOTES = {
    "docs/gallery/idle.md": (
        *(_STUDIES[f"idle-{name}.png"] for name in ("rattle", "drag", "quiet", "tolerance", "run-ups", "friction")),
    ),
    "docs/gallery/engine-start.md": (
        _STUDIES["start-slow.png"],
        _STUDIES["start-fast.png"],
        _STUDIES["start-many.png"],
    ),
    "docs/tutorial/rattle.md": tuple(_STUDIES[f"gearbox-{name}.png"] for name in ("rattle", "drag", "damping")),
}
"""Pages that quote answers, and the files and studies of the commands, in the order of the page."""

TABLES = ("end", "point")
"""First headings of the tables of an answer that these pages repeat."""

_COMMAND = re.compile(r"^    gapwalk run (\S+\.toml)(?:(?: --study)? (\S+))?$", re.M)
_NUMBER = re.compile(r"[-+]?\d[\d,]*(?:\.\d+)?(?:e[-+]?\d+)?")
TOLERANCE = 0.001
"""Mean difference of the small copies of two pictures, of 1, up to which they are the same."""
_SMALL = (200, 200)


@dataclass(frozen=True)
class Quote:
    """An answer of a command that a page quotes: a sentence, or the numbers of a row of a table."""

    page: str
    words: str  #: File and study of the command.
    text: str
    is_row: bool = False

    def is_in(self, answer: str) -> bool:
        """Return True if an answer says the same: a sentence word by word, a number of a row to its printed digits."""
        if not self.is_row:
            return _plain(self.text) in _plain(answer)
        said = [each.replace(",", "") for each in _NUMBER.findall(answer)]
        return all(any(_rounds(other, each) for other in said) for each in _NUMBER.findall(_cells(self.text)))


def _plain(text: str) -> str:
    return " ".join(text.split())


def _cells(row: str) -> str:
    """Return the cells of a row without names in backticks, which may hold digits."""
    return re.sub(r"`[^`]*`|(?<![\d.])\d+ %", "", row)


def _rounds(value: str, printed: str) -> bool:
    """Return True if a number is the printed one, or rounds to it."""
    printed = printed.replace(",", "")
    digits = len(printed.partition(".")[2])
    return abs(float(value) - float(printed)) <= 0.5000001 * 10.0**-digits if "e" not in printed else value == printed


def quotes_of(page: str) -> Iterator[Quote]:
    """Yield the quotes on a page, and rows of tables of an answer, each with the last command above it."""
    text = (ROOT / page).read_text(encoding="utf-8")
    places = [(each.end(), each[1], each[2]) for each in _COMMAND.finditer(text)]
    folder = Path(page).parent
    commands = [
        (end, f"{file if (ROOT / file).exists() else folder / file}{f' --study {study}' if study else ''}")
        for end, file, study in places
    ]
    for match in re.finditer(r"(?:^> ?.*\n)+", text, re.M):
        words = next((words for end, words in reversed(commands) if end <= match.start()), "")
        for part in re.sub(r"^> ?", "", match[0], flags=re.M).split("\n\n"):
            yield Quote(page, words, part.strip())
    for table in re.finditer(rf"^\| ({'|'.join(TABLES)}) \|.*\n(?:\|.*\n)+", text, re.M):
        words = next(words for end, words in reversed(commands) if end <= table.start())
        yield from (Quote(page, words, row, is_row=True) for row in table[0].splitlines()[2:])


def kept(words: str) -> Path:
    """Return the file in which the result of a file and a study is kept."""
    file, _, study = words.partition(" --study ")
    return KEPT / f"{Path(file).stem}{f'-{study}' if study else ''}.gapwalk"


@cache
def answer(words: str) -> str:
    """Return what the command of a file and a study answers; what is not kept of its result is computed."""
    result = kept(words)
    result.parent.mkdir(parents=True, exist_ok=True)
    _run(f"run {words} --output {shlex.quote(str(result))} --quiet{' --resume' * result.exists()}")
    return _run(f"show {shlex.quote(str(result))}")


def _run(command: str) -> str:
    """Run a command of gapwalk in the folder of the project; return what it prints."""
    printed, told = io.StringIO(), io.StringIO()
    wide = patch.dict(os.environ, COLUMNS="1000")  # answers are quoted unfolded
    with wide, contextlib.chdir(ROOT), contextlib.redirect_stdout(printed), contextlib.redirect_stderr(told):
        code = main(shlex.split(command))
    if code:
        raise SystemExit(f"gapwalk {command}: {told.getvalue()}")
    return printed.getvalue()


def draw(name: str, target: Path) -> None:
    """Write a picture of the list to a file."""
    words = MADE[name].removeprefix("gapwalk ")
    if words == MADE[name]:
        raise SystemExit(f"{name} is made by {words}")
    with tempfile.TemporaryDirectory() as folder:  # a command may write tables beside its picture
        made = Path(folder) / name
        if name in _STUDIES:
            answer(_STUDIES[name])
            _run(f"export {shlex.quote(str(kept(_STUDIES[name])))} --output {shlex.quote(str(made))}")
        else:
            _run(f"{words} {'--picture' if words.startswith('modes') else '--output'} {shlex.quote(str(made))}")
        shutil.copy(made, target)


def difference(one: Path, other: Path) -> float:
    """Return how much two pictures differ: the mean of small copies, of 1; more than 1 if their sizes differ."""
    import numpy as np
    from PIL import Image

    first, second = (Image.open(path).convert("RGB") for path in (one, other))
    if first.size != second.size:
        return 2.0
    arrays = [np.asarray(each.resize(_SMALL, Image.Resampling.BOX), dtype=float) for each in (first, second)]
    return float(np.abs(arrays[0] - arrays[1]).mean()) / 255.0


def problems(name: str) -> list[str]:
    """Return what is stale: a picture of the list, or quotes of a page."""
    if name in QUOTES:
        return [
            f"{name}: gapwalk run {each.words} does not answer: {each.text}"
            for each in quotes_of(name)
            if not each.is_in(answer(each.words))
        ]
    with tempfile.TemporaryDirectory() as folder:
        made = Path(folder) / name
        draw(name, made)
        far = difference(made, PICTURES / name)
    return [f"{name} is not what {MADE[name]} draws: {far:.3f}"] if far > TOLERANCE else []


def _main(words: list[str]) -> int:
    checked, names = "--check" in words, [each for each in words if each != "--check"]
    found = []
    for name in names or [*(each for each in MADE if each != "kept.png"), *QUOTES]:
        if name in QUOTES or checked:
            stale = problems(name)
            found += stale
            print(f"{name}: {'stale' if stale else 'as its command gives it'}", flush=True)
        else:
            draw(name, PICTURES / name)
            print(f"made: docs/pictures/{name}", flush=True)
    print("\n".join(found) or "pictures and quotes are those of their commands")
    return bool(found)


if __name__ == "__main__":
    sys.exit(_main(sys.argv[1:]))

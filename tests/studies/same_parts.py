"""Studies of every kind store the same arrays as another checkout: `python -m tests.studies.same_parts CHECKOUT`.

Each study runs whole, and again stopped after its first and second report and resumed. The parts of both checkouts are
compared byte by byte. A change of form alone passes; a change of numbers does not.
"""

from __future__ import annotations

import argparse
import os
import sqlite3
import subprocess
import sys
import tempfile
from contextlib import closing, suppress
from pathlib import Path

STOPS = (0, 1, 2)  # reports after which a run is stopped; 0: none


def make(folder: Path) -> None:
    """Run all studies of this checkout into files of a folder."""
    import gapwalk as gw
    from gapwalk.model.model_source import parse_source
    from gapwalk.studies.study_file import check_study
    from tests.studies import jobs
    from tests.studies.test_every_study import TEXTS

    for module, name, value in jobs.SMALL:
        setattr(sys.modules[module] if isinstance(module, str) else module, name, value)
    for kind, text in TEXTS.items():
        study = check_study(parse_source(text))
        for stop in STOPS:
            path = folder / f"{kind}-{stop}.gapwalk"
            left = [stop]

            def report(*_: object, left: list[int] = left) -> None:
                left[0] -= 1
                if left[0] == 0:
                    raise KeyboardInterrupt

            with suppress(KeyboardInterrupt):
                gw.run(study, path, report=report if stop else lambda *_: None)
            gw.run(study, path, resume=True)


def parts(path: Path) -> dict[tuple[str, int], bytes]:
    """Return the arrays of the parts of a result file."""
    with closing(sqlite3.connect(path)) as file:
        rows = file.execute("SELECT name, number, arrays FROM part WHERE name != 'moment'")  # one after some seconds
        return {(name, number): arrays for name, number, arrays in rows}


def main() -> int:
    """Run the studies in both checkouts, compare, and return 1 if anything differs."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("checkout", type=Path, help="the other checkout, or - to make the files of this one")
    parser.add_argument("--into", type=Path, help=argparse.SUPPRESS)
    asked = parser.parse_args()
    if asked.into is not None:
        make(asked.into)
        return 0
    root = Path(__file__).parents[2]
    with tempfile.TemporaryDirectory() as folder:
        folders = []
        for number, checkout in enumerate((asked.checkout.resolve(), root)):
            folders.append(Path(folder) / str(number))
            folders[-1].mkdir()
            paths = os.pathsep.join((str(checkout / "src"), str(checkout)))
            command = [sys.executable, str(Path(__file__)), "-", "--into", str(folders[-1])]
            subprocess.run(command, env={**os.environ, "PYTHONPATH": paths}, cwd=checkout, check=True)
        different = 0
        for path in sorted(folders[1].iterdir()):
            before, after = parts(folders[0] / path.name), parts(path)
            wrong = [key for key in sorted(before.keys() | after.keys()) if before.get(key) != after.get(key)]
            different += len(wrong)
            print(f"{path.stem}: {len(after)} parts, {sum(map(len, after.values())):,} bytes", *wrong)
    print("all equal" if not different else f"{different} parts differ")
    return 1 if different else 0


if __name__ == "__main__":
    sys.exit(main())

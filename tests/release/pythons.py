"""Try the wheel on every Python of this machine: ``python -m tests.release.pythons`` (``3.12``: on this one only).

For each, the wheel is installed into two empty environments below out/pythons: with the newest packages that its
dependencies allow, and with the least for which there are wheels. Each does the main job of the README, verifies it,
exports it, and runs the quick tests of this tree against the installed package. ``ends`` tries the oldest and the
newest Python.
"""

import os
import re
import shutil
import subprocess
import sys
import time
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[2]
PLACE = ROOT / "out" / "pythons"
OLDEST, NEWEST = (3, 11), (3, 14)

# What only `make lint`, `make types` and `make docs` need.
NOT_FOR_TESTS = {"basedpyright", "codespell", "furo"}


class Python(NamedTuple):
    """An interpreter, by its version (3, 12)."""

    version: tuple[int, int]
    command: str

    def __str__(self) -> str:
        return "{}.{}".format(*self.version)


def pythons_found() -> list[Python]:
    """Each supported version once, as a command or below a folder of pyenv; a shim without a Python is none."""
    found: dict[tuple[int, int], Python] = {}
    for command in candidates():
        answer = subprocess.run(
            [command, "-c", "import sys, venv; print(*sys.version_info[:2])"],
            check=False,
            capture_output=True,
            text=True,
        )
        if answer.returncode == 0:
            major, minor = map(int, answer.stdout.split())
            if OLDEST <= (major, minor) <= NEWEST:
                found.setdefault((major, minor), Python((major, minor), command))
    return sorted(found.values())


def candidates() -> Iterator[str]:
    """Commands that may be a Python, those on the path first."""
    names = (f"python3.{minor}" for minor in range(OLDEST[1], NEWEST[1] + 1))
    yield from filter(None, map(shutil.which, (*names, "python3", "python")))
    pyenv = Path(os.environ.get("PYENV_ROOT", Path.home() / ".pyenv"))
    yield from map(str, sorted(pyenv.glob("versions/*/bin/python")))


def requirements() -> tuple[list[str], list[str]]:
    """List the dependencies of the package with its extras, and what the tests need besides."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())
    extras = project["project"]["optional-dependencies"].values()
    asked = [*project["project"]["dependencies"], *(each for extra in extras for each in extra)]
    own = [each for each in dict.fromkeys(asked) if name_of(each) != "gapwalk"]  # `all` names the other extras
    known = {name_of(each) for each in own} | NOT_FOR_TESTS
    groups = project["dependency-groups"]
    tests = [*groups["build"], *(each for each in groups["dev"] if isinstance(each, str))]
    return own, [each for each in tests if name_of(each) not in known]


def name_of(requirement: str) -> str:
    """The package of a requirement."""
    return re.split(r"[^\w-]", requirement, maxsplit=1)[0]


def try_on(python: Python, wheel: Path, *, newest: bool) -> None:
    """Install the wheel and use it; raise a CalledProcessError if something fails."""
    own, tests = requirements()
    home = PLACE / f"{python}-{'newest' if newest else 'least'}"
    shutil.rmtree(home, ignore_errors=True)
    outside = {name: value for name, value in os.environ.items() if not name.startswith(("PYTHON", "VIRTUAL_ENV"))}
    environment = {**outside, "MPLBACKEND": "Agg", "CI": ""}

    def call(*words: str | Path, at: Path = ROOT) -> None:
        subprocess.run(list(map(str, words)), cwd=at, env=environment, check=True)

    call(python.command, "-m", "venv", home)
    binary, work = home / "bin", home / "work"
    call(binary / "python", "-m", "pip", "install", "--quiet", "--disable-pip-version-check", "uv")
    install = (binary / "python", "-m", "uv", "pip", "install", "--quiet", "--only-binary", ":all:")
    call(*install, "--resolution", "highest" if newest else "lowest-direct", *own)
    call(*install, wheel, *tests)
    work.mkdir()
    shutil.copy(ROOT / "examples" / "clutch.toml", work)
    program = binary / "gapwalk"
    call(program, "run", "clutch.toml", "--quiet", at=work)
    call(program, "verify", "clutch.gapwalk", at=work)
    call(program, "export", "clutch.gapwalk", "--output", "clutch.html", "--output", "clutch.nc", at=work)
    special_points = (work / "clutch-special-points.csv").read_text().splitlines()
    assert len(special_points) == 1 + 20, f"{len(special_points) - 1} special points, and not 20"
    workers = os.environ.get("WORKERS", "2")
    call(binary / "python", "-m", "pytest", "-p", "no:cacheprovider", f"--numprocesses={workers}", "-m", "quick")


def main() -> int:
    """Try all, say what failed at the end; the exit code."""
    found, asked = pythons_found(), sys.argv[1:]
    if asked == ["ends"]:
        found = list(dict.fromkeys([found[0], found[-1]]))
    elif asked:
        found = [python for python in found if str(python) in asked]
    PLACE.mkdir(parents=True, exist_ok=True)
    for old in PLACE.glob("*.whl"):
        old.unlink()
    subprocess.run([sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", PLACE], cwd=ROOT, check=True)
    (wheel,) = PLACE.glob("*.whl")
    results = []
    for python in found:
        for newest in (True, False):
            words, begun = f"Python {python} with the {'newest' if newest else 'least'} packages", time.monotonic()
            print(f"== {words}", flush=True)
            try:
                try_on(python, wheel, newest=newest)
                results.append((words, "passed", begun))
            except (subprocess.CalledProcessError, AssertionError) as error:
                print(error, flush=True)
                results.append((words, "FAILED", begun))
            print(f"{words}: {results[-1][1]} in {time.monotonic() - begun:.0f} s", flush=True)
    print(*(f"{words}: {outcome}" for words, outcome, _ in results), sep="\n")
    return int(any(outcome == "FAILED" for _, outcome, _ in results) or not results)


if __name__ == "__main__":
    raise SystemExit(main())

"""Each promise of docs/explanation/validation.md has a test that fails when it is broken: shown by breaking it."""

import os
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "explanation" / "validation.md"
BREAKS = tomllib.loads(Path(__file__).with_name("breaks.toml").read_text())["break"]
NEEDED = ("src", "tests", "benchmarks", "docs", "examples", "pyproject.toml", "README.md", "Makefile", "SECURITY.md")
FAILED = 1  # what pytest says of tests that fail; a broken import or a test that is not there is another number

each_break = pytest.mark.parametrize("broken", BREAKS, ids=[broken["promise"] for broken in BREAKS])


def test_the_page_has_these_promises_with_these_tests():
    rows = re.findall(r"^\| \*\*(.+?)[.:]?\*\*.* \| `(tests/[^`]+)` \|", PAGE.read_text(), re.MULTILINE)
    assert sorted(rows) == sorted((broken["promise"], broken["test"]) for broken in BREAKS)


@each_break
def test_a_promise_can_still_be_broken_as_it_says(broken):
    """The change fits the source as it is now, and the test is there: so the campaign does what it seems to do."""
    assert (ROOT / "src" / "gapwalk" / broken["file"]).read_text().count(broken["old"]) == 1
    file, _, name = broken["test"].partition("::")
    assert f"def {name}(" in (ROOT / file).read_text()


@pytest.mark.slow
@each_break
def test_a_broken_promise_is_noticed(broken, tmp_path):
    for name in NEEDED:
        source, target = ROOT / name, tmp_path / name
        if source.is_dir():
            shutil.copytree(source, target, ignore=shutil.ignore_patterns("__pycache__", ".hypothesis"))
        else:
            shutil.copy(source, target)
    file = tmp_path / "src" / "gapwalk" / broken["file"]
    file.write_text(file.read_text().replace(broken["old"], broken["new"]))
    environment = {**os.environ, "PYTHONPATH": str(tmp_path / "src"), "MPLBACKEND": "Agg"}
    command = [sys.executable, "-m", "pytest", "-x", "-p", "no:cacheprovider", broken["test"]]
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == FAILED, f"{broken['test']} does not notice it: {done.stdout[-2000:]}{done.stderr[-1000:]}"

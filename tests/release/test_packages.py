"""The wheel and the source distribution: all that is needed is in them, and the program runs from the wheel alone."""

import os
import re
import shutil
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
SOURCE = ROOT / "src" / "gapwalk"
NOT_SHIPPED = {"__pycache__"}
SUPPORTED = ("3.11", "3.12", "3.13")
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
VERSION = PROJECT["version"]


@pytest.fixture(scope="module")
def packages(tmp_path_factory):
    """The folder with both, built from a copy of the tree without anything that a build leaves behind."""
    folder = tmp_path_factory.mktemp("dist")
    build("-t", "wheel", "-t", "sdist", "-d", str(folder), at=ROOT)
    return folder


def build(*words, at):
    subprocess.run([sys.executable, "-m", "hatchling", "build", *words], cwd=at, check=True, capture_output=True)


def only(folder, pattern):
    (found,) = folder.glob(pattern)
    return found


def shipped_files():
    files = (file.relative_to(SOURCE.parent) for file in SOURCE.rglob("*") if file.is_file())
    return {file.as_posix() for file in files if not NOT_SHIPPED & set(file.parts)}


def test_the_wheel_holds_every_file_of_the_package_and_no_other(packages):
    with zipfile.ZipFile(only(packages, "*.whl")) as wheel:
        names = {name for name in wheel.namelist() if ".dist-info/" not in name}
    assert names == shipped_files()
    assert {"gapwalk/py.typed", "gapwalk/studies/template.toml", "gapwalk/explorer/page/index.html"} <= names


def test_the_wheel_of_the_source_distribution_is_that_of_the_tree(packages, tmp_path):
    with tarfile.open(only(packages, "*.tar.gz")) as archive:
        archive.extractall(tmp_path, filter="data")
    tree = only(tmp_path, "gapwalk-*")
    build("-t", "wheel", "-d", str(tmp_path), at=tree)
    with zipfile.ZipFile(only(packages, "*.whl")) as first, zipfile.ZipFile(only(tmp_path, "*.whl")) as second:
        assert {each.filename: each.CRC for each in first.infolist()} == {
            each.filename: each.CRC for each in second.infolist()
        }
    needed_files = "README.md LICENSE SECURITY.md CODE_OF_CONDUCT.md CITATION.cff Makefile requirements.lock .ci/run"
    for needed in (*needed_files.split(), "tests/conftest.py", ".github/workflows/test.yml"):
        assert (tree / needed).is_file(), f"{needed} is not in the source distribution"


def test_the_extra_all_has_every_other_and_the_core_has_no_web_server():
    extras = PROJECT["optional-dependencies"]
    inside = extras["all"][0].removeprefix("gapwalk[").removesuffix("]").split(",")
    assert {each for name in inside for each in extras[name]} == {
        each for name, extra in extras.items() if name != "all" for each in extra
    }
    assert not {"plotly", "starlette", "uvicorn"} & {each.partition(">")[0] for each in PROJECT["dependencies"]}
    assert all(address.startswith("https://") for address in PROJECT["urls"].values())


def test_a_missing_extra_is_named_with_the_line_to_write(tmp_path):
    """The explorer is asked for where its libraries are hidden."""
    code = """
import sys
from importlib.machinery import PathFinder
class Hidden:
    def find_spec(name, path=None, target=None):
        return None if name in ("plotly", "uvicorn") else PathFinder.find_spec(name, path, target)
sys.meta_path[:] = [each for each in sys.meta_path if each is not PathFinder] + [Hidden]
import gapwalk as gw
try:
    gw.save_html
except gw.errors.ModelError as error:
    print(error)
"""
    answer = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, check=True, capture_output=True, text=True)
    assert answer.stdout.strip() == (
        'the explorer and pages in HTML need plotly, uvicorn; install it: pip install "gapwalk[explorer]"'
    )


def test_version_and_date_of_the_citation_are_those_of_the_release():
    citation = dict(re.findall(r"^(version|date-released): (.+)$", (ROOT / "CITATION.cff").read_text("utf-8"), re.M))
    heading = re.search(r"^## \[(.+)\] - (\S+)$", (ROOT / "CHANGELOG.md").read_text("utf-8"), re.M)
    assert heading is not None
    assert (citation["version"], citation["date-released"]) == heading.groups() == (VERSION, heading[2])
    assert f"gapwalk {VERSION}" in (ROOT / "SECURITY.md").read_text("utf-8")


def test_the_changelog_of_a_release_is_short():
    _, *releases = (ROOT / "CHANGELOG.md").read_text("utf-8").split("\n## ")
    assert releases
    assert all(release.count("\n") <= 42 for release in releases)


@pytest.mark.slow
def test_the_program_runs_from_the_wheel_alone(packages, tmp_path):
    place = tmp_path / "installed"
    command = [sys.executable, "-m", "pip", "install", "-q", "--no-deps", "--target", place, only(packages, "*.whl")]
    subprocess.run(command, check=True, capture_output=True)
    run_the_demo([sys.executable, "-m", "gapwalk"], tmp_path, {**os.environ, "PYTHONPATH": str(place)}, place)


@pytest.mark.slow
@pytest.mark.parametrize("package", ["*.whl", "*.tar.gz"])
@pytest.mark.parametrize("version", SUPPORTED)
def test_a_package_installs_into_an_empty_environment_and_runs(version, package, packages, tmp_path):
    """The core alone: no extra is installed, and those that are asked for are named with the line to write."""
    interpreter = shutil.which(f"python{version}")
    if interpreter is None or subprocess.run([interpreter, "-c", ""], check=False, capture_output=True).returncode:
        pytest.skip(f"there is no Python {version} here")
    environment = tmp_path / "environment"
    subprocess.run([interpreter, "-m", "venv", str(environment)], check=True, capture_output=True)
    python, program = environment / "bin" / "python", str(environment / "bin" / "gapwalk")
    wheels = ("--only-binary", ":all:") if package == "*.whl" else ("--prefer-binary",)
    subprocess.run([python, "-m", "pip", "install", "-q", *wheels, only(packages, package)], check=True)
    run_the_demo([program], tmp_path, clean_environment(), environment)
    words = {"cwd": tmp_path / "workplace", "env": clean_environment(), "capture_output": True, "text": True}
    assert subprocess.run([program, "--version"], check=True, **words).stdout.strip() == VERSION
    page = subprocess.run([program, "export", "model.gapwalk", "-o", "model.html"], check=False, **words)
    assert page.returncode == 2
    assert 'pip install "gapwalk[explorer]"' in " ".join(page.stderr.split())
    subprocess.run([python, "-c", "import gapwalk"], check=True, **words)
    assert seconds_of_import(python, words) < 0.25


def seconds_of_import(python, words):
    """CPU time of `import gapwalk` in a fresh process, beyond that of the interpreter; the least of five."""
    code = "import time; begun = time.process_time(); import gapwalk; print(time.process_time() - begun)"
    return min(float(subprocess.run([python, "-c", code], check=True, **words).stdout) for _ in range(5))


def clean_environment():
    return {name: value for name, value in os.environ.items() if not name.startswith(("PYTHON", "VIRTUAL_ENV"))}


def run_the_demo(program, folder, environment, home):
    """New model, check, run: in an empty folder, with the package at home and not that of the tree."""
    workplace = folder / "workplace"
    workplace.mkdir()

    def call(*words):
        return subprocess.run(words, cwd=workplace, env=environment, check=True, capture_output=True, text=True).stdout

    python = str(Path(program[0]).parent / "python") if len(program) == 1 else program[0]
    assert Path(call(python, "-c", "import gapwalk; print(gapwalk.__file__)").strip()).is_relative_to(home)
    call(*program, "new", "model.toml")
    assert "coordinates" in call(*program, "check", "model.toml")
    call(*program, "run", "model.toml", "--quiet")
    assert "grazing" in call(*program, "show", "model.gapwalk")
    written = {file.name for file in workplace.iterdir()}
    assert {"model.gapwalk", "model.png", "model.svg", "model-points.csv"} <= written

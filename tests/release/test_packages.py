"""The wheel and the source distribution: all that is needed is in them, and the program runs from the wheel alone."""

import os
import shutil
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
SOURCE = ROOT / "src" / "gapwalk"
NOT_SHIPPED = {"__pycache__"}
SUPPORTED = ("3.11", "3.12", "3.13")


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
    for needed in (
        "README.md",
        "LICENSE",
        "SECURITY.md",
        "Makefile",
        "requirements.lock",
        "tests/conftest.py",
        ".ci/run",
    ):
        assert (tree / needed).is_file(), f"{needed} is not in the source distribution"


@pytest.mark.slow
def test_the_program_runs_from_the_wheel_alone(packages, tmp_path):
    place = tmp_path / "installed"
    command = [
        sys.executable,
        "-m",
        "pip",
        "install",
        "-q",
        "--no-deps",
        "--target",
        str(place),
        str(only(packages, "*.whl")),
    ]
    subprocess.run(command, check=True, capture_output=True)
    run_the_demo([sys.executable, "-m", "gapwalk"], tmp_path, {**os.environ, "PYTHONPATH": str(place)}, place)


@pytest.mark.slow
@pytest.mark.parametrize("version", SUPPORTED)
def test_the_wheel_installs_into_an_empty_environment_and_runs(version, packages, tmp_path):
    interpreter = shutil.which(f"python{version}")
    if interpreter is None or subprocess.run([interpreter, "-c", ""], check=False, capture_output=True).returncode:
        pytest.skip(f"there is no Python {version} here")
    environment = tmp_path / "environment"
    subprocess.run([interpreter, "-m", "venv", str(environment)], check=True, capture_output=True)
    python = environment / "bin" / "python"
    subprocess.run(
        [python, "-m", "pip", "install", "-q", "--only-binary", ":all:", only(packages, "*.whl")], check=True
    )
    run_the_demo([str(environment / "bin" / "gapwalk")], tmp_path, clean_environment(), environment)


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

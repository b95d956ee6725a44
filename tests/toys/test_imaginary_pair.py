"""A kind of special point in one file goes through all that special points go through."""

import csv
import json
import math
import subprocess
import sys
from pathlib import Path

import pytest

MODEL = """\
coordinates = ["x"]
mass = [1.0]
stiffness = [1.0]
damping = [0.2]
frequency = 1.6

[[harmonic]]
amplitude = 0.3
acts_on = { x = 1.0 }

[[contact]]
name = "stop"
deflection = { x = 1.0 }
clearance = 100.0
stiffness = 5.0

[[study]]
name = "response"
kind = "response"
parameter = "frequency"
to = 0.7

[[study]]
name = "balanced"
kind = "response"
parameter = "frequency"
to = 0.7
method = "harmonic-balance"

[[study]]
name = "locus"
kind = "locus"
of = "imaginary-pair"
near = 1.33
parameter = "frequency"
from = 1.6
to = 0.7
second = { parameter = "stiffness.x.x", from = 0.7, to = 1.2, at = 1.0 }
"""


def exact(stiffness: float, order: int) -> float:
    """Frequency at which the multipliers exp((-0.1 +- i w) 2 pi/W) of x'' + 0.2 x' + k x = ... are imaginary."""
    return 4.0 * math.sqrt(stiffness - 0.01) / order


def in_process(folder: Path, *lines: str, knows: bool = True) -> str:
    """What a program prints, in a process that knows the toy from its beginning or not; it succeeds."""
    root = Path(__file__).resolve().parents[2]
    head = f"import sys\nsys.path.insert(0, {str(root)!r})\n" + "import tests.toys.imaginary_pair\n" * knows
    call = [sys.executable, "-c", head + "\n".join(lines)]
    done = subprocess.run(call, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def commands(folder: Path, *calls: tuple[str, ...]) -> str:
    """What the command line prints in calls, one after the other, in one process; each succeeds."""
    lines = (f"if main({[*words]!r}): sys.exit({' '.join(words)!r} + ' failed')" for words in calls)
    return in_process(folder, "from gapwalk.cli import main", *lines)


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """A folder with the model and the results of its studies but the locus."""
    folder = tmp_path_factory.mktemp("toy")
    (folder / "toy.toml").write_text(MODEL)
    in_process(
        folder,
        "import gapwalk as gw",
        "for name in ('response', 'balanced'):",
        "    assert gw.run(gw.read_study('toy.toml', name=name), f'toy-{name}.gapwalk').complete",
    )
    return folder


@pytest.fixture(scope="module")
def whole(folder: Path) -> Path:
    """The folder with the locus too."""
    commands(folder, ("run", "toy.toml", "--study", "locus", "--quiet"))
    return folder


def test_it_is_located_stored_and_shown(folder: Path) -> None:
    shown = commands(folder, *(("show", f"toy-{name}.gapwalk", "--json") for name in ("response", "balanced")))
    for document in shown.replace("}\n{", "}\n\0{").split("\0"):
        points = json.loads(document)["special_points"]
        assert [point["kind"] for point in points] == ["imaginary-pair"] * 2
        for point, order in zip(points, (3, 5), strict=True):
            assert abs(point["parameter"] - exact(1.0, order)) < 1e-11
            assert point["uncertainty"] < 1e-11


@pytest.mark.slow
def test_it_is_followed_in_two_parameters(whole: Path) -> None:
    """The branch is followed by another process, which has to know the toy too."""
    commands(whole, ("export", "toy-locus.gapwalk", "--output", "locus.csv"))
    rows = list(csv.DictReader((whole / "locus.csv").read_text(encoding="utf-8").splitlines()))
    stiffness = [float(row["stiffness.x.x"]) for row in rows]
    assert min(stiffness) < 0.75
    assert max(stiffness) > 1.15
    for row, value in zip(rows, stiffness, strict=True):
        assert abs(float(row["frequency"]) - exact(value, 3)) < 1e-9


@pytest.mark.slow
def test_it_is_verified_and_drawn(whole: Path) -> None:
    names = ("toy-response", "toy-locus")
    commands(
        whole,
        *(("verify", f"{name}.gapwalk") for name in names),
        *(("export", f"{name}.gapwalk", "--output", f"{name}.svg") for name in names),
    )
    for name in names:
        assert "imaginary pair" in (whole / f"{name}.svg").read_text(encoding="utf-8")


def test_a_process_that_does_not_know_it_says_so(folder: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "gapwalk", "show", "toy-response.gapwalk"],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 2
    assert "there is no kind of special point 'imaginary-pair'" in done.stderr
    assert "Import the module" in done.stderr


@pytest.mark.slow
def test_it_may_be_registered_after_all_of_gapwalk_is_loaded(folder: Path) -> None:
    (folder / "map.toml").write_text(MODEL.replace("imaginary-pair", "fold"))
    late = (
        "from gapwalk.cli import main",
        "main(['run', 'map.toml', '--study', 'response', '--quiet'])",
        "import tests.toys.imaginary_pair",
        "sys.exit(main(['run', 'toy.toml', '--study', 'locus', '--output', 'late.gapwalk']))",
    )
    assert "1 of imaginary-pair" in in_process(folder, *late, knows=False)
    assert (folder / "late.png").stat().st_size > 1000


@pytest.mark.slow
def test_a_kind_of_the_script_itself_is_not_lost_in_other_processes(folder: Path) -> None:
    toy = (Path(__file__).with_name("imaginary_pair.py")).read_text(encoding="utf-8")
    (folder / "own.py").write_text(
        toy + "\nfrom gapwalk.cli import main\nmain(['run', 'toy.toml', '--study', 'locus', '--force'])\n"
    )
    done = subprocess.run([sys.executable, "own.py"], cwd=folder, capture_output=True, text=True, check=False)
    assert "imaginary-pair" in done.stdout
    assert "only this process works" in done.stderr

"""Studies of reduced systems, from the table [reduction] of a model file to what a result says."""

import json
from pathlib import Path

import numpy as np
import pytest
import scipy.io
import scipy.sparse as sp

from gapwalk import open_result, reduce, run
from gapwalk.cli.commands import app
from gapwalk.errors import StoreError
from gapwalk.model import ModelFileError
from gapwalk.studies.result import result_document
from gapwalk.studies.study_file import read_studies, read_study
from tests.models import read_system

TEXT = """
coordinates = 12
stiffness = "rod.mtx"
damping = { mass = 0.05, stiffness = 0.01 }
[[contact]]
name = "gap"
deflection = { q6 = 1.0 }
clearance = 0.1
stiffness = 1.0
[[harmonic]]
amplitude = 0.05
acts_on = { q2 = 1.0 }
[reduction]
modes = 1
[study]
kind = "response"
parameter = "frequency"
from = 0.15
to = 0.25
measure = "half.q9"
"""


SECOND = """
[[study]]
name = "two"
kind = "settle"
signal = "q11'"
set = { frequency = 0.28 }
"""
LIGHT = "mass = [1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, -1]"


def model(folder: Path, *changes: tuple[str, str]) -> Path:
    matrix = 1.44 * (2.0 * np.eye(12) - np.eye(12, k=1) - np.eye(12, k=-1))
    scipy.io.mmwrite(folder / "rod.mtx", sp.csr_array(matrix), symmetry="symmetric")
    text = TEXT
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    path = folder / "rod.toml"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    folder = tmp_path_factory.mktemp("reduced")
    study = read_study(model(folder))
    return study, run(study, folder / "rod.gapwalk"), folder / "rod.gapwalk"


def test_a_study_is_one_of_the_reduced_system(tmp_path: Path) -> None:
    study = read_study(model(tmp_path))
    assert study.system.coordinates == ("q2", "q6", "q9", "mode1")  # q9 is kept because it is shown
    assert study.system.frequency == 0.15
    origin = study.reduced
    assert origin is not None
    assert (origin.degrees, origin.kept, origin.modes, origin.up_to) == (12, ("q2", "q6", "q9"), 1, 0.25)
    assert origin.reduction is not None
    again = reduce(origin.reduction.full, modes=1, up_to=0.25, keep=["q9"])
    assert origin.error == pytest.approx(again.error)
    assert "reduced from 12 degrees of freedom to 4: 3 kept, 1 modes" in origin.words


def test_what_is_set_is_set_in_the_full_system(tmp_path: Path) -> None:
    changes = {"stiffness.q3.q3": 4.0, "gap.clearance": 0.2}
    study = read_study(model(tmp_path), changes)
    assert study.system["gap.clearance"] == 0.2
    assert study.reduced is not None
    assert study.reduced.reduction is not None
    assert study.reduced.reduction.full["stiffness.q3.q3"] == 4.0


def test_each_study_keeps_what_it_names(tmp_path: Path) -> None:
    path = model(
        tmp_path,
        ("[study]", '[[study]]\nname = "one"'),
        (
            '"half.q9"',
            '"half.q4"\n' + SECOND,
        ),
    )
    one, two = read_studies(path)
    assert one.system.coordinates[:3] == ("q2", "q4", "q6")
    assert two.system.coordinates[:3] == ("q2", "q6", "q11")
    assert two.reduced is not None
    assert two.reduced.up_to == 0.28


@pytest.mark.parametrize(
    ("old", "new", "path", "words"),
    [
        ("modes = 1", "modes = 1\nerror = 0.1", "reduction", "leave one of the two out"),
        ("modes = 1", "modes = -1", "reduction.modes", ">= 0"),
        ("modes = 1", "mode = 1", "reduction.mode", "did you mean modes?"),
        ("modes = 1", "error = 2.0", "reduction.error", "1"),
        ("modes = 1", 'keep = ["q99"]', "reduction", "'q99', which is not a coordinate"),
        ("[reduction]\nmodes = 1", "", "", ""),
        ('"half.q9"', '"half.z"', "study.measure", "there is no signal z"),
        ('"frequency"\n', '"stiffness.q6.q6"\n', "study", "contains what the other coordinates give"),
        (
            'stiffness = "rod.mtx"',
            'stiffness = "rod.mtx"\nmass = [1,1,1,1,1,1,1,1,1,1,1,-1]',
            "mass",
            "the inertia -1",
        ),
    ],
)
def test_a_wrong_table_is_told(tmp_path: Path, old: str, new: str, path: str, words: str) -> None:
    file = model(tmp_path, (old, new), *([("from = 0.15", "")] if "q6.q6" in new else []))
    if not path:
        assert read_study(file).reduced is None
        return
    with pytest.raises(ModelFileError) as caught:
        read_study(file, {"frequency": 0.2} if "q6.q6" in new else None)
    found = [problem for problem in caught.value.problems if problem.path == path]
    assert found, caught.value
    assert words in found[0].message


@pytest.mark.slow
def test_the_result_says_what_the_full_system_says(finished) -> None:
    study, result, path = finished
    assert result.complete
    (check,) = result.checks
    (branch,) = result.branches
    assert check.branch == "P1-1"
    assert len(check.errors) == len(branch.special_points) > 0
    assert study.reduced is not None
    assert study.reduced.reduction is not None
    again = study.reduced.reduction.check(branch)
    assert check.errors == tuple(each.error for each in again.special)
    assert max(check.errors) < 0.02
    assert f"{len(check.errors)} of its {len(check.errors)} special points exist there" in check.words
    stored = open_result(path)
    assert stored.checks == result.checks
    assert stored.study.reduced == study.reduced
    document = result_document(stored)
    assert document["reduction"]["degrees"] == 12
    assert document["checks"][0]["errors"] == list(check.errors)
    json.dumps(document, allow_nan=False)


@pytest.mark.slow
def test_a_finished_study_is_resumed_to_the_same(finished) -> None:
    study, result, path = finished
    assert run(study, path, resume=True).checks == result.checks
    # modes computed elsewhere differ by rounding, which is no other study
    values = study.system.values * (1.0 + 1e-14)
    other = type(study)(
        type(study.system).from_values(study.system.structure, values), study.options, reduced=study.reduced
    )
    assert run(other, path, resume=True).checks == result.checks
    with pytest.raises(StoreError, match="holds the result of something else"):
        run(
            type(study)(study.system.at({"gap.clearance": 0.11}), study.options, reduced=study.reduced),
            path,
            resume=True,
        )


def test_the_command_line_tells_it(finished, capsys) -> None:
    _, _, path = finished
    with pytest.raises(SystemExit) as done:
        app(["show", str(path)])
    assert done.value.code in (0, None)
    text = capsys.readouterr().out
    assert "reduced from 12 degrees of freedom to 4" in text
    assert "P1-1 compared with the full system, by 15 harmonics" in text
    with pytest.raises(SystemExit):
        app(["check", str(path.with_suffix(".toml"))])
    assert "reduced from 12 degrees of freedom to 4" in capsys.readouterr().out


def test_the_system_alone_is_the_full_one(tmp_path: Path) -> None:
    assert read_system(model(tmp_path, ("coordinates = 12", "coordinates = 12\nfrequency = 0.2"))).size == 12

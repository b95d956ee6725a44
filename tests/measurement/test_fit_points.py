"""Parameters fitted to measured special points: they are recovered, their errors are right, and doubts are said."""

import csv

import numpy as np
import pytest
from scipy.stats import chi2

import gapwalk as gw
from gapwalk.cli import main
from gapwalk.errors import ModelError
from gapwalk.model.problems import ModelFileError
from gapwalk.studies.measurement_fit import read_measured_model
from tests.models import CLUTCH
from tests.systems import clutch

TRUE = {"stage2.clearance": 1.02, "mean.q1": 0.245}
NAMES = tuple(TRUE)
ERROR = 1e-4
POINTS = (("fold", 1), ("fold", 2), ("flip", 1), ("grazing", "stage2 +"))


def walked(**changes) -> gw.Branch:
    return gw.follow(gw.find_orbit(clutch(frequency=0.9, **changes)), "frequency", 0.6)


@pytest.fixture(scope="module")
def guess() -> gw.Branch:
    return walked()


@pytest.fixture(scope="module")
def exact() -> list[float]:
    """Values of the points of the true system, from a walk of its own."""
    branch = walked(**TRUE)
    values = []
    for kind, which in POINTS:
        alike = branch.special(kind)
        values.append(alike[which - 1].value if isinstance(which, int) else alike[0].value)
    return values


def measured(values, error: float = ERROR) -> list[tuple]:
    return [(kind, value, error, which) for (kind, which), value in zip(POINTS, values, strict=True)]


def test_exact_points_give_the_parameters_back(guess, exact) -> None:
    found = gw.measure.fit_points(guess, measured(exact), NAMES)
    for name, value in TRUE.items():
        assert abs(found[name].value - value) < 1e-8
        assert 0.0 < found[name].error < 0.01
    assert (found.failures, found.notes, found.freedom) == ((), (), 2)
    assert [point.contact for point in found.points] == ["", "", "", "stage2 +"]
    assert all(abs(point.after - value) < 1e-9 for point, value in zip(found.points, exact, strict=True))
    assert [point.before for point in found.points[:2]] == [each.value for each in guess.special("fold")]
    assert found.branch is not None
    assert {name: found.system[name] for name in NAMES} == {each.name: each.value for each in found.estimates}


@pytest.mark.slow
def test_estimates_scatter_as_their_standard_errors_say(guess, exact) -> None:
    draws, random = 30, np.random.default_rng(19)
    misfits, squares = 0.0, 0.0
    for _ in range(draws):
        noisy = np.array(exact) + random.normal(0.0, ERROR, len(exact))
        points = measured(noisy)
        found = gw.measure.fit_points(guess.special_points, [*points[:2], points[3]], NAMES)
        errors = np.array([each.error for each in found.estimates])
        away = np.array([found[name].value - TRUE[name] for name in NAMES]) / errors
        misfits += float(away @ np.linalg.solve(found.correlation, away))
        squares += found.chi_square
    for value, freedom in ((misfits, 2 * draws), (squares, draws)):
        assert 0.005 < chi2.cdf(value, freedom) < 0.995


def test_parameters_that_the_points_do_not_determine_are_named(guess, exact) -> None:
    """All lengths together only change the unit of length."""
    lengths = ["stage2.clearance", "mean.q1", "mean.q3", "harmonic1.amplitude", "stage2.impact_damping"]
    found = gw.measure.fit_points(guess.special_points, measured(exact, 0.001), lengths)
    text = "\n".join(found.failures)
    assert "the points do not determine" in text
    assert "leaves the points where they are; fit one fewer of them" in text
    free = np.array([each.weights for each in found.combinations if each.singular == 0.0])
    assert np.linalg.norm(free @ np.array([1.0, 1.0, 1.0, 1.0, -1.0])) == pytest.approx(np.sqrt(5.0), abs=1e-6)
    assert all(np.isinf(each.error) for each in found.estimates)
    assert "undetermined" in str(found.summary())
    assert found.chi_square < 1e-8
    few = gw.measure.fit_points(guess.special_points, measured(exact)[:1], NAMES)
    assert [each.error for each in few.estimates].count(np.inf) == 2
    assert "and" in few.failures[0]
    assert few["mean.q1"].value == few["mean.q1"].start or few["stage2.clearance"].value == 1.0


def test_a_parameter_without_effect_is_said_to_have_none(guess, exact) -> None:
    """The phase of the only harmonic shifts the time, and nothing else."""
    found = gw.measure.fit_points(guess.special_points, measured(exact), ["harmonic1.phase", *NAMES])
    assert found.failures == ("the points do not determine harmonic1.phase: it moves none of them",)
    assert (found["harmonic1.phase"].value, found["harmonic1.phase"].error) == (0.0, np.inf)
    assert found["mean.q1"].value == pytest.approx(TRUE["mean.q1"], abs=1e-8)
    assert [each.singular == 0.0 for each in found.combinations] == [False, False, True]
    assert found.combinations[-1].words(found.free_names) == "1.00 harmonic1.phase"


@pytest.mark.slow
def test_a_parameter_that_begins_at_zero_is_found() -> None:
    """Its terms are left out of the equations of the first guess."""
    shapes = [clutch(frequency=0.7, **{"stage2.impact_damping": value}) for value in (0.0, 0.05)]
    guess, true = (gw.follow(gw.find_orbit(system), "frequency", 0.6) for system in shapes)
    points = [("fold", special.value, 1e-4, place) for place, special in enumerate(true.special("fold"), start=1)]
    found = gw.measure.fit_points(guess.special_points, points, ["stage2.impact_damping"])
    assert found["stage2.impact_damping"].value == pytest.approx(0.05, abs=1e-8)
    assert found.failures == ()


def test_a_bound_is_kept_and_a_misfit_is_said(guess, exact) -> None:
    found = gw.measure.fit_points(
        guess.special_points, measured(exact), NAMES, bounds={"stage2.clearance": (0.9, 1.005)}
    )
    assert found["stage2.clearance"].value == pytest.approx(1.005, abs=1e-4)
    assert np.isnan(found["stage2.clearance"].error)
    assert "ended at its bound" in found.notes[0]
    assert "more than their uncertainties" in found.notes[-1]


@pytest.mark.parametrize(
    ("points", "names", "words"),
    [
        ([("fold", 0.63, 0.001)], NAMES, r"may be that at 0\.63959899 or at 0\.61909755; say which, as in which = 2"),
        ([("fold", 0.619, 1e-3), ("fold", 0.6195, 1e-3)], NAMES, "are both nearest to that at 0.61909755; say which"),
        ([("fold", 0.619, 0.001, 3)], NAMES, "is number 3, but the branch has 2"),
        ([("grazing", 0.8, 0.001, "stage2")], NAMES, r"has which = stage2, but the branch has 1: at 0\.8228"),
        ([("neimark-sacker", 0.6, 0.001)], NAMES, "but the branch has none; it has grazing, flip, fold"),
        ([("folt", 0.6, 0.001)], NAMES, "kind is 'folt'; .*fold"),
        ([("fold", 0.6, 0.0)], NAMES, "error of the .* is .*; it must be a number > 0"),
        ([("fold", 0.6)], NAMES, r"write \(kind, value, error\)"),
        ([], NAMES, "no point was measured"),
        ([("fold", 0.619, 0.001)], ["frequency"], "is the parameter of the branch"),
        ([("fold", 0.619, 0.001)], [], "parameters is empty"),
        ([("fold", 0.619, 0.001)], ["stage2.clearence"], "clearance"),
    ],
)
def test_what_is_wrong_is_refused_with_what_to_write(guess, points, names, words) -> None:
    with pytest.raises(ModelError, match=words):
        gw.measure.fit_points(guess, points, names)


MODEL = (
    CLUTCH
    + """
[measurement]
sweep = { parameter = "frequency", from = 0.7, to = 0.61 }
fit = ["stage2.clearance"]
"""
)


def test_the_command_fits_points_of_the_model_or_of_a_csv_file(tmp_path, monkeypatch, capsys, exact) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "points.csv").write_text(f"kind,value,error,which\nfold,{exact[0]},1e-4,1\nfold,{exact[1]},1e-4,2\n")
    table = '[[measurement.point]]\nkind = "fold"\nvalue = {}\nerror = 1e-4\nwhich = {}\n'
    full = MODEL + "".join(table.format(exact[k], k + 1) for k in range(2))
    (tmp_path / "full.toml").write_text(full)
    assert read_measured_model("full.toml").point == gw.measure.read_points("points.csv")
    assert main(["measure", "full.toml", "--fit", "stage2.clearance", "--fit", "mean.q1"]) == 0
    shown = capsys.readouterr().out
    assert "2 parameters fitted to 2 measured points" in shown
    assert "stage2.clearance" in shown
    rows = list(csv.DictReader((tmp_path / "full-measured-parameters.csv").read_text().splitlines()))
    assert {row["name"]: float(row["value"]) for row in rows} == pytest.approx(TRUE, abs=1e-8)
    assert (tmp_path / "full-measured-points.csv").read_text().startswith("kind,contact,before,after,measured,error")
    (tmp_path / "wrong.toml").write_text(full.replace('"fold"', '"folt"', 1))
    with pytest.raises(ModelFileError, match="number 1: kind is 'folt'"):
        read_measured_model("wrong.toml")
    (tmp_path / "points.csv").write_text("kind,value\nfold,0.6\n")
    with pytest.raises(ModelError, match="has no column error"):
        gw.measure.read_points("points.csv")

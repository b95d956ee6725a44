"""Studies of drive trains with units: the same as in non-dimensional form, stored, in tables, and refused."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.errors import ModelError, StoreError
from gapwalk.model.problems import ModelFileError
from gapwalk.orbit.shooting import ShootingEquation
from gapwalk.studies.export import export_csv
from gapwalk.studies.result import result_document
from gapwalk.studies.study_file import without_units

EXAMPLE = Path(__file__).parents[2] / "examples" / "drivetrain.toml"


@pytest.fixture(scope="module")
def speed() -> gw.Result:
    """The example over the speed of its engine."""
    return gw.run(gw.read_study(EXAMPLE, name="speed"))


@pytest.mark.slow
def test_physical_and_non_dimensional_runs_agree(speed: gw.Result) -> None:
    """Special points of two walks, in two systems of different numbers; and every single orbit of one in the other."""
    study = without_units(speed.study)
    form = gw.train.nondimensional(speed.system)
    plain = gw.run(study)
    first, second = speed.branches[0], plain.branches[0]
    assert [special.kind for special in first.special_points] == [special.kind for special in second.special_points]
    assert len(first.special_points) >= 4
    for special, other in zip(first.special_points, second.special_points, strict=True):
        assert form.physical_value("speed", other.value) == pytest.approx(special.value, rel=1e-10)
        state = form.physical_state(other.orbit.state)
        np.testing.assert_allclose(state, special.orbit.state, rtol=1e-10, atol=1e-10 * np.abs(state).max())
    for point in first.points:
        orbit, system = point.orbit, form.system.at(frequency=form.value("speed", point.value))
        state = form.state(orbit.state)
        evaluation = ShootingEquation(system).evaluate(state, system.frequency)
        assert np.abs(evaluation.residual).max() < 1e-10
        exact = ShootingEquation(orbit.system).evaluate(orbit.state, orbit.system.frequency)
        ours, theirs = (np.linalg.eigvals(_transition(each)) for each in (exact, evaluation))
        np.testing.assert_allclose(np.sort(np.abs(ours)), np.sort(np.abs(theirs)), rtol=1e-10)


def _transition(evaluation) -> np.ndarray:
    return evaluation.by_unknowns + np.eye(len(evaluation.by_unknowns))


def test_values_of_studies_have_units() -> None:
    drive, load = gw.studies.read_studies(EXAMPLE, {"study.speed.to": "20 Hz"})
    assert (drive.walked.parameter, drive.walked.begin, drive.walked.end) == ("speed", 3000.0, pytest.approx(1200.0))
    assert (load.walked.begin, load.walked.end, load.system["speed"]) == (60.0, 2.0, 1400.0)


def test_a_parameter_has_the_unit_in_which_its_study_asks() -> None:
    """A gap of 90 arcmin is 1.5 deg in the equations, and is written in arcmin."""
    name, system = "clutch.stage2.clearance", gw.read_study(EXAMPLE, name="load").system
    changes = {"study.load.parameter": name, "study.load.from": "90 arcmin", "study.load.to": "1 deg"}
    load = gw.read_study(EXAMPLE, changes, name="load")
    assert (load.walked.begin, load.walked.end) == (90.0, pytest.approx(60.0, rel=1e-15))
    assert load.system.units.parameter(name) == "arcmin"
    asked, known = load.system.at({name: 90.0, "mean.flywheel": 60.0}), system.at({name: 1.5, "mean.flywheel": 60.0})
    np.testing.assert_allclose(asked.equations.values, known.equations.values, rtol=1e-15)
    assert asked.breakpoints == known.breakpoints


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        (
            {"study.speed.to": 800},
            ['study "speed".to is 800, a number without a unit; write a frequency or speed such as "800'],
        ),
        ({"study.speed.to": "80 N m"}, ['study "speed".to is "80 N m": N m is the unit of a torque']),
        (
            {"clutch.stage2.clearance": 2.0, "hub.inertia": "5 kg"},
            [
                'clutch.stage2.clearance is 2.0, a number without a unit; write an angle such as "2.0 deg"',
                'hub.inertia is "5 kg": kg is the unit of a mass; an inertia is expected, as in "5 kg m^2"',
            ],
        ),
        ({"study.load.set": {"speed": 1500}}, ['study "load".set.speed is 1500, a number without a unit']),
        ({"frequency": "50 Hz"}, ["speed is given together with frequency; leave one of the two out"]),
        ({"vehicle.inertia": "4 kg m^2", "firing.acts_on.flywheel": "1 N m"}, ["it is a plain number"]),
    ],
)
def test_what_has_no_unit_or_a_wrong_one_is_refused(changes: dict, words: list[str]) -> None:
    with pytest.raises(ModelFileError) as error:
        gw.studies.read_studies(EXAMPLE, changes)
    for word in words:
        assert word in str(error.value)


def test_a_result_keeps_its_units(speed: gw.Result, tmp_path: Path) -> None:
    file = tmp_path / "drive.gapwalk"
    study = gw.read_study(EXAMPLE, {"study.speed.to": "2900 rpm"}, name="speed")
    result = gw.run(study, file)
    loaded = gw.open_result(file)
    assert loaded.system == result.system
    assert loaded.system.units == study.system.units
    with pytest.raises(StoreError, match="made of other parts"):
        gw.run(without_units(study), file, resume=True)
    assert gw.run(study, file, resume=True).complete
    export_csv(loaded, {name: tmp_path / f"{name}.csv" for name in loaded.tables()})
    with open(tmp_path / "points.csv", encoding="utf-8", newline="") as table:
        header, first, *_ = csv.reader(table)
    row = dict(zip(header, first, strict=True))
    assert float(row["speed [rpm]"]) == 3000.0
    point = loaded.branches[0].points[0]
    assert float(row["half.clutch [deg]"]) == point.measure("half.clutch")
    assert float(row["clutch'(0) [deg/s]"]) == point.orbit.state[3]
    document = json.loads(json.dumps(result_document(loaded)))
    assert document["parameters"]["speed"] == 3000.0
    assert {document["units"][name] for name in ("speed", "clutch", "gearbox''", "input.torque")} == {
        "rpm",
        "deg",
        "rad/s^2",
        "N m",
    }


def test_only_what_has_units_has_another_form() -> None:
    study = gw.read_study(EXAMPLE.with_name("clutch.toml"))
    with pytest.raises(ModelError, match="the system has no units"):
        without_units(study)


def test_equations_with_units_are_not_reduced(tmp_path: Path) -> None:
    file = tmp_path / "reduced.toml"
    file.write_text(EXAMPLE.read_text(encoding="utf-8") + "\n[reduction]\nmodes = 1\n", encoding="utf-8")
    with pytest.raises(ModelFileError, match="reduction reduces equations without units"):
        gw.studies.read_studies(file)

"""Loads that depend on the speed: by formulas and tables, within the tables only, in systems and in drive trains."""

import pickle
from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import PchipInterpolator

import gapwalk as gw
from gapwalk.bifurcation.loci.locus import LocusEndReason
from gapwalk.continuation.walk import EndReason
from gapwalk.errors import ModelError, NumericalError
from gapwalk.loads import FactorOverSpeed, Steady
from gapwalk.loads import Load as AnyLoad
from gapwalk.model.coefficients import ParameterLine
from gapwalk.model.loads import Harmonic
from gapwalk.model.measured.measured_table import SpeedTable
from tests.sampled_verification import SAMPLED, verified

SPEEDS, FACTORS = (0.5, 0.8, 1.2, 1.5), (1.0, 1.3, 1.3, 2.0)
TABLE = SpeedTable(SPEEDS, FACTORS, "gas.csv")


def system_of(*loads: AnyLoad, frequency: float = 0.7, amplitude: float = 0.3) -> gw.System:
    stop = gw.stop("stop", {"x": 1.0}, clearance=0.5, stiffness=5.0, impact_damping=0.1)
    driving = Harmonic(amplitude, {"x": 1.0}, over_speed=TABLE)
    return gw.System(["x"], [[1.0]], [[0.1]], contacts=[stop], harmonics=[driving, *loads], frequency=frequency)


@pytest.mark.parametrize("frequency", [0.5, 0.61, 1.0, 1.5])
def test_a_table_is_its_monotone_cubic_and_a_formula_itself(frequency: float) -> None:
    factor = FactorOverSpeed("", TABLE)
    expected = PchipInterpolator(SPEEDS, FACTORS)
    assert float(factor.value(frequency)) == pytest.approx(float(expected(frequency)), rel=1e-15)
    slope = np.imag(factor.value(complex(frequency, 1e-150))) / 1e-150
    assert slope == pytest.approx(float(expected.derivative()(frequency)), rel=1e-13, abs=1e-15)
    formula = FactorOverSpeed("sqrt(1 + 0.1*W**2) - tanh(speed)/2", pace=0.5)
    exact = np.sqrt(1.0 + 0.1 * frequency**2) - 0.5 * np.tanh(frequency / 0.5)
    assert formula.value(frequency) == pytest.approx(exact, rel=1e-15)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("1 + k*W", "k is unknown"),
        ("abs(W - 1)", "kink"),
        ("max(W, 1)", "kink"),
        ("max(W - 1, 0)**1.5", "kink"),
        ("1 +", "column"),
    ],
)
def test_other_formulas_are_refused(text: str, words: str) -> None:
    with pytest.raises(ModelError, match=words):
        Harmonic(1.0, {"x": 1.0}, over_speed=text)


def test_a_formula_has_no_value_where_it_ends() -> None:
    system = gw.System(["x"], [[1.0]], harmonics=[Harmonic(1.0, {"x": 1.0}, over_speed="log(W - 1)")], frequency=0.9)
    with pytest.raises(NumericalError, match=r"has no value at W = 0\.9"):
        gw.find_orbit(system)


@pytest.mark.parametrize("given", [3.0, ("table",), ("formula", 3, 1.0)])
def test_so_is_anything_else(given) -> None:
    with pytest.raises(ModelError, match="write a formula such as"):
        Steady(1.0, {"x": 1.0}, over_speed=given)


def test_a_steady_load_is_a_mean_that_depends_on_the_speed() -> None:
    system = system_of(Steady(0.2, {"x": 1.0}, over_speed="1 + 0.5*W**2"), frequency=0.9)
    plain = gw.System(
        ["x"],
        [[1.0]],
        [[0.1]],
        contacts=[gw.stop("stop", {"x": 1.0}, clearance=0.5, stiffness=5.0, impact_damping=0.1)],
        mean={"x": 0.2 * (1.0 + 0.5 * 0.9**2)},
        harmonics=[Harmonic(0.3 * float(TABLE.value(0.9)), {"x": 1.0})],
        frequency=0.9,
    )
    assert np.abs(gw.find_orbit(system).state - gw.find_orbit(plain).state).max() < 1e-11
    rest = [gw.find_equilibria(each).equilibria[0].position for each in (system, plain)]
    np.testing.assert_allclose(rest[0], rest[1], rtol=1e-13)


@pytest.mark.parametrize("sampled", SAMPLED)
def test_a_walk_ends_where_a_table_does_and_keeps_its_points(sampled: int) -> None:
    branch = gw.follow(gw.find_orbit(system_of()), "frequency", (0.2, 3.0))
    assert [(end.reason, end.value) for end in branch.ends] == [(EndReason.TABLE, 0.5), (EndReason.TABLE, 1.5)]
    assert "gas.csv covers 0.5 to 1.5" in branch.ends[0].reason_words
    assert (branch.points[0].value, branch.points[-1].value) == (0.5, 1.5)
    assert verified(branch, sampled).ok


def test_within_its_table_a_walk_ends_as_any_other() -> None:
    branch = gw.follow(gw.find_orbit(system_of()), "frequency", 0.9)
    assert branch.ends[1].reason is EndReason.RANGE
    along = gw.follow(gw.find_orbit(system_of(frequency=1.5)), "harmonic1.amplitude", 0.32)
    assert along.ends[1].reason is EndReason.RANGE


@pytest.mark.slow
def test_a_locus_ends_there_too() -> None:
    branch = gw.follow(gw.find_orbit(system_of(amplitude=0.2)), "frequency", (0.5, 1.5))
    grazing = branch.special(gw.Kind.GRAZING)[-1]
    locus = gw.follow_locus(grazing, "frequency", "harmonic1.amplitude", ((0.2, 3.0), (0.01, 3.0)))
    ends = [end for end in locus.ends if end.reason is LocusEndReason.TABLE]
    assert ends
    assert all(end.values[0] in (0.5, 1.5) and "gas.csv" in end.detail for end in ends)
    other = gw.follow_locus(grazing, "harmonic1.amplitude", "frequency", ((0.01, 3.0), (0.2, 3.0)))
    assert {end.reason for end in other.ends} == {end.reason for end in locus.ends}


@pytest.mark.parametrize("frequency", [0.49, 1.51])
def test_beyond_it_there_is_an_error_and_no_extrapolation(frequency: float) -> None:
    system = system_of(frequency=frequency)
    words = f"gas.csv covers 0.5 to 1.5; it has no value at frequency = {frequency}"
    for compute in (gw.find_orbit, lambda each: gw.integrate(each, [0.0, 0.0], 1.0)):
        for kind in (ModelError, NumericalError):
            with pytest.raises(kind, match=words):
                compute(system)
    with pytest.raises(ModelError, match="beyond it"):
        gw.follow(gw.find_orbit(system_of(frequency=1.5)), "frequency", 2.0)
    with pytest.raises(ModelError, match="stay within it"):
        gw.regimes(system_of(), {"frequency": (0.2, 1.0), "harmonic1.amplitude": (0.1, 0.2)})
    with pytest.raises(ModelError, match=r"gas\.csv covers"):
        gw.sweep(system_of(), "frequency", (0.2, 1.0))


def test_equations_go_on_beyond_it_for_newtons_steps_only() -> None:
    line = ParameterLine(system_of(), "frequency")
    inside, outside = (line.coefficients(value)[0] for value in (1.5, 1.5001))
    assert np.isfinite(outside).all()
    assert np.abs(outside - inside).max() < 1e-3
    with pytest.raises(ModelError):
        gw.find_orbit(line.system_at(1.5001))


def test_a_system_with_a_table_is_kept(tmp_path: Path) -> None:
    system = system_of(Steady(0.2, {"x": 1.0}, over_speed="1 + 0.5*W"))
    assert pickle.loads(pickle.dumps(system)) == system
    swept = gw.sweep(system, "frequency", (0.7, 0.75), steps=2, output=tmp_path / "sweep.gapwalk")
    known = gw.open_result(tmp_path / "sweep.gapwalk")
    assert getattr(known, "record", known).system == swept.system == system


TRAIN = """
speed = "1500 rpm"
[[inertia]]
name = "flywheel"
inertia = "0.14 kg m^2"
[[inertia]]
name = "body"
inertia = "0.5 kg m^2"
[[shaft]]
name = "clutch"
between = ["flywheel", "body"]
stiffness = "10 N m/deg"
damping = "0.05 N m s/deg"
clearance = "2 deg"
[[harmonic]]
amplitude = "10 N m"
acts_on = { flywheel = 1.0 }
order = 2
over_speed = "1 + speed/3000"
[[steady]]
amplitude = "1 N m"
acts_on = { body = -1.0 }
over_speed = "drag.csv"
"""
STUDY = """
[study]
kind = "response"
parameter = "speed"
from = "1500 rpm"
to = "3000 rpm"
"""


def test_a_train_has_its_speed_in_its_own_unit(tmp_path: Path) -> None:
    (tmp_path / "drag.csv").write_text("speed (Hz); torque (N m)\n10; 11\n20; 12\n60; 30\n")
    (tmp_path / "m.toml").write_text(TRAIN + STUDY)
    system = gw.read_study(tmp_path / "m.toml").system
    assert system.structure.pace_limits[:2] == pytest.approx((600.0, 3600.0))
    harmonic, steady = system.structure.harmonics
    assert harmonic.order == 1  # repeats twice in a turn
    assert harmonic.factor is not None
    assert harmonic.factor.value(system.frequency) == pytest.approx(1.5)
    assert steady.factor is not None
    expected = float(PchipInterpolator([10.0, 20.0, 60.0], [11.0, 12.0, 30.0])(25.0))
    assert steady.factor.value(system.frequency) == pytest.approx(expected)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('"drag.csv"', '"nix.csv"', 'steady[0].over_speed is "nix.csv", which cannot be read'),
        ('"1 + speed/3000"', '"1 + n/3000"', "n is unknown in it"),
        ('"1 + speed/3000"', "2", "write a formula such as"),
        ('amplitude = "1 N m"', 'amplitude = "1 N m"\norder = 2', "leave order out"),
        ("Hz", "kg", "kg"),
        ("speed (Hz)", "speed", "has no unit"),
        ("60; 30", "20; 30", "each must occur once"),
    ],
)
def test_what_is_wrong_in_a_file_is_said(tmp_path: Path, old: str, new: str, words: str) -> None:
    table = "speed (Hz); torque (N m)\n10; 11\n20; 12\n60; 30\n"
    (tmp_path / "drag.csv").write_text(table.replace(old, new))
    (tmp_path / "m.toml").write_text(TRAIN.replace(old, new, 1) + STUDY)
    with pytest.raises(ModelError) as error:
        gw.read_study(tmp_path / "m.toml")
    assert words in str(error.value).replace('steady "steady"', "steady[0]")

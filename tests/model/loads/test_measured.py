"""Loads from measured curves: against closed forms and SciPy, from files, in drive trains, and what is refused."""

import math
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp

import gapwalk as gw
from gapwalk.ensemble import BatchOptions, batch_flow_of
from gapwalk.errors import ModelError
from gapwalk.loads import Measured, displacement_orders, orders_of
from gapwalk.model.coefficients import coefficients_of, layout_of
from gapwalk.model.loads import Harmonic

TURN = 2.0 * math.pi
MODEL = """
coordinates = ["q1"]
stiffness = [[1.0]]
damping = [[0.2]]
frequency = 0.9

[[contact]]
name = "stop"
deflection = { q1 = 1.0 }
clearance = 0.5
stiffness = 4.0

[[measured]]
file = "gas.csv"
ACTS

[study]
kind = "response"
parameter = "frequency"
from = 0.8
to = 1.0
"""
ACTS = 'acts_on = { q1 = 1.0 }\nper = "cycle"'


def torque(angle):
    """A curve over the angle of the shaft that repeats after two turns, and has all orders."""
    return np.exp(np.cos(angle - 0.3)) + 0.3 * np.sin(0.5 * angle)


def write(folder: Path, name: str, head: str, rows) -> None:
    lines = "\n".join(", ".join(f"{float(number)!r}" for number in row) for row in rows)
    (folder / name).write_text(f"{head}\n{lines}\n", encoding="utf-8")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    degrees = np.arange(0.0, 721.0, 5.0)
    write(tmp_path, "gas.csv", "crank (deg), torque", zip(degrees, torque(np.radians(degrees)), strict=True))
    return tmp_path


def read(folder: Path, acts: str = ACTS, text: str = MODEL) -> gw.System:
    (folder / "m.toml").write_text(text.replace("ACTS", acts), encoding="utf-8")
    return gw.read_study(folder / "m.toml").system


def refused(folder: Path, acts: str, text: str = MODEL) -> str:
    with pytest.raises(ModelError) as error:
        read(folder, acts, text)
    return str(error.value)


def pull(system: gw.System, theta):
    """The load of a system of one coordinate with the mass 1, at angles of the excitation."""
    layout, coefficients = layout_of(system.structure), coefficients_of(system)
    mean, *lines = coefficients[layout.accelerations[0, 2 + len(layout.contacts) :]]
    orders, half = np.array(layout.orders), len(layout.orders)
    angles = np.multiply.outer(theta, orders)
    return mean + np.cos(angles) @ lines[:half] + np.sin(angles) @ lines[half:]


@pytest.mark.parametrize(("turns", "order"), [(1, 1), (1, 2), (2, 1), (2, 3)])
def test_it_is_the_curve_over_the_angle_of_the_shaft(turns: int, order: int) -> None:
    angle = np.linspace(0.0, TURN * turns, 145)
    table = orders_of(angle, torque(angle * (2 if turns == 1 else 1)), per=("turn", "cycle")[turns - 1], error=1e-13)
    load = Measured.of(table, {"q": 1.0}, order=order, scale=2.0, phase=0.7)
    system = gw.System(["q"], [[1.0]], harmonics=[load])
    theta = np.linspace(0.0, TURN, 9)
    shaft = theta * order * turns + 0.7
    expected = 2.0 * torque(shaft * (2 if turns == 1 else 1))
    np.testing.assert_allclose(pull(system, theta), expected, rtol=0.0, atol=1e-6)


def test_orbits_are_those_of_scipy_under_the_curve_itself(folder: Path) -> None:
    system = read(folder, f"{ACTS}\nerror = 1e-14")
    orbit = gw.find_orbit(system)

    def rates(theta, state):
        x, v = state
        stop = 4.0 * (max(x - 0.5, 0.0) + min(x + 0.5, 0.0))
        return [v / system.frequency, (torque(2.0 * theta) - x - 0.2 * v - stop) / system.frequency]

    end = solve_ivp(rates, (0.0, TURN), orbit.state, "DOP853", rtol=1e-12, atol=1e-12, max_step=0.01).y[:, -1]
    assert np.abs(end - orbit.state).max() < 2e-6


def test_the_share_that_is_left_out_is_that_of_the_curve(folder: Path, capsys, monkeypatch) -> None:
    from gapwalk.cli import main

    system = read(folder, f"{ACTS}\norders = [0.5, 1]")
    (load,) = (form for form in system.structure.harmonics if form.name == "measured1")
    left_out = dict(load.constants)["left_out"]
    mean = quad(torque, 0.0, 2.0 * TURN)[0] / (2.0 * TURN)
    energy = quad(lambda angle: (torque(angle) - mean) ** 2, 0.0, 2.0 * TURN)[0] / (2.0 * TURN)
    kept = 0.0
    for order in (0.5, 1.0):
        for wave in (np.cos, np.sin):
            part = quad(lambda a, k=order, f=wave: torque(a) * f(k * a), 0.0, 2.0 * TURN)[0] / TURN
            kept += 0.5 * part**2
    assert left_out == pytest.approx(1.0 - kept / energy, rel=1e-9)
    monkeypatch.setenv("COLUMNS", "1000")
    said = f"measured1 (orders 0.5, 1 per turn of gas.csv, without {100.0 * left_out:.2g} % of the energy)"
    assert said in str(system.summary())
    assert main(["check", str(folder / "m.toml")]) == 0
    assert said in capsys.readouterr().out


def test_a_variation_leaves_the_mean_out_and_says_so(folder: Path) -> None:
    degrees = np.arange(0.0, 361.0, 5.0)
    write(
        folder, "te.csv", "angle (deg), error", [(each, 0.2 + 0.05 * math.cos(math.radians(each))) for each in degrees]
    )
    system = read(folder, 'varies = "stop.deflection"\nname = "te"', MODEL.replace("gas.csv", "te.csv"))
    assert "te (orders 1 per turn of te.csv, without 0 % of the energy and without the mean 0.2)" in str(
        system.summary()
    )
    wave = coefficients_of(system)[layout_of(system.structure).contacts[0].sway]
    np.testing.assert_allclose(wave, [0.05, 0.0], atol=1e-15)


def test_a_measured_stiffness_varies_by_its_share_of_the_mean(folder: Path) -> None:
    degrees = np.arange(0.0, 360.0, 5.0)
    write(folder, "k.csv", "angle (deg); k", [(each, 3e5 + 6e4 * math.sin(math.radians(each))) for each in degrees])
    (folder / "k.csv").write_text((folder / "k.csv").read_text().replace(", ", "; "))
    text = MODEL.replace("gas.csv", "k.csv")
    wrong = refused(folder, 'varies = "stop.stiffness"\ncolumn = "k"', text)
    assert "has the mean 300000" in wrong
    assert "relative = true" in wrong
    system = read(folder, 'varies = "stop.stiffness"\ncolumn = "k"\nrelative = true', text)
    wave = coefficients_of(system)[layout_of(system.structure).contacts[0].stages[0].waves["stiffness"].lines]
    np.testing.assert_allclose(wave, [0.0, 0.2], atol=1e-15)


@pytest.mark.parametrize("over", ["angle", "time"])
def test_the_acceleration_of_a_base_becomes_its_displacement(folder: Path, over: str) -> None:
    """u = 0.03 cos(2 a) + 0.01 sin(a) at the speed 5: u'' = -0.03 (10)^2 cos 2a - 0.01 (5)^2 sin a."""
    angle = np.radians(np.arange(0.0, 361.0, 5.0))
    values = -3.0 * np.cos(2.0 * angle) - 0.25 * np.sin(angle)
    if over == "angle":
        write(folder, "base.csv", "angle (deg), acceleration", zip(np.degrees(angle), values, strict=True))
        key = "speed = 5.0"
    else:
        write(folder, "base.csv", "time, acceleration", zip(angle / 5.0, values, strict=True))
        key = f"period = {TURN / 5.0!r}"
    text = MODEL.replace("gas.csv", "base.csv")
    system = read(folder, f'varies = "stop.deflection"\n{key}', text)
    wave = coefficients_of(system)[layout_of(system.structure).contacts[0].sway]
    np.testing.assert_allclose(wave, [0.0, 0.03, 0.01, 0.0], atol=1e-14)
    missing = refused(folder, 'varies = "stop.deflection"', text)
    assert f"{key.split()[0]} is missing" in missing


def test_the_same_from_python() -> None:
    angle = np.linspace(0.0, TURN, 73)
    table = displacement_orders(angle, acceleration=-4.0 * np.cos(angle), speed=2.0)
    load = Measured.of(table, varies="stop.deflection")
    assert load.series[0][0] == 1
    assert load.series[0][1] == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("acts", "words"),
    [
        ("acts_on = { q1 = 1.0 }", ["0 deg to 720 deg", 'write per = "cycle"']),
        (f"{ACTS}\norders = [1, 1.3]", ["the order 1.3", "multiples of 0.5"]),
        (f"{ACTS}\norder = 1.5", ["order is 1.5", "must be an integer"]),
        (f"{ACTS}\nerror = 2.0", ["error is 2.0"]),
        (f'{ACTS}\ncolumn = "M"', ["no column 'M'", "torque"]),
        (ACTS.replace("cycle", "year"), ["'turn' or 'cycle'"]),
        (f"{ACTS}\nrelative = true", ["relative is only for what a curve varies"]),
        (f"{ACTS}\ngrowth = 3", ["growth is 3"]),
        ("per = 'cycle'", ["acts_on is missing", "varies ="]),
        ('varies = "stop.deflection"\nper = "cycle"', ["no column 'displacement'"]),
    ],
)
def test_what_is_wrong_is_said(folder: Path, acts: str, words: list[str]) -> None:
    message = refused(folder, acts)
    assert all(each in message for each in words), message


def test_degrees_without_a_unit_are_recognised(folder: Path) -> None:
    (folder / "gas.csv").write_text((folder / "gas.csv").read_text().replace("crank (deg)", "crank"))
    assert "in degrees; name the column angle (deg)" in refused(folder, ACTS)


def test_a_unit_in_a_model_without_units_is_refused(folder: Path) -> None:
    (folder / "gas.csv").write_text((folder / "gas.csv").read_text().replace("torque", "torque (N m)"))
    assert "this model has no units" in refused(folder, ACTS)


@pytest.mark.parametrize("name", ["nix.csv", "../gas.csv"])
def test_a_file_that_is_missing_or_outside_of_the_folder_is_refused(folder: Path, name: str) -> None:
    from gapwalk.model.model_file import check_model
    from gapwalk.model.model_source import read_source

    (folder / "inner").mkdir()
    (folder / "inner" / "m.toml").write_text(MODEL.replace("ACTS", ACTS).replace("gas.csv", name), encoding="utf-8")
    source = read_source(folder / "inner" / "m.toml", str(folder / "inner"))
    model, (problem,) = check_model(source)
    assert model is None
    assert (problem.path, problem.line) == ("measured[0].file", 14)
    wanted = "cannot be read" if name == "nix.csv" else "lies outside of the folder inner; put the file into it"
    assert wanted in problem.message
    free, problems = check_model(read_source(folder / "inner" / "m.toml"))
    assert (free is None) is (name == "nix.csv"), problems


def test_a_changed_file_is_noticed_when_a_study_is_resumed(folder: Path) -> None:
    read(folder)
    study = gw.read_study(folder / "m.toml")
    gw.run(study, folder / "out.gapwalk")
    gw.run(gw.read_study(folder / "m.toml"), folder / "out.gapwalk", resume=True)
    assert gw.read_study(folder / "m.toml").matrices == study.matrices
    degrees = np.arange(0.0, 721.0, 5.0)
    write(folder, "gas.csv", "crank (deg), torque", zip(degrees, 1.001 * torque(np.radians(degrees)), strict=True))
    changed = gw.read_study(folder / "m.toml")
    assert changed.matrices != study.matrices
    with pytest.raises(ModelError):
        gw.run(changed, folder / "out.gapwalk", resume=True)


def test_harmonic_balance_and_the_batch_integrator_carry_it(folder: Path) -> None:
    system = read(folder)
    exact = gw.find_orbit(system)
    balanced = gw.find_orbit(system, start=exact.state, method=gw.Balance())
    assert np.abs(balanced.state - exact.state).max() < 1e-3
    assert balanced.harmonics >= 2 * max(order for form in system.structure.harmonics for order in form.orders)
    run = batch_flow_of(system, BatchOptions(error=1e-5)).run(np.array([exact.state, [0.1, 0.0]]), 60)
    assert np.abs(run.states - exact.state).max() < 1e-3


def test_a_rectangle_repeats_as_often_as_its_cycles() -> None:
    """Beside a harmonic of order 3, a rectangle of order 2 repeats once in a period, and not three times."""
    from gapwalk.loads import Rectangle
    from gapwalk.orbit.orbit import repeats

    stop = gw.stop("stop", {"x": 1.0}, clearance=0.1, stiffness=1.0)
    loads = [Harmonic(1.0, {"x": 1.0}, order=3), Rectangle(0.2, {"stop.stiffness": 1.0}, order=2)]
    assert repeats(gw.System(["x"], [[1.0]], contacts=[stop], harmonics=loads)) == 1
    assert repeats(gw.System(["x"], [[1.0]], contacts=[stop], harmonics=loads[:1])) == 3


def test_a_shaken_base_is_the_same_in_both_coordinates() -> None:
    """The models of the how-to page: y - u, and the multipliers, agree."""
    docs = Path(__file__).parents[3] / "docs" / "howto"
    fixed, relative = (gw.read_study(docs / f"{name}.toml").system.at(frequency=0.9) for name in ("base", "relative"))
    orbits = [gw.find_orbit(each) for each in (fixed, relative)]
    order = np.argsort(orbits[0].multipliers.imag), np.argsort(orbits[1].multipliers.imag)
    np.testing.assert_allclose(orbits[0].multipliers[order[0]], orbits[1].multipliers[order[1]], atol=1e-6)
    sway = coefficients_of(fixed)[layout_of(fixed.structure).contacts[0].sway]
    displaced = sway[: len(sway) // 2].sum()  # of the contacts: -u(0)
    assert orbits[0].state[0] + displaced == pytest.approx(orbits[1].state[0], abs=1e-6)

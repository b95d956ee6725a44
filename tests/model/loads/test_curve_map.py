"""Curves over angle and speed: files in both forms, cubics over the speed, ends of the map, and bad input."""

import math
from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import PchipInterpolator

import gapwalk as gw
from gapwalk.errors import ModelError
from gapwalk.flow.ramp import Ramped
from gapwalk.loads import Measured, orders_of
from gapwalk.model.coefficients import ParameterLine, coefficients_of, layout_of, varying
from tests.sampled_verification import verified

TURN = 2.0 * math.pi
SPEEDS = (1000.0, 1500.0, 2500.0, 4000.0)
DEGREES = np.arange(0.0, 720.0, 4.0)
TRAIN = """
speed = "1700 rpm"
reaction = "car"
study = { kind = "response", parameter = "speed", from = "1200 rpm", to = "1700 rpm" }
inertia = [{ name = "crank", inertia = "0.1 kg m^2" }, { name = "car", inertia = "1 kg m^2" }]
shaft = [{ name = "s", between = ["crank", "car"], stiffness = "900 N m/rad", damping = "3 N m s/rad" }]

[[measured]]
name = "gas"
acts_on = { crank = 1 }
file = "gas.csv"
per = "cycle"
error = 1e-9
"""


def torque(degrees, rpm):
    """A torque over the cycle that changes its shape with the speed; its order 1.5 vanishes at one of the speeds."""
    a = np.radians(degrees)
    part = (rpm - 1500.0) / 1000.0
    return 80.0 + 0.01 * rpm + 40.0 * np.exp(np.cos(0.5 * a - part)) + 9.0 * part * np.sin(1.5 * a)


def wide(folder: Path, unit=("rpm", 1.0), of=("N m", 1.0), speeds=SPEEDS, degrees=DEGREES) -> None:
    heads = [f"{rpm * unit[1]:.17g} {unit[0]} ({of[0]})" for rpm in speeds]
    rows = [[a, *(of[1] * torque(a, rpm) for rpm in speeds)] for a in degrees]
    save(folder, ["angle (deg)", *heads], rows)


def long(folder: Path, speeds=SPEEDS, degrees=DEGREES, by_angle: bool = False) -> None:
    pairs = [(a, rpm) for rpm in speeds for a in degrees]
    rows = [[a, rpm, torque(a, rpm)] for a, rpm in (sorted(pairs) if by_angle else pairs)]
    save(folder, ["angle (deg)", "n (rpm)", "M (N m)"], rows)


def save(folder: Path, heads, rows) -> None:
    lines = ["; ".join(heads), *("; ".join(f"{each:.17g}" for each in row) for row in rows)]
    (folder / "gas.csv").write_text("\n".join(lines), encoding="utf-8")


def read(folder: Path, old: str = "", new: str = "", text: str = TRAIN) -> gw.System:
    (folder / "m.toml").write_text(text.replace(old, new) if old else text, encoding="utf-8")
    return gw.read_study(folder / "m.toml").system


def orders(rpm: float) -> dict[float, complex]:
    spectrum = np.fft.rfft(torque(DEGREES, rpm)) / len(DEGREES)
    return {k: (1.0 if k == 0 else 2.0) * spectrum[k] for k in range(12)}


def lines_at(system: gw.System, rpm: float) -> dict[int, complex]:
    system = system.at(speed=rpm)
    form = next(load for load in system.structure.harmonics if load.name == "gas")
    values = [system.equations[name] for name in form.parameters]
    found: dict[int, complex] = {}
    for order, cosine, sine in form.lines(system.frequency, values):
        found[order] = found.get(order, 0.0) + cosine - 1j * sine
    return found


@pytest.mark.parametrize("form", [wide, long])
@pytest.mark.parametrize("rpm", [1000.0, 1499.0, 1500.0, 2200.0, 4000.0])
def test_every_order_is_a_cubic_over_the_speed(tmp_path: Path, form, rpm: float) -> None:
    form(tmp_path)
    found = lines_at(read(tmp_path), rpm)
    for order in range(6):
        row = [orders(speed)[order] for speed in SPEEDS]
        parts = [PchipInterpolator(SPEEDS, part(row))(rpm) for part in (np.real, np.imag)]
        assert found[order] == pytest.approx(complex(*parts), abs=1e-9)


@pytest.mark.parametrize("change", ["rad/s", "Hz", "kN m", "by angle", "shuffled"])
def test_other_units_and_another_order_of_the_rows_change_nothing(tmp_path: Path, change: str) -> None:
    wide(tmp_path)
    known = lines_at(read(tmp_path), 1700.0)
    if change in ("rad/s", "Hz"):
        wide(tmp_path, unit=(change, TURN / 60.0 if change == "rad/s" else 1.0 / 60.0))
    elif change == "kN m":
        wide(tmp_path, of=("kN m", 1e-3))
    elif change == "by angle":
        long(tmp_path, by_angle=True)
    else:
        wide(tmp_path, speeds=(2500.0, 1000.0, 4000.0, 1500.0))
    found = lines_at(read(tmp_path), 1700.0)
    assert found == pytest.approx(known)


def test_a_run_with_its_speed_beside_it_is_one_curve(tmp_path: Path) -> None:
    save(tmp_path, ["angle (deg)", "n (rpm)", "M (N m)"], [[a, 1500.0 + np.sin(a), torque(a, 1500.0)] for a in DEGREES])
    system = read(tmp_path)
    assert lines_at(system, 1000.0)[2] == lines_at(system, 3000.0)[2] == pytest.approx(orders(1500.0)[2])


@pytest.mark.parametrize("rpm", [1200.0, 1510.0, 1900.0, 3900.0])
def test_slopes_by_the_speed_are_exact(tmp_path: Path, rpm: float) -> None:
    wide(tmp_path)
    line = ParameterLine(read(tmp_path), "speed")
    step = 1e-2
    values = [line.coefficients(rpm + shift * step)[0] for shift in (-1, 1)]
    wanted = (values[1] - values[0]) / (2.0 * step)
    assert line.coefficients(rpm)[1] == pytest.approx(wanted, abs=1e-6 * np.abs(wanted).max())
    known = [lines_at(read(tmp_path), rpm + shift * step) for shift in (-1, 1)]
    assert known[0].keys() == known[1].keys()


def test_a_branch_follows_it_and_ends_with_it(tmp_path: Path) -> None:
    wide(tmp_path, speeds=(1000.0, 1250.0, 1300.0))
    system = read(tmp_path).at(speed=1295.0)
    branch = gw.follow(gw.find_orbit(system), "speed", (1290.0, 1500.0))
    assert branch.points[-1].orbit.system["speed"] == pytest.approx(1300.0)
    assert "gas.csv" in str(branch.ends[-1])
    assert verified(branch, 2).ok
    for rpm in (900.0, 1301.0):
        with pytest.raises(ModelError, match=r"gas.csv covers 1000 to 1300; it has no value at speed = "):
            gw.find_orbit(system.at(speed=rpm))


def test_the_flow_knows_all_coefficients_that_the_speed_moves() -> None:
    """An order that is 0 at a speed, or the same at two, enters a compiled flow as any other."""
    curves = {1.0: 0.0, 2.0: 0.0, 3.0: 5.0}
    angle = np.arange(64) * TURN / 64
    tables = {w: orders_of(angle, 2.0 * np.cos(angle) + size * np.cos(3.0 * angle)) for w, size in curves.items()}
    loads = [Measured.of(tables, {name: 1.0}, name=f"m{name}") for name in ("a", "b")]
    stiffness = [[2.0, -1.0], [-1.0, 2.0]]
    system = gw.System(["a", "b"], np.eye(2), 0.1 * np.eye(2), stiffness, harmonics=loads, frequency=1.5)
    for w in (1.2, 2.5):
        orbit = gw.find_orbit(system.at(frequency=w))
        angles = np.linspace(0.0, TURN, 50)
        size = PchipInterpolator([1.0, 2.0, 3.0], [0.0, 0.0, 5.0])(w)
        wanted = sum(
            np.real(part * np.exp(1j * order * angles) / (1.0 - (order * w) ** 2 + 0.1j * order * w))
            for order, part in ((1, 2.0), (3, size))
        )
        assert orbit.motion(49).q[:, 0] == pytest.approx(wanted, abs=1e-6)
    mask = varying(system, ["frequency"])[0]
    layout, there = layout_of(system.structure), coefficients_of(system.at(frequency=2.9))
    places = layout.accelerations[:, 4 + 1 :]
    assert np.all(mask[places][there[places] != 0.0])


def test_it_varies_a_stiffness_relative_to_its_mean_at_each_speed() -> None:
    angle = np.arange(64) * TURN / 64
    tables = {w: orders_of(angle, w * (10.0 + np.cos(angle))) for w in (1.0, 2.0)}
    load = Measured.of(tables, varies="stop.stiffness", relative=True)
    assert load.series[0][1] == pytest.approx((0.1, 0.1))


def test_balance_and_shooting_agree(tmp_path: Path) -> None:
    wide(tmp_path)
    system = read(tmp_path, 'damping = "3 N m s/rad"', 'damping = "3 N m s/rad", clearance = "1 deg"')
    exact = gw.find_orbit(system, method=gw.Shooting() if hasattr(gw, "Shooting") else None)
    balanced = gw.find_orbit(system, start=exact.state, method=gw.Balance())
    assert np.abs(balanced.state - exact.state).max() < 1e-3 * np.abs(exact.state).max()


def test_the_non_dimensional_train_moves_alike(tmp_path: Path) -> None:
    wide(tmp_path)
    system = read(tmp_path)
    small = gw.train.nondimensional(system)
    first, second = (gw.find_orbit(each).motion(60) for each in (system, small.system))
    assert second.q[:, 0] == pytest.approx(first.q[:, 0] * system.units.angle / small.scales.angle, rel=1e-8)


def test_a_run_up_refuses_it(tmp_path: Path) -> None:
    wide(tmp_path)
    with pytest.raises(ModelError, match="gas has a factor over the speed"):
        _ = Ramped(read(tmp_path)).growth


def test_a_map_without_units(tmp_path: Path) -> None:
    text = "\n".join(
        [
            'coordinates = ["q"]\nstiffness = [[1.0]]\ndamping = [[0.1]]\nfrequency = 1.5',
            '[[measured]]\nfile = "gas.csv"\nacts_on = { q = 1.0 }',
            '[study]\nkind = "response"\nparameter = "frequency"\nfrom = 1.2\nto = 1.4',
        ]
    )
    angles = np.arange(24) * 15.0
    save(
        tmp_path, ["angle (deg)", "1.0", "2.0"], [[a, np.cos(np.radians(a)), 3 * np.cos(np.radians(a))] for a in angles]
    )
    system = read(tmp_path, text=text)
    assert system.structure.harmonics[0].lines(1.5, [1.0, 0.0])[-1] == (1, pytest.approx(2.0), pytest.approx(0.0))
    rows = [[a, w, w * np.cos(np.radians(a))] for w in (1.0, 2.0) for a in angles]
    save(tmp_path, ["angle (deg)", "W", "load"], rows)
    assert read(tmp_path, text=text).structure.harmonics[0].lines(1.5, [1.0, 0.0])[-1].cosine == pytest.approx(1.5)


def test_a_map_of_pressures(tmp_path: Path) -> None:
    speeds, degrees = (1000.0, 2000.0), np.arange(0.0, 720.0)
    rows = [
        [a, *(1.0 + size * np.exp(12.0 * np.cos(np.radians(a - 10.0) / 2.0) - 12.0) for size in (40.0, 70.0))]
        for a in degrees
    ]
    save(tmp_path, ["angle (deg)", *(f"{rpm} rpm (bar)" for rpm in speeds)], rows)
    text = TRAIN[: TRAIN.index("[[measured]]")] + (
        '[[cylinder]]\nname = "gas"\nacts_on = { crank = 1 }\npressure = "gas.csv"\nbore = "80 mm"\nstroke = "90 mm"\n'
        'rod = "150 mm"\nhighest = 8\n'
    )
    system = read(tmp_path, text=text)
    ends = [lines_at(system, rpm)[4] for rpm in speeds]
    assert lines_at(system, 1500.0)[4] == pytest.approx(sum(ends) / 2.0)
    assert abs(ends[1]) > 1.5 * abs(ends[0])
    with pytest.raises(ModelError, match=r"gas\.csv covers 1000 to 2000"):
        gw.find_orbit(system.at(speed=2100.0))


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda folder: wide(folder, degrees=np.arange(0.0, 360.0, 4.0)), ["gas.csv at 1000 rpm", "not a cycle"]),
        (lambda folder: wide(folder, speeds=(1000.0,)), ["the one speed 1000 rpm", "two at least"]),
        (lambda folder: wide(folder, speeds=(1000.0, 1000.0)), ["a speed has two columns", "once"]),
        (lambda folder: wide(folder, of=("kg", 1.0)), ["1000 rpm (kg)", "a torque is expected"]),
        (
            lambda folder: save(folder, ["angle (deg)", "1000 rpm", "2000 rpm"], [[0, 1, 2]]),
            ["no unit", "1000 rpm (N m)"],
        ),
        (
            lambda folder: save(
                folder,
                ["angle (deg)", "n (rpm)", "M (N m)"],
                [[a, rpm, torque(a, rpm)] for rpm in SPEEDS for a in DEGREES if rpm < 3000.0 or a < 400.0],
            ),
            ["gas.csv at 4000 rpm", "not a cycle"],
        ),
    ],
)
def test_what_is_wrong_is_said(tmp_path: Path, make, words: list[str]) -> None:
    make(tmp_path)
    with pytest.raises(ModelError) as error:
        read(tmp_path)
    for word in words:
        assert word in str(error.value)

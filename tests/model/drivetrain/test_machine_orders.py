"""Orders of an electric machine: by pole pairs, and of its cogging by slots."""

from fractions import Fraction
from pathlib import Path

import pytest

import gapwalk as gw
from gapwalk.errors import ModelError
from gapwalk.model.drivetrain.train_orders import real_orders

TRAIN = """
speed = "3000 rpm"
reaction = "car"
study = { kind = "response", parameter = "speed", from = "2000 rpm", to = "3000 rpm" }
inertia = [{ name = "rotor", inertia = "0.1 kg m^2" }, { name = "car", inertia = "1 kg m^2" }]
gear = [{ name = "g", between = ["rotor", "car"], teeth = [20, 50], stiffness = "9 kN m/rad", damping = "3 N m s/rad" }]
harmonic = [
    { amplitude = "3 N m", acts_on = { rotor = 1 }, order = 6, KEYS },
]
"""


def read(folder: Path, keys: str, old: str = "", new: str = "") -> gw.System:
    (folder / "m.toml").write_text(TRAIN.replace("KEYS", keys).replace(old, new), encoding="utf-8")
    return gw.read_study(folder / "m.toml").system


@pytest.mark.parametrize(
    ("keys", "order", "wanted"),
    [
        ("pole_pairs = 4", 6, 24),
        ("pole_pairs = 4", 12, 48),
        ("pole_pairs = 4, slots = 48", 1, 48),
        ("pole_pairs = 4, slots = 36", 1, 72),
        ("pole_pairs = 5, slots = 12", 2, 120),
        (
            'pole_pairs = 4, turns_of = "car"',
            5,
            8,
        ),  # 20 in a turn of the car: 2/5 of the rotor
    ],
)
def test_orders_are_counted_by_poles_and_slots(tmp_path: Path, keys: str, order: int, wanted: int) -> None:
    system = read(tmp_path, keys, "order = 6", f"order = {order}")
    turns = system.units.turns
    assert [form.order * turns for form in system.structure.harmonics] == [wanted]
    amplitude = abs(gw.find_orbit(system).motion(400).signal("g.torque")).max()
    plain = read(tmp_path, "phase = 0.0", "order = 6", f"order = {wanted}".replace("phase = 0.0", ""))
    assert abs(gw.find_orbit(plain).motion(400).signal("g.torque")).max() == pytest.approx(amplitude)


def test_the_same_in_python() -> None:
    load = gw.train.Counted(gw.Harmonic("3 N m", {"rotor": 1.0}, order=6), pole_pairs=4)
    train = gw.train.Train(
        [gw.train.Inertia("rotor", "0.1 kg m^2"), gw.train.Inertia("car", "1 kg m^2")],
        [gw.train.Shaft("s", ("rotor", "car"), stiffness="900 N m/rad", damping="1 N m s/rad")],
        harmonics=[load],
        speed="900 rpm",
    )
    assert real_orders(train) == [Fraction(24)]


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ("pole_pairs = 0", "pole_pairs"),
        ("pole_pairs = 2.5", "pole_pairs"),
        ("slots = 48", "has slots, but no pole_pairs"),
        ('pole_pairs = 4, mesh = "g"', "both mesh and pole_pairs"),
    ],
)
def test_what_is_wrong_is_said(tmp_path: Path, keys: str, words: str) -> None:
    with pytest.raises(ModelError, match=words):
        read(tmp_path, keys)

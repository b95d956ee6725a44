"""Quantities: texts with units against conversions done by hand, and what is refused."""

import math
import subprocess
import sys
from pathlib import Path

import pytest

from gapwalk.model.units import QuantityKind, has_unit, read_quantity

DEGREE = math.pi / 180.0


@pytest.mark.parametrize(
    ("text", "kind", "number", "factor"),
    [
        ("0.14 kg m^2", QuantityKind.INERTIA, 0.14, 1.0),
        ("0.14 kg*m**2", QuantityKind.INERTIA, 0.14, 1.0),
        ("0.14 kg m²", QuantityKind.INERTIA, 0.14, 1.0),
        ("0.14 kg·m²", QuantityKind.INERTIA, 0.14, 1.0),
        ("1400kg cm^2", QuantityKind.INERTIA, 1400.0, 1e-4),
        ("0.14 N m s^2/rad", QuantityKind.INERTIA, 0.14, 1.0),
        ("30 N m/deg", QuantityKind.STIFFNESS, 30.0, 1.0 / DEGREE),
        ("30 Nm/°", QuantityKind.STIFFNESS, 30.0, 1.0 / DEGREE),
        ("1.7 kN m / rad", QuantityKind.STIFFNESS, 1.7, 1e3),
        ("2 N m s/rad", QuantityKind.DAMPING, 2.0, 1.0),
        ("2 Nms/deg", QuantityKind.DAMPING, 2.0, 1.0 / DEGREE),
        ("2 N m/(rad/s)", QuantityKind.DAMPING, 2.0, 1.0),
        ("2 N m/rpm", QuantityKind.DAMPING, 2.0, 30.0 / math.pi),
        ("5 N m/deg^3", QuantityKind.CUBIC, 5.0, DEGREE**-3),
        ("-3e-1 deg", QuantityKind.ANGLE, -0.3, DEGREE),
        ("5 mrad", QuantityKind.ANGLE, 5.0, 1e-3),
        ("6 arcmin", QuantityKind.ANGLE, 6.0, DEGREE / 60.0),
        ("0.05 s/rad", QuantityKind.IMPACT, 0.05, 1.0),
        ("120 N m", QuantityKind.TORQUE, 120.0, 1.0),
        ("88.5 lbf ft", QuantityKind.TORQUE, 88.5, 4.4482216152605 * 0.3048),
        # an angular frequency is 2 pi times the frequency, and 2 pi / 60 times the turns a minute
        ("25 Hz", QuantityKind.FREQUENCY, 25.0, 2.0 * math.pi),
        ("1500 rpm", QuantityKind.FREQUENCY, 1500.0, math.pi / 30.0),
        ("157 rad/s", QuantityKind.FREQUENCY, 157.0, 1.0),
    ],
)
def test_a_text_is_a_number_and_a_unit(text: str, kind: QuantityKind, number: float, factor: float) -> None:
    found = read_quantity(text, kind)
    assert found.number == number
    assert found.factor == pytest.approx(factor, rel=1e-14)


@pytest.mark.parametrize(
    ("given", "kind", "words"),
    [
        (0.14, QuantityKind.INERTIA, 'a number without a unit; write an inertia such as "0.14 kg m^2"'),
        ("0.14", QuantityKind.INERTIA, 'without a unit; write an inertia such as "0.14 kg m^2"'),
        ("0,14 kg m^2", QuantityKind.INERTIA, "a point, not a comma"),
        ("much", QuantityKind.INERTIA, 'must be an inertia such as "1.5 kg m^2"'),
        ("0.14 kg m", QuantityKind.INERTIA, "something else; an inertia is expected"),
        ("30 N m", QuantityKind.STIFFNESS, 'a torque; a stiffness is expected, as in "30 N m/rad" or "30 N m/deg"'),
        ("30 N m/deg", QuantityKind.TORQUE, 'a stiffness; a torque is expected, as in "30 N m"'),
        ("30 N m/rad", QuantityKind.DAMPING, 'a stiffness; a damping is expected, as in "30 N m s/rad"'),
        ("30 J", QuantityKind.TORQUE, "J is the unit of an energy; write a torque in N m"),
        ("25 1/s", QuantityKind.FREQUENCY, "write Hz (turns in a second) or rad/s"),
        ("1500 1/min", QuantityKind.FREQUENCY, "write rpm"),
        ("3 rad", QuantityKind.FREQUENCY, "rad is the unit of an angle; a frequency or speed is expected"),
        ("3 degC", QuantityKind.ANGLE, "a temperature has no place here"),
        ("3 grad", QuantityKind.ANGLE, "there is no unit 'grad' here"),
        ("2 N m/rad s", QuantityKind.DAMPING, "needs brackets, as in N m/(rad s)"),
        ("2 lb-in", QuantityKind.TORQUE, "lbf that of a force; write lbf in"),
        ("2 m^99", QuantityKind.ANGLE, "this is no unit"),
        ("2 ((m", QuantityKind.ANGLE, "this is no unit"),
        ("2 " + "m " * 100, QuantityKind.ANGLE, "this is no unit"),
        ("2 __import__('os')", QuantityKind.ANGLE, "this is no unit"),
    ],
)
def test_anything_else_is_refused_with_what_to_write(given: object, kind: QuantityKind, words: str) -> None:
    with pytest.raises(ValueError) as error:  # noqa: PT011 (the words are compared)
        read_quantity(given, kind)
    assert words in str(error.value)


def test_a_quantity_of_another_kind_is_refused() -> None:
    angle = read_quantity("3 deg", QuantityKind.ANGLE)
    assert read_quantity(angle, QuantityKind.ANGLE) is angle
    with pytest.raises(ValueError, match='is 3 deg, an angle; a torque is expected, as in "3 N m"'):
        read_quantity(angle, QuantityKind.TORQUE)


def test_only_a_number_with_something_behind_it_has_a_unit() -> None:
    assert has_unit("3 deg")
    assert has_unit(".5deg")
    assert not any(has_unit(value) for value in ("3", "3.0 ", "deg", "", 3.0, None, True))


@pytest.mark.parametrize(("example", "imported"), [("train", False), ("drivetrain", True)])
def test_a_model_without_units_does_not_pay_for_them(example: str, imported: bool) -> None:
    file = Path(__file__).parents[3] / "examples" / f"{example}.toml"
    script = f"import sys, gapwalk as gw; gw.studies.read_studies({str(file)!r}); print('pint' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == str(imported)

"""Measures of a motion by their names: orders, sums, levels, ratios; against closed forms of linear trains."""

import functools
import math

import pytest

import gapwalk as gw
from gapwalk.errors import ModelError
from gapwalk.model.measures import full_measure, parsed
from gapwalk.model.words import measure_words

RPM, J1, J2, K, C = 900.0, 0.1, 0.02, 300.0, 0.5
TORQUES = {2: 10.0, 4: 3.0}


@functools.cache
def orbit(radius: str | None = "50 mm") -> gw.Orbit:
    """Two discs with a shaft between them, shaken at orders 2 and 4."""
    parts = gw.train
    train = parts.Train(
        [parts.Inertia("drive", f"{J1} kg m^2"), parts.Inertia("gear", f"{J2} kg m^2", radius)],
        [parts.Shaft("shaft", ("drive", "gear"), stiffness=f"{K} N m/rad", damping=f"{C} N m s/rad")],
        harmonics=[gw.Harmonic(f"{size} N m", {"drive": 1.0}, order) for order, size in TORQUES.items()],
        speed=f"{RPM} rpm",
    )
    return gw.find_orbit(train.system())


def closed(order: int) -> tuple[complex, complex]:
    """Return the angular accelerations of both discs at an order, in rad/s^2."""
    w = order * RPM * 2.0 * math.pi / 60.0
    link = K + 1j * w * C
    a, b, torque = link - J1 * w**2, link - J2 * w**2, TORQUES[order]
    first, second = torque * b / (a * b - link**2), torque * link / (a * b - link**2)
    return -(w**2) * first, -(w**2) * second


def test_orders_against_the_closed_form() -> None:
    found = orbit()
    for order in TORQUES:
        drive, gear = map(abs, closed(order))
        assert found.measure(f"order{order}.drive.acceleration") == pytest.approx(drive, rel=1e-9)
        assert found.measure(f"order{order}.gear.acceleration") == pytest.approx(0.05 * gear, rel=1e-9)
        assert found.measure(f"h{order}.gear''") == pytest.approx(gear, rel=1e-9)
        ratio = found.measure(f"order{order}.gear.speed/drive.speed")
        assert ratio == pytest.approx(gear / drive, rel=1e-9)
        assert found.measure(f"db.order{order}.gear.speed/order{order}.drive.speed") == pytest.approx(
            20.0 * math.log10(gear / drive), abs=1e-8
        )
    both = math.hypot(*(abs(closed(order)[1]) for order in TORQUES))
    assert found.measure("order2+4.gear''") == pytest.approx(both, rel=1e-9)
    assert found.measure("rms.gear''") == pytest.approx(both / math.sqrt(2.0), rel=1e-6)


def test_levels_have_the_reference_of_their_unit() -> None:
    size = abs(closed(2)[1])
    assert orbit().measure("db.order2.gear.acceleration") == pytest.approx(
        20.0 * math.log10(0.05 * size / math.sqrt(2.0) / 1e-6), abs=1e-8
    )
    assert orbit(None).measure("db.order2.gear.acceleration") == pytest.approx(
        20.0 * math.log10(size / math.sqrt(2.0)), abs=1e-8
    )
    assert orbit().measure("db.order0.shaft") < -150.0  # without a mean torque: rounding, or nothing at all
    rms = orbit().measure("rms.gear.acceleration")
    assert orbit().measure("db.rms.gear.acceleration") == pytest.approx(20.0 * math.log10(rms / 1e-6), abs=1e-9)


def test_peak_to_peak_is_twice_half() -> None:
    found = orbit()
    for signal in ("shaft", "gear.acceleration"):
        assert found.measure(f"peak_to_peak.{signal}") == 2.0 * found.measure(f"half.{signal}")


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("half.shaft", "amplitude of shaft (half the peak to peak) [deg]"),
        ("order2.gear.acceleration", "amplitude of order 2 of the acceleration of gear [m/s^2]"),
        ("h1/2.shaft", "amplitude of order 1/2 of shaft [deg]"),
        ("order2+4.drive''", "amplitude of orders 2, 4 of drive'' (root of the sum of squares) [rad/s^2]"),
        ("order2.gear.speed/drive.speed", "amplitude of order 2 of gear.speed over that of drive.speed"),
        ("db.rms.gear.acceleration", "level of root mean square of the acceleration of gear [dB re 1e-6 m/s^2]"),
        ("db.order2.drive''", "level of order 2 of drive'' [dB re 1 rad/s^2]"),
        ("db.rms.gear.speed/drive.speed", "level of root mean square of gear.speed over that of drive.speed [dB]"),
        ("max.gear''/rms.shaft", "maximum of gear'' over root mean square of shaft [(rad/s^2)/(deg)]"),
    ],
)
def test_words_and_units(name: str, words: str) -> None:
    assert measure_words(name, orbit().system.units) == words


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("orde2.shaft", "write one of max, min, half"),
        ("rmss.shaft", "did you mean rms.shaft"),
        ("db.shaft", "write one of max, min, half"),
        ("order2.gear.sped", "did you mean gear.speed"),
        ("order1/2.shaft", "harmonics of multiples of order 2, not of 1/2"),
        ("order2.shaft/", "there is no signal"),
        ("order2+.shaft", "write one of max"),
        ("a/b/c", "write one of max"),
        ("hx.shaft", "is not an order"),
        ("order1/0.shaft", "write one of max"),
    ],
)
def test_what_is_no_measure_is_told(name: str, message: str) -> None:
    with pytest.raises(ModelError) as error:
        orbit().measure(name)
    assert message in str(error.value)


def test_short_names() -> None:
    assert full_measure("order2", ("x", "y")) == "order2.x"
    assert full_measure("db.rms", ("x", "y")) == "db.rms.x"
    assert full_measure("y", ("x", "y")) == "half.y"
    assert parsed("order2+2.x") == parsed("order2.x")


@pytest.mark.parametrize("radius", ["0.05 m", "50 mm", "5 cm"])
def test_a_radius_makes_the_acceleration_linear(radius: str) -> None:
    units = orbit(radius).system.units
    assert units.signal("gear.acceleration") == (pytest.approx(0.05 * units.angle), "m/s^2")
    assert units.signal("gear''") == (units.angle, "rad/s^2")
    assert units.signal("drive.acceleration") == (units.angle, "rad/s^2")
    ratio = orbit(radius).motion(64).signal("gear.acceleration") / orbit(radius).motion(64).signal("gear''")
    assert ratio == pytest.approx(0.05, rel=1e-12)


@pytest.mark.parametrize(
    ("radius", "message"),
    [
        ("-1 mm", "it must be positive"),
        ("0 mm", "it must be positive"),
        ("5 N m", "a length is expected"),
        (5, "without a unit"),
    ],
)
def test_a_bad_radius_is_told(radius: object, message: str) -> None:
    with pytest.raises(ModelError) as error:
        orbit(radius)
    assert "gear.radius" in str(error.value)
    assert message in str(error.value)


def test_a_train_without_units_has_no_radius() -> None:
    parts = gw.train
    with pytest.raises(ModelError, match=r"b\.radius is 0\.1, but this train has no units; leave it out"):
        parts.Train(
            [parts.Inertia("a", 1.0), parts.Inertia("b", 1.0, 0.1)], [parts.Shaft("s", ("a", "b"), stiffness=1.0)]
        )

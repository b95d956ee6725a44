"""The reaction of a train balances the constant part of all loads, at every speed; and what is written for a drag."""

import io
import math
import re

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.cli.modes_command import train_lines
from gapwalk.errors import ModelError
from gapwalk.flow.ramp import Ramped
from gapwalk.model.coefficients import ParameterLine, coefficients_of, static_load
from gapwalk.model.doubts import doubts_of, train_doubts

RATIO = 2.5


def geared(loads=(), **changes) -> gw.train.Train:
    """Three inertias in line, with a mesh between the first two; the last one takes the reaction."""
    given = {
        "inertias": [gw.train.Inertia("a", 0.1), gw.train.Inertia("b", 0.3), gw.train.Inertia("c", 2.0)],
        "shafts": [gw.train.Shaft("bc", ("b", "c"), stiffness=40.0, damping=0.3)],
        "gears": [gw.train.Gear("ab", ("a", "b"), RATIO, stiffness=30.0, damping=0.2)],
        "harmonics": loads,
        "frequency": 1.4,
        "reaction": "c",
    }
    return gw.train.Train(**(given | changes))


def all_kinds() -> list:
    angle = np.linspace(0.0, 2.0 * math.pi, 361)
    curve = gw.loads.orders_of(angle, 1.5 + 0.8 * np.cos(2.0 * angle + 0.4))
    return [
        gw.loads.Steady(0.7, {"b": 1.0}, name="plain"),
        gw.loads.Steady(-0.4, {"a": 1.0, "b": 0.5}, name="squared", growth=2, at=0.9),
        gw.loads.Steady(0.2, {"a": -1.0}, name="by_formula", over_speed="1 + 0.3*W"),
        gw.loads.Measured.of(curve, {"a": 1.0}, name="gas", growth=1, at=2.0),
        gw.Harmonic(0.6, {"a": 1.0}, order=2),
    ]


def constant_torques(pace: float) -> tuple[float, float]:
    """The constant torques on a and b, written by hand."""
    on_a = -0.4 * (pace / 0.9) ** 2 - 0.2 * (1.0 + 0.3 * pace) + 1.5 * (pace / 2.0)
    return on_a, 0.7 - 0.2 * (pace / 0.9) ** 2


@pytest.mark.parametrize("pace", [0.3, 1.4, 5.0])
def test_at_every_speed_the_mean_of_all_loads_flows_to_the_reaction(pace: float) -> None:
    system = geared(all_kinds(), mean={"b": 0.25}).system().at(frequency=pace)
    (rest,) = gw.find_equilibria(system).equilibria
    on_a, on_b = constant_torques(pace)
    expected = {"ab": on_a / 30.0, "bc": (RATIO * on_a + on_b + 0.25) / 40.0}
    assert rest.position == pytest.approx([expected[name] for name in system.coordinates], rel=1e-12)
    orbit = gw.find_orbit(system)
    for name, stiffness in (("ab", 30.0), ("bc", 40.0)):
        assert orbit.measure(f"mean.{name}.torque") == pytest.approx(stiffness * expected[name], rel=1e-9)
        assert orbit.measure(f"mean.{name}") == pytest.approx(expected[name], rel=1e-9)
    for inertia in "abc":  # nothing accelerates in the mean
        assert orbit.measure(f"mean.{inertia}''") == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(
    "name", ["frequency", "plain.amplitude", "squared.acts_on.b", "gas.scale", "ab.ratio", "a.inertia", "mean.a"]
)
def test_its_derivatives_are_exact(name: str) -> None:
    system = geared(all_kinds(), mean={"a": 0.25}).system()
    line, value = ParameterLine(system, name), system[name]
    step = 1e-3 * abs(value)
    shifted = [coefficients_of(system.at({name: value + k * step})) for k in (-2, -1, 1, 2)]
    by_differences = (shifted[0] - 8.0 * shifted[1] + 8.0 * shifted[2] - shifted[3]) / (12.0 * step)
    np.testing.assert_allclose(line.coefficients(value)[1], by_differences, rtol=1e-7, atol=1e-8)


def test_without_a_reaction_the_train_accelerates_by_all_of_them() -> None:
    system = geared(all_kinds(), reaction=None).system()
    on_a, on_b = constant_torques(1.4)
    (told,) = train_doubts(system)
    assert doubts_of(system)[-1] == told  # which check, run and show repeat
    expected = (on_a + on_b / RATIO) / (0.1 + 0.3 / RATIO**2 + 2.0 / RATIO**2)
    assert float(re.search(r"a by ([-\d.e]+)", told)[1]) == pytest.approx(expected, rel=1e-5)
    assert 'reaction = "c" would balance them' in told


def test_a_ramp_follows_the_reaction_over_the_speed() -> None:
    loads = [each for each in all_kinds() if each.name != "by_formula"]
    train = geared(loads).system()
    ramped = Ramped(train)
    for pace in (0.5, 2.0):
        np.testing.assert_allclose(
            ramped.coefficients(pace, 0.0), coefficients_of(train.at(frequency=pace)), rtol=1e-10, atol=1e-12
        )


def test_a_reaction_relieves_a_weak_spring_to_the_ground() -> None:
    """Without it the torque of the motor flows through the mesh of the loose gear, which never rattles then."""
    weak = gw.train.Shaft("weak", ("b", "ground"), stiffness=1e-4, damping=0.01)
    parts = {
        "shafts": [gw.train.Shaft("ac", ("a", "c"), stiffness=40.0, damping=0.3), weak],
        "mean": {"a": 9.0},
        "harmonics": [gw.Harmonic(0.5, {"a": 1.0})],
    }
    held, grounded = geared(**parts).system(), geared(**parts, reaction=None).system()
    for system, through, loose in ((held, 9.0, 0.0), (grounded, 0.0, 9.0)):
        position = np.linalg.solve(system.matrix("stiffness"), static_load(system))
        numbers = system.structure.assembly.numbers(system.values)
        of_links = {
            link.name: moved for link, moved in zip(numbers.form.links, numbers.deflections @ position, strict=True)
        }
        assert 40.0 * of_links["ac"] == pytest.approx(through, abs=1e-9)
        assert 30.0 * of_links["ab"] == pytest.approx(loose, abs=1e-9)
    assert "the ground takes the mean torques, 9 at a; " in train_lines(grounded)[-1]
    assert train_lines(held)[1:] == []


TRAIN = """
speed = "1500 rpm"
reaction = "c"
mean = {{ a = "20 N m" }}
inertia = [
    {{ name = "a", inertia = "0.15 kg m^2" }},
    {{ name = "b", inertia = "0.003 kg m^2" }},
    {{ name = "c", inertia = "2.5 kg m^2" }},
]
shaft = [
    {{ name = "ac", between = ["a", "c"], stiffness = "900 N m/rad", damping = "0.6 N m s/rad" }}{more}
]

[[gear]]
name = "ab"
between = ["a", "b"]
ratio = 2.5
stiffness = "5e4 N m/rad"
clearance = "0.001 rad"
damping = "1 N m s/rad"

[[harmonic]]
order = 2
amplitude = "5 N m"
acts_on = {{ a = 1.0 }}
{tables}
[study]
kind = "settle"
"""
OIL = ',\n    { name = "oil", between = ["b", "ENDS"], damping = "0.018 N m s/rad" }'
SLIP = 1500.0 * math.pi / 30.0  # of a


@pytest.mark.parametrize(
    ("more", "tables", "loose", "power"),
    [
        (OIL.replace("ENDS", "ground"), "", 0.018 * SLIP / 2.5, 1),
        (OIL.replace("ENDS", "c"), "", 0.018 * (1.0 / 2.5 - 1.0) * SLIP, 1),
        ("", '[[force]]\nname = "oil"\nbetween = ["b", "ground"]\nlaw = "d*v*abs(v)"\nd = "2e-4 N m s^2/rad^2"\n',
         2e-4 * (SLIP / 2.5) ** 2, 2),
        ("", '[[drag]]\nname = "oil"\nbetween = ["b", "ground"]\nquadratic = "2e-4 N m s^2/rad^2"\n',
         2e-4 * (SLIP / 2.5) ** 2, 2),
        ("", '[[friction]]\nname = "oil"\nbetween = ["b", "c"]\nlimit = "300 mN m"\n', -0.3, 0),
        ("", '[[friction]]\nname = "oil"\nbetween = ["c", "b"]\nlimit = "0.3 N m"\n', -0.3, 0),
        ("", '[[drag]]\nname = "oil"\nbetween = ["c", "b"]\nconstant = "0.3 N m"\n', -0.3, 0),
    ],
)  # fmt: skip
def test_a_drag_between_parts_of_different_speeds_has_its_mean_torque(more, tables, loose: float, power: int) -> None:
    system = gw.read_study(io.StringIO(TRAIN.format(more=more, tables=tables))).system
    for factor in (1.0, 0.5):
        if "friction" in tables:
            break  # which static equilibria leave out
        position = gw.find_equilibria(system.at(speed=1500.0 * factor)).equilibria[0]
        force = next(each.force for each in position.contacts if each.name == "ab")
        assert force * RATIO == pytest.approx(loose * factor**power, rel=1e-6)
    assert gw.find_orbit(system).measure("mean.ab.torque") * RATIO == pytest.approx(loose, rel=1e-4)


def test_a_name_that_a_reaction_needs_is_refused() -> None:
    with pytest.raises(ModelError, match="gas_reaction is a name that the train gives a load of its own"):
        geared(all_kinds(), shafts=[gw.train.Shaft("gas_reaction", ("b", "c"), stiffness=40.0)])

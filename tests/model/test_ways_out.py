"""What messages advise: each line is written here as it is advised, and gives the right motion."""

import io
from fractions import Fraction

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import gapwalk as gw
from gapwalk.errors import ModelError
from gapwalk.model.problems import ModelFileError

PERIOD = 2.0 * np.pi
PLAIN = (
    'coordinates = ["x"]\nstiffness = [[1.0]]\ndamping = [[0.2]]\nfrequency = 0.8\nmean = {{ x = {mean} }}\n{more}\n'
)
LOAD = '[[harmonic]]\namplitude = 0.5\nacts_on = {{ x = 1.0 }}\n[study]\nkind = "settle"\n'


def plain(more: str, mean: float = 0.0) -> gw.System:
    return gw.read_study(io.StringIO((PLAIN + LOAD).format(mean=mean, more=more))).system


def settled(force, frequency: float, periods: int = 60) -> np.ndarray:
    """The state of x'' + 0.2 x' + force(t, x) = 0 after whole periods, by DOP853."""
    end = periods * PERIOD / frequency
    found = solve_ivp(
        lambda t, y: [y[1], -0.2 * y[1] - force(t, y[0])], (0.0, end), [0.0, 0.0], "DOP853", rtol=1e-10, atol=1e-12,
        max_step=0.1,
    )  # fmt: skip
    return found.y[:, -1]


def test_a_gap_beside_the_zero_position_is_counted_from_its_middle() -> None:
    with pytest.raises(ModelFileError, match="subtract the stiffness matrix times this position from the mean load"):
        plain('[[contact]]\nname = "c"\ndeflection = { x = 1.0 }\nside = "positive"\nclearance = -0.15\nstiffness = 50')
    with pytest.raises(ModelError, match=r"for one from 0\.15 to 0\.35 write clearance"):
        gw.System(["x"], [[1.0]], contacts=[gw.Contact("c", {"x": 1.0}, [gw.Stage(-0.15, 50.0)])])
    system = plain('[[contact]]\nname = "c"\ndeflection = { x = 1.0 }\nclearance = 0.1\nstiffness = 50', mean=-0.25)
    with pytest.raises(ModelError, match=r"for one from 0\.15 to 0\.35"):
        system.at({"c.clearance": -0.15})

    def force(t: float, x: float) -> float:
        return x + 50.0 * (min(x - 0.15, 0.0) + max(x - 0.35, 0.0)) - 0.5 * np.cos(0.8 * t)

    expected = settled(force, 0.8, periods=5) - [0.25, 0.0]
    motion = gw.integrate(system, np.array([-0.25, 0.0]), 5.0)
    np.testing.assert_allclose(motion.states[-1], expected, atol=1e-6)


def test_an_entry_of_a_matrix_varies_as_a_force() -> None:
    varying = '[[harmonic]]\nname = "p"\norder = 2\namplitude = 0.3\nvaries = "{}"\n'
    with pytest.raises(ModelError, match=r"an entry of a matrix, .* write it as a force with a law such as \"k\*x\""):
        plain(varying.format("stiffness.x.x"))
    system = plain(
        '[[force]]\nname = "spring"\ndeflection = { x = 1.0 }\nlaw = "k*x"\nk = 1.0\n' + varying.format("spring.k")
    ).at({"stiffness.x.x": 0.0})
    expected = settled(lambda t, x: (1.0 + 0.3 * np.cos(1.6 * t)) * x - 0.5 * np.cos(0.8 * t), 0.8)
    np.testing.assert_allclose(gw.find_orbit(system).state, expected, atol=1e-4)  # the transient decays to 2e-5


def chain(units: bool, loads: list, **changes) -> gw.train.Train:
    inertia, stiffness, damping = ("{} kg m^2", "{} N m/rad", "{} N m s/rad") if units else ("{}",) * 3
    read = str if units else float
    return gw.train.Train(
        [gw.train.Inertia(name, read(inertia.format(size))) for name, size in (("a", 1.0), ("b", 2.0))],
        [gw.train.Shaft("s", ("a", "b"), stiffness=read(stiffness.format(5.0)), damping=read(damping.format(0.1)))],
        harmonics=loads,
        **changes,
    )


def amplitude(speed: float) -> float:
    """Amplitude of the twist by a torque 0.2 cos(W t) on a, in rad."""
    reduced = 2.0 / 3.0
    return abs(0.2 * reduced / (5.0 - reduced * speed**2 + 0.1j * speed))


def test_half_orders_of_a_train() -> None:
    with pytest.raises(ModelError, match=r"mesh = Fraction\(1, 2\), which is not the name of a gear; .* order=0.5"):
        gw.train.Counted(gw.Harmonic(0.2, {"a": 1.0}), Fraction(1, 2))
    with pytest.raises(ModelError, match=r"turns_of = 0.5, which is not the name of an inertia"):
        gw.train.Counted(gw.Harmonic(0.2, {"a": 1.0}), turns_of=0.5)
    with pytest.raises(ModelError, match=r"write gw.train.Counted\(load, order=0.5\) with a load of order 1"):
        gw.Harmonic(0.2, {"a": 1.0}, order=0.5)
    half = gw.train.Counted(gw.Harmonic("0.2 N m", {"a": 1.0}), order=0.5)
    orbit = gw.find_orbit(chain(True, [half], speed="1.2 rad/s").system())
    assert orbit.measure("half.s") == pytest.approx(np.degrees(amplitude(0.6)), rel=1e-6)
    with pytest.raises(ModelError, match=r"multiply the orders of all loads by 2, and write the frequency 0\.6"):
        chain(False, [gw.train.Counted(gw.Harmonic(0.2, {"a": 1.0}), order=0.5)], frequency=1.2)
    orbit = gw.find_orbit(chain(False, [gw.Harmonic(0.2, {"a": 1.0})], frequency=0.6).system())
    assert orbit.measure("half.s") == pytest.approx(amplitude(0.6), rel=1e-6)


TRAIN = """
speed = "60 rpm"
reaction = "b"
{top}
[[inertia]]
name = "a"
inertia = "0.1 kg m^2"
{inertia}
[[inertia]]
name = "b"
inertia = "0.1 kg m^2"
[[shaft]]
name = "s"
between = ["a", "b"]
stiffness = "1 N m/deg"
damping = "1 N m s/deg"
{shaft}
[[harmonic]]
amplitude = "0.1 N m"
acts_on = {{ a = 1.0 }}
{more}
[study]
kind = "settle"
"""


def train(top: str = "", inertia: str = "", shaft: str = "", more: str = "") -> gw.System:
    return gw.read_study(io.StringIO(TRAIN.format(top=top, inertia=inertia, shaft=shaft, more=more))).system


def rest(system: gw.System) -> float:
    return float(gw.find_equilibria(system).equilibria[0].position[0])


def test_a_constant_torque_of_an_inertia_is_a_mean() -> None:
    with pytest.raises(ModelFileError, match=r'a constant load is mean = \{ engine = "10 N m" \}'):
        train(inertia='torque = "10 N m"')
    assert rest(train(top='mean = { a = "10 N m" }')) == pytest.approx(10.0, rel=1e-12)


def test_a_stop_in_a_train_is_a_stage_or_a_formula() -> None:
    with pytest.raises(ModelFileError, match=r"in a drive train a stop on both sides is stage = "):
        train(shaft='end_stop = "5 deg"')
    for sign in (1.0, -1.0):
        top = f'mean = {{ a = "{sign * 10.0} N m" }}'
        both = train(top, shaft='stage = [{ clearance = "5 deg", stiffness = "100 N m/deg" }]')
        assert rest(both) == pytest.approx(sign * (10.0 + 500.0) / 101.0, rel=1e-12)
        formula = 'law = "k*max(x - g, 0)"\nk = "100 N m/deg"\ng = "5 deg"'
        one = train(top, more=f'[[force]]\nname = "stop"\nbetween = ["a", "b"]\n{formula}')
        assert rest(one) == pytest.approx(510.0 / 101.0 if sign > 0.0 else -10.0, rel=1e-9)

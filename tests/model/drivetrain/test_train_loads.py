"""Loads that vary a train, against equations written body by body in SI units, and against a plain system."""

import math
import pickle
from fractions import Fraction
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import gapwalk as gw
from gapwalk.errors import ModelError
from gapwalk.flow.forces import accelerations
from gapwalk.flow.motion import integrate
from gapwalk.model.coefficients import ParameterLine, coefficients_of, layout_of
from gapwalk.model.drivetrain import Scales
from tests.results.again import again
from tests.tiers import in_campaign

DEGREE = math.pi / 180.0
RPM = math.pi / 30.0
BODIES = ("motor", "p1", "w1", "p2", "load")
INERTIA = {"motor": 0.05, "p1": 0.002, "w1": 0.01, "p2": 0.003, "load": 0.4}
GAP, SPEED = 0.05 * DEGREE, 1200.0


def varied() -> list:
    """Loads of all kinds: meshes, transmission errors, and a torque that grows with the speed."""
    return [
        gw.train.Counted(gw.Harmonic(0.2, varies="mesh1.stiffness", name="k1"), mesh="mesh1"),
        gw.train.Counted(
            gw.loads.Rectangle(0.15, "mesh2.stiffness", share=0.6, phase="0.4 rad", name="k2"), mesh="mesh2"
        ),
        gw.train.Counted(
            gw.Harmonic("0.002 deg", varies="mesh1.deflection", name="te1", order=2, phase="0.3 rad"), mesh="mesh1"
        ),
        gw.train.Counted(gw.Harmonic("3e-5 rad", varies="mesh2.deflection", name="te2"), mesh="mesh2"),
        gw.Harmonic("20 N m", {"motor": 1.0}, order=2, name="torque", growth=2, at="1000 rpm"),
    ]


def stages(**changes) -> gw.train.Train:
    """Two meshes, one with backlash, with varying stiffness and transmission errors, in mixed units."""
    given = {
        "inertias": [gw.train.Inertia(name, f"{value} kg m^2") for name, value in INERTIA.items()],
        "shafts": [
            gw.train.Shaft("input", ("motor", "p1"), stiffness="300 N m/deg", damping="0.5 N m s/rad"),
            gw.train.Shaft("middle", ("w1", "p2"), stiffness="3e4 N m/rad", damping="0.7 N m s/rad"),
        ],
        "gears": [
            gw.train.Gear(
                "mesh1",
                ("p1", "w1"),
                teeth=[24, 48],
                stiffness="2e5 N m/rad",
                damping="2 N m s/rad",
                clearance="0.05 deg",
            ),
            gw.train.Gear("mesh2", ("p2", "load"), teeth=[18, 54], stiffness="1e5 N m/rad", damping="3 N m s/rad"),
        ],
        "forces": [gw.train.Force("seal", ("p1", "motor"), "a*v + b*v*abs(v) + k*x**3", a="0.01 N m s/rad",
                                  b="0.002 N m s^2/rad^2", k="3e4 N m/deg^3")],
        "mean": {"motor": "50 N m"},
        "reaction": "load",
        "harmonics": varied(),
        "speed": f"{SPEED} rpm",
    }  # fmt: skip
    return gw.train.Train(**(given | changes))


def by_hand(t: float, angle: np.ndarray, speed: np.ndarray, shaken: bool = False) -> np.ndarray:
    """Accelerations of the bodies in rad/s^2: all in SI units, written without gapwalk."""
    turn = SPEED * RPM * t
    u = dict(zip(BODIES, angle, strict=True))
    v = dict(zip(BODIES, speed, strict=True))
    if shaken:
        u["motor"], v["motor"] = shake(t)
    torque = dict.fromkeys(BODIES, 0.0)
    torque["motor"] += 50.0 + 20.0 * (SPEED / 1000.0) ** 2 * math.cos(2 * turn)
    torque["load"] -= 50.0 * 6.0

    def join(first: str, second: str, ratio: float, force: float) -> None:
        torque[first] -= force
        torque[second] += ratio * force

    x, w = u["motor"] - u["p1"], v["motor"] - v["p1"]
    join("motor", "p1", 1.0, 300.0 / DEGREE * x + 0.5 * w)
    join("p1", "motor", 1.0, -0.01 * w - 0.002 * w * abs(w) - 3e4 / DEGREE**3 * x**3)
    join("w1", "p2", 1.0, 3e4 * (u["w1"] - u["p2"]) + 0.7 * (v["w1"] - v["p2"]))
    mesh, rate = 24 * turn, 24 * SPEED * RPM
    x = u["p1"] - 2 * u["w1"] + 0.002 * DEGREE * math.cos(2 * mesh + 0.3)
    w = v["p1"] - 2 * v["w1"] - 0.002 * DEGREE * 2 * rate * math.sin(2 * mesh + 0.3)
    depth = math.copysign(max(abs(x) - GAP, 0.0), x)
    join("p1", "w1", 2.0, 2e5 * (1 + 0.2 * math.cos(mesh)) * depth + 2.0 * w)
    mesh, rate = 9 * turn, 9 * SPEED * RPM
    high = math.cos(mesh + 0.4) > math.cos(0.6 * math.pi)
    factor = 1.15 if high else 1 - 0.15 * 0.6 / 0.4
    x = u["p2"] - 3 * u["load"] + 3e-5 * math.cos(mesh)
    w = v["p2"] - 3 * v["load"] - 3e-5 * rate * math.sin(mesh)
    join("p2", "load", 3.0, 1e5 * factor * x + 3.0 * w)
    return np.array([torque[name] / INERTIA[name] for name in BODIES])


def shake(t: float) -> tuple[float, float]:
    """The motion of the motor about its steady rotation."""
    w = SPEED * RPM
    wave = [(0.4 * DEGREE, 1, 0.2), (0.1 * DEGREE, 2, 0.0)]
    return (
        sum(size * math.cos(h * w * t + phase) for size, h, phase in wave),
        sum(-size * h * w * math.sin(h * w * t + phase) for size, h, phase in wave),
    )


ROWS = {"input": (1, -1, 0, 0, 0), "middle": (0, 0, 1, -1, 0), "mesh1": (0, 1, -2, 0, 0), "mesh2": (0, 0, 0, 1, -3)}


def shaken() -> gw.train.Train:
    """The same train, with the motion of the motor prescribed."""
    free = [gw.train.Inertia(name, f"{INERTIA[name]} kg m^2") for name in BODIES[1:]]
    return stages(
        inertias=[gw.train.Inertia("motor"), *free],
        mean={"load": "-300 N m"},
        reaction=None,
        harmonics=[
            *varied()[:4],
            gw.Harmonic("0.4 deg", varies="motor.angle", phase="0.2 rad", name="first"),
            gw.Harmonic("0.1 deg", varies="motor.angle", order=2, name="second"),
        ],
    )


@pytest.mark.parametrize("prescribed", [False, True])
@pytest.mark.parametrize("seed", range(12))
def test_the_equations_are_those_written_body_by_body(seed: int, prescribed: bool) -> None:
    random = np.random.default_rng(seed)
    system = (shaken() if prescribed else stages()).system()
    t = random.uniform(0.0, 0.2)
    angle, speed = random.normal(0, 2 * GAP, 5), random.normal(0, 3.0, 5)
    if prescribed:
        angle[0], speed[0] = 0.0, 0.0  # coordinates count the motor as steady
    rows = np.array([ROWS[name] for name in system.coordinates], float)
    found = accelerations(
        layout_of(system.structure),
        coefficients_of(system),
        system.frequency * t,
        rows @ angle / DEGREE,
        rows @ speed / DEGREE,
    )
    moved = by_hand(t, angle, speed, prescribed)
    if prescribed:
        moved[0] = 0.0
    np.testing.assert_allclose(found * DEGREE, rows @ moved, rtol=1e-11)


@pytest.mark.parametrize(
    "name",
    ["speed", "k1.amplitude", "k2.share", "te1.amplitude", "te2.phase", "torque.amplitude", "seal.b", "seal.k",
     "mesh2.stiffness", "mesh2.damping", "mesh1.clearance", "input.stiffness", "p2.inertia"],
)  # fmt: skip
def test_derivatives_by_all_numbers_are_exact(name: str) -> None:
    system = stages().system()
    line, value = ParameterLine(system, name), system[name]
    step = 1e-5 * (abs(value) or 1.0)
    ends = [coefficients_of(system.at({name: value + sign * step})) for sign in (1, -1)]
    coefficients, slope = line.coefficients(value)
    np.testing.assert_allclose(coefficients, coefficients_of(system), rtol=1e-13)
    np.testing.assert_allclose(slope, (ends[0] - ends[1]) / (2 * step), rtol=1e-6, atol=1e-8 * np.abs(slope).max())
    assert np.any(slope)


def test_a_period_is_that_of_dop853() -> None:
    system = stages().system()
    motion = integrate(system, np.zeros(8), 1, 2)
    period, n = 2 * math.pi / system.frequency, 4
    rows = np.array([ROWS[name] for name in system.coordinates], float)

    def rates(t: float, y: np.ndarray) -> np.ndarray:
        return np.concatenate((y[5:], by_hand(t, y[:5], y[5:])))

    # the load accelerates nothing: the torques balance but for the alternating one, which turns the train as a whole
    jumps = [((sign * 0.6 * math.pi - 0.4) % (2 * math.pi)) / (9 * SPEED * RPM) for sign in (1, -1)]
    cycle = 2 * math.pi / (9 * SPEED * RPM)
    times = sorted(jump + k * cycle for jump in jumps for k in range(30) if jump + k * cycle < period)
    state = np.zeros(10)
    for begin, end in pairwise([0.0, *times, period]):
        found = solve_ivp(
            lambda t, y, end=end, begin=begin: rates(min(max(t, begin + 1e-12), end - 1e-12), y),
            (begin, end), state, "DOP853", rtol=1e-11, atol=1e-13, max_step=2e-5,
        )  # fmt: skip
        state = found.y[:, -1]
    np.testing.assert_allclose(motion.q[-1] * DEGREE, rows @ state[:5], rtol=1e-6, atol=1e-10)
    np.testing.assert_allclose(motion.v[-1] * DEGREE, rows @ state[5:], rtol=1e-6, atol=1e-6)
    assert motion.signal("mesh2.torque")[-1] == pytest.approx(_torque(motion), rel=1e-9)
    assert n == system.size


def _torque(motion) -> float:
    """The torque of the second mesh at the end of a period, from the deflections."""
    x, w = motion.signal("mesh2")[-1] * DEGREE, motion.signal("mesh2'")[-1] * DEGREE
    high = math.cos(0.4) > math.cos(0.6 * math.pi)
    return 1e5 * (1.15 if high else 1 - 0.15 * 0.6 / 0.4) * (x + 3e-5) + 3.0 * w


def test_a_displacement_without_clearances_needs_no_contact() -> None:
    train = gw.train.Train(
        [gw.train.Inertia("a", 0.3), gw.train.Inertia("b", 0.7)],
        [gw.train.Shaft("ab", ("a", "b"), stiffness=5.0, damping=0.2)],
        harmonics=[gw.Harmonic(0.1, varies="ab.deflection", order=2, phase=0.4)],
        frequency=1.7,
    )
    system = train.system()
    assert not system.structure.contacts
    mass, w = 0.3 * 0.7, 3.4
    stiffness, damping = 5.0, 0.2  # of the deflection: m x'' + c (x' + u') + k (x + u) = 0
    u = 0.1 * np.exp(0.4j)
    x = -(stiffness + 1j * w * damping) * u / (stiffness + 1j * w * damping - mass * w**2)
    orbit = gw.find_orbit(system)
    assert orbit.measure("half.ab") == pytest.approx(abs(x), rel=1e-9)
    assert orbit.measure("h2.ab.torque") == pytest.approx(abs(mass * w**2 * x), rel=1e-9)


def test_a_varied_shaft_is_a_plain_system() -> None:
    """Mathieu's shaft to the ground: a gapless contact, as one writes it for a plain system."""
    train = gw.train.Train(
        [gw.train.Inertia("a", 2.0)],
        [gw.train.Shaft("wall", ("a", "ground"), stiffness=8.0, damping=0.3)],
        harmonics=[gw.Harmonic(0.2, varies="wall.stiffness", order=2), gw.Harmonic(1.5, {"a": 1.0})],
        frequency=1.3,
    )
    plain = gw.System(
        ["wall"],
        [[0.0]],
        [[0.3]],
        [[2.0]],
        contacts=[gw.Contact("wall2", {"wall": 1.0}, [gw.Stage(0.0, 8.0)])],
        harmonics=[gw.Harmonic(0.2, varies="wall2.stiffness", order=2), gw.Harmonic(1.5, {"wall": 1.0})],
        frequency=1.3,
    )
    found, expected = gw.find_orbit(train.system()), gw.find_orbit(plain)
    np.testing.assert_allclose(found.state, expected.state, rtol=1e-11)
    np.testing.assert_allclose(np.sort(found.multipliers), np.sort(expected.multipliers), rtol=1e-10)
    still = gw.train.Train(train.inertias, train.shafts, harmonics=train.harmonics[1:], frequency=1.3).system()
    assert not still.structure.contacts  # nothing changes for a train that varies nothing


def test_the_period_is_the_common_one() -> None:
    system = stages().system()
    # meshes 24 and 9 per turn, the second order of the motor: 1 turn; without the torque 3 teeth
    assert system.turns == 1
    meshes = stages(harmonics=varied()[:4]).system()
    assert meshes.turns == 3
    assert [load.order for load in meshes.structure.harmonics] == [8, 3, 16, 16, 3, 3]
    halves = stages(harmonics=[gw.train.Counted(varied()[4], order=0.5)]).system()
    assert halves.turns == Fraction(1, 2)
    assert halves.frequency == pytest.approx(0.5 * SPEED * RPM)
    assert "torque of order 1/2" in str(halves.summary())
    assert again(halves) == halves
    assert pickle.loads(pickle.dumps(meshes)) == meshes
    assert again(meshes) == meshes
    of_load = stages(harmonics=[gw.train.Counted(varied()[4], turns_of="load")]).system()
    assert of_load.turns == Fraction(1, 3)  # the second order of a sixth of the speed


def test_other_numbers_keep_their_units() -> None:
    system = stages().system()
    assert system.units is not None
    names = ("k1.amplitude", "te1.amplitude", "seal.b", "torque.amplitude")
    assert [system.units.parameter(name) for name in names] == [
        "", "deg", "N m s^2/rad^2", "N m",
    ]  # fmt: skip
    assert system["te2.amplitude"] == pytest.approx(3e-5 / DEGREE)
    changed = system.at({"te1.amplitude": "1e-4 rad", "seal.a": "1 N m s/deg", "k1.amplitude": 0.3})
    assert changed["te1.amplitude"] == pytest.approx(1e-4 / DEGREE)
    assert changed["seal.a"] == pytest.approx(1 / DEGREE)
    for name, text, reason in (
        ("seal.a", "1 N m s", "has the unit N m s/rad"),
        ("seal.a", "1 kg", "not made of an angle"),
        ("k1.amplitude", "1 N m", "plain number"),
    ):
        with pytest.raises(ModelError, match=reason):
            system.at({name: text})


def test_numbers_that_orders_depend_on_are_no_parameters() -> None:
    names = stages().system().structure.names
    assert "mesh1.ratio" not in names
    assert "mesh2.ratio" not in names
    assert "mesh1.ratio" in stages(harmonics=varied()[4:]).system().structure.names


def test_a_part_is_replaced_with_its_loads() -> None:
    train = stages()
    assert train.replaced("seal", law="a*v", numbers={"a": 0.5}).system()["seal.a"] == 0.5
    other = train.replaced("mesh1", stiffness="1e5 N m/rad").system()
    assert other == train.system().at({"mesh1.stiffness": "1e5 N m/rad"})


def mistake(**changes):
    """A train that is refused."""
    return lambda: stages(**changes)


def varying(name: str, amplitude=0.1, kind=gw.Harmonic, **more):
    """A train of which one load varies something else."""
    return mistake(harmonics=[kind(amplitude, varies=name, name="load1", **more)])


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (varying("mesh9.stiffness"), "load1.varies is 'mesh9.stiffness', but there is no shaft or gear 'mesh9'"),
        (varying("input.damping"), "a damper that acts always does not vary"),
        (varying("mesh1.ratio"), "but a ratio does not vary"),
        (varying("input.clearance", "0.1 deg"), "but input has no clearance"),
        (varying("mesh1.clearance", "0.1 deg"), "the clearance can only vary with all stages of a contact on one side"),
        (varying("mesh1.stifness"), "'mesh1.stifness', which is not one of its numbers"),
        (varying("p1.inertia"), 'varies = "p1.angle" prescribes the motion of p1'),
        (varying("p1.angle", "0.1 deg"), "p1.inertia is 0.002, but its motion is prescribed"),
        (varying("mesh1.deflection"), "load1.amplitude is 0.1, a number without a unit; write an angle"),
        (varying("mesh1.stiffness", "0.1 N m"), "it is a plain number, so write it without a unit"),
        (varying("mesh1.deflection", 0.1, gw.loads.Rectangle), "load1.amplitude is 0.1, a number without a unit"),
        (varying("mesh1.deflection", "0.1 deg", gw.loads.Rectangle), "which cannot jump"),
        (varying("input.deflection", "0.1 deg", gw.loads.Rectangle), "which cannot jump"),
        (
            mistake(harmonics=[gw.Harmonic("1 deg", varies={"mesh1.stiffness": 1.0, "mesh2.deflection": 1.0})]),
            "write two loads",
        ),
        (
            mistake(harmonics=[gw.train.Counted(gw.Harmonic(0.1, varies="mesh1.stiffness"), mesh="mesh7")]),
            "harmonic1.mesh is 'mesh7', which is no gear; ",
        ),
        (
            mistake(harmonics=[gw.train.Counted(gw.Harmonic(0.1, varies="mesh1.stiffness"), turns_of="x")]),
            "harmonic1.turns_of is 'x', which is no inertia",
        ),
        (mistake(reference="x"), "reference is 'x', which is no inertia"),
        (mistake(inertias=[gw.train.Inertia(name) for name in BODIES]), "motor has no inertia; write inertia = ..."),
        (mistake(forces=[gw.train.Force("drag", ("p1", "motor"), "c*v +", c=1.0)]), "drag has no formula as its law"),
        (mistake(forces=[gw.train.Force("drag", ("p1", "motor"), "c*v")]), "drag has no c, which its formula needs"),
        (
            mistake(forces=[gw.train.Force("drag", ("p1", "motor"), "c*v", c="1 kg")]),
            "drag.c is \"1 kg\": kg is not made of an angle, s and N m",
        ),
    ],
)  # fmt: skip
def test_a_mistake_is_told(make, message: str) -> None:
    with pytest.raises(ModelError) as error:
        make()
    assert message in str(error.value)


def gears(first, second, ratio2=None):
    """The gears with other teeth."""
    more = [
        {"teeth": first} if isinstance(first, list) else {"ratio": first[0], "teeth": first[1]},
        {"teeth": second} if ratio2 is None else {"ratio": ratio2},
    ]
    return [
        gw.train.Gear(f"mesh{place + 1}", ends, stiffness="2e5 N m/rad", **more[place])
        for place, ends in enumerate([("p1", "w1"), ("p2", "load")])
    ]


def test_orders_without_a_short_common_period_are_refused_with_the_way_out() -> None:
    hunting = gears([27, 41], [19, 54])
    meshes = varied()[:2]
    assert stages(gears=hunting, harmonics=meshes).system().turns == Fraction(27, 41)
    with pytest.raises(ModelError) as error:
        stages(gears=hunting, harmonics=[*meshes, varied()[4]])
    text = str(error.value)
    assert "torque repeats 82 times before all loads repeat together, after 41 turns of the reference shaft" in text
    assert "leave out the loads counted by mesh2 (1 turn remain)" in text
    assert "longest = 82" in text
    assert stages(gears=hunting, harmonics=[*meshes, varied()[4]], longest=82).system().turns == Fraction(1, 41)
    with pytest.raises(ModelError, match=r"has 24 teeth and the ratio 1.5185, so its second gear would have 36.444"):
        stages(gears=gears((1.5185, 24), [18, 54]))
    with pytest.raises(ModelError, match="which has no teeth; write teeth = 27 for mesh2, the number of p2"):
        stages(gears=gears([24, 48], None, 3.0))
    with pytest.raises(ModelError, match=r"counts turns behind mesh2, whose ratio 3.14159\d* is no fraction"):
        stages(
            gears=gears([24, 48], None, math.pi),
            harmonics=[gw.train.Counted(gw.Harmonic("1 N m", {"load": 1.0}), turns_of="load")],
        )
    with pytest.raises(ModelError, match=r'is no whole multiple of 1; write speed = "1000 rpm"'):
        stages(gears=hunting, harmonics=meshes, speed=None, frequency="20 Hz")
    assert stages(speed=None, frequency="20 Hz").system().structure.harmonics[0].order == 24


@pytest.mark.parametrize("prescribed", [False, True])
def test_the_non_dimensional_form_is_exact(prescribed: bool) -> None:
    system = (shaken() if prescribed else stages()).system()
    form = gw.train.nondimensional(system, Scales(angle=0.06 * DEGREE, frequency=700.0, inertia=0.003))
    random, n = np.random.default_rng(3), system.size
    for theta in random.uniform(0, 2 * math.pi, 4):
        state = random.normal(0, 0.1, 2 * n) * np.repeat([1.0, 700.0], n)
        other, found = form.state(state), []
        for each, (q, v) in ((system, np.split(state, 2)), (form.system, np.split(other, 2))):
            found.append(accelerations(layout_of(each.structure), coefficients_of(each), theta, q, v))
        np.testing.assert_allclose(found[0] * DEGREE, found[1] * 0.06 * DEGREE * 700.0**2, rtol=1e-10)
    assert form.physical_value("seal.a", form.value("seal.a", 0.3)) == pytest.approx(0.3)


@pytest.mark.slow
@pytest.mark.parametrize("prescribed", [False, in_campaign(True)])
def test_a_walk_with_displacements_is_verified(prescribed: bool) -> None:
    load = ("motor.angle", "1 deg") if prescribed else ("mesh.deflection", "0.03 deg")
    train = gw.train.Train(
        [gw.train.Inertia("motor", None if prescribed else "0.1 kg m^2"), gw.train.Inertia("pinion", "0.01 kg m^2"),
         gw.train.Inertia("load", "0.2 kg m^2")],
        [gw.train.Shaft("shaft", ("motor", "pinion"), stiffness="900 N m/rad", damping="0.4 N m s/rad")],
        [gw.train.Gear("mesh", ("pinion", "load"), teeth=[20, 40], stiffness="4000 N m/rad", damping="0.8 N m s/rad",
                       clearance="0.1 deg")],
        forces=[gw.train.Force("oil", ("motor", "pinion"), "c*v*abs(v) + d*x**3", c="0.002 N m s^2/rad^2",
                               d="50 N m/rad^3")],
        mean={"load": "-4 N m"} if prescribed else {"motor": "2 N m"},
        reaction=None if prescribed else "load",
        harmonics=[
            gw.Harmonic(load[1], varies=load[0], name="moved"),
            gw.Harmonic(0.2, varies="mesh.stiffness", order=2, name="varied"),
        ],
        speed="3600 rpm",
    )  # fmt: skip
    orbit = gw.find_orbit(train.system())
    branch = gw.follow(orbit, "speed", to=3000.0, walk=gw.WalkOptions(initial_step=0.1, largest_step=0.3))
    assert gw.verify(branch).ok
    down = 0.7 * orbit.system["moved.amplitude"]
    other = gw.follow(orbit, "moved.amplitude", to=down, walk=gw.WalkOptions(initial_step=0.2, largest_step=0.5))
    assert gw.verify(other).ok
    motion = orbit.motion(64)
    torques = [motion.signal(f"{name}.torque") for name in ("shaft", "oil", "mesh")]
    np.testing.assert_allclose(
        0.01 * motion.signal("pinion''"), torques[0] + torques[1] - torques[2], atol=1e-9 * np.abs(torques[0]).max()
    )

"""Planetary sets and differentials against published modes, Willis's equation, and equations in absolute angles."""

import io
import math
from dataclasses import replace

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.errors import ModelError
from gapwalk.flow.forces import accelerations
from gapwalk.model import System
from gapwalk.model.coefficients import coefficients_of, layout_of
from gapwalk.train import Counted, Drag, Gear, Inertia, Planetary, Shaft, Train
from tests.model.drivetrain.trains import check_slopes
from tests.results.again import again
from tests.tiers import keeps, some_of

# Lin and Parker (1999), Journal of Vibration and Acoustics 121, table 2, in Hz: rotational modes, and planet modes.
ROTATIONAL = {
    3: [1475.7, 1930.3, 2658.3, 7462.8, 11775.3],
    4: [1536.6, 1970.6, 2625.7, 7773.6, 13071.1],
    5: [1567.4, 2006.1, 2614.8, 8065.4, 14253.1],
}
OF_PLANETS = [1808.2, 5963.8, 6981.7]


def lin_parker(planets: int, lumped: bool = True) -> System:
    """The set of Lin and Parker, whose masses are I / r^2, on a carrier of radius 1."""
    sun = 0.6 * math.cos(math.radians(24.6))
    planet, ring = sun * 2.0 / 3.0, sun * 7.0 / 3.0
    inertias = [Inertia("sun", 0.39 * sun**2), Inertia("ring", 3.0 * ring**2), Inertia("carrier", 6.29)]
    gears = Planetary(
        "set",
        "sun",
        "ring",
        "carrier",
        teeth=(30, 20, 70),
        planets=planets,
        planet_inertia=0.61 * planet**2,
        lumped=lumped,
        stiffness=planets * 5e8 * sun**2,
        orbit_inertia=0.66,
        bearing_stiffness=planets * 1e8,
        pressure_angle=24.6,
    )
    support = Shaft("support", ("ring", "ground"), stiffness=1e9 * ring**2)
    return Train(inertias, [support], planetaries=[gears]).system()


@pytest.mark.parametrize("planets", [3, 4, 5])
def test_rotational_modes_are_those_of_lin_and_parker(planets: int) -> None:
    modes = gw.find_modes(lin_parker(planets))
    assert np.array(modes.frequencies) / (2.0 * np.pi) == pytest.approx(ROTATIONAL[planets], abs=0.07)


def test_planets_apart_have_the_planet_modes_too() -> None:
    """With sun, ring and carrier on their axis, each planet mode comes n - 1 times."""
    found = np.array(gw.find_modes(lin_parker(5, lumped=False)).frequencies) / (2.0 * np.pi)
    assert found == pytest.approx(sorted([*ROTATIONAL[5], *OF_PLANETS * 4]), abs=0.07)


# Kinematics.

MEMBERS = ("sun", "ring", "carrier")


@pytest.mark.parametrize("springs", [{}, {"stiffness": 50.0}], ids=["rigid", "elastic"])
@pytest.mark.parametrize("held", MEMBERS)
def test_speeds_follow_willis_for_each_member_held(held: str, springs: dict) -> None:
    first, second = (each for each in MEMBERS if each != held)
    members = {first: first, second: second, held: "ground"}
    gears = Planetary("set", **members, teeth=(30, 20, 70), planet_inertia=0.1, **springs)
    shaft = Shaft("shaft", (second, "wheel"), stiffness=9.0)
    inertias = [Inertia(first, 1.0), Inertia(second, 2.0), Inertia("wheel", 30.0)]
    train = Train(inertias, [shaft], planetaries=[gears], mean={first: 1.0}, reaction="wheel")
    speeds = train._speeds | {"ground": 0.0}
    sun, ring, carrier, planet = (speeds[each] for each in (*members_of(members), "set_planet"))
    assert (sun - carrier) * 30 == pytest.approx(-(ring - carrier) * 70)
    assert (sun - carrier) * 30 == pytest.approx(-(planet - carrier) * 20)
    numbers = train.system().structure.assembly.numbers(train.system().values)
    assert numbers.speeds == pytest.approx([speeds[each.name] for each in train.inertias])
    # power: the torque of the shaft is that of the first member over the ratio of the speeds
    twist = gw.find_equilibria(train.system()).equilibria[0].position[list(train.system().coordinates).index("shaft")]
    assert 9.0 * twist == pytest.approx(speeds[first] / speeds[second])


def members_of(members: dict) -> list[str]:
    return [members[each] for each in MEMBERS]


def test_torques_of_a_differential_are_halves_and_power_is_kept() -> None:
    """Drag on one output only: both half-shafts have the same torque, and the cage both."""
    train = Train(
        [Inertia(each, 1.0) for each in ("cage", "left", "right", "wheel1", "wheel2")],
        [
            Shaft("half1", ("left", "wheel1"), stiffness=40.0, damping=1.0),
            Shaft("half2", ("right", "wheel2"), stiffness=70.0, damping=1.0),
        ],
        planetaries=[Planetary("diff", "left", "right", "cage", ratio=1, stiffness=900.0, damping=0.2)],
        drags=[Drag("lock", ("left", "right"), linear=0.3), Drag("road", ("wheel2", "ground"), linear=0.5)],
        mean={"cage": 4.0},
        reaction="wheel1",
        frequency=2.0,
        harmonics=[gw.Harmonic(0.5, {"cage": 1.0})],
    )
    system = train.system()
    assert system.coordinates == ("half1", "half2", "lock_slip", "diff", "turn")
    assert [*train._speeds.values()] == [1.0] * 5
    orbit = gw.find_orbit(system)
    # of each half 2 N m: the one of the slip that ends in the drag between
    assert orbit.measure("mean.diff.torque") == pytest.approx(-2.0)
    halves = [orbit.measure(f"mean.{each}.torque") for each in ("half1", "half2")]
    assert sum(halves) == pytest.approx(4.0)
    # by hand: the right wheel turns at 2 - s / 2 for a slip s of the outputs, and 2 + .3 s = .5 (2 - s / 2)
    assert halves[1] == pytest.approx(16.0 / 11.0)
    slip = orbit.measure("mean.lock.torque")
    assert halves == pytest.approx([2.0 - slip, 2.0 + slip])


def test_a_rigid_set_is_its_ratio_and_the_inertia_of_its_planets() -> None:
    """Against a train of two inertias, with all of the set at the sun in closed form."""
    gears = Planetary("set", "sun", "ground", "carrier", teeth=(30, 20, 70), planets=4, planet_inertia=0.05)
    train = Train(
        [Inertia("sun", 0.3), Inertia("carrier", 0.7), Inertia("out", 2.0)],
        [Shaft("shaft", ("carrier", "out"), stiffness=5.0)],
        planetaries=[gears],
    )
    ratio = 1.0 + 7.0 / 3.0  # sun over carrier
    planet = 1.0 - 7.0 / 2.0  # planet over carrier
    inertia = 0.7 + 0.3 * ratio**2 + 4 * 0.05 * planet**2
    wanted = math.sqrt(5.0 * (1.0 / inertia + 1.0 / 2.0))
    assert np.array(gw.find_modes(train.system()).frequencies) == pytest.approx([wanted])


# Random sets against equations in absolute angles.


def random_sets(seed: int) -> Train:
    """One or two sets, rigid, elastic or with gaps, with planets of all kinds, between trees of shafts and gears."""
    random = np.random.default_rng(seed)
    names = ["m0", "m1"]
    links, gears, sets, free = [Shaft("begin", ("m0", "m1"), stiffness=5.0, damping=0.1)], [], [], "m1"
    for number in range(int(random.integers(1, 3))):
        planet = int(random.integers(10, 30))
        sun = int(random.integers(15, 40))
        members = [free, f"a{number}", "ground"]
        names.append(f"a{number}")
        match int(random.integers(4)):
            case 0:  # the third member is held by a spring
                members[2] = f"b{number}"
                names.append(members[2])
                links.append(
                    Shaft(f"held{number}", (members[2], "ground"), stiffness=float(random.uniform(5, 50)), damping=0.2)
                )
            case 1:  # power split: the third member is geared to the second
                members[2] = f"b{number}"
                names.append(members[2])
                ratio = -float(random.integers(2, 5))
                gears.append(
                    Gear(f"split{number}", (members[2], f"a{number}"), ratio, stiffness=float(random.uniform(5, 50)))
                )
            case 2:  # it slips on a drag
                members[2] = f"b{number}"
                names.append(members[2])
                links.append(Shaft(f"drag{number}", (members[2], f"a{number}"), damping=float(random.uniform(0.1, 1))))
        free = f"a{number}"
        random.shuffle(members)
        place = dict(zip(MEMBERS, members, strict=True))
        springs = {"stiffness": float(random.uniform(20, 90)), "damping": 0.3, "clearance": random.choice([None, 0.02])}
        of_ring = {"ring_stiffness": float(random.uniform(20, 90)), "ring_damping": 0.1}
        teeth = {"teeth": (sun, planet, sun + 2 * planet), "planets": int(random.integers(2, 5))}
        inertia = {"planet_inertia": float(random.uniform(0.01, 0.3))}
        bearing = {"orbit_inertia": 0.2, "bearing_stiffness": float(random.uniform(10, 60)), "bearing_damping": 0.05}
        match int(random.integers(6)):
            case 0:
                kind = inertia if random.random() < 0.5 else {}
            case 1:
                kind = springs
            case 2:
                kind = inertia | springs | of_ring | {"lumped": False}
            case 3:
                kind = inertia | springs | of_ring | bearing | {"lumped": bool(random.random() < 0.5)}
            case 4:
                kind = inertia | {"ring_stiffness": of_ring["ring_stiffness"]}
            case _:
                kind = inertia | springs | of_ring
        sets.append(Planetary(f"set{number}", **place, **teeth, **kind))
    names.append("end")
    gears.append(
        Gear("last", (free, "end"), float(random.uniform(0.5, 2)), stiffness=float(random.uniform(1, 9)), damping=0.1)
    )
    inertias = [Inertia(name, float(random.uniform(0.2, 3))) for name in names]
    pair = [("m0", "ground"), ("end", "ground"), ("m1", "a0"), ("a0", "ground")]
    train = Train(inertias, links, gears, planetaries=sets)
    drags = []
    for number in range(int(random.integers(0, 3))):
        first, second = pair[int(random.integers(len(pair)))]
        if abs(train._speeds[first] - train._speeds.get(second, 0.0)) > 1e-6:
            own = {"linear": float(random.uniform(0.05, 0.3)), "quadratic": 0.02 * float(random.integers(2))}
            drags.append(Drag(f"oil{number}", (first, second), **{k: v for k, v in own.items() if v}))
    return Train(
        inertias,
        links,
        gears,
        {"m0": 0.7},
        [gw.Harmonic(0.4, {"m0": 1.0}, order=2, phase=0.3)],
        frequency=1.3,
        reaction="end",
        drags=drags,
        planetaries=sets,
    )


def rows_by_hand(train: Train, names: list[str]):
    """(row, stiffness, damping, clearance, rigid) of everything that joins, in absolute angles."""

    def unit(name: str | None) -> np.ndarray:
        return np.array([1.0 * (name == each) for each in names])

    for link in (*train.shafts, *train.gears):
        row = unit(link.between[0]) - getattr(link, "ratio", 1.0) * unit(link.between[1])
        yield row, link.stiffness or 0.0, link.damping, link.clearance, False
    for each in train.planetaries:
        sun, planet, ring = each.teeth
        apart = each.planets if not each.lumped and each.stiffness else 1
        share = 1.0 / apart
        springs = [(each.stiffness, each.damping, each.clearance)]
        at_ring = each.stiffness if each.ring_stiffness is None else each.ring_stiffness
        damper = each.damping if each.ring_damping is None else each.ring_damping
        springs.append((at_ring, damper, each.clearance))
        if each.planet_inertia is None:
            whole = sun * unit(each.sun) + ring * unit(each.ring) - (sun + ring) * unit(each.carrier)
            yield whole / sun, springs[0][0] or 0.0, springs[0][1], springs[0][2], springs[0][0] is None
            continue
        for number in range(apart):
            place = str(number + 1) if apart > 1 else ""
            turn, centre = unit(f"{each.name}_planet{place}"), unit(each.carrier)
            out = np.zeros(len(names))
            if each.orbit_inertia:
                centre, out = unit(f"{each.name}_orbit{place}"), unit(f"{each.name}_radial{place}")
                for way in (centre - unit(each.carrier), out):
                    yield way, each.bearing_stiffness * share, each.bearing_damping * share, None, False
            # ways of the two flanks along the line of action, over the sun's base radius: r_c cos = r_s + r_p
            slope = math.tan(math.radians(each.pressure_angle))
            circle = (sun + planet) / sun
            at_sun = unit(each.sun) + planet / sun * turn - circle * centre - circle * slope * out
            at_ring = ring / sun * unit(each.ring) - planet / sun * turn - circle * centre + circle * slope * out
            for row, (stiffness, damping, clearance) in zip((at_sun, at_ring), springs, strict=True):
                yield row, (stiffness or 0.0) * share, damping * share, clearance, stiffness is None


@pytest.mark.parametrize("seed", some_of(range(40), *range(0, 40, 3)))
def test_the_equations_are_those_in_absolute_angles(seed: int) -> None:
    train = random_sets(seed)
    system = train.system()
    assembly = system.structure.assembly
    numbers, random = assembly.numbers(system.values), np.random.default_rng(seed)
    names = [each.name for each in train.inertias]
    q, rate = random.normal(0.0, 0.1, system.size), random.normal(0.0, 0.01, system.size)
    has_turn = assembly.form.has_turn
    if has_turn:
        rate[-1] *= 1e-3
    angle, speed = numbers.angles @ q, numbers.angles @ (rate + numbers.leaks * q)
    inertia = np.array([each.inertia for each in train.inertias])
    total, rigid = np.zeros(len(names)), []
    turning = np.array([train._speeds[each] for each in names])
    total[0] = 0.7 + 0.4 * math.cos(2 * 0.9 + 0.3)
    for row, stiffness, damping, clearance, bound in rows_by_hand(train, names):
        assert row @ turning == pytest.approx(0.0, abs=1e-12)
        if bound:
            rigid.append(row)
            continue
        x = row @ angle
        depth = x if clearance is None else math.copysign(max(abs(x) - clearance, 0.0), x)
        total -= row * (stiffness * depth + damping * (row @ speed))
    balance = 0.7 * turning[0]
    for drag in train.drags:
        row = np.array([1.0 * (each == drag.between[0]) - 1.0 * (each == drag.between[1]) for each in names])
        base, now = row @ turning * 1.3, row @ (turning * 1.3 + speed)
        torque = [drag.numbers["linear"] * s + drag.numbers.get("quadratic", 0.0) * s * abs(s) for s in (base, now)]
        total -= row * torque[1]
        balance -= row @ turning * torque[0]
    place = names.index("end")
    held = numbers.hold * 1e3 * q[-1] + numbers.steadying * 1e3 * rate[-1] if has_turn else 0.0
    total[place] -= (balance + held) / turning[place]
    bound = np.array(rigid).reshape(len(rigid), len(names))
    # rigid rows may depend on each other, as those of planets apart
    matrix = np.block([[np.diag(inertia), bound.T], [bound, np.zeros((len(bound), len(bound)))]])
    expected = np.linalg.lstsq(matrix, np.concatenate((total, np.zeros(len(bound)))), rcond=None)[0][: len(names)]
    found = accelerations(layout_of(system.structure), coefficients_of(system), 0.9, q, rate)
    moved = numbers.angles @ (found + numbers.leaks * rate)
    whole = 0.0 if has_turn else (inertia * turning @ expected) / (inertia * turning @ turning)
    assert moved + whole * turning == pytest.approx(expected, rel=1e-10, abs=1e-10)
    equations = System.from_values(system.structure.equations, system.equations.values)
    assert coefficients_of(equations) == pytest.approx(coefficients_of(system), rel=1e-9, abs=1e-9)


@keeps("6", "2", "1")
@pytest.mark.parametrize("seed", range(8))
def test_derivatives_by_each_number_are_exact(seed: int) -> None:
    check_slopes(random_sets(seed).system())


# Orders by teeth, phases of planets, files, and errors.

FILE = """
title = "planetary set"
speed = "1500 rpm"
reaction = "out"
mean = { sun = "20 N m" }
[[inertia]]
name = "sun"
inertia = "0.01 kg m^2"
[[inertia]]
name = "carrier"
inertia = "0.03 kg m^2"
[[inertia]]
name = "out"
inertia = "0.8 kg m^2"
[[shaft]]
name = "shaft"
between = ["carrier", "out"]
stiffness = "3000 N m/rad"
damping = "2 N m s/rad"
[[planetary]]
name = "set"
sun = "sun"
ring = "ground"
carrier = "carrier"
teeth = [30, 20, 70]
planets = 4
planet_inertia = "2e-4 kg m^2"
stiffness = "2e5 N m/rad"
damping = "3 N m s/rad"
clearance = "0.02 deg"
lumped = false
[[harmonic]]
mesh = "set"
varies = "set_sun.stiffness"
order = 1
amplitude = 0.2
"""


def read(text: str) -> System:
    return gw.read_model(io.StringIO(text))


def test_a_file_with_phased_meshes() -> None:
    """Per turn of the sun 30 (1 - 30 / 100) = 21 teeth pass; the planets are a quarter of 100 teeth apart."""
    system = read(FILE)
    assert system.turns == 21
    phases = [system[f"harmonic{place}.phase"] for place in (11, 12, 13, 14)]
    wanted = [math.remainder(-30 * 360.0 * place / 4, 360.0) for place in range(4)]
    assert np.cos(np.radians(phases)) == pytest.approx(np.cos(np.radians(wanted)))
    assert np.sin(np.radians(phases)) == pytest.approx(np.sin(np.radians(wanted)), abs=1e-9)
    orbit = gw.find_orbit(system)
    # the mean torque of the sun is that of four meshes; that of the shaft follows from the speeds
    meshes = [orbit.measure(f"mean.set_sun{place}.torque") for place in range(1, 5)]
    assert sum(meshes) == pytest.approx(20.0, rel=1e-6)
    assert orbit.measure("mean.shaft.torque") == pytest.approx(20.0 * 100 / 30, rel=1e-6)


def test_sums_over_planets_in_opposite_phases_shake_nothing() -> None:
    """With 30 teeth and 4 planets meshes 1 and 3 are in phase, and against 2 and 4: order 1 leaves the shaft alone."""
    system = read(
        FILE.replace('"set_sun.stiffness"', '"set_sun.deflection"')
        .replace("amplitude = 0.2", 'amplitude = "0.002 deg"')
        .replace('clearance = "0.02 deg"', "")
    )
    motion = gw.find_orbit(system).motion(257)
    moved = motion.signal("set_planet1.acceleration")
    assert np.ptp(moved) > 1.0
    assert np.ptp(motion.signal("shaft.torque")) < 1e-6 * np.ptp(motion.signal("set_sun1.torque"))


def test_a_set_with_a_gap_per_mesh_moves_as_in_absolute_angles() -> None:
    """A period of rattle by SciPy's DOP853 in absolute angles from the same state."""
    from scipy.integrate import solve_ivp

    train = Train(
        [Inertia("sun", 0.3), Inertia("carrier", 1.1), Inertia("wheel", 5.0)],
        [Shaft("shaft", ("carrier", "wheel"), stiffness=4.0, damping=0.3)],
        planetaries=[
            Planetary(
                "set",
                "sun",
                "ground",
                "carrier",
                teeth=(30, 20, 70),
                planet_inertia=0.02,
                stiffness=60.0,
                damping=0.4,
                clearance=0.05,
                ring_stiffness=90.0,
            )
        ],
        harmonics=[gw.Harmonic(0.4, {"sun": 1.0})],
        frequency=1.7,
    )
    system = train.system()
    orbit = gw.find_orbit(system)
    assert orbit.events
    rows = [*rows_by_hand(train, [each.name for each in train.inertias])]
    inertia = np.array([each.inertia for each in train.inertias])
    load = np.array([1.0, 0.0, 0.0, 0.0])

    def rhs(time: float, y: np.ndarray) -> np.ndarray:
        total = 0.4 * math.cos(1.7 * time) * load
        for row, stiffness, damping, clearance, _ in rows:
            x = row @ y[:4]
            depth = x if clearance is None else math.copysign(max(abs(x) - clearance, 0.0), x)
            total = total - row * (stiffness * depth + damping * (row @ y[4:]))
        return np.concatenate((y[4:], total / inertia))

    numbers, n = system.structure.assembly.numbers(system.values), system.size
    # the angular momentum of the excitation: whole' = integral of its share
    first = np.concatenate([numbers.angles @ half for half in (orbit.state[:n], orbit.state[n:])])
    turning = numbers.speeds
    whole = inertia * turning @ turning
    first[:4] -= turning * 0.4 / 1.7**2 / whole
    # without short steps, corners of the force that fall between the stages of a step pass unseen
    settings = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-13, "max_step": 0.005}
    found = solve_ivp(rhs, (0.0, orbit.period * 2 * np.pi / 1.7), first, **settings)
    assert found.y[:, -1] == pytest.approx(first, abs=2e-8)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"teeth": (30, 20, 71)}, "write teeth = [30, 20, 70]"),
        ({"teeth": None}, "write teeth = [30, 20, 70]"),
        ({"teeth": None, "ratio": -1.0}, "1 for a differential"),
        ({"sun": None}, "write sun ="),
        ({"sun": "nobody"}, "which is no inertia"),
        ({"ring": "a"}, "two of its members"),
        ({"planet_inertia": 0.1, "planets": 0}, "planets = 0"),
        ({"lumped": False}, "write planet_inertia and stiffness"),
        ({"clearance": 0.1, "stiffness": None}, "rigid"),
        ({"planet_inertia": 0.1, "orbit_inertia": 0.2}, "write both"),
        ({"ring_stiffness": 3.0}, "planets have no inertia"),
        ({"ring": "c"}, "hold a member"),
    ],
)
def test_errors_of_sets_say_what_to_write(changes: dict, words: str) -> None:
    own = {"sun": "a", "ring": "ground", "carrier": "b", "teeth": (30, 20, 70), "stiffness": 5.0} | changes
    inertias = [Inertia("a", 1.0), Inertia("b", 1.0), *([Inertia("c", 1.0)] if own["ring"] == "c" else [])]
    with pytest.raises(ModelError) as error:
        Train(inertias, planetaries=[Planetary("set", **own)])
    assert words in str(error.value)


def test_gears_that_lock_a_set_are_refused() -> None:
    gears = [Gear("first", ("a", "c"), 2.0, stiffness=1.0), Gear("second", ("a", "b"), 3.0, stiffness=1.0)]
    own = Planetary("set", "a", "b", "c", teeth=(30, 20, 70), stiffness=5.0)
    with pytest.raises(ModelError, match="lock the train"):
        Train([Inertia(each, 1.0) for each in "abc"], [], gears, planetaries=[own])


def test_orders_of_planets_and_members_are_exact() -> None:
    train = Train(
        [Inertia("sun", "1 kg m^2"), Inertia("carrier", "1 kg m^2"), Inertia("wheel", "1 kg m^2")],
        [Shaft("shaft", ("carrier", "wheel"), stiffness="9 N m/rad")],
        harmonics=[Counted(gw.Harmonic("0.1 N m", {"carrier": 1.0}, name="bump"), turns_of="set_planet")],
        speed="60 rpm",
        planetaries=[
            Planetary(
                "set",
                "sun",
                "ground",
                "carrier",
                teeth=(30, 20, 70),
                planet_inertia="0.1 kg m^2",
                stiffness="50 N m/rad",
            )
        ],
    )
    assert train.units is not None
    assert train.units.turns == pytest.approx(0.75)  # the planet turns backwards at -5/2 of the carrier's 3/10


def test_a_member_with_a_prescribed_motion_shakes_the_set() -> None:
    """Against the response of the free angles to that of the sun, by dynamic stiffness."""
    inertias = [Inertia("sun"), Inertia("carrier", 0.7), Inertia("out", 2.0)]
    gears = Planetary(
        "set", "sun", "ground", "carrier", teeth=(30, 20, 70), planet_inertia=0.1, stiffness=50.0, damping=0.3
    )
    train = Train(
        inertias,
        [Shaft("shaft", ("carrier", "out"), stiffness=9.0, damping=0.2)],
        harmonics=[gw.Harmonic(0.2, varies="sun.angle", name="motion")],
        frequency=1.7,
        planetaries=[gears],
    )
    names = [each.name for each in train.inertias]
    matrix = np.zeros((4, 4), dtype=complex)
    for row, stiffness, damping, _, _ in rows_by_hand(train, names):
        matrix += (stiffness + 1.7j * damping) * np.outer(row, row)
    matrix -= 1.7**2 * np.diag([0.0, 0.7, 2.0, 0.3])
    angles = np.linalg.solve(matrix[1:, 1:], -0.2 * matrix[1:, 0])
    motion = gw.find_orbit(train.system()).motion(257)
    found = [2.0 * np.mean((motion.signal(f"{name}.angle") * np.exp(-1j * motion.theta))[:-1]) for name in names[1:]]
    assert found == pytest.approx(angles, rel=1e-8)
    with pytest.raises(ModelError, match="is rigid, so the motion of"):
        Train(
            inertias, train.shafts, harmonics=train.harmonics, planetaries=[replace(gears, stiffness=None, damping=0)]
        )


def test_a_set_is_stored_and_replaced() -> None:
    train = random_sets(3)
    assert again(train.system()) == train.system()
    name = train.planetaries[0].name
    changed = train.replaced(name, planet_inertia=0.5, stiffness=33.0)
    assert changed.planetaries[0].stiffness == 33.0
    assert [each.inertia for each in changed.inertias if each.name.startswith(f"{name}_planet")]

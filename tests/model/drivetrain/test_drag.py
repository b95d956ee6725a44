"""Drags between parts that turn at different speeds: the rotation as a whole, the reaction, and what depends on W.

Reference values are those of computations in absolute angles by SciPy's DOP853, and of closed forms; the equations of
random trains are written here from the bodies, in absolute angles.
"""

import io
import math

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.errors import ModelError
from gapwalk.flow.characteristics import characteristics_of
from gapwalk.flow.forces import accelerations
from gapwalk.model import System
from gapwalk.model.coefficients import ParameterLine, coefficients_of, layout_of
from gapwalk.studies.machine_templates import machine_text
from gapwalk.train import Drag, Force, Friction, Gear, Inertia, Shaft, Train
from tests.model.drivetrain.trains import check_slopes
from tests.tiers import keeps, some_of

W, MEAN = 100.0, 20.0
BODIES = {"flywheel": 0.15, "input": 0.005, "gear": 0.003, "output": 0.01, "vehicle": 2.5}
DRAGS = (
    Drag("bearing", ("gear", "output"), linear=0.010),
    Drag("churning", ("gear", "ground"), linear=0.018),
    Drag("final", ("output", "ground"), linear=0.020, quadratic=1e-4),
)


def worked(amplitude: float, drags=DRAGS, **more) -> System:
    """Five inertias with an engaged and a loose mesh."""
    parts = {
        "inertias": [Inertia(*each) for each in BODIES.items()],
        "shafts": [
            Shaft("clutch", ("flywheel", "input"), stiffness=900.0, damping=0.6),
            Shaft("half", ("output", "vehicle"), stiffness=400.0, damping=1.0),
        ],
        "gears": [
            Gear("engaged", ("input", "output"), 1.25, stiffness=2e4),
            Gear("loose", ("input", "gear"), 2.5, stiffness=5e4, clearance=0.001, impact_damping=1.0),
        ],
        "drags": drags,
        "mean": {"flywheel": MEAN},
        "reaction": "vehicle",
        "frequency": W,
        "harmonics": [gw.Harmonic(amplitude, {"flywheel": 1.0}, order=2)],
    }
    return Train(**(parts | more)).system()


def amplitude(motion, signal: str, order: int = 2) -> float:
    """Amplitude of an order of a signal over samples that close a period."""
    return 2.0 * abs(np.mean((motion.signal(signal) * np.exp(-1j * order * motion.theta))[:-1]))


def test_the_worked_example_without_separation() -> None:
    """Closed form in complex amplitudes, and DOP853 in absolute angles."""
    system = worked(5.0)
    assert system.coordinates == ("clutch", "half", "engaged", "loose", "turn")
    numbers = system.structure.assembly.numbers(system.values)
    assert numbers.mean_slips[-3:] == pytest.approx([-40.0, 40.0, 80.0], abs=1e-12)
    assert numbers.drags[-3:] == pytest.approx([-0.4, 0.72, 2.24], abs=1e-13)
    (final,) = (each for each in characteristics_of(system).forces if each.over_slip)
    np.testing.assert_allclose(final.force, 0.020 * final.x + 1e-4 * final.x**2, rtol=1e-13, atol=1e-13)
    assert numbers.torques[0][-1] == pytest.approx(-22.2, abs=1e-13)
    assert (numbers.whole, numbers.whole * numbers.decay) == pytest.approx((1.76188, 0.02752), rel=1e-12)
    orbit = gw.find_orbit(system)
    motion = orbit.motion(1025)
    assert orbit.state[[0, 1, 2, 3]] == pytest.approx([0.022402870, 0.05471156, 0.00099226, 0.001002937], abs=1e-8)
    assert orbit.state[5:9] == pytest.approx([0.043248716, -0.030848045, 0.0013160473, 0.000015454579], abs=2e-9)
    assert 1e3 * orbit.state[9] == pytest.approx(0.0000153, abs=1e-7)
    assert amplitude(motion, "loose.torque") == pytest.approx(0.01921864, abs=1e-8)
    assert amplitude(motion, "gear''") / (2.0 * W) == pytest.approx(0.08005263, abs=2e-8)
    assert 1e3 * amplitude(motion, "turn'") == pytest.approx(0.01419242, abs=1e-8)
    loose = motion.signal("loose.torque")
    assert (loose.min(), loose.max()) == pytest.approx((0.108781, 0.147219), abs=2e-6)
    means = [orbit.measure(f"mean.{each}.torque") for each in ("clutch", "engaged", "loose")]
    assert means == pytest.approx([20.0, 19.872, 0.128], abs=1e-10)
    drags = [orbit.measure(f"mean.{each}.torque") for each in ("bearing", "churning")]
    assert drags == pytest.approx([-0.4, 0.72], abs=1e-9)


def rattling(system: System) -> gw.Orbit:
    """The motion of period 1 with nine separations, near where DOP853 has it."""
    x = [0.024416185, 0.046026834, 0.000967738, 0.001003330]
    rates = [0.617090, -0.338488, -0.120870, -0.177250]
    turn = ([0.0], [1.83e-7]) if system.size == 5 else ([], [])
    return gw.find_orbit(system, start=np.array([*x, *turn[0], *rates, *turn[1]]))


def test_the_worked_example_in_rattle() -> None:
    orbit = rattling(worked(60.0))
    motion = orbit.motion(16385)
    assert sum(not event.enters for event in orbit.events) == 2 * 9  # in two periods of order 2
    x = orbit.state[:4]
    assert x == pytest.approx([0.024416185, 0.046026834, 0.000967738, 0.001003330], abs=5e-8)
    assert orbit.state[5:9] == pytest.approx([0.617090, -0.338488, -0.120870, -0.177250], abs=1e-5)
    loose = motion.signal("loose.torque")[:-1]
    assert (loose.min(), loose.max()) == pytest.approx((-3.910, 5.399), abs=1e-3)
    assert np.sqrt(np.mean(loose**2)) == pytest.approx(0.5026, abs=5e-5)
    assert amplitude(motion, "loose.torque") == pytest.approx(0.242416, abs=4e-5)
    assert amplitude(motion, "gear''") / (2.0 * W) == pytest.approx(1.01127, abs=1e-4)
    assert 1e3 * amplitude(motion, "turn'") == pytest.approx(0.170311, abs=3e-6)


def test_the_mean_of_the_speed_is_kept_though_a_drag_is_square() -> None:
    """The reaction of DOP853 for which the mean speed is exactly W; without vibration it would be 22.2 N m."""
    orbit = rattling(worked(60.0))
    assert orbit.measure("mean.half.torque") == pytest.approx(22.199815, abs=5e-7)
    assert orbit.measure("mean.turn'") == pytest.approx(0.0, abs=1e-10)
    assert orbit.measure("mean.loose.torque") == pytest.approx(0.128, abs=2e-5)


def test_without_the_rotation_or_without_the_vibration_of_the_drags_it_is_another_motion() -> None:
    """In the deflection of the loose mesh 1.5e-6 and 5.2e-6, where the one that is right is within 1e-8."""
    from gapwalk.model.drivetrain import train_assembly

    right = rattling(worked(60.0)).state[3]
    slips = {"gear": -0.4 + 0.72, "output": 0.4 + 2.24}
    means = {"flywheel": MEAN} | {name: -torque for name, torque in slips.items()}
    steady = rattling(worked(60.0, drags=(), mean=means)).state[3]
    assert abs(steady - right) == pytest.approx(5.2e-6, rel=0.05)
    form = train_assembly.TrainForm.has_turn
    train_assembly.TrainForm.has_turn = property(lambda self: False)
    try:
        still = rattling(worked(60.0)).state[3]
    finally:
        train_assembly.TrainForm.has_turn = form
    assert 1.4e-6 < abs(still - right) < 2e-6


# Random trains against equations in absolute angles.


def slips_of(train: Train):
    """(vector of inertias, torque as a function of slip and of all absolute speeds) of everything that slips."""
    names = [each.name for each in train.inertias]

    def unit(name: str) -> np.ndarray:
        return np.array([1.0 * (name == each) for each in names])

    for drag in train.drags:
        given, scale = drag.numbers, train.groups.get(drag.group, 1.0) if drag.group else 1.0

        def torque(s, w, base, given=given, scale=scale):
            found = given.get("linear", 0.0) * s + given.get("quadratic", 0.0) * s * abs(s)
            low = given.get("constant", 0.0)
            if "breakaway" in given:
                low = low + (given["breakaway"] - low) * math.exp(-((s / given["stribeck"]) ** 2))
            return scale * (found + low * math.copysign(1.0, base))

        yield unit(drag.between[0]) - unit(drag.between[1]), torque
    for shaft in train.shafts:
        if shaft.is_drag:
            yield unit(shaft.between[0]) - unit(shaft.between[1]), lambda s, w, base, c=shaft.damping: c * s
    for rub in train.frictions:
        yield (
            unit(rub.between[0]) - unit(rub.between[1]),
            lambda s, w, base, t=rub.numbers["limit"]: t * math.copysign(1.0, s),
        )
    for force in train.forces:  # "a*w1*w1 - b*w2 + c*s*s*s + d*W"
        first, second = unit(force.between[0]), unit(force.between[1])

        def formula(s, w, base, n=force.numbers, i=first, j=second):
            return n["a"] * (i @ w) ** 2 - n["b"] * (j @ w) + n["c"] * s**3 + n["d"] * 1.3

        yield first - second, formula


def by_hand(train: Train, angle, speed, theta: float, hold: float, turn: float, speeds=None):
    """Accelerations of all inertias in absolute angles, with the reaction that holds the mean speed."""
    names = [each.name for each in train.inertias]
    inertia = np.array([each.inertia for each in train.inertias])
    total, mean, rigid = np.zeros(len(names)), np.array([train.mean.get(each, 0.0) for each in names]), []
    r, known = dict.fromkeys(names, 0.0), [train.reference]
    r[train.reference] = 1.0
    links = [link for link in (*train.shafts, *train.gears) if not link.is_drag]
    for name in known:
        for link in links:
            first, second = link.between
            ratio = getattr(link, "ratio", 1.0)
            for here, there, factor in ((first, second, 1.0 / ratio), (second, first, ratio)):
                if here == name and there not in known:
                    r[there] = r[name] * factor
                    known.append(there)
    turning = np.array([r[each] for each in names]) if speeds is None else speeds
    for load in train.harmonics:
        for name, share in load.acts_on.items():
            total[names.index(name)] += share * load.amplitude * math.cos(load.order * theta + load.phase)
    for link in links:
        row = np.array([1.0 * (each == link.between[0]) for each in names])
        row -= getattr(link, "ratio", 1.0) * np.array([1.0 * (each == link.between[1]) for each in names])
        if not link.has_springs:
            rigid.append(row)
            continue
        x, v = row @ angle, row @ speed
        depth = x if link.clearance is None else math.copysign(max(abs(x) - link.clearance, 0.0), x)
        total -= row * (link.stiffness * depth + link.damping * v)
    balance = turning @ mean
    for row, torque in slips_of(train):
        base = row @ turning * 1.3
        total -= row * torque(base + row @ speed, turning * 1.3 + speed, base)
        balance -= row @ turning * torque(base, turning * 1.3, base)
    total += mean
    if train.reaction:
        place = names.index(train.reaction)
        total[place] -= (balance + hold * turn) / turning[place]
    else:  # the torque by which the train is held at its speed acts on all parts as they turn
        total -= inertia * turning * hold * turn / (inertia * turning @ turning)
    rows = np.array(rigid).reshape(len(rigid), len(names))
    none = np.zeros((len(rows), len(rows)))
    matrix = np.block([[np.diag(inertia), rows.T], [rows, none]])
    return np.linalg.solve(matrix, np.concatenate((total, np.zeros(len(rows)))))[: len(names)], turning


def random_train(seed: int) -> Train:
    """A free tree of up to nine bodies with drags of all kinds between any of them, and on the casing."""
    random = np.random.default_rng(seed)
    count = int(random.integers(3, 10))
    names = [f"b{number}" for number in range(count)]
    shafts = [Shaft("first", (names[0], names[1]), stiffness=4.0, damping=0.3)]
    gears, drags, forces, frictions = [], [], [], []
    for number, name in enumerate(names[2:], start=2):
        pair = (name, names[int(random.integers(number))])
        pair = pair if random.random() < 0.5 else pair[::-1]
        ratio = float(random.choice([-1, 1]) * random.uniform(0.3, 3))
        springs = {"stiffness": float(random.uniform(1, 9)), "clearance": random.choice([None, 0.05])}
        match int(random.integers(4)):
            case 0:
                gears.append(Gear(f"rigid{number}", pair, ratio))
            case 1:
                shafts.append(Shaft(f"shaft{number}", pair, **springs, damping=0.2))
            case _:
                gears.append(Gear(f"gear{number}", pair, ratio, **springs, damping=0.1))
    bodies = {name: name for name in names}
    for gear in gears:
        if gear.is_rigid:
            first, second = (bodies[each] for each in gear.between)
            bodies = {name: first if body == second else body for name, body in bodies.items()}
    speeds = Train([Inertia(name, 1.0) for name in names], shafts, gears)._speeds
    for number in range(int(random.integers(1, 6))):
        first, second = random.choice([*names, "ground"], 2, replace=False)
        first, second = (second, first) if first == "ground" else (first, second)
        if second != "ground" and bodies[first] == bodies[second]:
            continue
        slips = abs(speeds[first] - speeds.get(second, 0.0)) > 1e-6
        size = random.uniform(0.05, 0.5, 5).tolist()
        match int(random.integers(6)):
            case 0 if slips:
                drags.append(Drag(f"d{number}", (first, second), linear=size[0], constant=size[1], group="oil"))
            case 1 if slips:
                curve = {"constant": size[1], "breakaway": 2.0 * size[1], "stribeck": 1.0 + size[2]}
                drags.append(Drag(f"d{number}", (first, second), quadratic=size[0], **curve))
            case 2 if slips:
                shafts.append(Shaft(f"d{number}", (first, second), damping=size[0]))
            case 3 if slips and not any({first, second} == {*each.between} for each in gears):
                frictions.append(Friction(f"d{number}", (first, second), size[0]))
            case 4 if slips and second != "ground":
                numbers = dict(zip("abcd", size, strict=False))
                law = "a*w1*w1 - b*w2 + c*s*s*s + d*W"
                forces.append(Force(f"d{number}", (first, second), law, numbers=numbers))
            case _:
                drags.append(Drag(f"d{number}", (first, second), linear=size[0]))
    return Train(
        [Inertia(name, float(random.uniform(0.1, 5))) for name in names],
        shafts,
        gears,
        {names[-1]: 0.7},
        [gw.Harmonic(0.4, {names[0]: 1.0}, order=2, phase=0.3)],
        frequency=1.3,
        reaction=names[1] if random.random() < 0.7 else None,
        reference=str(random.choice(names)),
        drags=drags,
        forces=forces,
        frictions=frictions,
        groups={"oil": 0.7} if any(each.group for each in drags) else {},
    )


@pytest.mark.parametrize("seed", some_of(range(40), *range(0, 40, 3)))
def test_the_equations_are_those_in_absolute_angles(seed: int) -> None:
    train = random_train(seed)
    system = train.system()
    assembly = system.structure.assembly
    numbers, random = assembly.numbers(system.values), np.random.default_rng(seed)
    q, rate = random.normal(0.0, 0.1, system.size), random.normal(0.0, 0.01, system.size)  # no slip turns back
    if assembly.form.has_turn:
        rate[-1] *= 1e-3
    angle, speed = numbers.angles @ q, numbers.angles @ rate  # rigid gears are respected
    has_turn = assembly.form.has_turn
    names = [each.name for each in train.inertias]
    scale = numbers.speeds[names.index(train.reference)]  # the turn is counted by the first inertia
    hold, turn = (numbers.hold, 1e3 * (q[-1] + numbers.steadying / numbers.hold * rate[-1])) if has_turn else (0.0, 0.0)
    hold /= scale
    expected, turning = by_hand(train, angle, speed, 0.9, hold, turn)
    layout, coefficients = layout_of(system.structure), coefficients_of(system)
    found = accelerations(layout, coefficients, 0.9, q, rate)
    inertia = np.array([each.inertia for each in train.inertias])
    for place, name in enumerate(system.coordinates):
        if name == "turn":
            whole = inertia * turning
            assert 1e3 * found[place] * scale == pytest.approx(
                whole @ expected / (whole @ turning), rel=1e-10, abs=1e-12
            )
            continue
        link = next(each for each in train.links if each.name == name)
        first, second = (names.index(each) for each in link.between)
        wanted = expected[first] - getattr(link, "ratio", 1.0) * expected[second]
        assert found[place] == pytest.approx(wanted, rel=1e-10, abs=1e-10)
    equations = System.from_values(system.structure.equations, system.equations.values)
    assert coefficients_of(equations) == pytest.approx(coefficients, rel=1e-9, abs=1e-9)


@keeps("1")
@pytest.mark.parametrize("seed", range(10))
def test_derivatives_by_each_number_and_by_the_speed_are_exact(seed: int) -> None:
    check_slopes(random_train(seed).system())


def test_signals_of_inertias_are_those_of_the_absolute_motion() -> None:
    """Angles and speeds are integrals of accelerations, with the same means as the turn; slips contain their means."""
    system = worked(60.0)
    orbit = rattling(system)
    motion = orbit.motion(8193)
    time = motion.time
    for name in BODIES:
        speed, moved = motion.signal(f"{name}.speed"), motion.signal(f"{name}.acceleration")
        assert np.array_equal(moved, motion.signal(f"{name}''"))
        integral = speed[0] + np.concatenate(([0.0], np.cumsum(0.5 * (moved[1:] + moved[:-1]) * np.diff(time))))
        assert speed == pytest.approx(integral, abs=2e-3)
        assert np.mean(speed[:-1]) == pytest.approx(0.0, abs=1e-6)
    relative = motion.signal("gear.speed") - motion.signal("output.speed")
    assert motion.signal("bearing.speed") == pytest.approx(-40.0 + relative, abs=1e-12)
    assert motion.signal("flywheel.angle") - motion.signal("input.angle") == pytest.approx(motion.signal("clutch"))


def test_a_free_train_without_drags_has_the_rotation_as_a_whole_in_its_signals() -> None:
    """Two inertias with a shaft so soft that they move as if free: the speed of the first is that of its own load."""
    train = Train(
        [Inertia("a", 2.0), Inertia("b", 3.0)],
        [Shaft("s", ("a", "b"), stiffness=1e-8, damping=1e-8)],
        harmonics=[gw.Harmonic(1.5, {"a": 1.0})],
        frequency=4.0,
    )
    motion = gw.find_orbit(train.system()).motion(64)
    assert motion.signal("a.speed") == pytest.approx(1.5 / 2.0 / 4.0 * np.sin(motion.theta), abs=1e-9)
    assert motion.signal("b.speed") == pytest.approx(0.0, abs=1e-9)
    assert motion.signal("a.angle") == pytest.approx(-1.5 / 2.0 / 16.0 * np.cos(motion.theta), abs=1e-8)


def test_a_drag_that_turns_back_is_named() -> None:
    """A torque of order 2 so large that the slip of the gear on its shaft changes its direction."""
    weak = (Drag("bearing", ("gear", "output"), linear=0.01, constant=0.01), *DRAGS[1:])
    assert gw.find_orbit(worked(5.0, drags=weak)).turned_back == ()
    orbit = gw.find_orbit(worked(5.0, drags=weak, harmonics=[gw.Harmonic(2000.0, {"gear": 1.0}, order=2)]))
    assert "bearing" in orbit.turned_back
    assert "bearing turns back, against its torque" in repr(orbit)


def test_a_torque_converter_slips_by_its_formula() -> None:
    """The torque is a w1**2 - b w2**2 of the absolute speeds at each instant, and the first inertia turns at W."""
    numbers = {"a": 0.004, "b": 0.002}
    system = Train(
        [Inertia("engine", 0.2), Inertia("turbine", 0.05), Inertia("vehicle", 3.0)],
        [Shaft("out", ("turbine", "vehicle"), stiffness=300.0, damping=0.8)],
        forces=[Force("converter", ("engine", "turbine"), "a*w1*w1 - b*w2*w2", numbers=numbers)],
        mean={"engine": 30.0},
        reaction="vehicle",
        frequency=W,
        harmonics=[gw.Harmonic(20.0, {"engine": 1.0}, order=2)],
    ).system()
    assert system.coordinates == ("out", "converter_slip", "turn")
    orbit = gw.find_orbit(system)
    motion = orbit.motion(257)
    first, second = (W + motion.signal(f"{name}.speed") for name in ("engine", "turbine"))
    assert motion.signal("converter.torque") == pytest.approx(0.004 * first**2 - 0.002 * second**2, rel=1e-12)
    assert np.mean(first[:-1]) == pytest.approx(W, abs=1e-9)
    assert orbit.measure("mean.converter.torque") == pytest.approx(30.0, rel=1e-9)
    steady = gw.find_orbit(system.at({"harmonic2.amplitude": 0.0})).motion(8)
    assert W + steady.signal("turbine.speed") == pytest.approx(math.sqrt((0.004 * W**2 - 30.0) / 0.002), rel=1e-9)


def test_an_order_tuned_pendulum_has_its_zero_at_all_speeds() -> None:
    """Linear pendulum of length r at the radius R: no response of its carrier at the order sqrt(R / r)."""
    order, size = 2.0, 0.002
    train = Train(
        [Inertia("engine", 0.1), Inertia("pendulum", size), Inertia("vehicle", 5.0)],
        [Shaft("shaft", ("engine", "vehicle"), stiffness=2000.0, damping=1.0)],
        forces=[Force("field", ("pendulum", "engine"), "k*W*W*x", k=size * order**2)],
        frequency=50.0,
        harmonics=[gw.Harmonic(10.0, {"engine": 1.0}, order=2)],
    ).system()
    for pace in (20.0, 50.0, 90.0):
        motion = gw.find_orbit(train.at(frequency=pace)).motion(64)
        assert np.abs(motion.signal("engine''")).max() < 1e-6 * np.abs(motion.signal("pendulum''")).max()


def test_stiffness_over_the_speed_is_that_of_other_numbers() -> None:
    text = """
speed = "SPEED rpm"
inertia = [{ name = "a", inertia = "0.1 kg m^2" }, { name = "b", inertia = "0.3 kg m^2" }]
[[shaft]]
name = "s"
between = ["a", "b"]
stiffness = "STIFF N m/rad"
damping = "0.5 N m s/rad"
FACTOR
[[harmonic]]
order = 2
amplitude = "5 N m"
acts_on = { a = 1.0 }
"""
    pace = 1200.0 * math.pi / 30.0
    factor = 'over_speed = { stiffness = "1 + 1e-4*W**2", damping = "speed/600" }'
    made = text.replace("SPEED", "1200").replace("STIFF", "900").replace("FACTOR", factor)
    plain = text.replace("SPEED", "1200").replace("STIFF", repr(900.0 * (1.0 + 1e-4 * pace**2))).replace("FACTOR", "")
    found, expected = (gw.read_model(io.StringIO(each)) for each in (made, plain.replace("0.5 N m s", "1.0 N m s")))
    assert gw.find_orbit(found).state == pytest.approx(gw.find_orbit(expected).state, rel=1e-11)
    nondimensional = gw.train.nondimensional(found)
    scale = math.degrees(nondimensional.scales.angle)
    assert gw.find_orbit(nondimensional.system).state[0] * scale == pytest.approx(
        gw.find_orbit(found).state[0], rel=1e-9
    )
    slope = ParameterLine(found, "speed").coefficients(1200.0)[1]
    ahead, behind = (ParameterLine(found, "speed").coefficients(1200.0 + step)[0] for step in (1e-3, -1e-3))
    assert slope == pytest.approx((ahead - behind) / 2e-3, rel=1e-6, abs=1e-6)


def test_units_do_not_change_a_motion_with_drags() -> None:
    """The same train with angles in rad and in deg: accelerations in rad/s^2, and the torque of the mesh."""
    text = """
speed = "955 rpm"
reaction = "c"
mean = { a = "20 N m" }
inertia = [
  { name = "a", inertia = "0.15 kg m^2" }, { name = "b", inertia = "0.003 kg m^2" },
  { name = "c", inertia = "2.5 kg m^2" },
]
shaft = [{ name = "ac", between = ["a", "c"], stiffness = "900 N m/rad", damping = "0.6 N m s/rad" }]
[[gear]]
name = "ab"
between = ["a", "b"]
ratio = 2.5
stiffness = "5e3 N m/rad"
clearance = "0.01 rad"
damping = "0.1 N m s/rad"
[[drag]]
name = "oil"
between = ["b", "ground"]
quadratic = "2e-4 N m s^2/rad^2"
linear = "1e-3 N m s/rad"
constant = "0.02 N m"
breakaway = "0.05 N m"
stribeck = "40 rad/s"
[[drag]]
name = "seal"
between = ["b", "c"]
law = "t*tanh(s/a)"
t = "0.1 N m"
a = "10 rad/s"
[[harmonic]]
order = 2
amplitude = "30 N m"
acts_on = { a = 1.0 }
"""
    sizes = []
    for clearance in ("0.01 rad", f"{math.degrees(0.01)!r} deg"):
        motion = gw.find_orbit(gw.read_model(io.StringIO(text.replace("0.01 rad", clearance)))).motion(512)
        names = ("b.acceleration", "ab.torque", "oil.torque", "b.speed", "seal.speed")
        sizes.append([np.abs(motion.signal(name)).max() for name in names])
    assert sizes[0] == pytest.approx(sizes[1], rel=1e-6)


@pytest.mark.parametrize(
    ("drag", "message"),
    [
        ({"between": ("input", "output"), "constant": 0.1}, "leave it out"),
        ({"between": ("gear", "output")}, "has no torque; write linear = ..."),
        ({"between": ("gear", "output"), "breakaway": 0.1}, "write both: the torque at rest"),
        ({"between": ("gear", "output"), "linear": -0.1}, "is -0.1; it must be >= 0"),
        ({"between": ("gear", "output"), "viscous": 0.1}, "which is none of its numbers; they are linear, quadratic"),
        ({"between": ("gear", "output"), "law": "a*s"}, "has no a, which its formula needs"),
        ({"between": ("output", "vehicle"), "constant": 0.1}, "write dry friction: a table [[friction]]"),
    ],
)
def test_a_mistake_of_a_drag_is_told(drag, message: str) -> None:
    gears = [Gear("engaged", ("input", "output"), 1.0), Gear("loose", ("input", "gear"), 2.5, stiffness=5e4)]
    with pytest.raises(ModelError) as told:
        worked(5.0, drags=[Drag("bearing", **drag)], gears=gears)
    assert message in str(told.value), told.value


def test_a_prescribed_flywheel_drags_its_loose_gear() -> None:
    """Neutral rattle: the mean torque of the mesh is that of the drag at the speed of the gear, behind the ratio."""
    system = Train(
        [Inertia("flywheel"), Inertia("gear", 0.003)],
        gears=[Gear("mesh", ("flywheel", "gear"), 2.5, stiffness=5e4, clearance=0.001, impact_damping=1.0)],
        drags=[Drag("oil", ("gear", "ground"), linear=0.018, quadratic=1e-4)],
        frequency=W,
        harmonics=[gw.Harmonic(1e-4, varies="flywheel.angle", order=2, name="firing")],
    ).system()
    assert system.coordinates == ("mesh",)
    orbit = gw.find_orbit(system)
    slip = orbit.motion(1024).signal("oil.speed")[:-1]
    assert np.mean(slip) == pytest.approx(W / 2.5, rel=1e-9)
    torque = np.mean(0.018 * slip + 1e-4 * slip**2)
    assert orbit.measure("mean.mesh.torque") * 2.5 == pytest.approx(torque, rel=1e-6)


@pytest.mark.parametrize("seed", some_of(range(20), *range(0, 20, 3)))
def test_parts_that_slip_on_each_other_turn_as_in_absolute_angles(seed: int) -> None:
    """Where a damper or a formula alone joins two parts: the absolute acceleration of every inertia."""
    random, whole = np.random.default_rng(seed), random_train(seed)
    names = [each.name for each in whole.inertias]
    joint = {"between": (names[1], "tail")}
    law = "a*w1*w1 - b*w2 + c*s*s*s + d*W"
    numbers = dict(zip("abcd", random.uniform(0.05, 0.5, 4).tolist(), strict=True))
    by_damper = random.random() < 0.4
    train = Train(
        [*whole.inertias, Inertia("tail", 0.7), Inertia("end", 1.9)],
        [*whole.shafts, Shaft("rear", ("tail", "end"), stiffness=2.0, damping=0.1)]
        + ([Shaft("joint", **joint, damping=0.4)] if by_damper else []),
        whole.gears,
        whole.mean,
        whole.harmonics,
        frequency=1.3,
        reaction=whole.reaction,
        reference=whole.reference,
        drags=[*whole.drags, Drag("oil_of_tail", ("end", "ground"), linear=0.2)],
        forces=[*whole.forces, *([] if by_damper else [Force("joint", **joint, law=law, numbers=numbers)])],
        groups=whole.groups,
    )
    system = train.system()
    assert system.coordinates[-1] == "turn"
    assert "joint_slip" in system.coordinates
    assembly = system.structure.assembly
    of = assembly.numbers(system.values)
    q, rate = random.normal(0.0, 0.1, system.size), random.normal(0.0, 0.01, system.size)
    rate[-1] *= 1e-3
    rates = rate + of.leaks * q
    own = [each.name for each in train.inertias]
    scale = of.speeds[own.index(train.reference)]
    turn = 1e3 * (q[-1] + of.steadying / of.hold * rate[-1])
    expected, _ = by_hand(train, of.angles @ q, of.angles @ rates, 0.9, of.hold / scale, turn, of.speeds / scale)
    found = accelerations(layout_of(system.structure), coefficients_of(system), 0.9, q, rate)
    moved = of.angles @ (found + of.leaks * rate)
    assert moved == pytest.approx(expected, rel=1e-10, abs=1e-10)


@pytest.mark.parametrize(
    ("key", "hint"), [("lineer = 0.1", "did you mean linear?"), ("by = 2.0", "its keys are linear, quadratic")]
)
def test_a_key_that_a_drag_does_not_have_is_told_in_a_file(key: str, hint: str) -> None:
    text = machine_text("neutral-rattle").replace('quadratic = "2e-4 N m s^2/rad^2"', key)
    with pytest.raises(ModelError) as told:
        gw.read_study(io.StringIO(text))
    assert f'drag "churning" has no key {key.split(maxsplit=1)[0]}; write its torque as in linear = ' in str(told.value)
    assert hint in str(told.value)

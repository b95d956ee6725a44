"""Drags that alone join two groups of inertias, as fluid couplings do: the angle is removed, its rate is not."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import gapwalk as gw
from gapwalk.errors import ModelError
from tests.results.again import again

ENGINE, DRIVEN, DRAG, TORQUE, SIZE, PHASE, W = 0.3, 0.07, 0.05, 2.0, 5.0, 0.3, 3.0
ALONE = ENGINE * DRIVEN / (ENGINE + DRIVEN)


def coupled(**more) -> gw.train.Train:
    """Two inertias that a drag alone joins."""
    inertias = [gw.train.Inertia("engine", ENGINE), gw.train.Inertia("driven", DRIVEN)]
    load = gw.Harmonic(SIZE, {"engine": 1.0}, phase=PHASE)
    oil = gw.train.Shaft("oil", ("engine", "driven"), damping=DRAG)
    return gw.train.Train(
        inertias, [oil], mean={"engine": TORQUE}, harmonics=[load], frequency=W, reaction="driven", **more
    )


FLY, PUMP, TURBINE, LOAD = 1.0, 0.2, 0.3, 2.0
MEAN, FIRING, PACE = 0.5, 1.5, 2.0


def converter() -> gw.train.Train:
    """A staged clutch before a fluid coupling, gears that rattle behind it, and a second drag across."""
    return gw.train.Train(
        [
            gw.train.Inertia("fly", FLY),
            gw.train.Inertia("pump", PUMP),
            gw.train.Inertia("turbine", TURBINE),
            gw.train.Inertia("load", LOAD),
        ],
        [
            gw.train.Shaft("clutch", ("fly", "pump"), stiffness=1.0, damping=0.05, stages=(gw.Stage(0.4, 6.0),)),
            gw.train.Shaft("oil", ("pump", "turbine"), damping=0.4),
            gw.train.Shaft("seal", ("fly", "load"), damping=0.02),
        ],
        [gw.train.Gear("mesh", ("turbine", "load"), 1.0, clearance=0.05, stiffness=20.0, impact_damping=0.1)],
        mean={"fly": MEAN},
        reaction="load",
        harmonics=[gw.Harmonic(FIRING, {"fly": 1.0}, phase=PHASE)],
        frequency=PACE,
    )


def converter_by_hand(t: float, z: np.ndarray) -> np.ndarray:
    """The same, body by body: rates of four angles and four speeds."""
    q, v = z[:4], z[4:]
    torque = np.array([MEAN + FIRING * np.cos(PACE * t + PHASE), 0.0, 0.0, -MEAN])

    def pull(first: int, second: int, law: Callable[[float, float], float]) -> None:
        force = law(q[first] - q[second], v[first] - v[second])
        torque[first] -= force
        torque[second] += force

    def beyond(x: float, gap: float) -> float:
        return float(np.sign(x)) * max(abs(x) - gap, 0.0)

    pull(0, 1, lambda x, rate: x + 0.05 * rate + 6.0 * beyond(x, 0.4))
    pull(1, 2, lambda x, rate: 0.4 * rate)
    pull(0, 3, lambda x, rate: 0.02 * rate)
    pull(2, 3, lambda x, rate: 20.0 * (beyond(x, 0.05) + 0.1 * abs(beyond(x, 0.05)) * rate))
    return np.concatenate((v, torque / np.array([FLY, PUMP, TURBINE, LOAD])))


def after_a_period(state: np.ndarray) -> np.ndarray:
    """Angles and speeds a period later, by DOP853."""
    period = 2.0 * np.pi / PACE
    found = solve_ivp(
        converter_by_hand, (0, period), state, method="DOP853", rtol=1e-12, atol=1e-13, max_step=period / 500
    )
    return found.y[:, -1]


def without_the_free_angles(z: np.ndarray) -> np.ndarray:
    """What the motion depends on: clutch, mesh, their rates, and the rate of the slip."""
    return np.array([z[0] - z[1], z[2] - z[3], z[4] - z[5], z[6] - z[7], z[5] - z[6]])


def angles_of(orbit: gw.Orbit) -> np.ndarray:
    """Angles and speeds of the four bodies at the start of an orbit: where they are as a whole does not matter."""
    motion = orbit.motion(64)
    clutch, mesh = motion.signal("clutch")[0], motion.signal("mesh")[0]
    clutch_rate, mesh_rate = motion.signal("clutch'")[0], motion.signal("mesh'")[0]
    slip = motion.signal("oil.torque")[0] / orbit.system["oil.damping"]
    return np.array([clutch, 0.0, mesh, 0.0, clutch_rate, 0.0, -slip, -slip - mesh_rate])


def test_two_inertias_and_a_drag_slip_as_the_closed_form_has_it() -> None:
    orbit = gw.find_orbit(coupled().system())
    motion = orbit.motion(64)
    turning = SIZE * np.exp(1j * PHASE) * DRIVEN / (ENGINE + DRIVEN) / (1j * W * ALONE + DRAG)
    slip = TORQUE / DRAG + np.real(turning * np.exp(1j * W * motion.time))
    assert motion.signal("oil.torque") == pytest.approx(DRAG * slip, abs=1e-12)
    assert motion.signal("driven''") == pytest.approx((DRAG * slip - TORQUE) / DRIVEN, abs=1e-11)
    torque = TORQUE + SIZE * np.cos(W * motion.time + PHASE)
    assert motion.signal("engine''") == pytest.approx((torque - DRAG * slip) / ENGINE, abs=1e-11)
    decay = np.exp(-DRAG / ALONE * 2.0 * np.pi / W)
    assert np.sort(orbit.multipliers.real) == pytest.approx([decay**2, decay], rel=1e-10)  # the first is the leak's


def test_a_transient_slip_dies_away_as_the_closed_form_has_it_whatever_the_state_says_of_the_angle() -> None:
    system = coupled().system().at({"harmonic1.amplitude": 0.0, "mean.engine": 0.0})
    motion = gw.integrate(system, np.array([0.7, 0.2]), 2.0)
    slip = motion.signal("oil.torque") / DRAG
    assert slip == pytest.approx(slip[0] * np.exp(-DRAG / ALONE * motion.time), rel=1e-9)


def test_an_orbit_with_contacts_on_both_sides_of_the_coupling_is_that_of_the_angles() -> None:
    orbit = gw.find_orbit(converter().system())
    first = angles_of(orbit)
    last = after_a_period(first)
    assert without_the_free_angles(last) == pytest.approx(without_the_free_angles(first), abs=1e-9)
    slipped = (last[1] - last[2]) - (first[1] - first[2])
    assert slipped * PACE / (2.0 * np.pi) == pytest.approx(MEAN / (0.4 + 0.02), rel=1e-9)  # both drags take the mean

    def changed(place: int, step: float) -> np.ndarray:
        """The map of a period, with one of the five moved: at fixed angle and speed of the load."""
        move = np.zeros(8)
        move[[(0,), (0, 1, 2), (4,), (4, 5, 6), (4, 5)][place],] = step
        return without_the_free_angles(after_a_period(first + move))

    step = 1e-4  # the error of DOP853 at the corners of the force is 1e-9, and differences divide it by the step
    slopes = np.transpose([(changed(place, step) - changed(place, -step)) / (2.0 * step) for place in range(5)])
    expected = np.linalg.eigvals(slopes)
    rate = orbit.system.structure.assembly.numbers(orbit.system.values).leaks[1]
    leak = np.abs(orbit.multipliers - np.exp(-rate * 2.0 * np.pi / PACE)).argmin()
    assert orbit.multipliers[leak] == pytest.approx(np.exp(-rate * 2.0 * np.pi / PACE), abs=1e-9)
    left = np.delete(orbit.multipliers, leak)
    assert max(np.abs(left - value).min() for value in expected) < 1e-6


@pytest.mark.slow
def test_a_walk_along_the_drag_of_a_coupling_is_verified() -> None:
    branch = gw.follow(gw.find_orbit(coupled().system()), "oil.damping", 0.2)
    assert gw.verify(branch)
    for point in branch.points[:: len(branch.points) // 5]:
        mean = point.orbit.measure("mean.oil.torque")
        assert mean == pytest.approx(TORQUE, rel=1e-9)


def test_a_coupled_train_rests_slipping_and_vibrates_as_its_two_sides_do() -> None:
    system = converter().system()
    (rest,) = gw.find_equilibria(system).equilibria
    leaks = system.structure.assembly.numbers(system.values).leaks
    assert leaks[1] * rest.position[1] == pytest.approx(MEAN / (0.4 + 0.02), rel=1e-12)
    assert rest.stable
    assert not rest.loose
    sides = [0.0, np.sqrt(7.0 * (1 / FLY + 1 / PUMP)), np.sqrt(20.0 * (1 / TURBINE + 1 / LOAD))]
    assert gw.find_modes(system).frequencies == pytest.approx(sorted(sides), rel=1e-9, abs=1e-6)


def test_a_rotor_that_a_drag_alone_joins_to_the_ground_takes_its_mean_torque() -> None:
    train = gw.train.Train(
        [gw.train.Inertia("disc", 0.4), gw.train.Inertia("rotor", 0.1)],
        [
            gw.train.Shaft("wall", ("disc", "ground"), stiffness=2.0, damping=0.1),
            gw.train.Shaft("bearing", ("disc", "rotor"), damping=0.3),
            gw.train.Shaft("air", ("rotor", "ground"), damping=0.05),
        ],
        mean={"rotor": 0.7},
        harmonics=[gw.Harmonic(1.0, {"disc": 1.0})],
        frequency=2.0,
    )
    motion = gw.find_orbit(train.system()).motion(64)
    # disc x and rotor speed s: .4 x'' + .1 x' + 2 x + .3 (x' - s) = cos 2t, .1 s' + .05 s + .3 (s - x') = .7
    matrix = np.array([[2.0 - 0.4 * 4.0 + 0.4 * 2j, -0.3], [-0.3 * 2j, 0.1 * 2j + 0.35]])
    disc, rotor = np.linalg.solve(matrix, [1.0, 0.0])
    turn = np.exp(2j * motion.time)
    assert motion.signal("wall") == pytest.approx(np.real(disc * turn) + 0.3 * 2.0 / 2.0, abs=1e-10)
    assert motion.signal("air.torque") == pytest.approx(0.05 * (2.0 + np.real(rotor * turn)), abs=1e-10)


def test_a_coupled_train_is_stored_and_given_other_numbers() -> None:
    system = converter().system()
    assert system.coordinates == ("clutch", "oil_slip", "mesh")
    assert again(system).coordinates == system.coordinates
    with pytest.raises(ModelError, match=r"oil\.damping is 0; it must be > 0, for nothing else joins its two"):
        system.at({"oil.damping": 0.0})


def test_units_leave_a_slip_as_it_is() -> None:
    base: Any = gw  # quantities with units are texts
    parts: Any = gw.train
    train = parts.Train(
        [parts.Inertia("engine", f"{ENGINE} kg m^2"), parts.Inertia("driven", f"{DRIVEN} kg m^2")],
        [parts.Shaft("oil", ("engine", "driven"), damping=f"{DRAG * np.pi / 180.0} N m s/deg")],
        mean={"engine": f"{TORQUE} N m"},
        reaction="driven",
        harmonics=[base.Harmonic(f"{SIZE} N m", {"engine": 1.0}, phase="0.3 rad")],
        frequency=f"{W} rad/s",
    )
    torque = gw.find_orbit(train.system()).motion(64).signal("oil.torque")
    assert torque == pytest.approx(gw.find_orbit(coupled().system()).motion(64).signal("oil.torque"), rel=1e-9)
    other = gw.train.nondimensional(train.system())
    assert np.sort(gw.find_orbit(other.system).multipliers.real) == pytest.approx(
        np.sort(gw.find_orbit(coupled().system()).multipliers.real), rel=1e-6
    )

"""The batch integrator against closed forms, the exact flow, and SciPy."""

import math
import os
import signal
import threading

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy.linalg import expm

from gapwalk import find_orbit, integrate, paper
from gapwalk.ensemble import BatchOptions, batch_flow_of
from gapwalk.ensemble import force_source as chunks
from gapwalk.ensemble import kernel_source as kernel
from gapwalk.errors import FlowError, ModelError
from gapwalk.flow.flow import PERIOD, flow_of
from gapwalk.model import Contact, Harmonic, Stage, System
from gapwalk.model.coefficients import coefficients_of
from tests.independent import integrate as reference
from tests.systems import backlash_oscillator, clutch, linear, random_systems, viscous_stop
from tests.tiers import keeps


def draw(system, count=40, size=1.0, seed=0):
    return np.random.default_rng(seed).normal(size=(count, 2 * system.size)) * size


def exact(system, states, periods=1):
    flow, coefficients = flow_of(system), coefficients_of(system)
    return np.array([flow.integrate(coefficients, state, 0.0, periods * PERIOD).state for state in states])


def rms(difference):
    return float(np.sqrt(np.mean(difference**2)))


def chain(masses=5):
    """Masses in a row with one gap between the last of them and a wall, so that modal coordinates pay."""
    stiffness = 2.0 * np.eye(masses) - np.eye(masses, k=1) - np.eye(masses, k=-1)
    names = tuple(f"q{i}" for i in range(masses))
    stop = Contact("stop", {names[-1]: 1.0}, (Stage(0.2, 2.0),), None, "hunt-crossley", {"impact_damping": 0.1})
    return System(
        names, stiffness, 0.03 * stiffness, contacts=[stop], harmonics=[Harmonic(0.4, {"q0": 1.0})], frequency=0.7
    )


@keeps("8")
@pytest.mark.parametrize("steps", [8, 40])
def test_linear_motion_is_exact_whatever_the_steps(steps):
    system, states = linear(), draw(linear())
    n, inverse = system.size, np.linalg.inv(system.matrix("mass"))
    a = np.block(
        [[np.zeros((n, n)), np.eye(n)], [-inverse @ system.matrix("stiffness"), -inverse @ system.matrix("damping")]]
    )
    end = batch_flow_of(system, BatchOptions(steps=steps)).run(states, 3).states
    homogeneous = (end - end[0]) - (states - states[0]) @ expm(a * 3 * 2 * math.pi / system.frequency).T
    assert np.abs(homogeneous).max() < 1e-12
    assert end[0] == pytest.approx(reference(system, states[0], 3), abs=1e-8)


def test_free_backlash_oscillator_repeats_after_its_closed_form_period():
    gap, amplitudes = 0.5, np.array([0.9, 1.0, 2.0, 3.0])
    periods = 2 * math.pi + 4 * gap / (amplitudes - gap)  # half circles in contact, and two flights over the gap
    states = np.column_stack((amplitudes, np.zeros(4)))
    run = batch_flow_of(backlash_oscillator(1.0, gap), BatchOptions(error=1e-7)).run(
        states, 1, parameters={"frequency": 2 * math.pi / periods}
    )
    assert run.states == pytest.approx(states, abs=2e-6)
    assert run.error < 1e-7


def test_the_error_falls_with_the_third_power_of_the_step():
    system = paper.case("15").at(frequency=0.45)
    states = exact(system, draw(system, 150, 2.0))
    expected = exact(system, states)
    errors = [
        rms(batch_flow_of(system, BatchOptions(steps=steps)).run(states, 1).states - expected)
        for steps in (100, 200, 400, 800)
    ]
    assert errors[0] < 1e-3
    assert errors[0] / errors[-1] > 0.5 * 8**3  # a kink that is not seen to would leave 8**2, a wrong weight 8


def test_a_force_that_jumps_leaves_the_second_power():
    system, steps = viscous_stop(), (100, 800)
    states = draw(system, 200)
    expected = exact(system, states)
    coarse, fine = (
        rms(batch_flow_of(system, BatchOptions(steps=count)).run(states, 1).states - expected) for count in steps
    )
    assert coarse / fine > 0.5 * 8**2


@settings(max_examples=4, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(system=random_systems(), seed=st.integers(0, 1000))
def test_random_systems_keep_the_error_that_was_asked_for(system, seed):
    states = draw(system, 500, seed=seed)
    run = batch_flow_of(system).run(states, 1)
    expected = exact(system, states)
    scale = np.maximum(np.abs(expected), np.abs(states)).max(axis=0)  # by what was sampled less often than the run did
    assert run.error <= 1e-4
    error = (np.abs(run.states - expected) / scale).max(axis=1)
    assert np.quantile(error, 0.9) < 3e-4  # a single motion that grazes decides the rms of a sample
    assert not run.ran_away.any()


def test_one_period_agrees_with_scipy():
    system, states = clutch(), draw(clutch(), 2, 2.0)
    run = batch_flow_of(system, BatchOptions(error=1e-7)).run(states, 1)
    expected = [reference(system, state, max_step=0.005) for state in states]
    assert run.states == pytest.approx(np.array(expected), abs=5e-6)


def test_modal_coordinates_change_nothing():
    system, states = chain(), draw(chain(), 60, 0.5)
    run = batch_flow_of(system, BatchOptions(error=1e-6)).run(states, 2)
    assert run.states == pytest.approx(exact(system, states, 2), abs=1e-4)
    assert rms(run.states - exact(system, states, 2)) < 1e-5


@pytest.mark.slow
def test_cutting_the_code_into_many_loops_changes_nothing(monkeypatch):
    system, states = paper.case("25").at(frequency=0.5), draw(paper.case("25"), 70, 2.0)
    flow = batch_flow_of(system, BatchOptions(steps=100))
    whole = flow.run(states, 5, survey=3)
    kernel._compile.cache_clear()
    monkeypatch.setattr(chunks, "_FULL", 1)
    parts = flow.run(states, 5, survey=3)
    own = flow.run(states, 5, survey=3, parameters={"harmonic2.phase": np.array([0.0] * 69 + [1e-12])})
    kernel._compile.cache_clear()
    assert len(chunks.chunks_of([["y0 = c0 * z0"], ["y1 = c1 * z1"]])) == 2
    for run in (parts, own):
        assert run.states == pytest.approx(whole.states, abs=1e-9)
        assert run.survey.low == pytest.approx(whole.survey.low, abs=1e-9)
        assert run.survey.peak_force == pytest.approx(whole.survey.peak_force, abs=1e-9)
        assert run.survey.impacts.tolist() == whole.survey.impacts.tolist()


def test_two_sides_without_a_gap_between_them():
    system, states = clutch().at({"stage2.clearance": 0.0}), draw(clutch(), 60, 2.0)
    run = batch_flow_of(system, BatchOptions(error=1e-6)).run(states, 1)
    assert rms(run.states - exact(system, states)) < 1e-5


def test_parameters_that_differ_from_trajectory_to_trajectory():
    system, states = paper.case("25"), draw(paper.case("25"), 70, 2.0)
    random = np.random.default_rng(3)
    parameters = {
        "frequency": random.uniform(0.3, 1.5, 70),
        "harmonic2.amplitude": np.where(random.uniform(size=70) < 0.3, 0.0, 0.2),
        "stage2.clearance": random.choice([0.5, 1.0], 70),
    }
    options = BatchOptions(steps=200)
    together = batch_flow_of(system, options).run(states, 4, parameters=parameters).states
    for lane in (0, 13, 64, 69):
        one = system.at({name: float(values[lane]) for name, values in parameters.items()})
        alone = batch_flow_of(one, options).run(states[[lane]], 4).states[0]
        assert together[lane] == pytest.approx(alone, abs=1e-9)


def test_the_result_depends_neither_on_threads_nor_on_the_other_trajectories():
    system = paper.case("15").at(frequency=0.25)
    states = draw(system, 300, 2.0)
    one, two = (batch_flow_of(system, BatchOptions(steps=120, threads=count)).run(states, 50) for count in (1, 2))
    assert one.states.tobytes() == two.states.tobytes()
    few = batch_flow_of(system, BatchOptions(steps=120)).run(states[100:107], 50)
    assert few.states.tobytes() == one.states[100:107].tobytes()


@pytest.mark.parametrize(("count", "threads", "started"), [(300, 1, 0), (40, 2, 0), (300, 2, 2)])
def test_threads_start_only_where_several_work(monkeypatch, count, threads, started):
    """Two processes that start a thread for each call disturb each other: they took as long as one and a half."""
    begun, start = [], threading.Thread.start
    monkeypatch.setattr(threading.Thread, "start", lambda thread: (begun.append(thread), start(thread)))
    options = BatchOptions(steps=120, threads=threads)
    batch_flow_of(clutch(), options).run(draw(clutch(), count), 1)
    assert len(begun) == started


def test_a_long_run_in_this_thread_is_that_of_several_threads():
    system, periods = clutch(), 600  # more than are done between two looks for Ctrl-C
    states = draw(system, 70)
    flows = [batch_flow_of(system, BatchOptions(steps=120, threads=threads)) for threads in (1, 2)]
    one, two = (flow.run(states, periods, every=7, survey=450) for flow in flows)
    assert one.strobes.tobytes() == two.strobes.tobytes()
    assert one.survey.low.tobytes() == two.survey.low.tobytes()
    assert one.survey.impacts.tobytes() == two.survey.impacts.tobytes()


def test_strobes_are_the_states_every_so_many_periods():
    system = clutch()
    states = draw(system, 10)
    flow = batch_flow_of(system, BatchOptions(steps=160))
    strobes = flow.run(states, 7, every=2).strobes
    assert strobes.shape == (3, 10, 4)
    for row, periods in enumerate((2, 4, 6)):
        assert strobes[row].tobytes() == flow.run(states, periods).states.tobytes()
    assert flow.run(states, 7).strobes is None


def test_motions_that_run_away_are_told_and_leave_the_others_alone():
    # a cubic spring that pulls outwards beyond the gap; nearer motions stay
    spring = Contact("c", {"x": 1.0}, (Stage(0.5, 0.0, -1.0),))
    system = System(("x",), [[1.0]], [[0.1]], contacts=[spring], frequency=1.0)
    states = np.array([[0.3, 0.0], [9.0, 0.0], [0.2, 0.1], [-5.0, -1.0]])
    run = batch_flow_of(system).run(states, 3, every=1, survey=1)
    assert run.ran_away.tolist() == [False, True, False, True]
    assert np.isnan(run.states).all(axis=1).tolist() == run.ran_away.tolist()
    assert np.isnan(run.strobes[:, 1]).all()
    assert np.isnan(run.survey.high[1]).all()
    assert np.isnan(run.survey.impacts[1]).all()
    assert run.states[[0, 2]] == pytest.approx(exact(system, states[[0, 2]], 3), abs=1e-9)
    with pytest.raises(FlowError):
        exact(system, states[[1]], 3)


def test_too_few_steps_are_not_taken_for_a_motion_that_runs_away():
    system = viscous_stop().at({"stop.stiffness": 4e4})
    few = batch_flow_of(system, BatchOptions(steps=40)).run(draw(system), 4)
    assert few.ran_away.any()  # unstable numerically
    assert math.isinf(few.error)
    run = batch_flow_of(system, BatchOptions(error=1e-3)).run(draw(system), 4)
    assert not run.ran_away.any()
    assert run.error <= 1e-3
    assert run.steps > 400


def test_a_system_too_stiff_is_refused():
    system = viscous_stop().at({"stop.stiffness": 8e9})
    with pytest.raises(FlowError, match="the system is too stiff for it"):
        batch_flow_of(system, BatchOptions(error=1e-6)).run(draw(system), 2)


def test_a_survey_is_what_the_exact_motions_do():
    system = paper.case("15").at(frequency=0.45)
    states = exact(system, draw(system, 12, 2.0), 3)
    survey = batch_flow_of(system, BatchOptions(error=1e-7)).run(states, 5, survey=2).survey
    for lane, state in enumerate(exact(system, states, 3)):
        motion = integrate(system, state, 2, samples=4000)
        assert survey.low[lane] == pytest.approx(motion.q.min(axis=0), abs=1e-4)
        assert survey.high[lane] == pytest.approx(motion.q.max(axis=0), abs=1e-4)
        assert survey.peak_force[lane] == pytest.approx(np.abs(motion.forces).max(axis=0), abs=1e-4)
        closing = [record.side for record in motion.contacts if record.closes]
        assert (2 * survey.impacts[lane, 0]).tolist() == [closing.count(1), closing.count(-1)]


@pytest.mark.slow
def test_basins_of_figure_15():
    # 32 x 32 points of the square from -4 to 4, its edges among them; the exact flow gives the same for every one
    grid = np.linspace(-4.0, 4.0, 32)
    states = np.zeros((1024, 4))
    states[:, 0], states[:, 2] = (each.ravel() for each in np.meshgrid(grid, grid))
    run = batch_flow_of(paper.case("15").at(frequency=0.45), BatchOptions(error=1e-5)).run(states, 1500, every=1)
    last = run.strobes[-4:]
    back = [np.abs(last[-1] - last[-1 - period]).max(axis=1) < 1e-6 for period in (1, 3)]
    assert np.count_nonzero(back[0]) == 123
    assert np.count_nonzero(back[1] & ~back[0]) == 901


@pytest.mark.parametrize("threads", [1, 2])
def test_ctrl_c_ends_a_run_at_once(threads):
    flow = batch_flow_of(clutch(), BatchOptions(steps=100, threads=threads))
    flow.run(draw(clutch()), 1)
    threading.Timer(0.5, os.kill, (os.getpid(), signal.SIGINT)).start()
    with pytest.raises(KeyboardInterrupt):
        flow.run(draw(clutch(), 640), 2_000_000)  # all of it would take hours


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda f: f.run(np.zeros((3, 3)), 1), r"a row for each trajectory with 4 of them \(q1, q3, q1', q3'\)"),
        (lambda f: f.run(np.zeros(4), 1), "must be an array of finite numbers"),
        (lambda f: f.run([[np.nan] * 4], 1), "finite numbers"),
        (lambda f: f.run(np.zeros((2, 4)), 0), "periods is 0; it must be an integer >= 1"),
        (lambda f: f.run(np.zeros((2, 4)), 2, survey=3), "survey is 3, but the run lasts 2"),
        (lambda f: f.run(np.zeros((2, 4)), 2, parameters={"frequenzy": 1.0}), "did you mean 'frequency'"),
        (lambda f: f.run(np.zeros((2, 4)), 2, parameters={"frequency": [1.0]}), r"has shape \(1,\)"),
        (lambda f: f.run(np.zeros((2, 4)), 2, parameters={"frequency": [1.0, -1.0]}), "frequency is -1.0"),
    ],
)
def test_requests_that_make_no_sense(call, message):
    with pytest.raises(ModelError, match=message):
        call(batch_flow_of(clutch()))


def test_settled_trajectories_lie_on_the_exact_orbit():
    system = clutch().at(frequency=1.5)
    end = batch_flow_of(system, BatchOptions(error=1e-6)).run(draw(system, 3), 400).states
    orbit = find_orbit(system, start=end[0])
    assert end == pytest.approx(np.tile(orbit.state, (3, 1)), abs=1e-5)

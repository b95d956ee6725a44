"""Steps past resonances, and Newton's method of tori against that of dense matrices."""

import math

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.continuation.corrector import Corrector, check_range
from gapwalk.tori.torus import TURN, at_phases, in_steps
from gapwalk.tori.torus_start import CurveEquation, corrector_of
from gapwalk.tori.torus_tracer import nearness_to_fractions
from tests.tori.closed_forms import one_circle


def test_the_golden_mean_is_farther_from_fractions_than_its_neighbours():
    golden = (math.sqrt(5.0) - 1.0) / 2.0
    turns = np.array([golden, golden - 2e-4, 34.0 / 55.0 + 1e-7, 0.5 + 1e-5])
    nearness = nearness_to_fractions(turns)
    assert nearness.argmin() == 0
    assert nearness[2] > 10.0 * nearness[0]
    assert nearness[3] > nearness[2]


def test_states_at_equal_steps_are_those_at_their_phases():
    states = np.random.default_rng(1).standard_normal((33, 4))
    found = in_steps(states, TURN * 0.237, 5, 50)
    assert found == pytest.approx(at_phases(states, TURN * 0.237 * np.arange(5.0, 55.0, dtype=np.float64)), abs=1e-12)


def test_newtons_method_is_that_of_dense_matrices():
    """The corrector factorises one matrix; the one of all branches factorises one in each pass."""
    system = one_circle(math.sqrt(8.7))
    torus = gw.tori.find_torus(gw.settle(system, [1.5, 0.2, 0.1, 0.0]))
    equation = CurveEquation(torus.system, "frequency", 1, torus.states)
    within = check_range(system.frequency, (2.9, 3.0)).along("frequency", system)
    corrector = corrector_of(equation, torus.states, 0.0, within)
    x = np.append(torus.states.ravel(), (torus.rotation, system.frequency)) / corrector.scales
    guess, normal = x.copy(), np.zeros(len(x))
    guess[:-2] *= 1.01
    guess[-1] += 0.05
    normal[-1] = 1.0
    dense = Corrector(corrector.equation, corrector.scales).correct(guess, normal)
    ours = corrector.correct(guess, normal)
    assert dense is not None
    assert ours is not None
    assert ours.x == pytest.approx(dense.x, abs=1e-11)
    assert ours.course is not None
    assert dense.course is not None
    assert ours.course.tangent == pytest.approx(dense.course.tangent, abs=1e-7)
    turns = ours.x[-2] * corrector.scales[-2]
    assert min(turns, 1.0 - turns) == pytest.approx(1.0 / (ours.x[-1] * corrector.scales[-1]), abs=1e-10)

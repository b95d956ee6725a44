"""A walk of doubled motions does not take motions of shorter periods for its own."""

from __future__ import annotations

import importlib

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import gapwalk as gw
from gapwalk.bifurcation.branch import Branch
from gapwalk.bifurcation.follow import BranchTracer
from gapwalk.continuation.walk import EndReason
from gapwalk.model.contact import Contact, Side, Stage
from gapwalk.verification.verification import Check
from tests.computed import once

FOLLOW = importlib.import_module("gapwalk.bifurcation.follow")  # the package has a function of that name

LOAD, DAMPING, STIFFNESS = 0.527, 0.1, 100.0
RANGE = (0.68, 0.705)


def stopped(frequency: float) -> gw.System:
    """An oscillator with one stiff stop, whose doubled motions begin within 1e-4 of a graze."""
    stop = Contact("stop", {"x": 1.0}, [Stage(1.0, STIFFNESS, side=Side.POSITIVE)])
    load = gw.Harmonic(LOAD, {"x": 1.0})
    return gw.System(["x"], [[1.0]], [[DAMPING]], contacts=[stop], harmonics=[load], frequency=frequency)


@once
def parents() -> tuple[Branch, Branch]:
    """Walk the branches of period 1 and of period 2."""
    first = gw.follow(gw.find_orbit(stopped(0.68)), "frequency", RANGE[1])
    return first, gw.follow(first.special("flip")[0], "frequency", RANGE)


def settled(frequency: float, state: np.ndarray, periods: int) -> np.ndarray:
    """Return the states after each of some periods, by SciPy; the stop closes by an event."""

    def rates(t: float, y: np.ndarray) -> list[float]:
        force = STIFFNESS * max(y[0] - 1.0, 0.0)
        return [y[1], LOAD * np.cos(frequency * t) - DAMPING * y[1] - y[0] - force]

    ends = 2.0 * np.pi / frequency * np.arange(periods + 1)
    return solve_ivp(rates, (0.0, ends[-1]), state, "DOP853", t_eval=ends, rtol=1e-12, atol=1e-13, max_step=0.02).y.T


@pytest.mark.slow
def test_a_doubled_branch_that_begins_beside_a_graze_is_walked_to_its_other_end() -> None:
    flips = parents()[1].special("flip")
    branch = gw.follow(flips[0], "frequency", RANGE)
    assert branch.period == 4
    assert branch.ends[-1].reason is EndReason.JOINED
    assert branch.points[-1].value == pytest.approx(flips[1].value, abs=1e-9)
    middle = branch.points[len(branch.points) // 2]
    states = settled(middle.value, middle.orbit.state, 4)
    assert states[4] == pytest.approx(states[0], abs=1e-6)
    assert np.abs(states[2] - states[0]).max() > 1e-3


def test_verification_notices_motions_of_a_shorter_period(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(FOLLOW, "has_merged", lambda point: False)
    monkeypatch.setattr(BranchTracer, "_until_parent", lambda self, first, step: step)
    flips = parents()[1].special("flip")
    branch = gw.follow(flips[0], "frequency", RANGE)
    monkeypatch.undo()
    stray = branch.points[1]
    states = settled(stray.value, stray.orbit.state, 2)
    assert states[2] == pytest.approx(states[0], abs=1e-6)
    breaches = gw.verify(branch).breaches
    shorter = [each.spot.item for each in breaches if each.check is Check.ORDER and "repeats" in each.detail]
    assert shorter[0] == "point 1"

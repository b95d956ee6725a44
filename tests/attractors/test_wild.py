"""Wild systems and states: each ends with a result or with an error of its own, soon, and never with a silent NaN."""

from __future__ import annotations

import numpy as np
import pytest

from gapwalk.attractors import SettleOptions, settle
from gapwalk.errors import NumericalError
from gapwalk.flow.motion import integrate
from gapwalk.model import Contact, Harmonic, Side, Stage, System
from gapwalk.model.laws import LAWS

PERIODS = 40  # longest transient: what is asked here is whether it ends, not where it leads
STIFFEST = 6.0  # decades by which a stage is stiffer than the first one


def wild_system(random: np.random.Generator) -> System:
    """Any of many: gaps of no width, stages up to 1e6 times as stiff as the first, light and heavy damping."""
    n = int(random.integers(1, 3))
    names = tuple(f"q{i + 1}" for i in range(n))
    basis = np.linalg.qr(random.normal(size=(n, n)))[0]
    stiffness = basis @ np.diag(random.choice([0.0, 0.3, 2.0], n)) @ basis.T
    law = list(LAWS)[int(random.integers(3))]  # the law as printed feeds energy in
    stages, clearance = [], 0.0 if random.random() < 0.3 else 10.0 ** random.uniform(-3.0, 0.5)
    for index in range(2):
        decades = random.uniform(0.0, STIFFEST) if index else 0.0
        stages.append(Stage(clearance, 10.0**decades, side=list(Side)[int(random.integers(3))], name=f"s{index}"))
        clearance += 10.0 ** random.uniform(-3.0, 0.5)
    contact = Contact(
        "gap",
        {names[0]: 1.0},
        tuple(stages),
        None,
        law,
        {
            "impact_damping": 10.0 ** random.uniform(-3.0, 0.0) if law == "hunt-crossley" else 0.0,
            "viscous_damping": 10.0 ** random.uniform(-3.0, 1.0) if law == "viscous" else 0.0,
        },
    )
    return System(
        names,
        stiffness=stiffness,
        damping=np.eye(n) * random.choice([0.0, 1e-3, 0.1, 3.0]),
        contacts=[contact],
        mean={names[-1]: random.choice([0.0, 0.3, 3.0])},
        harmonics=[Harmonic(10.0 ** random.uniform(-2.0, 2.0), {names[0]: 1.0})],
        frequency=10.0 ** random.uniform(-1.0, 1.0),
    )


def wild_state(random: np.random.Generator, system: System) -> np.ndarray:
    """A large state, one at rest on a breakpoint, or one that only just touches it."""
    kind, size = random.integers(3), system.size
    if kind == 0:
        return random.normal(size=2 * size) * 10.0 ** random.uniform(0.0, 3.0)
    state = np.zeros(2 * size)
    state[0] = system["gap.s0.clearance"] * (1.0 if random.random() < 0.5 else -1.0)
    if kind == 2:
        state[size] = 10.0 ** random.uniform(-14.0, -6.0) * random.choice([-1.0, 1.0])
    return state


def outcome(seed: int) -> str:
    """What becomes of one system and state: ``settled``, ``not settled``, or the name of an error."""
    random = np.random.default_rng(seed)
    system = wild_system(random)
    state = wild_state(random, system)
    try:
        motion = integrate(system, state, 2)
        for name in ("q", "v", "a", "forces"):
            assert np.isfinite(getattr(motion, name)).all(), (seed, name)
        settled = settle(system, state, options=SettleOptions(max_periods=PERIODS))
    except NumericalError as error:
        return type(error).__name__
    assert np.isfinite(settled.strobes).all(), seed
    return "settled" if settled.converged else "not settled"


def test_wild_systems_end_with_a_result_or_an_error():
    outcomes = [outcome(seed) for seed in (0, 2, 3, 4, 5)]  # 1 takes seconds
    assert {"settled", "not settled"} <= set(outcomes) <= {"settled", "not settled", "FlowError"}


@pytest.mark.slow
def test_a_thousand_wild_systems_end_with_a_result_or_an_error():
    outcomes = {outcome(seed) for seed in range(1000)}
    assert outcomes == {"settled", "not settled", "FlowError"}

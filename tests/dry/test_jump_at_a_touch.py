"""Where the slip rate touches zero, friction whose static coefficient is the larger one sticks at once, for a while."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.bifurcation.branch import Branch
from gapwalk.continuation.walk import EndReason
from gapwalk.model.contact import Contact, Stage, friction
from gapwalk.model.system import System
from tests.computed import once
from tests.dry.event_reference import Reference
from tests.sampled_verification import verified
from tests.tiers import in_campaign


def system(frequency: float) -> System:
    contacts = [
        friction("clamp", {"x": 1.0}, 0.46, stiffness=3.166),
        friction("pad", {"x": 1.0}, 0.04, static=1.3),
        Contact("stop", {"x": 1.0}, [Stage(0.79, 15.4)], law="hunt-crossley", numbers={"impact_damping": 0.034}),
    ]
    load = gw.Harmonic(1.843, {"x": -0.778})
    return System(["x"], [[1.0405]], [[0.0579]], [[1.1447]], contacts, harmonics=[load], frequency=frequency)


LOW, HIGH = 0.6536, 0.657


@once
def walked(low: float) -> tuple[Branch, Branch]:
    """Walk towards the touch from both sides."""
    walk = gw.WalkOptions(largest_step=0.05)  # each point is verified
    return (
        gw.follow(gw.find_orbit(system(low)), "frequency", HIGH, walk=walk),
        gw.follow(gw.find_orbit(system(HIGH)), "frequency", low, walk=walk),
    )


@pytest.mark.slow
@pytest.mark.parametrize(("low", "sampled"), [(LOW, 4), in_campaign(0.651, 0)])  # it slides four times between
def test_a_branch_ends_at_the_jump_in_either_direction(low: float, sampled: int) -> None:
    ends = [branch.ends[-1] for branch in walked(low)]
    for end, branch in zip(ends, walked(low), strict=True):
        assert end.reason is EndReason.JUMPS
        assert "pad behaves otherwise" in end.detail
        assert abs(end.value - branch.points[-1].value) < 1e-6
        assert not branch.special("grazing-sliding")
        assert verified(branch, sampled).breaches == ()


@pytest.mark.parametrize("number", [0, 1])
def test_beyond_the_end_an_independent_motion_jumps(number: int) -> None:
    """From almost the same state and frequency it sticks once more in each direction, or once less."""
    branch = walked(LOW)[number]
    end, (before, last) = branch.ends[-1].value, branch.points[-2:]
    slope = (last.orbit.state - before.orbit.state) / (last.value - before.value)
    ahead = np.sign(last.value - before.value) * 1e-7
    closures, sticks = [], []
    for value in (end - ahead, end + ahead):
        motion = Reference(system(value))
        start = last.orbit.state + (value - last.value) * slope
        state, modes, stops = start, None, 0
        # short pieces, since it looks at guards at 16 places of a step
        pieces = np.unique([0.0, 2.0 * np.pi, *np.linspace(1.70, 1.73, 60), *np.linspace(4.84, 4.87, 60)])
        for low, high in pairwise(pieces):
            found = motion.integrate(state, low, high, modes)
            state, modes = found.state, found.modes
            stops += sum((each.kind, each.index, each.mode) == ("slip", 1, 0) for each in found.events)
        closures.append(float(np.abs(state - start)[:2].max()))
        sticks.append(stops)
    assert closures[0] < 1e-9
    assert closures[1] > 5e-5
    assert (sticks[1] > sticks[0]) is bool(number)

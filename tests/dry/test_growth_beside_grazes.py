"""Multipliers beside grazes, where changes of a motion grow by 1e4 and more, in three ways."""

from __future__ import annotations

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.verification.friction_dop853 import EXACT, FINE, DryRound, carry
from tests.dry.linear_pieces import largest_multiplier
from tests.dry.trials.random_systems import random_system
from tests.sampled_verification import verified
from tests.tiers import in_campaign

pytestmark = pytest.mark.skipif(bool(np.finfo(np.longdouble).eps > 1e-18), reason="needs numbers of 80 bits")


@pytest.mark.slow
@pytest.mark.parametrize(("factor", "sampled"), [(1.005, 2), in_campaign(1.3, 0)])
def test_multipliers_beside_a_graze_are_those_in_extended_precision(factor: float, sampled: int) -> None:
    """The other integrator needs smaller steps: its error grows along the period, and decides on the touch."""
    system = random_system(99)
    branch = gw.follow(gw.find_orbit(system), "frequency", factor * system.frequency)
    growing = [each.orbit for each in branch.points if np.abs(each.orbit.multipliers).max() > 1e4]
    orbit = growing[1]
    exact = largest_multiplier(orbit)
    assert exact > 2e4
    assert np.abs(orbit.multipliers).max() == pytest.approx(exact, rel=1e-4)
    sizes = []
    for error in (EXACT, FINE):
        (around,) = carry([orbit], exact=error)
        assert isinstance(around, DryRound)
        assert around.transition is not None
        sizes.append(float(np.abs(np.linalg.eigvals(around.transition)).max()))
    rough, fine = sizes
    assert abs(rough / exact - 1.0) > 1e-2
    assert fine == pytest.approx(exact, rel=1e-4)
    assert verified(branch, sampled).breaches == ()

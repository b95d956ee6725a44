"""A branch above a slider: coarse pictures at each step, the branch itself at rest."""

import matplotlib.pyplot as plt
import pytest

import gapwalk as gw
from tests.systems import clutch


@pytest.mark.slow
def test_a_branch_follows_a_slider_and_is_exact_at_rest():
    branch = gw.follow(gw.find_orbit(clutch(frequency=2.0), start="rest"), "frequency", 1.0)
    slider = branch.live("stage2.clearance", (0.8, 1.2), "half.q1")
    try:
        slider.set_val(1.02)
        live = slider.live
        moved = [(point.value, point.measure("half.q1")) for point in live.points[:: len(live.points) // 5]]
        for value, half in moved:
            orbit = gw.find_orbit(clutch(frequency=value, **{"stage2.clearance": 1.02}), start="settle")
            assert half == pytest.approx(orbit.measure("half.q1"), rel=0.02)
        live.rest()
        assert live.branch.system["stage2.clearance"] == 1.02
        own = gw.follow(gw.find_orbit(live.branch.points[0].orbit.system, start="rest"), "frequency", 1.0)
        assert [each.value for each in live.branch.special_points] == pytest.approx(
            [each.value for each in own.special_points], abs=1e-8
        )
        with pytest.raises(gw.errors.ModelError, match="what the branch is over"):
            branch.live("frequency", (1.0, 2.0))
        with pytest.raises(gw.errors.ModelError, match="write a range around it"):
            branch.live("stage2.clearance", (2.0, 3.0))
    finally:
        plt.close("all")

"""Records above a slider: coarse pictures at each step, the record itself at rest."""

import matplotlib.pyplot as plt
import numpy as np
import pytest

import gapwalk as gw
from tests.systems import clutch


def test_a_branch_follows_a_slider_and_is_exact_at_rest():
    branch = gw.follow(gw.find_orbit(clutch(frequency=2.0), start="rest"), "frequency", 1.0)
    slider = branch.live("stage2.clearance", (0.8, 1.2), "half.q1")
    try:
        slider.set_val(1.02)
        live = slider.live
        moved = [
            (point.value, point.measure("half.q1")) for point in live.answer.points[:: len(live.answer.points) // 5]
        ]
        for value, half in moved:
            orbit = gw.find_orbit(clutch(frequency=value, **{"stage2.clearance": 1.02}), start="settle")
            assert half == pytest.approx(orbit.measure("half.q1"), rel=0.02)
        live.rest()
        assert live.record.system["stage2.clearance"] == 1.02
        own = gw.follow(gw.find_orbit(live.record.points[0].orbit.system, start="rest"), "frequency", 1.0)
        assert [each.value for each in live.record.special_points] == pytest.approx(
            [each.value for each in own.special_points], abs=1e-8
        )
        with pytest.raises(gw.errors.ModelError, match="what the branch is over"):
            branch.live("frequency", (1.0, 2.0))
        with pytest.raises(gw.errors.ModelError, match="write a range around it"):
            branch.live("stage2.clearance", (2.0, 3.0))
    finally:
        plt.close("all")


def test_a_locus_follows_a_slider_and_is_exact_at_rest():
    start = gw.find_orbit(clutch(frequency=1.45), start="rest")
    graze = gw.follow(start, "frequency", 1.3).special("grazing")[0]
    plane = "frequency", "harmonic1.amplitude"
    slider = gw.follow_locus(graze, *plane, ((1.3, 1.5), (0.2, 0.3))).live("stage2.clearance", (0.9, 1.1))
    try:
        live = slider.live
        slider.set_val(1.02)
        coarse = np.column_stack((live.seen.x, live.seen.y))
        start = gw.find_orbit(clutch(frequency=1.45, **{"stage2.clearance": 1.02}), start="rest")
        graze = gw.follow(start, "frequency", 1.3).special("grazing")[0]
        own = gw.follow_locus(graze, *plane, live.answer.to).values
        line = coarse[np.isfinite(coarse).all(axis=1)]
        line = line[np.argsort(line[:, 0])]
        inside = (own[:, 0] > line[0, 0]) & (own[:, 0] < line[-1, 0])
        assert inside.mean() > 0.8
        assert np.interp(own[inside, 0], line[:, 0], line[:, 1]) == pytest.approx(own[inside, 1], abs=1e-4)
        live.rest()
        ends = live.record.values[[0, -1]]
        assert ends == pytest.approx(own[[0, -1]], abs=1e-8)
        with pytest.raises(gw.errors.ModelError, match="the locus is over; write another"):
            live.record.live("frequency", (1.0, 2.0))
    finally:
        plt.close("all")


def test_shares_follow_a_slider_and_are_those_of_basins_at_rest():
    box = {"q1": (-4.0, 4.0), "q3": (-4.0, 4.0), "q1'": (-4.0, 4.0), "q3'": (-4.0, 4.0)}
    slider = gw.basin_shares(clutch(frequency=0.63), box, 60, workers=1).live("stage2.clearance", (0.9, 1.1))
    try:
        live = slider.live
        slider.set_val(1.02)
        own = gw.basin_shares(clutch(frequency=0.63, **{"stage2.clearance": 1.02}), box, 60, workers=1)
        decided = live.seen.labels >= 0
        assert decided.mean() > 0.9
        for at, label in zip(live.seen.starts[decided], live.seen.labels[decided], strict=True):
            found = gw.settle(own.system, at).orbit  # the motion of the same start by the exact flow
            assert found.state == pytest.approx(live.seen.attractors[label].orbit.state, abs=1e-6) or found.period > 1
        live.rest()
        assert [(each.name, each.starts) for each in live.record.shares] == [
            (each.name, each.starts) for each in own.shares
        ]
        assert np.array_equal(live.record.starts, own.starts)
    finally:
        plt.close("all")

"""Families of tori of figures 13 and 15: rotation numbers as by long simulation, and locked windows on their way."""

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.attractors.rotation import rotation
from gapwalk.tori.torus_family import TorusEndReason, TorusEventKind
from tests.tiers import in_campaign

# five values of each family whose tori no contact grazes; of the family of three curves it does below .85364
VALUES = [
    *(in_campaign("13", 2, value) for value in (0.670, 0.671, 0.672, 0.673, 0.674)),
    *(in_campaign("15", 2, value) for value in (1.117, 1.119, 1.123, 1.126)),
    ("15", 2, 1.12),
    *(in_campaign("15", 2, value) for value in (1.155, 1.16, 1.165, 1.168, 1.17)),
    *(in_campaign("15", 3, value) for value in (0.854, 0.855, 0.856, 0.857, 0.858)),
]


@pytest.mark.slow
@pytest.mark.parametrize(("name", "curves", "frequency"), VALUES)
def test_rotation_numbers_as_by_long_simulation(name, curves, frequency):
    case = gw.paper.case(name)
    settled = gw.settle(case, frequency=frequency)
    torus = gw.tori.find_torus(settled, gw.tori.TorusOptions(accuracy=1e-10))
    assert (torus.curves, torus.stable) == (curves, True)
    assert torus.error < 1e-10
    strobes = gw.analysis.strobe(case.at(frequency=frequency), settled.strobes[-1], 8192 * curves).states
    simulated = rotation(strobes, curves)
    assert simulated is not None
    assert min(abs(torus.rotation - each) for each in (simulated.number, 1.0 - simulated.number)) < 1e-8


@pytest.mark.slow
def test_a_family_goes_on_beyond_the_window_in_which_it_locks():
    """Between 1.13172 and 1.13229 the motion of figure 15 repeats after 18 periods; beyond, it is a torus again."""
    case = gw.paper.case("15")
    torus = gw.tori.find_torus(gw.settle(case, frequency=1.13))
    family = gw.tori.follow_tori(torus, "frequency", 1.135)
    assert family.ends[1].reason is TorusEndReason.RANGE
    (event,) = [each for each in family.events if each.ratio_words in ("1/9", "8/9")]
    window = event.window
    assert window is not None
    assert window.is_whole
    assert window.orbit.stable
    inside = 0.5 * (window.low + window.high)
    assert gw.settle(case, window.orbit.state, frequency=inside).period == 18
    # just outside of both ends motions are quasi-periodic, with rotation numbers on both sides of the fraction
    sides = []
    for value in (window.low - 2e-5, window.high + 1e-4):
        strobes = gw.analysis.strobe(case.at(frequency=value), window.orbit.state, 30_000).states[-16_000:]
        found = rotation(strobes, 2)
        assert found is None or found.number != pytest.approx(1.0 / 9.0, abs=1e-7)
        sides.append(np.abs(strobes[18:] - strobes[:-18]).max())
    assert min(sides) > 1e-4
    assert family.rotations.min() < 1.0 / 9.0 < family.rotations.max()


@pytest.mark.slow
def test_the_family_of_two_curves_connects_two_neimark_sacker_points():
    """Between 1.14387 and 1.15114 its windows are dense: it passes them by leaps."""
    case = gw.paper.case("15")
    torus = gw.tori.find_torus(gw.settle(case, frequency=1.12))
    family = gw.tori.follow_tori(torus, "frequency", (1.11, 1.175))
    assert [end.reason for end in family.ends] == [TorusEndReason.SHRINKS] * 2
    assert [end.value for end in family.ends] == pytest.approx([1.1158757, 1.170599], abs=1e-7)
    windows = {each.ratio_words: each.window for each in family.events if each.window is not None}
    assert {"1/9", "1/8", "2/15", "1/7"} <= set(windows)
    for words in ("1/8", "2/15", "1/7"):  # what motions do there, by simulation
        window = windows[words]
        assert window is not None
        inside = 0.5 * (window.low + window.high)
        assert gw.settle(case, window.orbit.state, frequency=inside).period == 2 * window.ratio.denominator
    middle = [point for point in family.points if 1.1439 < point.value < 1.1511]
    assert len(middle) >= 5
    for point in middle:
        strobes = gw.analysis.strobe(point.torus.system, point.torus.state(), 50_000).states
        found = rotation(strobes[2000:], 2)
        assert found is not None
        assert min(abs(point.torus.rotation - each) for each in (found.number, 1.0 - found.number)) < 1e-7


@pytest.mark.slow
def test_the_ends_of_the_family_of_three_curves():
    """It shrinks at 0.859849; downwards a contact grazes along it, from 0.8536446 on, and it locks to 1:3."""
    case = gw.paper.case("15")
    torus = gw.tori.find_torus(gw.settle(case, frequency=0.855))
    family = gw.tori.follow_tori(torus, "frequency", (0.84, 0.87))
    end = family.ends[0]
    assert end.reason is TorusEndReason.RESONANCE
    assert "approaches 1/3; period 9, stable" in end.detail
    assert end.value == pytest.approx(0.8456, abs=2e-4)
    assert gw.settle(case, family.points[0].torus.state(), frequency=end.value - 2e-4).period == 9
    assert family.ends[1].reason is TorusEndReason.SHRINKS
    assert family.ends[1].value == pytest.approx(0.859849, abs=1e-6)
    (graze,) = [each for each in family.events if each.kind is TorusEventKind.GRAZING]
    assert graze.value == pytest.approx(0.853644, abs=graze.uncertainty + 1e-6)  # by simulation at eight values
    assert graze.uncertainty < 1e-5
    touches = [each.torus.touches for each in family.points if each.value < graze.value - 1e-5]
    assert set(touches) == {(4, 6)}

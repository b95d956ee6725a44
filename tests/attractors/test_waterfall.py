"""The waterfall: amplitudes of a branch in orders."""

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.attractors import settle, waterfall
from gapwalk.errors import ModelError
from tests.systems import clutch, linear


def test_a_linear_branch_has_the_lines_of_its_orbits():
    branch = gw.follow(gw.find_orbit(linear(frequency=0.8)), "frequency", to=1.4)
    found = waterfall(branch, "a", 4)
    assert found.parameter == "frequency"
    assert found.orders == pytest.approx([0, 1, 2, 3, 4])
    assert found.values == pytest.approx(branch.values)
    assert found.amplitudes.shape == (len(branch.points), 5)
    for name, column in (("h1.a", 1), ("h3.a", 3)):
        assert found.amplitudes[:, column] == pytest.approx(branch.measure(name), abs=1e-9)
    assert found.amplitudes[:, 2].max() < 1e-9
    assert found.stable.all()
    assert "orders up to 4" in repr(found)


def test_orbits_of_different_periods_share_their_orders():
    three = settle(gw.paper.case("15"), frequency=0.45).orbit
    one = settle(gw.paper.case("15"), frequency=0.63).orbit
    assert three is not None
    assert one is not None
    found = waterfall([three, one], "q1", 2)
    assert found.orders == pytest.approx(np.arange(7) / 3)
    assert found.values == pytest.approx([0.45, 0.63])
    assert found.amplitudes[0, 2] == pytest.approx(three.measure("h2/3.q1"), rel=1e-4)
    assert found.amplitudes[1, [1, 2, 4, 5]] == pytest.approx([0.0] * 4)
    assert found.amplitudes[1, 3] == pytest.approx(one.measure("h1.q1"), rel=1e-4)


def test_what_makes_no_sense_is_refused():
    with pytest.raises(ModelError, match="at least one orbit"):
        waterfall([], "q1")
    orbit = gw.find_orbit(clutch(frequency=1.9))
    with pytest.raises(ModelError, match="top is 0"):
        waterfall([orbit], "q1", 0)
    with pytest.raises(ModelError, match="no parameter 'speed'"):
        waterfall([orbit], "q1", parameter="speed")
    with pytest.raises(ModelError, match="no signal 'q9'"):
        waterfall([orbit], "q9")

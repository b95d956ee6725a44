"""Boxes of initial states, and windows on planes of them."""

import numpy as np
import pytest

from gapwalk.attractors.basins import Box, Window
from gapwalk.errors import ModelError
from tests.systems import clutch


def test_a_state_has_names():
    assert clutch().state_names == ("q1", "q3", "q1'", "q3'")


def test_a_window_is_cut_into_cells():
    window = Window.of(clutch(), {"q1'": (-1.0, 1.0), "q3": (0.0, 4.0)}, {"q1": 0.5})
    across, up = window.centres((2, 4))
    assert across.tolist() == [-0.5, 0.5]
    assert up.tolist() == [0.5, 1.5, 2.5, 3.5]
    states = window.states((2, 4))
    assert states.shape == (8, 4)
    assert states[0].tolist() == [0.5, 0.5, -0.5, 0.0]
    assert states[1].tolist() == [0.5, 0.5, 0.5, 0.0]  # the row goes on to the right
    assert states[-1].tolist() == [0.5, 3.5, 0.5, 0.0]


def test_random_states_fill_a_box_evenly_and_repeatably():
    box = Box.of(clutch(), {"q1": (-4.0, 4.0), "q3'": (1.0, 2.0), "q3": 0.7})
    assert box.free == ("q1", "q3'")
    states = box.draw(4000, seed=3)
    assert np.array_equal(states, box.draw(4000, seed=3))
    assert not np.array_equal(states, box.draw(4000, seed=4))
    assert np.all(states[:, 1] == 0.7)
    assert np.all(states[:, 2] == 0.0)
    counts = np.histogram2d(states[:, 0], states[:, 3], bins=2, range=((-4, 4), (1, 2)))[0]
    assert counts.sum() == 4000
    assert np.all(np.abs(counts - 1000) < 5 * np.sqrt(750))


@pytest.mark.parametrize(
    ("plane", "fixed", "words"),
    [
        ({"q1": (-4, 4)}, {}, "a plane has two axes, but 1 ranges were given"),
        ({"q1": (-4, 4), "q2": (-4, 4)}, {}, "there is no coordinate or velocity 'q2'; did you mean q1 or q3"),
        ({"q1": (-4, 4), "q3": (4, -4)}, {}, "the range of q3 is from 4 to -4: it is empty"),
        ({"q1": (-4, 4), "q3": 2.0}, {}, "q3 is 2.0; an axis of the plane needs a range"),
        ({"q1": (-4, 4), "q3": (0, 1, 2)}, {}, "write two finite numbers"),
        ({"q1": (-4, 4), "q3": (0, np.inf)}, {}, "write two finite numbers"),
        ({"q1": (-4, 4), "q3": (0, 1)}, {"q1": 0.0}, "q1 is both an axis of the plane and fixed"),
        ({"q1": (-4, 4), "q3": (0, 1)}, {"q1'": (0, 1)}, "q1' is fixed at .*; it must be one number"),
    ],
)
def test_a_window_that_makes_no_sense_is_refused(plane, fixed, words):
    with pytest.raises(ModelError, match=words):
        Window.of(clutch(), plane, fixed)

"""What feeds energy in, or damps nothing, is told."""

import pytest

import gapwalk as gw
from gapwalk.model.dissipation import dissipation_doubts
from tests.systems import clutch


@pytest.mark.parametrize(
    ("damping", "words"),
    [
        ([[0.1, 0.0], [0.0, 0.1]], ""),
        ([[0.1, -0.1], [-0.1, 0.1]], ""),
        ([[0.0, 0.0], [0.0, 0.0]], "damping is zero"),
        ([[0.1, 0.0], [0.0, -0.04]], "at the rate -0.02 "),
        ([[0.1, 0.3], [0.3, 0.1]], "damping is negative"),
    ],
)
def test_damping_that_takes_no_energy_out_is_told(damping, words):
    doubts = dissipation_doubts(gw.System(["a", "b"], [[2, -1], [-1, 2]], damping, [[1.0, 0.0], [0.0, 2.0]]))
    assert len(doubts) == bool(words)
    assert words in "".join(doubts)


def test_a_contact_that_feeds_energy_in_is_told():
    assert dissipation_doubts(clutch()) == []
    assert "stage2.impact_damping is -0.1" in dissipation_doubts(clutch(**{"stage2.impact_damping": -0.1}))[0]

"""Folds of tori and the unstable ones between them, against what motions do: hysteresis under two tones."""

from functools import cache

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.tori.torus_family import TorusEventKind

LOAD = "harmonic1.amplitude"


@cache
def family():
    """Tori of a lightly damped mass with a stop, over the amplitude of the first of two loads."""
    stop = gw.stop("stop", {"x": 1.0}, clearance=0.5, stiffness=1.0)
    load = gw.Harmonic(0.08, {"x": 1.0})
    mass = gw.System(["x"], [[1.0]], [[0.06]], contacts=[stop], harmonics=[load], frequency=1.1)
    torus = gw.tori.two_tones(mass, gw.tori.Tone(0.003, {"x": 1.0}, 1.1 * (1.0 + np.sqrt(5.0)) / 2.0))
    return gw.tori.follow_tori(torus, LOAD, 0.12)


def swing(load, state, periods=1500):
    """Largest distance of the last strobes of a motion from zero, for a load."""
    system = family().points[0].torus.system.at({LOAD: load})
    return float(np.abs(gw.analysis.strobe(system, state, periods).states[-100:, 0]).max())


def folds():
    return [each.value for each in family().events if each.kind is TorusEventKind.FOLD]


@pytest.mark.slow
def test_folds_of_tori_are_at_both_ends_of_the_hysteresis():
    assert folds() == pytest.approx([0.112988, 0.080943], abs=1e-6)


@pytest.mark.parametrize("is_up", [True, False])
def test_motions_jump_at_the_folds_of_tori(is_up):
    up, down = folds()
    points = family().points
    turns = [
        place for place in range(1, len(points)) if points[place].torus.stable is not points[place - 1].torus.stable
    ]
    lower, upper = points[: turns[0]], points[turns[1] :]

    def settles_on_the_upper(load, state):
        """True if a motion ends nearer to the upper torus of that load than to the lower one."""
        found = swing(load, state)
        tori = [min(each, key=lambda point: abs(point.value - load)).torus for each in (lower, upper)]
        away = [abs(found - np.abs(torus.states[:, 0]).max()) for torus in tori]
        assert min(away) < 0.3 * max(away)
        return away[1] < away[0]

    fold, start = (up, lower[-1]) if is_up else (down, upper[0])
    assert [settles_on_the_upper(fold + away, start.torus.state()) for away in (-1e-4, 1e-4)] == [False, True]


def test_an_unstable_torus_separates_motions():
    """Started on either side of it, they settle on the two stable tori; started on it, they stay for a while."""
    torus = min(
        (point.torus for point in family().points if not point.torus.stable),
        key=lambda each: abs(each.system[LOAD] - 0.1),
    )
    assert (torus.unstable, torus.error < 1e-9) == (1, True)
    start, load = torus.state(), torus.system[LOAD]
    aside = np.array([1e-3, 0.0, 0.0, 0.0])
    sides = sorted(swing(load, start + sign * aside) for sign in (1.0, -1.0))
    assert sides[1] > 1.5 * sides[0]
    strobes = gw.analysis.strobe(torus.system, start, 40).states
    assert strobes == pytest.approx(torus.strobes(40), abs=1e-6)

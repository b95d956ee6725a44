"""Torus doubling: a self-excited oscillator beside one whose orbit doubles, apart, and with a force between them."""

import math
from functools import cache

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.errors import ModelError
from gapwalk.tori.torus_family import TorusEndReason, TorusEventKind

WELLS = gw.force("wells", {"y": 1.0}, "x*x*x - x")
LOADS = "harmonic1.amplitude"


def one(load):
    """A driven mass between two wells, whose orbit in one well doubles as the load grows."""
    return gw.System(
        ["y"], [[0.0]], [[0.3]], contacts=[WELLS], harmonics=[gw.Harmonic(load, {"y": 1.0})], frequency=math.sqrt(1.7)
    )


def pair(load, between=0.0):
    """The same mass y beside a self-excited oscillator x on the unit circle, which varies its wells."""
    contacts = [
        gw.force("circle", {"x": 1.0}, "(x*x + v*v - 1)*v"),
        WELLS,
        gw.force("between", {"r": {"x": 1.0}, "s": {"y": 1.0}}, "k*r*s", acts_on={"y": 1.0}, numbers={"k": between}),
    ]
    return gw.System(
        ["x", "y"],
        stiffness=[1.0, 0.0],
        damping=[0.0, 0.3],
        contacts=contacts,
        harmonics=[gw.Harmonic(load, {"y": 1.0})],
        frequency=math.sqrt(1.7),
    )


@cache
def before_doubling(between):
    """The family of tori of one curve, through the load at which it doubles, and the doubling."""
    torus = gw.tori.find_torus(gw.settle(pair(0.3, between), [1.0, 1.0, 0.0, 0.0]))
    family = gw.tori.follow_tori(torus, LOADS, 0.33)
    (event,) = [each for each in family.events if each.kind is TorusEventKind.DOUBLING]
    assert (event.before, event.after) == (0, 1)
    assert "twice as many curves" in event.detail
    return torus, event


@pytest.mark.slow
def test_apart_the_torus_doubles_where_the_orbit_does():
    orbit = gw.settle(one(0.3), [1.0, 0.0]).orbit
    assert orbit is not None
    (flip,) = gw.follow(orbit, LOADS, 0.33).special(gw.Kind.FLIP)
    torus, event = before_doubling(0.0)
    assert event.value == pytest.approx(flip.value, abs=1e-8)
    doubled = gw.tori.follow_tori(event, LOADS, 0.32)
    assert doubled.curves == 2
    assert doubled.ends[0].reason is TorusEndReason.DOUBLED
    assert doubled.ends[1].reason is TorusEndReason.RANGE
    # the mass moves as on its orbit of period 2, whatever the oscillator beside it does
    last = doubled.points[-1].torus
    expected = gw.find_orbit(one(0.32), 2, last.state()[[1, 3]])
    strobes = gw.analysis.strobe(one(0.32), expected.state, 2).states
    for curve in last.sections:
        away = np.abs(strobes[:, None, :] - curve[None, :, [1, 3]]).max(axis=(1, 2)).min()
        assert away < 1e-8
    assert last.stable
    turns = 2.0 * torus.rotation % 1.0
    assert last.rotation == pytest.approx(turns, abs=1e-9)


@pytest.mark.slow
def test_together_motions_settle_on_the_doubled_torus():
    _, event = before_doubling(0.01)
    doubled = gw.tori.follow_tori(event, LOADS, 0.325)
    last = doubled.points[-1]
    assert (last.value, last.torus.curves, last.torus.stable) == (pytest.approx(0.325), 2, True)
    assert np.abs(last.torus.sections[0].mean(axis=0) - last.torus.sections[1].mean(axis=0)).max() > 1e-2
    met = gw.tori.find_torus(gw.settle(pair(0.325, 0.01), last.torus.state() * 1.001))
    assert met.curves == 2
    turns = (met.rotation, 1.0 - met.rotation)
    assert min(abs(each - last.torus.rotation) for each in turns) < 1e-9
    assert gw.verify(last.torus).ok


def test_other_events_bear_no_tori():
    torus, event = before_doubling(0.01)
    family = gw.tori.follow_tori(torus, LOADS, 0.31)
    assert not [each for each in family.events if each.torus is not None]
    with pytest.raises(ModelError, match="can be kept only if the walk starts from a torus"):
        gw.tori.follow_tori(event, LOADS, 0.33, second=("between.k", (0.0, 0.1)))

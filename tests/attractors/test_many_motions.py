"""Motions: many motions by the batch integrator beside the same ones by the exact flow."""

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.attractors.many_motions import BatchMotions, ExactMotions, enough, motions_of
from gapwalk.errors import FlowError
from tests.systems import clutch
from tests.tiers import in_campaign

SYSTEM = clutch(frequency=0.6)
STATES = np.random.default_rng(2).uniform(-1.5, 1.5, (20, 4))
VALUES = {"frequency": np.linspace(0.4, 1.6, 20), "harmonic1.amplitude": np.linspace(0.1, 0.5, 20)}


@pytest.mark.parametrize("values", [in_campaign(None), VALUES])
def test_both_flows_agree(values):
    fast, exact = motions_of(SYSTEM, STATES, values), ExactMotions(SYSTEM, values)
    assert isinstance(fast, BatchMotions)
    assert fast.advance(STATES, 3) == pytest.approx(exact.advance(STATES, 3), abs=5e-3)
    track = fast.strobes(STATES, 2, after=1)
    assert track == pytest.approx(exact.strobes(STATES, 2, after=1), abs=5e-3)
    seen, known = fast.contacts(STATES, 2), exact.contacts(STATES, 2)
    assert seen.peaks == pytest.approx(known.peaks, rel=1e-2, abs=5e-3)
    assert np.mean(seen.impacts == known.impacts) >= 0.9  # a slight touch may be missed
    assert 0.0 < fast.error < 5e-4


def test_parts_and_motions_that_ran_away_keep_their_places():
    whole = motions_of(SYSTEM, STATES, VALUES)
    which = np.array([3, 11, 17])
    states = STATES[which].copy()
    states[1] = np.nan
    ends = whole.part(which).advance(states, 2)
    assert np.isnan(ends[1]).all()
    assert ends[[0, 2]] == pytest.approx(whole.advance(STATES, 2)[which][[0, 2]], abs=1e-12)
    alone = whole.part(which).part(np.array([2])).advance(states[2:], 2)
    assert alone == pytest.approx(ends[2:], abs=1e-12)
    assert np.isnan(whole.contacts(np.full((20, 4), np.nan), 2).peaks).all()


def test_the_exact_flow_serves_where_the_mass_flow_gives_up(monkeypatch):
    def refuse(*_, **__):
        raise FlowError("too stiff")

    monkeypatch.setattr("gapwalk.ensemble.batch_flow.BatchFlow.steps_for", refuse)
    assert isinstance(motions_of(SYSTEM, STATES), ExactMotions)


RARE = gw.System(
    ["x"],
    [[1.0]],
    [[0.15]],
    [[1.0]],
    contacts=[gw.stop("s", {"x": 1.0}, 1.0, 9.7)],
    harmonics=[gw.Harmonic(0.13, {"x": 1.0}, name="a")],
)
"""A mass that touches its stop near resonance only."""


def test_steps_resolve_contacts_that_the_chosen_motions_never_close():
    grid = np.meshgrid(np.linspace(0.6, 1.87, 20), np.linspace(0.026, 0.13, 20))
    values = dict(zip(("frequency", "a.amplitude"), (each.ravel() for each in grid), strict=True))
    (motions, states), error = enough(
        motions_of(RARE, np.zeros((400, 2)), values), lambda motions: (motions, motions.advance(np.zeros((400, 2)), 64))
    )
    assert isinstance(motions, BatchMotions)
    assert motions.steps >= 2 * np.pi * np.sqrt(9.7) / 0.6 / 0.2
    assert error < 1e-4
    response = 1.0 / (1.0 - grid[0] ** 2 + 0.15j * grid[0])  # linear, below the clearance
    x = (grid[1] * response).ravel()
    is_open = np.abs(x) < 1.0
    assert is_open.sum() > 390
    exact = np.stack((x.real, -grid[0].ravel() * x.imag), axis=1)
    assert states[is_open] == pytest.approx(exact[is_open], abs=0.01)  # what is left of the transients
    assert not (motions.contacts(exact, 16).impacts[is_open]).any()


def test_what_was_done_with_too_few_steps_is_done_again():
    coarse = motions_of(SYSTEM, STATES, VALUES)._in(8)
    assert isinstance(coarse, BatchMotions)
    tried = []

    def work(motions):
        tried.append(motions.steps)
        return motions.contacts(STATES, 2).states

    ends, error = enough(coarse, work)
    assert tried[0] == 8
    assert len(tried) > 1
    assert error <= 1e-4
    assert ends == pytest.approx(ExactMotions(SYSTEM, VALUES).advance(STATES, 2), abs=5e-3)

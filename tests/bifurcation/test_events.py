"""Special points of a user's own, against closed forms."""

import pickle

import numpy as np
import pytest
from scipy.optimize import brentq

import gapwalk as gw
from gapwalk.bifurcation.special_point import Kind, register
from gapwalk.continuation import EndReason
from gapwalk.errors import ModelError

FORCE, DAMPING = 0.2, 0.1


def oscillator(clearance: float = 100.0) -> gw.System:
    """A linear oscillator with a stop out of its reach."""
    return gw.System(
        ["a"],
        [[1.0]],
        [[DAMPING]],
        contacts=[gw.backlash("stop", {"a": 1.0}, clearance, 5.0)],
        harmonics=[gw.Harmonic(FORCE, {"a": 1.0})],
        frequency=0.3,
    )


def amplitude(w: float) -> float:
    return FORCE / np.hypot(1.0 - w**2, DAMPING * w)


LIMIT = gw.Event("amplitude 0.5", lambda orbit: orbit.measure("half.a") - 0.5)


@pytest.mark.slow
def test_an_event_is_located_where_its_function_vanishes():
    branch = gw.follow(gw.find_orbit(oscillator()), "frequency", 2.0, events=[LIMIT])
    up, down = branch.special("amplitude 0.5")
    expected = [brentq(lambda w: amplitude(w) - 0.5, *ends, xtol=1e-15) for ends in ((0.3, 0.99), (1.01, 2.0))]
    for found, value in zip((up, down), expected, strict=True):
        assert abs(found.value - value) < 1e-12
        assert found.uncertainty < 1e-9
    assert branch.ends[-1].reason is EndReason.RANGE
    assert not branch.unexplained
    assert gw.verify(branch).ok


def test_two_events_in_one_step_are_both_found():
    highest = max(amplitude(w) for w in np.linspace(0.99, 1.0, 100_001))
    near = gw.Event("almost the peak", lambda orbit: orbit.measure("half.a") - highest * (1.0 - 1e-7))
    branch = gw.follow(gw.find_orbit(oscillator()), "frequency", 2.0, events=[near, LIMIT])
    assert [str(each.kind) for each in branch.special_points] == [LIMIT, near, near, LIMIT]


def test_an_event_beside_bifurcations_leaves_them_where_they_are():
    system = oscillator(1.0)
    plain = gw.follow(gw.find_orbit(system), "frequency", 2.0)
    branch = gw.follow(gw.find_orbit(system), "frequency", 2.0, events=[LIMIT])
    others = [special for special in branch.special_points if special.kind != LIMIT]
    assert [special.kind for special in others] == [special.kind for special in plain.special_points]
    assert np.allclose([special.value for special in others], [special.value for special in plain.special_points])
    assert branch.plot() is not None


def test_an_event_keeps_its_function_in_a_pickle():
    event = pickle.loads(pickle.dumps(gw.Event("long", len)))
    assert event == "long"
    assert isinstance(event, gw.Event)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: gw.Event("fold", len), "no other kind"),
        (lambda: gw.Event("limit", 3), "callable"),  # type: ignore[arg-type]
        (lambda: gw.follow(gw.find_orbit(oscillator()), "frequency", 2.0, events=LIMIT), "a list of events"),
        (lambda: gw.follow(gw.find_orbit(oscillator()), "frequency", 2.0, events=[LIMIT, LIMIT]), "same name"),
        (
            lambda: gw.follow(
                gw.find_orbit(oscillator()), "frequency", 2.0, events=[gw.Event("bad", lambda orbit: np.nan)]
            ),
            "finite",
        ),
    ],
)
def test_a_mistake_is_explained(make, message):
    with pytest.raises(ModelError, match=message):
        make()


def test_the_name_of_another_kind_is_refused() -> None:
    class Other(Kind):
        pass

    with pytest.raises(ModelError, match="there is a kind of special point 'fold' already, Fold; choose another name"):
        register(Other("fold"))
    assert type(Kind.named("fold")).__name__ == "Fold"

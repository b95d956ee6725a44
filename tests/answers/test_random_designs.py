"""The least change for figure 13's clutch against random designs, judged by folds that are tracked, not walked."""

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.answers.least_change import DesignProblem
from gapwalk.answers.point_prediction import TrackedPoint
from gapwalk.errors import NumericalError

pytestmark = pytest.mark.slow

NAMES = ("stage2.clearance", "stage2.stiffness", "stage2.impact_damping", "harmonic1.amplitude", "mean.q1")
BAND = (0.60, 0.66)
LEAST = 0.229048
NEW = (0.0480, -0.2198, 0.0132, -0.0406, 0.0013)


@pytest.fixture(scope="module")
def problem():
    lead = gw.find_orbit(gw.paper.case("13").at(frequency=0.71))
    changes = tuple(gw.ask.Change(name) for name in NAMES)
    return DesignProblem(lead, "frequency", 0.55, changes, (gw.ask.NoPoint("fold", BAND),))


def in_ball(count: int, radius: float) -> np.ndarray:
    """Points that are evenly spread over a ball."""
    random = np.random.default_rng(1)
    steps = random.normal(size=(count, len(NAMES)))
    lengths = radius * random.random(count) ** (1.0 / len(NAMES))
    return steps * (lengths / np.linalg.norm(steps, axis=1))[:, None]


def nearest_that_reaches(problem, designs) -> float:
    """The least change of the designs that reach the goal."""
    special = problem.response(np.zeros(len(NAMES))).branch.special("fold")
    folds = [TrackedPoint.of(each, NAMES) for each in special]

    def is_refused(u) -> bool:
        values = folds[0].origin * (1.0 + u)
        found = (fold.found_at(values) for fold in folds)
        return any(each is not None and BAND[0] < each.value < BAND[1] for each in found)

    for u in sorted(designs, key=np.linalg.norm):
        if is_refused(u):
            continue
        try:
            if problem.goals[0].margin(problem.response(u)) >= 0.0:
                return float(np.linalg.norm(u))
        except NumericalError:
            continue
    return np.inf


def test_the_least_change_is_what_the_search_finds(problem):
    route = problem.route(("below",), 0)
    assert route.is_reached
    assert route.change == pytest.approx(LEAST, rel=1e-5)
    assert problem.relative(route.values) == pytest.approx(NEW, abs=1e-4)


@pytest.mark.parametrize(("centre", "radius"), [((0.0,) * 5, 0.30), (NEW, 0.05)])
def test_none_of_10000_random_designs_is_nearer(problem, centre, radius):
    assert LEAST < nearest_that_reaches(problem, np.array(centre) + in_ball(10_000, radius)) < 1.1 * LEAST

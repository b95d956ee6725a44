"""The measure that table, pictures and pages of a study show: the one that it names, or that of what it is about."""

from dataclasses import dataclass

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.answers.shown_measure import shown_measure
from gapwalk.plot.picture import picture_of
from gapwalk.studies.response_study import ResponseOptions


@dataclass(frozen=True)
class Asked:
    measure: str = ""
    goals: tuple[object, ...] = ()
    gaps: tuple[str, ...] = ()
    spreads: object = None


@pytest.fixture(scope="module")
def system() -> gw.System:
    stop = gw.Contact("stop", {"y": 2.0, "x": 0.5}, [gw.Stage(clearance=1.0, stiffness=20.0)])
    return gw.System(
        ["x", "y"], np.diag([1.0, 1.5]), 0.1 * np.eye(2), contacts=[stop], harmonics=[gw.Harmonic(0.5, {"x": 1.0})]
    )


@pytest.mark.parametrize(
    ("asked", "shown"),
    [
        (Asked(), "half.x"),
        (Asked("max.y", gaps=("stop",)), "max.y"),
        (Asked(gaps=("stop",)), "half.y"),
        (Asked(goals=(gw.ask.NoPoint("fold", (0.1, 0.2)), gw.ask.Quiet("stop", (0.1, 0.2)))), "half.y"),
        (Asked(goals=(gw.ask.PeakBelow("stop.force", 1.0, (0.1, 0.2)),)), "half.y"),
        (Asked(goals=(gw.ask.PeakBelow("y''", 1.0, (0.1, 0.2)),)), "half.y"),
        (Asked(spreads=gw.analysis.Spreads((gw.ask.Spread("stop.clearance", sd=0.02),))), "half.y"),
    ],
)
def test_what_is_asked_for_is_shown(system, asked, shown) -> None:
    assert shown_measure(system, asked) == shown


def test_the_table_has_the_measure_of_the_picture() -> None:
    stop = gw.Contact("stop", {"x": 1.0}, [gw.Stage(clearance=1.0, stiffness=20.0, side="positive")])
    mass = gw.System(["x"], [[1.0]], [[0.1]], contacts=[stop], harmonics=[gw.Harmonic(0.5, {"x": 1.0})])
    result = gw.run(gw.Study(mass, ResponseOptions("frequency", 1.1, 1.6, measure="max.x"), "", ""))
    table, points = result.special_points(), result.branches[0].special_points
    place = [heading for heading, _ in table.columns].index("max x")
    assert points
    assert picture_of(result).axes[0].get_ylabel() == "maximum of x"
    for row, special in zip(table.rows, points, strict=True):
        assert float(row[place]) == pytest.approx(special.orbit.motion(4096).q.max(), rel=1e-5)

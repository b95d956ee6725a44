"""Maps: the loci of a plane, checked against branches along one parameter."""

import numpy as np
import pytest

from gapwalk import bifurcation_map
from gapwalk.bifurcation import Kind, follow
from gapwalk.bifurcation.loci import Codim2
from gapwalk.continuation import EndReason
from gapwalk.errors import ModelError
from gapwalk.orbit import find_orbit
from gapwalk.paper import case

PLANE = {"harmonic1.amplitude": (-0.1, 0.8), "frequency": (0.23, 0.28)}


def islands(**options):
    given = {"sections": 3, "max_period": 1, "kinds": (Kind.FOLD,), "workers": 1, **options}
    return bifurcation_map(case("27").at(frequency=0.28), PLANE, **given)


@pytest.fixture(scope="module")
def chart():
    return islands()


def crossings(locus, frequency):
    """Where a locus crosses a value of the second parameter, by straight interpolation."""
    a, b = locus.values[:-1], locus.values[1:]
    hit = (a[:, 1] - frequency) * (b[:, 1] - frequency) <= 0
    share = (frequency - a[hit, 1]) / (b[hit, 1] - a[hit, 1])
    return a[hit, 0] + share * (b[hit, 0] - a[hit, 0])


@pytest.mark.slow
def test_one_curve_of_folds_bounds_the_island_of_figure_27(chart):
    """The loop over Te1 = 0.484 ... 0.602 at W = 0.25 begins and ends on one locus, whose lowest point is near."""
    loop = follow(find_orbit(case("27"), at={"harmonic1.amplitude": 0.6}), "harmonic1.amplitude", to=(-1.0, 1.0))
    assert loop.ends[-1].reason is EndReason.CLOSED
    ends = sorted(fold.value for fold in loop.special(Kind.FOLD))
    bounding = [
        locus
        for locus in chart.loci
        if all(np.abs(crossings(locus, 0.25) - end).min(initial=1.0) < 1e-3 for end in ends)
    ]
    assert len(bounding) == 1
    lowest = bounding[0].values[:, 1].min()
    assert 0.244 < lowest < 0.25  # below it the island is gone
    gone = follow(
        find_orbit(case("27").at(frequency=lowest - 0.003), at={"harmonic1.amplitude": 0.55}),
        "harmonic1.amplitude",
        to=(-1.0, 1.0),
    )
    assert gone.ends[-1].reason is not EndReason.CLOSED


@pytest.mark.slow
def test_the_islands_overlap_once_their_bounds_have_crossed(chart):
    """Both grow with W. Their bounds cross at W = 0.2575: a little above the 0.255 of figure 28, not below it."""
    for figure in ("27", "28"):
        system = case(figure)
        large = follow(find_orbit(system, at={"harmonic1.amplitude": 0.1}), "harmonic1.amplitude", to=(-1.0, 1.0))
        small = follow(find_orbit(system, at={"harmonic1.amplitude": 0.6}), "harmonic1.amplitude", to=(-1.0, 1.0))
        assert large.ends[-1].reason is small.ends[-1].reason is EndReason.CLOSED
        assert large.values.max() < small.values.min()
        known = np.concatenate([crossings(locus, system.frequency) for locus in chart.loci])
        for bound in (large.values.max(), small.values.min()):
            assert np.abs(known - bound).min() < 1e-3
    of_large = next(locus for locus in chart.loci if locus.values[:, 0].min() < 0.0)
    of_small = next(
        locus
        for locus in chart.loci
        if abs(locus.values[:, 1].min() - 0.2457) < 1e-3 and locus.values[:, 0].max() > 0.7
    )
    gaps = {w: crossings(of_small, w).min() - crossings(of_large, w).max() for w in (0.2565, 0.259)}
    assert gaps[0.2565] > 0 > gaps[0.259]


@pytest.mark.slow
def test_cusps_are_marked(chart):
    cusps = [point for locus in chart.loci for point in locus.codim2(Codim2.CUSP)]
    assert len(cusps) >= 3
    assert "loci: 4 of fold" in repr(chart)
    assert chart.complete


@pytest.mark.parametrize(
    ("request_", "message"),
    [
        (lambda: bifurcation_map(case("27"), {"frequency": (0.2, 0.3)}), "a plane has two axes"),
        (
            lambda: bifurcation_map(case("27"), {"frequenzy": (0.2, 0.3), "mean.q1": (0.1, 0.2)}),
            "did you mean 'frequency'",
        ),
        (lambda: bifurcation_map(case("27"), {"mean.q1": (0.1, 0.1), "frequency": (0.2, 0.3)}), "it is empty"),
        (lambda: bifurcation_map(case("27"), {"mean.q1": (0.1, 0.2), "frequency": (-0.2, 0.3)}), "must be > 0"),
        (lambda: islands(sections=0), "sections is 0; it must be an integer from 1 to 100,000"),
        (lambda: islands(kinds=(Kind.BRANCH_POINT,)), "they may be fold, flip"),
    ],
)
def test_bad_requests_are_refused(request_, message):
    with pytest.raises(ModelError, match=message):
        request_()

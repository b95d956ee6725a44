"""Shares of basins along a parameter: their limits, the motions that are known again, and files."""

import numpy as np
import pytest
from scipy.stats import binom

import gapwalk as gw
from tests.computed import once

BOX = {"x": (-2.0, 1.0), "x'": (-2.0, 2.0)}


@once
def branch() -> gw.Branch:
    system = gw.System(
        ["x"],
        stiffness=[[1.0]],
        damping=[[0.1]],
        contacts=[gw.stop("stop", {"x": 1.0}, 1.0, 20.0, impact_damping=0.2)],
        harmonics=[gw.Harmonic(0.5, {"x": 1.0})],
        frequency=1.45,
    )
    return gw.follow(gw.find_orbit(system), "frequency", 1.3)


def test_shares_along_a_branch_are_those_of_each_value(tmp_path) -> None:
    file = tmp_path / "shares.gapwalk"
    found = branch().basins(BOX, points=3, starts=40, workers=1, output=file)
    np.testing.assert_allclose(found.values, [1.3, 1.375, 1.45])
    # two motions below the fold at 1.3921, and one above
    high, low = found.counts["period 1a"], found.counts["period 1b"]
    assert list(high + low) == [40, 40, 40]
    assert high[0] > high[1] > high[2] == 0
    plain = gw.basin_shares(branch().system.at(frequency=1.375), BOX, 40, workers=1)
    assert sorted(each.starts for each in plain.shares) == sorted((high[1], low[1]))
    for count, a, b in zip(high, *found.limits(high), strict=True):
        assert a == 0.0 if not count else binom.sf(count - 1, 40, a) == pytest.approx(0.025, rel=1e-6)
        assert binom.cdf(count, 40, b) == pytest.approx(0.025, rel=1e-6)
    again = gw.open_result(file)
    assert list(again.counts) == list(found.counts)
    np.testing.assert_array_equal(again.counts["period 1a"], high)
    assert list(found.to_xarray()["shares"]["share"].values[:3]) == list(high / 40)
    assert len(found.plot().collections) == 2
    assert "nearest one of its kind" in str(found.summary())


def test_what_is_done_first_is_coarse() -> None:
    seen: list[tuple] = []
    options = {"points": 5, "starts": 4, "workers": 1, "report": lambda *news: seen.append(news)}
    gw.analysis.shares(branch().system, "frequency", (1.45, 1.6), BOX, **options)
    values = [each[0].value for each in seen if hasattr(each[0], "places")]
    np.testing.assert_allclose(values, [1.45, 1.6, 1.525, 1.4875, 1.5625])


def test_a_box_of_other_components_is_refused() -> None:
    with pytest.raises(gw.errors.ModelError, match="no coordinate or velocity 'y'"):
        branch().basins({"y": (-1.0, 1.0)})

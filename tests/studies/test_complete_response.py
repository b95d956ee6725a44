"""A response goes on where many gaps rattle and no curve can be followed: settled motions at steps of the range."""

import io
import signal
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.answers.band_picture import band_series
from gapwalk.answers.settled_curve import STEPS, SettledCurve
from gapwalk.bifurcation.band import Band, graze_words
from gapwalk.continuation.walk import EndReason
from gapwalk.errors import ModelError
from gapwalk.flow.flow import flow_of
from gapwalk.model.coefficients import coefficients_of
from gapwalk.studies.compare import compare_results
from gapwalk.studies.result import Result
from gapwalk.studies.study_file import Study
from tests.computed import once
from tests.interruption import until_ctrl_c
from tests.studies.same import assert_same_branch
from tests.studies.studies import stop_study

INERTIA = '[[inertia]]\nname = "{}"\ninertia = "{} kg m^2"\n'
GEAR = """
[[gear]]
name = "mesh{number}"
between = ["input", "gear{number}"]
ratio = {ratio}
clearance = "0.12 deg"
stiffness = "2000 N m/rad"
impact_damping = "0.1 s/rad"
"""
TRAIN = f"""
title = "Two loose gears"
speed = "1100 rpm"
mean = {{ gear1 = "-0.4 N m", gear2 = "-0.5 N m" }}
reaction = "flywheel"

{
    "".join(
        INERTIA.format(*each)
        for each in (("flywheel", 0.13), ("secondary", 0.02), ("input", 0.004), ("gear1", 0.0031), ("gear2", 0.0022))
    )
}
[[shaft]]
name = "springs"
between = ["flywheel", "secondary"]
stiffness = "10 N m/deg"
damping = "2 N m s/rad"
[[shaft]]
name = "spline"
between = ["secondary", "input"]
stiffness = "2000 N m/rad"
damping = "0.5 N m s/rad"
{GEAR.format(number=1, ratio=3.6)}{GEAR.format(number=2, ratio=2.1)}
[[harmonic]]
name = "second"
order = 2
amplitude = "60 N m"
acts_on = {{ flywheel = 1.0 }}

[study]
kind = "response"
parameter = "speed"
from = "1100 rpm"
to = "1050 rpm"
measure = "max.mesh1"
"""


def study() -> Study:
    return gw.read_study(io.StringIO(TRAIN))


@once
def response() -> Result:
    return gw.run(study())


def reached(result: Result) -> list[tuple[float, float]]:
    """The ranges of the stretches and of the runs of bands."""
    found = [(each.values.min(), each.values.max()) for each in result.branches]
    return found + [(band.value, band.value) for band in result.branches[0].bands]


@pytest.mark.slow
def test_nothing_of_the_range_is_missing() -> None:
    result = response()
    first = result.branches[0]
    assert result.complete
    assert not result.failures
    assert first.values[0] == 1100.0
    assert first.bands[-1].value == 1050.0
    ranges, at = sorted(reached(result)), 1050.0
    for low, high in ranges:
        assert low - at < 1.01 * 50.0 / STEPS
        at = max(at, high)
    assert at == 1100.0
    assert {each.ends[1].reason for each in result.branches} == {EndReason.SETTLED}


def test_the_end_of_the_quiet_motion_is_located() -> None:
    # 1086.17917: the held flank pulls there (quiet_limits)
    (graze, *_) = response().branches[0].special("grazing")
    assert graze.value == pytest.approx(1086.1791680, abs=1e-5)
    assert graze.contact.startswith("mesh1")


def test_a_band_is_what_the_exact_flow_settles_to() -> None:
    result = response()
    band = next(band for band in result.branches[0].bands if band.period)
    system = result.system.at(speed=band.value)
    arc = flow_of(system).integrate(coefficients_of(system), band.state)
    for _ in range(band.period - 1):
        arc = flow_of(system).integrate(coefficients_of(system), arc.state)
    n = system.size
    assert np.abs(arc.state - band.state)[:n].max() < 0.02 * np.ptp(band.extremes, axis=0).max()


def test_words_tables_and_document_have_the_settled_motions() -> None:
    result = response()
    first = result.branches[0]
    text = "\n".join(map(str, result.summary()))
    assert "settled, speed from 1050 to" in text
    assert "mesh2: separates at" in text
    heading, *rows = result.tables()["bands"]()
    assert list(heading[:4]) == ["speed", "period", "separations", "least.springs"]
    assert len(rows) == len(first.bands)
    document = result.to_dict()["branches"][0]
    assert [row["parameter"] for row in document["bands"]] == [band.value for band in first.bands]
    assert "bands" not in result.to_dict(points=False)["branches"][0]


def test_grazes_are_counted_in_runs() -> None:
    system = response().system

    def band(value: float, separations: float) -> Band:
        counts = np.full(len(system.structure.equations.contacts), np.nan)
        counts[-1] = separations
        return Band(value, np.zeros(8), 1, np.zeros((3, 4)), counts)

    bands = [band(value, count) for value, count in ((10, 1), (9, 1), (8, 2), (7, 3), (3, 3), (2, 4))]
    first, grazes, second, more = graze_words(bands, "speed", system)
    assert "4 values" in first
    assert grazes == "  mesh2: separates at 4 of them, up to 3 times in a period; about 2 grazes, speed from 7 to 9 rpm"
    assert "2 values" in second
    assert more == "  mesh2: separates at 2 of them, up to 4 times in a period; about 1 graze, speed from 2 to 3 rpm"


def test_the_picture_has_a_band_and_its_mean() -> None:
    result = response()
    first = result.branches[0]
    wide, line = list(band_series(result.branches, "max.mesh1"))[-2:]
    low, high = np.asarray(wide.y)
    assert (low <= line.y).all()
    assert (line.y == high).all()
    place = first.system.coordinates.index("mesh1")
    assert high[-1] == first.bands[-1].extremes[2, place]
    wide, line = list(band_series(result.branches, "half.mesh1"))[-2:]
    assert np.asarray(wide.y).mean(axis=0) == pytest.approx(line.y)
    assert list(band_series(result.branches, "rms.mesh1")) == []
    axes = first.plot("max.mesh1")
    assert len(axes.collections) >= 1
    assert "largest, settled" in [text.get_text() for text in axes.figure.legends[0].get_texts()]


@pytest.mark.slow
def test_what_is_stored_goes_on_to_the_same_response(tmp_path: Path) -> None:
    path, whole = tmp_path / "response.gapwalk", response()

    def stops_at(value: float) -> Callable[..., None]:
        left = [value]

        def report(point: object, _: object) -> None:
            if left and point.value <= left[0]:  # type: ignore[attr-defined]
                left.clear()
                signal.raise_signal(signal.SIGINT)

        return report

    for value in (1090.0, 1070.0):
        result = until_ctrl_c(gw.run, study(), output=path, resume=path.exists(), report=stops_at(value))
        assert result.interrupted
        assert not result.complete
        assert (len(result.branches[0].bands) > 0) is (value == 1070.0)
    result = gw.run(study(), output=path, resume=True)
    assert result.complete
    assert len(result.branches) == len(whole.branches)
    for one, other in zip(result.branches, whole.branches, strict=True):
        assert_same_branch(one, other)
    for one, other in zip(result.branches[0].bands, whole.branches[0].bands, strict=True):
        assert one.value == other.value
        assert (one.state == other.state).all()
    again = gw.open_result(path)
    assert len(again.branches[0].bands) == len(whole.branches[0].bands)


def test_few_coordinates_or_gaps_are_walked_as_ever() -> None:
    assert SettledCurve.of(stop_study().system, "frequency", (0.7, 1.9)) is None
    assert SettledCurve.of(response().system, "speed", (1100.0, 1050.0)) is not None


def rattling(begin: float, end: float) -> Study:
    """The response of the train over speeds of which the first has no orbit that can be followed."""
    return gw.read_study(io.StringIO(TRAIN.replace("1100 rpm", f"{begin} rpm").replace('"1050 rpm"', f'"{end} rpm"')))


@once
def without_an_orbit() -> Result:
    return gw.run(rattling(1076.0, 1074.0))


def test_a_response_without_any_orbit_is_what_settles() -> None:
    result = without_an_orbit()
    (only,) = result.branches
    assert result.complete
    assert not only.points
    assert len(only.bands) == STEPS + 1
    assert [end.value for end in only.ends] == [1076.0, 1074.0]
    first, second, *_ = only.summary()
    assert str(first).startswith("no orbit of period 1 can be followed")
    assert "201 values, at none of them periodic" in str(second)
    assert "0 points" in repr(only)
    axes = only.plot("max.mesh1")
    assert len(axes.collections) == 1
    headings, *rows = result.tables()["points"]()
    assert "speed" in headings or not rows
    assert len(list(result.tables()["bands"]())) == STEPS + 2


def test_without_orbits_nothing_can_be_verified_or_compared() -> None:
    result = without_an_orbit()
    with pytest.raises(ModelError, match="settled motions alone"):
        gw.verify(result)
    with pytest.raises(ModelError, match="settled motions alone"):
        compare_results(result, result)


def test_an_orbit_is_followed_from_where_one_settles(tmp_path: Path) -> None:
    path = tmp_path / "response.gapwalk"

    def report(point: object, _: object) -> None:
        if isinstance(point, Band) and point.value > 1080.0 and not stopped:
            stopped.append(point.value)
            signal.raise_signal(signal.SIGINT)

    stopped = list[float]()
    part = until_ctrl_c(gw.run, rattling(1079.0, 1087.0), output=path, report=report)
    assert part.interrupted
    assert not part.branches[0].points
    result = gw.run(rattling(1079.0, 1087.0), output=path, resume=True)
    assert result.complete
    first = result.branches[0]
    assert first.bands[0].value == 1079.0
    assert first.values[0] > 1080.0
    assert max(high for _, high in reached(result)) == 1087.0
    assert gw.verify(result).ok

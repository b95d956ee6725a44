"""Thresholds of rattle: against the closed form of a preloaded oscillator, at an edge, and where there are none."""

import dataclasses
import math
import signal
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import gapwalk as gw
from gapwalk.answers.threshold import Confirmation, Threshold, ThresholdOptions
from tests.interruption import until_ctrl_c

DAMPING, STIFFNESS, LOAD, GAP = 0.4, 1.3, 0.2, 0.5
EXAMPLES = Path(__file__).parents[2] / "examples"
FEW = {"values": 8, "starts": 4, "periods": 60}


@pytest.fixture(scope="module")
def gear() -> gw.System:
    """Make a mass in a gap, which a mean load presses against one side."""
    return gw.System(
        ["x"],
        stiffness=[[0.0]],
        damping=[[DAMPING]],
        contacts=[gw.backlash("teeth", {"x": 1.0}, GAP, STIFFNESS)],
        mean={"x": 0.5},
        harmonics=[gw.Harmonic(LOAD, {"x": 1.0})],
        frequency=1.0,
    )


def amplitude(frequency: float) -> float:
    """Return the amplitude of the motion in contact."""
    return LOAD / abs(STIFFNESS - frequency**2 + 1j * DAMPING * frequency)


def test_the_threshold_is_that_of_the_linear_resonance(gear: gw.System) -> None:
    """The teeth stay together if the mean load exceeds the stiffness times the amplitude of the linear motion."""
    found = gw.ask.threshold(gear, "mean.x", (0.1, 1.2), {"frequency": (0.7, 1.6)}, **FEW)
    assert found.at == pytest.approx(math.sqrt(STIFFNESS - DAMPING**2 / 2.0), rel=1e-6)
    exact = STIFFNESS * LOAD / (DAMPING * math.sqrt(STIFFNESS - DAMPING**2 / 4.0))
    assert found.value == pytest.approx(exact, rel=1e-9)
    assert not found.is_edge
    assert found.confirmation is not None
    assert found.confirmation.rattling == 0
    assert not found.failures
    # the threshold is proportional to the load, and depends on the damping as its closed form does
    slopes = found.gradient("harmonic1.amplitude", "damping.x.x").slopes
    by_damping = -exact / DAMPING + exact * DAMPING / 4.0 / (STIFFNESS - DAMPING**2 / 4.0)
    assert slopes == pytest.approx([exact / LOAD, by_damping], rel=1e-7)
    for share, rattles in ((0.99, True), (1.01, False)):  # SciPy agrees on both sides
        assert opens(found.at, share * found.value) is rattles


def opens(frequency: float, mean: float) -> bool:
    """Return True if the teeth part after a long transient, by another integrator."""

    def rates(time: float, y: np.ndarray) -> list[float]:
        force = STIFFNESS * (max(y[0] - GAP, 0.0) + min(y[0] + GAP, 0.0))
        return [y[1], mean + LOAD * math.cos(frequency * time) - DAMPING * y[1] - force]

    period = 2.0 * math.pi / frequency
    end = solve_ivp(rates, (0.0, 40 * period), [GAP + mean, 0.0], rtol=1e-9, atol=1e-11, max_step=0.1)
    last = end.y[0][end.t > 38 * period]
    return bool(last.min() < GAP)


@pytest.mark.slow
def test_a_limit_at_the_end_of_the_range_is_told(gear: gw.System) -> None:
    found = gw.ask.threshold(gear, "mean.x", (0.05, 1.2), {"frequency": (1.4, 2.0)}, **FEW)
    assert found.is_edge
    assert found.at == pytest.approx(1.4, rel=1e-9)
    assert found.value == pytest.approx(STIFFNESS * amplitude(1.4), rel=1e-8)
    assert "end of the range" in str(found.summary())


@pytest.mark.parametrize(
    ("to", "says"),
    [
        ((0.8, 1.2), "nothing rattles"),
        ((0.05, 0.2), "still rattles"),
        ((1.2, 0.2), "; widen the range, or, if its first value is the quiet end, write from = 0.2 and to = 1.2"),
    ],
)
def test_no_threshold_is_an_answer_too(gear: gw.System, to: tuple[float, float], says: str) -> None:
    found = gw.ask.threshold(gear, "mean.x", to, {"frequency": (0.7, 1.6)}, **FEW)
    assert found.limit is None
    assert math.isnan(found.value)
    assert says in found.notes[0]
    assert ("teeth still rattles at" in found.sentence) is (says != "nothing rattles")
    assert "something" not in found.notes[0]
    with pytest.raises(gw.errors.ModelError, match="no threshold"):
        found.gradient()


def test_a_study_stores_its_threshold(gear: gw.System, tmp_path) -> None:
    found = gw.ask.threshold(
        gear, "mean.x", (0.1, 1.2), {"frequency": (1.4, 2.0)}, **FEW, output=tmp_path / "t.gapwalk"
    )
    again = gw.open_result(tmp_path / "t.gapwalk")
    assert again.value == found.value
    assert again.sentence == found.sentence
    header, *rows = again.tables()["loci"]()
    assert header == ["locus", "kind", "frequency", "mean.x"]
    assert len(rows) == sum(len(locus.points) for locus in found.loci)


def test_a_stopped_search_shows_what_rattles_so_far(gear: gw.System, tmp_path) -> None:
    def stop(*news) -> None:
        if news[-1].done == 2:
            signal.raise_signal(signal.SIGINT)

    asked, path = (gear, "mean.x", (0.1, 1.2), {"frequency": (0.7, 1.6)}), tmp_path / "t.gapwalk"
    found = until_ctrl_c(gw.ask.threshold, *asked, **FEW, output=path, report=stop, workers=1)
    assert not found.complete
    frequencies, means, rattles = found.points.T
    limits = np.array([STIFFNESS * amplitude(each) for each in frequencies])
    assert rattles.tolist() == (means < limits).tolist()
    last, first = means[rattles > 0.0].max(), means[means > means[rattles > 0.0].max()].min()
    assert found.sentence.startswith(f"teeth rattles at mean.x = {last:.6g}, ")
    assert found.sentence.endswith(f"from mean.x = {first:.6g} on")
    again = gw.open_result(path)
    assert again.sentence == found.sentence
    assert "tried: rattles" in [text.get_text() for text in again.plot().figure.legends[0].get_texts()]


def test_bad_requests_teach(gear: gw.System) -> None:
    with pytest.raises(gw.errors.ModelError, match="two different ones"):
        gw.ask.threshold(gear, "mean.x", (0.1, 1.0), {"mean.x": (0.7, 1.6)})
    with pytest.raises(gw.errors.ModelError, match="teeth"):
        gw.ask.threshold(gear, "mean.x", (0.1, 1.0), {"frequency": (0.7, 1.6)}, gaps="tooth")
    with pytest.raises(gw.errors.ModelError, match="starts is 0"):
        ThresholdOptions(starts=0)


def test_a_picture_without_a_threshold_says_why(gear: gw.System) -> None:
    found = gw.ask.threshold(gear, "mean.x", (1.2, 0.2), {"frequency": (0.7, 1.6)}, **FEW)
    figure = found.plot().figure
    assert any("widen the range" in " ".join(text.get_text().split()) for text in figure.axes[0].texts)


@pytest.mark.slow
def test_the_loci_of_a_threshold_are_verified(gear: gw.System) -> None:
    found = gw.ask.threshold(gear, "mean.x", (0.1, 1.2), {"frequency": (1.4, 2.0)}, **FEW)
    assert gw.verify(found).ok
    first, *rest = found.loci[0].points
    moved = dataclasses.replace(first.orbit, state=first.orbit.state * 1.001)
    wrong = dataclasses.replace(found.loci[0], points=(dataclasses.replace(first, orbit=moved), *rest))
    assert not gw.verify(dataclasses.replace(found, loci=(wrong,))).ok
    with pytest.raises(gw.errors.ModelError, match="no locus to verify"):
        gw.verify(dataclasses.replace(found, limit=None, loci=()))


def test_texts_of_a_threshold_have_units() -> None:
    """The figures are those of a threshold, the units those of a train."""
    system = gw.read_study(EXAMPLES / "idle.toml", name="drag").system
    tried = Confirmation(-3.0, 40, 2, 0, 0, 0, 60, 0, 0.0)
    ends = ("mean.gear", -1.0, -6.0, "speed", 700.0, 1100.0)
    none = Threshold(system, ("mesh",), *ends, None, math.nan, math.inf, False, (), tried)
    assert none.sentence == "mesh: no threshold of mean.gear from -1 to -6 N m over speed from 700 to 1100 rpm"
    assert "confirmed at mean.gear = -3 N m: none of 40" in str(none.summary())
    two = dataclasses.replace(none, gaps=("mesh", "clutch"), between=(-3.0, -3.1), at=900.0, last=("mesh", "clutch"))
    assert two.sentence == (
        "mesh and clutch do not rattle over speed from 700 to 1100 rpm at mean.gear = -3.1 N m and below (mesh and "
        "clutch still rattle at mean.gear = -3 N m, speed = 900 rpm)"
    )
    edge = dataclasses.replace(two, at=700.0)
    assert edge.sentence.endswith("speed = 700 rpm, an end of the range: a wider one may have another threshold)")


@pytest.mark.slow
def test_what_moves_it_names_no_factor_that_repeats_an_amplitude(gear: gw.System) -> None:
    system = gear.at(frequency=0.9)
    found = gw.ask.threshold(system, "mean.x", (0.05, 1.2), {"frequency": (1.4, 2.0)}, **FEW)
    gradient = found.gradient()
    load = system.structure.harmonics[0].name
    assert gradient[f"{load}.acts_on.x"] * system[f"{load}.acts_on.x"] == pytest.approx(
        gradient[f"{load}.amplitude"] * system[f"{load}.amplitude"], rel=1e-9
    )
    assert f"{load}.amplitude" in gradient.words(99)
    assert "acts_on" not in gradient.words(99)


def stopped(damping: float, clearance: float, unit: float = 1.0) -> gw.System:
    """Make a mass on a spring beside a stop; the limit is ``clearance * damping * sqrt(1 - damping**2 / 4)``."""
    return gw.System(
        ["x"],
        stiffness=[[1.0]],
        damping=[[damping]],
        contacts=[gw.stop("s", {"x": 1.0}, clearance * unit, 4.0)],
        harmonics=[gw.Harmonic(0.1 * unit, {"x": 1.0}, name="a")],
    )


@pytest.mark.parametrize(("damping", "unit"), [(0.3, 1e-9), (0.13, 1.0)])
def test_the_stated_error_holds(damping: float, unit: float) -> None:
    """A graze is computed a little off the breakpoint: the threshold is that of the touch itself."""
    exact = 0.7 * unit * damping * math.sqrt(1.0 - damping**2 / 4.0)
    found = gw.ask.threshold(
        stopped(damping, 0.7, unit), "a.amplitude", (3.0 * exact, 0.3 * exact), {"frequency": (0.6, 1.4)}, **FEW
    )
    assert found.value == pytest.approx(exact, rel=1e-12)
    assert abs(found.value - exact) <= found.uncertainty


@pytest.mark.slow
def test_a_transient_is_no_rattle_and_a_narrow_resonance_is_found() -> None:
    """At a damping ratio of 0.11 % transients rattle for thousands of periods, and tries miss the resonance."""
    exact = 0.5288 * 0.0022 * math.sqrt(1.0 - 0.0011**2)
    options = {"values": 8, "starts": 4}
    found = gw.ask.threshold(
        stopped(0.0022, 0.5288), "a.amplitude", (0.003, 0.0003), {"frequency": (0.8, 1.2)}, **options
    )
    assert found.value == pytest.approx(exact, rel=1e-11)
    assert abs(found.value - exact) <= found.uncertainty
    tried = found.confirmation
    assert tried is not None
    assert tried.rattling == 0
    assert tried.waited > 600
    assert f"none of {tried.settled} settled motions" in str(found.summary())
    assert tried.settled == tried.motions - tried.restless - tried.lost

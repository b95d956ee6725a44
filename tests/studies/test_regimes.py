"""Regime maps: beside the exact flow cell by cell, carried over both ways, and on systems with one answer."""

import numpy as np
import pytest

import gapwalk as gw
from gapwalk import regimes
from gapwalk.attractors.regimes import Regime, Verdicts
from gapwalk.errors import ModelError, StoreError
from gapwalk.orbit import find_orbit
from gapwalk.paper import case
from gapwalk.parallel.workers import local_workers
from gapwalk.studies import regime_study
from gapwalk.studies.options import ParameterRange
from gapwalk.studies.regime_study import RegimeChunk
from tests.interruption import until_ctrl_c
from tests.systems import linear
from tests.tiers import in_campaign

pytestmark = pytest.mark.usefixtures("kept_processes")

SET_15 = case("15")
PLANE = {"frequency": (0.63, 0.91), "harmonic1.amplitude": (0.2, 0.8)}


def in_process(**options):
    return {"workers": 1, **options}


@pytest.fixture(scope="module", params=[4, in_campaign(12)])
def chart(request):
    """Figure 15's set: periods 1 to 3, tori and chaos in 77 cells; some of them checked."""
    return regimes(SET_15, PLANE, (11, 7), **in_process(check=request.param))


@pytest.mark.slow
def test_the_words_are_those_of_the_exact_flow(chart):
    found = chart
    assert found.resolution == (11, 7)
    assert {"period 1", "period 2", "period 3", "quasi-periodic", "chaotic"} <= set(found.cells)
    assert sum(found.cells.values()) == 77
    assert found.check.checked in (4, 12)
    assert len(found.check.different) <= 1
    assert 0.0 < found.error < 5e-4
    assert found.complete


def test_a_cell_has_the_forces_of_its_orbit(chart):
    found = chart
    across, up = found.axes
    for row, column in zip(*np.nonzero(found.periods == 3), strict=True):
        at = {"frequency": across[column], "harmonic1.amplitude": up[row]}
        orbit = find_orbit(SET_15, 3, found.states[row, column], at=at)
        assert orbit.state == pytest.approx(found.states[row, column], abs=0.02)
        peak = max(orbit.measure("max.stage2"), -orbit.measure("min.stage2"))
        assert found.peak_force[row, column, 0] == pytest.approx(peak, rel=5e-3)
        assert found.impacts[row, column, 0] == pytest.approx(sum(orbit.closings) / 3)


def test_the_word_at_a_point(chart):
    found = chart
    row, column = np.argwhere(found.regimes == Regime.CHAOTIC)[0]
    across, up = found.axes
    assert found.at(across[column], up[row]) == "chaotic"
    assert found.at(0.91, 0.2) == "period 1"
    with pytest.raises(ModelError, match="lies outside the map"):
        found.at(2.0, 0.5)


def same(a, b):
    """Whether two maps say the same, bit for bit."""
    names = ("regimes", "periods", "exponents", "peak_force", "impacts", "states")
    return all(np.array_equal(getattr(a, name), getattr(b, name), equal_nan=True) for name in names) and (
        (a.check, a.error, a.notes, a.within) == (b.check, b.error, b.notes, b.within)
    )


def test_a_map_that_was_stopped_goes_on_from_its_file(tmp_path, monkeypatch):
    path, plane, size = tmp_path / "map.regimes", {"frequency": (0.4, 1.6), "mean.q1": (0.2, 0.3)}, (2, 70)
    options = in_process(check=2, carry="up")
    whole = regimes(SET_15, plane, size, **options)

    def stop(chunk, pace):
        raise KeyboardInterrupt

    until_ctrl_c(regimes, SET_15, plane, size, **options, report=stop, output=path)
    stopped = gw.open_result(path)
    assert not stopped.complete
    assert stopped.notes == ("stopped when 128 of 140 cells were done",)
    paces = []
    found = regimes(SET_15, plane, size, **options, report=lambda _, pace: paces.append(pace), output=path)
    assert [(pace.done, pace.before) for pace in paces] == [(2, 1)]
    assert same(found, whole)
    assert same(gw.open_result(path), whole)
    monkeypatch.setattr("gapwalk.studies.regime_study._judge_piece", None)
    assert same(regimes(SET_15, plane, size, **options, output=path), whole)
    with pytest.raises(StoreError, match=r"carry is 'no', and was 'up'"):
        regimes(SET_15, plane, size, **in_process(check=2), output=path)


def test_the_result_does_not_depend_on_who_does_the_work():
    plane = {"frequency": (0.4, 1.6), "harmonic1.amplitude": (0.1, 0.2)}
    options = in_process(check=2, carry="down", forces=False)
    alone = regimes(SET_15, plane, (2, 65), **options)
    with local_workers(2) as workers:
        both = regimes(SET_15, plane, (2, 65), **{**options, "workers": workers})
    assert same(both, alone)
    assert both.impacts.shape == (65, 2, 0)


def test_a_linear_system_has_period_1_everywhere():
    found = regimes(linear(), {"mean.a": (-1.0, 1.0), "frequency": (0.3, 3.0)}, 5, **in_process(check=5))
    assert found.cells == {"period 1": 25}
    assert found.peak_force.shape == (5, 5, 0)
    assert not found.check.different


@pytest.mark.slow
def test_states_that_are_carried_over_show_the_jump_at_two_places():
    """The main resonance leans: going up, the motion stays on the upper branch for longer than coming down."""
    plane = {"frequency": (0.5, 0.75), "harmonic1.amplitude": (0.25, 0.35)}
    options = {way: in_process(carry=way, check=0, max_period=8) for way in ("up", "down")}
    up, down = (regimes(case("13"), plane, (12, 1), **options[way]).peak_force[0, :, 0] for way in options)
    differs = np.abs(up - down) > 0.1
    assert 1 <= differs.sum() <= 6
    assert np.all(up[differs] > down[differs]) or np.all(up[differs] < down[differs])


def test_ctrl_c_keeps_what_is_done():
    def stop(chunk, pace):
        assert (pace.done, pace.total) == (1, 2)
        raise KeyboardInterrupt

    found = until_ctrl_c(
        regimes, linear(), {"mean.a": (-1.0, 1.0), "frequency": (0.3, 3.0)}, (17, 64), **in_process(), report=stop
    )
    assert not found.complete
    assert found.cells == {"period 1": 1024, "undecided": 64}
    assert found.notes == ("stopped when 1024 of 1088 cells were done",)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: regimes(SET_15, {"frequency": (0.2, 1.0)}), "a plane has two axes, but 1 ranges"),
        (lambda: regimes(SET_15, {"frequency": (0.2, 1.0), "mass": (0, 1)}), "mass"),
        (lambda: regimes(SET_15, {"frequency": (0.0, 1.0), "mean.q1": (0, 1)}), "frequency is 0.0; it must be > 0"),
        (
            lambda: regimes(SET_15, {"frequency": (1.0, 0.2), "mean.q1": (0, 1)}),
            "frequency is from 1 to 0.2: it is empty",
        ),
        (lambda: regimes(SET_15, {"frequency": 1.0, "mean.q1": (0, 1)}), "write two numbers"),
        (lambda: regimes(SET_15, PLANE, -3), "resolution is -3"),
        (lambda: regimes(SET_15, PLANE, 3, start=[0.0]), "a state of this system is 4 finite numbers"),
        (lambda: regimes(SET_15, PLANE, 3, carry="left"), "carry is 'left'; they are no, up, down"),
        (lambda: regimes(SET_15, PLANE, 3, check=-1), "check is -1"),
    ],
)
def test_what_makes_no_sense_is_refused(call, words):
    with pytest.raises(ModelError, match=words):
        call()


def test_doubtful_cells_are_pieces_of_their_own() -> None:
    """Half of the time of a map is theirs, and most are in few chunks; those that are carried over cannot wait."""
    count, none = 50, np.full((1, 50, 0), np.nan)
    found = np.full((1, count), int(Regime.PERIODIC))
    found[0, 10:30] = int(Regime.UNDECIDED)
    exponents, states = np.zeros((1, count)), np.arange(100.0).reshape(1, count, 2)
    verdicts = Verdicts(found, np.ones((1, count), dtype=int), exponents, none, none, states)
    values = np.random.default_rng(0).normal(size=(1, count, 2))
    parts = regime_study._doubts_in((0, values), RegimeChunk(0, verdicts, 0.0))
    assert [len(each.which) for each in parts] == [8, 8, 4]
    assert np.concatenate([each.which for each in parts]).tolist() == [*range(10, 30)]
    assert np.array_equal(np.concatenate([each.values for each in parts]), values[0, 10:30])
    assert np.array_equal(np.concatenate([each.verdicts.states for each in parts]), states[0, 10:30])
    assert regime_study._doubts_in((0, np.concatenate((values, values))), RegimeChunk(0, verdicts, 0.0)) == []


def corrupted(rows, regime, period):
    """Return the work on a map whose cells are of period 1, with some of them labelled otherwise, and those labels."""
    system = gw.System(
        ["x"],
        [[1.0]],
        [[0.2]],
        [[1.0]],
        contacts=[gw.stop("s", {"x": 1.0}, 9.0, 5.0)],
        harmonics=[gw.Harmonic(1.0, {"x": 1.0}, name="a")],
    )
    asked = regime_study.RegimeStudy(
        "frequency", 0.5, 2.0, second=ParameterRange("a.amplitude", 0.1, 1.0), resolution=(20, 20), check=8, workers=1
    )
    work = asked.work(system)
    with local_workers(1) as workers:
        for _, chunk in work.follow(workers, [0]):
            work._add(chunk)
        assert (work.verdicts.periods == 1).all()
        for row in rows:
            work.verdicts.regimes[row, 5:9], work.verdicts.periods[row, 5:9] = regime, period
            work.verdicts.states[row, 5:9] *= 1.0 if regime != Regime.RUNAWAY else np.nan
        work.check(workers)
    return work.found(complete=True)


@pytest.mark.parametrize(
    ("regime", "period"), [(Regime.PERIODIC, 12), (Regime.CHAOTIC, 0), (Regime.RUNAWAY, 0), (Regime.PERIODIC, 2)]
)
def test_a_check_finds_the_rare_labels_and_goes_on_until_none_is_wrong(regime, period):
    """Twelve wrong ones of 400: more than a sample has, in three rows."""
    found = corrupted((3, 4, 5), regime, period)
    assert found.cells == {"period 1": 400}
    assert len(found.check.different) == 12
    assert found.check.checked < 100
    across, up = found.axes
    x = 1.0 / (1.0 - across[6] ** 2 + 0.2j * across[6]) * up[4]
    assert found.states[4, 6, 0] == pytest.approx(x.real, abs=1e-9)  # of the exact flow

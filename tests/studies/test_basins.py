"""Basins of attraction, where the answer is known: by an independent computation, by symmetry, by SciPy."""

import numpy as np
import pytest
from scipy.stats import beta

import gapwalk as gw
from gapwalk import basins
from gapwalk.attractors.basins import (
    RUNAWAY,
    UNRESOLVED,
    BasinCheck,
    about,
    attractor_names,
    beside_cells,
    beside_states,
    differs,
    in_order,
)
from gapwalk.ensemble.batch_flow import BatchOptions, batch_flow_of
from gapwalk.errors import ModelError, StoreError
from gapwalk.model import Contact, Harmonic, Stage, System
from gapwalk.paper import case
from gapwalk.parallel.workers import Workers, local_workers
from gapwalk.studies import basin_study
from gapwalk.studies.basin_study import BasinOptions, BasinWork, basin_shares
from gapwalk.studies.result import load_result
from tests.independent import integrate
from tests.interruption import until_ctrl_c
from tests.systems import linear

pytestmark = pytest.mark.usefixtures("kept_processes")

HALF_A_CELL = 4.0 / 31.0
WELLS = {"x": (-2.0, 2.0), "x'": (-2.0, 2.0)}


def double_well(**changes):
    """x'' + 0.3 x' - x + x^3 = 0.02 cos(t): two wells, at about -1 and +1."""
    cubic = Contact("spring", {"x": 1.0}, (Stage(0.0, 0.0, 1.0),))
    push = Harmonic(0.02, {"x": 1.0})
    return System(("x",), [[-1.0]], [[0.3]], contacts=[cubic], harmonics=[push], frequency=1.0).at(changes)


def in_process(**options):
    return {"workers": 1, **options}


@pytest.fixture(scope="module")
def clutch_basins():
    """The grid of 32 x 32 states from -4 to 4, both ends included: the centres of cells that are 8 / 31 wide."""
    ends = (-4.0 - HALF_A_CELL, 4.0 + HALF_A_CELL)
    return basins(case("15").at(frequency=0.45), {"q1": ends, "q1'": ends}, 32, **in_process(check=64))


@pytest.fixture(scope="module")
def wells():
    return basins(double_well(), WELLS, 40, **in_process(check=200))


def test_the_grid_of_figure_15_has_123_cells_of_period_1_and_901_of_period_3(clutch_basins):
    found = clutch_basins
    assert found.axes[0] == pytest.approx(np.linspace(-4, 4, 32))
    assert found.cells == {"period 1": 123, "period 3": 901}
    assert found.unresolved == found.runaway == 0
    assert [attractor.period for attractor in found.attractors] == [1, 3]
    assert all(attractor.orbit.stable for attractor in found.attractors)
    assert found.check.border_checked == found.check.borders > 150
    assert found.check.inner_wrong == 0
    assert 0.0 < found.error < 3e-4
    assert found.complete
    assert not found.notes
    assert repr(found) == "Basins(q1, q1'; 32 x 32 cells; period 1: 123, period 3: 901)"


def same(a, b):
    """Whether two records say the same, bit for bit."""
    states = all(
        np.array_equal(one.strobes, other.strobes) for one, other in zip(a.attractors, b.attractors, strict=True)
    )
    return states and np.array_equal(a.labels, b.labels) and (a.check, a.error, a.notes) == (b.check, b.error, b.notes)


def test_a_job_that_was_stopped_goes_on_from_its_file(tmp_path, monkeypatch):
    path, size = tmp_path / "wells.basins", (100, 50)
    whole = basins(double_well(), WELLS, size, **in_process(check=9))

    def stop(chunk, pace):
        raise KeyboardInterrupt

    until_ctrl_c(basins, double_well(), WELLS, size, **in_process(check=9), report=stop, output=path)
    part = gw.open_result(path)
    assert not part.complete
    assert part.unresolved == 5000 - 4096
    sides = [np.array([one.state[0] for one in each.attractors])[each.labels.ravel()[:4096]] for each in (part, whole)]
    assert np.array_equal(*sides)
    paces = []
    found = basins(
        double_well(), WELLS, size, **in_process(check=9), report=lambda _, pace: paces.append(pace), output=path
    )
    assert [(pace.done, pace.total, pace.before) for pace in paces] == [(2, 2, 1)]
    assert same(found, whole)
    assert same(gw.open_result(path), whole)
    assert gw.open_result(path).window == whole.window
    monkeypatch.setattr("gapwalk.studies.basin_study.explore", None)
    assert same(basins(double_well(), WELLS, size, **in_process(check=9), output=path), whole)
    with pytest.raises(StoreError, match=r"something else, so it cannot be continued: check is 8, and was 9"):
        basins(double_well(), WELLS, size, **in_process(check=8), output=path)
    with pytest.raises(StoreError, match="its kind is sweep, and was basins"):
        gw.sweep(double_well(), "frequency", (0.9, 1.1), output=path)
    with pytest.raises(
        StoreError, match=r"holds Basins\(.*, and no result of a study; in Python, gapwalk\.open_result"
    ):
        load_result(path)


def test_a_check_that_was_stopped_goes_on_from_its_file(tmp_path, monkeypatch):
    exactly, calls, asked = basin_study._sort_exactly, [], (double_well(), WELLS, 30)

    def sort(*about):
        calls.append(about)
        if len(calls) == 4:
            raise KeyboardInterrupt
        return exactly(*about)

    monkeypatch.setattr(basin_study, "_sort_exactly", sort)
    until_ctrl_c(basins, *asked, **in_process(check=99), output=tmp_path / "b.gapwalk")
    stopped = gw.open_result(tmp_path / "b.gapwalk")
    assert stopped.notes == ("stopped when 900 of 900 states were done; they were not all checked",)
    assert (stopped.complete, stopped.unresolved) == (False, 0)
    goes_on = basins(*asked, **in_process(check=99), output=tmp_path / "b.gapwalk"), len(calls) - 4
    whole = basins(*asked, **in_process(check=99)), len(calls) - 4 - goes_on[1]
    assert same(goes_on[0], whole[0])
    assert goes_on[1] == whole[1] - 3


def test_a_linear_system_has_one_basin():
    found = basins(linear(), {"a": (-5.0, 5.0), "b'": (-5.0, 5.0)}, (6, 4), fixed={"b": 1.0}, **in_process())
    assert found.resolution == (6, 4)
    assert found.labels.shape == (4, 6)
    assert found.cells == {"period 1": 24}
    assert found.check.limit == 0.0  # no cell is left that was not checked


@pytest.mark.slow
def test_two_wells_are_told_apart_as_scipy_tells_them(wells):
    assert wells.names == ("period 1a", "period 1b")
    assert sum(wells.cells.values()) == 1600
    side = np.sign([attractor.state[0] for attractor in wells.attractors])
    assert side[0] == -side[1]
    x, v = wells.axes
    random = np.random.default_rng(4)
    for row, column in random.integers(0, 40, (12, 2)):
        end = integrate(double_well(), (x[column], v[row]), 12, max_step=0.2)[0]
        assert np.sign(end) == side[wells.labels[row, column]]


def test_without_forcing_the_basins_of_two_wells_are_each_other_turned_by_half(wells):
    found = basins(double_well(**{"harmonic1.amplitude": 0.0}), WELLS, 40, **in_process(check=0))
    assert np.array_equal(found.labels, 1 - found.labels[::-1, ::-1])
    assert list(found.cells.values()) == [800, 800]
    assert not np.array_equal(found.labels, wells.labels)


def test_the_result_does_not_depend_on_who_does_the_work(wells):
    with local_workers(2) as workers:
        found = basins(double_well(), WELLS, 40, check=200, workers=workers)
    assert np.array_equal(found.labels, wells.labels)
    assert found.check == wells.check


def test_shares_have_the_limits_of_clopper_and_pearson():
    found = basin_shares(double_well(**{"harmonic1.amplitude": 0.0}), WELLS, 400, confidence=0.9, **in_process(seed=5))
    assert sum(share.starts for share in found.shares) == 400
    for share in found.shares:
        low = beta.ppf(0.05, share.starts, 401 - share.starts)
        high = beta.ppf(0.95, share.starts + 1, 400 - share.starts)
        assert (share.low, share.high) == pytest.approx((low, high))
        assert share.low < 0.5 < share.high  # by symmetry it is exactly a half
    assert "period 1a 0." in repr(found)


@pytest.mark.slow
def test_starts_beside_others_of_another_label_are_found_with_the_exact_flow():
    """Two of these starts were called period 3 by the fast flow, whose error is 1e-4; at 1e-7 it calls none wrongly."""
    found = basin_shares(
        case("15").at(frequency=0.45), {"q1": (-4, 4), "q1'": (-4, 4)}, 4000, **in_process(seed=1, check=32)
    )
    assert [attractor.period for attractor in found.attractors] == [1, 3]
    assert found.check.border_wrong == 2
    assert found.check.border_checked == found.check.borders < 400
    assert (found.check.inner_wrong, found.check.shifted_wrong) == (0, 0)
    assert "exact at all borders; elsewhere 0 of 32" in repr(found)
    assert 0.0 < found.error < 3e-4
    some = np.concatenate(([3424, 3769], np.arange(0, 4000, 40)))
    fine = batch_flow_of(found.system, BatchOptions(error=1e-7)).run(found.starts[some], 901, every=900)
    assert fine.strobes is not None
    turn = fine.states - fine.strobes[-1]
    assert found.labels[some].tolist() == np.where(np.abs(turn).max(axis=1) < 1e-3, 0, 1).tolist()
    assert found.labels[3424] == found.labels[3769] == 0
    only_fast = basin_shares(
        found.system, {"q1": (-4, 4), "q1'": (-4, 4)}, 4000, **in_process(seed=1, check=0, exact_borders=False)
    )
    assert np.flatnonzero(only_fast.labels != found.labels).tolist() == [3424, 3769]
    assert only_fast.check.text == "not checked with the exact flow"
    assert only_fast.check.limit == 1.0


class Told(BasinWork):
    """A job whose exact labels are known beforehand, and whose shifted ones are others in some places."""

    def __init__(self, fast, truth, neighbours, options, by_rounding=()):
        super().__init__(double_well(), np.zeros((len(truth), 2)), neighbours, (len(truth), 1), options)
        self.labels, self.truth, self.looks = fast.copy(), truth, 0
        self.other = truth.copy()
        self.other[list(by_rounding)] = 1 - truth[list(by_rounding)]

    def found(self, *, complete):
        raise NotImplementedError

    def _exact(self, workers, which, shift=0.0):
        self.looks += len(which)
        yield from ()
        return (self.other if shift else self.truth)[which]


@pytest.mark.parametrize("seed", range(5))
def test_where_wrong_labels_are_found_more_are_looked_for(seed):
    """Two basins, a border between them, and in a corner a patch in which both the truth and the labels are random."""
    random, size, patch = np.random.default_rng(seed), 64, 12
    truth = np.zeros((size, size), dtype=int)
    truth[:, size // 2 :] = 1
    fast = truth.copy()
    truth[:patch, :patch], fast[:patch, :patch] = random.integers(0, 2, (2, patch, patch))
    job = Told(fast.ravel(), truth.ravel(), beside_cells(size, size), BasinOptions(check=64))
    list(job.check_labels(Workers()))
    assert job.labels.tolist() == truth.ravel().tolist()
    assert job.looks < 0.2 * size**2
    assert job.checked.border_wrong + job.checked.inner_wrong >= np.sum(fast != truth)


def test_samples_are_drawn_until_one_holds_nothing_wrong():
    """Wrong labels far from each other and from all borders: the sample finds some, so all are looked at in the end."""
    truth, wrong = np.zeros(6400, dtype=int), np.arange(0, 6400, 9)
    fast = truth.copy()
    fast[wrong] = 1
    lone = np.repeat(np.arange(6400)[:, None], 4, axis=1)  # no cell has a neighbour
    job = Told(fast, truth, lone, BasinOptions(check=200))
    list(job.check_labels(Workers()))
    assert not job.labels.any()
    assert job.checked.inner_checked == job.looks - 200 == 6400
    once = Told(fast, truth, lone, BasinOptions(check=200, exact_borders=False))
    list(once.check_labels(Workers()))
    assert once.checked.inner_checked == 200
    share = once.checked.share
    assert share == pytest.approx(once.labels.mean(), abs=0.06)
    assert share < once.checked.limit < share + 0.06


def test_labels_that_rounding_decides_are_counted():
    fast = np.zeros(100, dtype=int)
    job = Told(fast, fast, beside_cells(10, 10), BasinOptions(check=100), by_rounding=(3, 4, 50))
    list(job.check_labels(Workers()))
    assert (job.checked.shifted, job.checked.shifted_wrong) == (100, 3)
    assert job.checked.share == job.checked.limit == pytest.approx(0.03)
    assert job.checked.text.endswith(
        "elsewhere 0 of 100 cells differed from the exact flow; rounding decides 3 of 100 cells"
    )


@pytest.mark.slow
def test_basins_finer_than_rounding_say_so():
    """x'' + 0.15 x' - x + x^3 = 0.2 cos(t): a fractal border, to which motions stay near for many periods."""
    cubic = Contact("spring", {"x": 1.0}, (Stage(0.0, 0.0, 1.0),))
    push = Harmonic(0.2, {"x": 1.0})
    system = System(("x",), [[-1.0]], [[0.15]], contacts=[cubic], harmonics=[push], frequency=1.0)
    found = basins(system, {"x": (-2.2, 2.2), "x'": (-2.2, 2.2)}, 30, **in_process(check=256))
    assert found.check.border_wrong > 50
    assert 0 < found.check.shifted_wrong < 0.1 * found.check.shifted
    assert 0.0 < found.check.share < 0.1
    assert "rounding decides" in found.check.text


def test_motions_that_run_away_have_a_label_of_their_own():
    """A softening spring, x'' + 0.2 x' + x - x^3 = 0.1: saddles at x = -1.05 and 0.95, beyond which all is lost."""
    soft = Contact("spring", {"x": 1.0}, (Stage(0.0, 0.0, -1.0),))
    system = System(("x",), [[1.0]], [[0.2]], contacts=[soft], mean={"x": 0.1}, frequency=1.0)
    found = basins(system, {"x": (-2.0, 2.0), "x'": (-0.1, 0.1)}, (8, 1), **in_process())
    assert found.labels[0].tolist() == [RUNAWAY, RUNAWAY, 0, 0, 0, 0, RUNAWAY, RUNAWAY]
    assert found.runaway == 4
    assert "diverges: 4" in repr(found)


def test_ctrl_c_keeps_what_is_done():
    def stop(chunk, pace):
        assert pace.done == 1
        raise KeyboardInterrupt

    found = until_ctrl_c(basins, double_well(), WELLS, (100, 50), **in_process(), report=stop)
    assert not found.complete
    assert found.notes == ("stopped when 4096 of 5000 states were done",)
    assert 904 - 64 <= found.unresolved <= 904  # some of the others were looked at before
    assert found.check.limit == 1.0


def test_cells_at_borders():
    labels = np.array([[0, 0, 0], [0, 0, 1], [0, 0, 0]])
    beside = beside_cells(3, 3)
    borders = differs(labels.ravel(), beside)
    assert borders.reshape(3, 3).astype(int).tolist() == [[0, 0, 1], [0, 1, 1], [0, 0, 1]]
    assert about(labels.ravel() == 1, beside).tolist() == borders.tolist()


def test_random_states_are_beside_those_nearest_in_units_of_their_ranges():
    """A grid of 5 x 4, its second component a million times as wide; a third one is the same for all."""
    places = np.array([(i, j) for i in range(5) for j in range(4)])
    states = np.column_stack((places[:, 0] / 4.0, 1e6 * places[:, 1] / 3.0, np.full(20, 7.0)))
    random = np.random.default_rng(1).permutation(20)
    beside = beside_states(states[random])
    for state, others in zip(places[random], places[random][beside], strict=True):
        if state[0] in (1, 2, 3) and state[1] in (1, 2):
            assert {tuple(step) for step in (others - state).tolist()} == {(1, 0), (-1, 0), (0, 1), (0, -1)}
    assert beside_states(states[:1]).shape == (1, 0)
    assert not differs(np.zeros(1, dtype=int), beside_states(states[:1])).any()


def test_the_error_of_the_picture_is_that_of_cells_that_were_not_checked():
    assert BasinCheck(1000, 100, 50, 5, 90, 0).share == pytest.approx(50 * 0.1 / 1000)
    assert BasinCheck(1000, 100, 100, 7, 900, 3).limit == 0.0
    inner = 1.0 - 0.025 ** (1.0 / 90.0)  # the limit after 90 checks without a wrong one, in closed form
    assert BasinCheck(1000, 0, 0, 0, 90, 0).limit == pytest.approx(inner * 910 / 1000)
    assert BasinCheck(1000, 1000, 1000, 7, 0, 0, 100, 3).share == pytest.approx(0.03)  # which rounding decides
    assert BasinCheck(1000, 1000, 1000, 7, 0, 0, 90, 0).limit == pytest.approx(inner * 910 / 1000)
    assert BasinCheck(24, 0, 0, 0, 24, 0, 24, 0).limit == 0.0


def test_attractors_stand_in_an_order_of_their_own(clutch_basins):
    one, three = clutch_basins.attractors
    labels = np.array([0, 0, 1, UNRESOLVED, RUNAWAY])
    ordered, renamed = in_order((three, one), labels)
    assert ordered == (one, three)
    assert renamed.tolist() == [1, 1, 0, UNRESOLVED, RUNAWAY]
    assert attractor_names((one, three, three)) == ("period 1", "period 3a", "period 3b")


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: basins(double_well(), WELLS, 0), "resolution is 0; write a number of cells"),
        (lambda: basins(double_well(), WELLS, (3, 2.5)), "resolution is"),
        (lambda: basins(double_well(), {"x": (-1, 1)}), "a plane has two axes"),
        (lambda: basin_shares(double_well(), {"x": 1.0}), "all components of the box are fixed"),
        (lambda: basin_shares(double_well(), WELLS, 0), "starts is 0"),
        (lambda: basin_shares(double_well(), WELLS, confidence=1.0), "confidence is 1.0; it must lie between"),
        (lambda: BasinOptions(longest=0), "longest is 0; it must be an integer >= 1"),
    ],
)
def test_what_makes_no_sense_is_refused(call, words):
    with pytest.raises(ModelError, match=words):
        call()

"""Run-ups of files laid over their response: the delay of a jump, orders, tables, and what is refused."""

import io

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.studies.export import table_of

STOP = """
coordinates = ["x"]
mass = [1.0]
damping = [0.1]
stiffness = [1.0]

[[contact]]
name = "wall"
deflection = { x = 1.0 }
clearance = 1.0
stiffness = 1.0

[[harmonic]]
amplitude = 0.25
acts_on = { x = 1.0 }

[study]
kind = "run-up"
from = 0.9
to = 1.3
"""


def found(more: str):
    return gw.run(gw.read_study(io.StringIO(STOP + more))).finding


@pytest.fixture(scope="module")
def laid_over():
    return found("rate = 0.0016\nwith_response = true\norders = 4\nsamples = 64\n")


def test_a_jump_is_later_the_faster_the_run_up(laid_over):
    """Behind a fold, the shift of the jump grows with the rate to the power 2/3 (Haberman 1979)."""
    slow = laid_over.found
    (delay,) = laid_over.delays
    fold = next(each for each in laid_over.response.branch.special("fold") if each.value == delay.fold)
    assert fold.point.measure("half.x") > 1.0  # the upper one
    slower = gw.ask.run_up(slow.system, gw.ask.SpeedCourse.ramp(1.0, 1.25, 0.0002), samples=64)
    (later,) = slower.delays(laid_over.response.branch, "x")
    assert delay.delay == pytest.approx((delay.jump - delay.fold) / 0.0016, rel=1e-6)
    assert (delay.jump - delay.fold) / (later.jump - later.fold) == pytest.approx(4.0, rel=0.25)


def test_tables_of_jumps_and_orders(laid_over):
    tables = laid_over.tables()
    assert list(tables["jumps"]())[1] == [*laid_over.delays[0]]
    rows = list(tables["orders"]())
    assert rows[0][0] == "frequency"
    orders = np.array([float(text.removeprefix("order ")) for text in rows[0][1:]])
    numbers = np.array(rows[1:], dtype=float)
    assert orders[1:][numbers[:, 2:].argmax(axis=1)] == pytest.approx(1.0)  # the order of the load
    assert any("after the fold" in line for line in map(str, laid_over.summary()))
    assert table_of(laid_over, "order-cuts").splitlines()[1].endswith(",")  # without units, no level in a band of Hz
    assert laid_over.document(False)["jumps"][0]["fold"] == laid_over.delays[0].fold


def test_a_run_up_that_never_reached_the_fold_has_no_delay(laid_over):
    fast = gw.ask.run_up(laid_over.found.system, gw.ask.SpeedCourse.ramp(0.9, 1.3, 0.02), samples=64)
    (delay,) = fast.delays(laid_over.response.branch, "x")
    assert np.isnan(delay.jump)
    assert delay.words(fast.system).startswith("no jump")


@pytest.mark.parametrize(
    ("more", "word"),
    [
        ("rate = [0.01, 0.02]\norders = 4\n", "single run-up"),
        ("rate = 0.01\norders = 9\nsamples = 16\n", "samples = 18"),
        ("rate = 0.4\norders = 4\n", "window"),
        ("rate = 0.01\norders = -1\n", "orders"),
        ("rate = 0.01\nwith_response = 3\n", "with_response"),
    ],
)
def test_what_has_no_orders_is_refused(more, word):
    with pytest.raises(gw.errors.ModelError, match=word):
        gw.read_study(io.StringIO(STOP + more))


def test_samples_resolve_the_level_of_rattle_at_the_lowest_speed():
    text = """
    speed = "800 rpm"
    inertia = [{ name = "a", inertia = "1 kg m^2" }, { name = "b", inertia = "1 kg m^2" }]
    shaft = [{ name = "s", between = ["a", "b"], stiffness = "100 N m/rad" }]
    harmonic = [{ order = 0.5, amplitude = "1 N m", acts_on = { a = 1.0 } }]
    study = { kind = "run-up", from = "600 rpm", to = "900 rpm", rate = "30 rpm/s", orders = 4 }
    """
    study = gw.read_study(io.StringIO(text))
    assert study.options.sampling(study.system) / 2 * 600.0 / 60.0 / 2 >= 5000.0

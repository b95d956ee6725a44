"""Campbell diagrams: train A of the reference, whose modes and crossings were computed by matrices of its own."""

import functools
import math
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

import gapwalk as gw
from gapwalk.errors import ModelError
from gapwalk.explorer.answer_view import AnswerView
from gapwalk.model.mode_states import loose_gears, mode_states
from gapwalk.plot import draw

FILE = Path(__file__).parents[1] / "data/train_a.toml"
LOOSE = "mesh1, mesh2, mesh3 and mesh5 open"
REFERENCE = {  # Hz
    "all closed, friction slips": [5.815, 21.892, 61.431, 705.375, 1312.0, 1750.5, 2164.6, 2801.1],
    "all closed, friction sticks": [6.291, 35.500, 64.809, 705.5],
    f"{LOOSE}, friction slips": [5.831, 22.232, 67.344, 897.2],
    f"clutch within its gap, {LOOSE}, friction slips": [1.036, 21.099, 29.225, 893.05],
}


@functools.cache
def train_a() -> gw.System:
    """Nine inertias, four loose gears, a two-stage clutch with friction."""
    return gw.read_model(str(FILE))


@pytest.fixture(scope="module")
def found():
    return gw.ask.campbell(train_a(), "speed", (400.0, 1500.0), points=4)


def test_the_modes_of_train_a_in_each_state(found) -> None:
    assert [each.text for each in found.states] == [*REFERENCE]
    for values, modes in zip(REFERENCE.values(), found.frequencies, strict=True):
        np.testing.assert_allclose(modes[: len(values)], np.array(values)[:, None] * np.ones(4), rtol=1e-4)


def test_modes_are_numbered_alike_everywhere() -> None:
    """The goal of a design, the crossings and the command of modes begin with the slowest vibration."""
    modes = gw.find_modes(train_a(), "closed")
    assert modes.numbers.tolist()[:3] == [0, 1, 2]
    speed = gw.ask.Resonance(2, above=1.0, order=2.0, at="closed").value(train_a())
    assert speed == pytest.approx(modes.frequencies[2] / math.tau / 2.0 * 60.0)


def test_the_crossings_of_train_a(found) -> None:
    places = {(each.state, each.order, each.mode): each.value for each in found.crossings}
    slips, sticks = list(REFERENCE)[:2]
    for key, rpm in {(slips, 4, 3): 921, (slips, 2, 2): 657, (sticks, 2, 2): 1065, (sticks, 4, 3): 972}.items():
        assert places[key] == pytest.approx(rpm, abs=0.6)
    for each in found.crossings:
        assert each.frequency == pytest.approx(each.order * each.value / 60.0, rel=1e-9)
    assert found.ray(2.0)[0] == pytest.approx(2.0 * 400.0 / 60.0)


def test_the_record_tells_tables_and_picture(found) -> None:
    assert "13 crossings of orders 2, 4, 6 with modes of 4 states" in str(found.summary())
    rows = [*found.tables()["crossings"]()]
    assert len(rows) == 14
    assert rows[0] == ["state", "order", "mode", "natural_frequency", "speed"]
    figure = Figure(figsize=(8, 5.6))
    draw(found, figure=figure)
    (ax,) = figure.axes
    assert ax.get_ylabel() == "frequency [Hz]"


def test_the_page_draws_it_in_the_main_diagram(found) -> None:
    content = AnswerView(found).content()
    assert content["axes"] == ("speed", "natural_frequency")
    assert content["quantities"] == [{"name": "natural_frequency", "words": "natural frequency [Hz]"}]
    layers = content["layers"]
    assert {tuple(each["axes"]) for each in layers} == {("speed", "natural_frequency")}
    assert sum(len(each["x"]) for each in layers if each["mark"] == "dots") == len(found.crossings)
    assert [each["notes"][1] for each in layers if "notes" in each] == ["order 2", "order 4", "order 6"]


def test_a_gear_is_loose_if_no_load_acts_behind_its_teeth() -> None:
    system = train_a()
    names = [form.name for form in system.structure.contacts]
    assert [names[place] for place in loose_gears(system)] == ["mesh1", "mesh2", "mesh3", "mesh5"]
    loaded = system.at({"mean.gear3": -1.0})
    assert "mesh3" not in [names[place] for place in loose_gears(loaded)]


def test_a_system_without_gears_has_its_contacts_open_and_closed() -> None:
    """Two masses on walls: their frequencies are those of springs in parallel."""
    stops = [
        gw.stop(name, {f"x{k}": 1.0}, clearance=0.1, stiffness=stiff)
        for k, (name, stiff) in enumerate((("a", 3.0), ("b", 8.0)), 1)
    ]
    system = gw.System(
        ["x1", "x2"], mass=[1.0, 1.0], damping=[0.1, 0.1], stiffness=[1.0, 1.0], contacts=stops,
        harmonics=[gw.Harmonic(0.1, {"x1": 1.0})], frequency=1.0,
    )  # fmt: skip
    modes = {state.text: gw.find_modes(system, state).frequencies for state in mode_states(system)}
    assert modes["all closed"] == pytest.approx([2.0, 3.0])
    assert modes["all open"] == pytest.approx([1.0, 1.0])
    assert modes["a within its gap"] == pytest.approx([1.0, 3.0])
    found = gw.ask.campbell(system, "frequency", (0.5, 4.0), orders=(1.0, 2.0))
    assert {(each.order, round(each.value, 9)) for each in found.crossings if each.state == "all closed"} == {
        (1.0, 2.0), (1.0, 3.0), (2.0, 1.0), (2.0, 1.5),
    }  # fmt: skip


def test_a_stiffness_that_grows_with_the_speed_bends_the_modes() -> None:
    """Two discs, k + a W^2 between them: order n meets their mode where n^2 W^2 = 2 (k + a W^2) / J."""
    parts, k, a = gw.train, 4.0, 0.2
    train = parts.Train(
        [parts.Inertia("first", 1.0), parts.Inertia("second", 1.0)],
        [parts.Shaft("shaft", ("first", "second"), stiffness=k, damping=0.01)],
        forces=[parts.Force("pull", ("first", "second"), "a*W**2*x", a=a)],
        harmonics=[gw.Harmonic(0.1, {"first": 1.0})],
        frequency=1.0,
    )
    found = gw.ask.campbell(train.system(), "frequency", (0.5, 5.0), orders=(1.0, 2.0), points=8)
    wanted = [math.sqrt(2.0 * k / (order**2 - 2.0 * a)) for order in (1.0, 2.0)]
    assert [each.value for each in found.crossings] == pytest.approx(wanted, rel=1e-10)


def test_it_is_over_the_speed() -> None:
    with pytest.raises(ModelError, match=r'parameter is "mesh4\.stiffness"; .*write parameter = "speed"'):
        gw.ask.campbell(train_a(), "mesh4.stiffness", (1e4, 1e5))

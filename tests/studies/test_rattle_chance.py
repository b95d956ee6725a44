"""The probability of rattle in production: a closed form, resume, workers, trains, and what is refused."""

import io
import math
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure
from scipy.stats import norm

import gapwalk as gw
from gapwalk.answers.tolerance import SpreadLaw
from gapwalk.errors import ModelError
from gapwalk.model.model_source import parse_source
from gapwalk.plot import draw
from gapwalk.studies import rattle_chance
from gapwalk.studies.study_file import check_study
from tests.interruption import until_ctrl_c
from tests.tiers import keeps

LAW = {"m": 1.0, "c": 0.4, "k": 1.0, "kc": 3.0, "a": 0.2, "w": 1.2}
MEAN, SD = 0.35, 0.1
MODEL = """
title = "A mass pressed against a stop"
coordinates = ["x"]
stiffness = [1.0]
damping = [0.4]
mean = { x = 0.35 }
frequency = 1.2

[[contact]]
name = "stop"
deflection = { x = 1.0 }
clearance = 1e-9
side = "positive"
stiffness = 3.0

[[harmonic]]
amplitude = 0.2
acts_on = { x = 1.0 }

[study]
kind = "rattle-chance"
samples = 24
seed = 3
workers = 1
spread = [{ parameter = "mean.x", sd = 0.1 }]
"""
GEARS = Path(__file__).parents[1] / "data/train_a.toml"


def system() -> gw.System:
    return check_study(parse_source(MODEL)).system


def spread() -> gw.ask.Spread:
    return gw.ask.Spread("mean.x", sd=SD, mean=MEAN)


def least_preload(frequency: float) -> float:
    """The stop stays closed if the mean deflection exceeds the amplitude of the glued system: preload > a k T."""
    stiff = 1.0 + 3.0
    return 0.2 * stiff / math.hypot(stiff - frequency**2, 0.4 * frequency)


def test_a_law_with_values_that_its_parameter_cannot_have_is_a_doubt() -> None:
    whole = check_study(parse_source(MODEL.replace('"mean.x"', '"stop.clearance"')))
    assert "about 50 % of all parts have a value that is not allowed" in whole.doubts[-1]
    assert not check_study(parse_source(MODEL)).doubts


def test_the_probability_is_that_of_the_closed_form() -> None:
    found = gw.ask.rattle_chance(system(), [spread()], values=[1.2], samples=200, workers=1)
    for value in found.values:
        preload, codes = found.samples[:, 0], found.at("stop", value)[0]
        # a preload that is too small opens the stop; one below minus that keeps it open
        limit = least_preload(value)
        kept_open = preload < -0.2 / math.hypot(1.0 - value**2, 0.4 * value)
        far = np.abs(preload / limit - 1.0) > 2e-3  # nearer ones are within the error of the integrator
        np.testing.assert_array_equal((codes >= 5)[far], ((preload < limit) & ~kept_open)[far])
        exact = norm.cdf(limit, MEAN, SD)
        chance = found.chance("stop", value)
        assert chance.low <= exact <= chance.high
        assert chance.samples == 200


def test_the_answer_names_what_matters_and_is_drawn() -> None:
    found = gw.ask.rattle_chance(system(), [spread()], values=[1.0, 1.2], samples=60, seed=1, workers=1)
    text = str(found.summary())
    chance = found.chance("stop", 1.2)
    assert f"stop rattles at Ω = 1.2 in {100 * chance.value:.3g} % of all parts" in text
    assert "% with 95 % confidence, 60 samples)" in text
    assert "mean.x -" in text  # less preload, more acceleration
    heads, *rows = [*found.tables()["chances"]()]
    assert heads[:3] == ["gap", "frequency", "samples"]
    assert [row[:2] for row in rows] == [["stop", 1.0], ["stop", 1.2]]
    assert len([*found.tables()["samples"]()]) == 1 + 2 * 60
    for record in (found, gw.ask.rattle_chance(system(), [spread()], samples=20, workers=1)):
        figure = Figure()
        draw(record, figure=figure)
        (ax,) = figure.axes
        assert ax.lines


@keeps("2")
@pytest.mark.parametrize("workers", [1, 2])
def test_a_stopped_run_continues_to_the_same_bytes(tmp_path, monkeypatch, workers) -> None:
    monkeypatch.setattr(rattle_chance, "CHUNK", 8)
    whole, file = tmp_path / "whole.gapwalk", tmp_path / "part.gapwalk"
    gw.ask.rattle_chance(system(), [spread()], samples=24, starts=2, seed=3, workers=1, output=whole)

    def press(*_: object) -> None:
        raise KeyboardInterrupt

    stopped = until_ctrl_c(
        gw.ask.rattle_chance, system(), [spread()], samples=24, starts=2, seed=3, workers=1, report=press, output=file
    )
    assert len(stopped.samples) == 8
    assert not stopped.complete
    assert "stopped when 8 samples were done" in stopped.notes
    again = gw.ask.rattle_chance(system(), [spread()], samples=24, starts=2, seed=3, workers=workers, output=file)
    first = gw.open_result(whole)
    for name in ("samples", "codes", "rms"):
        assert getattr(again, name).tobytes() == getattr(first, name).tobytes()


def test_gears_are_judged_by_equal_steps() -> None:
    train = gw.read_model(str(GEARS))
    laws = [gw.ask.Spread("bearing1.linear", sd=0.2 * train["bearing1.linear"])]
    found = gw.ask.rattle_chance(train, laws, values=[1000.0], gaps=["mesh1", "mesh2"], samples=16, workers=1)
    assert found.names == ("mesh1", "mesh2", "any gap")
    drag, (codes, rms) = found.samples[:, 0], found.at("mesh1", 1000.0)
    # more drag pulls harder at the loose gear: at this speed it rattles above a limit, and is louder then
    assert 0 < np.sum(codes >= 5) < 16
    assert abs(np.corrcoef(drag, codes >= 5)[0, 1]) > 0.5
    assert found.chance("any gap", 1000.0).value >= found.chance("mesh1", 1000.0).value
    assert rms[codes >= 5].mean() > rms[codes < 5].mean()
    assert "rad/s^2" in str(found.summary())


def test_accelerations_of_other_units_are_not_compared() -> None:
    inertia = 'name = "gear1"\ninertia = "0.0034 kg m^2"\n'
    train = gw.read_model(io.StringIO(GEARS.read_text().replace(inertia, inertia + 'radius = "50 mm"\n')))
    laws = [gw.ask.Spread("mesh1.clearance", sd=0.05 * train["mesh1.clearance"])]
    found = gw.ask.rattle_chance(train, laws, values=[900.0], gaps=["mesh1", "mesh2"], samples=4, workers=1)
    assert [found.unit(name) for name in found.names] == ["m/s^2", "rad/s^2", ""]
    assert np.isnan(found.at("any gap", 900.0)[1]).all()
    figure = Figure()
    draw(found, figure=figure)
    assert len(figure.axes) == 2


def test_parts_without_an_answer_do_not_count() -> None:
    """A negative clearance is refused, negative damping diverges."""
    laws = [gw.ask.Spread("stop.clearance", SpreadLaw.UNIFORM, low=-0.1, high=0.1)]
    found = gw.ask.rattle_chance(system(), laws, samples=20, workers=1)
    refused = int(np.sum(found.samples[:, 0] < 0.0))
    assert found.chance("stop", 1.2).samples == 20 - refused
    assert f"{refused} samples do not count, because the model does not allow their values" in found.notes
    grown = gw.ask.rattle_chance(
        system(), [gw.ask.Spread("damping.x.x", SpreadLaw.UNIFORM, low=-0.9, high=-0.5)], samples=4, workers=1
    )
    assert grown.chance("stop", 1.2).samples == 0
    assert "4 samples do not count for a gap, because a motion diverges" in grown.notes
    assert "in an unknown share of all parts" in str(grown.summary())


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (("samples = 24", "samples = 1"), "samples"),
        (("samples = 24", 'gaps = ["stpo"]'), "did you mean"),
        (("samples = 24", "values = [-1.0]"), "frequency"),
        (("samples = 24", 'values = ["fast"]'), "values"),
        (('spread = [{ parameter = "mean.x", sd = 0.1 }]', ""), "write tables"),
        (('"mean.x", sd', '"frequency", sd'), "it cannot have a spread as well"),
        (('"mean.x", sd', '"mean.y", sd'), "mean.y"),
    ],
)
def test_bad_input_teaches(change, words) -> None:
    with pytest.raises(ModelError, match=words):
        check_study(parse_source(MODEL.replace(*change)))

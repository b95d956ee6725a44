"""The picture of a model: forces, measured points, what varies over the angle, and loads, with their units."""

from pathlib import Path

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.cli import main
from gapwalk.plot.picture import picture_of

EXAMPLES = Path(__file__).parents[2] / "examples"


def drawn(name: str, **options):
    return picture_of(gw.read_study(EXAMPLES / name).system, **options).axes


def test_a_panel_for_each_force_each_number_that_varies_and_the_loads():
    labels = [(ax.get_xlabel(), ax.get_ylabel()) for ax in drawn("mesh.toml") if ax.get_visible() and ax.axison]
    assert labels == [
        ("deflection of mesh", "force"),
        ("angle of the excitation [deg]", "stiffness of mesh"),
        ("angle of the excitation [deg]", "displacement in mesh"),
    ]


def test_axes_of_a_train_have_its_units_and_its_measured_points():
    x = np.array([-10.0, 0.0, 17.0])
    axes = drawn("engine.toml", points={"clutch": (x, x)})
    assert axes[0].get_xlabel() == "deflection of clutch [deg]"
    assert axes[0].get_ylabel() == "torque [N m]"
    assert axes[0].get_xlim()[1] < 18.5  # no farther than what was measured
    points = [line for line in axes[0].lines if len(line.get_xdata()) == 3]
    assert points
    assert np.array_equal(points[0].get_xdata(), x)
    assert axes[2].get_xlabel() == "angle of the shaft [deg]"
    assert axes[2].get_ylabel() == "torque on engine [N m]"


@pytest.mark.slow
def test_check_draws_the_model_and_tells_of_its_curves(tmp_path, capsys):
    picture = tmp_path / "engine.svg"
    assert main(["check", str(EXAMPLES / "engine.toml"), "--picture", str(picture)]) == 0
    text = capsys.readouterr().out
    assert "curve of clutch: linear, 4 corners, within 0.4 % of the largest force at 109 points" in text
    assert "measured points" in picture.read_text(encoding="utf-8")


def test_a_model_without_contacts_and_loads_shows_its_machine_alone():
    (ax,) = picture_of(gw.System(["x"], [[1.5]])).axes
    assert [text.get_text() for text in ax.texts] == ["1.5", "x"]

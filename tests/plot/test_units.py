"""Pictures of a drive train with units: what stands at their axes, and in which units their values are."""

from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib import pyplot as plt

import gapwalk as gw
from gapwalk.model.words import measure_words, parameter_symbol, parameter_words, value_words
from gapwalk.plot import draw

EXAMPLE = Path(__file__).parents[2] / "examples" / "drivetrain.toml"


@pytest.fixture(scope="module")
def orbit() -> gw.Orbit:
    """The example at 1,600 rpm."""
    return gw.find_orbit(
        gw.read_study(EXAMPLE, name="load").system.at({"speed": "1600 rpm", "mean.flywheel": "20 N m"})
    )


def test_words_have_units_where_there_are_some(orbit) -> None:
    units = orbit.system.units
    assert parameter_words("speed", units) == "speed [rpm]"
    assert parameter_words("mean.flywheel", units) == "mean torque on flywheel [N m]"
    assert parameter_words("clutch.stage2.clearance", units) == "clearance of stage 2 of clutch [deg]"
    assert parameter_symbol("firing.phase", units) == "firing.phase [deg]"
    assert parameter_symbol("firing.acts_on.flywheel", units) == "firing.acts_on.flywheel"
    assert measure_words("max.gearbox''", units) == "maximum of gearbox'' [rad/s^2]"
    assert measure_words("rms.clutch.torque", units) == "root mean square of the torque of clutch [N m]"
    assert value_words(1500.0, "speed", units) == "speed = 1500 rpm"
    assert (parameter_words("frequency"), parameter_symbol("frequency")) == ("excitation frequency Ω", "Ω")


def test_axes_of_a_branch_are_in_rpm_and_deg(orbit) -> None:
    branch = gw.follow(orbit, "speed", to=1650.0)
    figure, ax = plt.subplots()
    draw([branch], "half.clutch", ax=ax, legend=False, closeup=False)
    assert ax.get_xlabel() == "speed [rpm]"
    assert ax.get_ylabel() == "amplitude of clutch (half the peak to peak) [deg]"
    low, high = ax.get_xlim()
    assert 1590.0 < low < 1600.0
    assert 1650.0 < high < 1660.0
    plt.close(figure)


def test_histories_are_in_the_units_at_their_axes(orbit) -> None:
    figure, axes = plt.subplots(1, 3)
    motion = orbit.motion()
    for ax, signal, label in zip(axes, ("gearbox''", "clutch"), ("gearbox'' [rad/s^2]", "clutch [deg]"), strict=False):
        draw(motion, signal, ax=ax)
        assert ax.get_ylabel() == label
        np.testing.assert_array_equal(ax.get_lines()[0].get_ydata(), motion.signal(signal))
    draw(motion, contact="clutch", ax=axes[2])
    assert (axes[2].get_xlabel(), axes[2].get_ylabel()) == ("deflection of clutch [deg]", "force of clutch [N m]")
    plt.close(figure)


def test_a_velocity_has_one_unit_as_a_state_and_as_a_signal(orbit) -> None:
    units, place = orbit.system.units, orbit.system.coordinates.index("clutch")
    assert units.signal("clutch'") == (1.0, units.state("clutch'")) == (1.0, "deg/s")
    velocity = orbit.motion().signal("clutch'")
    assert velocity[0] == pytest.approx(orbit.state[len(orbit.state) // 2 + place])
    slope = np.gradient(orbit.motion().signal("clutch"), orbit.motion().time)
    assert np.median(np.abs(slope - velocity)) < 0.02 * np.abs(velocity).max()  # deg over s, indeed


def test_a_settled_motion_is_told_at_its_speed() -> None:
    mpl.use("Agg")
    settled = gw.settle(gw.read_study(EXAMPLE, name="load").system, speed=2500.0)
    figure = draw(settled, "gearbox''").figure
    assert figure.get_suptitle() == "Motion of period 1 at speed = 2500 rpm"
    labels = {" ".join(ax.get_ylabel().split()) for ax in figure.axes}
    assert {"gearbox'' [rad/s^2]", "amplitude of gearbox'' [rad/s^2]"} <= labels
    assert {"clutch' [deg/s]", "force of clutch [N m]"} <= labels
    plt.close("all")

"""Pictures over the distance from a special point, in other colours and fonts; what an orbit and a locus say."""

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.colors import to_rgba

import gapwalk as gw
from tests.computed import once

DAMPING, OMEGA = 0.1, 1.6


@once
def beyond_graze() -> gw.Branch:
    """A branch across the graze of a soft stop, whose linear motion is known below it."""
    system = gw.System(
        ["x"],
        mass=[[1.0]],
        stiffness=[[1.0]],
        damping=[[DAMPING]],
        contacts=[gw.stop("stop", {"x": 1.0}, 1.0, 5.0)],
        harmonics=[gw.Harmonic(1.0, {"x": 1.0})],
        frequency=OMEGA,
    )
    return gw.follow(gw.find_orbit(system), "harmonic1.amplitude", (0.5, 2.5))


GRAZE = abs(1.0 - OMEGA**2 + 1j * DAMPING * OMEGA)  # the linear motion has the amplitude 1 there


def test_distances_below_a_graze_are_those_of_the_linear_motion() -> None:
    branch = beyond_graze()
    below = branch.distances("below grazing 1")
    known = ~np.isnan(below)
    assert known.any()
    assert not known.all()
    np.testing.assert_allclose(below[known], GRAZE * (1.0 - branch.measure("max.x")[known]), rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(branch.distances(f"distance from {GRAZE!r}")[known], below[known], atol=1e-11)
    ax = branch.plot("max.x", x="below grazing 1", labels=False)
    assert ax.get_xscale() == "log"
    assert ax.get_xlabel().startswith(f"{GRAZE:.9f}")
    across, up = (np.concatenate([line.get_data()[k] for line in ax.lines]) for k in (0, 1))
    drawn = np.isfinite(across)
    np.testing.assert_allclose(across[drawn], GRAZE * (1.0 - up[drawn]), rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("text", ["above grazing 7", "beyond grazing 1", "above hopf 1", "above x", "below 0.1"])
def test_a_distance_that_is_none_is_refused_with_those_that_are(text: str) -> None:
    with pytest.raises(gw.errors.ModelError, match=r"there are grazing 1|no point lies on this side|no kind of"):
        beyond_graze().plot(x=text)


def test_the_orbits_at_a_value_are_on_the_linear_motion() -> None:
    (orbit,) = beyond_graze().orbits_at(0.75 * GRAZE)
    assert orbit.measure("max.x") == pytest.approx(0.75, abs=1e-10)


def test_colours_lines_and_fonts_are_keywords() -> None:
    look = {"stable": {"c": "tab:red", "ls": ":"}, "font.family": "serif", "grazing": {"color": "lime"}}
    ax = beyond_graze().plot("max.x", style=look)
    assert (ax.lines[0].get_color(), ax.lines[0].get_linestyle()) == ("tab:red", ":")
    assert ax.xaxis.label.get_family() == ["serif"]
    with pytest.raises(gw.errors.ModelError, match="no style 'steady'"):
        beyond_graze().plot(style={"steady": {}})
    with gw.plot.styled({"period 1": {"color": "blue"}}):
        diagram = gw.diagram(beyond_graze().system, "harmonic1.amplitude", (0.5, 0.6), max_period=1, workers=1)
        drawn = diagram.plot("max.x", labels=False)
    assert {to_rgba(line.get_color()) for line in drawn.lines} == {to_rgba("blue")}
    assert drawn.figure.axes[0] is drawn


def test_an_orbit_is_verified_and_a_wrong_one_is_not() -> None:
    orbit = beyond_graze().points[-1].orbit
    found = gw.verify(orbit)
    assert found.ok
    assert (found.points, len(found.summaries) >= 6) == (1, True)
    wrong = gw.verify(replace(orbit, state=orbit.state + 1e-6))
    assert "closure" in {each.check.word for each in wrong.breaches}


def test_an_orbit_without_contacts_says_so() -> None:
    linear = gw.System(
        ["x"], mass=[[1.0]], stiffness=[[1.0]], damping=[[0.1]], harmonics=[gw.Harmonic(0.5, {"x": 1.0})]
    )
    assert "contacts none, state" in repr(gw.find_orbit(linear, frequency=0.5))


def test_a_locus_has_a_summary_and_tables() -> None:
    branch = beyond_graze()
    locus = gw.follow_locus(branch.special("grazing")[0], "harmonic1.amplitude", "frequency", ((0.1, 5.0), (1.5, 1.8)))
    assert "grazing: period 1 of stop +; " in str(locus.summary())
    table = locus.to_xarray()["points"]
    omega = table["frequency"].to_numpy()
    right = np.abs(1.0 - omega**2 + 1j * DAMPING * omega)
    np.testing.assert_allclose(table["harmonic1.amplitude"], right, rtol=1e-9)


def test_a_motion_has_all_its_signals_as_labelled_arrays() -> None:
    motion = gw.integrate(beyond_graze().system, np.array([0.0, 2.0]), 2)
    tree = motion.to_xarray()
    for name, values in {"x": motion.q[:, 0], "x'": motion.v[:, 0], "stop.force": motion.forces[:, 0]}.items():
        np.testing.assert_array_equal(tree["signals"][name], values)
    assert tree["signals"][name].dims == ("theta",)
    assert tree["contacts"].sizes["contacts"] == len(motion.contacts)

"""The pictures of basins and of regime maps: what is drawn, and what the legend says."""

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.image import AxesImage

import gapwalk as gw
from gapwalk.attractors import classify
from gapwalk.attractors.basins import BasinCheck, Basins, Window
from gapwalk.attractors.regimes import Regime, RegimeCheck, Regimes
from gapwalk.bifurcation import Kind, follow
from gapwalk.bifurcation.loci import follow_locus
from gapwalk.errors import ModelError
from gapwalk.orbit import find_orbit
from gapwalk.plot import draw
from gapwalk.plot.picture import picture_of
from tests.systems import clutch, far_and_near


@pytest.fixture(scope="module")
def basins():
    system = clutch(frequency=1.5)
    attractor = classify(system)
    window = Window.of(system, {"q1": (-2.0, 2.0), "q1'": (-1.0, 1.0)}, {})
    labels = np.array([[0, 1, -1], [0, 0, -2]])
    return Basins(system, window, labels, (attractor, attractor), BasinCheck(6, 4, 4, 1, 2, 0))


@pytest.fixture(scope="module")
def chart():
    rows, columns = 2, 6
    regimes = np.full((rows, columns), int(Regime.PERIODIC))
    periods = np.tile([1, 2, 3, 12, 0, 0], (rows, 1))
    regimes[:, 4:] = (Regime.QUASI_PERIODIC, Regime.CHAOTIC)
    forces = np.arange(12.0).reshape(rows, columns, 1)
    return Regimes(
        clutch(), "frequency", "harmonic1.amplitude", ((0.4, 1.0), (0.0, 0.4)), regimes, periods,
        np.full((rows, columns), np.nan), forces, forces / 10, np.zeros((rows, columns, 4)), RegimeCheck(5, ("...",)),
    )  # fmt: skip


def test_periodic_cells_are_labelled_by_their_impacts(chart):
    assert chart.z[0].tolist() == ["0/1", "0/2", "1/3", "4/12", "", ""]  # 0, 0.1, 0.2 and 0.3 a period
    assert [row[-1] for row in chart.tables()["cells"]()][1:4] == ["0/1", "0/2", "1/3"]
    figure = picture_of(chart, labels="z", panels=())
    assert legend_of(figure)[:3] == ["z = 0/1", "z = 1/1", "z = 0/2"]
    assert legend_of(figure)[-2:] == ["quasi-periodic", "chaotic"]
    with pytest.raises(ModelError, match='write "period", or "z"'):
        draw(chart, labels="number", panels=())


def legend_of(figure: Figure) -> list[str]:
    (legend,) = figure.legends
    return [text.get_text() for text in legend.get_texts()]


def image_of(ax) -> AxesImage:
    (image,) = ax.images
    return image


def test_each_cell_has_the_colour_of_its_attractor(basins):
    figure = picture_of(basins, title="A title", strobes="all")
    (ax,) = figure.axes
    image = image_of(ax)
    colors = image.cmap(image.norm(image.get_array()))
    assert image.get_extent() == [-2.0, 2.0, -1.0, 1.0]
    assert image.origin == "lower"
    assert len({tuple(color) for color in colors.reshape(-1, 4)}) == 4
    assert tuple(colors[0, 0]) == tuple(colors[1, 1]) != tuple(colors[0, 1])
    assert legend_of(figure) == [
        "period 1a (50.0 %)", "period 1b (16.7 %)", "diverges (17 %)", "unresolved (17 %)", "orbit of period 1a",
        "orbit of period 1b",
    ]  # fmt: skip
    assert figure.legends[0].get_title().get_text() == (
        "exact at all borders; elsewhere 0 of 2 cells differed from the exact flow"
    )
    assert ax.get_title(loc="left") == "A title"
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("q1 at the start", "q1' at the start")


def test_only_strobes_in_the_plane_are_marked_unless_all_are_wanted(basins):
    assert not draw(basins).lines  # q3 is 0 in the plane, but not on the orbit
    marked = draw(basins, strobes="all").lines
    state = basins.attractors[0].state
    assert [line.get_xydata()[0].tolist() for line in marked] == [[state[0], state[2]]] * 2
    window = Window.of(
        basins.system, {"q1": (-2.0, 2.0), "q1'": (-1.0, 1.0)}, {"q3": float(state[1]), "q3'": float(state[3])}
    )
    assert len(draw(replace(basins, window=window)).lines) == 2
    assert not draw(replace(basins, window=window), strobes="none").lines
    with pytest.raises(ModelError, match='strobes is \'some\'; write "in the plane", "all" or "none"'):
        draw(basins, strobes="some")


def test_a_basin_picture_tells_what_was_checked(basins):
    unchecked = picture_of(replace(basins, check=BasinCheck(6)))
    assert unchecked.legends[0].get_title().get_text() == "not checked with the exact flow"
    some = picture_of(replace(basins, check=BasinCheck(6, 4, 2, 1, 2, 0))).legends[0].get_title().get_text()
    assert some == "1 of 2 cells at borders and elsewhere 0 of 2 cells differed from the exact flow"


def test_regimes_have_a_legend_and_forces_a_scale(chart):
    figure = picture_of(chart, title="A title", panels=("peak force", "impacts"))
    top, force, impacts = figure.axes[:3]
    assert legend_of(figure) == ["period 1", "period 2", "period 3", "period 9 and more", "quasi-periodic", "chaotic"]
    assert figure.legends[0].get_title().get_text() == "checked with the exact flow: 1 of 5 cells differed"
    assert image_of(top).get_array()[0].tolist() == [0, 1, 2, 3, 4, 5]
    assert np.array_equal(image_of(force).get_array(), chart.peak_force[..., 0])
    assert np.array_equal(image_of(impacts).get_array(), chart.impacts[..., 0])
    labels = [ax.get_ylabel() for ax in figure.axes[3:]]
    assert labels == ["peak force of stage2", "impacts of stage2 per forcing period"]
    assert top.get_xlim() == (0.4, 1.0)
    assert (top.get_xlabel(), impacts.get_xlabel()) == ("", "excitation frequency Ω")


def test_a_map_without_contacts_has_one_panel(chart):
    nothing = np.zeros((2, 6, 0))
    bare = replace(chart, peak_force=nothing, impacts=nothing)
    assert len(picture_of(bare).axes) == 1
    with pytest.raises(ModelError, match="the map has no figures of contacts"):
        picture_of(bare, panels=("impacts",))
    with pytest.raises(ModelError, match="there is no figure 'noise'"):
        picture_of(chart, panels=("noise",))


def test_the_forces_are_those_of_the_contact_that_is_hit_hardest_unless_another_is_named(chart):
    forces = np.concatenate((np.nan * chart.peak_force, chart.peak_force, chart.peak_force / 2.0), axis=2)
    both = replace(chart, system=far_and_near(), peak_force=forces)
    for contact, drawn in ((None, 1), ("near", 1), (1, 1), ("far", 0), (0, 0)):
        image = image_of(picture_of(both, contact=contact).axes[1]).get_array()
        assert np.array_equal(np.ma.filled(image, np.nan), forces[..., drawn], equal_nan=True), contact
    with pytest.raises(ModelError, match="no figures of a contact 'wall'; contacts are far, near, other"):
        picture_of(both, contact="wall")


@pytest.mark.slow
def test_loci_are_drawn_over_the_regimes(chart):
    system = clutch(frequency=0.9)
    branch = follow(find_orbit(system), "frequency", to=(0.5, 1.0))
    fold = branch.special(Kind.FOLD)[0]
    locus = follow_locus(fold, "frequency", "harmonic1.amplitude", chart.within)
    figure = picture_of(chart, loci=[locus])
    assert legend_of(figure)[-1] == "fold"
    casing, line = figure.axes[0].lines
    assert np.array_equal(line.get_xydata(), locus.values)
    assert casing.get_zorder() < line.get_zorder()
    with pytest.raises(ModelError, match="a locus is in the plane of frequency and harmonic1"):
        picture_of(replace(chart, first="mean.q1"), loci=[locus])


def test_records_draw_themselves(basins, chart):
    assert basins.plot("Title").get_title("left") == "Title"
    assert len(chart.plot(panels=()).figure.axes) == 1


def test_a_rigid_stop_has_impacts_and_no_panel_of_zero_force(chart):
    wall = gw.rigid_stop("wall", {"x": 1.0}, clearance=1.0, restitution=0.8)
    system = gw.System(["x"], [[1.0]], [[0.1]], contacts=[wall], harmonics=[gw.Harmonic(0.5, {"x": 1.0})])
    rigid = replace(chart, system=system, peak_force=np.full(chart.peak_force.shape, np.nan))
    figure = picture_of(rigid)
    assert np.array_equal(image_of(figure.axes[1]).get_array(), rigid.impacts[..., 0])
    assert figure.axes[2].get_ylabel() == "impacts of wall per forcing period"
    with pytest.raises(ModelError, match="wall is a rigid stop, and its impacts have no finite force"):
        picture_of(rigid, panels=["peak force"], contact="wall")


def test_records_of_cells_have_tables_of_their_cells(basins, chart):
    for record, name, values in ((chart, "period", chart.periods), (basins, "leads.to", None)):
        found = record.to_xarray()["cells"][name]
        assert found.shape == record.resolution[::-1]
        assert values is None or np.array_equal(found, values)

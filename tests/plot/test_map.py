"""Pictures of maps: loci by kind and period, sections with islands, and names of points of codimension two."""

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure

import gapwalk as gw
from gapwalk.bifurcation.loci import Codim2, LocusEndReason
from gapwalk.continuation import End, EndReason
from gapwalk.errors import ModelError
from gapwalk.model.words import parameter_words
from gapwalk.plot import draw, save
from gapwalk.plot.picture import picture_of
from gapwalk.plot.style import CODIM2, locus_options
from tests.studies.maps import clutch_map


@pytest.fixture(scope="module")
def result() -> gw.Result:
    return gw.run(clutch_map(max_period=2, walk=gw.WalkOptions(largest_step=0.05)))


@pytest.fixture(scope="module")
def figure(result) -> Figure:
    figure = picture_of(result)
    figure.draw_without_rendering()
    return figure


def legend_of(figure) -> list[str]:
    return [text.get_text() for text in figure.legends[0].get_texts()]


def test_the_plane_is_the_whole_picture(result, figure) -> None:
    (ax,) = figure.axes
    assert (ax.get_xlim(), ax.get_ylim()) == result.map.within
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("excitation frequency Ω", "mean load on q1")
    assert ax.get_title(loc="left") == "Second resonance"


def test_every_locus_is_drawn_in_the_line_of_its_kind_and_period(result, figure) -> None:
    lines = {line.get_xydata().tobytes(): line for line in figure.axes[0].lines}
    for locus in result.map.loci:
        line = lines[locus.values.tobytes()]
        options = locus_options(locus.kind, locus.period - 1)
        assert (line.get_color(), line.get_linewidth()) == (options["color"], options["linewidth"])


def test_what_is_drawn_is_explained(result, figure) -> None:
    assert legend_of(figure) == [
        "fold, period 1",
        "fold, period 2",
        "flip, period 1",
        "Neimark–Sacker, period 2",
        "grazing, period 1",
        "grazing, period 2",
        "cusp (CP)",
        "branches were followed here",
    ]


def test_kinds_are_told_apart_without_colour() -> None:
    lines = [str(locus_options(kind, 0)["linestyle"]) for kind in gw.Kind.with_locus()]
    assert len(set(lines)) == len(gw.Kind.with_locus())
    assert set(CODIM2) == set(Codim2)
    labels = [style.label for style in CODIM2.values() if style.label]
    assert len(set(labels)) == len(labels)


def test_points_of_codimension_two_are_marked_and_named_once(result, figure) -> None:
    (ax,) = figure.axes
    cusps = [point.values for locus in result.map.loci for point in locus.codim2(Codim2.CUSP)]
    marked = [tuple(line.get_xydata()[0]) for line in ax.lines if line.get_marker() == CODIM2[Codim2.CUSP].marker]
    assert sorted(marked) == sorted(cusps)
    assert [text.get_text() for text in ax.texts].count("CP") == len(cusps)
    twice = replace(result.map, loci=(*result.map.loci, *result.map.loci))  # loci that meet share a name
    texts = [text.get_text() for text in draw(twice, ax=Figure().add_subplot()).texts]
    assert texts.count("CP") == len(cusps)


def test_sections_have_their_values_and_islands_are_bars(result) -> None:
    chart = result.map
    branch = chart.sections[1].branches[0]
    closed = replace(branch, ends=(branch.ends[0], End(EndReason.CLOSED, branch.values[-1])))
    chart = replace(chart, sections=(chart.sections[0], replace(chart.sections[1], branches=(closed,))))
    ax = draw(chart, ax=Figure().add_subplot())
    assert {"0.2", "0.3"} <= {text.get_text() for text in ax.texts}
    (bar,) = [line for line in ax.lines if line.get_marker() == "|"]
    assert bar.get_xydata().tolist() == [[branch.values.min(), 0.3], [branch.values.max(), 0.3]]
    assert "isola (closed branch)" in [text.get_text() for text in ax.get_legend().get_texts()]


def test_an_end_at_which_the_numerics_gave_up_is_marked(result, figure) -> None:
    first, *others = result.map.loci
    lost = replace(first, ends=(first.ends[0], replace(first.ends[1], reason=LocusEndReason.STEP)))
    ax = draw(replace(result.map, loci=(lost, *others)), ax=Figure().add_subplot())
    (mark,) = [line.get_xydata() for line in ax.lines if line.get_marker() == "x"]
    assert mark.tolist() == [list(first.ends[1].values)]
    assert "not followed further" in [text.get_text() for text in ax.get_legend().get_texts()]
    assert "not followed further" not in legend_of(figure)


def test_a_closed_locus_is_closed(result) -> None:
    locus = result.map.loci[0]
    closed = replace(locus, ends=tuple(replace(end, reason=LocusEndReason.CLOSED) for end in locus.ends))
    ax = replace(result.map, loci=(closed,)).plot(ax=Figure().add_subplot(), labels=False, legend=False)
    (curve,) = [line.get_xydata() for line in ax.lines if len(line.get_xydata()) > 2]
    assert np.array_equal(curve[0], curve[-1])
    assert ax.get_legend() is None
    assert not ax.texts


def test_a_map_that_is_not_complete_can_be_drawn(result, tmp_path) -> None:
    save(replace(result.map, loci=(), sections=result.map.sections[:1]), tmp_path / "first.png")
    assert (tmp_path / "first.png").stat().st_size > 10_000
    with pytest.raises(ModelError, match="no measure; leave it out"):
        picture_of(result, measure="half.q1")


def test_files_are_equal_for_equal_results(result, tmp_path) -> None:
    for name in ("a", "b"):
        save(result, tmp_path / f"{name}.png", tmp_path / f"{name}.svg")
    for ending in ("png", "svg"):
        assert (tmp_path / f"a.{ending}").read_bytes() == (tmp_path / f"b.{ending}").read_bytes()


def test_parameters_are_called_by_words() -> None:
    assert parameter_words("harmonic1.amplitude") == "amplitude of harmonic 1"
    assert parameter_words("stage2.impact_damping") == "impact damping of stage2"
    assert parameter_words("stiffness.q1.q3") == "stiffness (q1, q3)"
    assert parameter_words("gas.acts_on.engine") == "share of gas that acts on engine"
    assert parameter_words("stop.cubic") == "cubic stiffness of stop"

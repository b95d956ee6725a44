"""One registry of pictures: a record is drawn by its type, alone, in given axes, in a list, and into files."""

import subprocess
import sys
from dataclasses import dataclass, replace
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib import pyplot as plt
from matplotlib import style
from matplotlib.figure import Figure

import gapwalk as gw
from gapwalk.bifurcation.detector import Unexplained
from gapwalk.bifurcation.diagram import Diagram
from gapwalk.errors import ModelError
from gapwalk.plot import picture
from gapwalk.plot.picture import begin, new_sheet, picture_of, write_legend
from gapwalk.plot.style import UNEXPLAINED, sized, stroke
from gapwalk.studies.settle_study import SettleStudyOptions
from tests.studies.diagrams import clutch_loop
from tests.studies.maps import resonance
from tests.studies.studies import stop_study


@dataclass(frozen=True)
class Ramp:
    """A record that gapwalk does not know."""

    height: tuple[float, ...]


@pytest.fixture
def ramp(monkeypatch) -> Ramp:
    monkeypatch.setattr(picture, "_IN_AXES", dict(picture._IN_AXES))

    @gw.plot.draws(Ramp, size=(4.0, 3.0))
    def draw_ramp(ramp, ax, *, color="k"):
        ax.plot(ramp.height, color=color)

    return Ramp((0.0, 1.0, 4.0))


@pytest.fixture(scope="module")
def branch() -> gw.Branch:
    return gw.run(stop_study()).branches[0]


def unexplained(branch: gw.Branch, step: int) -> gw.Branch:
    """The same branch, in one step of which something was missed."""
    a, b = branch.points[step : step + 2]
    other = replace(branch)
    vars(other)["unexplained"] = (Unexplained(a.value, b.value, "one multiplier more"),)
    return other


def question_marks(ax) -> np.ndarray:
    found = [line.get_xydata() for line in ax.lines if line.get_marker() == UNEXPLAINED.marker]
    return np.concatenate([np.empty((0, 2)), *found])


def test_a_type_of_your_own_is_drawn_and_saved_like_all_others(ramp, tmp_path) -> None:
    gw.plot.save(ramp, tmp_path / "a.png", tmp_path / "a.svg", title="costs $5 and $6", color="red")
    assert (tmp_path / "a.png").read_bytes()[:4] == b"\x89PNG"
    assert "costs $5 and $6" in (tmp_path / "a.svg").read_text(encoding="utf-8")
    figure = picture_of(ramp)
    assert figure.get_size_inches().tolist() == [4.0, 3.0]
    assert figure.axes[0].lines[0].get_ydata().tolist() == [0.0, 1.0, 4.0]
    with pytest.raises(TypeError, match="the picture of Ramp takes color; not 'colour'"):
        gw.plot.draw(ramp, colour="red")


def test_what_cannot_be_drawn_says_what_can(branch, tmp_path) -> None:
    with pytest.raises(ModelError, match="there is no picture of a str; there are pictures of Alignment, Attractor,"):
        gw.plot.draw("branch")
    with pytest.raises(ModelError, match=r"a.jpg is not a name for a picture; give it the ending .png, .svg or .pdf"):
        gw.plot.save(branch, tmp_path / "a.jpg")
    gw.plot.save(branch, tmp_path / "a.dat", form="png")
    with pytest.raises(
        TypeError, match="the picture of Branch takes measure, labels, legend, closeup, within, x; not 'color'"
    ):
        branch.plot(color="red")


def test_a_list_of_different_records_is_refused(branch) -> None:
    orbit = branch.points[0].orbit
    with pytest.raises(ModelError, match="a list of Branch, Orbit has no picture in common; draw them one by one"):
        gw.plot.draw([branch, orbit])
    with pytest.raises(ModelError, match="a list of Orbit has no picture in common"):
        gw.plot.draw([orbit, orbit])
    with pytest.raises(ModelError, match="there is no picture of a list"):
        gw.plot.draw([])


def test_no_empty_window_stays_open_after_an_error(branch) -> None:
    before = plt.get_fignums()
    with pytest.raises(ModelError, match="no measure"):
        branch.plot("loudness.x")
    with pytest.raises(ModelError, match="nothing to draw"):
        gw.plot.draw(Diagram("frequency", (0.1, 0.2)))
    assert plt.get_fignums() == before


def test_the_motion_of_a_study_is_drawn_in_axes_too(tmp_path) -> None:
    """Options of the study that the panel does not have (the phase of its section) are left out."""
    options = SettleStudyOptions(signal="x'", phase=1.0)
    result = gw.run(gw.Study(stop_study().system, options, "Settles"))
    ax = gw.plot.draw(result, ax=Figure().add_subplot())
    assert (ax.get_ylabel(), ax.get_title("left")) == ("x'", "Settles")
    assert picture_of(result).axes[0].get_ylabel() == "x'"


def test_every_type_has_its_picture_where_the_registry_says() -> None:
    """Each type of the table, found by its name in the module that draws it."""
    for module, names in picture._MODULES.items():
        home = __import__(f"gapwalk.plot.{module}", fromlist=["*"])
        for name in names:
            kind = getattr(home, name)
            drawing = picture._IN_PANELS.get(kind) or picture._IN_AXES[kind]
            assert drawing.draw.__module__ == home.__name__
            assert drawing.draw.__doc__


def test_a_list_is_one_picture(branch) -> None:
    one, two = (picture_of(record, "x", labels=False, legend=False) for record in (branch, [branch, branch]))
    assert len(two.axes[0].lines) > len(one.axes[0].lines)


def test_panels_of_your_own_are_laid_out_once(branch) -> None:
    with gw.plot.in_style():
        figure = new_sheet((8.0, 3.0))
        left, right = figure.subplots(1, 2)
    rest = [begin(branch, "x", ax=ax, legend="above") for ax in (left, right)]
    assert not left.texts
    figure.draw_without_rendering()
    for draw_the_rest in rest:
        draw_the_rest()
    assert [text.get_text() for text in left.texts] == [text.get_text() for text in right.texts] != []


def test_a_diagram_shows_its_states_in_axes_of_your_own() -> None:
    diagram = clutch_loop().diagram
    ax = Figure(layout="constrained").add_subplot()
    assert diagram.plot("q3", ax=ax, within=(0.68, 0.69)) is ax
    assert ax.get_ylabel() == "q3(0), once every forcing period"
    assert ax.get_xlim() == (0.68, 0.69)
    other = diagram.plot("max.q3", ax=Figure(layout="constrained").add_subplot())
    assert other.get_ylabel() == "maximum of q3"
    with pytest.raises(ModelError, match="is drawn in several panels: give figure"):
        gw.plot.draw(gw.analysis.contrast(*(member.branch.points[0].orbit for member in diagram.members[:2])), ax=ax)


def test_a_diagram_has_question_marks_where_something_was_missed() -> None:
    diagram = clutch_loop().diagram
    member = next(member for member in diagram.members if member.period == 2)
    marked = replace(member, branch=unexplained(member.branch, 5))
    members = tuple(marked if each is member else each for each in diagram.members)
    figure = picture_of(replace(diagram, members=members), strobes=True)
    a, b = member.branch.points[5:7]
    assert len(question_marks(figure.axes[0])) == 1  # which has the motions of all periods
    states = 0.5 * (a.orbit.strobes(2)[:, 0] + b.orbit.strobes(2)[:, 0])
    expected = [(0.5 * (a.value + b.value), state) for state in states]
    np.testing.assert_allclose(np.sort(question_marks(figure.axes[1]), axis=0), np.sort(expected, axis=0), rtol=1e-6)
    assert "not explained" in [text.get_text() for text in figure.axes[0].get_legend().get_texts()]


@pytest.mark.slow
def test_a_map_has_question_marks_on_its_sections() -> None:
    chart = resonance().map
    first, *others = chart.sections
    branch = first.branches[0]
    section = replace(first, branches=(unexplained(branch, 3), *first.branches[1:]))
    figure = picture_of(replace(chart, sections=(section, *others)))
    a, b = branch.points[3:5]
    np.testing.assert_allclose(question_marks(figure.axes[0]), [(0.5 * (a.value + b.value), first.value)])
    assert "not explained" in [text.get_text() for text in figure.legends[0].get_texts()]
    assert not len(question_marks(picture_of(chart).axes[0]))


@pytest.mark.parametrize("count", [4, 5, 7, 10])
def test_a_legend_is_no_wider_than_a_column(count) -> None:
    with sized("column"), gw.plot.in_style():
        figure = new_sheet()
        ax = figure.add_subplot()
        write_legend(ax, [(f"orbit of period {index}", stroke("k", 1.0)) for index in range(count)])
        figure.draw_without_rendering()
        assert figure.legends[0].get_window_extent().width <= figure.bbox.width


def test_the_style_can_be_used_for_other_pictures() -> None:
    with style.context("gapwalk.plot.gapwalk"):
        assert mpl.rcParams["font.size"] == 9.5
        assert mpl.rcParams["svg.hashsalt"] == "gapwalk"


def test_nothing_is_loaded_before_something_is_drawn_and_files_need_no_pyplot(tmp_path) -> None:
    program = (
        "import sys, gapwalk as gw; gw.plot; assert 'matplotlib' not in sys.modules; "
        "from tests.studies.studies import run, stop_study; save = gw.plot.save; result = run(stop_study(end=0.8)); "
        f"save(result, {str(tmp_path / 'a.png')!r}); assert 'matplotlib.pyplot' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", program], check=True, cwd=Path(__file__).parents[2])

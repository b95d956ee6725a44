"""Pictures at the size of a column, a page or a slide."""

import re

import pytest

import gapwalk as gw
from gapwalk import plot
from gapwalk.errors import ModelError
from gapwalk.plot.picture import picture_of
from gapwalk.plot.style import SIZES, broken, points, sheet_size, sized
from tests.tiers import keeps

_INCH = 25.4


@pytest.fixture(scope="module")
def branch() -> gw.Branch:
    system = gw.System(
        ["x"],
        stiffness=[[1.0]],
        damping=[[0.1]],
        contacts=[gw.stop("stop", {"x": 1.0}, clearance=1.0, stiffness=20.0, impact_damping=0.2)],
        harmonics=[gw.Harmonic(0.5, {"x": 1.0})],
        frequency=0.6,
    )
    return gw.follow(gw.find_orbit(system), "frequency", to=1.6)


@keeps("page-175.0-8.5", "slide-250.0-16.0")
@pytest.mark.parametrize(
    ("size", "width", "letters"), [("column", 85.0, 8.0), ("page", 175.0, 8.5), ("slide", 250.0, 16.0)]
)
def test_a_size_is_a_width_and_letters(branch, size, width, letters) -> None:
    with sized(size):
        figure = picture_of(branch, title="A stop")
    assert figure.get_size_inches()[0] * _INCH == pytest.approx(width)
    (ax,) = figure.axes
    assert ax.get_xticklabels()[0].get_fontsize() == pytest.approx(letters)
    figure.draw_without_rendering()
    box = figure.get_tightbbox()
    assert box.x0 >= -0.02
    assert box.y0 >= -0.02
    assert box.x1 <= figure.get_size_inches()[0] + 0.02
    assert box.y1 <= figure.get_size_inches()[1] + 0.02


def test_text_in_svg_and_pdf_is_text(branch, tmp_path) -> None:
    plot.save(branch, tmp_path / "a.svg", tmp_path / "a.pdf", size="column")
    svg = (tmp_path / "a.svg").read_text(encoding="utf-8")
    assert re.search(r"<text[^>]*>excitation frequency Ω</text>", svg)
    width = re.search(r'<svg[^>]* width="([\d.]+)pt"', svg)
    assert width is not None
    assert float(width[1]) / 72.0 * _INCH == pytest.approx(85.0, abs=0.01)
    pdf = (tmp_path / "a.pdf").read_bytes()
    plot.save(branch, tmp_path / "b.pdf", size="column")
    assert (tmp_path / "b.pdf").read_bytes() == pdf
    assert b"CreationDate" not in pdf  # which is all that would differ a second later
    assert b"/FontFile2" in pdf  # letters of a font, not outlines
    assert b"/Type3" not in pdf


def test_plot_takes_a_size(branch) -> None:
    ax = branch.plot(size="page")
    assert ax.figure.get_size_inches()[0] * _INCH == pytest.approx(175.0)


def test_a_size_ends_with_its_block() -> None:
    with sized("slide"), sized(None):
        assert points(9.5) == pytest.approx(16.0)
    assert points(9.5) == 9.5
    assert sheet_size(8.0, 4.8) == (8.0, 4.8)


def test_long_labels_are_broken_on_small_sheets_only() -> None:
    text = "amplitude of x (half the peak to peak)"
    assert broken(text) == text
    with sized("column"):
        assert broken(text) == "amplitude of x\n(half the peak to peak)"
        assert broken("maximum of x") == "maximum of x"


def test_an_unknown_size_is_refused() -> None:
    with pytest.raises(ModelError, match="there are screen, column, page, slide: write"), sized("poster"):  # pyright: ignore[reportArgumentType]
        pass
    assert set(SIZES) == {"screen", "column", "page", "slide"}

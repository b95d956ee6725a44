"""An answer that stands in one file is drawn on paper and on the page from one description."""

import numpy as np
import pytest
from matplotlib.figure import Figure

import gapwalk as gw
from gapwalk.explorer.answer_view import AnswerView
from tests.explorer.browser import browser, new_page, until
from tests.toys.gain import Gain, gain


@pytest.fixture(scope="module")
def found() -> Gain:
    return gain()


def test_paper_has_its_panels_legend_and_answer(found: Gain) -> None:
    figure = found.plot(figure=Figure(layout="constrained")).figure
    upper, lower = figure.axes
    line, star = (each for each in upper.lines if len(each.get_xdata()) != 2)
    np.testing.assert_array_equal(line.get_ydata(), found.gains)
    assert star.get_ydata() == [found.gains.max()]
    assert upper.get_ylabel().startswith("amplitude of x")
    assert lower.get_ylabel() == "share of the largest"
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["gain", "largest", "near the resonance"]
    assert "the gain is largest" in figure.get_suptitle()
    assert upper.get_xlim() == (0.5, 1.5)
    ax = Figure().add_subplot()
    assert gw.plot.draw(found, ax=ax) is ax
    assert "<img" in found._repr_html_()


def test_the_page_has_the_same_values(found: Gain) -> None:
    content = AnswerView(found).content()
    line, star = content["layers"]
    np.testing.assert_allclose(line["y"], found.gains, rtol=1e-6)
    assert star["mark"] == "stars"
    assert [each["text"] for each in content["shades"]] == ["near the resonance"]
    assert content["below"][0]["across"] == "excitation frequency Ω"
    assert content["sentences"] == [str(found.summary())]


def test_its_page_opens_alone(found: Gain, tmp_path) -> None:
    gw.save_html(found, tmp_path / "gain.html")
    with browser() as chrome:
        page = new_page(chrome, offline=True)
        page.goto((tmp_path / "gain.html").as_uri())
        until(page, "window.gapwalk?.diagram?.over?.layers.length === 2")
        until(page, "document.querySelectorAll('#below svg').length === 1")

"""Every kind of result is one file that opens without a server: what it draws is what the record says."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.attractors.basins import RUNAWAY, UNRESOLVED
from gapwalk.explorer.answer_view import AnswerView
from gapwalk.explorer.saved_page import Blob, content_of, lines_of
from gapwalk.model.model_source import parse_source
from gapwalk.studies.study_file import check_study
from gapwalk.studies.study_kind import kind_of, kinds
from tests.explorer.browser import browser, new_page, until
from tests.explorer.conftest import CLUTCH
from tests.models import STOP
from tests.studies.jobs import result_file, study_of

FAMILY = (
    STOP
    + """
[study]
kind = "family"
parameter = "frequency"
from = 0.7
to = 0.9
over = { "stop.clearance" = [0.9, 1.0, 1.1] }
"""
)
MAP = (
    STOP
    + """
[study]
kind = "map"
parameter = "frequency"
from = 0.7
to = 0.9
second = { parameter = "harmonic1.amplitude", from = 0.15, to = 0.25 }
sections = [0.2]
"""
)

UNFORCED = ("tori", "backbone", "self-excited")


@pytest.fixture(scope="module")
def results(tmp_path_factory) -> Callable[[str], gw.Result]:
    """The result of a kind of study whose picture is not tested elsewhere."""
    folder = tmp_path_factory.mktemp("kinds")
    own = {"family": FAMILY, "map": MAP}

    @cache
    def result(kind: str) -> gw.Result:
        if kind in own:
            return gw.run(check_study(parse_source(own[kind])))
        path = folder / f"{kind}.gapwalk"
        path.write_bytes(result_file(kind))
        return gw.open_result(path)

    return result


@pytest.fixture
def found(results, name) -> gw.Result:
    """The result of the kind of a test."""
    return results(name)


def test_no_kind_of_study_is_left_out() -> None:
    """Those of `results`, and those of test_answer_page.py and test_kept.py."""
    known = {"basins", "regimes", "sweep", "family", "map", "campbell", "rattle-chance", "shares", *UNFORCED}
    others = {"response", "diagram", "locus", "settle", "rattle", "threshold", "design", "tolerance", "run-up"}
    # a saved page does not show them; the message says what to write
    refused = {"scan"}
    own = {kind for kind in kinds() if kind_of(kind).__module__.startswith("gapwalk.")}  # tests may register others
    assert known | others | refused == own


@pytest.mark.parametrize(
    "name", ["basins", "regimes", "sweep", "family", "map", "campbell", "rattle-chance", "shares", *UNFORCED]
)
def test_a_page_of_each_kind_opens_alone_and_draws_something(found, tmp_path, name) -> None:
    file = tmp_path / f"{name}.html"
    gw.save_html(found, file)
    with browser() as chrome:
        page = new_page(chrome, viewport={"width": 1280, "height": 800}, offline=True)
        wrong: list[str] = []
        page.on("pageerror", lambda error: wrong.append(str(error)))
        page.on("console", lambda said: wrong.append(said.text) if said.type in ("error", "warning") else None)
        page.goto(file.as_uri())
        until(page, "Boolean(window.gapwalk?.diagram?.ready)")
        until(page, "Boolean(gapwalk.answer.content) || gapwalk.curves.all.size > 0")
        drawn = page.evaluate(
            "[gapwalk.curves.all.size, gapwalk.diagram.over?.cells?.rows.length ?? 0, "
            "(gapwalk.diagram.over?.layers ?? []).reduce((sum, { x }) => sum + x.length, 0), "
            "(gapwalk.answer.content?.charts ?? []).reduce((sum, { series }) => sum + series.length, 0)]"
        )
        assert any(drawn[:3] if name == "campbell" else drawn), drawn
        if name in UNFORCED:  # the first picture is there, the others are drawn when they are opened
            until(page, "document.querySelector('.drawn img')?.naturalWidth > 100")
            page.evaluate("for (const each of document.querySelectorAll('.drawn')) each.open = true")
            wide = "each.querySelector('img')?.naturalWidth > 100"
            until(page, f"[...document.querySelectorAll('.drawn')].every((each) => {wide})")
            pictures = len(AnswerView(found.finding).picture.wholes)
            assert page.locator(".drawn img").count() == pictures == (7 if name == "tori" else 1)
        if name in ("family", "map"):
            page.focus("#diagram")
            page.keyboard.press("Home")
            until(page, "document.querySelectorAll('#section .dot').length > 0")
            assert page.locator("#spectrum .bar, #spectrum .curve").count() > 0
        assert page.inner_text("#error").strip("\u00d7 \n") == ""
    assert wrong == []


def test_the_cells_of_basins_are_the_labels_of_the_record(results) -> None:
    found = results("basins").finding.record
    view = AnswerView(results("basins").finding)
    content = view.content()
    (cells,) = content["cells"]
    texts = [entry["text"] for entry in cells["entries"]]
    named = np.array(texts)[np.array(cells["rows"])]
    for index, name in enumerate(found.names):
        np.testing.assert_array_equal(np.char.startswith(named, f"{name} ("), found.labels == index)
    assert {RUNAWAY, UNRESOLVED}.isdisjoint(found.labels.ravel().tolist()) == (len(texts) == len(found.names))
    assert cells["within"] == [list(ends) for ends in found.window.within]
    assert content["sentences"][0].startswith(f"Of {found.labels.size:,} starts: {found.names[0]} ")


def test_shares_of_a_box_have_their_limits() -> None:
    study = study_of("basins")
    system = study.system
    names = system.state_names
    shares = gw.basin_shares(system, {names[0]: (-1.0, 1.0), names[1]: (-1.0, 1.0)}, starts=200)
    content = AnswerView(shares).content()
    assert [each["share"] for each in content["shares"]] == [each.share for each in shares.shares]
    assert sum(each["share"] for each in content["shares"]) == pytest.approx(1.0)
    assert all(each["low"] <= each["share"] <= each["high"] for each in content["shares"])
    lines = lines_of(shares)
    assert content_of(lines, "half", "", 10, Blob())["answer"]["shares"][0]["name"] == shares.shares[0].name


def test_a_family_has_its_members_and_the_paths_of_its_special_points(results) -> None:
    found = results("family").finding.record
    view = AnswerView(results("family").finding)
    content = view.content()
    assert content["space"]["values"] == [member.value for member in found.members for _ in member.branches]
    assert next(name for name, _ in view.curves()) == "P1-1 at stop.clearance = 0.9"
    joined = [path for path in found.point_paths if len(path.places) > 1]
    assert len(content["ribs"]) == len(joined) > 0
    for rib, path in zip(content["ribs"], joined, strict=True):
        for (branch, special), place in zip(rib["points"], path.places, strict=True):
            assert view.curves()[branch][1].special_points[special] is found.special(place)


def test_a_saved_map_has_its_sections_too(results) -> None:
    chart = results("map").map
    saved = content_of(lines_of(results("map")), "half.x", "", 10, Blob())
    assert [each["second"] for each in saved["branches"]] == (
        [""] * len(chart.branches) + ["harmonic1.amplitude"] * len(chart.loci)
    )
    assert (saved["x"], saved["y"]) == ("frequency", "harmonic1.amplitude")


def test_a_saved_run_up_plays_without_a_server(tmp_path: Path) -> None:
    file = tmp_path / "run.html"
    study = gw.read_study(CLUTCH)
    run = gw.ask.run_up(study.system, gw.ask.SpeedCourse.ramp(0.5, 0.9, 0.001))
    gw.save_html(run, file)
    with browser() as chrome:
        page = new_page(chrome, viewport={"width": 1280, "height": 800}, offline=True)
        wrong: list[str] = []
        page.on("pageerror", lambda error: wrong.append(str(error)))
        page.goto(file.as_uri())
        until(page, "Boolean(window.gapwalk?.answer?.heard.found)")
        signals = page.evaluate("[...document.getElementById('heard-signal').options].map(({ value }) => value)")
        page.click("#heard-play")
        until(page, "Boolean(gapwalk.answer.heard.own)")
        rate, values = page.evaluate("[gapwalk.answer.heard.values.rate, [...gapwalk.answer.heard.own]]")
        assert not page.locator("#heard-wav").is_visible()
        page.select_option("#heard-signal", signals[1])
        until(page, "!gapwalk.answer.heard.source && Boolean(document.querySelector('#heard-picture image'))")
    exact = run.sound(signals[0], rate=rate).values
    assert len(values) == len(exact)
    assert np.abs(np.array(values) - (exact - exact.mean())).max() < 1e-4 * np.abs(exact).max()
    assert wrong == []


def test_a_family_of_both_kinds_is_drawn_in_two_looks_that_meet(results) -> None:
    (family,) = results("tori").finding.record.families
    count = len(family.points)
    lost = replace(  # as if deviations grew on the first five tori
        family,
        points=tuple(
            replace(point, torus=replace(point.torus, exponents=point.torus.exponents + 9.0)) if number < 5 else point
            for number, point in enumerate(family.points)
        ),
    )
    content = AnswerView(lost).content()
    stable, unstable = (each for each in content["layers"] if each["axes"] == ["frequency", "half.q1"])
    assert (stable["text"], unstable["text"]) == ("torus, stable", "torus, unstable")
    heights = lost.measure("half.q1")
    np.testing.assert_allclose(stable["y"][5:], heights[5:], rtol=1e-6)
    np.testing.assert_allclose(unstable["y"][:6], heights[:6], rtol=1e-6)
    assert stable["y"][:5] == [None] * 5
    assert unstable["y"][6:] == [None] * (count - 6)


def test_backbones_lie_over_the_frequency_of_responses() -> None:
    spring = gw.Contact("spring", {"x": 1.0}, (gw.Stage(clearance=0.0, stiffness=0.0, cubic=1.0),))
    duffing = gw.System(["x"], [[1.0]], [[0.1]], contacts=[spring], harmonics=[gw.Harmonic(0.3, {"x": 1.0})])
    line = gw.free.backbone(duffing, 1)
    content = AnswerView(line).content()
    (layer,) = content["layers"]
    assert layer["axes"] == ["frequency", "half.x"] == list(content["axes"])
    np.testing.assert_allclose(layer["y"], line.half("x"), rtol=1e-6)
    (chart,) = content["charts"]
    # the energy of Duffing's oscillator at rest at x is x^2/2 + x^4/4
    half = line.half("x")
    np.testing.assert_allclose(chart["series"][0]["x"], np.log10(half**2 / 2 + half**4 / 4), atol=1e-5)
    assert content["complete"]

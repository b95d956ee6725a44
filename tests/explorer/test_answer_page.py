"""Answers on the page: what is drawn is what the record says, gradients are closed forms, and all of it is saved."""

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Page, Route
from starlette.testclient import TestClient

import gapwalk as gw
from gapwalk.errors import ModelError
from gapwalk.explorer.opened_file import Exploration
from gapwalk.explorer.page_requests import Settle
from gapwalk.explorer.request_tasks import plan
from gapwalk.explorer.server_state import Session
from gapwalk.explorer.web_app import application
from gapwalk.explorer.workspace_folder import Workspace, mark_of
from tests.explorer.browser import chromium, new_page, opened, until, watched
from tests.explorer.conftest import ORIGIN, STOP, about
from tests.explorer.serving import serving
from tests.explorer.test_web_app import unpacked
from tests.studies.jobs import RATTLE, RUN_UP, THRESHOLD, result_file
from tests.studies.test_complete_response import TRAIN

KINDS = ("rattle", "threshold", "design", "tolerance", "run-up")
ONE_RUN_UP = RUN_UP.replace("rate = [0.002, 0.004]\nstarts = 3\nbins = 10", "rate = 0.004")
MAP = RATTLE + 'second = { parameter = "mean.x", from = 0.1, to = 0.6 }\nresolution = [4, 3]\ncheck = 0\n'
SHOWN = "gapwalk.page.about?.file === '{0}' && Boolean(gapwalk.answer.content)"


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """A result of each kind, the two other forms of two kinds, and a model file of a study of rattle."""
    folder = tmp_path_factory.mktemp("answers")
    for kind in KINDS:
        (folder / f"{kind}.gapwalk").write_bytes(result_file(kind))
    for name, text in (("one", ONE_RUN_UP), ("map", MAP), ("model", RATTLE)):
        (folder / f"{name}.toml").write_text(text, encoding="utf-8")
    for name in ("one", "map"):
        gw.run(gw.read_study(folder / f"{name}.toml"), folder / f"{name}.gapwalk")
    return folder


@pytest.fixture(scope="module")
def records(folder) -> dict[str, object]:
    """Records of the results, by name."""
    return {path.stem: gw.open_result(path).finding.record for path in folder.glob("*.gapwalk")}


@pytest.fixture(scope="module")
def client(folder) -> Iterator[TestClient]:
    """A server of that folder."""
    session = Session(folder)
    yield TestClient(application(session), base_url=ORIGIN)
    session.close()


def answer(client: TestClient, name: str) -> dict:
    found = client.get("/api/answer", params={"file": f"{name}.gapwalk", "result": ""})
    assert found.status_code == 200, found.text
    return found.json()


@pytest.mark.parametrize("name", [*KINDS, "one", "map"])
def test_each_result_opens_with_a_sentence_a_picture_and_curves_to_choose(client, name) -> None:
    (result,) = about(client, f"{name}.gapwalk")["results"]
    shown = answer(client, name)
    assert all(shown["sentences"])
    assert result["answer"]["axes"] == shown["axes"]
    assert any(shown.get(key) for key in ("shades", "clouds", "layers", "cells"))
    x, y = shown["axes"]
    for number, line in enumerate(result["branches"]):
        place = {"file": f"{name}.gapwalk", "result": "", "branch": number}
        curve = client.get("/api/curve", params={**place, "x": x, "y": y}).json()
        assert len(unpacked(curve, "x")) >= line["points"] > 0
        motion = client.get("/api/motion", params={**place, "point": 0, "signal": "", "tab": "a"})
        assert motion.status_code == 200, motion.text
    script = client.get("/api/export/script", params={"file": f"{name}.gapwalk", "result": ""}).text
    assert script.count("record") >= 2


def test_the_picture_of_rattle_is_that_of_the_record(client, records) -> None:
    bands, shown = records["rattle"], answer(client, "rattle")
    assert shown["sentences"] == [bands.sentence("teeth")]
    (band,) = bands.of("teeth")
    assert [(each["low"], each["high"]) for each in shown["shades"]] == [(band.low.value, band.high.value)]
    peak, impacts = shown["below"]
    lines = [each for each in peak["series"] if each["mark"] == "line"]
    for series, way in zip(lines, ("rising", "falling"), strict=True):
        rows = [row for row in bands.severities if row.met == way]
        np.testing.assert_allclose(series["x"], [row.value for row in rows], rtol=1e-6)
        np.testing.assert_allclose(series["y"], [row.peak for row in rows], rtol=1e-6)
    (star,) = [each for each in peak["series"] if each["mark"] == "stars"]
    assert star["y"] == pytest.approx([max(row.peak for row in bands.severities)], rel=1e-6)
    assert impacts["over"] == "frequency"
    (end,) = shown["ends"]
    place = {"file": "rattle.gapwalk", "result": "", "branch": end["branch"], "special": end["special"], "tab": "a"}
    moved = client.get("/api/gradient", params=place).json()
    assert moved["at"] == pytest.approx(band.high.value, rel=1e-9)
    turned = [each.name for each in band.high.movers if ".deflection." not in each.name]
    assert moved["rows"][0]["name"] == turned[0]


def test_what_moves_a_graze_is_the_closed_form(client) -> None:
    """The closed form: a linear oscillator touches its stop where its amplitude is the clearance."""
    shown = answer(client, "tolerance")
    (end,) = shown["ends"]
    place = {"file": "tolerance.gapwalk", "result": "", "branch": end["branch"], "special": end["special"], "tab": "a"}
    moved = client.get("/api/gradient", params=place).json()
    rows = {row["name"]: row for row in moved["rows"]}
    at, clearance, force, damping = moved["at"], rows["stop.clearance"]["value"], 0.2, 0.05
    size = force / math.hypot(1.0 - at**2, damping * at)
    assert size == pytest.approx(clearance, rel=1e-9)
    # d size / d frequency, from size^-2 = ((1 - w^2)^2 + (c w)^2) / force^2
    slope = -(size**3) / force**2 * (-2.0 * at * (1.0 - at**2) + damping**2 * at)
    assert rows["stop.clearance"]["slope"] == pytest.approx(1.0 / slope, rel=1e-7)
    assert rows["harmonic1.amplitude"]["slope"] == pytest.approx(-size / force / slope, rel=1e-7)
    shares = [abs(row["share"]) for row in moved["rows"]]
    assert shares == sorted(shares, reverse=True)


def test_the_cloud_has_the_quantiles_of_the_samples(client, records) -> None:
    found = records["tolerance"]
    (cloud,) = answer(client, "tolerance")["clouds"]
    column = found.values[found.known][:, 0]
    np.testing.assert_allclose(cloud["x"], column, rtol=1e-6)
    np.testing.assert_allclose(cloud["quantiles"], np.quantile(column, (0.05, 0.5, 0.95)), rtol=1e-6)
    assert cloud["place"] == {"branch": 0, "special": 0}
    assert f"exists in {found.exists[0]} of all parts" in cloud["lines"]


def test_a_point_that_has_no_gradient_says_why(client) -> None:
    place = {"file": "rattle.gapwalk", "result": "", "branch": 0, "special": 99, "tab": "a"}
    assert client.get("/api/gradient", params=place).status_code == 400


def test_the_script_of_an_answer_repeats_it(client, records, folder, monkeypatch) -> None:
    monkeypatch.chdir(folder)
    text = client.get("/api/export/script", params={"file": "tolerance.gapwalk", "result": ""}).text
    names: dict = {}
    exec(compile(text, "script", "exec"), names)
    np.testing.assert_array_equal(names["record"].values, records["tolerance"].values)
    assert len(names["branches"]) == 1


@pytest.fixture(scope="module")
def page(folder) -> Iterator[Page]:
    """The page of the server of that folder, with an ear for errors: there are none."""
    chromium()
    with serving(folder / "rattle.gapwalk") as address, watched(address, height=800) as page:
        yield page


def show(page: Page, file: str) -> None:
    """Open a result, and wait for its answer."""
    if page.evaluate("gapwalk.page.about.file") != file:
        opened(page, file)
    until(page, SHOWN.format(file))
    until(page, "gapwalk.diagram.ready && gapwalk.diagram.over !== null")


@pytest.mark.parametrize("name", [*KINDS, "one", "map"])
def test_the_page_shows_each_answer_over_its_axes(page, name) -> None:
    show(page, f"{name}.gapwalk")
    content = page.evaluate("gapwalk.answer.content")
    assert page.locator("#answer-text span").all_inner_texts() == content["sentences"]
    assert [page.input_value("#x"), page.input_value("#y")] == content["axes"]
    until(page, f"document.querySelectorAll('#below svg').length === {len(content.get('below', []))}")
    assert page.locator("#below path.series, #below circle.series").count() >= len(content.get("below", []))
    assert page.evaluate("gapwalk.diagram.over.shades.length") == len(content.get("shades", []))
    layers = [each for each in content.get("layers", []) if each["axes"] == content["axes"]]
    assert page.evaluate("gapwalk.diagram.over.layers.length") == len(layers)
    assert page.locator("#answer-numbers table").count() + page.locator("#answer-numbers .line").count() > 0
    assert page.locator("#legend .of-answer").count() > 0


def test_a_turned_knob_is_an_arrow_of_its_shift(page) -> None:
    show(page, "rattle.gapwalk")
    page.click("#answer-ends button")
    until(page, "Boolean(gapwalk.movers.found) && gapwalk.diagram.arrows.length > 0")
    assert "grazing" in page.inner_text("#motion-title")
    assert page.locator("#answer-details").get_attribute("open") is None  # it has made room
    until(page, "gapwalk.movers.found.rows.some((row) => row.name === 'teeth.stiffness')")  # they come by and by
    page.fill("#movers-percent", "-3")
    row = page.evaluate("gapwalk.movers.found.rows.find((row) => row.name === 'teeth.stiffness')")
    page.click("#movers [data-name='teeth.stiffness'] button")
    until(page, "gapwalk.diagram.arrows.some((a) => a.chosen)")
    ((x0, y0), (x1, y1)) = page.evaluate("(({from, to}) => [from, to])(gapwalk.diagram.arrows.find((a) => a.chosen))")
    assert x1 - x0 == pytest.approx(-0.03 * row["slope"] * row["value"], rel=1e-9)
    assert y1 == y0
    assert x0 == page.evaluate("gapwalk.movers.found.at")
    until(page, "gapwalk.diagram.place.layout.shapes.length === gapwalk.diagram.arrows.length")
    page.select_option("#y", "frequency")  # upright over the other axis, and none where the parameter is on neither
    page.select_option("#x", "half.x")
    until(page, "gapwalk.diagram.arrows.some(({ from, to }) => from[0] === to[0])")
    page.select_option("#y", "max.x")
    until(page, "gapwalk.diagram.arrows.length === 0")
    page.click("#movers-set")
    field = page.locator(".parameter[data-name='teeth.stiffness'] input[type=number]")
    assert float(field.input_value()) == pytest.approx(0.97 * row["value"], rel=1e-12)


def test_a_chosen_point_comes_back_with_its_curve_however_late(page) -> None:
    show(page, "rattle.gapwalk")
    page.select_option("#x", "frequency")
    page.select_option("#y", "half.x")
    until(page, "!gapwalk.page.updating")
    page.click("#answer-ends button")
    until(page, "gapwalk.diagram.arrows.length > 0")
    chosen, mark = page.evaluate("[gapwalk.page.chosen.title, gapwalk.diagram.mark]")
    held: list[Route] = []
    is_late = True
    page.route("**/api/curve?*", lambda route: held.append(route) if is_late else route.continue_())
    page.select_option("#y", "frequency")
    until(page, "gapwalk.page.updating && gapwalk.page.chosen.curve === null")
    page.select_option("#x", "half.x")  # while the curves over the axes before are on their way
    now = page.evaluate("[gapwalk.page.chosen.title, gapwalk.page.chosen.curve, gapwalk.diagram.mark]")
    assert now == [chosen, None, None]
    is_late = False
    for route in held:
        route.continue_()
    until(page, f"gapwalk.diagram.mark?.[1] === {mark[0]!r} && gapwalk.diagram.arrows.length > 0")
    assert page.evaluate("gapwalk.page.chosen.title") == chosen
    assert page.inner_text("#chosen") == chosen
    # over its parameter both ways, an arrow leads along the diagonal
    page.select_option("#x", "frequency")
    until(page, "gapwalk.diagram.mark && gapwalk.diagram.mark[0] === gapwalk.diagram.mark[1]")
    ((x0, y0), (x1, y1)) = page.evaluate("(({from, to}) => [from, to])(gapwalk.diagram.arrows[0])")
    assert (x0, x1) == (y0, y1)
    assert x1 != x0
    page.unroute("**/api/curve?*")


def test_the_limit_of_a_threshold_says_what_moves_it(page, records) -> None:
    show(page, "threshold.gapwalk")
    page.click("#answer-ends button")
    until(page, "Boolean(gapwalk.movers.found)")
    assert page.evaluate("gapwalk.movers.found.at") == pytest.approx(records["threshold"].value, rel=1e-12)
    (from_, to) = page.evaluate("(({from, to}) => [from, to])(gapwalk.diagram.arrows[0])")
    assert from_ == pytest.approx([records["threshold"].at, records["threshold"].value], rel=1e-12)
    assert to[0] == from_[0] != to[1]
    shaded = "import('/static/overlay.js').then((m) => m.shapesOf(gapwalk.diagram.over, () => '')[0])"
    ends = page.evaluate(f"{shaded}.then(({{ x0, x1 }}) => [x0, x1])")  # nothing is known beyond the studied range
    assert ends == pytest.approx([records["threshold"].low, records["threshold"].high])


def test_panels_below_follow_the_diagram(page) -> None:
    show(page, "rattle.gapwalk")
    page.click("#fit")
    page.click("#nearer")
    low, high = page.evaluate("gapwalk.diagram.place._fullLayout.xaxis.range")
    texts = page.locator("#below > div:first-child text[text-anchor=middle]")
    ticks = [float(text) for text in texts.all_text_contents()]
    assert ticks
    assert all(low <= tick <= high for tick in ticks)
    # a tick of the panel is below that of the diagram
    tick = texts.first.bounding_box()
    assert tick is not None
    exact = page.evaluate(
        """(v) => {
            const { place } = gapwalk.diagram, { xaxis } = place._fullLayout;
            return place.getBoundingClientRect().left + xaxis._offset + xaxis.l2p(v);
        }""",
        ticks[0],
    )
    assert tick["x"] + tick["width"] / 2 == pytest.approx(exact, abs=1.5)


@pytest.mark.parametrize("format", ["svg", "png"])
def test_the_saved_picture_has_the_bands(page, format) -> None:
    show(page, "rattle.gapwalk")
    with page.expect_download() as download:
        page.click(f"#save-{format}")
    content = Path(download.value.path()).read_bytes()
    assert len(content) > 10_000
    if format == "svg":
        assert content.count(b"rgb(253, 243, 211)") >= 1  # the tint of rattle on one side


@pytest.mark.parametrize(("width", "height", "scheme"), [(1280, 720, "dark"), (390, 844, "light")])
def test_it_fits_on_small_screens(page, width, height, scheme) -> None:
    show(page, "tolerance.gapwalk")
    page.emulate_media(color_scheme=scheme)
    page.set_viewport_size({"width": width, "height": height})
    page.wait_for_timeout(300)
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    page.emulate_media(color_scheme="light")
    page.set_viewport_size({"width": 1280, "height": 800})


def test_rattle_is_computed_from_the_page_and_shown_at_its_end(page) -> None:
    opened(page, "model.toml")
    assert page.is_hidden("#answer")
    page.click("#compute")
    until(page, "gapwalk.page.results[0]?.state === 'done' && Boolean(gapwalk.answer.content) && !gapwalk.answer.grows")
    assert "teeth rattles from the beginning of the range, 0.9, to 1.3" in page.inner_text("#answer-text")
    until(page, "gapwalk.curves.all.size === 2")
    assert page.evaluate("document.querySelector('#results .message.done').clientHeight") < 70  # three lines
    page.click("#answer-close")
    assert page.is_hidden("#answer")
    page.click("#results button:text-is('Show')")
    until(page, "Boolean(gapwalk.answer.content)")

    page.click("#settle")
    until(page, "gapwalk.page.results[1]?.state === 'done' && Boolean(gapwalk.motion.motion)")
    opened(page, "rattle.gapwalk")
    opened(page, "model.toml")  # the bands come back, although a settled motion was stored after them
    until(page, "gapwalk.answer.content?.sentences[0].startsWith('teeth rattles')")


GEARS = (
    TRAIN[: TRAIN.index("[[harmonic]]")]
    + """
[[measured]]
name = "gas"
file = "torque.csv"
acts_on = { flywheel = 1.0 }

[study]
kind = "rattle"
parameter = "speed"
from = "850 rpm"
to = "950 rpm"
steps = 4
starts = 0
search = 0
"""
)


@pytest.fixture(scope="module")
def gears(tmp_path_factory) -> Path:
    """A train whose two gears rattle without period, its torque in a file beside it, and its bands of rattle."""
    folder = tmp_path_factory.mktemp("gears")
    angles = np.arange(0.0, 360.0, 6.0)
    rows = [
        f"{angle:g},{torque:.6f}" for angle, torque in zip(angles, 60.0 * np.sin(np.radians(2 * angles)), strict=True)
    ]
    (folder / "torque.csv").write_text("\n".join(["crank angle [deg],torque [N m]", *rows]), encoding="utf-8")
    (folder / "gears.toml").write_text(GEARS, encoding="utf-8")
    gw.run(gw.read_study(folder / "gears.toml"), folder / "gears.gapwalk")
    return folder


def test_the_worst_gap_is_chosen_and_another_one_turns_headline_and_diagram(gears) -> None:
    found = gw.open_result(gears / "gears.gapwalk").finding.record
    worst = max(found.worst, key=lambda each: each.severity.rms).severity.gap
    (other,) = [each for each in found.gaps if each != worst]
    with serving(gears / "gears.gapwalk") as address, watched(address, height=800) as page:
        show(page, "gears.gapwalk")
        for gap in (worst, other):
            page.select_option("#answer-contact", gap)
            until(page, f"document.getElementById('y').value === 'half.{gap}' && !gapwalk.page.updating")
            assert page.inner_text("#answer-text").startswith(found.sentence(gap))
            until(page, "gapwalk.diagram.over.layers.some(({ x }) => x.length)")
            layer = "gapwalk.diagram.over.layers.find(({ look, x }) => look === 'rising' && x.length)"
            place = found.system.coordinates.index(gap)
            (rising,) = [each for each in found.sweeps if each.met == "rising"]
            half = {m.value: np.ptp(m.extremes[[0, 2], place]) / 2 for m in rising.lanes if not m.period}
            x, y = page.evaluate(f"[{layer}.x, {layer}.y]")
            assert y == pytest.approx([half[value] for value in x])
        laid, box = "gapwalk.diagram.place._fullLayout", page.locator("#diagram .plot").bounding_box()
        at = f"[{laid}.xaxis._offset + {laid}.xaxis.l2p({x[0]}), {laid}.yaxis._offset + {laid}.yaxis.l2p({y[0]})]"
        left, top = page.evaluate(at)
        page.mouse.click(box["x"] + left, box["y"] + top)
        until(page, f"gapwalk.page.chosen === null && document.getElementById('error').innerText.includes('{x[0]:g}')")
        assert float(page.input_value("#parameters [data-name=speed] input[type=number]")) == x[0]


def test_settled_motions_are_clicked_listed_and_saved_over_any_axes(gears, monkeypatch) -> None:
    monkeypatch.setattr("gapwalk.answers.settled_curve.STEPS", 40)
    text = GEARS[: GEARS.index("[study]")]
    study = '[study]\nkind = "response"\nparameter = "speed"\nfrom = "899 rpm"\nto = "898 rpm"\nstart = "settle"\n'
    (gears / "settled.toml").write_text(text + study, encoding="utf-8")
    gw.run(gw.read_study(gears / "settled.toml"), gears / "settled.gapwalk")
    (branch,) = gw.open_result(gears / "settled.gapwalk").branches
    assert branch.points == ()
    bands, system = branch.bands, branch.system
    names, first = list(system.coordinates), system.coordinates[0]
    with serving(gears / "settled.gapwalk") as address, watched(address, height=800) as page:
        show(page, "settled.gapwalk")
        page.click("#table-open")
        for across, up in (("speed", f"half.{first}"), (f"max.{names[1]}", f"mean.{first}")):
            page.select_option("#x", across)
            page.select_option("#y", up)
            until(page, f"gapwalk.diagram.over.settled?.x.length === {len(bands)} && !gapwalk.page.updating")
            x, y = page.evaluate("[gapwalk.diagram.over.settled.x, gapwalk.diagram.over.settled.y]")
            low, mean, high = np.array([band.extremes for band in bands]).transpose(1, 2, 0)
            known = {"speed": [band.value for band in bands], f"half.{first}": (high[0] - low[0]) / 2}
            known |= {f"max.{names[1]}": high[1], f"mean.{first}": mean[0]}
            assert x == pytest.approx(known[across], rel=1e-6)
            assert y == pytest.approx(known[up], rel=1e-6)
            rows = page.locator("#table-rows tr[data-index]")
            assert rows.count() == len(bands)
            rows.nth(7).click()
            assert page.evaluate("gapwalk.page.settled") == 7
            assert page.evaluate("gapwalk.diagram.mark") == [x[7], y[7]]
            assert "not periodic" in page.inner_text("#error p")
            assert float(page.input_value("#parameters [data-name=speed] input[type=number]")) == bands[7].value
            laid, box = "gapwalk.diagram.place._fullLayout", page.locator("#diagram .plot").bounding_box()
            at = f"[{laid}.xaxis._offset + {laid}.xaxis.l2p({x[20]}), {laid}.yaxis._offset + {laid}.yaxis.l2p({y[20]})]"
            left, top = page.evaluate(at)
            page.mouse.click(box["x"] + left, box["y"] + top)
            assert page.evaluate("gapwalk.page.settled") != 7
        words = page.locator("#table-rows tr[data-index='7'] td").all_inner_texts()
        assert all(f"{name} " in words[-1] for name in ("mesh1", "mesh2") if bands[7].total)
        page.select_option("#y", f"rms.{first}")
        until(page, "document.getElementById('empty').innerText.startsWith('Of settled motions')")
        with page.expect_download() as load:
            page.click("#results [data-action$=' bands']")
        lines = Path(load.value.path()).read_text().splitlines()
        assert len(lines) == 1 + len(bands)
        assert lines[1].startswith(f"{bands[0].value!r},0,")


def test_what_starts_from_a_file_with_measured_torque_is_of_its_model(gears) -> None:
    shown = Exploration(Workspace(gears), "gears.toml")
    _, task = plan(Settle(do="settle", start=None, values={"speed": 900.0}), shown)
    assert mark_of(task.study) == shown.model
    assert task.study.system["speed"] == 900.0


@pytest.mark.parametrize("name", ["rattle", "threshold", "run-up"])
def test_a_saved_page_has_the_answer(page, folder, tmp_path, name) -> None:
    path, wrong = tmp_path / f"{name}.html", []
    gw.save_html(gw.open_result(folder / f"{name}.gapwalk"), path, motions=4)
    kept = new_page(page.context.browser, offline=True)
    kept.on("pageerror", lambda error: wrong.append(str(error)))
    kept.goto(path.as_uri())
    until(kept, "Boolean(window.gapwalk?.answer?.content) && gapwalk.diagram.over !== null")
    content = kept.evaluate("gapwalk.answer.content")
    assert kept.locator("#answer-text span").all_inner_texts() == content["sentences"]
    assert [kept.input_value("#x"), kept.input_value("#y")] == content["axes"]
    until(kept, f"document.querySelectorAll('#below svg').length === {len(content.get('below', []))}")
    if content.get("ends"):
        kept.click("#answer-ends button")
        until(kept, "gapwalk.movers.found?.rows.length > 0 && gapwalk.diagram.arrows.length > 0")
    assert wrong == []
    kept.context.close()


def test_the_first_special_points_of_a_branch_are_saved_with_what_moves_them(page, tmp_path) -> None:
    path, wrong = tmp_path / "stop.html", []
    (folder := tmp_path / "stop.toml").write_text(STOP.replace("to = 0.9", "to = 1.4"), encoding="utf-8")
    branch = gw.run(gw.read_study(folder)).branches[0]
    gw.save_html(branch, path, motions=4, gradients=1)
    with pytest.raises(ModelError, match="gradients is -1"):
        gw.save_html(branch, path, gradients=-1)
    kept = new_page(page.context.browser, offline=True)
    kept.on("pageerror", lambda error: wrong.append(str(error)))
    kept.goto(path.as_uri())
    until(kept, "Number(document.body.dataset.branches) === 1")
    curve = "[...gapwalk.curves.all.values()][0]"
    choose = f"((c) => gapwalk.page.choice.choose({{{{ curve: c, index: c.node.indexOf(-1 - {{}}) }}}}))({curve})"
    kept.evaluate("gapwalk.movers.open()")
    kept.evaluate(choose.format(0))
    until(kept, "gapwalk.movers.found?.rows.length > 0")
    first = branch.special_points[0]
    assert kept.evaluate("gapwalk.movers.found.at") == first.value
    slopes = first.gradient()
    row = kept.evaluate("gapwalk.movers.found.rows[0]")
    assert row["slope"] == slopes[row["name"]]
    kept.evaluate(choose.format(1))  # the next one has its motion alone
    until(kept, "document.getElementById('movers').hidden")
    assert wrong == []
    kept.context.close()


def test_pictures_are_drawn_when_the_page_asks_for_them(folder, client) -> None:
    (folder / "self-excited.gapwalk").write_bytes(result_file("self-excited"))
    assert answer(client, "self-excited")["pictures"] == ["equilibria and motions over the parameter"]
    asked = {"file": "self-excited.gapwalk", "result": ""}
    drawn = client.get("/api/picture", params={**asked, "number": 0}).json()
    assert (drawn["form"], drawn["content"][:5]) == ("svg", "<?xml")
    missing = client.get("/api/picture", params={**asked, "number": 1})
    assert missing.status_code == 400
    assert "the answer has 1 pictures, but none with the number 1" in missing.json()["error"]
    assert answer(client, "rattle")["pictures"] == []


def test_bands_are_drawn_before_their_study_ends_and_stay_when_it_is_stopped(tmp_path) -> None:
    endless = RATTLE.replace("starts = 4", "starts = 100000\nsearch = 40")  # after two sweeps that are done at once
    (tmp_path / "model.toml").write_text(endless, encoding="utf-8")
    with serving(tmp_path / "model.toml") as address, watched(address, height=800) as page:
        page.click("#compute")
        until(page, "gapwalk.page.results[0]?.answer && gapwalk.diagram.over?.shades.length")
        state, done, total = page.evaluate("(({ state, done }) => [state, ...done])(gapwalk.page.results[0])")
        assert state == "running"
        assert 0 < done < total == 4
        assert all(each.startswith("So far: ") for each in page.locator("#answer-text span").all_inner_texts())
        until(page, "gapwalk.curves.all.size === 2 && !gapwalk.page.updating")  # both sweeps; the rest does not end
        page.select_option("#y", "max.x")
        page.click("#status-stop")
        until(page, "gapwalk.page.results[0].state === 'stopped' && gapwalk.answer.content.notes.length")
        assert page.input_value("#y") == "max.x"
        ((low, high),) = page.evaluate("gapwalk.diagram.over.shades.map(({ low, high }) => [low, high])")
        assert all(each.endswith(" (incomplete)") for each in page.locator("#answer-text span").all_inner_texts())
    (path,) = tmp_path.rglob("*.gapwalk")
    found = gw.open_result(path).finding.record
    assert not found.complete
    assert (low, high) == pytest.approx(
        (min(band.low.value for band in found.bands), max(band.high.value for band in found.bands))
    )


def test_what_is_tried_for_a_threshold_is_drawn_before_its_end(tmp_path) -> None:
    endless = THRESHOLD.replace("values = 8", "values = 4000\nworkers = 1")
    (tmp_path / "model.toml").write_text(endless, encoding="utf-8")
    with serving(tmp_path / "model.toml") as address, watched(address, height=800) as page:
        page.click("#compute")
        until(page, "gapwalk.page.results[0]?.answer && gapwalk.diagram.over?.layers.length === 2")
        assert page.evaluate("gapwalk.page.results[0].state") == "running"
        assert page.inner_text("#answer-text").startswith("So far: teeth rattles at mean.x = ")
        page.click("#status-stop")
        until(page, "document.getElementById('answer-text').innerText.endsWith(' (incomplete)')")
        drawn = page.evaluate("gapwalk.answer.content.layers.map(({ x }) => x.length)")
    (path,) = tmp_path.rglob("*.gapwalk")
    rattles = gw.open_result(path).finding.record.points[:, 2]
    assert drawn == [np.sum(rattles == 0.0), np.sum(rattles > 0.0)]

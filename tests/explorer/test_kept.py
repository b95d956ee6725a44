"""A result as one HTML file: what lies in it, and what a browser without a network makes of it."""

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from playwright.sync_api import Page

import gapwalk as gw
from gapwalk.errors import ModelError
from gapwalk.explorer.saved_page import STEPS, Blob, content_of, lines_of
from tests.explorer.browser import browser, new_page, until

TITLE = "</script><script>window.stolen = 1</script><b>&amp;"


def a_stop() -> gw.System:
    return gw.System(
        ["x"],
        stiffness=[[1.0]],
        damping=[[0.05]],
        contacts=[gw.stop("stop", {"x": 1.0}, clearance=1.0, stiffness=20.0, impact_damping=0.1)],
        harmonics=[gw.Harmonic(0.2, {"x": 1.0})],
        frequency=0.7,
    )


@pytest.fixture(scope="module")
def branch() -> gw.Branch:
    return gw.follow(gw.find_orbit(a_stop()), "frequency", to=1.2)


@pytest.fixture(scope="module")
def file(branch, tmp_path_factory) -> Path:
    """The branch, with the motions of every few points."""
    path = tmp_path_factory.mktemp("kept") / "stop.html"
    gw.save_html(branch, path, measure="max.x", title=TITLE, motions=len(branch.points) // 3)
    return path


@pytest.fixture(scope="module")
def page(file) -> Iterator[Page]:
    """The file in a browser that reaches nothing, with an ear for errors."""
    wrong: list[str] = []
    with browser() as chrome:
        page = new_page(chrome, viewport={"width": 1280, "height": 800}, offline=True)
        page.on("pageerror", lambda error: wrong.append(str(error)))
        page.on("console", lambda said: wrong.append(said.text) if said.type in ("error", "warning") else None)
        own = (file.as_uri(), "data:", "blob:")
        page.on("request", lambda asked: None if asked.url.startswith(own) else wrong.append(asked.url))
        page.goto(file.as_uri())
        until(page, "Number(document.body.dataset.branches) === 1")
        yield page
    assert wrong == []


@given(st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=50))
def test_a_drawn_curve_is_off_by_less_than_a_level(values) -> None:
    blob = Blob()
    kept = blob.drawn(values)
    low_bytes, high_bytes = np.frombuffer(blob.content, dtype=np.uint8).reshape(2, -1).astype(int)
    levels = np.cumsum(np.cumsum(low_bytes + 256 * high_bytes)) % 65536  # as saved_data.js does
    step = (kept["high"] - kept["low"]) / (STEPS - 1)
    np.testing.assert_allclose(kept["low"] + levels * step, values, rtol=0, atol=0.51 * step + 1e-9)


def test_the_diagram_is_the_branch(page, branch) -> None:
    assert page.evaluate("gapwalk.curves.all.get('/0').count") == len(branch.points)
    x, y, node = (np.array(page.evaluate(f"[...gapwalk.curves.all.get('/0').{each}]")) for each in ("x", "y", "node"))
    np.testing.assert_array_equal(x[node >= 0], branch.values)
    np.testing.assert_allclose(y[node >= 0], branch.measure("max.x"), rtol=1e-7)
    assert (node < 0).sum() == len(branch.special_points)


def test_a_title_is_only_a_title(page) -> None:
    assert page.inner_text("#title") == TITLE
    assert page.title() == f"{TITLE} – gapwalk"
    assert page.evaluate("window.stolen") is None


def test_nothing_that_needs_a_server_is_shown(page) -> None:
    assert page.locator(".live").count() > 0
    assert page.locator(".live:visible").count() == 0


def test_a_click_shows_the_nearest_motion_that_is_kept(page, branch) -> None:
    place = page.evaluate(
        """() => {
            const { diagram, curves } = gapwalk, curve = curves.all.get("/0"), k = curve.node.indexOf(6);
            const { xaxis, yaxis } = diagram.place._fullLayout, box = diagram.place.getBoundingClientRect();
            return [box.left + xaxis._offset + xaxis.l2p(curve.x[k]), box.top + yaxis._offset + yaxis.l2p(curve.y[k])];
        }"""
    )
    page.mouse.click(*place)
    until(page, "document.querySelectorAll('#history path.curve').length === 1")
    point = page.evaluate("gapwalk.page.chosen.start.point")
    motions = page.evaluate("Object.keys(gapwalk.page.about.branches[0].motions).map(Number)")
    assert 6 not in motions
    assert point in motions
    orbit = branch.points[point].orbit
    theta, q = (np.array(page.evaluate(f"gapwalk.page.motion.motion.{each}")) for each in ("theta", "q.x"))
    size = np.ptp(q)
    assert theta[0] == 0.0
    np.testing.assert_allclose([q.max(), q.min()], [orbit.measure("max.x"), orbit.measure("min.x")], atol=2e-3 * size)
    np.testing.assert_allclose(q[0], orbit.state[0], atol=size / STEPS)
    assert page.locator("#multipliers .dot").count() == 2
    assert "points have their motions in this file" in page.inner_text("#note")


def test_arrow_keys_go_from_motion_to_motion(page, branch) -> None:
    page.focus("#diagram")
    page.keyboard.press("Home")
    met = [page.evaluate("gapwalk.page.chosen.start.point")]
    for _ in range(3):
        page.keyboard.press("ArrowRight")
        met.append(page.evaluate("gapwalk.page.chosen.start.point ?? -1 - gapwalk.page.chosen.start.special"))
    assert met[0] == 0
    assert len(set(met)) == 4
    assert set(met) <= set(page.evaluate("Object.keys(gapwalk.page.about.branches[0].motions).map(Number)"))
    page.keyboard.press("s")
    special = page.evaluate("gapwalk.page.chosen.start.special")
    if special is not None:
        assert page.evaluate("gapwalk.page.chosen.special.value") == branch.special_points[special].value
        until(page, "document.querySelectorAll('#log tr').length > 1")


def test_other_axes_show_the_same_points(page, branch) -> None:
    page.focus("#diagram")
    page.keyboard.press("Home")
    page.select_option("#y", "min.x")
    until(page, "gapwalk.diagram.names.y.startsWith('minimum')")
    y, node = (np.array(page.evaluate(f"[...gapwalk.curves.all.get('/0').{each}]")) for each in ("y", "node"))
    np.testing.assert_allclose(y[node >= 0], branch.measure("min.x"), rtol=1e-7)
    until(page, "gapwalk.page.chosen.curve === gapwalk.curves.all.get('/0')")  # the chosen point stays chosen
    index = page.evaluate("gapwalk.page.chosen.index")
    assert node[index] == page.evaluate("gapwalk.page.chosen.start.point") == 0
    assert page.evaluate("gapwalk.diagram.mark[1]") == y[index]


def test_a_mean_load_is_not_the_mean_of_a_coordinate(tmp_path) -> None:
    loaded = gw.System(
        ["x"],
        stiffness=[[4.0]],
        damping=[[0.05]],
        mean={"x": 0.5},
        harmonics=[gw.Harmonic(0.2, {"x": 1.0})],
        frequency=0.7,
    )
    branch = gw.follow(gw.find_orbit(loaded), "mean.x", to=1.0)
    blob = Blob()
    content = content_of(lines_of(branch), "mean.x", "", 10, blob)
    assert (content["x"], content["y"]) == ("mean.x", "measure:mean.x")
    words = {each["name"]: each["words"] for each in content["quantities"]}
    assert (words["mean.x"], words["measure:mean.x"]) == ("mean load on x", "mean of x")
    kept = content["branches"][0]["quantities"]
    load = np.frombuffer(blob.content, "<f8", kept["mean.x"]["n"], kept["mean.x"]["at"])
    mean = np.frombuffer(blob.content, "<f4", kept["measure:mean.x"]["n"], kept["measure:mean.x"]["at"])
    assert load[[0, -1]].tolist() == [0.5, 1.0]
    np.testing.assert_allclose(mean, load / 4.0, rtol=1e-6)  # the static deflection of the linear system


def test_nothing_is_named_that_would_be_fetched(file) -> None:
    text = re.sub(r'<script type="text/plain".*?</script>', "", file.read_text(encoding="utf-8"), flags=re.S)
    assert "/static/" not in text
    assert not re.findall(r'(?:src|href)="(?!data:|#)[^"]*"', text)


def test_a_settled_motion_is_shown_at_once(page, tmp_path) -> None:
    path = tmp_path / "settled.html"
    gw.save_html(gw.settle(a_stop()), path, title="Settled")
    assert page.context.browser is not None
    other = new_page(page.context.browser, offline=True)
    other.goto(path.as_uri())
    until(other, "document.querySelectorAll('#history path.curve').length === 1")
    assert not other.is_visible("#picture")


@pytest.mark.slow
def test_loci_and_sweeps_are_saved_with_their_points(tmp_path) -> None:
    branch = gw.follow(gw.find_orbit(a_stop()), "frequency", to=0.9)
    (graze,) = [each for each in branch.special_points if each.kind == "grazing"][:1]
    locus = gw.follow_locus(graze, "frequency", "harmonic1.amplitude", ((0.7, 0.9), (0.1, 0.3)))
    plane = content_of(lines_of(locus), "half.x", "", 10, Blob())
    assert (plane["x"], plane["y"]) == ("frequency", "harmonic1.amplitude")
    assert [each["second"] for each in plane["branches"]] == ["harmonic1.amplitude"]
    sweep = gw.sweep(a_stop(), "frequency", (0.7, 0.75), steps=3)
    blob = Blob()
    content = content_of(lines_of(sweep), "half.x", "", 10, blob)
    assert (content["x"], content["y"]) == ("frequency", "section.x")
    assert {each["name"]: each["words"] for each in content["quantities"]}["section.x"].startswith("x(0)")
    layer = content["answer"]["layers"][0]
    assert layer["x"] == sorted(sweep.values.tolist())
    orbits = [gw.find_orbit(a_stop().at({"frequency": each})) for each in sweep.values.tolist()]
    np.testing.assert_allclose(layer["y"], [orbit.state[0] for orbit in orbits], atol=1e-5)
    for found in (locus, sweep):
        gw.save_html(found, tmp_path / "found.html")


def test_a_saved_motion_has_its_spectrum_and_its_section(page, branch) -> None:
    page.focus("#diagram")
    page.keyboard.press("Home")
    until(page, "document.querySelectorAll('#spectrum .bar').length > 3")
    until(page, "document.querySelectorAll('#section .dot').length === 1")
    orbit = branch.points[0].orbit
    shown = page.evaluate("gapwalk.motion.details")
    signal = shown["signal"]
    order = int(np.argmin(np.abs(np.array(shown["orders"]) - 1.0)))
    assert shown["amplitudes"][order] == pytest.approx(orbit.measure(f"h1.{signal}"), rel=1e-3)
    page.evaluate(
        """(() => {
            const curve = gapwalk.curves.all.get("/0");
            gapwalk.diagram.chosen({ curve, index: curve.node.indexOf(-1) });
        })()"""
    )
    until(page, "gapwalk.page.chosen.special && document.getElementById('next-text').textContent.startsWith('At Ω')")
    assert page.locator("#next-steps button").all_inner_texts() == ["Hear it", "Compare others with it"]
    assert shown["section"]["q"][0] == pytest.approx(orbit.state[0], rel=1e-6)


def test_what_has_no_motions_is_refused(tmp_path) -> None:
    spectrum = gw.analysis.spectrum(gw.find_orbit(a_stop()), "x")
    with pytest.raises(ModelError, match="Spectrum has none; write --format svg"):
        gw.save_html(spectrum, tmp_path / "spectrum.html")  # pyright: ignore[reportArgumentType]
    with pytest.raises(ModelError, match="motions=400"):
        gw.save_html(gw.find_orbit(a_stop()), tmp_path / "orbit.html", motions=0)

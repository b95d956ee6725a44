"""The page in a browser, served by the command: what a user does in the first five minutes."""

import shutil
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Page

import gapwalk as gw
from tests.explorer.browser import READY, browser, choose_special, chromium, new_page, opened, served, until
from tests.explorer.conftest import CLUTCH, STOP

LONG = STOP + "\n[study.walk]\ninitial_step = 1e-5\nlargest_step = 1e-5\nmax_points = 1000000\n"
DONE = "gapwalk.page.results.length === {} && gapwalk.page.results.every((r) => r.state === 'done')"


@pytest.fixture(scope="module")
def workspace(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("page")
    shutil.copy(CLUTCH, folder)
    shutil.copy(CLUTCH, folder / "torus.toml")
    (folder / "long.toml").write_text(LONG, encoding="utf-8")
    (folder / "stop.toml").write_text(STOP, encoding="utf-8")
    shutil.copy(CLUTCH.with_name("drivetrain.toml"), folder)
    (folder / "bad.toml").write_text("coordinates = 3\n", encoding="utf-8")
    return folder


@pytest.fixture(scope="module")
def address(workspace) -> Iterator[str]:
    """Of the server, as the command prints it."""
    chromium()
    with served(workspace / "clutch.toml") as address:
        yield address


@pytest.fixture(scope="module")
def page(address) -> Iterator[Page]:
    """The page of the server, with an ear for errors and for requests to anyone else: there are none."""
    wrong: list[str] = []
    own = (address.partition("?")[0], "blob:", "data:")
    with browser() as chrome:
        page = new_page(chrome, viewport={"width": 1280, "height": 720}, accept_downloads=True)
        page.on("pageerror", lambda error: wrong.append(str(error)))
        page.on("request", lambda asked: None if asked.url.startswith(own) else wrong.append(asked.url))
        page.goto(address)
        until(page, READY)
        yield page
    assert wrong == []


def computed(page: Page) -> str:
    """Compute figure 13, unless a test before has; the name of the branch."""
    opened(page, "clutch.toml")
    if not page.evaluate("gapwalk.page.results.length"):
        page.click("#compute")
    until(page, "gapwalk.page.results[0]?.state === 'done'")
    name = page.evaluate("gapwalk.page.results[0].key") + "/0"
    until(page, f"gapwalk.curves.all.get('{name}')?.count > 200")
    return name


def place_of(page: Page, name: str, point: int) -> list[float]:
    """Where a point of a branch is on the screen."""
    return page.evaluate(
        """([name, point]) => {
            const curve = gapwalk.curves.all.get(name), k = curve.node.indexOf(point);
            const { xaxis, yaxis } = gapwalk.diagram.place._fullLayout;
            const box = gapwalk.diagram.place.getBoundingClientRect();
            return [box.left + xaxis._offset + xaxis.l2p(curve.x[k]), box.top + yaxis._offset + yaxis.l2p(curve.y[k])];
        }""",
        [name, point],
    )


def test_figure_13_is_computed_a_click_shows_a_motion_and_a_flip_leads_on(page, workspace) -> None:
    name = computed(page)
    (result,) = gw.open_result(next((workspace / "clutch.explorer").glob("*.gapwalk"))).branches
    until(page, f"gapwalk.curves.all.get('{name}').count === {len(result.points)}")
    x, y = place_of(page, name, 30)  # a click beside a point chooses it
    page.mouse.click(x + 1, y + 1)
    until(page, "Boolean(gapwalk.motion.motion)")
    number = page.evaluate("gapwalk.page.chosen.start.point")
    assert abs(number - 30) <= 1
    shown = np.array(page.evaluate("gapwalk.motion.motion.q.q1"))
    np.testing.assert_allclose(shown[0], result.points[number].orbit.state[0], rtol=1e-6)
    assert page.locator("#history path.curve").count() == 1
    # the sliders show the values of that motion, which are not those of the file
    frequency = result.points[number].value
    assert page.evaluate("gapwalk.motion.motion.parameters.frequency") == frequency != result.points[0].value
    until(page, f"document.querySelector(\".parameter[data-name='frequency'] input\").valueAsNumber === {frequency!r}")
    until(page, "document.querySelectorAll('#section .dot').length === 1")
    # on to the branch of twice the period
    choose_special(page, "flip")
    until(page, "!document.getElementById('switch').disabled")
    page.click("#switch")
    until(page, DONE.format(2))
    until(page, "gapwalk.curves.all.size === 2")
    assert page.evaluate("[...gapwalk.curves.all.values()].map((c) => c.period)") == [1, 2]
    # all of it is there after a reload
    page.reload()
    until(page, "window.gapwalk?.curves.all.size === 2")


def test_keys_walk_along_the_branch_and_say_where(page) -> None:
    computed(page)
    page.focus("#diagram")
    page.keyboard.press("Home")
    first = page.inner_text("#chosen")
    page.keyboard.press("ArrowLeft")  # the branch was walked from 2 downwards
    page.keyboard.press("Shift+ArrowLeft")
    assert page.evaluate("gapwalk.page.chosen.start.point") == 11
    assert page.inner_text("#chosen") != first
    # the second of two quick steps is the one that is shown
    until(page, "gapwalk.motion.place?.point === 11 && document.querySelectorAll('#spectrum .bar').length > 5")
    assert "Ω" in page.inner_text("#motion-title")


def test_the_chosen_point_stays_chosen_over_other_axes(page) -> None:
    name = computed(page)
    before = page.input_value("#y")
    page.focus("#diagram")
    page.keyboard.press("Home")
    page.keyboard.press("Shift+ArrowLeft")
    title = page.inner_text("#chosen")
    heights = []
    for measure in ("min.q1", before):
        page.select_option("#y", measure)
        node = f"gapwalk.curves.all.get('{name}')"
        until(page, f"document.getElementById('y').value === '{measure}' && !gapwalk.page.updating && Boolean({node})")
        until(page, f"gapwalk.diagram.mark?.[1] === {node}.y[10] && gapwalk.page.chosen.curve === {node}")
        heights.append(page.evaluate("gapwalk.diagram.mark[1]"))
        assert page.inner_text("#chosen") == title
    assert heights[0] != heights[1]


def test_what_is_shown_can_be_saved(page) -> None:
    computed(page)
    found = {}
    for name, button in {
        "svg": "#save-svg",
        "png": "#save-png",
        "csv": "#results li:first-child button:text-is('CSV')",
        "py": "#results li:first-child button:text-is('Python')",
    }.items():
        with page.expect_download() as download:
            page.click(button)
        path = download.value.path()
        found[name] = path.read_bytes()
        assert download.value.suggested_filename.endswith(f".{name}")
    assert found["svg"].startswith(b"<svg")
    assert found["png"].startswith(b"\x89PNG")
    assert found["csv"].count(b"\n") > 200
    assert b"gw.read_study(io.StringIO(MODEL))" in found["py"]


def test_a_long_walk_grows_and_is_stopped(page) -> None:
    opened(page, "long.toml")
    page.click("#compute")
    until(page, "[...gapwalk.curves.all.values()][0]?.count > 10")
    count = page.evaluate("[...gapwalk.curves.all.values()][0].count")
    until(page, f"[...gapwalk.curves.all.values()][0].count > {count}")
    page.reload()  # the job goes on
    until(page, f"[...(window.gapwalk?.curves.all.values() ?? [])][0]?.count > {count}")
    page.click("#results button:text-is('Stop')")
    until(page, "gapwalk.page.results[0].state === 'stopped'")
    assert page.locator("#results button:text-is('Resume')").count() == 1


def test_a_bad_file_is_told_in_sentences_and_another_can_be_opened(page) -> None:
    page.select_option("#file", "bad.toml")
    until(page, "!document.getElementById('error').hidden")
    assert "bad.toml" in page.inner_text("#error")
    page.select_option("#file", "stop.toml")
    until(page, "gapwalk.page.about?.file === 'stop.toml'")
    assert page.is_hidden("#error")


def test_a_file_is_opened_while_curves_of_another_are_on_their_way(page) -> None:
    computed(page)
    held, released = [], []
    page.route("**/api/curve?*", lambda route: route.continue_() if released else held.append(route))
    page.select_option("#y", "min.q3")
    until(page, "gapwalk.page.updating")
    page.select_option("#file", "bad.toml")
    until(page, "!document.getElementById('error').hidden")
    released.append(True)
    for route in held:
        route.continue_()
    until(page, "!gapwalk.page.updating")
    page.unroute("**/api/curve?*")
    assert "bad.toml" in page.inner_text("#error")
    page.select_option("#file", "stop.toml")
    until(page, "gapwalk.page.about?.file === 'stop.toml'")


def test_a_motion_settles_at_the_values_of_the_sliders(page) -> None:
    opened(page, "stop.toml")
    page.click("summary:text-is('Values')")
    if not page.evaluate("document.getElementById('values-part').open"):  # a test before may have turned a value
        page.click("#values-part > summary")
    page.fill("#filter", "frequency")
    page.fill("[aria-label='excitation frequency Ω']", "0.6")
    page.click("#settle")
    until(page, "gapwalk.curves.settled.size === 1")
    until(page, "gapwalk.motion.motion?.parameters.frequency === 0.6")
    assert "stable" in page.inner_text("#motion-text")


def test_each_signal_of_a_train_is_shown_and_none_in_the_place_of_another(page, workspace) -> None:
    opened(page, "drivetrain.toml")
    signals = page.evaluate("[...document.querySelectorAll('#signal option')].map((option) => option.value)")
    assert len(set(signals)) == len(signals)
    page.click("#compute")
    until(page, "gapwalk.page.results[0]?.state === 'done' && gapwalk.curves.all.size > 0")
    page.focus("#diagram")
    page.keyboard.press("Home")
    until(page, "Boolean(gapwalk.motion.motion)")
    result, *_ = (workspace / "drivetrain.explorer").glob("*.gapwalk")
    motion = gw.open_result(result).branches[0].points[0].orbit.motion(64)
    for signal in ("clutch", "clutch'", "clutch.force", "clutch.torque", "flywheel''"):
        page.select_option("#signal", signal)
        until(page, f'gapwalk.motion.details?.signal === "{signal}"')
        values = np.array(page.evaluate("gapwalk.motion.values"))
        assert np.ptp(values) == pytest.approx(np.ptp(motion.signal(signal)), rel=0.02), signal
        assert "clutch" in page.inner_text("#loop")


def test_what_has_no_place_in_the_diagram_is_said_to_have_none(page) -> None:
    opened(page, "torus.toml")
    assert "Nothing is computed yet." in page.inner_text("#empty")
    if not page.evaluate("document.getElementById('values-part').open"):  # a test before may have turned a value
        page.click("#values-part > summary")
    page.fill("#filter", "frequency")
    page.fill("[aria-label='excitation frequency Ω']", "0.4")
    page.click("#settle")
    until(page, "document.getElementById('empty').textContent.includes('does not repeat itself')")
    assert page.evaluate("[...document.querySelectorAll('#results button')].map((b) => b.textContent)") == [
        "Show",
        "Rename",
        "Delete",
        "CSV",
        "Python",
        "Result",
    ]
    page.click("#results button:text-is('Show')")
    until(page, "gapwalk.motion.motion?.period === null")


def test_nothing_is_cut_off_at_200_percent(page) -> None:
    computed(page)
    page.set_viewport_size({"width": 640, "height": 360})  # a window of 1280 x 720 at 200 %
    page.wait_for_timeout(100)
    assert page.evaluate("document.documentElement.scrollWidth") <= 640
    for part in ("#controls", "#diagram", "#motion"):
        page.locator(part).scroll_into_view_if_needed()
        box = page.locator(part).bounding_box()
        assert box is not None
        assert box["x"] >= 0
        assert box["x"] + box["width"] <= 640


def test_a_locus_is_followed_and_shown_in_its_plane(page) -> None:
    opened(page, "stop.toml")
    key = page.evaluate("gapwalk.page.results.length")
    page.click("#compute")
    until(page, f"gapwalk.page.results[{key}]?.state === 'done'")
    until(page, "gapwalk.curves.subject().at(-1)?.special.some((s) => s.kind === 'grazing')")
    assert page.is_disabled("#locus")
    page.evaluate(
        """(() => {
            const curve = gapwalk.curves.subject().at(-1);
            const special = curve.special.findIndex((s) => s.kind === "grazing");
            gapwalk.diagram.chosen({ curve, index: curve.node.indexOf(-1 - special) });
        })()"""
    )
    until(page, "!document.getElementById('locus').disabled")
    page.select_option("#locus-parameter", "harmonic1.amplitude")
    assert page.input_value("#locus-low") == "0.1"
    page.click("#locus")
    until(page, f"gapwalk.page.results[{key + 1}]?.state === 'done' && gapwalk.curves.hasLoci")
    assert page.input_value("#y") == "harmonic1.amplitude"
    assert page.locator("#legend .of-plane:visible").all_inner_texts() == ["locus of grazing"]
    x, y = page.evaluate("(() => { const c = gapwalk.curves.subject()[0]; return [[...c.x], [...c.y]]; })()")
    # the motion that just touches its stop, in closed form: amplitude 1 of the free oscillator
    exact = np.hypot(1.0 - np.square(x), 0.05 * np.array(x))
    np.testing.assert_allclose(y, exact, rtol=1e-6)
    page.evaluate("gapwalk.diagram.chosen({ curve: gapwalk.curves.subject()[0], index: 0 })")
    until(page, "gapwalk.motion.motion?.parameters.frequency === gapwalk.curves.subject()[0].x[0]")
    page.click(f"#results li:nth-child({key + 1}) button:text-is('Show')")  # back to the diagram
    until(page, "!gapwalk.curves.hasLoci && gapwalk.curves.all.size >= 1")
    until(page, "gapwalk.page.chosen.curve === null && gapwalk.diagram.mark === null")  # the locus has no place there
    page.click(f"#results li:nth-child({key + 2}) button:text-is('Show')")
    until(page, "gapwalk.curves.hasLoci && gapwalk.page.chosen.curve === gapwalk.curves.subject()[0]")
    assert page.evaluate("gapwalk.diagram.mark") == [x[0], y[0]]


@pytest.mark.slow  # a search that is found complete, and jobs that are stopped, have tests of their own
def test_a_search_is_begun_and_stopped(page) -> None:
    opened(page, "clutch.toml")
    count = page.evaluate("gapwalk.page.results.length")
    page.fill("#search-count", "40")
    page.click("#search")
    until(page, f"gapwalk.page.results[{count}]?.state === 'running'")
    assert "isolated branches" in page.inner_text("#results li:last-child")
    page.reload()
    until(page, f"window.gapwalk?.page.results[{count}]?.state === 'running'")
    page.click("#results button:text-is('Stop')")
    until(page, f"gapwalk.page.results[{count}].state === 'stopped'")
    until(page, "document.querySelectorAll('#results li:last-child button[data-action$=resume]').length === 1")

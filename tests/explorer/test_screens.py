"""The whole page on three machines: units everywhere, no labels that meet, and all of it by keyboard."""

import itertools
import re
from collections.abc import Iterator

import pytest
from playwright.sync_api import Page

from tests.explorer.browser import boxes, nameless, opened, overlap, tree_of, until, watched
from tests.explorer.machines import MACHINES
from tests.explorer.serving import serving
from tests.tiers import in_campaign

OTHERS = [name for name in MACHINES if name != "five"]
SIZES = [(1280, 720), (3840, 2160), (390, 844)]
SHOWN = "gapwalk.page.results[0]?.state === 'done' && gapwalk.curves.all.size === 1"
PANELS = ("history", "phase", "loop", "spectrum", "section", "multipliers")


@pytest.fixture(scope="module")
def page(tmp_path_factory) -> Iterator[Page]:
    """The page of the three machines; no errors on the console, and no request to anyone else."""
    folder = tmp_path_factory.mktemp("machines")
    for name, text in MACHINES.items():
        (folder / f"{name}.toml").write_text(text, encoding="utf-8")
    with serving(folder / "five.toml") as address, watched(address) as page:
        yield page


def shown(page: Page, name: str) -> None:
    """Show a machine with its diagram, and the motion at a special point."""
    if page.evaluate("gapwalk.page.about.file") != f"{name}.toml":
        opened(page, f"{name}.toml")
    if not page.evaluate("gapwalk.page.results.length"):
        page.click("#compute")
    until(page, SHOWN)
    until(page, "[...gapwalk.curves.all.values()][0].special.length > 0")
    if not page.evaluate("Boolean(gapwalk.page.chosen?.special && gapwalk.motion.details)"):
        page.focus("#diagram")
        page.keyboard.press("Home")
        page.keyboard.press("s")
        until(page, "Boolean(gapwalk.motion.details)")


@pytest.mark.parametrize(("width", "height"), SIZES)
@pytest.mark.parametrize(
    ("name", "scheme"),
    [*((name, "light") for name in MACHINES), ("five", "dark"), *(in_campaign(name, "dark") for name in OTHERS)],
)
def test_no_labels_meet_on_any_screen(page, name, width, height, scheme) -> None:
    page.emulate_media(color_scheme=scheme)
    page.set_viewport_size({"width": width, "height": height})
    shown(page, name)
    page.wait_for_timeout(250)
    apart(boxes(page, "#diagram .textpoint text"), "letters of special points")
    apart(boxes(page, "#diagram .xtick text, #diagram .ytick text, #diagram .g-xtitle, #diagram .g-ytitle"), "axes")
    apart(boxes(page, "#legend li"), "legend")
    apart(boxes(page, "#diagram .annotation"), "arrows")
    for panel in PANELS:
        apart(boxes(page, f"#{panel} text"), panel)
    apart(boxes(page, ".axes > *"), "choice of the axes")
    apart(boxes(page, "header > *"), "header")
    apart(
        boxes(page, "#controls button, #controls input, #controls select, #controls .hint, #controls summary"),
        "controls",
    )
    apart(boxes(page, "#motion figure, #motion .tools, #next, #motion-title"), "panels of the motion")
    words = boxes(page, "header > *, .axes > *, #legend li, #controls button, #controls select, #motion figure")
    assert all(left >= -1.0 and right <= width + 1.0 for left, _, right, _ in words)
    page.emulate_media(color_scheme="light")
    page.set_viewport_size({"width": 1280, "height": 720})


def apart(found: list, what: str) -> None:
    """Fail if two of some boxes overlap."""
    meeting = [(a, b) for a, b in itertools.combinations(found, 2) if overlap(a, b)]
    assert meeting == [], what


def titles(page: Page, panel: str) -> list[str]:
    return [text.strip() for text in page.locator(f"#{panel} .title").all_text_contents()]


def test_all_of_a_train_has_its_unit(page) -> None:
    shown(page, "five")
    unit = r"\[(rpm|deg|deg/s|N m|N m/deg|N m s/rad|kg m\^2)\]"
    plotly = page.locator("#diagram .g-xtitle text, #diagram .g-ytitle text").all_text_contents()
    assert plotly == ["speed [rpm]", "amplitude of third (half the peak to peak) [deg]"]
    plain = {"third.ratio", "firing.phase", "firing.acts_on.engine", "third.cubic", "third.impact_damping"}
    for name in ("x", "y", "walk-parameter", "locus-parameter", "signal"):
        texts = page.locator(f"#{name} option").all_inner_texts()
        assert len(texts) > 5
        bare = [text for text in texts if not re.search(r"\[[^\]]+\]$", text) and "per second" not in text]
        assert set(bare) <= plain, name
    labels = page.locator("#parameters .parameter span").all_text_contents()
    assert {text for text in labels if not re.search(r"\[[^\]]+\]$", text)} <= plain
    assert titles(page, "history") == ["forcing periods (one lasts 22.33 ms)", "third [deg]"] or re.search(
        r"one lasts [\d.]+ ms", titles(page, "history")[0]
    )
    assert [title for panel in ("phase", "loop") for title in titles(page, panel) if not re.search(unit, title)] == []
    assert titles(page, "spectrum")[0] == "order (per turn of engine)"
    assert page.inner_text("#log th:last-child") == "rate [deg/s]"
    assert page.inner_text("#energy th:nth-child(3)") == "energy [J]"
    assert page.inner_text("#results .name") == "speed 2000 to 1300 rpm"
    assert page.inner_text("#results .message").endswith("at speed = 1300 rpm")
    assert re.search(r"= [\d.]+ rpm$", page.inner_text("#motion-title"))
    until(page, "/^At [0-9.]+ rpm /.test(document.querySelector('#next-text').textContent)")
    lines = page.evaluate("[...gapwalk.curves.all.values()][0].special.map(({ lines }) => lines[0])")
    assert [line for line in lines if not re.fullmatch(r"at [\d.]+ ± \S+ rpm", line)] == []
    assert page.inner_text("#walk-unit") == "rpm"
    page.select_option("#locus-parameter", "third.clearance")
    assert page.inner_text("#locus-unit") == "deg"


@pytest.mark.parametrize(
    ("name", "parameter", "to"), [("five", "firing.amplitude", "121"), ("clutch", "mean.q1", "0.26")]
)
def test_the_range_and_the_axes_follow_the_parameter_of_a_walk(page, name, parameter, to) -> None:
    shown(page, name)
    page.focus("#diagram")
    page.keyboard.press("Home")
    until(page, "gapwalk.page.chosen && !gapwalk.page.chosen.special && !document.getElementById('walk').disabled")
    until(page, "gapwalk.motion.details && gapwalk.motion.place.point === gapwalk.page.chosen.start.point")
    page.select_option("#walk-parameter", parameter)
    until(page, "gapwalk.motion?.motion != null")  # the motion of a clicked point comes a moment later
    value = page.evaluate(f"gapwalk.motion.motion.parameters['{parameter}']")
    assert float(page.input_value("#walk-to")) == pytest.approx(1.5 * value, rel=1e-3)
    page.fill("#walk-to", to)
    page.click("#walk")
    until(page, "gapwalk.page.results.at(-1).kind === 'walk' && gapwalk.page.results.at(-1).state === 'done'")
    assert page.input_value("#x") == parameter
    words = page.evaluate("document.getElementById('x').selectedOptions[0].title")
    until(page, f"gapwalk.diagram.place._fullLayout.xaxis.title.text === {words!r}")
    page.click("#results li:last-child button:text-is('Delete')")
    until(page, "gapwalk.page.results.length === 1")
    page.select_option("#x", page.evaluate("gapwalk.page.about.x"))
    until(page, SHOWN)


def test_the_tree_has_a_role_and_a_name_for_all_that_can_be_reached(page) -> None:
    shown(page, "clutch")
    page.evaluate("document.querySelectorAll('details').forEach((each) => { each.open = true; })")
    nodes, reached = tree_of(page)
    roles = {role for role, _ in reached}
    assert {"button", "combobox", "slider", "spinbutton", "application", "searchbox"} <= roles
    assert nameless(reached) == []
    names = [name for role, name in reached if role == "button"]
    assert {"Edit model", "Keys", "Compute", "Walk", "Settle"} <= set(names)
    landmarks = set(nodes)
    assert {("main", ""), ("region", "Diagram"), ("region", "The motion at the chosen point")} <= landmarks
    assert ("heading", "gapwalk") in landmarks
    assert {"status", "alert"} & {role for role, _ in landmarks}


def test_the_focus_goes_through_the_page_in_the_order_in_which_it_is_read(page) -> None:
    shown(page, "clutch")
    page.evaluate("document.activeElement.blur(); getSelection().removeAllRanges()")
    page.click("h1")
    order, last = [], ""
    for _ in range(400):
        page.keyboard.press("Tab")
        now = page.evaluate(
            "(() => { const a = document.activeElement, p = a.closest('header, #controls, #picture, #motion');"
            " return [p?.id || p?.tagName || '', a.id || a.textContent.slice(0, 20), a.matches(':focus-visible')]; })()"
        )
        if now[0] == "":
            break
        assert now[2], now  # where the focus is can be seen
        if now[0] != last:
            order.append(now[0])
        last = now[0]
    assert order[:4] == ["HEADER", "controls", "picture", "motion"]


@pytest.mark.slow
def test_news_of_a_growing_branch_come_at_most_four_times_a_second(page) -> None:
    opened(page, "chain.toml")
    page.evaluate(
        """() => {
            window.news_ = [];
            window.drawings_ = [];
            const events = new EventSource("/api/events"), { diagram } = gapwalk, { draw } = diagram;
            events.onmessage = () => news_.push(performance.now());
            diagram.draw = function () { drawings_.push(performance.now()); return draw.call(this); };
            window.end_ = () => { events.close(); delete diagram.draw; };
        }"""
    )
    before, begin = page.evaluate("[gapwalk.page.results.length, performance.now()]")
    page.click("#compute")
    until(page, f"gapwalk.page.results.length > {before} && gapwalk.page.results.at(-1).state === 'done'")
    until(page, f"gapwalk.curves.all.size === {before + 1}")
    news, drawings = page.evaluate("[news_, drawings_]")
    page.evaluate("end_()")
    for times in (news, drawings):
        assert len(times) >= 3
        # from the beginning, four a second, and two more; on a busy machine late ones come together, but none too early
        assert all(time - begin > 250.0 * (count - 2) - 50.0 for count, time in enumerate(times))
    page.click("#results li:last-child button:text-is('Delete')")

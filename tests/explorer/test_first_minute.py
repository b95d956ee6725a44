"""The first minute on the page: a response at once, a curve in numbers, an address that holds, names and labels."""

import shutil
import subprocess
import tarfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Page

from tests.explorer.browser import READY, opened, until, watched
from tests.explorer.conftest import STOP
from tests.explorer.machines import MACHINES
from tests.explorer.serving import serving

FREE = STOP.replace("damping = [0.05]", "damping = [0.0]").replace("impact_damping = 0.1", "").replace("= 0.7", "= 1.0")
REFUSED = FREE.replace("to = 0.9", 'to = 1.2\nstart = "linear"')  # at its resonance
EMPTY = STOP[: STOP.index("[study]")] + '[study]\nkind = "settle"\n'
FILES = {**MACHINES, "stop": STOP, "refused": REFUSED, "empty": EMPTY}
CURVE = "[...gapwalk.curves.all.values()][0]"
CUT = """() => {
    const rolls = (each) => each && (/auto|scroll/.test(getComputedStyle(each).overflowX) || rolls(each.parentElement));
    const words = "button, select, th, td, figcaption, summary, h2, p, li, svg.chart text, .machine text";
    return [...document.querySelectorAll(words)].filter((each) => {
        if (!each.checkVisibility({ visibilityProperty: true })) return false;
        const own = each.getBoundingClientRect(), svg = each.ownerSVGElement?.getBoundingClientRect();
        const { left, right, top, bottom } = svg ?? { left: 0, right: innerWidth, top: -Infinity, bottom: Infinity };
        const out = own.left < left - 2 || own.right > right + 2 || own.top < top - 2 || own.bottom > bottom + 2;
        if (svg) return each.textContent.includes("…") || (out && each.closest(".chart"));
        const hides = !/visible/.test(getComputedStyle(each).overflowX);
        return !rolls(each) && (out || (hides && each.scrollWidth > each.clientWidth + 1));
    }).map((each) => each.outerHTML.slice(0, 200));
}"""  # fmt: skip


@pytest.fixture(scope="module")
def page(tmp_path_factory) -> Iterator[Page]:
    """The page of four systems, of which nothing is computed yet; it has no errors."""
    folder = tmp_path_factory.mktemp("first")
    for name, text in FILES.items():
        (folder / f"{name}.toml").write_text(text, encoding="utf-8")
    with serving(folder / "stop.toml") as address, watched(address) as page:
        yield page


@pytest.fixture(scope="module")
def axe() -> str:
    """The text of axe-core, which is fetched once."""
    (file := Path(__file__).parents[2] / "out" / "axe-core-4.14.1.tgz").parent.mkdir(exist_ok=True)
    npm = shutil.which("npm")
    command = [npm or "npm", "pack", "axe-core@4.14.1", "--silent", "--pack-destination", str(file.parent)]
    if not file.exists() and (
        npm is None or subprocess.run(command, check=False, capture_output=True, timeout=120).returncode
    ):
        pytest.skip("axe-core is a package of npm, which is not reached here")
    with tarfile.open(file) as packed:
        found = packed.extractfile("package/axe.min.js")
        assert found is not None
        return found.read().decode()


def compute(page: Page) -> None:
    """Compute the first curve of the page."""
    page.click("#empty button")
    until(page, "gapwalk.page.results[0]?.state === 'done' && gapwalk.curves.all.size === 1")
    until(page, f"{CURVE}.x.length > 100")  # the last points come after the state


def test_it_opens_with_a_response_on_which_the_exact_one_lies(page) -> None:
    until(page, "gapwalk.curves.quick?.count > 10 && gapwalk.curves.all.size === 0")
    until(page, "gapwalk.curves.quick.x.at(-1) === 0.9")  # the end of its range
    quick = np.array(page.evaluate("[[...gapwalk.curves.quick.x], [...gapwalk.curves.quick.y]]"))
    for name in ("Run up", "Edit model", "Compute"):
        assert page.get_by_role("button", name=name, exact=True).first.is_visible()
    assert "Pale: a quick response" in page.inner_text("#empty")
    compute(page)
    assert page.locator("#empty").is_hidden()
    x, y = np.array(page.evaluate(f"[[...{CURVE}.x], [...{CURVE}.y]]"))
    order = np.argsort(x)
    assert np.abs(np.interp(quick[0], x[order], y[order]) - quick[1]).max() < 0.02 * y.max()


def test_what_is_refused_is_said_at_once_beside_what_there_is(page) -> None:
    opened(page, "empty.toml")
    until(
        page, "document.getElementById('empty').innerText.includes('There is no quick response: no study has a range')"
    )
    assert "Settle" in page.inner_text("#empty")
    opened(page, "refused.toml")
    until(page, "gapwalk.curves.quick?.x.at(-1) === 1.2")
    page.click("#empty button")
    until(page, "gapwalk.page.results[0]?.state === 'failed'")
    until(page, "/without damping.*Pale: the quick response/s.test(document.getElementById('empty').innerText)")
    page.get_by_role("button", name="Settle").first.click()  # what it says to do
    until(page, "gapwalk.page.results.at(-1)?.settled && Boolean(gapwalk.motion.motion)")
    opened(page, "stop.toml")


def test_a_curve_is_read_at_the_pointer_in_a_table_and_from_an_address(page) -> None:
    if page.evaluate("gapwalk.curves.all.size === 0"):
        compute(page)
    x, y = page.evaluate(f"[[...{CURVE}.x], [...{CURVE}.y]]")
    page.click("#table-open")
    rows = page.locator("#table-rows tr[data-index]")
    assert rows.count() == len(x)
    lines = page.evaluate("gapwalk.table.text(',')").splitlines()
    assert [list(map(float, line.split(",")[:2])) for line in lines[1:]] == [
        list(each) for each in zip(x, y, strict=True)
    ]
    rows.nth(len(x) // 2).click()
    until(page, f"gapwalk.page.chosen?.index === {len(x) // 2} && Boolean(gapwalk.motion.details)")
    page.click("#table-open")
    apart = "({_fullLayout: laid, clientWidth: w, clientHeight: h}) => Math.hypot(laid.width - w, laid.height - h)"
    until(page, f"({apart})(gapwalk.diagram.place) < 1")  # the picture has taken the place of the table
    box = page.locator("#diagram .plot").bounding_box()
    xaxis, yaxis = (f"gapwalk.diagram.place._fullLayout.{name}" for name in ("xaxis", "yaxis"))
    left = page.evaluate(f"{xaxis}._offset + {xaxis}.l2p({x[7]})")
    top = page.evaluate(f"{yaxis}._offset + {yaxis}.l2p({y[7]})")
    page.mouse.move(box["x"] + left, box["y"] + top)
    until(page, f"gapwalk.diagram.tip.innerText.includes('= {float(f'{x[7]:.6g}')}')")
    assert page.locator("#diagram .dot").is_visible()
    page.click("#box")
    page.mouse.move(box["x"] + left - 20, box["y"] + top - 30)  # within the axes, left of which there is little
    page.mouse.down()
    page.mouse.move(box["x"] + left + 60, box["y"] + top + 20, steps=4)
    page.mouse.up()
    until(page, "gapwalk.diagram.range !== null")
    low, high = page.evaluate("gapwalk.diagram.place._fullLayout.xaxis.range")
    assert low < x[7] < high < max(x)
    page.click("#box")
    page.select_option("#y", "max.x")
    until(page, "location.hash.includes('y=max.x&at=') && !gapwalk.page.updating")
    chosen, text = "[gapwalk.page.chosen.key, gapwalk.page.chosen.node, document.getElementById('y').value]", page.url
    before = page.evaluate(chosen)
    page.goto("about:blank")
    page.goto(text)
    until(page, f"{READY} && Boolean(gapwalk.motion.motion)")
    assert page.evaluate(chosen) == before


def test_what_moves_a_point_is_switched_on_and_names_no_direction(page) -> None:
    opened(page, "clutch.toml")
    page.click("#compute")
    until(page, "gapwalk.page.results[0]?.state === 'done' && gapwalk.curves.all.size === 1")
    page.focus("#diagram")
    page.keyboard.press("Home")
    page.keyboard.press("s")
    until(page, "Boolean(gapwalk.motion.details) && document.getElementById('next-text').textContent !== ''")
    places = "['machine', 'history'].map((id) => document.getElementById(id).getBoundingClientRect().top)"
    before = None
    while before != (now := page.evaluate(places)):  # until what stands above them has come
        before = now
        page.wait_for_timeout(700)
    assert page.evaluate("[gapwalk.movers.found, gapwalk.diagram.arrows.length]") == [None, 0]
    page.evaluate("gapwalk.movers.open()")
    until(page, "gapwalk.movers.found?.rows.some(({ name }) => name === 'stage2.stiffness')")
    assert page.evaluate(places) == before
    names = page.evaluate("gapwalk.movers.found.rows.map(({ name }) => name)")
    assert not [name for name in names if ".force." in name or ".deflection." in name or ".acts_on." in name]
    page.evaluate("document.getElementById('movers').open = false")


@pytest.mark.parametrize("width", [1280, 390])
@pytest.mark.parametrize("name", [*MACHINES, "stop"])
def test_nothing_is_inaccessible_and_no_label_is_cut(page, axe, name, width) -> None:
    page.set_viewport_size({"width": width, "height": 800})
    opened(page, f"{name}.toml")
    if not page.evaluate("gapwalk.page.results.length"):
        page.click("#compute")
    until(page, "gapwalk.page.results[0]?.state === 'done' && gapwalk.curves.all.size > 0")
    page.focus("#diagram")
    page.keyboard.press("Home")
    until(page, "Boolean(gapwalk.motion.details)")
    page.wait_for_timeout(300)
    assert page.evaluate(CUT) == []
    page.evaluate(axe)
    for part in ("motion", "editor"):
        if part == "editor":
            page.click("#edit-open")
            until(page, "gapwalk.editor.chart.curve?.whole && !gapwalk.editor.isBusy")
        found = page.evaluate("axe.run(document, { resultTypes: ['violations'] })")["violations"]
        assert [
            (each["id"], each["nodes"][0]["target"]) for each in found if each["impact"] in ("serious", "critical")
        ] == []
    page.click("#edit-close")

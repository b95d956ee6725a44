"""The list of results in a browser: names, colours, pale and hidden lines, deletion, and how each is undone."""

from collections.abc import Iterator

import pytest
from playwright.sync_api import Page

from tests.explorer.browser import chromium, until, watched
from tests.explorer.conftest import STOP
from tests.explorer.serving import serving

COUNT = "gapwalk.curves.all.size === {}"
ITEM = "#results li:nth-child({}) "


@pytest.fixture(scope="module")
def page(tmp_path_factory) -> Iterator[Page]:
    """A page with two results: one of the file, and one of another clearance."""
    chromium()
    file = tmp_path_factory.mktemp("results") / "stop.toml"
    file.write_text(STOP, encoding="utf-8")
    with serving(file) as address, watched(address) as page:
        page.click("#compute")
        until(page, "gapwalk.page.results[0]?.state === 'done'")
        page.click("summary:text-is('Values')")
        page.fill("#filter", "clearance")
        page.fill("[aria-label='clearance of stop']", "0.6")
        page.click("#compute-values")
        until(page, "gapwalk.page.results[1]?.state === 'done' && gapwalk.curves.all.size === 2")
        yield page


def test_each_result_says_what_it_is(page) -> None:
    assert page.locator("#results .name").all_inner_texts() == ["Ω 0.7 to 0.9", "Ω 0.7 to 0.9, stop.clearance = 0.6"]


def test_a_name_is_given_by_keyboard_and_undone(page) -> None:
    page.focus(ITEM.format(2) + "button:text-is('Rename')")
    page.keyboard.press("Enter")
    page.keyboard.type("half the gap")
    page.keyboard.press("Enter")
    until(page, "gapwalk.page.results[1].title === 'half the gap'")
    assert page.inner_text(ITEM.format(2) + ".name") == "half the gap"
    assert page.evaluate("document.activeElement.textContent") == "Rename"
    page.keyboard.press("Control+z")
    until(page, "gapwalk.page.results[1].title.endsWith('0.6')")
    page.click(ITEM.format(2) + "button:text-is('Rename')")
    page.keyboard.type("thrown away")
    page.keyboard.press("Escape")
    assert page.inner_text(ITEM.format(2) + ".name").endswith("0.6")


def test_lines_have_a_colour_are_pale_or_hidden(page) -> None:
    first = ITEM.format(1)
    page.get_by_role("combobox", name="Colour: Ω 0.7 to 0.9", exact=True).select_option("blue")
    until(page, "[...gapwalk.curves.all.values()].filter(({ shade }) => shade === '--result-blue').length === 1")
    assert page.locator("#legend .of-result").all_inner_texts() == ["Ω 0.7 to 0.9"]
    page.select_option(first + "select >> nth=0", "pale")
    until(page, "[...gapwalk.curves.all.values()].filter(({ earlier }) => earlier).length === 1")
    assert page.inner_text("#legend .of-earlier") == "made pale"
    page.fill("#ghosts-strength", "10")
    opacities = "gapwalk.diagram.lines.each((line, kind, opacity) => opacity)"
    assert set(page.evaluate(opacities)) == {0.1, 1}
    page.select_option(first + "select >> nth=0", "hidden")
    until(page, COUNT.format(1))
    for _ in range(3):
        page.click("#undo")
        page.wait_for_timeout(50)
    until(page, COUNT.format(2))
    until(page, "[...gapwalk.curves.all.values()].every(({ earlier, shade }) => !earlier && !shade)")
    page.check("#ghosts-older")
    assert page.evaluate("[...gapwalk.curves.all.keys()].sort().map((key) => gapwalk.curves.all.get(key).earlier)") == [
        True,
        False,
    ]
    page.uncheck("#ghosts-older")


def test_a_deleted_result_comes_back_and_one_removed_does_not(page) -> None:
    for way in ("undo", "restore"):
        page.click(ITEM.format(1) + "button:text-is('Delete')")
        until(page, "gapwalk.page.results.length === 1 && gapwalk.curves.all.size === 1")
        assert page.inner_text("#deleted summary") == "1 deleted"
        if way == "undo":
            page.click("#undo")
        else:
            page.click("#deleted summary")
            page.get_by_role("button", name="Restore").click()
        until(page, "gapwalk.page.results.length === 2 && gapwalk.curves.all.size === 2")
        assert page.is_hidden("#deleted")
    page.click(ITEM.format(1) + "button:text-is('Delete')")
    until(page, "gapwalk.page.deleted.length === 1")
    page.click("#deleted .clean")
    until(page, "gapwalk.page.deleted.length === 0")
    assert page.is_disabled("#undo")
    assert page.is_hidden("#error")


def test_a_settled_result_opens_with_its_motion_and_its_verdict(page) -> None:
    page.click("#settle")
    until(page, "gapwalk.page.results.at(-1).settled && Boolean(gapwalk.motion.motion)")
    last = page.locator("#results li").last
    assert last.locator(".verdict").inner_text() == "period 1, stable"
    until(page, "document.getElementById('motion-title').textContent.startsWith('settled at Ω')")

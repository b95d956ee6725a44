"""What comes next at a point, in a browser: the sentence, its buttons, and two motions compared."""

from collections.abc import Iterator

import pytest
from playwright.sync_api import Page

from tests import models
from tests.explorer.browser import choose_special, chromium, until, watched
from tests.explorer.serving import serving

SAID = "document.getElementById('next-text').textContent"
STEPS = "[...document.querySelectorAll('#next-steps button:not(:disabled)')].map((button) => button.dataset.step)"


@pytest.fixture(scope="module")
def page(tmp_path_factory) -> Iterator[Page]:
    chromium()
    file = tmp_path_factory.mktemp("next") / "stop.toml"
    file.write_text(models.STOP + models.response(1.4), encoding="utf-8")
    with serving(file) as address, watched(address) as page:
        page.click("#compute")
        until(page, "gapwalk.page.results[0]?.state === 'done' && gapwalk.curves.all.size === 1")
        yield page


def test_at_a_fold_the_page_says_what_happens_and_settles_beside_it(page) -> None:
    choose_special(page, "fold")
    until(page, f"{SAID}.includes('the motion ends')")
    assert page.evaluate(STEPS) == ["locus", "settle", "hear", "pin"]
    assert page.get_by_role("group", name="What can be done next").is_visible()
    page.focus("[data-step=locus]")
    page.keyboard.press("Enter")
    assert page.evaluate("document.activeElement.id") == "locus-parameter"
    label = page.inner_text("[data-step=settle]")
    page.click("[data-step=settle]")
    until(page, "gapwalk.page.results.at(-1).settled && gapwalk.page.results.at(-1).state === 'done'")
    until(page, "gapwalk.page.chosen.start.result === gapwalk.page.results.at(-1).key")
    assert page.evaluate("gapwalk.page.results.at(-1).title") == label.replace("Settle", "settled")


def test_two_motions_are_compared(page) -> None:
    choose_special(page, "fold")
    until(page, f"{STEPS}.includes('pin')")
    page.click("[data-step=pin]")
    assert page.locator("#history .pinned").count() == 0  # it is the shown one
    page.focus("#diagram")
    page.keyboard.press("Shift+ArrowRight")
    until(page, "document.querySelectorAll('#history .pinned').length === 1")
    for place in ("phase", "loop"):
        assert page.locator(f"#{place} .pinned").count() == 1
    until(page, "document.querySelectorAll('#section .pinned').length === 1")
    assert page.locator("#spectrum .pinned").count() > 3
    assert "fold" in page.inner_text("#pinned")
    page.get_by_role("button", name="Take away").click()
    assert page.locator("#panels .pinned").count() == 0
    assert page.is_hidden("#pinned")


def test_peak_force_and_impacts_are_axes(page) -> None:
    for measure, words in (("peak.stop", "peak force of stop"), ("impacts.stop", "impacts per unit of time on stop")):
        page.select_option("#y", measure)
        until(page, f"gapwalk.diagram.names.y === '{words}' && gapwalk.curves.all.size === 1")
    heights = page.evaluate(
        "(() => { const [c] = gapwalk.curves.all.values(); return [...c.y].map((y, i) => y / c.x[i]); })()"
    )
    # no impact, or one in each forcing period: one in 2 pi / frequency
    assert {round(each * 6.283185307179586, 9) for each in heights} <= {0.0, 1.0, 2.0}
    assert len(set(heights)) > 1

"""Three dimensions: turned by the mouse and the keyboard, points can be chosen, and no text lies on another."""

from collections.abc import Iterator
from itertools import chain, product

import numpy as np
import pytest
from playwright.sync_api import Page

from tests.explorer.browser import boxes, opened, until, watched
from tests.explorer.serving import serving
from tests.explorer.test_saved_answers import FAMILY, MAP
from tests.models import STOP

FREE = STOP.replace("damping = [0.05]", "damping = [0.0]").replace("clearance = 1.0", "clearance = 9.0")
SETTLE = FREE.replace("frequency = 0.7", "frequency = 0.6") + '\n[study]\nkind = "settle"\nsignal = "x"\n'
VIEW = "(({ turn, tilt, zoom }) => [turn, tilt, zoom])(gapwalk.depth.space.view)"
PLACE = """(number) => {
    const { space } = gapwalk.depth, line = space.content.lines.find(({ of }) => of);
    const at = space.place3(line.points.map((values) => values[number])), box = space.canvas.getBoundingClientRect();
    return [box.left + at[0], box.top + at[1]];
}"""


@pytest.fixture(scope="module")
def page(tmp_path_factory) -> Iterator[Page]:
    """The page with a family, in three dimensions; no errors, and no request to anyone else."""
    folder = tmp_path_factory.mktemp("depth")
    for name, text in (("family", FAMILY), ("map", MAP), ("settle", SETTLE)):
        (folder / f"{name}.toml").write_text(text, encoding="utf-8")
    with serving(folder / "family.toml") as address, watched(address, height=800) as page:
        page.click("#compute")
        until(page, "gapwalk.page.results[0]?.state === 'done' && gapwalk.answer.content?.space?.values.length === 3")
        until(page, "gapwalk.curves.all.size === 3 && !gapwalk.page.updating")
        page.select_option("#z", "of the family")
        until(page, "gapwalk.depth.space.content?.lines.length > 0 && !gapwalk.page.updating")
        yield page


def test_members_lie_at_their_values_and_their_special_points_are_joined(page) -> None:
    lines = page.evaluate(
        "gapwalk.depth.space.content.lines.map(({ of, points }) => [Boolean(of), [...points[1]], points[0].length])"
    )
    depths = {tuple(sorted(set(zs))) for is_curve, zs, _ in lines if is_curve}
    assert depths == {(0.9,), (1.0,), (1.1,)}
    ribs = [zs for is_curve, zs, _ in lines if not is_curve]
    assert ribs
    assert [0.9, 1.0] in ribs
    assert [each["words"] for each in page.evaluate("gapwalk.depth.space.content.axes")] == [
        "excitation frequency \N{GREEK CAPITAL LETTER OMEGA}",
        "clearance of stop",
        "amplitude of x (half the peak to peak)",
    ]
    assert page.locator("#diagram .plot").evaluate("(each) => getComputedStyle(each).visibility") == "hidden"


def test_keys_and_mouse_turn_it(page) -> None:
    page.focus("#space canvas")
    before = page.evaluate(VIEW)
    page.keyboard.press("ArrowRight")
    page.keyboard.press("ArrowUp")
    page.keyboard.press("+")
    after = page.evaluate(VIEW)
    assert np.array(after) - np.array(before) == pytest.approx([np.pi / 36, np.pi / 36, 0.2 * before[2]])
    (box,) = boxes(page, "#space canvas")
    x, y = 0.5 * (box[0] + box[2]), 0.5 * (box[1] + box[3])
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + 80, y)
    page.mouse.up()
    assert page.evaluate(VIEW)[0] - after[0] == pytest.approx(0.5, abs=0.02)
    page.keyboard.press("0")
    assert page.evaluate(VIEW) == pytest.approx(before)
    assert page.evaluate("document.activeElement.getAttribute('role')") == "application"


def test_a_click_shows_the_motion_there(page) -> None:
    x, y = page.evaluate(PLACE, 40)
    page.mouse.click(x, y)
    until(page, "Boolean(gapwalk.motion.motion) && Boolean(gapwalk.depth.space.content.mark)")
    chosen = page.evaluate("[gapwalk.page.chosen.curve.x[gapwalk.page.chosen.index], gapwalk.page.chosen.start.branch]")
    mark = page.evaluate("gapwalk.depth.space.content.mark")
    assert mark[0] == pytest.approx(chosen[0])
    assert mark[1] == pytest.approx([0.9, 1.0, 1.1][chosen[1]])


@pytest.mark.parametrize("width", [1280, 390])
def test_no_text_lies_on_another_from_any_side(page, width) -> None:
    page.set_viewport_size({"width": width, "height": 800})
    page.wait_for_timeout(200)
    for turn in np.linspace(-3.0, 3.0, 9):
        for tilt in (-0.7, 0.1, 0.9):
            page.evaluate(f"gapwalk.depth.space.turn({{ turn: {turn}, tilt: {tilt}, zoom: 1 }})")
            texts = page.evaluate("gapwalk.depth.space.texts")
            assert len(texts) >= 6
            for k, one in enumerate(texts):
                for a, b in product(one, chain.from_iterable(texts[:k])):
                    assert not (a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3])
    page.set_viewport_size({"width": 1280, "height": 800})


def test_it_is_saved_as_a_picture_and_flat_again(page) -> None:
    with page.expect_download() as saved:
        page.click("#save-png")
    assert saved.value.path().read_bytes()[1:4] == b"PNG"
    page.click("#save-svg")
    assert "saved as PNG" in page.inner_text("#error")
    page.click("#error button")
    page.select_option("#z", "")
    until(page, "!document.getElementById('diagram').classList.contains('deep')")
    assert page.locator("#space").is_hidden()


def test_loci_have_a_measure_as_height(page) -> None:
    """Over the plane of both parameters, the locus and its branches stand at their amplitudes."""
    opened(page, "map.toml")
    page.click("#compute")
    until(page, "gapwalk.page.results[0]?.state === 'done' && gapwalk.page.results[0].branches.length > 1")
    page.select_option("#y", "half.x")
    page.select_option("#z", "harmonic1.amplitude")
    kinds = (
        "new Set((gapwalk.depth.space.content?.lines ?? [])"
        ".map(({ of }) => gapwalk.page.results[0].branches[of?.branch]?.second)).size"
    )
    until(page, f"{kinds} === 2")  # a branch, and a locus
    depths = page.evaluate("gapwalk.depth.space.content.lines.map(({ points }) => [...points[1]])")
    assert {max(values) - min(values) > 0.01 for values in depths} == {True, False}
    page.select_option("#z", "")


def test_a_motion_is_seen_in_three_signals_with_its_section(page) -> None:
    opened(page, "settle.toml")
    page.click("#compute")
    until(page, "gapwalk.page.results[0]?.state === 'done' && Boolean(gapwalk.motion.details)")
    page.click("#solid-figure summary")
    until(page, "Boolean(gapwalk.motion.solid.space.content)")
    values = "[...['solid-x', 'solid-z', 'solid-y']].map((id) => document.getElementById(id).value)"
    assert page.evaluate(values) == ["x", "x'", "cos \N{GREEK SMALL LETTER THETA}"]
    until(page, "gapwalk.motion.solid.space.content.dots.length === 400")
    dots = page.evaluate("gapwalk.motion.solid.space.content.dots.map(({ at }) => at)")
    section = page.evaluate("[gapwalk.motion.details.section.q, gapwalk.motion.details.section.v]")
    np.testing.assert_allclose(np.array(dots).T, [*section, np.ones(400)])
    (box,) = boxes(page, "#solid canvas")
    assert box[3] - box[1] == pytest.approx(300.0, abs=1.0)

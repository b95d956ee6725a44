"""The machine on the page, in Chromium: it moves as the motion does, its parts choose panels, and no texts meet."""

from collections.abc import Iterator

import numpy as np
import pytest
from playwright.sync_api import Page

from benchmarks.chain import chain
from gapwalk.plot.machine.elements import svg_of
from gapwalk.plot.machine.layout import NARROW, WIDE, scene_of
from gapwalk.studies import read_studies
from tests.explorer.browser import READY, boxes, browser, chromium, new_page, overlap, until
from tests.explorer.conftest import CLUTCH
from tests.explorer.serving import serving

EXAMPLES = ("clutch", "train", "idle", "belt", "impact_damper", "pendulum", "rod")

TRAIN = """\
title = "Two inertias and a loose gear"
speed = "900 rpm"
mean = { gear = "-0.2 N m" }
reaction = "flywheel"

[[inertia]]
name = "flywheel"
inertia = "0.14 kg m^2"

[[inertia]]
name = "hub"
inertia = "0.004 kg m^2"

[[inertia]]
name = "gear"
inertia = "0.002 kg m^2"

[[shaft]]
name = "clutch"
between = ["flywheel", "hub"]
stiffness = "12 N m/deg"
damping = "0.3 N m s/rad"

[[gear]]
name = "mesh"
between = ["hub", "gear"]
ratio = -1.25
clearance = "0.1 deg"
stiffness = "10000 N m/rad"
impact_damping = "0.1 s/rad"

[[harmonic]]
name = "second"
order = 2
amplitude = "150 N m"
acts_on = { flywheel = 1.0 }

[study]
kind = "settle"
signal = "mesh"
"""


@pytest.fixture(scope="module")
def page(tmp_path_factory) -> Iterator[Page]:
    """The page with the settled motion of the train, which stands still; there are no errors."""
    chromium()
    file = tmp_path_factory.mktemp("machine") / "train.toml"
    file.write_text(TRAIN, encoding="utf-8")
    wrong: list[str] = []
    with serving(file) as address, browser() as chrome:
        page = new_page(chrome, viewport={"width": 1280, "height": 720})
        page.on("pageerror", lambda error: wrong.append(str(error)))
        page.on("console", lambda said: wrong.append(said.text) if said.type in ("error", "warning") else None)
        page.goto(address)
        until(page, READY)
        yield page
    assert wrong == []


def moving(page: Page) -> None:
    """Compute and show the motion, unless a test before has."""
    if page.evaluate("Boolean(gapwalk.motion.details)"):
        return
    page.click("#compute")
    until(page, "gapwalk.page.results[0]?.state === 'done' && document.querySelectorAll('#results button').length > 0")
    page.click("#results button:text-is('Show')")
    until(page, "Boolean(gapwalk.motion.details)")


def test_the_machine_is_there_before_any_motion_and_then_moves_as_it_does(page) -> None:
    names = page.locator("#machine .part[role=button]").evaluate_all("all => all.map((e) => e.dataset.words)")
    assert names == [
        "clutch: shaft, stiffness 12 N m/deg",
        "clutch: damper, 0.3 N m s/rad",
        "mesh: spring with a gap of ±0.1 deg",
        "flywheel; loads: second, reaction",
        "hub",
        "gear; loads: mean",
    ]
    moving(page)
    (mesh,) = [each for each in page.evaluate("gapwalk.motion.motion.contacts") if each["name"] == "mesh"]
    deflection = np.array(mesh["deflection"])
    assert deflection.max() > 0.1 > -0.1 > deflection.min()  # it rattles on both sides
    seen = page.evaluate(
        """(samples) => samples.map((i) => {
            gapwalk.motion.machine.at(i);
            const part = document.querySelector("#machine .part.gap"), x = (e) => e.getBoundingClientRect();
            const tongue = x(part.querySelector(".m-tongue"));
            const away = (stop) => Math.abs(x(stop).left + x(stop).right - tongue.left - tongue.right) / 2;
            const stops = [...part.querySelectorAll(".m-stop")];
            const far = stops.map((stop) => [stop.classList.contains("high"), away(stop)]);
            return [part.querySelector(".m-state").textContent, Object.fromEntries(far)];
        })""",
        list(range(len(deflection))),
    )
    for x, (words, far) in zip(deflection, seen, strict=True):
        assert words == ("touches +" if x > 0.1 else "touches −" if x < -0.1 else "open")
        if words != "open":  # the tongue is at the stop of that side, and far from the other
            assert far[str(x > 0).lower()] < 4.0
            assert far[str(x < 0).lower()] > 15.0


def test_a_part_chooses_what_is_looked_at_by_mouse_and_by_keyboard(page) -> None:
    moving(page)
    gap = page.locator("#machine .part.gap")
    gap.click()
    assert gap.get_attribute("aria-pressed") == "true"
    assert page.inner_text("#log-of span") == "mesh"
    assert set(page.locator("#log td:nth-child(2)").all_inner_texts()) <= {"mesh +", "mesh −"}
    assert "mesh" in str(page.locator("#loop .title").first.text_content())
    page.click("#log-of button")
    assert page.locator("#log-of").is_hidden()
    hub = page.locator("#machine .part.body[data-words='hub']")
    hub.focus()
    page.keyboard.press("Enter")
    until(page, "document.getElementById('signal').value === `hub''`")
    until(page, "document.activeElement.dataset.words === 'hub' && document.activeElement.ariaPressed === 'true'")
    until(page, "document.querySelector('#history .title:last-of-type').textContent.startsWith('hub')")
    page.locator("#machine .part.spring[data-words^='clutch']").press(" ")
    until(page, "document.getElementById('signal').value === 'clutch.torque'")


@pytest.mark.parametrize(("width", "height"), [(1280, 720), (390, 844)])
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_texts_on_the_page_do_not_meet_and_can_be_read(page, width, height, scheme) -> None:
    page.emulate_media(color_scheme=scheme)
    page.set_viewport_size({"width": width, "height": height})
    page.wait_for_timeout(200)
    words = boxes(page, "#machine text")
    assert len(words) >= 8
    assert not any(overlap(a, b) for k, a in enumerate(words) for b in words[:k])
    (drawing,) = boxes(page, "#machine svg")
    assert all(drawing[0] - 1 <= x0 and x1 <= drawing[2] + 1 for x0, _, x1, _ in words)
    assert drawing[2] <= width
    colours = page.locator("#machine .m-name").first.evaluate("e => getComputedStyle(e).fill")
    assert (sum(map(int, colours.strip("rgb()").split(","))) > 382) == (scheme == "dark")


def test_it_moves_by_itself_unless_one_wants_no_motion_and_asks_for_frames_only_while_it_does(page) -> None:
    moving(page)
    page.wait_for_timeout(200)  # for frames of what was shown
    page.evaluate(
        """() => {
            window.frames_ = 0;
            const original = window.requestAnimationFrame;
            window.requestAnimationFrame = (then) => (window.frames_++, original(then));
        }"""
    )
    look = "document.querySelector('#machine .machine').innerHTML"
    at_rest = page.evaluate(look)
    page.wait_for_timeout(100)
    assert page.evaluate("frames_") == 0
    assert page.evaluate(look) == at_rest
    page.click("#play")
    until(page, "frames_ > 5")
    assert page.evaluate(look) != at_rest
    page.click("#play")
    page.wait_for_timeout(50)  # for a frame that was on its way
    asked = page.evaluate("frames_")
    page.wait_for_timeout(100)
    assert page.evaluate("frames_") == asked
    other = new_page(page.context.browser, reduced_motion="no-preference")
    other.goto(page.url)
    until(other, READY)
    assert other.evaluate("gapwalk.motion.machine.playing")
    other.context.close()
    page.reload()
    until(page, READY)


def test_texts_of_the_gallery_do_not_meet(page) -> None:
    """Chromium measures the letters, which the layout only estimates."""
    systems = {name: read_studies(CLUTCH.with_name(f"{name}.toml"))[0].system for name in EXAMPLES}
    measured = new_page(page.context.browser)
    for name, system in {**systems, "chain": chain(10)}.items():
        for width in (NARROW, WIDE):
            scene = scene_of(system, width)
            measured.set_content(f"<body style='margin:0'>{svg_of(scene)}")
            found = boxes(measured, "svg text")
            assert len(found) >= 3
            assert not any(overlap(a, b) for k, a in enumerate(found) for b in found[:k]), name
            assert all(x0 >= 0.0 and x1 <= width and y1 <= scene.height for x0, _, x1, y1 in found), name
    measured.close()

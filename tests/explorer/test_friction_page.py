"""Friction and rigid stops on the page: loops, modes, energy and loci, against closed forms, in Chromium too."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from playwright.sync_api import Page

import gapwalk as gw
from gapwalk.explorer.motion_panels import details_of, panels_of
from tests.dry.closed_forms import den_hartog
from tests.explorer.browser import boxes, choose_special, chromium, new_page, opened, overlap, until, watched
from tests.explorer.serving import serving

BRAKE = """\
title = "Den Hartog"
coordinates = ["x"]
stiffness = [1.0]

[[friction]]
name = "brake"
deflection = { x = 1.0 }
limit = 0.4

[[harmonic]]
amplitude = 1.0
acts_on = { x = 1.0 }

[study]
kind = "response"
parameter = "frequency"
from = 0.56
to = 0.52
measure = "half.x"
"""

MANY = """\
title = "Three elements"
coordinates = ["x", "y"]
mass = [1.0, 0.5]
stiffness = [[2.0, -1.0], [-1.0, 1.5]]
damping = [0.05, 0.05]
frequency = 0.8

[[friction]]
name = "a_brake_with_a_rather_long_name"
deflection = { y = 1.0 }
limit = 0.3

[[friction]]
name = "joint"
deflection = { x = 1.0 }
limit = 0.15
stiffness = 6.0

[[contact]]
name = "wall"
deflection = { x = 1.0 }
side = "positive"
clearance = 0.3
stiffness = "rigid"
restitution = 0.4

[[harmonic]]
amplitude = 1.2
acts_on = { x = 1.0 }

[study]
kind = "settle"
signal = "x"
"""


def a_brake(frequency: float) -> gw.Orbit:
    system = gw.System(
        ["x"],
        stiffness=[[1.0]],
        contacts=[gw.friction("brake", {"x": 1.0}, 0.4)],
        harmonics=[gw.Harmonic(1.0, {"x": 1.0})],
        frequency=frequency,
    )
    return gw.find_orbit(system)


def enclosed(contact: dict[str, Any]) -> float:
    """Area of a loop that is drawn."""
    x, y = np.array(contact["deflection"]), np.array(contact["force"])
    return abs(float(np.sum(0.5 * (y[1:] + y[:-1]) * np.diff(x))))


def test_the_loop_encloses_what_the_brake_dissipates_in_closed_form() -> None:
    orbit = a_brake(0.8)
    panels = panels_of(orbit, "x")
    (contact,) = panels["contacts"]
    exact = 4.0 * 0.4 * den_hartog(0.8, 0.4)
    # its corners are drawn: without samples beside them it would be off by 1e-3
    assert enclosed(contact) == pytest.approx(exact, rel=1e-6)
    assert contact["is"] == "friction"
    (lost,) = details_of(orbit, "x")["energy"]["losses"]
    assert lost == ["brake", "friction", pytest.approx(exact, rel=1e-9), pytest.approx(1.0, rel=1e-9)]
    assert panels["elements"]["shares"] == [{"slip +": pytest.approx(0.5), "slip -": pytest.approx(0.5)}]


def test_phases_cover_the_period_and_the_log_tells_where_they_begin() -> None:
    orbit = a_brake(0.3)  # it sticks
    panels = panels_of(orbit, "x")
    phases = panels["elements"]["phases"]
    assert [each[2] for each in phases] == [0.0, *(each[3] for each in phases[:-1])]
    assert phases[-1][3] == pytest.approx(1.0)
    began = [(entry["what"], entry["periods"]) for entry in panels["log"]]
    words = {"slip +": "slips +", "slip -": "slips -", "stick": "sticks"}
    assert began == [(words[mode], start) for _, mode, start, _ in phases[1:]]
    theta, rate = np.array(panels["theta"]), np.array(panels["v"]["x"])
    for _, mode, start, end in phases:
        inside = rate[(theta > start + 1e-5) & (theta < end - 1e-5)]
        assert np.all({"slip +": inside > 0.0, "slip -": inside < 0.0, "stick": inside == 0.0}[mode])


def test_a_rigid_stop_shows_its_rebound_and_what_it_takes() -> None:
    system = gw.System(
        ["x"],
        stiffness=[[1.0]],
        damping=[[0.1]],
        contacts=[gw.rigid_stop("wall", {"x": 1.0}, 1.0, restitution=0.8)],
        harmonics=[gw.Harmonic(0.5, {"x": 1.0})],
        frequency=1.0,
    )
    orbit = gw.find_orbit(system)
    panels = panels_of(orbit, "x")
    (contact,), theta = panels["contacts"], np.array(panels["theta"])
    ((_, at, before),) = panels["elements"]["strikes"]
    rate = np.array(contact["rate"])
    k = int(np.searchsorted(theta, at))
    np.testing.assert_allclose(rate[[k - 1, k]], [before, -0.8 * before], rtol=1e-4)
    losses = {kind: value for _, kind, value, _ in details_of(orbit, "x")["energy"]["losses"]}
    assert losses["impacts"] == pytest.approx(0.5 * (1.0 - 0.8**2) * before**2, rel=1e-9)
    assert [entry["what"] for entry in panels["log"]] == ["is struck"]


def test_harmonic_balance_shows_its_phases_and_says_why_it_has_no_energy() -> None:
    system = gw.System(
        ["x"],
        stiffness=[[1.0]],
        damping=[[0.05]],
        contacts=[gw.friction("joint", {"x": 1.0}, 0.3, stiffness=5.0)],
        harmonics=[gw.Harmonic(1.0, {"x": 1.0})],
        frequency=0.8,
    )
    exact, balanced = gw.find_orbit(system), gw.find_orbit(system, method=gw.Balance())
    shown = panels_of(balanced, "x")["elements"]["shares"][0]
    assert shown == pytest.approx(panels_of(exact, "x")["elements"]["shares"][0], abs=1e-3)
    assert "refine it first" in details_of(balanced, "x")["energy"]["reason"]


@pytest.fixture(scope="module")
def workspace(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("friction")
    (folder / "brake.toml").write_text(BRAKE, encoding="utf-8")
    (folder / "many.toml").write_text(MANY, encoding="utf-8")
    return folder


@pytest.fixture(scope="module")
def page(workspace) -> Iterator[Page]:
    """The page of the server, with an ear for errors: there are none."""
    chromium()
    with serving(workspace / "brake.toml") as address, watched(address) as page:
        yield page


def settled(page: Page) -> None:
    """Show the motion of the system with three elements."""
    opened(page, "many.toml")
    if not page.evaluate("gapwalk.page.results.length"):
        page.click("#compute")
    until(page, "gapwalk.page.results[0]?.state === 'done' && document.querySelectorAll('#results button').length > 0")
    page.click("#results button:text-is('Show')")
    until(page, "Boolean(gapwalk.motion.details)")


def test_the_strip_shows_all_phases_and_the_machine_says_them(page) -> None:
    settled(page)
    elements = page.evaluate("gapwalk.motion.motion.elements")
    assert elements["names"] == ["wall", "a_brake_with_a_rather_long_name", "joint"]
    assert page.locator("#history rect.mode").count() == len(elements["phases"])
    assert page.locator("#history line.strike").count() == len(elements["strikes"]) > 0
    resting = [each for each in elements["phases"] if each[1] in ("stick", "held")]
    assert page.locator("#history rect.rest").count() == len(resting) > 0
    # in the middle of a stick, and in slip, the machine says so by word and by colour
    for mode, words, look in (("stick", "sticks", "sticks"), ("slip +", "slips +", "slips-forth")):
        row, _, start, end = max(
            (each for each in elements["phases"] if each[1] == mode), key=lambda each: each[3] - each[2]
        )
        middle = 0.5 * (start + end)
        page.evaluate(f"gapwalk.motion.machine.at(gapwalk.motion.motion.theta.findIndex((t) => t >= {middle}))")
        part = page.locator(f"#machine .part[data-words^='{elements['names'][row]}:']")
        assert part.locator(".m-state").text_content() == words
        assert look in str(part.get_attribute("class")).split()
    at = elements["strikes"][0][1]
    page.evaluate(f"gapwalk.motion.machine.at(gapwalk.motion.motion.theta.findIndex((t) => t >= {at}))")
    assert page.locator("#machine .part[data-words^='wall:'] .m-state").text_content() == "impact"


def test_each_element_can_be_chosen_and_the_table_adds_up(page) -> None:
    settled(page)
    for name in ("joint", "wall", "a_brake_with_a_rather_long_name"):
        page.select_option("#element", name)
        assert name in str(page.locator("#element-loop .title").first.text_content())
        assert page.inner_text("#element-figure figcaption") == ("Rigid stop" if name == "wall" else "Hysteresis loop")
    until(page, "Boolean(gapwalk.motion.details)")  # a job that ends shows its motion again
    (energy,) = page.evaluate("[gapwalk.motion.details.energy]")
    work, lost = (sum(each[2] for each in energy[side]) for side in ("work", "losses"))
    assert work == pytest.approx(lost, rel=1e-9)
    rows = [row.inner_text().split("\t") for row in page.locator("#energy tr:has(td)").all()]
    assert [row[:2] for row in rows] == [each[:2] for side in ("work", "losses") for each in energy[side]]
    (own,) = [each for each in energy["losses"] if each[0].startswith("a_brake")]
    assert float(page.inner_text("#element-facts dd >> nth=0")) == pytest.approx(own[2], rel=1e-3)
    # the force of an element as the signal chooses it
    page.select_option("#signal", "joint.force")
    until(page, "document.getElementById('element').value === 'joint'")


@pytest.mark.parametrize(("width", "height"), [(1280, 720), (390, 844)])
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_nothing_overlaps_and_nothing_is_cut_off(page, width, height, scheme) -> None:
    settled(page)
    page.emulate_media(color_scheme=scheme)
    page.set_viewport_size({"width": width, "height": height})
    page.wait_for_timeout(300)
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    figures = boxes(page, "#panels > *")
    assert not any(overlap(a, b) for i, a in enumerate(figures) for b in figures[:i])
    for chart in ("#history", "#element-loop", "#machine"):
        words = boxes(page, f"{chart} text")
        assert not any(overlap(a, b) for i, a in enumerate(words) for b in words[:i]), chart
    (strip,) = boxes(page, "#history svg")
    parts = boxes(page, "#history svg text, #history svg rect, #history svg line.strike")
    assert [a for a in parts if a[0] < strip[0] - 4 or a[2] > strip[2] + 4] == []
    page.emulate_media(color_scheme="light")
    page.set_viewport_size({"width": 1280, "height": 720})


def test_a_locus_of_sliding_has_a_line_of_its_own_on_the_closed_form(page) -> None:
    opened(page, "brake.toml")
    page.click("#compute")
    until(page, "gapwalk.page.results[0]?.state === 'done' && gapwalk.curves.all.size === 1")
    until(page, "document.querySelectorAll('#legend .of-point').length === 1")
    assert page.inner_text("#legend .of-point") == "crossing-sliding"
    choose_special(page, "crossing-sliding")
    until(page, "!document.getElementById('locus').disabled")
    page.select_option("#locus-parameter", "brake.limit")
    page.fill("#locus-low", "0.38")
    page.fill("#locus-high", "0.42")
    page.click("#locus")
    until(page, "gapwalk.page.results[1]?.state === 'done' && gapwalk.curves.hasLoci")
    assert page.locator("#legend .of-plane:visible").all_inner_texts() == ["locus of crossing-sliding"]
    # both axes at once: the curve may still grow
    curve = page.evaluate("(({ x, y }) => ({ x: [...x], y: [...y] }))(gapwalk.curves.subject()[0])")
    ratio, limit = np.array(curve["x"]), np.array(curve["y"])
    assert len(ratio) > 3
    # Den Hartog (1931): without stops as long as the friction is below this share of the force
    forced = 1.0 / (1.0 - ratio**2)
    damping = np.sin(np.pi / ratio) / (ratio * (1.0 + np.cos(np.pi / ratio)))
    np.testing.assert_allclose(limit, forced / np.sqrt(damping**2 + ratio**-4.0), rtol=1e-8)
    colour, dashes = (
        page.evaluate(f"document.querySelector('#legend .of-plane:not([hidden]) path').getAttribute('{each}')")
        for each in ("stroke", "stroke-dasharray")
    )
    others = page.locator("#legend .of-plane path").all()
    looks = [(each.get_attribute("stroke"), each.get_attribute("stroke-dasharray")) for each in others]
    assert looks.count((colour, dashes)) == 1
    assert len(set(looks)) == len(gw.Kind.with_locus())


def test_a_kept_page_has_loops_strips_and_energy(page, tmp_path) -> None:
    path = tmp_path / "brake.html"
    branch = gw.follow(a_brake(0.56), "frequency", to=0.52)
    gw.save_html(branch, path, motions=20)
    wrong: list[str] = []
    assert page.context.browser is not None
    kept = new_page(page.context.browser, offline=True)
    kept.on("pageerror", lambda error: wrong.append(str(error)))
    kept.goto(path.as_uri())
    until(kept, "Number(document.body.dataset.branches) === 1")
    assert kept.inner_text("#legend .of-point") == "crossing-sliding"
    kept.focus("#diagram")
    kept.keyboard.press("Home")
    until(kept, "document.querySelectorAll('#element-loop path.curve').length === 1")
    assert kept.locator("#history rect.mode").count() > 0
    exact = 4.0 * 0.4 * den_hartog(0.56, 0.4)
    assert enclosed(kept.evaluate("gapwalk.motion.motion.contacts[0]")) == pytest.approx(exact, rel=1e-3)
    assert float(kept.inner_text("#element-facts dd >> nth=0")) == pytest.approx(exact, rel=1e-3)
    assert kept.locator("#energy td").count() == 8
    assert wrong == []
